"""Which passes to track: those that fill the sky soonest, or those that shrink chosen sigmas most.

`plan_campaign` makes two greedy plans and takes the one that ends first.  One goes through the
candidates in order of time and, of those that overlap, keeps the one with more points in thin
sectors: good for few passes.  The other continues with the candidate that brings most of the
missing points per second after the last one, slew included: good for many.  When the last sector is
full, passes that the others make up for are removed again, the poorest first.

`next_best_passes` needs no measurement: a pass with weighted partials A, its own orbit and clock
errors eliminated, turns the covariance C of the terms into

    C' = C - C A' (1 + A C A')^-1 A C

It takes the best pass first, then the best one given the first, and so on.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.angles import REFERENCE_TEMPERATURE_K
from rf_pointing.calibration.coverage import Coverage, SectorRule
from rf_pointing.calibration.fit import held_at_zero
from rf_pointing.calibration.fit_problem import FitProblem
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.calibration.terms import terms_by_name
from rf_pointing.core import Array, Pair, Params, parameter, require_between


@dataclass(frozen=True, kw_only=True, eq=False)
class CandidatePass:
    """A predicted pass: `track` at the times of its points, and their sigma in both axes."""

    name: str
    track: ReferenceTrack
    sigma_rad: float

    @property
    def start_t_s(self) -> float:
        """Return the time of the first point."""
        return float(self.track.t_s[0])

    @property
    def end_t_s(self) -> float:
        """Return the time of the last point."""
        return float(self.track.t_s[-1])

    def observations(self, station: str, band: str, pass_id: int) -> Observations:
        """Return the points without noise and bias, for the fit's partial derivatives."""
        track, sigma = self.track, np.full(len(self.track.t_s), self.sigma_rad)
        return Observations(
            station=station, band=band, t_s=track.t_s, pass_id=np.full(len(sigma), pass_id),
            observed_azimuth_rad=track.azimuth_rad, observed_elevation_rad=track.elevation_rad,
            sigma_azimuth_rad=sigma, sigma_elevation_rad=sigma, mount=track.mount, **track.truth(),
        )  # fmt: skip


Counts = NDArray[np.int64]
Plan = tuple[list[int], Counts, float | None]

_TURN = 2.0 * math.pi


@dataclass(frozen=True, kw_only=True)
class Slew(Params):
    """Time from the last point of a pass to the first of the next: the slower axis, and the rest.

    `travel_rad` are the ends of the azimuth travel: cables may rule out the shorter direction.
    """

    rate_rad_s: float = parameter(math.radians(1.8), "mean axis rate of a slew", 1e-5, 10.0)
    settle_s: float = parameter(30.0, "stop, settling and acquisition", 0.0, 3600.0)
    travel_rad: tuple[float, ...] = parameter(
        (), "lower and upper end of the azimuth travel; none: unlimited", -20.0, 20.0
    )

    def check_together(self) -> None:
        """Refuse a travel that is not a pair."""
        # Less than a turn is right: the axes of an X-Y mount stop short of the horizon.
        if self.travel_rad and (
            len(self.travel_rad) != 2 or self.travel_rad[1] <= self.travel_rad[0]
        ):
            raise ValueError(f"travel_rad={self.travel_rad} must be two ends, the lower one first")

    def ends_rad(self, azimuth_rad: Array) -> Pair:
        """Return first and last azimuth of a pass (n,) on the turn that fits the travel best."""
        # The ends of a pass across north are on the turns of the cable, not on those of the sky.
        path = np.unwrap(azimuth_rad)
        if self.travel_rad:
            low, high = self.travel_rad
            turns = _TURN * (np.arange(-2.0, 3.0) - np.floor(path[0] / _TURN))
            outside = np.maximum(low - np.min(path) - turns, 0.0) + np.maximum(
                np.max(path) + turns - high, 0.0
            )
            path = path + turns[np.lexsort((np.abs(path[0] + turns), outside))[0]]
        return float(path[0]), float(path[-1])

    def time_s(self, ends_rad: Array, starts_rad: Array) -> Array:
        """Return the time between directions (..., 2); without limits by the shorter azimuth."""
        # Both axes move at once: the slower one decides.
        azimuth, elevation = np.moveaxis(np.abs(starts_rad - ends_rad), -1, 0)
        if not self.travel_rad:
            azimuth = np.abs(np.mod(azimuth + np.pi, _TURN) - np.pi)
        return np.asarray(np.maximum(azimuth, elevation) / self.rate_rad_s + self.settle_s)

    def allows(self, one: CandidatePass, other: CandidatePass) -> bool:
        """Return whether one antenna can track both."""
        # From the end of one to the start of the other: the gap between them must hold the slew.
        first, then = sorted((one, other), key=lambda candidate: candidate.start_t_s)
        end = np.array([self.ends_rad(first.track.azimuth_rad)[1], first.track.elevation_rad[-1]])
        start = np.array([self.ends_rad(then.track.azimuth_rad)[0], then.track.elevation_rad[0]])
        return bool(then.start_t_s - first.end_t_s >= self.time_s(end, start))


@dataclass(frozen=True, eq=False)
class Campaign:
    """Passes to track in order of time, what they fill, and when the sky is full (None: never)."""

    passes: tuple[CandidatePass, ...]
    coverage: Coverage
    full_at_t_s: float | None


def plan_campaign(
    candidates: Sequence[CandidatePass], rule: SectorRule, slew: Slew, already: Counts | None = None
) -> Campaign:
    """Return the campaign; candidates may be whole passes or pieces of them.

    `already` (sectors,) are the points that an interrupted campaign has taken; the coverage counts
    them.  Where the candidates cannot fill the sky, all useful passes are returned, `full_at_t_s`
    is None and the coverage names the thin sectors.
    """
    # An interrupted campaign continues where it was, so its points count before the first pass.
    begun = np.zeros(rule.count, dtype=np.int64) if already is None else already
    if not candidates:
        return Campaign((), Coverage(rule, begun), None)
    table = _Table(sorted(candidates, key=lambda c: c.end_t_s), rule, slew, begun)
    # Neither plan is always the better one, and both cost little next to the candidates' tracks.
    plans = [table.by_exchange(), table.by_rate()]
    # Where neither fills the sky, the plan that brings more of the missing points.
    taken, filled, full_at = min(
        plans, key=lambda plan: (plan[2] or math.inf, -table.gain(begun, plan[1] - begun))
    )
    if full_at is not None:
        taken, filled = table.without_needless(taken, filled)
    return Campaign(tuple(table.candidates[k] for k in taken), Coverage(rule, filled), full_at)


class _Table:
    """Times, directions at both ends and points per sector of all candidates, by their end."""

    def __init__(
        self, candidates: Sequence[CandidatePass], rule: SectorRule, slew: Slew, begun: Counts
    ) -> None:
        self._begun = begun
        self.candidates, self._rule, self._slew = candidates, rule, slew
        tracks = [c.track for c in candidates]
        self._start = np.array([c.start_t_s for c in candidates])
        self._end = np.array([c.end_t_s for c in candidates])
        azimuth = np.array([slew.ends_rad(t.azimuth_rad) for t in tracks])
        elevation = np.array([(t.elevation_rad[0], t.elevation_rad[-1]) for t in tracks])
        self._from, self._to = np.moveaxis(np.stack([azimuth, elevation], axis=-1), 1, 0)
        self._counts = np.array([rule.coverage(*t.sky_rad()).counts for t in tracks])

    def gain(self, filled: Counts, more: Counts) -> Counts:
        """Return how many points `more` (..., sectors) brings where they are missing."""
        # Points beyond the required ones are worth nothing, however many a pass brings.
        missing = np.maximum(self._rule.fewest - filled, 0)
        return np.asarray(np.sum(np.minimum(more, missing), axis=-1))

    def by_exchange(self) -> Plan:
        """Take candidates in order of their end, each in place of poorer ones that it overlaps."""
        taken: list[int] = []
        filled = self._begun
        for k in range(len(self.candidates)):
            ready = self._end[taken] + self._slew.time_s(self._to[taken], self._from[k])
            # One candidate may exclude several: it must be worth more than all of them.
            rivals = [
                other for other, t_s in zip(taken, ready, strict=True) if t_s > self._start[k]
            ]
            theirs: Counts = np.sum(self._counts[rivals], axis=0, dtype=np.int64)
            without = filled - theirs
            if self.gain(without, self._counts[k]) <= self.gain(without, theirs):
                continue
            taken = [*(other for other in taken if other not in rivals), k]
            filled = without + self._counts[k]
            if self._full(filled):
                return taken, filled, float(self._end[k])
        return taken, filled, None

    def by_rate(self) -> Plan:
        """Continue with the candidate that brings most missing points per second."""
        taken: list[int] = []
        filled = self._begun
        now_s, ready = float(np.min(self._start)), np.full(len(self.candidates), -np.inf)
        while not self._full(filled):
            # Until its end: waiting for a rich pass is weighed against a poor one now.
            rate = self.gain(filled, self._counts) / np.maximum(self._end - now_s, 1e-9)
            rate[self._start < ready] = 0.0
            best = int(np.argmax(rate))
            # No reachable candidate brings a missing point any more.
            if rate[best] <= 0.0:
                return taken, filled, None
            taken.append(best)
            filled = filled + self._counts[best]
            now_s = float(self._end[best])
            ready = now_s + self._slew.time_s(self._to[best], self._from)
        return taken, filled, now_s

    def without_needless(self, taken: list[int], filled: Counts) -> tuple[list[int], Counts]:
        """Remove what the others make up for, the poorest first."""
        for k in sorted(taken, key=lambda k: int(np.sum(self._counts[k]))):
            reduced = filled - self._counts[k]
            if self._full(reduced):
                taken, filled = [other for other in taken if other != k], reduced
        return taken, filled

    def _full(self, filled: Counts) -> bool:
        return bool(np.all(filled >= self._rule.fewest))


@dataclass(frozen=True, eq=False)
class PassAdvice:
    """One pass worth tracking: sigma (k,) of all terms after it, mean factor on the chosen ones."""

    candidate: CandidatePass
    sigma: Array
    factor: float

    @property
    def name(self) -> str:
        """Name of the satellite."""
        return self.candidate.name

    @property
    def start_t_s(self) -> float:
        """Time of the first point."""
        return self.candidate.start_t_s


def uninformed_covariance(terms: Sequence[str]) -> Array:
    """Return the covariance before any calibration: the largest credible sizes as sigma."""
    return np.diag([term.limit**2 for term in terms_by_name(terms)])


def next_best_passes(
    terms: Sequence[str], covariance: Array, candidates: Sequence[CandidatePass], *,
    chosen: Sequence[str], count: int, pass_priors: PassPriors | None = None,
    slew: Slew | None = None,
) -> list[PassAdvice]:  # fmt: skip
    """Return up to `count` passes, the best first, that most reduce the `chosen` terms' sigma.

    `covariance` (k, k) is that of the last fit, or `uninformed_covariance`.  Passes that overlap a
    better one, or begin before the antenna can have slewed there, are left out.  Raises ValueError
    for `chosen` that are not in `terms`.
    """
    require_between("count", count, 1, None)
    places = _places(terms, chosen)
    information = [_information(tuple(terms), candidate, pass_priors) for candidate in candidates]
    reach = slew or Slew()
    left, present = list(range(len(candidates))), np.asarray(covariance, dtype=np.float64)
    advice: list[PassAdvice] = []
    while left and len(advice) < count:
        after = {k: _updated(present, information[k]) for k in left}
        best = min(left, key=lambda k: _factor(after[k], present, places))
        factor = _factor(after[best], present, places)
        # Given this one: two good passes of one sky add less than each alone.
        present = after[best]
        left = [k for k in left if k != best and reach.allows(candidates[k], candidates[best])]
        advice.append(PassAdvice(candidates[best], np.sqrt(np.diag(present)), factor))
    return advice


def _places(terms: Sequence[str], chosen: Sequence[str]) -> NDArray[np.int64]:
    astray = [name for name in chosen if name not in terms]
    if astray or not chosen:
        raise ValueError(
            f"chosen={', '.join(chosen) or 'nothing'} must name terms among {', '.join(terms)}"
        )
    return np.array([list(terms).index(name) for name in chosen], dtype=np.int64)


def _information(
    terms: tuple[str, ...], candidate: CandidatePass, pass_priors: PassPriors | None
) -> Array:
    """Return rows (m, k) whose squares are the information of a pass about the terms."""
    data = candidate.observations("planned", "planned", 0)
    # At the reference of the thermal terms, of which a plan can promise nothing.
    data = replace(data, temperature_k=np.full(len(data), REFERENCE_TEMPERATURE_K))
    problem = FitProblem(data, terms, held_at_zero(terms), {}, pass_priors, "printed")
    one = np.ones(len(data))
    equations, _ = problem.equations(np.zeros(len(terms)), one.astype(bool), one)
    return equations.factor[:, :-1]


def _updated(covariance: Array, rows: Array) -> Array:
    seen = covariance @ rows.T
    # In the size of the pass's rows, and not by inverting C, which may be nearly singular.
    inner = np.eye(len(rows)) + rows @ seen
    return np.asarray(covariance - seen @ np.linalg.solve(inner, seen.T))


def _factor(after: Array, before: Array, places: NDArray[np.int64]) -> float:
    ratio = np.diag(after)[places] / np.diag(before)[places]
    return float(np.mean(np.sqrt(np.maximum(ratio, 0.0))))
