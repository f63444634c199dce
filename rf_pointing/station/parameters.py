"""The parameter sets of the nodes as a station description gives them, in radians, without ROS."""

from rf_pointing.core import with_leaves
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from rf_pointing.station.description import StationDescription
from rf_pointing.station.pointing.params import ControllerParams


def controller_params(station: StationDescription, band: str | None = None) -> ControllerParams:
    """Return the parameter sets of the pointing controller; the default band if None."""
    return with_leaves(ControllerParams(), station.parameters("pointing_controller", band))


def antenna_params(station: StationDescription, band: str | None = None) -> AntennaParams:
    """Return the parameter sets of the antenna's control unit; the default band if None."""
    return with_leaves(AntennaParams(), station.parameters("antenna_servo", band))
