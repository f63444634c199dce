"""The pass certificate: before a pass, what every way of tracking it asks of the machine, and which way is taken.

A branch is a whole number of azimuth turns, direct or plunged.  The exact plunge of (az, el) is (az + 180 deg,
180 deg - el); mirroring about closest approach instead is 30 deg off at loss of signal.  Each branch is followed through the
whole pass: travel, rates, accelerations, horizon mask, Sun, and the crossing of the zenith (`crossing.py`) with its loss.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.geometry import Params, parameter
from rf_pointing.planning.crossing import AxisMotionLimits, Crossing, Gain, cross
from rf_pointing.planning.limits import AxisLimits
from rf_pointing.planning.mask import HorizonMask
from rf_pointing.planning.profile import PassProfile
from rf_pointing.planning.slew import AxisRates

__all__ = ["Branch", "Certificate", "MachineParams", "certify", "plunged", "unplunged"]

Array = NDArray[np.float64]
TURN = 2.0 * math.pi
STEP_S = 0.1
HALF_POWER_DB = 3.0
DEEPEST_DB = 60.0
"""Loss beyond which only "more than" is meant; a Gaussian beam has no sidelobes."""


@dataclass(frozen=True, kw_only=True)
class MachineParams(Params):
    """What the axes can do, and what a pass must keep to be worth tracking."""

    rate_limit_rad_s: tuple[float, float] = parameter((math.radians(1.8),) * 2, "largest rates", low=1e-6, high=10.0)
    acceleration_limit_rad_s2: tuple[float, float] = parameter(
        (math.radians(0.8),) * 2, "largest accelerations", low=1e-6, high=100.0
    )
    reserve: float = parameter(0.05, "share of both that planning leaves to the tracking loop", low=0.0, high=0.5)
    sun_radius_rad: float = parameter(math.radians(1.0), "the beam stays this far from the Sun", low=0.0, high=0.5)
    least_share: float = parameter(0.8, "share of the pass that must be received within 3 dB", low=0.0, high=1.0)
    half_power_beamwidth_rad: float = parameter(
        math.radians(0.065), "beamwidth that the loss is computed for", low=1e-6, high=0.5
    )

    def motion_limits(self, elevation_max_rad: float) -> AxisMotionLimits:
        """Return the limits that planning may use."""
        share = 1.0 - self.reserve
        return AxisMotionLimits(
            (share * self.rate_limit_rad_s[0], share * self.rate_limit_rad_s[1]),
            (share * self.acceleration_limit_rad_s2[0], share * self.acceleration_limit_rad_s2[1]),
            elevation_max_rad,
        )

    @property
    def axes(self) -> AxisRates:
        """Rates and accelerations of the axes."""
        return AxisRates(self.rate_limit_rad_s, self.acceleration_limit_rad_s2)

    def slew_s(self, start: tuple[float, float], end: tuple[float, float]) -> float:
        """Return the time from rest at one position to rest at another, both axes at once."""
        return self.axes.slew_s(start, end)


@dataclass(frozen=True, kw_only=True)
class Branch:
    """One way to track a pass; angles are those of the axes, `refusals` say with numbers why it cannot be."""

    turns: int
    plunge: bool
    start_rad: tuple[float, float]
    end_rad: tuple[float, float]
    azimuth_range_rad: tuple[float, float]
    elevation_range_rad: tuple[float, float]
    peak_rate_rad_s: tuple[float, float]
    peak_acceleration_rad_s2: tuple[float, float]
    closest_limit: str
    limit_margin_rad: float
    mask_margin_rad: float
    sun_margin_rad: float
    keyhole_s: float
    lost_s: float
    lost_signal_s: float
    peak_loss_db: float
    mean_loss_db: float
    preposition_s: float
    unwind_s: float
    late_s: float
    refusals: tuple[str, ...]
    crossing: Crossing | None = None

    @property
    def works(self) -> bool:
        """Whether the pass can be tracked this way."""
        return not self.refusals

    @property
    def label(self) -> str:
        """The branch in words."""
        return f"{'plunge' if self.plunge else 'direct'}, {self.turns:+d} turns"


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """All branches of one pass, best first among those that work; `machine` is what they were held against."""

    name: str
    issued_t_s: float
    aos_t_s: float
    los_t_s: float
    sky_peak_rad: float
    branches: tuple[Branch, ...]
    machine: MachineParams

    @property
    def chosen(self) -> Branch | None:
        """The branch to track on, None when none works."""
        return next((branch for branch in self.branches if branch.works), None)

    @property
    def refusal(self) -> str:
        """Why no branch works, with the numbers of the one that comes closest; "" when one works."""
        if self.chosen is not None:
            return ""
        first = self.branches[0]
        return f"no branch works; the nearest, {first.label}: " + "; ".join(first.refusals)


def plunged(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Return the same motion on the sky with the dish over the top, (..., 2) each; `unplunged` undoes it."""
    mirror = np.array([1.0, -1.0])
    return position * mirror + np.pi, velocity * mirror, acceleration * mirror


def unplunged(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Undo `plunged`."""
    mirror = np.array([1.0, -1.0])
    return (position - np.pi) * mirror, velocity * mirror, acceleration * mirror


def certify(
    profile: PassProfile,
    axes: dict[bool, tuple[Array, ...]],
    issued_t_s: float,
    present_rad: tuple[float, float],
    machine: MachineParams,
    limits: AxisLimits,
    mask: HorizonMask,
    gain: Gain,
) -> Certificate:
    """Return the certificate of a pass.

    Parameters
    ----------
    profile : the pass on the sky, at even steps of `STEP_S` or less.
    axes : position, velocity, acceleration (n, 2) of the axes that hold the beam on it, azimuth continuous, by whether
        they are plunged; a way that is not there is not considered.
    issued_t_s, present_rad : now, and where the axes stand.
    gain : power received relative to the peak at angles off the beam axis.
    """
    sky = _Sky(
        mask=float(np.min(profile.position_rad[:, 1] - mask.lowest_all(profile.position_rad[:, 0]))),
        sun=float(np.min(profile.sun_angle_rad())) - machine.sun_radius_rad,
    )
    branches: list[Branch] = []
    for plunge, motion in axes.items():
        # Over the top the whole pass lies beyond the zenith: an end of travel there is a refusal, not a detour.
        motion_limits = machine.motion_limits(math.inf if plunge else limits.elevation_max_rad)
        crossing = cross(profile.t_s, motion[0], motion[1], motion[2], motion_limits, gain)
        branches += [
            _branch(plunge, turns, profile, motion, crossing, sky, issued_t_s, present_rad, machine, limits, gain)
            for turns in _turns(motion[0][:, 0], limits)
        ]
    return Certificate(
        name=profile.name,
        issued_t_s=issued_t_s,
        aos_t_s=float(profile.t_s[0]),
        los_t_s=float(profile.t_s[-1]),
        sky_peak_rad=float(profile.position_rad[:, 1].max()),
        branches=tuple(sorted(branches, key=_cost)),
        machine=machine,
    )


@dataclass(frozen=True, slots=True)
class _Sky:
    mask: float
    sun: float


def _turns(azimuth: Array, limits: AxisLimits) -> list[int]:
    """Return the turns with which some of the pass lies within the travel; the nearest one when none does."""
    low, high = float(azimuth.min()), float(azimuth.max())
    first = math.ceil((limits.azimuth_min_rad - high) / TURN)
    last = math.floor((limits.azimuth_max_rad - low) / TURN)
    return list(range(first, last + 1)) or [first]


def _branch(
    plunge: bool,
    turns: int,
    profile: PassProfile,
    motion: tuple[Array, ...],
    crossing: Crossing | None,
    sky: _Sky,
    issued_t_s: float,
    present_rad: tuple[float, float],
    machine: MachineParams,
    limits: AxisLimits,
    gain: Gain,
) -> Branch:
    shift = np.array([turns * TURN, 0.0])
    position = motion[0] + shift
    if crossing is not None:
        crossing = Crossing(
            crossing.t_s, crossing.position_rad + shift, crossing.velocity_rad_s, crossing.acceleration_rad_s2,
            crossing.error_rad,
        )  # fmt: skip
        first = int(np.searchsorted(profile.t_s, crossing.t_s[0]))
        position = position.copy()
        position[first : first + len(crossing.t_s)] = crossing.position_rad
    (low, high), (bottom, top) = ((float(part.min()), float(part.max())) for part in position.T)
    closest, margin = _closest(limits, low, high, bottom, top)
    start, end = (float(position[0, 0]), float(position[0, 1])), (float(position[-1, 0]), float(position[-1, 1]))
    preposition_s = machine.slew_s(present_rad, start)
    losses = _losses(profile, crossing, gain)
    late_s = max(0.0, issued_t_s + preposition_s - float(profile.t_s[0]))
    return Branch(
        turns=turns,
        plunge=plunge,
        start_rad=start,
        end_rad=end,
        azimuth_range_rad=(low, high),
        elevation_range_rad=(bottom, top),
        peak_rate_rad_s=_peaks(motion[1]),
        peak_acceleration_rad_s2=_peaks(motion[2]),
        closest_limit=closest,
        limit_margin_rad=margin,
        mask_margin_rad=sky.mask,
        sun_margin_rad=sky.sun,
        preposition_s=preposition_s,
        unwind_s=machine.slew_s((end[0], 0.0), (math.remainder(end[0], TURN), 0.0)),
        late_s=late_s,
        refusals=_refusals(sky, closest, margin, losses[1] + late_s, profile.duration_s, machine),
        crossing=crossing,
        keyhole_s=losses[0],
        lost_s=losses[1],
        lost_signal_s=losses[2],
        peak_loss_db=losses[3],
        mean_loss_db=losses[4],
    )


def _peaks(values: Array) -> tuple[float, float]:
    azimuth, elevation = np.abs(values).max(axis=0).tolist()
    return azimuth, elevation


def _closest(limits: AxisLimits, low: float, high: float, bottom: float, top: float) -> tuple[str, float]:
    """Return the limit that the motion comes nearest to, and by how much it stays inside (negative: past it)."""
    margins = {
        f"azimuth {math.degrees(limits.azimuth_min_rad):.1f} deg": low - limits.azimuth_min_rad,
        f"azimuth {math.degrees(limits.azimuth_max_rad):.1f} deg": limits.azimuth_max_rad - high,
        f"elevation {math.degrees(limits.elevation_min_rad):.1f} deg": bottom - limits.elevation_min_rad,
        f"elevation {math.degrees(limits.elevation_max_rad):.1f} deg": limits.elevation_max_rad - top,
    }
    name = min(margins, key=lambda key: margins[key])
    return name, margins[name]


def _losses(profile: PassProfile, crossing: Crossing | None, gain: Gain) -> tuple[float, float, float, float, float]:
    """Return seconds off the target, seconds below half power, seconds of signal lost, peak and mean loss in dB."""
    if crossing is None:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    step_s = float(crossing.t_s[1] - crossing.t_s[0])
    received = gain(crossing.error_rad)
    off = crossing.error_rad > 0.05 * float(np.max(crossing.error_rad))
    lost_s = float(np.sum(1.0 - received) * step_s)
    peak = -10.0 * math.log10(max(float(received.min()), 10.0 ** (-DEEPEST_DB / 10.0)))
    mean = -10.0 * math.log10(max(1.0 - lost_s / profile.duration_s, 1e-6))
    below = float(np.sum(received < 10.0 ** (-HALF_POWER_DB / 10.0)) * step_s)
    return float(np.sum(off) * step_s), below, lost_s, peak, mean


def _refusals(
    sky: _Sky, closest: str, margin: float, lost_s: float, duration_s: float, machine: MachineParams
) -> tuple[str, ...]:
    found = []
    if margin < 0.0:
        found.append(f"{-math.degrees(margin):.3f} deg past the limit {closest}")
    if sky.mask < 0.0:
        found.append(f"{-math.degrees(sky.mask):.3f} deg below the horizon mask")
    if sky.sun < 0.0:
        found.append(
            f"{math.degrees(sky.sun + machine.sun_radius_rad):.3f} deg from the Sun, "
            f"must be >= {math.degrees(machine.sun_radius_rad):.3f} deg"
        )
    share = 1.0 - lost_s / duration_s
    if share < machine.least_share:
        found.append(
            f"{lost_s:.0f} s of {duration_s:.0f} s would be lost, {100.0 * max(share, 0.0):.0f} % received, "
            f"must be >= {100.0 * machine.least_share:.0f} %"
        )
    return tuple(found)


def _cost(branch: Branch) -> tuple[object, ...]:
    """Order: works; least signal lost, to a tenth of a second; then the least time to get there and to unwind."""
    distance = max(0.0, -branch.limit_margin_rad)
    return (
        not branch.works, len(branch.refusals), distance, round(branch.lost_signal_s + branch.late_s, 1),
        branch.preposition_s + branch.unwind_s,
    )  # fmt: skip
