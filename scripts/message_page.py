"""Print docs/messages.md: messages, services and actions, from the comments of their definitions.

    scripts/run-python scripts/message_page.py > docs/messages.md

`scripts/check` and a test compare the page with msg_defs/.
"""

import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from rf_pointing.report.export import FIELD

DEFINITIONS = Path(__file__).parents[1] / "msg_defs"
PARTS = {"msg": ("",), "srv": ("Request", "Response"), "action": ("Goal", "Result", "Feedback")}
TITLES = {"msg": "Messages", "srv": "Services", "action": "Actions"}
HEADER = """\
# Messages

Every message, service and action of `rf_pointing_msgs`. A meaning begins with the unit: SI and
radians, times in UTC. Signs and frames are in [conventions.md](conventions.md), the topics in
[nodes_and_topics.md](nodes_and_topics.md). The values of a closed set are constants of their
interface: with `AntennaStatus.MODE_FAULT` a misspelt one is an error where it is written.

This page is made by `scripts/run-python scripts/message_page.py > docs/messages.md` from the
comments in `msg_defs/`; `scripts/check` compares them.
"""
CONSTANT = re.compile(r"^\S+ ([A-Z][A-Z0-9_]*)=(.*)$", re.MULTILINE)


def message_page() -> str:
    """Return the page."""
    return HEADER + "".join(text for kind in PARTS for text in _kind(kind))


def _kind(kind: str) -> Iterator[str]:
    files = sorted(DEFINITIONS.glob(f"{kind}/*.{kind}"))
    links = ", ".join(f"[{each.stem}](#{each.stem.lower()})" for each in files)
    yield f"\n## {TITLES[kind]}\n\n{_filled(links)}\n"
    for file in files:
        text = file.read_text(encoding="utf-8")
        head = re.match(r"(?:#.*\n)*", text)
        assert head is not None
        about = re.sub("^# *", "", head.group(), flags=re.MULTILINE)
        yield f"\n### {file.stem}\n\n{_filled(about)}\n"
        parts = re.split("^---$", text[head.end() :], flags=re.MULTILINE)
        for title, part in zip(PARTS[kind], parts, strict=True):
            yield from _table(title, part)


def _filled(text: str) -> str:
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)


def _table(title: str, part: str) -> Iterator[str]:
    yield f"\n| {title or 'Field'} | Type | Meaning |\n|---|---|---|\n"
    end = 0
    for found in FIELD.finditer(part):
        kind, name, comment = found[1], found[2], re.sub(r"\s*\n +#\s*", " ", found[3] or "")
        # The constants of a field stand above it.
        known = [f"`{key}` {value}" for key, value in CONSTANT.findall(part, end, found.start())]
        end = found.start()
        meaning = "; ".join([comment.replace("|", "\\|"), *([", ".join(known)] if known else [])])
        yield f"| `{name}` | `{kind}` | {meaning} |\n"


def main() -> None:
    """Print the page."""
    sys.stdout.write(message_page())


if __name__ == "__main__":
    main()
