"""What is commanded ahead of time: the target through the bias model, within the limits, and rest at the end.

Offsets led against the mount's lags: the simulated mount's beam goes where the offset says.
"""

import dataclasses
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.core import MDEG, JointReading, PointingError, nearest_turn_rad
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.planning import AxisLimits
from rf_pointing.station.antenna.mount import MountError, MountParams, RateAverage
from rf_pointing.station.pointing.motion import CorrectionLag
from rf_pointing.station.pointing.params import ControllerParams, PointingParams

SAME_RAD = 1e-9

Rig = Any
MakeRig = Callable[..., Rig]


def on_sky(track: TopocentricTrack, t_s: float, near_rad: float) -> np.ndarray:
    target = track.target_at(t_s)
    return np.array([nearest_turn_rad(target.azimuth_rad, near_rad), target.elevation_rad])


def test_program_track_commands_the_target_ahead_of_time(rig: MakeRig, window: Pass, track: TopocentricTrack) -> None:
    """Points from transport to horizon after the issue, a period apart; on the target to a nanoradian."""
    params = PointingParams()
    for t_s, trajectory, status in rig().run(window.aos_t_s, 8.0):
        assert trajectory is not None
        np.testing.assert_allclose(trajectory.t_s, t_s + np.arange(1, 11) * 0.1, atol=1e-6)
        assert trajectory.t_s[-1] - t_s == pytest.approx(params.horizon_s)
        assert status.command_lead_s >= 0.5
        for instant, position in zip(trajectory.t_s, trajectory.position_rad, strict=True):
            np.testing.assert_allclose(position, on_sky(track, float(instant), position[0]), atol=SAME_RAD)
    assert status.mode == "program_track"


def test_rates_and_accelerations_are_the_targets_own(rig: MakeRig, window: Pass, track: TopocentricTrack) -> None:
    *_, (t_s, trajectory, _) = rig().run(window.aos_t_s, 3.0)
    target = track.target_at(float(trajectory.t_s[4]))
    np.testing.assert_allclose(
        trajectory.velocity_rad_s[4], [target.azimuth_rate_rad_s, target.elevation_rate_rad_s], atol=1e-9
    )
    np.testing.assert_allclose(
        trajectory.acceleration_rad_s2[4],
        [target.azimuth_acceleration_rad_s2, target.elevation_acceleration_rad_s2],
        atol=1e-9,
    )
    assert t_s < trajectory.t_s[0]


def test_before_the_pass_the_antenna_waits_where_it_begins(rig: MakeRig, window: Pass) -> None:
    made = rig(start_s=window.aos_t_s - 60.0)
    for _, trajectory, status in made.run(window.aos_t_s - 60.0, 2.0):
        np.testing.assert_allclose(
            trajectory.position_rad, [[window.aos_azimuth_rad, window.aos_elevation_rad]] * 10, atol=SAME_RAD
        )
        assert not np.any(trajectory.velocity_rad_s)
        assert status.mode == "slew"


def test_the_pointing_model_in_force_is_added_to_the_command(
    rig: MakeRig, window: Pass, track: TopocentricTrack
) -> None:
    model = MountParams(azimuth_offset_rad=3e-3, droop_rad=-1e-3, elevation_velocity_lag_s=-1.5).model()
    made = rig()
    made.controller.take_model(model)
    *_, (_, trajectory, _) = made.run(window.aos_t_s, 2.0)
    target = track.target_at(float(trajectory.t_s[3]))
    wanted = model.apply(
        target.azimuth_rad, target.elevation_rad, target.azimuth_rate_rad_s, target.elevation_rate_rad_s,
        target.azimuth_acceleration_rad_s2, target.elevation_acceleration_rad_s2,
    )  # fmt: skip
    np.testing.assert_allclose(trajectory.position_rad[3, 1], wanted[1], atol=SAME_RAD)
    assert math.remainder(trajectory.position_rad[3, 0] - float(wanted[0]), 2.0 * math.pi) == pytest.approx(
        0.0, abs=SAME_RAD
    )


def test_predictions_of_another_satellite_are_ignored(rig: MakeRig, window: Pass) -> None:
    made = rig()
    list(made.run(window.aos_t_s, 2.0))
    other = dataclasses.replace(made.track.target_at(window.aos_t_s + 4.2), name="OTHER", elevation_rad=1.2)
    made.controller.take_target(other)
    trajectory, _ = made.period(round(window.aos_t_s + 2.1, 6))
    assert np.all(trajectory.position_rad[:, 1] < 0.2)


def test_a_limit_reached_in_the_middle_of_the_pass_is_waited_at_until_it_is_gone(rig: MakeRig, window: Pass) -> None:
    made, limit_rad = rig(), math.radians(6.0)
    wide = made.controller.params.limits
    list(made.run(window.aos_t_s, 5.0))
    made.controller.retune(made.controller.params.replace(limits=AxisLimits(elevation_max_rad=limit_rad)))
    waited = None
    for t_s, trajectory, status in made.run(window.aos_t_s + 5.0, 60.0):
        assert np.all(trajectory.position_rad[:, 1] <= limit_rad)
        if status.mode == "idle":
            assert "past the limit 6.000 deg" in status.reason
            assert trajectory.position_rad.shape == (1, 2)
            assert not np.any(trajectory.velocity_rad_s)
            waited = waited or t_s
    assert waited is not None
    assert status.mode == "idle"
    assert "past the limit 6.000 deg" in status.alarm
    made.controller.retune(made.controller.params.replace(limits=wide))
    *_, (_, _, status) = made.run(t_s, 20.0)
    assert (status.mode, status.held) == ("program_track", True)
    assert made.controller.statistics.outcome.lost_s < t_s - waited + 15.0


def test_an_antenna_just_outside_its_limit_is_not_deadlocked(rig: MakeRig, window: Pass) -> None:
    """It stands 0.0003 deg below the limit, on a rising pass: it tracks upwards and out of it."""
    made = rig()
    list(made.run(window.aos_t_s, 2.0))
    limit_rad = float(made.latest.position_rad[0, 1]) + math.radians(0.0003)
    made.controller.retune(made.controller.params.replace(limits=AxisLimits(elevation_min_rad=limit_rad)))
    *_, (_, trajectory, _) = made.run(window.aos_t_s + 2.0, 2.0)
    assert made.controller.busy
    assert trajectory.position_rad[0, 1] > limit_rad


def test_a_stop_commands_rest_where_the_axes_can_come_to_it(rig: MakeRig, window: Pass) -> None:
    made = rig()
    list(made.run(window.aos_t_s, 5.0))
    made.controller.stop("stop was requested")
    moving = made.latest.velocity_rad_s[0].copy()
    trajectory, status = made.period(round(window.aos_t_s + 5.1, 6))
    way = trajectory.position_rad[0] - made.position_rad
    deceleration = PointingParams().stop_deceleration_rad_s2
    np.testing.assert_allclose(way, moving * np.abs(moving) / (2.0 * deceleration), rtol=1e-3)
    assert not np.any(trajectory.velocity_rad_s)
    assert (status.mode, status.reason) == ("idle", "stop was requested")
    assert not made.controller.busy


PERIOD_S, TICK_S, AVERAGING_S = 0.1, 0.02, 5.0
MODEL = MountParams(azimuth_velocity_lag_s=-1.0, elevation_velocity_lag_s=-1.9).model()
START_RAD = np.array([1.0, 0.6])


def pulled_in(t_s: np.ndarray) -> np.ndarray:
    """195 mdeg down and half as much to the side within 2 s, as after a search."""
    share = np.clip(t_s / 2.0, 0.0, 1.0)
    return np.outer(share**3 * (10.0 - 15.0 * share + 6.0 * share**2), [100.0 * MDEG, -195.0 * MDEG])


def rates_at(t_s: np.ndarray) -> np.ndarray:
    return (pulled_in(t_s + 1e-4) - pulled_in(t_s - 1e-4)) / 2e-4


def beam_error_mdeg(averaging_s: float) -> float:
    """Largest distance of the simulated mount's beam from where the offset says, when commanded with the lead."""
    lag, mount, mean = CorrectionLag(averaging_s), MountError(MODEL), RateAverage(AVERAGING_S)
    worst, before = 0.0, START_RAD
    for period in range(300):
        times = PERIOD_S * (period + np.arange(3))
        offset = pulled_in(times)
        lead = lag.lead(times, rates_at(times), MODEL)
        for tick in range(5):
            share = tick / 5.0
            axes = START_RAD + (1.0 - share) * (offset + lead.position)[0] + share * (offset + lead.position)[1]
            t_s = float(times[0]) + tick * TICK_S
            beam = mount.remove(t_s, axes, mean.rate_rad_s, mean.acceleration_rad_s2)
            mean.update(TICK_S, (axes - before) / TICK_S + mount.drift_rad_s)
            before = axes
            wanted = START_RAD + pulled_in(np.array([t_s]))[0]
            worst = max(worst, float(np.max(np.abs(beam - wanted))) / MDEG)
    return worst


def test_the_beam_goes_where_it_was_sent_and_not_a_fifth_of_the_way_beside_it() -> None:
    assert beam_error_mdeg(0.0) > 30.0
    assert beam_error_mdeg(AVERAGING_S) < 4.0


def test_its_derivatives_belong_to_it_and_the_coming_leads_are_those_that_come() -> None:
    lag, found = CorrectionLag(AVERAGING_S), []
    for period in range(100):
        times = PERIOD_S * (period + np.arange(10))
        found.append(lag.lead(times, rates_at(times), MODEL))
    for earlier, later in pairwise(found):
        np.testing.assert_allclose(earlier.position[1:], later.position[:-1], atol=1e-12)
    position, velocity = np.array([(m.position[0], m.velocity[0]) for m in found]).transpose(1, 0, 2)
    steps = 0.5 * PERIOD_S * (velocity[1:] + velocity[:-1])
    np.testing.assert_allclose(np.diff(position, axis=0), steps, atol=0.02 * MDEG)


@pytest.mark.parametrize(("averaging_s", "model"), [(0.0, MODEL), (AVERAGING_S, BiasModel.zero())])
def test_without_lags_or_their_time_nothing_is_added(averaging_s: float, model: BiasModel) -> None:
    times = PERIOD_S * np.arange(10)
    for part in CorrectionLag(averaging_s).lead(times, rates_at(times), model):
        assert not part.any()


def test_a_new_pass_begins_at_rest() -> None:
    lag, times = CorrectionLag(AVERAGING_S), PERIOD_S * np.arange(10)
    for late_s in (0.0, 0.5, 1.0):
        lag.lead(times + late_s, rates_at(times + late_s), MODEL)
    lag.restart()
    assert not lag.lead(times + 100.0, np.full((10, 2), math.radians(0.1)), MODEL).position[0].any()


# What target and axes are, from one period to the next


def joints(t_s: float, position: np.ndarray, rate: tuple[float, float] = (0.0, 0.0)) -> JointReading:
    return JointReading(t_s=t_s, position_rad=position, velocity_rad_s=np.array(rate))


def test_rates_that_no_mount_has_are_taken_as_twice_its_largest(rig: MakeRig) -> None:
    motion = rig().controller._motion
    fastest = np.array(motion._plan.machine.axes.rate_rad_s)
    motion.take_joints(joints(1.0, np.ones(2), (9.0, -9.0)))
    np.testing.assert_allclose(motion.axes.velocity_rad_s, 2.0 * fastest * [1.0, -1.0])
    motion.take_joints(joints(1.1, np.ones(2), tuple(1.9 * fastest * [-1.0, 1.0])))
    np.testing.assert_allclose(motion.axes.velocity_rad_s, 1.9 * fastest * [-1.0, 1.0])


def test_axes_are_stopped_where_they_have_come_to_and_can(rig: MakeRig, window: Pass) -> None:
    """From the reading and its rate for a second; then from the trajectory that was issued."""
    made = rig()
    *_, (t_s, issued, _) = made.run(window.aos_t_s, 3.0)
    motion, deceleration = made.controller._motion, PointingParams().stop_deceleration_rad_s2
    place, rate = np.array([1.0, 0.5]), np.array([0.01, -0.02])
    motion.take_joints(joints(t_s, place, tuple(rate)))
    for late_s in (0.0, 0.3, 1.0):
        halt = motion.halt(t_s + late_s)
        stop = place + late_s * rate + rate * np.abs(rate) / (2.0 * deceleration)
        np.testing.assert_allclose(halt.position_rad, [stop], atol=1e-8)
        assert halt.t_s == pytest.approx([t_s + late_s + 0.1], abs=1e-6)
        assert not np.any(halt.velocity_rad_s)
        assert not np.any(halt.acceleration_rad_s2)
    motion.take_joints(joints(t_s - 0.6, place, tuple(rate)))
    row = int(np.argmin(np.abs(issued.t_s - (t_s + 0.5))))
    there, moving = issued.position_rad[row], issued.velocity_rad_s[row]
    stop = there + moving * np.abs(moving) / (2.0 * deceleration)
    np.testing.assert_allclose(motion.halt(t_s + 0.5).position_rad, [stop], atol=1e-12)
    motion._issued = None
    stop = place + 1.1 * rate + rate * np.abs(rate) / (2.0 * deceleration)
    np.testing.assert_allclose(motion.halt(t_s + 0.5).position_rad, [stop], atol=1e-8)
    motion.axes = None
    assert motion.halt(t_s) is None


def test_a_prediction_is_late_by_what_it_lacks_of_a_trajectory(rig: MakeRig, window: Pass) -> None:
    made = rig()
    *_, (t_s, _, _) = made.run(window.aos_t_s, 1.0)
    # Targets are known 2 s ahead, trajectories reach 1 s.
    for late_s, lacking_s in ((0.0, 0.0), (0.9, 0.0), (1.0, 0.0), (1.3, 0.3), (4.0, 3.0)):
        assert made.controller._motion.targets_late_s(t_s + late_s) == pytest.approx(lacking_s, abs=1e-5)


def test_the_centre_of_a_scan_is_known_at_the_time_of_the_encoders(rig: MakeRig, window: Pass) -> None:
    """On the target axes are on it; on a circle off it by its radius, with the lead of its lags on both."""
    made = rig()
    assert made.controller._motion.off_centre_rad() is not None
    *_, (t_s, _, _) = made.run(window.aos_t_s, 3.0)
    np.testing.assert_allclose(made.controller._motion.off_centre_rad(), 0.0, atol=1e-8)
    off = np.array([2e-3, -3e-3])
    made.controller._motion.take_joints(joints(t_s, made.position_rad + off))
    stretch = np.array([math.cos(made.position_rad[1] + off[1]), 1.0])
    np.testing.assert_allclose(made.controller._motion.off_centre_rad(), -off * stretch, atol=1e-8)
    given = ControllerParams()
    made = rig("conscan", pointing=given.pointing.replace(lag_averaging_s=0.5), integrator=given.integrator)
    made.controller.take_model(MODEL)

    def heard(t_s: float, _rig: Rig) -> list[PointingError]:
        return [
            PointingError(t_s=round(t_s - 0.1, 6), sensor="conscan", cross_elevation_rad=0.0, elevation_rad=0.0,
                covariance_rad2=1e-10 * np.eye(2), carrier_to_noise_db_hz=60.0)
        ]  # fmt: skip

    *_, (_, _, status) = made.run(window.aos_t_s, 20.0, heard)
    assert status.mode == "conscan"
    radius_rad = made.controller.params.conscan.radius_rad
    assert np.hypot(*made.controller._motion.off_centre_rad()) == pytest.approx(radius_rad, rel=0.01)


def test_without_axes_or_commands_no_centre_is_known(make_controller: Callable[..., Any]) -> None:
    motion = make_controller()._motion
    assert motion.off_centre_rad() is None
    motion.take_joints(joints(1.0, np.ones(2)))
    assert motion.off_centre_rad() is None
    np.testing.assert_array_equal(motion.centre_rad(1.0), [0.0, 0.0])
    motion._centres.add(5.0, np.ones(2))
    assert motion.off_centre_rad() is None, "that of a later time"


@pytest.mark.parametrize(("axis", "way"), [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)])
def test_the_slew_is_over_when_both_axes_will_be_within_the_tolerance(
    rig: MakeRig, window: Pass, axis: int, way: float
) -> None:
    """By where they are now: the reading is 40 ms old, and moves."""
    made = rig()
    *_, (t_s, _, _) = made.run(window.aos_t_s, 1.0)
    motion, tolerance_rad = made.controller._motion, PointingParams().on_target_rad
    centre, rate = motion.centre_rad(t_s), np.array([0.003, -0.004])
    for share, arrived in ((0.99, True), (1.01, False)):
        off = way * share * tolerance_rad * np.eye(2)[axis]
        motion.take_joints(joints(t_s - 0.04, centre + off - 0.04 * rate, tuple(rate)))
        assert motion.snapshot(t_s, window, None).on_target is arrived
    motion.take_joints(joints(t_s, centre))
    assert motion.snapshot(t_s, window, None).on_target
    assert not motion.snapshot(round(t_s + 5.0, 6), window, None).on_target, "nothing is commanded then"
    assert not motion.snapshot(t_s, dataclasses.replace(window, aos_t_s=t_s + 1.0), None).on_target


def test_distance_and_beam_are_told_of_now_and_of_the_newest_error(
    rig: MakeRig, window: Pass, track: TopocentricTrack
) -> None:
    made = rig()
    motion = made.controller._motion
    *_, (t_s, _, _) = made.run(window.aos_t_s, 2.0)
    error_s = round(t_s - 0.4, 6)
    found = motion.snapshot(t_s, window, error_s)
    assert found.target_available
    for path, at_s in ((found.path, t_s), (found.error_path, error_s)):
        assert path[0] == pytest.approx(track.target_at(at_s).range_m, abs=0.5)
        assert path[1] == pytest.approx(track.target_at(at_s).satellite_gain_db)
    assert abs(found.path[0] - found.error_path[0]) > 100.0
    np.testing.assert_allclose(found.beam_rad, [0.0, 0.0], atol=1e-8)
    alone = motion.snapshot(t_s, window, None)
    assert alone.beam_rad is None
    assert alone.error_path == alone.path == found.path
    # Known until 2 s ahead, and three points of a trajectory from 0.1 s on are needed.
    made.controller.plan.profile = None
    for later_s, available, known in ((1.69, True, True), (1.8, False, True), (2.3, False, False)):
        later = motion.snapshot(t_s + later_s, window, None)
        assert (later.target_available, later.path is not None) == (available, known)
        assert later.error_path is not None
    # Before the pass its beginning is always known, its distance is not.
    motion.targets.clear()
    early = motion.snapshot(t_s, dataclasses.replace(window, aos_t_s=t_s + 1.0), None)
    assert (early.target_available, early.path, early.error_path) == (True, None, None)
    assert not motion.snapshot(t_s, window, None).target_available


def test_the_profile_goes_on_where_the_prediction_ends(rig: MakeRig, window: Pass, track: TopocentricTrack) -> None:
    made = rig()
    *_, (t_s, _, _) = made.run(window.aos_t_s, 1.0)
    motion = made.controller._motion
    motion.snapshot(round(t_s + 0.9, 6), window, None)
    assert motion.targets.known_until_s == pytest.approx(t_s + 2.0), "long enough"
    motion.snapshot(round(t_s + 1.5, 6), window, None)
    assert t_s + 2.5 <= motion.targets.known_until_s <= t_s + 3.6
    at_s = t_s + 2.4
    np.testing.assert_allclose(motion.targets.at([at_s]).position[0, 1], track.target_at(at_s).elevation_rad, atol=1e-6)
    # Without any sample the nearest distance of the pass stands for it.
    motion.targets.clear()
    motion.snapshot(t_s, window, None)
    assert motion.targets.range_m(t_s) == pytest.approx(window.smallest_range_m)


def test_the_direction_on_the_sky_is_the_start_then_the_target_with_its_corrections(
    rig: MakeRig, window: Pass, track: TopocentricTrack
) -> None:
    made = rig()
    motion = made.controller._motion
    start = [window.aos_azimuth_rad, window.aos_elevation_rad]
    np.testing.assert_allclose(motion.sky_rad(window.aos_t_s - 1.0, window, np.ones(2)), start)
    *_, (t_s, _, _) = made.run(window.aos_t_s, 1.0)
    look, correction = track.target_at(t_s), np.array([2e-4, -3e-4])
    found = motion.sky_rad(t_s, window, correction)
    assert found[1] == pytest.approx(look.elevation_rad - 3e-4, abs=1e-8)
    moved = math.remainder(found[0] - look.azimuth_rad, 2.0 * math.pi)
    assert moved == pytest.approx(2e-4 / math.cos(look.elevation_rad), abs=1e-8)
    # Without a target, or a pass, it is what it was.
    for at_s, of in ((t_s + 60.0, window), (t_s, None)):
        np.testing.assert_array_equal(motion.sky_rad(at_s, of, np.zeros(2)), found)


def test_a_lead_averages_over_the_time_that_is_set_from_the_next_call_on() -> None:
    lag, times = CorrectionLag(0.0), PERIOD_S * np.arange(10)
    assert not lag.lead(times, rates_at(times), MODEL).position.any()
    lag.retune(AVERAGING_S)
    found = lag.lead(times, rates_at(times), MODEL)
    fresh = CorrectionLag(AVERAGING_S).lead(times, rates_at(times), MODEL)
    assert fresh.position.any()
    for part, wanted in zip(found, fresh, strict=True):
        np.testing.assert_array_equal(part, wanted)
    # Another model, another lag.
    none = lag.lead(times, rates_at(times), BiasModel.zero())
    assert not none.position.any()


def test_a_new_model_or_time_counts_for_a_wait_and_a_pass(rig: MakeRig, window: Pass) -> None:
    made = rig(start_s=window.aos_t_s - 5.0)
    list(made.run(window.aos_t_s - 5.0, 1.0))
    before = made.latest.position_rad[0].copy()
    made.controller.take_model(BiasModel.zero().replace(elevation_offset=2e-3))
    *_, (_, trajectory, _) = made.run(window.aos_t_s - 4.0, 0.2)
    np.testing.assert_allclose(trajectory.position_rad[0] - before, [0.0, 2e-3], atol=1e-9)
    given = made.controller.params
    made.controller.retune(given.replace(pointing=given.pointing.replace(lag_averaging_s=2.5)))
    motion = made.controller._motion
    assert (motion._path.lag_averaging_s, motion._lag._averaging_s) == (2.5, 2.5)
    assert motion.params.lag_averaging_s == 2.5
