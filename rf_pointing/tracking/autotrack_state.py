"""What the autotrack table looks at: its parameters, its inputs of one tick and its own state."""

import math
from dataclasses import dataclass

from rf_pointing.core import Mode, Params, parameter

__all__ = ["MODES", "SENSORS", "AutotrackInputs", "AutotrackParams", "AutotrackState"]

MODES = tuple(Mode)
SENSORS = ("auto", "monopulse", "conscan", "steptrack", "none")
RF_MODES = (Mode.STEPTRACK, Mode.CONSCAN, Mode.MONOPULSE)


@dataclass(frozen=True, kw_only=True)
class AutotrackParams(Params):
    """Gates and times of the state table; each gate opens at `_on` and closes at `_off`."""

    sensor: str = parameter("auto", "which sensor may track (none: ephemeris only)", choices=SENSORS)
    carrier_on_db_hz: float = parameter(22.0, "C/N0 from which there is a carrier", low=0.0, high=120.0)
    carrier_off_db_hz: float = parameter(18.0, "C/N0 below which the carrier is lost", low=0.0, high=120.0)
    monopulse_on_db_hz: float = parameter(36.0, "C/N0 from which monopulse is chosen", low=0.0, high=120.0)
    monopulse_off_db_hz: float = parameter(32.0, "C/N0 below which monopulse is left", low=0.0, high=120.0)
    beam_drop_db: float = parameter(
        10.0, "C/N0 below that on the beam's axis at which the target is outside the beam", low=3.0, high=60.0
    )
    confirm_s: float = parameter(0.3, "time a carrier must last before it counts", low=0.0, high=60.0)
    patience_s: float = parameter(1.0, "time of invalid errors after which monopulse is left", low=0.0, high=60.0)
    coast_s: float = parameter(5.0, "time on the trimmed ephemeris before a search", low=0.0, high=600.0)
    settle_s: float = parameter(3.0, "time on program track without a carrier before a search", low=0.0, high=600.0)
    search_turn_s: float = parameter(
        8.0, "time without a higher C/N0 after which a search has seen the target: one turn", low=0.1, high=600.0
    )
    search_s: float = parameter(60.0, "longest search", low=0.1, high=3600.0)
    calibrate_s: float = parameter(25.0, "time of a calibration scan", low=1.0, high=3600.0)
    hold_s: float = parameter(5.0, "time in hand back before the sensors are trusted again", low=0.0, high=600.0)
    most_false_locks: int = parameter(
        2, "false locks of monopulse after which auto leaves it alone until a calibration", low=1, high=1000
    )

    def check_together(self) -> None:
        """Refuse a gate that closes above where it opens."""
        for gate in ("carrier", "monopulse"):
            on, off = getattr(self, f"{gate}_on_db_hz"), getattr(self, f"{gate}_off_db_hz")
            if off >= on:
                raise ValueError(f"{gate}_off_db_hz={off} must be < {gate}_on_db_hz={on}")
        if self.monopulse_off_db_hz < self.carrier_off_db_hz:
            raise ValueError(
                f"monopulse_off_db_hz={self.monopulse_off_db_hz} must be >= carrier_off_db_hz={self.carrier_off_db_hz}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class AutotrackInputs:
    """What is known at one tick.

    `request` is idle, track, calibrate or stow.  `carrier_to_noise_db_hz` is the receiver's own, -inf for none or a stale one.
    `axis_db_hz` is the C/N0 that the link would give on the beam's axis, -inf where it is not known.
    `conscan_valid` is that of the last conscan estimate, true before the first one.
    `arriving`: the beam is still brought to where it was sent, so that errors which are not valid yet say nothing.
    `fault` is why the sensor in use must not be trusted (sidelobe, sign flip), empty if it may be.
    """

    t_s: float
    request: str
    target_available: bool
    on_target: bool
    carrier_to_noise_db_hz: float = -math.inf
    axis_db_hz: float = -math.inf
    monopulse_valid: bool = False
    conscan_valid: bool = True
    arriving: bool = False
    fault: str = ""

    def __post_init__(self) -> None:
        if self.request not in ("idle", "track", "calibrate", "stow"):
            raise ValueError(f"request={self.request!r} must be one of idle, track, calibrate, stow")
        if not math.isfinite(self.t_s):
            raise ValueError(f"t_s={self.t_s} must be finite")


@dataclass(frozen=True, slots=True, kw_only=True)
class AutotrackState:
    """Mode, when and why it was entered, and what the gates remember.

    `peak_db_hz` is the largest C/N0 of the last search and `peak_s` its time: where the beam was then is where to go
    when the search ends in coasting.  `false_locks` counts those of monopulse since the pass began or the feed was calibrated.
    """

    mode: str = "idle"
    entered_s: float = 0.0
    reason: str = "start"
    carrier: bool = False
    strong: bool = False
    carrier_since_s: float | None = None
    invalid_since_s: float | None = None
    peak_db_hz: float = -math.inf
    peak_s: float | None = None
    false_locks: int = 0

    @property
    def integrating(self) -> bool:
        """Whether a sensed error may move the antenna or the trim: only while tracking a carrier that is there."""
        return self.mode in RF_MODES and self.carrier

    @property
    def scanning(self) -> bool:
        """Whether the conical scan is added to the command."""
        return self.mode == "conscan"
