"""What to command: table, preprocessor, position laws, radio integrator, oscillation watch."""

from rf_pointing.controllers.command_preprocessor import CommandPreprocessor, CommandPreprocessorParams
from rf_pointing.controllers.law_matrices import LawMatrices, law_matrices
from rf_pointing.controllers.lqg import LqgDesign, LqgLoop, LqgLoopParams, load_lqg_designs
from rf_pointing.controllers.oscillation_detector import OscillationDetector, OscillationDetectorParams
from rf_pointing.controllers.position_loop import PositionLoop, PositionLoopParams
from rf_pointing.controllers.presets import TUNED_RADIO_BANDWIDTH_HZ, dss13_loops, dss13_lqg_loops
from rf_pointing.controllers.tracker_integrator import TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.controllers.trajectory_buffer import TrajectoryBuffer, TrajectoryBufferParams, TrajectorySample

__all__ = [
    "TUNED_RADIO_BANDWIDTH_HZ",
    "CommandPreprocessor",
    "CommandPreprocessorParams",
    "LawMatrices",
    "LqgDesign",
    "LqgLoop",
    "LqgLoopParams",
    "OscillationDetector",
    "OscillationDetectorParams",
    "PositionLoop",
    "PositionLoopParams",
    "TrackerIntegrator",
    "TrackerIntegratorParams",
    "TrajectoryBuffer",
    "TrajectoryBufferParams",
    "TrajectorySample",
    "dss13_loops",
    "dss13_lqg_loops",
    "law_matrices",
    "load_lqg_designs",
]
