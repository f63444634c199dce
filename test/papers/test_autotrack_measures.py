"""What the autotrack rows measure, on logs of no flight: flips, hold-offs, acquisitions, dropouts, averaging."""

import math
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.core import MDEG, MonopulseCluster, random_stream
from rf_pointing.papers import autotrack, sensors
from rf_pointing.papers.autotrack_cases import (
    Case,
    Changes,
    command_accelerations_rad_s2,
    moved_mount,
    reacquisitions_s,
)
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.simulation import PassLog

Array = NDArray[np.float64]
WINDOW = SimpleNamespace(aos_t_s=1000.0, duration_s=400.0)
START_S = 995.0


def log_of(modes: list[str], errors_rad: list[float] | None = None, step_s: float = 0.5) -> PassLog:
    """Return a log with these modes, one a step, and errors whose components are as 3 to 4."""
    size = np.zeros(len(modes)) if errors_rad is None else np.array(errors_rad)
    return PassLog(
        t_s=[START_S + step_s * k for k in range(len(modes))],
        cross_elevation_rad=(0.6 * size).tolist(),
        elevation_rad=(0.8 * size).tolist(),
        mode=list(modes),
        carrier_to_noise_db_hz=[45.0] * len(modes),
        command_t_s=[START_S + 0.1 * k for k in range(6)],
        command_rad=[(1e-4 * k**2, 5e-5 * k**3) for k in range(6)],
    )


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> list[Case]:
    """Return what was flown; every flight gives the log that `answer` makes of its case."""
    flown: list[Case] = []

    def fly(case: Case, _window: object, _heard: object = None) -> PassLog:
        flown.append(case)
        return answer(case)

    def answer(case: Case) -> PassLog:
        modes = ["search"] * 40 + ["monopulse"] * 44 + ["hand_back"] * 8
        if case.seed % 2:
            modes = modes[:84]
        return log_of(modes, [MDEG * k for k in range(len(modes))])

    monkeypatch.setattr(autotrack, "fly", fly)
    monkeypatch.setattr(autotrack, "low_orbit_pass", lambda *_: WINDOW)
    return flown


def test_a_flip_is_found_at_the_hold_off_after_it_with_the_largest_error_until_then(flights: list[Case]) -> None:
    # Forty seconds of flight are 80 steps; the hold-off is the 84th.
    found_s, largest = autotrack.flip_found_s("Ka", 2)
    assert (found_s, largest) == (pytest.approx(2.0), pytest.approx(84.0 * MDEG))
    assert autotrack.flip_found_s("X", 3) == (math.inf, pytest.approx(83.0 * MDEG))
    ka, x = flights
    assert (ka.band, ka.sensor, ka.seconds, ka.seed) == ("Ka", "monopulse", 46.0, 2)
    assert ka.changes["rf_receiver"] == {
        "signal.sign_flip_after_s": 40.0, "signal.link.zenith_carrier_to_noise_db_hz": 45.0,
        "signal.link.reference_range_m": 1.1e6,
    }  # fmt: skip
    assert x.changes == {"rf_receiver": {"signal.sign_flip_after_s": 40.0}}


def test_a_hold_off_before_the_flip_does_not_find_it(monkeypatch: pytest.MonkeyPatch, flights: list[Case]) -> None:
    monkeypatch.setattr(autotrack, "fly", lambda *_: log_of(["monopulse"] * 70 + ["hand_back"] * 20))
    assert autotrack.flip_found_s("Ka", 1) == (math.inf, math.inf)


def test_passes_with_a_hold_off_are_counted(flights: list[Case]) -> None:
    assert autotrack.doubted_passes([1, 2, 3, 4, 6]) == 3
    assert {(case.band, case.sensor, case.seconds) for case in flights} == {("Ka", "monopulse", 600.0)}
    assert [case.seed for case in flights] == [1, 2, 3, 4, 6]


def test_the_row_of_flips_is_the_slowest_of_all_and_that_of_doubts_their_number(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(autotrack, "flip_found_s", lambda band, seed: (0.3 * seed + (band == "X"), MDEG * seed))
    monkeypatch.setattr(autotrack, "doubted_passes", lambda seeds: sum(seeds))
    slowest, doubted = autotrack.watch_rows(2)
    # Five flips at Ka with seeds 2 to 6, three at X with 2 to 4; two long passes with 2 and 3.
    assert (slowest.ours, slowest.paper, slowest.bound) == (pytest.approx(2.2), 2.0, "<=")
    assert "88% within 2 s" in slowest.remark
    assert "at most 4.0 mdeg" in slowest.remark
    assert (doubted.ours, doubted.paper, doubted.tolerance) == (5.0, 0.0, 0.0)


def test_radial_rms_counts_one_mode_from_a_time_on() -> None:
    log = log_of(["monopulse", "coast", "monopulse", "monopulse"], [9.0 * MDEG, 5.0 * MDEG, 3.0 * MDEG, 4.0 * MDEG])
    assert autotrack.radial_rms_mdeg(log, "monopulse", START_S + 1.0) == pytest.approx(math.sqrt(12.5))
    assert autotrack.radial_rms_mdeg(log, "coast", 0.0) == pytest.approx(5.0)
    assert autotrack.radial_rms_mdeg(log, "conscan", 0.0) == math.inf


def test_the_ka_row_counts_from_25_s_after_the_start_of_the_pass(flights: list[Case]) -> None:
    row = autotrack._ka_row(1)
    # The 60th step is 1025 s, the last one the 83rd.
    assert row.ours == pytest.approx(math.sqrt(np.mean(np.arange(60.0, 84.0) ** 2)))
    assert (row.paper, row.bound, row.tolerance) == (2.0, "<=", 0.0)
    assert "acquired 15.0 s" in row.remark
    (case,) = flights
    assert (case.band, case.sensor, case.seconds, case.seed) == ("Ka", "monopulse", 90.0, 1)
    assert set(case.changes) == {"rf_receiver", "pointing_controller"}


def test_an_acquisition_is_three_beamwidths_off_in_its_direction(monkeypatch: pytest.MonkeyPatch) -> None:
    cases: list[Case] = []
    beam = HALF_POWER_BEAMWIDTH_RAD["X"]

    def fly(case: Case, _window: object) -> PassLog:
        cases.append(case)
        return log_of(["search"] * 20 + ["monopulse"] * 10, [beam] * 26 + [0.099 * beam] * 4)

    monkeypatch.setattr(autotrack, "fly", fly)
    assert autotrack.acquisition_s(WINDOW, 0.4, 7) == pytest.approx(8.0)  # type: ignore[arg-type]
    (case,) = cases
    assert case.changes["antenna_servo"] == moved_mount("X", 3.0 * beam * math.cos(0.4), 3.0 * beam * math.sin(0.4))
    assert case.changes["rf_receiver"] == {"source.along_track_offset_s": 0.0}
    assert (case.band, case.sensor, case.seconds, case.seed) == ("X", "monopulse", 45.0, 7)


def test_acquisition_rows_are_the_95th_percentile_of_twelve_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    directions: list[tuple[float, int]] = []

    def acquired(_window: object, angle_rad: float, seed: int) -> float:
        directions.append((angle_rad, seed))
        return 20.0 + seed

    masks: list[tuple[float, ...]] = []
    monkeypatch.setattr(autotrack, "acquisition_s", acquired)
    monkeypatch.setattr(autotrack, "low_orbit_pass", lambda *angles: masks.append(angles))
    rows = autotrack._acquisition_rows(3)
    assert masks == [(40.0, 5.0), (40.0, 40.0)]
    assert [seed for _, seed in directions] == 2 * list(range(3, 15))
    assert directions[0][0] == random_stream(3, "acquisition 5.0").uniform(0.0, 2.0 * math.pi)
    for row in rows:
        # The slowest of twelve: no less than 95 % are within it.
        assert (row.ours, row.paper, row.bound, row.tolerance) == (34.0, 30.0, "<=", 0.0)
        assert "67% of 12 directions within 30 s, median 28.5 s" in row.remark


def test_dropout_rows_count_the_reacquired_and_take_the_steepest_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def fly(case: Case, _window: object) -> PassLog:
        assert case.changes["rf_receiver"] == {
            "signal.dropouts.count": 10, "signal.dropouts.gap_s": 8.0, "signal.dropouts_after_s": 60.0,
            "signal.dropouts_within_s": 310.0,
        }  # fmt: skip
        log = log_of(["monopulse"] * 4 + ["coast"] * 4 + ["monopulse"] * (4 * (case.seed != 3)))
        log.carrier_to_noise_db_hz[4:6] = [0.0, 0.0]
        log.command_rad = [(2e-4 * case.seed * k**2, 0.0) for k in range(200)]
        log.command_t_s = [1000.0 + 0.1 * k for k in range(200)]
        return log

    monkeypatch.setattr(autotrack, "fly", fly)
    monkeypatch.setattr(autotrack, "low_orbit_pass", lambda *_: WINDOW)
    reacquired, steepest = autotrack._dropout_rows(1)
    assert (reacquired.ours, reacquired.paper, reacquired.tolerance) == (2.0, 30.0, 0.0)
    # Seed 3: 2 x 6e-4 rad in 0.1 s squared.
    assert steepest.ours == pytest.approx(math.degrees(0.12))
    assert (steepest.bound, steepest.tolerance) == ("<=", 1e-6)


def test_reacquisition_counts_from_the_return_of_the_carrier_to_the_mode() -> None:
    log = log_of(["monopulse"] * 3 + ["coast"] * 5 + ["monopulse"] * 4)
    log.carrier_to_noise_db_hz[4:6] = [0.0, -3.0]
    log.carrier_to_noise_db_hz[10:11] = [0.0]
    # Back at the 6th step, tracked at the 8th; then back at the 11th in the mode itself.
    assert reacquisitions_s(log, "monopulse").tolist() == [pytest.approx(1.0), 0.0]
    assert reacquisitions_s(log, "conscan").tolist() == [math.inf, math.inf]


def test_command_accelerations_are_second_differences_after_a_time() -> None:
    log = log_of(["monopulse"])
    found = command_accelerations_rad_s2(log, START_S + 0.15)
    # 1e-4 k^2 and 5e-5 k^3 a tenth of a second apart, from the second inner command on.
    assert found == pytest.approx(np.column_stack([[0.02] * 3, 0.03 * np.array([2.0, 3.0, 4.0])]))


def test_a_sample_alone_is_given_twice_20_ms_apart() -> None:
    cluster = MonopulseCluster(
        t_s=np.arange(5.0), sum=np.arange(5.0) + 1j, difference_cross_elevation=np.arange(5.0) * 2.0,
        difference_elevation=np.arange(5.0) * 3.0, carrier_to_noise_db_hz=40.0,
    )  # fmt: skip
    alone = autotrack._alone(cluster, 3)
    assert alone.t_s == pytest.approx([3.0, 3.02])
    assert alone.sum.tolist() == [3.0 + 1j] * 2
    assert alone.difference_cross_elevation.tolist() == [6.0] * 2
    assert alone.difference_elevation.tolist() == [9.0] * 2


def test_averaging_gains_seven_db_on_white_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    random, clusters = random_stream(2, "white samples"), 500
    log = log_of(["search"] * 10 + ["monopulse"] * (clusters + 100), step_s=0.1)
    t_s = np.array(log.t_s)
    log.cross_elevation_rad = (1e-5 * np.sin(t_s)).tolist()
    log.elevation_rad = (1e-5 * np.cos(t_s)).tolist()
    noise = 0.01 * random.standard_normal((2, len(t_s), 5))
    slope = autotrack.MonopulseTracker(
        autotrack.MonopulseParams(half_power_beamwidth_rad=HALF_POWER_BEAMWIDTH_RAD["Ka"])
    ).params.slope
    per_rad = slope / HALF_POWER_BEAMWIDTH_RAD["Ka"]

    def fly(case: Case, _window: object, heard: Callable[[object], None]) -> PassLog:
        assert (case.band, case.sensor, case.seconds, case.seed) == ("Ka", "monopulse", 100.0, 9)
        for k, begin in enumerate(t_s):
            times = begin + 0.02 * np.arange(5)
            # What is not to be counted is a hundred times as noisy.
            loud = 100.0 if begin <= t_s[10] + 10.0 else 1.0
            parts = 1e-5 * per_rad * np.array([np.sin(times), np.cos(times)]) + loud * noise[:, k]
            heard(SimpleNamespace(cluster=MonopulseCluster(
                t_s=times, sum=np.ones(5, dtype=complex), difference_cross_elevation=parts[0].astype(complex),
                difference_elevation=parts[1].astype(complex), carrier_to_noise_db_hz=60.0,
            )))  # fmt: skip
        return log

    monkeypatch.setattr(autotrack, "fly", fly)
    monkeypatch.setattr(autotrack, "low_orbit_pass", lambda *_: WINDOW)
    assert autotrack.station_gain_db({}, 9) == pytest.approx(10.0 * math.log10(5.0), abs=0.4)


@pytest.mark.parametrize(("white", "coloured", "accepted"), [(7.2, 8.5, True), (7.2, 8.1, False), (7.2, 25.0, False)])
def test_a_line_gains_more_than_noise_alone_and_less_than_the_line_alone(
    white: float, coloured: float, accepted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gain(changes: Changes, _seed: int) -> float:
        return coloured if "signal.interference.level_db_hz" in changes["rf_receiver"] else white

    monkeypatch.setattr(autotrack, "station_gain_db", gain)
    plain, line = autotrack.averaging_rows(1)
    assert (plain.ours, plain.paper, plain.tolerance) == (white, 7.0, 0.5)
    assert (line.ours, line.paper, line.tolerance, line.accepted) == (coloured, 17.0, 1.0, accepted)
    # A line of 12 Hz in samples of 20 ms: sin(5 x) / (5 sin x) at x = 0.24 pi.
    assert "takes out 15.3 dB" in line.remark


def tracked_log(band: str = "X") -> PassLog:
    modes = ["search"] * 100 + ["conscan"] * 20 + ["search"] * 30 + ["conscan"] * 500 + ["coast"] * 50
    size = HALF_POWER_BEAMWIDTH_RAD[band] * 0.1
    log = log_of(modes, step_s=0.1)
    turn = 2.0 * math.pi * np.arange(len(modes)) / 40.0
    log.cross_elevation_rad = (size * np.cos(turn)).tolist()
    log.elevation_rad = (size * np.sin(turn) + 0.5 * size).tolist()
    log.command_t_s, log.command_rad = list(log.t_s), [(0.0, 1e-4 * k**2) for k in range(len(modes))]
    return log


def test_a_tracked_pass_counts_from_20_s_after_the_first_mode_that_lasts(monkeypatch: pytest.MonkeyPatch) -> None:
    cases: list[Case] = []

    def fly(case: Case, _window: object) -> PassLog:
        cases.append(case)
        return tracked_log()

    monkeypatch.setattr(sensors, "fly", fly)
    monkeypatch.setattr(sensors, "low_orbit_pass", lambda *angles: WINDOW if angles == (40.0, 20.0) else None)
    found = sensors.tracked("X", "conscan", 4)
    assert (cases[0].band, cases[0].sensor, cases[0].seconds, cases[0].seed) == ("X", "conscan", 400.0, 4)
    # The mode of step 150 lasts: 1010 s, ten after the start of the pass.
    assert found.acquired_s == pytest.approx(10.0)
    size = 0.1 * HALF_POWER_BEAMWIDTH_RAD["X"]
    assert found.beam_rad == pytest.approx(size * math.sqrt(1.25), rel=0.01)
    # A turn takes the 4 s of a scan: the mean over it is the offset of the circle.
    assert found.centre_rad == pytest.approx(0.5 * size, rel=1e-9)
    assert found.share == pytest.approx(300.0 / 350.0)
    assert found.modes == ("conscan",)
    assert found.acceleration_rad_s2 == pytest.approx(0.02)
    # 12 (0.1 x beamwidth)^2 dB at a distance: the mean square distance is 1.25 of it.
    assert found.loss_db == pytest.approx(12.04 * 0.01 * 1.25, rel=0.03)
    row = sensors._row(found)
    assert (row.paper, row.bound, row.tolerance) == (8.0, "<=", 0.0)
    assert row.ours == pytest.approx(found.beam_rad / MDEG)


def test_a_pass_without_acquisition_is_a_row_that_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    short = ["search"] * 20 + ["conscan"] * 40 + ["search"] * 20
    monkeypatch.setattr(sensors, "fly", lambda *_: log_of(short, step_s=0.1))
    monkeypatch.setattr(sensors, "low_orbit_pass", lambda *_: WINDOW)
    found = sensors.tracked("Ka", "auto")
    assert found.acquired_s == math.inf
    assert found.share == 0.0
    assert not sensors._row(found).holds


def test_every_sensor_has_a_row_in_every_band(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensors, "tracked", lambda band, sensor, seed: sensors.Tracked(
        band, sensor, 3.0, seed * MDEG, MDEG, 0.1, 1.0, (), 0.1))  # fmt: skip
    rows = sensors.rows(5)
    assert len(rows) == 12
    assert rows[0].quantity.startswith("S monopulse")
    assert rows[-1].quantity.startswith("Ka auto")
    assert [row.ours for row in rows] == pytest.approx([5.0] * 12)
