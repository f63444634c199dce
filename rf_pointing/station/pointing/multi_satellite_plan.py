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
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from rf_pointing.core import DAY_S, MU, Array, Pair, RadioRefraction
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
from rf_pointing.ephemeris.stays import Horizon
from rf_pointing.planning import (
    AxisLimits,
    Candidate,
    Certificate,
    HorizonMask,
    PassProfile,
    reasons_against,
    turns_within,
)
from rf_pointing.planning.schedule import Chain, schedule
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
    band: str = ""
    """Band of the contact, "" for that of the antenna."""
    contact_s: float = 0.0
    """Least contact in a day that a network owes it."""


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
    band: str = ""
    """Band that its target names, "" for that of the station."""


@dataclass(frozen=True, kw_only=True)
class DayPlan:
    """All passes in order of rise, and the satellites that were not searched, with the reasons."""

    start_t_s: float
    duration_s: float
    passes: tuple[DayPass, ...]
    unsearched: tuple[tuple[Elements, str], ...]


@dataclass(frozen=True, kw_only=True)
class PlannedAntenna:
    """An antenna to plan for: where it stands, what it may do, and where its axes rest at first.

    Passes begin and end above `least_rad` and the mask of `rules`.
    """

    site: Site
    rules: PlanningRules
    encoder_rad: Pair
    least_rad: float
    of_band: Mapping[str, PlanningRules] = field(default_factory=dict)
    """The rules in each of its bands, for wishes that name one."""
    closed: tuple[Pair, ...] = ()
    """Times of maintenance, begin and end: the axes wait where they rest at first."""


def plan_day(
    wishes: Sequence[Wish], antenna: PlannedAntenna, start_t_s: float, duration_s: float, *,
    gap_s: float = 0.0, max_age_s: float = 14.0 * DAY_S,
) -> DayPlan:  # fmt: skip
    """Return the plan of one antenna that rests at the start.

    An object that stays up for longer than `LONG_S`, or all the time, and yields gets the time
    between the tracked passes.
    """
    day = AntennaDay(wishes, antenna, start_t_s, duration_s, gap_s=gap_s, max_age_s=max_age_s)
    while True:
        _, failed = day.take(list(enumerate(day.wanted)), day.candidates())
        if failed:
            day.barred |= failed
            continue
        k = max(day.long_in_part(), key=day.rank, default=None)
        if k is None:
            return day.plan(day.reasons())
        # The most wanted one first: what it leaves is the next one's.
        day.cut([k])


class AntennaDay:
    """The passes over one antenna in a time, what bars them, and those that it tracks.

    `wanted` are the passes in order of rise; whatever is stated of one goes by its place there.
    """

    def __init__(
        self, wishes: Sequence[Wish], antenna: PlannedAntenna, start_t_s: float, duration_s: float,
        *, gap_s: float, max_age_s: float,
    ) -> None:  # fmt: skip
        self.antenna, self.gap_s = antenna, gap_s
        self._span = start_t_s, duration_s
        self.wish_of = {id(wish.target): wish for wish in wishes}
        self._least = _least(antenna.rules.mask, antenna.least_rad)
        air = RadioRefraction.standard(antenna.site.altitude_m)
        self._issued = _Certificates(antenna, air, self._span, max_age_s, self.wish_of)
        elements = [wish.target for wish in wishes if isinstance(wish.target, Elements)]
        windows, self.unsearched = list[CataloguePass](), tuple[tuple[Elements, str], ...]()
        # The search of a catalogue is for a month at most; one of a body has no such end.
        if elements:
            found = find_catalogue_passes(
                elements, antenna.site, *self._span, self._least, refraction=air, max_age_s=max_age_s
            )
            windows, self.unsearched = list(found.passes), found.unsearched
        for wish in wishes:
            if not isinstance(wish.target, Elements):
                windows += self._issued.passes(wish.target, start_t_s, duration_s, self._least)
        windows = [w for each in windows for w in self._open_parts(each)]
        wanted = [w for w in windows if w.peak_elevation_rad >= self.wish_of[id(w.target)].min_peak_rad]
        self.wanted = self._joined(wanted, lambda window: not _is_long(window))
        self._cut, self._shared = set[int](), set[int]()
        turn = antenna.encoder_rad, antenna.encoder_rad
        self.waits = [
            Candidate(name="maintenance", aos_t_s=begin, los_t_s=end, peak_rad=0.0, priority=math.inf, turns=(turn,))
            for begin, end in antenna.closed
        ]
        """Times of maintenance as candidates that nothing comes before."""
        # What is planned again and again: a cut changes few of ten thousands of passes.
        self._made: dict[tuple[int, bool], tuple[CataloguePass, Candidate]] = {}
        self._known: dict[tuple[bytes, bytes], tuple[list[Candidate], Chain]] = {}
        self._judge()

    def _joined(self, windows: Sequence[CataloguePass], which: Callable[[CataloguePass], bool]) -> list[CataloguePass]:
        """Return the passes; those that last at the start begin when the antenna can be there."""
        at_once = [_FreeTime(*self.rest, sum(self._span), None)]
        found = (
            w.rises_before and which(w) and self._issued.pieces(w, at_once, 0.0, self._least, 0.0) for w in windows
        )
        return [one for each, w in zip(found, windows, strict=True) for one in each or [w]]

    def _judge(self) -> None:
        """Bar what fits no turn; what was barred for its slew may be in time now."""
        self.certified: list[tuple[int, CataloguePass, Certificate, PassProfile]] = []
        self._all = [self.candidate(window) for window in self.wanted]
        limits, turned = self.antenna.rules.limits, zip(self.wanted, self._all, strict=True)
        self.barred = {k: _no_turn(window, limits) for k, (window, one) in enumerate(turned) if not one.turns}

    def _open_parts(self, window: CataloguePass) -> list[CataloguePass]:
        """Return what times of maintenance leave of a pass."""
        begin_s, found = window.aos_t_s, list[CataloguePass]()
        if not any(begin < window.los_t_s and end > window.aos_t_s for begin, end in self.antenna.closed):
            return [window]
        for closed_s, open_s in (*self.antenna.closed, (window.los_t_s, math.inf)):
            end_s = min(closed_s, window.los_t_s)
            if end_s - begin_s > LEAST_SEARCH_S:
                found += self._issued.passes(window.target, begin_s, end_s - begin_s, self._least)
            begin_s = max(begin_s, open_s)
        return found

    def part(self, window: CataloguePass, begin_s: float, end_s: float) -> CataloguePass:
        """Return the part of a pass between two times."""
        if (begin_s, end_s) == (window.aos_t_s, window.los_t_s):
            return window
        found = self._issued.passes(window.target, begin_s, end_s - begin_s, self._least)
        return max(found, key=lambda one: one.duration_s, default=window)

    def look(self, window: CataloguePass, t_s: Array) -> tuple[Array, Array]:
        """Return azimuth, continuous, and elevation of the target of a pass at times (n,)."""
        looks = self._issued.track(window.target).sample(t_s)
        return np.unwrap(looks.azimuth_rad), looks.elevation_rad

    def candidate(self, window: CataloguePass) -> Candidate:
        """Return a pass as the schedule takes it."""
        key, wish = (id(window), self._is_long(window)), self.wish_of[id(window.target)]
        if key not in self._made:
            self._made[key] = window, Candidate(
                name=window.name, aos_t_s=window.aos_t_s, los_t_s=window.los_t_s, peak_rad=window.peak_elevation_rad,
                # Above a whole number below: what stays up lends time to passes of its priority.
                priority=wish.priority - 0.5 * key[1], turns=_turns(window, self.antenna.rules),
                share=_share_to_expect(window, self.antenna.of_band.get(wish.band, self.antenna.rules)),
            )  # fmt: skip
        return self._made[key][1]

    def candidates(self) -> list[Candidate]:
        """Return all passes as candidates, without a turn where they are barred."""
        return [dataclasses.replace(one, turns=()) if k in self.barred else one for k, one in enumerate(self._all)]

    @property
    def rest(self) -> tuple[float, Pair]:
        """Start of the plan, and where the axes rest then."""
        return self._span[0], self.antenna.encoder_rad

    def take(
        self, runs: Sequence[tuple[int, CataloguePass]], candidates: Sequence[Candidate]
    ) -> tuple[list[int], dict[int, str]]:
        """Schedule passes, and certify those of the plan in order of rise.

        Each run is the place of a pass in `wanted`, and that pass or a part of it.  Returns which
        of the runs are in the plan, and why no branch works for some of these.
        """
        everything = [*candidates, *self.waits]
        tracked = schedule(everything, self.antenna.rules.machine.axes, self.rest, self.gap_s, self._known)
        self._tracked = [(everything[k], turn) for k, turn in tracked]
        kept = [k for k, _ in tracked if k < len(runs)]
        self.certified, failed = [], dict[int, str]()
        free_t_s, encoder_rad = self.rest
        for k in kept:
            number, window = runs[k]
            for _, open_s in self.antenna.closed:
                if free_t_s < open_s <= window.aos_t_s:
                    free_t_s, encoder_rad = open_s, self.antenna.encoder_rad
            certificate, profile = self._issued.of(window, free_t_s, encoder_rad)
            if certificate.chosen is None:
                failed[k] = certificate.reason
                continue
            self.certified.append((number, window, certificate, profile))
            encoder_rad, free_t_s = certificate.chosen.end_rad, window.los_t_s
        return kept, failed

    def reasons(self) -> dict[int, str]:
        """Return why passes that are not barred have no part in the plan of `take`."""
        taken = {number for number, *_ in self.certified}
        others = [(k, one) for k, one in enumerate(self.candidates()) if k not in taken and one.turns]
        found = reasons_against(
            [*(one for one, _ in self._tracked), *(one for _, one in others)],
            [(place, turn) for place, (_, turn) in enumerate(self._tracked)],
            self.antenna.rules.machine.axes, self.rest, self.gap_s,
        )  # fmt: skip
        return {k: found[place] for place, (k, _) in enumerate(others, start=len(self._tracked))}

    @property
    def lasting(self) -> set[int]:
        """Targets (by identity) that stay up for long over this antenna."""
        return {id(window.target) for window in self.wanted if _is_long(window)}

    def share(self, lasting: set[int]) -> None:
        """Rank all passes of these targets below others: over one of the antennas they last."""
        self._shared, self.wanted = lasting, self._joined(self.wanted, _is_long)
        self._judge()

    def long_in_part(self) -> list[int]:
        """Return long stays that yield, or are tracked in part, and are not cut into pieces yet."""
        tracked_s: dict[int, float] = {}
        for k, window, *_ in self.certified:
            tracked_s[k] = tracked_s.get(k, 0.0) + window.duration_s
        return [
            k for k, window in enumerate(self.wanted)
            if self._is_long(window) and id(window.target) not in self._cut and (k in tracked_s or k not in self.barred)
            and tracked_s.get(k, 0.0) < window.duration_s - LEAST_PIECE_S
        ]  # fmt: skip

    def _is_long(self, window: CataloguePass) -> bool:
        return _is_long(window) or id(window.target) in self._shared

    def rank(self, k: int) -> Pair:
        """Return how much a pass is wanted."""
        window = self.wanted[k]
        return self.wish_of[id(window.target)].priority, window.peak_elevation_rad

    def _held(self, but: int) -> list[tuple[float, float, Pair, Pair]]:
        """Return times and ends of what is tracked, but for one pass that is cut anew."""
        return [
            (one.aos_t_s, one.los_t_s, one.chosen.start_rad, one.chosen.end_rad)
            for k, _, one, _ in self.certified if one.chosen and k != but
        ]  # fmt: skip

    def cut(self, numbers: Collection[int]) -> None:
        """Cut stays into pieces that fit between the certified passes."""
        found, at_rest = [], (self.antenna.encoder_rad, self.antenna.encoder_rad)
        closed = [(begin, end, *at_rest) for begin, end in self.antenna.closed]
        for k, window in enumerate(self.wanted):
            pieces = []
            if k in numbers:
                free = _free_times(sorted([*closed, *self._held(k)]), self.rest, sum(self._span))
                pieces = self._issued.pieces(window, free, self.gap_s, self._least, LEAST_PIECE_S)
            found += pieces or [window]
        self._cut |= {id(self.wanted[k].target) for k in numbers}
        self.wanted = sorted(found, key=lambda window: window.aos_t_s)
        self._judge()

    def plan(self, yields: Mapping[int, str]) -> DayPlan:
        """Return the plan: the certified passes, and the reasons against the others."""
        rows = [self._row(k, window, Fate.TRACKED, "", certificate, profile)
                for k, window, certificate, profile in self.certified]  # fmt: skip
        taken = {k for k, *_ in self.certified}
        for k, window in enumerate(self.wanted):
            reason = self.barred.get(k) or yields.get(k, "")
            if k not in taken:
                rows.append(self._row(k, window, Fate.BARRED if k in self.barred else Fate.YIELDS, reason))
        return DayPlan(
            start_t_s=self._span[0], duration_s=self._span[1], unsearched=self.unsearched,
            passes=tuple(row for _, row in sorted(rows, key=lambda each: (each[0], each[1].window.aos_t_s))),
        )  # fmt: skip

    def _row(
        self, k: int, window: CataloguePass, fate: Fate, reason: str, certificate: Certificate | None = None,
        profile: PassProfile | None = None,
    ) -> tuple[int, DayPass]:  # fmt: skip
        target = window.target
        age_s = abs(window.tca_t_s - target.epoch_t_s) if isinstance(target, Elements) else 0.0
        wish = self.wish_of[id(target)]
        return k, DayPass(
            window=window, priority=wish.priority, fate=fate, age_s=age_s, reason=reason,
            along_rad=_sigmas_rad(window)[0], certificate=certificate, profile=profile, filler=id(target) in self._cut,
            band=wish.band,
        )  # fmt: skip


def _sigmas_rad(window: CataloguePass) -> Pair:
    """Return one sigma along the track and across it where it is closest, by the age."""
    if not isinstance(window.target, Elements):
        return 0.0, 0.0
    along_m, cross_m, _ = ElementUncertainty().sigmas_m(window.tca_t_s - window.target.epoch_t_s)
    return along_m / window.tca_range_m, cross_m / window.tca_range_m


def _share_to_expect(window: CataloguePass, rules: PlanningRules) -> float:
    """Return the share of a pass that is received, on average over the errors of its elements."""
    beam, (along, cross) = rules.machine.half_power_beamwidth_rad, _sigmas_rad(window)
    if not rules.swept_rad2_s:
        # The mean of a Gaussian beam over normal errors.
        wider = math.prod(1.0 + 2.0 * MU * (sigma / beam) ** 2 for sigma in (along, cross))
        return 1.0 / math.sqrt(wider)
    # Swept outward from where it is expected, past what the beam sees at once.
    area = 2.0 * math.pi * along * max(cross, 0.25 * beam)
    beyond = math.exp(-0.25 * math.pi * beam**2 / area) if area else 0.0
    return max(0.0, 1.0 - area * beyond / (rules.swept_rad2_s * window.duration_s))


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


def _free_times(
    held: Sequence[tuple[float, float, Pair, Pair]], rest: tuple[float, Pair], end_s: float
) -> list[_FreeTime]:
    """Return the times between what is held: begins, ends, and where the axes are then."""
    begins = [rest, *((los_s, end_rad) for _, los_s, _, end_rad in held)]
    ends = [*((aos_s, start_rad) for aos_s, _, start_rad, _ in held), (end_s, None)]
    return [_FreeTime(*begin, *end) for begin, end in zip(begins, ends, strict=True)]


def _no_turn(window: CataloguePass, limits: AxisLimits) -> str:
    low, high = (math.degrees(azimuth) for azimuth in window.azimuth_path_rad[1:3])
    travel = f"{math.degrees(limits.azimuth_min_rad):.1f} to {math.degrees(limits.azimuth_max_rad):.1f} deg"
    return f"azimuth {low:.1f} to {high:.1f} deg fits no turn within the travel {travel}"


class _Certificates:
    """Certificates of passes in a row; those whose slew did not change are issued once."""

    def __init__(
        self, antenna: PlannedAntenna, air: RadioRefraction, span: Pair, max_age_s: float, wish_of: Mapping[int, Wish]
    ) -> None:
        self._antenna, self._air, self._max_age_s, self._wish_of = antenna, air, max_age_s, wish_of
        self._rules = antenna.rules
        # The Sun's ephemeris costs as much as a certificate: once for all passes.
        self._sun = SolarTable(antenna.site, air, *span)
        # With the pass: another one must not come to its place in memory.
        self._issued: dict[tuple[int, float, Pair], tuple[CataloguePass, tuple[Certificate, PassProfile]]] = {}

    def track(self, target: Elements | TargetSource) -> TopocentricTrack:
        """Return the motion of a target over the antenna."""
        return TopocentricTrack(target, self._antenna.site, refraction=self._air, max_age_s=self._max_age_s)

    def passes(
        self, target: Elements | TargetSource, start_s: float, duration_s: float, least: float | Horizon
    ) -> list[CataloguePass]:
        """Return the passes of one target in a time, as the search of one satellite finds them."""
        track = self.track(target)
        return [CataloguePass.of_window(target, track, stay) for stay in find_passes(track, start_s, duration_s, least)]

    def pieces(
        self, window: CataloguePass, free: Sequence[_FreeTime], gap_s: float, least: float | Horizon, shortest_s: float
    ) -> list[CataloguePass]:
        """Return the parts of a stay that fit into free times, with the slews before and after."""
        found = list[CataloguePass]()
        for time in free:
            begin_s, end_s = max(time.begin_s, window.aos_t_s), min(time.end_s, window.los_t_s)

            stays: list[CataloguePass] = []
            # A satellite moves on during the slew to it, and what is left may fit more turns.
            while end_s - begin_s > max(shortest_s, LEAST_SEARCH_S):
                stays = self.passes(window.target, begin_s, end_s - begin_s, least)
                if not stays:
                    break
                slews_s = self._slews_s(stays[0], time)
                late_s = time.begin_s + gap_s + MARGIN_S + slews_s[0] - stays[0].aos_t_s
                if late_s <= 0.0:
                    break
                begin_s, stays = stays[0].aos_t_s + max(1.0, min(late_s, JOIN_STEP_S)), []
            if stays and time.to_rad is not None:
                end_s = min(end_s, time.end_s - gap_s - MARGIN_S - self._slews_s(stays[-1], time)[1])
                lasts = end_s - begin_s > max(shortest_s, LEAST_SEARCH_S)
                stays = self.passes(window.target, begin_s, end_s - begin_s, least) if lasts else []
            if stays and end_s == window.los_t_s:
                # The search ended there; whether the object sets was known before.
                stays[-1] = dataclasses.replace(stays[-1], sets_after=window.sets_after)
            found += stays
        return found

    def _slews_s(self, stay: CataloguePass, time: _FreeTime) -> Pair:
        """Return the slews to a stay, on the nearest turn as a certificate has it, and from it."""
        axes, slews = self._rules.machine.axes, list[Pair]()
        for start, end in _turns(stay, self._rules):
            after_s = axes.slew_s(end, time.to_rad) if time.to_rad is not None else 0.0
            slews.append((axes.slew_s(time.from_rad, start), after_s))
        return min(slews, default=(math.inf, math.inf))

    def of(self, window: CataloguePass, free_t_s: float, encoder_rad: Pair) -> tuple[Certificate, PassProfile]:
        """Return certificate and motion of a pass; the axes are free somewhere from a time on."""
        key = id(window), free_t_s, encoder_rad
        if key not in self._issued:
            rules = self._antenna.of_band.get(self._wish_of[id(window.target)].band, self._rules)
            track = self.track(window.target)
            issued = planned_certificate(track, window, free_t_s, encoder_rad, rules, self._sun)
            self._issued[key] = window, issued
        return self._issued[key][1]


def _least(mask: HorizonMask, least_rad: float) -> float | Horizon:
    """Return the elevation of rise and set: one number where the mask is flat, which is faster."""
    if len(mask.azimuth_rad) == 1:
        return max(mask.elevation_rad[0] + mask.clearance_rad, least_rad)
    return mask.above(least_rad)


def turns_of(
    rules: PlanningRules, path: tuple[float, float, float, float], elevations: Pair
) -> tuple[tuple[Pair, Pair], ...]:
    """Return where the axes begin and end a pass on each turn of the travel."""
    # A pass that fits no turn waits at a stop or unwinds: it ends on any turn, as its certificate.
    ends = ((path[0], elevations[0]), (path[3], elevations[1]))
    limits, mount = rules.limits, rules.mount
    rises, sets = ([start for start, _ in turns_within(limits, (az,) * 4, (el, el), mount)] for az, el in ends)
    return turns_within(limits, path, elevations, mount) or tuple(itertools.product(rises, sets))


def _turns(window: CataloguePass, rules: PlanningRules) -> tuple[tuple[Pair, Pair], ...]:
    return turns_of(rules, window.azimuth_path_rad, (window.aos_elevation_rad, window.los_elevation_rad))
