import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, rotation_vector
from rf_pointing.array_sensors.interferometer.motion import DockingApproach, RelativeMotion, moved
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams, required_power_w
from rf_pointing.array_sensors.interferometer.rate_filter import FilterParams
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from rf_pointing.array_sensors.interferometer.tracker import InterferometerTracker, TrackerParams, TrackerState

SYSTEM = InterferometerSystem()
TRACKER = InterferometerTracker(system=SYSTEM)
STEP_S = 2.0
HARDWARE = RadioParams(hardware_phase_rad=0.002, hardware_rate_rad_s=0.02, hardware_coupling=0.002)


def source(seed: int = 1, radio: RadioParams | None = None, **options) -> InterferometerSource:
    return InterferometerSource(SYSTEM, radio or RadioParams(), LinkParams(), seed, **options)


def drifting(roll: float = 0.3) -> RelativeMotion:
    return RelativeMotion(
        position_m=np.array([5e3, 300.0, -200.0]), velocity_m_s=np.array([-0.8, 0.1, 0.05]),
        attitude=attitude_from_euler(0.1, -0.15, roll), rate_rad_s=np.array([5e-3, 1e-3, -1e-3]),
    )  # fmt: skip


def run(maker, truth, steps, state=None, first=0, tracker=TRACKER):
    """Return the state and all outputs over `steps` sequences from number `first` on."""
    state, outputs = state or TrackerState(), []
    for step in range(first, first + steps):
        t_s = STEP_S * step
        state, output = tracker.step(state, maker.measure(t_s, moved(truth, t_s)))
        outputs.append(output)
    return state, outputs


def normalised_errors(output, truth: RelativeMotion):
    estimate = output.estimate
    off = np.concatenate(
        [
            truth.position_m - estimate.motion.position_m,
            truth.velocity_m_s - estimate.motion.velocity_m_s,
            rotation_vector(truth.attitude @ estimate.motion.attitude.T),
            truth.rate_rad_s - estimate.motion.rate_rad_s,
        ]
    )
    return off / np.sqrt(np.diag(estimate.covariance))


def with_wrong_lane(measurement, paths=(Ellipsis,)):
    """Phases as if the ranges of `paths` were longer by one finest lane: resolution cannot see it."""
    plan = SYSTEM.plan
    shift = 2.0 * np.pi * plan.ambiguities_m[-1] * plan.offsets_hz / plan.speed_of_light_m_s
    phases = measurement.phase_rad.copy()
    selected = phases[(slice(None), *paths)]
    phases[(slice(None), *paths)] = selected + shift[SYSTEM.schedule.carriers(plan)].reshape(
        (-1,) + (1,) * (selected.ndim - 1)
    )
    return dataclasses.replace(measurement, phase_rad=phases)


@pytest.mark.parametrize(("start_m", "constant_s"), [(9e4, 3e4), (2e3, 1200.0), (30.0, 600.0)])
def test_an_approach_is_acquired_at_once_and_tracked_within_the_covariance(start_m: float, constant_s: float) -> None:
    approach = DockingApproach(start_range_m=start_m, time_constant_s=constant_s)
    maker, state = source(), TrackerState()
    for step in range(20):
        truth = approach.motion_at(STEP_S * step)
        state, output = TRACKER.step(state, maker.measure(STEP_S * step, truth))
        assert output.status == "tracking", output.reason
        assert np.max(np.abs(normalised_errors(output, truth))) < 5.0


def test_roll_through_half_a_turn_is_tracked_without_a_break() -> None:
    truth = dataclasses.replace(drifting(roll=np.pi - 0.05), rate_rad_s=np.array([0.01, 0.0, 0.0]))
    state, outputs = run(source(), truth, 8)
    assert all(output.status == "tracking" for output in outputs)
    for step, output in enumerate(outputs):
        assert np.max(np.abs(normalised_errors(output, moved(truth, STEP_S * step)))) < 5.0
    assert state.rejected == 0


def test_unknown_excitation_is_tracked_along() -> None:
    tracker = InterferometerTracker(system=SYSTEM, filter_params=FilterParams(track_excitation=True))
    truth = drifting()
    _, outputs = run(source(excitation=(0.7, 1.2)), truth, 5, tracker=tracker)
    assert [output.status for output in outputs] == ["tracking"] * 5
    np.testing.assert_allclose(outputs[-1].estimate.excitation, [0.7, 1.2], atol=5e-3)
    assert np.max(np.abs(normalised_errors(outputs[-1], moved(truth, 8.0)))) < 5.0


def test_excitation_taken_as_known_but_wrong_is_refused_not_turned_into_roll() -> None:
    _, (output,) = run(source(excitation=(0.7, 1.2)), drifting(), 1)
    assert output.status == "acquiring"
    assert "contradict each other" in output.reason


def test_wrong_lane_of_one_path_is_refused_with_its_reason_and_changes_nothing() -> None:
    truth, maker = drifting(), source()
    state, _ = run(maker, truth, 4)
    measurement = with_wrong_lane(maker.measure(8.0, moved(truth, 8.0)), (0, 1))
    after, output = TRACKER.step(state, measurement)
    assert output.status == "coasting"
    assert "contradict each other (wrong lane?)" in output.reason
    assert after.rejected == 1
    assert np.max(np.abs(normalised_errors(output, moved(truth, 8.0)))) < 5.0
    _, outputs = run(maker, truth, 1, after, first=5)
    assert outputs[0].status == "tracking"


def test_wrong_lane_of_all_paths_contradicts_the_prediction() -> None:
    truth, maker = drifting(), source()
    state, _ = run(maker, truth, 4)
    _, output = TRACKER.step(state, with_wrong_lane(maker.measure(8.0, moved(truth, 8.0))))
    assert output.status == "coasting"
    assert "contradicts the prediction (wrong lane?)" in output.reason


def test_acquisition_on_a_wrong_lane_of_all_paths_is_left_again() -> None:
    truth, maker = drifting(), source()
    state, output = TRACKER.step(TrackerState(), with_wrong_lane(maker.measure(0.0, truth)))
    assert output.status == "tracking"
    # Refused while the covariance excludes 0.37 m of motion, then believed; in the end the pose is right again.
    _, outputs = run(maker, truth, 12, state, first=1)
    assert [o.status for o in outputs[:3]] == ["coasting"] * 3
    assert outputs[-1].status == "tracking"
    assert np.max(np.abs(normalised_errors(outputs[-1], moved(truth, STEP_S * 12)))) < 5.0


def test_lost_lock_coasts_with_growing_covariance_then_gives_up_and_acquires_anew() -> None:
    truth, maker = drifting(), source()
    state, outputs = run(maker, truth, 4)
    sizes = [np.trace(outputs[-1].estimate.covariance)]
    for step in range(4, 4 + TRACKER.params.most_rejected):
        measured = maker.measure(STEP_S * step, moved(truth, STEP_S * step))
        locked = measured.locked.copy()
        locked[3, 1, 2] = False
        state, output = TRACKER.step(state, dataclasses.replace(measured, locked=locked))
        assert output.status == "coasting"
        assert output.reason == "1 loops without lock, first: slot 3, path A2-P3"
        sizes.append(np.trace(output.estimate.covariance))
    assert np.all(np.diff(sizes) > 0.0)
    state, output = TRACKER.coast(state, STEP_S * (step + 1), "no measurement")
    assert output.status == "acquiring"
    assert output.estimate is None
    assert output.reason == "dropped after 12 s and 6 refused readings, last: no measurement"
    _, outputs = run(maker, truth, 1, state, first=step + 2)
    assert outputs[0].status == "tracking"


def test_a_false_lock_without_signal_is_refused() -> None:
    away = dataclasses.replace(drifting(), attitude=attitude_from_euler(np.pi, 0.0, 0.0))
    for seed in range(20):
        measured = source(seed).measure(0.0, away)
        claimed = dataclasses.replace(measured, locked=np.ones_like(measured.locked))
        _, output = TRACKER.step(TrackerState(), claimed)
        assert output.status == "acquiring"
        assert output.reason


def test_weak_links_are_refused_even_if_the_loops_claim_lock() -> None:
    far = dataclasses.replace(drifting(), position_m=np.array([9e4, 0.0, 0.0]))
    measured = source(radio=RadioParams(return_power_w=5e-4)).measure(0.0, far)
    _, output = TRACKER.step(TrackerState(), dataclasses.replace(measured, locked=np.ones_like(measured.locked)))
    assert "return link snr=" in output.reason


def test_phases_turned_by_a_manoeuvre_within_the_sequence_are_refused() -> None:
    measured = source().measure(0.0, drifting())
    jumped = measured.phase_rad.copy()
    jumped[9:] += np.linspace(1.0, 3.0, 9)[:, None, None]
    _, output = TRACKER.step(TrackerState(), dataclasses.replace(measured, phase_rad=jumped))
    assert "repeated phases agree to" in output.reason


def test_an_unresolved_cycle_is_refused() -> None:
    measured = source().measure(0.0, drifting())
    biased = measured.phase_rad.copy()
    biased[SYSTEM.schedule.carriers(SYSTEM.plan) == 4, 0, 0] += 2.0 * np.pi * 0.42
    _, output = TRACKER.step(TrackerState(), dataclasses.replace(measured, phase_rad=biased))
    assert output.reason.startswith("lane residual 0.4")


def test_a_measurement_out_of_order_is_flagged_and_leaves_the_state() -> None:
    maker, truth = source(), drifting()
    state, _ = run(maker, truth, 3)
    after, output = TRACKER.step(state, maker.measure(4.0, moved(truth, 4.0)))
    assert after is state
    assert output.reason == "t_s=4.0 must be > the last epoch 4.0"


def test_predicted_path_rates_hold_track_at_a_power_where_measured_ones_fail() -> None:
    weak = RadioParams(forward_power_w=0.02, return_power_w=0.01)
    truth = dataclasses.replace(drifting(), position_m=np.array([9e4, 2e3, 1e3]))
    state, _ = run(source(2), truth, 10)
    maker, held, cold = source(3, weak), 0, 0
    for step in range(10, 25):
        measurement = maker.measure(STEP_S * step, moved(truth, STEP_S * step))
        state, output = TRACKER.step(state, measurement)
        held += output.status == "tracking"
        cold += TRACKER.step(TrackerState(), measurement)[1].status == "tracking"
    assert held >= cold + 5


@pytest.mark.parametrize(("range_m", "across_m_s"), [(200.0, 1.5), (200.0, 4.0), (2e3, 5.0), (30.0, 1.0)])
def test_a_path_that_is_crossed_is_acquired_at_once_and_tracked(range_m: float, across_m_s: float) -> None:
    truth = RelativeMotion(
        position_m=range_m * np.array([0.96, 0.28, 0.0]),
        velocity_m_s=across_m_s * np.array([-0.28, 0.96, 0.0]),
        attitude=attitude_from_euler(0.1, -0.15, 0.3),
        rate_rad_s=np.array([5e-3, 1e-3, -1e-3]),
    )
    _, outputs = run(source(radio=HARDWARE), truth, 6)
    for step, output in enumerate(outputs):
        assert output.status == "tracking", output.reason
        assert np.max(np.abs(normalised_errors(output, moved(truth, STEP_S * step)))) < 5.0


def test_fixed_errors_of_the_hardware_are_not_averaged_away() -> None:
    """Mean square of the normalised errors (12) over 16 runs of 12 readings: 71 where they are taken as white."""
    squares = []
    for seed in range(16):
        truth = drifting()
        _, outputs = run(source(seed, HARDWARE), truth, 12)
        there, found = moved(truth, STEP_S * 11), outputs[-1].estimate
        off = normalised_errors(outputs[-1], there) * np.sqrt(np.diag(found.covariance))
        squares.append(off @ np.linalg.solve(found.covariance, off))
    # The motion is steadier than the model's, so a mean below 12 is right.
    assert 6.0 < np.mean(squares) < chi2.ppf(0.999, 12 * len(squares)) / len(squares)


def test_position_80_km_away_is_within_its_covariance_along_the_sight() -> None:
    far = dataclasses.replace(drifting(), position_m=np.array([7.9e4, 9e3, -6e3]))
    for seed in range(8):
        _, outputs = run(source(seed), far, 3)
        for step, output in enumerate(outputs):
            assert np.max(np.abs(normalised_errors(output, moved(far, STEP_S * step)))) < 5.0
            off = moved(far, STEP_S * step).position_m - output.estimate.motion.position_m
            assert off @ np.linalg.solve(output.estimate.covariance[:3, :3], off) < 30.0


@pytest.mark.parametrize("size_rad", [0.1, 0.5, 2.0])
def test_carrier_phases_that_all_paths_share_are_refused(size_rad: float, rng) -> None:
    """Half a radian on each carrier made a range of 2 km and 97 m in one run of eight."""
    for seed in range(10):
        shared = rng.uniform(-1.0, 1.0, SYSTEM.plan.count)[SYSTEM.schedule.carriers(SYSTEM.plan)] * size_rad
        measured = source(seed).measure(0.0, drifting())
        turned = dataclasses.replace(measured, phase_rad=measured.phase_rad + shared[:, None, None])
        _, output = TRACKER.step(TrackerState(), turned)
        assert output.status == "acquiring"
        assert "sigma from a whole number" in output.reason or "lane residual" in output.reason


def test_a_coarse_wrong_lane_of_all_paths_has_the_wrong_power() -> None:
    plan, truth = SYSTEM.plan, drifting()
    measured = source().measure(0.0, truth)
    # As if the way were one lane of the second difference longer, on every carrier: 19.6 km.
    shift = 2.0 * np.pi * plan.ambiguities_m[1] * plan.offsets_hz / plan.speed_of_light_m_s
    turned = measured.phase_rad + shift[SYSTEM.schedule.carriers(plan)][:, None, None]
    _, output = TRACKER.step(TrackerState(), dataclasses.replace(measured, phase_rad=turned))
    assert output.status == "acquiring"
    assert output.reason.startswith("power of the forward link is +13.8 dB from that at 24567.")


def test_weak_links_are_acquired_on_the_right_lanes_or_not_at_all() -> None:
    acquired = 0
    for seed in range(40):
        snr = 10.0 ** (0.1 * (12.0 + 0.45 * seed))
        powers = [float(required_power_w(snr, 2e4, link_hz, LinkParams())) for link_hz in (3.4e9, 2.4e9)]
        radio = RadioParams(forward_power_w=powers[0], return_power_w=powers[1])
        truth = dataclasses.replace(drifting(), position_m=np.array([2e4, 300.0, -200.0]))
        tracker = dataclasses.replace(TRACKER, radio=radio)
        _, output = tracker.step(TrackerState(), source(seed, radio).measure(0.0, truth))
        if output.estimate is not None:
            acquired += 1
            assert np.max(np.abs(normalised_errors(output, truth))) < 5.0
    assert acquired >= 12


def test_no_pose_is_given_while_sound_readings_contradict_the_prediction() -> None:
    truth, maker = drifting(), source()
    state, outputs = run(maker, truth, 4)
    pushed = dataclasses.replace(moved(truth, 8.0), velocity_m_s=truth.velocity_m_s + np.array([0.3, 0.0, 0.0]))
    for step in range(4, 20):
        there = moved(pushed, STEP_S * (step - 4))
        state, output = TRACKER.step(state, maker.measure(STEP_S * step, there))
        if output.estimate is None:
            assert "contradicts the prediction" in output.reason
        else:
            assert np.max(np.abs(normalised_errors(output, there))) < 5.0
        outputs.append(output)
    assert outputs[4].estimate is None
    assert outputs[-1].status == "tracking"


@pytest.mark.parametrize("link", ["forward", "return"])
def test_a_link_may_be_six_decibels_off_at_acquisition_either_way(link: str) -> None:
    nominal = {"forward": 2.2, "return": 1.1}[link]
    for over_db, status in ((5.9, "tracking"), (-5.9, "tracking"), (6.1, "acquiring"), (-6.1, "acquiring")):
        radio = RadioParams(**{f"{link}_power_w": nominal * 10.0 ** (0.1 * over_db)})
        _, output = TRACKER.step(TrackerState(), source(1, radio).measure(0.0, drifting()))
        assert output.status == status, output.reason
        if status == "acquiring":
            assert output.reason.startswith(f"power of the {link} link is {over_db:+.1f} dB from that at 50")


@pytest.mark.parametrize("side", ["active", "passive"])
def test_each_array_sees_the_other_within_its_widest_angle(side: str) -> None:
    angle = 0.62
    attitude = attitude_from_euler(*((angle, 0.0, 0.3) if side == "active" else (-angle, 0.0, 0.3)))
    if side == "active":
        # The passive array faces the active one.
        position, attitude = 500.0 * np.array([np.cos(angle), np.sin(angle), 0.0]), attitude_from_euler(angle, 0.0, 0.3)
    else:
        position = np.array([500.0, 0.0, 0.0])
    truth = dataclasses.replace(drifting(), position_m=position, attitude=attitude, rate_rad_s=np.zeros(3))
    for widest, status in ((angle + 0.02, "tracking"), (angle - 0.02, "acquiring")):
        tracker = InterferometerTracker(system=SYSTEM, params=TrackerParams(widest_angle_rad=widest))
        _, (output,) = run(source(), truth, 1, tracker=tracker)
        assert output.status == status, output.reason
    assert output.reason.startswith(f"{side} array sees the other 35.")


def test_the_time_of_the_last_accepted_reading_counts_and_its_limit_is_still_coasting() -> None:
    state, _ = run(source(), drifting(), 2)
    assert (state.accepted_t_s, state.rejected, state.doubted) == (2.0, 0, False)
    after, output = TRACKER.coast(state, 2.0, "at once")
    assert (output.status, output.reason, output.t_s) == ("coasting", "at once", 2.0)
    assert (after.accepted_t_s, after.rejected) == (2.0, 1)
    after, output = TRACKER.coast(state, 2.0 + TRACKER.params.coast_limit_s, "late")
    assert output.status == "coasting"
    dropped, output = TRACKER.coast(after, 2.1 + TRACKER.params.coast_limit_s, "later")
    assert dropped == TrackerState()
    with pytest.raises(ValueError, match=r"t_s=1.0 must be >= the last epoch 2.0"):
        TRACKER.coast(state, 1.0, "late")
    assert output.reason == "dropped after 20.1 s and 2 refused readings, last: later"


def test_an_excitation_turned_over_is_refused() -> None:
    tracker = InterferometerTracker(system=SYSTEM, filter_params=FilterParams(track_excitation=True))
    truth, maker = drifting(), source()
    state, _ = run(maker, truth, 3, tracker=tracker)
    measured = maker.measure(6.0, moved(truth, 6.0))
    turned = dataclasses.replace(measured, amplitudes=measured.amplitudes * np.array([1.0, -1.0]))
    _, output = tracker.step(state, turned)
    assert output.status == "coasting"
    assert output.reason.startswith("excitation=[")
