"""The operator's page without sockets: what it shows and when, what an operator may send.

What the nodes publish arrives as the plain values of `ros/station_view.py`, and leaves in sections
of JSON.  What moves is shown `rate_hz` times a second, the rest once a second.
"""

import math
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any

import numpy as np

from rf_pointing.core import LEVEL, Params, leaves, one_of, parameter, utc_text, with_leaves
from rf_pointing.core.whole_file import read_whole
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.ephemeris.target_offsets import TargetOffsets
from rf_pointing.operations.dictionary import TABLES, DirectiveRow, read_directives
from rf_pointing.planning import HorizonMask, PassProfile
from rf_pointing.tracking.sensors import SENSOR_CHOICES

SLOW_S = 1.0
"""Time between two looks at what changes seldom."""
SILENT_S = 3.0
"""A node that has reported nothing for so long is shown as silent."""
RUNNING_S = 5.0
"""An executive that is silent for so long runs nothing."""
LONGEST_TEXT = 200
MOST_ROWS = 200
"""Passes, nodes, and checks of a node that are shown at most."""
EVENTS = 30
PATH_POINTS = 90
"""Points of a pass on the sky plot, about."""
MASK_STEP_DEG = 2.0
LARGEST = 1e18
"""Largest number of a command."""
JOG = "jog"
"""Sent several times a second while a button is held: only what refuses it is shown."""
FROM_DICTIONARY = (
    "stop_antenna", "stop_pass", "pause_antenna", "release", "park", "stow", "reset_antenna_fault", "select_target", "track",
    "set_along_track", "set_cross_track", "set_time_offset", "set_azimuth_offset", "set_elevation_offset",
    "set_cross_elevation_offset", "set_right_ascension_offset", "set_declination_offset",
    "clear_offsets", "keep_offsets", "recall_offsets", JOG,
)  # fmt: skip
"""Directives of the shipped dictionary that the page sends."""
OF_EXECUTIVE = {"acknowledge": True, "skip": True, "pause": False, "resume": False, "stop": False, "abort": False}
"""Services of the executive that the page calls as `night_…`, and whether they take a name."""
TAKES = {"track": ("aos_utc", "sensor")}
"""Arguments where they differ: a goal needs a whole pass, a viewer names a shown one."""
LIMITS = tuple(f"limits.{axis}_{end}_deg" for axis in ("azimuth", "elevation") for end in ("min", "max"))
SUN_RADIUS = "machine.sun_radius_deg"
OFFSETS = tuple(leaves(TargetOffsets()))
SETS: Mapping[str, Params] = {"mask": HorizonMask(), "sun": SunParams(), "kinematics": LEVEL}
READ = {
    "pointing_controller": [
        *LIMITS, SUN_RADIUS,
        *(f"{name}.{leaf}" for name, each in SETS.items() for leaf in leaves(each)),
    ],
    "ephemeris_publisher": [f"source.{name}" for name in OFFSETS],
}  # fmt: skip
"""Parameters of other nodes that the page shows; some change while the nodes run."""

ALL = "all"
"""Word of `page.antennas` for every antenna in the graph."""
MOST_ANTENNAS = 50

Reply = Callable[[bool, str], object]


def namespaces_of(text: str) -> list[str]:
    """Return the namespaces of a list such as "/gs1, /gs2"; ValueError names one that cannot be."""
    found = [f"/{each.strip('/')}" for each in text.replace(",", " ").split()]
    for each in found:
        if not re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)+", each):
            raise ValueError(f"antennas={text!r}: {each} must be a namespace, as /gs1")
        if found.count(each) > 1:
            raise ValueError(f"antennas={text!r} names {each} twice")
    if len(found) > MOST_ANTENNAS:
        raise ValueError(f"antennas names {len(found)} namespaces, must be <= {MOST_ANTENNAS}")
    return found


@dataclass(frozen=True, kw_only=True)
class PageParams(Params):
    """Where the page is, and who may command."""

    address: str = parameter("127.0.0.1", "address to bind to; any but loopback needs token_file")
    port: int = parameter(8080, "TCP port; 0: any that is free", 0, 65535)
    hosts: str = parameter("", "further host names under which the page is reached, separated by commas")
    token_file: str = parameter("", "file (mode 600) with the token of commands; empty: one is made for this user")
    reports: str = parameter("runs", "folder whose reports are offered; empty: none")
    rate_hz: float = parameter(6.0, "how often what moves is sent to the viewers", 1.0, 20.0)
    viewers: int = parameter(50, "viewers at one time", 1, 1000)
    antennas: str = parameter(
        "", "namespaces shown, separated by commas; all: every antenna that is found; empty: that of the node"
    )

    def check_together(self) -> None:
        """Refuse wrong namespaces, and an open address without a token that somebody has chosen."""
        if self.antennas != ALL:
            namespaces_of(self.antennas)
        try:
            address = ip_address(self.address)
        except ValueError:
            raise ValueError(f"address={self.address} must be an IP address, as 127.0.0.1") from None
        if not address.is_loopback and not self.token_file:
            raise ValueError(
                f"address={self.address} can be reached by other computers: token_file='' must name the file of a token"
            )


def command_rows() -> dict[str, DirectiveRow]:
    """Return what the page can send, by name."""
    shipped = read_directives(read_whole(TABLES / "directives.yaml"))
    rows = {name: shipped[name] for name in FROM_DICTIONARY}
    for name, named in OF_EXECUTIVE.items():
        kind, takes = ("rf_pointing_msgs/srv/Named", ("name",)) if named else ("std_srvs/srv/Trigger", ())
        rows[f"night_{name}"] = DirectiveRow(
            name=f"night_{name}", kind="service", address=f"station_executive/{name}", type_name=kind, takes=takes
        )
    return rows


def degrees(values: Sequence[float], digits: int = 4) -> list[float]:
    """Return angles (rad) or rates (rad/s) in degrees, rounded."""
    return [round(math.degrees(float(value)), digits) for value in values]


class Board:
    """View of one namespace for a page, as plain values, and the commands of its viewers.

    `send` takes number, name and arguments of a command; `responded` and `ended` take what comes
    back under the number.  For `track` the argument target_pass is a row of the section `passes`.
    """

    def __init__(self, rate_hz: float, namespace: str, send: Callable[[int, str, Mapping[str, Any]], None]) -> None:
        self.rows = command_rows()
        self.profiles: Sequence[PassProfile] = ()
        """The coming passes of the selected target, in the order of their times."""
        self._period_s, self._namespace, self._send = 1.0 / rate_hz, namespace, send
        self._now_s = self._utc_s = 0.0
        self._mount = LEVEL
        self.kept: dict[str, Any] = {"certificate": None, "station": {"name": "", "band": ""}}
        """The sections that are shown as they are, by name."""
        self._seen_s: dict[str, float] = {}
        self._nodes: dict[str, dict[str, Any]] = {}
        self._parameters: dict[str, Any] = {"offsets": None}
        self._sun: SolarDirection | None = None
        self._path: tuple[PassProfile | None, dict[str, Any] | None] = None, None
        self._requests: dict[int, tuple[str, Reply]] = {}
        self._number = 0
        self._events: deque[dict[str, Any]] = deque(maxlen=EVENTS)
        self._next_s = self._slow_s = -math.inf
        self._viewers = 0
        self._carrier_seen = False

    def turn(self, now_s: float, utc_s: float, viewers: int) -> bool:
        """Set steady and UTC time (s) of what follows; return whether to look at the streams.

        Where there are viewers, `sections` are shown then.
        """
        self._now_s, self._utc_s = now_s, utc_s
        if viewers and not self._viewers:
            # The first viewer has nothing yet.
            self._next_s = self._slow_s = -math.inf
        self._viewers = viewers
        if now_s < self._next_s:
            return False
        period_s = self._period_s if viewers else SLOW_S
        self._next_s = max(self._next_s + period_s, now_s + 0.5 * period_s)
        return True

    @property
    def wait_s(self) -> float:
        """How long to wait for the next view; a command waits for 50 ms at most."""
        return min(0.05, max(0.001, self._next_s - self._now_s))

    # What is known

    def seen(self, name: str) -> None:
        """Note that a message of a stream has arrived."""
        self._seen_s[name] = self._now_s

    def take_profiles(self, profiles: Sequence[PassProfile]) -> None:
        """Take the coming passes of the selected target."""
        self.profiles = profiles

    def keep(self, name: str, values: Any) -> None:
        """Take a section that is shown as it is."""
        self.kept[name] = values
        self.seen(name)

    def note_check(self, node: str, check: str, level: int, message: str) -> None:
        """Take a check of a node on /diagnostics; `node` is its full name, of any namespace."""
        start = f"{self._namespace.rstrip('/')}/"
        name = node.removeprefix(start)
        if node.startswith(start) and (name in self._nodes or len(self._nodes) < MOST_ROWS):
            row = self._nodes.setdefault(name, {"checks": {}})
            row["seen_s"] = self._now_s
            if check in row["checks"] or len(row["checks"]) < MOST_ROWS:
                row["checks"][check] = [level, message]

    def take_parameters(self, node: str, values: Mapping[str, Any] | None) -> str:
        """Note parameters, if there are new ones; return why they are refused, "" if not."""
        try:
            if values is not None:
                self.note_parameters(node, values)
        except ValueError as error:
            return str(error)
        return ""

    def note_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        """Take the parameters `READ` of a node; ValueError for a wrong horizon or site."""
        if node == "ephemeris_publisher":
            found = {name: values[f"source.{name}"] for name in OFFSETS if f"source.{name}" in values}
            self._parameters["offsets"] = with_leaves(TargetOffsets(), found).offsets_text
            return
        self._mount = with_leaves(LEVEL, _below("kinematics.", values))
        mask = with_leaves(HorizonMask(), _below("mask.", values))
        sun = with_leaves(SunParams(), _below("sun.", values))
        self._parameters |= {
            "limits_deg": [values.get(name) for name in LIMITS], "mask_deg": mask_values(mask),
            "sun_radius_deg": values.get(SUN_RADIUS), "axes": self.axes,
        }  # fmt: skip
        if self._sun is None or self._sun.site != sun.site:
            self._sun = SolarDirection(sun)

    # What is shown

    def sections(self, live: Mapping[str, Any]) -> dict[str, Any]:
        """Return what to show now: `live` with ages (s), and what changes seldom where it is due.

        The time of `live` is its `t_s`, if it has one.
        """
        age_s = self.age_s
        # A station without a receiver has no carrier to lose.
        self._carrier_seen |= (live.get("carrier_to_noise_db_hz") or 0.0) > 0.0
        more = {"age_s": age_s, "viewers": self._viewers, "carrier_seen": self._carrier_seen}
        if not self._mount.level and "encoder_deg" in live:
            # The encoders show other angles than those of the sky plot.
            more["sky_deg"] = degrees(self._mount.skies(np.radians(live["encoder_deg"])).tolist(), 3)
        found: dict[str, Any] = {"live": {**more, **live}}
        if self._now_s < self._slow_s:
            return found
        self._slow_s = self._now_s + SLOW_S
        t_s = live.get("t_s", self._utc_s)
        sun = self._sun.at(t_s) if self._sun else None
        own = {"namespace": self._namespace, "sensors": list(SENSOR_CHOICES)}
        return found | self.kept | {
            "station": own | self.kept["station"] | self._parameters, "sun": degrees(sun, 2) if sun else None,
            "path": self._path_at(t_s), "nodes": self.nodes, "events": list(self._events),
        }  # fmt: skip

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the lower and the upper axis."""
        return self._mount.axes

    @property
    def age_s(self) -> dict[str, float]:
        """Age of the newest message of each source that was received, in s."""
        names = ("antenna", "tracking", "target", "executive")
        return {name: round(max(0.0, self._age_s(name)), 1) for name in names if name in self._seen_s}

    @property
    def nodes(self) -> list[dict[str, Any]]:
        """The nodes of the namespace with their checks, and for how long they have been silent."""
        return [
            {"name": name, "silent_s": round(silent_s) if (silent_s := self._now_s - row["seen_s"]) > SILENT_S else 0,
             "checks": [[check, *state] for check, state in row["checks"].items()]}
            for name, row in sorted(self._nodes.items())
        ]  # fmt: skip

    def _age_s(self, name: str) -> float:
        return self._now_s - self._seen_s.get(name, -math.inf)

    def _path_at(self, t_s: float) -> dict[str, Any] | None:
        """Return the pass that lasts or comes next."""
        coming = next((each for each in self.profiles if each.t_s[-1] > t_s), None)
        if coming is not self._path[0]:
            self._path = coming, path_values(coming) if coming else None
        return self._path[1]

    # Commands

    def request(self, name: str, arguments: Mapping[str, Any], reply: Reply) -> None:
        """Send a command; `reply` takes whether it was accepted, and a sentence."""
        self._number += 1
        self._requests[self._number] = name, reply
        try:
            self._send(self._number, name, self._checked(name, arguments))
        except (ValueError, TypeError) as error:
            self.responded(self._number, False, str(error))

    def responded(self, number: int, accepted: bool, text: str) -> None:
        """Take the response to a command."""
        if number in self._requests:
            name, reply = self._requests.pop(number)
            words = text or ("accepted" if accepted else "refused")
            if name != JOG or not accepted:
                self._note(accepted, f"{name}: {words}")
            reply(accepted, words)

    def ended(self, _number: int, name: str, succeeded: bool, result: Mapping[str, Any]) -> None:
        """Take the end of what a command has begun."""
        self._note(succeeded, f"{name} ended: {result.get('message') or 'no message'}")

    def _note(self, accepted: bool, text: str) -> None:
        """Show what has become of a command, with the next view."""
        self._events.appendleft({"utc": utc_text(self._utc_s)[:19], "accepted": accepted, "text": text})
        self._slow_s = -math.inf

    def _checked(self, name: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        if name not in self.rows:
            raise ValueError(f"command {name[:LONGEST_TEXT]!r} must be {one_of(name[:LONGEST_TEXT], self.rows)}")
        found = checked_arguments(self.rows[name], arguments)
        if name == "track":
            return {"target_pass": self._row(found.get("aos_utc", "")), "sensor": found.get("sensor", "auto")}
        return found

    def _row(self, aos_utc: str) -> int:
        if self.kept.get("executive", {}).get("state") == "running" and self._age_s("executive") < RUNNING_S:
            raise ValueError("the executive runs a schedule: pause the night first")
        rises = [row["aos_utc"] for row in self.kept["passes"]["rows"]] if "passes" in self.kept else []
        if aos_utc not in rises:
            coming = f"one of the {len(rises)} coming passes"
            raise ValueError(f"aos_utc={aos_utc!r} must be {coming}: select the target first")
        return rises.index(aos_utc)


def checked_arguments(row: DirectiveRow, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a command; ValueError for one that it does not take, or no number."""
    takes = TAKES.get(row.name, row.takes)
    for name, value in arguments.items():
        if name not in takes:
            known = ", ".join(takes) or "none"
            raise ValueError(f"{row.name} has no argument {name[:LONGEST_TEXT]!r}; it takes {known}")
        if isinstance(value, str) and len(value) > LONGEST_TEXT:
            raise ValueError(f"{name} has {len(value)} characters, must be <= {LONGEST_TEXT}")
        if row.kind == "parameter" and (isinstance(value, bool) or not isinstance(value, (int, float))):
            raise ValueError(f"{row.name}: {name}={value!r} must be a number")
        if isinstance(value, (int, float)) and not abs(value) <= LARGEST:
            raise ValueError(f"{row.name}: {name}={str(value)[:20]} must be finite, at most {LARGEST:g}")
    # A parameter of type double refuses a whole number.
    return {name: float(value) if row.kind == "parameter" else value for name, value in arguments.items()}


def _below(start: str, values: Mapping[str, Any]) -> dict[str, Any]:
    return {name.removeprefix(start): value for name, value in values.items() if name.startswith(start)}


def path_values(profile: PassProfile) -> dict[str, Any]:
    """Return a pass as points of the sky, deg, at even times."""
    step = max(1, math.ceil(len(profile.t_s) / PATH_POINTS))
    rows = [*range(0, len(profile.t_s), step), len(profile.t_s) - 1]
    return {
        "target": profile.name, "aos_s": float(profile.t_s[0]), "los_s": float(profile.t_s[-1]),
        "points_deg": [degrees(point, 2) for point in profile.position_rad[rows]],
    }  # fmt: skip


def mask_values(mask: HorizonMask) -> list[list[float]]:
    """Return the horizon (azimuth, elevation) in deg around the whole turn."""
    azimuths = np.arange(0.0, 360.0 + MASK_STEP_DEG, MASK_STEP_DEG)
    heights = np.degrees(mask.lowest_all(np.radians(azimuths)))
    return [[float(azimuth), round(float(height), 2)] for azimuth, height in zip(azimuths, heights, strict=True)]
