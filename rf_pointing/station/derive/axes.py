"""Axes, drive and zones: what the mount can do and where it may look, for every node alike."""

import math
from typing import TYPE_CHECKING, Any

from rf_pointing.core import AXES, Kinematics, Pair, Rows, Value, flat, leaves, rounded, tuned
from rf_pointing.core.mount_types import LOWER_AXES
from rf_pointing.planning.horizon import HorizonMask
from rf_pointing.station.derive.band import AXIS_KEYS, Band, nearest_within, site_of
from rf_pointing.station.description.content import BaseSection, Content

if TYPE_CHECKING:
    from rf_pointing.calibration import BiasModel

TRAIN_RATE_DEG_S = 1.0
SKY_TURNS_DEG = (-720.0, 720.0)
"""Azimuths on the sky for a base that moves: its own turns are those of its axes."""


def limits(of: Band) -> Rows:
    """Travel that may be commanded."""
    travel = [axis.travel_deg for axis in of.axes]
    if of.content.base is not None and kinematics_of(of.content).level:
        # The controller knows the sky: the control unit has the turns and the travel of the axes.
        travel = [SKY_TURNS_DEG, (0.0, 90.0)]
    return {
        f"{name}_{side}_deg": Value(angle, f"{key}.travel_deg")
        for name, key, ends in zip(AXES, of.content.mount.keys, travel, strict=True)
        for side, angle in zip(("min", "max"), ends, strict=True)
    }


def kinematics(of: Band) -> Rows:
    """How the axes lie."""
    keys = {"latitude_deg": "site.latitude_deg"}
    return {
        name: Value(value, keys.get(name, f"mount.{name}"))
        for name, (_, value) in leaves(kinematics_of(of.content)).items()
    }


def kinematics_of(content: Content) -> Kinematics:
    """Return the mount of a description; ValueError where it cannot stand at the site."""
    mount = content.mount
    rate_deg_s = mount.train_rate_deg_s or TRAIN_RATE_DEG_S
    return Kinematics(
        type=mount.type,
        lower_axis=mount.lower_axis or LOWER_AXES[0],
        latitude_rad=site_of(content).latitude_rad if mount.kind.polar else 0.0,
        tilt_rad=math.radians(mount.tilt_deg or 0.0),
        train_rad=math.radians(mount.train_deg or 0.0),
        train_rate_rad_s=math.radians(rate_deg_s) if mount.leans_anywhere else 0.0,
    )


def zenith_deg(of: Band) -> Pair:
    """Return the angles of the axes that point at the zenith."""
    first, second = kinematics_of(of.content).axes_at(0.0, 0.5 * math.pi)
    return round(math.degrees(math.remainder(first, math.tau)), 9) + 0.0, round(math.degrees(second), 9) + 0.0


def commanded(of: Band) -> Rows:
    """Largest commanded rates and accelerations."""
    return {
        "rate_limit_deg_s": Value(
            of.rates_deg_s, "mount.*.command_rate_deg_s",
            "0.9 of the drive's rate, all of it for one that takes positions, unless given",
        ),
        "acceleration_limit_deg_s2": Value(
            of.accelerations_deg_s2, "mount.*.command_acceleration_deg_s2", "0.4 of the drive's acceleration, unless given"
        ),
    }  # fmt: skip


def fixed_elevation(of: Band) -> Rows:
    """Elevation of an antenna that turns in azimuth alone; nothing where both axes turn."""
    given = of.content.mount.fixed_elevation_deg
    return {} if given is None else {"fixed_elevation_deg": Value((given,), "mount.fixed_elevation_deg")}


def preprocessor(of: Band) -> Rows:
    """Limits of every command in the control unit."""
    rows = dict(commanded(of))
    # The control unit stops what the controller would not command, a little outside of it.
    for end, sign, name in ((0, -1.0, "min"), (1, 1.0, "max")):
        travel = [axis.travel_deg[end] for axis in of.axes]
        margin = [min(0.1, 0.5 * abs(stop[end] - angle)) for stop, angle in zip(of.stops_deg, travel, strict=True)]
        ends = tuple(rounded(angle + sign * each, 9) for angle, each in zip(travel, margin, strict=True))
        rows[f"travel_{name}_deg"] = tuned(ends, "0.1 deg outside the travel, at most half way to the stop")
    return rows


def rest(of: Band) -> Rows:
    """Park and stow position, and who may command."""
    mount, elevation = of.content.mount, of.axes[1].travel_deg
    park = mount.park_deg or at_rest_deg(of)
    stow = (
        nearest_within(zenith_deg(of)[1], elevation) if mount.stow_elevation_deg is None else mount.stow_elevation_deg
    )
    return {
        "park_azimuth_deg": Value(park[0], "mount.park_deg"),
        "park_elevation_deg": Value(park[1], "mount.park_deg"),
        "stow_elevation_deg": Value(stow, "mount.stow_elevation_deg"),
        "unsigned_commands": Value(of.content.mount.unsigned_commands, "mount.unsigned_commands"),
    }


def at_rest_deg(of: Band) -> Pair:
    """Return where the axes rest unless the description says it: not far from the zenith."""
    first, second = (0.0, 45.0) if kinematics_of(of.content).level else zenith_deg(of)
    azimuth, elevation = (axis.travel_deg for axis in of.axes)
    return nearest_within(first, azimuth), nearest_within(second, elevation)


def drive(of: Band) -> dict[str, Value]:
    """The drive; one that takes positions moves as the mount says, unless its section says more."""
    from rf_pointing.drives.params import DriveParams

    low, high = zip(*of.stops_deg, strict=True)
    steps = tuple(axis.resolution_deg or 0.0 for axis in of.axes)
    of_mount: dict[str, tuple[Any, str, str]] = {
        "rate_deg_s": (tuple(axis.rate_deg_s for axis in of.axes), "rate_deg_s", "the mount's"),
        "resolution_deg": (steps, "resolution_deg", "the mount's; 0: the protocol's"),
        "travel_min_deg": (low, AXIS_KEYS["travel_min_deg"], "the mount's stops"),
        "travel_max_deg": (high, AXIS_KEYS["travel_max_deg"], "the mount's stops"),
    }
    return (
        {name: Value(value, f"drive.{name}") for name, (_, value) in leaves(DriveParams()).items()}
        | {
            f"rotator.{name}": Value(value, f"mount.*.{key}", formula)
            for name, (value, key, formula) in of_mount.items()
        }
        | {name: Value(value, f"drive.{name}") for name, value in flat(of.content.drive).items()}
    )


def site(of: Band) -> Rows:
    """Where the antenna stands."""
    given = of.content.site
    if isinstance(given, str):
        place = {name: value for name, (_, value) in leaves(site_of(of.content)).items()}
    else:
        place = {"latitude_deg": given.latitude_deg, "longitude_deg": given.longitude_deg, "altitude_m": given.height_m}
    return {name: Value(place[name], f"site.{name.replace('altitude', 'height')}") for name in place}


def sun(of: Band) -> Rows:
    """The Sun that the beam does not look into."""
    return {"site": site(of), "watched": Value(of.content.sun.radius_deg > 0.0, "sun.radius_deg")}


def sun_at_rest(of: Band) -> Rows:
    """The Sun that comes to an antenna at rest."""
    names = ("escapes", "warning_s", "clear_s")
    return {name: Value(getattr(of.content.sun, name), f"sun.{name}") for name in names}


def mask(of: Band, *, deck: bool = False) -> Rows:
    """The horizon; on a base that moves it is that of the deck, and the sky has a free one."""
    key = "mount.horizon_file" if of.content.mount.horizon_file else "mount.horizon_deg"
    keys = {"clearance_deg": "mount.horizon_clearance_deg"}
    seen = of.mask
    if of.content.base is not None and not deck:
        seen = HorizonMask(clearance_rad=seen.clearance_rad)
    return {name: Value(value, keys.get(name, key)) for name, (_, value) in leaves(seen).items()}


def base(of: Band) -> Rows:
    """The base of the antenna."""
    given = of.content.base or BaseSection()
    rows = {name: Value(getattr(given, name), f"base.{name}") for name in ("coast_s", "imu_deg")}
    return rows | {"moves": Value(of.content.base is not None, "base")}


def gate(of: Band) -> Rows:
    """Margins of the safety gate."""
    return {
        "sun_radius_deg": sun_radius(of),
        "transmit_elevation_deg": Value(of.content.mount.transmit_elevation_deg, "mount.transmit_elevation_deg"),
        "hard_deg": tuned(min(max(0.25, 3.0 * of.step_deg), 28.0), "0.25 deg, at least three encoder steps"),
    }


def sun_radius(of: Band) -> Value:
    """The zone of the sky around the Sun."""
    return Value(of.content.sun.radius_deg, "sun.radius_deg")


def wind_limits(of: Band) -> Rows:
    """Wind from which the antenna is stowed."""
    keys = {"watched": "anemometer", "stows": "stow"}
    keys |= {name: name for name in ("gust_limit_m_s", "mean_limit_m_s")}
    return {name: Value(getattr(of.content.wind, key), f"wind.{key}") for name, key in keys.items()}


def lag_averaging(of: Band) -> Value:
    """Time in which the lags of the mount build up."""
    return Value(of.content.simulation.lag_averaging_s, "simulation.lag_averaging_s")


def mount_errors(of: Band) -> dict[str, Value]:
    """True errors of the simulated mount in a band, with those by which its feed is off."""
    sections = (("simulation", of.content.simulation), (f"bands.{of.name}", of.section))
    rows = {
        name: Value(value, f"{key}.mount_errors.{name}")
        for key, section in sections
        for name, value in flat(section.mount_errors).items()
    }
    for term, degrees in _feed_terms(of.content, of.name).items():
        name, own = f"{term}_deg", rows.get(f"{term}_deg")
        rows[name] = Value(degrees + (own.value if own else 0.0), "bands.*.feed_offset")
    return rows


def feed_model(content: Content, band: str) -> "BiasModel":
    """Return the model of a perfect mount with the feed of a band, before one is fitted."""
    # Imported here: most nodes need no model.
    from rf_pointing.calibration import BiasModel

    zero = BiasModel.zero(kinematics_of(content))
    # x3 and x10, by the names of the mount's axes.
    names = [list(zero.coefficients)[number - 1] for number in (3, 10)]
    values = map(math.radians, _feed_terms(content, band).values())
    return zero.replace(**dict(zip(names, values, strict=False)))


def _feed_terms(content: Content, band: str) -> dict[str, float]:
    """Return the terms of a bias model, in deg, that put the beam of a feed on a target."""
    # The beam (cos c cos e, sin c, cos c sin e) off axes that look ahead: exact, as the terms.
    feed = content.bands[band].feed_offset
    if feed is None:
        return {}
    return {"collimation": -feed.cross_elevation_deg, "elevation_offset": -feed.elevation_deg}
