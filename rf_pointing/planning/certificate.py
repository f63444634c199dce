"""The pass certificate: before a pass, what each way of tracking it requires of the machine.

A branch is a whole number of azimuth turns and a motion (`branch_motion.py`): direct, plunged, or
over the top in the middle of the pass.  Each branch is followed through the whole pass: travel,
rates, accelerations, horizon mask, Sun, the crossing of the zenith with its loss, and the slew to
its start.  The best branch that works is taken.

A pass that is going on is worth what is left of it: everything is counted from the issue on.  The
expected loss is that of the mean power (`core/pass_outcome.py`),

    (T - L - A - C) p + (L + A) g_sidelobe  of  T

with T what is left of the pass, L the lateness, A the acquisition, C the signal lost in a crossing
and p the power that a scan or an error of the prediction leaves.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.core import LEVEL, TURN, Array, Kinematics, Pair, PassOutcome
from rf_pointing.planning.branch_motion import BranchMotion, Lag, branch_motions, no_lag
from rf_pointing.planning.crossing import Crossing, CrossingLoss, Gain
from rf_pointing.planning.forbidden_sky import ForbiddenSky, angle_between
from rf_pointing.planning.horizon import HorizonMask
from rf_pointing.planning.limits import AxisLimits, MachineParams
from rf_pointing.planning.profile import PassProfile

# Time of a slew between two positions of the axes by the free way, and why no way is free.
Slew = Callable[[Pair, Pair], tuple[float, str]]
# A pass keeps so much more than the Sun's zone, for the loop's corrections and the mount's lags.
SUN_CLEARANCE_RAD = math.radians(0.05)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorCost:
    """Cost of a sensor on any branch of a pass.

    `acquisition_s` is the expected time until it holds the target, `power` the mean power over that
    on the axis while it does.  A crossing that takes longer than `memory_s` costs it the target:
    the mount's errors are others on the other side of the sky.  `carrier_to_noise_db_hz` is the
    least and the most that the link gives on the pass, () if it is not known.

    Nine passes of ten do without more than `unheld_90_s` and with at least `power_90`: what is
    known of the target decides.  `unheld_s` is the mean; a search moves by `search_rad_s` at most.
    """

    acquisition_s: float = 0.0
    power: float = 1.0
    memory_s: float = math.inf
    carrier_to_noise_db_hz: tuple[float, ...] = ()
    unheld_s: float = 0.0
    unheld_90_s: float = 0.0
    power_90: float = 1.0
    search_rad_s: float = 0.0
    acquisition_band: str = ""
    """Wider band in which the target is acquired first, "" for none."""
    fresh: "SensorCost | None" = None
    """The same on fresh elements, where those in use are older."""


@dataclass(frozen=True, kw_only=True)
class Branch:
    """One way to track a pass; angles are those of the axes, `reasons` why it cannot be.

    `plunge` is how the dish stands at the rise, `over` whether it goes over to the other side in
    the middle of the pass.  `mean_loss_db` is what is expected of all that is left of the pass.
    """

    turns: int
    plunge: bool
    over: bool
    start_rad: Pair
    end_rad: Pair
    azimuth_range_rad: Pair
    elevation_range_rad: Pair
    peak_rate_rad_s: Pair
    peak_acceleration_rad_s2: Pair
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
    acquisition_s: float
    reasons: tuple[str, ...]
    held_s: float | None = None
    """Seconds within half power to expect, None in a certificate from the wire, as what follows."""
    held_90_s: float | None = None
    """Seconds that nine passes of ten hold, by what is known of the target."""
    loss_90_db: float | None = None
    fresh_held_90_s: float | None = None
    """The same on fresh elements, None where those in use are."""
    fresh_loss_90_db: float | None = None
    search_rate_rad_s: tuple[float, ...] = ()
    """Largest rates of the axes with a search on top of the target's motion."""
    # Arrays do not compare to one truth value, and a certificate from the wire has none.
    crossing: Crossing | None = field(default=None, compare=False)
    axes_rad: Array | None = field(default=None, compare=False)
    """Positions (n, 2) of the axes at the times of the profile."""

    @property
    def works(self) -> bool:
        """Whether the pass can be tracked this way."""
        return not self.reasons

    @property
    def label(self) -> str:
        """The branch in words."""
        way = ("over back" if self.plunge else "over") if self.over else ("plunge" if self.plunge else "direct")
        stop = ", unwinds" if self.turned else ", waits" if self.at_stop else ""
        return f"{way}, {self.turns:+d} turns{stop}"

    @property
    def at_stop(self) -> bool:
        """Whether the pass crosses an end of the azimuth's travel."""
        return self.crossing is not None and self.crossing.at_stop

    @property
    def turned(self) -> bool:
        """Whether the azimuth is unwound by a turn in the pass."""
        return self.crossing is not None and self.at_stop and self.crossing.turn_rad != 0.0


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """All branches of one pass on `machine`, best first among those that work."""

    name: str
    issued_t_s: float
    aos_t_s: float
    los_t_s: float
    sky_peak_rad: float
    branches: tuple[Branch, ...]
    machine: MachineParams
    carrier_to_noise_db_hz: tuple[float, ...] = ()
    """Least and most that is expected with the beam on the target, () if it is not known."""
    mount: Kinematics = LEVEL
    """The mount whose axes the branches move, its tilt axis set for this pass."""
    band: str = ""
    """Band of the station, "" if it is not known."""
    acquisition_band: str = ""
    """Wider band in which the target is acquired first, "" for none."""

    @property
    def chosen(self) -> Branch | None:
        """The branch to track on, None when none works."""
        return next((branch for branch in self.branches if branch.works), None)

    @property
    def reason(self) -> str:
        """Why no branch works, with the numbers of the nearest one; "" when one works."""
        if self.chosen is not None:
            return ""
        first = self.branches[0]
        return f"no branch works; the nearest, {first.label}: " + "; ".join(first.reasons)


def certify(
    profile: PassProfile, axes: dict[bool, tuple[Array, Array, Array]], issued_t_s: float,
    encoder_rad: Pair, machine: MachineParams, limits: AxisLimits, mask: HorizonMask, gain: Gain,
    lag: Lag = no_lag, slew: Slew | None = None, cost: SensorCost | None = None,
    mount: Kinematics = LEVEL,
) -> Certificate:  # fmt: skip
    """Return the certificate of a pass.

    Parameters
    ----------
    profile : the pass in the angles of the mount's axes, resampled.
    axes : position, velocity, acceleration (n, 2) of the axes that hold the beam on the target,
        azimuth continuous, by whether they are plunged; a side that is missing is not considered.
    issued_t_s, encoder_rad : now, and where the axes are.
    gain : power received relative to the peak at angles off the beam axis.
    lag : what the axes must lead the beam by because of how it moves.
    slew : the way to the start; without one it is straight.
    cost : what the sensor of the pass costs; without one nothing.
    mount : what the axes are; the horizon mask is that of the sky.

    Raises
    ------
    ValueError
        When the pass is over.
    """
    if issued_t_s >= profile.t_s[-1]:
        raise ValueError(f"the pass of {profile.name} ended {issued_t_s - float(profile.t_s[-1]):.0f} s ago")
    way = slew or (lambda start, end: (machine.slew_s(start, end), ""))
    sky = ForbiddenSky(mask, machine.sun_radius_rad, mount)
    certified = _Certifier(profile, sky, issued_t_s, encoder_rad, machine, limits, gain, way, cost or SensorCost())
    branches = [
        certified.branch(motion, turns)
        for motion in branch_motions(profile.t_s, axes, machine, limits, gain, lag)
        for turns in _turns(motion.axes_rad[:, 0], limits)
    ]
    return Certificate(
        name=profile.name, issued_t_s=issued_t_s, aos_t_s=float(profile.t_s[0]),
        los_t_s=float(profile.t_s[-1]),
        sky_peak_rad=float(_elevations(profile.position_rad, mount).max()),
        branches=tuple(sorted(branches, key=branch_cost)), machine=machine,
        carrier_to_noise_db_hz=cost.carrier_to_noise_db_hz if cost else (), mount=mount,
        acquisition_band=cost.acquisition_band if cost else "",
    )  # fmt: skip


def _elevations(axes_rad: Array, mount: Kinematics) -> Array:
    return axes_rad[:, 1] if mount.level else mount.skies(axes_rad)[:, 1]


def _turns(azimuth: Array, limits: AxisLimits) -> list[int]:
    """Return the turns with which some of the pass lies within the travel, else the nearest one."""
    low, high = float(azimuth.min()), float(azimuth.max())
    first = math.ceil((limits.azimuth_min_rad - high) / TURN)
    last = math.floor((limits.azimuth_max_rad - low) / TURN)
    return list(range(first, last + 1)) or [first]


@dataclass(frozen=True, slots=True)
class _Certifier:
    """Common data of all branches of one pass."""

    profile: PassProfile
    sky: ForbiddenSky
    issued_t_s: float
    encoder_rad: Pair
    machine: MachineParams
    limits: AxisLimits
    gain: Gain
    slew: Slew
    cost: SensorCost

    def branch(self, motion: BranchMotion, turns: int) -> Branch:
        """Return one branch, a motion moved by whole turns."""
        shift = np.array([turns * TURN, 0.0])
        position, crossing = motion.axes_rad + shift, motion.crossing
        if crossing is not None:
            crossing = dataclasses.replace(crossing, position_rad=crossing.position_rad + shift)
        # A pass that is going on is met where it is now, not at its rise behind the antenna.
        first = min(int(np.searchsorted(self.profile.t_s, self.issued_t_s)), len(position) - 1)
        ahead, required = position[first:], [part[first:] for part in motion.required]
        (low, high), (bottom, top) = ((float(part.min()), float(part.max())) for part in ahead.T)
        closest, margin = _closest(self.limits, low, high, bottom, top, self.sky.mount.axes)
        start, end = (ahead[0, 0].item(), ahead[0, 1].item()), (ahead[-1, 0].item(), ahead[-1, 1].item())
        preposition_s, barred = self.slew(self.encoder_rad, start)
        begin_s = float(self.profile.t_s[first])
        loss = CrossingLoss.of(crossing, self.gain, begin_s)
        for fixed in self.machine.fixed_elevation_rad:
            looks = np.column_stack([ahead[:, 0], np.full(len(ahead), fixed)])
            beside = angle_between(looks, self.profile.position_rad[first:])
            step_s = float(self.profile.t_s[1] - self.profile.t_s[0])
            loss = dataclasses.replace(loss, **CrossingLoss.of_errors(beside, self.gain, step_s))
        # Late is what the slew takes beyond the rise.
        late_s = max(0.0, self.issued_t_s + preposition_s - begin_s)
        above = -float(np.max(self.sky.under_mask_all(ahead)))
        sun = float(np.min(angle_between(ahead, self.profile.sun_rad[first:]))) - self.machine.sun_radius_rad
        left_s = float(self.profile.t_s[-1]) - begin_s
        acquisition_s = self.cost.acquisition_s * (2.0 if loss.lost_s > self.cost.memory_s else 1.0)
        reasons = _reasons_against(closest, margin, above, sun, self.machine)
        return Branch(
            turns=turns, plunge=motion.plunge,
            over=crossing is not None and crossing.over_t_s is not None, start_rad=start,
            end_rad=end, azimuth_range_rad=(low, high), elevation_range_rad=(bottom, top),
            peak_rate_rad_s=_peaks(required[1]), peak_acceleration_rad_s2=_peaks(required[2]),
            closest_limit=closest, limit_margin_rad=margin, mask_margin_rad=above,
            sun_margin_rad=sun,
            mean_loss_db=self._expected(loss, late_s + acquisition_s, left_s).mean_loss_db,
            preposition_s=preposition_s,
            unwind_s=self.machine.slew_s((end[0], 0.0), (math.remainder(end[0], TURN), 0.0)),
            late_s=late_s, acquisition_s=acquisition_s, **self._probable(loss, late_s, left_s),
            search_rate_rad_s=self._search_rate(motion.required[1][first:], ahead[:, 1]),
            reasons=(
                *reasons, *self._too_little(loss.lost_s, late_s, left_s),
                *((f"no way to the start: {barred}",) if barred and margin >= 0.0 else ()),
            ),
            crossing=crossing, axes_rad=position, **dataclasses.asdict(loss),
        )  # fmt: skip

    def _expected(self, loss: CrossingLoss, blind_s: float, left_s: float) -> PassOutcome:
        """Return what is expected of the `left_s` of the pass, `blind_s` of which are not held."""
        blind_s = min(blind_s, left_s)
        off_s = min(loss.lost_s, left_s - blind_s)
        received_s = max(left_s - blind_s - loss.lost_signal_s, 0.0) * self.cost.power
        held = PassOutcome(left_s - blind_s - off_s, off_s, received_s)
        return held + PassOutcome.unseen(blind_s)

    def _probable(self, loss: CrossingLoss, late_s: float, left_s: float) -> dict[str, float]:
        """Return the seconds held on average and in nine passes of ten, and the loss in these."""
        free_s = left_s - min(late_s, left_s) - min(loss.lost_s, left_s)
        found = {"held_s": max(free_s - self.cost.unheld_s, 0.0)}
        for name, cost in (("", self.cost), ("fresh_", self.cost.fresh)):
            if cost is None:
                continue
            worst = dataclasses.replace(self, cost=dataclasses.replace(cost, power=cost.power_90))
            # Program track alone is on the pass all the time; what it misses is in its power.
            blind_s = late_s + cost.unheld_90_s * bool(cost.search_rad_s)
            found[f"{name}held_90_s"] = max(free_s - cost.unheld_90_s, 0.0)
            found[f"{name}loss_90_db"] = worst._expected(loss, blind_s, left_s).mean_loss_db
        return found

    def _search_rate(self, rates: Array, elevation: Array) -> Pair:
        """Return the largest rates of the axes while the target is searched for."""
        if not self.cost.search_rad_s:
            return _peaks(rates)
        # Near the zenith a step across the line of sight is any angle of the azimuth, whose limit
        # holds.
        stretch = np.column_stack([1.0 / np.maximum(np.abs(np.cos(elevation)), 1e-6), np.ones(len(elevation))])
        azimuth, up = _peaks(np.abs(rates) + self.cost.search_rad_s * stretch)
        most = self.machine.rate_limit_rad_s
        return min(azimuth, most[0]), min(up, most[1])

    def _too_little(self, lost_s: float, late_s: float, left_s: float) -> tuple[str, ...]:
        """Return why too little of the pass would be received, () when it is enough."""
        if self.issued_t_s > float(self.profile.t_s[0]):
            # Every second of a pass that is going on counts, however few are left.
            if late_s < left_s:
                return ()
            return (f"the slew to the pass takes {late_s:.0f} s, {left_s:.0f} s of it are left",)
        # Signal lost on the way to the pass counts like signal lost at the zenith.
        share, least = 1.0 - (lost_s + late_s) / left_s, self.machine.least_share
        if share >= least:
            return ()
        return (
            f"{lost_s + late_s:.0f} s of {left_s:.0f} s would be lost, {100.0 * max(share, 0.0):.0f} % received, "
            f"must be >= {100.0 * least:.0f} %",
        )


def _peaks(values: Array) -> Pair:
    azimuth, elevation = np.abs(values).max(axis=0).tolist()
    return azimuth, elevation


def _closest(
    limits: AxisLimits, low: float, high: float, bottom: float, top: float, names: tuple[str, str]
) -> tuple[str, float]:
    """Return the limit that the motion comes nearest to, and the margin (negative: past it)."""
    (left, down), (right, up) = limits.lowest_rad, limits.highest_rad
    margins = {
        f"{names[0]} {math.degrees(left):.1f} deg": low - left,
        f"{names[0]} {math.degrees(right):.1f} deg": right - high,
        f"{names[1]} {math.degrees(down):.1f} deg": bottom - down,
        f"{names[1]} {math.degrees(up):.1f} deg": up - top,
    }
    name = min(margins, key=lambda key: margins[key])
    return name, margins[name]


def _reasons_against(closest: str, margin: float, above: float, sun: float, machine: MachineParams) -> tuple[str, ...]:
    found = []
    if margin < 0.0:
        found.append(f"{-math.degrees(margin):.3f} deg past the limit {closest}")
    if above < 0.0:
        found.append(f"{-math.degrees(above):.3f} deg below the horizon mask")
    least = machine.sun_radius_rad + SUN_CLEARANCE_RAD
    if machine.sun_radius_rad > 0.0 and sun < SUN_CLEARANCE_RAD:
        near = math.degrees(sun + machine.sun_radius_rad)
        found.append(f"{near:.3f} deg from the Sun, must be >= {math.degrees(least):.3f} deg (sun.radius_deg)")
    return tuple(found)


def branch_cost(branch: Branch) -> tuple[object, ...]:
    """Return the order of branches.

    It works; least past a limit, fewest reasons; least signal lost, to 0.1 s; then the least time
    to get there and to unwind.
    """
    distance = max(0.0, -branch.limit_margin_rad)
    return (
        not branch.works, distance, len(branch.reasons), round(branch.lost_signal_s + branch.late_s, 1),
        round(branch.preposition_s + branch.unwind_s, 6),  # equally long ones keep their order
    )  # fmt: skip
