"""Lines of the logs of nodes and commands: text for a reader, or JSON for a collector.

`RF_POINTING_LOG=json` in the environment makes every line of a node's log, and every line that a
command says on stderr, an object with `t_s` (UTC), `level`, `name` and `text`.  Data on stdout stay
as they are.
"""

import json
import os
import sys
import time

_CHOSEN = "RF_POINTING_LOG"
_CHOICES = ("", "text", "json")
ROS_FORMAT = '{"t_s": {time}, "level": "{severity}", "name": "{name}", "text": "{message}"}'
"""Lines of rcutils, which knows no quoting: texts come `quoted`."""


def json_lines() -> bool:
    """Return whether lines of JSON are wanted; ValueError for an unknown word."""
    chosen = os.environ.get(_CHOSEN, "")
    if chosen not in _CHOICES:
        raise ValueError(f"{_CHOSEN}={chosen!r} must be text or json")
    return chosen == "json"


def quoted(text: str) -> str:
    """Return a text as it stands between the quotes of a JSON string."""
    return json.dumps(text)[1:-1]


def say(program: str, text: str, level: str = "INFO") -> None:
    """Report to the user on stderr; stdout is for data."""
    line = f"{program}: {text}"
    if json_lines():
        line = json.dumps({"t_s": time.time(), "level": level, "name": program, "text": text})
    print(line, file=sys.stderr, flush=True)
