"""The words of the state table: modes of the controller, and the sensors that it may use."""

from enum import StrEnum


class Mode(StrEnum):
    """Modes of the state table (`tracking/autotrack.py`); the values travel in `tracking_status`.

    While a sensor tracks, the mode bears its name; that of a registered tracker is not a member.
    """

    IDLE = "idle"
    SLEW = "slew"
    PROGRAM_TRACK = "program_track"
    SEARCH = "search"
    STEPTRACK = "steptrack"
    CONSCAN = "conscan"
    MONOPULSE = "monopulse"
    ARRAY = "array"
    CALIBRATE = "calibrate"
    COAST = "coast"
    # The value is on the wire and in recordings, so it keeps its first name.
    HOLD_OFF = "hand_back"


# Modes of the antenna whose words cannot follow "is".
_NOUNS = {"fault": "in fault", "manual_rate": "driven by an experiment", "jogging": "jogged"}


def antenna_is(mode: str) -> str:
    """Return the clause that says which mode of `antenna_status` the antenna is in."""
    return f"the antenna is {_NOUNS.get(mode, mode)}"


class Sensor(StrEnum):
    """Sensors of a pass: the radio sensors, the choice between them, and none of them."""

    AUTO = "auto"
    PROGRAM = "program"
    MONOPULSE = "monopulse"
    CONSCAN = "conscan"
    STEPTRACK = "steptrack"
    ARRAY = "array"
