"""The plan of the pass in hand: certificate, chosen branch, and the slew to its start."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.controllers import CommandPreprocessor, CommandPreprocessorParams
from rf_pointing.core import DESIGNATED, Array, JointReading, Motion, Pair, nearest_turn_rad
from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.ephemeris import Pass, SolarDirection, SunPermit
from rf_pointing.planning import (
    AxisLimits,
    Branch,
    Certificate,
    CornerPath,
    Gate,
    GateParams,
    HorizonMask,
    MachineParams,
    PassProfile,
    SensorCost,
    motion_between,
    plunged,
    unplunged,
)
from rf_pointing.planning.certificate import SUN_CLEARANCE_RAD
from rf_pointing.planning.forbidden_sky import ForbiddenSky, angle_between
from rf_pointing.station.pointing.branch import TrackingBranch
from rf_pointing.station.pointing.certificates import PlanningRules, certificate_of
from rf_pointing.station.pointing.prediction import axis_motion
from rf_pointing.tracking import TrackPath

# Times of a pass and of its profile differ by less: they may have been computed from other
# elements.
SAME_PASS_S = 30.0
# More than the Sun's parallax and refraction, less than what any other station would give.
SAME_SUN_RAD = math.radians(0.5)
# How far another bias model must move the start of a pass before the slew to it is planned again.
NEW_GOAL_RAD = math.radians(0.1)
# A search keeps so much above the horizon, for what the loops and the mount make of it.
SEARCH_CLEARANCE_RAD = math.radians(0.1)
# Axes that cannot run straight after their target are there so much before it, and how many places
# ahead of it are looked at.
MEETING_S = 2.0
MEETINGS = 12
# Axes that are slower and nearer than this rest at a corner: encoders are never quite still, and a
# rotator stops a step away; one of coarser steps where it counts as on its target.
REST_RAD_S = math.radians(0.1)
NEAR_RAD = math.radians(1.5)
# Axes whose rate is gone in this time stand.
STOPPED_S = 0.2
NO_MEETING: tuple[Array | None, float] = (None, -math.inf)
# Steps in which a chase is computed, and the longest one.
CHASE_STEP_S = 0.1
CHASE_S = 60.0


@dataclass(frozen=True, slots=True)
class Chased:
    """A target by the positions (n, 2) of axes that hold it at times (n,)."""

    t_s: Array
    position_rad: Array

    def at(self, times: Array | float) -> Array:
        """Return the positions (..., 2) at times (...), that of the nearer end outside."""
        return np.stack([np.interp(np.asarray(times), self.t_s, part) for part in self.position_rad.T], axis=-1)

    def chase_s(self, t_s: float, axes: JointReading, gate: Gate, sun_rad: Pair | None) -> float | None:
        """Return how long axes run after it until they have it, None if past a hill or the Sun."""
        rate, acceleration = gate.axes
        runner = CommandPreprocessor(
            CommandPreprocessorParams(
                rate_limit_rad_s=rate, acceleration_limit_rad_s2=acceleration,
                travel_min_rad=(-50.0, -50.0), travel_max_rad=(50.0, 50.0),
            )
        )  # fmt: skip
        runner.reset(axes.position_rad, axes.velocity_rad_s)
        times = t_s + CHASE_STEP_S * np.arange(round(CHASE_S / CHASE_STEP_S), dtype=np.float64)
        target = self.at(times)
        rates = np.gradient(target, CHASE_STEP_S, axis=0)
        run = [(axes.position_rad, axes.velocity_rad_s)]
        for position, velocity in zip(target[1:], rates[1:], strict=True):
            run.append(runner.step(position, velocity, np.zeros(2), CHASE_STEP_S)[:2])
            if all(runner.state.transparent):
                break
        positions, speeds = (np.array(part) for part in zip(*run, strict=True))
        barred = gate.chase(positions, speeds, target[: len(run)], sun_rad)
        return None if barred else CHASE_STEP_S * len(run)


class PassPlan:
    """Profiles of the coming passes, and the branch of the one that is tracked."""

    def __init__(
        self, machine: MachineParams, mask: HorizonMask, gate: GateParams, limits: AxisLimits,
        sun: SolarDirection, on_target_rad: float, mount: Kinematics = LEVEL,
    ) -> None:  # fmt: skip
        self.machine, self.mask, self._gate_params, self.sun, self.mount = machine, mask, gate, sun, mount
        self.profiles: list[PassProfile] = []
        self.certificate: Certificate | None = None
        self.retune(limits, on_target_rad)
        self.clear()

    def retune(self, limits: AxisLimits, on_target_rad: float) -> None:
        """Use these limits of travel, and this distance at which a slew is over, from now on."""
        self._limits, self.gate = limits, Gate(self._gate_params, limits, self.mask, self.machine.axes, self.mount)
        self._near_rad = max(NEAR_RAD, on_target_rad)

    def take_profiles(self, profiles: list[PassProfile]) -> None:
        """Replace the profiles of the coming passes, which are on the sky."""
        self.profiles = [each.on(self.mount) for each in profiles]

    def seen(self, window: Pass, *, piece: bool = False) -> Pass:
        """Return the pass in hand in the angles of the mount's axes, as its profile.

        A `piece` of a pass has the angles of its own.
        """
        if (self.mount.level and not piece) or self.profile is None:
            return window
        first = self.profile.position_rad[:, 0]
        return replace(
            window, aos_azimuth_rad=float(first[0]), aos_elevation_rad=float(self.profile.position_rad[0, 1]),
            los_azimuth_rad=float(first[-1]), azimuth_min_rad=float(first.min()), azimuth_max_rad=float(first.max()),
        )  # fmt: skip

    def forget(self) -> None:
        """Forget the certificate too: one that is refused must not leave that of the last pass."""
        self.clear()
        self.certificate = None

    def clear(self) -> None:
        """Forget the branch and the profile: direct, without a crossing."""
        self.course = TrackingBranch()
        self.profile: PassProfile | None = None
        self._slew, self._goal = self._path(), np.full(2, math.inf)
        self._meeting = NO_MEETING
        self.path: TrackPath | None = None
        """The pass in hand on the sky, for a target that is early or late."""
        self.permit: SunPermit | None = None
        """Permission that the pass needs."""
        self.beyond = ""
        """Why the pass does not go on beyond its certificate."""
        self._judged: PassProfile | None = None

    def choose(
        self, t_s: float, window: Pass, joints: JointReading, model: BiasModel,
        lag_averaging_s: float = 0.0, cost: Callable[[PassProfile], SensorCost] | None = None, *,
        direct: bool = False,
    ) -> None:  # fmt: skip
        """Issue the certificate of a pass and take its branch; `direct`: not over the top.

        Raises
        ------
        ValueError
            When the pass has no profile, or no branch works, with the numbers.
        """
        self.forget()
        profile = self.profile_of(window)
        if profile is None:
            raise ValueError(f"this pass of {window.name} has no profile")
        self._check_sun(profile)
        led = window.name.startswith(DESIGNATED)
        self.profile = fine = profile.resampled()
        # What has no orbit is not early or late on a path that is known.
        self.path = None if led else TrackPath(
            fine.t_s, fine.position_rad, fine.range_m, self.sun.site.latitude_rad, self.mount
        )  # fmt: skip
        self._judged = profile
        self.certificate, hint = self._certified(
            t_s, profile, joints, model, lag_averaging_s, cost, direct=direct or led
        )
        branch = self.certificate.chosen
        if branch is None:
            raise ValueError(self.certificate.reason + hint)
        if led:
            branch = followed(self.certificate, branch.turns)
            if branch is None or (impossible := self._impossible(branch, t_s, profile)):
                raise ValueError(impossible if branch else "the azimuth would have to unwind on the way")
        # Without a slew to its start the branch is as good as none.
        self.approach(t_s, joints, np.array(branch.start_rad))
        self.course = TrackingBranch(branch)

    def _certified(
        self, t_s: float, profile: PassProfile, joints: JointReading, model: BiasModel,
        lag_averaging_s: float, cost: Callable[[PassProfile], SensorCost] | None, *, direct: bool,
    ) -> tuple[Certificate, str]:  # fmt: skip
        """Return the certificate of a profile, and a hint where a permission of the Sun helps."""
        machine, permit = self.machine, self.sun.permitted(t_s)
        fine = profile.resampled()
        ahead = fine.t_s >= t_s
        apart = angle_between(fine.position_rad[ahead], fine.sun_rad[ahead])
        near = bool(np.any(apart < machine.sun_radius_rad + SUN_CLEARANCE_RAD))
        if near and permit is not None:
            machine, self.permit = machine.replace(sun_radius_rad=0.0), permit
        rules = PlanningRules(
            model=model, machine=machine, mask=self.mask,
            limits=self._limits.direct() if direct else self._limits, gate=self._gate_params,
            lag_averaging_s=lag_averaging_s, mount=self.mount,
        )  # fmt: skip
        azimuth, elevation = joints.position_rad.tolist()
        slew = partial(self.gate.slew, sun_rad=self.sun.avoided(t_s))
        certificate = certificate_of(
            profile, rules, t_s, (azimuth, elevation), plunge_allowed=not direct, slew=slew,
            cost=cost(profile) if cost else None,
        )  # fmt: skip
        return certificate, "" if permit or not near else "; `station permit-sun` allows the Sun, once"

    def _impossible(self, branch: Branch, t_s: float, profile: PassProfile) -> str:
        """Return why axes of this rate cannot follow enough of what is predicted, "" if they can.

        Of an orbit whatever is left of a pass is worth having; a rocket near its pad would drag
        the antenna behind it.
        """
        # The crossing of a certificate knows slow azimuths only; here either axis may be too slow.
        fine = profile.resampled()
        assert branch.axes_rad is not None
        ahead = fine.t_s >= t_s
        positions, step_s = branch.axes_rad[ahead], float(fine.t_s[1] - fine.t_s[0])
        most = np.array(self.machine.axes.rate_rad_s)
        behind = np.zeros_like(positions)
        for row, moved in enumerate(np.diff(positions, axis=0), start=1):
            left = behind[row - 1] + moved
            behind[row] = left - np.clip(left, -most * step_s, most * step_s)
        behind[:, 0] *= np.cos(positions[:, 1])
        off = np.hypot(*behind.T) > 0.5 * self.machine.half_power_beamwidth_rad
        lost_s, left_s = step_s * int(off.sum()), step_s * len(off)
        if lost_s <= (1.0 - self.machine.least_share) * left_s:
            return ""
        needed = np.degrees(np.max(np.abs(np.diff(positions, axis=0)), axis=0)) / step_s
        axis = int(np.argmax(needed / most))
        return (
            f"{lost_s:.0f} s of the next {left_s:.0f} s would be lost: the target needs {needed[axis]:.1f} deg/s "
            f"of {self.mount.axes[axis]}, the axis turns at {math.degrees(most[axis]):.1f} deg/s"
        )

    def extended(
        self, t_s: float, window: Pass, joints: JointReading, model: BiasModel,
        lag_averaging_s: float, cost: Callable[[PassProfile], SensorCost],
    ) -> Pass:  # fmt: skip
        """Return the pass in hand, longer where its target is predicted further by now.

        What is new needs a certificate on the turn of the pass; without one the pass ends where it
        is certified to, and `beyond` says why.
        """
        found = next((each for each in self.profiles if each.name == window.name), None)
        if found is None or found is self._judged or not self.course.direct or self.profile is None:
            return window
        if not found.t_s[0] <= t_s < window.los_t_s < found.t_s[-1]:
            return window
        # Judged once, whatever comes of it: the next one comes within seconds.
        self._judged = found
        # What is behind needs no certificate any more.
        piece = found.between(t_s, float(found.t_s[-1]))
        # On the turn of the pass in hand, however often the target has gone round the station.
        before = float(np.interp(t_s, self.profile.t_s, self.profile.position_rad[:, 0]))
        first = float(piece.position_rad[0, 0])
        shift = nearest_turn_rad(first, before) - first
        piece = replace(piece, position_rad=piece.position_rad + np.array([shift, 0.0]))
        certificate, _ = self._certified(t_s, piece, joints, model, lag_averaging_s, cost, direct=True)
        turns = round(self.course.turns_rad / math.tau)
        branch = followed(certificate, turns)
        if branch is None:
            self.beyond = "the azimuth would have to unwind"
        else:
            self.beyond = "; ".join(branch.reasons) or self._impossible(branch, t_s, piece)
        if branch is None or self.beyond:
            return window
        self.certificate = replace(certificate, aos_t_s=window.aos_t_s, branches=(branch,))
        self.profile = piece.resampled()
        azimuth = piece.position_rad[:, 0]
        return replace(
            window, los_t_s=float(piece.t_s[-1]), azimuth_min_rad=float(azimuth.min()),
            azimuth_max_rad=float(azimuth.max()), los_azimuth_rad=float(azimuth[-1]),
        )  # fmt: skip

    def approach(self, t_s: float, axes: JointReading, goal_rad: Array) -> Array | None:
        """Return the corner (2,) of the slew to a goal, None for a straight one; encoder angles.

        Raises
        ------
        ValueError
            When the safety gate finds no slew, with its reason.
        """
        azimuth, elevation = axes.position_rad.tolist()
        # Planned once, not every period: the path remembers which corners are behind it.
        if not float(np.max(np.abs(goal_rad - self._goal))) <= NEW_GOAL_RAD:
            goal = (float(goal_rad[0]), float(goal_rad[1]))
            kind = motion_between((azimuth, elevation), goal)
            here, sun_rad = (azimuth, elevation), self.sun.avoided(t_s)
            found = self.gate.check(kind, here, np.array([goal]), sun_rad=sun_rad)
            if not found.allowed:
                raise ValueError(f"no {kind} to the start of the pass: {found.reason}")
            self._goal, self._slew = goal_rad.copy(), self._path(found.way)
        corner = self._slew.next((azimuth, elevation), axes.velocity_rad_s.tolist())
        return None if corner is None else np.array(corner)

    def to_start(self, t_s: float, axes: JointReading | None, start_rad: Array) -> Array:
        """Return the next corner (2,) on the slew to the pass, in direct angles."""
        if axes is None:
            return start_rad
        still = np.zeros(2)
        plunge = self.course.plunge_at(t_s)
        corner = self.approach(t_s, axes, plunged(start_rad, still, still)[0] if plunge else start_rad)
        if corner is None:
            return start_rad
        return unplunged(corner, still, still)[0] if plunge else corner

    def meeting_rad(self, t_s: float, axes: JointReading) -> Array | None:
        """Return where (2,) axes that join go, encoder angles; None: straight after the target.

        Axes that run after a target cut the corner of its path, towards a hill or the Sun that the
        path itself keeps away from.  Then they go by a free way to where the target will be, and
        wait for it; without one they stay where they are, and look again.
        """
        if t_s >= self._meeting[1]:
            self._meeting = self._meet(t_s, axes)
        goal = self._meeting[0]
        if goal is None:
            return None
        try:
            corner = self.approach(t_s, axes, goal)
        except ValueError:
            # The axes have come to where no way leads there: they stop, and look for another.
            self._meeting = NO_MEETING
            return self._rest_rad(axes)
        return goal if corner is None else corner

    def rejoin(self) -> None:
        """Judge the way to the target anew: the axes are no longer on the one that was found."""
        self._meeting = NO_MEETING

    def _rest_rad(self, axes: JointReading) -> Array:
        """Return where (2,) the axes come to rest if they brake now."""
        rate, acceleration = axes.velocity_rad_s, np.array(self.machine.axes.acceleration_rad_s2)
        return np.asarray(axes.position_rad + 0.5 * rate * np.abs(rate) / acceleration, dtype=np.float64)

    def _meet(self, t_s: float, axes: JointReading) -> tuple[Array | None, float]:
        """Return where (2,) to wait and until when, None to run straight on."""
        branch = self.certificate.chosen if self.certificate else None
        if self.profile is None or branch is None or branch.axes_rad is None:
            return NO_MEETING
        path, sun = Chased(self.profile.t_s, branch.axes_rad), self.sun.avoided(t_s)
        chase_s = path.chase_s(t_s, axes, self.gate, sun)
        if chase_s is not None:
            # Once begun it is not judged again: a rotator that is stopped in the middle of it,
            # because it runs otherwise than computed, stops late, and nearer to what it avoids.
            return None, t_s + chase_s
        rest_rad = self._rest_rad(axes)
        stop_s = float(np.max(np.abs(axes.velocity_rad_s) / np.array(self.machine.axes.acceleration_rad_s2)))
        if stop_s > STOPPED_S:
            # Axes that turn round while they move run through what a stop keeps out of.
            return rest_rad, t_s + stop_s + STOPPED_S
        here, arrival_s = (float(rest_rad[0]), float(rest_rad[1])), MEETING_S
        for _ in range(MEETINGS):
            goal = path.at(t_s + arrival_s)
            needed_s, barred = self.gate.slew(here, (float(goal[0]), float(goal[1])), sun)
            if not barred and needed_s + MEETING_S <= arrival_s:
                waiting = JointReading(t_s=t_s + arrival_s, position_rad=goal, velocity_rad_s=np.zeros(2))
                if path.chase_s(t_s + arrival_s, waiting, self.gate, sun) is not None:
                    return goal, t_s + arrival_s
            arrival_s = max(needed_s, arrival_s) + MEETING_S
        return rest_rad, t_s + MEETING_S

    def kept_inside(self, t_s: float, times: Array, centre: Motion, searched: Motion) -> Motion:
        """Return the motion (n, 2) of a search about `centre` without what must not be looked at.

        Direct angles.  It goes along the horizon and the ends of the travel, and it shrinks by
        what the Sun's zone takes of its room: neither is a jump.
        """
        offset = searched.position - centre.position
        if (sun_rad := self.sun.avoided(t_s)) is not None and self._gate_params.sun_radius_rad > 0.0:
            kept_rad = self._gate_params.sun_radius_rad + SUN_CLEARANCE_RAD
            room = np.maximum(angle_between(centre.position, np.array(sun_rad)) - kept_rad, 0.0)
            reach = np.hypot(offset[:, 0] * np.cos(centre.position[:, 1]), offset[:, 1])
            offset = offset * np.minimum(1.0, room / np.maximum(reach, 1e-9))[:, None]
        position = centre.position + offset
        if not self.mount.level:
            # The horizon bends across the axes: what would look below it stays with the target.
            low = ForbiddenSky(self.mask, 0.0, self.mount).under_mask_all(position) > -SEARCH_CLEARANCE_RAD
            position = np.where(low[:, None], centre.position, position)
        (left, bottom), (right, top) = self._limits.lowest_rad, self._limits.highest_rad
        if self.course.direct and not self.course.plunge_at(t_s):
            position[:, 0] = np.clip(position[:, 0], left, right)
            lowest = np.full(len(position), bottom)
            if self.mount.level:
                lowest = np.maximum(self.mask.lowest_all(position[:, 0]) + SEARCH_CLEARANCE_RAD, bottom)
            # A target that rises is met where it is, however low.
            lowest = np.minimum(lowest, centre.position[:, 1])
            position[:, 1] = np.clip(position[:, 1], lowest, min(top, 0.5 * math.pi))
        if np.array_equal(position, searched.position):
            return searched
        rate = np.gradient(position, times, axis=0)
        return Motion(position, np.clip(rate, *np.outer((-1, 1), self.machine.axes.rate_rad_s)), searched.acceleration)

    def model_motion(self, t_s: float, sky: Motion, model: BiasModel) -> Motion:
        """Return the direct angles that hold the beam on `sky` (n, 2) at `t_s`."""
        plunge = self.course.plunge_at(t_s)
        motion = axis_motion(sky, model, plunge=plunge)
        return Motion(*unplunged(*motion)) if plunge else motion

    def _check_sun(self, profile: PassProfile) -> None:
        """Refuse a pass that was predicted for a station under another Sun."""
        here = self.sun.at(float(profile.t_s[0]))
        if here is None or self._gate_params.sun_radius_rad == 0.0:
            return
        apart = ForbiddenSky.sun_distance(*here, (float(profile.sun_rad[0, 0]), float(profile.sun_rad[0, 1])))
        if apart > SAME_SUN_RAD:
            raise ValueError(
                f"the Sun of this site is {math.degrees(apart):.1f} deg from the one that the pass was "
                f"predicted with, must be <= {math.degrees(SAME_SUN_RAD):.1f} deg: another station"
            )

    def profile_of(self, window: Pass) -> PassProfile | None:
        """Return the profile of a pass or a piece of one, None when none that comes has it."""
        for profile in self.profiles:
            late_s, early_s = window.aos_t_s - float(profile.t_s[0]), float(profile.t_s[-1]) - window.los_t_s
            if profile.name != window.name or min(late_s, early_s) < -SAME_PASS_S:
                continue
            if max(late_s, early_s) <= SAME_PASS_S:
                return profile
            ends_s = max(window.aos_t_s, float(profile.t_s[0])), min(window.los_t_s, float(profile.t_s[-1]))
            piece = profile.between(*ends_s)
            if not self.mount.level:
                return piece
            # The whole pass may have crossed north before: the turns are those of the window.
            turns = round((window.aos_azimuth_rad - float(piece.position_rad[0, 0])) / math.tau)
            return replace(piece, position_rad=piece.position_rad + np.array([turns * math.tau, 0.0]))
        return None

    def _path(self, corners: Sequence[Pair] = ()) -> CornerPath:
        return CornerPath(corners, near_rad=self._near_rad, rest_rad_s=REST_RAD_S)


def followed(certificate: Certificate, turns: int) -> Branch | None:
    """Return the branch that follows the target on a turn and never leaves it, None without one.

    A crossing of the zenith is not planned for a target that may turn before it.
    """
    for branch in certificate.branches:
        if branch.turns == turns and not (branch.plunge or branch.over or branch.at_stop):
            return replace(branch, crossing=None)
    return None
