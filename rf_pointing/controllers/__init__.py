"""Command to the axes: table, preprocessor, position laws, radio integrator, oscillation watch."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.controllers.command_preprocessor import CommandPreprocessor, CommandPreprocessorParams
    from rf_pointing.controllers.filters import LawMatrices
    from rf_pointing.controllers.lqg import LqgDesign, LqgLoop, LqgLoopParams, load_lqg_designs
    from rf_pointing.controllers.oscillation_detector import OscillationDetector, OscillationDetectorParams
    from rf_pointing.controllers.position_law import PositionLaw
    from rf_pointing.controllers.position_loop import PositionLoop, PositionLoopParams
    from rf_pointing.controllers.presets import TUNED_RADIO_BANDWIDTH_HZ, dss13_loops, dss13_lqg_loops
    from rf_pointing.controllers.tracker_integrator import TrackerIntegrator, TrackerIntegratorParams
    from rf_pointing.controllers.trajectory_buffer import TrajectoryBuffer, TrajectoryBufferParams, TrajectorySample

__getattr__ = lazily(__name__, __file__)
