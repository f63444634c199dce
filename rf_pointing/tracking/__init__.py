"""How far the target is off the beam, and what to do about it: monopulse, conscan, search and the autotrack table."""

from rf_pointing.tracking.autotrack import (
    TRANSITIONS,
    Autotrack,
    AutotrackInputs,
    AutotrackParams,
    AutotrackState,
    transition_diagram,
    transition_table,
)
from rf_pointing.tracking.conscan import ConscanState, ConscanTracker
from rf_pointing.tracking.conscan_delay import DelayEstimate, DelayEstimator, DelayParams, DelayState
from rf_pointing.tracking.conscan_design import (
    ScanDesign,
    ScanDesignParams,
    design_scan,
    radius_for_loss_rad,
    scan_for_accuracy,
)
from rf_pointing.tracking.conscan_equations import (
    conscan_loss,
    conscan_sigma_eq20_rad,
    conscan_sigma_eq21_rad,
    conscan_sigma_eq23_rad,
    conscan_sigma_eq25_rad,
    conscan_slope,
)
from rf_pointing.tracking.conscan_likelihood import BeamDesign, LikelihoodFit, beam_design, fit_beam
from rf_pointing.tracking.conscan_linear import ConscanEstimate, linear_errors_rad, linear_estimate
from rf_pointing.tracking.conscan_parameters import ConscanParams
from rf_pointing.tracking.conscan_window import ConscanWindow
from rf_pointing.tracking.lock_watch import LockWatch, LockWatchState
from rf_pointing.tracking.lock_watch_parameters import LockWatchParams
from rf_pointing.tracking.monopulse import MonopulseParams, MonopulseTracker
from rf_pointing.tracking.monopulse_calibration import MonopulseCalibration
from rf_pointing.tracking.monopulse_scan import (
    CalibrationFit,
    MonopulseCalibrator,
    MonopulseScanParams,
    MonopulseScanState,
)
from rf_pointing.tracking.scan import Offset, ScanParams, circle_offset
from rf_pointing.tracking.spin import spin_columns, spin_period_s
from rf_pointing.tracking.spiral import SpiralParams, SpiralSearch
from rf_pointing.tracking.steptrack import StepTracker, StepTrackParams, StepTrackState
from rf_pointing.tracking.strip_search import StripOffset, StripSearch
from rf_pointing.tracking.trim import SkyMotion, Trim, TrimFilter, TrimParams, TrimState, direction_rows

__all__ = [
    "TRANSITIONS",
    "Autotrack",
    "AutotrackInputs",
    "AutotrackParams",
    "AutotrackState",
    "BeamDesign",
    "CalibrationFit",
    "ConscanEstimate",
    "ConscanParams",
    "ConscanState",
    "ConscanTracker",
    "ConscanWindow",
    "DelayEstimate",
    "DelayEstimator",
    "DelayParams",
    "DelayState",
    "LikelihoodFit",
    "LockWatch",
    "LockWatchParams",
    "LockWatchState",
    "MonopulseCalibration",
    "MonopulseCalibrator",
    "MonopulseParams",
    "MonopulseScanParams",
    "MonopulseScanState",
    "MonopulseTracker",
    "Offset",
    "ScanDesign",
    "ScanDesignParams",
    "ScanParams",
    "SkyMotion",
    "SpiralParams",
    "SpiralSearch",
    "StepTrackParams",
    "StepTrackState",
    "StepTracker",
    "StripOffset",
    "StripSearch",
    "Trim",
    "TrimFilter",
    "TrimParams",
    "TrimState",
    "beam_design",
    "circle_offset",
    "conscan_loss",
    "conscan_sigma_eq20_rad",
    "conscan_sigma_eq21_rad",
    "conscan_sigma_eq23_rad",
    "conscan_sigma_eq25_rad",
    "conscan_slope",
    "design_scan",
    "direction_rows",
    "fit_beam",
    "linear_errors_rad",
    "linear_estimate",
    "radius_for_loss_rad",
    "scan_for_accuracy",
    "spin_columns",
    "spin_period_s",
    "transition_diagram",
    "transition_table",
]
