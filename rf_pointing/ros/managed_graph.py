"""The managed nodes of one namespace, each a process of its own or some together, start to end.

The executables are those that `ros2 run` starts; each process writes its own log.  If this process
dies, the kernel ends its children.
"""

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from ament_index_python.packages import get_package_prefix
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node

from rf_pointing.ros.graph import APART, MOVES, PROCESSES, RECEIVER_GRAPH, SERVED, TRACKERS
from rf_pointing.ros.main_loop import DEAF, last_holder
from rf_pointing.ros.repeated_call import AGAIN_S, RepeatedCall
from rf_pointing.tracking.sensors import SENSORS

ACTIVATION_S = 5.0
"""How long a refused activation is repeated: the held time reaches one node after the other."""
ACTIVATION_PERIOD_S = 0.1
NICENESS = 10
"""Niceness of nodes in the background, so that those on time go first."""
NODE_ENVIRONMENT = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Environment of the nodes, unless it says otherwise."""
# UDP instead of shared memory: as fast for messages this small, and a killed node leaves no
# port for which a restarted one would wait.  One thread: the matrices are small.
_PR_SET_PDEATHSIG = 1
_ENDINGS = ((signal.SIGINT, 4.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 2.0))
"""Signals that end a process, in this order, each with the wall time in s that it may take."""

LOOK_S = 0.02
"""Longest wait for one event where something is awaited."""
# Time in which the executor takes up a client that was just made; an answer that arrives in that
# moment is not noticed (1 of 1700 calls).
TAKEN_UP_S = 0.02


class Answer(Protocol):
    """A future, or a `RepeatedCall`."""

    def done(self) -> bool:
        """Return whether the answer is there."""

    def result(self) -> Any:
        """Return the answer."""


class Waiting:
    """Waits at most `patience_s`; `spin(timeout_s)` must run the executor once.

    `check` raises when waiting is in vain, as when a process has ended.
    """

    def __init__(
        self, spin: Callable[[float], None], patience_s: float, check: Callable[[], None] = lambda: None
    ) -> None:
        self.spin, self.patience_s, self._check = spin, patience_s, check

    def until(
        self, condition: Callable[[], bool], missing: str | Callable[[], str], patience_s: float | None = None
    ) -> None:
        """Wait for `condition`; TimeoutError names what is `missing` when it takes too long."""
        patience_s = self.patience_s if patience_s is None else patience_s
        deadline_s = time.monotonic() + patience_s
        while not condition():
            self._check()
            if time.monotonic() > deadline_s:
                text = missing if isinstance(missing, str) else missing()
                raise TimeoutError(f"{text} within {patience_s:.0f} s")
            self.spin(LOOK_S)

    def pause(self, duration_s: float) -> None:
        """Handle events for a while."""
        deadline_s = time.monotonic() + duration_s
        while time.monotonic() < deadline_s:
            self.spin(LOOK_S)

    def answer(self, future: Answer, owner: str) -> Any:
        """Return what `owner` answers."""
        self.until(future.done, f"an answer of {owner} not seen")
        return future.result()

    def call(self, node: Node, kind: Any, name: str, request: Any) -> Any:
        """Call a service, and return its answer."""
        client = node.create_client(kind, name)
        self.pause(TAKEN_UP_S)
        self.until(client.service_is_ready, f"{name} not seen")
        return self.answer(client.call_async(request), name)


def with_trackers(names: Sequence[str], sensors: Collection[str], receiver: str) -> tuple[str, ...]:
    """Return the executables of a real antenna whose bands have these `sensors`.

    Where no band has any, one stays for a described `receiver`: it reports the C/N0.
    """
    wanted = {SENSORS[name].node for name in sensors if name in SENSORS}
    if not wanted and receiver != "simulated":
        wanted = {SENSORS[name].node for traits in SENSORS.values() for name in traits.level_from}
    return tuple(name for name in names if name not in TRACKERS or name in wanted)


def with_receiver(names: Sequence[str], receiver: str) -> tuple[str, ...]:
    """Return the executables of a station with this `receiver` in place of the simulated one.

    `names` are those with a simulated receiver, or none: with a drive that is a device.
    """
    if receiver == "simulated":
        return tuple(names)
    source, own = (node.name for node in RECEIVER_GRAPH)
    rest = tuple(name for name in names if name != "rf_receiver")
    if receiver == "topic":
        return rest
    return (*rest, source, own) if rest != tuple(names) and receiver in SERVED else (*rest, own)


def partition(names: Sequence[str], processes: int) -> list[tuple[str, ...]]:
    """Return the nodes of each process of a station, in the order of `names`.

    The control unit of a real drive has a process of its own, and so has every client.

    Raises
    ------
    ValueError
        When `processes` is not one of `PROCESSES`.
    """
    if processes not in PROCESSES:
        raise ValueError(f"processes={processes} must be 1, 2 or 8")
    if processes == 8 or os.environ.get("ROS_SECURITY_ENABLE") == "true":
        # Under SROS2 each node has an enclave, which is that of its process.
        return [(name,) for name in names]
    alone = APART if "simulation_clock" in names else ("antenna_servo", *APART)
    rooms: dict[Any, list[str]] = {}
    for name in names:
        key = name if name in alone else processes == 1 or name in MOVES
        rooms.setdefault(key, []).append(name)
    return [tuple(room) for room in rooms.values()]


class NodeProcesses:
    """The running nodes of one namespace, in `processes` as `partition` has it.

    Processes without a node `on_time` get a lower priority.
    """

    def __init__(
        self, namespace: str, parameter_files: Sequence[Path], log_folder: Path, on_time: Sequence[str] = (),
        processes: int = 8,
    ) -> None:  # fmt: skip
        self.namespace, self._files, self._logs = namespace, list(parameter_files), log_folder
        self._on_time, self._processes = on_time, processes
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._simulated_time = True

    def start(self, names: Sequence[str], simulated_time: bool = True, *, autostart: bool = False) -> None:
        """Start every executable of `names`; `below/executable` starts it in a namespace below.

        With `autostart` the nodes configure and activate themselves.
        """
        # The executables themselves, not `ros2 run`: its process would be the parent of ours.
        folder = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing"
        self._simulated_time = simulated_time
        self._logs.mkdir(parents=True, exist_ok=True)
        for room in partition(names, self._processes):
            *below, executable = room[0].split("/")
            start = [executable] if len(room) == 1 else ["station_process", *room]
            arguments = ["--ros-args", ONE_LOG, "-r", f"__ns:={'/'.join([self.namespace, *below])}"]
            for path in self._files:
                arguments += ["--params-file", str(path)]
            if simulated_time and room != ("simulation_clock",):
                arguments += ["-r", f"/clock:={self.namespace}/clock", "-p", "use_sim_time:=true"]
            if autostart:
                arguments += ["-p", "lifecycle.autostart:=true"]
            urgent = not self._on_time or not set(self._on_time).isdisjoint((*room, executable))
            with self.log(room[0]).open("ab") as log:
                process = subprocess.Popen(
                    [str(folder / start[0]), *start[1:], *arguments], stdin=subprocess.DEVNULL,
                    stdout=log, stderr=subprocess.STDOUT, env=NODE_ENVIRONMENT | os.environ,
                    preexec_fn=bind_to_parent if urgent else _bind_in_the_background,
                )  # fmt: skip
            self._running |= dict.fromkeys(room, process)
            for name in room[1:]:
                self.log(name).unlink(missing_ok=True)
                self.log(name).symlink_to(self.log(room[0]).name)

    def ended(self) -> Mapping[str, int]:
        """Return name and exit code of every node whose process has ended by itself."""
        return {name: code for name, process in self._running.items() if (code := process.poll()) is not None}

    def nameless(self, names: Sequence[str]) -> list[str]:
        """Return the nodes whose process does not hold its name yet."""
        # A process that still starts, or whose name another graph has.
        return [name for name in names if last_holder(f"{self.namespace}/{name}") != self._running[name].pid]

    def complaint(self, name: str) -> str:
        """Return the last line of a node's log, which states why it refused."""
        lines = self.log(name).read_text(errors="replace").strip().splitlines()
        # A log of several nodes: the last line may be that of another one.
        own = [line for line in lines if f"{name}]: " in line]
        return (own or lines or ["no message"])[-1]

    def process_id(self, name: str) -> int:
        """Return the process id of a running executable."""
        return self._running[name].pid

    def stop(self) -> None:
        """Interrupt every process, then terminate and finally kill those that do not end."""
        end_processes(list(set(self._running.values())))
        self._running.clear()

    def log(self, name: str) -> Path:
        """Return the log file of an executable."""
        return self._logs / f"{name.replace('/', '.')}.log"


def end_processes(processes: Sequence["subprocess.Popen[bytes]"]) -> None:
    """Interrupt processes together, then terminate and finally kill those that do not end."""
    for sign, grace_s in _ENDINGS:
        alive = [process for process in processes if process.poll() is None]
        for process in alive:
            process.send_signal(sign)
        deadline_s = time.monotonic() + grace_s
        for process in alive:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.01, deadline_s - time.monotonic()))


def bind_to_parent() -> None:
    """Let this process end with its parent, in a group that Ctrl-C in a terminal does not reach."""
    # Ctrl-C is then for the parent alone, which ends the nodes in order.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.setpgid(0, 0)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def _bind_in_the_background() -> None:
    bind_to_parent()
    os.nice(NICENESS)


ONE_LOG = "--disable-external-lib-logs"
"""Argument of ROS: what a node logs is in the log of its process, and not once more in ~/.ros."""
TRANSITIONS = {
    "configure": (Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE),
    "activate": (Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE),
    "deactivate": (Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE),
}
"""The transition that is called, and the state in which a node is after it."""


class NotStartedError(Exception):
    """The graph could not be brought up, or a process of it ended."""


class LifecycleClient:
    """Calls change_state of the nodes of one namespace."""

    def __init__(self, node: Node, namespace: str, waiting: Waiting) -> None:
        self._node, self._namespace, self._waiting = node, namespace, waiting
        self._clients: dict[str, Any] = {}
        self._looks: dict[str, Any] = {}

    def wait_for(self, names: Sequence[str]) -> None:
        """Wait until every node offers its lifecycle service."""
        for name in names:
            self._clients[name] = self._node.create_client(ChangeState, f"{self._namespace}/{name}/change_state")
            self._looks[name] = self._node.create_client(GetState, f"{self._namespace}/{name}/get_state")
        self._until_none(lambda: [name for name in names if not self._clients[name].service_is_ready()], "appear")

    def change(self, names: Sequence[str], transition: str, patience_s: float | None = None) -> list[str]:
        """Take all nodes through `transition` at once; return those that refused."""
        # All at once: each transition takes a node tens of milliseconds, and discovery more.
        wanted, reached = TRANSITIONS[transition]
        request = ChangeState.Request(transition=Transition(id=wanted))
        waiting = {name: self._clients[name].call_async(request) for name in names}
        # Where the answer to the change is lost, the state shows the outcome.
        look = lambda name: RepeatedCall(self._looks[name], GetState.Request(), AGAIN_S)  # noqa: E731
        states, again = {name: look(name) for name in names}, set[str]()

        def succeeded(name: str) -> bool:
            if waiting[name].done():
                return bool(waiting[name].result().success)
            return bool(states[name].result().current_state.id == reached)

        def over(name: str) -> bool:
            if waiting[name].done() or not states[name].done():
                return bool(waiting[name].done())
            if succeeded(name) or name in again:
                return True
            # A node that is still starting may answer the later of two calls first.
            again.add(name)
            states[name] = look(name)
            return False

        self._until_none(lambda: [name for name in names if not over(name)], transition, patience_s)
        return [name for name in names if not succeeded(name)]

    def _until_none(self, late: Callable[[], list[str]], what: str, patience_s: float | None = None) -> None:
        self._waiting.until(lambda: not late(), lambda: f"{', '.join(late())} did not {what}", patience_s)


class ManagedGraph(NodeProcesses):
    """The processes of nodes that go through their lifecycle together; see `NodeProcesses`.

    `spin(timeout_s)` must run the executor of `node` once; `patience_s` is how long to wait for an
    answer, in wall time.
    """

    def __init__(
        self, node: Node, namespace: str, parameter_files: Sequence[Path], logs: Path,
        spin: Callable[[float], None], *, patience_s: float, on_time: Sequence[str] = (),
        processes: int = 8,
    ) -> None:  # fmt: skip
        super().__init__(namespace, parameter_files, logs, on_time, processes)
        self.waiting = Waiting(spin, patience_s, self.check)
        self._lifecycle = LifecycleClient(node, namespace, self.waiting)

    def configure(self, names: Sequence[str]) -> None:
        """Wait until the nodes run, and configure them."""
        # Another graph's nodes of the same names offer the same services; only the holder of the
        # name is ours.
        self.waiting.until(lambda: not self.nameless(names), f"{', '.join(names)} not seen")
        self._lifecycle.wait_for(names)
        self.change(names, "configure")

    def activate(self, names: Sequence[str]) -> None:
        """Activate the nodes; those that refuse get the request again for `ACTIVATION_S`."""
        deadline_s = time.monotonic() + ACTIVATION_S
        while time.monotonic() < deadline_s:
            names = self._lifecycle.change(names, "activate")
            if not names:
                return
            self.waiting.pause(ACTIVATION_PERIOD_S)
        self.change(names, "activate")

    def change(self, names: Sequence[str], transition: str) -> None:
        """Take all through one transition at once; NotStartedError states why a node refuses."""
        refused = self._lifecycle.change(names, transition)
        if refused:
            reasons = "; ".join(f"{name}: {self.complaint(name)}" for name in refused)
            raise NotStartedError(f"could not {transition} {reasons}")

    def check(self) -> None:
        """NotStartedError if a process has ended; one that no longer receives starts again."""
        ended = self.ended()
        if deaf := [name for name, code in ended.items() if code == DEAF]:
            self.start(deaf, self._simulated_time, autostart=True)
        if ended := self.ended():
            # The log of the process has the reason; its exit code has not.
            raise NotStartedError("; ".join(f"{name} ended: {self.complaint(name)}" for name in ended))
