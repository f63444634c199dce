"""When each carrier is on the air: one after the other, so that a moving target shifts their phases.

"simultaneous" is the report's static simulation.  "ascending" sends f1 ... fK once: a path rate w looks like a range
offset kappa w with kappa = 5 s, so millimetres per second cost centimetres.  "nested" sends f2 ... fK-1, f1, fK and the
same backwards: every carrier has the same mean time, kappa is zero, and as f1 and fK, which make the range, lie
innermost, an acceleration hardly matters either.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.core import Params, parameter

__all__ = ["Schedule", "range_acceleration_lever_s2", "range_rate_lever_s"]

Array = NDArray[np.float64]
ORDERS = ("simultaneous", "ascending", "nested")


@dataclass(frozen=True, kw_only=True)
class Schedule(Params):
    """Order of the carriers and how long each is on; the measurement's epoch is the middle of the sequence."""

    order: str = parameter("nested", "order of transmission", choices=ORDERS)
    dwell_s: float = parameter(0.1, "time on one carrier (PI83: 0.1 to 0.5 s)", low=1e-3, high=10.0)

    def carriers(self, plan: CarrierPlan) -> NDArray[np.intp]:
        """Return the carrier index of each slot, (S,)."""
        up = np.arange(plan.count)
        if self.order != "nested":
            return up
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

    kappa = (f_TK tau_K - f_T1 tau_1)/f_K1, f_T the mean of both links' frequencies, tau the carriers' mean times.
    """
    return _lever(schedule, plan, 1)


def range_acceleration_lever_s2(schedule: Schedule, plan: CarrierPlan) -> float:
    """Return the range error per path acceleration during the sequence, half the lever of tau^2."""
    return 0.5 * _lever(schedule, plan, 2)


def _lever(schedule: Schedule, plan: CarrierPlan, power: int) -> float:
    mean_hz = 0.5 * (plan.forward_carriers_hz + plan.return_carriers_hz)
    moments = mean_hz * schedule.mean_offset_powers(plan, power)
    return float((moments[-1] - moments[0]) / plan.offsets_hz[-1])
