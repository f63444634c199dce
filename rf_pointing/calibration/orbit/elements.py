"""Keplerian elements and the state they stand for (two-body, exact both ways)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.geometry import Params, as_finite_array, parameter

__all__ = ["GM_M3_S2", "Elements"]

Array = NDArray[np.float64]

GM_M3_S2 = 3.986004418e14
"""Gravitational constant times mass of the Earth (WGS-84)."""
_KEPLER_TOLERANCE_RAD, _KEPLER_ITERATIONS = 1e-14, 50


@dataclass(frozen=True, kw_only=True)
class Elements(Params):
    """Osculating elements in inertial axes."""

    semi_major_axis_m: float = parameter(description="semi-major axis", low=6.4e6, high=1e9)
    eccentricity: float = parameter(description="eccentricity of the ellipse", low=0.0, high=0.99)
    inclination_rad: float = parameter(description="inclination", low=0.0, high=math.pi)
    node_rad: float = parameter(description="right ascension of the ascending node", low=-10.0, high=10.0)
    perigee_rad: float = parameter(description="argument of perigee", low=-10.0, high=10.0)
    mean_anomaly_rad: float = parameter(description="mean anomaly", low=-10.0, high=10.0)

    def state(self) -> Array:
        """Return position and velocity (6,), m and m/s; `from_state` is the inverse."""
        anomaly = _eccentric_anomaly(self.mean_anomaly_rad, self.eccentricity)
        a, e = self.semi_major_axis_m, self.eccentricity
        root = math.sqrt(1.0 - e * e)
        radius = a * (1.0 - e * math.cos(anomaly))
        speed = math.sqrt(GM_M3_S2 * a) / radius
        plane_position = np.array([a * (math.cos(anomaly) - e), a * root * math.sin(anomaly), 0.0])
        plane_velocity = speed * np.array([-math.sin(anomaly), root * math.cos(anomaly), 0.0])
        axes = _orbit_axes(self.node_rad, self.inclination_rad, self.perigee_rad)
        return np.concatenate([axes @ plane_position, axes @ plane_velocity])

    @classmethod
    def from_state(cls, state: ArrayLike) -> "Elements":
        """Return the elements of an elliptic, inclined, not exactly circular orbit."""
        both = as_finite_array("state", state, (6,))
        position, velocity = both[:3], both[3:]
        radius, momentum = float(np.linalg.norm(position)), np.cross(position, velocity)
        a = 1.0 / (2.0 / radius - float(velocity @ velocity) / GM_M3_S2)
        if a <= 0.0:
            raise ValueError(f"semi_major_axis_m={a:.0f} must be > 0: the state is not a closed orbit")
        inclination = math.atan2(math.hypot(momentum[0], momentum[1]), momentum[2])
        node = math.atan2(momentum[0], -momentum[1])
        along_node = np.array([math.cos(node), math.sin(node), 0.0])
        ahead = np.cross(momentum / np.linalg.norm(momentum), along_node)
        latitude = math.atan2(float(position @ ahead), float(position @ along_node))
        e_cos = 1.0 - radius / a
        e_sin = float(position @ velocity) / math.sqrt(GM_M3_S2 * a)
        e, anomaly = math.hypot(e_cos, e_sin), math.atan2(e_sin, e_cos)
        true_anomaly = math.atan2(math.sqrt(1.0 - e * e) * math.sin(anomaly), math.cos(anomaly) - e)
        return cls(
            semi_major_axis_m=a,
            eccentricity=e,
            inclination_rad=inclination,
            node_rad=node % (2.0 * math.pi),
            perigee_rad=(latitude - true_anomaly) % (2.0 * math.pi),
            mean_anomaly_rad=(anomaly - e * math.sin(anomaly)) % (2.0 * math.pi),
        )


def _eccentric_anomaly(mean_rad: float, eccentricity: float) -> float:
    anomaly = mean_rad + eccentricity * math.sin(mean_rad)
    for _ in range(_KEPLER_ITERATIONS):
        miss = anomaly - eccentricity * math.sin(anomaly) - mean_rad
        step = miss / (1.0 - eccentricity * math.cos(anomaly))
        anomaly -= step
        if abs(step) <= _KEPLER_TOLERANCE_RAD:
            return anomaly
    raise ValueError(f"mean_anomaly_rad={mean_rad}: Kepler's equation needs more than {_KEPLER_ITERATIONS} steps")


def _orbit_axes(node: float, inclination: float, perigee: float) -> Array:
    sin_o, cos_o, sin_w, cos_w = math.sin(node), math.cos(node), math.sin(perigee), math.cos(perigee)
    sin_i, cos_i = math.sin(inclination), math.cos(inclination)
    return np.array(
        [
            [cos_o * cos_w - sin_o * sin_w * cos_i, -cos_o * sin_w - sin_o * cos_w * cos_i, sin_o * sin_i],
            [sin_o * cos_w + cos_o * sin_w * cos_i, -sin_o * sin_w + cos_o * cos_w * cos_i, -cos_o * sin_i],
            [sin_w * sin_i, cos_w * sin_i, cos_i],
        ]
    )
