"""The author of motion: which pass it begins, on which turn and on whose word, and when it ends."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, PointingError
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.planning import AxisLimits
from rf_pointing.station.pointing.controller import PLAN_PATIENCE_S, PointingController
from rf_pointing.station.pointing.status import Level

Rig = Any
MakeRig = Callable[..., Rig]
MakeController = Callable[..., PointingController]


def still(azimuth_rad: float, elevation_rad: float, t_s: float = 0.0) -> JointReading:
    return JointReading(t_s=t_s, position_rad=[azimuth_rad, elevation_rad], velocity_rad_s=[0.0, 0.0])


def test_a_model_that_turns_the_beam_out_of_what_the_axes_guard_is_doubted(make_controller: MakeController) -> None:
    controller = make_controller()
    clearance_rad = controller.params.mask.clearance_rad
    sun_rad = controller.params.machine.sun_radius_rad
    assert 0.5 * sun_rad < clearance_rad
    controller.take_model(BiasModel.zero().replace(elevation_offset=0.49 * sun_rad))
    assert controller.model_doubt == ""
    controller.take_model(BiasModel.zero().replace(elevation_offset=-0.51 * sun_rad))
    assert controller.model_doubt.startswith("the bias model holds the beam 0.51 deg off the axes at azimuth ")
    assert controller.model_doubt.endswith(
        "must be <= 0.50 deg: horizon and Sun are judged by the axes; set the zero of the drive"
    )
    low = dataclasses.replace(controller.params.mask, clearance_rad=0.2 * sun_rad)
    controller.retune(dataclasses.replace(controller.params, mask=low))
    controller.take_model(BiasModel.zero().replace(elevation_offset=0.3 * sun_rad))
    assert "0.30 deg off the axes" in controller.model_doubt
    assert "<= 0.20 deg" in controller.model_doubt


# Which turn


@pytest.mark.parametrize("turns", [-1, 0])
def test_the_pass_is_tracked_on_the_turn_nearest_to_the_antenna(
    make_controller: MakeController, window: Pass, turns: int
) -> None:
    """Travel of +-400 deg offers two turns for any pass."""
    wide = AxisLimits(azimuth_min_rad=math.radians(-400.0), azimuth_max_rad=math.radians(400.0))
    controller, wanted_rad = make_controller(limits=wide), window.aos_azimuth_rad + turns * 2.0 * math.pi
    controller.take_joints(still(wanted_rad + 0.3, 1.0))
    controller.start(window.aos_t_s - 100.0, window, "program")
    trajectory, _ = controller.step(window.aos_t_s - 99.9)
    assert trajectory is not None
    np.testing.assert_allclose(trajectory.position_rad[:, 0], wanted_rad, atol=1e-4)


def test_a_pass_that_fits_no_turn_is_refused_at_the_start(make_controller: MakeController, window: Pass) -> None:
    controller = make_controller(limits=AxisLimits(azimuth_min_rad=-1.0, azimuth_max_rad=1.0))
    controller.take_joints(still(0.0, 1.0))
    with pytest.raises(ValueError, match=r"no branch works; the nearest, .* would be lost"):
        controller.start(window.aos_t_s, window, "program")
    assert not controller.busy


# No pass without a certificate


@pytest.mark.parametrize("known", ["joint_states", "pass_profiles"])
def test_a_pass_whose_certificate_cannot_be_made_is_refused_with_what_is_missing(
    make_controller: MakeController, window: Pass, known: str
) -> None:
    controller, t_s = make_controller(), window.aos_t_s - 100.0
    if known == "joint_states":
        controller.plan.take_profiles([])
    controller.start(t_s, window, "program")
    for step in range(1, 400):
        if known == "joint_states":
            controller.take_joints(still(2.0, 1.0, t_s + 0.1 * step))
        trajectory, status = controller.step(t_s + 0.1 * step)
        if not controller.busy:
            break
        assert trajectory is None
    assert 0.1 * step == pytest.approx(PLAN_PATIENCE_S, abs=0.2)
    what = {"joint_states": "the profile of this pass of CBERS 2 (pass_profiles)",
            "pass_profiles": "the position of the axes (joint_states)"}[known]  # fmt: skip
    assert status.reason == controller.statistics.reason == f"no certificate: {what} has not arrived in 10 s"
    assert controller.plan.certificate is None


# Refusals of a start


def test_a_pass_that_is_over_is_refused(make_controller: MakeController, window: Pass) -> None:
    with pytest.raises(ValueError, match=r"the pass of CBERS 2 ended 10 s ago"):
        make_controller().start(window.los_t_s + 10.0, window, "program")


def test_a_second_pass_is_refused_while_one_is_tracked(rig: MakeRig, window: Pass) -> None:
    made = rig()
    with pytest.raises(ValueError, match="CBERS 2 is being tracked until its loss of signal"):
        made.controller.start(window.aos_t_s, window, "program")


def test_an_unknown_sensor_is_refused(make_controller: MakeController, window: Pass) -> None:
    with pytest.raises(
        ValueError, match="sensor='radar' must be one of program, monopulse, conscan, steptrack, array, auto"
    ):
        make_controller().start(window.aos_t_s, window, "radar")


# Ends of a pass


def test_beyond_its_prediction_the_axes_wait_at_rest_and_go_on_by_themselves(rig: MakeRig, window: Pass) -> None:
    """The prediction reaches 2 s ahead and is followed until three points are left of it: 1.7 s."""
    made, t_s = rig(), window.aos_t_s + 3.0
    list(made.run(window.aos_t_s, 3.0))
    made.controller.plan.profile = None
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


def test_a_pass_that_is_going_on_is_joined_on_its_profile(rig: MakeRig, window: Pass) -> None:
    """The targets come two seconds ahead, so for two seconds the present is not covered by them."""
    begin_s = window.tca_t_s
    made = rig(start_s=begin_s, azimuth_rad=0.5 * (window.azimuth_min_rad + window.azimuth_max_rad))
    rows = list(made.run(begin_s, 8.0))
    assert rows[0][2].mode == "slew"
    assert all(trajectory is not None for _, trajectory, _ in rows)
    assert rows[-1][2].mode == "program_track"


@pytest.mark.parametrize("rate_rad_s", [5.0, 1e13, -1e150])
def test_a_rate_that_no_mount_has_does_not_end_the_joining_of_a_pass(
    rig: MakeRig, window: Pass, rate_rad_s: float
) -> None:
    begin_s = window.tca_t_s
    made = rig(start_s=begin_s, azimuth_rad=0.5 * (window.azimuth_min_rad + window.azimuth_max_rad))
    mad = JointReading(t_s=begin_s, position_rad=made.position_rad, velocity_rad_s=[rate_rad_s, rate_rad_s])
    made.controller.take_joints(mad)
    trajectory, status = made.controller.step(begin_s + 0.1)
    assert status.mode == "slew"
    assert float(np.max(np.abs(trajectory.position_rad - made.position_rad))) < math.pi
    assert list(made.run(begin_s + 0.1, 8.0))[-1][2].mode == "program_track"


# What is published


def test_the_status_is_what_target_axes_and_pass_give(rig: MakeRig, window: Pass, track: TopocentricTrack) -> None:
    made = rig()
    assert made.controller.step(window.aos_t_s - 0.05)[1].command_lead_s == 1.0
    *_, (t_s, trajectory, status) = made.run(window.aos_t_s, 8.0)
    look = track.target_at(t_s)
    assert (status.mode, status.sensor, status.target, status.los_t_s) == (
        "program_track", "none", window.name, window.los_t_s,
    )  # fmt: skip
    assert math.remainder(status.azimuth_rad - look.azimuth_rad, math.tau) == pytest.approx(0.0, abs=1e-8)
    assert status.elevation_rad == pytest.approx(look.elevation_rad, abs=1e-8)
    np.testing.assert_allclose(status.scan_centre_rad, made.position_rad, atol=1e-9)
    np.testing.assert_allclose([status.cross_elevation_error_rad, status.elevation_error_rad], 0.0, atol=1e-8)
    np.testing.assert_array_equal(status.offset_rad, [0.0, 0.0])
    assert (status.carrier_to_noise_db_hz, status.command_lead_s) == (0.0, 1.0)
    assert status.half_power_beamwidth_rad == made.controller.params.spiral.half_power_beamwidth_rad
    assert (status.held, status.on_source, status.axis_age_s) == (True, True, 0.0)
    assert status.settle_count > 60
    assert status.seconds_tracked_s == pytest.approx(8.0, abs=0.35)
    assert status.seconds_lost_s == pytest.approx(8.0 - status.seconds_tracked_s, abs=0.11)
    assert status.mean_loss_db == made.controller.statistics.outcome.mean_loss_db < 0.1
    assert (status.level, status.alarm) == (Level.OK, "")
    # Axes that stay behind by a mrad show it, with the great circle.
    off = np.array([1e-3, -2e-3])
    made.controller.take_joints(still(*(trajectory.position_rad[0] - off), t_s=round(t_s + 0.1, 6)))
    made.controller.take_target(track.target_at(round(t_s + 2.1, 6)))
    status = made.controller.step(round(t_s + 0.1, 6))[1]
    right = off[0] * math.cos(trajectory.position_rad[0, 1])
    np.testing.assert_allclose(status.axis_error_rad, [right, off[1]], rtol=0.01)
    assert status.axis_distance_rad == pytest.approx(math.hypot(right, off[1]), rel=0.01)
    assert status.cross_elevation_error_rad == pytest.approx(right, rel=0.01)
    assert (status.on_source, status.settle_count) == (False, 0)


def measured(t_s: float, sensor: str = "monopulse", **changes: Any) -> PointingError:
    given = {"t_s": round(t_s, 6), "sensor": sensor, "cross_elevation_rad": 1e-5, "elevation_rad": -2e-5,
        "covariance_rad2": 1e-10 * np.eye(2), "carrier_to_noise_db_hz": 60.0}  # fmt: skip
    return PointingError(**(given | changes))


def test_the_error_of_the_sensor_in_use_is_shown_and_no_other(rig: MakeRig, window: Pass) -> None:
    made = rig("monopulse")
    shown = {}
    for t_s, _, status in made.run(window.aos_t_s, 5.0, lambda t_s, _rig: [measured(t_s - 0.1)]):
        shown[status.mode] = (status.cross_elevation_error_rad, status.elevation_error_rad)
        if t_s > window.aos_t_s + 1.0:
            assert status.carrier_to_noise_db_hz == 60.0
    assert shown["monopulse"] == (1e-5, -2e-5)
    assert shown["program_track"] == pytest.approx((0.0, 0.0), abs=1e-8)
    # What the loop has learned of it, as a pair.
    assert status.cross_elevation_offset_rad > 1e-7
    np.testing.assert_array_equal(status.offset_rad, [status.cross_elevation_offset_rad, status.elevation_offset_rad])
    assert status.elevation_offset_rad < -1e-7
    # One that is not valid is not shown, its level is.
    weak = measured(t_s, valid=False, reason="weak", carrier_to_noise_db_hz=59.0)
    _, status = made.period(round(t_s + 0.1, 6), [weak])
    assert status.carrier_to_noise_db_hz == 59.0
    assert abs(status.elevation_error_rad + 2e-5) > 1e-6


def test_a_fault_of_the_antenna_is_shown_until_its_reset_and_one_of_the_watch_until_the_next_pass(
    make_controller: MakeController,
) -> None:
    controller = make_controller()
    for own, antenna, expected in (
        ("", "", (Level.OK, "")), ("", "brake", (Level.ERROR, "antenna fault: brake")),
        ("the axes run away", "", (Level.ERROR, "the axes run away")),
        ("the axes run away", "brake", (Level.ERROR, "antenna fault: brake")), ("antenna fault: brake", "", (Level.OK, "")),
    ):  # fmt: skip
        controller.statistics.fault = own
        controller.take_antenna("holding", antenna)
        status = controller.step(10.0)[1]
        assert (status.level, status.alarm) == expected


# What the link cannot give


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


# From one pass to the next, and through stalls


def test_a_fault_of_the_antenna_refuses_a_pass_and_ends_one(rig: MakeRig, window: Pass) -> None:
    made = rig()
    *_, (t_s, _, _) = made.run(window.aos_t_s, 2.0)
    made.controller.take_antenna("fault", "brake")
    halt, status = made.period(round(t_s + 0.1, 6))
    assert halt.position_rad.shape == (1, 2)
    assert (status.mode, status.reason) == ("idle", "antenna fault: brake")
    assert made.controller.statistics.fault == made.controller.statistics.reason == "antenna fault: brake"
    with pytest.raises(ValueError, match=r"the antenna has a latched fault \(brake\); reset it first"):
        made.controller.start(round(t_s + 0.2, 6), window, "program")
    assert not made.controller.busy
    made.controller.take_antenna("holding", "")
    made.controller.start(round(t_s + 0.2, 6), window, "program")
    assert made.controller.statistics.fault == ""
    # A stop that was asked for is not replaced by what comes with it.
    made.controller.stop("stop was requested")
    made.controller.take_antenna("fault", "brake")
    assert made.period(round(t_s + 0.3, 6))[1].reason == "stop was requested"
