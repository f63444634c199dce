"""Twenty faults in an hour of wall time, on Debian's rotctld: is each announced once, and is the report right?

Started by `benchmarks/night.py --drive rotctld [--faults N]`.  Every 6 min a satellite passes for about 150 s;
one fault comes in the middle of each pass, one between two.  For every fault: the messages `raised` that left the
station by the hook while it lasted, and the alarms of the morning report in that time.  As asked: one message of
the right alarm, none of another, the alarm in the report; a pass under a fault names it, another pass names nothing.
"""

import json
import os
import shutil
import signal
import subprocess
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from launched_station import LaunchedStation, say

from rf_pointing.core.dates import parse_utc, utc_text

FIRST_S, EVERY_S = 240.0, 360.0
"""From the start to the first culmination, and from one to the next."""
IN_PASS_S, BETWEEN_S = -30.0, 140.0
"""Time of the two faults from a culmination."""
AFTER_S = 45.0
"""After the end of a fault its alarm may still be raised, or cleared."""
OLD_H, STALE_H = 30.0, 24.0
DISK_GB, LEAST_GB = 0.4, 0.1
"""Size of the disk that the station has for itself, and the free space below which it warns."""


@dataclass
class Fault:
    """One fault of the list: in a pass or between two, for `seconds`."""

    kind: str
    alarm: str
    seconds: float
    in_pass: bool
    begun_s: float = 0.0
    ended_s: float = 0.0


def hung(node: str, alarm: str = "lost_node") -> tuple[str, str, float]:
    """Return a node that does nothing for 12 s, and is killed then."""
    return f"hung {node}", f"{alarm} {node}", 12.0


IN_PASS = (
    ("link cut", "lost_drive", 60.0), hung("pointing_controller"), ("axes stuck", "latched_fault", 20.0),
    hung("ephemeris_publisher"), hung("antenna_servo"), ("stale elements", "stale_elements", 60.0),
    ("encoder frozen", "latched_fault", 20.0), ("rotctld hung", "lost_drive", 40.0),
    ("receiver fails", "failed_check rf_receiver", 20.0), ("gust", "high_wind", 30.0),
)  # fmt: skip
BETWEEN = (
    ("receiver gone", "missing_node rf_receiver", 20.0), ("full disk", "full_disk", 25.0), hung("antenna_servo"),
    ("rotctld killed", "lost_drive", 40.0), ("hung station_executive", "lost_executive", 20.0),
    hung("bias_calibrator", "missing_node"), ("clock", "clock", 30.0), hung("station_description", "missing_node"),
    ("link cut", "lost_drive", 40.0), hung("pointing_controller"),
)  # fmt: skip
STALE_PASS = [kind for kind, _, _ in IN_PASS].index("stale elements")


def faults_of(count: int) -> list[Fault]:
    """Return the first faults of the list, in pass and between by turns."""
    both = [
        (row, in_pass)
        for pair in zip(IN_PASS, BETWEEN, strict=True)
        for row, in_pass in zip(pair, (True, False), strict=True)
    ]
    return [Fault(*row, in_pass) for row, in_pass in both[:count]]


class Hand:
    """What begins and ends the faults of a station."""

    def __init__(self, station: LaunchedStation) -> None:
        self.station, self.ballast = station, station.folder / "state" / "ballast"

    def begin(self, kind: str) -> None:
        station = self.station
        relay = {"link cut": "cut", "axes stuck": "stuck", "encoder frozen": "frozen", "rotctld hung": "hung"}
        if kind in relay:
            station.relay.set(relay[kind])
        elif kind.startswith("hung "):
            station.signal(kind.partition(" ")[2], signal.SIGSTOP)
        elif kind == "rotctld killed":
            station.rotctld.kill()
        elif kind == "full disk":
            free = shutil.disk_usage(self.ballast.parent).free
            with self.ballast.open("wb") as file:
                os.posix_fallocate(file.fileno(), 0, free - int(0.5e9 * LEAST_GB))
        self._own(kind, on=True)

    def end(self, kind: str) -> None:
        station = self.station
        if kind.startswith("hung "):
            station.signal(kind.partition(" ")[2], signal.SIGKILL)
        elif kind == "rotctld killed":
            station.rotctld.start()
        self.ballast.unlink(missing_ok=True)
        station.relay.set("pass")
        self._own(kind, on=False)

    def _own(self, kind: str, *, on: bool) -> None:
        """Let the station's own receiver and anemometer say it."""
        station = self.station
        station.own_level = 2 if on and kind == "receiver fails" else 0
        station.own_silent = on and kind == "receiver gone"
        station.own_offset_s = 0.5 if on and kind == "clock" else 0.0
        station.wind_m_s = 30.0 if on and kind == "gust" else 3.0


def fly(count: int, folder: Path, every_s: float = EVERY_S) -> int:
    """Fly the night with `count` faults and a pass each `every_s`; print every fault and the verdict.

    Return the exit code.  What the station writes lies on a small disk of its own, which takes root to mount.
    """
    disk = folder / "state"
    disk.mkdir(parents=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={int(1000 * DISK_GB)}m", "tmpfs", str(disk)], check=True)
    try:
        return _fly(count, folder, every_s)
    finally:
        shutil.copytree(disk, folder / "kept")
        subprocess.run(["umount", "-l", str(disk)], check=True)


def _fly(count: int, folder: Path, every_s: float) -> int:
    faults, begun_s = faults_of(count), time.time()
    culminations = [begun_s + FIRST_S + every_s * k for k in range(count // 2 + 1)]
    ages = [OLD_H if k == STALE_PASS else 0.0 for k in range(len(culminations))]
    changes = f"  alarms.elements_stale_h: {STALE_H}\n  alarms.disk_free_gb: {LEAST_GB}\n"
    station = LaunchedStation(
        folder, culminations, ages_h=ages, changes=changes, anemometer=True, words=("page:=true",)
    )
    try:
        station.own_silent = False
        say(f"{count} faults, {len(culminations)} passes, until {utc_text(culminations[-1])[11:19]}; {folder}")
        say(f"the control unit is heard after {station.until(station.fresh, 120.0):.1f} s")
        client = station.queue()
        _play(Hand(station), faults, culminations)
        say(f"the night: {station.executive.state}, {station.executive.reason}")
        station.until(lambda: client.poll() is not None, 60.0)
        report = station.report()
        say(f"ends with exit code {station.stop()}")
        (folder / "faults.json").write_text(json.dumps([asdict(fault) for fault in faults], indent=1))
        return judge(faults, station.told(), report, [each.id for each in station.passes])
    finally:
        station.close()


def _play(hand: Hand, faults: list[Fault], culminations: list[float]) -> None:
    station = hand.station
    for k, fault in enumerate(faults):
        at_s = culminations[k // 2] + (IN_PASS_S if fault.in_pass else BETWEEN_S)
        station.until(lambda at_s=at_s: time.time() >= at_s, 2.0 * EVERY_S)
        fault.begun_s = time.time()
        if fault.kind == "stale elements":
            # It comes with the target of its pass, which is selected before the rise.
            fault.begun_s, fault.ended_s = at_s - EVERY_S + BETWEEN_S, at_s + fault.seconds
            continue
        say(f"{fault.kind} for {fault.seconds:g} s {'in a pass' if fault.in_pass else 'between'}: "
            f"{station.antenna.mode}, {station.tracking.mode}")  # fmt: skip
        hand.begin(fault.kind)
        station.spin(fault.seconds)
        hand.end(fault.kind)
        fault.ended_s = time.time()
    station.until(lambda: station.executive.state == "idle", EVERY_S)


def judge(faults: list[Fault], told: list[dict[str, str]], report: dict[str, Any], passes: list[str]) -> int:
    """Print each fault with its messages, each pass with its causes, and the verdict."""
    wrong, alarms = 0, report.get("alarms", [])
    raised = [(parse_utc(each["utc"]), each) for each in told if each["event"] == "raised"]
    others = [each for each in told if each["event"] not in ("raised", "cleared")]
    windows = [(fault.alarm, fault.begun_s, fault.ended_s + AFTER_S) for fault in faults]
    for fault in faults:
        until_s = fault.ended_s + AFTER_S
        own = [each for t_s, each in raised if fault.begun_s <= t_s < until_s]
        right = [each for each in own if each["alarm"] == fault.alarm]
        # A fault that lasts at the same time has messages of its own.
        meant = {alarm for alarm, from_s, to_s in windows if from_s < until_s and to_s > fault.begun_s}
        foreign = sorted(each["alarm"] for each in own if each["alarm"] not in meant)
        listed = [
            each for each in alarms if each["name"] == fault.alarm and fault.begun_s <= each["raised_t_s"] < until_s
        ]
        good = len(right) == 1 and bool(listed) and not foreign
        wrong += not good
        delay = f"after {parse_utc(right[0]['utc']) - fault.begun_s:.1f} s" if right else "NEVER"
        words = right[0]["message"] if right else ""
        print(
            f"{'ok ' if good else 'BAD'} {utc_text(fault.begun_s)[11:19]} {fault.kind:<24} -> {fault.alarm:<32} "
            f"told {len(right)} {delay}, in the report {len(listed)}; "
            f"others told: {', '.join(foreign) or '-'}: {words}"
        )
    known = {each["name"] for each in alarms}
    for row in report.get("passes", []):
        under = [f.alarm for f in faults if f.begun_s < row["los_t_s"] and f.ended_s + AFTER_S > row["aos_t_s"]]
        named = [alarm for alarm in under if any(cause.startswith(alarm) for cause in row["causes"])]
        # Words of an attempt stand beside the alarms, and need a fault as well.
        words = [cause for cause in row["causes"] if cause.startswith(tuple(known)) or not under]
        stray = [cause for cause in words if not cause.startswith(tuple(under))]
        good = not stray and (row["state"] == "tracked" or bool(named))
        wrong += not good
        length_s = row["los_t_s"] - row["aos_t_s"]
        print(f"{'ok ' if good else 'BAD'} {row['id']} {row['state']}, held {100.0 * row['tracked_s'] / length_s:.1f} %: "
              f"under {', '.join(under) or '-'}; causes {'; '.join(row['causes']) or '-'}")  # fmt: skip
    missing = set(passes) - {row["id"] for row in report.get("passes", [])}
    print(f"messages {len(told)}, of them {len(others)} neither raised nor cleared: "
          f"{', '.join(sorted(each['alarm'] + ' ' + each['event'] for each in others)) or '-'}")  # fmt: skip
    print(f"{'as asked' if not wrong and not missing else 'NOT AS ASKED'}: {wrong} lines wrong, passes not in the report: "
          f"{', '.join(sorted(missing)) or '-'}")  # fmt: skip
    return int(bool(wrong or missing))
