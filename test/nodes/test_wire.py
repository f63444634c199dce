"""What other people's nodes read: every field of a message holds what its definition says, without our own readers.

There and back proves nothing about the wire: azimuth and elevation swapped by both of a pair come back unchanged.
"""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rf_pointing_msgs import action, msg, srv

from rf_pointing.array_sensors.attitude.attitude_report import AttitudeReport, RateReport
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque
from rf_pointing.array_sensors.doa.array_source import SnapshotBlock
from rf_pointing.array_sensors.doa.attitude_chain import ChannelBlock, HeldTorque
from rf_pointing.array_sensors.interferometer.measurement import InterferometerMeasurement
from rf_pointing.array_sensors.interferometer.tracker import ACQUIRING, COASTING, TRACKING
from rf_pointing.array_sensors.nodes import convert as convert_arrays
from rf_pointing.array_sensors.tripulse.signal import TripulseFrame
from rf_pointing.core import (
    AXES,
    Boresight,
    CarrierPower,
    JointReading,
    JointTrajectory,
    MonopulseCluster,
    PointingError,
    Target,
)
from rf_pointing.core.modes import Mode, Sensor
from rf_pointing.identification import ExcitationParams
from rf_pointing.operations.night import NightState
from rf_pointing.operations.schedule import PassState
from rf_pointing.planning import Branch, Certificate, MachineParams, PassProfile
from rf_pointing.ros import convert, convert_identification, convert_planning
from rf_pointing.ros.antenna_server import antenna_status_to_message
from rf_pointing.ros.diagnostics import LEVELS
from rf_pointing.station.antenna.control_unit import AntennaStatus
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import FAULTS
from rf_pointing.station.pointing.status import TrackingStatus

T_S, SEC, NANOSEC = 1_151_384_323.813083, 1_151_384_323, 813_083_000
QUATERNION = np.array([0.1, 0.3, -0.5, 0.8062257748298549])
SQUARE = np.array([[4.0, 1.0], [1.0, 9.0]])
CUBE = np.array([[4.0, 1.0, 2.0], [1.0, 9.0, 3.0], [2.0, 3.0, 16.0]])


def plain(value: Any) -> Any:
    """A field of a message as numbers, words and lists."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if not isinstance(value, str | bytes) and hasattr(value, "__iter__"):
        return [plain(item) for item in value]
    return value


def same(one: Any, other: Any) -> bool:
    """Whether two signals are equal field by field, arrays included, but for the rounding of times."""
    pairs = [(item.name, getattr(one, item.name), getattr(other, item.name)) for item in dataclasses.fields(one)]
    return all(
        np.allclose(a, b, rtol=0.0, atol=1e-6) if name == "t_s" else np.array_equal(a, b) for name, a, b in pairs
    )


def says(message: Any, /, back: Any = None, signal: Any = None, **wanted: Any) -> None:
    """Every field of `message` is as wanted; those that are not named are numbered elsewhere or left at rest.

    `back` reads the message, and gives its `signal` again.
    """
    assert back is None or same(back(message), signal)
    fields = plain(message)
    assert {name: fields[name] for name in wanted} == wanted
    if "header" in fields:
        assert fields["header"]["stamp"] == {"sec": SEC, "nanosec": NANOSEC}


def test_target() -> None:
    target = Target(
        t_s=T_S, name="bird", azimuth_rad=1.0, elevation_rad=0.5, azimuth_rate_rad_s=0.01, elevation_rate_rad_s=0.002,
        azimuth_acceleration_rad_s2=3e-4, elevation_acceleration_rad_s2=4e-5, range_m=1e6, range_rate_m_s=-7e3,
        refraction_rad=1e-3, satellite_gain_db=-4.0,
    )  # fmt: skip
    says(
        convert.target_to_message(target), convert.target_from_message, target,
        target="bird", azimuth=1.0, elevation=0.5, azimuth_rate=0.01, elevation_rate=0.002, azimuth_acceleration=3e-4,
        elevation_acceleration=4e-5, range=1e6, range_rate=-7e3, refraction=1e-3, satellite_gain=-4.0, covariance=[],
    )  # fmt: skip


def test_joint_states() -> None:
    reading = JointReading(t_s=T_S, position_rad=np.array([1.0, 0.5]), velocity_rad_s=np.array([0.01, -0.02]))
    says(
        convert.joints_to_message(reading), convert.joints_from_message, reading,
        name=["azimuth", "elevation"], position=[1.0, 0.5], velocity=[0.01, -0.02], effort=[],
    )  # fmt: skip


def test_joint_trajectory() -> None:
    """Positions, rates and accelerations in the order of the joints' names, at times after the stamp."""
    command = JointTrajectory(
        t_s=T_S + np.array([0.1, 1.25]), position_rad=np.array([[1.0, 2.0], [3.0, 4.0]]),
        velocity_rad_s=np.array([[5.0, 6.0], [7.0, 8.0]]), acceleration_rad_s2=np.array([[9.0, 10.0], [11.0, 12.0]]),
    )  # fmt: skip
    message = convert.trajectory_to_message(command, T_S)
    says(message, lambda m: convert.trajectory_from_message(m, T_S), command, joint_names=["azimuth", "elevation"])
    points = [SimpleNamespace(**plain(point)) for point in message.points]
    assert [p.positions for p in points] == [[1.0, 2.0], [3.0, 4.0]]
    assert [p.velocities for p in points] == [[5.0, 6.0], [7.0, 8.0]]
    assert [p.accelerations for p in points] == [[9.0, 10.0], [11.0, 12.0]]
    assert [p.time_from_start for p in points] == [
        {"sec": 0, "nanosec": 100_000_000},
        {"sec": 1, "nanosec": 250_000_000},
    ]


def test_beam_error_and_power() -> None:
    beam = Boresight(t_s=T_S, azimuth_rad=1.0, elevation_rad=0.5)
    says(convert.boresight_to_message(beam), convert.boresight_from_message, beam, azimuth=1.0, elevation=0.5)
    error = PointingError(
        t_s=T_S, sensor="conscan", cross_elevation_rad=1e-4, elevation_rad=-2e-4, covariance_rad2=SQUARE,
        carrier_to_noise_db_hz=55.0, valid=False, reason="late",
    )  # fmt: skip
    says(
        convert.error_to_message(error), convert.error_from_message, error,
        sensor="conscan", valid=False, reason="late", cross_elevation=1e-4, elevation=-2e-4,
        covariance=[4.0, 1.0, 1.0, 9.0], carrier_to_noise=55.0,
    )  # fmt: skip
    power = CarrierPower(t_s=T_S, integration_s=0.1, power_w=1e-15, sigma_w=1e-17, carrier_to_noise_db_hz=55.0)
    says(
        convert.power_to_message(power), convert.power_from_message, power,
        integration_time=0.1, power=1e-15, sigma=1e-17, carrier_to_noise=55.0,
    )  # fmt: skip


def test_monopulse_is_stamped_with_its_last_sample() -> None:
    cluster = MonopulseCluster(
        t_s=T_S + np.array([-0.04, -0.02, 0.0]), sum=np.array([1 + 2j, 3 + 4j, 5 + 6j]),
        difference_cross_elevation=np.array([7 + 8j, 9 + 10j, 11 + 12j]),
        difference_elevation=np.array([13 + 14j, 15 + 16j, 17 + 18j]), carrier_to_noise_db_hz=58.0,
    )  # fmt: skip
    says(
        convert.monopulse_to_message(cluster), convert.monopulse_from_message, cluster,
        sample_period=0.02, carrier_to_noise=58.0, sum_i=[1.0, 3.0, 5.0], sum_q=[2.0, 4.0, 6.0],
        difference_cross_elevation_i=[7.0, 9.0, 11.0], difference_cross_elevation_q=[8.0, 10.0, 12.0],
        difference_elevation_i=[13.0, 15.0, 17.0], difference_elevation_q=[14.0, 16.0, 18.0],
    )  # fmt: skip


def test_tracking_status() -> None:
    status = TrackingStatus(
        t_s=T_S, mode="monopulse", sensor="auto", target="bird", reason="why", los_t_s=T_S + 500.0, azimuth_rad=1.0,
        elevation_rad=0.5, scan_centre_rad=np.array([1.1, 0.6]), cross_elevation_error_rad=1e-4,
        elevation_error_rad=2e-4, cross_elevation_offset_rad=3e-4, elevation_offset_rad=4e-4,
        carrier_to_noise_db_hz=58.0, half_power_beamwidth_rad=1e-3, command_lead_s=0.9,
    )  # fmt: skip
    says(
        convert.tracking_status_to_message(status),
        mode="monopulse", sensor="auto", target="bird", reason="why", los={"sec": SEC + 500, "nanosec": NANOSEC},
        azimuth=1.0, elevation=0.5, scan_centre=[1.1, 0.6], cross_elevation_error=1e-4, elevation_error=2e-4,
        cross_elevation_offset=3e-4, elevation_offset=4e-4, carrier_to_noise=58.0, beamwidth=1e-3, command_lead=0.9,
    )  # fmt: skip


def test_antenna_status() -> None:
    status = AntennaStatus(
        t_s=T_S, mode="fault", fault="ran dry", commanded_rad=np.array([1.0, 2.0]),
        rate_command_rad_s=np.array([3.0, 4.0]), rate_limit_rad_s=np.array([5.0, 6.0]),
        acceleration_limit_rad_s2=np.array([7.0, 8.0]), at_limit=(False, True), command_lead_s=0.7,
        commands_accepted=11, commands_rejected=12, last_rejection="stale", warning="near", transmit_inhibit="slewing",
        commander="pointing_controller", set_points=9, starts=(7, 8), reversals=(1, 2),
    )  # fmt: skip
    says(
        antenna_status_to_message(status),
        mode="fault", fault="ran dry", commanded=[1.0, 2.0], rate_command=[3.0, 4.0], rate_limit=[5.0, 6.0],
        acceleration_limit=[7.0, 8.0], at_limit=[False, True], command_lead=0.7, commands_accepted=11,
        commands_rejected=12, last_rejection="stale", warning="near", transmit_inhibit="slewing",
        commander="pointing_controller", set_points=9, starts=[7, 8], reversals=[1, 2],
    )  # fmt: skip


def test_an_experiment_and_its_samples() -> None:
    says(
        convert_identification.manual_rate_to_message(
            T_S, "elevation", 7, np.array([1e-4, 2e-4]), np.array([1.0, 0.5]), 0.013
        ),
        axis="elevation", sample=7, rate=[1e-4, 2e-4], position=[1.0, 0.5], position_age=0.013,
    )  # fmt: skip
    params = ExcitationParams(
        kind="multisine", samples=512, sample_s=0.05, mean_rad_s=1e-3, rms_rad_s=5e-4, peak_rad_s=3e-3,
        idle_rate_rad_s=2e-6, high_hz=10.0,
    )  # fmt: skip
    goal = convert_identification.excitation_to_goal("azimuth", 8, 3, params)
    says(
        goal, axis="azimuth", kind="multisine", sequences=8, samples=512, mean=1e-3, rms=5e-4, peak=3e-3, idle=2e-6,
        seed=3,
    )  # fmt: skip
    assert convert_identification.excitation_from_goal(goal, 0.05) == params


def test_orientations_are_scalar_last_and_rates_fill_the_lower_half_of_a_twist() -> None:
    report = AttitudeReport(t_s=T_S, quaternion=QUATERNION, covariance_rad2=CUBE, valid=False, reason="one station")
    said = dict(zip("xyzw", report.quaternion.tolist(), strict=True))
    says(
        convert_arrays.attitude_to_message(report, "body"),
        child_frame_id="body", valid=False, reason="one station", orientation=said, covariance=CUBE.ravel().tolist(),
    )  # fmt: skip
    says(convert_arrays.orientation_to_message(T_S, report.quaternion, "orbit"), quaternion=said)
    rate = RateReport(t_s=T_S, rate_rad_s=np.array([1e-3, 2e-3, 3e-3]), covariance_rad2_s2=CUBE)
    covariance = np.zeros((6, 6))
    covariance[3:, 3:] = CUBE
    angular = {"x": 1e-3, "y": 2e-3, "z": 3e-3}
    says(
        convert_arrays.rate_to_message(rate),
        twist={
            "twist": {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": angular},
            "covariance": covariance.ravel().tolist(),
        },
    )


def test_measurements_of_the_array_sensors() -> None:
    """Elements before snapshots, slots before active before passive elements, real parts in I."""
    frame = TripulseFrame(
        t_s=T_S, station="usingen", sequence=17, steering=np.array([0.01, -0.02]), samples=np.array([1 + 2j, 3 + 4j])
    )
    says(
        convert_arrays.frame_to_message(frame, 4e6),
        station="usingen", frame=17, sample_rate=4e6, steering=[0.01, -0.02], samples_i=[1.0, 3.0], samples_q=[2.0, 4.0],
    )  # fmt: skip
    samples = np.array([[1 + 7j, 2 + 8j, 3 + 9j], [4 + 10j, 5 + 11j, 6 + 12j]])
    heard = ChannelBlock(transmitters=("a", "b"), block=SnapshotBlock(t_s=T_S, snapshots=samples))
    says(
        convert_arrays.snapshots_to_message(heard),
        transmitters=["a", "b"], elements=2, snapshots=3, samples_i=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        samples_q=[7.0, 8.0, 9.0, 10.0, 11.0, 12.0],
    )  # fmt: skip
    known = KnownTorque(
        control_n_m=np.array([1.0, 2.0, 3.0]), wheel_momentum_n_m_s=np.array([4.0, 5.0, 6.0]),
        wheel_momentum_rate_n_m=np.array([7.0, 8.0, 9.0]),
    )  # fmt: skip
    says(
        convert_arrays.torque_to_message(HeldTorque(t_s=T_S, known=known)),
        control_torque=[1.0, 2.0, 3.0], wheel_momentum=[4.0, 5.0, 6.0], wheel_momentum_rate=[7.0, 8.0, 9.0],
    )  # fmt: skip
    paths = np.arange(2 * 9, dtype=np.float64).reshape(2, 3, 3)
    measured = InterferometerMeasurement(
        t_s=T_S, phase_rad=0.01 * paths, phase_rate_rad_s=-paths, amplitudes=np.array([[1.0, 0.9], [0.8, 0.7]]),
        amplitude_sigma=0.01, snr_forward=np.array([50.0, 60.0]), snr_return=20.0 + paths, locked=paths > 4.0,
    )  # fmt: skip
    flat = np.arange(18.0)
    says(
        convert_arrays.sequence_to_message(measured),
        phase=(0.01 * flat).tolist(), phase_rate=(-flat).tolist(), coupling=[1.0, 0.9, 0.8, 0.7], coupling_sigma=0.01,
        snr_forward=[50.0, 60.0], snr_return=(20.0 + flat).tolist(), locked=(flat > 4.0).tolist(),
    )  # fmt: skip


def test_pass_certificate_and_profile(branch: Branch) -> None:
    certificate = Certificate(
        name="bird", issued_t_s=T_S, aos_t_s=T_S + 60.0, los_t_s=T_S + 660.0, sky_peak_rad=1.5, branches=(branch,),
        machine=MachineParams(rate_limit_rad_s=(0.03, 0.02), acceleration_limit_rad_s2=(0.014, 0.013)),
        carrier_to_noise_db_hz=(41.0, 52.0),
    )  # fmt: skip
    message = convert_planning.certificate_to_message(certificate)
    says(
        message, target="bird", aos={"sec": SEC + 60, "nanosec": NANOSEC}, los={"sec": SEC + 660, "nanosec": NANOSEC},
        accepted=True, refusal="", sky_peak=1.5, rate_limit=[0.03, 0.02], acceleration_limit=[0.014, 0.013],
        carrier_to_noise=[41.0, 52.0],
    )  # fmt: skip
    units = ("_rad_s2", "_rad_s", "_rad", "_s", "_db")
    for item in dataclasses.fields(Branch):
        wire = next((item.name.removesuffix(unit) for unit in units if item.name.endswith(unit)), item.name)
        if hasattr(message.branches[0], wire):
            value = getattr(branch, item.name)
            value = -1.0 if value is None else list(value) if isinstance(value, tuple) else value
            assert plain(getattr(message.branches[0], wire)) == value, wire
    assert convert_planning.certificate_from_message(message) == certificate
    profile = PassProfile(
        name="bird", t_s=T_S + np.array([0.0, 5.0]), position_rad=np.array([[1.0, 2.0], [3.0, 4.0]]),
        velocity_rad_s=np.array([[5.0, 6.0], [7.0, 8.0]]), acceleration_rad_s2=np.array([[9.0, 10.0], [11.0, 12.0]]),
        sun_rad=np.array([[0.1, 0.2], [0.3, 0.4]]), range_m=np.array([2e6, 1e6]), satellite_gain_db=np.array([-3.0, -1.0]),
    )  # fmt: skip
    says(
        convert_planning.profile_to_message(profile), convert_planning.profile_from_message, profile,
        target="bird", aos={"sec": SEC, "nanosec": NANOSEC}, time=[0.0, 5.0], azimuth=[1.0, 3.0], elevation=[2.0, 4.0],
        azimuth_rate=[5.0, 7.0], elevation_rate=[6.0, 8.0], azimuth_acceleration=[9.0, 11.0],
        elevation_acceleration=[10.0, 12.0], sun_azimuth=[0.1, 0.3], sun_elevation=[0.2, 0.4],
        range=[2e6, 1e6], satellite_gain=[-3.0, -1.0],
    )  # fmt: skip


@pytest.fixture
def branch() -> Branch:
    """Return a way of tracking a pass with a different number in every field."""
    pairs = {
        name: (10.0 + k, 20.0 + k)
        for k, name in enumerate(
            (
                "start_rad", "end_rad", "azimuth_range_rad", "elevation_range_rad",
                "peak_rate_rad_s", "peak_acceleration_rad_s2",
            )
        )
    }  # fmt: skip
    numbers = {
        name: 30.0 + k
        for k, name in enumerate(
            ("limit_margin_rad", "mask_margin_rad", "sun_margin_rad", "keyhole_s", "lost_s", "lost_signal_s",
             "peak_loss_db", "mean_loss_db", "preposition_s", "unwind_s", "late_s",
                 "acquisition_s")
        )
    }  # fmt: skip
    return Branch(turns=-1, plunge=True, over=True, reasons=(), closest_limit="azimuth", **pairs, **numbers)


@pytest.mark.parametrize(
    ("interface", "prefix", "words"),
    [
        (msg.AntennaStatus, "MODE", AntennaMode), (msg.TrackingStatus, "MODE", Mode),
        (msg.TrackingStatus, "SENSOR", {*Sensor, "none"} - {Sensor.PROGRAM}), (action.TrackPass.Goal, "SENSOR", Sensor),
        (msg.ScheduledPass, "STATE", PassState), (msg.ExecutiveStatus, "STATE", NightState),
        (msg.RelativePoseStatus, "STATUS", (ACQUIRING, TRACKING, COASTING)), (srv.InjectFault.Request, "FAULT", FAULTS),
        (action.Identify.Goal, "AXIS", AXES), (action.RunCampaign.Result, "VERDICT", ("better", "worse", "undecided")),
        (action.Identify.Goal, "KIND", ("white", "multisine")),
    ],
)  # fmt: skip
def test_an_interface_has_a_constant_for_every_word_of_a_closed_set(interface: Any, prefix: str, words: Any) -> None:
    names = [name for name in dir(type(interface)) if name.startswith(f"{prefix}_")]
    assert {name: getattr(interface, name) for name in names} == {
        f"{prefix}_{word.upper()}": str(word) for word in words
    }


def test_levels_are_those_of_diagnostics() -> None:
    levels = [bytes([level]) for level in (msg.TrackingStatus.LEVEL_OK, msg.Alarm.LEVEL_WARNING, msg.Alarm.LEVEL_ERROR)]
    assert tuple(levels) == LEVELS
    assert msg.TrackingStatus.LEVEL_ERROR == msg.Alarm.LEVEL_ERROR
