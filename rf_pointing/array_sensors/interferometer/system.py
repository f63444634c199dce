"""The interferometer that source and tracker both know: arrays, carriers and their schedule.

Arrays: element 0 sits in the centre, elements 1, 2, 3 on a circle of the array's radius, 120 deg
apart, in the y-z plane (PI83 eqs. 2-6 to 2-13).  A two-way range is the path out from the active
centre to the passive centre and back from passive element j to active element i:
R_ij = rho_ij + rho_00 + delay, eq. (3-1).

Carriers: f_1, f_1 + f0, f_1 + nu f0, ... f_1 + nu^(K-2) f0 on both links, shifted by the
transponder's fixed offset (eq. 7-1, listing FCOMP).  The phase back at the active array is
phi = (2 pi/c)(fF rho_00 + fR rho_ij), eq. (7-7); that of a difference against carrier 1 is exactly
(2 pi/c) f_n1 R_ij, because both links are shifted alike.

Schedule: one carrier after the other, so a moving target shifts their phases.  "simultaneous" is
the report's static simulation.  "ascending" sends f1 ... fK once: a path rate w looks like a range
offset kappa w with kappa = 5 s, so millimetres per second cost centimetres.  "nested" sends
f2 ... fK-1, f1, fK and the same backwards: every carrier has the same mean time and kappa is zero.
f1 and fK, which make the range, lie innermost, so an acceleration hardly matters either.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.rotations import cross_product
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, VARIANTS, is_published
from rf_pointing.core import Params, parameter
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.types import Array

ORDERS = ("simultaneous", "ascending", "nested")


@dataclass(frozen=True, kw_only=True)
class ArrayParams(Params):
    """Sizes of the two arrays and the transponder's delay, known from calibration."""

    radius_active_m: float = parameter(
        1.0, "circle of the active array's three elements", low=1e-3, high=100.0
    )
    radius_passive_m: float = parameter(
        1.0, "circle of the passive array's three elements", low=1e-3, high=100.0
    )
    transponder_delay_m: float = parameter(
        0.0, "transponder and cable delay, as a length of path", low=0.0
    )

    def swapped(self) -> "ArrayParams":
        """Return the same system with the two arrays exchanged, for the reverse direction."""
        return self.replace(
            radius_active_m=self.radius_passive_m, radius_passive_m=self.radius_active_m
        )


def element_positions(radius_m: float) -> Array:
    """Return elements 0 to 3 in their own array's frame, (4, 3) (PI83 eqs. 2-6 to 2-9)."""
    # Element 1 is up (z points down), 2 is left, 3 is right of the centre.
    half_root3 = math.sqrt(3.0) / 2.0
    unit = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -half_root3, 0.5], [0.0, half_root3, 0.5]]
    return radius_m * np.array(unit)


def path_vectors(position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams) -> Array:
    """Return r + A^T p_j - a_i for all sixteen pairs, (..., 4, 4, 3), in the active frame.

    Parameters: `position_m` (..., 3) of the passive centre, `attitude` A (..., 3, 3).
    """
    active = element_positions(arrays.radius_active_m)
    passive = element_positions(arrays.radius_passive_m) @ np.asarray(attitude, dtype=np.float64)
    ends = np.asarray(position_m, dtype=np.float64)[..., None, :] + passive
    return ends[..., None, :, :] - active[:, None, :]


def path_lengths(position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams) -> Array:
    """Return the sixteen one-way lengths rho_ij, (..., 4, 4).

    Active element i, passive element j (listing PATH2).
    """
    return np.asarray(np.linalg.norm(path_vectors(position_m, attitude, arrays), axis=-1))


def two_way_ranges(position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams) -> Array:
    """Return the nine two-way ranges R_ij, (..., 3, 3) (PI83 eq. 3-1, listing PATHES)."""
    lengths = path_lengths(position_m, attitude, arrays)
    return lengths[..., 1:, 1:] + lengths[..., :1, :1] + arrays.transponder_delay_m


def path_rates_m_s(
    position_m: ArrayLike,
    velocity_m_s: ArrayLike,
    attitude: ArrayLike,
    rate_rad_s: ArrayLike,
    arrays: ArrayParams,
) -> Array:
    """Return d rho_ij/dt of all sixteen pairs, (..., 4, 4): u_ij . (v + A^T (omega x p_j))."""
    vectors = path_vectors(position_m, attitude, arrays)
    # A length changes only by the motion along it: the rate is the velocity's part along the path.
    units = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    rate = np.asarray(rate_rad_s, dtype=np.float64)[..., None, :]
    swing = cross_product(rate, element_positions(arrays.radius_passive_m)) @ np.asarray(
        attitude, dtype=np.float64
    )
    moving = np.asarray(velocity_m_s, dtype=np.float64)[..., None, :] + swing
    return np.asarray(np.einsum("...ijk,...jk->...ij", units, moving))


def path_accelerations_m_s2(
    position_m: ArrayLike,
    velocity_m_s: ArrayLike,
    attitude: ArrayLike,
    rate_rad_s: ArrayLike,
    arrays: ArrayParams,
) -> Array:
    """Return d2 rho_ij/dt2 of all sixteen pairs, (..., 4, 4), at constant velocity and rate.

    u_ij . A^T (omega x (omega x p_j)) + (|v_ij|^2 - (u_ij . v_ij)^2)/rho_ij: a path that is crossed
    lengthens although nothing accelerates.
    """
    vectors = path_vectors(position_m, attitude, arrays)
    lengths = np.linalg.norm(vectors, axis=-1)
    turned, rate = (
        np.asarray(attitude, dtype=np.float64),
        np.asarray(rate_rad_s, dtype=np.float64)[..., None, :],
    )
    swing = cross_product(rate, element_positions(arrays.radius_passive_m))
    moving = np.asarray(velocity_m_s, dtype=np.float64)[..., None, :] + swing @ turned
    towards_axis = cross_product(rate, swing) @ turned
    across = (
        np.sum(moving**2, axis=-1)[..., None, :]
        - (np.einsum("...ijk,...jk->...ij", vectors, moving) / lengths) ** 2
    )
    return np.asarray((np.einsum("...ijk,...jk->...ij", vectors, towards_axis) + across) / lengths)


def two_way_gradients(
    position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams
) -> tuple[Array, Array]:
    """Return dR_ij/dr (..., 3, 3, 3) and dR_ij/dtheta (..., 3, 3, 3), last axis x, y, z.

    theta is the frame rotation vector in the passive frame, A = frame_rotation(theta) A0:
    d rho_ij/dtheta = p_j x (A u_ij) with u_ij the unit vector along the path.
    """
    attitude = np.asarray(attitude, dtype=np.float64)
    vectors = path_vectors(position_m, attitude, arrays)
    units = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    seen = np.einsum("...ab,...ijb->...ija", attitude, units[..., 1:, 1:, :])
    turning = cross_product(element_positions(arrays.radius_passive_m)[1:], seen)
    return units[..., 1:, 1:, :] + units[..., :1, :1, :], turning


@dataclass(frozen=True, kw_only=True)
class CarrierPlan(Params):
    """Carriers of both links; the defaults are the report's simulation (listing FCOMP)."""

    count: int = parameter(9, "number of carriers K", low=3, high=25)
    minimum_difference_hz: float = parameter(
        1250.0, "f0, carrier 2 minus carrier 1", low=1.0, high=1e9
    )
    ratio: float = parameter(6.1324, "nu, cycles resolved per step", low=1.01, high=1e4)
    forward_hz: float = parameter(3.0e9, "carrier 1 from active to passive", low=1e6, high=1e12)
    return_hz: float = parameter(2.0e9, "carrier 1 from passive to active", low=1e6, high=1e12)
    # A parameter because the report computes with 3e8 m/s, and its tables are compared to the last
    # digit.
    speed_of_light_m_s: float = parameter(
        SPEED_OF_LIGHT_M_S, "speed of light", low=2.9e8, high=3.1e8
    )
    exponents: str = parameter(
        CORRECTED, "published: first difference nu f0, as (7-1) reads", choices=VARIANTS
    )

    @property
    def offsets_hz(self) -> Array:
        """Carrier n minus carrier 1, (K,)."""
        # As (7-1) reads the first difference is nu f0, which resolves only a range nu times
        # shorter.
        first = 1 if is_published(self.exponents) else 0
        powers = self.ratio ** np.arange(first, first + self.count - 1)
        return np.concatenate([[0.0], self.minimum_difference_hz * powers])

    @property
    def ambiguities_m(self) -> Array:
        """Two-way length of one cycle of each difference against carrier 1, longest first, (K - 1,)
        (eq. 7-17).
        """
        return self.speed_of_light_m_s / self.offsets_hz[1:]

    @property
    def forward_carriers_hz(self) -> Array:
        """Carriers of the forward link, (K,)."""
        return self.forward_hz + self.offsets_hz

    @property
    def return_carriers_hz(self) -> Array:
        """Carriers of the return link, (K,)."""
        return self.return_hz + self.offsets_hz

    @property
    def forward_wave_rad_m(self) -> Array:
        """Phase per metre of forward path, (K,) (eq. 7-6)."""
        return 2.0 * np.pi * self.forward_carriers_hz / self.speed_of_light_m_s

    @property
    def return_wave_rad_m(self) -> Array:
        """Phase per metre of return path, (K,) (eq. 7-6)."""
        return 2.0 * np.pi * self.return_carriers_hz / self.speed_of_light_m_s


@dataclass(frozen=True, kw_only=True)
class Schedule(Params):
    """Order of the carriers and how long each is on.

    The measurement's epoch is the middle of the sequence.
    """

    order: str = parameter("nested", "order of transmission", choices=ORDERS)
    dwell_s: float = parameter(0.1, "time on one carrier (PI83: 0.1 to 0.5 s)", low=1e-3, high=10.0)

    def carriers(self, plan: CarrierPlan) -> NDArray[np.intp]:
        """Return the carrier index of each slot, (S,)."""
        up = np.arange(plan.count)
        if self.order != "nested":
            return up
        # Carriers 1 and K in the middle: their mean time from the epoch, and its square, are
        # smallest.
        inward = np.concatenate([up[1:-1], up[:1], up[-1:]])
        return np.concatenate([inward, inward[::-1]])

    def offsets_s(self, plan: CarrierPlan) -> Array:
        """Return the middle of each slot relative to the epoch, (S,)."""
        slots = len(self.carriers(plan))
        if self.order == "simultaneous":
            return np.zeros(slots)
        return np.asarray((np.arange(slots) - 0.5 * (slots - 1)) * self.dwell_s, dtype=np.float64)

    def duration_s(self, plan: CarrierPlan) -> float:
        """Return the length of the whole sequence."""
        return self.dwell_s * (1 if self.order == "simultaneous" else len(self.carriers(plan)))

    def mean_offset_powers(self, plan: CarrierPlan, power: int) -> Array:
        """Return the mean over each carrier's slots of (time from the epoch)^power, (K,)."""
        carriers, offsets = self.carriers(plan), self.offsets_s(plan)
        return np.bincount(carriers, weights=offsets**power) / np.bincount(carriers)


def range_rate_lever_s(schedule: Schedule, plan: CarrierPlan) -> float:
    """Return kappa: the range error per error of the path rate w used to bring phases to the epoch.

    kappa = (f_TK tau_K - f_T1 tau_1)/f_K1, f_T the mean of both links' frequencies, tau the
    carriers' mean times.
    """
    return _lever(schedule, plan, 1)


def range_acceleration_lever_s2(schedule: Schedule, plan: CarrierPlan) -> float:
    """Return the range error per path acceleration during the sequence, half the lever of tau^2."""
    return 0.5 * _lever(schedule, plan, 2)


def _lever(schedule: Schedule, plan: CarrierPlan, power: int) -> float:
    mean_hz = 0.5 * (plan.forward_carriers_hz + plan.return_carriers_hz)
    moments = mean_hz * schedule.mean_offset_powers(plan, power)
    return float((moments[-1] - moments[0]) / plan.offsets_hz[-1])


@dataclass(frozen=True, kw_only=True)
class InterferometerSystem:
    """Arrays, frequency plan and transmission schedule of one interferometer."""

    arrays: ArrayParams = field(default_factory=ArrayParams)
    plan: CarrierPlan = field(default_factory=CarrierPlan)
    schedule: Schedule = field(default_factory=Schedule)
