"""The target that is selected: where it is, when it passes, and what may change it meanwhile.

Offsets, hold, refraction and the satellite's attitude may change at any time.  Newer elements come
into force between two passes only.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from rf_pointing import ephemeris
from rf_pointing.core import HeldDirection, Params, SkyUncertainty, Target, leaves, parameter
from rf_pointing.core.dates import DAY_S, utc_text
from rf_pointing.core.signals import DESIGNATED
from rf_pointing.ephemeris import (
    ElementUncertainty,
    Pass,
    SatelliteAntennaParams,
    TopocentricTrack,
    sky_uncertainty,
    stale_warning,
)
from rf_pointing.ephemeris.element_updates import ElementUpdates
from rf_pointing.ephemeris.learned_times import LearnedTime, LearnedTimes
from rf_pointing.ephemeris.sites import Site
from rf_pointing.ephemeris.source import SourceParams, TargetMemory, load_track, refraction_at, unused
from rf_pointing.ephemeris.target_offsets import OffsetSets, TargetOffsets
from rf_pointing.planning import HorizonMask, PassProfile
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.status import Level, Report

RENEWAL_S = 10.0
"""How often the elements are looked at for newer ones, and the weather."""
WEATHER_STEPS = {"temperature_k": 0.5, "pressure_hpa": 0.5, "relative_humidity": 0.02}
"""Changes of the weather that matter: each is 0.2 % of the refraction or less."""
WEATHER_AGE_S = 3600.0
ATTITUDE_SHARE = 0.02
"""Share of the satellite's beam by which its axis moves before it matters, 0.005 dB."""
MOVED_M, SAILED_M = 1.0, 2e3
"""Distances from which a measured place is used, and from which passes are looked for again."""
FASTEST_M_S, BLUNDER_M = 350.0, 100.0
"""Speed of an aircraft, and an error of its receiver: what is farther away is refused."""


@dataclass(frozen=True, kw_only=True)
class PublisherParams(Params):
    """How far ahead and how often the target is published, and which passes count."""

    period_s: float = parameter(0.1, "time between two targets", 0.02, 10.0)
    lead_s: float = parameter(2.0, "how far ahead of its time a target is published", 0.0, 60.0)
    margin_s: float = parameter(5.0, "publishing begins before and ends after a pass by", 0.0, 600.0)
    mask_rad: float = parameter(math.radians(5.0), "elevation at which a pass begins and ends", 0.0, 1.5)
    span_s: float = parameter(86400.0, "how far ahead passes are looked for", 60.0, 2.6e6)
    state_file: str = parameter("", "file that keeps target, offsets and hold over a restart; empty: not kept")
    learned_file: str = parameter(
        "", "file that keeps what passes taught of the satellites' times along their orbits; empty: not kept"
    )
    moves: bool = parameter(False, "whether base/fix says where the station is, as on a ship")


class PredictedTarget:
    """One target at a time; `show(passes, profiles)` gets those of each choice, None if unchanged.

    Elements that were never fetched are fetched first.  Raises ValueError with the reason if the
    target is unknown; `log_once(subject, words)` gets what may repeat with every target.  `sets`
    are the named offsets of the band.
    """

    def __init__(
        self, params: PublisherParams, source: SourceParams, mask: HorizonMask, uncertainty: ElementUncertainty,
        show: Callable[[list[Pass] | None, list[PassProfile]], None],
        log_once: Callable[[str, str], None] = lambda _subject, _words: None, band: str = "",
    ) -> None:  # fmt: skip
        self.params, self.uncertainty = params, uncertainty
        self._horizon, self._show, self._log_once = mask.above(params.mask_rad), show, log_once
        self._memory = TargetMemory(params.state_file, source)
        self.sets = OffsetSets(params.state_file, band)
        kept, self.peak_rad = self._memory.source, self._memory.peak_rad
        self.source = kept if params.moves else kept.replace(site=source.site)
        self.learned = LearnedTimes(params.learned_file)
        self.updates = ElementUpdates(self.source.elements)
        self.updates.require()
        self.track = load_track(self.source, self._memory.hold_t_s)
        self._unused = unused(self.source.elements)
        self.passes: list[Pass] = []
        self._no_pass = self._unknown = self._not_renewed = self._weather_problem = ""
        self._weather: dict[str, float] = {}
        self._weather_s = math.inf
        self._place_s, self._searched_m = -math.inf, self.track.site.position_m
        self._attitude: SatelliteAntennaParams | None = None
        self._quiet = False

    def begin(self, now_s: float) -> str:
        """Find the passes; return "" or why there is no pass, where another target may have one."""
        try:
            self._choose(self.track, now_s, self.peak_rad)
        except ValueError as error:
            self._no_pass = str(error)
        return self._no_pass

    def select(self, target: str, start_s: float, peak_rad: float) -> list[Pass]:
        """Make `target` ("": the present one) the target, and return its passes from `start_s` on.

        Raises ValueError for one that is unknown or does not pass above `peak_rad`: the present
        target stays in force.
        """
        source, track = self.source, self.track
        if target:
            source = source.replace(satellite=target, hold=False)
            track = load_track(source)
        self._choose(track, start_s, peak_rad)
        self.source, self._quiet = source, False
        self._keep()
        return self.passes

    def target_at(self, now_s: float) -> Target | None:
        """Return what is published at `now_s`, None between passes and while it is unknown."""
        # Whole microseconds, as stamps are: the target is that of its own stamp.
        t_s = round(now_s + self.params.lead_s, 6)
        if self._quiet or not (self._near_a_pass(t_s, self.params.margin_s) and self.track.covers(t_s)):
            return None
        try:
            uncertainty = sky_uncertainty(self.track, t_s, self.uncertainty)
            target = replace(self.track.target_at(t_s), uncertainty=uncertainty)
        except ValueError as error:
            # What is set while the node runs may need more than elements or an ephemeris can give.
            self._unknown = str(error)
            self._log_once("no target is published", str(error))
            return None
        self._unknown = ""
        return target

    def set(self, source: SourceParams, now_s: float) -> None:
        """Bring offsets, hold, refraction and antenna into force."""
        # A hold that is set again keeps its instant; only a new one begins now.
        held_s = self.track.hold_t_s if self.track.hold_t_s is not None else now_s
        self.track = self.track.with_offsets(
            hold_t_s=held_s if source.hold else None,
            refraction=refraction_at(source, self.track.site),
            antenna=source.antenna,
            **source.offsets,
        )
        self.source = source
        self._keep()

    @property
    def about_offsets(self) -> dict[str, Callable[[str, float], str]]:
        """Requests about the offsets, by word: each takes a name and the time, and answers.

        All offsets to zero, or those of a set that was kept, in one step; ValueError for a set that
        is unknown or cannot be kept.
        """
        sets = self.sets
        return {
            "clear": lambda _, now_s: self._offset({}, now_s),
            "recall": lambda name, now_s: self._offset(sets.recall(name), now_s),
            "keep": lambda name, _: sets.keep(name, self.source),
            "forget": lambda name, _: sets.forget(name),
        }

    def _offset(self, offsets: dict[str, float], now_s: float) -> str:
        self.set(self.source.replace(**TargetOffsets(**offsets).offsets), now_s)
        return f"offsets: {self.source.offsets_text or 'none'}"

    def yield_to(self, target: str) -> None:
        """Publish nothing until a selection while another node publishes this target."""
        self._quiet = self._quiet or target.startswith(DESIGNATED)

    def take_weather(self, name: str, value: float, now_s: float) -> None:
        """Note a measured temperature_k, pressure_hpa or relative_humidity."""
        self._weather[name], self._weather_s = value, now_s

    def take_attitude(self, quaternion: tuple[float, float, float, float]) -> None:
        """Note the satellite's measured attitude (`SatelliteAntennaParams.turned`)."""
        self._attitude = self.source.antenna.turned(quaternion)

    def take_place(self, place: tuple[float, float, float], now_s: float) -> None:
        """Predict from where the station is now, by latitude and longitude in deg and height in m.

        Raises ValueError for a place that it cannot have reached.
        """
        site = Site.from_degrees(*place)
        moved_m = math.dist(site.position_m, self.track.site.position_m)
        within_m = BLUNDER_M + FASTEST_M_S * (now_s - self._place_s)
        if moved_m > within_m:
            raise ValueError(f"{moved_m:.0f} m from the last place, must be <= {within_m:.0f} m")
        self._place_s = now_s
        if moved_m > MOVED_M:
            held_s, offsets = self.track.hold_t_s, self.track.offsets.offsets
            self.source = self.source.replace(site=site)
            self.track = self.track.with_offsets(site=site, hold_t_s=held_s, **offsets)

    def renew(self, now_s: float) -> tuple[str, bool]:
        """Bring weather, attitude and newer elements into force; return news, and if it is bad.

        Elements, and passes of another place, come neither in a pass nor just before one, and not
        while the target is held.
        """
        self._use_weather(now_s)
        self._use_attitude(now_s)
        if taught := self._learn(now_s):
            return taught, False
        sailed = math.dist(self.track.site.position_m, self._searched_m) > SAILED_M
        if self._quiet or not (sailed or self.updates.changed()) or self.source.hold:
            return "", False
        if self._near_a_pass(now_s, self.params.margin_s + self.params.lead_s + RENEWAL_S):
            return "", False
        # Tried once: a broken file is not read every ten seconds, the next one is.
        self.updates.accept()
        self._searched_m, what = self.source.site.position_m, "passes" if sailed else "elements"
        self._keep()
        try:
            self._choose(load_track(self.source), now_s, self.peak_rad)
        except (ValueError, OSError) as error:
            self._not_renewed = f"{what} were not renewed: {error}"
            return self._not_renewed, True
        self._not_renewed, self._unused = "", unused(self.source.elements)
        return f"newer {what} of {self.track.name} are in force", False

    def health(self, now_s: float) -> Report:
        """Return whether the target is known, or what is doubtful, and the numbers behind it."""
        age_s, sky = now_s - self._weather_s, self._sky(now_s)
        old = f"the measured weather is {age_s / 3600.0:.1f} h old" if age_s > WEATHER_AGE_S else ""
        unused = self._unused and f"elements not used: {self._unused}"
        problems = (
            self._no_pass, self._memory.problem, self.learned.problem, self.updates.problem, self._not_renewed,
            self._stale(now_s), unused, self._weather_problem, old,
        )  # fmt: skip
        warnings = "; ".join(filter(None, (*self.track.warnings(now_s), *problems)))
        values: dict[str, object] = {
            "passes": len(self.passes),
            **{name: value for name, (_, value) in leaves(self.track.offsets).items()},
            "offset_sets": ", ".join(self.sets.names),
            "hold_since": "" if self.track.hold_t_s is None else utc_text(self.track.hold_t_s),
        }
        try:
            sigma_rad = ephemeris.orientation_sigma_rad(self.track, now_s)
            values["earth_orientation_sigma_deg"] = round(math.degrees(sigma_rad), 6)
        except ValueError:
            # The target's place is unknown now: `target_at` reports it when it is due.
            pass
        name = self.track.name
        if isinstance(self.track.learned, LearnedTime):
            values["learned"] = learned = self.track.learned.text(now_s)
            # The page shows the words of a check.
            name += f"; learned: {learned}"
        if sky is not None:
            values |= {
                "target": self.track.name,
                "element_age_h": round(sky.age_s / 3600.0, 3),
                "along_track_sigma_s": round(sky.along_track_s, 4),
                "along_track_sigma_deg": round(math.degrees(sky.along_track_rad), 5),
                "cross_track_sigma_deg": round(math.degrees(sky.cross_track_rad), 5),
            }
        if self._unknown:
            return Report(Level.ERROR, self._unknown, values)
        return Report(Level(bool(warnings)), warnings or name, values)

    def _choose(self, track: TopocentricTrack, start_s: float, peak_rad: float) -> None:
        """Make `track` the target, if it passes, and show its passes."""
        span_s = self.params.span_s
        track = self.learned.applied(track, start_s, self.uncertainty)
        found = ephemeris.passes_with_present(_moving(track), start_s, span_s, self._horizon)
        passes = [window for window in found if window.peak_elevation_rad >= peak_rad]
        if not passes:
            peak, span = f"{math.degrees(peak_rad):.1f} deg", f"{span_s / 3600.0:.1f} h"
            raise ValueError(f"{track.name} has no pass above {peak} in the {span} after {utc_text(start_s)}")
        # Only now: a target without a pass must not replace the present one.
        self.track, self.passes, self.peak_rad, self._no_pass = track, passes, peak_rad, ""
        self._show(passes, self._profiles())

    def take_tracking(self, target: str, held: HeldDirection | None) -> None:
        """Note where a sensor holds the target, None where none does."""
        if held is not None and target == self.track.name:
            self.learned.take(held)

    def forget_learned(self, now_s: float) -> str:
        """Forget what passes taught of the present target, and say so."""
        words = self.learned.forget(self.track.name)
        self._relearn(now_s)
        return words

    def _learn(self, now_s: float) -> str:
        """Learn from a pass that has ended, and return what; "" while one goes on."""
        if self._near_a_pass(now_s, self.params.margin_s + RENEWAL_S) or self.source.hold:
            return ""
        # Also without a new pass: what is older than the law allows is dropped.
        news, self.learned.news = self.learned.end_pass(self.track, self.uncertainty), ""
        if not news and self.track.learned is not None:
            self.learned.of(self.track, now_s, self.uncertainty)
            news = self.learned.news
        if news:
            self._relearn(now_s)
        return news

    def _relearn(self, now_s: float) -> None:
        self.track = self.learned.applied(self.track, now_s, self.uncertainty)
        self._show(None, self._profiles())

    def _profiles(self) -> list[PassProfile]:
        moving = _moving(self.track)
        return [pass_profile(moving, window, law=self.uncertainty) for window in self.passes]

    def _near_a_pass(self, t_s: float, margin_s: float) -> bool:
        return any(window.aos_t_s - margin_s <= t_s <= window.los_t_s + margin_s for window in self.passes)

    def _keep(self) -> None:
        self._memory.keep(self.source, self.peak_rad, self.track.hold_t_s)

    def _use_weather(self, now_s: float) -> None:
        """Bring the measured weather into force where it has changed by enough to bend a ray."""
        weather = self.source.weather
        if all(abs(value - getattr(weather, name)) <= WEATHER_STEPS[name] for name, value in self._weather.items()):
            return
        try:
            weather = weather.replace(**self._weather)
        except ValueError as error:
            self._weather_problem = f"measured weather is not used: {error}"
            return
        self._weather_problem = ""
        self.set(self.source.replace(weather=weather), now_s)

    def _use_attitude(self, now_s: float) -> None:
        """Bring the measured attitude into force where the satellite's beam has moved enough."""
        antenna, measured = self.source.antenna, self._attitude
        least = ATTITUDE_SHARE * antenna.half_power_beamwidth_rad
        if measured is None or math.dist(measured.axis, antenna.axis) <= least:
            return
        self.set(self.source.replace(antenna=measured), now_s)
        self._show(None, self._profiles())

    def _stale(self, now_s: float) -> str:
        """Return "" or how old the elements are at the closest approach of the next pass."""
        t_s = next((window.tca_t_s for window in self.passes if window.los_t_s >= now_s), now_s)
        try:
            return stale_warning(self.track, t_s, self.source.stale_days * DAY_S, self.uncertainty)
        except ValueError as error:
            return str(error)

    def _sky(self, t_s: float) -> SkyUncertainty | None:
        """Return how uncertain the target is, None where nothing is known of it."""
        try:
            return ephemeris.sky_uncertainty(self.track, t_s, self.uncertainty)
        except ValueError as error:
            self._log_once("uncertainty unknown", str(error))
            return None


def _moving(track: TopocentricTrack) -> TopocentricTrack:
    """Return the track without its hold: a target that is held passes never, or always."""
    return track.with_offsets(**track.offsets.offsets)
