"""What may change on a configured node, and what is refused because it would not be heeded."""

import math
from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState
from rclpy.parameter import Parameter

from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.ros.managed import ManagedNode

CASES = {
    AntennaServo: (("loops.azimuth.proportional_gain", 5.0), ("antenna.start_azimuth_deg", 20.0)),
    PointingControllerNode: (("limits.elevation_min_deg", 6.0), ("pointing.period_s", 0.05)),
    EphemerisPublisher: (("source.along_track_offset_s", 0.25), ("source.satellite", "9998")),
}


@pytest.fixture(params=CASES, ids=lambda kind: kind.__name__)
def subject(request: pytest.FixtureRequest, default_context: None) -> Iterator[ManagedNode]:
    """Yield each node, configured."""
    node = request.param()
    node.on_configure(LifecycleState(state_id=1, label="unconfigured"))
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


def test_a_live_parameter_is_in_force_and_another_is_refused(subject: Any) -> None:
    (live, heeded), (late, ignored) = CASES[type(subject)]
    before = subject.get_parameter(late).value
    (refused,) = subject.set_parameters([Parameter(late, value=ignored)])
    assert refused.reason.startswith(f"{late} is read when the node is configured")
    assert subject.get_parameter(late).value == before
    (taken,) = subject.set_parameters([Parameter(live, value=heeded)])
    assert taken.successful, taken.reason
    in_force = {
        AntennaServo: lambda: subject._antenna.axes.loops.params.azimuth.proportional_gain,
        PointingControllerNode: lambda: pytest.approx(
            math.degrees(subject._controller.params.limits.elevation_min_rad)
        ),
        EphemerisPublisher: lambda: subject.prediction.track.along_track_offset_s,
    }
    assert in_force[type(subject)]() == heeded


def test_cleaned_up_a_node_takes_everything(subject: Any) -> None:
    _, (late, wanted) = CASES[type(subject)]
    subject.on_cleanup(LifecycleState(state_id=2, label="inactive"))
    (taken,) = subject.set_parameters([Parameter(late, value=wanted)])
    assert taken.successful, taken.reason
    assert subject.get_parameter(late).value == wanted
