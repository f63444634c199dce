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
from rf_pointing.planning import PassProfile, plunged
from rf_pointing.station.antenna.mount import MountParams, RateAverage
from rf_pointing.station.pointing.branch import TrackingBranch
from rf_pointing.station.pointing.prediction import KEPT_S, Prediction, TargetBuffer, axis_motion

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


def test_late_samples_are_sorted_in(track: TopocentricTrack, window: Pass) -> None:
    times = round(window.tca_t_s) + np.arange(0.0, 2.01, 0.1)
    wanted = filled(track, times).at(times[:-1] + 0.05)
    shuffled = filled(track, np.concatenate([times[10:11], times[:10], times[11:]])).at(times[:-1] + 0.05)
    np.testing.assert_allclose(shuffled.position, wanted.position, atol=1e-13)


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
                target, azimuth_rad=target.azimuth_rad + offset[0],
                elevation_rad=target.elevation_rad + offset[1], range_m=2e6 - 1500.0 * k,
            )
        )  # fmt: skip
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
        azimuth_offset_rad=3e-3, non_orthogonality_rad=1e-3, collimation_rad=-2e-4,
        mislevel_east_rad=7e-4, azimuth_velocity_lag_s=-1.0, droop_rad=-1.5e-3,
        elevation_velocity_lag_s=-1.9,
    ).model()  # fmt: skip


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


@pytest.mark.parametrize("turns", [-1, 0, 2])
def test_the_azimuth_lies_on_the_turn_that_was_asked_for(track: TopocentricTrack, window: Pass, turns: int) -> None:
    t_s = round(window.tca_t_s, 1)
    buffer, near_rad = targets_at(track, t_s, 1.0), 1.0 + 2.0 * math.pi * turns
    motion = Prediction(PERIOD_S, StandingPlan()).at(np.array([t_s]), buffer, BiasModel.zero(), near_rad)
    wanted = track.target_at(t_s).azimuth_rad
    assert motion.position[0, 0] == pytest.approx(wanted + 2.0 * math.pi * turns, abs=SAME_RAD)


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


def test_how_far_ahead_the_target_is_known_changes_no_bit(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    """Which message arrives first depends on the processes of the graph: blocks end there."""
    start_s, near_rad, flown = round(window.tca_t_s, 1), math.pi, list[list[Motion]]()
    for lead_s in (0.9, 1.0, 1.3):
        path, found = Prediction(PERIOD_S, StandingPlan(), lag_averaging_s=0.5), list[Motion]()
        buffer, end_s = targets_at(track, start_s, 0.8), start_s + 0.8
        for step in range(40):
            times = np.round(start_s + PERIOD_S * (step + np.arange(9)), 6)
            while end_s < times[-1] + lead_s - 0.8:
                end_s = round(end_s + PERIOD_S, 6)
                buffer.add(track.target_at(end_s))
            found.append(path.at(times, buffer, model, near_rad))
        flown.append(found)
    for others in flown[1:]:
        np.testing.assert_array_equal(others, flown[0])


def test_a_new_model_in_the_middle_of_a_pass_does_not_start_the_lags_again(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    start_s, near_rad = round(window.tca_t_s, 1), math.pi
    path, buffer = Prediction(PERIOD_S, StandingPlan(), lag_averaging_s=0.1), targets_at(track, start_s, 4.0)
    late = np.round(start_s + PERIOD_S * np.arange(1, 30), 6)
    before = path.at(late, buffer, model, near_rad).position[-1]
    path.clear()
    np.testing.assert_allclose(path.at(late[-1:], buffer, model, near_rad).position[0], before, atol=1e-12)
    path.slew()
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


LAGS_S = np.array([-0.2, -0.3])
LAGGING = MountParams(azimuth_velocity_lag_s=LAGS_S[0], elevation_velocity_lag_s=LAGS_S[1]).model()
RATE = np.radians([0.8, -0.3])
REST = np.zeros(2)
AVERAGING_S = 0.6
LAG_TOLERANCE_RAD = 0.04 * float(np.max(np.abs(LAGS_S * RATE)))
"""Steps of 0.1 s are taken as straight; the mount's own are of 1 ms."""
SIMPLE_S = 5000.0


def placed(t_s: float) -> np.ndarray:
    """A target that moves at `RATE`."""
    return np.array([2.0, 0.7]) + RATE * (t_s - SIMPLE_S)


def path_of(times: np.ndarray) -> Motion:
    return Motion(
        np.array([placed(float(t_s)) for t_s in times]), np.tile(RATE, (len(times), 1)), np.zeros((len(times), 2))
    )


def straight(times: np.ndarray) -> TargetBuffer:
    buffer = TargetBuffer()
    for t_s in times:
        azimuth_rad, elevation_rad = placed(float(t_s))
        buffer.add(
            Target(
                t_s=float(t_s), name="A", azimuth_rad=azimuth_rad, elevation_rad=elevation_rad,
                azimuth_rate_rad_s=RATE[0], elevation_rate_rad_s=RATE[1], azimuth_acceleration_rad_s2=0.0,
                elevation_acceleration_rad_s2=0.0, range_m=1e6, range_rate_m_s=0.0, refraction_rad=0.0,
            )
        )  # fmt: skip
    return buffer


def read(t_s: float, position: np.ndarray, rate: np.ndarray = REST) -> JointReading:
    return JointReading(t_s=round(t_s, 6), position_rad=position, velocity_rad_s=rate)


def lags_of(*pieces: tuple[float, np.ndarray]) -> np.ndarray:
    """The lags of a mount at rest whose beam then has these rates, each for so many seconds."""
    mean = RateAverage(AVERAGING_S)
    for seconds, rate in pieces:
        for _ in range(round(seconds / 1e-3)):
            mean.update(1e-3, rate)
    return np.asarray(LAGS_S * mean.rate_rad_s)


def lags_at(path: Prediction, t_s: float) -> np.ndarray:
    """By what the axes lead the target a period after `t_s`."""
    times = np.round(t_s + PERIOD_S * np.arange(1, 4), 6)
    return np.asarray(path.at(times, straight(times), LAGGING, 2.0).position[0] - placed(float(times[0])))


def changing(before: np.ndarray) -> tuple[tuple[float, np.ndarray], ...]:
    """The period in which the beam goes over from this rate to that of the target."""
    return (0.05, before), (0.05, RATE)


def dragged(path: Prediction, begin_s: float, seconds: float, rate: np.ndarray) -> None:
    """Read axes whose beam moves at this rate, ten times a second."""
    mean = RateAverage(AVERAGING_S)
    for step in range(round(seconds / PERIOD_S) + 1):
        t_s = begin_s + step * PERIOD_S
        # The axes lead the beam by the lags.
        path.take_axes(read(t_s, placed(t_s), rate + LAGS_S * mean.acceleration_rad_s2), LAGGING)
        for _ in range(100):
            mean.update(1e-3, rate)


def test_axes_that_move_before_a_pass_take_their_lags_into_it() -> None:
    """What the encoders show for 0.8 s, with the readings that came; a target that goes on at the same rate."""
    path = Prediction(PERIOD_S, StandingPlan(), AVERAGING_S)
    dragged(path, SIMPLE_S - 0.8, 0.8, RATE)
    wanted = lags_of((0.9, RATE))
    np.testing.assert_allclose(lags_at(path, SIMPLE_S), wanted, atol=LAG_TOLERANCE_RAD)
    assert 0.3 * abs(LAGS_S[0] * RATE[0]) < abs(wanted[0]) < 0.95 * abs(LAGS_S[0] * RATE[0])
    # A reading that was overtaken, and one of the same time, change nothing.
    path.slew()
    for late_s in (0.0, 0.3):
        path.take_axes(read(SIMPLE_S - late_s, placed(SIMPLE_S), -30.0 * RATE), LAGGING)
    np.testing.assert_allclose(lags_at(path, SIMPLE_S), wanted, atol=LAG_TOLERANCE_RAD)


def test_a_slew_forgets_the_lags_of_the_target_and_keeps_those_of_the_axes() -> None:
    path = Prediction(PERIOD_S, StandingPlan(), AVERAGING_S)
    dragged(path, SIMPLE_S - 0.8, 0.8, -2.0 * RATE)
    before = lags_at(path, SIMPLE_S)
    # Without a slew the next block goes on from the last one's, and without one before it from rest.
    path.clear()
    later = lags_at(path, SIMPLE_S + 0.2)
    np.testing.assert_allclose(
        later, lags_of((0.8, -2.0 * RATE), *changing(-2.0 * RATE), (0.2, RATE)), atol=LAG_TOLERANCE_RAD
    )
    path.clear()
    np.testing.assert_allclose(lags_at(path, SIMPLE_S - 5.0), 0.0, atol=1e-9)
    path.slew()
    np.testing.assert_allclose(lags_at(path, SIMPLE_S), before, atol=1e-12)


KNOWN_S = np.round(SIMPLE_S - 2.0 + PERIOD_S * np.arange(21), 6)


def joined(
    seen_from_s: float | None, known: np.ndarray, reading: JointReading, averaging_s: float = AVERAGING_S
) -> np.ndarray:
    """The lags at `SIMPLE_S` of axes that were found with a reading, seen at rest from a time on."""
    path = Prediction(PERIOD_S, StandingPlan(), averaging_s)
    if seen_from_s is not None:
        for t_s in np.arange(seen_from_s, SIMPLE_S + 0.01, PERIOD_S):
            path.take_axes(read(float(t_s), reading.position_rad), LAGGING)
    path.followed(known, path_of(known), reading, LAGGING)
    path.lag_averaging_s = AVERAGING_S
    return lags_at(path, SIMPLE_S)


def test_axes_on_the_path_followed_it_unless_they_were_seen_to_stand() -> None:
    here = read(SIMPLE_S, placed(SIMPLE_S), RATE)
    # The path begins at rest too: 2 s of it are more than three times the average.
    wanted, rest, begun = lags_of((2.1, RATE)), lags_of(*changing(REST)), lags_of((0.0, RATE))
    assert np.all(np.abs(wanted) > 0.5 * np.abs(LAGS_S * RATE))
    np.testing.assert_allclose(joined(None, KNOWN_S, here), wanted, atol=LAG_TOLERANCE_RAD)
    np.testing.assert_allclose(joined(SIMPLE_S - 0.5, KNOWN_S, here), wanted, atol=LAG_TOLERANCE_RAD)
    for seen_from_s in (float(KNOWN_S[0]), float(KNOWN_S[0]) - 1.0):
        np.testing.assert_allclose(joined(seen_from_s, KNOWN_S, here), rest, atol=LAG_TOLERANCE_RAD)
    # Of no time, of one instant, of no average nothing is known: the target begins at once.
    for known in (KNOWN_S[:0], KNOWN_S[-1:]):
        np.testing.assert_allclose(joined(None, known, here), begun, atol=1e-9)
    np.testing.assert_allclose(joined(None, KNOWN_S, here, averaging_s=0.0), begun, atol=1e-9)
    np.testing.assert_allclose(joined(None, KNOWN_S[-2:], here), lags_of((0.2, RATE)), atol=LAG_TOLERANCE_RAD)
    assert np.all(np.abs(lags_of((0.2, RATE))) > 1e-5)


@pytest.mark.parametrize("plunge", [False, True])
def test_near_the_zenith_the_correction_at_the_rim_is_kept(plunge: bool) -> None:
    """A droop that is turned about the zenith has no solution there; the rim is at 85 deg."""
    model = BiasModel.zero().replace(azimuth_offset=0.02, non_orthogonality=math.radians(1.0), droop=math.radians(3.0))
    sky = Motion(np.radians([[20.0, 89.9], [40.0, 89.5]]), np.array([[0.01, 0.02]] * 2), np.array([[0.03, 0.04]] * 2))
    with pytest.raises(ValueError):
        model.apply_moving(*(plunged(*sky) if plunge else sky))
    found = axis_motion(sky, model, plunge=plunge)
    for row, azimuth_deg in enumerate((20.0, 40.0)):
        rim = np.radians([azimuth_deg, 85.0])
        here = sky.position[row]
        if plunge:
            rim, here = (np.array([place[0] + math.pi, math.pi - place[1]]) for place in (rim, here))
        added_rad = np.array(model.apply(*rim, 0.0, 0.0, 0.0, 0.0)) - rim
        # On whichever turn the model puts it.
        away = found.position[row] - here - added_rad
        assert math.remainder(away[0], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
        assert away[1] == pytest.approx(0.0, abs=1e-9)
    # Over the top the elevation runs the other way.
    np.testing.assert_allclose(found.velocity, [[0.01, -0.02 if plunge else 0.02]] * 2)
    np.testing.assert_allclose(found.acceleration, [[0.03, -0.04 if plunge else 0.04]] * 2)
