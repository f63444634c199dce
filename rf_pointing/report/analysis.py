"""What table and pictures share: modes, errors, the tracked pass and when the beam was acquired."""

from dataclasses import dataclass

import numpy as np

from rf_pointing.core import MDEG
from rf_pointing.report.error_series import ErrorSeries, error_series
from rf_pointing.report.recording import Pass, Recording
from rf_pointing.report.summary import Acquisition
from rf_pointing.report.timeline import RF_MODES, TRACKING_MODES, Timeline, timeline

__all__ = ["Analysis", "analyse", "tracked_pass"]

_SETTLED_BEAMWIDTHS = 0.1
_SETTLED_IN_A_ROW = 5


@dataclass(frozen=True)
class Analysis:
    """A recording and what was derived from it once; a part is None where the recording does not give it.

    `acquired_ns` is the stamp at which the RF loop had settled.
    """

    recording: Recording
    modes: Timeline | None
    errors: ErrorSeries | None
    target_pass: Pass | None
    acquired_ns: int | None
    acquisition: Acquisition


def analyse(recording: Recording) -> Analysis:
    """Return the analysis of `recording`."""
    modes = timeline(recording)
    acquired_ns, acquisition = _acquisition(recording, modes)
    return Analysis(
        recording=recording,
        modes=modes,
        errors=error_series(recording, modes),
        target_pass=tracked_pass(recording, modes),
        acquired_ns=acquired_ns,
        acquisition=acquisition,
    )


def tracked_pass(recording: Recording, modes: Timeline | None) -> Pass | None:
    """Return the announced pass that overlaps the tracking most, None when no announced one does."""
    if modes is None:
        return None
    spans = [(i.start_ns, i.end_ns) for i in modes.intervals() if i.mode in TRACKING_MODES]

    def overlap_ns(item: Pass) -> int:
        return sum(max(0, min(end, item.los_ns) - max(start, item.aos_ns)) for start, end in spans)

    best = max(recording.passes, key=overlap_ns, default=None)
    return best if best is not None and overlap_ns(best) > 0 else None


def _acquisition(recording: Recording, modes: Timeline | None) -> tuple[int | None, Acquisition]:
    """Return the stamp of the first settled sensor error, and the times from AOS.

    Settled: while a sensor closes the loop, the first of five successive valid errors below a tenth of a beamwidth.
    """
    sensed = recording.get("pointing_error")
    begin, name = _begin(recording, modes)
    if sensed is None or sensed.stamp_ns is None or modes is None or begin is None:
        nothing = Acquisition(measured_from=name, first_valid_s=None, settled_s=None, settled_below_mdeg=None)
        return None, nothing
    order = np.argsort(sensed.stamp_ns, kind="stable")
    order = order[sensed["valid"][order] & (sensed.stamp_ns[order] >= begin)]
    stamps = sensed.stamp_ns[order]
    limit = _SETTLED_BEAMWIDTHS * modes.beamwidth_rad_at(stamps)
    small = np.hypot(sensed["cross_elevation"], sensed["elevation"])[order] < limit
    small &= np.isin(modes.mode_at(stamps), RF_MODES)
    run = np.convolve(small, np.ones(_SETTLED_IN_A_ROW, dtype=np.int64), mode="valid") if len(small) else small
    settled = stamps[np.flatnonzero(run == _SETTLED_IN_A_ROW)[:1]]
    return (int(settled[0]) if len(settled) else None), Acquisition(
        measured_from=name,
        first_valid_s=float(stamps[0] - begin) * 1e-9 if len(stamps) else None,
        settled_s=float(settled[0] - begin) * 1e-9 if len(settled) else None,
        settled_below_mdeg=float(limit[0] / MDEG) if len(limit) else None,
    )


def _begin(recording: Recording, modes: Timeline | None) -> tuple[int | None, str]:
    found = tracked_pass(recording, modes)
    if found is not None:
        return found.aos_ns, "acquisition of signal"
    spans = modes.intervals() if modes is not None else []
    return next((i.start_ns for i in spans if i.mode in TRACKING_MODES), None), "start of tracking"
