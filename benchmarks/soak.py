"""Fly a night of short passes on a real device in wall time while nodes and device are killed and stopped.

    scripts/run-python benchmarks/soak.py [--minutes 60] [--drive rotctld] [--seed 1] [--busy 8] [--json FILE]

A satellite passes every 110 s for 71 s, and station_executive tracks them all.  At random times a
node is killed (-9) or stopped (SIGSTOP, 0.2 to 5 s), and the device behind the drive is stopped
(0.3 to 8 s) or killed and started again (after 0.5 to 8 s, at its home).  What has ended is started
again after 0.5 s, as a launch file does.  --busy processes compute meanwhile.

A second of a pass is lost while the axes are more than half the beamwidth from the satellite, or
have not been received for 1 s.  A fault, which for a killed node lasts until it is active again, may
cost itself and 10 s more, one of the device its way back at 6 deg/s too.  Every other
lost second, a node that ends by itself, an outage of the device which nobody has reported within
the 10 min in which an alarm is not repeated, and more than six messages about one fault fail the
soak (exit 1).
"""

import argparse
import json
import math
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from real_station import SPEED_DEG_S, Station, busy
from rf_pointing_msgs.action import RunSchedule
from rf_pointing_msgs.msg import ExecutiveStatus, Schedule

from rf_pointing.core import angular_distance_rad
from rf_pointing.ephemeris import find_passes
from rf_pointing.operations.schedule import ScheduledPass
from rf_pointing.ros.convert_planning import scheduled_to_message
from rf_pointing.ros.qos import LATCHED, STATUS, STREAM

NODES = (
    "antenna_servo", "ephemeris_publisher", "pointing_controller", "station_executive", "rotctld_server",
    "operator_page",
)  # fmt: skip
MASK_DEG = 55.0
"""Above it a satellite stays for 71 s."""
FIRST_S, EVERY_S = 100.0, 110.0
"""From the start to the first culmination, and from one to the next."""
ALLOWED_S, RESTART_S, BACK_S = 10.0, 0.5, 60.0
GAP_S = 3.0, 20.0
"""Between the time that a fault may cost and the next one."""
STALL_S, BLOCK_S, OUT_S = (0.2, 5.0), (0.3, 8.0), (0.5, 8.0)
SAMPLE_S, SILENT_S = 0.1, 1.0
LOST_S, QUIET_S, MOST_SAID = 4.5, 600.0, 6
"""An outage of the device that must be reported, once in so long; most messages about a fault."""


@dataclass
class Fault:
    """One fault: in force from `begin_s` to `end_s` of the run, excused until `until_s`."""

    what: str
    begin_s: float
    end_s: float
    until_s: float
    lost_s: float = 0.0
    recovered_s: float = 0.0
    """After the end of the fault."""
    said: int = 0
    words: str = ""


class Soak:
    """The night, the faults, and what was seen."""

    def __init__(
        self, ends: ExitStack, folder: Path, drive: str, minutes: float, random_: random.Random
    ) -> None:  # fmt: skip
        self.random, self.faults, self.ended = random_, list[Fault](), list[str]()
        self.told: list[tuple[float, str]] = []
        self.schedule, self.status = Schedule(), ExecutiveStatus()
        self._down: dict[str, float] = {}
        self._killed = set[str]()
        count = max(1, math.ceil((60.0 * minutes - FIRST_S) / EVERY_S))
        names = {f"SAT {number + 1}": FIRST_S + number * EVERY_S for number in range(count)}
        night = {
            "executive.folder": str(folder / "night"), "executive.state_file": str(folder / "night.json"),
            "executive.sensor": "program",
        }  # fmt: skip
        server = {"server.port": 0}
        page = {"page.port": 0, "page.reports": ""}
        own = {"station_executive": night, "rotctld_server": server, "operator_page": page}
        # The disk of this computer is not the question, nor is a pass of 71 s that is not worth it.
        changes = {"mount.pass_elevation_deg": MASK_DEG, "tuning.alarms.disk_free_gb": 0.001,
                   "tuning.machine.least_share": 0.1}  # fmt: skip
        self.station = station = Station(ends, folder, drive, NODES, names, own, **changes)
        band = station.description.sets("pointing_controller")
        self.half_rad = 0.5 * band["machine"].half_power_beamwidth_rad
        above = math.radians(MASK_DEG)
        self.passes = []
        for number, (name, track) in enumerate(station.tracks.items()):
            around_s = station.begun_s + names[name]
            window = find_passes(track, around_s - 300.0, 600.0, above)[0]
            ends = window.aos_azimuth_rad, window.azimuth_min_rad, window.azimuth_max_rad, window.los_azimuth_rad
            self.passes.append(ScheduledPass(
                id=f"pass{number + 1:02d}", target=str(91000 + number), name=name, aos_t_s=window.aos_t_s,
                los_t_s=window.los_t_s, peak_rad=window.peak_elevation_rad, elevation_rad=(above, above),
                azimuth_path_rad=ends, sensor="program",
            ))  # fmt: skip
        listen = station.node.create_subscription
        listen(Schedule, "schedule", lambda m: setattr(self, "schedule", m), LATCHED)
        listen(ExecutiveStatus, "executive_status", lambda m: setattr(self, "status", m), STATUS)
        listen(DiagnosticArray, "alarms", self._on_alarm, STREAM)
        client = ActionClient(station.node, RunSchedule, "run_schedule")
        station.until(client.server_is_ready, "run_schedule")
        sent = client.send_goal_async(RunSchedule.Goal(passes=list(map(scheduled_to_message, self.passes))))
        station.until(lambda: self.status.state == "running" and sent.done(), "the night")

    def _on_alarm(self, message: DiagnosticArray) -> None:
        self.told += [(self.now_s, f"{status.name}: {status.message}") for status in message.status]

    @property
    def now_s(self) -> float:
        """Time since the start."""
        return time.time() - self.station.begun_s

    def run(self) -> None:
        """Bring the faults about, one after the other, until the last pass has set."""
        end_s = self.passes[-1].los_t_s - self.station.begun_s
        self.spin(5.0)
        kinds = self._kinds()
        while self.now_s < end_s:
            self.spin(self.random.uniform(*GAP_S))
            what, bring_about = next(kinds)
            begin_s = self.now_s
            spare_s = bring_about()
            fault = Fault(what, begin_s, self.now_s, self.now_s + ALLOWED_S + spare_s)
            self.faults.append(fault)
            print(f"  {begin_s:7.1f} s  {what}", flush=True)
            self.spin(fault.until_s - self.now_s)
        self.spin(20.0)

    def _kinds(self) -> Iterator[tuple[str, Callable[[], float]]]:
        """Yield faults for ever: every kind once in random order, then all again."""
        nodes = [(name, act) for name in NODES for act in (self._kill, self._stall)]
        while True:
            kinds: list[tuple[str, Callable[[], float]]] = [
                (f"{name} {'killed' if act == self._kill else 'stopped'}", lambda n=name, a=act: a(n))
                for name, act in nodes
            ]
            kinds += [("device stopped", self._block), ("device killed", self._out)] * 2
            self.random.shuffle(kinds)
            yield from kinds

    def _kill(self, name: str) -> float:
        self._killed.add(name)
        station, begun_s = self.station, time.monotonic()
        station.signal(name, signal.SIGKILL)
        self.spin(RESTART_S)
        station.health.pop(f"{name}: state", None)
        while time.monotonic() < begun_s + BACK_S:
            self.spin(0.1)
            state = station.health.get(f"{name}: state")
            if name not in station.processes.ended() and state is not None and state.message.startswith("active"):
                return 0.0
        self.ended.append(f"{self.now_s:.1f} s: {name} is not back after {BACK_S:.0f} s")
        return 0.0

    def _stall(self, name: str) -> float:
        low, high = map(math.log, STALL_S)
        self.station.signal(name, signal.SIGSTOP)
        try:
            self.spin(math.exp(self.random.uniform(low, high)))
        finally:
            self.station.signal(name, signal.SIGCONT)
        return 0.0

    def _block(self) -> float:
        self.station.device.signal(signal.SIGSTOP)
        self.spin(self.random.uniform(*BLOCK_S))
        self.station.device.signal(signal.SIGCONT)
        return self._way_s(np.array(self.station.axes[-1][1:]), self.station.axes[-1][1])

    def _out(self) -> float:
        device, axes = self.station.device, self.station.axes
        device.kill()
        self.spin(self.random.uniform(*OUT_S))
        device.start()
        return self._way_s(np.array(device.home_deg), axes[-1][1])

    def _way_s(self, from_deg: np.ndarray, azimuth_deg: float) -> float:
        """Return how long axes at their full speed need from there to the satellite, or to its rise.

        They begin when a fault may cost nothing more; the azimuth is on the turn of `azimuth_deg`.
        """
        begin_s = time.time() + ALLOWED_S
        for after_s in np.arange(0.0, 120.0, SAMPLE_S).tolist():
            t_s = begin_s + after_s
            item = next((each for each in self.passes if each.los_t_s > t_s), self.passes[-1])
            there = self.station.direction_deg(item.name, max(t_s, item.aos_t_s))
            azimuth_deg += math.remainder(there[0] - azimuth_deg, 360.0)
            if max(abs(azimuth_deg - from_deg[0]), abs(there[1] - from_deg[1])) <= SPEED_DEG_S * after_s:
                return after_s
        raise AssertionError("a rotator of 6 deg/s is there after a minute")

    def spin(self, seconds: float) -> None:
        """Let time go on; start again what has ended."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.station.spin_once()
            now_s = time.monotonic()
            for name, code in self.station.processes.ended().items():
                if name not in self._down:
                    self._down[name] = now_s
                    if name not in self._killed:
                        words = self.station.processes.complaint(name)
                        self.ended.append(f"{self.now_s:.1f} s: {name} ended with {code}: {words}")
                        print(f"  {self.ended[-1]}", flush=True)
                elif now_s - self._down[name] >= RESTART_S:
                    del self._down[name]
                    self._killed.discard(name)
                    self.station.start([name])

    def lost(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the sampled seconds of all passes, which of them are lost, and which are excused."""
        known = np.array(self.station.axes)
        known = known[np.argsort(known[:, 0], kind="stable")]
        sampled, lost = list[float](), list[bool]()
        for item in self.passes:
            track = self.station.tracks[item.name]
            for t_s in np.arange(item.aos_t_s, min(item.los_t_s, time.time()), SAMPLE_S).tolist():
                t_axes, *axes = known[max(0, int(np.searchsorted(known[:, 0], t_s, side="right")) - 1)]
                look = track.target_at(t_s)
                there = look.azimuth_rad, look.elevation_rad
                off_rad = float(angular_distance_rad(*map(math.radians, axes), *there))
                sampled.append(t_s - self.station.begun_s)
                lost.append(off_rad > self.half_rad or t_s - t_axes > SILENT_S)
        at, bad = np.array(sampled), np.array(lost)
        excused = np.zeros(len(at), dtype=bool)
        for fault, after_s in zip(self.faults, [*(f.begin_s for f in self.faults[1:]), math.inf], strict=True):
            excused |= (at >= fault.begin_s) & (at <= fault.until_s)
            mine = (at >= fault.begin_s) & (at < after_s) & bad
            fault.lost_s = SAMPLE_S * int(np.count_nonzero(mine))
            fault.recovered_s = max(0.0, float(at[mine][-1]) - fault.end_s) if mine.any() else 0.0
            told = [words for when_s, words in self.told if fault.begin_s <= when_s < after_s]
            fault.said, fault.words = len(told), told[0] if told else ""
        return at, bad, excused

    def verdict(self) -> list[str]:
        """Print the table; return what is wrong."""
        at, bad, excused = self.lost()
        wrong = list(self.ended)
        print(f"{'fault':<30}{'at s':>8}{'for s':>7}{'lost s':>8}{'recovered after s':>19}{'said':>6}")
        for fault in self.faults:
            lasted_s = fault.end_s - fault.begin_s
            print(f"{fault.what:<30}{fault.begin_s:>8.1f}{lasted_s:>7.1f}{fault.lost_s:>8.1f}"
                  f"{fault.recovered_s:>19.1f}{fault.said:>6}  {fault.words[:90]}")  # fmt: skip
            if fault.said > MOST_SAID:
                wrong.append(f"{fault.begin_s:.1f} s: {fault.what}: reported {fault.said} times, at most {MOST_SAID}")
            quiet_s = fault.begin_s + LOST_S - QUIET_S
            told = any(quiet_s < when_s <= fault.until_s and "drive" in words for when_s, words in self.told)
            if fault.what.startswith("device") and lasted_s > LOST_S and not told:
                wrong.append(f"{fault.begin_s:.1f} s: {fault.what} for {lasted_s:.1f} s: it was not reported")
        unexcused = at[bad & ~excused]
        if len(unexcused):
            edges = np.flatnonzero(np.diff(unexcused) > 1.5 * SAMPLE_S)
            begins = unexcused[np.concatenate([[0], edges + 1])]
            ends = unexcused[np.concatenate([edges, [len(unexcused) - 1]])]
            wrong += [f"{a:.1f} to {b:.1f} s: lost without a fault" for a, b in zip(begins, ends, strict=True)]
        states = [each.state for each in self.schedule.passes]
        counts = ", ".join(f"{states.count(state)} {state}" for state in sorted(set(states)))
        total_s, lost_s = SAMPLE_S * len(at), SAMPLE_S * int(np.count_nonzero(bad))
        print(f"{len(self.faults)} faults in {len(self.passes)} passes ({counts}), {total_s:.0f} s of passes: {lost_s:.1f} s "
              f"lost, {SAMPLE_S * len(unexcused):.1f} s of them without a fault; load {os.getloadavg()[0]:.0f}")  # fmt: skip
        for each in wrong:
            print(f"FAILS {each}")
        print("holds" if not wrong else f"{len(wrong)} failures")
        return wrong


def main() -> int:
    """Run the soak; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--drive", choices=("rotctld", "pty", "topic"), default="rotctld")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--busy", type=int, default=0, help="processes that compute meanwhile")
    parser.add_argument("--json", type=Path, help="write the faults to a file")
    parser.add_argument("--keep", type=Path, help="folder of logs and state, which is kept")
    options = parser.parse_args()
    # An end by a signal ends the nodes and the device, too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))
    os.environ |= {"ROS_DOMAIN_ID": str(random.randrange(1, 100)), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    rclpy.init()
    with ExitStack() as ends, busy(options.busy):
        ends.callback(rclpy.try_shutdown)
        folder = options.keep or Path(ends.enter_context(tempfile.TemporaryDirectory(prefix="soak")))
        folder.mkdir(parents=True, exist_ok=True)
        soak = Soak(ends, folder, options.drive, options.minutes, random.Random(options.seed))
        soak.run()
        wrong = soak.verdict()
    if options.json:
        options.json.write_text(json.dumps([asdict(each) for each in soak.faults], indent=1))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
