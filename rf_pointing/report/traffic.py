"""Traffic on the topics: rates, losses, and wall time from one node's message to the next."""

from dataclasses import dataclass

import numpy as np

from rf_pointing.core import IntArray, Sensor
from rf_pointing.report.recording import Recording
from rf_pointing.report.summary import Latency, TopicTraffic, percentile_99, reduced
from rf_pointing.report.topics import TOPICS, TopicData

# A longer gap is a pause of the publisher, not a loss.
_PAUSE_PERIODS = 10
# Stamps are kept on whole microseconds.
_STAMP_TOLERANCE_NS = 2_000


@dataclass(frozen=True)
class Hop:
    """One arrow of the graph; `kind` as in `Latency`, `sensor` chooses one of several trackers."""

    cause: str
    effect: str
    kind: str = "transit"
    sensor: str = ""


HOPS = (
    Hop("clock", "joint_states"), Hop("joint_states", "sim/boresight"),
    Hop("sim/boresight", "sim/pointing_error"), Hop("sim/boresight", Sensor.MONOPULSE),
    Hop("sim/boresight", "carrier_power"),
    Hop(Sensor.MONOPULSE, "pointing_error", sensor=Sensor.MONOPULSE),
    Hop("pointing_error", "tracking_status", "reaction"),
    Hop("pointing_error", "joint_trajectory", "reaction"),
)  # fmt: skip
"""The loop from the clock through antenna, receiver and tracker back to the command."""


def topic_traffic(recording: Recording) -> list[TopicTraffic]:
    """Return one row per topic of the antenna, and per sensor where several share a topic.

    Losses are counted by sequence numbers where there are any; a number that falls is a restart.
    Otherwise they are counted by gaps in the stamps.
    """
    missing = {item.topic: item.count for item in recording.not_recorded}
    return [
        _traffic(name, sensor, part, missing.get(data.topic, 0))
        for name, data in recording.topics.items()
        for sensor, part in _by_sensor(name, data)
    ]


def _by_sensor(name: str, data: TopicData) -> list[tuple[str | None, TopicData]]:
    """Return the messages of each sensor: trackers share a topic, each with its own counter."""
    sensors = data.columns.get("sensor")
    if name.startswith("sim/") or sensors is None or len(data) == 0:
        return [(None, data)]
    return [(str(sensor), data.part(sensors == sensor)) for sensor in np.unique(sensors)]


def _traffic(name: str, sensor: str | None, data: TopicData, not_recorded: int) -> TopicTraffic:
    periodic = TOPICS[name].periodic
    # A repeated stamp (the clock while time is held) is not a step.
    stamps = np.unique(data.stamp_ns) if data.stamp_ns is not None else np.zeros(0, dtype=np.int64)
    steps: IntArray = stamps[1:] - stamps[:-1]
    # The measured period: a receiver or a scan may have been set to another one.
    period_ns = float(np.median(steps)) if periodic and len(steps) else None
    lost, counted_by, restarts = _losses(data, steps, period_ns)
    wall_s = (data.log_time_ns[-1] - data.log_time_ns[0]) * 1e-9 if len(data) > 1 else 0.0
    return TopicTraffic(
        topic=data.topic, sensor=sensor, type=data.type_name, count=len(data),
        rate_hz=1e9 / period_ns if period_ns else None,
        wall_rate_hz=float((len(data) - 1) / wall_s) if periodic and wall_s > 0.0 else None,
        lost=lost, counted_by=counted_by, restarts=restarts,
        longest_gap_s=float(np.max(steps)) * 1e-9 if period_ns else None,
        not_recorded=not_recorded,
    )  # fmt: skip


def _losses(data: TopicData, steps: IntArray, period_ns: float | None) -> tuple[int | None, str | None, int]:
    if data.sequence is not None:
        # In order of reception: the numbers of one publisher never fall but at a restart.
        jumps = np.diff(data.sequence)
        return int(np.sum(jumps[jumps > 1] - 1)), "sequence numbers", int(np.sum(jumps <= 0))
    if period_ns is None:
        return None, None, 0
    missing = np.rint(steps / period_ns).astype(np.int64) - 1
    return int(np.sum(missing[missing < _PAUSE_PERIODS])), "stamp gaps", 0


def latencies(recording: Recording) -> list[Latency]:
    """Return one row per hop of which both ends were recorded, in times of the reception.

    A time is negative if the effect arrived first: every topic has a path of its own.
    """
    rows = []
    for hop in HOPS:
        cause, effect = recording.get(hop.cause), recording.get(hop.effect)
        if cause is not None and effect is not None:
            if hop.sensor:
                effect = effect.part(effect["sensor"] == hop.sensor)
            difference = _transit_ns(cause, effect) if hop.kind == "transit" else _reaction_ns(cause, effect)
            rows.append(_latency(hop, difference))
    return rows


def _transit_ns(cause: TopicData, effect: TopicData) -> IntArray:
    """Reception of each effect after that of the cause with the same stamp.

    Without equal stamps, the last cause received before the effect counts, if it is less than a
    period away.
    """
    # With equal stamps only those count: the servo answers one tick of the clock with several
    # readings, and only the reading at the tick's own time waited for nothing else.
    assert cause.stamp_ns is not None
    assert effect.stamp_ns is not None
    order = np.argsort(cause.stamp_ns, kind="stable")
    stamps, logs = cause.stamp_ns[order], cause.log_time_ns[order]
    index = np.searchsorted(stamps, effect.stamp_ns + _STAMP_TOLERANCE_NS, side="right") - 1
    linked = (index >= 0) & (effect.stamp_ns - stamps[index] <= _STAMP_TOLERANCE_NS)
    if not np.any(linked):
        order = np.argsort(cause.log_time_ns, kind="stable")
        stamps, logs = cause.stamp_ns[order], cause.log_time_ns[order]
        index = np.searchsorted(logs, effect.log_time_ns, side="right") - 1
        period = float(np.median(np.diff(np.unique(stamps)))) if len(np.unique(stamps)) > 1 else 0.0
        linked = (index >= 0) & (np.abs(effect.stamp_ns - stamps[index]) < period)
    return (effect.log_time_ns - logs[index])[linked]


def _reaction_ns(cause: TopicData, effect: TopicData) -> IntArray:
    """Return the time from each cause to the reception of the first effect, without pauses."""
    logs = np.sort(effect.log_time_ns)
    index = np.searchsorted(logs, cause.log_time_ns, side="right")
    answered = index < len(logs)
    waited = logs[index[answered]] - cause.log_time_ns[answered]
    # A pause of the publisher is not a slow reaction.
    usual = float(np.median(logs[1:] - logs[:-1])) if len(logs) > 1 else np.inf
    return waited[waited < _PAUSE_PERIODS * usual]


def _latency(hop: Hop, difference_ns: IntArray) -> Latency:
    taken_ms = difference_ns * 1e-6
    middle, late, longest = (reduced(each, taken_ms) for each in (np.median, percentile_99, np.max))
    return Latency(hop.cause, hop.effect, hop.kind, len(taken_ms), middle, late, longest)
