"""Contradictions in a description: values that are right alone and cannot be true together."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rf_pointing.core import AXES, LONGEST_NAME, Pair, Params, Sensor, brief, leaves, one_of
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, MOUNTS
from rf_pointing.core.parameters import flat, from_edge, with_leaves
from rf_pointing.core.whole_file import read_whole
from rf_pointing.drives.params import DriveParams
from rf_pointing.drives.protocols import turns_azimuth_alone
from rf_pointing.drives.registry import known_types, takes_positions
from rf_pointing.ephemeris import SITES
from rf_pointing.planning import HorizonMask
from rf_pointing.planning.horizon_file import in_order, read_horizon
from rf_pointing.receiver.params import SignalReceiverParams
from rf_pointing.servo.base_motion import BaseMotionParams
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.derive.band import BEAM_FACTOR_DEG, SPEED_OF_LIGHT_M_S, pass_elevation_deg
from rf_pointing.station.derive.nodes import NODES, described_parameters, reference
from rf_pointing.station.derive.signal import OPEN
from rf_pointing.station.derive.watches import takes_rates
from rf_pointing.station.description.content import (
    AZIMUTH_TEXT,
    ELEVATION_TEXT,
    ArraySection,
    BandReceiverSection,
    BandSection,
    Content,
    MountSection,
    ReceiverSection,
)
from rf_pointing.station.description.reading import MOST_VALUES, Reader, nearest

BEAMWIDTH_TOLERANCE = 0.2
REACH_POINTS = 73
"""Angles of each axis at which the sky that it reaches is looked for."""
WIDEST_GAP_DEG = 90.0
"""A wider gap between two points of a horizon mask is a gap that nobody surveyed."""


def check(content: Content, reader: Reader, nodes: tuple[str, ...]) -> HorizonMask:
    """Note every contradiction; return the horizon mask, a flat one where it has a problem.

    Of the tuning, and of the errors of the mount, what concerns these `nodes` is judged.
    """
    if isinstance(content.site, str) and content.site not in SITES:
        reader.wrong("site", f"={content.site!r} must be coordinates or {one_of(content.site, SITES)}")
    if content.name is not None and not 0 < len(content.name.strip()) <= LONGEST_NAME:
        reader.wrong("name", f"={brief(content.name)} must have 1 to {LONGEST_NAME} signs")
    mask = _mask(content, reader)
    if content.mount is not None:
        for key, text in _misplaced(content.mount):
            # What is there and was refused has its own problem.
            if not (" is missing" in text and f"mount.{key}" in reader.lines):
                reader.note(f"mount.{key}", f"mount{text}")
        for key, axis in zip(content.mount.keys, content.mount.pair, strict=True):
            for name, text in axis.contradictions() if axis is not None else ():
                reader.wrong(f"{key}.{name}", text)
        _check_mount(content, content.mount, reader)
    _check_bands(content, reader, nodes)
    _check_tuning(content.tuning, "tuning", reader, nodes)
    rows = {f"drive.{name}": value for name, value in flat(content.drive or {}).items()}
    _check_names({"drive": DriveParams()}, rows, "drive", reader, strip="drive.")
    kind = (content.drive or {}).get("type", "simulated")
    if kind not in ("simulated", "topic") and not takes_positions(kind) and kind not in known_types():
        known = one_of(kind, ("simulated", "topic", *known_types()))
        reader.wrong("drive.type", f"={kind!r} must be {known}")
    if content.second_stage and kind != "simulated" and not takes_rates(content.drive or {}):
        reader.wrong("second_stage", f": drive.type={kind!r} takes positions, not rates")
    if content.receiver is not None:
        _check_receiver(content.receiver, content.receiver, "receiver", reader)
    if (simulation := content.simulation) is not None and "antenna_servo" in nodes:
        _check_errors(simulation.mount_errors, "simulation.mount_errors", reader)
        given = flat(simulation.base or {})
        motion = {f"base_motion.{name}": value for name, value in given.items()}
        sets = {"base_motion": BaseMotionParams()}
        _check_names(sets, motion, "simulation.base", reader, strip="base_motion.")
        if motion and content.base is None:
            reader.wrong("simulation.base", " needs the section base: the antenna is on the ground")
    return mask


def _check_errors(values: Mapping[str, Any] | None, key: str, reader: Reader) -> None:
    from rf_pointing.station.antenna.mount import MountParams

    errors = {f"mount.{name}": value for name, value in flat(values or {}).items()}
    _check_names({"mount": MountParams()}, errors, key, reader, strip="mount.")


def _check_receiver(given: BandReceiverSection, whole: ReceiverSection, key: str, reader: Reader) -> None:
    if whole.type == "simulated":
        return
    from rf_pointing.receiver.registry import check_params, known_types

    problems = len(reader.problems)
    if whole.type not in known_types():
        known = ", ".join(known_types())
        reader.wrong(f"{key}.type", f"={whole.type!r} must be one of {known}")
    rows = flat({"receiver": {name: getattr(given, name) or {} for name in OPEN}})
    _check_names({"receiver": SignalReceiverParams()}, rows, key, reader, strip="receiver.")
    if len(reader.problems) == problems:
        try:
            sections = flat({name: getattr(whole, name) or {} for name in OPEN})
            check_params(with_leaves(SignalReceiverParams(), {"type": whole.type, **sections}))
        except ValueError as error:
            reader.wrong(key, f".{error}")


def _misplaced(mount: MountSection) -> Iterator[tuple[str, str]]:
    """Yield keys that the type of the mount lacks, or does not have, and why."""
    names, texts = mount.kind.axes, dict(zip(AXES, (AZIMUTH_TEXT, ELEVATION_TEXT), strict=True))
    for name, axis in zip(names, mount.pair, strict=True):
        if axis is None and name in AXES:
            yield name, f".{name} is missing: {texts[name]}"
        elif axis is None:
            yield f"axes.{name}", f".axes.{name} is missing: type={mount.type} has the axes {' and '.join(names)}"
    given = {f"axes.{name}": name for name in mount.axes or {}} | {
        name: name for name in AXES if getattr(mount, name) is not None
    }
    for key, name in given.items():
        if name not in names or (name in AXES) == ("." in key):
            yield key, f".{key}: type={mount.type} has the axes {' and '.join(names)}"
    for key in dict.fromkeys(key for each in MOUNTS.values() for key in (*each.keys, *each.further)):
        needed, there = key in mount.kind.keys, getattr(mount, key) is not None
        if there and not needed and key not in mount.kind.further:
            yield key, f".{key}: type={mount.type} has no such key"
        elif needed and not there:
            yield key, f".{key} is missing: type={mount.type} needs it"


def _check_mount(content: Content, mount: MountSection, reader: Reader) -> None:
    azimuth, elevation = (axis.travel_deg if axis is not None else None for axis in mount.pair)
    names, key = mount.kind.axes, mount.keys[1]
    if mount.park_deg is not None:
        for name, angle, travel in zip(names, mount.park_deg, (azimuth, elevation), strict=True):
            if travel is not None and not travel[0] <= angle <= travel[1]:
                reader.wrong("mount.park_deg", f"={list(mount.park_deg)}: {name} {angle} must lie within its "
                    f"travel_deg={list(travel)}")  # fmt: skip
    if elevation is None or azimuth is None or mount.type is None:
        return
    _check_reach(content, azimuth, elevation, reader)
    stow = mount.stow_elevation_deg
    # The control unit's travel may be wider than that of passes.
    outer = flat(content.tuning or {}).get("loops.preprocessor.travel_max_deg", elevation)
    if stow is not None and not elevation[0] <= stow <= max(elevation[1], outer[1]):
        reader.wrong("mount.stow_elevation_deg", f"={stow} must lie within {key}.travel_deg={list(elevation)}")
    if mount.type != AZIMUTH_ELEVATION:
        if mount.fixed_elevation_deg is not None:
            reader.wrong("mount.fixed_elevation_deg", f" is for an azimuth alone, of type={AZIMUTH_ELEVATION}")
        return
    if not -12.0 <= elevation[0] < elevation[1] <= 192.0:
        reader.wrong("mount.elevation.travel_deg", f"={list(elevation)} must lie within [-12, 192]")
    begins = pass_elevation_deg(content)
    drive = content.drive or {}
    if mount.fixed_elevation_deg is None and turns_azimuth_alone(str(drive.get("type")), str(drive.get("model", ""))):
        reader.wrong("mount.fixed_elevation_deg", f" must say where the antenna looks: drive.model="
            f"{drive['model']} turns the azimuth alone")  # fmt: skip
    # A pass begins on the limit itself otherwise, and is refused as 0.000 deg past it.
    if begins <= elevation[0]:
        reader.wrong("mount.pass_elevation_deg", f"={begins} must be > {elevation[0]}, the lowest "
            "elevation of the travel: passes begin where the mount cannot look")  # fmt: skip
    points = mount.horizon_deg or ()
    highest = max((point[1] for point in points), default=None)
    if highest is not None and min(90.0, elevation[1]) <= highest:
        reader.note("mount.horizon_deg", f"mount.elevation.travel_deg={list(elevation)} ends below the horizon mask, "
            f"{highest} deg: the travel is smaller than the mask allows")  # fmt: skip


def _check_reach(content: Content, first: Pair, second: Pair, reader: Reader) -> None:
    """Note a mount that cannot stand at the site, or that sees nothing of its sky."""
    site = content.site
    known = site in SITES if isinstance(site, str) else site and None not in (site.latitude_deg, site.longitude_deg)
    if not known:
        return
    try:
        mount = kinematics_of(content)
    except ValueError as error:
        reader.note("mount.type", f"mount: {error}")
        return
    if mount.level or first[0] >= first[1] or second[0] >= second[1]:
        return
    grid = np.stack(np.meshgrid(np.linspace(*first, REACH_POINTS), np.linspace(*second, REACH_POINTS)), axis=-1)
    highest, begins = float(np.degrees(mount.skies(np.radians(grid))[..., 1].max())), pass_elevation_deg(content)
    if highest <= begins:
        names, key = mount.axes, content.mount.keys[0]
        reader.wrong(f"{key}.travel_deg", f"={list(first)} and {names[1]} {list(second)} reach "
            f"{highest:.1f} deg of elevation at most, must be > {begins:g}, where passes begin")  # fmt: skip


def _mask(content: Content, reader: Reader) -> HorizonMask:
    mount = content.mount
    if mount is None:
        return HorizonMask()
    clearance = math.radians(mount.horizon_clearance_deg or 1.0)
    points, key, lines = mount.horizon_deg, "mount.horizon_deg", None
    if mount.horizon_file:
        if points is not None:
            reader.wrong("mount.horizon_file", " and mount.horizon_deg give the mask twice: leave one out")
        key = "mount.horizon_file"
        points, lines = _mask_file(mount.horizon_file, reader)
    if not points:
        if mount.horizon_deg == ():
            reader.wrong(key, "=[] must have at least one point")
        return HorizonMask(clearance_rad=clearance)
    problems = len(reader.problems)
    rows = in_order([(line, *point) for line, point in zip(lines or range(1, len(points) + 1), points, strict=True)])
    points, lines = tuple((azimuth, elevation) for _, azimuth, elevation in rows), lines and [row[0] for row in rows]
    for index, (azimuth, elevation) in enumerate(points):
        where = f"{key} point {index + 1}" + (f" (line {lines[index]})" if lines else "")
        if not 0.0 <= azimuth <= 360.0:
            reader.note(key, f"{where}: azimuth {azimuth} must be >= 0 and <= 360")
        if not -11.0 <= elevation <= 85.0:
            reader.note(key, f"{where}: elevation {elevation} must be >= -11 and <= 85")
        before = points[index - 1]
        if index and azimuth <= before[0]:
            reader.note(key, f"{where}: azimuth {azimuth} must be > {before[0]}, the one before")
        gap = azimuth - before[0] if index else azimuth + 360.0 - points[-1][0]
        if len(points) > 1 and gap > WIDEST_GAP_DEG:
            reader.note(
                key, f"{where}: {gap:g} deg after the point before, must be <= {WIDEST_GAP_DEG:g}: the mask has a gap"
            )
    if len(reader.problems) > problems:
        return HorizonMask(clearance_rad=clearance)
    azimuths, elevations = (tuple(map(math.radians, column)) for column in zip(*points, strict=True))
    return HorizonMask(azimuth_rad=azimuths, elevation_rad=elevations, clearance_rad=clearance)


def _mask_file(name: str, reader: Reader) -> tuple[tuple[Pair, ...], list[int]]:
    path = reader.path.parent / name
    try:
        text = read_whole(path, encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reader.wrong("mount.horizon_file", f"={name!r} cannot be read: {error}")
        return (), []
    rows, wrong = read_horizon(text)
    for number, line in wrong:
        reader.note("mount.horizon_file", f"{name}:{number}: {line[:40]!r} must be azimuth and elevation in deg")
    points, lines = [(azimuth, elevation) for _, azimuth, elevation in rows], [row[0] for row in rows]
    if not points:
        reader.wrong("mount.horizon_file", f"={name!r} must have at least one point")
    elif len(points) > MOST_VALUES:
        reader.wrong("mount.horizon_file", f"={name!r} has {len(points)} points, must have <= {MOST_VALUES}")
        points = []
    return tuple(points), lines


def _check_bands(content: Content, reader: Reader, nodes: tuple[str, ...]) -> None:
    bands = content.bands
    if bands is None:
        return
    if not bands:
        reader.wrong("bands", " must have at least one band")
    elif content.default_band and content.default_band not in bands:
        known = one_of(content.default_band, bands)
        reader.wrong("default_band", f"={content.default_band!r} must be {known}")
    for name, section in bands.items():
        if section is not None:
            _check_band(content, name, section, reader, nodes)


def _check_band(content: Content, name: str, section: BandSection, reader: Reader, nodes: tuple[str, ...]) -> None:
    key = f"bands.{name}"
    given, frequency = section.half_power_beamwidth_deg, section.frequency_mhz
    diameter = content.dish.diameter_m if content.dish else None
    if given is None and content.dish is None:
        reader.wrong(key, " needs half_power_beamwidth_deg: there is no dish to derive it from")
    if given is not None and diameter is not None and frequency is not None:
        derived = BEAM_FACTOR_DEG * SPEED_OF_LIGHT_M_S / (1e6 * frequency) / diameter
        if abs(given / derived - 1.0) > BEAMWIDTH_TOLERANCE:
            reader.wrong(f"{key}.half_power_beamwidth_deg", f"={given} must be within 20 % of "
                f"{derived:.4g}, that of dish.diameter_m={diameter} at {frequency} MHz")  # fmt: skip
    if section.sensors is not None and len(set(section.sensors)) < len(section.sensors):
        reader.wrong(f"{key}.sensors", f"={list(section.sensors)} names a sensor twice")
    if section.sensors is not None and Sensor.ARRAY in section.sensors and content.array is None:
        reader.wrong(f"{key}.sensors", " names array: the description has no section array")
    elif Sensor.ARRAY in (section.sensors or ()) and content.array and frequency is not None:
        _check_array(content.array, frequency, reader)
    if wider := section.acquisition_band:
        lower = [each for each, other in (content.bands or {}).items()
                 if other and frequency is not None and (other.frequency_mhz or frequency) < frequency]  # fmt: skip
        if wider not in lower:
            known = one_of(wider, lower) if lower else "empty: no band has a lower frequency"
            reader.wrong(f"{key}.acquisition_band", f"={wider!r} must be {known}")
    if section.bias_model:
        # Imported here, as what the checks of an array need: most stations have neither.
        from rf_pointing.calibration.model_file import read_model

        path = reader.path.parent / section.bias_model
        try:
            version = read_model(path)
        except (ValueError, OSError) as error:
            reader.wrong(f"{key}.bias_model", f"={section.bias_model!r}: {error}")
        else:
            for what, own, wanted in (("station", version.station, content.name), ("band", version.band, name)):
                if own != wanted:
                    reader.wrong(f"{key}.bias_model", f"={section.bias_model!r} is of {what} {own!r}, must be "
                        f"of {wanted!r}")  # fmt: skip
            try:
                if content.mount is not None and content.site is not None:
                    version.model.on(kinematics_of(content))
            except ValueError as error:
                reader.wrong(f"{key}.bias_model", f"={section.bias_model!r}: {error}")
    if section.noise is not None:
        if section.system_noise_k is not None:
            reader.wrong(f"{key}.noise", " and system_noise_k give the same twice: leave one out")
        for index, stage in enumerate(section.noise.chain or ()):
            if why := stage.contradiction():
                reader.wrong(f"{key}.noise.chain", f"[{index}] {why}")
    if (its := section.receiver) and any(vars(its).values()) and (common := content.receiver):
        here, kinds = content.receiver_in(name), {its.type or common.type, common.type}
        if len(kinds) > 1 and kinds & {"simulated", "topic"}:
            reader.wrong(f"{key}.receiver.type", f"={its.type!r}: receiver.type={common.type!r} has other nodes")
        _check_receiver(its, here, f"{key}.receiver", reader)
    _check_tuning(section.tuning, f"{key}.tuning", reader, nodes)
    if "antenna_servo" in nodes:
        _check_errors(section.mount_errors, f"{key}.mount_errors", reader)


def _check_array(section: ArraySection, frequency_mhz: float, reader: Reader) -> None:
    # A value that was refused has its own problem.
    if None in (section.elements, section.radius_m, section.phase_sigma_deg):
        return
    from rf_pointing.station.derive.array import level_of_array_db_hz

    if math.isinf(level_of_array_db_hz(section, SPEED_OF_LIGHT_M_S / (1e6 * frequency_mhz))):
        reader.wrong("array", f": {section.elements} patches on a circle of {section.radius_m} m, phases known to "
            f"{section.phase_sigma_deg} deg: at {frequency_mhz} MHz every direction is like another one")  # fmt: skip


def _check_tuning(values: Mapping[str, Any] | None, key: str, reader: Reader, nodes: tuple[str, ...]) -> None:
    known, complete = described_parameters(nodes), set(NODES) <= set(nodes)
    wanted: dict[str, Any] = {}
    for name, value in flat(values or {}).items():
        owner = reference(known[name][0]).owner(name) if name in known else ""
        if name not in known:
            # A single node does not know the names of the others.
            if complete:
                reader.wrong(f"{key}.{name}", f": no parameter of that name{nearest(name, known)}")
        elif not owner and not name.startswith(reference(known[name][0]).either):
            reader.wrong(f"{key}.{name}", f" is a parameter of {' and '.join(known[name])}, not of the station")
        elif owner and not owner.startswith("tuning."):
            reader.wrong(f"{key}.{name}", f" is given by {owner}: change it there")
        else:
            wanted[name] = value
    for name, value in wanted.items():
        _check_names(reference(known[name][0]).defaults, {name: value}, key, reader)


def _check_names(
    sets: Mapping[str, Params], values: Mapping[str, Any], key: str, reader: Reader, strip: str = ""
) -> None:
    """Note every value that its parameter set refuses."""
    for name, value in values.items():
        prefix, _, rest = name.partition(".")
        shown = name.removeprefix(strip)
        edge = leaves(sets[prefix])
        if rest not in edge:
            reader.wrong(f"{key}.{shown}", f": no such key of {key}{nearest(rest, edge)}")
            continue
        try:
            # Alone: what depends on other values is judged with the whole set later.
            from_edge(edge[rest][0], rest.rpartition(".")[2], value)
        except ValueError as error:
            section = rest.rpartition(".")[0]
            reader.note(f"{key}.{shown}", f"{key}.{shown.removesuffix(rest)}{section}{'.' if section else ''}{error}")
