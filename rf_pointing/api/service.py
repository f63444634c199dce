"""Services of a station: satellites that stay, bodies and radio sources, held without an end."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.core import KeptState, Pair
from rf_pointing.ephemeris import SolarDirection, TopocentricTrack
from rf_pointing.station.service.keeper import Service, ServiceDesk, ServiceParams
from rf_pointing.station.service.sidereal import SIDEREAL_DAY_S, SiderealMotion

# A target whose directions of a day lie within this of each other stays; others rise and set.
STAYS_RAD = math.radians(20.0)
ELEMENTS_SIGMA_RAD, SEEDS = math.radians(0.03), 49
# Mount errors at the direction of a satellite, before they are learned, in beamwidths.
MOUNT_BEAMS = 0.3
# What was learned of a satellite longer ago says little of it.
LONGEST_MEMORY_S = 60.0 * 86400.0


def make_desk(
    station: Station, targets: Sequence[Target], hours: Sequence[float], t_s: float, state: Path | str = ""
) -> ServiceDesk:
    """Return the services of targets from these hours of the day on, as they are at `t_s`.

    A satellite that stays is held by a model of its daily motion, which begins with its elements
    and does not need them again.  Raises ValueError for a target without a direction at `t_s`.
    """
    kept = KeptState(str(state))
    known = kept.recover()
    services = [make_service(station, each, t_s, known.get(each.name)) for each in targets]
    return ServiceDesk(services, hours, kept)


def make_service(station: Station, target: Target, t_s: float, kept: dict[str, Any] | None = None) -> Service:
    """Return the service of one target; `kept` is what was learned of it before."""
    station.description.require_mount("a service")
    track, width_rad = station.track_of(target), station.controller.machine.half_power_beamwidth_rad
    sun = SolarDirection(station.controller.sun).at
    if kept and t_s - float(kept.get("t_s", 0.0)) < LONGEST_MEMORY_S:
        azimuth, elevation = map(float, kept["base_rad"])
        motion = SiderealMotion(width_rad, MOUNT_BEAMS * width_rad, math.radians(7.0))
        motion.restore(kept)
        if motion.covariance is not None and stays(track, t_s):
            base = azimuth, elevation
            return Service(target.name, ServiceParams(), motion, lambda _t_s: base, sun)
    if not stays(track, t_s):
        motion = SiderealMotion(width_rad, MOUNT_BEAMS * width_rad, 0.1 * width_rad)
        moving = partial(direction, track)
        return Service(target.name, ServiceParams(), motion, moving, sun)
    # From here on the elements are not needed: they would be refused after two weeks.
    first = direction(track, t_s)
    motion = SiderealMotion(width_rad, math.radians(7.0), math.radians(7.0), t_s=t_s)
    times = t_s + np.linspace(0.0, SIDEREAL_DAY_S, SEEDS)
    looks = track.sample(times)
    right = (np.unwrap(looks.azimuth_rad) - looks.azimuth_rad[0]) * math.cos(first[1])
    # Errors of elements are alike all day: together the places say no more than some of them.
    sigma_rad = 0.5 * math.sqrt(SEEDS) * math.hypot(ELEMENTS_SIGMA_RAD, MOUNT_BEAMS * width_rad)
    offsets = np.column_stack([right, looks.elevation_rad - first[1]])
    for place_s, offset in zip(times.tolist(), offsets, strict=True):
        motion.place(place_s, offset, sigma_rad)
    motion.t_s = t_s
    return Service(target.name, ServiceParams(), motion, lambda _t_s: first, sun)


def stays(track: TopocentricTrack, t_s: float) -> bool:
    """Return whether a target hardly moves on the sky within a day."""
    try:
        looks = track.sample(t_s + np.linspace(0.0, SIDEREAL_DAY_S, SEEDS))
    except ValueError:
        return False
    azimuth, elevation = np.unwrap(looks.azimuth_rad), looks.elevation_rad
    across = np.ptp(azimuth) * math.cos(float(elevation.mean()))
    return bool(max(across, np.ptp(elevation)) < STAYS_RAD and elevation.min() > 0.0)


def direction(track: TopocentricTrack, t_s: float) -> Pair:
    """Return the apparent direction of a target."""
    target = track.target_at(t_s)
    return target.azimuth_rad, target.elevation_rad
