"""The numbers of one band that everything else is derived from, and the form of what is derived.

    beamwidth  h = 66 deg * wavelength / diameter     (aperture tapered to about -12 dB at the rim)

Angles are in degrees, as in the description and in the formulas that a user reads; the parameter
sets that come out (`Derived.set_of`) are in radians.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from rf_pointing.core import AZIMUTH_ELEVATION, Pair, Rows, Value, rounded
from rf_pointing.core.parameters import Params, flat, leaves, with_leaves
from rf_pointing.planning.horizon import HorizonMask
from rf_pointing.station.description.content import AxisSection, BandSection, Content

if TYPE_CHECKING:
    from rf_pointing.ephemeris import Site

SPEED_OF_LIGHT_M_S = 299_792_458.0
BEAM_FACTOR_DEG = 66.0
"""h D / wavelength: 62 to 69 deg over the three bands of DSS-13, 58 deg for a uniform aperture."""
TICK_S = 0.02  # period of the servo
REFERENCE_M = 34.0
"""Diameter of the antenna that was measured."""
STIFF_BELOW_M, STIFF_DRIVE_RAD_S, STIFF_BACKLASH_DEG = 10.0, 25.0, 0.01
"""Diameter below which a mount is stiff; bandwidth of its rate loop, play of its gears."""

AXIS_KEYS = {
    "rate_limit_deg_s": "rate_deg_s", "acceleration_limit_deg_s2": "acceleration_deg_s2",
    "travel_min_deg": "hard_stop_deg", "travel_max_deg": "hard_stop_deg", "encoder_bits": "encoder_bits",
    "backlash_deg": "backlash_deg",
}  # fmt: skip
"""Parameters of an axis that the mount gives, and their keys."""


@dataclass(frozen=True)
class Derived:
    """The parameter sets of one node, by their prefix, and where their numbers come from.

    `own` are the beginnings of the names that a parameter file gives where the description says
    nothing, `either` those that `tuning` may give as well, `root` the node's own sets without a
    prefix by the names of their groups, `given` what `tuning` puts over the rows.
    """

    defaults: Mapping[str, Params]
    rows: Rows = field(default_factory=dict)
    own: tuple[str, ...] = ()
    root: Mapping[str, Params] = field(default_factory=dict)
    either: tuple[str, ...] = ()
    given: Mapping[str, Value] = field(default_factory=dict)

    @cached_property
    def values(self) -> dict[str, Value]:
        """Given and derived parameters by their dotted edge names."""
        return dict(_flattened(self.rows)) | {name: self.given[name] for name in self.given if name in self.names}

    @cached_property
    def names(self) -> dict[str, Any]:
        """The defaults of the parameters that have a prefix, by dotted edge name."""
        sets = self.defaults.items()
        return {f"{prefix}.{edge}": value for prefix, params in sets for edge, (_, value) in leaves(params).items()}

    @property
    def every_name(self) -> set[str]:
        """The names of all parameters of the node."""
        return {*self.names, *(name for params in self.root.values() for name in leaves(params))}

    def set_of(self, prefix: str) -> Params:
        """Return one set in core units; ValueError names the parameter that is refused."""
        start = f"{prefix}."
        values = {name.removeprefix(start): each.value for name, each in self.values.items() if name.startswith(start)}
        try:
            return with_leaves(self.defaults[prefix], values)
        except ValueError as error:
            raise ValueError(f"{start}{error}") from error

    def owner(self, name: str) -> str:
        """Return the key that gives a parameter; "" for one that is the node's own."""
        value = self.values.get(name)
        # What only the simulation knows is the node's own where a trial may change it.
        if value is not None and not (value.key.startswith("simulation.") and name.startswith(self.own)):
            return value.key
        return "" if name not in self.names or name.startswith((*self.own, *self.either)) else f"tuning.{name}"


def _flattened(rows: Rows, prefix: str = "") -> Iterator[tuple[str, Value]]:
    for name, row in rows.items():
        if isinstance(row, Value):
            yield prefix + name, row if row.key else Value(row.value, f"tuning.{prefix}{name}", row.formula)
        else:
            yield from _flattened(row, f"{prefix}{name}.")


@dataclass(frozen=True)
class Band:
    """One band of a description; `model_file` is that of its bias model, "" for no correction."""

    content: Content
    name: str
    mask: HorizonMask = field(default_factory=HorizonMask)
    model_file: str = ""

    @property
    def section(self) -> BandSection:
        """The section of the band."""
        return self.content.bands[self.name]

    @property
    def axes(self) -> tuple[AxisSection, AxisSection]:
        """Lower and upper axis: azimuth and elevation."""
        return self.content.mount.pair

    @property
    def wavelength_m(self) -> float:
        """Wavelength of the carrier."""
        return SPEED_OF_LIGHT_M_S / (1e6 * self.section.frequency_mhz)

    @cached_property
    def beamwidth_deg(self) -> float:
        """Full width of the beam at half power."""
        given, dish = self.section.half_power_beamwidth_deg, self.content.dish
        if given is not None:
            return given
        return rounded(BEAM_FACTOR_DEG * self.wavelength_m / dish.diameter_m if dish else 1.0)

    @property
    def width(self) -> Value:
        """The beamwidth as the parameter of every set that needs it."""
        formula = f"{BEAM_FACTOR_DEG:g} deg * wavelength / diameter, unless given"
        return Value(self.beamwidth_deg, "bands.*.half_power_beamwidth_deg", formula)

    @property
    def positions(self) -> bool:
        """Whether the drive takes positions."""
        # Imported here, as below: a node without a drive does without them.
        from rf_pointing.drives.registry import takes_positions

        return takes_positions(str(self.content.drive.get("type")))

    @cached_property
    def rates_deg_s(self) -> Pair:
        """Largest commanded rates."""
        # One that takes positions moves at its own rate: at a lower one it would stop and start.
        share = 1.0 if self.positions else 0.9
        azimuth, elevation = (axis.command_rate_deg_s or rounded(share * axis.rate_deg_s) for axis in self.axes)
        return azimuth, elevation

    @cached_property
    def accelerations_deg_s2(self) -> Pair:
        """Largest commanded accelerations."""
        azimuth, elevation = (
            axis.command_acceleration_deg_s2 or rounded(0.4 * drive_acceleration_deg_s2(axis)) for axis in self.axes
        )
        return azimuth, elevation

    @property
    def power_period_s(self) -> float:
        """Time between two carrier powers."""
        return self.content.receiver.power_period_s

    @property
    def delay_s(self) -> float:
        """Time from the beam's direction to the power that it gives."""
        return self.content.receiver.delay_s

    @property
    def step_deg(self) -> float:
        """The coarser encoder step of both axes."""
        return max(
            360.0 / 2.0 ** encoder_bits(axis) if axis.resolution_deg is None else axis.resolution_deg
            for axis in self.axes
        )

    @property
    def stops_deg(self) -> tuple[Pair, Pair]:
        """Mechanical stops of both axes."""
        azimuth, elevation = (
            axis.hard_stop_deg or (axis.travel_deg[0] - margin, axis.travel_deg[1] + margin)
            for axis, margin in zip(self.axes, (5.0, 2.0), strict=True)
        )
        return azimuth, elevation

    @property
    def dead_band_deg(self) -> float:
        """How far from its set point a rotator may rest: its dead band or smallest move."""
        if not self.positions:
            return 0.0
        given = flat(self.content.drive)
        return float(max(max(given.get(f"rotator.{name}_deg", (0.0,))) for name in ("dead_band", "minimum_move")))

    @property
    def wind_diameter_m(self) -> float:
        """Diameter of the disc that the wind meets."""
        return self.content.dish.diameter_m if self.content.dish else 1.0

    @property
    def structure(self) -> str:
        """The kind of plant: as given, or by the diameter."""
        return self.content.simulation.structure or ("stiff" if self.wind_diameter_m < STIFF_BELOW_M else "flexible")


def site_of(content: Content) -> "Site":
    """Return the site of a description: a built-in one by name, or coordinates."""
    from rf_pointing.ephemeris.sites import SITES, Site

    if isinstance(content.site, str):
        return SITES[content.site]
    return Site.from_degrees(content.site.latitude_deg, content.site.longitude_deg, content.site.height_m)


def pass_elevation_deg(content: Content) -> float:
    """Return where passes begin and end on a free horizon."""
    given, mount = content.mount.pass_elevation_deg, content.mount
    # Only the lower end of an elevation axis is a height over the horizon.
    lowest = mount.pair[1].travel_deg[0] + 1.0 if mount.type == AZIMUTH_ELEVATION else 5.0
    return max(5.0, lowest) if given is None else given


def drive_acceleration_deg_s2(axis: AxisSection) -> float:
    """Return the largest acceleration of a drive."""
    return axis.acceleration_deg_s2 if axis.acceleration_deg_s2 is not None else axis.rate_deg_s


def encoder_bits(axis: AxisSection) -> int:
    """Return the bits of an encoder whose step is nearest to what is given."""
    if axis.encoder_bits is not None:
        return axis.encoder_bits
    return 20 if axis.resolution_deg is None else max(8, round(math.log2(360.0 / axis.resolution_deg)))


def nearest_within(angle: float, travel: Pair) -> float:
    """Return the angle of the travel that is nearest to `angle`."""
    return min(max(angle, travel[0]), travel[1])
