"""The trackers between their topics: what reaches the core and when, and what diagnostics shows of it."""

from collections.abc import Iterator
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import TrackingStatus

from rf_pointing.core import CarrierPower, JointReading, MonopulseCluster, PointingError
from rf_pointing.nodes import operator_page, pointing_controller, rotctld_server, station_executive
from rf_pointing.nodes.conscan_tracker import ConscanTrackerNode
from rf_pointing.nodes.monopulse_tracker import MonopulseTrackerNode
from rf_pointing.ros import convert
from rf_pointing.ros.diagnostics import OK, WARN

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
T_S = 1_200_000_000.0


def error(**values: Any) -> PointingError:
    return PointingError(t_s=T_S, sensor="conscan", cross_elevation_rad=1e-4, elevation_rad=2e-4, **values)


def yielded(node: Any) -> Iterator[Any]:
    """Configure a node, and collect what it publishes as `sent`."""
    node.sent = []
    assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, node._reason
    node._errors = SimpleNamespace(publish=node.sent.append)
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


@pytest.fixture
def monopulse(default_context: None) -> Iterator[Any]:
    yield from yielded(MonopulseTrackerNode())


@pytest.fixture
def conscan(default_context: None) -> Iterator[Any]:
    yield from yielded(ConscanTrackerNode())


def give(node: Any, topic: str, message: Any) -> None:
    """Deliver a message to each subscription of a topic; KeyError if there is none."""
    doors = [each.callback for each in node.subscriptions if each.topic_name == f"/{topic}"]
    if len(doors) != 1:
        raise KeyError(f"{len(doors)} subscriptions of {topic}")
    doors[0](serialize_message(message))


def cluster() -> Any:
    samples = np.array([1.0 + 0.0j, 1.0 + 0.0j, 1.0 + 0.0j])
    return convert.monopulse_to_message(MonopulseCluster(
        t_s=T_S + 0.02 * np.arange(3), sum=samples, difference_cross_elevation=0.01 * samples,
        difference_elevation=-0.02 * samples, carrier_to_noise_db_hz=60.0,
    ))  # fmt: skip


def joints() -> Any:
    return convert.joints_to_message(
        JointReading(t_s=T_S, position_rad=np.array([1.0, 0.5]), velocity_rad_s=np.zeros(2))
    )


def test_an_active_monopulse_tracker_publishes_an_error_for_each_cluster(monopulse: Any) -> None:
    give(monopulse, "monopulse", cluster())
    assert (monopulse.sent, monopulse._tracker.counts) == ([], {"valid": 0, "invalid": 0})
    monopulse.on_activate(ANY_STATE)
    give(monopulse, "monopulse", cluster())
    give(monopulse, "monopulse", cluster())
    assert len(monopulse.sent) == 2
    assert sum(monopulse._health().values.values()) == 2
    expected = monopulse._tracker.tracker.measure(convert.monopulse_from_message(cluster()))
    assert (monopulse.sent[0].sensor, monopulse.sent[0].cross_elevation) == ("monopulse", expected.cross_elevation_rad)


def test_encoders_are_read_from_the_first_calibration_scan_on_and_used_in_it(
    monopulse: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[float] = []
    monkeypatch.setattr(monopulse._tracker, "take_joints", lambda reading: taken.append(reading.t_s))
    give(monopulse, "tracking_status", TrackingStatus(mode="monopulse"))
    with pytest.raises(KeyError, match="0 subscriptions of joint_states"):
        give(monopulse, "joint_states", joints())
    for _ in range(2):
        give(monopulse, "tracking_status", TrackingStatus(mode="calibrate"))
    give(monopulse, "joint_states", joints())
    assert taken == [T_S]
    monkeypatch.setattr(monopulse._tracker, "_calibrator", None)
    give(monopulse, "joint_states", joints())
    assert taken == [T_S]
    # The subscription goes with the cleanup, and comes again.
    assert monopulse.on_cleanup(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    assert monopulse.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    give(monopulse, "tracking_status", TrackingStatus(mode="calibrate"))
    give(monopulse, "joint_states", joints())


def test_the_health_of_monopulse_is_its_last_reason_and_its_calibration(monopulse: Any) -> None:
    assert (monopulse._health().level, monopulse._health().message) == (OK, "errors are valid")
    monopulse._tracker.last_reason = "no lock"
    assert (monopulse._health().level, monopulse._health().message) == (WARN, "no lock")
    ideal = monopulse._calibration_health()
    assert (ideal.level, ideal.message, ideal.values) == (OK, "ideal feed", {"scans": 0})
    monopulse._tracker.outcome = SimpleNamespace(refused=True, message="too few clusters", scans=2)
    refused = monopulse._calibration_health()
    assert (refused.level, refused.message, refused.values) == (WARN, "too few clusters", {"scans": 2})


def test_parameters_of_monopulse_change_while_it_measures(monopulse: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    retuned: list[Any] = []
    monkeypatch.setattr(monopulse._tracker, "retune", retuned.append)
    monopulse._retune()
    assert retuned == [monopulse.parameters.value("monopulse")]
    (done,) = monopulse.set_parameters([Parameter("calibration_file", value="/nowhere")])
    assert not done.successful, "not while it is configured"


def test_conscan_estimates_are_counted_and_every_error_is_published(
    conscan: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    sure = {"covariance_rad2": 1e-9 * np.eye(2)}
    errors = [error(**sure), error(valid=False, reason="no lock", **sure), error(**sure), error(valid=False)]
    monkeypatch.setattr(conscan._tracker, "take_power", lambda _power: errors)
    power = convert.power_to_message(
        CarrierPower(t_s=T_S, integration_s=0.1, power_w=1e-15, sigma_w=1e-17, carrier_to_noise_db_hz=50.0)
    )
    give(conscan, "carrier_power", power)
    assert conscan.sent == [], "not active"
    conscan.on_activate(ANY_STATE)
    give(conscan, "carrier_power", power)
    assert [each.valid for each in conscan.sent] == [True, False, True, False]
    values = conscan._health().values
    assert (values["valid"], values["invalid"]) == (2, 1), "the last one is no estimate"


def test_conscan_takes_encoders_while_the_beam_scans(conscan: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[float] = []
    monkeypatch.setattr(conscan._tracker, "take_joints", lambda reading: taken.append(reading.t_s))
    give(conscan, "joint_states", joints())
    assert taken == []
    give(conscan, "tracking_status", TrackingStatus(mode="conscan", sensor="conscan", scan_centre=[1.0, 0.5]))
    assert conscan._tracker.scanning
    give(conscan, "joint_states", joints())
    assert taken == [T_S]


def test_the_health_of_conscan_has_its_delay_and_its_rejections(conscan: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    health = conscan._health()
    assert (health.level, health.message) == (OK, "samples are used")
    assert (health.values["valid"], health.values["invalid"], health.values["rejected"]) == (0, 0, 0)
    monkeypatch.setattr(type(conscan._tracker), "rejections", property(lambda _: (3, "too old")))
    monkeypatch.setattr(type(conscan._tracker), "delay_s", property(lambda _: 0.123456))
    health = conscan._health()
    assert (health.level, health.message, health.values["rejected"]) == (WARN, "too old", 3)
    assert health.values["delay_s"] == 0.1235


@pytest.mark.parametrize(
    ("module", "kind"),
    [
        (operator_page, "OperatorPage"), (pointing_controller, "PointingControllerNode"),
        (rotctld_server, "RotctldServerNode"), (station_executive, "StationExecutive"),
    ],
)  # fmt: skip
def test_nodes_that_name_sensors_know_those_of_other_packages(
    default_context: None, monkeypatch: pytest.MonkeyPatch, module: ModuleType, kind: str
) -> None:
    loaded: list[str] = []
    monkeypatch.setattr(module, "load_trackers", lambda: loaded.append(kind))
    node = getattr(module, kind)()
    if hasattr(node, "_action"):
        node._action.destroy()
    node.end()
    node.lock.release()
    node.destroy_node()
    assert loaded == [kind]
