"""The table of a report, as in `summary.json`, with units in the names.

Every key is always present; a value that the recording does not give is null, never NaN.
"""

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Readers of summary.json check this; a changed meaning of a key needs a new number.
SCHEMA = "rf_pointing/summary/2"
Number = float | None


def reduced(function: Callable[..., Any], values: NDArray[np.floating[Any]]) -> Number:
    """Return `function` of the finite `values`, or None without one."""
    finite = values[np.isfinite(values)]
    return float(function(finite)) if len(finite) else None


def percentile_99(values: NDArray[np.floating[Any]]) -> float:
    """Return the 99th percentile, for `reduced`."""
    return float(np.percentile(values, 99.0))


@dataclass(frozen=True, kw_only=True)
class BagInfo:
    """Data that were read; `speed` is simulation time per wall time."""

    path: str
    namespace: str
    start_utc: str | None
    simulated_s: Number
    wall_s: Number
    speed: Number
    message_count: int
    notes: dict[str, str]


@dataclass(frozen=True)
class PassInfo:
    """The predicted pass that was tracked."""

    target: str
    aos_utc: str
    tca_utc: str
    los_utc: str
    peak_elevation_deg: float


@dataclass(frozen=True)
class Spread:
    """Root mean square, 95th percentile and largest magnitude of an error."""

    rms_mdeg: Number = None
    p95_mdeg: Number = None
    max_mdeg: Number = None


@dataclass(frozen=True)
class ErrorStatistics:
    """Errors of the beam over some samples; the loss is null outside tracking.

    The mean loss is that of the mean power; none is deeper than the sidelobes.
    """

    samples: int
    cross_elevation: Spread
    elevation: Spread
    radial: Spread
    mean_loss_db: Number
    max_loss_db: Number
    inside_half_power_percent: Number


@dataclass(frozen=True)
class ModeStatistics:
    """One tracking mode: time in it, its error, and that of program track alone meanwhile."""

    mode: str
    seconds: float
    entered: int
    error: ErrorStatistics
    program_track_alone: ErrorStatistics | None


@dataclass(frozen=True)
class ModeInterval:
    """One stretch in one mode."""

    mode: str
    start_s: float
    seconds: float
    reason: str


@dataclass(frozen=True, kw_only=True)
class Acquisition:
    """Seconds from `measured_from` to the first valid sensor error, and to the first settled."""

    measured_from: str
    first_valid_s: Number = None
    settled_s: Number = None
    settled_below_mdeg: Number = None


@dataclass(frozen=True)
class OutcomeNumbers:
    """Seconds held and lost, and the loss of the mean power, by `core/pass_outcome.py`."""

    tracked_s: float
    lost_s: float
    held_percent: float
    mean_loss_db: float


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Whether the pass was tracked, else why not; and three answers to what it gave.

    `source` is what the verdict is judged by: "true" is the flight, "counted" the controller's
    count, "night" that of an executive over all attempts, which is then in `counted`.  `faults` are
    those of the antenna and of its encoders, reset or not.
    """

    tracked: bool | None = None
    reason: str = ""
    source: str | None = None
    flown: OutcomeNumbers | None = None
    counted: OutcomeNumbers | None = None
    predicted: OutcomeNumbers | None = None
    faults: list[str]


@dataclass(frozen=True, kw_only=True)
class Headline:
    """The main results of the tracking loop.

    `error_source` is "true" (simulation truth) or "sensed"; `over` names the samples: "after
    acquisition", or "tracking" where no RF loop was used or it never settled.
    """

    error_source: str | None = None
    over: str
    seconds: Number = None
    beamwidth_mdeg: Number = None
    error: ErrorStatistics | None = None
    program_track_alone: ErrorStatistics | None = None
    messages_lost: int


@dataclass(frozen=True, kw_only=True)
class TopicTraffic:
    """One topic: `rate_hz` in simulation time, `lost` counted by sequence numbers or stamps.

    A topic on which several sensors publish, each at its own rate, has one row per `sensor`.
    """

    topic: str
    sensor: str | None
    type: str
    count: int
    rate_hz: Number
    wall_rate_hz: Number
    lost: int | None
    counted_by: str | None
    restarts: int
    longest_gap_s: Number
    not_recorded: int


@dataclass(frozen=True)
class Latency:
    """Wall time between the reception of two causally linked messages.

    `kind` "transit": equal or adjacent stamps; "reaction": the first message out after one in, with
    its wait for the next tick.
    """

    cause: str
    effect: str
    kind: str
    count: int
    median_ms: Number
    p99_ms: Number
    max_ms: Number


@dataclass(frozen=True, kw_only=True)
class Commands:
    """Lead of the commands at both ends, the servo's counters, and what the operator has given."""

    lead_min_s: Number
    lead_median_s: Number
    servo_lead_min_s: Number
    sent: int | None
    accepted: int | None
    rejected: int | None
    last_rejection: str
    offsets: str
    sun_permit: str


@dataclass(frozen=True)
class AxisLimits:
    """Largest rate and acceleration (mean over half a second) of one axis, and its limits."""

    axis: str
    peak_rate_deg_s: Number
    rate_limit_deg_s: Number
    peak_acceleration_deg_s2: Number
    acceleration_limit_deg_s2: Number
    at_limit_s: Number


@dataclass(frozen=True, kw_only=True)
class Servo:
    """Timing of the control ticks in wall time, faults and axes.

    Of a drive that takes positions: its set points, and by axis starts and changes of direction,
    since tracking began; 0 of any other.
    """

    tick_lateness_p99_ms: Number
    tick_lateness_max_ms: Number
    period_deviation_p99_ms: Number
    faults: list[str]
    axes: list[AxisLimits]
    set_points: int = 0
    starts: list[int] = field(default_factory=lambda: [0, 0])
    reversals: list[int] = field(default_factory=lambda: [0, 0])


@dataclass(frozen=True)
class Link:
    """Carrier-to-noise density over the time of the headline, and the topic it was read from."""

    over: str
    source: str | None = None
    carrier_to_noise_min_db_hz: Number = None
    carrier_to_noise_median_db_hz: Number = None


@dataclass(frozen=True)
class NotRecorded:
    """Messages that the recorder could not write."""

    topic: str
    count: int
    first_lost_utc: str


@dataclass(frozen=True)
class Complaint:
    """A report on /diagnostics above OK; messages that differ only in numbers count as one."""

    component: str
    message: str
    count: int


@dataclass(frozen=True, kw_only=True)
class Summary:
    """The whole table."""

    schema: str
    bag: BagInfo
    target_pass: PassInfo | None
    outcome: Verdict
    headline: Headline
    acquisition: Acquisition
    modes: list[ModeStatistics]
    timeline: list[ModeInterval]
    link: Link
    commands: Commands
    servo: Servo
    topics: list[TopicTraffic]
    latency: list[Latency]
    not_recorded: list[NotRecorded]
    warnings: list[Complaint]
    problems: list[str]


def to_json(summary: Summary) -> str:
    """Return the summary as JSON text in which numbers that are not finite are null."""
    # NaN is not JSON; most readers refuse a file that has one.
    plain = json.loads(json.dumps(dataclasses.asdict(summary)), parse_constant=lambda _: None)
    return json.dumps(plain, indent=2, allow_nan=False) + "\n"
