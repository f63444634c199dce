"""Which passes the rows of autotrack and of the sensors are flown on, and what is read off them, on flights planted."""

import math
from concurrent.futures import Executor, Future
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.core import MDEG
from rf_pointing.ephemeris import Pass
from rf_pointing.papers import autotrack, autotrack_cases, sensors
from rf_pointing.papers.autotrack_cases import Case, acquired_s, first_time_s, reacquisitions_s
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.simulation import PassLog

Array = NDArray[np.float64]
BEAM_X_RAD = HALF_POWER_BEAMWIDTH_RAD["X"]
WINDOW = Pass(
    name="one", aos_t_s=1000.4, tca_t_s=1200.0, los_t_s=1400.0, peak_elevation_rad=0.7, aos_azimuth_rad=0.5,
    aos_elevation_rad=0.3, los_azimuth_rad=2.5, azimuth_min_rad=0.2, azimuth_max_rad=2.6, peak_azimuth_rate_rad_s=0.01,
    peak_elevation_rate_rad_s=0.01, peak_azimuth_acceleration_rad_s2=1e-4, smallest_range_m=9e5, rises_before=False,
    sets_after=False,
)  # fmt: skip


def log_of(modes: list[str], errors_rad: list[float], begin_s: float = 995.0, step_s: float = 0.5) -> PassLog:
    """Return a log with these modes, one a step, and errors whose components are as 3 to 4."""
    size = np.array(errors_rad)
    return PassLog(
        t_s=[begin_s + step_s * k for k in range(len(modes))],
        cross_elevation_rad=(0.6 * size).tolist(),
        elevation_rad=(0.8 * size).tolist(),
        mode=modes,
        carrier_to_noise_db_hz=[45.0] * len(modes),
    )


def jerky_commands(log: PassLog, aos_t_s: float) -> PassLog:
    """Let the log command 0.4 rad/s^2 at 0.5 s and 0.1 rad/s^2 at 1.2 s after the start, and nothing else."""
    bends = np.zeros(40)
    bends[10 + 5], bends[10 + 12] = 4e-3, 1e-3
    log.command_t_s = [aos_t_s + 0.1 * (k - 10) for k in range(40)]
    azimuth = np.concatenate([[0.0], np.cumsum(np.cumsum(bends))[:-1]])
    log.command_rad = [(float(angle), 0.0) for angle in azimuth]
    return log


# Cases.


def test_a_low_pass_is_the_first_of_two_days_above_its_peak_and_mask(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(autotrack_cases, "load_elements", lambda _: SimpleNamespace(epoch_t_s=77.0))
    monkeypatch.setattr(autotrack_cases, "load_track", lambda _: "track")
    monkeypatch.setattr(autotrack_cases, "first_pass_above", lambda *args: asked.append(args))
    autotrack_cases.low_orbit_pass()
    autotrack_cases.low_orbit_pass(50.0, 10.0)
    forty, fifty, ten = (math.radians(degrees) for degrees in (40.0, 50.0, 10.0))
    assert asked == [("track", 77.0, forty, forty, 172800.0), ("track", 77.0, fifty, ten, 172800.0)]


@pytest.mark.parametrize(("seconds", "los_t_s"), [(30.0, 1030.4), (1e4, 1400.0)])
def test_a_case_starts_at_rest_on_the_first_point_of_its_pass(
    seconds: float, los_t_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[tuple[Any, ...]] = []
    monkeypatch.setattr(autotrack_cases, "StationSetup", lambda *args, **names: (*args, names))
    monkeypatch.setattr(autotrack_cases, "simulate_pass", lambda *args: flown.append(args) or "log")
    given = {"antenna_servo": {"mount.droop_deg": 0.1}, "pointing_controller": {"a": 1}}
    assert autotrack_cases.fly(Case("Ka", "conscan", seconds, given, 6), WINDOW, print) == "log"
    (((station, band, names), short, begin_s, sensor, heard),) = flown
    assert (station, band, sensor, heard) == ("dss13", "Ka", "conscan", print)
    assert short == replace(WINDOW, los_t_s=pytest.approx(los_t_s))
    # On a whole second, 5 s before the pass.
    assert begin_s == 995.0
    assert names["changes"] == {
        "antenna_servo": {
            "mount.droop_deg": 0.1, "antenna.start_azimuth_deg": pytest.approx(math.degrees(0.5)),
            "antenna.start_elevation_deg": pytest.approx(math.degrees(0.3)), "antenna.seed": 6,
        },
        "pointing_controller": {"a": 1},
        "rf_receiver": {"signal.seed": 6},
    }  # fmt: skip
    assert given == {"antenna_servo": {"mount.droop_deg": 0.1}, "pointing_controller": {"a": 1}}


def test_a_mount_moved_by_nothing_is_that_of_the_model_and_else_differs_in_two_angles() -> None:
    at_rest, moved = (autotrack_cases.moved_mount("X", *angles) for angles in ((0.0, 0.0), (0.01, -0.02)))
    known = autotrack_cases.read_model(autotrack_cases.model_file("X")).model.coefficients
    assert at_rest["mount.droop_deg"] == pytest.approx(math.degrees(known["droop"]))
    assert at_rest["mount.azimuth_velocity_lag_s"] == known["azimuth_velocity_lag"]
    differences = {name: value - at_rest[name] for name, value in moved.items() if value != at_rest[name]}
    assert differences == {
        "mount.collimation_deg": pytest.approx(math.degrees(0.01)),
        "mount.elevation_offset_deg": pytest.approx(math.degrees(-0.02)),
    }


def test_a_mode_is_entered_at_its_first_time_or_never() -> None:
    log = log_of(["search", "coast", "coast", "search"], [0.0] * 4)
    assert (first_time_s(log, "search"), first_time_s(log, "coast")) == (995.0, 995.5)
    assert first_time_s(log, "monopulse") == math.inf


@pytest.mark.parametrize(
    ("modes", "errors", "expected"),
    [
        (["monopulse"] * 3, [0.5] * 3, 995.0),
        (["search", "monopulse", "steptrack"], [0.5] * 3, 995.5),
        (["monopulse", "coast", "conscan", "conscan"], [0.5, 0.5, 1.5, 0.5], 996.5),
        (["monopulse", "monopulse", "coast"], [0.5] * 3, math.inf),
        (["monopulse", "monopulse"], [0.5, 1.5], math.inf),
        (["monopulse", "monopulse"], [1.5, 0.5], 995.5),
        ([], [], math.inf),
    ],
)
def test_a_target_is_acquired_when_it_is_held_from_then_on(
    modes: list[str], errors: list[float], expected: float
) -> None:
    assert acquired_s(log_of(modes, errors), 1.0) == expected


def test_a_weak_carrier_is_a_carrier() -> None:
    log = log_of(["monopulse"] * 4, [0.0] * 4)
    log.carrier_to_noise_db_hz = [45.0, 0.5, 0.0, 45.0]
    assert reacquisitions_s(log, "monopulse").tolist() == [0.0]
    log.carrier_to_noise_db_hz = [45.0, 0.5, 45.0, 45.0]
    assert reacquisitions_s(log, "monopulse").tolist() == []


# Rows.


def test_all_rows_of_autotrack_take_one_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    several = ("_acquisition_rows", "watch_rows", "averaging_rows", "_dropout_rows")
    for name in several:
        monkeypatch.setattr(autotrack, name, lambda seed, name=name: [(name, seed)])
    for name in ("_ka_row", "weak_conscan_row"):
        monkeypatch.setattr(autotrack, name, lambda seed, name=name: (name, seed))
    names = ["_ka_row", "_acquisition_rows", "weak_conscan_row", "watch_rows", "averaging_rows", "_dropout_rows"]
    assert autotrack.rows(3) == [(name, 3) for name in names]
    assert autotrack.rows() == [(name, 1) for name in names]


def test_long_passes_begin_at_5_deg_and_dropouts_at_10(monkeypatch: pytest.MonkeyPatch) -> None:
    passes: list[tuple[float, ...]] = []

    def fly(case: Case, window: Pass) -> PassLog:
        assert window is WINDOW
        log = jerky_commands(log_of(["monopulse"] * 8, [0.0] * 8), WINDOW.aos_t_s)
        log.carrier_to_noise_db_hz[3] = 0.0
        return log

    monkeypatch.setattr(autotrack, "fly", fly)
    monkeypatch.setattr(autotrack, "low_orbit_pass", lambda *angles: passes.append(angles) or WINDOW)
    assert autotrack.doubted_passes([1]) == 0
    found, steepest = autotrack._dropout_rows(1)
    assert passes == [(40.0, 5.0), (40.0, 10.0)]
    # The jerk of the start, within its first second, is no command of the pass.
    assert steepest.ours == pytest.approx(math.degrees(0.1))
    assert (found.ours, found.paper) == (3.0, 30.0)


@pytest.mark.parametrize(("held", "expected"), [(0.099, 2.1), (0.101, math.inf), (0.12, math.inf)])
def test_acquired_is_within_a_tenth_of_the_beamwidth(
    held: float, expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = log_of(["monopulse"] * 20, [BEAM_X_RAD] * 15 + [held * BEAM_X_RAD] * 5)
    monkeypatch.setattr(autotrack, "fly", lambda *_: log)
    assert autotrack.acquisition_s(WINDOW, 0.4, 7) == pytest.approx(expected)


def test_the_weak_conscan_is_of_the_first_degree_of_a_slow_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Any, ...]] = []
    flown: list[tuple[Case, Pass]] = []
    # Conscan begins at 1000 s; its third period ends at 1012 s, where the error is 1 mdeg.
    log = log_of(["search"] * 10 + ["conscan"] * 40, [MDEG * (9.0 if k < 34 else 1.0 + k % 2) for k in range(50)])
    log.carrier_to_noise_db_hz = [10.0] * 10 + [29.0, 31.5] * 20

    def first_pass(*args: object) -> Pass:
        asked.append(args)
        return WINDOW

    monkeypatch.setattr(autotrack, "load_elements", lambda source: SimpleNamespace(epoch_t_s=77.0, source=source))
    monkeypatch.setattr(autotrack, "load_track", lambda source: source.satellite)
    monkeypatch.setattr(autotrack, "first_pass_above", first_pass)
    monkeypatch.setattr(autotrack, "fly", lambda case, window: flown.append((case, window)) or log)
    row = autotrack.weak_conscan_row(5)
    assert asked == [("20413", 77.0, math.radians(45.0), math.radians(40.0), 172800.0)]
    ((case, window),) = flown
    assert window == replace(
        WINDOW, azimuth_min_rad=pytest.approx(0.5 - math.radians(1.0)),
        azimuth_max_rad=pytest.approx(0.5 + math.radians(1.0)),
    )  # fmt: skip
    assert (case.band, case.sensor, case.seconds, case.seed) == ("Ka", "conscan", 90.0, 5)
    link = {"link.zenith_carrier_to_noise_db_hz": 30.0, "link.reference_range_m": 9e5}
    assert case.changes == {
        "ephemeris_publisher": {"source.satellite": "20413"},
        "rf_receiver": {"source.satellite": "20413", **{f"signal.{name}": value for name, value in link.items()}},
        "pointing_controller": link,
    }
    assert row.ours == pytest.approx(math.sqrt(0.5 * (1.0 + 4.0)))
    assert (row.paper, row.bound, row.tolerance) == (2.0, "<=", 0.0)
    assert "30.2 dB-Hz measured" in row.remark


# Sensors.


class AtOnce(Executor):
    """An executor that notes what it shares out, and does it at once."""

    def __init__(self) -> None:
        self.shared: list[tuple[Any, ...]] = []

    def submit(self, work: Any, /, *args: Any, **_: Any) -> Future[Any]:
        self.shared.append(args)
        future: Future[Any] = Future()
        future.set_result(work(*args))
        return future


def test_the_passes_of_the_sensors_are_shared_out_where_there_is_an_executor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensors, "tracked", lambda *asked: asked)
    monkeypatch.setattr(sensors, "_row", lambda asked: asked)
    executor = AtOnce()
    assert sensors.rows(4, executor) == executor.shared == [
        (band, sensor, 4) for band in ("S", "X", "Ka") for sensor in ("monopulse", "conscan", "steptrack", "auto")
    ]  # fmt: skip
    assert {seed for _, _, seed in sensors.rows()} == {1}


def test_the_command_of_a_sensor_counts_from_a_second_after_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[Case] = []

    def fly(case: Case, window: Pass) -> PassLog:
        flown.append(case)
        log = log_of(["monopulse"] * 450, [0.1 * BEAM_X_RAD] * 450, step_s=0.1)
        log.mode[:60] = ["search"] * 60
        return jerky_commands(log, window.aos_t_s)

    monkeypatch.setattr(sensors, "fly", fly)
    monkeypatch.setattr(sensors, "low_orbit_pass", lambda *_: WINDOW)
    found = sensors.tracked("X", "monopulse", seconds=33.0)
    assert (flown[0].seconds, flown[0].seed) == (33.0, 1)
    assert found.acceleration_rad_s2 == pytest.approx(0.1)
    assert (found.share, found.modes, found.acquired_s) == (1.0, ("monopulse",), pytest.approx(0.6))
    # A tenth of a beamwidth, with half power at half of one.
    assert found.loss_db == pytest.approx(10.0 * math.log10(2.0) * 0.04, rel=1e-6)
    assert found.beam_rad == found.centre_rad == pytest.approx(0.1 * BEAM_X_RAD)


@pytest.mark.parametrize(
    ("modes", "expected"),
    [
        # A mode that began before the pass does not count, nor one of 5 s.
        (["conscan"] * 40, math.inf),
        (["search"] * 12 + ["conscan"] * 11 + ["search"] * 5 + ["steptrack"] * 11, math.inf),
        (["search"] * 12 + ["conscan"] * 11 + ["search"] * 5 + ["steptrack"] * 12, 1009.0),
        (["search"] * 12 + ["conscan"] * 12, 1001.0),
        (["search"] * 40, math.inf),
        (["search"] * 10 + ["conscan"] * 12, math.inf),
    ],
)
def test_a_radio_mode_lasts_from_more_than_5_s_on(modes: list[str], expected: float) -> None:
    assert sensors._lasting_s(log_of(modes, [0.0] * len(modes)), 1000.0) == expected
