"""The pass certificate: before a pass, what every way of tracking it asks of the machine, and which way is taken.

A branch is a whole number of azimuth turns and a course (`course.py`): direct, plunged, or over the top in the middle of the
pass.  Each branch is followed through the whole pass: travel, rates, accelerations, horizon mask, Sun, the crossing of the
zenith with its loss, and the way to its start.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rf_pointing.planning.branch_motion import BranchMotion, Lag, branch_motions, no_lag
from rf_pointing.planning.crossing import Crossing, Gain
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.limits import AxisLimits
from rf_pointing.planning.loss import PassLoss
from rf_pointing.planning.machine import MachineParams
from rf_pointing.planning.mask import HorizonMask
from rf_pointing.planning.profile import PassProfile

__all__ = ["STEP_S", "Branch", "Certificate", "certify"]

Array = NDArray[np.float64]
Pair = tuple[float, float]
Slew = Callable[[Pair, Pair], tuple[float, str]]
"""Time of a slew between two positions of the axes by the way that is free, and why there is none."""
TURN = 2.0 * math.pi
STEP_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Branch:
    """One way to track a pass; angles are those of the axes, `refusals` say with numbers why it cannot be.

    `plunge` is how the dish stands at the rise, `over` whether it goes over to the other side in the middle of the pass.
    """

    turns: int
    plunge: bool
    over: bool
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
    crossing: Crossing | None = field(default=None, compare=False)
    axes_rad: Array | None = field(default=None, compare=False)
    """Positions (n, 2) of the axes at the times of the profile."""

    @property
    def works(self) -> bool:
        """Whether the pass can be tracked this way."""
        return not self.refusals

    @property
    def label(self) -> str:
        """The branch in words."""
        way = ("over back" if self.plunge else "over") if self.over else ("plunge" if self.plunge else "direct")
        return f"{way}, {self.turns:+d} turns"


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


def certify(
    profile: PassProfile,
    axes: dict[bool, tuple[Array, Array, Array]],
    issued_t_s: float,
    present_rad: Pair,
    machine: MachineParams,
    limits: AxisLimits,
    mask: HorizonMask,
    gain: Gain,
    lag: Lag = no_lag,
    slew: Slew | None = None,
) -> Certificate:
    """Return the certificate of a pass.

    Parameters
    ----------
    profile : the pass on the sky, at even steps of `STEP_S` or less.
    axes : position, velocity, acceleration (n, 2) of the axes that hold the beam on it, azimuth continuous, by whether
        they are plunged; a way that is not there is not considered.
    issued_t_s, present_rad : now, and where the axes stand.
    gain : power received relative to the peak at angles off the beam axis.
    lag : what the axes have to stand ahead of the beam because of how it moves.
    slew : the way to the start; without one it is straight.
    """
    way = slew or (lambda start, end: (machine.slew_s(start, end), ""))
    sky = ForbiddenSky(mask, machine.sun_radius_rad)
    certified = _Certifier(profile, sky, issued_t_s, present_rad, machine, limits, gain, way)
    branches = [
        certified.branch(course, turns)
        for course in branch_motions(profile.t_s, axes, machine, limits, gain, lag)
        for turns in _turns(course.axes_rad[:, 0], limits)
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


def _turns(azimuth: Array, limits: AxisLimits) -> list[int]:
    """Return the turns with which some of the pass lies within the travel; the nearest one when none does."""
    low, high = float(azimuth.min()), float(azimuth.max())
    first = math.ceil((limits.azimuth_min_rad - high) / TURN)
    last = math.floor((limits.azimuth_max_rad - low) / TURN)
    return list(range(first, last + 1)) or [first]


@dataclass(frozen=True, slots=True)
class _Certifier:
    """What all branches of one pass have in common."""

    profile: PassProfile
    sky: ForbiddenSky
    issued_t_s: float
    present_rad: Pair
    machine: MachineParams
    limits: AxisLimits
    gain: Gain
    slew: Slew

    def branch(self, course: BranchMotion, turns: int) -> Branch:
        """Return one branch, on a course moved by whole turns."""
        shift = np.array([turns * TURN, 0.0])
        position, crossing = course.axes_rad + shift, _moved(course.crossing, shift)
        (low, high), (bottom, top) = ((float(part.min()), float(part.max())) for part in position.T)
        closest, margin = _closest(self.limits, low, high, bottom, top)
        start, end = (float(position[0, 0]), float(position[0, 1])), (float(position[-1, 0]), float(position[-1, 1]))
        preposition_s, barred = self.slew(self.present_rad, self._meeting_point(position))
        loss = PassLoss.of(crossing, self.profile.duration_s, self.gain)
        late_s = max(0.0, self.issued_t_s + preposition_s - float(self.profile.t_s[0]))
        above = -float(np.max(self.sky.under_mask_all(position)))
        sun = float(np.min(self.sky.sun_distance_all(position, self.profile.sun_rad))) - self.machine.sun_radius_rad
        lost_s, duration_s = loss.below_s + late_s, self.profile.duration_s
        refusals = _refusals(closest, margin, above, sun, lost_s, duration_s, self.machine)
        return Branch(
            turns=turns,
            plunge=course.plunge,
            over=crossing is not None and crossing.over_t_s is not None,
            start_rad=start,
            end_rad=end,
            azimuth_range_rad=(low, high),
            elevation_range_rad=(bottom, top),
            peak_rate_rad_s=_peaks(course.asked[1]),
            peak_acceleration_rad_s2=_peaks(course.asked[2]),
            closest_limit=closest,
            limit_margin_rad=margin,
            mask_margin_rad=above,
            sun_margin_rad=sun,
            preposition_s=preposition_s,
            unwind_s=self.machine.slew_s((end[0], 0.0), (math.remainder(end[0], TURN), 0.0)),
            late_s=late_s,
            refusals=(*refusals, *((f"no way to the start: {barred}",) if barred and margin >= 0.0 else ())),
            crossing=crossing,
            axes_rad=position,
            keyhole_s=loss.off_s,
            lost_s=loss.below_s,
            lost_signal_s=loss.signal_s,
            peak_loss_db=loss.peak_db,
            mean_loss_db=loss.mean_db,
        )

    def _meeting_point(self, position: Array) -> Pair:
        """Return where the axes have to go: to the start of the pass, or where a pass that is going on already has come."""
        row = int(np.searchsorted(self.profile.t_s, self.issued_t_s))
        azimuth, elevation = position[min(row, len(position) - 1)].tolist()
        return azimuth, elevation


def _moved(crossing: Crossing | None, shift: Array) -> Crossing | None:
    return None if crossing is None else dataclasses.replace(crossing, position_rad=crossing.position_rad + shift)


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


def _refusals(
    closest: str, margin: float, above: float, sun: float, lost_s: float, duration_s: float, machine: MachineParams
) -> tuple[str, ...]:
    found = []
    if margin < 0.0:
        found.append(f"{-math.degrees(margin):.3f} deg past the limit {closest}")
    if above < 0.0:
        found.append(f"{-math.degrees(above):.3f} deg below the horizon mask")
    if sun < 0.0:
        found.append(
            f"{math.degrees(sun + machine.sun_radius_rad):.3f} deg from the Sun, "
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
        round(branch.preposition_s + branch.unwind_s, 6),  # equally long ones keep their order
    )  # fmt: skip
