"""What a station's own instruments publish, at the nodes that use it: wind stows, temperature feeds the bias model."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Vector3Stamped
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.srv import StowInFault
from sensor_msgs.msg import Temperature

from rf_pointing.calibration import BiasModel
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.ros import convert_calibration, station_node
from rf_pointing.ros.diagnostics import WARN
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.description import read_station
from test.station.campaign.test_model_keeper import model_file

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
DRIVE = {"drive.type": "simulated_rotator", "wind.anemometer": True}


@pytest.fixture
def servo(default_context: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[AntennaServo]:
    """An active antenna on a drive, whose anemometer is a topic."""
    read_station("dss13").write(tmp_path / "station.yaml", DRIVE)
    monkeypatch.setattr(station_node, "read_station", lambda _: read_station(tmp_path / "station.yaml"))
    node = AntennaServo()
    assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, node._state_health().message
    assert node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


def wind(t_s: float, east: float, north: float) -> Vector3Stamped:
    message = Vector3Stamped()
    message.header.stamp = stamp_from_seconds(t_s)
    message.vector.x, message.vector.y = east, north
    return message


def test_the_wind_of_a_topic_reaches_the_stow_unless_it_is_old(servo: AntennaServo) -> None:
    antenna, begun_s = servo._antenna, servo.now_s()
    for tick in range(1, 200):
        t_s = begun_s + 0.02 * tick
        if tick % 25 == 0:
            # The clock of the test runs ahead of that of the node: these are not old.
            servo._on_wind(wind(t_s, 18.0, -24.0))
        servo._tick(round(t_s, 6))
    assert antenna.safety.wind.gust_m_s == pytest.approx(30.0)
    assert antenna.mode == "stowing"
    antenna.hardware.anemometer_m_s()
    servo._on_wind(wind(servo.now_s() - 60.0, 1.0, 0.0))
    assert antenna.hardware.anemometer_m_s() != 1.0


def test_an_operator_stows_in_a_fault_by_its_name(servo: AntennaServo) -> None:
    servo._tick(servo.now_s())
    servo._antenna.trip("azimuth encoder jumped by 9.00 deg")
    servo._tick(servo.now_s())
    with pytest.raises(
        ValueError, match="the latched fault is 'azimuth encoder jumped by 9.00 deg', the request names ''"
    ):
        servo._stow_in_fault(StowInFault.Request())
    answer = servo._stow_in_fault(StowInFault.Request(fault="azimuth encoder jumped by 9.00 deg"))
    assert "the azimuth is braked" in answer
    assert servo._antenna.mode == "stowing"


def test_a_model_with_thermal_terms_is_refused_until_a_temperature_has_come(default_context: None) -> None:
    node = PointingControllerNode()
    try:
        assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
        assert node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
        thermal = BiasModel.zero().replace(elevation_temperature=2e-5)
        version = model_file("thermal")
        object.__setattr__(version, "model", thermal)
        node._on_model(convert_calibration.model_to_message(version))
        ended = []
        goal = SimpleNamespace(request=TrackPass.Goal(), execute=lambda: ended.append(node._refusal))
        node._on_accepted(goal)
        assert ended == [
            "the bias model has elevation_temperature, and no temperature has been received on weather/temperature"
        ]
        node._on_temperature(Temperature(temperature=25.0))
        assert node._unfed == ""
        assert node._controller._motion.model.coefficients["elevation_offset"] == pytest.approx(2e-5 * 10.0)
        node._on_temperature(Temperature(temperature=25.05))
        assert node._controller._motion.model.coefficients["elevation_offset"] == pytest.approx(2e-5 * 10.0)
        node._refusal = ""
        object.__setattr__(version, "model", BiasModel.zero().replace(elevation_offset=0.1))
        node._on_model(convert_calibration.model_to_message(version))
        assert (node._health().level, "5.73 deg off the axes" in node._health().message) == (WARN, True)
        node._model, node._temperature_k = thermal, None
        node._use_model()
        assert node._health().level == WARN
    finally:
        node.end()
        node.lock.release()
        node.destroy_node()
