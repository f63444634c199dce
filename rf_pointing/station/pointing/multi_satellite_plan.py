"""Which passes of many targets one antenna tracks in a time, each with its certificate.

All passes above the mask are found together, the best plan is made of them
(`planning.schedule`), and the passes of the plan are certified in order, each slew from where the
one before leaves the axes.  A pass that no branch works for (keyhole, Sun, travel, a slew that
takes a detour) is barred with its reason, and the plan is made again without it.

What stays up for hours (a geostationary satellite, the Moon, a radio source) ranks below the passes
of its priority, and is tracked in the gaps that they leave.  A pass that lasts already at the start
is joined as soon as the antenna can be there.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from rf_pointing.core.dates import DAY_S
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.core.types import Pair
from rf_pointing.ephemeris import (
    CataloguePass,
    Elements,
    ElementUncertainty,
    Site,
    TargetSource,
    TopocentricTrack,
    find_catalogue_passes,
    find_passes,
)
from rf_pointing.ephemeris.passes import Horizon
from rf_pointing.planning import (
    AxisLimits,
    Candidate,
    Certificate,
    HorizonMask,
    PassProfile,
    reasons_against,
    turns_within,
)
from rf_pointing.planning.schedule import schedule
from rf_pointing.station.pointing.certificates import PlanningRules, SolarTable, planned_certificate

LONG_S = 10800.0
"""Stays of geostationary and highly eccentric orbits: they may be tracked in pieces."""
LEAST_PIECE_S, MARGIN_S = 600.0, 5.0
LEAST_SEARCH_S, JOIN_STEP_S = 60.0, 30.0
"""Shortest time that is searched, and steps in which the begin of a pass that lasts is put off."""


class Fate(StrEnum):
    """Fate of a pass in the plan."""

    TRACKED = "tracked"
    YIELDS = "yields"
    BARRED = "barred"


@dataclass(frozen=True, kw_only=True)
class Wish:
    """A target to track: its priority (larger first) and the least peak of a pass."""

    target: Elements | TargetSource
    priority: int = 0
    min_peak_rad: float = 0.0


@dataclass(frozen=True, kw_only=True)
class DayPass:
    """One pass of the plan; `reason` says why it is not tracked."""

    window: CataloguePass
    priority: int
    fate: Fate
    reason: str
    along_rad: float
    """One sigma of the elements' error along the track at the closest approach."""
    age_s: float
    """Age of the elements then, 0 for what is tracked without them."""
    certificate: Certificate | None = None
    profile: PassProfile | None = None
    filler: bool = False
    """Whether it fills a gap: a piece of the stay of what is up for hours."""


@dataclass(frozen=True, kw_only=True)
class DayPlan:
    """All passes in order of rise, and the satellites that were not searched, with the reasons."""

    start_t_s: float
    duration_s: float
    passes: tuple[DayPass, ...]
    unsearched: tuple[tuple[Elements, str], ...]


def plan_day(
    wishes: Sequence[Wish],
    site: Site,
    start_t_s: float,
    duration_s: float,
    rules: PlanningRules,
    encoder_rad: Pair,
    least_rad: float,
    *,
    gap_s: float = 0.0,
    max_age_s: float = 14.0 * DAY_S,
    uncertainty: ElementUncertainty | None = None,
) -> DayPlan:
    """Return the plan of one antenna that is at `encoder_rad`, at rest, at the start.

    Passes begin and end above `least_rad` and the mask of `rules`.  An object that stays above them
    for longer than `LONG_S`, or all the time, and yields gets the time between the tracked passes.
    """
    air, error = RadioRefraction.standard(site.altitude_m), uncertainty or ElementUncertainty()
    of = {id(wish.target): wish for wish in wishes}
    least = _least(rules.mask, least_rad)
    issued = _Certificates(site, air, rules, (start_t_s, duration_s), max_age_s)
    rest, cut = (start_t_s, encoder_rad), set[int]()
    found = find_catalogue_passes(
        [wish.target for wish in wishes if isinstance(wish.target, Elements)], site, start_t_s, duration_s, least,
        refraction=air, max_age_s=max_age_s,
    )  # fmt: skip
    windows = list(found.passes)
    for wish in wishes:
        if not isinstance(wish.target, Elements):
            windows += issued.passes(wish.target, start_t_s, duration_s, least)
    wanted = [w for w in windows if w.peak_elevation_rad >= of[id(w.target)].min_peak_rad]
    at_once = [_FreeTime(start_t_s, encoder_rad, start_t_s + duration_s, None)]
    wanted = [
        one
        for w in wanted
        for one in (w.rises_before and not _is_long(w) and issued.pieces(w, at_once, 0.0, least, 0.0)) or [w]
    ]
    while True:
        candidates = [_candidate(window, of[id(window.target)].priority, rules) for window in wanted]
        barred = {k: _no_turn(wanted[k], rules.limits) for k, one in enumerate(candidates) if not one.turns}
        while True:
            # A candidate without a turn is never taken.
            left = [dataclasses.replace(one, turns=()) if k in barred else one for k, one in enumerate(candidates)]
            tracked = schedule(left, rules.machine.axes, rest, gap_s)
            certified, failed = issued.of([(k, wanted[k]) for k, _ in tracked], *rest)
            if not failed:
                break
            barred |= failed
        yields = reasons_against(left, tracked, rules.machine.axes, rest, gap_s)
        long = [k for k in yields if _is_long(wanted[k]) and id(wanted[k].target) not in cut]
        if not long:
            break
        # The most wanted one first: what it leaves is the next one's.
        k = max(long, key=lambda k: (candidates[k].priority, candidates[k].peak_rad))
        cut.add(id(wanted[k].target))
        free = _free_times([certified[k][0] for k, _ in tracked], rest, start_t_s + duration_s)
        pieces = issued.pieces(wanted[k], free, gap_s, least, LEAST_PIECE_S)
        wanted = sorted([*wanted[:k], *(pieces or [wanted[k]]), *wanted[k + 1 :]], key=lambda w: w.aos_t_s)
    rows = []
    for k, window in enumerate(wanted):
        fate = Fate.TRACKED if k in certified else Fate.BARRED if k in barred else Fate.YIELDS
        target = window.target
        age_s = abs(window.tca_t_s - target.epoch_t_s) if isinstance(target, Elements) else 0.0
        certificate, profile = certified.get(k, (None, None))
        rows.append(
            DayPass(
                window=window, priority=of[id(target)].priority, fate=fate, age_s=age_s,
                reason=barred.get(k) or yields.get(k, ""),
                along_rad=error.sigmas_m(age_s)[0] / window.tca_range_m if isinstance(target, Elements) else 0.0,
                certificate=certificate, profile=profile, filler=id(target) in cut,
            )
        )  # fmt: skip
    return DayPlan(start_t_s=start_t_s, duration_s=duration_s, passes=tuple(rows), unsearched=found.unsearched)


def _is_long(window: CataloguePass) -> bool:
    """Return whether an object stays up: it lends its time to others and takes what is left."""
    return window.duration_s > LONG_S or (window.rises_before and window.sets_after)


@dataclass(frozen=True)
class _FreeTime:
    """Time between two tracked passes, and where they leave and want the axes; None: anywhere."""

    begin_s: float
    from_rad: Pair
    end_s: float
    to_rad: Pair | None


def _free_times(tracked: Sequence[Certificate], rest: tuple[float, Pair], end_s: float) -> list[_FreeTime]:
    begins = [rest, *((one.los_t_s, one.chosen.end_rad) for one in tracked if one.chosen)]
    ends = [*((one.aos_t_s, one.chosen.start_rad) for one in tracked if one.chosen), (end_s, None)]
    return [_FreeTime(*begin, *end) for begin, end in zip(begins, ends, strict=True)]


def _no_turn(window: CataloguePass, limits: AxisLimits) -> str:
    low, high = (math.degrees(azimuth) for azimuth in window.azimuth_path_rad[1:3])
    travel = f"{math.degrees(limits.azimuth_min_rad):.1f} to {math.degrees(limits.azimuth_max_rad):.1f} deg"
    return f"azimuth {low:.1f} to {high:.1f} deg fits no turn within the travel {travel}"


def _on_every_turn(limits: AxisLimits, azimuth_rad: float, elevation_rad: float) -> list[Pair]:
    """Return the positions of the axes for one direction, on every turn of the travel."""
    path = azimuth_rad, azimuth_rad, azimuth_rad, azimuth_rad
    return [start for start, _ in turns_within(limits, path, (elevation_rad, elevation_rad))]


class _Certificates:
    """Certificates of passes in a row; those whose slew did not change are issued once."""

    def __init__(
        self, site: Site, air: RadioRefraction, rules: PlanningRules, span: tuple[float, float], max_age_s: float
    ) -> None:
        self._site, self._air, self._rules, self._max_age_s = site, air, rules, max_age_s
        # The Sun's ephemeris costs as much as a certificate: once for all passes.
        self._sun = SolarTable(site, air, *span)
        self._issued: dict[tuple[int, float, Pair], tuple[Certificate, PassProfile]] = {}

    def _track(self, target: Elements | TargetSource) -> TopocentricTrack:
        return TopocentricTrack(target, self._site, refraction=self._air, max_age_s=self._max_age_s)

    def passes(
        self, target: Elements | TargetSource, start_s: float, duration_s: float, least: float | Horizon
    ) -> list[CataloguePass]:
        """Return the passes of one target in a time, as the search of one satellite finds them."""
        track = self._track(target)
        return [CataloguePass.of_window(target, track, stay) for stay in find_passes(track, start_s, duration_s, least)]

    def pieces(
        self, window: CataloguePass, free: Sequence[_FreeTime], gap_s: float, least: float | Horizon, shortest_s: float
    ) -> list[CataloguePass]:
        """Return the parts of a stay that fit into free times, with the slews before and after."""
        axes, found = self._rules.machine.axes, list[CataloguePass]()
        for time in free:
            begin_s, end_s = max(time.begin_s, window.aos_t_s), min(time.end_s, window.los_t_s)

            stays: list[CataloguePass] = []
            # A satellite moves on during the slew to it, and what is left may fit more turns.
            while end_s - begin_s > max(shortest_s, LEAST_SEARCH_S):
                stays = self.passes(window.target, begin_s, end_s - begin_s, least)
                if not stays:
                    break
                starts = (turn[0] for turn in _turns(stays[0], self._rules.limits))
                slew_s = min((axes.slew_s(time.from_rad, start) for start in starts), default=math.inf)
                late_s = time.begin_s + gap_s + MARGIN_S + slew_s - stays[0].aos_t_s
                if late_s <= 0.0:
                    break
                begin_s, stays = stays[0].aos_t_s + max(1.0, min(late_s, JOIN_STEP_S)), []
            if stays and time.to_rad is not None:
                ends = (turn[1] for turn in _turns(stays[-1], self._rules.limits))
                slew_s = min((axes.slew_s(end, time.to_rad) for end in ends), default=math.inf)
                end_s = min(end_s, time.end_s - gap_s - MARGIN_S - slew_s)
                lasts = end_s - begin_s > max(shortest_s, LEAST_SEARCH_S)
                stays = self.passes(window.target, begin_s, end_s - begin_s, least) if lasts else []
            if stays and end_s == window.los_t_s:
                # The search ended there; whether the object sets was known before.
                stays[-1] = dataclasses.replace(stays[-1], sets_after=window.sets_after)
            found += stays
        return found

    def of(
        self, windows: Sequence[tuple[int, CataloguePass]], free_t_s: float, encoder_rad: Pair
    ) -> tuple[dict[int, tuple[Certificate, PassProfile]], dict[int, str]]:
        """Return the certificates by number of the pass, and the reasons of passes without one."""
        certified, failed = {}, {}
        for number, window in windows:
            key = id(window), free_t_s, encoder_rad
            if key not in self._issued:
                track = self._track(window.target)
                self._issued[key] = planned_certificate(track, window, free_t_s, encoder_rad, self._rules, self._sun)
            certificate, profile = self._issued[key]
            if certificate.chosen is None:
                failed[number] = certificate.reason
                continue
            certified[number] = certificate, profile
            encoder_rad, free_t_s = certificate.chosen.end_rad, window.los_t_s
        return certified, failed


def _least(mask: HorizonMask, least_rad: float) -> float | Horizon:
    """Return the elevation of rise and set: one number where the mask is flat, which is faster."""
    if len(mask.azimuth_rad) == 1:
        return max(mask.elevation_rad[0] + mask.clearance_rad, least_rad)
    return mask.above(least_rad)


def _turns(window: CataloguePass, limits: AxisLimits) -> tuple[tuple[Pair, Pair], ...]:
    """Return where the axes begin and end a pass on each turn of the travel."""
    elevations = window.aos_elevation_rad, window.los_elevation_rad
    begin, _, _, end = window.azimuth_path_rad
    # A pass that fits no turn waits at a stop or unwinds: it ends on any turn, as its certificate.
    rises, sets = (_on_every_turn(limits, *place) for place in zip((begin, end), elevations, strict=True))
    return turns_within(limits, window.azimuth_path_rad, elevations) or tuple(itertools.product(rises, sets))


def _candidate(window: CataloguePass, priority: int, rules: PlanningRules) -> Candidate:
    return Candidate(
        name=window.name,
        aos_t_s=window.aos_t_s,
        los_t_s=window.los_t_s,
        peak_rad=window.peak_elevation_rad,
        # Above a whole number below: what stays up lends its time to the passes of its priority.
        priority=priority - 0.5 * _is_long(window),
        turns=_turns(window, rules.limits),
    )
