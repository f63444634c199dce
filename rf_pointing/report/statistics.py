"""From a recording to its table: how well the beam was on the target, how well the graph ran."""

import numpy as np

from rf_pointing.core import MDEG
from rf_pointing.core.dates import utc_text
from rf_pointing.report.analysis import TRACKING_MODES, Analysis, ErrorSeries, Timeline, statistics_of
from rf_pointing.report.machine import commands, link, servo
from rf_pointing.report.recording import Pass, Recording
from rf_pointing.report.summary import (
    SCHEMA,
    BagInfo,
    Complaint,
    Headline,
    ModeInterval,
    ModeStatistics,
    NotRecorded,
    PassInfo,
    Summary,
)
from rf_pointing.report.traffic import latencies, topic_traffic

__all__ = ["summarize"]


def summarize(analysis: Analysis) -> Summary:
    """Return the table of a recording; what it does not give is None and listed in `problems`."""
    recording, modes, errors = analysis.recording, analysis.modes, analysis.errors
    traffic = topic_traffic(recording)
    lost = sum(row.lost or 0 for row in traffic) + sum(item.count for item in recording.not_recorded)
    return Summary(
        schema=SCHEMA,
        bag=_bag(recording),
        target_pass=_pass_info(analysis.target_pass) if analysis.target_pass else None,
        headline=_headline(errors, analysis.acquired_ns, lost),
        acquisition=analysis.acquisition,
        modes=_mode_rows(errors, modes),
        timeline=_intervals(modes),
        link=link(recording, modes, analysis.acquired_ns),
        commands=commands(recording, modes),
        servo=servo(recording),
        topics=traffic,
        latency=latencies(recording),
        not_recorded=[
            NotRecorded(topic=i.topic, count=i.count, first_lost_utc=utc_text(i.first_log_time_ns * 1e-9))
            for i in recording.not_recorded
        ],
        warnings=[Complaint(component=name, message=text, count=count) for name, text, count in recording.warnings],
        problems=[*recording.problems, *_missing(recording, errors)],
    )


def _bag(recording: Recording) -> BagInfo:
    filled = [data for data in recording.topics.values() if len(data)]
    # First and last only; latched topics have one message.
    logs = np.concatenate([data.log_time_ns[[0, -1]] for data in filled]) if filled else np.zeros(0, dtype=np.int64)
    # Topics stamped "now": targets and commands are stamped in the future.
    clock = [recording.get(name) for name in ("joint_states", "tracking_status", "sim/pointing_error")]
    stamps = [data.stamp_ns for data in clock if data is not None and data.stamp_ns is not None]
    start = min((int(np.min(s)) for s in stamps), default=None)
    simulated = (max(int(np.max(s)) for s in stamps) - start) * 1e-9 if start is not None else None
    wall = float(np.max(logs) - np.min(logs)) * 1e-9 if len(logs) else None
    return BagInfo(
        path=str(recording.path),
        namespace=recording.namespace or "/",
        start_utc=utc_text(start * 1e-9) if start is not None else None,
        simulated_s=simulated,
        wall_s=wall,
        speed=simulated / wall if simulated is not None and wall else None,
        message_count=sum(len(data) for data in filled) + sum(recording.others.values()),
        notes=recording.notes,
    )


def _pass_info(item: Pass) -> PassInfo:
    return PassInfo(
        target=item.target,
        aos_utc=utc_text(item.aos_ns * 1e-9),
        tca_utc=utc_text(item.tca_ns * 1e-9),
        los_utc=utc_text(item.los_ns * 1e-9),
        peak_elevation_deg=float(np.degrees(item.peak_elevation_rad)),
    )


def _headline(errors: ErrorSeries | None, acquired_ns: int | None, lost: int) -> Headline:
    # The search is no fault of the loop, so the headline begins when the loop has settled.
    over = "tracking" if acquired_ns is None else "after acquisition"
    if errors is None:
        return Headline(
            error_source=None,
            over=over,
            held_beam=None,
            seconds=None,
            beamwidth_mdeg=None,
            error=None,
            program_track_alone=None,
            messages_lost=lost,
        )
    chosen = np.isin(errors.mode, TRACKING_MODES) & (errors.stamp_ns >= (acquired_ns or 0))
    width = errors.beamwidth_rad[chosen]
    error = statistics_of(errors.error_rad[chosen], width)
    # Held means always: one sample outside half power is a lost beam.
    inside = error.inside_half_power_percent
    return Headline(
        error_source=errors.source,
        over=over,
        held_beam=None if inside is None else inside == 100.0,
        seconds=_seconds(errors, chosen),
        beamwidth_mdeg=float(np.nanmedian(width) / MDEG) if np.any(np.isfinite(width)) else None,
        error=error,
        program_track_alone=statistics_of(errors.alone_rad[chosen], width),
        messages_lost=lost,
    )


def _seconds(errors: ErrorSeries, chosen: np.ndarray) -> float:
    step = float(np.median(np.diff(errors.stamp_ns))) * 1e-9 if len(errors.stamp_ns) > 1 else 0.0
    return float(np.sum(chosen)) * step


def _mode_rows(errors: ErrorSeries | None, modes: Timeline | None) -> list[ModeStatistics]:
    rows = []
    spans = modes.intervals() if modes is not None else []
    for mode in dict.fromkeys(span.mode for span in spans):
        chosen = errors.mode == mode if errors is not None else np.zeros(0, dtype=np.bool_)
        tracking = mode in TRACKING_MODES
        # A mode without samples still has its row, with its time.
        none = np.zeros((0, 2))
        rows.append(
            ModeStatistics(
                mode=mode,
                seconds=sum(span.seconds for span in spans if span.mode == mode),
                entered=sum(span.mode == mode for span in spans),
                error=statistics_of(errors.error_rad[chosen], errors.beamwidth_rad[chosen])
                if errors is not None
                else statistics_of(none, none[:, 0]),
                program_track_alone=statistics_of(errors.alone_rad[chosen], errors.beamwidth_rad[chosen])
                if tracking and errors is not None
                else None,
            )
        )
    return rows


def _intervals(modes: Timeline | None) -> list[ModeInterval]:
    if modes is None:
        return []
    start = int(modes.stamp_ns[0])
    return [
        ModeInterval(mode=i.mode, start_s=(i.start_ns - start) * 1e-9, seconds=i.seconds, reason=i.reason)
        for i in modes.intervals()
    ]


def _missing(recording: Recording, errors: ErrorSeries | None) -> list[str]:
    missing = []
    if recording.get("tracking_status") is None:
        missing.append("no tracking_status: errors cannot be sorted by mode, and no pointing loss is known")
    if errors is None:
        missing.append("no valid pointing error, neither sim/pointing_error nor pointing_error: no error statistics")
    elif errors.source == "sensed":
        missing.append("no sim/pointing_error: errors are those that the sensor measured, not the true ones")
    if errors is not None and errors.dropped:
        missing.append(f"{errors.dropped} errors are not finite numbers and were left out")
    for name, what in (("joint_states", "no axis rates"), ("antenna_status", "no limits, faults and tick lateness")):
        if recording.get(name) is None:
            missing.append(f"no {name}: {what}")
    return missing
