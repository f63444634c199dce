"""Alarms of a station, with or without an executive: what the nodes publish in, messages out.

What is published is noted as attributes of devices, as the recovery table names them; the causes of
the table are the alarms.  A check of /diagnostics that is in error and has no cause of its own is
the alarm `failed_check` of its node.
"""

import math
import shutil
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core import AXES, Kinematics, Pair, Params, parameter, utc_text
from rf_pointing.ephemeris.solar import SolarDirection
from rf_pointing.operations import AlarmParams
from rf_pointing.operations.alarms import Alarm
from rf_pointing.operations.recovery import Recovery
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.planning.limits import AxisLimits
from rf_pointing.station.antenna.sun_at_rest import SunAtRestParams, sun_entry
from rf_pointing.station.clients.alarm_hooks import NO_WAY, AlarmHooks, HookParams, Message
from rf_pointing.station.derive.nodes import NODES
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.status import Level, Report

NEEDED = ("antenna_servo", "pointing_controller", "ephemeris_publisher")
"""Nodes without which no pass is tracked; the tracker of its sensor is another one."""
SILENT_S = 5.0
"""Wall time without a word of an executive after which its alarms are sent here."""
START_S = 60.0
"""Wall time within which a node comes up, or is missed where no executive runs."""
STEP_S = 1.0
"""Longest time between two steps of a process that does not stall."""
EXECUTIVE = "station_executive"
"""Its silence has a cause of its own: others notice it."""
EXPLAINED = frozenset({
    "device", "drive", "oscillation", "tracking", "executive", "alarms", "hooks", "night",
    "computer", "clocks",
})  # fmt: skip
"""Checks whose subjects have causes of their own in the table."""
MEMORY = Path("/proc/meminfo")
TRIED_RAD = (2.4, 1.05)
"""Azimuth and elevation to which each axis is moved when it is tried."""


def place_to_try(limits: AxisLimits, mount: Kinematics) -> Pair:
    """Return the axis angles at which each axis is tried: those of `TRIED_RAD`, within the travel.

    An axis that does not reach them is tried in the middle of its travel.
    """
    first, second = TRIED_RAD if mount.level else mount.axes_at(*TRIED_RAD)
    turns = (first, first - math.tau, first + math.tau)
    rows = zip(((*turns,), (second,)), limits.lowest_rad, limits.highest_rad, strict=True)
    lower, upper = (next((at for at in ways if low <= at <= high), 0.5 * (low + high)) for ways, low, high in rows)
    return lower, upper


def place_values(place_rad: Pair, tried_rad: Pair) -> dict[str, dict[str, float]]:
    """Return by device where the axes are, where they are tried, and how far they are from it."""
    here, there = (dict(zip(AXES, each, strict=True)) for each in (place_rad, tried_rad))
    off = {f"{axis}_off": abs(here[axis] - there[axis]) for axis in AXES}
    return {"antenna": here | off, "test_place": there}


@dataclass(frozen=True, kw_only=True)
class AlarmNodeParams(Params):
    """Files that the alarms of a station look at."""

    folder: str = parameter("runs", "a folder on the disk of the recordings")
    recovery_file: str = parameter("", "recovery table (YAML); empty: the shipped one")


class StationAlarms:
    """Keeps what is known of a station, and tells the alarms of a `Recovery` that watches it.

    `folder` is on the disk of the recordings.  `tell(message)` logs and publishes what an operator
    receives.  Times in UTC s, `wall_s` that of a steady clock.
    """

    def __init__(
        self, recovery: Recovery, thresholds: AlarmParams, hooks: HookParams, station: str,
        controller: ControllerParams, folder: Path, tell: Callable[[Message], object],
    ) -> None:  # fmt: skip
        self.recovery, self.book, self.known = recovery, recovery.book, recovery.expected_state
        self.thresholds, self.hooks = thresholds, AlarmHooks(hooks, station)
        self._folder, self._tell, self._sun = folder, tell, SolarDirection(controller.sun, controller.kinematics)
        self._sun_radius_rad = controller.machine.sun_radius_rad
        self._tried_rad = place_to_try(controller.limits, controller.kinematics)
        self._t_s = 0.0
        conditions = (each.attribute for cause in recovery.table.causes for each in cause.when)
        watched = {each.partition(".")[0] for each in conditions if each.endswith(".silent_s")}
        self.named = watched - {"*"} | set(thresholds.nodes.replace(",", " ").split())
        self._alive_s: dict[str, float] = {}
        self._gone: set[str] = set()
        self._lost_executive = ""
        self._states: dict[str, tuple[str, str]] = {}
        self._ready_s: dict[str, float] = {}
        self._failed: dict[str, dict[str, str]] = {}
        self._executive_s, self._observed_s = float("-inf"), float("inf")
        self.healths: dict[str, dict[str, Any]] = {"disk": {"free_gb": 0.0}}
        """Health of devices and model as the morning report shows it."""
        self.book.notify = self._notify

    def take(self, device: str, values: Mapping[str, Any], t_s: float) -> None:
        """Note attributes of a device as they were at `t_s`."""
        for name, value in values.items():
            self.known.observe(f"{device}.{name}", value, t_s)

    def take_place(self, place_rad: Pair, t_s: float) -> None:
        """Note where the axes were at `t_s`."""
        for device, values in place_values(place_rad, self._tried_rad).items():
            self.take(device, values, t_s)

    def take_check(
        self, node: str, check: str, level: int, message: str, values: Mapping[str, str], wall_s: float
    ) -> None:
        """Note one check of a node: a sign of life, and the health of what it is about."""
        # Anybody can send any name, and what no pass needs may end.
        if node not in NODES and node not in self.named:
            return
        self._alive_s[node] = wall_s
        if check == "state":
            (self._gone.add if values.get("state") == "finalized" else self._gone.discard)(node)
            self._states[node] = values.get("state", ""), message
        if check not in EXPLAINED:
            failed = self._failed.setdefault(node, {})
            failed[check] = message if level == Level.ERROR else ""
        if check == "device":
            starts = (values.get(f"{axis}_starts") for axis in AXES)
            self.healths["relays"] = {"starts": ", ".join(filter(None, starts))}
            if node == "antenna_servo":
                self.healths["drive"] = {"problem": message if level == Level.ERROR else ""}
        elif check == "executive":
            self._lost_executive = message if level == Level.ERROR else ""
        elif check == "hooks" and values.get("alarms_sent") is not None:
            # Only an executive that has a way out tells its alarms itself.
            self._executive_s = wall_s if len(values) > 2 else self._executive_s
        elif check == "clocks":
            rows = values.items()
            offsets = [abs(float(each)) for name, each in rows if name.startswith("offset_ms ")]
            self.healths["clocks"] = {"offset_ms": max(offsets, default=0.0), "problem": message}
        elif (node, check) == ("bias_calibrator", "model"):
            self.healths["model"] = {"health": message, "level": level}
        elif (node, check) == ("ephemeris_publisher", "target") and "element_age_h" in values:
            age = {"age_h": float(values["element_age_h"]), "target": values.get("target", "")}
            self.healths["elements"] = age

    def reasons_not_ready(self, nodes: Collection[str], wall_s: float) -> list[str]:
        """Return what is missing of these nodes, and has no alarm of its own."""
        known = {each.name.partition(" ")[2] for each in self.book.lasting}
        found = (self._not_ready(each, wall_s) for each in nodes if each not in known)
        reasons = [reason for reason in found if reason]
        placed = self.known.is_fresh("antenna.azimuth", self._t_s, SILENT_S)
        if not reasons and not placed and NEEDED[0] not in known:
            reasons.append("the drive reads no position")
        return reasons

    def _is_lost(self, node: str, wall_s: float) -> bool:
        return wall_s - self._alive_s.get(node, wall_s) > self.thresholds.node_silent_s

    def _not_ready(self, node: str, wall_s: float) -> str:
        silent_s = wall_s - self._alive_s.get(node, float("-inf"))
        state, message = self._states.get(node, ("", ""))
        if node not in self._alive_s:
            return f"{node} has not been received"
        if self._is_lost(node, wall_s):
            return f"{node} has been silent for {silent_s:.0f} s"
        return "" if state in ("active", "") else f"{node} is {state}: {message}"

    def observe(self, t_s: float, wall_s: float, needed: Collection[str] = NEEDED) -> None:
        """Note what no message carries: silence, disk, memory, the Sun, the ways out."""
        self._t_s = t_s
        # Messages that this process was too late to receive do not count as silence of others.
        if (stalled_s := wall_s - self._observed_s - STEP_S) > 0.0:
            self._alive_s = {name: seen_s + stalled_s for name, seen_s in self._alive_s.items()}
            self._executive_s += stalled_s
        self._observed_s = wall_s
        for name, seen_s in self._alive_s.items():
            checks = self._failed.get(name, {}).items()
            failed = "; ".join(f"{check}: {text}" for check, text in checks if text)
            silent_s = wall_s - seen_s
            self.take(name, {"failed": "" if silent_s > SILENT_S else failed}, t_s)
            if name in needed:
                self.take(name, {"silent_s": silent_s}, t_s)
            elif name not in {*self._gone, EXECUTIVE}:
                self.take(name, {"missing_s": silent_s}, t_s)
        try:
            free_gb, problem = shutil.disk_usage(self._folder).free / 1e9, ""
        except OSError as error:
            free_gb, problem = 0.0, str(error)
        self.healths["disk"] = {"free_gb": free_gb} | ({"problem": problem} if problem else {})
        for device, values in self.healths.items():
            self.take(device, values, t_s)
        for way in self.hooks.ways:
            self.take(way.name, {"not_sent": way.problem}, t_s)
        self.take("computer", {"memory_free_mb": free_memory_mb()}, t_s)
        self._observe_sun(t_s)

    def _observe_sun(self, t_s: float) -> None:
        """Note how near the Sun is, and of a silent antenna when it will be in the beam."""
        azimuth, elevation = (self.known.value(f"antenna.{axis}") for axis in AXES)
        sun = self._sun.at(t_s) if azimuth is not None and elevation is not None else None
        margin_rad = float("inf")
        if sun is not None and not self._permitted(t_s):
            apart_rad = float(angle_between(np.array([azimuth, elevation]), np.array(sun)))
            margin_rad = apart_rad - self._sun_radius_rad
        self.take("antenna", {"sun_margin_rad": margin_rad}, t_s)
        if sun is not None and not self.known.is_fresh("antenna.mode", t_s, SILENT_S):
            # The control unit would warn and turn away; whoever is left can only tell.
            at = float(azimuth or 0.0), float(elevation or 0.0)
            entry = sun_entry(self._sun, self._sun_radius_rad, SunAtRestParams(), at, t_s)
            words = f"{entry.text}; nothing turns it away: antenna_servo is silent" if entry else ""
            self.take("antenna", {"sun": words}, t_s)

    def _permitted(self, t_s: float) -> bool:
        until_t_s = self.known.value("antenna.sun_permit_until_t_s")
        return until_t_s is not None and t_s < until_t_s

    def step(self, t_s: float, wall_s: float) -> None:
        """Observe, raise and clear, and tell what is due: where no executive acts on it."""
        self.observe(t_s, wall_s)
        # An executive that has just come back would tell of its own end once more.
        self.take("executive", {"lost": self._lost_executive}, t_s)
        # An executive knows what its next pass needs; here nobody else notices who never came up.
        for node in NEEDED:
            reason = self._not_ready(node, wall_s)
            if not reason or self._is_lost(node, wall_s):
                self._ready_s[node] = wall_s
            elif wall_s - self._ready_s.setdefault(node, wall_s) > START_S and not any(
                self._failed.get(node, {}).values()
            ):
                self.take(node, {"failed": reason.removeprefix(f"{node} ")}, t_s)
        self.book.held = wall_s - self._executive_s < SILENT_S
        self.recovery.step(t_s)

    def _notify(self, event: str, alarm: Alarm) -> None:
        # Called while the night is stepped: what an operator receives never waits for a server.
        t_s = self._t_s if alarm.notified_t_s is None else alarm.notified_t_s
        self._send(event, alarm.name, alarm.level, alarm.message, alarm.ask, utc_text(t_s))

    def _send(self, *message: Any) -> None:
        self._tell(self.hooks.put(*message))

    def test(self, now_s: float) -> str:
        """Send a message by every way; return its time and the ways."""
        utc = utc_text(now_s)
        words = "a test of the ways out of the station"
        self._send("test", "test_alarms", 0, words, "nothing: it was requested", utc)
        return f"{utc} {', '.join(way.name for way in self.hooks.ways) or NO_WAY}"

    def report(self) -> Report:
        """Return the worst level that is not acknowledged, the alarms in words, and since when."""
        lasting = self.book.lasting
        level = max((each.level for each in lasting if not each.acknowledged), default=0)
        words = "; ".join(f"{each.name}: {each.message}" for each in lasting)
        since: dict[str, object] = {each.name: f"raised {utc_text(each.raised_t_s)}" for each in lasting}
        return Report(Level(level), words or "none", since)

    def computer(self) -> Report:
        """Return whether disk and memory of the computer suffice."""
        alarms = (each for each in self.book.lasting if each.name in ("full_disk", "low_memory"))
        words, disk_mb = "; ".join(each.message for each in alarms), 1e3 * self.healths["disk"]["free_gb"]
        free = {"disk_free_mb": disk_mb, "memory_free_mb": free_memory_mb()}
        known: dict[str, object] = {name: round(each) for name, each in free.items() if each < 1e12}
        return Report(Level(bool(words)), words or "ok", known)


def free_memory_mb() -> float:
    """Return the memory that programs may still take; unlimited where it is unknown."""
    try:
        lines = MEMORY.read_text(encoding="ascii").splitlines()
        free = next(line for line in lines if line.startswith("MemAvailable:"))
        return float(free.split()[1]) / 1024.0
    except (OSError, StopIteration):
        return float("inf")
