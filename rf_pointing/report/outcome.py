"""Outcome of a recorded pass by the definition of `core/pass_outcome.py`, and its prediction.

Three answers to the same questions: as flown (from the true error, which only a simulation knows),
as the controller counted it (from axes, sensor and carrier), and as the certificate predicted it.
The verdict is that of the flight where the truth is known, else the controller's.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from rf_pointing.core import LEAST_SHARE, LOSS_OF_SIGNAL, OF_ANTENNA, IntArray, PassOutcome
from rf_pointing.core.whole_file import parse_json, read_whole
from rf_pointing.report.analysis import Analysis
from rf_pointing.report.recording import Pass
from rf_pointing.report.summary import OutcomeNumbers, Verdict
from rf_pointing.report.topics import TopicData

# Nothing says why the pass ended: the controller was killed, or the recording is cut short.
CUT_SHORT = "the recording ends before the loss of signal"
ERROR_LEVEL = 2


def verdict(analysis: Analysis) -> Verdict:
    """Return what the tracked pass gave; without a tracked pass only the faults."""
    found, status, faults = analysis.target_pass, analysis.recording.get("tracking_status"), recorded_faults(analysis)
    if found is None or status is None or status.stamp_ns is None:
        return Verdict(faults=faults)
    order = np.argsort(status.stamp_ns, kind="stable")
    stamps, targets = status.stamp_ns[order], status["target"][order]
    busy = np.flatnonzero(targets != "")
    begin_ns, last = max(found.aos_ns, int(stamps[busy[0]])), int(busy[-1])
    ended = last + 1 < len(stamps)
    end_ns = min(found.los_ns, int(stamps[last + 1 if ended else last]))
    reason = str(status["reason"][order][last + 1]) if ended else CUT_SHORT
    counted = _counted(status, order[last : last + 2])
    predicted, least_share = _predicted(analysis, found)
    flown = _flown(analysis, begin_ns, end_ns)
    judged = flown or counted
    # What ended the pass is its fault; one that was reset before it began is not.
    fault = reason if any(reason in (text, OF_ANTENNA + text) for text in faults) else ""
    why = "" if judged is None else judged.why_not_tracked(reason, fault, least_share)
    return Verdict(
        tracked=None if judged is None else not why, reason=why or LOSS_OF_SIGNAL,
        source="true" if flown is not None else "counted" if counted is not None else None,
        flown=_numbers(flown), counted=_numbers(counted), predicted=predicted, faults=faults,
    )  # fmt: skip


def judged_by_night(found: Verdict, path: Path) -> Verdict:
    """Return the verdict of the executive that ran the pass, else the one found.

    A recording holds one attempt at the pass, or a part of it; the executive has counted all.
    """
    try:
        record = parse_json(read_whole(path))
        tracked_s, lost_s = float(record["tracked_s"]), float(record["lost_s"])
        received_s = (tracked_s + lost_s) * 10.0 ** (-0.1 * float(record["loss_db"]))
        night = _numbers(PassOutcome(tracked_s, lost_s, received_s))
        tracked, reason = record["state"] == "tracked", str(record["reason"])
    except (OSError, ValueError, KeyError, TypeError):
        return found
    return replace(found, tracked=tracked, reason=reason, source="night", counted=night)


def recorded_faults(analysis: Analysis) -> list[str]:
    """Return the faults of the antenna and those that the controller found, each once."""
    antenna, status = (analysis.recording.get(name) for name in ("antenna_status", "tracking_status"))
    texts = [str(text) for text in antenna["fault"] if text] if antenna is not None else []
    if status is not None:
        # While nothing is tracked an error is the fault that ended the pass.
        stopped = (status["level"] == ERROR_LEVEL) & (status["target"] == "")
        texts += [str(text).removeprefix(OF_ANTENNA) for text in status["alarm"][stopped]]
    return list(dict.fromkeys(texts))


def _flown(analysis: Analysis, begin_ns: int, end_ns: int) -> PassOutcome | None:
    """Return the outcome of the true error between two stamps, None where it is not known."""
    errors = analysis.errors
    if errors is None or errors.source != "true" or analysis.modes is None or end_ns <= begin_ns:
        return None
    inside = (errors.stamp_ns > begin_ns) & (errors.stamp_ns <= end_ns)
    step_s = float(np.median(np.diff(errors.stamp_ns))) * 1e-9 if len(errors.stamp_ns) > 1 else 0.0
    width = analysis.modes.beamwidth_rad_at(errors.stamp_ns[inside])
    if not np.all(np.isfinite(width)):
        return None
    flown = PassOutcome.of(errors.radial_rad[inside], width, step_s)
    missing_s = (end_ns - begin_ns) * 1e-9 - flown.duration_s
    # A sample more or less at the ends is not a gap.
    return flown + PassOutcome.unseen(missing_s) if missing_s > 2.0 * step_s else flown


def _counted(status: TopicData, rows: IntArray) -> PassOutcome | None:
    """Return what the controller counted by the later of these rows, None without a count."""
    tracked, lost, loss = (status[name][rows] for name in ("seconds_tracked", "seconds_lost", "mean_loss"))
    best = int(np.argmax(tracked + lost))
    tracked_s, lost_s = float(tracked[best]), float(lost[best])
    if not tracked_s + lost_s > 0.0:
        return None
    return PassOutcome(tracked_s, lost_s, (tracked_s + lost_s) * 10.0 ** (-0.1 * float(loss[best])))


def _predicted(analysis: Analysis, found: Pass) -> tuple[OutcomeNumbers | None, float]:
    """Return what the certificate predicts, None without one, and the share required."""
    data = analysis.recording.get("pass_certificate")
    if data is None or data.stamp_ns is None:
        return None, LEAST_SHARE
    # The last certificate before the loss of signal is that of the goal which was tracked.
    overlap = (data["los"] > found.aos_ns) & (data["aos"] < found.los_ns)
    mine = np.flatnonzero((data["target"] == found.target) & overlap)
    if len(mine) == 0 or not data["accepted"][mine[-1]]:
        return None, LEAST_SHARE
    row = int(mine[-1])
    left_s = (int(data["los"][row]) - max(int(data["aos"][row]), int(data.stamp_ns[row]))) * 1e-9
    lost_s = min(sum(float(data[name][row]) for name in ("lost", "late", "acquisition")), left_s)
    held_percent, loss_db = 100.0 * (1.0 - lost_s / left_s), float(data["mean_loss"][row])
    predicted = OutcomeNumbers(left_s - lost_s, lost_s, held_percent, loss_db)
    return predicted, float(data["least_share"][row]) or LEAST_SHARE


def _numbers(of: PassOutcome | None) -> OutcomeNumbers | None:
    if of is None:
        return None
    return OutcomeNumbers(of.tracked_s, of.lost_s, 100.0 * of.share, of.mean_loss_db)
