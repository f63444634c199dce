"""Status that the controller and the antenna publish about themselves."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from rf_pointing.core.types import Array


class Level(IntEnum):
    """How bad things are, in the words of /diagnostics."""

    OK = 0
    WARN = 1
    ERROR = 2


class Report(NamedTuple):
    """One check on /diagnostics: how bad things are, a sentence, and the numbers behind it."""

    level: Level
    message: str
    values: dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingStatus:
    """Mode of the pointing controller at `t_s`, with what it commands and senses; angles in rad.

    The axis fields compare command and encoders (`antenna_watch.py`), the seconds and the loss are
    the outcome of the pass so far (`outcome.py`), `alarm` is why the level is not OK.
    """

    t_s: float
    mode: str
    sensor: str
    target: str
    reason: str
    los_t_s: float
    azimuth_rad: float
    elevation_rad: float
    scan_centre_rad: Array
    cross_elevation_error_rad: float
    elevation_error_rad: float
    cross_elevation_offset_rad: float
    elevation_offset_rad: float
    carrier_to_noise_db_hz: float
    half_power_beamwidth_rad: float
    command_lead_s: float
    axis_error_rad: Array = field(default_factory=lambda: np.zeros(2))
    axis_distance_rad: float = 0.0
    axis_age_s: float = 0.0
    on_source: bool = False
    settle_count: int = 0
    held: bool = False
    seconds_tracked_s: float = 0.0
    seconds_lost_s: float = 0.0
    mean_loss_db: float = 0.0
    level: int = Level.OK
    alarm: str = ""

    @property
    def offset_rad(self) -> Array:
        """Offset added to the prediction, without the scans (2,): cross-elevation and elevation."""
        return np.array([self.cross_elevation_offset_rad, self.elevation_offset_rad])


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaStatus:
    """State of the drive at `t_s`: mode, fault, what the loops follow, counts of commands.

    `set_points`, `starts` and `reversals` of a drive that takes positions count since tracking
    began.
    """

    t_s: float
    mode: str
    fault: str
    commanded_rad: Array
    rate_command_rad_s: Array
    rate_limit_rad_s: Array
    acceleration_limit_rad_s2: Array
    at_limit: tuple[bool, bool]
    command_lead_s: float
    commands_accepted: int
    commands_rejected: int
    last_rejection: str
    warning: str = ""
    high_wind: str = ""
    transmit_inhibit: str = ""
    commander: str = ""
    set_points: int = 0
    starts: tuple[int, int] = (0, 0)
    reversals: tuple[int, int] = (0, 0)
