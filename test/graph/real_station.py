"""A station on the real rotctld, and a satellite that passes over it when a test needs it."""

import math
from pathlib import Path

import numpy as np

from rf_pointing.core import EARTH_MU_M3_S2, EARTH_RADIUS_M, RadioRefraction
from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, tle_lines

HEIGHT_M = 4.2e5
INCLINATION_RAD = math.radians(97.0)
ASIDE_RAD = math.radians(1.5)
"""How far from the site, seen from the Earth's centre, the satellite passes: it peaks at 68 deg."""


def satellite_over(site: Site, culmination_s: float, *, age_s: float = 0.0, number: int = 1) -> Elements:
    """Return elements of a satellite that culminates over a site at a time, about 68 deg high.

    They are `age_s` old then; the first satellite is OVERHEAD, further ones have their `number`.
    """
    epoch_s = culmination_s - age_s
    mean_motion = math.sqrt(EARTH_MU_M3_S2 / (EARTH_RADIUS_M + HEIGHT_M) ** 3)
    # The latitude gives the place on the orbit; the longitude is searched for.
    latitude = site.latitude_rad
    along = math.asin(math.sin(latitude) / math.sin(INCLINATION_RAD)) - mean_motion * age_s

    air = RadioRefraction.standard(site.altitude_m)

    def height(node: float, along: float, t_s: float) -> float:
        one = elements(epoch_s, node, along, mean_motion, number)
        return float(TopocentricTrack(one, site, refraction=air).target_at(t_s).elevation_rad)

    node = max(np.radians(np.arange(360.0)).tolist(), key=lambda each: height(each, along, culmination_s))
    peak_s = culmination_s
    for aside in (0.0, ASIDE_RAD) if age_s else (ASIDE_RAD,):
        # What is old has drifted: its place on the orbit is corrected before the node is found.
        along += mean_motion * (peak_s - culmination_s)
        near = (node + np.radians(np.arange(-1.0, 1.0, 0.05))).tolist()
        node = max(near, key=lambda each: height(each, along, culmination_s)) + aside
        times = (culmination_s + np.arange(-60.0, 60.0, 0.5)).tolist()
        peak_s = max(times, key=lambda t_s: height(node, along, t_s))
    return elements(epoch_s, node, along + mean_motion * (peak_s - culmination_s), mean_motion, number)


def elements(epoch_t_s: float, node: float, anomaly: float, mean_motion: float, number: int) -> Elements:
    return Elements(
        name="OVERHEAD" if number == 1 else f"OVERHEAD {number}", catalogue_number=90999 + number,
        epoch_t_s=epoch_t_s, inclination_rad=INCLINATION_RAD,
        ascending_node_rad=node % (2.0 * math.pi), eccentricity=1e-4, argument_of_perigee_rad=0.0,
        mean_anomaly_rad=anomaly % (2.0 * math.pi), mean_motion_rad_s=mean_motion, drag_per_earth_radius=0.0,
        international_designator="26001A",
    )  # fmt: skip


STATION = Path(__file__).parents[2] / "examples" / "hamlib_rotator.yaml"


def write_station(folder: Path, port: int) -> Path:
    """Write the description of a rotator behind the rotctld of a port, and return the file."""
    path = folder / "real.yaml"
    path.write_text(STATION.read_text().replace("port: 4533", f"port: {port}"))
    return path


def write_elements(folder: Path, site: Site, culmination_s: float) -> Path:
    """Write the elements of a satellite that culminates then, and return the file."""
    one = satellite_over(site, culmination_s)
    path = folder / "overhead.tle"
    path.write_text("\n".join((one.name, *tle_lines(one))) + "\n")
    return path
