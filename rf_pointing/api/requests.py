"""Requests of an operator to a live station: complete and checked before anything is started.

A request is made from a command line or from the arguments of `rp.Station`.  It knows what follows
from it: the source of the target, the pass, the scan, the time before the pass.  Errors are
ValueErrors in the operator's words.
"""

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import yaml

from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.core import AXES, MDEG, Params, Sensor, id_of, require_between
from rf_pointing.core.dates import DAY_S, parse_utc, utc_text
from rf_pointing.core.parameters import flat, leaves, read_parameter_files, with_leaves
from rf_pointing.ephemeris import Elements, ElementUncertainty, Pass, first_pass_above, stale_warning
from rf_pointing.ephemeris.solar import SolarDirection
from rf_pointing.ephemeris.source import SourceParams, read_source
from rf_pointing.identification import ExcitationParams
from rf_pointing.planning import Gate, HorizonMask, choose_turns
from rf_pointing.receiver.params import SignalReceiverParams
from rf_pointing.receiver.registry import check_params, known_types
from rf_pointing.station.campaign.calibrator import journal_of
from rf_pointing.station.campaign.plan import beacons
from rf_pointing.station.campaign.schedule import CalibrationSchedule, CampaignParams, schedule_calibration
from rf_pointing.station.derive.signal import OPEN
from rf_pointing.station.description.content import ReceiverSection
from rf_pointing.station.description.writing import leaning, received_by
from rf_pointing.station.designated.params import DesignateParams
from rf_pointing.station.designated.target import DesignatedTarget
from rf_pointing.tracking.power_tracker import scan_tuning

DEFAULT_MODELS = "runs/models"
"""Where `calibrate` leaves accepted models and `track` finds them."""
SLEW_TIME_S = 150.0
"""Least time from the start of a run to acquisition."""
SETTLE_S = 30.0
"""From the end of a slew to acquisition."""
SEARCH_S = 2.0 * DAY_S
CALIBRATION_START = "2006-06-25T00:00:00"
"""Before the passes that `track` chooses by default, for which the model shall be valid."""
SHADOW_SPAN_S = 600.0
"""Time in which a beacon is found for each pass in the shadow."""


@dataclass(frozen=True, kw_only=True)
class RunRequest:
    """A run that starts the nodes of a station.

    `speed` is a factor of real time, or "max" (default); it, the seed and the error of the
    ephemeris belong to a simulated antenna, `reset_fault` to a real one.  `sensor` is by default
    that of the band, `models` the folder of accepted models ("" for the station's own).
    `receiver` takes the place of the station's, as rtl_tcp://localhost:1234?iq.rate_hz=240000.
    """

    station: Station
    target: Target = Target()
    sensor: str = ""
    start_s: float | None = None
    speed: float | str | None = None
    seed: int | None = None
    ephemeris_error_s: float | None = None
    reset_fault: bool = False
    processes: int = 2
    models: str = DEFAULT_MODELS
    keep_observations: bool = False
    receiver: str = ""
    namespace: str = "/gs1"
    parameter_files: Sequence[Path] = ()
    record: Path | None = None
    output: Path | None = None

    def __post_init__(self) -> None:
        self.station.description.require_mount(type(self).__name__.removesuffix("Request").lower())
        if isinstance(self.speed, float | int) and not 0.1 <= self.speed <= 1000.0:
            raise ValueError(f"speed={self.speed} must be between 0.1 and 1000")
        if self.ephemeris_error_s is not None:
            require_between("ephemeris_error_s", self.ephemeris_error_s, -60.0, 60.0)
        if self.receiver:
            description = self.station.description
            section = receiver_section(self.receiver, description.content.receiver_in(self.station.band))
            station = Station(received_by(description, section), self.station.band)
            object.__setattr__(self, "station", station)
        if self.station.simulated and self.speed is None and self.station.description.receiver != "simulated":
            # Samples without stamps have the time of their arrival.
            object.__setattr__(self, "speed", 1.0)
        if not self.station.simulated:
            self._check_real_time()
        elif self.seed is None:
            object.__setattr__(self, "seed", 1)
        sensor = self.station.description.chosen_sensor(self.sensor, self.station.band)
        object.__setattr__(self, "sensor", sensor)

    def _check_real_time(self) -> None:
        """Refuse options of a simulation on a real drive, and a start in the past."""
        real = (
            f"drive.type={self.station.description.drive['type']} of {self.station.name} moves a device, in real time"
        )
        given = {"speed": self.speed, "seed": self.seed, "ephemeris-error": self.ephemeris_error_s}
        for name, value in given.items():
            if value is not None:
                raise ValueError(f"{name}={value}: {real}; it is for a simulated drive")
        if self.start_s is not None and (late_s := time.time() - self.start_s) > 0.0:
            raise ValueError(
                f"start={utc_text(self.start_s)} was {late_s:.0f} s ago: {real}; the present is the default"
            )

    @property
    def changes(self) -> dict[str, Any]:
        """Values over those of the description, by dotted key: tilt, another receiver."""
        content = self.station.description.content
        train_deg = content.mount.train_deg
        leans = {} if train_deg is None else {"mount.train_deg": train_deg}
        if not self.receiver:
            return leans
        own = {f"bands.{name}.receiver" for name in content.bands} & self.station.description.lines.keys()
        return leans | {key: {} for key in sorted(own)} | flat({"receiver": vars(content.receiver)})

    @cached_property
    def said(self) -> dict[str, dict[str, Any]]:
        """Values of the parameter files, by node."""
        return read_parameter_files(self.parameter_files)

    def before_pass_s(self, window: Pass) -> float:
        """Return the whole seconds before acquisition: the slew from where the antenna may be."""
        params = self.station.controller
        limits, machine = params.limits, params.machine
        if not (self.station.simulated and params.kinematics.level):
            # A real antenna may be anywhere: the longest slew of the azimuth, or over the top.  And
            # where a pass begins in the angles of other axes only its certificate knows.
            travel_rad = (
                limits.azimuth_max_rad - limits.azimuth_min_rad,
                limits.elevation_max_rad - limits.elevation_min_rad,
            )
            slew_s = max(np.divide(travel_rad, machine.rate_limit_rad_s))
            return float(math.ceil(max(SLEW_TIME_S, slew_s + SETTLE_S)))
        # The start position belongs to the run, so a parameter file may set it.
        servo = self.station.description.sets("antenna_servo", self.station.band, self.said.get("antenna_servo"))
        start = servo["antenna"].start_azimuth_rad, servo["antenna"].start_elevation_rad
        sun = SolarDirection(params.sun).at(window.aos_t_s)
        times = [SLEW_TIME_S - SETTLE_S]
        # A pass over the top may begin on the other side; only the certificate knows whether it
        # does.
        for over in (False, True) if limits.elevation_max_rad > 0.5 * math.pi else (False,):
            shift = math.pi if over else 0.0
            elevation = math.pi - window.aos_elevation_rad if over else window.aos_elevation_rad
            try:
                turns = choose_turns(limits, window.azimuth_min_rad + shift, window.azimuth_max_rad + shift, start[0])
            except ValueError:
                # A pass that fits no turn is the certificate's to refuse, with its reasons.
                continue
            goal = (window.aos_azimuth_rad + shift + turns * 2.0 * math.pi, elevation)
            times.append(Gate(params.gate, limits, params.mask, machine.axes).slew(start, goal, sun)[0])
        return float(math.ceil(max(times) + SETTLE_S))


def _read(key: str, text: str) -> Any:
    """Return the value of a receiver's parameter: a text as it is, else as YAML has it."""
    _, default = leaves(SignalReceiverParams()).get(key, ("", None))
    value = text if isinstance(default, str) else yaml.safe_load(text)
    # A number of YAML 1.2 that YAML 1.1 takes for a text.
    with suppress(ValueError):
        return float(value) if isinstance(default, float) and isinstance(value, str) else value
    return value


def receiver_section(text: str, before: ReceiverSection) -> ReceiverSection:
    """Return the receiver that an address means, its further keys after `?`.

    What the address leaves out stays as it was `before`.  Raises ValueError for a wrong address.
    """
    # A scheme of the standard has no underscore.
    kind, _, place = text.partition("://")
    try:
        parts = urlsplit(f"//{place}")
        link: dict[str, Any] = {"host": parts.hostname, "port": parts.port}
    except ValueError as error:
        raise ValueError(f"receiver={text!r}: {error}") from error
    sections: dict[str, Any] = {name: dict(flat(getattr(before, name))) for name in OPEN}
    link = {name: value for name, value in link.items() if value is not None}
    sections["link"] |= {"file": parts.path} if kind == "sigmf" else link
    for key, value in parse_qsl(parts.query, keep_blank_values=True):
        section, _, name = key.partition(".")
        if section not in sections:
            raise ValueError(f"receiver={text!r}: {key} must begin with one of {', '.join(sections)}")
        sections[section][name] = _read(key, value)
    if kind not in known_types():
        raise ValueError(f"receiver={text!r} must begin with one of {', '.join(known_types())} and ://")
    given = {f"{name}.{key}": value for name in OPEN for key, value in sections[name].items()}
    check_params(with_leaves(SignalReceiverParams(), {"type": kind, **given}))
    return replace(before, type=kind, **sections)


@dataclass(frozen=True, kw_only=True)
class TrackRequest(RunRequest):
    """One pass: the `chosen` one, or the first from `start_s` on that rises to `min_peak_deg`.

    `start_s` is by default the epoch of the elements, for a real antenna the present; `mask_deg` is
    the elevation of its begin and end (None: the station's), `scan_sigma_mdeg` the accuracy of
    the scan for which its radius and period are chosen (None: the station's scan).
    """

    chosen: Pass | None = None
    min_peak_deg: float = 40.0
    mask_deg: float | None = None
    scan_sigma_mdeg: float | None = None

    def __post_init__(self) -> None:
        # How the tilt of a real antenna is set only its user knows.
        if self.station.description.content.mount.leans_anywhere and self.station.simulated:
            leaning = self.station.leaning(self.target, self.window)
            object.__setattr__(self, "station", Station(leaning, self.station.band))
        super().__post_init__()
        require_between("min_peak_deg", self.min_peak_deg, 0.0, 90.0)
        if self.mask_deg is not None:
            require_between("mask_deg", self.mask_deg, 0.0, 89.0)
        if self.scan_sigma_mdeg is not None and not 0.0 < self.scan_sigma_mdeg < math.inf:
            raise ValueError(f"scan-sigma={self.scan_sigma_mdeg} mdeg must be > 0 and finite")

    @cached_property
    def window(self) -> Pass:
        """The pass to track; ValueError if satellite, station and time do not give one."""
        if self.chosen is not None:
            return self.chosen
        station, start_s = self.station, self.start_s
        if start_s is None:
            start_s = self.target.first_t_s if station.simulated else time.time()
        lowest_rad = station.lowest_rad if self.mask_deg is None else math.radians(self.mask_deg)
        above, peak_rad = station.controller.mask.above(lowest_rad), math.radians(self.min_peak_deg)
        return first_pass_above(self.target.track(station.site), start_s, peak_rad, above, SEARCH_S)

    @property
    def stale_warning(self) -> str:
        """Error of stale elements at the pass, in beamwidths; "" for fresh ones."""
        beamwidth_rad = self.station.controller.machine.half_power_beamwidth_rad
        track, stale_s = self.target.track(self.station.site), SourceParams().stale_days * DAY_S
        return stale_warning(track, self.window.tca_t_s, stale_s, ElementUncertainty(), beamwidth_rad)

    @property
    def changes(self) -> dict[str, Any]:
        """The requested scan, and where passes begin."""
        tuning = {} if self.scan is None else scan_tuning(self.scan)
        scan = {f"bands.{self.station.band}.tuning.{name}": value for name, value in tuning.items()}
        own = {**super().changes, **scan}
        return own if self.mask_deg is None else {**own, "mount.pass_elevation_deg": self.mask_deg}

    @cached_property
    def scan(self) -> Params | None:
        """The scan for the requested accuracy at the weakest carrier, None without one."""
        if self.scan_sigma_mdeg is None:
            return None
        params, track = self.station.controller, self.target.track(self.station.site)
        # The link is weakest at the horizon, where the range is longest.
        farthest_m = max(float(track.target_at(t_s).range_m) for t_s in (self.window.aos_t_s, self.window.los_t_s))
        level_db_hz = params.link.level_db_hz(farthest_m)
        return params.scan_for_accuracy(level_db_hz, self.scan_sigma_mdeg * MDEG)


@dataclass(frozen=True, kw_only=True)
class DesignateRequest(RunRequest):
    """A target without an orbit: `designate` says who reports it, `kind` what it is.

    adsb:HOST:PORT/ICAO24, sonde:ADDRESS:PORT/CALLSIGN, mavlink:ADDRESS:PORT/SYSTEM, several of one
    target separated by commas; or table:FILE.  A simulated antenna is led in real time, or flies a
    table at any speed; its receiver does not receive the target, so `sensor` is program there.
    """

    designate: str = ""
    kind: str = "aircraft"

    def __post_init__(self) -> None:
        if self.station.simulated and not self.is_table:
            if self.speed not in (None, 1.0):
                raise ValueError(f"speed={self.speed}: reports come in real time, must be 1")
            object.__setattr__(self, "speed", 1.0)
        if self.station.simulated and not self.sensor:
            object.__setattr__(self, "sensor", Sensor.PROGRAM.value)
        super().__post_init__()
        _ = self.begin_s

    @property
    def is_table(self) -> bool:
        """Whether the flight is known before."""
        return self.designate.startswith("table:")

    @property
    def params(self) -> DesignateParams:
        """Parameters of target_designate."""
        parts = [self.designate] if self.is_table else self.designate.split(",")
        source, name = " ".join(parts), parts[0].partition("/")[2]
        if self.is_table:
            file = Path(self.designate.partition(":")[2])
            source, name = f"table:{file.resolve()}", id_of(file.stem)
        elif not all(each.partition("/")[2] for each in parts):
            raise ValueError(
                f"designate={self.designate!r} must name the target after a slash, as adsb:HOST:PORT/ICAO24"
            )
        return DesignateParams(source=source, target=name, kind=self.kind, fused=len(parts) > 1)

    @cached_property
    def begin_s(self) -> float:
        """Time at which the run begins: now, or in time for the first row of a table.

        ValueError for what target_designate would refuse.
        """
        first_s = DesignatedTarget(self.params, self.station.site, HorizonMask(), lambda *_: None, time.time).first_s
        return math.floor(time.time() if first_s is None else first_s - SLEW_TIME_S)


@dataclass(frozen=True, kw_only=True)
class CalibrateRequest(RunRequest):
    """A campaign on all satellites at the location of `target`, of a simulated sky on beacons.

    `longest_s` is by default 4800 s, for a real antenna a day; `acceptance_passes` are tracked with
    the new model in the shadow of the old one.
    """

    longest_s: float | None = None
    fewest: int = 25
    acceptance_passes: int = 3
    orbit_prior_m: float = 5.0
    resume: bool = False
    keep_observations: bool = True

    def __post_init__(self) -> None:
        description = self.station.description
        if description.content.mount.leans_anywhere and self.station.simulated:
            # Its model holds wherever the mount leans: a campaign needs one place.
            object.__setattr__(self, "station", Station(leaning(description, 0.0), self.station.band))
        super().__post_init__()
        real = not self.station.simulated
        if self.longest_s is None:
            object.__setattr__(self, "longest_s", DAY_S if real else 4800.0)
        if self.ephemeris_error_s is None and not real:
            object.__setattr__(self, "ephemeris_error_s", 0.0)
        _ = self.campaign
        # Without a folder a kill would lose the campaign, and nothing could be resumed.
        if not self.models:
            raise ValueError("models='' must name a folder: a campaign keeps its observations there")
        if real and not self.target.location:
            raise ValueError(
                "elements='' must name satellites: the beacons of a simulated sky are not in that of a real antenna"
            )

    @property
    def campaign(self) -> CampaignParams:
        """How much of the sky is observed, and how the model is judged."""
        longest_s = self.longest_s or 0.0
        return CampaignParams(
            longest_s=longest_s, fewest=self.fewest, acceptance_passes=self.acceptance_passes,
            orbit_prior_m=self.orbit_prior_m,
            # Satellites of the user's do not come every ten minutes.
            acceptance_span_s=longest_s if self.target.location else self.acceptance_passes * SHADOW_SPAN_S,
        )  # fmt: skip

    def schedule(self) -> CalibrationSchedule:
        """Return the passes to track; ValueError when nothing can be tracked."""
        start_s = self.start_s
        if start_s is None:
            start_s = parse_utc(CALIBRATION_START) if self.station.simulated else time.time()
        # The beacons' epoch is the start: SGP4 elements are good for days, not for years.
        place = self.target.file
        latitude_rad = self.station.site.latitude_rad
        elements: list[Elements] = read_source(str(place)).elements if place else beacons(start_s, latitude_rad)
        name, band = self.station.name, self.station.band
        mount = self.station.controller.kinematics
        kept = journal_of(self.models, name, band, mount).points if self.resume else None
        if self.resume and kept is None:
            raise ValueError(f"no observations of {name} in band {band} to resume from in {self.models}")
        return schedule_calibration(self.station.description, elements, start_s, self.campaign, kept)


IDLE_DEG_S = 1.84e-4
"""Rate of the offset of 0.0023 V that the published antenna had at both inputs."""
# It keeps the friction of the other axis constant.


@dataclass(frozen=True, kw_only=True)
class IdentifyRequest:
    """An experiment on each of `axes`; the last `held_out` of its sequences check the models.

    `simulated` starts an antenna for it, in light wind.
    """

    station: Station
    axes: Sequence[str] = AXES
    sequences: int = 8
    held_out: int = 4
    seed: int = 1
    excitation: ExcitationParams = field(
        default_factory=lambda: ExcitationParams(idle_rate_rad_s=math.radians(IDLE_DEG_S))
    )
    simulated: bool = False
    namespace: str = "/gs1"
    parameter_files: Sequence[Path] = ()
    output: Path = Path("runs/identification")

    def __post_init__(self) -> None:
        self.station.description.require_mount("identify_antenna")
        if not 1 <= self.held_out < self.sequences:
            raise ValueError(f"held_out={self.held_out} must be >= 1 and < sequences={self.sequences}")
