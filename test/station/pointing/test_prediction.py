"""The target's coming motion as a continuous function, against the track it was sampled from.

Blocks of axis motion against the motion computed for the instants themselves.
"""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel, without_lags
from rf_pointing.core import JointReading, Motion, Target, nearest_turn_rad
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.planning.profile import PassProfile
from rf_pointing.station.antenna.mount import MountParams, RateAverage
from rf_pointing.station.pointing.branch import TrackingBranch
from rf_pointing.station.pointing.prediction import KEPT_S, LARGEST_GAP_S, Prediction, TargetBuffer, axis_motion

INTERPOLATION_RAD = 1e-10


class StandingPlan:
    """Direct, without a crossing."""

    def __init__(self) -> None:
        self.course = TrackingBranch()

    def model_motion(self, _t_s: float, sky: Motion, model: BiasModel) -> Motion:
        return axis_motion(sky, model)


def filled(track: TopocentricTrack, times: np.ndarray) -> TargetBuffer:
    buffer = TargetBuffer()
    for t_s in times:
        buffer.add(track.target_at(float(t_s)))
    return buffer


@pytest.mark.parametrize("step_s", [0.1, 1.0])
def test_between_samples_the_motion_is_the_tracks_own(track: TopocentricTrack, window: Pass, step_s: float) -> None:
    start_s = round(window.tca_t_s, 1)
    buffer = filled(track, start_s + np.arange(0.0, 4.01, step_s))
    times = start_s + np.linspace(0.013, 3.987, 57)
    motion = buffer.at(times)
    for row, t_s in enumerate(times):
        wanted = track.target_at(float(t_s))
        np.testing.assert_allclose(
            motion.position[row], [wanted.azimuth_rad, wanted.elevation_rad], atol=INTERPOLATION_RAD
        )
        np.testing.assert_allclose(
            motion.velocity[row], [wanted.azimuth_rate_rad_s, wanted.elevation_rate_rad_s], atol=1e-8
        )


def test_azimuth_stays_continuous_across_north(track: TopocentricTrack, window: Pass) -> None:
    """The track folds its azimuth to the turn around south; the buffer undoes it."""
    assert window.crosses_north
    times = np.linspace(window.aos_t_s, window.los_t_s, 3000)
    azimuth = [math.remainder(track.target_at(float(t)).azimuth_rad, 2.0 * math.pi) for t in times]
    north_s = float(times[int(np.flatnonzero(np.diff(np.sign(azimuth)))[0])])
    buffer = filled(track, np.round(north_s, 1) + np.arange(-2.0, 2.01, 0.1))
    path = buffer.at(np.round(north_s, 1) + np.linspace(-1.9, 1.9, 77)).position[:, 0]
    assert np.max(np.abs(np.diff(path))) < math.radians(0.1)


def test_a_gap_that_is_too_long_is_not_covered(track: TopocentricTrack, window: Pass) -> None:
    t_s = round(window.tca_t_s)
    buffer = filled(track, np.array([t_s, t_s + 1.0, t_s + 1.0 + LARGEST_GAP_S + 0.01]))
    assert buffer.covers(t_s, t_s + 1.0)
    assert not buffer.covers(t_s + 0.5, t_s + 1.5)
    with pytest.raises(ValueError, match="is outside the known motion of the target"):
        buffer.at([t_s + 2.0])


def test_nothing_is_known_outside_the_samples(track: TopocentricTrack, window: Pass) -> None:
    t_s = round(window.tca_t_s)
    empty, buffer = TargetBuffer(), filled(track, np.array([t_s, t_s + 0.1]))
    assert empty.known_until_s == -math.inf
    assert buffer.known_until_s == t_s + 0.1
    for outside in (t_s - 0.01, t_s + 0.11):
        assert not empty.covers(outside, outside)
        assert not buffer.covers(outside, outside)
        with pytest.raises(ValueError, match="is outside the known motion"):
            buffer.at([outside])
    buffer.clear()
    assert not buffer.covers(t_s, t_s)


def test_a_later_sample_of_the_same_time_replaces_the_earlier(track: TopocentricTrack, window: Pass) -> None:
    t_s = float(round(window.tca_t_s))
    buffer = filled(track, np.array([t_s, t_s + 0.1]))
    moved: Target = dataclasses.replace(track.target_at(t_s), elevation_rad=0.3)
    buffer.add(moved)
    assert buffer.at([t_s]).position[0, 1] == 0.3


def test_late_samples_are_sorted_in(track: TopocentricTrack, window: Pass) -> None:
    times = round(window.tca_t_s) + np.arange(0.0, 2.01, 0.1)
    wanted = filled(track, times).at(times[:-1] + 0.05)
    shuffled = filled(track, np.concatenate([times[10:11], times[:10], times[11:]])).at(times[:-1] + 0.05)
    np.testing.assert_allclose(shuffled.position, wanted.position, atol=1e-13)


def test_the_past_is_forgotten(track: TopocentricTrack, window: Pass) -> None:
    times = round(window.tca_t_s) + np.arange(0.0, KEPT_S + 3.01, 0.1)
    buffer = filled(track, times)
    assert buffer.covers(times[-1] - KEPT_S + 0.1, times[-1])
    assert not buffer.covers(times[0], times[0])


def test_the_range_stays_in_step_with_the_samples_and_is_the_nearest_outside(
    track: TopocentricTrack, window: Pass
) -> None:
    """Late, repeated and forgotten samples included; a straight line over 0.1 s is within centimetres."""
    times = round(window.aos_t_s) + np.arange(0.0, KEPT_S + 3.01, 0.1)
    buffer = filled(track, np.concatenate([times[10:11], times[:10], times[11:], times[-5:]]))
    between = times[-40:-1] + 0.05
    wanted = [track.target_at(float(t_s)).range_m for t_s in between]
    np.testing.assert_allclose(buffer.range_m(between), wanted, atol=0.1)
    first_s = next(t_s for t_s in times if buffer.covers(t_s, t_s))
    assert first_s > times[0] + 2.0
    for outside_s, nearest_s in ((times[0], first_s), (times[-1] + 60.0, times[-1])):
        assert buffer.range_m([outside_s])[0] == pytest.approx(track.target_at(float(nearest_s)).range_m, abs=1e-6)


def test_a_filled_gap_goes_on_from_the_last_sample(track: TopocentricTrack, window: Pass) -> None:
    """At the last offset from the profile, and at the last change of the distance; or as if nothing was known."""
    start_s = round(window.aos_t_s) + 20.0
    times = start_s + np.arange(-5.0, 30.0)
    targets = [track.target_at(float(t_s)) for t_s in times]
    profile = PassProfile(
        name="coming",
        t_s=times,
        position_rad=np.array([[target.azimuth_rad, target.elevation_rad] for target in targets]),
        velocity_rad_s=np.array([[target.azimuth_rate_rad_s, target.elevation_rate_rad_s] for target in targets]),
        acceleration_rad_s2=np.zeros((len(times), 2)),
        sun_rad=np.full((len(times), 2), 0.1),
        range_m=np.full(len(times), 1e6),
        satellite_gain_db=np.linspace(-3.0, 0.0, len(times)),
    )
    offset = np.array([2e-3, -1e-3])
    buffer = TargetBuffer()
    for k, t_s in enumerate(start_s + np.array([0.0, 0.25, 0.5])):
        target = track.target_at(float(t_s))
        buffer.add(
            dataclasses.replace(
                target,
                azimuth_rad=target.azimuth_rad + offset[0],
                elevation_rad=target.elevation_rad + offset[1],
                range_m=2e6 - 1500.0 * k,
            )
        )
    buffer.fill(profile, start_s + 0.5, start_s + 4.0, 7e6)
    assert buffer.covers(start_s, start_s + 4.0)
    wanted = np.array([np.interp(start_s + 3.0, times, column) for column in profile.position_rad.T])
    np.testing.assert_allclose(buffer.at(np.array([start_s + 3.0])).position[0], wanted + offset, atol=1e-5)
    # 1500 m in 0.25 s: 6 km/s, on from 0.5 s to 3 s.
    assert buffer.range_m([start_s + 3.0])[0] == pytest.approx(2e6 - 3000.0 - 6000.0 * 2.5, abs=1e-3)
    empty = TargetBuffer()
    empty.fill(profile, start_s, start_s + 4.0, 7e6)
    assert empty.range_m([start_s + 3.0])[0] == 7e6
    np.testing.assert_array_equal(empty.at(np.array([start_s + 3.0])).position[0], wanted)


PERIOD_S = 0.1
SAME_RAD = 1e-12


@pytest.fixture
def model() -> BiasModel:
    """Return a model with every kind of term: rotations, encoders, flexure, lags."""
    return MountParams(
        azimuth_offset_rad=3e-3,
        non_orthogonality_rad=1e-3,
        collimation_rad=-2e-4,
        mislevel_east_rad=7e-4,
        azimuth_velocity_lag_s=-1.0,
        droop_rad=-1.5e-3,
        elevation_velocity_lag_s=-1.9,
    ).model()


def held(sky: Motion, model: BiasModel, near_azimuth_rad: float) -> Motion:
    """The motion of the axes at every instant alone, on the turn next to an azimuth."""
    position, velocity, acceleration = axis_motion(sky, model)
    first = float(position[0, 0])
    near = nearest_turn_rad(first, near_azimuth_rad)
    return Motion(position + np.array([near - first, 0.0]), velocity, acceleration)


def targets_at(track: TopocentricTrack, start_s: float, seconds: float) -> TargetBuffer:
    buffer = TargetBuffer()
    for step in range(round(seconds / PERIOD_S) + 1):
        buffer.add(track.target_at(round(start_s + step * PERIOD_S, 6)))
    return buffer


def test_every_period_gets_the_motion_computed_for_its_own_instants(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    start_s, near_rad = round(window.tca_t_s, 1), math.pi
    path, buffer = Prediction(PERIOD_S, StandingPlan()), targets_at(track, start_s, 4.0)
    for step in range(30):
        times = start_s + PERIOD_S * step + PERIOD_S * np.arange(1, 11)
        got, wanted = path.at(times, buffer, model, near_rad), held(buffer.at(times), model, near_rad)
        for part, direct in zip(got, wanted, strict=True):
            np.testing.assert_allclose(part, direct, rtol=0.0, atol=SAME_RAD)


def test_the_model_is_applied_to_the_targets_motion(track: TopocentricTrack, window: Pass, model: BiasModel) -> None:
    t_s = round(window.tca_t_s, 1)
    sky = targets_at(track, t_s, 1.0).at([t_s, t_s + 0.5])
    for row in range(2):
        azimuth, elevation = model.apply(*sky.position[row], *sky.velocity[row], *sky.acceleration[row])
        motion = held(sky, model, float(sky.position[0, 0]))
        np.testing.assert_allclose(motion.position[row], [azimuth, elevation], atol=1e-14)


@pytest.mark.parametrize("turns", [-1, 0, 2])
def test_the_azimuth_lies_on_the_turn_that_was_asked_for(track: TopocentricTrack, window: Pass, turns: int) -> None:
    t_s = round(window.tca_t_s, 1)
    buffer, near_rad = targets_at(track, t_s, 1.0), 1.0 + 2.0 * math.pi * turns
    motion = Prediction(PERIOD_S, StandingPlan()).at(np.array([t_s]), buffer, BiasModel.zero(), near_rad)
    wanted = track.target_at(t_s).azimuth_rad
    assert motion.position[0, 0] == pytest.approx(wanted + 2.0 * math.pi * turns, abs=SAME_RAD)


def test_after_clear_a_new_model_is_used(track: TopocentricTrack, window: Pass, model: BiasModel) -> None:
    t_s = round(window.tca_t_s, 1)
    times, path, buffer = np.array([t_s]), Prediction(PERIOD_S, StandingPlan()), targets_at(track, t_s, 1.0)
    before = path.at(times, buffer, BiasModel.zero(), math.pi)
    assert np.array_equal(path.at(times, buffer, model, math.pi).position, before.position)
    path.clear()
    assert not np.allclose(path.at(times, buffer, model, math.pi).position, before.position, atol=1e-4)


def test_instants_that_are_not_covered_are_refused(track: TopocentricTrack, window: Pass) -> None:
    t_s = round(window.tca_t_s, 1)
    with pytest.raises(ValueError, match="is outside the known motion"):
        Prediction(PERIOD_S, StandingPlan()).at(
            np.array([t_s + 5.0]), targets_at(track, t_s, 1.0), BiasModel.zero(), math.pi
        )


def test_lags_are_those_of_a_mount_that_makes_the_same_motion_from_rest(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    """The simulated mount's average, stepped a thousand times as finely, fed with the rates that the beam has."""
    start_s, averaging_s, near_rad = round(window.tca_t_s, 1), 0.5, math.pi
    path, buffer = Prediction(PERIOD_S, StandingPlan(), lag_averaging_s=averaging_s), targets_at(track, start_s, 4.9)
    times = np.round(start_s + PERIOD_S * np.arange(1, 46), 6)
    parts = [path.at(times[k : k + 10], buffer, model, near_rad) for k in range(0, 36, 5)]
    got = np.concatenate([part.position[:5] for part in parts])
    rates, mount, steps = buffer.at(times).velocity, RateAverage(averaging_s), 1000
    velocity_s = np.array([model.coefficients[f"{axis}_velocity_lag"] for axis in ("azimuth", "elevation")])
    lags = [velocity_s * mount.rate_rad_s]
    for before, after in itertools.pairwise(rates):
        for step in range(steps):
            mount.update(PERIOD_S / steps, before + (after - before) * (step + 0.5) / steps)
        lags.append(velocity_s * mount.rate_rad_s)
    assert np.max(np.abs(lags)) > math.radians(0.2)
    still = held(buffer.at(times), without_lags(model), near_rad).position
    np.testing.assert_allclose(got[0], still[0], atol=1e-12)
    np.testing.assert_allclose(got, (still + np.array(lags))[: len(got)], atol=1e-4 * float(np.max(np.abs(lags))))
    # Position, velocity and acceleration belong to one motion (Hermite's rule of the fifth order).
    motion = path.at(times[30:45], buffer, model, near_rad)
    steps_rad = 0.5 * PERIOD_S * (motion.velocity[1:] + motion.velocity[:-1])
    steps_rad += PERIOD_S**2 / 12.0 * (motion.acceleration[:-1] - motion.acceleration[1:])
    np.testing.assert_allclose(np.diff(motion.position, axis=0), steps_rad, atol=5e-8)


def test_a_new_model_in_the_middle_of_a_pass_does_not_start_the_lags_again(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    start_s, near_rad = round(window.tca_t_s, 1), math.pi
    path, buffer = Prediction(PERIOD_S, StandingPlan(), lag_averaging_s=0.1), targets_at(track, start_s, 4.0)
    late = np.round(start_s + PERIOD_S * np.arange(1, 30), 6)
    before = path.at(late, buffer, model, near_rad).position[-1]
    path.clear()
    np.testing.assert_allclose(path.at(late[-1:], buffer, model, near_rad).position[0], before, atol=1e-12)
    path.restart()
    resting = held(buffer.at(late[-1:]), without_lags(model), near_rad).position[0]
    np.testing.assert_allclose(path.at(late[-1:], buffer, model, near_rad).position[0], resting, atol=1e-12)
    assert np.max(np.abs(before - resting)) > math.radians(0.2)


def test_axes_found_on_the_path_of_a_pass_have_the_lags_of_axes_that_followed_it(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    """A controller that starts again in the middle of a pass; axes elsewhere have followed nothing."""
    start_s, near_rad, averaging_s = round(window.tca_t_s, 1), math.pi, 0.3
    times = np.round(start_s + PERIOD_S * np.arange(1, 31), 6)
    buffer = targets_at(track, start_s, 4.0)
    whole = Prediction(PERIOD_S, StandingPlan(), averaging_s).at(times, buffer, model, near_rad)
    known, sky = times[:26], buffer.at(times[:26])
    resting = held(buffer.at(times[25:]), without_lags(model), near_rad).position[0]
    for off_deg, followed in ((0.1, True), (3.0, False)):
        place = whole.position[25] + np.array([0.0, math.radians(off_deg)])
        reading = JointReading(t_s=float(times[25]), position_rad=place, velocity_rad_s=np.zeros(2))
        again = Prediction(PERIOD_S, StandingPlan(), averaging_s)
        again.followed(known, sky, reading, model)
        found = again.at(times[25:], buffer, model, near_rad).position[0]
        np.testing.assert_allclose(found, whole.position[25] if followed else resting, atol=math.radians(5e-3))
    assert np.max(np.abs(whole.position[25] - resting)) > math.radians(0.2)
