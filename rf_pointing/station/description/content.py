"""Contents of a station description: every section and key, with unit, range and meaning.

One declaration serves the reader of the file, its list of problems and the published JSON schema.
Angles are in degrees, as a user writes them; the unit is the end of a key's name.  A key whose
default is None is derived when it is not given (`station/derive`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from rf_pointing.core import AXES, Pair, flat, parameter
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, LOWER_AXES, MOUNTS, MountType
from rf_pointing.tracking.sensors import SENSORS

VERSION = 1
AZIMUTH_TEXT = "azimuth axis; more than 360 deg of travel is the cable wrap"
ELEVATION_TEXT = "elevation axis; beyond 90 deg the dish looks over its back"
Open = dict[str, Any]
"""A section whose keys somebody else declares: a drive, the tuning of the nodes."""


def section(description: str, kind: Callable[[], Any] = dict) -> Any:
    """Return a field for a section that may be left out."""
    return field(default_factory=kind, metadata={"description": description})


@dataclass(frozen=True, kw_only=True)
class SiteSection:
    """Intersection of the axes, on WGS 84."""

    latitude_deg: float = parameter(description="geodetic latitude, north positive", low=-90.0, high=90.0)
    longitude_deg: float = parameter(description="longitude, east positive", low=-180.0, high=360.0)
    height_m: float = parameter(0.0, "height above the WGS 84 ellipsoid", -500.0, 9000.0)


@dataclass(frozen=True, kw_only=True)
class AxisSection:
    """One axis of the mount."""

    travel_deg: Pair = parameter(description="lowest and highest angle that may be commanded", low=-1000.0, high=1000.0)
    rate_deg_s: float = parameter(description="largest rate of the drive", low=0.001, high=100.0)
    acceleration_deg_s2: float | None = parameter(
        None, "largest acceleration of the drive; default: the full rate in 1 s", 0.001, 1000.0
    )
    command_rate_deg_s: float | None = parameter(
        None, "largest commanded rate; default: 0.9 of the drive's, the rest is the loop's", 0.001, 100.0
    )
    command_acceleration_deg_s2: float | None = parameter(
        None, "largest commanded acceleration; default: 0.4 of the drive's", 0.001, 1000.0
    )
    encoder_bits: int | None = parameter(
        None, "bits of the encoder per turn; default: 20, or those of resolution_deg", 8, 40
    )
    resolution_deg: float | None = parameter(
        None, "smallest step that the encoder or the rotator shows, in place of encoder_bits", 1e-9, 5.0
    )
    hard_stop_deg: Pair | None = parameter(
        None, "mechanical stops; default: 5 deg (azimuth) and 2 deg (elevation) outside the travel", -1100.0, 1100.0
    )
    backlash_deg: float | None = parameter(
        None, "half width of the gear's play; default: 0.003 deg or a tenth of a beamwidth step", 0.0, 0.5
    )

    def contradictions(self) -> Iterator[tuple[str, str]]:
        """Yield keys that cannot be what they are with the others, and what they must be.

        A value of None, also of one that must not be, contradicts nothing.
        """
        travel, stop = self.travel_deg, self.hard_stop_deg
        if travel is not None and travel[0] >= travel[1]:
            yield "travel_deg", f"={list(travel)} must rise from its lowest to its highest angle"
        elif travel is not None and stop is not None and not (stop[0] < travel[0] and travel[1] < stop[1]):
            yield "hard_stop_deg", f"={list(stop)} must lie outside travel_deg={list(travel)}"
        if self.encoder_bits is not None and self.resolution_deg is not None:
            both = f"={self.resolution_deg} and encoder_bits={self.encoder_bits}"
            yield "resolution_deg", f"{both} give the same twice: leave one out"
        drive = self.acceleration_deg_s2 if self.acceleration_deg_s2 is not None else self.rate_deg_s
        for name, bound in (("command_rate_deg_s", self.rate_deg_s), ("command_acceleration_deg_s2", drive)):
            value = getattr(self, name)
            if value is not None and bound is not None and value > bound:
                yield name, f"={value} must be <= {bound}, what the drive can do"


@dataclass(frozen=True, kw_only=True)
class MountSection:
    """Axes and where they may, rest and look."""

    type: str = parameter(AZIMUTH_ELEVATION, "how the axes lie, the lower one first", choices=MOUNTS)
    azimuth: AxisSection | None = parameter(None, AZIMUTH_TEXT)
    elevation: AxisSection | None = parameter(None, ELEVATION_TEXT)
    axes: dict[str, AxisSection] = section("axes of another mount by their names: x and y, hour_angle and declination")
    lower_axis: str | None = parameter(None, "direction of the x axis of an X-Y mount", choices=LOWER_AXES)
    tilt_deg: float | None = parameter(
        None, "angle by which a tilt axis leans the azimuth axis, to a side chosen for each pass", 0.1, 45.0
    )
    train_deg: float | None = parameter(
        None, "azimuth to which a tilt axis leans; default: chosen and set before each pass",
        -360.0, 360.0,
    )  # fmt: skip
    train_rate_deg_s: float | None = parameter(
        None, "rate at which a tilt axis is set to another azimuth; default: 1", 0.001, 50.0
    )
    fixed_elevation_deg: float | None = parameter(
        None, "where an antenna looks that turns in azimuth alone; default: both axes turn", -10.0, 180.0
    )
    park_deg: Pair | None = parameter(
        None, "axis angles of the park position; default: those of the travel nearest to azimuth 0 and elevation 45",
        -1000.0, 1000.0,
    )  # fmt: skip
    stow_elevation_deg: float | None = parameter(
        None, "angle of the upper axis at which the wind does least; default: that nearest to the zenith", -180.0, 180.0
    )
    horizon_deg: tuple[Pair, ...] | None = parameter(
        None, "horizon mask: azimuth and lowest elevation of its points, rising; default: none", -12.0, 360.0
    )
    horizon_file: str = parameter("", "file of the horizon mask: azimuth and elevation in deg, a point a line")
    horizon_clearance_deg: float = parameter(1.0, "passes begin and end this far above the mask", 0.01, 11.4)
    pass_elevation_deg: float | None = parameter(
        None, "elevation at which passes begin and end; default: 5, at least 1 above the lowest", 0.0, 85.0
    )
    transmit_elevation_deg: float = parameter(10.0, "lowest elevation at which the transmitter may be on", -11.0, 91.0)
    unsigned_commands: bool = parameter(
        False, "whether anybody on the network may command the antenna between passes; false: who has its key"
    )

    @property
    def kind(self) -> MountType:
        """The row of the mount's type."""
        return MOUNTS[self.type or AZIMUTH_ELEVATION]

    @property
    def leans_anywhere(self) -> bool:
        """Whether it has a tilt axis that is set before each pass, and is not set by now."""
        return self.tilt_deg is not None and self.train_deg is None

    @property
    def pair(self) -> tuple[AxisSection, AxisSection]:
        """Lower and upper axis; a description with problems may lack one."""
        given: dict[str, Any] = {"azimuth": self.azimuth, "elevation": self.elevation, **(self.axes or {})}
        first, second = map(given.get, self.kind.axes)
        return first, second  # type: ignore[return-value]

    @property
    def keys(self) -> tuple[str, str]:
        """Dotted keys of both axes."""
        first, second = (f"mount.{name}" if name in AXES else f"mount.axes.{name}" for name in self.kind.axes)
        return first, second


@dataclass(frozen=True, kw_only=True)
class DishSection:
    """The dish; omit for antennas without one (Yagi)."""

    diameter_m: float = parameter(description="diameter of the reflector", low=0.1, high=120.0)


@dataclass(frozen=True, kw_only=True)
class ArraySection:
    """Patches on a circle that moves with the dish; the sensor `array` of a band."""

    elements: int = parameter(12, "number of patches on the circle", 5, 64)
    radius_m: float = parameter(0.12, "radius of the circle", 0.001, 10.0)
    element_gain_dbi: float = parameter(6.0, "gain of one patch", -10.0, 30.0)
    roll_deg: float = parameter(0.0, "angle from the axis of the first patch to cross-elevation", -180.0, 180.0)
    axis_cross_elevation_deg: float = parameter(0.0, "array's axis right of the beam by", -45.0, 45.0)
    axis_elevation_deg: float = parameter(0.0, "array's axis above the beam by", -45.0, 45.0)
    phase_sigma_deg: float = parameter(1.0, "what the calibration leaves of the phases", 0.0, 28.0)


@dataclass(frozen=True, kw_only=True)
class SunSection:
    """The zone of the sky around the Sun."""

    radius_deg: float = parameter(1.0, "the beam stays this far from the Sun; 0: it may look into it", 0.0, 28.0)
    escapes: bool = parameter(True, "an antenna at rest turns away from it; false: it only warns")
    warning_s: float = parameter(300.0, "it warns so long before, turns away 60 s before", 60.0, 3600.0)
    clear_s: float = parameter(
        1800.0, "where it turns to stays clear of the Sun for so long", 60.0, 14400.0
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class WindSection:
    """Wind in which the antenna is stowed."""

    anemometer: bool = parameter(
        False, "whether one publishes weather/wind (simulated: is simulated); without it, wind never stows the antenna"
    )
    stow: bool = parameter(True, "whether high wind stows the antenna; false: it is only warned of")
    gust_limit_m_s: float = parameter(25.0, "3-s gust from which the antenna is stowed", 1.0, 100.0)
    mean_limit_m_s: float = parameter(18.0, "10-min mean from which the antenna is stowed", 1.0, 100.0)


@dataclass(frozen=True, kw_only=True)
class StageSection:
    """One cable, filter or amplifier behind the antenna: its loss, or its noise and gain."""

    loss_db: float | None = parameter(None, "loss of a cable, filter or coupler", 0.0, 60.0)
    noise_figure_db: float | None = parameter(None, "noise figure of an amplifier", 0.0, 40.0)
    noise_k: float | None = parameter(None, "noise temperature of an amplifier, in place of its figure", 0.0, 1e6)
    gain_db: float = parameter(0.0, "gain of an amplifier", -60.0, 120.0)
    physical_k: float = parameter(290.0, "temperature of what loses", 1.0, 400.0)

    def contradiction(self) -> str:
        """Return "" or why this is not one part of the chain."""
        given = [self.loss_db, self.noise_figure_db, self.noise_k]
        if sum(each is not None for each in given) != 1:
            return "must have one of loss_db, noise_figure_db, noise_k"
        if self.loss_db is not None and self.gain_db != 0.0:
            return f"gain_db={self.gain_db}: a part with loss_db has no gain of its own"
        return ""


@dataclass(frozen=True, kw_only=True)
class NoiseSection:
    """Parts of the system noise, in place of system_noise_k."""

    chain: tuple[StageSection, ...] = parameter(description="parts behind the antenna, in the order of the signal")
    spillover_k: float = parameter(8.0, "ground seen past the reflector, feed and mirrors", 0.0, 300.0)
    dichroic_loss_db: float = parameter(
        0.0, "reflection and ohmic loss of a dichroic plate in the beam; 0: none", 0.0, 3.0
    )


@dataclass(frozen=True, kw_only=True)
class FeedOffsetSection:
    """Where the beam of a feed is off the axis of the dish."""

    cross_elevation_deg: float = parameter(0.0, "the beam is right of the axis by", -5.0, 5.0)
    elevation_deg: float = parameter(0.0, "the beam is above the axis by", -5.0, 5.0)


@dataclass(frozen=True, kw_only=True)
class BandReceiverSection:
    """Keys that a band has in place of those of the common `receiver`."""

    type: str | None = parameter(None, "where the signal comes from")
    power_period_s: float | None = parameter(None, "time between two powers", 0.06, 10.0)
    delay_s: float | None = parameter(None, "time from direction to power", -60.0, 60.0)
    options: str | None = parameter(None, "text for a receiver of your own")
    link: Open = section("how the device is reached")
    iq: Open = section("samples of a radio")
    signal: Open = section("what is measured in samples")
    level: Open = section("what a reported level means")


@dataclass(frozen=True, kw_only=True)
class BandSection:
    """One frequency band."""

    frequency_mhz: float = parameter(description="frequency of the carrier", low=10.0, high=400000.0)
    half_power_beamwidth_deg: float | None = parameter(
        None, "full width of the beam at half power; default: from diameter and frequency", 1e-4, 80.0
    )
    sensors: tuple[str, ...] = parameter(
        tuple(name for name, traits in SENSORS.items() if traits.scans),
        "what the feed and receiver can track with, the default first; none: program track",
        choices=SENSORS.keys(),
    )
    system_noise_k: float | None = parameter(
        None, "system noise temperature at the zenith; default: 120, below 1 GHz 400", 5.0, 10000.0
    )
    noise: NoiseSection | None = parameter(None, "parts of the system noise, in place of system_noise_k")
    satellite_eirp_dbw: float | None = parameter(
        None, "EIRP of the satellite less polarisation loss, in place of zenith_carrier_to_noise_db_hz", -60.0, 90.0
    )
    gain_dbi: float | None = parameter(
        None, "gain of the antenna; default: 26 000 deg^2 over the square of the beamwidth", 0.0, 90.0
    )
    zenith_carrier_to_noise_db_hz: float = parameter(
        60.0, "C/N0 to expect from a satellite at the zenith, at reference_range_km", 0.0, 140.0
    )
    reference_range_km: float = parameter(780.0, "range at which that C/N0 is received", 0.1, 1e9)
    model_error_deg: float = parameter(
        0.1, "error per axis that the bias model, or a mount without one, leaves", 0.0, 5.0
    )
    feed_offset: FeedOffsetSection | None = parameter(None, "where the beam is, without bias_model")
    bias_model: str = parameter("", "file of the bias model; empty: none, until one is calibrated")
    acquisition_band: str = parameter(
        "", "wider band in which a pass begins while its target is uncertain; its satellites must transmit in both"
    )
    receiver: BandReceiverSection = section("its own keys of receiver", BandReceiverSection)
    mount_errors: Open = section("mount errors of the simulated antenna that differ in this band")
    tuning: Open = section("values of this band over the derived ones, by their names")


@dataclass(frozen=True, kw_only=True)
class ReceiverSection(BandReceiverSection):
    """The receiver that measures the carrier: simulated, or a device of yours."""

    type: str = parameter("simulated", "where the signal comes from, as receiver.type of signal_receiver")
    power_period_s: float = parameter(0.1, "time between two carrier powers", 0.06, 10.0)
    delay_s: float = parameter(0.0, "time from the beam's direction to the power that it gives", -60.0, 60.0)
    options: str = parameter("", "text for a receiver of your own")


@dataclass(frozen=True, kw_only=True)
class RigSection:
    """The receiver or the transmitter, behind rigctld of Hamlib."""

    host: str = parameter("localhost", "host of rigctld")
    port: int = parameter(4532, "TCP port of rigctld; the same for both sides: one rig in split", 1, 65535)
    oscillator_mhz: float = parameter(
        0.0, "local oscillator of the converter (LNB, transverter) before the rig; 0: none", 0.0, 400000.0
    )
    offset_hz: float = parameter(0.0, "added to the tuning, for the errors of both oscillators", -1e6, 1e6)
    step_hz: float = parameter(1.0, "smallest step of the tuning", 0.1, 10000.0)


@dataclass(frozen=True, kw_only=True)
class TransponderSection:
    """Frequencies of one satellite."""

    downlink_mhz: float = parameter(description="middle of the downlink", low=10.0, high=400000.0)
    uplink_mhz: float | None = parameter(
        None, "middle of the uplink; omit for a satellite that is only received", 10.0, 400000.0
    )
    passband_khz: float = parameter(0.0, "width of a transponder; 0: one channel", 0.0, 1e6)
    inverting: bool = parameter(False, "whether the top of the uplink is the bottom of the downlink")


@dataclass(frozen=True, kw_only=True)
class RadioSection:
    """The radio that node radio_control tunes, and lets send or not."""

    transponders: dict[str, TransponderSection] = parameter(
        description="frequencies by the satellite's name; any: of every other one"
    )
    receive: RigSection | None = parameter(None, "the receiver; omit if something else tunes it")
    transmit: RigSection | None = parameter(None, "the transmitter; omit for a station that only receives")
    eirp_dbw: float = parameter(0.0, "largest EIRP of the station", -60.0, 150.0)
    eirp_sectors: tuple[tuple[float, float, float, float], ...] = parameter(
        (), "azimuths from and to, elevation below which, and the largest EIRP in dBW allowed there", -360.0, 360.0
    )
    transmit_line: str = parameter(
        "", "high while the transmitter may send: a file (GPIO), /dev/ttyX:rts or /dev/ttyX:dtr; empty: none"
    )


@dataclass(frozen=True, kw_only=True)
class SimulatedWindSection:
    """Wind that blows on the simulated antenna."""

    mean_speed_m_s: float = parameter(0.0, "mean wind speed", 0.0, 60.0)
    from_azimuth_deg: float = parameter(0.0, "azimuth that the wind comes from", -360.0, 360.0)


@dataclass(frozen=True, kw_only=True)
class SecondStageSection:
    """A steering mirror, subreflector, hexapod or feed table that moves the beam."""

    travel_deg: float = parameter(description="largest deflection, each way", low=1e-5, high=5.0)
    rate_deg_s: float = parameter(1.0, "largest rate of the deflection", low=1e-4, high=500.0)
    bandwidth_hz: float = parameter(description="-3 dB bandwidth of its loop", low=0.1, high=2000.0)
    latency_s: float = parameter(0.02, "time from a command to its motion", low=0.0, high=2.0)


@dataclass(frozen=True, kw_only=True)
class BaseSection:
    """Base of an antenna on a ship or a vehicle; its motion is base/imu or base/odometry."""

    coast_s: float = parameter(2.0, "silence of the IMU before the antenna is stowed", 0.2, 60.0)
    imu_deg: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), "roll, pitch, yaw of the IMU on the base, as in REP-103", -229.0, 229.0
    )


@dataclass(frozen=True, kw_only=True)
class SimulationSection:
    """The truth of a simulated station: what its nodes have to correct.  A trial may change it."""

    structure: str | None = parameter(
        None, "plant of the simulated drive; default: flexible from 10 m of diameter, else stiff",
        choices=("flexible", "stiff"),
    )  # fmt: skip
    start_deg: Pair | None = parameter(None, "azimuth and elevation at the start; default: the park position",
        -1000.0, 1000.0)  # fmt: skip
    along_track_offset_s: float = parameter(0.0, "satellite ahead of its elements by", -60.0, 60.0)
    lag_averaging_s: float = parameter(5.0, "time in which the lags of the mount build up", 0.1, 100.0)
    wind: SimulatedWindSection = section("wind on the simulated antenna", SimulatedWindSection)
    mount_errors: Open = section("mount errors of the simulated antenna, as mount.* of antenna_servo")
    base: Open = section("motion of its base, as base_motion.* of antenna_servo")


@dataclass(frozen=True, kw_only=True)
class Content:
    """One station description file."""

    version: int = parameter(description=f"version of this format, {VERSION}", low=VERSION, high=VERSION)
    name: str = parameter(description="name of the station: models and observations belong to it")
    site: SiteSection | str = parameter(description="where it stands: coordinates, or the name of a built-in site")
    mount: MountSection = parameter(description="axes and where they may look")
    dish: DishSection | None = parameter(None, "the dish; omit for antennas without one (Yagi)")
    base: BaseSection | None = parameter(None, "base that moves; omit for an antenna on the ground")
    array: ArraySection | None = parameter(None, "array of patches on the dish; omit for dishes without one")
    sun: SunSection = section("the zone around the Sun", SunSection)
    wind: WindSection = section("wind that stows the antenna", WindSection)
    default_band: str = parameter("", "band that is used when none is named; empty: the first one")
    bands: dict[str, BandSection] = parameter(description="frequency bands by their names, as S, X, Ka, UHF")
    drive: Open = section("its type and the keys of that type", lambda: {"type": "simulated"})
    second_stage: SecondStageSection | None = parameter(None, "fast actuator; omit without one")
    receiver: ReceiverSection = section("the receiver", ReceiverSection)
    radio: RadioSection | None = parameter(None, "frequencies and transmitter; omit for a station without a radio")
    simulation: SimulationSection = section("truth of the simulated antenna and receiver", SimulationSection)
    tuning: Open = section("values over the derived ones, by their names")

    def receiver_in(self, band: str) -> ReceiverSection:
        """Return the receiver, with what a band has of its own."""
        found = dict(vars(self.receiver))
        for name, own in vars(self.bands[band].receiver).items():
            if own not in (None, {}):
                found[name] = flat(found[name] or {}) | flat(own) if isinstance(own, dict) else own
        return ReceiverSection(**found)
