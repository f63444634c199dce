"""Start the nodes of one antenna, each as its own process, and end them without leftovers.

The executables are those that `ros2 run` starts; each writes a log of its own.  Should this process die, the kernel ends
its children.
"""

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from ament_index_python.packages import get_package_prefix

from rf_pointing.nodes.main_loop import last_holder

__all__ = ["NodeProcesses"]

NICENESS = 10

_PR_SET_PDEATHSIG = 1
_GRACE_S = (4.0, 2.0)


class NodeProcesses:
    """The running executables of one namespace; where some are to be `on_time`, the others run in the background."""

    def __init__(
        self, namespace: str, parameter_files: Sequence[Path], log_folder: Path, on_time: Sequence[str] = ()
    ) -> None:
        self.namespace, self._files, self._logs = namespace, list(parameter_files), log_folder
        self._on_time = on_time
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, names: Sequence[str], simulated_time: bool = True, *, autostart: bool = False) -> None:
        """Start every executable of `names` under its own name; one of a namespace below is named `below/executable`.

        With `autostart` they configure and activate themselves.
        """
        folder = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing"
        self._logs.mkdir(parents=True, exist_ok=True)
        for name in names:
            *below, executable = name.split("/")
            arguments = ["--ros-args", "-r", f"__ns:={'/'.join([self.namespace, *below])}"]
            for path in self._files:
                arguments += ["--params-file", str(path)]
            if simulated_time and name != "simulation_clock":
                arguments += ["-r", f"/clock:={self.namespace}/clock", "-p", "use_sim_time:=true"]
            if autostart:
                arguments += ["-p", "lifecycle.autostart:=true"]
            with self._log(name).open("wb") as log:
                self._running[name] = subprocess.Popen(
                    [str(folder / executable), *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=_environment(),
                    preexec_fn=_bind_in_the_background
                    if self._on_time and executable not in self._on_time
                    else _bind_to_parent,
                )

    def ended(self) -> Mapping[str, int]:
        """Return name and exit code of every process that has ended by itself."""
        return {name: code for name, process in self._running.items() if (code := process.poll()) is not None}

    def nameless(self, names: Sequence[str]) -> list[str]:
        """Return those whose process does not hold its name yet: it still starts, or another graph has the name."""
        return [name for name in names if last_holder(f"{self.namespace}/{name}") != self._running[name].pid]

    def complaint(self, name: str) -> str:
        """Return the last line of a node's log, which says why it refused."""
        lines = self._log(name).read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else "no message"

    def process_id(self, name: str) -> int:
        """Return the process id of a running executable."""
        return self._running[name].pid

    def stop(self) -> None:
        """Interrupt every process, then terminate and at last kill what does not end."""
        for sign, grace_s in ((signal.SIGINT, _GRACE_S[0]), (signal.SIGTERM, _GRACE_S[1]), (signal.SIGKILL, 2.0)):
            alive = [process for process in self._running.values() if process.poll() is None]
            for process in alive:
                process.send_signal(sign)
            deadline_s = time.monotonic() + grace_s
            for process in alive:
                try:
                    process.wait(max(0.01, deadline_s - time.monotonic()))
                except subprocess.TimeoutExpired:
                    continue
        self._running.clear()

    def _log(self, name: str) -> Path:
        return self._logs / f"{name.replace('/', '.')}.log"


def _environment() -> dict[str, str]:
    """Loopback UDP instead of shared memory: as fast for messages this small, and a killed node leaves no segment."""
    return {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"} | os.environ


def _bind_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.setpgid(0, 0)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def _bind_in_the_background() -> None:
    _bind_to_parent()
    os.nice(NICENESS)
