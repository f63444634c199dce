"""The satellite and the stations of a pass, as the attitude sensors see them.

The satellite moves by its elements or ephemeris (TLE, OMM, OEM), read as `ephemeris_publisher`
reads them; the stations stand where their descriptions say, on the WGS 84 ellipsoid.  Directions
are geometric: light time turns them by v/c, 1.5 mdeg in a low orbit.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude.ground_stations import (
    GroundNetworkParams,
    GroundPlace,
    SurveyedStation,
    require_names,
)
from rf_pointing.array_sensors.attitude.orbits import Orbit, OrbitPoint
from rf_pointing.core import Params, parameter
from rf_pointing.ephemeris import TargetSource, orbital_axes, orbital_rate_rad_s
from rf_pointing.ephemeris.source import BODIES, SourceParams, load_track
from rf_pointing.station.description import read_station


@dataclass(frozen=True, kw_only=True)
class PassSceneParams(Params):
    """Satellite and stations of a pass in place of the circular orbit and the given places."""

    satellite: str = parameter(
        "",
        "catalogue number or name of the satellite, as source.satellite; empty: the circular orbit of orbit.*",
    )
    elements: str = parameter(
        "",
        "its elements or ephemeris, as source.elements; empty: the verification set of the sgp4 package",
    )
    descriptions: tuple[str, ...] = parameter(
        (),
        "station descriptions, by name or file, that take the place of stations.*; each name is a namespace",
    )


class ElementOrbit:
    """An orbit by elements, an ephemeris file or anything else that the station can track."""

    def __init__(self, target: TargetSource) -> None:
        self._target = target

    def point(self, t_s: ArrayLike) -> OrbitPoint:
        """Return place, frame and frame rate at UTC times `t_s` (...); ValueError outside."""
        times = np.asarray(t_s, dtype=np.float64)
        motion = self._target.motion_at(times.ravel())
        shape = (*times.shape, 3)
        return OrbitPoint(
            position_m=np.stack(motion.position, axis=-1).reshape(shape),
            frame=np.stack(
                [np.stack(axis, axis=-1) for axis in orbital_axes(motion)], axis=-2
            ).reshape(*shape, 3),
            frame_rate_rad_s=np.stack(orbital_rate_rad_s(motion), axis=-1).reshape(shape),
        )


def scene_params(orbit: Params) -> dict[str, Params]:
    """Return the parameters of a scene by their prefix; `orbit` where no satellite is named."""
    return {"orbit": orbit, "stations": GroundNetworkParams(), "scene": PassSceneParams()}


def pass_scene(
    params: PassSceneParams, orbit: Orbit, network: GroundNetworkParams
) -> tuple[Orbit, list[GroundPlace]]:
    """Return the orbit and the stations: those of the pass where they are named, else the given.

    Raises
    ------
    ValueError : for a satellite, a file or a description that is not there, or a name that is not
        a namespace.
    """
    if params.satellite.casefold() in BODIES:
        raise ValueError(
            f"satellite={params.satellite!r} is not a satellite: it has no orbit around the Earth"
        )
    if params.satellite or params.elements:
        track = load_track(SourceParams(satellite=params.satellite, elements=params.elements))
        orbit = ElementOrbit(track.target)
    if not params.descriptions:
        return orbit, list(network.stations())
    names = tuple(Path(each).stem for each in params.descriptions)
    require_names("descriptions", names)
    sites = [read_station(each).site for each in params.descriptions]
    return orbit, [
        SurveyedStation(name=name, site=site) for name, site in zip(names, sites, strict=True)
    ]
