"""From a description to the parameters of every node: what is copied, what is derived and how.

Each value carries the key that gives it and, where it is derived, its formula in words.  The
formulas reproduce what was measured on the 34-m antenna (`stations/dss13.yaml` overrides what they
do not meet there) and scale with beam, encoder step, rates and mass.

    beamwidth  h = 66 deg * wavelength / diameter     (aperture tapered to about -12 dB at the rim)
    scan       r = 0.0912 h                           (0.1 dB of loss, CONSCAN eq. 1)
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from rf_pointing.core import MDEG, Params, Sensor, leaves
from rf_pointing.drives import DriveParams, takes_positions
from rf_pointing.ephemeris import SITES, Site
from rf_pointing.ephemeris.source import SourceParams
from rf_pointing.operations import AlarmParams, BetweenParams
from rf_pointing.planning import HorizonMask
from rf_pointing.rf.dish_array import DishArrayParams, least_level_db_hz
from rf_pointing.station.antenna.receiver import SignalParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from rf_pointing.station.description.content import (
    VERSION,
    ArraySection,
    AxisSection,
    BandSection,
    Content,
    DishSection,
    MountSection,
    Pair,
    SiteSection,
)
from rf_pointing.station.description.plants import (
    REFERENCE_M,
    STIFF_BACKLASH_DEG,
    STIFF_BELOW_M,
    STIFF_DRIVE_RAD_S,
    MountAxis,
    plant_of,
    position_loops,
)
from rf_pointing.station.description.reading import flat, nearest
from rf_pointing.station.pointing.antenna_watch import AntennaWatchParams
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.tracking import MonopulseParams, MonopulseScanParams, power_tracker
from rf_pointing.tracking.power_tracker import PowerTrackerParams

SPEED_OF_LIGHT_M_S = 299_792_458.0
BEAM_FACTOR_DEG = 66.0
"""h D / wavelength: 62 to 69 deg over the three bands of DSS-13, 58 deg for a uniform aperture."""
GUST_POWER = 2.5
"""Of the beam's motion that the encoders miss: 0.06 mdeg in 1 s at 34 m, 0.36 mdeg at 70 m."""
# As the parameters of the watch hold them, to the last bit.
GUSTS_DEG = tuple(math.degrees(each * MDEG) for each in (0.1, 0.2, 0.4, 0.8))
VIBRATION_DEG = (0.0, math.degrees(0.2 * MDEG), 6e-4)
AXES = ("azimuth", "elevation")
OF_RECEIVER = "rf_receiver:"
"""Before a name that means something else in another node."""

NODES: dict[str, dict[str, Params]] = {
    "antenna_servo": AntennaParams().sets(),
    "pointing_controller": ControllerParams().sets(),
    "ephemeris_publisher": {"source": SourceParams(), "mask": HorizonMask()},
    "rf_receiver": {"source": SourceParams(), "signal": SignalParams()},
    "monopulse_tracker": {Sensor.MONOPULSE: MonopulseParams(), "calibration": MonopulseScanParams()},
    power_tracker.NODE: PowerTrackerParams().sets(),
    "array_receiver": {"array": DishArrayParams()},
    "array_tracker": {"array": DishArrayParams()},
    "station_executive": {"between": BetweenParams(), "alarms": AlarmParams()},
}
"""Parameter sets of each node that a description covers, by their prefix."""
# Their parameter sets are declared with the nodes.
_FURTHER = {
    "ephemeris_publisher": ("publisher.mask_deg",),
    "bias_calibrator": (
        "calibrator.station",
        "calibrator.band",
        "calibrator.model_file",
        "calibrator.largest_error_deg",
    ),
}
_OWN = {
    "array_receiver": "receiver.seed",
    "array_tracker": "",
    "antenna_servo": "wrap_file state_file enable_fault_injection command_key_file",
    "bias_calibrator": "calibrator.folder calibrator.keep_observations calibrator.spacing_s calibrator.scan_spacing_s "
    "calibrator.sigma_deg calibrator.settle_s shadow.fewest_passes shadow.t_limit shadow.accept orbit.along_track_m "
    "orbit.cross_track_m orbit.radial_m orbit.along_track_drift_m_s orbit.cross_track_drift_m_s "
    "orbit.radial_drift_m_s orbit.clock_s",
    "conscan_tracker": "",
    "ephemeris_publisher": "publisher.period_s publisher.lead_s publisher.margin_s publisher.span_s "
    "publisher.state_file uncertainty.along_m uncertainty.along_growth_m_s uncertainty.along_drag_m_s2 "
    "uncertainty.cross_m uncertainty.cross_growth_m_s uncertainty.radial_m uncertainty.radial_growth_m_s",
    "monopulse_tracker": "calibration_file",
    "operator_page": "page.address page.port page.hosts page.token_file page.reports page.rate_hz page.viewers "
    "command_key_file",
    "pointing_controller": "certificate_folder command_key_file",
    "rf_receiver": "",
    "rotctld_server": "identify sensor command_key_file server.host server.port server.most_clients server.idle_s "
    "server.patience_s follow.window_s follow.interval_s follow.coast_s follow.jump_deg "
    "follow.blend_s follow.clear_deg match.points match.tolerance_deg match.motion_deg "
    "match.threshold_deg match.lead_s match.silence_s",
    "simulation_clock": "start_s speed tick_s",
    "station_description": "view.publish_tf view.radius_m view.period_s",
    "station_executive": "executive.state_file executive.folder executive.directives_file executive.procedure_file "
    "executive.recovery_file executive.sensor executive.record executive.partners hooks.command hooks.webhook "
    "hooks.mail_server hooks.mail_from hooks.mail_to hooks.retry_s command_key_file",
}
"""Parameters of each node that no description gives; without ROS no node can name its own."""
OF_EVERY_NODE = (
    "lifecycle.autostart", "lifecycle.realtime_priority", "station", "band", "use_sim_time",
    "start_type_description_service",
)  # fmt: skip
TRIAL = (
    "antenna.", "wind.mean_speed_m_s", "wind.from_azimuth_deg", "mount.", "pointing.period_s", "pointing.transport_s",
    "pointing.horizon_s", "pointing.error_age_s", "autotrack.sensor", "signal.dropouts", "signal.spin.",
    "signal.interference.", "signal.sign_flip_after_s", "signal.seed", "source.",
)  # fmt: skip
"""What remains a ROS parameter: the timing of a node, the target, and the truth of a trial."""


@cache
def defaults_of(node: str) -> dict[str, Any]:
    """Return the defaults of a node's sets by parameter name, where a description says nothing."""
    sets = NODES.get(node, {})
    return {f"{prefix}.{edge}": value for prefix, params in sets.items() for edge, (_, value) in leaves(params).items()}


@cache
def names_of(node: str) -> frozenset[str]:
    """Return the parameters of a node that a description covers."""
    return frozenset({*defaults_of(node), *_FURTHER.get(node, ())})


def require_known(node: str, names: Iterable[str]) -> None:
    """Raise ValueError for a node, or a parameter of it, that does not exist; "**" is any node."""
    if node not in (*_OWN, "**"):
        raise ValueError(f"{node} is no node of a station{nearest(node, _OWN)}")
    known = {name for each in (_OWN if node == "**" else [node]) for name in (*names_of(each), *_OWN[each].split())}
    known.update(OF_EVERY_NODE)
    for name in names:
        if name not in known and not name.startswith("qos_overrides."):
            raise ValueError(f"{node}: no such parameter {name}{nearest(name, known)}")


@cache
def described_parameters() -> dict[str, tuple[str, ...]]:
    """Return the nodes that have a parameter, by its name."""
    found: dict[str, tuple[str, ...]] = {}
    for node in (*NODES, "bias_calibrator"):
        for name in names_of(node):
            found[name] = (*found.get(name, ()), node)
    return found


@cache
def owner_of_name(name: str) -> str:
    """Return the key that gives a parameter; "" for one that is the node's own."""
    given = _reference().get(name)
    # What the station gives directly belongs to it, also below a prefix of trials.
    if given is not None and not given.key.startswith(("tuning.", "simulation.")):
        return given.key
    if name.startswith(TRIAL) or name not in described_parameters():
        return ""
    return given.key if given is not None and given.key.startswith("simulation.") else f"tuning.{name}"


@cache
def _reference() -> dict[str, "Value"]:
    """Return the values of a small description with everything that one may have."""
    axis = AxisSection(travel_deg=(0.0, 90.0), rate_deg_s=1.0)
    bands = {"X": BandSection(frequency_mhz=8450.0)}
    mount = MountSection(azimuth=axis, elevation=axis)
    site = SiteSection(latitude_deg=0.0, longitude_deg=0.0)
    content = Content(
        version=VERSION, name="", site=site, mount=mount, dish=DishSection(diameter_m=5.0), array=ArraySection(), bands=bands
    )  # fmt: skip
    return derive(content, "X", HorizonMask(), "")


@dataclass(frozen=True, slots=True)
class Value:
    """One parameter: its value in edge units, the key that gives it, and how it is derived."""

    value: Any
    key: str
    formula: str = ""


class Band:
    """The numbers of a description that everything else follows from, for one band."""

    def __init__(self, content: Content, name: str) -> None:
        self.content, self.name = content, name
        self.section: BandSection = content.bands[name]
        self.key = f"bands.{name}"
        self.axes: tuple[AxisSection, AxisSection] = (content.mount.azimuth, content.mount.elevation)
        section = self.section
        self.wavelength_m = SPEED_OF_LIGHT_M_S / (1e6 * section.frequency_mhz)
        self.diameter_m = content.dish.diameter_m if content.dish else 0.0
        given = section.half_power_beamwidth_deg
        self.beamwidth_deg = given if given is not None else rounded(self.aperture_beamwidth_deg or 1.0)

    @property
    def aperture_beamwidth_deg(self) -> float | None:
        """The beamwidth of the dish in this band, None without a dish."""
        return BEAM_FACTOR_DEG * self.wavelength_m / self.diameter_m if self.diameter_m else None

    @property
    def rates_deg_s(self) -> Pair:
        """Largest commanded rates."""
        # One that takes positions moves at its own rate: at a lower one it would stop and start.
        share = 1.0 if takes_positions(str(self.content.drive.get("type"))) else 0.9
        rates = [axis.command_rate_deg_s or rounded(share * axis.rate_deg_s) for axis in self.axes]
        return rates[0], rates[1]

    @property
    def accelerations_deg_s2(self) -> Pair:
        """Largest commanded accelerations."""
        found = [
            axis.command_acceleration_deg_s2 or rounded(0.4 * drive_acceleration_deg_s2(axis)) for axis in self.axes
        ]
        return found[0], found[1]

    @property
    def step_deg(self) -> float:
        """The coarser encoder step of both axes."""
        return max(encoder_step_deg(axis) for axis in self.axes)

    @property
    def dead_band_deg(self) -> float:
        """How far from its set point a rotator may rest: its dead band or smallest move."""
        if not takes_positions(str(self.content.drive.get("type"))):
            return 0.0
        given = flat(self.content.drive)
        rests = [given.get(f"rotator.{name}_deg", (0.0,)) for name in ("dead_band", "minimum_move")]
        return float(max(map(max, rests)))

    @property
    def site(self) -> Site:
        """The site."""
        return site_of(self.content)


def site_of(content: Content) -> Site:
    """Return the site of a description: a built-in one by name, or coordinates."""
    if isinstance(content.site, str):
        return SITES[content.site]
    return Site.from_degrees(content.site.latitude_deg, content.site.longitude_deg, content.site.height_m)


def rounded(value: float, digits: int = 6) -> float:
    """Return `value` with so many significant digits: a derived number is read by people."""
    return float(f"{value:.{digits}g}")


def drive_acceleration_deg_s2(axis: AxisSection) -> float:
    """Return the largest acceleration of a drive."""
    return axis.acceleration_deg_s2 if axis.acceleration_deg_s2 is not None else axis.rate_deg_s


def encoder_bits(axis: AxisSection) -> int:
    """Return the bits of an encoder whose step is nearest to what is given."""
    if axis.encoder_bits is not None:
        return axis.encoder_bits
    return 20 if axis.resolution_deg is None else max(8, round(math.log2(360.0 / axis.resolution_deg)))


def encoder_step_deg(axis: AxisSection) -> float:
    """Return the smallest step that an axis shows."""
    return axis.resolution_deg if axis.resolution_deg is not None else 360.0 / 2.0 ** encoder_bits(axis)


def nearest_within(angle: float, travel: Pair) -> float:
    """Return the angle of the travel that is nearest to `angle`."""
    return min(max(angle, travel[0]), travel[1])


def derive(content: Content, band: str, mask: HorizonMask, model_file: str) -> dict[str, Value]:
    """Return every parameter that the description gives or derives, by its dotted name.

    The same name means the same in every node that has it.
    """
    of = Band(content, band)
    found: dict[str, Value] = {}
    for part in (
        _site,
        _axes,
        _zones,
        _beam,
        _scans,
        _search,
        _loop,
        _signal,
        _truth,
        _plant,
        _watches,
        _drive,
        _array,
    ):
        found |= part(of)
    for prefix in ("mask", "safety.mask"):
        key = "mount.horizon_file" if content.mount.horizon_file else "mount.horizon_deg"
        for name, (_, value) in leaves(mask).items():
            found[f"{prefix}.{name}"] = Value(value, "mount.horizon_clearance_deg" if name == "clearance_deg" else key)
    found["calibrator.station"] = Value(content.name, "name")
    found["calibrator.band"] = Value(band, "bands")
    found["calibrator.model_file"] = Value(model_file, "bands.*.bias_model")
    return found


def _site(of: Band) -> dict[str, Value]:
    if isinstance(of.content.site, str):
        place = {name: value for name, (_, value) in leaves(of.site).items()}
    else:
        site = of.content.site
        place = {"latitude_deg": site.latitude_deg, "longitude_deg": site.longitude_deg, "altitude_m": site.height_m}
    keys = {"latitude_deg": "site.latitude_deg", "longitude_deg": "site.longitude_deg", "altitude_m": "site.height_m"}
    return {
        f"{prefix}.site.{name}": Value(value, keys[name])
        for prefix in ("source", "sun", "safety.sun")
        for name, value in place.items()
    }


def _axes(of: Band) -> dict[str, Value]:
    """Travel, rates and rest of the mount."""
    azimuth, elevation = of.axes
    mount = of.content.mount
    found: dict[str, Value] = {}
    for name, axis in zip(AXES, of.axes, strict=True):
        for side, angle in zip(("min", "max"), axis.travel_deg, strict=True):
            found[f"limits.{name}_{side}_deg"] = Value(angle, f"mount.{name}.travel_deg")
    rate, acceleration = "mount.*.command_rate_deg_s", "mount.*.command_acceleration_deg_s2"
    for prefix in ("machine", "loops.preprocessor"):
        found[f"{prefix}.rate_limit_deg_s"] = Value(
            of.rates_deg_s, rate, "0.9 of the drive's rate, all of it for one that takes positions, unless given"
        )
        found[f"{prefix}.acceleration_limit_deg_s2"] = Value(
            of.accelerations_deg_s2, acceleration, "0.4 of the drive's acceleration, unless given"
        )
    # The control unit stops what the controller would not command, a little outside of it.
    stops = [hard_stop_deg(of, index) for index in (0, 1)]
    for end, sign, name in ((0, -1.0, "min"), (1, 1.0, "max")):
        travel = [each.travel_deg[end] for each in of.axes]
        margin = [min(0.1, 0.5 * abs(stop[end] - angle)) for stop, angle in zip(stops, travel, strict=True)]
        full = f"loops.preprocessor.travel_{name}_deg"
        ends = tuple(rounded(angle + sign * each, 9) for angle, each in zip(travel, margin, strict=True))
        found[full] = _tuned(full, ends, "0.1 deg outside the travel, at most half way to the stop")
    park = mount.park_deg or (nearest_within(0.0, azimuth.travel_deg), nearest_within(45.0, elevation.travel_deg))
    stow = mount.stow_elevation_deg
    stow = nearest_within(90.0, elevation.travel_deg) if stow is None else stow
    found["safety.park_azimuth_deg"] = Value(park[0], "mount.park_deg")
    found["safety.park_elevation_deg"] = Value(park[1], "mount.park_deg")
    found["safety.stow_elevation_deg"] = Value(stow, "mount.stow_elevation_deg")
    found["publisher.mask_deg"] = Value(pass_elevation_deg(of.content), "mount.pass_elevation_deg")
    found["pointing.stop_deceleration_deg_s2"] = Value(
        rounded(0.625 * min(of.accelerations_deg_s2)), "tuning.pointing.stop_deceleration_deg_s2",
        "0.625 of the smaller commanded acceleration",
    )  # fmt: skip
    return found


def pass_elevation_deg(content: Content) -> float:
    """Return where passes begin and end on a free horizon."""
    given = content.mount.pass_elevation_deg
    return max(5.0, content.mount.elevation.travel_deg[0] + 1.0) if given is None else given


def hard_stop_deg(of: Band, axis: int) -> Pair:
    """Return the mechanical stops of an axis."""
    section = of.axes[axis]
    if section.hard_stop_deg is not None:
        return section.hard_stop_deg
    margin = (5.0, 2.0)[axis]
    return section.travel_deg[0] - margin, section.travel_deg[1] + margin


def _drive(of: Band) -> dict[str, Value]:
    """The drive; one that takes positions moves as the mount says, unless its section says more."""
    found = {f"drive.{name}": Value(value, f"drive.{name}") for name, (_, value) in leaves(DriveParams()).items()}
    stops = [hard_stop_deg(of, axis) for axis in (0, 1)]
    low, high = zip(*stops, strict=True)
    steps = tuple(axis.resolution_deg or 0.0 for axis in of.axes)
    for name, value, key, formula in (
        ("rate_deg_s", tuple(axis.rate_deg_s for axis in of.axes), "mount.*.rate_deg_s", "the mount's"),
        ("resolution_deg", steps, "mount.*.resolution_deg", "the mount's; 0: the protocol's"),
        ("travel_min_deg", low, "mount.*.hard_stop_deg", "the mount's stops"),
        ("travel_max_deg", high, "mount.*.hard_stop_deg", "the mount's stops"),
    ):
        found[f"drive.rotator.{name}"] = Value(value, key, formula)
    return found | {f"drive.{name}": Value(value, f"drive.{name}") for name, value in flat(of.content.drive).items()}


def _zones(of: Band) -> dict[str, Value]:
    content = of.content
    radius = Value(content.sun.radius_deg, "sun.radius_deg")
    found = dict.fromkeys(("machine.sun_radius_deg", "gate.sun_radius_deg", "safety.gate.sun_radius_deg"), radius)
    for prefix in ("", "safety."):
        found[f"{prefix}sun.watched"] = Value(content.sun.radius_deg > 0.0, "sun.radius_deg")
        found[f"{prefix}gate.transmit_elevation_deg"] = Value(
            content.mount.transmit_elevation_deg, "mount.transmit_elevation_deg"
        )
    found["safety.wind.watched"] = Value(content.wind.anemometer, "wind.anemometer")
    found["safety.wind.stows"] = Value(content.wind.stow, "wind.stow")
    found["safety.wind.gust_limit_m_s"] = Value(content.wind.gust_limit_m_s, "wind.gust_limit_m_s")
    found["safety.wind.mean_limit_m_s"] = Value(content.wind.mean_limit_m_s, "wind.mean_limit_m_s")
    return found


_BEAMWIDTHS = (
    Sensor.MONOPULSE, Sensor.CONSCAN, Sensor.STEPTRACK, "calibration", "watch", "spiral", "machine", "signal.beam",
)  # fmt: skip


def _beam(of: Band) -> dict[str, Value]:
    formula = f"{BEAM_FACTOR_DEG:g} deg * wavelength / diameter, unless given"
    width = Value(of.beamwidth_deg, "bands.*.half_power_beamwidth_deg", formula)
    found = {f"{prefix}.half_power_beamwidth_deg": width for prefix in _BEAMWIDTHS}
    h = of.beamwidth_deg
    found["pointing.on_target_deg"] = _tuned(
        "pointing.on_target_deg", min(max(0.05, 0.1 * h, 2.5 * of.step_deg, rounded(1.1 * of.dead_band_deg)), 5.0),
        "0.1 h, at least 0.05 deg, 2.5 encoder steps, and 1.1 times the dead band or smallest move of a rotator",
    )  # fmt: skip
    found["calibrator.largest_error_deg"] = _tuned(
        "calibrator.largest_error_deg", rounded(0.1 * h, 1) if h < 0.05 else rounded(0.1 * h, 2), "0.1 h"
    )
    return found


def _tuned(name: str, value: Any, formula: str) -> Value:
    return Value(value, f"tuning.{name}", formula)


def _rows(rows: Mapping[str, tuple[Any, str]]) -> dict[str, Value]:
    return {name: _tuned(name, value, formula) for name, (value, formula) in rows.items()}


def _scans(of: Band) -> dict[str, Value]:
    """Conical scan and step-track."""
    h, sample_s = of.beamwidth_deg, of.content.receiver.power_period_s
    rate, acceleration = min(of.rates_deg_s), min(of.accelerations_deg_s2)
    radius = rounded(0.0912 * h, 3)
    fastest = max(
        2.0 * math.pi * radius / (0.25 * rate),
        2.0 * math.pi * math.sqrt(radius / (0.3 * acceleration)),
        12.0 * sample_s,
    )
    period_s = math.ceil(max(4.0, fastest) / sample_s - 1e-9) * sample_s
    turn = round(period_s / sample_s)
    across = math.sqrt(2.0) * 0.08 * h
    move_s = max(0.6, 1.875 * across / (0.5 * rate), math.sqrt(5.7735 * across / acceleration))
    unmodelled = max(0.001, of.step_deg / math.sqrt(12.0))
    found = _rows({
        "conscan.radius_deg": (radius, "0.0912 h: 0.1 dB of loss"),
        "conscan.period_s": (period_s, "4 s, longer where a quarter of the rate or 0.3 of the acceleration is reached"),
        "conscan.ramp_s": (0.5 * period_s, "half a turn"),
        "conscan.window_samples": (2 * turn, "two turns"),
        "conscan.fewest_samples": (turn, "one turn"),
        "conscan.updates": ("sample", "a sliding window"),
        "conscan.drift": (True, "the carrier changes along a pass"),
        "conscan.unmodelled_deg": (unmodelled, "0.001 deg, at least the rms of an encoder step"),
        "conscan.misfit_limit": (20.0, "wind and fading are no noise of the receiver"),
        "conscan.bandwidth_hz": (0.4 / period_s, "0.4 / period"),
        "steptrack.step_beamwidths": (0.08, "0.08 of a beamwidth: 0.08 dB"),
        "steptrack.dwell_s": (0.7 if of.content.receiver.power_period_s <= 0.1 else 7.0 * sample_s, "seven samples"),
        "steptrack.move_s": (move_s, "0.6 s, longer where half the rate or the acceleration is reached"),
        "steptrack.samples_per_point": (5, "of seven"),
        "steptrack.tolerance": (0.5, "half a step"),
    })  # fmt: skip
    found["conscan.sample_s"] = Value(sample_s, "receiver.power_period_s")
    found["conscan.delay_s"] = Value(of.content.receiver.delay_s, "receiver.delay_s")
    return found


def _search(of: Band) -> dict[str, Value]:
    h = of.beamwidth_deg
    rate, acceleration = min(of.rates_deg_s), min(of.accelerations_deg_s2)
    return _rows({
        "spiral.uncertainty_deg": (
            max(0.065, 3.0 * of.step_deg), "0.065 deg, 1 km at 900 km, at least three encoder steps"
        ),
        "spiral.rate_deg_s": (rounded(min(2.31 * h, rate / 6.0), 3), "2.31 h / s, at most a sixth of the rate"),
        "spiral.acceleration_deg_s2": (0.4375 * acceleration, "0.4375 of the commanded acceleration"),
    })  # fmt: skip


def _loop(of: Band) -> dict[str, Value]:
    """The tracking loop and what it expects."""
    section, acceleration = of.section, min(of.accelerations_deg_s2)
    found = _rows({
        "integrator.bandwidth_hz": (0.2, "a fifth of the position loop's at most"),
        "integrator.mean_of": (5, "five errors"),
        "integrator.offset_limit_deg": (min(max(0.6, 1.5 * of.beamwidth_deg), 20.0), "1.5 h, from 0.6 to 20 deg"),
        "integrator.acceleration_deg_s2": (0.25 * acceleration, "a quarter of the commanded acceleration"),
        "trim.bias_walk_deg": (0.02 * section.model_error_deg, "0.02 of model_error_deg in 1 s"),
    })  # fmt: skip
    # What the encoders do not see of the beam: gusts that bend a large dish, their own steps.
    gusts = max(1.0, (wind_diameter_m(of.content) / REFERENCE_M) ** GUST_POWER)
    vibration = max(gusts, of.step_deg / math.sqrt(12.0) / VIBRATION_DEG[1])
    found |= _rows({
        "watch.gust_deg": (
            tuple(each * gusts for each in GUSTS_DEG),
            "0.0001 to 0.0008 deg, above 34 m with the power 2.5 of the diameter",
        ),
        "watch.vibration_deg": (
            tuple(each * vibration for each in VIBRATION_DEG),
            "0 to 0.0006 deg, above 34 m as the gusts, at least the rms of an encoder step",
        ),
    })  # fmt: skip
    found["integrator.sample_s"] = Value(of.content.receiver.power_period_s, "receiver.power_period_s")
    found["trim.bias_deg"] = Value(section.model_error_deg, "bands.*.model_error_deg")
    lags = of.content.simulation.lag_averaging_s
    found["pointing.lag_averaging_s"] = Value(lags, "simulation.lag_averaging_s")
    found["antenna.lag_averaging_s"] = Value(lags, "simulation.lag_averaging_s")
    for prefix in ("link", "signal.link"):
        found[f"{prefix}.zenith_carrier_to_noise_db_hz"] = Value(
            section.zenith_carrier_to_noise_db_hz, "bands.*.zenith_carrier_to_noise_db_hz"
        )
        found[f"{prefix}.reference_range_m"] = Value(1e3 * section.reference_range_km, "bands.*.reference_range_km")
    return found


# Loss of the clear atmosphere at the zenith over frequency: those of the three bands of DSS-13
# (docs/math/link.md) and what little is left of it at VHF.
_LOSS_MHZ, _LOSS_DB = (100.0, 2300.0, 8450.0, 32000.0, 50000.0), (0.03, 0.035, 0.04, 0.14, 0.6)
COSMIC_K, AIR_K, GROUND_K = 2.725, 275.0, 8.0
TICK_S = 0.02


def _signal(of: Band) -> dict[str, Value]:
    """The simulated receiver."""
    section = of.section
    loss_db = rounded(float(np.interp(math.log(section.frequency_mhz), np.log(_LOSS_MHZ), _LOSS_DB)), 3)
    noise_k = system_noise_k(section)
    passed = 10.0 ** (-0.1 * loss_db)
    sky_k = COSMIC_K * passed + AIR_K * (1.0 - passed)
    found = _rows({
        "signal.atmosphere.zenith_loss_db": (loss_db, "by frequency, 0.03 dB at VHF to 0.14 dB at 32 GHz"),
        "signal.noise.lna_k": (max(0.0, noise_k - GROUND_K - sky_k), "what sky and ground leave of system_noise_k"),
        "signal.noise.dichroic_k": (0.0, "none"),
        "signal.cluster_samples": (max(3, round(of.content.receiver.power_period_s / TICK_S)), "samples in a power period"),
    })  # fmt: skip
    found["signal.receiver.system_noise_k"] = Value(
        noise_k, "bands.*.system_noise_k", "120 K, below 1 GHz 400 K, unless given"
    )
    return found


def system_noise_k(section: BandSection) -> float:
    """Return the system noise of a band."""
    if section.system_noise_k is not None:
        return section.system_noise_k
    return 400.0 if section.frequency_mhz < 1000.0 else 120.0


def _truth(of: Band) -> dict[str, Value]:
    """What only the simulated antenna and receiver know."""
    simulation = of.content.simulation
    start = simulation.start_deg or (
        nearest_within(0.0, of.axes[0].travel_deg), nearest_within(45.0, of.axes[1].travel_deg)
    )  # fmt: skip
    found = {
        "antenna.start_azimuth_deg": Value(start[0], "simulation.start_deg"),
        "antenna.start_elevation_deg": Value(start[1], "simulation.start_deg"),
        "wind.mean_speed_m_s": Value(simulation.wind.mean_speed_m_s, "simulation.wind.mean_speed_m_s"),
        "wind.from_azimuth_deg": Value(simulation.wind.from_azimuth_deg, "simulation.wind.from_azimuth_deg"),
        f"{OF_RECEIVER}source.along_track_offset_s": Value(
            simulation.along_track_offset_s, "simulation.along_track_offset_s"
        ),
    }
    found["wind.dish_diameter_m"] = Value(wind_diameter_m(of.content), "dish.diameter_m", "1 m without a dish")
    for key, errors in (("simulation", simulation.mount_errors), (of.key, of.section.mount_errors)):
        for name, value in flat(errors).items():
            found[f"mount.{name}"] = Value(value, f"{key}.mount_errors.{name}")
    return found


def wind_diameter_m(content: Content) -> float:
    """Return the diameter of the disc that the wind meets."""
    return content.dish.diameter_m if content.dish else 1.0


def structure_of(content: Content) -> str:
    """Return the kind of plant: as given, or by the diameter."""
    given = content.simulation.structure
    return given or ("stiff" if wind_diameter_m(content) < STIFF_BELOW_M else "flexible")


def _plant(of: Band) -> dict[str, Value]:
    """The simulated plant and the position loops."""
    content, structure = of.content, structure_of(of.content)
    diameter = wind_diameter_m(content)
    stops = [hard_stop_deg(of, axis) for axis in (0, 1)]
    azimuth, elevation = (
        MountAxis(
            rate_rad_s=math.radians(axis.rate_deg_s),
            acceleration_rad_s2=math.radians(drive_acceleration_deg_s2(axis)),
            stop_rad=(math.radians(stops[index][0]), math.radians(stops[index][1])),
            encoder_bits=encoder_bits(axis),
            backlash_rad=None if axis.backlash_deg is None else math.radians(axis.backlash_deg),
        )
        for index, axis in enumerate(of.axes)
    )
    plant = plant_of(structure, diameter, (azimuth, elevation), content.wind.mean_limit_m_s)
    loops = position_loops(structure, diameter, plant)
    keys = {
        "rate_limit_deg_s": "rate_deg_s", "acceleration_limit_deg_s2": "acceleration_deg_s2",
        "travel_min_deg": "hard_stop_deg", "travel_max_deg": "hard_stop_deg", "encoder_bits": "encoder_bits",
        "backlash_deg": "backlash_deg",
    }  # fmt: skip
    found: dict[str, Value] = {}
    for name, (_, value) in leaves(plant, "plant.").items():
        axis, last = name.split(".")[1], name.rpartition(".")[2]
        given = axis in AXES and last in keys
        key = f"mount.{axis}.{keys[last]}" if given else f"tuning.{name}"
        found[name] = Value(value, key, "" if given else f"{structure} structure of {diameter:g} m (plants.py)")
    for axis, loop in zip(AXES, loops, strict=True):
        for name, (_, value) in leaves(loop, f"loops.{axis}.").items():
            key = f"mount.{axis}.rate_deg_s" if name.endswith("rate_limit_deg_s") else f"tuning.{name}"
            found[name] = Value(value, key, f"PI loop of a {structure} structure with a gain margin of 2")
        rate = of.axes[AXES.index(axis)].rate_deg_s
        found[f"loops.lqg_{axis}.rate_limit_deg_s"] = Value(rate, f"mount.{axis}.rate_deg_s")
    return found


PATTERN_DB = 44.3
"""Gain of a dish, G = 27000 deg^2 / h^2, in dBi at a beamwidth of 1 deg."""
ARRAY_ABOVE_DB = 2.0
"""From half of the directions valid to all but 1 %, with 8 to 16 patches."""


def _array(of: Band) -> dict[str, Value]:
    """The array of patches on the dish."""
    section = of.content.array
    if section is None:
        return {}
    given = ("elements", "radius_m", "roll_deg", "axis_cross_elevation_deg", "axis_elevation_deg", "phase_sigma_deg")
    found = {f"array.{name}": Value(getattr(section, name), f"array.{name}") for name in given}
    found["array.wavelength_m"] = Value(rounded(of.wavelength_m), "bands.*.frequency_mhz", "that of the carrier")
    loss_db = rounded(PATTERN_DB - 20.0 * math.log10(of.beamwidth_deg) - section.element_gain_dbi, 4)
    found["array.element_loss_db"] = Value(loss_db, "array.element_gain_dbi", "27000 deg^2 / h^2 over a patch's gain")
    found["autotrack.array_gain_db"] = Value(
        rounded(10.0 * math.log10(section.elements) - loss_db, 4), "array.element_gain_dbi",
        "all patches together over the dish",
    )  # fmt: skip
    level_db_hz = array_level_db_hz(section, of.wavelength_m)
    if math.isfinite(level_db_hz):
        found["autotrack.array_off_db_hz"] = Value(
            rounded(level_db_hz, 3), "tuning.autotrack.array_off_db_hz", "half of the directions are valid"
        )
        found["autotrack.array_on_db_hz"] = Value(
            rounded(level_db_hz + ARRAY_ABOVE_DB, 3), "tuning.autotrack.array_on_db_hz",
            "2 dB above, where all directions are valid",
        )  # fmt: skip
    return found


def array_level_db_hz(section: ArraySection, wavelength_m: float) -> float:
    """Return the C/N0 of all patches at which half of the directions are valid, or infinity."""
    return least_level_db_hz(
        DishArrayParams(
            elements=section.elements, radius_m=section.radius_m, wavelength_m=wavelength_m,
            phase_sigma_rad=math.radians(section.phase_sigma_deg),
        )
    )  # fmt: skip


def _watches(of: Band) -> dict[str, Value]:
    """The watches over drives, encoders and loops: shares of what moves, steps and scans."""
    hardest = max(map(drive_acceleration_deg_s2, of.axes))
    fastest = max(axis.rate_deg_s for axis in of.axes)
    stiff, step = structure_of(of.content) == "stiff", of.step_deg
    play = max(axis.backlash_deg or 0.0 for axis in of.axes) or (STIFF_BACKLASH_DEG if stiff else 0.003)
    bandwidth = STIFF_DRIVE_RAD_S if stiff else 20.0 * min(1.0, REFERENCE_M / wind_diameter_m(of.content))
    swing = max(0.02, 4.0 * step, 0.6 * 0.0912 * of.beamwidth_deg)
    drive, reaction_s = _drive(of), AntennaWatchParams().reaction_s
    if takes_positions(str(of.content.drive.get("type"))):
        waits = ("rotator.minimum_interval_s", "rotator.latency_s", "link.poll_period_s", "link.poll_period_s")
        reaction_s = rounded(sum(drive[f"drive.{name}"].value for name in waits))
    return _rows({
        "safety.drive.bandwidth_hz": (bandwidth / (2.0 * math.pi), "the rate loops'"),
        "safety.drive.acceleration_limit_deg_s2": (hardest, "the faster drive's"),
        "safety.drive.rate_limit_deg_s": (fastest, "the faster drive's"),
        "safety.drive.disturbance_deg_s2": (0.75 * hardest, "0.75 of the acceleration"),
        "safety.drive.slack_deg_s2": (0.15 * hardest, "0.15 of the acceleration"),
        "safety.drive.gained_deg_s": (0.01 * hardest, "10 ms of the acceleration"),
        "safety.drive.excess_deg_s": (0.25 * fastest, "a quarter of the rate"),
        "safety.watch.jump_deg": (max(0.03, 6.0 * step), "0.03 deg, at least six encoder steps"),
        "safety.watch.drift_deg": (max(0.03, 4.0 * step + 4.0 * play), "0.03 deg, at least four steps and four plays"),
        "safety.watch.frozen_deg": (max(0.008, 4.0 * step + 2.0 * play), "0.008 deg, at least four steps and two plays"),
        "safety.gate.hard_deg": (min(max(0.25, 3.0 * step), 28.0), "0.25 deg, at least three encoder steps"),
        "gate.hard_deg": (min(max(0.25, 3.0 * step), 28.0), "0.25 deg, at least three encoder steps"),
        "axes.frozen_deg": (max(0.02, 4.0 * step), "0.02 deg, at least four encoder steps"),
        "axes.reaction_s": (reaction_s, "0.3 s; a drive that takes positions: interval, latency and two polls"),
        "axes.runaway_deg": (
            min(max(0.5, 5.0 * step, 0.25 * of.beamwidth_deg), 50.0), "0.5 deg, at least five steps and 0.25 h"
        ),
        "loops.oscillation.threshold_deg": (min(swing, 5.0), "0.02 deg, at least four steps and 0.6 of the scan radius"),
        "loops.oscillation.gross_threshold_deg": (min(2.5 * swing, 50.0), "2.5 times the smallest swing"),
        "loops.oscillation.largest_deg": (min(max(0.5, 10.0 * swing), 50.0), "0.5 deg, at least ten times the smallest swing"),
    })  # fmt: skip
