"""A feed that is off the axis of the dish: axes by its model put its beam on the target, planned and simulated."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rf_pointing as rp
from rf_pointing.core import angular_distance_rad
from rf_pointing.planning.certificate_text import certificate_values
from rf_pointing.station.antenna.mount import SimulatedBeam
from rf_pointing.station.derive.axes import feed_model, kinematics_of
from rf_pointing.station.description import StationDescription, read_station
from rf_pointing.station.description.content import FeedOffsetSection

OFFSETS_DEG = st.floats(-4.9, 4.9)


def with_feed(name: str, right_deg: float, up_deg: float) -> StationDescription:
    """Return a shipped station whose mount has no errors but this feed for S."""
    own = read_station(name, ("antenna_servo", "pointing_controller"))
    feed = FeedOffsetSection(cross_elevation_deg=right_deg, elevation_deg=up_deg)
    bands = own.content.bands | {"S": replace(own.content.bands["S"], feed_offset=feed)}
    content = replace(own.content, bands=bands, simulation=replace(own.content.simulation, mount_errors={}))
    return StationDescription(own.path, content, own.mask, own.lines)


@pytest.mark.parametrize("name", ["leo_3m7", "xy_7m3"])
@settings(max_examples=20, deadline=None)
@given(
    right_deg=OFFSETS_DEG, up_deg=OFFSETS_DEG, azimuth_deg=st.floats(-170.0, 170.0), elevation_deg=st.floats(12.0, 75.0),
    over=st.booleans(),
)  # fmt: skip
def test_the_axes_of_its_model_put_the_beam_of_the_feed_on_the_target_over_the_back_too(
    name: str, right_deg: float, up_deg: float, azimuth_deg: float, elevation_deg: float, over: bool,
) -> None:  # fmt: skip
    station = with_feed(name, right_deg, up_deg)
    mount, still = kinematics_of(station.content), np.zeros(2)
    wanted = np.radians([azimuth_deg, elevation_deg])
    sky = np.array(mount.sky_at(*wanted)) if not mount.level else wanted
    if over and mount.level:
        wanted = np.array([wanted[0] + math.pi, math.pi - wanted[1]])
    axes = np.array([float(part) for part in feed_model(station.content, "S").apply(*wanted, *still, *still)])
    beam = SimulatedBeam(station.sets("antenna_servo", "S")["mount"], 5.0, 0.02, mount).boresight(0.0, axes, still)
    assert angular_distance_rad(beam.azimuth_rad, beam.elevation_rad, *sky) < 1e-9
    # By vectors of the dish: forward, right and up, from the angles of the axes alone.
    (sin_a, sin_e), (cos_a, cos_e) = np.sin(axes), np.cos(axes)
    (sin_c, sin_u), (cos_c, cos_u) = (f(np.radians([right_deg, up_deg])) for f in (np.sin, np.cos))
    forward, right = np.array([cos_e * sin_a, cos_e * cos_a, sin_e]), np.array([cos_a, -sin_a, 0.0])
    feed = cos_c * cos_u * forward + sin_c * right + cos_c * sin_u * np.cross(right, forward)
    target = np.array([math.cos(wanted[1]) * math.sin(wanted[0]), math.cos(wanted[1]) * math.cos(wanted[0]),
                       math.sin(wanted[1])])  # fmt: skip
    assert np.linalg.norm(feed - target) < 1e-9


def test_a_plan_certifies_the_axes_that_the_feed_needs_and_the_other_band_is_as_it_was() -> None:
    target, ranges = rp.elements("CBERS 2"), {}
    for band in ("S", "X"):
        station = rp.Station(with_feed("leo_3m7", 0.9, -0.6), band)
        (one, *_) = station.passes(target, start_t_s=target.first_t_s)
        values = certificate_values(station.certificates([one])[0].planned.certificate)
        ranges[band] = next(each for each in values["branches"] if each["chosen"])["elevation_range_deg"]
        plain = rp.Station("leo_3m7", band, model=feed_model(station.description.content, "X"))
        assert (station.model == plain.model) == (band == "X")
    assert np.subtract(ranges["S"], ranges["X"]) == pytest.approx([0.6, 0.6], abs=0.02)


def test_stations_with_other_feeds_are_not_the_same() -> None:
    assert with_feed("leo_3m7", 0.9, 0.0).digest != with_feed("leo_3m7", 0.8, 0.0).digest
