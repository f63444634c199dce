"""A recorded run of one antenna as numpy arrays, from any rosbag2 bag (ours, or `ros2 bag record -a`).

Types come from the bag itself.  Stamps are simulation time, log times the wall clock of the recorder, both integer
nanoseconds.  A message that cannot be decoded is counted; NaN values are kept.
"""

import json
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rf_pointing.report.bag_source import BagSource, open_bag
from rf_pointing.report.bag_writer import LOST_NOTE, PROBLEM_NOTE, TopicLoss
from rf_pointing.report.collector import Collector
from rf_pointing.report.topic_data import TopicData
from rf_pointing.report.topics import TOPICS

__all__ = ["Pass", "Recording", "antennas", "namespaces", "read_recording"]

_LONGEST_FIRST = sorted(TOPICS, key=len, reverse=True)


@dataclass(frozen=True)
class Pass:
    """One predicted pass: times in nanoseconds of simulation time, angle in radians."""

    target: str
    aos_ns: int
    tca_ns: int
    los_ns: int
    peak_elevation_rad: float


@dataclass(frozen=True)
class Recording:
    """All topics of one antenna namespace, by name relative to it, and what is wrong with the recording.

    `others` counts the messages of topics that belong to no antenna or to another.  `warnings` holds what
    `/diagnostics` said above OK as (component, last message, count); messages that differ in numbers only are one.
    `not_recorded` is what the recorder itself reported as lost.
    """

    path: Path
    namespace: str
    topics: dict[str, TopicData]
    passes: tuple[Pass, ...]
    warnings: tuple[tuple[str, str, int], ...]
    others: dict[str, int]
    notes: dict[str, str]
    not_recorded: tuple[TopicLoss, ...]
    problems: tuple[str, ...]

    def get(self, name: str) -> TopicData | None:
        """Return topic `name`, or None when the recording holds no message of it."""
        data = self.topics.get(name)
        return data if data is not None and len(data) else None


def namespaces(topics: Iterable[str]) -> list[str]:
    """Return the antenna namespaces among full topic names, sorted; the root namespace is ""."""
    found = set()
    for topic in topics:
        name = next((known for known in _LONGEST_FIRST if topic.endswith(f"/{known}")), None)
        # The global clock of an ordinary simulation is no sign of an antenna.
        if name is not None and topic != "/clock":
            found.add(topic.removesuffix(f"/{name}"))
    return sorted(found)


def antennas(path: Path | str) -> list[str]:
    """Return the antenna namespaces of a bag; ValueError where nothing of it can be read."""
    with ExitStack() as stack:
        return _antennas(open_bag(Path(path), stack))


def read_recording(path: Path | str, *, namespace: str | None = None) -> Recording:
    """Read the recording of one antenna.

    Parameters
    ----------
    path
        Bag directory, or one of its files.
    namespace
        Which antenna; needed when the bag holds several.

    Raises
    ------
    ValueError
        Nothing readable at `path`, no antenna in it, several and `namespace` is None, or not the one asked for.
    """
    path = Path(path)
    with ExitStack() as stack:
        source = open_bag(path, stack)
        found = _antennas(source)
        if not found:
            raise ValueError("; ".join([f"path={path} holds no topic of an antenna", *source.problems]))
        chosen = _chosen(found, namespace, path)
        collector = Collector(source, chosen)
        topics = collector.topics()
        problem = source.notes.get(PROBLEM_NOTE, "")
        return Recording(
            path=path,
            namespace=chosen,
            topics=topics,
            passes=_passes(topics.get("passes")),
            warnings=tuple((key[0], *said) for key, said in sorted(collector.warnings.items())),
            others=dict(sorted(collector.others.items())),
            notes={key: text for key, text in source.notes.items() if key not in (LOST_NOTE, PROBLEM_NOTE)},
            not_recorded=tuple(TopicLoss(**item) for item in json.loads(source.notes.get(LOST_NOTE, "[]"))),
            problems=(*([problem] if problem else []), *collector.all_problems()),
        )


def _antennas(source: BagSource) -> list[str]:
    ours = {item.topic for item in source.connections if item.msgtype.startswith("rf_pointing_msgs/")}
    return namespaces(ours or {item.topic for item in source.connections})


def _chosen(found: list[str], wanted: str | None, path: Path) -> str:
    names = ", ".join(name or "/" for name in found)
    if wanted is None:
        if len(found) > 1:
            raise ValueError(f"path={path} holds several antennas ({names}); choose one by its namespace")
        return found[0]
    stem = wanted.strip("/")
    full = f"/{stem}" if stem else ""
    if full not in found:
        raise ValueError(f"namespace={full or '/'} is not in {path}, which holds {names}")
    return full


def _passes(data: TopicData | None) -> tuple[Pass, ...]:
    """Return every pass that any list announced, in its newest version, in order of acquisition."""
    found: list[Pass] = []
    for new in (_pass(item) for entry in (data["passes"] if data is not None else ()) for item in entry):
        found = [old for old in found if not _overlap(old, new)] + [new]
    return tuple(sorted(found, key=lambda item: item.aos_ns))


def _overlap(a: Pass, b: Pass) -> bool:
    return a.target == b.target and a.aos_ns < b.los_ns and b.aos_ns < a.los_ns


def _pass(message: Any) -> Pass:
    aos, tca, los = (time.sec * 10**9 + time.nanosec for time in (message.aos, message.tca, message.los))
    return Pass(message.target, aos, tca, los, message.peak_elevation)
