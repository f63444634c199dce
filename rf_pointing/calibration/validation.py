"""First level of the pipeline: time, transmission and quality of raw samples (SATCAL 3)."""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.raw_tracking import RawTracking, StageReport
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S

__all__ = ["validate"]

Array = NDArray[np.float64]

_NEIGHBOURS = 2
_JUMP_STEPS = 2.5
_MARGIN_S = 0.1


def validate(raw: RawTracking, reference: ReferenceTrack) -> tuple[NDArray[np.bool_], StageReport]:
    """Return which samples are sound (n,) and why the others are not; each sample counts under one reason only.

    A time is a jump when it is far from the median of its neighbours: one wrong time tag does not condemn the
    samples after it, as a plain "must increase" would.
    """
    keep, dropped = np.ones(len(raw), dtype=bool), {}
    finite = np.isfinite(raw.t_s) & np.all([np.isfinite(value) for value in raw.channels.values()], axis=0)
    checks = (
        ("flagged by the station", ~raw.good),
        ("not finite", ~finite),
        ("angle out of range", _out_of_range(raw)),
    )
    for reason, wrong in checks:
        dropped[reason] = int(np.sum(keep & wrong))
        keep &= ~wrong
    for reason, find in (("time jump", _jumps), ("repeated time", _repeats), ("time not increasing", _backward)):
        rows = np.flatnonzero(keep)
        wrong_rows = rows[find(raw.t_s[rows])]
        keep[wrong_rows] = False
        dropped[reason] = len(wrong_rows)
    rows = np.flatnonzero(keep)
    latest = np.max(reference.range_m) / SPEED_OF_LIGHT_M_S + _MARGIN_S
    inside = reference.covers(raw.t_s[rows]) & reference.covers(raw.t_s[rows] - latest)
    keep[rows[~inside]] = False
    dropped["outside the reference orbit"] = int(np.sum(~inside))
    report = StageReport(stage="validation", before=len(raw), after=int(np.sum(keep)), dropped=dropped)
    return keep, report


def _out_of_range(raw: RawTracking) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):
        wrong: NDArray[np.bool_] = np.abs(raw.azimuth_rad) > 3.0 * np.pi
        wrong |= (raw.elevation_rad < -np.pi / 2.0) | (raw.elevation_rad > np.pi)
        if raw.range_m is not None:
            wrong |= raw.range_m <= 0.0
    return wrong


def _jumps(t_s: Array) -> NDArray[np.bool_]:
    if len(t_s) < 2 * _NEIGHBOURS + 1:
        return np.zeros(len(t_s), dtype=bool)
    padded = np.concatenate([t_s[:_NEIGHBOURS][::-1], t_s, t_s[-_NEIGHBOURS:][::-1]])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1)
    step = np.median(np.abs(np.diff(t_s)))
    return np.asarray(np.abs(t_s - np.median(windows, axis=1)) > _JUMP_STEPS * step)


def _repeats(t_s: Array) -> NDArray[np.bool_]:
    wrong = np.ones(len(t_s), dtype=bool)
    wrong[np.unique(t_s, return_index=True)[1]] = False
    return wrong


def _backward(t_s: Array) -> NDArray[np.bool_]:
    before = np.concatenate([[-np.inf], np.maximum.accumulate(t_s)[:-1]])
    return np.asarray(t_s <= before)
