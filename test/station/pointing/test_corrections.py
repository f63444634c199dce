"""What is added to the target on the sky: it goes on from where it is whatever the mode, and a coast knows what was learned.

From one path to another without a step, within the acceleration.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest

from rf_pointing.controllers import TrackerIntegratorParams
from rf_pointing.core import MDEG, Motion, PointingError, sky_offset_rad
from rf_pointing.planning import AxisRates, MachineParams
from rf_pointing.station.pointing.corrections import STEEPEST_RAD, OffsetTransition, PointingCorrections, added
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.scan_patterns import Scans
from rf_pointing.tracking import AutotrackState, SkyMotion, TrimFilter, TrimParams, direction_rows
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.scan import ScanParams as CircleParams

T_S = 1_151_384_000.0
PERIOD_S = 0.1
RANGE_M = 1e6
ROUNDING_RAD = 1e-9
"""A float resolves UTC seconds to 0.24 microseconds: an offset that moves is known to that share of it."""
PROBE = CircleParams(radius_rad=0.2 * MDEG, period_s=1.0, ramp_s=1.0)
MODES = ("monopulse", "conscan", "steptrack", "calibrate", "search", "coast", "hand_back", "program_track")
AXES = MachineParams().planned
CONSCAN = ConscanParams(period_s=4.0, ramp_s=2.0, updates="sample", sample_s=0.1, window_samples=40, fewest_samples=20)


def climbing(times: np.ndarray, elevation_rad: float = 0.9) -> Motion:
    azimuth_rate, climb, bend = 0.004, 0.003, np.array([3e-5, -4e-5])
    since = (times - T_S)[:, None]
    rate = np.array([azimuth_rate, climb])
    position = np.array([1.0, elevation_rad]) + rate * since + 0.5 * bend * since**2
    return Motion(position, rate + bend * since, np.tile(bend, (len(times), 1)))


class Loop:
    """Steps the offsets once a period, as the pointing controller does, with a beam that is where it is commanded."""

    def __init__(self, probe: CircleParams | None = None, sample_s: float = 0.1) -> None:
        sets = ControllerParams(conscan=CONSCAN)
        scans = Scans(sets.spiral, sets.calibration.scan, probe, sets)
        integrator = TrackerIntegratorParams(bandwidth_hz=0.2, sample_s=sample_s)
        self.offsets = PointingCorrections(integrator, scans, TrimParams())
        self.offsets.restart(T_S)
        self.mode, self.t_s = "program_track", T_S
        self.rows: list[np.ndarray] = []
        self.step("program_track")

    def step(
        self, mode: str, error: PointingError | None = None, beam: np.ndarray | None = None, *, carrier: bool = True
    ) -> np.ndarray:
        """Return offset and rate (10, 4) on the sky of the trajectory that this period issues."""
        self.t_s = round(self.t_s + PERIOD_S, 6)
        times = np.round(self.t_s + PERIOD_S * np.arange(1, 11), 6)
        state = AutotrackState(mode=mode, entered_s=self.t_s, carrier=carrier, strong=True)
        self.offsets.update(float(times[0]), self.mode, state, error, beam)
        self.mode = mode
        sky = climbing(times)
        corrected = self.offsets.add_corrections(times, sky, np.full(10, RANGE_M))
        moved = self.offsets.add_scan(times, corrected, AXES)
        cosine = np.cos(sky.position[:, 1])
        offset = (moved.position - sky.position) * np.column_stack([cosine, np.ones(10)])
        self.rows.append(offset[0])
        return np.column_stack([offset, (moved.velocity - sky.velocity) * np.column_stack([cosine, np.ones(10)])])

    def run(self, mode: str, seconds: float, truth: Callable[[float], np.ndarray] | None = None) -> np.ndarray:
        """Step through `seconds`; `truth(t_s)` is target minus prediction (2,) for a perfect sensor."""
        for _ in range(round(seconds / PERIOD_S)):
            error = beam = None
            if truth is not None:
                stamp_s = round(self.t_s - PERIOD_S, 6)
                # The last row is that of the next instant; the error is about the one before the present.
                beam = self.rows[-3] if len(self.rows) >= 3 else np.zeros(2)
                right, up = truth(stamp_s) - beam
                error = heard(stamp_s, float(right), float(up))
            out = self.step(mode, error, beam)
        return out


def heard(t_s: float, right_rad: float, up_rad: float, **changes: object) -> PointingError:
    values = {"t_s": t_s, "sensor": "monopulse", "cross_elevation_rad": right_rad, "elevation_rad": up_rad,
              "covariance_rad2": np.eye(2) * (0.2 * MDEG) ** 2, "carrier_to_noise_db_hz": 50.0}  # fmt: skip
    return PointingError(**{**values, **changes})


def beside(right_mdeg: float, up_mdeg: float) -> Callable[[float], np.ndarray]:
    return lambda _t_s: np.array([right_mdeg, up_mdeg]) * MDEG


def late(t_s: float) -> np.ndarray:
    """A target 50 ms ahead of its elements."""
    motion = climbing(np.array([t_s]))
    rate = motion.velocity[0] * np.array([math.cos(motion.position[0, 1]), 1.0])
    return np.asarray(direction_rows(SkyMotion(rate[0], rate[1], RANGE_M)) @ np.array([0.05, 0.0, 0.0, 0.0]))


def test_a_perfect_sensor_brings_the_offset_to_the_target() -> None:
    loop = Loop()
    loop.run("monopulse", 10.0, beside(5.0, -3.0))
    np.testing.assert_allclose(loop.rows[-1], [5 * MDEG, -3 * MDEG], atol=0.05 * MDEG)


def test_offsets_are_measured_on_the_sky() -> None:
    sky = climbing(np.array([T_S]))
    moved = added(sky, np.array([[5 * MDEG, -3 * MDEG]]), np.zeros((1, 2)))
    right, up = sky_offset_rad(*moved.position[0], *sky.position[0])
    assert float(right) == pytest.approx(5 * MDEG, abs=0.001 * MDEG)
    assert float(up) == pytest.approx(-3 * MDEG, abs=0.001 * MDEG)


@pytest.mark.parametrize("elevation_rad", [0.1, 0.9, 1.4])
def test_rates_of_the_sum_are_the_derivatives_of_its_positions(elevation_rad: float) -> None:
    step_s = 0.01
    times = T_S + 3.0 + step_s * np.arange(-1, 2)
    offset = np.column_stack([2e-4 * (times - T_S), -1e-4 * (times - T_S)])
    moved = added(climbing(times, elevation_rad), offset, np.tile([2e-4, -1e-4], (3, 1)))
    slope = (moved.position[2] - moved.position[0]) / (2.0 * step_s)
    np.testing.assert_allclose(moved.velocity[1], slope, atol=2e-6)


def test_close_to_the_zenith_the_azimuth_correction_stays_bounded() -> None:
    at_zenith = Motion(np.array([[1.0, math.radians(89.99)]]), np.zeros((1, 2)), np.zeros((1, 2)))
    moved = added(at_zenith, np.array([[5 * MDEG, 0.0]]), np.zeros((1, 2)))
    assert abs(moved.position[0, 0] - 1.0) <= 5 * MDEG / math.cos(STEEPEST_RAD) + 1e-12


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("before", ["monopulse", "conscan", "search", "steptrack"])
def test_no_change_of_mode_makes_the_command_jump(before: str, mode: str) -> None:
    """The rate that a trajectory states is that of its positions, across every change, and changes by no more than 0.5
    deg/s^2 allow."""
    loop = Loop(PROBE)
    loop.run("monopulse", 3.0, beside(9.0, -6.0))
    last = loop.run(before, 2.3)
    # The second instant of one trajectory is the first of the next.
    first = loop.step(mode)
    np.testing.assert_allclose(first[0, :2], last[1, :2], atol=2e-7)
    np.testing.assert_allclose(first[0, 2:], last[1, 2:], atol=2e-7)
    loop.run(mode, 3.9)
    offsets = np.array(loop.rows)
    rates = np.diff(offsets, axis=0) / PERIOD_S
    assert float(np.max(np.abs(np.diff(rates, axis=0)))) / PERIOD_S < math.radians(0.5)


@pytest.mark.parametrize("mode", ["conscan", "steptrack"])
def test_near_the_zenith_a_scan_is_as_large_as_the_azimuth_axis_allows(mode: str) -> None:
    """With 1.71 deg/s and 0.76 deg/s^2 a scan of 30 mdeg would need 8 deg/s^2 of azimuth at 89.5 deg."""
    sets = ControllerParams(conscan=CONSCAN.replace(radius_rad=30.0 * MDEG))
    offsets = PointingCorrections(
        TrackerIntegratorParams(), Scans(sets.spiral, sets.calibration.scan, None, sets), TrimParams()
    )
    offsets.restart(T_S)
    offsets.update(T_S, "coast", AutotrackState(mode=mode, carrier=True), None, None)
    times = T_S + 20.0 + 0.02 * np.arange(400)
    rows = {}
    for elevation_deg in (30.0, 80.0, 89.5):
        sky = Motion(*(np.tile([0.0, part], (len(times), 1)) for part in (math.radians(elevation_deg), 0.0, 0.0)))
        rows[elevation_deg] = offsets.add_scan(times, sky, AXES)
    rates = {key: np.abs(motion.velocity[:, 0]) for key, motion in rows.items()}
    bends = {key: np.abs(np.gradient(motion.velocity[:, 0], 0.02)) for key, motion in rows.items()}
    assert np.ptp(rows[30.0].position[:, 1]) > 1.0 * MDEG
    for key in rows:
        assert rates[key].max() <= 1.01 * AXES.rate_rad_s[0]
        assert bends[key].max() <= 1.01 * AXES.acceleration_rad_s2[0], key
    low = Motion(*(np.tile([0.0, part], (len(times), 1)) for part in (math.radians(30.0), 0.0, 0.0)))
    unlimited = offsets.add_scan(times, low, AxisRates((9.0, 9.0), (99.0, 99.0)))
    np.testing.assert_array_equal(rows[30.0].position, unlimited.position)
    # What the next mode takes out is the scan as small as it was, in place and speed.
    high = Motion(*(np.tile([0.0, part], (len(times), 1)) for part in (math.radians(89.5), 0.0, 0.0)))
    last = offsets.add_scan(times, high, AXES)
    offsets.update(float(times[200]), mode, AutotrackState(mode="coast", carrier=True), None, None)
    first = offsets.add_scan(times[200:], Motion(*(part[200:] for part in high)), AXES)
    np.testing.assert_allclose(first.position[0], last.position[200], atol=1e-9)
    np.testing.assert_allclose(first.velocity[0, 1], last.velocity[200, 1], atol=1e-4 * AXES.rate_rad_s[1])


def test_a_coast_follows_the_ephemeris_error_that_was_learned() -> None:
    loop = Loop()
    loop.run("monopulse", 40.0, late)
    held, grown = late(loop.t_s), late(loop.t_s + 10.0)
    loop.run("coast", 10.0)
    assert np.linalg.norm(loop.rows[-1] - grown) < 0.25 * np.linalg.norm(held - grown)


def test_the_filter_moves_trim_and_residual_but_not_their_sum() -> None:
    loop = Loop()
    out = loop.run("monopulse", 8.0, late)
    same = loop.step("monopulse", None, None)
    assert loop.offsets.filter.state.used > 0
    np.testing.assert_allclose(same[0, :2], out[1, :2], atol=0.05 * MDEG)


def test_one_error_is_used_once() -> None:
    loop, same = Loop(), heard(T_S, 1 * MDEG, 0.0)
    loop.step("monopulse")
    for _ in range(8):
        loop.step("monopulse", same, None)
    assert loop.rows[-1][0] == pytest.approx(2.0 * math.pi * 0.2 * PERIOD_S * MDEG, rel=1e-3)


def test_hand_back_forgets_what_a_false_lock_taught() -> None:
    loop = Loop()
    loop.run("monopulse", 10.0, beside(5.0, -3.0))
    loop.run("hand_back", 6.0)
    np.testing.assert_allclose(loop.rows[-1], [0.0, 0.0], atol=ROUNDING_RAD)
    assert loop.offsets.filter.state.used == 0


def test_deliberate_displacement_is_not_taken_for_an_error() -> None:
    """From a search the beam is brought to the target in a blend: the loop does not fight it and does not overshoot."""
    loop, truth = Loop(), beside(40.0, 25.0)
    loop.run("search", 2.0)
    loop.run("search", 0.5, truth)
    loop.run("monopulse", 6.0, truth)
    away = np.array(loop.rows[-60:]) - np.array([40.0, 25.0]) * MDEG
    assert float(np.max(np.hypot(*away[25:].T))) < 1.5 * MDEG


@pytest.mark.parametrize("mode", ["monopulse", "conscan", "steptrack", "coast"])
def test_a_search_hands_over_the_place_of_the_strongest_carrier(mode: str) -> None:
    loop = Loop()
    loop.run("search", 1.0)
    for k, level_db_hz in enumerate((30.0, 45.0, 40.0)):
        weak = heard(loop.t_s, 0.0, 0.0, valid=False, reason="off the axis", carrier_to_noise_db_hz=level_db_hz)
        loop.step("search", weak, np.array([k * 10 * MDEG, -k * 5 * MDEG]))
    loop.step(mode)
    loop.step(mode)
    np.testing.assert_allclose(loop.offsets.correction_rad(loop.t_s), [10 * MDEG, -5 * MDEG], atol=0.2 * MDEG)


def test_the_conscan_circle_has_its_radius_and_period() -> None:
    loop = Loop()
    loop.run("conscan", CONSCAN.ramp_s + 0.5)
    start = len(loop.rows)
    loop.run("conscan", CONSCAN.period_s)
    turn = np.array(loop.rows[start:])
    np.testing.assert_allclose(np.hypot(*turn.T), CONSCAN.radius_rad, rtol=1e-6)
    np.testing.assert_allclose(turn[-1], loop.rows[start - 1], atol=1e-8)


def test_the_probe_of_a_lock_is_circled_and_the_loop_does_not_fight_it() -> None:
    """Taken for an error of the centre, the circle would be followed by a seventh of itself."""
    loop = Loop(PROBE)
    loop.run("monopulse", 20.0, beside(0.0, 0.0))
    turn = np.array(loop.rows[-10:])
    np.testing.assert_allclose(np.hypot(*turn.T), PROBE.radius_rad, rtol=0.01)
    np.testing.assert_allclose(turn.mean(axis=0), [0.0, 0.0], atol=0.002 * MDEG)
    np.testing.assert_allclose(loop.offsets.correction_rad(loop.t_s), [0.0, 0.0], atol=0.002 * MDEG)


def test_a_new_pass_begins_without_an_offset_or_scan() -> None:
    loop = Loop()
    loop.run("monopulse", 5.0, beside(5.0, -3.0))
    loop.run("search", 1.0)
    loop.offsets.restart(loop.t_s)
    loop.mode = "program_track"
    np.testing.assert_array_equal(loop.step("program_track")[:, :2], np.zeros((10, 2)))


def test_over_the_top_the_errors_of_the_dish_turn_with_it_and_those_of_the_ephemeris_do_not() -> None:
    """What was learned as a bias changes its sign in elevation, as the axis does; there and back is what it was."""
    loop = Loop()
    loop.run("monopulse", 20.0, lambda _t_s: np.array([30.0, 50.0]) * MDEG)
    offsets, here = loop.offsets, climbing(np.array([loop.t_s]))
    before, other = (
        offsets.axis_offsets_rad(here, np.array([False]), RANGE_M),
        offsets.axis_offsets_rad(here, np.array([True]), RANGE_M),
    )
    mean = offsets.filter.state.mean.copy()
    offsets.turn_over(True)
    np.testing.assert_allclose(offsets.axis_offsets_rad(here, np.array([True]), RANGE_M), other, atol=1e-12)
    np.testing.assert_allclose(offsets.filter.state.mean, mean * [1.0, 1.0, 1.0, -1.0])
    ephemeris = (direction_rows(SkyMotion(*sky_rates(here), np.array([RANGE_M]))) @ (mean * [1.0, 1.0, 0.0, 0.0]))[0]
    assert before[0, 1] - ephemeris[1] == pytest.approx(ephemeris[1] - other[0, 1], abs=1e-9)
    offsets.turn_over(False)
    np.testing.assert_allclose(offsets.axis_offsets_rad(here, np.array([False]), RANGE_M), before, atol=1e-12)


def sky_rates(motion: Motion) -> np.ndarray:
    return (motion.velocity * np.column_stack([np.cos(motion.position[:, 1]), np.ones(len(motion.position))])).T


ACCELERATION = 400 * MDEG
TIMES = 100.0 + np.arange(0.0, 6.0, 0.01)


@pytest.mark.parametrize(
    ("right", "up", "rate"), [(200.0, -50.0, 150.0), (150.0, 120.0, 30.0), (0.0, 0.0, 80.0), (3.0, 1.0, 0.0)]
)
def test_it_starts_as_given_ends_at_rest_and_stays_within_the_acceleration(
    right: float, up: float, rate: float
) -> None:
    offset, speed = np.array([right, up]) * MDEG, np.array([0.6, 0.8]) * rate * MDEG
    blend = OffsetTransition.within(100.0, offset, speed, ACCELERATION)
    position, velocity = blend.at(TIMES)
    np.testing.assert_allclose(position[0], offset, atol=1e-12)
    np.testing.assert_allclose(velocity[0], speed, atol=1e-12)
    np.testing.assert_allclose(position[-1], [0.0, 0.0], atol=1e-15)
    acceleration = np.diff(velocity, axis=0) / 0.01
    assert float(np.max(np.hypot(*acceleration.T))) <= 1.01 * ACCELERATION


# Against the filter and the loop by themselves


def sky_at(t_s: float) -> SkyMotion:
    right, up = sky_rates(climbing(np.array([t_s])))
    return SkyMotion(float(right[0]), float(up[0]), RANGE_M)


def test_a_scan_teaches_the_filter_once_a_window_at_the_mean_time_of_its_samples() -> None:
    """And the loop with its own bandwidth: after every estimate the offset goes on by 2 pi f T e."""
    loop, alone, learned_s = Loop(), TrimFilter(TrimParams()), -math.inf
    loop.run("conscan", 5.0)
    age_s = CONSCAN.age_s
    bandwidth_hz, sample_s = CONSCAN.loop
    sensed, covariance = np.array([3.0, -2.0]) * MDEG, np.array([[400.0, 50.0], [50.0, 300.0]]) * MDEG**2
    for _ in range(120):
        stamp_s = round(loop.t_s - PERIOD_S, 6)
        then = loop.offsets.correction_rad(stamp_s)
        if stamp_s - learned_s >= 2.0 * age_s:
            learned_s = stamp_s
            alone.update(stamp_s - age_s, then + sensed, covariance, sky_at(stamp_s - age_s))
        loop.step("conscan", heard(stamp_s, *sensed, sensor="conscan", covariance_rad2=covariance), np.zeros(2))
    state = loop.offsets.filter.state
    assert state.used == alone.state.used >= 3
    assert state.t_s == pytest.approx(alone.state.t_s)
    np.testing.assert_allclose(state.covariance, alone.state.covariance, rtol=1e-4, atol=1e-18)
    np.testing.assert_allclose(state.mean, alone.state.mean, rtol=1e-3, atol=1e-12)
    before, last_s = loop.offsets.correction_rad(loop.t_s + PERIOD_S), loop.t_s
    loop.step("conscan")
    moved = loop.offsets.correction_rad(loop.t_s + PERIOD_S) - before
    # What the filter learned moves with the target meanwhile.
    rows = [direction_rows(sky_at(t_s + PERIOD_S)) for t_s in (last_s, loop.t_s)]
    drifted = (rows[1] - rows[0]) @ state.mean
    expected = 2.0 * math.pi * bandwidth_hz * min(PERIOD_S, sample_s or PERIOD_S) * sensed
    np.testing.assert_allclose(moved - drifted, expected, rtol=0.02, atol=1e-9)


def test_a_loop_that_loses_its_carrier_stands_from_the_next_command_on() -> None:
    """With errors once a second it would go on for a second."""
    for carrier in (True, False):
        loop = Loop(sample_s=1.0)
        loop.step("monopulse")
        loop.step("monopulse", heard(round(loop.t_s - PERIOD_S, 6), 4 * MDEG, 0.0))
        for _ in range(3):
            loop.step("monopulse", carrier=carrier)
        begin = loop.offsets.correction_rad(loop.t_s + PERIOD_S)[0]
        for _ in range(3):
            loop.step("monopulse", carrier=carrier)
        moved = loop.offsets.correction_rad(loop.t_s + PERIOD_S)[0] - begin
        assert moved == pytest.approx(0.3 * 2.0 * math.pi * 0.2 * 4 * MDEG if carrier else 0.0, abs=1e-9)
        assert begin > 0.3 * MDEG


def test_the_rates_of_the_corrections_are_the_slopes_of_their_places() -> None:
    """While the loop runs, the filter follows the target and a coast forgets."""
    for mode in ("monopulse", "coast"):
        loop = Loop()
        loop.run("monopulse", 12.0, late)
        loop.step("monopulse", heard(round(loop.t_s - PERIOD_S, 6), 9 * MDEG, -6 * MDEG))
        loop.step(mode)
        times = np.round(loop.t_s + PERIOD_S * np.arange(1, 11), 6)
        motion = loop.offsets.add_corrections(times, climbing(times), np.full(10, RANGE_M))
        slope = np.gradient(motion.position - climbing(times).position, times, axis=0, edge_order=2)
        rate = motion.velocity - climbing(times).velocity
        assert float(np.max(np.abs(rate[1:-1]))) > 1e-6
        np.testing.assert_allclose(rate[2:-2], slope[2:-2], atol=2e-7)
