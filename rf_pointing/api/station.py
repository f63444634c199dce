"""A station as an object: its description, one of its bands, and what it can do."""

import dataclasses
import importlib
import math
import time
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from rf_pointing.api.keywords import angle_rad, span_s, time_s
from rf_pointing.api.link_budget import LinkBudgetTable
from rf_pointing.api.passes import Look, PassCertificate, StationPass
from rf_pointing.api.plan import Plan
from rf_pointing.api.scan import ScanRequest, ScanResult, simulated
from rf_pointing.api.simulated import SimulatedPass
from rf_pointing.api.target import MAX_AGE_S, Target
from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.core import DAY_S, SCANNED, Sensor, require_choice
from rf_pointing.ephemeris import Elements, Pass, TopocentricTrack, find_passes
from rf_pointing.ephemeris.passes import part_searched
from rf_pointing.planning import AxisLimits
from rf_pointing.simulation import StationSetup, merged, simulate_pass
from rf_pointing.station.campaign.calibrator import CalibratorParams
from rf_pointing.station.clients.scan_samples import ScanSamples
from rf_pointing.station.derive.axes import feed_model
from rf_pointing.station.description import DEFAULT_STATION, StationDescription, read_station
from rf_pointing.station.description.writing import leaning
from rf_pointing.station.pointing.certificates import PlannedPass, PlanningRules, planned_certificate
from rf_pointing.station.pointing.multi_satellite_plan import PlannedAntenna, Wish, plan_day
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.tracking.power_tracker import CarrierTracker
from rf_pointing.tracking.scan_program import ScanProgramParams

BEFORE_S = 150.0
"""A simulation begins so long before acquisition, for the slew and until its lags have faded."""


class Station:
    """One antenna as its description states it, in one band.

    Parameters
    ----------
    station : your description file (YAML), or the name of a shipped one: dss13 (default), leo_3m7,
        rotator_2m, vhf_uhf_yagi.
    band : one of its bands; its default band if None.
    model : bias model in place of the station's: a file, or `BiasModel.zero()` for none.

    Attributes
    ----------
    name, site : of the station, to which models and observations belong; where the antenna stands.
    band, bands : the band in use, and the names of all in the order of the file.
    sensors : of the band, the default first; empty for program track alone.
    simulated : whether its drive is simulated; any other moves a device in real time.

    Raises
    ------
    ValueError
        The description has problems (all are listed with file and line), or not this band.

    Examples
    --------
    >>> station = rp.Station("leo_3m7")
    >>> station.band, station.sensors
    ('X', ('conscan', 'steptrack'))
    """

    def __init__(
        self, station: str | Path | StationDescription = DEFAULT_STATION, band: str | None = None,
        *, model: BiasModel | str | Path | None = None,
    ) -> None:  # fmt: skip
        self.description = station if isinstance(station, StationDescription) else read_station(station)
        own = self.description
        self.name, self.site, self.simulated, self.bands = own.name, own.site, own.simulated, own.bands
        self.band = own.default_band if band is None else band
        require_choice(f"{self.name}: band", self.band, self.bands)
        self.sensors = own.sensors(self.band)
        self._model, self._in_band = model, {self.band: self}

    def __repr__(self) -> str:
        return f"Station({self.name!r}, band={self.band!r})"

    @cached_property
    def controller(self) -> ControllerParams:
        """Parameter sets of the pointing controller, in radians."""
        return ControllerParams(**self.description.sets("pointing_controller", self.band))

    @cached_property
    def calibrator(self) -> CalibratorParams:
        """Parameters of the calibrator, in radians: how good and how near an observation is."""
        found: CalibratorParams = self.description.sets("bias_calibrator", self.band)["calibrator"]
        return found

    @property
    def limits(self) -> AxisLimits:
        """Travel of the axes, in radians."""
        return self.controller.limits

    @property
    def beamwidth_deg(self) -> float:
        """Half-power beamwidth of the band."""
        return math.degrees(self.controller.machine.half_power_beamwidth_rad)

    @property
    def frequency_hz(self) -> float:
        """Frequency of the band."""
        return 1e6 * self.description.content.bands[self.band].frequency_mhz

    @cached_property
    def model(self) -> BiasModel:
        """The bias model in force: the one given, else the station's, else that of its feed."""
        chosen = self.description.bias_model_file(self.band) if self._model is None else self._model
        if not isinstance(chosen, BiasModel):
            chosen = read_model(chosen).model if chosen else feed_model(self.description.content, self.band)
        return chosen.on(self.controller.kinematics)

    @cached_property
    def rules(self) -> PlanningRules:
        """The antenna that passes are planned for: its errors, axes, mask and safety gate."""
        sets, spiral = self.controller, self.controller.spiral
        swept_rad2_s = spiral.rate_rad_s * spiral.pitch_beamwidths * spiral.half_power_beamwidth_rad
        return PlanningRules(
            model=self.model, machine=sets.machine, limits=sets.limits, mask=sets.mask, gate=sets.gate,
            lag_averaging_s=sets.pointing.lag_averaging_s, mount=sets.kinematics,
            swept_rad2_s=swept_rad2_s if self.sensors else 0.0,
        )  # fmt: skip

    @cached_property
    def start_rad(self) -> tuple[float, float]:
        """Azimuth and elevation at which the antenna is taken to stand at first."""
        start_rad: tuple[float, float] = self.description.sets("antenna_servo", self.band)["antenna"].start_rad
        return start_rad

    @cached_property
    def lowest_rad(self) -> float:
        """Elevation at which passes begin and end unless one is given; the mask may be above it."""
        values = self.description.parameters("ephemeris_publisher", self.band)
        return math.radians(values["publisher.mask_deg"])

    def track_of(self, target: Target) -> TopocentricTrack:
        """Return the apparent motion of a target over the station, in radians."""
        return target.track(self.site)

    def look(self, target: Target, *, at: str | None = None, at_t_s: float | None = None) -> Look:
        """Return where a target is at a time, and what the bias model adds to point there.

        Parameters
        ----------
        at, at_t_s : the time, UTC text or s since 1970; one of them.

        Examples
        --------
        >>> station.look(rp.elements("CBERS 2"), at="2006-06-27T05:05:00").elevation_deg
        """
        t_s = time_s("at", at, at_t_s)
        if t_s is None:
            raise ValueError("at: give the time, as at (UTC text) or at_t_s")
        return Look.of(self.track_of(target), self.model, t_s)

    def passes(
        self,
        target: Target,
        *,
        start: str | None = None,
        start_t_s: float | None = None,
        hours: float | None = None,
        days: float | None = None,
        mask_deg: float | None = None,
        mask_rad: float | None = None,
        min_peak_deg: float | None = None,
        min_peak_rad: float | None = None,
    ) -> list[StationPass]:
        """Return the passes of a target above the horizon mask, in order of rise.

        Parameters
        ----------
        target : what `rp.elements` returns.
        start, start_t_s : begin of the search, UTC text or s since 1970; by default the epoch of
            the elements.
        hours, days : length of the search; 24 h by default.
        mask_deg, mask_rad : elevation at which passes begin and end; by default the station's.
        min_peak_deg, min_peak_rad : least peak of a pass; 0 by default.

        Raises
        ------
        ValueError
            A time outside the span of the elements, an angle given twice, or a span of length 0.

        Examples
        --------
        >>> for one in station.passes(rp.elements("CBERS 2"), days=2, min_peak_deg=40.0):
        ...     print(one.aos_utc, one.peak_elevation_deg)
        """
        begin_s = time_s("start", start, start_t_s)
        begin_s = target.first_t_s if begin_s is None else begin_s
        above = self.rules.mask.above(angle_rad("mask", mask_deg, mask_rad, self.lowest_rad))
        least_rad = angle_rad("min_peak", min_peak_deg, min_peak_rad, 0.0)
        found = find_passes(self.track_of(target), begin_s, span_s(hours, days), above)
        return [
            StationPass.of_window(window, target, self, begin_s)
            for window in found
            if window.peak_elevation_rad >= least_rad
        ]

    def certificate(
        self,
        one: StationPass,
        *,
        azimuth_deg: float | None = None,
        azimuth_rad: float | None = None,
        elevation_deg: float | None = None,
        elevation_rad: float | None = None,
    ) -> PassCertificate:
        """Return what a pass requires of the antenna, and the way on which it would be tracked.

        The antenna stands at these axis angles, by default where it starts, from the begin of the
        search for the pass on.
        """
        standing_rad = (
            angle_rad("azimuth", azimuth_deg, azimuth_rad, self.start_rad[0]),
            angle_rad("elevation", elevation_deg, elevation_rad, self.start_rad[1]),
        )
        return self._certified(one, one.searched_from_t_s, standing_rad)

    def part_searched(
        self, target: Target, *, start_t_s: float, hours: float | None = None, days: float | None = None
    ) -> str:
        """Return "" or the only parts of a search in which the target is known: it may decay."""
        return part_searched(self.track_of(target), start_t_s, span_s(hours, days))

    def certificates(self, passes: Sequence[StationPass]) -> list[PassCertificate]:
        """Return the certificates of passes in a row, none left out.

        Each slew begins where the pass before has left the axes, the first at the start position.
        """
        found: list[PassCertificate] = []
        standing_rad = self.start_rad
        free_t_s = passes[0].searched_from_t_s if passes else 0.0
        for one in passes:
            found.append(self._certified(one, free_t_s, standing_rad))
            if (chosen := found[-1].chosen) is not None:
                standing_rad, free_t_s = chosen.end_rad, one.los_t_s
        return found

    def _require_mine(self, one: StationPass) -> None:
        if one.station.site != self.site:
            where, here = (
                f"{each.name} at {math.degrees(each.site.latitude_rad):.4f} deg north, "
                f"{math.degrees(each.site.longitude_rad):.4f} deg east"
                for each in (one.station, self)
            )
            raise ValueError(
                f"one: this pass of {one.name} is over {where}; passes of {here} are found by its passes()"
            )

    def _certified(self, one: StationPass, free_t_s: float, standing_rad: tuple[float, float]) -> PassCertificate:
        self._require_mine(one)
        track = self.track_of(one.target)
        certificate, profile = planned_certificate(track, one.window, free_t_s, standing_rad, self.rules)
        certificate = dataclasses.replace(certificate, band=self.band)
        return PassCertificate(one, PlannedPass(window=one.window, profile=profile, certificate=certificate))

    def plan(
        self,
        targets: Sequence[Target],
        *,
        start: str | None = None,
        start_t_s: float | None = None,
        hours: float | None = None,
        days: float | None = None,
        mask_deg: float | None = None,
        mask_rad: float | None = None,
        gap_s: float = 0.0,
    ) -> Plan:
        """Return which passes of these targets the antenna tracks, and which yield and why.

        Parameters
        ----------
        targets : satellites, Sun, Moon and radio sources; their `priority`, `min_peak_deg`
            and `band` count.  What stays up for hours is tracked in the gaps between the others.
        start, start_t_s : begin of the plan, UTC text or s since 1970; by default now, or the
            newest epoch where the elements do not reach from now to the end of the plan.
        hours, days : length of the plan; 24 h by default.
        mask_deg, mask_rad : elevation at which passes begin and end; by default the station's.
        gap_s : time between two passes besides the slew.

        Raises
        ------
        ValueError
            No target, or what `passes` refuses.
        """
        wishes = [target.wish() for target in targets]
        for wish in wishes:
            if wish.contact_s:
                raise ValueError(f"contact of {wish.target.name} is of a network: give stations")
            require_choice(f"{wish.target.name}: band", wish.band, ("", *self.bands))
        length_s = span_s(hours, days)
        begin_s = begin_of_plan(wishes, time_s("start", start, start_t_s), length_s)
        of_band = {wish.band: self.in_band(wish.band).rules for wish in wishes if wish.band}
        least_rad = angle_rad("mask", mask_deg, mask_rad, self.lowest_rad)
        antenna = self.antenna(least_rad, of_band=of_band)
        return Plan(self, plan_day(wishes, antenna, begin_s, length_s, gap_s=gap_s, max_age_s=MAX_AGE_S))

    def antenna(self, least_rad: float, **more: Any) -> PlannedAntenna:
        """Return the antenna as plans take it; passes begin and end above `least_rad`."""
        return PlannedAntenna(site=self.site, rules=self.rules, encoder_rad=self.start_rad, least_rad=least_rad, **more)

    def in_band(self, band: str) -> "Station":
        """Return the same station in another of its bands."""
        if band not in self._in_band:
            self._in_band[band] = Station(self.description, band, model=self._model)
        return self._in_band[band]

    def link_budget(self, one: StationPass | None = None) -> LinkBudgetTable:
        """Return noise, G/T and C/N0 of the band over elevation, or along a pass.

        Examples
        --------
        >>> print(rp.Station("leo_3m7", "S").link_budget())
        """
        return LinkBudgetTable.of(self, one)

    def slew_s(
        self,
        *,
        from_azimuth_deg: float | None = None,
        from_azimuth_rad: float | None = None,
        from_elevation_deg: float | None = None,
        from_elevation_rad: float | None = None,
        to_azimuth_deg: float | None = None,
        to_azimuth_rad: float | None = None,
        to_elevation_deg: float | None = None,
        to_elevation_rad: float | None = None,
    ) -> float:
        """Return the time of a slew from rest to rest between two positions of the axes, in s."""
        start = (
            angle_rad("from_azimuth", from_azimuth_deg, from_azimuth_rad),
            angle_rad("from_elevation", from_elevation_deg, from_elevation_rad),
        )
        goal = (
            angle_rad("to_azimuth", to_azimuth_deg, to_azimuth_rad),
            angle_rad("to_elevation", to_elevation_deg, to_elevation_rad),
        )
        return self.rules.machine.slew_s(start, goal)

    def simulate(
        self,
        one: StationPass,
        *,
        sensor: str | None = None,
        minutes: float | None = None,
        seed: int = 1,
        tracker: CarrierTracker | None = None,
        changes: Mapping[str, Mapping[str, object]] | None = None,
    ) -> SimulatedPass:
        """Track a pass with the whole station simulated in this process, and return its log.

        Parameters
        ----------
        one : a pass of `passes`.
        sensor : monopulse, conscan, steptrack, program, auto; by default the station's.
        minutes : only the first minutes of the pass; all of it by default.
        seed : of every noise source.
        tracker : a tracker of yours in place of the package's (examples/own_tracker.py).
        changes : parameters by node and dotted name, over everything else:
            `{"antenna_servo": {"wind.mean_speed_m_s": 15.0}}`.

        Raises
        ------
        ValueError
            A sensor that the band does not have, or a parameter that does not exist.
        """
        window = one.window
        if minutes is not None:
            window = dataclasses.replace(window, los_t_s=min(window.los_t_s, window.aos_t_s + 60.0 * minutes))
        chosen = self.description.chosen_sensor(sensor, self.band)
        setup = self.setup(one, seed, changes, tracker=tracker)
        log = simulate_pass(setup, window, math.floor(window.aos_t_s) - BEFORE_S, chosen)
        return SimulatedPass(one, chosen, log)

    def setup(
        self, one: StationPass, seed: int = 1,
        changes: Mapping[str, Mapping[str, object]] | None = None, *,
        model: BiasModel | None = None, **more: Any,
    ) -> StationSetup:  # fmt: skip
        """Return the simulated station for a pass of its own; more is that of `StationSetup`."""
        self._require_mine(one)
        source = one.target.parameters
        own: dict[str, dict[str, object]] = {
            "ephemeris_publisher": source, "rf_receiver": {**source, "signal.seed": seed},
            "antenna_servo": {"antenna.seed": seed},
        }  # fmt: skip
        given: dict[str, Any] = {"changes": merged(own, changes), "model": model or self.model}
        return StationSetup(self.leaning(one.target, one.window), self.band, **given, **more)

    def leaning(self, target: Target, window: Pass) -> StationDescription:
        """Return the description for one pass: a tilt axis leans as its certificate chooses."""
        if not self.description.content.mount.leans_anywhere:
            return self.description
        begin_s = window.aos_t_s - self.rules.mount.leaning_s - DAY_S
        track = self.track_of(target)
        chosen, _ = planned_certificate(track, window, begin_s, self.start_rad, self.rules)
        return leaning(self.description, chosen.mount.train_rad)

    def scan(
        self,
        target: Target,
        *,
        start: str | None = None,
        start_t_s: float | None = None,
        seed: int = 1,
        bandwidth_hz: float = 2.4e6,
        changes: Mapping[str, Mapping[str, object]] | None = None,
        **scan: Any,
    ) -> ScanResult:
        """Scan a source with the station simulated in this process, and return what was found.

        Parameters
        ----------
        target : a satellite, Sun, Moon, Cassiopeia A, Cygnus A, Taurus A or Virgo A: the others
            have no flux, and no carrier.
        start, start_t_s : the scan begins as soon as the target is up from then on.
        seed, changes : as of `simulate`.
        bandwidth_hz : of the total power; that of an RTL-SDR.
        scan : fields of `rf_pointing.api.scan.ScanRequest`, as pattern, half_width_deg, frame.

        Raises
        ------
        ValueError
            A scan that does not fit the axes or the time, and powers that show no source, or more
            than the source, by name.

        Examples
        --------
        >>> print(rp.Station("leo_3m7", "S").scan(rp.elements("Sun"), start="2026-06-21T09:00:00"))
        """
        at_s = time_s("start", start, start_t_s)
        request = ScanRequest(station=self, target=target, **scan)
        at_s = target.first_t_s if at_s is None else at_s
        return simulated(request, at_s, seed, bandwidth_hz, changes)

    def simulate_scan(
        self, one: StationPass, program: ScanProgramParams, taken: ScanSamples, seed: int,
        changes: Mapping[str, Mapping[str, object]],
    ) -> str:  # fmt: skip
        """Let the simulated station scan, and return "" or why the scan is not complete."""
        setup = self.setup(one, seed, changes, tracker=taken)
        start_s = math.floor(one.aos_t_s) - BEFORE_S
        log = simulate_pass(setup, one.window, start_s, Sensor.PROGRAM, scan=program)
        late = "it takes longer than the target is up"
        return "" if log.ended == SCANNED else log.fault or log.ended or late

    def track(self, one: StationPass, **options: Any) -> Any:
        """Track a pass with the live graph of this station (ROS), record it and report on it.

        Parameters
        ----------
        one : a pass of `passes`.
        options : fields of `rf_pointing.api.requests.TrackRequest`, as sensor, speed, output.

        Returns the `rf_pointing.api.live.TrackResult`: exit code, folder of the report, bag.
        """
        self._require_mine(one)
        # Not at the top: the rest of the front door does without ROS.
        live, requests = (importlib.import_module(f"rf_pointing.api.{name}") for name in ("live", "requests"))
        return live.track(requests.TrackRequest(station=self, target=one.target, chosen=one.window, **options))


def begin_of_plan(wishes: Sequence[Wish], given_s: float | None, length_s: float) -> float:
    """Return when a plan begins: where given, else now or at the newest epoch of old elements.

    Raises ValueError without a target.
    """
    if not wishes:
        raise ValueError("targets: give at least one satellite")
    if given_s is not None:
        return given_s
    now_s = time.time()
    newest_s = max((wish.target.epoch_t_s for wish in wishes if isinstance(wish.target, Elements)), default=now_s)
    return now_s if abs(now_s - newest_s) <= MAX_AGE_S - length_s else newest_s
