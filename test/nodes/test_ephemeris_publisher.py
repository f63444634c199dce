"""The ephemeris publisher between its topics: what it publishes, takes, serves, and mirrors in its parameters."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import Attitude
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import FluidPressure, RelativeHumidity, Temperature

from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.ros.stamps import stamp_from_seconds

STATE = LifecycleState(state_id=1, label="unconfigured")
NOW_S = 1_151_384_500.0


@pytest.fixture
def make(default_context: None) -> Iterator[Callable[..., Any]]:
    """Yield a maker of active nodes in June 2006, `make(source__hold=True)`; `sent` is what they publish, by topic."""
    made: list[EphemerisPublisher] = []

    def publisher(**given: Any) -> Any:
        node: Any = EphemerisPublisher()
        made.append(node)
        node.sent, node.work, stream, every = {}, [], node.stream, node.every
        node.now_s = lambda: NOW_S

        def noted(kind: Any, topic: str, qos: Any) -> Any:
            out = stream(kind, topic, qos)
            out.publish = node.sent.setdefault(topic, []).append
            return out

        node.stream = noted
        node.every = lambda period_s, call: (node.work.append((period_s, call)), every(period_s, call))
        for name, value in given.items():
            (done,) = node.set_parameters([Parameter(name.replace("__", "."), value=value)])
            assert done.successful, done.reason
        assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS
        assert node.on_activate(STATE) == TransitionCallbackReturn.SUCCESS
        return node

    yield publisher
    for node in made:
        node.end()
        node.lock.release()
        node.destroy_node()


def select(node: Any, **given: Any) -> SelectTarget.Response:
    (service,) = (each for each in node.services if each.service_name.endswith("/select_target"))
    return service.callback(SelectTarget.Request(**given), SelectTarget.Response())


def give(node: Any, topic: str, message: Any) -> None:
    (door,) = [each.callback for each in node.subscriptions if each.topic_name == f"/{topic}"]
    door(serialize_message(message))


def test_passes_profiles_and_targets_are_published_with_their_stamps(make: Callable[..., Any]) -> None:
    node = make(publisher__period_s=0.25)
    ((passes,), (profiles,)) = node.sent["passes"], node.sent["pass_profiles"]
    assert (passes.target, passes.header.stamp.sec, profiles.header.stamp.sec) == ("CBERS 2", int(NOW_S), int(NOW_S))
    assert len(passes.passes) == len(profiles.profiles) >= 4
    ((period_s, publish), (renewal_s, _)) = node.work
    assert (period_s, renewal_s) == (0.25, 10.0)
    publish(NOW_S)
    (target,) = node.sent["target"]
    assert (target.target, target.header.stamp.sec, len(target.covariance)) == ("CBERS 2", int(NOW_S) + 2, 4)
    publish(passes.passes[0].los.sec + 30.0)
    assert len(node.sent["target"]) == 1
    assert not [each for each in node.subscriptions if "weather" in each.topic_name or "attitude" in each.topic_name]


def test_a_target_is_selected_by_name_start_and_peak_and_a_refusal_has_its_reason(make: Callable[..., Any]) -> None:
    node = make(source__hold=True)
    start_s = node.sent["passes"][0].passes[0].los.sec + 60.0
    answer = select(node, target="CBERS 2", start=stamp_from_seconds(start_s), minimum_peak_elevation=0.2)
    assert (answer.success, answer.message) == (True, f"{len(answer.passes)} passes of CBERS 2")
    assert answer.passes[0].aos.sec > start_s
    assert min(each.peak_elevation for each in answer.passes) >= 0.2
    assert node.parameters.value("source").hold is False
    refused = select(node, target="nobody")
    assert not refused.success
    assert "nobody" in refused.message
    assert len(node.sent["passes"]) == 2


def test_measured_weather_and_attitude_are_used_and_read_back_where_they_are_wanted(make: Callable[..., Any]) -> None:
    node = make(source__refraction="measured", source__antenna__half_power_beamwidth_deg=40.0)
    give(node, "weather/temperature", Temperature(temperature=30.0))
    give(node, "weather/pressure", FluidPressure(fluid_pressure=94000.0))
    give(node, "weather/humidity", RelativeHumidity(relative_humidity=0.4))
    for roll_rad, frame, valid in ((0.5, "sat/orbit", True), (0.9, "sat/orbit", False), (0.9, "earth", True)):
        message = Attitude(valid=valid)
        message.header.frame_id = frame
        message.orientation.x, message.orientation.w = math.sin(0.5 * roll_rad), math.cos(0.5 * roll_rad)
        give(node, "satellite_attitude", message)
    assert node.inputs.refused == {"satellite_attitude": 1}
    node.work[1][1](NOW_S)
    source = node.parameters.value("source")
    found = (source.weather.temperature_k, source.weather.pressure_hpa, source.weather.relative_humidity)
    assert found == pytest.approx((303.15, 940.0, 0.4))
    assert source.antenna.roll_rad == pytest.approx(0.5)


def test_what_is_set_live_is_in_force_and_a_new_configuration_begins_without_passes(make: Callable[..., Any]) -> None:
    node = make()
    node.set_parameters([Parameter("publisher.lead_s", value=9.0), Parameter("source.along_track_offset_s", value=0.5)])
    node.work[0][1](NOW_S)
    assert node.sent["target"][0].header.stamp.sec == int(NOW_S) + 9
    assert node.prediction.track.along_track_offset_s == 0.5
    node.on_deactivate(STATE)
    node.on_cleanup(STATE)
    assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS
    assert node.prediction.passes == []
