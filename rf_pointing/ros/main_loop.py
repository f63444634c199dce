"""The process of nodes: its arguments, their names, its executor, a loop that ends under control.

Every executable of a managed node is `run(NodeType)`; `station_process` runs several.  A second
node of the same name, namespace and ROS domain on a machine is refused: two controllers would fight
over one antenna.
"""

import faulthandler
import fcntl
import gc
import math
import os
import re
import select
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from types import CodeType
from typing import Any

import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl import rcutils_logger
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from rf_pointing.core.whole_file import open_private
from rf_pointing.ros import NODE_USAGE
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.station.log_lines import ROS_FORMAT, json_lines, quoted, say

DRIVE_PRIORITY = 20
"""Real-time priority of a real drive loop, below the kernel's own threads (50)."""
NICER = -10
"""Niceness where a real-time priority is not permitted."""
HUNG_S = 120.0
"""Longest time for one thing of a node; to read 32 MiB of elements takes 15 s."""
WRITTEN_S = 15.0
STUCK_S = 8.0
"""Longest time within the middleware itself, of which one wait is 0.2 s."""
LOOK_S = 1.0
COMPUTED_S = 2.0
"""Longest time for which a thread of DDS computes without any wait."""
LOCKED_S = 4.0
"""Longest computing in one call with Python's lock held, on top of all processors for `LOOK_S`."""
START_OR_END_S = 60.0
"""Longest making of the nodes of a process, and its longest end with the stop of what it moves."""
DEAF = 3
"""Exit code of a node that no longer receives."""
leave = os._exit
LONGEST_WAIT_S = 0.2
"""Longest wait for an event: a signal is noticed between two of them."""
IDLE_S, LOST_S = 0.02, 0.3
"""Simulated time waits for work that is due: after two such waits without an event it is done, in a
process that is never idle what has been due for longer than any timer waits there."""
RESTART_S = 0.5
"""From the end of a node to its next start, as in the launch files."""
STALL_S, STALL_SHOWN_S = 1.0, 60.0
"""Stall of a process that is reported, and for how long it is."""
_SECURITY_WORDS = {"ROS_SECURITY_ENABLE": ("true", "false"), "ROS_SECURITY_STRATEGY": ("Enforce", "Permissive")}
_IN_THE_SOURCE = re.compile(r"\s*, at \S+\.c(pp)?:\d+")
"""The place in rcl's own source that ends its messages: no help to a user."""


def make_executor(context: Any = None) -> Any:
    """Return the executor that costs least.

    Call `spin_once` in a loop: `EventsExecutor.spin` of rclpy 7.1 burns a core without a callback.
    """
    # Six nodes at 100 Hz cost 10 % of a core with events and 67 % without.
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def settle_garbage() -> None:
    """Exempt what was imported from garbage collection."""
    # Each round would search it again in vain.
    gc.collect()
    gc.freeze()


def run(
    *node_types: Callable[[], Any], description: str = "", known: Sequence[str] = (), restart: bool = False
) -> None:
    """Run nodes until SIGINT or SIGTERM; an active node is deactivated before it ends.

    A start that fails prints one line and exits with 2.  A node that fails makes the exit code 1;
    with `restart` it is started again, alone.  One that receives nothing ends the process (`DEAF`).
    `--help` prints the `description`, by default the module's docstring.  Arguments are those of
    ROS and `known`.
    """
    signals: list[int] = []
    # A library that crashes says where it was called.
    faulthandler.enable(sys.__stderr__)
    try:
        _take_arguments(description or str(sys.modules[node_types[0].__module__].__doc__), known)
        _check_security(os.environ)
        log_as_chosen()
        # The handlers of rclpy would shut the context down before the motion has ended.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        for sign in (signal.SIGINT, signal.SIGTERM):
            signal.signal(sign, lambda number, _frame: signals.append(number))
        executor = make_executor()
        watch = HangWatch()
        watch.begin(NodeLoop.work.__code__)
        loop = NodeLoop(node_types, executor, signals, watch.writing, restart=restart)
    except (RuntimeError, ValueError) as error:
        _say_not_started(error)
        rclpy.try_shutdown()
        sys.exit(2)
    settle_garbage()
    code = loop.work(watch.come_round, watch.begin_end)
    if loop.deaf:
        # A participant of DDS that took damaged datagrams may never be destroyed.
        sys.stdout.flush()
        sys.stderr.flush()
        leave(code)
    executor.shutdown()
    rclpy.try_shutdown()
    if code:
        sys.exit(code)


class NodeLoop:
    """The nodes of a process, made by `node_types`, in one executor; each lives and ends by itself.

    With `restart` a node that has failed is made again, and brings itself up.  `writing` surrounds
    what a node writes each second.
    """

    def __init__(
        self, node_types: Sequence[Callable[[], Any]], executor: Any, signals: Sequence[int],
        writing: Callable[[], AbstractContextManager[None]] = nullcontext, *, restart: bool = False
    ) -> None:  # fmt: skip
        self._executor, self._signals, self._restart = executor, signals, restart
        self._writing = writing
        self._nodes: list[tuple[Callable[[], Any], Any]] = []
        self._missing: dict[Callable[[], Any], float] = {}
        self.deaf = False
        self._restarts, self._stall_s, self._stalled_s = Counter[str](), 0.0, -math.inf
        for make in node_types:
            self._add(make, make())

    def _add(self, make: Callable[[], Any], node: Any) -> None:
        self._nodes.append((make, node))
        self._executor.add_node(node)
        node.diagnostics.writing = self._writing
        if self._restart:
            node.diagnostics.add("process", self.health)

    def work(self, come_round: Callable[[], str] = str, begin_end: Callable[[], None] = lambda: None) -> int:
        """Work until a signal or without a node; return the exit code.

        `come_round`, called each round, says why the process is deaf; `begin_end` begins its end.
        """
        code, looked_s, idle_s = 0, time.monotonic(), 0.0
        caught_s = looked_s
        # Not `spin`: between two events the nodes do their own work and the signals are seen.
        while not self._signals and (self._nodes or self._missing):
            if hung := come_round():
                for _, node in self._nodes:
                    node.input_watchdog.deaf = hung
            wait_s = LONGEST_WAIT_S
            if any(node.input_watchdog.deaf for _, node in self._nodes):
                # The participant of DDS does not receive, which all nodes of a process share.
                break
            if lost := looked_s - caught_s >= LOST_S:
                caught_s = looked_s
            for make, node in tuple(self._nodes):
                try:
                    if node.failure is None:
                        node.bring_up()
                        if idle_s >= 2.0 * IDLE_S:
                            node.catch_up()
                        elif lost:
                            node.catch_up(LOST_S)
                        wait_s = min(wait_s, node.turn())
                        continue
                except Exception as error:
                    node.failure = error
                if self._restart:
                    self._missing[make] = time.monotonic() + RESTART_S
                    self._restarts[node.get_name()] += 1
                code = self._end(make, node)
            for make in [make for make, due_s in self._missing.items() if looked_s >= due_s]:
                self._make_again(make)
            spun_s = time.monotonic()
            try:
                self._executor.spin_once(timeout_sec=wait_s)
            except Exception as error:
                # What failed by itself, a message that rclpy cannot read for example, is left out.
                if all(node.failure is None for _, node in self._nodes):
                    for _, node in self._nodes[:1]:
                        node.survived("a callback", error)
            began_s, looked_s = looked_s, time.monotonic()
            # A process that was held up finds its events at once, in the next wait.
            idle_s = idle_s + wait_s if looked_s - spun_s >= wait_s > 0.0 else 0.0
            if looked_s - began_s - wait_s > STALL_S:
                self._stall_s, self._stalled_s = looked_s - began_s, looked_s
        begin_end()
        self.deaf = any(node.input_watchdog.deaf for _, node in self._nodes)
        codes = [self._end(make, node, destroy=not self.deaf) for make, node in tuple(self._nodes)]
        return max([0 if self._restart else code, *codes])

    def _end(self, make: Callable[[], Any], node: Any, *, destroy: bool = True) -> int:
        """End a node under control, and return what the exit code says of it.

        What DDS has of it is left where it has stopped to receive: its end may hang.
        """
        words, deaf = "", node.input_watchdog.deaf
        if node.failure is not None:
            words = _report(node, node.failure)
        elif deaf:
            # No fault: what moves is stopped, and goes on with the new node.
            node.get_logger().fatal(f"the node ends, and must be started again: {deaf}")
        try:
            if words:
                node.fail(words)
            node.end()
        except Exception as error:
            words = _report(node, error)
        self._nodes.remove((make, node))
        if destroy:
            self._executor.remove_node(node)
            # `destroy_node` leaves them: an old action would take the goals of the new one.
            for action in [each for each in node.waitables if isinstance(each, (ActionClient, ActionServer))]:
                action.destroy()
            node.destroy_node()
        node.lock.release()
        return 1 if words else DEAF if deaf else 0

    def _make_again(self, make: Callable[[], Any]) -> None:
        try:
            node = make()
        except (RuntimeError, ValueError) as error:
            _say_not_started(error)
            self._missing[make] = time.monotonic() + RESTART_S
            return
        del self._missing[make]
        node.brings_itself_up = True
        self._add(make, node)

    def health(self) -> Health:
        """Return which nodes were started again, and whether one has held all of them up."""
        values: dict[str, object] = {"nodes": len(self._nodes), "longest_stall_s": round(self._stall_s, 1)}
        values |= {f"restarts {name}": count for name, count in self._restarts.items()}
        words = [f"{name} was started again" for name in self._restarts]
        if time.monotonic() - self._stalled_s < STALL_SHOWN_S:
            words.append(f"one node has held up its process for {self._stall_s:.1f} s")
        return Health(WARN if words else OK, "; ".join(words) or "all run", values)


def log_as_chosen() -> None:
    """Make every logger of this process write JSON where that is chosen; before `rclpy.init`."""
    if not json_lines():
        return
    os.environ["RCUTILS_CONSOLE_OUTPUT_FORMAT"] = ROS_FORMAT
    write = rcutils_logger.RcutilsLogger.log

    def log(self: Any, message: str, severity: Any, **more: Any) -> bool:
        # rcutils puts a text between quotes as it is.
        return bool(write(self, quoted(str(message)), severity, **more))

    rcutils_logger.RcutilsLogger.log = log
    # rclpy knows a line by its caller, which is not this function.
    rcutils_logger._internal_callers.append(os.path.realpath(__file__))


def _say_not_started(error: Exception) -> None:
    # One line for the operator; a traceback would hide what is wrong.
    say("rf_pointing", f"not started: {_IN_THE_SOURCE.sub('', str(error))}", "FATAL")


def take_priority(realtime: int) -> str:
    """Give this process a real-time priority, 0 for none; return "" or why it is not permitted."""
    if not realtime:
        return ""
    try:
        # Threads of DDS that run already keep theirs unless each is named.
        for thread in os.listdir("/proc/self/task"):
            os.sched_setscheduler(int(thread), os.SCHED_FIFO, os.sched_param(realtime))
        return ""
    except OSError as error:
        words = f"lifecycle.realtime_priority={realtime} is not permitted ({error.strerror})"
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICER)
        return f"{words}: nice {NICER} instead; rtprio in /etc/security/limits.conf allows it"
    except OSError:
        return f"{words}, nor is nice {NICER}; rtprio in /etc/security/limits.conf allows it"


class HangWatch:
    """Ends a process whose loop has not come round for `patience_s`; stderr gets where it stands.

    The launch files start it again: a node that is alive and does nothing would never be.
    """

    def __init__(self, patience_s: float = HUNG_S) -> None:
        self._patience_s, self._armed_s, self._rounds, self._hung = patience_s, -math.inf, 0, ""

    def begin(self, loop: CodeType) -> None:
        """Give the start of nodes its time, and watch the calling thread and those of DDS.

        It may not be stuck in what `loop` itself calls: that is a library, and no callback of a
        node, whose work may be long.
        """
        self._arm(min(START_OR_END_S, self._patience_s))
        # Damaged datagrams have left a wait in DDS for good, also with Python's lock.
        faulthandler.register(signal.SIGPROF, sys.__stderr__, chain=True)
        given = loop, threading.get_ident()
        threading.Thread(target=self._watch, args=given, daemon=True).start()

    def come_round(self) -> str:
        """Note that the loop works; return which thread of DDS hangs, "" for none."""
        self._rounds += 1
        if time.monotonic() - self._armed_s > min(1.0, 0.1 * self._patience_s):
            self._arm(self._patience_s)
        return self._hung

    def _watch(self, loop: CodeType, thread: int) -> None:
        looks, rounds, waited = 0, 0, dict[str, tuple[str, int]]()
        # Looks are counted, not time: a process that was stopped has not looked either.
        while looks * LOOK_S < STUCK_S:
            if sys.gettrace() is None:
                signal.setitimer(signal.ITIMER_PROF, LOCKED_S + LOOK_S * (os.cpu_count() or 1))
            # Not `time.sleep`: it fails where the clock of one process is shifted.
            select.select((), (), (), LOOK_S)
            self._hung = self._hung or hung_thread(waited)
            frame = sys._current_frames().get(thread)
            in_loop = frame is not None and frame.f_code is loop and sys.gettrace() is None
            looks = looks + 1 if (in_loop or self._hung) and self._rounds == rounds else 0
            rounds = self._rounds
        why = self._hung or "A wait for events does not end"
        print(f"Timeout (0:00:{STUCK_S:02.0f})! {why}.", file=sys.__stderr__)
        faulthandler.dump_traceback(sys.__stderr__)
        leave(1)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Give what is written within a shorter time."""
        # Damaged datagrams can leave a thread of DDS in a loop without end, with the lock that
        # every write needs.
        self._arm(min(WRITTEN_S, self._patience_s))
        yield
        self._arm(self._patience_s)

    def _arm(self, patience_s: float) -> None:
        self._armed_s = time.monotonic()
        if sys.gettrace() is None:
            faulthandler.dump_traceback_later(patience_s, exit=True, file=sys.__stderr__)

    def begin_end(self) -> None:
        """Give the end of nodes and process its time; Python itself ends the watch."""
        self._patience_s = min(START_OR_END_S, self._patience_s)
        self._arm(self._patience_s)


def hung_thread(waited: dict[str, tuple[str, int]]) -> str:
    """Return which thread of DDS has computed for `COMPUTED_S` without any wait, "" for none.

    `waited` keeps how often each had waited, and what it had computed when it last did.
    """
    # A damaged datagram has a thread note 10^18 lost messages, one by one.
    for thread in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            name, _, fields = (thread / "stat").read_text().partition("(")[2].rpartition(")")
            if name.startswith("dds."):
                text = (thread / "status").read_text()
                waits = text.partition("\nvoluntary")[2].partition("\n")[0]
                ticks = int(fields.split()[11])
                if waited.setdefault(thread.name, (waits, ticks))[0] != waits:
                    waited[thread.name] = waits, ticks
                if (ticks - waited[thread.name][1]) / os.sysconf("SC_CLK_TCK") > COMPUTED_S:
                    return f"{name} has computed for {COMPUTED_S:g} s and never waited"
    return ""


def _check_security(environment: Mapping[str, str]) -> None:
    """Raise ValueError for SROS2 variables that ROS would take for no security at all."""
    # rcl compares with these words exactly: `True` or `enforce` would start an open node.
    for name, words in _SECURITY_WORDS.items():
        if (given := environment.get(name, "")) and given not in words:
            raise ValueError(f"{name}={given} must be {' or '.join(words)}: ROS would run without security")


def _report(node: Any, error: Exception) -> str:
    """Log an error that ends a node, with its place, and return it in words."""
    words = f"{type(error).__name__}: {error}"
    place = "".join(traceback.format_exception(error))
    node.get_logger().fatal(f"the node ends after a controlled stop, please report it: {words}\n{place}")
    return words


def _take_arguments(description: str, known: Sequence[str]) -> None:
    """Print the help and exit if requested; ValueError for an argument that is not one of ROS."""
    given = remove_ros_args(sys.argv)[1:]
    if {"-h", "--help"} & set(given):
        print(f"{description}\n{NODE_USAGE}")
        sys.exit(0)
    for word in given:
        if word not in known:
            raise ValueError(f"argument {word!r} is not known; {NODE_USAGE}")


class InstanceLock:
    """Holds the name `full_name` (for example /gs1/antenna_servo) in the present ROS domain."""

    # A lock of the kernel, which goes with the process however that ends.  The ROS graph would
    # still show a node that was killed 15 s ago.

    def __init__(self, full_name: str) -> None:
        self.path = _path(full_name)
        private_folder(self.path.parent)
        # Not truncated yet: the holder's number stays readable until the lock is ours.
        self._file = os.fdopen(open_private(self.path, os.O_RDWR), "r+")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._file.close()
            holder = last_holder(full_name) or "unknown"
            raise RuntimeError(f"{full_name} already runs in ROS domain {ros_domain()} (process {holder})") from error
        self.take_over()

    def take_over(self) -> None:
        """Name this process as the holder: the first one, or its child that goes on for it."""
        self._file.seek(0)
        self._file.truncate(0)
        self._file.write(str(os.getpid()))
        self._file.flush()

    def release(self) -> None:
        """Release the name; the file stays, since without it two holders could lock two files."""
        self._file.close()


def last_holder(full_name: str) -> int | None:
    """Return the process that took the name last in the present ROS domain, alive or not."""
    try:
        with os.fdopen(os.open(_path(full_name), os.O_RDONLY | os.O_NOFOLLOW), "r") as file:
            return int(file.read(20))
    except (OSError, ValueError):
        # Never taken, or being taken at this moment.
        return None


def present_holder(full_name: str) -> int | None:
    """Return the process that holds the name now, None where it is free."""
    with suppress(OSError), os.fdopen(os.open(_path(full_name), os.O_RDONLY | os.O_NOFOLLOW)) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return last_holder(full_name)
    return None


def private_folder(folder: Path) -> None:
    """Make a folder that is this user's alone; RuntimeError when somebody else has made it."""
    # Whoever makes it first could put a link there, and a node would empty any file of its user.
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError as error:
        raise RuntimeError(f"folder of locks {folder} cannot be used: {error.strerror}") from error
    try:
        owner = os.fstat(opened).st_uid
        if owner != os.getuid():
            raise RuntimeError(f"folder of locks {folder} belongs to user {owner}, must belong to {os.getuid()}")
        os.fchmod(opened, 0o700)
    finally:
        os.close(opened)


def ros_domain() -> str:
    """Return the number of the present ROS domain."""
    return os.environ.get("ROS_DOMAIN_ID", "0")


def _path(full_name: str) -> Path:
    return _runtime_folder() / f"domain{ros_domain()}{full_name.replace('/', '.')}.lock"


def _runtime_folder() -> Path:
    """Return the folder of locks: in the user's runtime directory, where the machine has one."""
    user = os.getuid()
    for name in (os.environ.get("XDG_RUNTIME_DIR", ""), f"/run/user/{user}"):
        try:
            if name and os.stat(name).st_uid == user and os.access(name, os.W_OK):
                return Path(name) / "rf_pointing"
        except OSError:
            continue
    # A service or a container has none.
    return Path(tempfile.gettempdir()) / f"rf_pointing-{user}"
