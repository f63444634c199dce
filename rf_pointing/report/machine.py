"""The machine behind the beam: link quality, command lead, servo timing, axis rates, limits."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import AXES
from rf_pointing.report.analysis import Timeline
from rf_pointing.report.recording import Recording
from rf_pointing.report.summary import AxisLimits, Commands, Link, Servo
from rf_pointing.report.topics import TopicData

__all__ = ["AxisMotion", "axis_motion", "commands", "link", "link_series", "servo"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_ACCELERATION_SPAN_S = 0.5
"""Over a shorter span the steps of the encoders dominate."""


def link_series(recording: Recording) -> tuple[str, Ints, Floats] | None:
    """Return source, stamps and finite C/N0 in dB-Hz of the best topic that has it."""
    # Best first: the receiver measures more often than the controller reports.
    for name in ("monopulse", "carrier_power", "tracking_status"):
        data = recording.get(name)
        if data is not None and data.stamp_ns is not None:
            values = data["carrier_to_noise"].astype(np.float64)
            good = np.isfinite(values)
            if np.any(good):
                return name, data.stamp_ns[good], values[good]
    return None


def link(recording: Recording, modes: Timeline | None, acquired_ns: int | None) -> Link:
    """Return C/N0 after acquisition, else while tracking, else of the whole recording."""
    series = link_series(recording)
    over = "recording" if modes is None else "tracking" if acquired_ns is None else "after acquisition"
    if series is None:
        return Link(source=None, over=over, carrier_to_noise_min_db_hz=None, carrier_to_noise_median_db_hz=None)
    name, stamps, values = series
    chosen = values[modes.is_tracking_at(stamps) & (stamps >= (acquired_ns or 0))] if modes is not None else values
    return Link(
        source=name,
        over=over,
        carrier_to_noise_min_db_hz=float(np.min(chosen)) if len(chosen) else None,
        carrier_to_noise_median_db_hz=float(np.median(chosen)) if len(chosen) else None,
    )


def commands(recording: Recording, modes: Timeline | None) -> Commands:
    """Return the command lead while tracking, and the servo's counters at the end."""
    status, antenna = recording.get("tracking_status"), recording.get("antenna_status")
    lead = np.zeros(0)
    if status is not None and modes is not None:
        # Before and after tracking the controller sends no commands that could lead.
        lead = modes.columns["command_lead"][modes.is_tracking_at(modes.stamp_ns)]
    buffered = antenna["command_lead"][antenna["mode"] == "tracking"] if antenna is not None else np.zeros(0)
    return Commands(
        lead_min_s=_reduced(np.min, lead),
        lead_median_s=_reduced(np.median, lead),
        servo_lead_min_s=_reduced(np.min, buffered),
        sent=_last(status, "commands_sent"),
        accepted=_last(antenna, "commands_accepted"),
        rejected=_last(antenna, "commands_rejected"),
        last_rejection=str(antenna["last_rejection"][-1]) if antenna is not None else "",
    )


class AxisMotion:
    """Rates (n, 2) and accelerations (m, 2) of both axes at stamps in ns, from `joint_states`.

    An acceleration is the change of rate over half a second.
    """

    def __init__(self, joints: TopicData) -> None:
        assert joints.stamp_ns is not None
        self.stamp_ns, index = np.unique(joints.stamp_ns, return_index=True)
        self.rate_rad_s: Floats = joints["velocity"][index]
        step_s = float(np.median(np.diff(self.stamp_ns))) * 1e-9 if len(self.stamp_ns) > 1 else np.inf
        span = max(1, round(_ACCELERATION_SPAN_S / step_s))
        elapsed_s = (self.stamp_ns[span:] - self.stamp_ns[:-span]) * 1e-9
        self.acceleration_rad_s2: Floats = (self.rate_rad_s[span:] - self.rate_rad_s[:-span]) / elapsed_s[:, None]
        self.acceleration_stamp_ns: Ints = (self.stamp_ns[span:] + self.stamp_ns[:-span]) // 2


def axis_motion(recording: Recording) -> AxisMotion | None:
    """Return the motion of the axes, None without `joint_states`."""
    joints = recording.get("joint_states")
    return AxisMotion(joints) if joints is not None and joints.stamp_ns is not None else None


def servo(recording: Recording) -> Servo:
    """Return tick lateness, deviation of the servo's period, faults and axes."""
    antenna, joints = recording.get("antenna_status"), recording.get("joint_states")
    lateness = antenna["tick_lateness"] * 1e3 if antenna is not None else np.zeros(0)
    # By the recorder's clock: the stamps are exact whatever the servo does.
    period = np.diff(joints.log_time_ns) * 1e-6 if joints is not None else np.zeros(0)
    # Of the median period: the recorder does not know the nominal one.
    deviation = np.abs(period - np.median(period)) if len(period) else period
    faults = dict.fromkeys(str(text) for text in antenna["fault"] if text) if antenna is not None else {}
    return Servo(
        tick_lateness_p99_ms=_reduced(_p99, lateness),
        tick_lateness_max_ms=_reduced(np.max, lateness),
        period_deviation_p99_ms=_reduced(_p99, deviation),
        faults=list(faults),
        axes=[_axis(recording, index) for index in range(len(AXES))],
    )


def _axis(recording: Recording, index: int) -> AxisLimits:
    motion, antenna = axis_motion(recording), recording.get("antenna_status")
    rate = motion.rate_rad_s[:, index] if motion is not None else np.zeros(0)
    acceleration = motion.acceleration_rad_s2[:, index] if motion is not None else np.zeros(0)
    # Unknown, not 0: without status the limits are not known.
    at_limit_s = None
    if antenna is not None and antenna.stamp_ns is not None and len(antenna) > 1:
        at_limit_s = float(np.sum(antenna["at_limit"][:, index]) * np.median(np.diff(antenna.stamp_ns)) * 1e-9)
    return AxisLimits(
        axis=AXES[index],
        peak_rate_deg_s=_reduced(np.max, np.degrees(np.abs(rate))),
        rate_limit_deg_s=_limit(antenna, "rate_limit", index),
        peak_acceleration_deg_s2=_reduced(np.max, np.degrees(np.abs(acceleration))),
        acceleration_limit_deg_s2=_limit(antenna, "acceleration_limit", index),
        at_limit_s=at_limit_s,
    )


def _limit(antenna: TopicData | None, column: str, index: int) -> float | None:
    return float(np.degrees(antenna[column][-1, index])) if antenna is not None else None


def _last(data: TopicData | None, column: str) -> int | None:
    return int(data[column][-1]) if data is not None else None


def _reduced(function: Callable[..., Any], values: Floats) -> float | None:
    finite = values[np.isfinite(values)]
    return float(function(finite)) if len(finite) else None


def _p99(values: Floats) -> float:
    return float(np.percentile(values, 99.0))
