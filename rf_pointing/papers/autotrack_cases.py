"""Short passes of the whole simulated station, one per requirement on the radio loop.

Every case is the station of the graph (`simulation.simulate_pass`): wind, servo, structure,
receiver noise, tracker, state table, trim filter.  Only the subject of the case differs from the
configuration files.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rf_pointing.calibration import read_model
from rf_pointing.core.types import Array
from rf_pointing.ephemeris import Pass, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass
from rf_pointing.station.antenna.mount import MountParams
from rf_pointing.station.antenna.receiver import Reception
from rf_pointing.station.description import read_station

Changes = Mapping[str, Mapping[str, object]]
# The simulated clock starts before the pass, as that of the graph does.
LEAD_S = 5.0
COMMAND_S = 0.1
RADIO_MODES = ("monopulse", "conscan", "steptrack")
LINK_45_DB_HZ = {"link.zenith_carrier_to_noise_db_hz": 45.0, "link.reference_range_m": 1.1e6}
"""45 dB-Hz at about the distance of the satellite at the top of its pass, for the controller."""
KA_45_DB_HZ = {f"signal.{name}": value for name, value in LINK_45_DB_HZ.items()}
"""The same for the receiver."""


@dataclass(frozen=True)
class Case:
    """Band, sensor, seconds from the start of the pass, and changes per node over the configuration
    files.
    """

    band: str
    sensor: str
    seconds: float
    changes: Changes = dataclasses.field(default_factory=dict)
    seed: int = 1


def model_file(band: str) -> Path:
    """Return the pointing model that the station uses in a band."""
    file = read_station("dss13").bias_model_file(band)
    assert file is not None
    return file


def moved_mount(band: str, right_rad: float, up_rad: float) -> dict[str, object]:
    """Return parameters of the antenna whose mount is that of the model but for its collimation and
    elevation offset.

    The beam misses a target that is where its elements say by `right_rad` in cross-elevation and
    `up_rad` in elevation.
    """
    known = read_model(model_file(band)).model
    mount = {
        item.name: known.coefficients[item.name.rsplit("_", 1)[0]]
        for item in dataclasses.fields(MountParams)
    }
    # Collimation moves the beam in cross-elevation by the same angle at every elevation; an azimuth
    # offset would not.
    mount["collimation_rad"] += right_rad
    mount["elevation_offset_rad"] += up_rad
    degrees = {
        name: (name.removesuffix("_rad") + "_deg", math.degrees(value))
        for name, value in mount.items()
    }
    return {
        f"mount.{as_degrees if name.endswith('_rad') else name}": in_degrees
        if name.endswith("_rad")
        else mount[name]
        for name, (as_degrees, in_degrees) in degrees.items()
    }


def low_orbit_pass(peak_deg: float = 40.0, mask_deg: float = 40.0) -> Pass:
    """Return a pass of CBERS-2 over DSS-13 above the mask.

    The default is its top, where the rates are largest.
    """
    source = SourceParams()
    begin_s = load_elements(source).epoch_t_s
    return first_pass_above(
        load_track(source), begin_s, math.radians(peak_deg), math.radians(mask_deg), 2.0 * 86400.0
    )


def fly(case: Case, window: Pass, heard: Callable[[Reception], object] | None = None) -> PassLog:
    """Return the log of a case, at most to the end of the pass.

    `heard` gets everything from the receiver.
    """
    short = dataclasses.replace(window, los_t_s=min(window.aos_t_s + case.seconds, window.los_t_s))
    changes: dict[str, dict[str, object]] = {
        node: dict(values) for node, values in case.changes.items()
    }
    # Start at rest on the first point of the pass: the slew to it is not part of the case.
    changes.setdefault("antenna_servo", {}).update(
        {
            "antenna.start_azimuth_deg": math.degrees(window.aos_azimuth_rad),
            "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
            "antenna.seed": case.seed,
        }
    )
    changes.setdefault("rf_receiver", {})["signal.seed"] = case.seed
    setup = StationSetup("dss13", case.band, changes=changes)
    return simulate_pass(setup, short, math.floor(window.aos_t_s) - LEAD_S, case.sensor, heard)


def first_time_s(log: PassLog, mode: str) -> float:
    """Return the time at which a mode was first entered, infinite if never."""
    return next(
        (t_s for t_s, name in zip(log.t_s, log.mode, strict=True) if name == mode), math.inf
    )


def acquired_s(log: PassLog, within_rad: float) -> float:
    """Return the time from which a radio mode holds the true error below `within_rad` to the end,
    infinite if it never does.
    """
    held = (np.hypot(*log.errors_rad().T) < within_rad) & np.isin(log.mode, RADIO_MODES)
    # From the last loss on: an acquisition that is lost again does not count.
    lost = np.flatnonzero(~held)
    if not len(held) or not held[-1]:
        return math.inf
    return log.t_s[int(lost[-1]) + 1] if len(lost) else log.t_s[0]


def command_accelerations_rad_s2(log: PassLog, from_s: float) -> Array:
    """Return the second differences (n, 2) of the commands of the periods from a time on."""
    late = np.array(log.command_t_s)[1:-1] > from_s
    # Second differences of commands a period apart; the first ones contain the start of the pass.
    found: Array = np.diff(np.array(log.command_rad), 2, axis=0)[late] / COMMAND_S**2
    return found


def reacquisitions_s(log: PassLog, mode: str) -> Array:
    """Return, for every time the carrier came back, how long it took until `mode` tracked again,
    infinite if it never did.

    A dropout that was over before the mode was left took no time.
    """
    level, times = np.array(log.carrier_to_noise_db_hz), np.array(log.t_s)
    # The receiver reports 0 dB-Hz and below while there is no carrier.
    silent = level <= 0.0
    back = times[1:][silent[:-1] & ~silent[1:]]
    tracking = times[np.array(log.mode) == mode]
    return np.array(
        [float(np.min(tracking[tracking >= t_s], initial=math.inf)) - t_s for t_s in back]
    )
