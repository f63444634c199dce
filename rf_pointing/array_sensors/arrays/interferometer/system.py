"""What source and tracker both know: the arrays, the carriers and their timing."""

from dataclasses import dataclass, field

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams
from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.array_sensors.arrays.interferometer.schedule import Schedule

__all__ = ["InterferometerSystem"]


@dataclass(frozen=True, kw_only=True)
class InterferometerSystem:
    """Arrays, frequency plan and transmission schedule of one interferometer."""

    arrays: ArrayParams = field(default_factory=ArrayParams)
    plan: CarrierPlan = field(default_factory=CarrierPlan)
    schedule: Schedule = field(default_factory=Schedule)
