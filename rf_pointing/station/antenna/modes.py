"""The modes of the antenna: what may be asked for in each of them, and what leads from one to another.

    inactive --enable--> holding --command--> tracking --command ends at rest--> holding
    tracking --pause--> paused --resume--> tracking
    holding --identify--> manual_rate --end of the experiment--> stopping
    any of these --stop--> stopping --at rest--> holding, or fault when the stop had a reason
    a movable one --park, stow, release--> parking, stowing, disabling --> parked, stowed, disabled --resume--> holding
    parked --stow--> stowing
    fault --reset_fault--> holding

A loop or a sensor that cannot be trusted leads to fault at once, with the brakes set.  Each request does what it says and
returns "", or changes nothing and returns why not.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.identification import IdentificationExperiment
from rf_pointing.station.antenna.axes import AntennaAxes, pair
from rf_pointing.station.antenna.manual_rate import ManualRate
from rf_pointing.station.antenna.safety import AntennaSafety
from rf_pointing.station.antenna.slew_path import NEW_COURSE_RAD

__all__ = ["AntennaModes"]

Array = NDArray[np.float64]
ARRIVED_RAD = math.radians(0.02)
RESTING = {"parking": "parked", "stowing": "stowed", "disabling": "disabled"}
"""Modes that end at rest with the brakes set, and the modes they end in."""
MOVABLE = ("tracking", "holding", "stopping", "paused", "parking", "stowing")
"""Modes in which the position laws drive the axes: from them the antenna may be sent to rest."""


class AntennaModes:
    """The mode machine of one antenna; it begins inactive.

    `mode` is inactive, holding, tracking, manual_rate, paused, stopping, fault; parking, stowing, disabling or their ends.
    """

    def __init__(self, axes: AntennaAxes, safety: AntennaSafety, manual: ManualRate) -> None:
        self.mode = "inactive"
        self._axes, self._safety, self._manual = axes, safety, manual

    def enable(self) -> None:
        """Release the brakes and hold where the axes are; nothing moves.  After an oscillation they stay set."""
        axes = self._axes
        self._safety.release(pair(axes.hardware.plant.true_joint_rad))
        axes.rate_command_rad_s = np.zeros(2)
        self.watch()
        self._hold_or_fault()
        if not axes.loops.oscillation:
            axes.hold()
            axes.hardware.plant.release_brake()

    def rest(self, mode: str) -> None:
        """Set the brakes and stay in a rest mode: inactive, which `enable` ends, or those that `resume` ends."""
        self._axes.hardware.plant.brake()
        self.mode = mode

    def stop(self, reason: str = "") -> None:
        """Decelerate both axes at their limits; with a reason the stop latches as a fault."""
        self._axes.course.stop()
        self._safety.authority.release()
        if reason:
            self._safety.latch.latch(reason, self._axes.t_s)
        if self.mode == "manual_rate":
            self.leave_manual_rate(reason or "stop was requested")
        if self.mode in MOVABLE:
            self.mode = "stopping"

    def trip(self, reason: str) -> None:
        """Cut the drives and set the brakes at once, and latch why."""
        self._safety.latch.latch(reason, self._axes.t_s)
        self._axes.cut()
        self.mode = "fault"

    def watch(self) -> None:
        """Look at the sensors after a tick, and trip on what cannot be bridged."""
        reason = self._axes.watch()
        if reason:
            self.trip(reason)

    def reset_fault(self) -> str:
        """Clear a latched fault."""
        if self._fault and (self.mode == "stopping" or self._axes.moving):
            return "the axes are still moving"
        refused = self._safety.latch.reset(self._safety.lasting_cause())
        if not refused and self._axes.loops.oscillation:
            self._axes.hold()
        if not refused and self.mode == "fault":
            self.enable()
        return refused

    def pause(self) -> str:
        """Stop where the axes are and keep taking commands; `resume` goes on with them."""
        if self.mode != "tracking":
            return f"nothing to pause, the antenna is {self.mode}"
        self._axes.course.preprocessor.stop()
        self.mode = "paused"
        return ""

    def resume(self) -> str:
        """Go on after a pause, or leave park, stow or disable and hold."""
        if self.mode == "paused":
            refused = self._take_way_back()
            if not refused:
                self._axes.course.preprocessor.follow()
                self.mode = "tracking"
            return refused
        if self.mode not in RESTING.values():
            return f"nothing to resume, the antenna is {self.mode}"
        if self._safety.wind.reason:
            return self._safety.wind.reason
        self.enable()
        return ""

    def park(self) -> str:
        """Go to the park position and set the brakes there."""
        place = self._safety.params
        return self._go("parking", (place.park_azimuth_rad, place.park_elevation_rad))

    def stow(self) -> str:
        """Go to the stow elevation at the present azimuth and set the brakes there; a parked antenna leaves its park for it."""
        return self._go("stowing", (float(self._axes.used_rad[0]), self._safety.params.stow_elevation_rad))

    def release(self) -> str:
        """Stop under control and set the brakes where the axes then are."""
        if self.mode not in MOVABLE:
            return f"nothing to disable, the antenna is {self.mode}"
        self.stop()
        self.mode = "disabling"
        return ""

    def identify(self, experiment: IdentificationExperiment) -> str:
        """Let an experiment give the rate commands until it has finished or `stop`."""
        axes = self._axes
        if self.mode != "holding":
            return f"the antenna is {self._fault or self.mode}, must be holding"
        if axes.moving:
            return "the axes are still moving"
        refused = self._manual.refusal(experiment, axes.limits)
        refused = refused or self._safety.check("manual", axes.t_s, pair(axes.used_rad), axes.used_rad[None, :]).reason
        if refused:
            return refused
        self._manual.begin(experiment)
        self.mode = "manual_rate"
        return ""

    def leave_manual_rate(self, reason: str) -> None:
        """End the experiment, and bring the axes that it has moved to rest."""
        self._manual.end(reason)
        self._axes.take_over()
        self.mode = "stopping"

    def refusal_of_command(self) -> str:
        """Return why no command is taken in this mode, "" if one is."""
        if self._fault:
            return f"fault latched ({self._fault}); reset it first"
        if self.mode == "inactive":
            return "the antenna is not active"
        if self.mode == "manual_rate":
            return "an identification drives the antenna"
        if self.mode in RESTING or self.mode in RESTING.values():
            return f"the antenna is {self.mode}; resume it first"
        return ""

    def follow(self) -> None:
        """Follow the command that was taken; a pause keeps it for later."""
        if self.mode != "paused":
            self._axes.course.preprocessor.follow()
            self.mode = "tracking"

    def come_to_rest(self, position_rad: Array) -> None:
        """End a motion that has come to rest at this position, and hold there."""
        self._axes.course.goal_rad = position_rad
        self._hold_or_fault()

    def settle(self, position_rad: Array, measured_rad: Array) -> None:
        """End a mode whose course stands still at `position_rad`, once the encoders have followed."""
        course = self._axes.course
        if self.mode == "stopping":
            self.come_to_rest(position_rad)
        arrived = float(np.max(np.abs(measured_rad - course.goal_rad))) < ARRIVED_RAD
        if self.mode == "disabling" or (self.mode in ("parking", "stowing") and arrived):
            self.rest(RESTING[self.mode])

    def _take_way_back(self) -> str:
        """Find the way from where a pause has held the antenna to where the commands have come; return why there is none."""
        axes, course = self._axes, self._axes.course
        if course.table.empty:
            return ""
        goal = course.table.at(axes.t_s).position_rad
        if float(np.max(np.abs(goal - axes.used_rad))) <= NEW_COURSE_RAD:
            return ""
        decision = self._safety.check("preset", axes.t_s, pair(axes.used_rad), goal[None, :])
        if decision.allowed:
            course.take_way(decision.way)
        return decision.reason

    @property
    def _fault(self) -> str:
        return self._safety.latch.text

    def _hold_or_fault(self) -> None:
        self.mode = "fault" if self._fault else "holding"

    def _go(self, mode: str, goal: tuple[float, float]) -> str:
        """Begin a motion of the antenna's own, through the gate."""
        if self._fault:
            return f"fault latched ({self._fault}); reset it first"
        kind = "stow" if mode == "stowing" else "park"
        if self.mode not in MOVABLE and (kind, self.mode) != ("stow", "parked"):
            return f"the antenna is {self.mode}"
        decision = self._safety.check(kind, self._axes.t_s, pair(self._axes.used_rad), np.array([goal]))
        if not decision.allowed:
            return decision.reason
        if self.mode == "parked":
            self.enable()
            if self._fault:
                return self._fault
        self._safety.authority.release()
        self._axes.course.go(goal, decision.way)
        self.mode = mode
        return ""
