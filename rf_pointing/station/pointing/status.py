"""Status that the controller publishes, and the form of a check on /diagnostics."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from rf_pointing.core import Array, HeldDirection
from rf_pointing.tracking.sensors import SENSORS


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
    the outcome of the pass so far (`outcome.py`), `offsets` are those of the operator, `alarm` is
    why the level is not OK.
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
    offsets: str = ""
    level: int = Level.OK
    alarm: str = ""

    @property
    def held_direction(self) -> HeldDirection | None:
        """The direction in which a sensor holds the target, None while none does."""
        if not (self.held and self.mode in SENSORS):
            return None
        return HeldDirection(
            t_s=self.t_s, azimuth_rad=self.azimuth_rad, elevation_rad=self.elevation_rad,
            beamwidth_rad=self.half_power_beamwidth_rad,
        )  # fmt: skip

    @property
    def offset_rad(self) -> Array:
        """Offset added to the prediction, without the scans (2,): cross-elevation and elevation."""
        return np.array([self.cross_elevation_offset_rad, self.elevation_offset_rad])
