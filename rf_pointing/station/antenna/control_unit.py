"""The control unit of an antenna: commands and requests in, encoder angles and status out.

It is in front of any hardware.  Per control tick: command table -> preprocessor -> position law of
each axis -> rate command -> drives; a drive that takes positions follows the preprocessor's motion
itself.  In manual-rate mode an identification experiment gives the
rate commands instead.  A loop that oscillates has its drives cut and the brakes set, and the fault
latches.

`modes.py` rules what may be requested in which mode, `safety.py` what must not happen, `axes.py`
closes the loops.  This module alone carries anything out: it gives the others what they need to
know and acts on their answers.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.controllers import TrajectorySample
from rf_pointing.core import AXES, Array, JointReading, JointTrajectory, Pair, nearest_turn_rad
from rf_pointing.core.modes import antenna_is
from rf_pointing.ephemeris.solar import SunPermit
from rf_pointing.identification import IdentificationExperiment
from rf_pointing.servo import PlantParams
from rf_pointing.station.antenna.axes import NEW_PATH_RAD, AntennaAxes, Hardware, pair
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.modes import AntennaMode, AntennaModes, MotionSnapshot, Request
from rf_pointing.station.antenna.safety import AntennaSafety, SafetyParams
from rf_pointing.station.antenna.second_stage import StageLoop
from rf_pointing.station.antenna.sun_at_rest import AT_REST_RAD_S, EVERY_S, sun_entry, way_out

SAME_S = 1e-9
_ON_THE_WAY = {Request.PARK: AntennaMode.PARKING, Request.STOW: AntennaMode.STOWING, Request.GO_TO: AntennaMode.HOLDING}
"""Mode of the antenna's own motions; one that holds at its end holds its goal from the start."""
SAME_RAD = 1e-3
JOG_S = 0.5
"""A jog that is not refreshed for so long ends: whoever held the key has gone."""
AWAY_S = 1.0
"""Time since a base that moves kept the axes off their commands in which they are still away."""
WIND_EVERY = 5
"""Ticks between two readings of the anemometer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaStatus:
    """State of the drive at `t_s`: mode, fault, what the loops follow, counts of commands.

    `set_points`, `starts` and `reversals` of a drive that takes positions count since tracking
    began.  `sun` says when the Sun comes into the beam of an antenna at rest, and what is done;
    `sun_permit` who lets it, for which band and until when, "" nobody.
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
    sun: str = ""
    sun_permit: str = ""
    sun_permit_band: str = ""
    sun_permit_until_t_s: float = 0.0
    set_points: int = 0
    starts: tuple[int, int] = (0, 0)
    reversals: tuple[int, int] = (0, 0)


class ControlUnit:
    """One antenna's control unit; it begins inactive, with the brakes set.

    `enable`, `park` and the other requests do what they say and return "", or change nothing and
    return why not.  `t_s` is the time of the latest tick.
    """

    def __init__(
        self, hardware: Hardware, loops: LoopParams, plant: PlantParams, safety: SafetyParams,
        tick_s: float, start_rad: Pair,
    ) -> None:  # fmt: skip
        self.safety = AntennaSafety(safety, loops.preprocessor, tick_s)
        self.axes = AntennaAxes(hardware, loops, plant, self.safety, tick_s, start_rad)
        self.modes = AntennaModes()
        self.stage: StageLoop | None = None
        self.t_s = 0.0
        self._tick_s = self._passed_s = tick_s
        self._ticks = 0
        self._experiment: IdentificationExperiment | None = None
        self._accepted = self._rejected = 0
        self._held_axis = -1
        self._last_rejection = self._ran_dry = ""
        self._sun, self._sun_seen_s, self._sun_permitted = "", -math.inf, False
        self._jog_rad_s, self._jog_until_s = np.zeros(2), -math.inf
        self._turning_away = False
        # Lower axis of a moving base while it follows commands: the real one, and that at rest.
        self._axis_rad: float | None = None
        self._level_rad: float | None = None
        self._away_s, self._away = -math.inf, ""

    @property
    def mode(self) -> AntennaMode:
        """The mode that the antenna is in."""
        return self.modes.mode

    @property
    def in_use(self) -> str:
        """Why what guards the antenna cannot change now, "" while its drives are off."""
        powered = self.axes.hardware.powered
        return f"the drives are enabled ({antenna_is(self.mode)}); disable it first" if powered else ""

    # Commands

    def accept(self, trajectory: JointTrajectory, now_s: float, commander: str = "") -> str:
        """Take a command; return "" or why it was rejected: then only the count has changed."""
        table, safety = self.axes.path.table, self.safety
        reason = (
            self.modes.reason_against(Request.COMMAND, self._motion())
            or ("the antenna turns away from the Sun" if self._turning_away else "")
            or (safety.base.lost(now_s) if safety.base is not None else "")
            # Cheap checks first; the gate, which looks for a path, costs the most.
            or safety.authority.conflict(commander, now_s)
            or table.reason_against(trajectory, now_s)
            or self._find_path(trajectory, now_s)
        )
        if reason:
            if self._away or (safety.base is not None and self.mode == AntennaMode.TRACKING):
                self._away_s, self._away = now_s, reason
            return self.reject(reason)
        table.take(trajectory, now_s)
        safety.authority.claim(commander, now_s)
        self._accepted, self._ran_dry = self._accepted + 1, ""
        safety.commanded_s = now_s
        # A fault shows the last commands before it: which of them led there is the first question.
        safety.latch.note_command((now_s, commander, *pair(trajectory.position_rad[-1])))
        self.modes.follow()
        if self.mode == AntennaMode.TRACKING:
            self.axes.path.preprocessor.follow()
        return ""

    def reject(self, reason: str) -> str:
        """Count a command that could not be used, and return the reason."""
        self._rejected += 1
        self._last_rejection = reason
        return reason

    def _find_path(self, trajectory: JointTrajectory, now_s: float) -> str:
        """Pass a command through the gate and note the path to it; return why no path is free."""
        path, encoder_rad = self.axes.path, self.axes.encoder_rad
        positions = self._on_base(now_s, trajectory.position_rad)
        # The gate of the controller does not bind a foreign commander; this one does.
        reason = self.safety.check("track", now_s, pair(encoder_rad), positions).reason
        if reason:
            return reason
        following = self.mode in (AntennaMode.TRACKING, AntennaMode.PAUSED)
        level_rad = encoder_rad if self.safety.base is None else self.reading(now_s).position_rad
        return self._go_round(now_s, positions[0]) if path.leaves(trajectory, level_rad, following) else ""

    def _go_round(self, now_s: float, goal_rad: Array) -> str:
        """Note the path to a far position (2,) where commands are; return why no path is free."""
        decision = self.safety.check("preset", now_s, pair(self.axes.encoder_rad), goal_rad[None, :])
        if decision.allowed:
            self.axes.path.go_round(decision.way)
        return decision.reason

    # Requests

    def enable(self) -> None:
        """Release the brakes and hold where the axes are; nothing moves.

        After an oscillation they stay set.
        """
        axes = self.axes
        self._held_axis = -1
        # Watches begin anew: what they saw under the brakes is not motion.
        self.safety.release(axes.hardware.switch_rad)
        axes.rate_command_rad_s = np.zeros(2)
        self._watch_sensors()
        self.modes.hold(self._motion())
        if not axes.loops.oscillation:
            axes.hold()
            axes.hardware.release_brake()

    def rest(self, mode: AntennaMode) -> None:
        """Set the brakes and stay in this mode: inactive until `enable`, others until `resume`."""
        self.axes.hardware.brake()
        self.modes.mode = mode

    def stop(self, reason: str = "") -> None:
        """Decelerate both axes at their limits; with a reason the stop latches as a fault."""
        self.axes.path.stop()
        self.safety.authority.release()
        if reason:
            self.safety.latch.latch(reason, self.t_s)
        if self.mode == AntennaMode.MANUAL_RATE:
            self._end_experiment(reason or "stop was requested")
        self.modes.stop()

    def clock_stepped(self, by_s: float) -> None:
        """Go on with a clock that was stepped by `by_s`: every wait stays as long as it was."""
        self._jog_until_s += by_s
        self.safety.clock_stepped(by_s)

    def stall(self) -> None:
        """Go on after a stall: to a goal of the antenna's own, else with the next command."""
        if self.mode not in _ON_THE_WAY.values():
            self.stop()

    def trip(self, reason: str) -> None:
        """Cut the drives and set the brakes at once, and latch why."""
        self.safety.latch.latch(reason, self.t_s)
        self.axes.cut()
        self.modes.mode = AntennaMode.FAULT

    def reset_fault(self) -> str:
        """Clear a latched fault."""
        reason = self.modes.reason_against(Request.RESET_FAULT, self._motion())
        # What is still there keeps its fault.
        reason = reason or self.safety.latch.reset(
            self.safety.watch.cause or self.safety.drive.reason or self.axes.hardware.fault
        )
        if reason:
            return reason
        if self.axes.loops.oscillation:
            # Holding forgets what the detectors have seen; `enable` keeps the brakes set until they
            # have.
            self.axes.hold()
        if self.mode == AntennaMode.FAULT:
            self.enable()
        return ""

    def pause(self) -> str:
        """Stop where the axes are and keep taking commands; `resume` goes on with them."""
        reason = self.modes.reason_against(Request.PAUSE, self._motion())
        if not reason:
            self.axes.path.preprocessor.stop()
            self.modes.mode = AntennaMode.PAUSED
        return reason

    def resume(self) -> str:
        """Go on after a pause, or leave park, stow or disable and hold."""
        reason = self.modes.reason_against(Request.RESUME, self._motion())
        if reason:
            return reason
        if self.mode != AntennaMode.PAUSED:
            self.enable()
            return ""
        reason = self._find_path_back()
        if not reason:
            self.axes.path.preprocessor.follow()
            self.modes.mode = AntennaMode.TRACKING
        return reason

    def park(self) -> str:
        """Go to the park position and set the brakes there."""
        place = self.safety.params
        return self._go(Request.PARK, (place.park_azimuth_rad, place.park_elevation_rad))

    def stow(self) -> str:
        """Go to the stow elevation at the present azimuth, also from park; set the brakes there.

        Another mount goes to where its lower axis points at the zenith as well.
        """
        mount, first_rad = self.safety.gate.mount, float(self.axes.encoder_rad[0])
        if not mount.level:
            first_rad = math.remainder(mount.axes_at(0.0, 0.5 * math.pi)[0], math.tau)
        return self._go(Request.STOW, (first_rad, self.safety.params.stow_elevation_rad))

    def go_to(self, goal: Pair) -> str:
        """Go to a position of the axes and hold there."""
        reason = self.safety.gate.limits.reason(*goal, names=self.safety.gate.mount.axes)
        return reason or self._go(Request.GO_TO, goal)

    def jog(self, rate_rad_s: Pair) -> str:
        """Move at these rates for `JOG_S`, and on while it is called again; zero rates stop."""
        reason = self.modes.reason_against(Request.JOG, self._motion())
        rows = zip(self.safety.gate.mount.axes, rate_rad_s, self.axes.limits.rate_limit_rad_s, strict=True)
        for axis, rate, limit in rows:
            if not abs(rate) <= limit:
                fast, most = math.degrees(rate), math.degrees(limit)
                reason = reason or f"{axis} rate {fast:.3f} deg/s must be within {most:.3f} deg/s"
        if reason:
            return reason
        if not any(rate_rad_s):
            if self.mode == AntennaMode.JOGGING:
                self.stop()
            return ""
        self._jog_rad_s, self._jog_until_s = np.array(rate_rad_s), self.t_s + JOG_S
        if self.mode != AntennaMode.JOGGING:
            self.safety.authority.release()
            self.axes.path.go(pair(self.axes.path.preprocessor.state.position_rad), ())
            self.modes.mode, self._ran_dry = AntennaMode.JOGGING, ""
        return ""

    def stow_in_fault(self, fault: str) -> str:
        """Stow the elevation in spite of the latched `fault`; the azimuth keeps its brake.

        For a storm: an operator who names the fault has read it, and it must not be the
        elevation's.
        """
        axes, safety = self.axes, self.safety
        reason = self.modes.reason_against(Request.STOW_IN_FAULT, self._motion()) or self._unfit(fault)
        if reason:
            return reason
        goal = (float(axes.encoder_rad[0]), safety.params.stow_elevation_rad)
        decision = safety.check("stow", self.t_s, pair(axes.encoder_rad), np.array([goal]))
        if not decision.allowed:
            return decision.reason
        if any(abs(azimuth - goal[0]) > SAME_RAD for azimuth, _ in decision.way):
            return "the way to stow leads round what is forbidden and needs the azimuth, which is braked"
        self._held_axis = 0
        safety.release(axes.hardware.switch_rad)
        axes.hold()
        axes.hardware.release_brake(self._held_axis)
        axes.path.go(goal, decision.way)
        self.modes.mode = AntennaMode.STOWING
        return ""

    def _unfit(self, fault: str) -> str:
        """Return why the elevation cannot be stowed in the latched fault, "" if it can."""
        latched = self.safety.latch.text
        if fault != latched:
            return f"the latched fault is {latched!r}, the request names {fault!r}"
        causes = (latched, self.axes.hardware.fault, self.safety.watch.cause, self.safety.drive.reason)
        found = next((cause for cause in causes if AXES[1] in cause), "") or self.axes.hardware.fault
        return f"the elevation cannot be trusted: {found}" if found else ""

    def _without_held(self, reason: str) -> str:
        """Return a reason without what concerns the axis whose brake is set."""
        if self._held_axis < 0:
            return reason
        # Every reason of a watch begins with its axis.
        kept = [part for part in reason.split("; ") if not part.startswith(AXES[self._held_axis])]
        return "; ".join(kept)

    def disable(self) -> str:
        """Stop under control and set the brakes where the axes then are."""
        reason = self.modes.reason_against(Request.DISABLE, self._motion())
        if not reason:
            self.stop()
            self.modes.mode = AntennaMode.DISABLING
        return reason

    def identify(self, experiment: IdentificationExperiment) -> str:
        """Let an experiment give the rate commands until it has finished or `stop`."""
        encoder_rad = self.axes.encoder_rad
        reason = (
            self.modes.reason_against(Request.IDENTIFY, self._motion())
            or self._unsuitable(experiment)
            or self.safety.check("manual", self.t_s, pair(encoder_rad), encoder_rad[None, :]).reason
        )
        if not reason:
            self._experiment = experiment
            self.modes.mode = AntennaMode.MANUAL_RATE
        return reason

    def _unsuitable(self, experiment: IdentificationExperiment) -> str:
        """Return why an experiment does not suit this antenna, "" if it does."""
        if self.axes.hardware.takes_positions:
            return "the drive takes positions, an identification needs one that takes rates"
        if abs(experiment.sample_s - self._tick_s) > SAME_S:
            return f"sample_s={experiment.sample_s} must be {self._tick_s}, the control period"
        limit = min(self.axes.limits.rate_limit_rad_s)
        if experiment.peak_rad_s > limit:
            return f"peak_rad_s={experiment.peak_rad_s} must be <= {limit}, the rate limit"
        return ""

    def _find_path_back(self) -> str:
        """Find the path from a pause back to where the commands are; return why no path is free."""
        encoder_rad, path = self.axes.encoder_rad, self.axes.path
        if path.table.empty:
            return ""
        goal = self._on_base(self.t_s, path.table.at(self.t_s).position_rad[None, :])[0]
        if float(np.max(np.abs(goal - encoder_rad))) <= NEW_PATH_RAD:
            return ""
        return self._go_round(self.t_s, goal)

    def _go(self, request: Request, goal: Pair) -> str:
        """Begin a motion of the antenna's own to rest at `goal`, through the gate."""
        reason = self.modes.reason_against(request, self._motion())
        if reason:
            return reason
        # To hold anywhere is a preset: the gate knows no other motion that ends without brakes.
        kind = "preset" if request == Request.GO_TO else str(request)
        decision = self.safety.check(kind, self.t_s, pair(self.axes.encoder_rad), np.array([goal]))
        if not decision.allowed:
            return decision.reason
        if self.mode == AntennaMode.PARKED:
            self.enable()
            if self.safety.latch.text:
                return self.safety.latch.text
        self.safety.authority.release()
        self.axes.path.go(goal, decision.way)
        self.modes.mode = _ON_THE_WAY[request]
        return ""

    def permit_sun(self, permit: SunPermit | None, band: str = "") -> str:
        """Let the beam look into the Sun as a permission says, None: no longer; return why not."""
        if permit is not None:
            try:
                permit.check(self.t_s, band)
            except ValueError as error:
                return str(error)
        self.safety.sun.permit, self._sun_seen_s = permit, -math.inf
        return ""

    # One tick

    def reading(self, t_s: float) -> JointReading:
        """Return the present angles, stamped `t_s`: the encoders, and what a second stage adds."""
        velocity, angles = self.axes.hardware.velocity_rad_s, self.axes.encoder_rad.copy()
        if self.stage is not None:
            angles += self.stage.axes_rad(float(angles[1]))
        if (base := self.safety.base) is not None:
            angles, velocity = base.at(t_s).to_level(angles, velocity)
            if self._level_rad is not None:
                angles[0] = nearest_turn_rad(float(angles[0]), self._level_rad)
        return JointReading(t_s=t_s, position_rad=angles, velocity_rad_s=velocity)

    def tick(self, t_s: float, passed_s: float | None = None) -> JointReading:
        """Return the encoder reading at `t_s`, then drive the hardware through one tick.

        Without `passed_s` the hardware lives through the tick, and what its sensors then show is
        checked at the end.  A real drive has gone on by itself: what it shows now is checked first,
        and the commanded motion is taken on by the `passed_s` since the tick before.
        """
        self.t_s, self._passed_s = t_s, passed_s or self._tick_s
        if passed_s is not None:
            self._watch_sensors()
        reading = self.reading(t_s)
        self._watch_wind(t_s)
        if (base := self.safety.base) is None:
            self._watch_sun(t_s)
        elif base.lost(t_s) and base.known and self.modes.traits.leaves_wind:
            self.stow()
        axes = self.axes
        axes.path.following = None
        # Unpowered axes get no rates: laws that run against the brakes would wind up.
        rates = self._rates(t_s, axes.encoder_rad) if axes.hardware.powered else np.zeros(2)
        if self._held_axis >= 0:
            rates[self._held_axis] = 0.0
        axes.rate_command_rad_s = rates
        if self.stage is not None:
            command = axes.path.preprocessor.state.position_rad
            follow = self.mode == AntennaMode.TRACKING
            self.stage.tick(self._passed_s, command, axes.encoder_rad, tracking=follow)
        axes.hardware.move(rates, axes.path.following)
        if passed_s is None:
            self._watch_sensors()
        return reading

    def _kept_away(self, t_s: float) -> str:
        """Return why a base that moves keeps the axes off their commands, "" where it does not."""
        return self._away if t_s - self._away_s < AWAY_S and self.modes.traits.transmits else ""

    def published_mode(self, t_s: float) -> AntennaMode:
        """Return the mode; of axes that are kept away, so that nobody takes them for a runaway."""
        return AntennaMode.STOPPING if self._kept_away(t_s) else self.mode

    def status(self, t_s: float) -> AntennaStatus:
        """Return the status at `t_s`."""
        axes, path, safety = self.axes, self.axes.path, self.safety
        commanded, permit = path.preprocessor.state.position_rad, safety.sun.permitted(t_s)
        away, mode = self._kept_away(t_s), self.published_mode(t_s)
        silent = "" if self.modes.traits.transmits and not away else antenna_is(mode)
        base, seen, shown = safety.base, pair(axes.encoder_rad), commanded
        if base is not None:
            # What the transmitter and the Sun see is the sky, not the deck.
            seen, silent = base.at(t_s).level_of(seen), silent or base.lost(t_s)
            shown = np.array(base.level_of(pair(commanded)))
        return AntennaStatus(
            t_s=t_s, mode=mode, fault=safety.latch.text, commanded_rad=shown,
            rate_command_rad_s=axes.rate_command_rad_s,
            rate_limit_rad_s=np.array(axes.limits.rate_limit_rad_s),
            acceleration_limit_rad_s2=np.array(axes.limits.acceleration_limit_rad_s2),
            at_limit=axes.hardware.at_stop,
            command_lead_s=0.0 if path.table.empty else path.table.lead_s(t_s),
            commands_accepted=self._accepted, commands_rejected=self._rejected,
            last_rejection=self._last_rejection,
            warning=("" if axes.hardware.powered else axes.hardware.fault)
            or self._sun
            or self._ran_dry
            or (away and f"stopped: {away}")
            or (self.stage.warning if self.stage is not None else "")
            or safety.warning(t_s, self.mode, pair(commanded)),
            high_wind=safety.wind.reason,
            transmit_inhibit=silent
            or safety.gate.too_low_to_send(*seen)
            # A permission is for the receiver.
            or safety.gate.sun_in_beam(*seen, safety.sun.at(t_s)),
            commander=safety.authority.holder,
            sun=self._sun,
            sun_permit=permit.by if permit else "",
            sun_permit_band=permit.band if permit else "",
            sun_permit_until_t_s=permit.until_t_s if permit else 0.0,
        )  # fmt: skip

    def _motion(self) -> MotionSnapshot:
        """Return what the mode machine may know of the motion now."""
        away = np.abs(self.axes.encoder_rad - self.axes.path.goal_rad)
        if self._held_axis >= 0:
            away[self._held_axis] = 0.0
        away_rad = float(np.max(away))
        return MotionSnapshot(
            fault=self.safety.latch.text, high_wind=self.safety.wind.reason,
            moving=self.axes.moving, arrived=away_rad < self.axes.hardware.settled_rad,
        )  # fmt: skip

    def _watch_wind(self, t_s: float) -> None:
        self._ticks += 1
        if self._ticks % WIND_EVERY:
            return
        speed_m_s = self.axes.hardware.anemometer_m_s()
        if speed_m_s is None:
            return
        self.safety.wind.take(t_s, speed_m_s)
        # An experiment moves at its own rates and cannot be sent to stow before it has stopped.
        if self.safety.wind.step(t_s) and self.mode == AntennaMode.MANUAL_RATE:
            self.stop()
        if self.safety.wind.reason and self.safety.wind.params.stows and self.modes.traits.leaves_wind:
            self.stow()

    def _watch_sun(self, t_s: float) -> None:
        """Warn of the Sun that comes to an antenna at rest, and turn away in time."""
        if 0.0 <= t_s - self._sun_seen_s < EVERY_S:
            return
        self._sun_seen_s, safety, params = t_s, self.safety, self.safety.params.at_rest
        was_permitted = self._sun_permitted
        self._sun_permitted = safety.sun.permitted(t_s) is not None
        rate = max(map(abs, self.axes.path.preprocessor.velocity_rad_s))
        moving = self.axes.hardware.powered and rate > AT_REST_RAD_S
        radius_rad, here = safety.params.gate.sun_radius_rad, pair(self.axes.encoder_rad)
        entry = sun_entry(safety.sun, radius_rad, params, here, t_s)
        if entry is not None and moving and was_permitted and not self._sun_permitted:
            # One that follows the Sun moves; the end of its permission finds it in the zone.
            moving = entry.t_s > t_s
        if entry is None or moving:
            self._sun, self._turning_away = "", self._turning_away and moving
            return
        # A commander that lives may still leave by itself, and what is permitted lasts to its end.
        waits = self.mode == AntennaMode.TRACKING or self._sun_permitted
        lead_s = 0.0 if waits else params.escape_s
        does = f"the antenna stays ({antenna_is(self.mode)})"
        if params.escapes and self.modes.traits.leaves_sun:
            does = f"it turns away {lead_s:.0f} s before" if lead_s else "it turns away then"
            if t_s >= entry.t_s - lead_s:
                does = self._turn_away(t_s) or "it turns away"
        self._sun = f"{entry.text}; {does}"

    def _turn_away(self, t_s: float) -> str:
        """Turn to where the Sun will not be for long; return why not."""
        safety, rests = self.safety, self.modes.traits.at_rest
        if safety.wind.reason:
            return f"the antenna stays: {safety.wind.reason}"
        _, path = safety.sun.ahead(t_s, safety.params.at_rest.span_s)
        kind = "park" if rests else "preset"
        found = way_out(safety.gate, kind, pair(self.axes.encoder_rad), path)
        if found is None:
            return "the antenna stays: no free way leads out"
        if rests:
            self.enable()
            if safety.latch.text:
                return f"the antenna stays: {safety.latch.text}"
        safety.authority.release()
        self.axes.path.go(*found)
        # What was stowed is not so any more; brakes that were set are set again there.
        self.modes.mode = AntennaMode.PARKING if rests else AntennaMode.HOLDING
        self._turning_away = True
        return ""

    def _watch_sensors(self) -> None:
        """Check the sensors after a tick, and trip on what cannot be bridged."""
        reason = self.axes.watch()
        if reason and (reason := self._without_held(reason)):
            self.trip(reason)

    def _rates(self, t_s: float, encoder_rad: Array) -> Array:
        """Return the rate commands (2,): of an experiment, or of the laws on a guarded path."""
        if self.mode == AntennaMode.MANUAL_RATE:
            rates = self._experiment_rates(t_s, encoder_rad)
            if rates is not None:
                return rates
        axes, steps = self.axes, max(1, round(self._passed_s / self._tick_s))
        motion = self.modes.traits.motion
        step_s = self._passed_s / steps
        for left in reversed(range(steps)):
            followed = self._held(self._followed(t_s - left * step_s))
            feasible = axes.path.step(followed, pair(axes.encoder_rad), step_s)
            if motion:
                reason = self.safety.guard(motion, t_s, *map(pair, feasible))
                if reason and self.mode == AntennaMode.JOGGING:
                    # Whoever jogs sees it stop, and may turn back.
                    self.stop()
                    self._ran_dry = f"the jog was stopped: {reason}"
                elif reason and self.safety.base is not None:
                    # A ship rolls back by itself.
                    self.stop()
                    self._away_s, self._away = t_s, reason
                elif reason:
                    self.stop(reason)
        # Exactly zero: the preprocessor brings the rate to zero, not near it.
        standing = not any(feasible.velocity.tolist())
        if standing and self.mode not in (AntennaMode.TRACKING, AntennaMode.HOLDING):
            self._settle(feasible.position)
        rates = axes.loops.rates(feasible, encoder_rad)
        swings = axes.loops.oscillation
        if not (swings and self._without_held(swings)):
            return rates
        # The command follows the swinging axes, or the reset would start with a slew.
        axes.path.preprocessor.reset(encoder_rad)
        self.trip(f"drives cut: {axes.loops.oscillation}")
        return np.zeros(2)

    def _settle(self, position_rad: Array) -> None:
        """End a mode whose commanded motion stands still at `position_rad`."""
        if self.mode == AntennaMode.STOPPING:
            self.axes.path.goal_rad = position_rad
        if self.modes.settle(self._motion()):
            self.axes.hardware.brake()

    def _experiment_rates(self, t_s: float, encoder_rad: Array) -> Array | None:
        """Return the experiment's rate commands (2,), None when it ends here."""
        experiment = self._experiment
        assert experiment is not None
        # The experiment is guarded at the measured rate: its command is noise around a mean.
        barred = self.safety.guard("manual", t_s, pair(encoder_rad), pair(self.axes.hardware.velocity_rad_s))
        if not experiment.finished and not barred:
            rates = experiment.command(encoder_rad, self.axes.hardware.lag_s)
            if not experiment.abort_reason:
                return rates
        self._end_experiment(experiment.abort_reason or barred or "complete")
        return None

    def _end_experiment(self, reason: str) -> None:
        """End the experiment, aborted when unfinished, and bring the axes to rest."""
        if self._experiment is not None and not self._experiment.finished:
            self._experiment.abort(reason)
        self._experiment = None
        self.axes.take_over()
        self.modes.mode = AntennaMode.STOPPING

    def _on_base(self, t_s: float, level_rad: Array) -> Array:
        """Return the angles (n, 2) of the axes for commanded ones, on the turn nearest to them."""
        base = self.safety.base
        if base is None:
            return level_rad
        found = base.at(t_s).axes_of(level_rad)
        here_rad = float(self.axes.encoder_rad[0]) if self._axis_rad is None else self._axis_rad
        turn_rad = nearest_turn_rad(float(found[0, 0]), here_rad) - found[0, 0]
        low, high = self.axes.travel_rad[0]
        # A ship that has turned too far is followed on another turn, if the travel has one.
        for each in (turn_rad, turn_rad - math.tau, turn_rad + math.tau):
            if low <= found[0, 0] + each <= high:
                turn_rad = each
                break
        found[:, 0] += turn_rad
        return found

    def _held(self, sample: TrajectorySample | None) -> TrajectorySample | None:
        """Return a commanded sample as the motion of the axes that holds it on a moving base."""
        base = self.safety.base
        if base is None or sample is None or self.mode != AntennaMode.TRACKING:
            self._axis_rad = self._level_rad = None
            return sample
        near = self._on_base(sample.t_s, sample.position_rad[None, :])[0, 0]
        if self._axis_rad is not None and abs(near - self._axis_rad) > math.pi:
            # Another turn is a slew: it is stopped, and the next command finds a free way there.
            self.stop()
            self._away_s, self._away = sample.t_s, "the lower axis unwinds to another turn"
            return None
        position, velocity, acceleration = base.to_axes(*sample[1:4])
        position[0] = self._axis_rad = near
        self._level_rad = float(sample.position_rad[0])
        if float(np.max(np.abs(position - self.axes.encoder_rad))) > NEW_PATH_RAD:
            self._away_s = sample.t_s
        else:
            self._away = ""
        return TrajectorySample(sample.t_s, position, velocity, acceleration, sample.source)

    def _followed(self, t_s: float) -> TrajectorySample | None:
        """Return the commanded motion at `t_s`, or None: then the goal is kept."""
        if self.mode == AntennaMode.JOGGING:
            if t_s > self._jog_until_s:
                self.stop()
                return None
            # From where the command is: axes that fall behind do not run to catch up.
            here = self.axes.path.preprocessor.state.position_rad
            ahead = here + self._tick_s * self._jog_rad_s
            return TrajectorySample(t_s, ahead, self._jog_rad_s, np.zeros(2), "table")
        if self.mode != AntennaMode.TRACKING:
            return None
        path = self.axes.path
        sample = path.table.at(t_s)
        silent_s = t_s - self.safety.commanded_s
        # A table far ahead must not move an antenna whose commander has gone; a goal at rest may.
        if silent_s > path.table.params.silence_s and not path.at_rest(sample):
            self.stop(
                f"the commander has been silent for {silent_s:.2f} s while its commands move the axes, "
                f"at most {path.table.params.silence_s:.2f} s"
            )
            return None
        if sample.source != "dry":
            return sample
        # A table whose end is at rest is a goal; one that runs dry in motion is a lost commander.
        if path.at_rest(path.table.at(sample.t_s + path.table.lead_s(sample.t_s))):
            path.goal_rad = self._on_base(sample.t_s, sample.position_rad[None, :])[0]
            self.modes.hold(self._motion())
        else:
            # No fault: a commander that stalled goes on with its next command.
            late_s = -path.table.lead_s(t_s)
            self.stop()
            self._ran_dry = f"commands ran dry {late_s:.1f} s ago while moving: stopped until the next one"
        return None
