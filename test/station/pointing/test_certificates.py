"""Planning a day: passes above the horizon, the time to their starts, lags along the motion that is really made."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.ephemeris import Pass, TopocentricTrack, find_passes, sun
from rf_pointing.planning import AxisLimits, Certificate, GateParams, HorizonMask, MachineParams
from rf_pointing.station.antenna.mount import MountParams
from rf_pointing.station.pointing.certificates import PlanningRules, certificate_of, pass_profile, planned_certificate

DEG = math.pi / 180.0
RULES = PlanningRules(
    model=BiasModel.zero(), machine=MachineParams(), limits=AxisLimits(), mask=HorizonMask(), gate=GateParams(),
    lag_averaging_s=0.0,
)  # fmt: skip


def certificates(
    track: TopocentricTrack, start_t_s: float, span_s: float, place: tuple[float, float], rules: PlanningRules
) -> list[tuple[Pass, Certificate]]:
    windows = find_passes(track, start_t_s, span_s, rules.mask.above(5.0 * DEG))
    return [(window, planned_certificate(track, window, start_t_s, place, rules)[0]) for window in windows]


def test_a_hill_on_the_way_to_the_start_costs_the_time_over_it(track: TopocentricTrack, window: Pass) -> None:
    """From 5 deg on one side to 5 deg on the other with a hill of 40 deg between: up, across and down, each from rest."""
    at = window.aos_azimuth_rad
    hill = HorizonMask(
        azimuth_rad=tuple(sorted((at + x * DEG) % (2.0 * math.pi) for x in (20.0, 40.0, 60.0))),
        elevation_rad=(0.0, 40.0 * DEG, 0.0),
    )  # fmt: skip
    present, start_s = (at + 80.0 * DEG, 5.0 * DEG), window.aos_t_s - 300.0
    plain, over = (
        certificates(track, start_s, 1200.0, present, dataclasses.replace(RULES, mask=mask))[0][1].chosen
        for mask in (HorizonMask(), hill)
    )
    machine = RULES.machine
    legs = [machine.slew_s((0.0, a), (0.0, b)) for a, b in ((5.0 * DEG, 40.5 * DEG), (40.5 * DEG, 5.0 * DEG))]
    assert plain.preposition_s == pytest.approx(machine.slew_s(present, plain.start_rad), abs=1e-6)
    assert over.preposition_s == pytest.approx(plain.preposition_s + sum(legs), abs=0.5)


def test_passes_over_a_surveyed_horizon_can_be_tracked_by_a_mount_with_errors(track: TopocentricTrack) -> None:
    """They begin and end at it: the axes, 0.1 deg lower than the beam and 0.3 deg lower while it rises, stay above it."""
    horizon = HorizonMask(
        azimuth_rad=tuple(x * DEG for x in (0.0, 40.0, 90.0, 120.0, 180.0, 250.0, 300.0)),
        elevation_rad=tuple(x * DEG for x in (6.0, 8.0, 12.0, 7.0, 9.0, 15.0, 6.0)),
    )  # fmt: skip
    mount = MountParams(elevation_offset_rad=-0.1 * DEG, elevation_velocity_lag_s=-2.0).model()
    rules = dataclasses.replace(RULES, mask=horizon, model=mount)
    span = track.target.elements.epoch_t_s, 86400.0, (2.0, 1.0)
    planned = certificates(track, *span, rules)
    assert len(planned) == 5
    for window, certificate in planned:
        assert window.aos_elevation_rad > float(horizon.lowest_all(window.aos_azimuth_rad)) + 0.99 * DEG
        chosen = certificate.chosen
        assert chosen is not None, certificate.reason
        assert 0.5 * DEG < chosen.mask_margin_rad < 0.9 * DEG
    low = certificates(track, *span, dataclasses.replace(rules, mask=horizon.replace(clearance_rad=0.1 * DEG)))
    assert "deg below the horizon mask" in low[0][1].reason


def test_lags_of_the_mount_are_part_of_the_axes_path(track: TopocentricTrack, window: Pass) -> None:
    mount = MountParams(azimuth_velocity_lag_s=-1.0, elevation_velocity_lag_s=-2.0).model()
    profile = pass_profile(track, window)
    plain, lagging = (
        certificate_of(
            profile, dataclasses.replace(RULES, model=model, lag_averaging_s=5.0), window.aos_t_s, (2.5, 0.1)
        ).chosen
        for model in (BiasModel.zero(), mount)
    )
    moved = lagging.axes_rad - plain.axes_rad
    rates = profile.resampled().velocity_rad_s
    np.testing.assert_allclose(moved[0], 0.0, atol=1e-9)
    steady = slice(600, -1)
    np.testing.assert_allclose(moved[steady], (rates * [-1.0, -2.0])[steady], atol=0.06 * DEG)
    assert np.max(np.abs(moved)) > 0.3 * DEG


def test_a_profile_is_the_track_and_the_sun_at_its_times(track: TopocentricTrack, window: Pass) -> None:
    found = pass_profile(track, window, 30.0)
    solar = TopocentricTrack(sun(), track.site, refraction=track.refraction)
    for row, t_s in enumerate(found.t_s):
        look, there = track.target_at(float(t_s)), solar.target_at(float(t_s))
        near = look.azimuth_rad + 2.0 * math.pi * round((found.position_rad[row, 0] - look.azimuth_rad) / 2.0 / math.pi)
        np.testing.assert_allclose(found.position_rad[row], [near, look.elevation_rad], atol=1e-9)
        rates = [look.azimuth_rate_rad_s, look.elevation_rate_rad_s]
        np.testing.assert_allclose(found.velocity_rad_s[row], rates, atol=1e-10)
        bends = [look.azimuth_acceleration_rad_s2, look.elevation_acceleration_rad_s2]
        np.testing.assert_allclose(found.acceleration_rad_s2[row], bends, atol=1e-10)
        # Within a minute the Sun's path bends by less than 0.12 mdeg.
        off = found.sun_rad[row] - [there.azimuth_rad, there.elevation_rad]
        assert math.remainder(off[0], 2.0 * math.pi) == pytest.approx(0.0, abs=2e-6)
        assert off[1] == pytest.approx(0.0, abs=2e-6)
        assert found.range_m[row] == pytest.approx(look.range_m, abs=1e-3)
        assert found.satellite_gain_db[row] == pytest.approx(look.satellite_gain_db)
    assert found.name == window.name
