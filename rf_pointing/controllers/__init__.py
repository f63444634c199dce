"""What to command: trajectory buffer, command preprocessor, position loop with feedforward and notch, RF integrator."""

from rf_pointing.controllers.command_preprocessor import (
    CommandPreprocessor,
    CommandPreprocessorParams,
    CommandPreprocessorState,
)
from rf_pointing.controllers.law_matrices import LawMatrices, law_matrices
from rf_pointing.controllers.lqg_design import LqgDesign, LqgWeights
from rf_pointing.controllers.lqg_file import load_lqg_designs, save_lqg_designs
from rf_pointing.controllers.lqg_loop import LqgLoop, LqgLoopParams, LqgLoopState
from rf_pointing.controllers.notch import Notch, NotchParams, NotchState
from rf_pointing.controllers.oscillation_detector import (
    OscillationDetector,
    OscillationDetectorParams,
    OscillationDetectorState,
)
from rf_pointing.controllers.position_loop import PositionLoop, PositionLoopParams, PositionLoopState
from rf_pointing.controllers.presets import TUNED_RADIO_BANDWIDTH_HZ, dss13_loops, dss13_lqg_loops
from rf_pointing.controllers.rate_feedforward import FeedforwardState, RateFeedforward
from rf_pointing.controllers.section import Section, SectionParams, SectionState, filter_sample, section_matrices
from rf_pointing.controllers.tracker_integrator import (
    TrackerIntegrator,
    TrackerIntegratorParams,
    TrackerIntegratorState,
)
from rf_pointing.controllers.trajectory_buffer import (
    TrajectoryAnswer,
    TrajectoryBuffer,
    TrajectoryBufferParams,
    TrajectorySample,
)

__all__ = [
    "TUNED_RADIO_BANDWIDTH_HZ",
    "CommandPreprocessor",
    "CommandPreprocessorParams",
    "CommandPreprocessorState",
    "FeedforwardState",
    "LawMatrices",
    "LqgDesign",
    "LqgLoop",
    "LqgLoopParams",
    "LqgLoopState",
    "LqgWeights",
    "Notch",
    "NotchParams",
    "NotchState",
    "OscillationDetector",
    "OscillationDetectorParams",
    "OscillationDetectorState",
    "PositionLoop",
    "PositionLoopParams",
    "PositionLoopState",
    "RateFeedforward",
    "Section",
    "SectionParams",
    "SectionState",
    "TrackerIntegrator",
    "TrackerIntegratorParams",
    "TrackerIntegratorState",
    "TrajectoryAnswer",
    "TrajectoryBuffer",
    "TrajectoryBufferParams",
    "TrajectorySample",
    "dss13_loops",
    "dss13_lqg_loops",
    "filter_sample",
    "law_matrices",
    "load_lqg_designs",
    "save_lqg_designs",
    "section_matrices",
]
