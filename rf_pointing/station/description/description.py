"""One station, described once: what every node, command and simulation takes its numbers from."""

import dataclasses
import json
from collections.abc import Iterable, Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rf_pointing.core import STANDBY_ROLE, Sensor, Value, flat, leaves, read_whole, require_choice
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION
from rf_pointing.station.derive.band import Band, Derived, site_of
from rf_pointing.station.derive.nodes import NODES, reference
from rf_pointing.station.description.content import Content
from rf_pointing.station.description.reading import Reader, StationError, nearest
from rf_pointing.tracking.sensors import SENSORS

if TYPE_CHECKING:
    from rf_pointing.planning import HorizonMask

_PACKAGE = Path(__file__).parents[2]
STATIONS = next(filter(Path.is_dir, (_PACKAGE / "config/stations", _PACKAGE.parent / "config/stations")))
"""Folder of the shipped descriptions: installed with the package, or config/ of a checkout."""
DEFAULT_STATION = "dss13"
OF_EVERY_NODE = (
    "lifecycle.autostart", "lifecycle.realtime_priority", "station", "band", "use_sim_time",
    "start_type_description_service",
)  # fmt: skip
# Parameters of before, and the key that took their place.
_FORMER = {
    ("ephemeris_publisher", "source.station"): "site", ("rf_receiver", "source.station"): "site",
    ("pointing_controller", "sun.station"): "site", ("antenna_servo", "safety.sun.station"): "site",
}  # fmt: skip


class StationDescription:
    """A description without problems; `read_station` makes it."""

    def __init__(self, path: Path, content: Content, mask: "HorizonMask", lines: Mapping[str, int]) -> None:
        self.path, self.content, self.mask, self.lines = path, content, mask, lines
        self.name = content.name
        """Name of the station; models and observations belong to it."""
        self.site = site_of(content)
        """Where the antenna stands."""
        self.bands = tuple(content.bands)
        """Names of the bands, in the order of the file."""
        self.default_band = content.default_band or self.bands[0]
        """The band that counts when none is named."""
        self.drive: Mapping[str, Any] = {"type": "simulated"} | content.drive
        """The drive section: its `type` and the keys of that type."""
        self._derived: dict[tuple[str, str], Derived] = {}

    @property
    def receiver(self) -> str:
        """Type of the receiver: simulated, or that of a device."""
        return self.content.receiver.type

    @property
    def simulated(self) -> bool:
        """Whether its antenna is a simulated one; any other moves a device in real time."""
        from rf_pointing.drives.registry import SIMULATED

        return self.drive["type"] in SIMULATED

    def sensors(self, band: str | None = None) -> tuple[str, ...]:
        """Return what a band can track with, the default first; empty for program track alone."""
        return self.content.bands[self._band(band)].sensors

    @property
    def every_sensor(self) -> set[str]:
        """Every sensor that one of the bands can track with."""
        return {name for band in self.content.bands.values() for name in band.sensors}

    def chosen_sensor(self, sensor: str | None = None, band: str | None = None) -> str:
        """Return the sensor that the operator's choice means in a band, by default the first.

        `auto` is monopulse or conscan, as the carrier allows, where the band has both; else the one
        of them that it has; else its first sensor.

        Raises
        ------
        ValueError
            For a sensor that the band does not have, and for `auto` where it has none.
        """
        known, name = self.sensors(band), self._band(band)
        if not sensor:
            return str(known[0] if known else Sensor.PROGRAM)
        if sensor != Sensor.AUTO:
            # Sensors of other packages are not the feed's: the station does not list them.
            if sensor in set(Sensor) - {*known, Sensor.PROGRAM}:
                words = ", ".join((*known, *((Sensor.AUTO,) if known else ()), Sensor.PROGRAM))
                raise ValueError(f"sensor={sensor}: {name} band of {self.name} has {words}")
            return str(sensor)
        if not known:
            raise ValueError(f"sensor=auto: {name} band of {self.name} has no sensor, only program")
        automatic = [name for name, traits in SENSORS.items() if traits.automatic and name in set(Sensor)]
        usable = [each for each in automatic if each in known]
        if usable == automatic:
            return str(sensor)
        return str(usable[0] if usable else known[0])

    def bias_model_file(self, band: str | None = None) -> Path | None:
        """Return the file of the bias model of a band, None for no correction."""
        name = self.content.bands[self._band(band)].bias_model
        return (self.path.parent / name).resolve() if name else None

    @cached_property
    def digest(self) -> str:
        """Text that two descriptions share only if every number in them is the same.

        Masks and bias models from files count by their content, comments and order do not.
        """
        # Imported here: OpenSSL takes 3.5 MB.
        import hashlib

        content = dataclasses.asdict(self.content)
        content["mount"]["horizon_deg"] = leaves(self.mask)["azimuth_deg"][1], leaves(self.mask)["elevation_deg"][1]
        del content["mount"]["horizon_file"]
        if self.content.mount.type == AZIMUTH_ELEVATION:
            # As recordings have it from before there were other mounts.
            for name in ("type", "axes", "lower_axis", "tilt_deg"):
                del content["mount"][name]
        if self.content.second_stage is None:
            del content["second_stage"]
        for name, section in content["bands"].items():
            if section["feed_offset"] is None:
                del section["feed_offset"]
            if not any(section["receiver"].values()):
                del section["receiver"]
            model = self.bias_model_file(name)
            section["bias_model"] = read_whole(model) if model else ""
        return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:16]

    def derived(self, node: str, band: str | None = None) -> Derived:
        """Return the parameter sets of a node as they follow from the description."""
        chosen = self._band(band)
        if (node, chosen) not in self._derived:
            model = self.bias_model_file(chosen)
            content = self.content
            if any(vars(content.bands[chosen].receiver).values()):
                content = dataclasses.replace(content, receiver=content.receiver_in(chosen))
            numbers = Band(content, chosen, self.mask, str(model) if model else "")
            tuning = (("tuning", self.content.tuning), (f"bands.{chosen}.tuning", numbers.section.tuning))
            given = {
                name: Value(value, f"{key}.{name}", "given")
                for key, section in tuning for name, value in flat(section).items()
            }  # fmt: skip
            self._derived[node, chosen] = dataclasses.replace(NODES[node](numbers), given=given)
        return self._derived[node, chosen]

    def values(self, band: str | None = None) -> dict[str, Value]:
        """Return every given or derived parameter by its name, with its key and formula."""
        return {name: value for node in NODES for name, value in self.derived(node, band).values.items()}

    def parameters(self, node: str, band: str | None = None) -> dict[str, Any]:
        """Return the parameters of a node that the description gives or derives.

        Names are dotted, angles in degrees, as in a ROS parameter file.  A node that the
        description does not cover gets none.
        """
        return {name: each.value for name, each in self.derived(node, band).values.items()} if node in NODES else {}

    def sets(self, node: str, band: str | None = None, changes: Mapping[str, object] | None = None) -> dict[str, Any]:
        """Return the parameter sets of a node by their prefix, in core units.

        `changes` are values by dotted names, in degrees, over those of the description; ValueError
        names node and parameter of one that is refused.
        """
        derived = self.derived(node, band)
        if changes:
            over = {name: Value(value, "") for name, value in changes.items()}
            derived = dataclasses.replace(derived, given={**derived.given, **over})
        try:
            return {prefix: derived.set_of(prefix) for prefix in derived.defaults}
        except ValueError as error:
            raise ValueError(f"{node}: {error}") from error

    def check_file(self, node: str, values: Mapping[str, Any], band: str | None = None) -> None:
        """Raise ValueError for what a parameter file may not say: unknown names, other numbers.

        A number of the description may be repeated, as `ros2 param dump` does.
        """
        require_known(node, values)
        # "**" names every node, and no number of one.
        given = {} if node == "**" else reference(node).names | self.parameters(node, band)
        for name, value in values.items():
            if given and (key := owner(node, name)) and not same_value(given[name], value):
                raise ValueError(f"{node}: {name} is given by the station description: {key}")

    def write(self, path: Path, changes: Mapping[str, Any]) -> None:
        """Write the description to `path`, with other values for the dotted keys of `changes`.

        The files that it names are named by their whole paths.
        """
        # Imported here: nodes read descriptions, and write none.
        from rf_pointing.station.description.writing import text_with

        path.write_text(text_with(self, changes))

    def require_mount(self, user: str) -> None:
        """Raise ValueError for a mount that may lean anywhere: `user` must know its axes."""
        if self.content.mount.leans_anywhere:
            raise ValueError(
                f"mount.train_deg of {self.name} is missing: {user} must know to which azimuth it leans in the pass"
            )

    def _band(self, band: str | None) -> str:
        chosen = self.default_band if band is None else band
        require_choice(f"{self.name}: band", chosen, self.bands)
        return chosen


def read_station(name_or_path: str | Path, nodes: tuple[str, ...] = tuple(NODES)) -> StationDescription:
    """Return the description of a shipped name or of a user's file.

    Checked are the file, and what follows from it for these `nodes`.

    Raises
    ------
    StationError
        A ValueError with all problems of the file, one a line: `file:line: key=value must ...`.
    """
    text = str(name_or_path)
    path = STATIONS / f"{text}.yaml"
    if not path.is_file():
        path = Path(text).expanduser()
        if not path.is_file():
            raise StationError(text, [(0, f"no such file, and no shipped station{nearest(text, shipped_stations())}")])
    return station_from(path, nodes=nodes)


def station_from(path: Path, text: str | None = None, nodes: tuple[str, ...] = tuple(NODES)) -> StationDescription:
    """Return the description of a file, or of the `text` that will be its content.

    Raises StationError as `read_station` does.
    """
    # Imported here: a node without a station file does without its rules.
    from rf_pointing.station.description.checks import check

    reader = Reader(path)
    content = reader.content(text)
    mask = check(content, reader, nodes)
    reader.refuse()
    station = StationDescription(path, content, mask, reader.lines)
    for node in nodes:
        _check_sets(station, node, reader)
    reader.refuse()
    return station


def shipped_stations() -> tuple[str, ...]:
    """Return the names of the shipped descriptions."""
    return tuple(sorted(path.stem for path in STATIONS.glob("*.yaml") if not path.stem.startswith("bias_model")))


def require_known(node: str, names: Iterable[str]) -> None:
    """Raise ValueError for a node, or a parameter of it, that does not exist; "**" is any node."""
    if node not in (*NODES, "**"):
        raise ValueError(f"{node} is not a node of a station{nearest(node, NODES)}")
    known = {name for each in (NODES if node == "**" else [node]) for name in reference(each).every_name}
    known.update(OF_EVERY_NODE, [STANDBY_ROLE] * (node in ("pointing_controller", "**")))
    for name in names:
        if name not in known and not name.startswith("qos_overrides."):
            raise ValueError(f"{node}: no such parameter {name}{nearest(name, known)}")


@cache
def owner(node: str, parameter: str) -> str:
    """Return the key of the description that gives this parameter, "" if it is the node's own.

    A parameter of this name in a parameter file is refused with that key.  Former names are
    known too.
    """
    return _FORMER.get((node, parameter)) or (reference(node).owner(parameter) if node in NODES else "")


def same_value(given: Any, value: Any) -> bool:
    """Return whether a value of a parameter file is that of the description."""
    return bool(
        (list(given) if isinstance(given, tuple) else given) == (list(value) if isinstance(value, tuple) else value)
    )


def _check_sets(station: StationDescription, node: str, reader: Reader) -> None:
    """Note what a node would refuse in the derived values, by the node's own parameter sets."""
    for band in station.bands:
        try:
            derived = station.derived(node, band)
        except ValueError as error:
            reader.note("mount", f"band {band}: {error}")
            continue
        for prefix in derived.defaults:
            try:
                derived.set_of(prefix)
            except ValueError as error:
                reader.note(f"bands.{band}", f"band {band}, {node}: {error}")
