"""From a tracked pass to calibration data: planted mount errors come back out of the fit."""

import dataclasses
import gc
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel, ObservationJournal, Observations
from rf_pointing.core import MDEG, JointReading, PointingError, Target
from rf_pointing.ephemeris import Pass, TopocentricTrack, find_passes
from rf_pointing.planning import plunged
from rf_pointing.station.campaign.log import CalibrationLog

NOISE_RAD = 1.0 * MDEG


def log(spacing_s: float = 5.0) -> CalibrationLog:
    return CalibrationLog("Goldstone DSS-13", "X", spacing_s, 2.0 * MDEG)


def tracked(
    into: CalibrationLog, track: TopocentricTrack, window: Pass, model: BiasModel, random: np.random.Generator
) -> None:
    """Track a pass 5 mdeg beside the target; the encoders read true + model, the sensor says how far off the beam is."""
    for t_s in np.arange(window.aos_t_s + 10.0, window.los_t_s - 10.0, 1.0):
        for ahead in (0.0, 1.0):
            into.take_target(track.target_at(float(t_s) + ahead))
        sky = track.target_at(float(t_s))
        azimuth, elevation = model.apply(
            sky.azimuth_rad, sky.elevation_rad, sky.azimuth_rate_rad_s, sky.elevation_rate_rad_s,
            sky.azimuth_acceleration_rad_s2, sky.elevation_acceleration_rad_s2,
        )  # fmt: skip
        right, up = 5.0 * MDEG, -3.0 * MDEG
        into.take_joints(
            JointReading(
                t_s=float(t_s),
                position_rad=[float(azimuth) - right / math.cos(float(elevation)), float(elevation) - up],
                velocity_rad_s=[sky.azimuth_rate_rad_s, sky.elevation_rate_rad_s],
            )
        )
        noise = NOISE_RAD * random.standard_normal(2)
        into.take_error(
            PointingError(
                t_s=float(t_s), sensor="monopulse", cross_elevation_rad=right + noise[0], elevation_rad=up + noise[1]
            )
        )


def test_planted_offsets_are_recovered_from_a_day_of_passes(
    track: TopocentricTrack, window: Pass, random: np.random.Generator
) -> None:
    planted = BiasModel.zero().replace(azimuth_offset=2.0e-3, elevation_offset=-1.5e-3)
    collected = log()
    passes = find_passes(track, window.aos_t_s - 60.0, 86400.0, math.radians(5.0))
    for one in passes:
        tracked(collected, track, one, planted, random)
    fitted = collected.fit(BiasModel.zero())
    for t_s in np.linspace(window.aos_t_s + 30.0, window.los_t_s - 30.0, 20):
        sky = track.target_at(float(t_s))
        motion = (
            sky.azimuth_rad, sky.elevation_rad, sky.azimuth_rate_rad_s, sky.elevation_rate_rad_s,
            sky.azimuth_acceleration_rad_s2, sky.elevation_acceleration_rad_s2,
        )  # fmt: skip
        wanted, got = planted.apply(*motion), fitted.model.apply(*motion)
        assert float(got[0] - wanted[0]) * math.cos(sky.elevation_rad) == pytest.approx(0.0, abs=1.0 * MDEG)
        assert float(got[1] - wanted[1]) == pytest.approx(0.0, abs=1.0 * MDEG)
    assert max(fitted.rms_rad()) < 1.3 * NOISE_RAD
    assert len(set(collected.observations().pass_id.tolist())) == len(passes)


def test_a_large_error_is_no_observation_and_the_lags_must_settle_again(track: TopocentricTrack, window: Pass) -> None:
    collected = CalibrationLog("s", "X", 0.5, 2.0 * MDEG, largest_error_rad=6.0 * MDEG, settle_s=10.0)
    start_s = window.tca_t_s
    for second in range(60):
        t_s, away = start_s + second, 20.0 * MDEG if second == 30 else 1.0 * MDEG
        for ahead in (0.0, 1.0):
            collected.take_target(track.target_at(t_s + ahead))
        sky = track.target_at(t_s)
        position = [sky.azimuth_rad, sky.elevation_rad]
        collected.take_joints(JointReading(t_s=t_s, position_rad=position, velocity_rad_s=[0.0, 0.0]))
        collected.take_error(PointingError(t_s=t_s, sensor="monopulse", cross_elevation_rad=away, elevation_rad=0.0))
    seconds = np.round(collected.observations().t_s - start_s).tolist()
    assert seconds == [*range(10, 30), *range(41, 60)]


def test_an_observation_every_second_takes_less_than_a_megabyte_an_hour(track: TopocentricTrack, window: Pass) -> None:
    collected = CalibrationLog("s", "X", 1.0, 2.0 * MDEG)
    sky = track.target_at(window.tca_t_s)
    position = [sky.azimuth_rad, sky.elevation_rad]

    def observe(seconds: range) -> None:
        for second in seconds:
            t_s = float(second)
            for ahead in (0.0, 1.0):
                collected.take_target(dataclasses.replace(sky, t_s=t_s + ahead))
            collected.take_joints(JointReading(t_s=t_s, position_rad=position, velocity_rad_s=[0.0, 0.0]))
            collected.take_error(
                PointingError(t_s=t_s, sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=1e-9 * second)
            )

    def taken() -> int:
        # Free lists are emptied by a full collection; threads that other tests left take memory, too.
        gc.collect()
        ours = [tracemalloc.Filter(True, f"*/{room}/*") for room in ("station/campaign", "calibration", "core")]
        return sum(each.size for each in tracemalloc.take_snapshot().filter_traces(ours).traces)

    tracemalloc.start()
    # The buffers of targets are full after their time.
    observe(range(100))
    before = taken()
    observe(range(100, 600))
    after = taken()
    tracemalloc.stop()
    assert len(collected) == 600
    assert np.array_equal(collected.observations().t_s, np.arange(600.0))
    assert 3600 / 500 * (after - before) < 1e6


CIRCLE_RAD = 30.0 * MDEG


@pytest.mark.parametrize(("sensor", "over"), [("conscan", False), ("steptrack", False), ("conscan", True)])
def test_planted_offset_is_recovered_from_scans_whose_encoders_circle_and_whose_errors_come_late(
    track: TopocentricTrack, window: Pass, random: np.random.Generator, sensor: str, over: bool
) -> None:
    """The other tracker's errors arrive between them, with other stamps; once the dish is over the top."""
    planted = BiasModel.zero().replace(azimuth_offset=2.0e-3, elevation_offset=-1.5e-3)
    collected = CalibrationLog(
        "s", "X", 1.0, 1.0 * MDEG, scan_spacing_s=4.0, largest_error_rad=8.0 * MDEG, settle_s=5.0
    )
    for t_s in np.arange(window.aos_t_s + 10.0, window.los_t_s - 10.0, 0.1).tolist():
        sky = track.target_at(t_s)
        collected.take_target(track.target_at(t_s + 1.0))
        motion = (
            np.array([sky.azimuth_rad, sky.elevation_rad]),
            np.array([sky.azimuth_rate_rad_s, sky.elevation_rate_rad_s]),
            np.array([sky.azimuth_acceleration_rad_s2, sky.elevation_acceleration_rad_s2]),
        )
        azimuth, elevation = planted.apply(*np.concatenate(plunged(*motion) if over else motion).tolist())
        right, up = 5.0 * MDEG, -3.0 * MDEG
        # Over the top upward on the sky is downward on the axis.
        upward = -up if over else up
        turn = 2.0 * math.pi if over else 0.0
        centre = np.array([float(azimuth) - turn - right / abs(math.cos(float(elevation))), float(elevation) - upward])
        collected.take_status(t_s, centre, np.zeros(2), sensor, sensor)
        around = CIRCLE_RAD * np.array([math.cos(1.6 * t_s), math.sin(1.6 * t_s)])
        collected.take_joints(JointReading(t_s=t_s, position_rad=centre + around, velocity_rad_s=[0.0, 0.0]))
        for name, age_s in ((sensor, 0.15), ("monopulse", 0.04)):
            noise = 0.3 * MDEG * random.standard_normal(2)
            error = PointingError(
                t_s=t_s - age_s, sensor=name, cross_elevation_rad=right + noise[0], elevation_rad=up + noise[1]
            )
            collected.take_error(error)
    points = collected.observations()
    assert len(points) == pytest.approx((window.duration_s - 25.0) / 4.05, abs=3)
    wanted_az, wanted_el = planted.apply(
        points.true_azimuth_rad, points.true_elevation_rad, points.azimuth_rate_rad_s, points.elevation_rate_rad_s,
        points.azimuth_acceleration_rad_s2, points.elevation_acceleration_rad_s2,
    )  # fmt: skip
    across = (points.observed_azimuth_rad - wanted_az) * np.cos(points.true_elevation_rad)
    assert np.max(np.abs(np.mean([across, points.observed_elevation_rad - wanted_el], axis=1))) < 0.2 * MDEG
    assert np.max(np.abs([across, points.observed_elevation_rad - wanted_el])) < 2.0 * MDEG
    assert "errors: the beam scans" in collected.reasons()
    assert bool(np.all(points.true_elevation_rad > 0.5 * math.pi)) is over


def test_reasons_of_a_pass_without_observations_are_counted(track: TopocentricTrack, window: Pass) -> None:
    collected, t_s = log(), window.tca_t_s
    assert collected.reasons() == "no pointing error was received"
    for k in range(3):
        collected.take_error(
            PointingError(
                t_s=t_s + k, sensor="conscan", cross_elevation_rad=0.0, elevation_rad=0.0, valid=k > 0, reason="r"
            )
        )
    assert collected.reasons() == "2 errors: conscan does not track (mode unknown); 1 errors: not valid (r)"
    collected.begin_pass()
    assert collected.reasons() == "no pointing error was received"


def test_too_few_observations_are_refused() -> None:
    with pytest.raises(ValueError, match="0 observations, must have at least 30: track a pass with a sensor first"):
        log().fit(BiasModel.zero())


@pytest.mark.parametrize("why", ["invalid", "no joints", "old joints", "no target"])
def test_what_does_not_belong_together_is_no_observation(track: TopocentricTrack, window: Pass, why: str) -> None:
    collected, t_s = log(), window.tca_t_s
    target: Target = track.target_at(t_s)
    if why != "no target":
        collected.take_target(target)
    if why != "no joints":
        age_s = 0.5 if why == "old joints" else 0.0
        collected.take_joints(
            JointReading(
                t_s=t_s - age_s, position_rad=[target.azimuth_rad, target.elevation_rad], velocity_rad_s=[0.0, 0.0]
            )
        )
    collected.take_error(
        PointingError(t_s=t_s, sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=0.0, valid=why != "invalid")
    )
    assert len(collected) == 0


def test_a_full_disk_loses_no_observation_and_is_told(
    track: TopocentricTrack, window: Pass, random: np.random.Generator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it does not take waits in memory, and follows in order when there is room again."""
    place = tmp_path / "observations.csv"
    kept = CalibrationLog(
        "Goldstone DSS-13", "X", 5.0, 2.0 * MDEG, journal=ObservationJournal(place, "Goldstone DSS-13", "X")
    )
    whole = ObservationJournal.append
    room = iter([True] * 4 + [False] * 3 + [True] * 1000)

    def append(self: ObservationJournal, points: Observations) -> None:
        if not next(room):
            raise OSError(28, "No space left on device")
        whole(self, points)

    monkeypatch.setattr(ObservationJournal, "append", append)
    problems = []
    take = kept.take_error

    def watched(error: PointingError) -> Observations | None:
        row = take(error)
        problems.append(kept.problem)
        return row

    monkeypatch.setattr(kept, "take_error", watched)
    tracked(kept, track, window, BiasModel.zero(), random)
    assert f"3 observations are in memory only: {place} cannot be written: No space left on device" in problems
    assert problems[-1] == ""
    written = ObservationJournal(place, "Goldstone DSS-13", "X").points
    assert written is not None
    np.testing.assert_allclose(written.t_s, kept.observations().t_s)


def test_a_new_campaign_does_not_begin_over_observations_that_are_in_memory_only(
    track: TopocentricTrack, window: Pass, random: np.random.Generator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = ObservationJournal(tmp_path / "observations.csv", "Goldstone DSS-13", "X")
    kept = CalibrationLog("Goldstone DSS-13", "X", 5.0, 2.0 * MDEG, journal=journal)

    def full(_points: Observations) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(journal, "append", full)
    tracked(kept, track, window, BiasModel.zero(), random)
    count = len(kept)
    with pytest.raises(ValueError, match=f"{count} observations are in memory only"):
        kept.begin_anew("old")
    assert len(kept) == count > 0


def test_a_new_campaign_keeps_the_old_ones_file_under_its_name(
    track: TopocentricTrack, window: Pass, random: np.random.Generator, tmp_path: Path
) -> None:
    journal = ObservationJournal(tmp_path / "observations.csv", "Goldstone DSS-13", "X")
    kept = CalibrationLog("Goldstone DSS-13", "X", 60.0, 2.0 * MDEG, journal=journal)
    tracked(kept, track, window, BiasModel.zero(), random)
    rows = (tmp_path / "observations.csv").read_text()
    kept.begin_anew("spring")
    assert len(kept) == 0
    (old,) = tmp_path.glob("*spring*")
    assert old.read_text() == rows
    assert not (tmp_path / "observations.csv").exists()
    # Without a journal there is nothing to rename.
    plain = log()
    plain.begin_anew("spring")
    assert len(plain) == 0
