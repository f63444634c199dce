"""A campaign: the fewest passes that fill every sector of the sky at the earliest possible time.

Going through the passes in order of time, of two that overlap the one with more points where they are still missing
is taken.  When the last sector is full, passes whose points others make up for are struck out again, the poorest first.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.candidate_pass import CandidatePass
from rf_pointing.calibration.coverage import Coverage, SectorRule
from rf_pointing.geometry import require_between

__all__ = ["Campaign", "plan_campaign"]

Counts = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Campaign:
    """Passes to track in order of time, what they fill, and when the last sector is full (None: never)."""

    passes: tuple[CandidatePass, ...]
    coverage: Coverage
    full_at_t_s: float | None


def plan_campaign(candidates: Sequence[CandidatePass], rule: SectorRule, *, turnaround_s: float) -> Campaign:
    """Return the campaign; `turnaround_s` is the time the antenna needs between two passes.

    Where the candidates cannot fill the sky, all useful passes are returned, `full_at_t_s` is None and the coverage
    names the thin sectors.
    """
    require_between("turnaround_s", turnaround_s, 0.0, None)
    counts = {id(c): rule.coverage(c.track.azimuth_rad, c.track.elevation_rad).counts for c in candidates}
    taken: list[CandidatePass] = []
    filled = np.zeros(rule.count, dtype=np.int64)
    full_at = None
    for candidate in sorted(candidates, key=lambda c: c.end_t_s):
        rivals = [other for other in taken if other.end_t_s + turnaround_s > candidate.start_t_s]
        theirs = np.zeros(rule.count, dtype=np.int64)
        for rival in rivals:
            theirs += counts[id(rival)]
        without = filled - theirs
        if _gain(without, counts[id(candidate)], rule) <= _gain(without, theirs, rule):
            continue
        taken = [*taken[: len(taken) - len(rivals)], candidate]
        filled = without + counts[id(candidate)]
        if np.all(filled >= rule.fewest):
            full_at = candidate.end_t_s
            break
    if full_at is not None:
        taken, filled = _without_needless(taken, filled, counts, rule)
    return Campaign(tuple(taken), Coverage(rule, filled), full_at)


def _gain(filled: Counts, more: Counts, rule: SectorRule) -> int:
    """Return how many points a pass brings where they are missing."""
    return int(np.sum(np.minimum(more, np.maximum(rule.fewest - filled, 0))))


def _without_needless(
    taken: list[CandidatePass], filled: Counts, counts: dict[int, Counts], rule: SectorRule
) -> tuple[list[CandidatePass], Counts]:
    for candidate in sorted(taken, key=lambda c: int(np.sum(counts[id(c)]))):
        reduced = filled - counts[id(candidate)]
        if np.all(reduced >= rule.fewest):
            taken, filled = [other for other in taken if other is not candidate], reduced
    return taken, filled
