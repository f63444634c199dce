"""The ground stations of a satellite, by name and place: parameters of every node that knows them."""

import math
import re
from dataclasses import dataclass

from rf_pointing.array_sensors.attitude.ground_stations import GroundStation
from rf_pointing.core import Params, parameter

__all__ = ["GroundNetworkParams"]

_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True, kw_only=True)
class GroundNetworkParams(Params):
    """Stations on the spherical Earth; the defaults are 12 deg apart as seen from 19 deg E in GEO."""

    names: tuple[str, ...] = parameter(("usingen", "hartebeesthoek"), "stations; each name is a namespace")
    latitude_rad: tuple[float, ...] = parameter(
        (math.radians(50.33), math.radians(-25.89)), "latitude of each", low=-math.pi / 2.0, high=math.pi / 2.0
    )
    longitude_rad: tuple[float, ...] = parameter(
        (math.radians(8.48), math.radians(27.69)), "longitude of each, east", low=-2.0 * math.pi, high=2.0 * math.pi
    )

    def check_together(self) -> None:
        """Refuse names that are no namespaces, double names, and places without a name."""
        for name in self.names:
            if not isinstance(name, str) or not _NAME.fullmatch(name):
                raise ValueError(f"names has {name!r}, must be lower-case letters, digits and underscores")
        if len(set(self.names)) != len(self.names) or not self.names:
            raise ValueError(f"names={self.names} must be different, and at least one")
        for field in ("latitude_rad", "longitude_rad"):
            if len(getattr(self, field)) != len(self.names):
                raise ValueError(
                    f"{field} has {len(getattr(self, field))} values, must be one for each of {len(self.names)} names"
                )

    def stations(self) -> list[GroundStation]:
        """Return the stations in their order."""
        places = zip(self.names, self.latitude_rad, self.longitude_rad, strict=True)
        return [GroundStation(name=name, latitude_rad=lat, longitude_rad=lon) for name, lat, lon in places]
