"""The modes of the antenna: what may be requested in each, and what leads to another.

    inactive --enable--> holding --command--> tracking --command ends at rest--> holding
    tracking --pause--> paused --resume--> tracking
    holding --identify--> manual_rate --end of the experiment--> stopping
    any of these --stop--> stopping --at rest--> holding, or fault when the stop had a reason
    a movable one --park, stow, disable--> parking, stowing, disabling --at rest-->
    parked, stowed, disabled --resume--> holding
    parked --stow--> stowing
    a movable one --go_to--> holding, on its way to where it was sent
    holding --jog--> jogging --no further jog in 0.5 s--> stopping
    fault --reset_fault--> holding, --stow_in_fault--> stowing with the azimuth braked

A loop or a sensor that cannot be trusted leads to fault at once, with the brakes set.  Nothing here
moves anything: the control unit gives a snapshot of the motion, and carries out what the answer
allows.
"""

from dataclasses import dataclass
from enum import StrEnum, auto

from rf_pointing.core.modes import antenna_is


class AntennaMode(StrEnum):
    """Modes of the antenna; the values travel in `antenna_status`."""

    INACTIVE = "inactive"
    HOLDING = "holding"
    TRACKING = "tracking"
    MANUAL_RATE = "manual_rate"
    JOGGING = "jogging"
    PAUSED = "paused"
    STOPPING = "stopping"
    FAULT = "fault"
    PARKING = "parking"
    STOWING = "stowing"
    DISABLING = "disabling"
    PARKED = "parked"
    STOWED = "stowed"
    DISABLED = "disabled"


OPERATED = {
    "park": ("park", "go to the park position"),
    "stow": ("stow", "go to the stow position"),
    "pause": ("pause", "stop, and keep the commands that come"),
    "disable": ("disable", "stop, and set the brakes"),
    "resume": ("release", "leave a pause or a rest"),
    "reset_fault": ("reset", "clear a latched fault"),
}
"""Requests without arguments, by service and method: the word of `station`, and its help."""


RELEASE, BRAKE = "resume", "disable"
"""Requests that leave a rest, and that set the brakes where the antenna is."""


class Request(StrEnum):
    """Request of an operator or a commander."""

    COMMAND = auto()
    IDENTIFY = auto()
    PAUSE = auto()
    RESUME = auto()
    PARK = auto()
    STOW = auto()
    GO_TO = auto()
    JOG = auto()
    STOW_IN_FAULT = auto()
    DISABLE = auto()
    RESET_FAULT = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeTraits:
    """Traits of a mode.

    `movable`: the position laws drive the axes, which may be sent to rest.  `motion`: what the
    safety gate calls the motion of this mode, "" where it need not pass.  `ends_in`: the mode at
    its end, with the brakes set.  `at_rest`: the brakes are set until `resume`.  `leaves_wind`:
    high wind sends the antenna to stow.  `leaves_sun`: an antenna at rest turns away from the Sun.
    `transmits`: the transmitter may be on.
    """

    movable: bool = False
    motion: str = ""
    ends_in: AntennaMode | None = None
    at_rest: bool = False
    leaves_wind: bool = False
    leaves_sun: bool = False
    transmits: bool = False


MODES = {
    AntennaMode.INACTIVE: ModeTraits(),
    AntennaMode.HOLDING: ModeTraits(movable=True, motion="preset", leaves_wind=True, leaves_sun=True, transmits=True),
    AntennaMode.TRACKING: ModeTraits(movable=True, motion="track", leaves_wind=True, leaves_sun=True, transmits=True),
    # An experiment passes the gate at its own rates, before the laws are run (see the control
    # unit).
    AntennaMode.MANUAL_RATE: ModeTraits(),
    AntennaMode.JOGGING: ModeTraits(movable=True, motion="manual", leaves_wind=True),
    AntennaMode.PAUSED: ModeTraits(movable=True, leaves_wind=True, leaves_sun=True),
    # A stop passes no gate: decelerating at the limits is the safest motion there is.
    AntennaMode.STOPPING: ModeTraits(movable=True),
    AntennaMode.FAULT: ModeTraits(),
    AntennaMode.PARKING: ModeTraits(movable=True, motion="park", ends_in=AntennaMode.PARKED, leaves_wind=True),
    # Already on its way to where high wind would send it.
    AntennaMode.STOWING: ModeTraits(movable=True, motion="stow", ends_in=AntennaMode.STOWED),
    # Not movable: neither park nor stow may overtake a disable that is under way.
    AntennaMode.DISABLING: ModeTraits(ends_in=AntennaMode.DISABLED),
    # Brakes hold a parked dish in any wind, but its park elevation is not the one at which the wind
    # does least.
    AntennaMode.PARKED: ModeTraits(at_rest=True, leaves_wind=True, leaves_sun=True),
    AntennaMode.STOWED: ModeTraits(at_rest=True, leaves_sun=True),
    # Somebody may be working on it.
    AntennaMode.DISABLED: ModeTraits(at_rest=True),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSnapshot:
    """The motion at one instant.

    `fault` is the latched fault and `high_wind` why the wind forbids to leave a rest, "" for none;
    `moving` says whether an axis turns too fast for its brakes or for an experiment, `arrived`
    whether the encoders are at the goal.
    """

    fault: str
    high_wind: str
    moving: bool
    arrived: bool


class AntennaModes:
    """The mode machine of one antenna; it begins inactive."""

    def __init__(self) -> None:
        self.mode = AntennaMode.INACTIVE

    @property
    def traits(self) -> ModeTraits:
        """Traits of the present mode."""
        return MODES[self.mode]

    def reason_against(self, request: Request, now: MotionSnapshot) -> str:
        """Return why this request is refused in the present mode, "" when it is not."""
        latched = f"fault latched ({now.fault}); reset it first" if now.fault else ""
        match request:
            case Request.COMMAND:
                return latched or self._against_command()
            case Request.IDENTIFY:
                wrong = "" if self.mode == AntennaMode.HOLDING else f"{antenna_is(self.mode)}, must be holding"
                return latched or wrong or ("the axes are still moving" if now.moving else "")
            case Request.JOG:
                may = (AntennaMode.HOLDING, AntennaMode.JOGGING, AntennaMode.STOPPING)
                wrong = "" if self.mode in may else f"{antenna_is(self.mode)}, must be holding"
                return latched or now.high_wind or wrong
            case Request.PAUSE:
                return "" if self.mode == AntennaMode.TRACKING else f"nothing to pause, {antenna_is(self.mode)}"
            case Request.RESUME:
                if self.mode == AntennaMode.PAUSED:
                    return ""
                return now.high_wind if self.traits.at_rest else f"nothing to resume, {antenna_is(self.mode)}"
            case Request.PARK | Request.STOW | Request.GO_TO:
                windy = now.high_wind if request == Request.GO_TO else ""
                stows_parked = request == Request.STOW and self.mode == AntennaMode.PARKED
                return latched or windy or ("" if self.traits.movable or stows_parked else antenna_is(self.mode))
            case Request.STOW_IN_FAULT:
                if not now.fault:
                    return "no fault is latched; request stow"
                return "" if self.mode == AntennaMode.FAULT else f"{antenna_is(self.mode)}, must be in fault"
            case Request.DISABLE:
                return "" if self.traits.movable else f"nothing to disable, {antenna_is(self.mode)}"
            case Request.RESET_FAULT:
                slowing = self.mode == AntennaMode.STOPPING or now.moving
                return "the axes are still moving" if now.fault and slowing else ""

    def _against_command(self) -> str:
        if self.mode == AntennaMode.INACTIVE:
            return "the antenna is not active"
        if self.mode == AntennaMode.MANUAL_RATE:
            return "an identification drives the antenna"
        if self.mode == AntennaMode.JOGGING:
            return "the antenna is jogged"
        if self.traits.ends_in or self.traits.at_rest:
            return f"{antenna_is(self.mode)}; resume it first"
        return ""

    def hold(self, now: MotionSnapshot) -> None:
        """Take the mode of an antenna that stands under its position laws."""
        self.mode = AntennaMode.FAULT if now.fault else AntennaMode.HOLDING

    def follow(self) -> None:
        """Take the mode of an accepted command; a pause keeps it for later."""
        # A pause keeps taking commands, so that `resume` goes on with the newest.
        if self.mode != AntennaMode.PAUSED:
            self.mode = AntennaMode.TRACKING

    def stop(self) -> None:
        """Take the mode of a controlled stop, where there is motion to stop."""
        # A parking antenna may be stopped; one whose brakes are set has nothing to stop.
        if self.traits.movable:
            self.mode = AntennaMode.STOPPING

    def settle(self, now: MotionSnapshot) -> bool:
        """Take the mode after a motion that has ended; return whether the brakes are to be set."""
        if self.mode == AntennaMode.STOPPING:
            self.hold(now)
        # A stopped command is not a stopped antenna: parked means that the encoders have followed.
        # `disabling` has no goal.
        if self.traits.ends_in is None or not (now.arrived or self.mode == AntennaMode.DISABLING):
            return False
        self.mode = self.traits.ends_in
        return True
