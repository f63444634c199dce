"""Print what a pass costs with its nodes in 8, 2 and 1 processes, and a digest of what was flown.

    scripts/run-python benchmarks/processes.py [--processes 8 2 1] [--seconds 30]
    scripts/run-python benchmarks/processes.py --stations 10 [--station leo_3m7] [--seconds 60] [--quick]

At maximum speed: processor time (user and system) and wall time of the whole command `track` of the
pass of CBERS-2 over DSS-13, recording and report included.  Equal digests are the same pass, bit
for bit: true errors, sensor errors, axes and commands, by their stamps.  Then at speed 1: share of
a core and memory (PSS) of `track` and all nodes while the pass is tracked.

--stations: cores, memory and speed of so many stations of one process each that all track at speed
1, and of the operator's page that shows them.
"""

import argparse
import hashlib
import json
import math
import os
import resource
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from ament_index_python.packages import get_package_prefix

from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, verification_elements
from rf_pointing.report import read_recording
from rf_pointing.ros.graph import NODES
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.station.description import read_station

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

SATELLITE = "28057"
BEFORE_S = 60.0
"""How long before a pass the stations begin: each slews to its begin."""
PATIENCE_S = 300.0


def digest(bag: Path) -> str:
    """Return the first 16 digits of the SHA-256 of what the pass has left, in the order of stamps."""
    recording, sums = read_recording(bag), hashlib.sha256()
    errors = recording.get("sim/pointing_error")
    # Whole seconds: the recording ends a tick sooner or later.
    begin, end = errors.stamp_ns[0] // 10**9 * 1e9 + MARGIN_S * 1e9, errors.stamp_ns[-1] // 10**9 * 1e9 - MARGIN_S * 1e9
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
        pss_mb = memory_mb(folders)
        run.send_signal(signal.SIGINT)
        run.communicate()
        return f"{processes} processes at speed 1: {100.0 * share:5.1f} % of a core, {pss_mb:.0f} MB PSS"


def memory_mb(folders: list[Path]) -> float:
    """Return the memory (PSS) of processes: what they share counts once."""
    lines = [line for each in folders for line in (each / "smaps_rollup").read_text().splitlines()]
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024.0


class Spectator:
    """Sends every station of `names` its next pass, and looks at the time and at who tracks."""

    def __init__(self, names: list[str]) -> None:
        import rclpy
        from rclpy.action import ActionClient
        from rf_pointing_msgs.action import TrackPass
        from rf_pointing_msgs.msg import PassList, TrackingStatus

        from rf_pointing.ros.main_loop import make_executor
        from rf_pointing.ros.qos import LATCHED, STREAM

        rclpy.init()
        self.node, self._executor, self._goal = rclpy.create_node("spectator"), make_executor(), TrackPass.Goal
        self._executor.add_node(self.node)
        self.passes, self.status = dict[str, Any](), dict[str, Any]()
        self._actions = {name: ActionClient(self.node, TrackPass, f"{name}/track_pass") for name in names}
        self._sent = dict[str, Any]()
        for name in names:
            make = self.node.create_subscription
            make(PassList, f"{name}/passes", lambda m, name=name: self.passes.update({name: m}), LATCHED)
            make(TrackingStatus, f"{name}/tracking_status", lambda m, name=name: self.status.update({name: m}), STREAM)

    def begin(self) -> None:
        """Wait until every station holds its target; TimeoutError names those that do not."""
        deadline_s = time.monotonic() + PATIENCE_S
        while waiting := [name for name in self._actions if not (name in self.status and self.status[name].held)]:
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"not tracking within {PATIENCE_S:.0f} s: {', '.join(waiting)}")
            for name in waiting:
                refused = name in self._sent and self._sent[name].done() and not self._sent[name].result().accepted
                if (name not in self._sent or refused) and name in self.passes and self._ready(name):
                    self._sent[name] = self._actions[name].send_goal_async(
                        self._goal(target_pass=self.passes[name].passes[0], sensor="auto")
                    )
            self.spin(0.5)

    def _ready(self, name: str) -> bool:
        return name in self.status and bool(self.passes[name].passes) and self._actions[name].server_is_ready()

    def spin(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left_s)

    def times_s(self) -> dict[str, float]:
        """Return the time of each station."""
        from rf_pointing.ros.stamps import seconds_from_stamp

        return {name: seconds_from_stamp(each.header.stamp) for name, each in self.status.items()}


def high_pass_s(station: str) -> float:
    """Return when a long pass of the shipped elements begins at the station, in UTC s."""
    found = find_elements(verification_elements(), SATELLITE)
    windows = find_passes(
        TopocentricTrack(found, read_station(station).site), found.epoch_t_s, 86400.0, math.radians(5.0)
    )
    return max(
        (each for each in windows if each.peak_elevation_rad < 1.3), key=lambda each: each.peak_elevation_rad
    ).aos_t_s


def network(count: int, station: str, seconds: float) -> None:
    """Track with `count` stations of one process each at speed 1, and print what that takes."""
    names = [f"/cost{number}" for number in range(count)]
    with tempfile.TemporaryDirectory() as folder:
        given = {f"/**/{name}": {"ros__parameters": {"station": station}} for name in NODES[1:]}
        for name in ("ephemeris_publisher", "rf_receiver"):
            given[f"/**/{name}"]["ros__parameters"]["source"] = {"satellite": SATELLITE}
        given["/**/simulation_clock"] = {"ros__parameters": {"start_s": high_pass_s(station) - BEFORE_S, "speed": 1.0}}
        page = {"port": 0, "antennas": ",".join(names), "token_file": "", "reports": ""}
        given["/**/operator_page"] = {"ros__parameters": {"page": page}}
        parameters = Path(folder) / "parameters.yaml"
        parameters.write_text(json.dumps(given))
        running = [NodeProcesses(name, [parameters], Path(folder) / name[1:], processes=1) for name in names]
        screen = NodeProcesses("/network", [parameters], Path(folder) / "network")
        try:
            spectator = Spectator(names)
            for each in running:
                each.start(NODES, autostart=True)
            screen.start(["operator_page"], simulated_time=False)
            spectator.begin()
            spectator.spin(5.0)
            stations = sorted({each.process_id(name) for each in running for name in NODES})
            folders = [Path(f"/proc/{each}") for each in stations]
            shows = [Path(f"/proc/{screen.process_id('operator_page')}")]
            before, times_s, began_s = (used_s(folders), used_s(shows)), spectator.times_s(), time.monotonic()
            spectator.spin(seconds)
            passed_s, load = time.monotonic() - began_s, os.getloadavg()[0]
            held = sum(each.held for each in spectator.status.values())
            speed = min((t_s - times_s[name]) / passed_s for name, t_s in spectator.times_s().items())
            cores = [(used_s(each) - was) / passed_s for each, was in zip((folders, shows), before, strict=True)]
            print(
                f"{count} stations of {station}, {len(stations)} processes: {cores[0]:.2f} cores, "
                f"{memory_mb(folders):.0f} MB PSS; slowest at {speed:.3f} of real time, {held} hold their target; "
                f"their page: {cores[1]:.3f} cores, {memory_mb(shows):.0f} MB; load {load:.1f}",
                flush=True,
            )
            if not (held == count and math.isfinite(speed)):
                raise SystemExit("not all of them track")
        finally:
            for each in (*running, screen):
                each.stop()


def main() -> None:
    """Print a line for each number of processes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=int, nargs="+", default=[8, 2, 1])
    parser.add_argument("--seconds", type=float, default=30.0, help="measured at speed 1 (default: 30); 0: not")
    parser.add_argument("--stations", type=int, default=0, help="so many stations of one process each, and no pass")
    parser.add_argument("--station", default="leo_3m7", help="of --stations (default: leo_3m7)")
    parser.add_argument("--quick", action="store_true", help="two stations for 5 s")
    given = parser.parse_args()
    if given.stations or given.quick:
        network(given.stations or 2, given.station, 5.0 if given.quick else given.seconds)
        return
    for processes in given.processes:
        print(whole_pass(processes), flush=True)
    for processes in given.processes if given.seconds else ():
        print(real_time(processes, given.seconds), flush=True)


if __name__ == "__main__":
    main()
