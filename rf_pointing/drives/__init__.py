"""Antenna drives: what a control unit needs of one, the protocols of controllers, and rotators."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.drives.drive import Capabilities, Drive, DriveReading
    from rf_pointing.drives.params import DriveParams, LinkParams, RotatorParams
    from rf_pointing.drives.registry import make_drive, simulated, takes_positions
    from rf_pointing.drives.rotator import Rotator
    from rf_pointing.drives.simulated_rotator import RotatorModel, SimulatedRotator

__getattr__ = lazily(__name__, __file__)
