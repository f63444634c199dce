"""The table of a recording: how well the beam was on the target, how well the graph ran.

`summarize` is the whole table; `link_series` and `axis_motion` are what its pictures show, too.
"""

from typing import Any

import numpy as np

from rf_pointing.core import MDEG, Array, IntArray, Sensor, utc_text
from rf_pointing.core.kinematics import MOUNT_NOTE
from rf_pointing.planning.horizon import HORIZON_NOTE
from rf_pointing.report import summary as table
from rf_pointing.report.analysis import Analysis, ErrorSeries, Interval, Timeline, statistics_of, tracking_modes
from rf_pointing.report.outcome import verdict
from rf_pointing.report.recording import Recording
from rf_pointing.report.summary import percentile_99, reduced
from rf_pointing.report.topics import TopicData
from rf_pointing.report.traffic import latencies, topic_traffic

# Over a shorter span the steps of the encoders dominate.
_ACCELERATION_SPAN_S = 0.5


def summarize(analysis: Analysis) -> table.Summary:
    """Return the table of a recording; what it does not give is None and listed in `problems`."""
    recording, modes, errors = analysis.recording, analysis.modes, analysis.errors
    spans = modes.intervals() if modes is not None else []
    traffic = topic_traffic(recording)
    lost = sum(row.lost or 0 for row in traffic) + sum(item.count for item in recording.not_recorded)
    found, info = analysis.target_pass, None
    if found is not None:
        times_ns = found.aos_ns, found.tca_ns, found.los_ns
        aos, tca, los = (utc_text(each * 1e-9) for each in times_ns)
        peak_deg = float(np.degrees(found.peak_elevation_rad))
        info = table.PassInfo(found.target, aos, tca, los, peak_deg)
    return table.Summary(
        schema=table.SCHEMA, bag=_bag(recording), outcome=verdict(analysis),
        target_pass=info,
        headline=_headline(errors, analysis.acquired_ns, lost), acquisition=analysis.acquisition,
        modes=_mode_rows(errors, spans), topics=traffic, latency=latencies(recording),
        timeline=[
            table.ModeInterval(i.mode, (i.start_ns - spans[0].start_ns) * 1e-9, i.seconds, i.reason) for i in spans
        ],
        link=_link(recording, modes, analysis.acquired_ns),
        commands=_commands(recording, modes), servo=servo(recording),
        not_recorded=[
            table.NotRecorded(i.topic, i.count, utc_text(i.first_log_time_ns * 1e-9)) for i in recording.not_recorded
        ],
        warnings=list(recording.warnings),
        problems=[*recording.problems, *_missing(recording, errors)],
    )  # fmt: skip


def _bag(recording: Recording) -> table.BagInfo:
    filled = [data for data in recording.topics.values() if len(data)]
    # First and last only; latched topics have one message.
    logs = np.concatenate([data.log_time_ns[[0, -1]] for data in filled]) if filled else np.zeros(0, dtype=np.int64)
    # Topics stamped "now": targets and commands are stamped in the future.
    clock = [recording.get(name) for name in ("joint_states", "tracking_status", "sim/pointing_error")]
    stamps = [data.stamp_ns for data in clock if data is not None and data.stamp_ns is not None]
    start = min((int(np.min(s)) for s in stamps), default=None)
    simulated = (max(int(np.max(s)) for s in stamps) - start) * 1e-9 if start is not None else None
    wall = float(np.max(logs) - np.min(logs)) * 1e-9 if len(logs) else None
    return table.BagInfo(
        path=str(recording.path), namespace=recording.namespace or "/",
        start_utc=utc_text(start * 1e-9) if start is not None else None,
        simulated_s=simulated, wall_s=wall,
        speed=simulated / wall if simulated is not None and wall else None,
        message_count=sum(len(data) for data in filled) + sum(recording.others.values()),
        notes={name: text for name, text in recording.notes.items() if name not in (HORIZON_NOTE, MOUNT_NOTE)},
    )  # fmt: skip


def _headline(errors: ErrorSeries | None, acquired_ns: int | None, lost: int) -> table.Headline:
    # The search is not a fault of the loop, so the headline begins when the loop has settled.
    over = "tracking" if acquired_ns is None else "after acquisition"
    if errors is None:
        return table.Headline(over=over, messages_lost=lost)
    chosen = np.isin(errors.mode, tracking_modes()) & (errors.stamp_ns >= (acquired_ns or 0))
    width = errors.beamwidth_rad[chosen]
    step_s = float(np.median(np.diff(errors.stamp_ns))) * 1e-9 if len(errors.stamp_ns) > 1 else 0.0
    return table.Headline(
        error_source=errors.source, over=over, seconds=float(np.sum(chosen)) * step_s,
        beamwidth_mdeg=reduced(np.median, width / MDEG), messages_lost=lost,
        error=statistics_of(errors.error_rad[chosen], width),
        program_track_alone=statistics_of(errors.alone_rad[chosen], width),
    )  # fmt: skip


def _mode_rows(errors: ErrorSeries | None, spans: list[Interval]) -> list[table.ModeStatistics]:
    rows = []
    for mode in dict.fromkeys(span.mode for span in spans):
        # A mode without samples still has its row, with its time.
        error, alone = statistics_of(np.zeros((0, 2)), np.zeros(0)), None
        if errors is not None:
            chosen = errors.mode == mode
            error = statistics_of(errors.error_rad[chosen], errors.beamwidth_rad[chosen])
            if mode in tracking_modes():
                alone = statistics_of(errors.alone_rad[chosen], errors.beamwidth_rad[chosen])
        own = [span.seconds for span in spans if span.mode == mode]
        rows.append(table.ModeStatistics(mode, sum(own), len(own), error, alone))
    return rows


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


def link_series(recording: Recording) -> tuple[str, IntArray, Array] | None:
    """Return source, stamps and finite C/N0 in dB-Hz of the best topic that has it."""
    # Best first: the receiver measures more often than the controller reports.
    for name in (Sensor.MONOPULSE, "carrier_power", "tracking_status"):
        data = recording.get(name)
        if data is not None and data.stamp_ns is not None:
            values = data["carrier_to_noise"].astype(np.float64)
            good = np.isfinite(values)
            # 0 throughout: nobody has measured it.
            if np.any(values[good] > 0.0):
                return name, data.stamp_ns[good], values[good]
    return None


def _link(recording: Recording, modes: Timeline | None, acquired_ns: int | None) -> table.Link:
    """Return C/N0 after acquisition, else while tracking, else of the whole recording."""
    series = link_series(recording)
    over = "recording" if modes is None else "tracking" if acquired_ns is None else "after acquisition"
    if series is None:
        return table.Link(over)
    name, stamps, values = series
    chosen = values[modes.is_tracking_at(stamps) & (stamps >= (acquired_ns or 0))] if modes is not None else values
    return table.Link(over, name, reduced(np.min, chosen), reduced(np.median, chosen))


def _commands(recording: Recording, modes: Timeline | None) -> table.Commands:
    """Return the command lead while tracking, and the servo's counters at the end."""
    status, antenna = recording.get("tracking_status"), recording.get("antenna_status")
    # Before and after tracking the controller sends no commands that could lead.
    lead = modes.columns["command_lead"][modes.is_tracking_at(modes.stamp_ns)] if modes is not None else np.zeros(0)
    buffered = antenna["command_lead"][antenna["mode"] == "tracking"] if antenna is not None else np.zeros(0)
    return table.Commands(
        lead_min_s=reduced(np.min, lead), lead_median_s=reduced(np.median, lead),
        servo_lead_min_s=reduced(np.min, buffered), sent=_last(status, "commands_sent"),
        accepted=_last(antenna, "commands_accepted"), rejected=_last(antenna, "commands_rejected"),
        last_rejection=str(antenna["last_rejection"][-1]) if antenna is not None else "",
        offsets=_texts(status, "offsets"), sun_permit=_texts(antenna, "sun_permit"),
    )  # fmt: skip


class AxisMotion:
    """Rates (n, 2), and accelerations (m, 2) over half a second, of both axes at stamps in ns."""

    def __init__(self, joints: TopicData) -> None:
        assert joints.stamp_ns is not None
        self.stamp_ns, index = np.unique(joints.stamp_ns, return_index=True)
        self.rate_rad_s: Array = joints["velocity"][index]
        step_s = float(np.median(np.diff(self.stamp_ns))) * 1e-9 if len(self.stamp_ns) > 1 else np.inf
        span = max(1, round(_ACCELERATION_SPAN_S / step_s))
        elapsed_s = (self.stamp_ns[span:] - self.stamp_ns[:-span]) * 1e-9
        self.acceleration_rad_s2: Array = (self.rate_rad_s[span:] - self.rate_rad_s[:-span]) / elapsed_s[:, None]
        self.acceleration_stamp_ns: IntArray = (self.stamp_ns[span:] + self.stamp_ns[:-span]) // 2


def axis_motion(recording: Recording) -> AxisMotion | None:
    """Return the motion of the axes, None without `joint_states`."""
    joints = recording.get("joint_states")
    return AxisMotion(joints) if joints is not None and joints.stamp_ns is not None else None


def servo(recording: Recording) -> table.Servo:
    """Return tick lateness, deviation of the servo's period, faults and axes."""
    antenna, joints = recording.get("antenna_status"), recording.get("joint_states")
    lateness = antenna["tick_lateness"] * 1e3 if antenna is not None else np.zeros(0)
    # By the recorder's clock: the stamps are exact whatever the servo does.
    period = np.diff(joints.log_time_ns) * 1e-6 if joints is not None else np.zeros(0)
    # Gaps are counted in median periods: the recorder does not know the nominal one.
    deviation = np.abs(period - np.median(period)) if len(period) else period
    faults = dict.fromkeys(str(text) for text in antenna["fault"] if text) if antenna is not None else {}
    moves: dict[str, Any] = {}
    if antenna is not None:
        # Those of a drive that takes positions begin anew with the next tracking: the last of them
        # may be that of a park.
        row = int(np.argmax(antenna["set_points"]))
        counts = "set_points", "starts", "reversals"
        moves = {name: np.asarray(antenna[name][row]).tolist() for name in counts}
    return table.Servo(
        tick_lateness_p99_ms=reduced(percentile_99, lateness), faults=list(faults),
        tick_lateness_max_ms=reduced(np.max, lateness),
        period_deviation_p99_ms=reduced(percentile_99, deviation),
        axes=[_axis(recording, index) for index in range(2)], **moves,
    )  # fmt: skip


def _axis(recording: Recording, index: int) -> table.AxisLimits:
    motion, antenna = axis_motion(recording), recording.get("antenna_status")
    rate = motion.rate_rad_s[:, index] if motion is not None else np.zeros(0)
    acceleration = motion.acceleration_rad_s2[:, index] if motion is not None else np.zeros(0)
    # Unknown, not 0: without status the limits are not known.
    rate_limit = acceleration_limit = at_limit_s = None
    if antenna is not None:
        rate_limit = float(np.degrees(antenna["rate_limit"][-1, index]))
        acceleration_limit = float(np.degrees(antenna["acceleration_limit"][-1, index]))
        if antenna.stamp_ns is not None and len(antenna) > 1:
            at_limit_s = float(np.sum(antenna["at_limit"][:, index]) * np.median(np.diff(antenna.stamp_ns)) * 1e-9)
    peaks = [reduced(np.max, np.degrees(np.abs(each))) for each in (rate, acceleration)]
    return table.AxisLimits(recording.axes[index], peaks[0], rate_limit, peaks[1], acceleration_limit, at_limit_s)


def _texts(data: TopicData | None, column: str) -> str:
    """Return the different texts of a column in their order, without the empty one."""
    return "; then ".join(dict.fromkeys(filter(None, map(str, data[column])))) if data else ""


def _last(data: TopicData | None, column: str) -> int | None:
    return int(data[column][-1]) if data is not None else None
