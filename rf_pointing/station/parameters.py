"""Parameter sets of single nodes, without ROS, and those of the controller.

The sets of the station's parts are declared where they are used; `derive/nodes.py` puts together
what each node has.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rf_pointing.core.parameters import Params, parameter

if TYPE_CHECKING:
    from rf_pointing.station.description import StationDescription
    from rf_pointing.station.pointing.controller import WiderBand
    from rf_pointing.station.pointing.params import ControllerParams


@dataclass(frozen=True, kw_only=True)
class CommandKeyParams(Params):
    """Where the key of the commands is."""

    command_key_file: str = parameter(
        "", "file with the key that signs commands and calls; made if missing; empty: not signed"
    )


@dataclass(frozen=True, kw_only=True)
class FileParams(Params):
    """Where the calibration is kept."""

    calibration_file: str = parameter("", "file of the feed's calibration; empty: none")


@dataclass(frozen=True, kw_only=True)
class ReceiverSeed(Params):
    """Seed, which differs from run to run."""

    seed: int = parameter(1, "seed of every noise source", 0, 2**31 - 1)


@dataclass(frozen=True, kw_only=True)
class ViewParams(Params):
    """Things that are drawn, and how often."""

    publish_tf: bool = parameter(
        True, "whether robot_description and the joints' transforms are published; false for robot_state_publisher"
    )
    radius_m: float = parameter(
        0.0, "radius of the sphere on which directions are drawn; 0: three diameters of the antenna", 0.0, 1e5
    )
    period_s: float = parameter(0.2, "time between two drawings of beam, target and Sun", 0.2, 10.0)


def wider_band(
    station: "StationDescription", band: str, changes: Mapping[str, Mapping[str, object]] | None = None
) -> "WiderBand | None":
    """Return the band in which uncertain targets of a band are acquired, None for none."""
    from rf_pointing.station.pointing.controller import WiderBand
    from rf_pointing.station.pointing.params import ControllerParams

    name = station.content.bands[band].acquisition_band
    if not name:
        return None
    sets = station.sets("pointing_controller", name, (changes or {}).get("pointing_controller"))
    return WiderBand(own=band, name=name, params=ControllerParams(**sets), sensors=station.sensors(name))


def controller_params(station: "StationDescription", band: str | None = None) -> "ControllerParams":
    """Return the parameter sets of the pointing controller; the default band if None."""
    from rf_pointing.station.pointing.params import ControllerParams

    return ControllerParams(**station.sets("pointing_controller", band))
