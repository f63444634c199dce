"""The target's coming motion as a continuous function, against the track it was sampled from."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.core import Target
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.station.pointing.target_buffer import KEPT_S, LARGEST_GAP_S, TargetBuffer

INTERPOLATION_RAD = 1e-10


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
