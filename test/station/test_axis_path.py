"""Blocks of axis motion against the motion computed for the instants themselves."""

import math

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.station.axis_path import RATE_LAGS, AxisPath, held, without_lags
from rf_pointing.station.mount import MountParams, RateAverage
from rf_pointing.station.target_buffer import TargetBuffer

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


def targets_at(track: TopocentricTrack, start_s: float, seconds: float) -> TargetBuffer:
    buffer = TargetBuffer()
    for step in range(round(seconds / PERIOD_S) + 1):
        buffer.add(track.target_at(round(start_s + step * PERIOD_S, 6)))
    return buffer


def test_every_period_gets_the_motion_computed_for_its_own_instants(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    start_s, near_rad = round(window.tca_t_s, 1), math.pi
    path, buffer = AxisPath(PERIOD_S), targets_at(track, start_s, 4.0)
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
    motion = AxisPath(PERIOD_S).at(np.array([t_s]), buffer, BiasModel.zero(), near_rad)
    wanted = track.target_at(t_s).azimuth_rad
    assert motion.position[0, 0] == pytest.approx(wanted + 2.0 * math.pi * turns, abs=SAME_RAD)


def test_after_clear_a_new_model_is_used(track: TopocentricTrack, window: Pass, model: BiasModel) -> None:
    t_s = round(window.tca_t_s, 1)
    times, path, buffer = np.array([t_s]), AxisPath(PERIOD_S), targets_at(track, t_s, 1.0)
    before = path.at(times, buffer, BiasModel.zero(), math.pi)
    assert np.array_equal(path.at(times, buffer, model, math.pi).position, before.position)
    path.clear()
    assert not np.allclose(path.at(times, buffer, model, math.pi).position, before.position, atol=1e-4)


def test_instants_that_are_not_covered_are_refused(track: TopocentricTrack, window: Pass) -> None:
    t_s = round(window.tca_t_s, 1)
    with pytest.raises(ValueError, match="is outside the known motion"):
        AxisPath(PERIOD_S).at(np.array([t_s + 5.0]), targets_at(track, t_s, 1.0), BiasModel.zero(), math.pi)


def test_lags_build_up_from_rest_without_a_step_and_end_at_those_of_steady_motion(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    # Lags and averaging time a tenth of the mount's: the rates hardly change before the lags are there.
    start_s, averaging_s, near_rad = round(window.tca_t_s, 1), 0.5, math.pi
    model = model.replace(**{name: 0.1 * value for name, value in model.coefficients.items() if name.endswith("_lag")})
    lags_s = np.array([model.coefficients[name] for name in RATE_LAGS])
    path, buffer = AxisPath(PERIOD_S, lag_averaging_s=averaging_s), targets_at(track, start_s, 4.9)
    times = np.round(start_s + PERIOD_S * np.arange(1, 46), 6)
    got = path.at(times, buffer, model, near_rad)
    steady, still = held(buffer.at(times), model, near_rad), held(buffer.at(times), without_lags(model), near_rad)
    lag = steady.position[0] - still.position[0]
    assert np.max(np.abs(lag)) > math.radians(0.01)
    np.testing.assert_allclose(got.position[0], still.position[0], atol=1e-12)
    # All the way the lag is there by the share of a mount whose axes go from rest to a steady rate.
    mount, steps_a_row, shares = RateAverage(averaging_s), 1000, [np.zeros(2)]
    for _ in times[1:]:
        for _ in range(steps_a_row):
            mount.update(PERIOD_S / steps_a_row, 1.0 - lags_s * mount.acceleration_rad_s2)
        shares.append(mount.rate_rad_s)
    wanted = still.position + np.array(shares) * (steady.position - still.position)
    np.testing.assert_allclose(got.position, wanted, atol=2e-4 * float(np.max(np.abs(lag))))
    # Position, velocity and acceleration belong to one motion (Hermite's rule of the fifth order).
    steps = 0.5 * PERIOD_S * (got.velocity[1:] + got.velocity[:-1])
    steps += PERIOD_S**2 / 12.0 * (got.acceleration[:-1] - got.acceleration[1:])
    np.testing.assert_allclose(np.diff(got.position, axis=0), steps, atol=5e-8)


def test_a_new_model_in_the_middle_of_a_pass_does_not_start_the_lags_again(
    track: TopocentricTrack, window: Pass, model: BiasModel
) -> None:
    start_s, near_rad = round(window.tca_t_s, 1), math.pi
    path, buffer = AxisPath(PERIOD_S, lag_averaging_s=0.1), targets_at(track, start_s, 4.0)
    path.at(np.array([start_s]), buffer, model, near_rad)
    path.clear()
    late = np.array([start_s + 3.0])
    np.testing.assert_allclose(
        path.at(late, buffer, model, near_rad).position, held(buffer.at(late), model, near_rad).position, atol=1e-12
    )
    path.restart()
    np.testing.assert_allclose(
        path.at(late, buffer, model, near_rad).position,
        held(buffer.at(late), without_lags(model), near_rad).position,
        atol=1e-12,
    )
