"""How far the target is off the beam, and what to do about it: monopulse, conscan, search and the autotrack table."""

from rf_pointing.tracking.autotrack import TRANSITIONS, Autotrack, transition_diagram, transition_table
from rf_pointing.tracking.autotrack_state import AutotrackInputs, AutotrackParams, AutotrackState
from rf_pointing.tracking.conscan import ConscanState, ConscanTracker
from rf_pointing.tracking.conscan_equations import (
    conscan_loss,
    conscan_sigma_eq20_rad,
    conscan_sigma_eq21_rad,
    conscan_sigma_eq23_rad,
    conscan_sigma_eq25_rad,
    conscan_slope,
)
from rf_pointing.tracking.conscan_likelihood import BeamDesign, LikelihoodFit, beam_design, fit_beam
from rf_pointing.tracking.conscan_parameters import ConscanParams
from rf_pointing.tracking.monopulse import MonopulseParams, MonopulseTracker
from rf_pointing.tracking.monopulse_calibration import MonopulseCalibration
from rf_pointing.tracking.scan import Offset, ScanParams, circle_offset
from rf_pointing.tracking.spin import spin_columns, spin_period_s
from rf_pointing.tracking.spiral import SpiralParams, SpiralSearch

__all__ = [
    "TRANSITIONS",
    "Autotrack",
    "AutotrackInputs",
    "AutotrackParams",
    "AutotrackState",
    "BeamDesign",
    "ConscanParams",
    "ConscanState",
    "ConscanTracker",
    "LikelihoodFit",
    "MonopulseCalibration",
    "MonopulseParams",
    "MonopulseTracker",
    "Offset",
    "ScanParams",
    "SpiralParams",
    "SpiralSearch",
    "beam_design",
    "circle_offset",
    "conscan_loss",
    "conscan_sigma_eq20_rad",
    "conscan_sigma_eq21_rad",
    "conscan_sigma_eq23_rad",
    "conscan_sigma_eq25_rad",
    "conscan_slope",
    "fit_beam",
    "spin_columns",
    "spin_period_s",
    "transition_diagram",
    "transition_table",
]
