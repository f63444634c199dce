"""The cause of passes that do not meet their reference is named with its size; a right campaign has none."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from rf_pointing.calibration import RawTracking, TrackedPass
from rf_pointing.ephemeris import find_elements, site, verification_elements
from rf_pointing.station.campaign.recorded_input import reference_of
from rf_pointing.station.campaign.wrong_causes import away_m, cause_of, moved
from test.commands.planted_campaign import STATION, raw_passes

PLACE, CBERS = site(STATION), find_elements(verification_elements(), "28057")


def later(seconds: float) -> Callable[[RawTracking], RawTracking]:
    return lambda raw: dataclasses.replace(raw, t_s=raw.t_s + seconds)


def causes(change: Callable[[RawTracking], RawTracking], place=PLACE) -> str:
    changed = [change(raw) for raw in raw_passes()]
    passes = [TrackedPass(raw, reference_of(raw, [CBERS], place, 1e7)) for raw in changed]
    return cause_of(passes, [CBERS], place, "standard")


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        # Leap seconds in 2006: TAI - UTC is 33 s.
        (later(14.0), "the time tags are 14.0 s late: GPS time, which is 14 s ahead of UTC?"),
        (later(33.0), "the time tags are 33.0 s late: TAI"),
        (later(65.184), "the time tags are 65.2 s late: TT"),
        (later(-7.3), "the time tags are 7.3 s early (the"),
        (later(3600.0), "the time tags are 1 h ahead"),
        (later(-5.5 * 3600.0), "the time tags are 5.5 h behind"),
        (lambda raw: dataclasses.replace(raw, azimuth_rad=-raw.azimuth_rad), "the azimuth is counted counterclockwise"),
        (
            lambda raw: dataclasses.replace(raw, azimuth_rad=raw.elevation_rad, elevation_rad=raw.azimuth_rad),
            "azimuth and elevation are swapped",
        ),
        (
            lambda raw: dataclasses.replace(raw, elevation_rad=0.5 * np.pi - raw.elevation_rad),
            "the elevations are zenith distances",
        ),
    ],
)
def test_the_cause_is_named_with_its_size(change: Callable[[RawTracking], RawTracking], cause: str) -> None:
    assert causes(change).startswith(cause)


def test_a_wrong_place_is_named_and_a_right_campaign_has_no_cause() -> None:
    assert causes(later(0.0)) == ""
    found = causes(later(0.0), moved(PLACE, np.array([-16e3, 12e3, 100.0])))
    # The offsets of the mount are fitted too; its other terms are a part of a kilometre.
    assert found.startswith("the antenna is 20.0 km away from the site given: +16.0 km east, -12.0 km north")


def test_moving_a_site_is_undone_by_the_way_to_it() -> None:
    metres = np.array([3e3, -4e3, 200.0])
    assert away_m(PLACE, moved(PLACE, metres)) == pytest.approx(tuple(metres), abs=1e-6)
