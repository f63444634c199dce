"""The server side of rotctld's protocol: the antenna as a rotator of Hamlib.

    P az el   set_pos      p  get_pos      S  stop      K  park      _  get_info
    s  get_status          1  dump_caps    \\dump_state             q  quit

Answers are those of Hamlib 4.5.4, byte for byte.  Where Hamlib accepts NaN, waits for the rest of a
short line in the next one, or answers an unknown command with silence, the line is refused with its
code.  The door is that of `line_server.py`.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

from rf_pointing.core.types import Pair
from rf_pointing.drives import line_server as door
from rf_pointing.drives.protocols import LIMIT_NAMES

# The direction counts: the station chooses the turn and the side of the dish.
AZIMUTH_DEG, ELEVATION_DEG = (-180.0, 450.0), (0.0, 180.0)
MODEL = 2
ZENITH_DEG = 1.0
"""Largest angle by which a bias model turns the beam past the zenith of the mount."""


@dataclass(slots=True)
class Habit:
    """In which range a client thinks, as its own commands show."""

    negative: bool = False
    over: bool = False

    def take(self, azimuth_deg: float, elevation_deg: float) -> None:
        """Note a command: negative azimuths stay a habit until one beyond 180 deg is sent."""
        self.negative = azimuth_deg < 0.0 or (self.negative and azimuth_deg <= 180.0)
        self.over = elevation_deg > 90.0

    def shown_deg(self, azimuth_deg: float, elevation_deg: float) -> Pair:
        """Return a direction (any turn, either side of the zenith) in the client's range.

        The azimuth stays that of the axes within `ZENITH_DEG` beyond the zenith, where the other
        side would name the opposite one for a beam that has hardly moved.
        """
        if not self.over and 90.0 < elevation_deg <= 90.0 + ZENITH_DEG:
            elevation_deg = 90.0
        if (elevation_deg > 90.0) != self.over:
            azimuth_deg, elevation_deg = azimuth_deg + 180.0, 180.0 - elevation_deg
        # Rounded first: 359.996 is shown as 0.00 and not as 360.00.
        azimuth_deg = round(azimuth_deg, 2) % 360.0
        if self.negative and azimuth_deg > 180.0:
            azimuth_deg -= 360.0
        return azimuth_deg, elevation_deg


@dataclass(slots=True)
class StationView:
    """Values that clients may read; the station replaces the values as it learns them.

    `position_deg` is the direction of the beam on any turn and either side of the zenith, None
    while it is not known.
    """

    name: str
    position_deg: Pair | None = None
    moving: tuple[int, int] = (0, 0)
    """Sign of the motion of azimuth and elevation."""
    reason: str = ""
    """Why the newest order was refused; `get_info` tells it to clients of the plain form too."""

    def fields(self, name: str, habit: Habit) -> door.Fields | None:
        """Return the lines of an answer, extended and plain; None where it is not known yet."""
        if name == "get_pos":
            if self.position_deg is None:
                return None
            azimuth, elevation = habit.shown_deg(*self.position_deg)
            return door.labelled(("Azimuth", f"{azimuth:.2f}"), ("Elevation", f"{elevation:.2f}"))
        if name == "get_info":
            refused = f"; refused: {self.reason}" if self.reason else ""
            return door.labelled(("Info", f"{self.name}{refused}"))
        if name == "get_status":
            return door.labelled(("Status flags", self._flags()))
        return tuple((line, line) for line in self._caps()) if name == "dump_caps" else _STATE

    def _flags(self) -> str:
        azimuth, elevation = self.moving
        words = ["MOVING"] * bool(azimuth or elevation)
        words += [f"MOVING_AZ MOVING_{'RIGHT' if azimuth > 0 else 'LEFT'}"] * bool(azimuth)
        words += [f"MOVING_EL MOVING_{'UP' if elevation > 0 else 'DOWN'}"] * bool(elevation)
        return "".join(f"{word} " for word in words)

    def _caps(self) -> tuple[str, ...]:
        return (
            f"Caps dump for model:\t{MODEL}", f"Model name:\t\t{self.name}", "Mfg name:\t\trf_pointing",
            "Rot type:\t\tAz-El", f"Min Azimuth:\t\t{AZIMUTH_DEG[0]:.2f}", f"Max Azimuth:\t\t{AZIMUTH_DEG[1]:.2f}",
            f"Min Elevation:\t\t{ELEVATION_DEG[0]:.2f}", f"Max Elevation:\t\t{ELEVATION_DEG[1]:.2f}",
            "Can set Position:\tY", "Can get Position:\tY", "Can Stop:\t\tY", "Can Park:\t\tY", "Can Reset:\t\tN",
            "Can Move:\t\tN", "Can get Info:\t\tY",
        )  # fmt: skip


_KEYS = ("min_az", "max_az", "min_el", "max_el")
_LIMITS = zip(LIMIT_NAMES, _KEYS, (*AZIMUTH_DEG, *ELEVATION_DEG), strict=True)
_STATE = (
    ("rotctld Protocol Ver: 1", "1"), (f"Rotor Model: {MODEL}", f"{MODEL}"),
    *((f"{name}: {value:.6f}", f"{key}={value:.6f}") for name, key, value in _LIMITS),
    ("South Zero: 0", "south_zero=0"), ("rot_type=AzEl", "rot_type=AzEl"), ("done", "done"),
)  # fmt: skip


class RotatorWords(door.ServedWords):
    """A rotator for one client; `host` is the habit of the clients before it."""

    title = "rotctld"
    letters: ClassVar = {
        "P": ("set_pos", 2), "p": ("get_pos", 0), "S": ("stop", 0), "K": ("park", 0), "R": ("reset", 1),
        "M": ("move", 2), "_": ("get_info", 0), "s": ("get_status", 0), "1": ("dump_caps", 0), "q": ("quit", 0),
        "Q": ("quit", 0),
    }  # fmt: skip
    names: ClassVar = {"dump_state": 0}
    of_station = ("set_pos", "stop", "park")

    def __init__(self, view: StationView, host: Habit | None = None) -> None:
        # Clients that connect anew for every command have the habit of the one before.
        self.view, self._host = view, host or Habit()
        self._habit = Habit(self._host.negative, self._host.over)

    def client(self) -> Self:
        return type(self)(self.view, self._host)

    def judged(self, name: str, arguments: list[str]) -> door.Judgement:
        if name in ("move", "reset"):
            return door.NOT_IMPLEMENTED, f"{name} is not offered", ()
        if name != "set_pos":
            return 0, "", ()
        bounds = (("azimuth", AZIMUTH_DEG), ("elevation", ELEVATION_DEG))
        for text, (axis, (low, high)) in zip(arguments, bounds, strict=True):
            if not door.NUMBER.fullmatch(text):
                return door.INVALID, f"{axis} {door.shown(text)} is not a number", ()
            if not low <= float(text) <= high:
                must = f"must be {low:g} to {high:g} deg"
                return door.INVALID, f"{axis} {door.shown(text)} {must}", ()
        return 0, "", tuple(map(float, arguments))

    def fields(self, order: door.Order) -> door.Fields | None:
        return self.view.fields(order.name, self._habit)

    @property
    def reason(self) -> str:
        return self.view.reason

    def obeyed(self, order: door.Order) -> None:
        if order.name == "set_pos":
            self._habit.take(order.values[0], order.values[1])
            self._host.negative, self._host.over = self._habit.negative, self._habit.over


def direction_rad(azimuth_deg: float, elevation_deg: float) -> Pair:
    """Return azimuth and elevation (at most 90 deg) in rad of what a client wrote."""
    if elevation_deg > 90.0:
        azimuth_deg, elevation_deg = azimuth_deg + 180.0, 180.0 - elevation_deg
    return math.radians(azimuth_deg % 360.0), math.radians(elevation_deg)
