"""The trackers between their topics: what is measured when, and what /diagnostics shows of it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rf_pointing_msgs.msg import Monopulse, TrackingStatus

from rf_pointing.core import CarrierPower, JointReading, MonopulseCluster
from rf_pointing.nodes import operator_page, pointing_controller, rotctld_server, station_executive
from rf_pointing.nodes.conscan_tracker import ConscanTrackerNode
from rf_pointing.nodes.monopulse_tracker import MonopulseTrackerNode
from rf_pointing.ros import convert
from rf_pointing.tracking.cluster_tracker import ClusterTracker

MakeBench = Callable[..., Any]
OK, WARN = b"\x00", b"\x01"
T_S = 1.8e9


def cluster(t_s: float, right: float = 0.01, up: float = -0.02) -> Any:
    samples = np.full(3, 1.0 + 0.0j)
    return convert.monopulse_to_message(MonopulseCluster(
        t_s=t_s + 0.02 * np.arange(3), sum=samples, difference_cross_elevation=right * samples,
        difference_elevation=up * samples, carrier_to_noise_db_hz=60.0,
    ))  # fmt: skip


def joints(t_s: float, azimuth_rad: float = 1.0, elevation_rad: float = 0.5) -> Any:
    place = np.array([azimuth_rad, elevation_rad])
    return convert.joints_to_message(JointReading(t_s=t_s, position_rad=place, velocity_rad_s=np.zeros(2)))


def status(t_s: float, mode: str, sensor: str = "") -> TrackingStatus:
    message = TrackingStatus(mode=mode, sensor=sensor, scan_centre=[1.0, 0.5])
    message.header.stamp = joints(t_s).header.stamp
    return message


def test_an_active_monopulse_tracker_publishes_what_the_core_measures_of_each_cluster(make_bench: MakeBench) -> None:
    bench = make_bench(MonopulseTrackerNode)
    assert bench.step("configure")
    bench.give("monopulse", cluster(T_S))
    assert bench.sent["pointing_error"] == []
    assert bench.step("activate")
    bench.give("monopulse", cluster(T_S), cluster(T_S + 0.1, right=0.03))
    station = bench.node.parameters.value
    core = ClusterTracker(station("monopulse"), station("calibration"), "")
    for message, sent in zip((cluster(T_S), cluster(T_S + 0.1, right=0.03)), bench.sent["pointing_error"], strict=True):
        wire = deserialize_message(serialize_message(message), Monopulse)
        error = core.take_cluster(convert.monopulse_from_message(wire))
        assert (sent.sensor, sent.cross_elevation, sent.elevation) == (
            "monopulse", error.cross_elevation_rad, error.elevation_rad,
        )  # fmt: skip
    health = bench.health("clusters")
    assert (health.level, health.message) == (OK, "errors are valid")
    assert sum(int(count) for count in health.values.values()) == 2
    bench.give("monopulse", cluster(T_S, right=50.0))
    assert (bench.health("clusters").level, bench.sent["pointing_error"][-1].valid) == (WARN, False)


def test_encoders_are_received_from_the_first_calibration_on_and_again_after_a_cleanup(make_bench: MakeBench) -> None:
    bench = make_bench(MonopulseTrackerNode).up()
    assert bench.health("calibration").message == "ideal feed"
    for _ in range(2):
        bench.give("tracking_status", status(T_S, "monopulse"))
        with pytest.raises(KeyError, match="no subscription of joint_states"):
            bench.give("joint_states", joints(T_S))
        bench.give("tracking_status", status(T_S, "calibrate"))
        bench.give("joint_states", joints(T_S))
        assert [topic for topic, _ in bench.inputs()].count("/joint_states") == 1
        # Ended without a cluster.
        bench.give("tracking_status", status(T_S + 1.0, "monopulse"))
        assert bench.health("calibration").level == WARN
        assert bench.step("deactivate")
        assert bench.step("cleanup")
        bench.up()


def test_parameters_of_monopulse_change_while_it_measures_and_its_calibration_does_not(make_bench: MakeBench) -> None:
    bench = make_bench(MonopulseTrackerNode).up()
    live = next(name for name in bench.node.parameters.names() if name.startswith("monopulse."))
    assert bench.change(**{live: bench.node.get_parameter(live).value}) == ""
    assert "read when the node is configured" in bench.change(calibration_file="/nowhere")


def test_conscan_estimates_come_from_powers_placed_by_the_encoders_of_a_scan(make_bench: MakeBench) -> None:
    bench = make_bench(ConscanTrackerNode).up()
    period_s, radius_rad, off_rad = 4.0, np.radians(0.02), np.radians(0.01)
    for step in range(400):
        t_s = T_S + 0.02 * step
        angle = 2.0 * np.pi * (t_s - T_S) / period_s
        right, up = radius_rad * np.cos(angle), radius_rad * np.sin(angle)
        if step % 5 == 0:
            bench.give("tracking_status", status(t_s, "conscan", "conscan"))
        bench.give("joint_states", joints(t_s, 1.0 + right / np.cos(0.5), 0.5 + up))
        if step % 5 == 4:
            power_w = 1e-15 * np.exp(-((right - off_rad) ** 2 + up**2) / np.radians(0.05) ** 2)
            power = CarrierPower(t_s=t_s - 0.05, integration_s=0.1, power_w=power_w, sigma_w=1e-18,
                                 carrier_to_noise_db_hz=50.0)  # fmt: skip
            bench.give("carrier_power", convert.power_to_message(power))
    assert len(bench.sent["pointing_error"]) == 79, "the last one waits for the encoders behind it"
    values = bench.health("samples").values
    estimates = [each for each in bench.sent["pointing_error"] if each.valid]
    assert int(values["valid"]) + int(values["invalid"]) <= 80
    assert (len(estimates), bool(values["delay_s"])) == (int(values["valid"]), True)
    assert np.mean([each.cross_elevation for each in estimates[-20:]]) > 0.2 * off_rad


@pytest.mark.parametrize(
    ("module", "kind"),
    [
        (operator_page, "OperatorPage"), (pointing_controller, "PointingControllerNode"),
        (rotctld_server, "RotctldServerNode"), (station_executive, "StationExecutive"),
    ],
)  # fmt: skip
def test_nodes_that_name_sensors_know_those_of_other_packages(
    make_bench: MakeBench, monkeypatch: pytest.MonkeyPatch, module: Any, kind: str
) -> None:
    loaded: list[str] = []
    monkeypatch.setattr(module, "load_trackers", lambda: loaded.append(kind))
    make_bench(getattr(module, kind))
    assert loaded == [kind]
