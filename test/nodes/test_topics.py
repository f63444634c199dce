"""The README's table of topics is that of the code."""

import re
from pathlib import Path

import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from rf_pointing.nodes.topics import TOPICS, Topic

README = Path(__file__).parents[2] / "README.md"
KNOWN = {topic.name: topic for topic in TOPICS}


def documented() -> dict[str, list[str]]:
    """Return the cells of the README's row of every topic; one row may tell of two."""
    text = README.read_text().split("## Topics of one antenna")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    return {name: row for row in rows[2:] for name in re.findall(r"`([^`]+)`", row[0])}


def test_the_readme_names_every_topic_and_no_other() -> None:
    assert list(documented()) == list(KNOWN)


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_the_readme_tells_type_quality_of_service_and_publisher(topic: Topic) -> None:
    _, kind, rate, qos, publisher = documented()[topic.name]
    assert topic.message_type.__name__ in kind
    assert f"{topic.message_type.__module__.split('.')[0]}/" in kind
    assert topic.rate.split(",")[0].removesuffix(" Hz") in rate
    assert ("transient local" in qos) == (topic.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)
    assert ("reliable" in qos) == (topic.qos.reliability == ReliabilityPolicy.RELIABLE)
    assert re.findall(r"\d+", qos)[0] == str(topic.qos.depth)
    assert publisher == "trackers" or topic.publisher in publisher
