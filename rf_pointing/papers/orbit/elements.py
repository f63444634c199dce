"""Keplerian elements and the state they stand for (two-body, exact both ways)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, as_finite_array, parameter
from rf_pointing.core.constants import EARTH_MU_M3_S2

__all__ = ["Elements"]

Array = NDArray[np.float64]

"""Gravitational constant times mass of the Earth (WGS-84)."""
_KEPLER_TOLERANCE_RAD, _KEPLER_ITERATIONS = 1e-13, 50


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
        angles = (np.array([value]) for value in (self.node_rad, self.perigee_rad, self.mean_anomaly_rad))
        return np.asarray(self.states(*angles)[0])

    def states(self, node_rad: Array, perigee_rad: Array, mean_anomaly_rad: Array) -> Array:
        """Return states (n, 6) on this ellipse with other nodes, perigees and anomalies (n,)."""
        a, e = self.semi_major_axis_m, self.eccentricity
        anomaly = _eccentric_anomaly(mean_anomaly_rad, e)
        cosine, sine, root = np.cos(anomaly), np.sin(anomaly), math.sqrt(1.0 - e * e)
        speed = math.sqrt(EARTH_MU_M3_S2 * a) / (a * (1.0 - e * cosine))
        toward_perigee, ahead = _orbit_axes(node_rad, self.inclination_rad, perigee_rad)
        position = a * ((cosine - e) * toward_perigee + root * sine * ahead)
        velocity = speed * (root * cosine * ahead - sine * toward_perigee)
        return np.concatenate([position, velocity]).T

    @classmethod
    def from_state(cls, state: ArrayLike) -> "Elements":
        """Return the elements of an elliptic, inclined, not exactly circular orbit."""
        both = as_finite_array("state", state, (6,))
        position, velocity = both[:3], both[3:]
        radius, momentum = float(np.linalg.norm(position)), np.cross(position, velocity)
        a = 1.0 / (2.0 / radius - float(velocity @ velocity) / EARTH_MU_M3_S2)
        if a <= 0.0:
            raise ValueError(f"semi_major_axis_m={a:.0f} must be > 0: the state is not a closed orbit")
        inclination = math.atan2(math.hypot(momentum[0], momentum[1]), momentum[2])
        node = math.atan2(momentum[0], -momentum[1])
        along_node = np.array([math.cos(node), math.sin(node), 0.0])
        ahead = np.cross(momentum / np.linalg.norm(momentum), along_node)
        latitude = math.atan2(float(position @ ahead), float(position @ along_node))
        e_cos = 1.0 - radius / a
        e_sin = float(position @ velocity) / math.sqrt(EARTH_MU_M3_S2 * a)
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


def _eccentric_anomaly(mean_rad: Array, eccentricity: float) -> Array:
    anomaly = mean_rad + eccentricity * np.sin(mean_rad)
    for _ in range(_KEPLER_ITERATIONS):
        miss = anomaly - eccentricity * np.sin(anomaly) - mean_rad
        step = miss / (1.0 - eccentricity * np.cos(anomaly))
        anomaly = anomaly - step
        if np.max(np.abs(step)) <= _KEPLER_TOLERANCE_RAD:
            return anomaly
    raise ValueError(f"eccentricity={eccentricity}: Kepler's equation needs more than {_KEPLER_ITERATIONS} steps")


def _orbit_axes(node: Array, inclination: float, perigee: Array) -> tuple[Array, Array]:
    """Return the unit vectors (3, n) to perigee and a quarter turn ahead of it."""
    sin_o, cos_o, sin_w, cos_w = np.sin(node), np.cos(node), np.sin(perigee), np.cos(perigee)
    sin_i, cos_i = math.sin(inclination), math.cos(inclination)
    toward = np.stack([cos_o * cos_w - sin_o * sin_w * cos_i, sin_o * cos_w + cos_o * sin_w * cos_i, sin_w * sin_i])
    ahead = np.stack([-cos_o * sin_w - sin_o * cos_w * cos_i, -sin_o * sin_w + cos_o * cos_w * cos_i, cos_w * sin_i])
    return toward, ahead
