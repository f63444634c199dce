"""Covariance of an orbit without data: how well a network would know it before it is built.

    R x + R_c c = z      epoch by epoch in a square-root filter (`square_root`)
    P(t) = Phi P Phi' + (Phi S + dx/dc) C (Phi S + dx/dc)'

The stations measure what `Tracking` says, wherever the satellite is above the lowest elevation.
Estimated are the state, radiation and drag, biases that wander (first-order Gauss-Markov), the
zenith delay of each station, and where ranges are one-way the satellite's clock, white.  What
`Considered` lists is not estimated and spoils the orbit.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import EARTH_RADIUS_M, Array, BoolArray, Params, parameter
from rf_pointing.orbit.determination import Dynamics
from rf_pointing.orbit.forces import EARTH_RATE_RAD_S, Disturbances
from rf_pointing.orbit.measurements import KINDS, StationMotion, measured_from, partials_from
from rf_pointing.orbit.motion import point_mass
from rf_pointing.orbit.square_root import SquareRootFilter


@dataclass(frozen=True, kw_only=True)
class Tracking(Params):
    """Measurements of each station, how good and how often; a sigma of 0 leaves a kind out."""

    angle_sigma_rad: float = parameter(0.0, "noise of each angle, on the sky", 0.0, 0.1)
    angle_bias_rad: float = parameter(1e-4, "bias of each angle", 1e-9, 0.1)
    range_sigma_m: float = parameter(0.0, "noise of a range", 0.0, 1e6)
    range_bias_m: float = parameter(10.0, "bias of the range of a station", 1e-6, 1e7)
    rate_sigma_m_s: float = parameter(0.0, "noise of a range rate", 0.0, 1e3)
    rate_bias_m_s: float = parameter(1.0, "bias of the range rate", 1e-9, 1e6)
    memory_s: float = parameter(43200.0, "time in which biases forget; 0: white", 0.0, 1e12)
    satellite_clock_m: float = parameter(
        0.0, "clock of one-way ranges, white; 0: two-way", 0.0, 1e9
    )
    zenith_delay_m: float = parameter(0.05, "zenith delay of a station", 1e-6, 10.0)
    step_s: float = parameter(60.0, "between two measurements", 1.0, 86400.0)
    lowest_rad: float = parameter(math.radians(5.0), "lowest elevation of a measurement", -0.1, 1.5)

    def check_together(self) -> None:
        """Refuse tracking that measures nothing."""
        if not self.kinds:
            raise ValueError("angle_sigma_rad, range_sigma_m and rate_sigma_m_s are all 0")

    @property
    def kinds(self) -> tuple[tuple[str, float, float], ...]:
        """Measured kinds, with noise and bias of each."""
        every = (
            (KINDS[0], self.angle_sigma_rad, self.angle_bias_rad),
            (KINDS[1], self.angle_sigma_rad, self.angle_bias_rad),
            (KINDS[2], self.range_sigma_m, self.range_bias_m),
            (KINDS[3], self.rate_sigma_m_s, self.rate_bias_m_s),
        )
        return tuple(one for one in every if one[1] > 0.0)


@dataclass(frozen=True, kw_only=True)
class Considered(Params):
    """One-sigma errors of what is not estimated."""

    station_m: float = parameter(0.1, "each coordinate of a station", 0.0, 1e4)
    gm: float = parameter(2e-9, "the Earth's gravitational constant, relative", 0.0, 1e-3)
    pole_m: float = parameter(0.25, "each coordinate of the pole", 0.0, 1e3)
    ut1_s: float = parameter(6e-4, "angle of the Earth, as time", 0.0, 10.0)
    field: float = parameter(1.0, "share of the field beyond its degree", 0.0, 10.0)
    clock_s: float = parameter(0.0, "clock of a station", 0.0, 100.0)


@dataclass(frozen=True, kw_only=True)
class Before(Params):
    """One-sigma knowledge of the estimated parameters before tracking."""

    position_m: float = parameter(5000.0, "each coordinate", 1e-3, 1e9)
    velocity_m_s: float = parameter(50.0, "each component of the velocity", 1e-6, 1e6)
    radiation: float = parameter(0.05, "radiation, relative", 1e-9, 10.0)
    air: float = parameter(0.3, "drag, relative", 1e-9, 10.0)
    burn_m_s: float = parameter(10.0, "each component of a manoeuvre", 1e-6, 1e4)


@dataclass(frozen=True, kw_only=True, eq=False)
class Knowledge:
    """Knowledge of an orbit at times (n,): states and covariances (n, 6, 6), inertial.

    `formal` is of noise and wandering biases alone, `parts` what each kind of consider parameter
    adds.  `tracked` (stations, n) says when which station measured.
    """

    t_s: Array
    states: Array
    formal: Array
    parts: Mapping[str, Array]
    tracked: BoolArray
    names: tuple[str, ...]

    @property
    def total(self) -> Array:
        """Covariance (n, 6, 6) with everything that is considered."""
        return np.asarray(self.formal + sum(self.parts.values()))

    def sigma_m(self, covariance: Array | None = None) -> Array:
        """Return the sigma of position (n,), all three directions; of the total unless given."""
        chosen = self.total if covariance is None else covariance
        return np.asarray(np.sqrt(np.trace(chosen[:, :3, :3], axis1=1, axis2=2)))

    def on_sky(self, motion: StationMotion) -> Array:
        """Return cross-elevation and elevation sigma (n, 2) as seen by a station, rad."""
        partials = partials_from(self.states, motion)[:, :2]
        elevation = measured_from(self.states, motion)[:, 1]
        covariance = partials @ self.total @ np.swapaxes(partials, 1, 2)
        sigmas = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        return np.asarray(sigmas * np.stack([np.cos(elevation), np.ones_like(elevation)], axis=1))


def known_orbit(
    epoch_t_s: float, state: Array, stations: Mapping[str, StationMotion], t_s: Array,
    tracking: Tracking, *, forces: Disturbances, before: Before | None = None,
    considered: Considered | None = None, station_m: Mapping[str, float] | None = None,
    until_t_s: float = math.inf, schedule: BoolArray | None = None, burn_t_s: float | None = None,
) -> Knowledge:  # fmt: skip
    """Return what is known of an orbit at rising times (n,), which are those of measurements.

    Parameters
    ----------
    epoch_t_s, state : inertial state (6,) at UTC, not after the first time.
    stations : their motions at `t_s`, by name.
    station_m : errors of the coordinates of some stations, in place of that of `considered`.
    until_t_s : end of the tracking; what follows is predicted.
    schedule : (n,) at which times there is tracking at all.
    burn_t_s : a manoeuvre whose change of velocity is estimated.

    Raises
    ------
    ValueError
        If no station measures anything, or what is measured does not determine the orbit.
    """
    prior, rest = before or Before(), considered or Considered()
    dynamics = Dynamics(forces=forces, manoeuvre_t_s=burn_t_s)
    start = np.zeros(len(dynamics.names))
    start[:6], start[6] = state, 1.0
    flown, slopes = dynamics.flow(epoch_t_s, start[np.newaxis], t_s)
    states, slopes = flown[0], slopes[0]
    own, dynamic = _moving(dynamics, slopes, states, t_s - epoch_t_s)
    orbit = {**dict.fromkeys(dynamics.names, 0.0)}
    orbit |= dict(
        zip(
            dynamics.names,
            [prior.position_m] * 3 + [prior.velocity_m_s] * 3 + [prior.air],
            strict=False,
        )
    )
    orbit |= dict.fromkeys(dynamics.names[7:], prior.burn_m_s)
    orbit["radiation"] = prior.radiation
    names = [f"{kind} of {name}" for name in stations for kind, _, _ in tracking.kinds]
    # Stochastic parameters lead: they are renewed between epochs.
    wandering = len(names)
    sigmas = [bias for _ in stations for _, _, bias in tracking.kinds]
    if tracking.satellite_clock_m:
        names, sigmas = [*names, "satellite clock"], [*sigmas, tracking.satellite_clock_m]
    fixed = len(names)
    zenith = [f"zenith delay of {name}" for name in stations]
    rows = SquareRootFilter(
        [*names, *orbit, *zenith],
        [*sigmas, *orbit.values(), *[tracking.zenith_delay_m] * len(zenith)],
        considered=len(_EARTH) + 4 * len(stations),
    )
    seen = {name: _Station(motion, states, tracking) for name, motion in stations.items()}
    wanted = (t_s <= until_t_s) & (True if schedule is None else schedule)
    tracked = np.array([one.up & wanted for one in seen.values()])
    if not np.any(tracked):
        raise ValueError(
            f"no station of {', '.join(stations)} sees the satellite while it is tracked"
        )
    last_s = float(t_s[0])
    for k in np.flatnonzero(np.any(tracked, axis=0)).tolist():
        kept = math.exp(-(float(t_s[k]) - last_s) / tracking.memory_s) if tracking.memory_s else 0.0
        if t_s[k] > last_s:
            # A white clock forgets all.
            decay = np.array([kept] * wandering + [0.0] * (fixed - wandering))
            rows.advance(np.arange(fixed), decay, np.array(sigmas) * np.sqrt(1.0 - decay**2))
        last_s = float(t_s[k])
        for number, one in enumerate(seen.values()):
            if tracked[number, k]:
                rows.update(
                    *one.rows(
                        k, number, own[k], dynamic[k], states[k], fixed, len(zenith), tracking
                    )
                )
    estimate = rows.estimate()
    place = slice(fixed, fixed + len(orbit))
    # Errors of the Earth and of stations act through the estimate, those of its field directly too.
    shift = own @ estimate.sensitivity[place]
    shift[..., : len(_EARTH)] += dynamic
    coordinates = [(station_m or {}).get(name, rest.station_m) for name in stations]
    spread = np.array(
        [
            rest.gm, rest.field, rest.ut1_s, rest.pole_m / EARTH_RADIUS_M,
            rest.pole_m / EARTH_RADIUS_M,
        ]
        + [size for each in coordinates for size in (each, each, each, rest.clock_s)]
    )  # fmt: skip
    effect = shift * spread
    kinds = [
        *_EARTH,
        *("clock" if part == 3 else "stations" for _ in stations for part in range(4)),
    ]
    parts = {}
    for kind in dict.fromkeys(kinds):
        column = effect[..., np.array(kinds) == kind]
        parts[kind] = np.asarray(column @ np.swapaxes(column, 1, 2))
    formal = own @ estimate.formal[place, place] @ np.swapaxes(own, 1, 2)
    return Knowledge(
        t_s=t_s, states=states, formal=formal, parts=parts, tracked=tracked, names=tuple(stations)
    )


_EARTH = ("gm", "field", "ut1", "pole", "pole")


def _moving(
    dynamics: Dynamics, slopes: Array, states: Array, elapsed_s: Array
) -> tuple[Array, Array]:
    """Return the partials (n, 6, q) by what is estimated, and (n, 6, 5) by what the Earth is."""
    count = len(dynamics.names)
    own = np.concatenate([slopes[..., :count], slopes[..., count + 1 :]], axis=-1)
    # A larger GM is a faster clock: the same path, with the first velocity scaled down.
    position, velocity = states[:, :3], states[:, 3:]
    passed = 0.5 * elapsed_s[:, np.newaxis]
    gm = (
        np.concatenate([passed * velocity, 0.5 * velocity + passed * point_mass(position)], axis=1)
        - 0.5 * slopes[..., 3:6] @ states[0, 3:]
    )
    earth = np.zeros((len(states), 6, len(_EARTH)))
    earth[..., 0], earth[..., 1] = gm, slopes[..., count]
    return own, earth


class _Station:
    """One station: its measurements of all times, and their rows."""

    def __init__(self, motion: StationMotion, states: Array, tracking: Tracking) -> None:
        self.motion, columns = motion, [KINDS.index(kind) for kind, _, _ in tracking.kinds]
        measured = measured_from(states, motion)
        self.up = measured[:, 1] >= tracking.lowest_rad
        # Below the horizon nothing is measured, and the delay must stay finite.
        sine = np.maximum(np.sin(measured[:, 1]), math.sin(math.radians(0.5)))
        # An azimuth errs by 1 / cos(El) more than the angle on the sky.
        self.sky = np.where(np.array(columns) == 0, 1.0 / np.cos(measured[:, 1:2]), 1.0)
        self.partials = partials_from(states, motion)[:, columns]
        self.delay = np.where(np.array(columns) == 2, 1.0 / sine[:, np.newaxis], 0.0)
        self.ranges = np.where(np.array(columns) == 2, 1.0, 0.0)
        rates = np.zeros((len(states), 4))
        rates[:, 0], rates[:, 1] = motion.angle_rates(states)
        rates[:, 2] = measured[:, 3]
        rates[:, 3] = np.gradient(measured[:, 3])
        self.rates = rates[:, columns]

    def rows(
        self, k: int, number: int, own: Array, dynamic: Array, state: Array, fixed: int,
        stations: int, tracking: Tracking,
    ) -> tuple[Array, float, Array]:  # fmt: skip
        """Return partials, values (0) and partials of what is considered, of unit variance."""
        count = len(tracking.kinds)
        weight = 1.0 / (np.array([noise for _, noise, _ in tracking.kinds]) * self.sky[k])
        partials = np.zeros((count, fixed + own.shape[1] + stations))
        place = number * count
        partials[np.arange(count), place + np.arange(count)] = self.sky[k]
        if tracking.satellite_clock_m:
            partials[:, fixed - 1] = self.ranges
        partials[:, fixed : fixed + own.shape[1]] = self.partials[k] @ own
        partials[:, fixed + own.shape[1] + number] = self.delay[k]
        considered = np.zeros((count, len(_EARTH) + 4 * stations))
        considered[:, : len(_EARTH)] = self.partials[k] @ dynamic
        # A turn of the Earth by UT1 or its pole is one of the satellite the other way.
        axes = self.motion.axes[k]
        for column, axis, rate in ((2, 2, EARTH_RATE_RAD_S), (3, 0, 1.0), (4, 1, 1.0)):
            spin = rate * np.eye(3)[axis]
            turned = np.concatenate([np.cross(spin, state[:3]), np.cross(spin, state[3:])])
            considered[:, column] -= self.partials[k] @ turned
        first = len(_EARTH) + 4 * number
        considered[:, first : first + 3] = -self.partials[k][:, :3] @ axes.T
        considered[:, first + 3] = self.rates[k]
        return partials * weight[:, np.newaxis], 0.0, considered * weight[:, np.newaxis]
