"""The author of motion: which pass it begins, on which turn and on whose word, and when it ends."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, PointingError
from rf_pointing.ephemeris import Pass, SatelliteAntennaParams, TopocentricTrack
from rf_pointing.planning import AxisLimits
from rf_pointing.planning.certificate_text import certificate_lines
from rf_pointing.rf import LinkParams
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.controller import PLAN_PATIENCE_S, PointingController, _motion_of
from rf_pointing.station.pointing.params import AlarmParams, ControllerParams
from rf_pointing.station.pointing.scan_patterns import array_cost, sensor_cost
from rf_pointing.station.pointing.status import Level
from rf_pointing.tracking import SkyMotion
from rf_pointing.tracking.sensors import SENSORS

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
    with pytest.raises(ValueError, match=r"no branch works; the nearest, .* past the limit azimuth"):
        controller.start(window.aos_t_s, window, "program")
    assert not controller.busy


# No pass without a certificate


def test_nothing_moves_until_axes_and_profile_are_known(make_controller: MakeController, window: Pass) -> None:
    """They come in either order, some seconds late, and the pass goes on as if they had been there."""
    for axes_s, profile_s in ((3.0, 7.0), (7.0, 3.0)):
        controller, t_s = make_controller(), window.aos_t_s - 100.0
        profiles = controller.plan._profiles
        controller.plan.take_profiles([])
        controller.start(t_s, window, "program")
        for step in range(1, 100):
            if step * 0.1 >= axes_s:
                controller.take_joints(still(window.aos_azimuth_rad - 0.3, 1.0, t_s + 0.1 * step))
            if step * 0.1 >= profile_s:
                controller.plan.take_profiles(profiles)
            trajectory, status = controller.step(t_s + 0.1 * step)
            complete = step * 0.1 >= max(axes_s, profile_s)
            assert (trajectory is not None) == complete == (controller.plan.certificate is not None)
            missing = "" if complete else "joint_states" if step * 0.1 < axes_s else "pass_profiles"
            assert missing in controller.missing
            assert missing in status.alarm
            assert (status.level > 0) == (not complete)
            assert status.mode == ("slew" if complete else "idle")


def test_a_piece_of_a_pass_has_a_certificate_of_its_own(make_controller: MakeController, window: Pass) -> None:
    """Campaigns track pieces of the passes that are predicted."""
    controller, begin_s = make_controller(), window.aos_t_s + 200.0
    piece = dataclasses.replace(window, aos_t_s=begin_s, los_t_s=begin_s + 105.0)
    controller.take_joints(still(window.aos_azimuth_rad, 1.0))
    controller.start(begin_s - 100.0, piece, "program")
    certificate = controller.plan.certificate
    assert certificate is not None
    assert certificate.chosen is not None
    assert controller.plan.profile is not None
    assert (controller.plan.profile.t_s[0], controller.plan.profile.t_s[-1]) == (begin_s, begin_s + 105.0)


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


def test_a_pass_that_fits_no_turn_ends_when_the_axes_become_known(
    make_controller: MakeController, window: Pass
) -> None:
    controller = make_controller(limits=AxisLimits(azimuth_min_rad=-1.0, azimuth_max_rad=1.0))
    controller.start(window.aos_t_s - 10.0, window, "program")
    controller.take_joints(still(0.0, 1.0))
    _, status = controller.step(window.aos_t_s - 9.9)
    assert "no branch works" in status.reason
    assert not controller.busy


def test_a_pass_above_the_elevation_limit_is_refused(make_controller: MakeController, window: Pass) -> None:
    controller = make_controller(limits=AxisLimits(elevation_max_rad=math.radians(20.0)))
    controller.take_joints(still(2.0, 0.5))
    with pytest.raises(ValueError, match=r"no branch works; the nearest, .* would be lost"):
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
    with pytest.raises(
        ValueError, match="sensor='radar' must be one of program, monopulse, conscan, steptrack, array, auto"
    ):
        make_controller().start(window.aos_t_s, window, "radar")


# Ends of a pass


def test_the_pass_ends_at_loss_of_signal(rig: MakeRig, window: Pass) -> None:
    made = rig(start_s=window.los_t_s - 8.0, azimuth_rad=window.los_azimuth_rad)
    assert made.controller.busy
    reasons = [status.reason for t_s, _, status in made.run(window.los_t_s - 8.0, 8.2) if t_s >= window.los_t_s]
    assert reasons[0] == "loss of signal"
    assert made.controller.statistics.reason == "loss of signal"


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


def test_the_way_to_the_target_is_judged_once_and_again_after_a_stall(
    rig: MakeRig, window: Pass, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin_s, judged = window.tca_t_s, []
    away_rad = 0.5 * (window.azimuth_min_rad + window.azimuth_max_rad) + 1.0
    made = rig(start_s=begin_s, azimuth_rad=away_rad)
    plan = made.controller.plan
    chase = plan.gate.chase
    monkeypatch.setattr(plan.gate, "chase", lambda *given: judged.append(given) or chase(*given))
    for step in range(1, 6):
        made.controller.take_joints(still(away_rad, window.aos_elevation_rad, begin_s + 0.1 * step))
        _, status = made.controller.step(begin_s + 0.1 * step)
    assert (status.mode, len(judged)) == ("slew", 1)
    for late_s in (4.0, 4.1):
        made.controller.take_joints(still(away_rad, window.aos_elevation_rad, begin_s + late_s))
        _, status = made.controller.step(begin_s + late_s)
    assert (status.mode, len(judged)) == ("slew", 2)


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


def test_without_a_pass_the_status_names_none(make_controller: MakeController) -> None:
    controller = make_controller()
    status = controller.step(50.0)[1]
    assert (status.target, status.los_t_s, status.command_lead_s, status.axis_age_s) == ("", 0.0, 0.0, -1.0)
    assert not status.on_source
    np.testing.assert_array_equal(status.axis_error_rad, [0.0, 0.0])
    controller.take_joints(still(1.0, 1.0, 50.0))
    assert controller.step(50.3)[1].axis_age_s == pytest.approx(0.3)


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


LOST = AlarmParams(lost_warning_s=1.0, lost_error_s=20.0)


@pytest.mark.parametrize(
    ("lost_s", "level"), [(0.9, Level.OK), (1.1, Level.WARN), (19.9, Level.WARN), (20.1, Level.ERROR)]
)
def test_a_target_that_is_not_held_is_a_warning_and_then_an_error(
    rig: MakeRig, window: Pass, lost_s: float, level: Level
) -> None:
    made = rig(alarm=LOST)
    *_, (t_s, _, _) = made.run(window.aos_t_s, 25.0)
    controller, axes = made.controller, made.controller.antenna.state
    controller.statistics.held_t_s = t_s - lost_s
    found = controller._alarm_of(t_s, window, axes)
    assert found[0] == level
    assert (f"the target has not been held for {lost_s:.1f} s: program_track" in found[1]) is (level > Level.OK)
    # Counted from the beginning of the pass, or from when it was joined.
    controller.statistics.held_t_s = -math.inf
    controller.statistics.begun_t_s = t_s - lost_s
    assert controller._alarm_of(t_s, window, axes)[0] == level
    controller.statistics.begun_t_s = -math.inf
    assert controller._alarm_of(window.aos_t_s + lost_s, window, axes)[0] == level
    assert controller._alarm_of(window.aos_t_s - 1.0, window, axes) == (Level.OK, "")


def test_what_is_wrong_comes_in_the_order_of_its_weight(rig: MakeRig, window: Pass) -> None:
    made = rig()
    *_, (t_s, _, _) = made.run(window.aos_t_s, 5.0)
    controller, axes = made.controller, made.controller.antenna.state
    assert controller._alarm_of(t_s, window, axes) == (Level.OK, "")
    doubted = dataclasses.replace(axes, doubt="silent")
    assert controller._alarm_of(t_s, window, doubted) == (Level.ERROR, "silent")
    assert controller._alarm_of(t_s, window, dataclasses.replace(doubted, fault="frozen")) == (Level.ERROR, "frozen")
    state = controller.state
    for mode, level in (
        ("search", Level.WARN), ("coast", Level.WARN), ("hand_back", Level.WARN), ("monopulse", Level.OK),
    ):  # fmt: skip
        controller._mode.state = dataclasses.replace(state, mode=mode, reason="why")
        assert controller._alarm_of(t_s, window, axes) == (level, f"{mode}: why" if level else "")
    controller._mode.state = state
    # Targets are known 2 s ahead and commanded 1 s ahead.
    held = controller.statistics
    for late_s in (0.9, 1.4):
        held.held_t_s = t_s + late_s
        level, words = controller._alarm_of(t_s + late_s, window, axes)
        assert (level, words[:20]) == ((Level.OK, "") if late_s < 1.0 else (Level.WARN, "no target for 0.4 s:"))


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


@pytest.mark.parametrize(
    ("sensor", "level_db_hz", "used"),
    [("program", 60.0, None), ("monopulse", 60.0, "monopulse"), ("auto", 36.1, "monopulse"), ("auto", 35.9, "conscan"),
     ("conscan", 60.0, "conscan"), ("steptrack", 60.0, "steptrack")],
)  # fmt: skip
def test_the_certificate_counts_what_the_sensor_costs_for_which_the_link_is_enough(
    make_controller: MakeController,
    track: TopocentricTrack,
    window: Pass,
    sensor: str,
    level_db_hz: float,
    used: str | None,
) -> None:
    link = LinkParams(zenith_carrier_to_noise_db_hz=level_db_hz, reference_range_m=window.smallest_range_m)
    controller, profile = make_controller(link=link), pass_profile(track, window)
    found = controller._cost(sensor, window, profile)
    rate = profile.velocity_rad_s[0]
    motion = SkyMotion(float(rate[0] * math.cos(profile.position_rad[0, 1])), float(rate[1]), window.smallest_range_m)
    params = controller.params
    alone = sensor_cost(SENSORS[used] if used else None, controller._scans, params.trim, params.autotrack, motion)
    levels = level_db_hz - 20.0 * np.log10(profile.range_m / window.smallest_range_m)
    expected = dataclasses.replace(alone, carrier_to_noise_db_hz=found.carrier_to_noise_db_hz)
    assert found == expected
    assert found.carrier_to_noise_db_hz == pytest.approx((levels.min(), levels.max()))


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


def test_the_satellite_s_antenna_is_in_the_certificate_the_refusal_and_the_expected_level(
    make_controller: MakeController, rig: MakeRig, track: TopocentricTrack, window: Pass
) -> None:
    """Its beam of 60 deg looks to the nadir, 40 deg and more off the station."""
    antenna = SatelliteAntennaParams(half_power_beamwidth_rad=math.radians(60.0))
    turned = track.with_offsets(along_track_offset_s=0.0, cross_track_offset_rad=0.0, antenna=antenna)
    profile, link = pass_profile(turned, window), LinkParams(zenith_carrier_to_noise_db_hz=50.0)
    levels = 50.0 - 20.0 * np.log10(profile.range_m / link.reference_range_m) + profile.satellite_gain_db
    controller = make_controller(link=link)
    controller.plan.take_profiles([profile])
    controller.take_joints(still(window.aos_azimuth_rad, window.aos_elevation_rad, window.aos_t_s - 10.0))
    controller.start(window.aos_t_s - 10.0, window, "conscan")
    certificate = controller.plan.certificate
    assert certificate is not None
    assert certificate.carrier_to_noise_db_hz == pytest.approx((levels.min(), levels.max()))
    assert f"C/N0 {levels.min():.1f} to {levels.max():.1f} dB-Hz" in certificate_lines(certificate)[-1]
    # The same link that is enough on the axis of the antenna is refused where the station is off it.
    faint = link.replace(zenith_carrier_to_noise_db_hz=50.0 + 21.9 - levels.max())
    made = make_controller(link=faint)
    made.start(window.aos_t_s - 10.0, window, "conscan")
    made = make_controller(link=faint)
    made.plan.take_profiles([profile])
    with pytest.raises(ValueError, match=r"conscan needs a carrier of 22.0 dB-Hz; the link gives at most 21.9"):
        made.start(window.aos_t_s - 10.0, window, "conscan")
    # What the state table compares the carrier with moves with the attitude that is published.
    flown = rig("conscan", link=link)
    flown.track = turned
    list(flown.run(window.aos_t_s, 3.0))
    now = turned.target_at(window.aos_t_s + 3.0)
    expected = link.level_db_hz(now.range_m, now.satellite_gain_db)
    assert flown.controller._mode.axis_db_hz == pytest.approx(expected, abs=0.01)


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


def test_a_second_pass_begins_with_nothing_of_the_first(rig: MakeRig, window: Pass) -> None:
    made = rig("monopulse")
    list(made.run(window.aos_t_s, 5.0, lambda t_s, _rig: [measured(t_s - 0.1)]))
    controller = made.controller
    assert (controller.busy, controller.stopping) == (True, False)
    assert np.hypot(*controller.corrections.correction_rad(round(window.aos_t_s + 5.0, 6))) > 1e-7
    assert controller.statistics.samples > 20
    controller.stop("enough")
    assert controller.stopping
    t_s = round(window.aos_t_s + 5.1, 6)
    _, status = made.period(t_s)
    assert (status.mode, status.reason, controller.busy, controller.stopping) == ("idle", "enough", False, False)
    assert controller.statistics.reason == "enough"
    tracked_s = controller.statistics.outcome.tracked_s
    assert tracked_s > 2.0
    # What was measured between two passes is of neither.
    controller.take_error(measured(t_s + 0.05))
    controller.stop("nothing is tracked")
    assert not controller.stopping
    controller.start(t_s, window, "monopulse")
    assert (controller.statistics.outcome.tracked_s, controller.statistics.samples) == (0.0, 0)
    assert controller._levels.power(t_s + 1.0, t_s - 9.0, 60.0) is None
    _, status = made.period(round(t_s + 0.1, 6))
    assert (status.mode, status.on_source) == ("slew", False)
    assert status.settle_count <= 1
    np.testing.assert_array_equal(status.offset_rad, [0.0, 0.0])
    assert status.carrier_to_noise_db_hz == 0.0
    assert controller.awaits_error(round(t_s + 0.3, 6)) is False


def test_new_timing_tolerance_limits_and_thresholds_count_from_the_next_period_on(rig: MakeRig, window: Pass) -> None:
    made = rig()
    list(made.run(window.aos_t_s, 3.0))
    controller = made.controller
    given = controller.params
    controller.retune(
        given.replace(
            pointing=given.pointing.replace(horizon_s=0.6, on_target_rad=0.002, stop_deceleration_rad_s2=0.5),
            axes=given.axes.replace(settle_periods=40),
            autotrack=given.autotrack.replace(coast_s=9.0),
            limits=AxisLimits(elevation_max_rad=1.5),
            alarm=AlarmParams(lost_warning_s=3.0),
        )
    )
    trajectory, status = made.period(round(window.aos_t_s + 3.1, 6))
    assert len(trajectory.t_s) == 6
    assert status.command_lead_s == 0.6
    assert (controller.antenna.tolerance_rad, controller.antenna.params.settle_periods) == (0.002, 40)
    assert (controller._mode.params.coast_s, controller._mode.timing.horizon_s) == (9.0, 0.6)
    assert controller.plan.gate.limits.elevation_max_rad == 1.5
    assert controller.params.alarm.lost_warning_s == 3.0
    controller.stop("enough")
    moving = made.latest.velocity_rad_s[0].copy()
    halt, _ = made.period(round(window.aos_t_s + 3.2, 6))
    np.testing.assert_allclose(halt.position_rad[0] - made.position_rad, moving * np.abs(moving) / 1.0, rtol=1e-3)


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


@pytest.mark.parametrize(("gap_s", "stalled"), [(0.9, False), (1.2, True)])
def test_after_a_stall_of_a_second_the_axes_find_the_target_again(
    rig: MakeRig, window: Pass, gap_s: float, stalled: bool
) -> None:
    made = rig()
    *_, (t_s, _, before) = made.run(window.aos_t_s, 4.0)
    assert before.mode == "program_track"
    now_s = round(t_s + gap_s, 6)
    _, status = made.period(now_s)
    assert (status.mode == "program_track") is not stalled
    if stalled:
        assert made.controller._returning
        assert f"the controller stalled for {gap_s:.1f} s" in made.controller.state.reason or status.mode == "slew"
        rows = list(made.run(now_s, 3.0))
        back_s = next(at_s for at_s, _, each in rows if each.mode == "program_track")
        assert not made.controller._returning
        # Errors are judged when the lags of the mount have followed.
        averaging_s = made.controller.params.pointing.lag_averaging_s
        assert made.controller.carrier._watched_s == pytest.approx(back_s + 2.0 * averaging_s, abs=0.11)


def test_the_return_from_a_stall_waits_twice_the_lags_before_it_judges_a_lock(rig: MakeRig, window: Pass) -> None:
    made = rig(pointing=ControllerParams().pointing.replace(lag_averaging_s=3.0))
    list(made.run(window.aos_t_s, 4.0))
    watched_s = made.controller.carrier._watched_s
    made.controller._slew_again(window.aos_t_s + 4.0, "the controller stalled for 1.5 s")
    assert made.controller.state.mode == "idle"
    assert made.controller.state.reason == "the controller stalled for 1.5 s"
    back_s = next(t_s for t_s, _, status in made.run(window.aos_t_s + 4.0, 5.0) if status.mode == "program_track")
    assert made.controller.carrier._watched_s == pytest.approx(back_s + 6.0, abs=0.01) != watched_s


def test_a_pause_of_the_antenna_is_told_when_it_is_over(rig: MakeRig, window: Pass) -> None:
    made = rig()
    *_, (t_s, _, _) = made.run(window.aos_t_s, 2.0)
    made.controller.take_antenna("paused", "")
    *_, (t_s, _, status) = made.run(t_s, 0.5)
    assert (status.level, status.alarm) == (Level.ERROR, "the antenna is paused")
    made.controller.take_antenna("tracking", "")
    reasons: list[str] = []
    interrupt = made.controller._mode.interrupt
    made.controller._mode.interrupt = lambda at_s, reason: reasons.append(reason) or interrupt(at_s, reason)
    *_, (t_s, _, status) = made.run(t_s, 1.0)
    assert reasons == ["over: the antenna is paused"]
    assert status.mode == "program_track"


def test_a_pass_that_was_stopped_while_it_waited_gets_no_certificate(
    make_controller: MakeController, window: Pass
) -> None:
    controller, t_s = make_controller(), window.aos_t_s - 100.0
    controller.start(t_s, window, "program")
    assert controller.missing.startswith("the position of the axes")
    controller.stop("stop was requested")
    assert controller.missing == ""
    controller.take_joints(still(window.aos_azimuth_rad, 1.0, t_s))
    trajectory, status = controller.step(t_s + 0.1)
    assert trajectory is None
    assert status.reason == "stop was requested"
    assert controller.plan.certificate is None


def test_nothing_is_counted_before_the_pass_begins(rig: MakeRig, window: Pass) -> None:
    made = rig(start_s=window.aos_t_s - 3.0)
    for t_s, _, status in made.run(window.aos_t_s - 3.0, 5.0):
        outcome = made.controller.statistics.outcome
        assert outcome.duration_s == pytest.approx(max(t_s - window.aos_t_s + 0.1, 0.0), abs=0.11)
        assert (status.alarm == "") or t_s >= window.aos_t_s
    assert outcome.duration_s > 1.5


def test_the_carrier_tells_how_far_the_beam_is_off_where_no_sensor_does(rig: MakeRig, window: Pass) -> None:
    """3 dB below the link's at the stamps that a period may use; what is reported now is not in it yet."""
    link = LinkParams(zenith_carrier_to_noise_db_hz=60.0, reference_range_m=window.smallest_range_m)
    made = rig("program", link=link)

    def heard(t_s: float, _rig: Rig) -> list[PointingError]:
        axis_db_hz = link.level_db_hz(made.track.target_at(t_s - 0.1).range_m)
        late = measured(t_s - 0.1, carrier_to_noise_db_hz=axis_db_hz - 3.0)
        return [late, measured(t_s, carrier_to_noise_db_hz=axis_db_hz - 30.0)]

    powers: list[float | None] = []
    power = made.controller._levels.power
    made.controller._levels.power = lambda *given: powers.append(power(*given)) or powers[-1]  # type: ignore[func-returns-value]
    list(made.run(window.aos_t_s, 3.0, heard))
    # Four periods lie between the oldest and the newest report that count, one of the two halves of each.
    assert powers[-1] is not None
    assert 0.25 < powers[-1] < 0.51
    assert made.controller.statistics.outcome.mean_loss_db > 1.0


@pytest.mark.parametrize(
    ("mode", "kind"),
    [("calibrate", "calibration"), ("search", "scan"), ("conscan", "scan"), ("steptrack", "scan"), ("array", "track"),
     ("monopulse", "track"), ("program_track", "track"), ("slew", "track"), ("coast", "track")],
)  # fmt: skip
def test_the_gate_knows_each_mode_as_a_kind_of_motion(mode: str, kind: str) -> None:
    assert _motion_of(mode) == kind


def test_a_zone_without_a_sun_leaves_the_clearance_for_a_model(make_controller: MakeController) -> None:
    controller = make_controller()
    machine = controller.params.machine
    clearance_rad = controller.params.mask.clearance_rad
    controller.retune(dataclasses.replace(controller.params, machine=machine.replace(sun_radius_rad=0.0)))
    controller.take_model(BiasModel.zero().replace(elevation_offset=0.99 * clearance_rad))
    assert controller.model_doubt == ""
    controller.take_model(BiasModel.zero().replace(elevation_offset=1.01 * clearance_rad))
    assert controller.model_doubt != ""


def test_an_array_costs_what_its_loop_leaves_at_the_levels_of_the_pass(
    make_controller: MakeController, track: TopocentricTrack, window: Pass
) -> None:
    link = LinkParams(zenith_carrier_to_noise_db_hz=50.0, reference_range_m=window.smallest_range_m)
    controller, profile = make_controller(link=link), pass_profile(track, window)
    found, params = controller._cost("array", window, profile), controller.params
    rate = profile.velocity_rad_s[0]
    motion = SkyMotion(float(rate[0] * math.cos(profile.position_rad[0, 1])), float(rate[1]), window.smallest_range_m)
    program = sensor_cost(None, controller._scans, params.trim, params.autotrack, motion)
    levels = controller.carrier.levels_db_hz(profile)
    alone = array_cost(
        params.array, params.integrator, params.autotrack, levels, params.spiral.half_power_beamwidth_rad, program
    )
    assert found == dataclasses.replace(alone, carrier_to_noise_db_hz=(min(levels), max(levels)))
    # A pass that does not say how near it comes is taken to be 1000 km away.
    unknown = controller._cost("program", dataclasses.replace(window, smallest_range_m=0.0), profile)
    far = SkyMotion(motion.cross_elevation_rate_rad_s, motion.elevation_rate_rad_s, 1e6)
    expected = sensor_cost(None, controller._scans, params.trim, params.autotrack, far)
    assert unknown == dataclasses.replace(expected, carrier_to_noise_db_hz=unknown.carrier_to_noise_db_hz)
