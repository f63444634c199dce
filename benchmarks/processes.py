"""Print what a pass costs with its nodes in 8, 2 and 1 processes, and a digest of what was flown.

    scripts/run-python benchmarks/processes.py [--processes 8 2 1] [--seconds 30]

At maximum speed: processor time (user and system) and wall time of the whole command `track` of the
pass of CBERS-2 over DSS-13, recording and report included.  Equal digests are the same pass, bit
for bit: true errors, sensor errors, axes and commands, by their stamps.  Then at speed 1: share of
a core and memory (PSS) of `track` and all nodes while the pass is tracked.
"""

import argparse
import hashlib
import os
import resource
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from ament_index_python.packages import get_package_prefix

from rf_pointing.report import read_recording

TRACK = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing" / "track"
FLOWN = {
    "sim/pointing_error": ("cross_elevation", "elevation", "carrier_to_noise"),
    "pointing_error": ("cross_elevation", "elevation"),
    "joint_states": ("position", "velocity"),
    "tracking_status": ("azimuth", "elevation", "cross_elevation_offset", "elevation_offset"),
}
MARGIN_S = 5.0
"""Left out at each end: a recording begins and ends with the processes."""
TRACKS_AFTER_S = 170.0
"""Wall time at speed 1 from the start of time until a sensor tracks."""


def digest(bag: Path) -> str:
    """Return the first 16 digits of the SHA-256 of what the pass has left, in the order of stamps."""
    recording, sums = read_recording(bag), hashlib.sha256()
    errors = recording.get("sim/pointing_error")
    begin, end = errors.stamp_ns[0] + MARGIN_S * 1e9, errors.stamp_ns[-1] - MARGIN_S * 1e9
    for topic, names in FLOWN.items():
        table = recording.get(topic)
        order = np.argsort(table.stamp_ns, kind="stable")
        order = order[(table.stamp_ns[order] > begin) & (table.stamp_ns[order] < end)]
        for values in (table.stamp_ns, *(table.columns[name] for name in names)):
            sums.update(np.ascontiguousarray(values[order]).tobytes())
    return sums.hexdigest()[:16]


def command(processes: int, speed: str, namespace: str, output: str) -> list[str]:
    """Return the command line of a pass."""
    return [
        str(TRACK), "--satellite", "28057", "--models", "", "--processes", str(processes), "--speed", speed,
        "--namespace", namespace, "--output", output,
    ]  # fmt: skip


def whole_pass(processes: int) -> str:
    """Fly a pass at maximum speed, and return what it has cost."""
    with tempfile.TemporaryDirectory() as folder:
        before, began_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        subprocess.run(command(processes, "max", "/cost", folder), stderr=subprocess.DEVNULL, check=True)
        wall_s, after = time.monotonic() - began_s, resource.getrusage(resource.RUSAGE_CHILDREN)
        user_s, system_s = after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime
        return (
            f"{processes} processes: {user_s + system_s:6.1f} s of processor ({system_s:.1f} s system), "
            f"{wall_s:6.1f} s wall, digest {digest(Path(folder) / 'bag')}"
        )


def members(process: int) -> list[Path]:
    """Return the folders in /proc of a process and of its children."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return [Path(f"/proc/{each}") for each in (process, *children)]


def used_s(folders: list[Path]) -> float:
    """Return the processor time of processes so far."""
    fields = [(folder / "stat").read_text().rpartition(")")[2].split() for folder in folders]
    return sum(int(each[11]) + int(each[12]) for each in fields) / os.sysconf("SC_CLK_TCK")


def real_time(processes: int, seconds: float) -> str:
    """Track in real time, and return what that takes of a core and of the memory."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = command(processes, "1", "/cost", folder)
        run = subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True)
        assert run.stderr is not None
        next(line for line in run.stderr if "LOS in" in line)
        time.sleep(TRACKS_AFTER_S)
        folders = members(run.pid)
        before_s, began_s = used_s(folders), time.monotonic()
        time.sleep(seconds)
        share = (used_s(folders) - before_s) / (time.monotonic() - began_s)
        lines = [line for each in folders for line in (each / "smaps_rollup").read_text().splitlines()]
        pss_mb = sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024.0
        run.send_signal(signal.SIGINT)
        run.communicate()
        return f"{processes} processes at speed 1: {100.0 * share:5.1f} % of a core, {pss_mb:.0f} MB PSS"


def main() -> None:
    """Print a line for each number of processes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=int, nargs="+", default=[8, 2, 1])
    parser.add_argument("--seconds", type=float, default=30.0, help="measured at speed 1 (default: 30); 0: not")
    given = parser.parse_args()
    for processes in given.processes:
        print(whole_pass(processes), flush=True)
    for processes in given.processes if given.seconds else ():
        print(real_time(processes, given.seconds), flush=True)


if __name__ == "__main__":
    main()
