"""Write the table of topics, between the markers `<!-- topics -->` and `<!-- /topics -->`, into the
page that has them.

    scripts/run-python scripts/topic_table.py

The table is made from `TOPICS`, `VIEWS` and `INHIBIT` of rf_pointing/ros/graph.py; a test compares
the page with it.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from rclpy.qos import DurabilityPolicy, QoSProfile

from rf_pointing.ros.graph import FOREIGN, INHIBIT, TOPICS, VIEWS, Topic

ROOT = Path(__file__).parents[1]
BETWEEN = re.compile(r"(?<=<!-- topics -->\n).*?(?=<!-- /topics -->)", re.DOTALL)


def topic_table() -> str:
    """Return the Markdown table "Topics of one antenna"."""
    head = ("topic", "type", "rate", "QoS", "published by", "frame")
    rows = [head, ("---",) * len(head), *map(_row, (*TOPICS, *VIEWS, INHIBIT))]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def pages() -> list[Path]:
    """Return the pages that have the markers."""
    return [page for page in (ROOT / "README.md", *sorted(ROOT.glob("docs/*.md"))) if BETWEEN.search(page.read_text())]


def _row(topic: Topic) -> tuple[str, ...]:
    meaning = f" ({topic.meaning})" if topic.meaning else ""
    frame = f"`{topic.frame}`" if topic.frame else ""
    qos = ", ".join(_qos(topic.qos)) + "; received best effort" * (topic.name in FOREIGN)
    return f"`{topic.name}`{meaning}", f"`{topic.type_name}`", topic.rate, qos, topic.publisher, frame


def _qos(profile: QoSProfile) -> Iterator[str]:
    yield profile.reliability.name.lower()
    if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        yield "transient local"
    yield str(profile.depth)
    for name in ("deadline", "lifespan"):
        # Not set is 0 ns.
        if limit_ns := getattr(profile, name).nanoseconds:
            yield f"{name} {limit_ns * 1e-9:g} s"


def main() -> None:
    """Write the table."""
    for page in pages():
        page.write_text(BETWEEN.sub(topic_table(), page.read_text()))


if __name__ == "__main__":
    main()
