"""A drive behind topics: what it sends to a vendor's node, and what it makes of the state that comes back."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from rf_pointing.drives import DriveParams
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.topic_drive import TopicDrive

NOW_S = 1.8e9
NAMES = ("azimuth", "elevation")
USELESS = "state that cannot be used"


class Bench:
    """A drive whose outputs are lists, at its first period."""

    def __init__(self, node: Any, model: str = "") -> None:
        self.set_points, self.enabled = list[JointState](), list[bool]()
        self.drive = TopicDrive(node, DriveParams(type="topic", model=model))
        # The lists in place of a wire: what is sent by each publisher of the drive's own node.
        for publisher in self.drive.node.publishers:
            if publisher.msg_type is JointState:
                publisher.publish = self.set_points.append
            elif publisher.msg_type is Bool:
                publisher.publish = lambda message: self.enabled.append(message.data)
        self.drive.step(NOW_S)

    def state(
        self, names: tuple[str, ...] = NAMES, position: tuple[float, ...] = (1.0, 0.5), velocity: tuple[float, ...] = (),
        t_s: float = NOW_S,
    ) -> None:  # fmt: skip
        message = JointState(name=list(names), position=list(position), velocity=list(velocity))
        message.header.stamp = stamp_from_seconds(t_s)
        self.drive.take_state(serialize_message(message))


@pytest.fixture
def bench(make_node: Callable[..., Any]) -> Iterator[Bench]:
    made = Bench(make_node("antenna_servo"))
    yield made
    made.drive.close()


def test_a_drive_takes_positions_unless_it_is_one_of_rates(bench: Bench, make_node: Callable[..., Any]) -> None:
    capabilities, params = bench.drive.capabilities, DriveParams()
    assert capabilities.set_points == "position"
    assert capabilities.resolution_rad == tuple(step or 1e-4 for step in params.rotator.resolution_rad)
    assert capabilities.period_s == params.link.poll_period_s
    rates = Bench(make_node("other_servo"), "rate")
    assert rates.drive.capabilities.set_points == "rate"
    rates.drive.close()
    with pytest.raises(ValueError, match="'torque'"):
        Bench(make_node("third_servo"), "torque")


def test_set_points_are_stamped_with_the_time_of_the_period(bench: Bench) -> None:
    bench.drive.go_to((1.0, 0.5))
    bench.drive.turn((0.1, -0.2))
    place, rate = bench.set_points
    assert (tuple(place.name), list(place.position), list(place.velocity)) == (NAMES, [1.0, 0.5], [])
    assert (list(rate.position), list(rate.velocity)) == ([], [0.1, -0.2])
    assert seconds_from_stamp(place.header.stamp) == NOW_S
    assert place.header.frame_id.startswith("test/")


def test_a_state_is_read_by_the_names_of_its_joints(bench: Bench) -> None:
    assert bench.drive.step(NOW_S) is None
    assert "no message on drive/state" in bench.drive.problem
    bench.state()
    reading = bench.drive.step(NOW_S)
    assert (reading.t_s, reading.position_rad, reading.rate_rad_s) == (NOW_S, (1.0, 0.5), None)
    assert bench.drive.problem == ""
    bench.state(("polarizer", "elevation", "azimuth"), (9.0, 0.6, 1.1), (8.0, 0.02, 0.01))
    reading = bench.drive.step(NOW_S)
    assert (reading.position_rad, reading.rate_rad_s) == ((1.1, 0.6), (0.01, 0.02))


@pytest.mark.parametrize(
    "state",
    [{"names": ("azimuth",), "position": (1.0,)},
     {"names": ("azimuth", "elevation", "azimuth"), "position": (1.0, 0.5, 1.0)},
     {"position": (1.0,)}, {"position": (1.0, 0.5, 0.2)}, {"velocity": (0.1,)}, {"names": (), "position": ()},
     {"t_s": NOW_S + 100.0}],
)  # fmt: skip
def test_a_state_that_cannot_be_used_is_counted_and_keeps_the_one_before(bench: Bench, state: dict[str, Any]) -> None:
    bench.state(position=(1.0, 0.5))
    bench.state(**state)
    assert bench.drive.losses == {USELESS: 1}
    assert bench.drive.step(NOW_S).position_rad == (1.0, 0.5)
    assert bench.drive.problem == "", "the state before it is fresh"
    for t_s in (99.98, 100.0):
        bench.drive.step(NOW_S + t_s)
    assert "can be used" in bench.drive.problem
    bench.state(t_s=NOW_S + 100.0)
    bench.drive.step(NOW_S + 100.0)
    assert bench.drive.problem == ""


def test_a_state_older_or_newer_than_the_loss_of_the_device_is_none(bench: Bench) -> None:
    lost_s = DriveParams().link.lost_s
    bench.state(t_s=NOW_S + lost_s)
    assert bench.drive.losses == {USELESS: 0}
    bench.state(t_s=NOW_S + lost_s + 0.01)
    assert bench.drive.losses == {USELESS: 1}
    bench.drive.step(NOW_S + 2.0 * lost_s)
    assert bench.drive.problem == ""
    bench.state(t_s=NOW_S + lost_s)
    bench.drive.step(NOW_S + 2.0 * lost_s + 0.01)
    assert bench.drive.problem == "", "a step that came late is not silence"
    bench.drive.step(NOW_S + 2.0 * lost_s + 0.03)
    assert "no message on drive/state for" in bench.drive.problem
    now_s = NOW_S + 2.0 * lost_s + 0.03
    for tick in range(1, 7):
        if tick % 3 == 1:
            bench.state(t_s=now_s + 0.02 * tick - 60.0)
        bench.drive.step(now_s + 0.02 * tick)
        assert "stamps on drive/state are 60.0 s behind this computer's clock" in bench.drive.problem


@pytest.mark.parametrize(("by_s", "words"), [(60.0, "are 60.0 s behind this"), (-60.0, "is 60.0 s ahead of this")])
def test_a_step_of_the_clock_makes_no_state_old_but_the_next_one_of_a_driver_without_it(
    bench: Bench, by_s: float, words: str
) -> None:
    bench.state()
    bench.drive.step(NOW_S)
    bench.drive.clock_stepped(by_s)
    bench.drive.step(NOW_S + by_s + 0.02)
    assert bench.drive.problem == ""
    bench.state(t_s=NOW_S + 0.04)
    for tick in range(60):
        bench.drive.step(NOW_S + by_s + 0.04 + 0.02 * tick)
    assert words in bench.drive.problem


def test_the_state_of_a_step_is_the_newest_that_has_arrived(bench: Bench, make_node: Callable[..., Any]) -> None:
    vendor = make_node("vendor").create_publisher(JointState, "drive/state", 10)
    while not vendor.get_subscription_count():
        time.sleep(0.01)
    for burst in range(3):
        for k in range(6):
            vendor.publish(
                JointState(
                    name=list(NAMES), position=[burst + 0.1 * k, 0.5], header=Header(stamp=stamp_from_seconds(NOW_S))
                )
            )
        time.sleep(0.3)
        assert bench.drive.step(NOW_S).position_rad[0] == burst + 0.1 * 5


def test_a_driver_that_publishes_best_effort_is_heard(bench: Bench) -> None:
    (heard,) = (each for each in bench.drive.node.subscriptions if each.topic_name.endswith("drive/state"))
    assert heard.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
