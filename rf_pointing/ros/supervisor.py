"""Processes of a launch file, kept running until they are to end; needs no `launch`.

Each writes a log of its own and, ended by itself, is started again after 0.5 s; a process that
ends within `SETTLED_S` of its start waits twice as long each time, 8 s at most.  They are ended in
three rounds: clients (executive, page), who points, and last what moves and receives.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rf_pointing.core import parse_json, read_whole, utc_text, write_whole
from rf_pointing.ros.graph import APART, EXECUTIVE, MOVES
from rf_pointing.ros.launching import Process
from rf_pointing.ros.main_loop import RESTART_S, present_holder
from rf_pointing.ros.managed_graph import NODE_ENVIRONMENT, ONE_LOG, bind_to_parent, end_processes
from rf_pointing.station.antenna.memory import state_folder
from rf_pointing.station.clients.station_alarms import NEEDED
from rf_pointing.station.log_lines import json_lines

FIRST = (*NEEDED, EXECUTIVE)
"""Nodes that a pass in progress waits for: to import all nodes takes a small computer 30 s."""
LATER_S = 5.0
"""From their start to that of the others."""
SETTLED_S = 30.0
LONGEST_DELAY_S = 8.0
STEP_S = 0.2
"""Longest time until an end is noticed, and until a line of a log is on the terminal."""
LOG_BYTES = 8 * 2**20
"""A log of this size becomes NAME.log.1, in place of an earlier one."""
MILD = (0, -signal.SIGINT, -signal.SIGTERM)
STATE = "launch.json"
LOG = "launch.log"


@dataclass
class _Child:
    """One process with its log; `due_s` is when it is started (again), None while it runs."""

    process: Process
    name: str
    due_s: float | None = 0.0
    started_s: float = 0.0
    started_t_s: float = 0.0
    starts: int = 0
    delay_s: float = RESTART_S
    running: Any = None
    last_end: str = ""
    shown: int = 0

    def state(self) -> dict[str, Any]:
        return {
            "nodes": list(self.process.nodes), "process": self.running.pid if self.due_s is None else None,
            "started_t_s": self.started_t_s, "starts": self.starts, "last_end": self.last_end,
        }  # fmt: skip


class Supervisor:
    """The processes of one namespace; logs, parameters and state are in `folder`.

    `show` gets every line of a log, with the name of its process.
    """

    def __init__(
        self, processes: Sequence[Process], folder: Path, about: dict[str, Any], show: Callable[[str], None] | None
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._about, self._show, self._children = folder, about, show, list[_Child]()
        space = processes[0].namespace.strip("/")
        for process in processes:
            below = process.namespace.strip("/").removeprefix(space).strip("/")
            child = _Child(process, "/".join(filter(None, (below, process.name))))
            child.shown = self._size(child)
            self._children.append(child)
        first = [child for child in self._children if set(child.process.nodes) & set(FIRST)]
        self._first: list[_Child] | None = first

    def run(self, signals: Sequence[int]) -> int:
        """Keep the processes running until a signal is there; return the exit code.

        Without `respawn` it ends with the last process.  The code is 0 when each has ended with 0,
        or by a signal before it was up.
        """
        while not signals and self.step(time.monotonic()):
            time.sleep(STEP_S)
        if signals:
            self.say(f"{signal.Signals(signals[0]).name}: ends all processes")
        self.stop()
        return 0 if all(child.running.returncode in MILD for child in self._children if child.running) else 1

    def step(self, now_s: float) -> bool:
        """Note what has ended, start what is due; return whether anything runs or will."""
        changed = False
        if self._first is not None:
            for child in self._children:
                child.due_s = now_s + (0.0 if child in (self._first or self._children) else LATER_S)
            self._first = None
        for child in self._children:
            if child.running is not None and child.due_s is None and (code := child.running.poll()) is not None:
                changed = True
                self._note_end(child, code, now_s)
            if child.due_s is not None and now_s >= child.due_s:
                changed = True
                try:
                    self._start(child, now_s)
                except OSError as error:
                    # A full disk or no memory: neither is for ever.
                    child.due_s = now_s + LONGEST_DELAY_S
                    self.say(f"{child.name} cannot be started: {error}")
            self._tend_log(child)
        if changed:
            states = {child.name: child.state() for child in self._children}
            with suppress(OSError):
                write_whole(self._folder / STATE, json.dumps(self._about | {"processes": states}, indent=1))
        return any(child.due_s is None or child.due_s < float("inf") for child in self._children)

    def stop(self) -> None:
        """End all processes: clients, then those that point, then those that move."""
        rounds: list[list[Any]] = [[], [], []]
        for child in self._children:
            if child.running is not None and child.running.poll() is None:
                nodes = set(child.process.nodes)
                rounds[0 if nodes <= set(APART) else 2 if nodes & set(MOVES) else 1].append(child)
        for each in rounds:
            end_processes([child.running for child in each])
            for child in each:
                child.last_end, child.due_s = _how(child.running.returncode), float("inf")
                self._tend_log(child)
                if child.running.returncode not in MILD:
                    self.say(f"{child.name} {child.last_end}")
        (self._folder / STATE).unlink(missing_ok=True)
        self.say("all processes have ended")

    def say(self, text: str) -> None:
        """Log a line of the supervisor's own."""
        t_s = time.time()
        row = {"t_s": t_s, "level": "INFO", "name": "launch", "text": text}
        line = json.dumps(row) if json_lines() else f"[{utc_text(t_s)}] launch: {text}"
        if self._show is not None:
            self._show(line)
        with suppress(OSError), (self._folder / LOG).open("a") as file:
            file.write(f"{line}\n")
        self._bound(self._folder / LOG)

    def _note_end(self, child: _Child, code: int, now_s: float) -> None:
        child.last_end = _how(code)
        if not child.process.respawn:
            child.due_s = float("inf")
            self.say(f"{child.name} {child.last_end}")
            return
        settled = now_s - child.started_s > SETTLED_S
        child.delay_s = RESTART_S if settled or child.starts == 1 else min(2.0 * child.delay_s, LONGEST_DELAY_S)
        child.due_s = now_s + child.delay_s
        self.say(f"{child.name} {child.last_end}, starts again in {child.delay_s:g} s")

    def _start(self, child: _Child, now_s: float) -> None:
        # Appended to: a log that was cut is written on from its new end.
        log = os.open(self._log(child), os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        try:
            child.running = subprocess.Popen(
                # The log is here; a file of rcl's own for every start would be kept for ever.
                [*child.process.command(self._folder), ONE_LOG],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=NODE_ENVIRONMENT | os.environ | dict(child.process.environment),
                preexec_fn=bind_to_parent,
            )
        finally:
            os.close(log)
        child.due_s, child.started_s, child.started_t_s = None, now_s, time.time()
        child.starts += 1
        self.say(f"{child.name} starts as process {child.running.pid}")

    def _tend_log(self, child: _Child) -> None:
        """Show what is new in a log, and cut one that is long."""
        size = self._size(child)
        if self._show is not None and size > child.shown:
            with self._log(child).open("rb") as file:
                file.seek(child.shown)
                new = file.read(size - child.shown)
            whole, _, _ = new.rpartition(b"\n")
            for line in whole.decode(errors="replace").splitlines():
                self._show(_named(child.name, line))
            child.shown += len(whole) + 1 if whole else 0
        if self._bound(self._log(child)):
            child.shown = 0

    @staticmethod
    def _bound(path: Path) -> bool:
        if not path.exists() or path.stat().st_size < LOG_BYTES:
            return False
        # Copied and cut, because the process goes on with the file that it has.
        with suppress(OSError):
            path.with_suffix(".log.1").write_bytes(path.read_bytes())
        os.truncate(path, 0)
        return True

    def _log(self, child: _Child) -> Path:
        return self._folder / f"{child.name.replace('/', '.')}.log"

    def _size(self, child: _Child) -> int:
        path = self._log(child)
        return path.stat().st_size if path.exists() else 0


def lock_name(namespace: str) -> str:
    """Return the name that one launch of a namespace holds."""
    return f"/{namespace.strip('/')}/launch"


def log_folder(namespace: str) -> Path:
    """Return the folder of logs and state of a launch."""
    return state_folder() / namespace.strip("/") / "log"


def running(words: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Return the state of each launch of this ROS domain, or of those with these namespaces."""
    found, wanted = [], {word.strip("/") for word in words}
    for path in sorted(state_folder().rglob(f"log/{STATE}")):
        with suppress(OSError, ValueError):
            state = parse_json(read_whole(path))
            named = not wanted or state["namespace"].strip("/") in wanted
            if named and present_holder(lock_name(state["namespace"])) == state["process"]:
                found.append(state | {"folder": path.parent})
    return found


def _how(code: int) -> str:
    return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"


def _named(name: str, line: str) -> str:
    """Return a line of a program's log with its name, as one object where that is chosen.

    A line that is an object already keeps its members: its own name, and `process` in front of it.
    """
    if not json_lines():
        return f"[{name}] {line}"
    try:
        members = json.loads(line)
        known = isinstance(members, dict)
    except ValueError:
        known = False
    # What an interpreter or a library prints: a traceback, a line of C.
    row = members if known else {"t_s": time.time(), "level": "INFO", "name": name, "text": line}
    return json.dumps({"process": name} | row)


def to_terminal(line: str) -> None:
    """Print a line; whoever closes the terminal does not end the station by that."""
    try:
        print(line, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
