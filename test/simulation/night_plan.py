"""Two satellites that follow each other through the top of the sky of the 3.7-m dish: a night of minutes."""

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rf_pointing.core.dates import DAY_S, to_utc_text
from rf_pointing.ephemeris import Elements, TopocentricTrack, find_passes
from rf_pointing.operations.schedule import ScheduledPass
from rf_pointing.station.description import StationDescription, read_station

MASK_DEG = 62.0
APART_S = 200.0
EPOCH_S = 1_151_347_200.0


def orbits(count: int) -> list[Elements]:
    """Satellites that follow each other over the station, APART_S from one to the next."""
    first = Elements(
        name="sat 1", catalogue_number=90001, epoch_t_s=EPOCH_S, inclination_rad=math.radians(98.0),
        ascending_node_rad=0.3, eccentricity=0.001, argument_of_perigee_rad=0.0, mean_anomaly_rad=0.0,
        mean_motion_rad_s=2.0 * math.pi / 5900.0, drag_per_earth_radius=0.0,
    )  # fmt: skip
    turn = 2.0 * math.pi * APART_S / 5900.0
    return [
        dataclasses.replace(
            first, name=f"sat {k + 1}", catalogue_number=90001 + k, mean_anomaly_rad=(-k * turn) % (2.0 * math.pi)
        )
        for k in range(count)
    ]


def as_omm(one: Elements) -> dict[str, Any]:
    angles = {"INCLINATION": one.inclination_rad, "RA_OF_ASC_NODE": one.ascending_node_rad,
              "ARG_OF_PERICENTER": one.argument_of_perigee_rad, "MEAN_ANOMALY": one.mean_anomaly_rad}  # fmt: skip
    return {
        "OBJECT_NAME": one.name, "OBJECT_ID": "2000-001A", "EPOCH": to_utc_text(one.epoch_t_s),
        "MEAN_MOTION": one.mean_motion_rad_s * DAY_S / (2.0 * math.pi), "ECCENTRICITY": one.eccentricity,
        **{name: math.degrees(angle) for name, angle in angles.items()},
        "EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": "U", "NORAD_CAT_ID": one.catalogue_number, "ELEMENT_SET_NO": 999,
        "REV_AT_EPOCH": 1, "BSTAR": 0.0, "MEAN_MOTION_DOT": 0, "MEAN_MOTION_DDOT": 0,
    }  # fmt: skip


def plan(station: Any, bands: Sequence[str]) -> tuple[list[Elements], list[ScheduledPass]]:
    """Return the satellites and their passes through the top of the sky."""
    satellites, found = orbits(len(bands)), []
    above = math.radians(MASK_DEG)
    for one, band in zip(satellites, bands, strict=True):
        track = TopocentricTrack(one, station.site)
        begin_s = EPOCH_S if not found else found[-1].aos_t_s - 60.0
        window = next(
            w for w in find_passes(track, begin_s, 3.0 * DAY_S, above) if w.peak_elevation_rad > math.radians(70.0)
        )
        found.append(ScheduledPass(
            id=f"{one.catalogue_number}", target=str(one.catalogue_number), name=one.name, band=band, aos_t_s=window.aos_t_s,
            los_t_s=window.los_t_s, peak_rad=window.peak_elevation_rad, elevation_rad=(above, above),
            azimuth_path_rad=(window.aos_azimuth_rad, window.azimuth_min_rad, window.azimuth_max_rad, window.los_azimuth_rad),
        ))  # fmt: skip
    return satellites, found


def small_night(
    folder: Path, bands: Sequence[str] = ("", ""), name: str = "leo_3m7", **changes: Any
) -> tuple[StationDescription, Path, list[ScheduledPass]]:
    """Write station and elements into `folder`; return both, and the passes."""
    path, elements = folder / "station.yaml", folder / "elements.json"
    # Of a pass of 95 s a scan needs 20 s to acquire the target.
    short = {"mount.pass_elevation_deg": MASK_DEG, "tuning.machine.least_share": 0.6}
    read_station(name).write(path, short | changes)
    station = read_station(path)
    satellites, passes = plan(station, bands)
    elements.write_text(json.dumps([as_omm(one) for one in satellites]))
    return station, elements, passes
