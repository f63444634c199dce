"""Antenna drives: what a control unit needs of one, the protocols of controllers, and rotators."""

from rf_pointing.drives.drive import Capabilities, Drive, DriveReading
from rf_pointing.drives.params import DriveParams, LinkParams, RotatorParams
from rf_pointing.drives.registry import ENTRY_POINTS, SIMULATED, known_types, make_drive, simulated, takes_positions
from rf_pointing.drives.rotator import MoveCounts, Rotator
from rf_pointing.drives.simulated_rotator import RotatorModel, SimulatedRotator

__all__ = [
    "ENTRY_POINTS",
    "SIMULATED",
    "Capabilities",
    "Drive",
    "DriveParams",
    "DriveReading",
    "LinkParams",
    "MoveCounts",
    "Rotator",
    "RotatorModel",
    "RotatorParams",
    "SimulatedRotator",
    "known_types",
    "make_drive",
    "simulated",
    "takes_positions",
]
