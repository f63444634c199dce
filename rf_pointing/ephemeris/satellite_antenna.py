"""How much the antenna of a satellite sends towards a station, from orbit and attitude.

Orbital frame F_o: x along the flight, y against the orbit's momentum, z to the centre of the Earth.
The body is turned from it by yaw, pitch and roll, R = Rz(yaw) Ry(pitch) Rx(roll), and the antenna
looks along the body's z.  Its pattern over the angle psi off the axis is that of a satellite
antenna with a single feed (ITU-R S.672-4, without its plateau):

    G(psi) = max(-3 (psi / psi_b)^2, floor) dB,   psi_b half of the width at half power.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rf_pointing.core import Params, parameter
from rf_pointing.ephemeris.state_vector import StateVector, Vector, combined, cross, dot, norm


@dataclass(frozen=True, kw_only=True)
class SatelliteAntennaParams(Params):
    """Pattern of the antenna, and attitude of the satellite that carries it."""

    half_power_beamwidth_rad: float = parameter(
        0.0, "full width at half power of the satellite's antenna; 0: it sends alike in all directions", 0.0, math.pi
    )
    floor_db: float = parameter(-20.0, "least gain against that on the axis", -80.0, 0.0)
    roll_rad: float = parameter(0.0, "turn about the flight direction", -math.pi, math.pi)
    pitch_rad: float = parameter(0.0, "turn about the orbit's negative normal", -math.pi, math.pi)
    yaw_rad: float = parameter(0.0, "turn about the nadir", -math.pi, math.pi)

    @cached_property
    def axis(self) -> Vector:
        """Unit vector along the antenna's axis in F_o."""
        turns = self.roll_rad, self.pitch_rad, self.yaw_rad
        (cr, sr), (cp, sp), (cy, sy) = ((math.cos(turn), math.sin(turn)) for turn in turns)
        return cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr

    def turned(self, quaternion: tuple[float, float, float, float]) -> "SatelliteAntennaParams":
        """Return the same antenna at another attitude (x, y, z, w), from the body's axes to F_o."""
        x, y, z, w = quaternion
        return self.replace(
            roll_rad=math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            pitch_rad=math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0)),
            yaw_rad=math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )

    def gain_db(self, motion: StateVector, station_m: Vector) -> Any:
        """Return the gain towards a station, in dB against that on the axis.

        `motion` is that of the satellite, inertial derivatives in Earth-fixed axes; `station_m`
        Earth-fixed.
        """
        axes = orbital_axes(motion)
        line = combined((1.0, station_m), (-1.0, motion.position))
        along = sum(part * dot(row, line) for part, row in zip(self.axis, axes, strict=True))
        off = np.arccos(np.clip(along / norm(line), -1.0, 1.0))
        return np.maximum(-12.0 * (off / self.half_power_beamwidth_rad) ** 2, self.floor_db)


def orbital_axes(motion: StateVector) -> tuple[Vector, Vector, Vector]:
    """Return the axes of F_o in the components of an inertial motion."""
    momentum = cross(motion.position, motion.velocity)
    down = combined((-1.0 / norm(motion.position), motion.position))
    opposite = combined((-1.0 / norm(momentum), momentum))
    return cross(opposite, down), opposite, down


def orbital_rate_rad_s(motion: StateVector) -> Vector:
    """Return the inertial rate of F_o, in F_o: h/r^2 about the orbit's normal, r a_n/h about r."""
    momentum, distance = cross(motion.position, motion.velocity), norm(motion.position)
    size = norm(momentum)
    across = dot(momentum, motion.acceleration) / size
    return 0.0 * size, -size / distance**2, -distance * across / size
