"""Parameters of the pointing controller: timing, tolerances, and the tree of all its sets.

The names of the tree's fields are the prefixes of the ROS parameters and the keys of the YAML
files.
"""

import math
from dataclasses import dataclass

from rf_pointing.controllers import TrackerIntegratorParams
from rf_pointing.core import Kinematics, Params, parameter
from rf_pointing.ephemeris.solar import SunParams
from rf_pointing.planning import AxisLimits, GateParams, HorizonMask, MachineParams
from rf_pointing.rf import LinkParams
from rf_pointing.rf.dish_array import DishArrayParams
from rf_pointing.station.pointing.antenna_watch import AntennaWatchParams
from rf_pointing.tracking import AutotrackParams, LockWatchParams, MonopulseScanParams, SpiralParams, TrimParams
from rf_pointing.tracking.power_tracker import PowerTrackerParams


@dataclass(frozen=True, kw_only=True)
class PointingParams(Params):
    """Timing of the commands and tolerances of the controller."""

    period_s: float = parameter(0.1, "time between two trajectories", 0.02, 2.0)
    transport_s: float = parameter(0.1, "first commanded point after the issue", 0.0, 2.0)
    horizon_s: float = parameter(1.0, "last commanded point after the issue", 0.2, 10.0)
    on_target_rad: float = parameter(math.radians(0.05), "axis error below which the slew is over", 1e-6, 0.1)
    error_age_s: float = parameter(0.5, "age from which a sensed error is not used", 0.05, 10.0)
    stop_deceleration_rad_s2: float = parameter(math.radians(0.5), "deceleration of a controlled stop", 1e-5, 1.0)
    lag_averaging_s: float = parameter(
        0.0, "time in which the lags of the mount build up after a start from rest (0: at once)", 0.0, 100.0
    )

    def check_together(self) -> None:
        """Refuse a horizon that ends too early, and first points off the grid of periods.

        On the grid, the first point of one period is the direction that the axes are compared with
        at a later one.
        """
        # Off the grid the axes would be compared with a direction that was never commanded.
        periods = self.transport_s / self.period_s
        if round(periods) < 1 or abs(periods - round(periods)) > 1e-6:
            raise ValueError(f"transport_s={self.transport_s} must be a whole number of period_s={self.period_s}")
        if self.horizon_s < self.transport_s + 2.0 * self.period_s:
            raise ValueError(
                f"horizon_s={self.horizon_s} must be >= transport_s + 2 period_s = {self.transport_s + 2 * self.period_s}"
            )


@dataclass(frozen=True, kw_only=True)
class AlarmParams(Params):
    """From when on a target that is not held is reported on /diagnostics."""

    lost_warning_s: float = parameter(1.0, "time without the target that is a warning", 0.0, 3600.0)
    lost_error_s: float = parameter(20.0, "time without the target that is an error", 0.0, 3600.0)

    ordered = ("lost_error_s >= lost_warning_s",)


@dataclass(frozen=True, kw_only=True)
class ControllerParams(PowerTrackerParams):
    """Everything that the pointing controller is configured with, one set per concern.

    The scans are those of the tracker that measures on them.
    """

    pointing: PointingParams = parameter(PointingParams(), "timing of the commands, tolerances")
    axes: AntennaWatchParams = parameter(AntennaWatchParams(), "watch over the axes")
    alarm: AlarmParams = parameter(AlarmParams(), "when a lost target is reported")
    limits: AxisLimits = parameter(AxisLimits(), "travel of the axes")
    autotrack: AutotrackParams = parameter(AutotrackParams(), "thresholds and times of the state table")
    integrator: TrackerIntegratorParams = parameter(TrackerIntegratorParams(), "tracking loop")
    spiral: SpiralParams = parameter(SpiralParams(), "search pattern")
    machine: MachineParams = parameter(MachineParams(), "what the axes can do, for the certificate")
    mask: HorizonMask = parameter(HorizonMask(), "horizon of the site")
    kinematics: Kinematics = parameter(Kinematics(), "how the axes lie")
    calibration: MonopulseScanParams = parameter(MonopulseScanParams(), "calibration scan of the feed")
    trim: TrimParams = parameter(TrimParams(), "filter of the ephemeris error")
    watch: LockWatchParams = parameter(LockWatchParams(), "watch on the monopulse lock")
    link: LinkParams = parameter(LinkParams(), "carrier to expect")
    array: DishArrayParams = parameter(DishArrayParams(), "array on the dish, for the certificate")
    gate: GateParams = parameter(GateParams(), "safety gate")
    sun: SunParams = parameter(SunParams(), "site from which the Sun is computed")


LIVE: dict[str, bool | tuple[str, ...]] = {
    "axes": True, "alarm": True, "limits": True, "autotrack": True,
    "pointing": ("on_target_deg", "error_age_s", "stop_deceleration_deg_s2", "lag_averaging_s"),
}  # fmt: skip
"""Parameters that may change while the controller works, by edge names; timing may not."""
