"""The author of motion: which pass it begins, on which turn and on whose word, and when it ends."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import JointReading, PointingError
from rf_pointing.ephemeris import Pass
from rf_pointing.planning import AxisLimits
from rf_pointing.rf import LinkParams
from rf_pointing.station.pointing.controller import PREDICTION_PATIENCE_S, PointingController

Rig = Any
MakeRig = Callable[..., Rig]
MakeController = Callable[..., PointingController]


def still(azimuth_rad: float, elevation_rad: float, t_s: float = 0.0) -> JointReading:
    return JointReading(t_s=t_s, position_rad=[azimuth_rad, elevation_rad], velocity_rad_s=[0.0, 0.0])


def test_nothing_is_commanded_without_a_pass(make_controller: MakeController) -> None:
    controller = make_controller()
    controller.take_joints(still(1.0, 1.0))
    trajectory, status = controller.step(0.0)
    assert trajectory is None
    assert status.mode == "idle"
    assert not controller.busy


# Which turn


def in_overlap(window: Pass) -> Pass:
    """The same pass turned to where +-220 deg of travel offer two turns."""
    low = math.radians(150.0)
    return dataclasses.replace(window, aos_azimuth_rad=low, azimuth_min_rad=low, azimuth_max_rad=math.radians(200.0))


@pytest.mark.parametrize(
    ("standing_deg", "wanted_deg"), [(175.0, 150.0), (-185.0, -210.0), (-30.0, -210.0), (30.0, 150.0)]
)
def test_the_pass_is_tracked_on_the_turn_nearest_to_the_antenna(
    make_controller: MakeController, window: Pass, standing_deg: float, wanted_deg: float
) -> None:
    controller = make_controller()
    controller.take_joints(still(math.radians(standing_deg), 1.0))
    controller.start(window.aos_t_s - 100.0, in_overlap(window), "program")
    trajectory, _ = controller.step(window.aos_t_s - 99.9)
    assert trajectory is not None
    np.testing.assert_allclose(np.degrees(trajectory.position_rad[:, 0]), wanted_deg, atol=1e-9)


def test_the_turn_is_chosen_once_the_axes_are_known(make_controller: MakeController, window: Pass) -> None:
    controller, t_s = make_controller(), window.aos_t_s - 100.0
    controller.start(t_s, in_overlap(window), "program")
    assert controller.step(t_s + 0.1)[0] is None
    controller.take_joints(still(math.radians(-170.0), 1.0))
    trajectory, _ = controller.step(t_s + 0.2)
    assert trajectory is not None
    assert np.degrees(trajectory.position_rad[0, 0]) == pytest.approx(-210.0)


def test_a_pass_that_fits_no_turn_is_refused_at_the_start(make_controller: MakeController, window: Pass) -> None:
    controller = make_controller(limits=AxisLimits(azimuth_min_rad=-1.0, azimuth_max_rad=1.0))
    controller.take_joints(still(0.0, 1.0))
    with pytest.raises(ValueError, match="fits no turn within the travel"):
        controller.start(window.aos_t_s, window, "program")
    assert not controller.busy


def test_a_pass_that_fits_no_turn_ends_when_the_axes_become_known(
    make_controller: MakeController, window: Pass
) -> None:
    controller = make_controller(limits=AxisLimits(azimuth_min_rad=-1.0, azimuth_max_rad=1.0))
    controller.start(window.aos_t_s - 10.0, window, "program")
    controller.take_joints(still(0.0, 1.0))
    _, status = controller.step(window.aos_t_s - 9.9)
    assert "fits no turn" in status.reason
    assert not controller.busy


def test_a_pass_above_the_elevation_limit_is_refused(make_controller: MakeController, window: Pass) -> None:
    controller = make_controller(limits=AxisLimits(elevation_max_rad=math.radians(40.0)))
    controller.take_joints(still(2.0, 0.5))
    with pytest.raises(ValueError, match=r"elevation 44\.309 deg is 4\.309 deg past the limit 40\.000 deg"):
        controller.start(window.aos_t_s, window, "program")


# Refusals of a start


def test_a_pass_that_is_over_is_refused(make_controller: MakeController, window: Pass) -> None:
    with pytest.raises(ValueError, match=r"the pass of CBERS 2 ended 10 s ago"):
        make_controller().start(window.los_t_s + 10.0, window, "program")


def test_a_second_pass_is_refused_while_one_is_tracked(rig: MakeRig, window: Pass) -> None:
    made = rig()
    with pytest.raises(ValueError, match="CBERS 2 is being tracked until its loss of signal"):
        made.controller.start(window.aos_t_s, window, "program")


def test_an_unknown_sensor_is_refused(make_controller: MakeController, window: Pass) -> None:
    with pytest.raises(ValueError, match="sensor='radar' must be one of program, monopulse, conscan, steptrack, auto"):
        make_controller().start(window.aos_t_s, window, "radar")


# Ends of a pass


def test_the_pass_ends_at_loss_of_signal(rig: MakeRig, window: Pass) -> None:
    made = rig(start_s=window.los_t_s - 8.0)
    assert made.controller.busy
    reasons = [status.reason for t_s, _, status in made.run(window.los_t_s - 8.0, 8.2) if t_s >= window.los_t_s]
    assert reasons[0] == "loss of signal"
    assert made.controller.statistics.reason == "loss of signal"


def test_without_a_prediction_the_axes_wait_at_rest_and_go_on_by_themselves(rig: MakeRig, window: Pass) -> None:
    """The prediction reaches 2 s ahead and is followed until three points are left of it: 1.7 s."""
    made, t_s = rig(), window.aos_t_s + 3.0
    list(made.run(window.aos_t_s, 3.0))
    for step in range(1, 60):
        at_s = round(t_s + 0.1 * step, 6)
        made.move(at_s)
        made.controller.take_joints(still(*made.position_rad, t_s=at_s))
        trajectory, status = made.controller.step(at_s)
        made.latest = trajectory or made.latest
        if status.mode == "idle":
            break
    assert step * 0.1 == pytest.approx(1.8)
    assert status.reason == "the target is no longer available"
    assert trajectory.position_rad.shape == (1, 2), "at rest"
    assert made.controller.busy
    lost_s = made.controller.statistics.outcome.lost_s
    *_, (_, trajectory, status) = made.run(at_s, 4.0)
    assert (status.mode, status.held, len(trajectory.t_s)) == ("program_track", True, 10)
    assert made.controller.statistics.outcome.lost_s - lost_s < 3.0


def test_a_pass_that_is_going_on_is_joined_once_the_target_is_known(rig: MakeRig, window: Pass) -> None:
    """The prediction comes two seconds ahead, so for two seconds the present is not covered."""
    begin_s = window.tca_t_s
    made = rig(start_s=begin_s)
    modes = []
    for t_s, trajectory, status in made.run(begin_s, 4.0):
        modes.append(status.mode)
        assert (trajectory is None) == (status.mode == "idle")
        assert made.controller.busy
        assert status.mode != "idle" or t_s - begin_s < 2.2
    assert modes[0] == "idle"
    assert modes[-1] == "program_track"


def test_a_pass_without_any_prediction_is_given_up(make_controller: MakeController, window: Pass) -> None:
    controller, begin_s = make_controller(), window.tca_t_s
    controller.take_joints(still(1.3, 0.7, begin_s))
    controller.start(begin_s, window, "program")
    for step in range(1, 300):
        controller.take_joints(still(1.3, 0.7, begin_s + 0.1 * step))
        trajectory, status = controller.step(begin_s + 0.1 * step)
        if not controller.busy:
            break
        assert trajectory is None
    assert status.reason == "no prediction of the target has arrived"
    assert 0.1 * step == pytest.approx(PREDICTION_PATIENCE_S, abs=0.2)


# What the link cannot give


def test_a_sensor_whose_gate_the_link_never_opens_is_refused_in_words(
    make_controller: MakeController, window: Pass
) -> None:
    faint = LinkParams(zenith_carrier_to_noise_db_hz=30.0, reference_range_m=window.smallest_range_m)
    with pytest.raises(
        ValueError, match=r"sensor=monopulse needs a carrier of 36.0 dB-Hz; the link gives at most 30.0"
    ):
        make_controller(link=faint).start(window.aos_t_s - 10.0, window, "monopulse")
    silent = faint.replace(zenith_carrier_to_noise_db_hz=12.0)
    for sensor in ("conscan", "steptrack", "auto"):
        make_controller(link=faint).start(window.aos_t_s - 10.0, window, sensor)
        with pytest.raises(ValueError, match=rf"sensor={sensor} needs a carrier of 22.0 dB-Hz"):
            make_controller(link=silent).start(window.aos_t_s - 10.0, window, sensor)
    make_controller(link=silent).start(window.aos_t_s - 10.0, window, "program")
    unknown = dataclasses.replace(window, smallest_range_m=0.0)
    make_controller(link=silent).start(window.aos_t_s - 10.0, unknown, "monopulse")


def test_errors_of_an_unregistered_sensor_are_refused_with_its_name_and_keep_the_lock(
    rig: MakeRig, window: Pass
) -> None:
    made = rig("auto")
    modes = set()
    for step in range(300):
        t_s = round(window.aos_t_s + 0.1 * (step + 1), 6)
        measured = PointingError(
            t_s=round(t_s - 0.1, 6), sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=0.0,
            covariance_rad2=1e-10 * np.eye(2), carrier_to_noise_db_hz=60.0,
        )  # fmt: skip
        # Off by a degree, with no carrier: followed it would move the beam, used it would end the lock.
        foreign = dataclasses.replace(measured, sensor="radar", elevation_rad=0.02, carrier_to_noise_db_hz=0.0)
        with pytest.raises(ValueError, match="sensor='radar' must be one of monopulse, conscan, steptrack"):
            made.controller.take_error(foreign)
        _, status = made.period(t_s, [measured])
        if step > 20:
            modes.add(status.mode)
    assert modes == {"monopulse"}
