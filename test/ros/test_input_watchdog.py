"""A node that no longer receives knows it, and one whose neighbours are busy, gone or new is not fooled."""

from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message

from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.input_watchdog import TOPIC, Hearing

OWN = "/gs1/pointing_controller"
OTHERS = ("/gs1/antenna_servo", "/gs1/rf_receiver", "/gs1/bias_calibrator")
INPUT = "joint_states"
# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


class Graph:
    """A node and its neighbours, second by second; `says` are those whose diagnostics arrive."""

    def __init__(self, others: tuple[str, ...] = OTHERS) -> None:
        self.t_s = self.node_s = 100.0
        self.speed, self.state = 1.0, "active"
        self.present = {TOPIC: [OWN, "/gs2/antenna_servo", *others], INPUT: ["/gs1/antenna_servo"]}
        self.says = list(others)
        self.sends = True
        self.diagnostics = SimpleNamespace(add=lambda *_given: None)
        self.hearing = Hearing(self, lambda: self.t_s)
        self.count = self.hearing.watch(INPUT)

    def get_fully_qualified_name(self) -> str:
        return OWN

    def get_namespace(self) -> str:
        return "/gs1"

    def now_s(self) -> float:
        return self.node_s

    def create_subscription(self, *_given: Any, raw: bool) -> None:
        assert raw

    def get_publishers_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        parts = [name.rsplit("/", 1) for name in self.present.get(topic, [])]
        return [SimpleNamespace(node_namespace=space, node_name=name) for space, name in parts]

    def run(self, seconds: int) -> tuple[bytes, str]:
        for _ in range(seconds):
            self.t_s, self.node_s = self.t_s + 1.0, self.node_s + self.speed
            for name in [*self.says, OWN, "/gs2/antenna_servo"]:
                status = DiagnosticStatus(name=f"{name[1:]}: state", message=self.state, hardware_id=name)
                self.hearing.note(serialize_message(DiagnosticArray(status=[status])))
            if self.sends:
                self.count()
            health = self.hearing.look()
        return health.level, health.message


def test_a_node_that_hears_all_is_not_deaf() -> None:
    graph = Graph()
    assert graph.run(100) == (OK, "3 neighbours")
    assert graph.hearing.deaf == ""


def test_a_node_that_hears_nobody_is_deaf_although_it_hears_itself_and_other_antennas() -> None:
    graph = Graph()
    graph.run(30)
    graph.says, graph.sends = [], False
    graph.run(24)
    assert graph.hearing.deaf == ""
    level, message = graph.run(2)
    assert level == ERROR
    assert message.startswith(
        "nothing has been received from /gs1/antenna_servo, /gs1/bias_calibrator, /gs1/rf_receiver for 2"
    )
    assert message.endswith("s: the node starts again")


def test_a_machine_that_stalled_is_not_deaf() -> None:
    """All processes stop for a minute; the node looks before the first message is taken."""
    graph = Graph()
    graph.run(30)
    graph.t_s, graph.node_s = graph.t_s + 60.0, graph.node_s + 60.0
    says, graph.says, graph.sends = graph.says, [], False
    graph.run(1)
    assert graph.hearing.deaf == ""
    graph.says, graph.sends = says, True
    assert graph.run(5) == (OK, "3 neighbours")


def test_one_neighbour_that_is_busy_is_a_warning_only() -> None:
    graph = Graph()
    graph.run(5)
    graph.says.remove("/gs1/bias_calibrator")
    assert graph.run(100) == (WARN, "/gs1/bias_calibrator has been silent for 100 s")
    assert graph.hearing.deaf == ""
    alone = Graph(OTHERS[2:])
    alone.says = []
    assert alone.run(100)[0] == WARN
    assert alone.hearing.deaf == ""


def test_neighbours_that_ended_or_have_just_started_are_no_silence() -> None:
    graph = Graph()
    graph.run(5)
    graph.says, graph.sends = [], False
    graph.run(20)
    graph.present[TOPIC] = [OWN]
    assert graph.run(60) == (OK, "0 neighbours")
    graph.present[TOPIC] = [OWN, *OTHERS]
    graph.run(20)
    graph.says = list(OTHERS)
    graph.run(60)
    graph.sends = True
    assert graph.hearing.deaf.startswith(INPUT), "its publisher is active and heard again, the input is not"


@pytest.mark.parametrize(
    ("change", "deaf"),
    [({}, True), ({"state": "inactive"}, False), ({"speed": 0.0}, False), ({"speed": 10.0}, True),
     ({"says": list(OTHERS[1:])}, False)],
)  # fmt: skip
def test_a_silent_input_is_deafness_only_while_its_publisher_is_heard_and_active(
    change: dict[str, Any], deaf: bool
) -> None:
    """Not one whose publisher is inactive, not while simulated time is held, not while the publisher is busy."""
    graph = Graph()
    graph.run(10)
    graph.sends = False
    vars(graph).update(change)
    graph.run(10)
    assert graph.hearing.deaf == ""
    graph.run(5 if deaf else 60)
    assert bool(graph.hearing.deaf) is deaf
    if deaf:
        assert graph.hearing.deaf == "joint_states has been silent for 11 s although its publisher is active"


def test_a_node_subscribes_to_diagnostics_and_reports_what_it_finds() -> None:
    made: list[tuple[Any, ...]] = []
    graph = Graph()
    graph.create_subscription = lambda *given, raw: made.append((*given[:3], raw))  # type: ignore[method-assign]
    graph.diagnostics = SimpleNamespace(add=lambda *given: made.append(given))
    hearing = Hearing(graph, lambda: graph.t_s)
    assert made == [(DiagnosticArray, "/diagnostics", hearing.note, True), ("hearing", hearing.look)]


def test_of_two_neighbours_both_must_be_silent() -> None:
    graph = Graph(OTHERS[:2])
    graph.run(5)
    graph.says, graph.sends = [OTHERS[0]], True
    assert graph.run(60) == (WARN, "/gs1/rf_receiver has been silent for 60 s")
    assert graph.hearing.deaf == ""
    graph.says, graph.sends = [], False
    graph.run(24)
    assert graph.hearing.deaf == ""
    graph.run(2)
    assert graph.hearing.deaf == "nothing has been received from /gs1/antenna_servo, /gs1/rf_receiver for 26 s"


def test_a_look_that_comes_late_counts_for_three_seconds_of_silence() -> None:
    """Silence adds up while the node looks; what it has not looked at proves nothing, of neighbours and of inputs."""
    graph = Graph()
    graph.run(5)
    graph.says, graph.sends = [], False
    for _ in range(8):
        graph.t_s, graph.node_s = graph.t_s + 9.0, graph.node_s + 9.0
        graph.run(1)
        assert graph.hearing.deaf == ""
    # Of each ten seconds three have counted.
    level, message = graph.run(2)
    assert (level, message.rpartition("for ")[2]) == (ERROR, "26 s: the node starts again")


def test_an_input_that_comes_again_is_no_longer_silent() -> None:
    graph = Graph()
    graph.run(5)
    for _ in range(3):
        graph.sends = False
        graph.run(9)
        graph.sends = True
        graph.run(1)
    assert graph.hearing.deaf == ""


def test_a_time_that_goes_back_is_no_silence_of_an_input() -> None:
    graph = Graph()
    graph.run(5)
    graph.sends = False
    graph.run(6)
    graph.speed = -3.0
    graph.run(2)
    graph.speed = 1.0
    graph.run(4)
    assert graph.hearing.deaf == ""
    graph.run(1)
    assert graph.hearing.deaf.startswith("joint_states has been silent for")


def test_silence_counts_while_somebody_sends_by_both_clocks() -> None:
    """While time is simulated at half speed, 20 s of the wall are 10 s of the antenna's."""
    graph = Graph()
    graph.run(5)
    graph.sends, graph.state, graph.speed = False, "inactive", 0.5
    graph.run(30)
    graph.state = "active"
    graph.run(20)
    assert graph.hearing.deaf == ""
    graph.run(1)
    assert graph.hearing.deaf == "joint_states has been silent for 21 s although its publisher is active"
