"""What to command: trajectory buffer, command preprocessor, position loop with feedforward and notch, RF integrator."""

from rf_pointing.controllers.command_preprocessor import (
    CommandPreprocessor,
    CommandPreprocessorParams,
    CommandPreprocessorState,
)
from rf_pointing.controllers.notch import Notch, NotchParams, NotchState
from rf_pointing.controllers.position_loop import PositionLoop, PositionLoopParams, PositionLoopState
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
    "CommandPreprocessor",
    "CommandPreprocessorParams",
    "CommandPreprocessorState",
    "Notch",
    "NotchParams",
    "NotchState",
    "PositionLoop",
    "PositionLoopParams",
    "PositionLoopState",
    "TrackerIntegrator",
    "TrackerIntegratorParams",
    "TrackerIntegratorState",
    "TrajectoryAnswer",
    "TrajectoryBuffer",
    "TrajectoryBufferParams",
    "TrajectorySample",
]
