"""One run of a station on the live graph: nodes, recording, and an orderly end.

A simulated antenna has a clock and a receiver of its own, and time is held until the run begins.
An antenna with a drive runs in real time; what its receiver publishes is recorded.
"""

import math
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import rclpy
import yaml
from lifecycle_msgs.srv import GetState
from rclpy.action import ActionClient
from std_srvs.srv import Trigger

from rf_pointing.core import LEVEL, Kinematics, mount_from_notes
from rf_pointing.ros.graph import NODES, TOPICS, topics_of
from rf_pointing.ros.main_loop import log_as_chosen, make_executor, ros_domain, settle_garbage
from rf_pointing.ros.managed_graph import ONE_LOG, ManagedGraph, NotStartedError, Waiting
from rf_pointing.ros.recorder import Recorder
from rf_pointing.station.log_lines import say

PATIENCE_S = 120.0
"""Wall time that one step of the bring-up may take; a process that has ended is noticed at once."""
# At a load of 20 on two cores, eight interpreters need half a minute to start.
SETTLE_S = 0.2
"""Publishers and subscribers that the graph knows still need a moment to match each other."""
SAY_EVERY_S = 60.0
FOLLOW_S = 0.1
"""Longest wait for one event where a pass or a night is followed to its end."""
LOOK_PERIOD_S = 0.2
"""Time between two checks that every node still runs."""
PUNCTUAL = ("simulation_clock", "antenna_servo")
"""These have priority in real time."""
# All nodes wake at once every 0.1 s; only the servo's 50 Hz cannot wait some milliseconds.
CLOCK = NODES[:1]


def parameter_file(folder: Path, given: Mapping[str, Mapping[str, Any]]) -> Path:
    """Write the parameters `given` by node into a folder, and return the file."""
    written = folder / "run.yaml"
    sections = {f"/**/{node}": {"ros__parameters": dict(values)} for node, values in given.items()}
    written.write_text(yaml.safe_dump(sections, sort_keys=False))
    return written


class InterruptedRunError(Exception):
    """The user stopped the run before the graph was up."""


class GraphRun:
    """A node of the user's own in `namespace`, the `graph` that it has started, and its end."""

    graph: ManagedGraph | None = None

    def __init__(self, program: str, namespace: str, *, name: str = "", patience_s: float = PATIENCE_S) -> None:
        self.node = rclpy.create_node(name or program, namespace=namespace)
        self.namespace, self.stopping = namespace, False
        """Whether the user has requested the end of the run."""
        self._program, self._executor = program, make_executor()
        self._executor.add_node(self.node)
        self.waiting = Waiting(self.spin, patience_s, self.check)

    @property
    def place(self) -> str:
        """Where it looks: the same namespace of another domain is another station."""
        return f"{self.namespace} of ROS domain {ros_domain()}"

    def say(self, text: str) -> None:
        """Report to the user on stderr."""
        say(self._program, text)

    def interrupt(self, *_: object) -> None:
        """Request the end of the run; safe in a signal handler."""
        self.stopping = True

    def spin(self, timeout_s: float) -> None:
        """Handle one event, or wait for one."""
        self._executor.spin_once(timeout_sec=timeout_s)

    def check(self) -> None:
        """NotStartedError if a process that the run has started has ended."""
        if self.graph is not None:
            self.graph.check()

    @property
    def mount(self) -> Kinematics:
        """The mount, as far as is known of it; its axes have the names of the joints."""
        return LEVEL

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Wait for `condition`; NotStartedError when the user stops the run."""

        def seen() -> bool:
            if self.stopping:
                raise NotStartedError("interrupted")
            return bool(condition())

        self.waiting.until(seen, f"{what} not seen")

    def send(self, client: ActionClient, goal: Any, owner: str, feedback: Callable[[Any], None] | None = None) -> Any:
        """Send a goal and return its handle; NotStartedError with the reason if it is refused."""
        handle = self.waiting.answer(client.send_goal_async(goal, feedback_callback=feedback), owner)
        if not handle.accepted:
            raise NotStartedError(f"the goal was refused: {self._refusal_of(owner)}")
        return handle

    def _refusal_of(self, owner: str) -> str:
        """Return why a node refuses a goal: what it logs, or its state if another run began it."""
        if self.graph:
            return self.graph.complaint(owner)
        answer = self.waiting.call(self.node, GetState, f"{owner}/get_state", GetState.Request())
        state = answer.current_state.label
        return f"{owner} is {state}; " + ("its log says why" if state == "active" else "it must be active")

    def result(self, handle: Any) -> Any:
        """Return the result of an accepted goal, which is cancelled when the user stops the run."""
        result, cancelled, look_s = handle.get_result_async(), False, 0.0
        while not result.done():
            self.spin(FOLLOW_S)
            # Not at every event: to check eight processes costs more than most events.
            if self.graph is not None and time.monotonic() >= look_s:
                self.graph.check()
                look_s = time.monotonic() + LOOK_PERIOD_S
            if self.stopping and not cancelled:
                cancelled = True
                handle.cancel_goal_async()
        return result.result().result

    def close(self) -> None:
        """End every process, and destroy the run's own node."""
        if self.graph is not None:
            self.graph.stop()
        self._executor.shutdown()
        self.node.destroy_node()


@dataclass(frozen=True, kw_only=True)
class RunSetup:
    """Which nodes of a station run, with which parameters, and what is recorded of them.

    `punctual` gives clock and servo priority; a real antenna is started at `begin_s` (UTC, s since
    1970) for what is `awaited`.
    """

    program: str
    namespace: str
    nodes: tuple[str, ...]
    simulated: bool
    parameter_files: tuple[Path, ...]
    logs: Path
    bag: Path
    notes: Mapping[str, str]
    punctual: bool = False
    reset_fault: bool = False
    begin_s: float = 0.0
    awaited: str = ""
    processes: int = 2


class StationRun(GraphRun):
    """The nodes of a setup in their namespace, with their recording."""

    graph: ManagedGraph

    def __init__(self, setup: RunSetup) -> None:
        super().__init__(setup.program, setup.namespace)
        self._setup, self._begun = setup, False
        on_time = PUNCTUAL if setup.punctual else ()
        self.graph = ManagedGraph(
            self.node, setup.namespace, setup.parameter_files, setup.logs, self.spin,
            patience_s=PATIENCE_S, on_time=on_time, processes=setup.processes,
        )  # fmt: skip
        topics = TOPICS if setup.simulated else topics_of(setup.nodes)
        given = setup.bag, topics, setup.notes, setup.simulated
        self._recorder = Recorder(self.node, setup.namespace, *given)

    @property
    def mount(self) -> Kinematics:
        """The mount of the station."""
        return mount_from_notes(self._setup.notes) or LEVEL

    def spin(self, timeout_s: float) -> None:
        """Handle one event, or wait for one; InterruptedRunError if stopped before time runs."""
        if self.stopping and not self._begun:
            raise InterruptedRunError
        super().spin(timeout_s)

    def bring_up(self, *actions: ActionClient) -> None:
        """Start and activate all nodes, until all topics and `actions` match.

        Simulated time is held meanwhile; a real antenna is started in time for its first pass, and
        stands where it is.
        """
        nodes, simulated = self._setup.nodes, self._setup.simulated
        if not simulated:
            self.wait_for(self._setup.begin_s, f"{self._setup.awaited} is waited for; the antenna is started")
        began_s = time.monotonic()
        self.graph.start(nodes, simulated_time=simulated)
        # The clock first: while the others start, its held time reaches them.
        others = [name for name in nodes if name not in CLOCK]
        if simulated:
            self.graph.configure(CLOCK)
        self.graph.configure(others)
        self.graph.activate(others)
        self.waiting.until(lambda: all(client.server_is_ready() for client in actions), "the actions not seen")
        self.waiting.until(lambda: not self._recorder.unmatched(), "every topic not seen")
        self.waiting.pause(SETTLE_S)
        self.say(f"{len(nodes)} nodes matched and active in {time.monotonic() - began_s:.1f} s")
        if self._setup.reset_fault:
            self.say(f"reset of a latched fault: {self.request('antenna_servo/reset_fault').message}")
            # The controller refuses a pass until it has received that the fault is gone.
            self.waiting.pause(SETTLE_S)

    def request(self, name: str) -> Trigger.Response:
        """Call a service of a node that takes no argument, and return its answer."""
        answer: Trigger.Response = self.waiting.call(self.node, Trigger, name, Trigger.Request())
        return answer

    def wait_for(self, t_s: float, what: str) -> None:
        """Let real time go on until `t_s` (UTC, s since 1970), and report once a minute."""
        next_s = math.inf
        while (left_s := t_s - time.time()) > 0.0:
            if left_s <= next_s:
                self.say(f"in real time: {what} in {left_s:.0f} s")
                next_s = left_s - SAY_EVERY_S
            self.spin(min(0.5, left_s))

    def run_time(self) -> None:
        """Start simulated time; real time does not wait."""
        if self._setup.simulated:
            self.graph.change(CLOCK, "activate")
        self._begun = True
        # Collections of the recorder's process delay what it receives.
        settle_garbage()

    def hold_time(self) -> None:
        """Stop simulated time; a real antenna stands where the last pass has left it."""
        if self._setup.simulated:
            self.graph.change(CLOCK, "deactivate")

    def close(self) -> None:
        """End the run, close the bag and report what it lacks."""
        # The nodes first: what they publish at their end belongs in the bag.
        self.graph.stop()
        recorded = self._recorder.close()
        if recorded.problem:
            lost = sum(loss.count for loss in recorded.lost)
            self.say(f"recording stopped: {recorded.problem}; {lost} messages are not in the bag")
        super().close()


RunType = TypeVar("RunType", bound=GraphRun)


def run_to_end(program: str, make: Callable[[], RunType], work: Callable[[RunType], int]) -> int:
    """Do `work` with the run that `make` returns and end the run, whatever happens.

    Return the exit code: that of `work`, 1 for an interrupted run, 2 for one that did not start.
    """
    # Ctrl-C must cancel the goal and end the run in order, not end rclpy under it.
    log_as_chosen()
    rclpy.init(args=["--ros-args", ONE_LOG], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    try:
        run = make()
    except (OSError, ValueError) as error:
        say(program, str(error), "ERROR")
        rclpy.try_shutdown()
        return 2
    handlers = {sign: signal.signal(sign, run.interrupt) for sign in (signal.SIGINT, signal.SIGTERM)}
    code = 1
    try:
        code = work(run)
    except (NotStartedError, TimeoutError) as error:
        run.say(str(error))
        code = 2
    except InterruptedRunError:
        run.say("interrupted before the graph was up")
    finally:
        run.close()
        rclpy.try_shutdown()
        for sign, handler in handlers.items():
            signal.signal(sign, handler)
    return code
