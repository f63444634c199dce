"""Two antennas on two computers share a pass and fail in turn; print who had it, who transmitted, and every gap.

    sudo scripts/run-python benchmarks/two_antennas.py [--drive rotctld] [--legs fault drive cut executive computer]

Each computer (a network namespace, as in two_computers.py) has a whole station in wall time: drive (Debian's rotctld,
or a simulated antenna), two rigctld, radio_control with a transmit line that is a file, and an executive that names
the other antenna as its partner and stands by for it.  One leg after the other in one pass: a latched fault, a lost
drive, a link that is cut for 15 s and healed, an executive that is killed (-9), a computer that loses its power.
Each begins with whoever has the pass.  A line without power is down.  Prints JSON.
"""

import argparse
import json
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import two_computers
import yaml

NAMES = f"a{os.getpid()}", f"b{os.getpid()}"
"""Namespaces; the locks of nodes are those of the whole machine."""
LEGS = ("fault", "drive", "cut", "executive", "computer")
ROOM = ("ephemeris_publisher", "pointing_controller", "radio_control")
EXECUTIVE = "station_executive"
RISES_IN_S, CUT_S, CALM_S, PATIENCE_S = 45.0, 15.0, 4.0, 60.0
LOOK_S = 0.01
PASS_ID = "shared"
DRIVES = {"rotctld": "hamlib", "simulated": "simulated_rotator"}
EXAMPLE = Path(__file__).parents[1] / "examples" / "hamlib_rotator.yaml"
FRESH_S = 0.5
"""Age of what was seen of an antenna, after which nothing is known of it."""


class Side:
    """One computer: its processes, and what its observer sees."""

    def __init__(self, number: int, both: Any, folder: Path, drive: str, programs: Path) -> None:
        self.name, self.number, self._both, self._folder = NAMES[number], number, both, folder
        self._programs, self._drive, self.running = programs, drive, dict[str, Any]()
        self.line, self.file = folder / f"{self.name}.line", folder / f"{self.name}.jsonl"
        self.line.write_text("0\n")
        self.seen: dict[str, Any] = {}
        self.powered = True
        self._read = 0
        self._station = folder / f"{self.name}.yaml"
        description = yaml.safe_load(EXAMPLE.read_text())
        description["bands"]["S"]["sensors"] = []
        if drive == "simulated":
            description["drive"] = {"type": DRIVES[drive]}
        description["mount"]["transmit_elevation_deg"] = 5.0
        description["tuning"] = {"between": {"standby": True}}
        up = {"any": {"downlink_mhz": 2250.0, "uplink_mhz": 2050.0}}
        description["radio"] = {
            "receive": {"port": 4532}, "transmit": {"port": 4542}, "transponders": up, "transmit_line": str(self.line),
        }  # fmt: skip
        self._station.write_text(yaml.safe_dump(description))

    @property
    def station(self) -> str:
        return str(self._station)

    def begin(self) -> None:
        for port in (4532, 4542):
            self.start(f"rigctld{port}", ["rigctld", "-m", "1", "-T", "127.0.0.1", "-t", str(port)])
        self.start_drive()
        words = [sys.executable, __file__, "--observe", str(self.file)]
        self.start("observer", words, ROS_NAMESPACE=f"/{self.name}")
        self.start_nodes()

    def start_drive(self) -> None:
        if self._drive == "rotctld":
            self.start("rotctld", ["rotctld", "-m", "1", "-T", "127.0.0.1", "-t", "4533"])

    def start_nodes(self) -> None:
        self.powered = True
        key = str(self._folder / f"{self.name}.key")
        elements = {"source.elements": str(self._folder / "flyer.tle"), "source.satellite": "FLYER"}
        self._node("antenna_servo", {"command_key_file": key})
        own = {"ephemeris_publisher": elements, "pointing_controller": {"command_key_file": key}}
        self._start(ROOM, {name: own.get(name, {}) for name in ROOM})
        self.start_executive()

    def start_executive(self) -> None:
        self._node(EXECUTIVE, {
            "command_key_file": str(self._folder / f"{self.name}.key"), "executive.record": False,
            "executive.partners": NAMES[1 - self.number], "executive.folder": str(self._folder / self.name),
            "executive.partners_key_file": str(self._folder / "partners.key"),
            "executive.state_file": str(self._folder / f"{self.name}.night.json"),
        })  # fmt: skip

    def _node(self, name: str, values: Mapping[str, Any]) -> None:
        self._start((name,), {name: values})

    def _start(self, names: Sequence[str], values: Mapping[str, Mapping[str, Any]]) -> None:
        usual = {"station": self.station, "lifecycle.autostart": True}
        file = self._folder / f"{self.name}.{names[0]}.yaml"
        sections = {f"/**/{name}": {"ros__parameters": {**usual, **own}} for name, own in values.items()}
        file.write_text(json.dumps(sections))
        several = len(names) > 1
        words = [str(self._programs / ("station_process" if several else names[0])), *(names if several else ())]
        words += ["--ros-args", "-r", f"__ns:=/{self.name}", "--params-file", str(file)]
        self.start(names[0], words)

    def start(self, what: str, words: Sequence[str], **environment: str) -> None:
        self.running[what] = self._both.start(self.number, words, f"{self.name}.{what}", **environment)

    def kill(self, *names: str) -> None:
        """End processes as a crash does, by default all of the station."""
        if not names:
            self.powered = False
        for name in names or ("antenna_servo", ROOM[0], EXECUTIVE):
            self.running[name].kill()
            self.running[name].wait()

    def call(self, service: str) -> None:
        """Let the observer call a service of std_srvs/Trigger."""
        (self._folder / f"{self.name}.jsonl.call").write_text(service)

    def look(self) -> None:
        """Take what the observer has written."""
        if self.file.is_file():
            with self.file.open() as file:
                file.seek(self._read)
                text = file.read()
            whole = text[: text.rfind("\n") + 1]
            self._read += len(whole)
            if whole:
                self.seen = json.loads(whole.splitlines()[-1])

    def knows(self, name: str, value: Any) -> bool:
        return bool(self.seen.get(name) == value and time.monotonic() - self.seen["t_s"] < FRESH_S)

    @property
    def has(self) -> bool:
        """Whether it has the pass, and receives it."""
        return self.powered and self.knows("state", "active") and self.knows("held", True)

    @property
    def ready(self) -> bool:
        return self.powered and self.knows("state", "standby") and self.knows("held", True)

    @property
    def transmits(self) -> bool:
        return self.powered and self.line.read_text().strip() == "1"


class Watch:
    """Both sides, looked at 100 times a second; `gap_s` are the longest times without each since `begin`."""

    def __init__(self, sides: Sequence[Side]) -> None:
        self._sides, self.both_s, self._looked_s = sides, 0.0, time.monotonic()
        self.begin()

    def begin(self) -> None:
        self.gap_s, self._since_s = dict[str, float](), dict[str, float]()
        self.begun_s = time.monotonic()

    def look(self) -> None:
        for side in self._sides:
            side.look()
        now_s = time.monotonic()
        transmit = sum(each.transmits for each in self._sides)
        if transmit > 1:
            self.both_s += now_s - self._looked_s
        self._looked_s = now_s
        held = any(each.powered and each.knows("held", True) for each in self._sides)
        rows = {"received": held, "had": any(each.has for each in self._sides), "transmitted": transmit > 0}
        for name, is_so in rows.items():
            since_s = self._since_s.setdefault(name, now_s)
            self.gap_s[name] = max(self.gap_s.get(name, 0.0), now_s - since_s)
            if is_so:
                self._since_s[name] = now_s

    def until(self, condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> float:
        """Wait for a condition; return the seconds that it took."""
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > patience_s:
                seen = {each.name: each.seen for each in self._sides}
                raise TimeoutError(f"{what} not within {patience_s:.0f} s: {seen}")
            self.look()
            time.sleep(LOOK_S)
        return time.monotonic() - begun_s

    def wait(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end_s, "time")


def write_passes(folder: Path, station: str) -> float:
    """Write the list of the one pass; return the UTC (s) at which it begins."""
    from rf_pointing.core.dates import to_utc_text
    from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, read_elements
    from rf_pointing.station.description import read_station

    one = find_elements(read_elements((folder / "flyer.tle").read_text()), "FLYER")
    windows = find_passes(TopocentricTrack(one, read_station(station).site), time.time(), 3600.0, math.radians(5.0))
    row = {"id": PASS_ID, "target": "FLYER", "aos_utc": to_utc_text(windows[0].aos_t_s),
           "los_utc": to_utc_text(windows[0].los_t_s)}  # fmt: skip
    (folder / "passes.json").write_text(json.dumps([row]))
    return float(windows[0].aos_t_s)


class Trial:
    """The legs of one pass."""

    def __init__(self, both: Any, sides: Sequence[Side], watch: Watch) -> None:
        self._both, self.sides, self.watch = both, sides, watch

    def fly(self, legs: Sequence[str]) -> dict[str, Any]:
        self.watch.until(self._calm, "a pass that one has and the other stands by for", 180.0)
        found = {leg: self._flown(leg) for leg in legs}
        return found | {"both_transmit_s": self.watch.both_s}

    def _flown(self, leg: str) -> dict[str, Any]:
        watch = self.watch
        watch.wait(CALM_S)
        first, second = sorted(self.sides, key=lambda each: not each.has)
        watch.begin()
        before_s = watch.both_s
        back_s = getattr(self, f"_{leg}")(first, second)
        taken_s = watch.until(lambda: second.has and second.transmits, f"{leg}: {second.name} has the pass")
        gaps_s = dict(watch.gap_s)
        self._mend(leg, first)
        calm_s = watch.until(self._calm, f"{leg}: one that has the pass")
        return {"from": first.name[0], "taken_s": back_s + taken_s, "gap_s": gaps_s, "calm_s": calm_s,
                "both_transmit_s": watch.both_s - before_s, "load": os.getloadavg()[0]}  # fmt: skip

    def _calm(self) -> bool:
        """Whether one has the pass and transmits, and the other stands by on the target."""
        return any(a.has and a.transmits and b.ready and not b.transmits for a, b in (self.sides, self.sides[::-1]))

    def _fault(self, first: Side, _second: Side) -> float:
        first.call("antenna_servo/stop")
        return 0.0

    def _drive(self, first: Side, _second: Side) -> float:
        first.kill("rotctld")
        return 0.0

    def _cut(self, first: Side, second: Side) -> float:
        link = ("-n", self._both.names[1], "link", "set", "rfp0")
        two_computers.ip(*link, "down")
        begun_s = time.monotonic()
        took_s = self.watch.until(
            lambda: second.has and second.transmits and not first.transmits, "the other transmits"
        )
        self.watch.wait(max(CUT_S - (time.monotonic() - begun_s), 0.0))
        two_computers.ip(*link, "up")
        return took_s

    def _executive(self, first: Side, _second: Side) -> float:
        first.kill(EXECUTIVE)
        return 0.0

    def _computer(self, first: Side, _second: Side) -> float:
        first.kill()
        return 0.0

    def _mend(self, leg: str, first: Side) -> None:
        if leg == "fault":
            first.call("antenna_servo/reset_fault")
        elif leg == "drive":
            first.start_drive()
        elif leg == "executive":
            first.start_executive()
        elif leg == "computer":
            first.line.write_text("0\n")
            first.start_nodes()


def fly(drive: str, legs: Sequence[str]) -> dict[str, Any]:
    """Fly the pass and return what was measured."""
    from ament_index_python.packages import get_package_prefix

    programs = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing"
    with TemporaryDirectory() as name, two_computers.computers(Path(name), server=False) as both:
        folder = Path(name)
        sides = [Side(number, both, folder, drive, programs) for number in (0, 1)]
        two_computers.RISES_IN_S = RISES_IN_S
        two_computers.write_elements(folder / "flyer.tle", sides[0].station)
        aos_s, watch = write_passes(folder, sides[0].station), Watch(sides)
        for side in sides:
            side.begin()
        try:
            watch.until(lambda: all(each.knows("executive", "idle") for each in sides), "both executives", PATIENCE_S)
            for side in sides:
                words = ["--namespace", f"/{side.name}", "queue", str(folder / "passes.json"), "--start"]
                side.start("operator", [str(programs / "station"), *words])
            return {"on": drive, "up_before_rise_s": aos_s - time.time(), **Trial(both, sides, watch).fly(legs)}
        except TimeoutError as error:
            logs = [f"{path.stem}: {path.read_text(errors='replace')[-1500:]}" for path in sorted(folder.glob("*.log"))]
            raise RuntimeError("\n".join([*logs, str(error)])) from error


def observe(file: Path) -> None:
    """Write 20 times a second what an antenna publishes, and call the services that are requested."""
    import rclpy
    from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus, Schedule, TrackingStatus
    from std_msgs.msg import String
    from std_srvs.srv import Trigger

    from rf_pointing.ros.main_loop import make_executor
    from rf_pointing.ros.qos import LATCHED, STATUS, STREAM

    rclpy.init()
    node = rclpy.create_node("observer", namespace=os.environ["ROS_NAMESPACE"])
    seen: dict[str, Any] = {}

    def take(**known: Any) -> None:
        seen.update(known)

    listen, calls = node.create_subscription, file.with_name(f"{file.name}.call")
    listen(TrackingStatus, "tracking_status", lambda m: take(
        held=m.held, mode=m.mode, reason=m.reason, t_s=time.monotonic()), STREAM)  # fmt: skip
    listen(AntennaStatus, "antenna_status", lambda m: take(antenna=m.mode, fault=m.fault), STATUS)
    listen(ExecutiveStatus, "executive_status", lambda m: take(
        executive=m.state, why=m.reason, partner_inhibit=m.partner_inhibit), STATUS)  # fmt: skip
    listen(Schedule, "schedule", lambda m: take(state="".join(each.state for each in m.passes)), LATCHED)
    listen(String, "radio/inhibit", lambda m: take(inhibit=m.data), STATUS)
    executor, written_s = make_executor(), 0.0
    executor.add_node(node)
    clients = {name: node.create_client(Trigger, f"antenna_servo/{name}") for name in ("stop", "reset_fault")}
    with file.open("a", buffering=1) as out:
        while True:
            executor.spin_once(timeout_sec=0.02)
            if time.monotonic() - written_s > 0.05:
                written_s = time.monotonic()
                out.write(json.dumps({"t_s": 0.0} | seen) + "\n")
            if calls.is_file():
                name = calls.read_text().rpartition("/")[2]
                calls.unlink()
                clients[name].call_async(Trigger.Request())


def main() -> None:
    """Fly one pass, or be the observer of a side."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drive", choices=DRIVES, default="rotctld")
    parser.add_argument("--legs", nargs="+", choices=LEGS, default=list(LEGS))
    parser.add_argument("--observe", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    if options.observe:
        observe(options.observe)
    elif reason := two_computers.why_not():
        sys.exit(reason)
    else:
        print(json.dumps(fly(options.drive, options.legs), indent=1))


if __name__ == "__main__":
    main()
