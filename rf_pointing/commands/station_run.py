"""One run of a station on the live graph: nodes, recording, and an orderly end.

A simulated antenna has a clock and a receiver of its own, and time is held until the run begins.
An antenna with a drive runs in real time; what its receiver publishes is recorded.
"""

import argparse
import math
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from rclpy.action import ActionClient
from std_srvs.srv import Trigger

from rf_pointing.commands.options import say, station_of
from rf_pointing.commands.track_options import (
    bag_folder,
    in_real_time,
    nodes_of,
    notes,
    parameter_files,
    parameters,
)
from rf_pointing.ephemeris import Pass
from rf_pointing.ros.graph import NODES, TOPICS, topics_of
from rf_pointing.ros.main_loop import make_executor, settle_garbage
from rf_pointing.ros.managed_graph import ManagedGraph, NotStartedError
from rf_pointing.ros.recorder import Recorder

PATIENCE_S = 120.0
"""Wall time that one step of the bring-up may take; a process that has ended is noticed at once."""
# At a load of 20 on two cores, eight interpreters need half a minute to start.
SETTLE_S = 0.2
"""Publishers and subscribers that the graph knows still need a moment to match each other."""
SAY_EVERY_S = 60.0
EVENT_S = 0.02
"""Longest wait for one event where an answer is awaited."""
FOLLOW_S = 0.1
"""The same where a pass or a night is followed to its end."""
LOOK_PERIOD_S = 0.2
"""Time between two checks that every node still runs."""
PUNCTUAL = ("simulation_clock", "antenna_servo")
"""These have priority in real time."""
# All nodes wake at once every 0.1 s; only the servo's 50 Hz cannot wait some milliseconds.
CLOCK = NODES[:1]


class InterruptedRunError(Exception):
    """The user stopped the run before the graph was up."""


class GraphRun:
    """A node of the user's own in `namespace`, the `graph` that it has started, and its end."""

    graph: ManagedGraph | None = None

    def __init__(self, program: str, namespace: str) -> None:
        self.node = rclpy.create_node(program, namespace=namespace)
        self.stopping = False
        """Whether the user has requested the end of the run."""
        self._program, self._executor = program, make_executor()
        self._executor.add_node(self.node)

    def say(self, text: str) -> None:
        """Report to the user on stderr; stdout is for data."""
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

    def send(self, client: ActionClient, goal: Any, owner: str, feedback: Callable[[Any], None] | None = None) -> Any:
        """Send a goal and return its handle; NotStartedError if it is refused."""
        future, deadline_s = client.send_goal_async(goal, feedback_callback=feedback), time.monotonic() + PATIENCE_S
        while not future.done():
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"an answer of {owner} not seen within {PATIENCE_S:.0f} s")
            self.spin(EVENT_S)
        if not future.result().accepted:
            raise NotStartedError(f"the goal was refused: {owner} is not active, or has another one")
        return future.result()

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


class StationRun(GraphRun):
    """The station of the options in their namespace, with its recording.

    `options` are those of `track`; simulated time begins shortly before `window`, the first pass.
    """

    graph: ManagedGraph

    def __init__(self, program: str, options: argparse.Namespace, window: Pass, output: Path) -> None:
        super().__init__(program, options.namespace)
        self._begun, self._reset = False, options.reset_fault
        self.real, self._nodes = not station_of(options).simulated, nodes_of(options)
        on_time = PUNCTUAL if in_real_time(options) else ()
        files = parameter_files(options, parameters(options, window, output), output)
        self.graph = ManagedGraph(
            self.node, options.namespace, files, output / "logs", self.spin, patience_s=PATIENCE_S, on_time=on_time
        )
        topics = topics_of(self._nodes) if self.real else TOPICS
        self._recorder = Recorder(self.node, options.namespace, bag_folder(options, output), topics, notes(options))

    def spin(self, timeout_s: float) -> None:
        """Handle one event, or wait for one; InterruptedRunError if stopped before time runs."""
        if self.stopping and not self._begun:
            raise InterruptedRunError
        super().spin(timeout_s)

    def bring_up(self, *actions: ActionClient) -> None:
        """Start and activate all nodes, until all topics and `actions` match.

        Simulated time is held meanwhile; a real antenna stands where it is.
        """
        began_s = time.monotonic()
        self.graph.start(self._nodes, simulated_time=not self.real)
        # The clock first: while the others start, its held time reaches them.
        others = [name for name in self._nodes if name not in CLOCK]
        if not self.real:
            self.graph.configure(CLOCK)
        self.graph.configure(others)
        self.graph.activate(others)
        self.graph.wait_until(lambda: all(client.server_is_ready() for client in actions), "the actions")
        self.graph.wait_until(lambda: not self._recorder.unmatched(), "every topic")
        self.graph.wait(SETTLE_S)
        self.say(f"{len(self._nodes)} nodes matched and active in {time.monotonic() - began_s:.1f} s")
        if self._reset:
            self.say(f"reset of a latched fault: {self.call('antenna_servo/reset_fault').message}")
            # The controller refuses a pass until it has received that the fault is gone.
            self.graph.wait(SETTLE_S)

    def call(self, name: str) -> Trigger.Response:
        """Call a service of a node that takes no argument, and return its answer."""
        client = self.node.create_client(Trigger, name)
        self.graph.wait_until(client.service_is_ready, name)
        future = client.call_async(Trigger.Request())
        self.graph.wait_until(future.done, f"an answer of {name}")
        return future.result()

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
        if not self.real:
            self.graph.change(CLOCK, "activate")
        self._begun = True
        # Collections of the recorder's process delay what it receives.
        settle_garbage()

    def hold_time(self) -> None:
        """Stop simulated time; a real antenna stands where the last pass has left it."""
        if not self.real:
            self.graph.change(CLOCK, "deactivate")

    def send(self, client: ActionClient, goal: Any, owner: str, feedback: Callable[[Any], None] | None = None) -> Any:
        """Send a goal and return its handle; NotStartedError with the reason if it is refused."""
        future = client.send_goal_async(goal, feedback_callback=feedback)
        self.graph.wait_until(future.done, f"an answer of {owner}")
        if not future.result().accepted:
            raise NotStartedError(f"the goal was refused: {self.graph.complaint(owner)}")
        return future.result()

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
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    try:
        run = make()
    except (OSError, ValueError) as error:
        say(program, str(error))
        rclpy.try_shutdown()
        return 2
    for sign in (signal.SIGINT, signal.SIGTERM):
        signal.signal(sign, run.interrupt)
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
    return code
