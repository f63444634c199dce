"""What is commanded ahead of time: the target through the bias model, within the limits, and rest at the end.

Offsets led against the mount's lags: the simulated mount's beam goes where the offset says.
"""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import MDEG, nearest_turn_rad
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.planning import AxisLimits
from rf_pointing.station.antenna.mount import MountError, MountParams, RateAverage
from rf_pointing.station.pointing.motion import CorrectionLag
from rf_pointing.station.pointing.params import PointingParams

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
