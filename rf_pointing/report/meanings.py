"""Unit and meaning of what is read of each topic, from the comments of the message definitions.

`messages/` are the definitions of rf_pointing_msgs (a link to msg_defs/msg in a checkout), so that
they are there without ROS, too.  A comment begins with the unit: `# rad/s, after limits`.
"""

import re
from functools import cache
from pathlib import Path

from rf_pointing.report.topics import TOPICS

MESSAGES = Path(__file__).parent / "messages"
SUFFIXES = {"rad": "_rad", "rad/s": "_rad_s", "rad/s^2": "_rad_s2", "m": "_m", "m/s": "_m_s", "s": "_s", "dB": "_db",
            "dB-Hz": "_db_hz", "W": "_w", "ns": "_ns", "": ""}  # fmt: skip
"""End of the name of a column, by its unit."""
_FIELD = re.compile(r"^(\S+) (\w+) *(?:# *(.*(?:\n +#.*)*))?$", re.MULTILINE)
_JOINTS = {"position": ("rad", "encoder angle, continuous over all turns"), "velocity": ("rad/s", "encoder rate")}
"""JointState is a message of ROS, whose comments are not at hand without it."""
# A row of these tables is made of the elements of a list in their messages.
_INNER = {"passes": "Pass", "pass_certificate": "PassBranch"}
_PASSES = ("target", "aos", "tca", "los", "peak_elevation")

Meaning = tuple[str, str]


@cache
def meanings() -> dict[str, dict[str, Meaning]]:
    """Return unit and meaning of every column that is exported, by topic."""
    return {topic: _of_topic(topic) for topic, layout in TOPICS.items() if layout.columns}


def _of_topic(topic: str) -> dict[str, Meaning]:
    package, _, name = TOPICS[topic].type_name.partition("/msg/")
    if package != "rf_pointing_msgs":
        return _JOINTS
    fields = (_fields(_INNER[topic]) if topic in _INNER else {}) | _fields(name)
    return {column: fields[column] for column in (_PASSES if topic == "passes" else TOPICS[topic].columns)}


@cache
def _fields(name: str) -> dict[str, Meaning]:
    """Return unit and meaning of every field of a message; a time is read in ns."""
    found = {}
    for kind, field_name, comment in _FIELD.findall((MESSAGES / f"{name}.msg").read_text(encoding="utf-8")):
        text = re.sub(r"\s*\n +#\s*", " ", comment)
        unit = re.split("[, ]", text, maxsplit=1)[0]
        if kind == "builtin_interfaces/Time":
            found[field_name] = ("ns", f"{text} since 1970")
        elif unit in SUFFIXES:
            found[field_name] = (unit, text.removeprefix(unit).lstrip(", "))
        else:
            found[field_name] = ("", text)
    return found
