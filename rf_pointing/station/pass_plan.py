"""The plan of the pass in hand: its certificate, and the chosen branch carried out.

The controller thinks in direct axis angles; a plunged pass is turned over the top on the way out and back on the way in.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.ephemeris import Pass
from rf_pointing.geometry import JointReading, JointTrajectory, Motion, Quintic
from rf_pointing.planning import (
    AxisLimits,
    Branch,
    Certificate,
    Gate,
    GateParams,
    HorizonMask,
    MachineParams,
    PassProfile,
    Way,
    motion_between,
)
from rf_pointing.planning.certificate import plunged, unplunged
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.station.axis_motion import axis_motion
from rf_pointing.station.pass_planning import certificate_of
from rf_pointing.station.solar import SolarDirection

__all__ = ["PassPlan"]

Array = NDArray[np.float64]
SAME_PASS_S = 30.0
SAME_SUN_RAD = math.radians(0.5)
NEW_GOAL_RAD = math.radians(0.1)
"""How far the start of a pass must move, by another bias model, for the way to it to be looked for again."""
NEITHER_WAY = ("conscan", "auto")
"""Sensors whose scan is laid out in axis angles: not used over the top."""


class PassPlan:
    """Profiles of the coming passes, and the branch of the one that is tracked."""

    def __init__(
        self, machine: MachineParams, mask: HorizonMask, gate: GateParams, limits: AxisLimits, sun: SolarDirection
    ) -> None:
        self.machine, self.mask, self._gate_params, self.sun = machine, mask, gate, sun
        self._way, self._goal = Way(), np.full(2, math.inf)
        self.take_limits(limits)
        self._profiles: list[PassProfile] = []
        self.certificate: Certificate | None = None
        self.branch: Branch | None = None

    def take_limits(self, limits: AxisLimits) -> None:
        """Use these limits of travel from now on."""
        self._limits, self.gate = limits, Gate(self._gate_params, limits, self.mask, self.machine.axes)

    def take_profiles(self, profiles: list[PassProfile]) -> None:
        """Note the motion of the coming passes, in place of those before."""
        self._profiles = profiles

    def clear(self) -> None:
        """Forget the branch: direct, without a crossing."""
        self.branch, self._way, self._goal = None, Way(), np.full(2, math.inf)

    def choose(self, t_s: float, window: Pass, joints: JointReading, model: BiasModel, sensor: str) -> bool:
        """Issue the certificate of a pass and take its branch; False when the pass has no profile.

        Raises
        ------
        ValueError
            When no branch works, with the numbers.
        """
        self.clear()
        self.certificate = None
        profile = self._profile_of(window)
        if profile is None:
            return False
        self._check_sun(profile)
        azimuth, elevation = joints.position_rad.tolist()
        self.certificate = certificate_of(
            profile, model, t_s, (azimuth, elevation), self.machine, self._limits, self.mask,
            plunge_allowed=sensor not in NEITHER_WAY,
        )  # fmt: skip
        self.branch = self.certificate.chosen
        if self.branch is None:
            raise ValueError(self.certificate.refusal)
        try:
            self.approach(t_s, joints, np.array(self.branch.start_rad))
        except ValueError:
            self.branch = None
            raise
        return True

    def refusal(self, kind: str, t_s: float, present_rad: tuple[float, float] | None, positions: Array) -> str:
        """Return "" when the gate lets the axes move through `positions` (n, 2), else why not."""
        here = present_rad if present_rad is not None else (float(positions[0, 0]), float(positions[0, 1]))
        return self.gate.check(kind, here, positions, sun_rad=self.sun.at(t_s)).reason_of_refusal

    def approach(self, t_s: float, axes: JointReading, goal_rad: Array) -> Array | None:
        """Return the corner (2,) by which to go to a goal, None when the way is free; both as the axes stand.

        Raises
        ------
        ValueError
            When the gate knows no way, with its reason.
        """
        azimuth, elevation = axes.position_rad.tolist()
        if not float(np.max(np.abs(goal_rad - self._goal))) <= NEW_GOAL_RAD:
            goal = (float(goal_rad[0]), float(goal_rad[1]))
            kind = motion_between((azimuth, elevation), goal)
            found = self.gate.check(kind, (azimuth, elevation), np.array([goal]), sun_rad=self.sun.at(t_s))
            if not found.allowed:
                raise ValueError(f"no {kind} to the start of the pass: {found.reason}")
            self._goal, self._way = goal_rad.copy(), Way(found.way)
        corner = self._way.next((azimuth, elevation))
        return None if corner is None else np.array(corner)

    def to_start(self, t_s: float, axes: JointReading | None, start_rad: Array) -> Array:
        """Return where to go now (2,) on the way to the start of the pass, in direct angles; errors as of `approach`."""
        if axes is None:
            return start_rad
        still = np.zeros(2)
        goal = plunged(start_rad, still, still)[0] if self.plunge else start_rad
        corner = self.approach(t_s, axes, goal)
        if corner is None:
            return start_rad
        return unplunged(corner, still, still)[0] if self.plunge else corner

    @property
    def turns_rad(self) -> float:
        """Whole turns of the branch."""
        return 2.0 * math.pi * self.branch.turns if self.branch else 0.0

    @property
    def plunge(self) -> bool:
        """Whether the pass is tracked over the top."""
        return self.branch is not None and self.branch.plunge

    def crossing(self, t_s: float) -> bool:
        """Whether the antenna leaves the target at `t_s` because its axes are too slow for it."""
        found = self.branch.crossing if self.branch else None
        return found is not None and bool(found.t_s[0] <= t_s <= found.t_s[-1])

    def replace(self, times: Array, motion: Motion, beside: Callable[[Motion], Array]) -> Motion:
        """Return the motion (n, 2) with the crossing in place of the target's own motion while it lasts.

        `beside` tells by how much (m, 2) the axes have to stand off the target's predicted motion (m, 2).  It is asked at
        both ends of the crossing only and goes over from one to the other: close to the zenith an offset on the sky
        would be any azimuth.
        """
        found = self.branch.crossing if self.branch else None
        if found is None or times[-1] < found.t_s[0] or times[0] > found.t_s[-1]:
            return motion
        own = found.position_rad, found.velocity_rad_s, found.acceleration_rad_s2
        table = unplunged(*own) if self.plunge else own
        first, last = beside(Motion(*(part[[0, -1]] for part in table)))
        rows = [part.copy() for part in motion]
        for index in np.flatnonzero((times >= found.t_s[0]) & (times <= found.t_s[-1])):
            share = _eased((float(times[index]) - float(found.t_s[0])) / found.duration_s, found.duration_s)
            here = _interpolated(found.t_s, table, float(times[index]))
            for row, part, gone in zip(rows, here, share, strict=True):
                row[index] = part + gone * (last - first)
            rows[0][index] += first
        return Motion(*rows)

    def to_axes(self, trajectory: JointTrajectory) -> JointTrajectory:
        """Return a trajectory in direct angles as the axes must move."""
        if not self.plunge:
            return trajectory
        position, velocity, acceleration = plunged(
            trajectory.position_rad, trajectory.velocity_rad_s, trajectory.acceleration_rad_s2
        )
        return dataclasses.replace(
            trajectory, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration
        )

    def from_axes(self, reading: JointReading) -> JointReading:
        """Return a reading of the axes in direct angles; undoes `to_axes`."""
        if not self.plunge:
            return reading
        position, velocity, _ = unplunged(reading.position_rad, reading.velocity_rad_s, np.zeros(2))
        return dataclasses.replace(reading, position_rad=position, velocity_rad_s=velocity)

    def model_motion(self, sky: Motion, model: BiasModel) -> Motion:
        """Return the direct angles that hold the beam on `sky` (n, 2): the model sees the axes as they really stand."""
        motion = axis_motion(sky, model, plunge=self.plunge)
        return Motion(*unplunged(*motion)) if self.plunge else motion

    def _check_sun(self, profile: PassProfile) -> None:
        """Refuse a pass that was predicted for another station than the one whose Sun is kept clear of."""
        here = self.sun.at(float(profile.t_s[0]))
        if here is None or self._gate_params.sun_radius_rad == 0.0:
            return
        apart = ForbiddenSky.sun_distance(*here, (float(profile.sun_rad[0, 0]), float(profile.sun_rad[0, 1])))
        if apart > SAME_SUN_RAD:
            raise ValueError(
                f"sun.station={self.sun.station}: its Sun stands {math.degrees(apart):.1f} deg from the one that the pass was "
                f"predicted with, must be <= {math.degrees(SAME_SUN_RAD):.1f} deg: another station"
            )

    def _profile_of(self, window: Pass) -> PassProfile | None:
        for profile in self._profiles:
            begins = abs(float(profile.t_s[0]) - window.aos_t_s) <= SAME_PASS_S
            if profile.name == window.name and begins and abs(float(profile.t_s[-1]) - window.los_t_s) <= SAME_PASS_S:
                return profile
        return None


def _interpolated(t_s: Array, table: tuple[Array, ...], at_s: float) -> Motion:
    """Return the motion (2,) at one instant of a table of even times."""
    step_s = float(t_s[1] - t_s[0])
    row = min(int((at_s - float(t_s[0])) / step_s), len(t_s) - 2)
    start, end = (Motion(*(part[index] for part in table)) for index in (row, row + 1))
    return Quintic(start, end, step_s).at(at_s - float(t_s[row]))


def _eased(share: float, duration_s: float) -> tuple[float, float, float]:
    """Return the step from 0 to 1 without a jump of its rate, 3 x^2 - 2 x^3, and its two derivatives in time."""
    return (
        share**2 * (3.0 - 2.0 * share),
        6.0 * share * (1.0 - share) / duration_s,
        6.0 * (1.0 - 2.0 * share) / duration_s**2,
    )
