"""Which passes a calibration tracks, how it goes on after an interruption, and the fit of what it has kept."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.calibration import CandidatePass, Observations, SectorRule, read_model
from rf_pointing.core.dates import parse_utc
from rf_pointing.station.campaign.calibrator import journal_of
from rf_pointing.station.campaign.plan import beacons
from rf_pointing.station.campaign.schedule import CampaignParams, fit_of_kept, schedule_calibration
from rf_pointing.station.description import read_station

START_S = parse_utc("2006-06-25T00:00:00")
SMALL = CampaignParams(longest_s=1200.0, fewest=10)


@pytest.fixture(scope="module")
def station() -> Any:
    return read_station("dss13")


@pytest.fixture(scope="module")
def sky() -> list[Any]:
    """Return every fifth beacon."""
    return beacons(START_S)[::5]


@pytest.fixture(scope="module")
def schedule(station: Any, sky: list[Any]) -> Any:
    return schedule_calibration(station, sky, START_S, SMALL)


def points_of(one: CandidatePass, number: int) -> Observations:
    """Return what a calibrator would have kept of a piece of a pass."""
    track = one.track
    return Observations(
        station="Goldstone DSS-13", band="X", t_s=track.t_s, pass_id=np.full(len(track.t_s), number),
        observed_azimuth_rad=track.azimuth_rad, observed_elevation_rad=track.elevation_rad,
        true_azimuth_rad=track.azimuth_rad, true_elevation_rad=track.elevation_rad,
        azimuth_rate_rad_s=track.azimuth_rate_rad_s, elevation_rate_rad_s=track.elevation_rate_rad_s,
        azimuth_acceleration_rad_s2=track.azimuth_acceleration_rad_s2,
        elevation_acceleration_rad_s2=track.elevation_acceleration_rad_s2,
        sigma_azimuth_rad=np.full(len(track.t_s), 1e-5), sigma_elevation_rad=np.full(len(track.t_s), 1e-5),
        range_m=track.range_m, range_rate_m_s=track.range_rate_m_s,
    )  # fmt: skip


def kept_in(folder: Path, parts: list[Observations]) -> Observations:
    journal = journal_of(folder, "Goldstone DSS-13", "X")
    for part in parts:
        journal.append(part)
    points = journal_of(folder, "Goldstone DSS-13", "X").points
    assert points is not None
    return points


def test_the_shadow_is_tracked_after_the_campaign(schedule: Any) -> None:
    assert schedule.windows[0].aos_t_s > START_S
    times = [t_s for one in schedule.windows[-1:] + schedule.acceptance_passes for t_s in (one.aos_t_s, one.los_t_s)]
    assert times == sorted(times)
    assert len(schedule.acceptance_passes) == 3
    assert str(schedule).startswith(f"{len(schedule.windows)} passes from 2006-06-25T00:")
    assert "; 3 more in the shadow until 2006-06-25T00:" in str(schedule)


def test_an_interrupted_campaign_goes_on_after_its_last_observation_where_the_sky_is_thin(
    station: Any, sky: list[Any], schedule: Any, tmp_path: Path
) -> None:
    whole = schedule.campaign
    done = whole.passes[: len(whole.passes) // 2]
    kept = kept_in(tmp_path, [points_of(one, number) for number, one in enumerate(done)])
    resumed = schedule_calibration(station, sky, START_S, SMALL, kept)
    before = SectorRule(fewest=10).coverage(kept.true_azimuth_rad, kept.true_elevation_rad)
    assert resumed.windows[0].aos_t_s > kept.t_s[-1]
    assert set(resumed.campaign.coverage.thin) < set(before.thin)
    for one in resumed.campaign.passes:
        seen = SectorRule(fewest=10).coverage(one.track.azimuth_rad, one.track.elevation_rad)
        assert any(seen.counts[sector] for sector in before.thin), "a piece that only fills what is full already"
    assert np.all(resumed.campaign.coverage.counts >= before.counts)


@pytest.mark.parametrize(
    ("params", "count", "complaint"),
    [
        (SMALL, 0, r"longest=1200\.0 s leaves no satellite to track"),
        (
            SMALL.replace(acceptance_passes=20, acceptance_span_s=60.0),
            90,
            "shadow=20: only 1 passes can be tracked after the campaign",
        ),
    ],
)
def test_a_sky_that_is_too_empty_is_refused(
    station: Any, sky: list[Any], params: CampaignParams, count: int, complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        schedule_calibration(station, sky[:count], START_S, params)


def test_the_fit_of_the_kept_observations_finds_a_planted_offset(station: Any, schedule: Any, tmp_path: Path) -> None:
    """An elevation encoder that reads 5 mdeg too much, besides the model in force."""
    planted = read_model(station.bias_model_file("X")).model
    planted = planted.replace(elevation_offset=planted.coefficients["elevation_offset"] + np.radians(0.005))
    parts = []
    for number, one in enumerate(schedule.campaign.passes):
        points = points_of(one, number)
        azimuth, elevation = planted.apply(*points.motion())
        parts.append(replace(points, observed_azimuth_rad=azimuth, observed_elevation_rad=elevation))
    kept_in(tmp_path, parts)
    points, fit = fit_of_kept(station, "X", str(tmp_path), 5.0)
    azimuth, elevation = fit.model.apply(*points.motion())
    assert np.degrees(np.abs(points.observed_elevation_rad - elevation)).max() < 1e-3
