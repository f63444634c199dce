"""A node that no longer receives knows it, and one whose neighbours are busy, gone or new is not fooled."""

from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message

from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.input_watchdog import TOPIC, InputWatchdog

OWN = "/gs1/pointing_controller"
OTHERS = ("/gs1/antenna_servo", "/gs1/rf_receiver", "/gs1/bias_calibrator")
SERVO, RECEIVER, CALIBRATOR = OTHERS
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
        self.sends = self.active = self.works = True
        self.damaged_topics = set[str]()
        self.received: dict[str, str] = {}
        power = "/gs1/received_power"
        self.sent = {SERVO: [TOPIC, "/gs1/joint_states"], OWN: [TOPIC, "/gs1/joint_trajectory"], RECEIVER: [power]}
        self.taken = {OWN: [TOPIC, "/gs1/joint_states", power], SERVO: [TOPIC, "/gs1/joint_trajectory"]}
        self.diagnostics = SimpleNamespace(add=lambda *_given: None)
        self.watchdog = InputWatchdog(self, lambda: self.t_s)
        self.count, _ = self.watchdog.watch(INPUT)
        self.done, self.forget = self.watchdog.watch_work(0.5)

    def get_fully_qualified_name(self) -> str:
        return OWN

    def get_namespace(self) -> str:
        return "/gs1"

    def resolve_topic_name(self, topic: str) -> str:
        return {"weather/wind": "/site/wind"}.get(topic, f"/gs1/{topic}")

    def now_s(self) -> float:
        return self.node_s

    def create_subscription(self, *_given: Any, raw: bool) -> None:
        assert raw

    def get_publishers_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        parts = [name.rsplit("/", 1) for name in self.present.get(topic, [])]
        return [SimpleNamespace(node_namespace=space, node_name=name) for space, name in parts]

    def get_publisher_names_and_types_by_node(self, name: str, space: str) -> list[tuple[str, list[str]]]:
        return [(topic, []) for topic in self.sent.get(f"{space}/{name}", [])]

    def get_subscriber_names_and_types_by_node(self, name: str, space: str) -> list[tuple[str, list[str]]]:
        return [(topic, []) for topic in self.taken.get(f"{space}/{name}", [])]

    def run(self, seconds: int, **changes: Any) -> tuple[bytes, str]:
        """Let seconds pass; `changes` are attributes of this graph from now on."""
        vars(self).update(changes)
        for _ in range(seconds):
            self.t_s, self.node_s = self.t_s + 1.0, self.node_s + self.speed
            for name in [*self.says, OWN, "/gs2/antenna_servo"]:
                values = [KeyValue(key="received", value=self.received[name])] if name in self.received else []
                # Whoever names a node is not that node.
                values.append(KeyValue(key="commander", value=SERVO))
                status = DiagnosticStatus(
                    name=f"{name[1:]}: state", message=self.state, hardware_id=name, values=values
                )
                self.watchdog.note(serialize_message(DiagnosticArray(status=[status])))
            if self.sends:
                self.count()
            if self.works:
                self.done()
            health = self.watchdog.look()
        return health.level, health.message


SILENT: dict[str, Any] = {"says": [], "sends": False}
TALKING: dict[str, Any] = {"says": list(OTHERS), "sends": True}
NO_INPUT: dict[str, Any] = {"sends": False}
Phase = tuple[int, dict[str, Any]]


@pytest.mark.parametrize(
    ("phases", "deaf"),
    [
        ([(100, {})], ""),
        # All neighbours are silent, though the node receives itself and other antennas.
        ([(30, {}), (24, SILENT)], ""),
        ([(30, {}), (26, SILENT)], "nothing has been received from /gs1/antenna_servo, /gs1/bias_calibrator, "
         "/gs1/rf_receiver for 26 s"),
        # One that is busy, and one that is alone, prove nothing.
        ([(5, {}), (100, {"says": list(OTHERS[:2])})], ""),
        # Neighbours that have ended or have just started are not silent.
        ([(5, {}), (20, SILENT), (60, {"present": {TOPIC: [OWN]}}),
          (20, {"present": {TOPIC: [OWN, *OTHERS], INPUT: [OTHERS[0]]}})], ""),
        # An input counts as silent only while its publisher is active, received, and time goes on.
        ([(10, {}), (5, NO_INPUT)], ""),
        ([(10, {}), (15, NO_INPUT)], "joint_states has been silent for 6 s although its publisher is active"),
        ([(10, {}), (70, NO_INPUT | {"state": "inactive"})], ""),
        # One that knows why it is silent says so.
        ([(10, {}), (70, NO_INPUT | {"state": "joint_states are silent: drive lost"})], ""),
        ([(10, {}), (70, NO_INPUT | {"speed": 0.0})], ""),
        ([(10, {}), (15, NO_INPUT | {"speed": 10.0})], "joint_states has been silent for 6 s although its "
         "publisher is active"),
        ([(10, {}), (70, NO_INPUT | {"says": list(OTHERS[1:])})], ""),
        # At half speed 10 s of the wall are 5 s of the antenna's.
        ([(5, {}), (10, NO_INPUT | {"speed": 0.5})], ""),
        ([(5, {}), (11, NO_INPUT | {"speed": 0.5})], "joint_states has been silent for 11 s although its publisher "
         "is active"),
        # A time that goes back adds nothing, and an input that comes again starts anew.
        ([(5, {}), (3, NO_INPUT), (2, {"speed": -3.0}), (2, {"speed": 1.0})], ""),
        ([(5, {}), (4, NO_INPUT), (1, TALKING), (4, NO_INPUT), (1, TALKING), (4, NO_INPUT)], ""),
        # Work that is not done while it is due, in wall and node time.
        ([(5, {}), (6, {"works": False})], ""),
        ([(5, {}), (7, {"works": False})], "the work of every 0.5 s has not been done for 7 s"),
        # Simulated time that begins has not passed: it goes at a fiftieth of real time afterwards.
        ([(2, {"node_s": 0.0, "speed": 0.0}), (99, {"works": False, "node_s": 1e9, "speed": 0.02})], ""),
        ([(5, {}), (99, {"works": False, "speed": 0.0})], ""), ([(5, {}), (99, {"works": False, "active": False})], ""),
    ],
)  # fmt: skip
def test_a_node_is_deaf_only_where_others_prove_it(phases: list[Phase], deaf: str) -> None:
    graph = Graph()
    for seconds, changes in phases:
        level, message = graph.run(seconds, **changes)
    assert graph.watchdog.deaf == deaf
    if deaf:
        assert (level, message) == (ERROR, f"{deaf}: the node starts again")


def test_silent_neighbours_are_a_warning_while_one_is_received_or_there_is_only_one() -> None:
    graph = Graph(OTHERS[:2])
    graph.run(5)
    assert graph.run(60, says=[OTHERS[0]]) == (WARN, "/gs1/rf_receiver has been silent for 60 s")
    assert graph.run(5, says=list(OTHERS[:2])) == (OK, "2 neighbours")
    alone = Graph(OTHERS[2:])
    assert alone.run(100, says=[])[0] == WARN
    assert alone.watchdog.deaf == ""


ALL_BUT = {each: "".join(f"{name} " for name in (OWN, *OTHERS) if name != each) for each in OTHERS}


@pytest.mark.parametrize(
    ("says", "received", "deaf"),
    [
        # The servo is silent here, and the others receive it, or one of two, or none.
        ([RECEIVER, CALIBRATOR], ALL_BUT, f"nothing has been received from {SERVO} for 11 s, which others receive"),
        ([RECEIVER, CALIBRATOR], ALL_BUT | {RECEIVER: f"{OWN} "},
         f"nothing has been received from {SERVO} for 16 s, which others receive"),
        ([RECEIVER], {CALIBRATOR: f"{OWN} {SERVO} ", RECEIVER: f"{OWN} "}, ""),
        ([RECEIVER, CALIBRATOR], dict.fromkeys(OTHERS, f"{OWN} "), ""),
        # Nothing is needed of one that is silent here.
        ([SERVO, RECEIVER], ALL_BUT, ""),
        # A node says nothing of others, or is one that does not say whom it receives.
        ([RECEIVER], {RECEIVER: ""}, ""), ([RECEIVER], {}, ""),
        # None of the others receives this one; or not one that needs it, one that it needs, or neither.
        (OTHERS, dict.fromkeys(OTHERS, ""), f"{SERVO}, {CALIBRATOR}, {RECEIVER} has not received this node for 10 s"),
        (OTHERS, ALL_BUT | {SERVO: ""}, ""),
        (OTHERS, ALL_BUT | {RECEIVER: ""}, f"{RECEIVER} has not received this node for 10 s"),
        (OTHERS, ALL_BUT | {CALIBRATOR: ""}, ""),
    ],
)  # fmt: skip
def test_nodes_that_compare_whom_they_receive_find_the_one_that_starts_again(
    says: list[str], received: dict[str, str], deaf: str
) -> None:
    graph = Graph()
    graph.run(5)
    _, _ = graph.run(40, says=list(says), received=received)
    assert graph.watchdog.deaf == deaf


def test_nodes_that_are_new_find_each_other_slowly_and_prove_nothing() -> None:
    graph = Graph()
    graph.run(9, says=[RECEIVER, CALIBRATOR], received=dict.fromkeys(OTHERS, f"{SERVO} "))
    assert "received" not in graph.watchdog.look().values
    graph.run(9, received=ALL_BUT, says=list(OTHERS))
    assert graph.watchdog.deaf == ""


def test_a_look_that_comes_late_proves_no_more_than_one_in_time() -> None:
    """On a busy machine each second of work takes three."""
    graph, late = Graph(), {"says": [RECEIVER, CALIBRATOR], "received": ALL_BUT}
    graph.run(15)
    for _ in range(6):
        graph.t_s += 1.9
        graph.run(1, **late)
    assert graph.watchdog.deaf == ""
    graph.run(4)
    assert graph.watchdog.deaf.startswith(f"nothing has been received from {SERVO} for ")


def test_nodes_of_a_namespace_below_never_name_this_one() -> None:
    below = tuple(f"/gs1/{site}/receiver" for site in ("usingen", "kourou", "weilheim"))
    graph = Graph(below)
    graph.sent[OWN].append("/gs1/target")
    graph.taken |= {name: [TOPIC, "/gs1/target"] for name in below}
    graph.run(60, received=dict.fromkeys(below, ""))
    assert graph.watchdog.deaf == ""


def test_a_neighbour_that_was_killed_may_be_found_later_here_than_by_others() -> None:
    graph, without = Graph(), {each: ALL_BUT[each].replace(f"{SERVO} ", "") for each in OTHERS}
    graph.run(5, received=ALL_BUT)
    # For as long as it is in the graph after its death, and until the new process is received.
    graph.run(20, says=[RECEIVER, CALIBRATOR], received=without)
    graph.run(5, received=ALL_BUT)
    graph.run(5, says=list(OTHERS))
    assert graph.watchdog.deaf == ""


def test_what_moves_the_antenna_starts_again_last() -> None:
    graph = Graph()
    graph.sent[OWN].append("/gs1/target")
    graph.taken[RECEIVER] = ["/gs1/target"]
    graph.run(5, received=ALL_BUT)
    graph.run(20, says=[SERVO, CALIBRATOR])
    assert graph.watchdog.deaf == ""
    graph.run(1)
    assert graph.watchdog.deaf.startswith(f"nothing has been received from {RECEIVER} for 21 s")


def test_a_neighbour_that_only_others_have_in_their_graph_is_lost_here() -> None:
    graph = Graph()
    graph.run(5, received=ALL_BUT)
    # One that ends is in the lists of the others for some seconds.
    here = {"present": {TOPIC: [OWN, RECEIVER, CALIBRATOR]}, "says": [RECEIVER, CALIBRATOR]}
    graph.run(9, **here)
    graph.run(5, received=dict.fromkeys(OTHERS, f"{OWN} {RECEIVER} {CALIBRATOR} "))
    assert graph.watchdog.deaf == ""
    graph.run(11, received=ALL_BUT)
    assert graph.watchdog.deaf.startswith(f"nothing has been received from {SERVO} for 16 s")


def test_what_a_node_receives_is_what_its_neighbours_read() -> None:
    graph, other = Graph(), Graph()
    graph.run(20)
    graph.run(15, says=[SERVO, CALIBRATOR])
    values = {key: str(value) for key, value in graph.watchdog.look().values.items()}
    assert values == {"received": f"{SERVO} {CALIBRATOR} "}
    other.run(30, received=dict.fromkeys(OTHERS, values["received"]), says=list(OTHERS))
    assert other.watchdog.deaf.endswith("has not received this node for 10 s")


def test_a_name_that_becomes_damaged_ends_the_node_and_one_that_always_was_does_not() -> None:
    graph = Graph()
    graph.run(5)
    graph.run(5, damaged_topics={TOPIC})
    assert graph.watchdog.deaf == ""
    graph.run(1)
    assert graph.watchdog.deaf == "the names of the senders of /diagnostics have been damaged for 6 s"
    stranger = Graph()
    stranger.damaged_topics = {TOPIC}
    stranger.run(100)
    assert stranger.watchdog.deaf == ""


@pytest.mark.parametrize("stall_s", [9.0, 60.0])
def test_seconds_in_which_the_node_itself_did_not_look_prove_nothing(stall_s: float) -> None:
    """All processes stop; the node looks before the first message is taken.  Of each stall three seconds count."""
    graph = Graph()
    graph.run(5)
    for _ in range(8):
        graph.t_s, graph.node_s = graph.t_s + stall_s, graph.node_s + stall_s
        graph.run(1, **SILENT)
        assert graph.watchdog.deaf == ""
    level, message = graph.run(2)
    assert (level, message.rpartition("for ")[2]) == (ERROR, "26 s: the node starts again")


def test_an_input_that_ends_proves_nothing_any_more() -> None:
    graph = Graph()
    _, forget = graph.watchdog.watch(INPUT)
    forget()
    assert graph.run(60)[1] == "3 neighbours"


def test_a_required_input_is_missing_until_it_comes_and_when_its_last_sender_has_gone() -> None:
    graph, taken = Graph(), list[str]()
    take = {topic: graph.watchdog.require(topic, taken.append) for topic in (INPUT, "target", "weather/wind")}
    assert graph.watchdog.missing() == (
        "joint_states (antenna_servo), target (ephemeris_publisher, target_designate), /site/wind"
    )
    # The target is silent between passes: somebody who may send it is enough.
    graph.present["target"] = ["/gs1/ephemeris_publisher"]
    take[INPUT]("state")
    take["weather/wind"]("gust")
    assert (graph.watchdog.missing(), taken) == ("", ["state", "gust"])
    graph.run(30)
    assert graph.watchdog.missing() == "/site/wind", "nobody sends it, and nothing came for 25 s"
    graph.present = {TOPIC: [OWN], "weather/wind": ["/gs1/anemometer"]}
    assert graph.watchdog.missing() == "joint_states (antenna_servo), target (ephemeris_publisher, target_designate)"
    graph.watchdog.require_no_longer(INPUT)
    assert graph.watchdog.missing() == "target (ephemeris_publisher, target_designate)"
