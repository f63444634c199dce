"""Memory of a restarted control unit, from a state file and a wrap file.

The structure is where it was left, a latched fault is still latched, and an antenna that was
parked, stowed or disabled keeps its brakes set until `resume`.  The file is written as the antenna
moves, and before a change of fault or rest is published.  The wrap file keeps the azimuth's turn.
"""

import math
import os
from pathlib import Path

from rf_pointing.core import AXES, KeptState, require_choice
from rf_pointing.planning import WrapCount
from rf_pointing.station.antenna.control_unit import ControlUnit
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import AntennaParams

MOVED_RAD = math.radians(0.5)
"""Motion after which the file is written anew: seldom, and far less than a turn of cables."""
SAME_RAD = 1e-6
AT_REST = (AntennaMode.PARKED, AntennaMode.STOWED, AntennaMode.DISABLED)
SINCE = " (since before the restart)"


def state_folder() -> Path:
    """Return the folder of the user's state for the present ROS domain."""
    base = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    return Path(base).expanduser() / "rf_pointing" / f"domain{os.environ.get('ROS_DOMAIN_ID') or 0}"


def state_files(folder: Path, namespace: str) -> dict[str, str]:
    """Return the parameters of `antenna_servo` that name the files of an antenna in `folder`.

    The controller of the antenna needs `command_key_file` too.
    """
    # A latched fault and the turn of the cables must outlive a crash; two antennas keep two
    # folders.
    kept = folder / namespace.strip("/")
    names = {"state_file": "antenna_servo.json", "wrap_file": "azimuth_turn.json", "command_key_file": "command.key"}
    return {parameter: str(kept / name) for parameter, name in names.items()}


def move_state(folder: Path, former: str, namespace: str) -> str:
    """Move the files of an antenna to those of its full namespace, once; return what was done."""
    files = {Path(each).name for each in state_files(folder, former).values()}
    old, new = (folder / each.strip("/") for each in (former, namespace))
    found = sorted(path for path in old.glob("*") if path.name in files)
    if not found or any((new / name).exists() for name in files):
        return ""
    new.mkdir(parents=True, exist_ok=True)
    for path in found:
        path.rename(new / path.name)
    return f"state of {namespace}: {', '.join(path.name for path in found)} moved from {old} to {new}"


class AntennaMemory:
    """The state file of one antenna; an empty name remembers nothing."""

    def __init__(self, name: str) -> None:
        self._state = KeptState(name)
        self._kept = self._state.recover()
        # A file that lacks a key is another program's: half of a state would be a wrong one.
        missing = {"azimuth_rad", "elevation_rad", "mode", "fault"} - set(self._kept)
        if self._kept and missing:
            raise ValueError(f"state file {name} lacks {', '.join(sorted(missing))}")
        for key, kind in (
            ("azimuth_rad", (int, float)),
            ("elevation_rad", (int, float)),
            ("mode", str),
            ("fault", str),
        ):
            value = self._kept.get(key)
            if self._kept and (not isinstance(value, kind) or isinstance(value, bool)):
                raise ValueError(
                    f"state file {name}: {key}={value!r} must be {'a text' if kind is str else 'a number'}"
                )
        if self._kept:
            require_choice(f"state file {name}: mode", self._kept["mode"], ("", *AT_REST))
        self._written: tuple[float, float, str, str] | None = None

    def start(self, params: AntennaParams) -> AntennaParams:
        """Return the parameters with the angles at which the structure was left, if it is known."""
        if not self._kept:
            return params
        # Whole numbers of any length are JSON, and no angles.
        azimuth, elevation = (min(max(self._kept[f"{axis}_rad"], -1e9), 1e9) for axis in AXES)
        start = params.antenna.replace(start_azimuth_rad=float(azimuth), start_elevation_rad=float(elevation))
        return params.replace(antenna=start)

    def restore(self, antenna: ControlUnit) -> None:
        """Give an antenna that has just been enabled its earlier fault and rest; only once."""
        kept, self._kept = self._kept, {}
        if not kept:
            return
        # The mark is added once, however often the control unit restarts.
        if fault := kept["fault"]:
            antenna.stop(fault if fault.endswith(SINCE) else fault + SINCE)
        elif kept["mode"] in AT_REST:
            antenna.rest(AntennaMode(kept["mode"]))

    def keep(self, antenna: ControlUnit, t_s: float) -> None:
        """Write what has changed enough to matter."""
        azimuth, elevation = antenna.reading(t_s).position_rad.tolist()
        status = antenna.status(t_s)
        rest = status.mode if status.mode in AT_REST else ""
        now = (azimuth, elevation, rest, status.fault)
        was = self._written
        if was is not None and was[2:] == now[2:] and max(abs(azimuth - was[0]), abs(elevation - was[1])) < MOVED_RAD:
            return
        self._state.keep({"azimuth_rad": azimuth, "elevation_rad": elevation, "mode": rest, "fault": status.fault})
        # A failed write is tried again at the next status.
        if not self.problem:
            self._written = now

    @property
    def problem(self) -> str:
        """Why the file does not hold what it should, empty when it does."""
        return self._state.problem


class TurnMemory:
    """The wrap file of one antenna, which keeps the azimuth's turn; an empty name keeps nothing."""

    def __init__(self, name: str, antenna: ControlUnit) -> None:
        """Take the kept turn where the drive reads one; a simulated encoder is checked against it.

        Raises ValueError for a file that cannot be written.
        """
        self._antenna, self._name = antenna, name
        self._count, self.problem = WrapCount(Path(name)) if name else None, ""
        one_turn = isinstance(antenna, DriveAntenna) and antenna.hardware.drive.capabilities.one_turn
        if self._count is None:
            if one_turn:
                antenna.stop(
                    "the drive reads the azimuth modulo 360 deg and no wrap_file keeps its turn: "
                    "look at the cables, then reset"
                )
            return
        # A drive that reads all turns leaves none in doubt, wherever it was moved meanwhile.
        if one_turn or not isinstance(antenna, DriveAntenna):
            self._recover(self._count, float(antenna.axes.encoder_rad[0]))
        self.keep()
        if self.problem:
            raise ValueError(self.problem)

    def _recover(self, count: WrapCount, azimuth_rad: float) -> None:
        recovered_rad, doubt = count.recover(azimuth_rad)
        if isinstance(self._antenna, DriveAntenna):
            self._antenna.place(recovered_rad)
        elif not doubt and abs(recovered_rad - azimuth_rad) > SAME_RAD:
            doubt = "the wrap file names another turn than the encoder: look at the cables, then reset"
        if doubt:
            self._antenna.stop(doubt)

    def keep(self) -> None:
        """Write the turn; a full disk must not leave the antenna alone in its motion."""
        if self._count is None or self._antenna.safety.latch.text:
            return
        try:
            self._count.keep(float(self._antenna.axes.encoder_rad[0]))
            self.problem = ""
        except OSError as error:
            self.problem = f"wrap_file={self._name} cannot be written: {error.strerror}"
