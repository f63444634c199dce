"""The words of the state table: modes of the controller, and the sensors that it may use."""

from enum import StrEnum

__all__ = ["Mode", "Sensor"]


class Mode(StrEnum):
    """Modes of the state table (`tracking/autotrack.py`); the values travel in `tracking_status`."""

    IDLE = "idle"
    SLEW = "slew"
    PROGRAM_TRACK = "program_track"
    SEARCH = "search"
    STEPTRACK = "steptrack"
    CONSCAN = "conscan"
    MONOPULSE = "monopulse"
    CALIBRATE = "calibrate"
    COAST = "coast"
    HAND_BACK = "hand_back"
    STOW = "stow"


class Sensor(StrEnum):
    """Sensors of a pass: the radio sensors, the choice between them, and none of them."""

    AUTO = "auto"
    PROGRAM = "program"
    MONOPULSE = "monopulse"
    CONSCAN = "conscan"
    STEPTRACK = "steptrack"
