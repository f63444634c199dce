"""The drives by name: those of this package, and those that register an entry point.

A package of one's own registers a factory in its setup.cfg, which takes `DriveParams`:

    [options.entry_points]
    rf_pointing.drives =
        my_dish = my_package.my_dish:make_drive
"""

import math

from rf_pointing.core import Pair, one_of
from rf_pointing.core.lazy import installed
from rf_pointing.drives.drive import Drive
from rf_pointing.drives.params import DriveParams
from rf_pointing.drives.protocols import PROTOCOLS, protocol_of

ENTRY_POINTS = "rf_pointing.drives"
SIMULATED_ROTATOR = "simulated_rotator"
SIMULATED = ("simulated", SIMULATED_ROTATOR)
"""Drives that need no device: they move in whatever time the graph has."""


def known_types() -> list[str]:
    """Return the names of the drives that `make_drive` can make here."""
    return [SIMULATED_ROTATOR, *PROTOCOLS, *installed(ENTRY_POINTS)]


def takes_positions(kind: str) -> bool:
    """Whether a drive of this package takes positions; one of an entry point says so itself."""
    return kind == SIMULATED_ROTATOR or kind in PROTOCOLS


def simulated(params: DriveParams) -> DriveParams:
    """Return the drive of a simulation of the antenna: no simulation connects to a device."""
    if params.type not in PROTOCOLS:
        return params if params.type == SIMULATED_ROTATOR else params.replace(type="simulated")
    protocol = map(math.radians, protocol_of(params.type, params.model).resolution_deg)
    rows = zip(params.rotator.resolution_rad, protocol, strict=True)
    rotator = params.rotator.replace(resolution_rad=tuple(own or theirs for own, theirs in rows))
    return params.replace(type=SIMULATED_ROTATOR, rotator=rotator)


def make_drive(params: DriveParams, start_rad: Pair = (0.0, 0.0)) -> Drive:
    """Return the drive of the parameters; a simulated one begins at `start_rad`.

    ValueError for a type or model that does not exist, and what an entry point's factory refuses.
    """
    if params.type == SIMULATED_ROTATOR:
        from rf_pointing.drives.simulated_rotator import SimulatedRotator

        return SimulatedRotator(params, start_rad)
    if params.type in PROTOCOLS:
        from rf_pointing.drives.polled import PolledDrive

        return PolledDrive(protocol_of(params.type, params.model), params)
    if point := installed(ENTRY_POINTS).get(params.type):
        made: Drive = point.load()(params)
        return made
    if params.type in ("simulated", "topic"):
        makers = "antenna_servo, and topic by check_drive --namespace"
        raise ValueError(f"drive.type={params.type!r} is made by {makers}")
    known = one_of(params.type, ("simulated", "topic", *known_types()))
    raise ValueError(f"drive.type={params.type!r} must be {known}")
