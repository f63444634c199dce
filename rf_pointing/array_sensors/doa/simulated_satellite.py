"""Simulated satellite holding nadir: the truth behind the attitude filters.

With the inertia of DOA eq. (25) gravity gradient alone is unstable (iyy < izz), so a torque must
hold the satellite:

    T = -I (f^2 2 q + 2 z f w_bo),

f bandwidth, z damping, q vector part, w_bo rate against the orbital frame.  The filter knows this
torque.  Random torque makes the rate a random walk; a filter can be given the same process noise.
"""

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from rf_pointing.array_sensors.attitude.multiplicative_filter import ProcessNoiseParams
from rf_pointing.array_sensors.attitude.quaternion import (
    multiply,
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    unit_quaternion,
)
from rf_pointing.array_sensors.attitude.rigid_body import (
    KnownTorque,
    SatelliteParams,
    propagate,
    rigid_inertia,
)
from rf_pointing.core import Params, parameter, random_stream, require_between, require_finite
from rf_pointing.core.types import Array


@dataclass(frozen=True, kw_only=True)
class NadirHoldParams(Params):
    """Stiffness of the simulated attitude control."""

    # Above the orbital rate of 0.001 rad/s, or the gravity gradient would win.
    bandwidth_rad_s: float = parameter(0.02, "natural frequency of the loop", low=0.002, high=1.0)
    damping: float = parameter(1.0, "damping ratio of the loop", low=0.1, high=5.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteTruth:
    """Complete state: orientation of the body in the orbital frame, inertial body rate, and the
    noise generator.
    """

    t_s: float
    quaternion: Array
    rate_rad_s: Array
    generator: dict[str, Any]


class SimulatedSatellite:
    """One satellite, or a batch where `quaternion` (..., 4) and `rate_rad_s` (..., 3) have leading
    axes.
    """

    def __init__(
        self,
        satellite: SatelliteParams,
        hold: NadirHoldParams,
        noise: ProcessNoiseParams,
        *,
        t_s: float,
        quaternion: Array,
        rate_rad_s: Array,
        seed: int,
    ) -> None:
        require_finite("t_s", t_s)
        require_finite("rate_rad_s", rate_rad_s)
        self._inertia = rigid_inertia(satellite)
        self._hold = hold
        self._noise = noise
        self._stream = random_stream(seed, "satellite_disturbance")
        self._t_s = t_s
        self._quaternion = unit_quaternion(quaternion)
        self._rate = np.array(rate_rad_s, dtype=np.float64)

    @property
    def state(self) -> SatelliteTruth:
        """A copy of the truth, to compare with or to resume from with `restore`."""
        generator = copy.deepcopy(dict(self._stream.bit_generator.state))
        return SatelliteTruth(
            t_s=self._t_s,
            quaternion=self._quaternion.copy(),
            rate_rad_s=self._rate.copy(),
            generator=generator,
        )

    def restore(self, state: SatelliteTruth) -> None:
        """Continue from `state`."""
        self._t_s = state.t_s
        self._quaternion, self._rate = state.quaternion.copy(), state.rate_rad_s.copy()
        self._stream.bit_generator.state = copy.deepcopy(state.generator)

    def hold_torque(self, frame_rate: Array) -> KnownTorque:
        """Return the torque that turns the body frame into the orbital frame, without wheels."""
        rotation = quaternion_to_matrix(self._quaternion)
        relative = self._rate - np.einsum("...ji,...j->...i", rotation, frame_rate)
        # The sign of the scalar chooses the short way round; the other would unwind a full turn.
        turn = (
            2.0 * self._quaternion[..., :3] * np.where(self._quaternion[..., 3:] < 0.0, -1.0, 1.0)
        )
        pull = self._hold.bandwidth_rad_s**2 * turn
        brake = 2.0 * self._hold.damping * self._hold.bandwidth_rad_s * relative
        none = np.zeros(3)
        return KnownTorque(
            control_n_m=-(pull + brake) @ self._inertia.matrix,
            wheel_momentum_n_m_s=none,
            wheel_momentum_rate_n_m=none,
        )

    def step(self, dt_s: float, known: KnownTorque, frame_rate: Array) -> None:
        """Advance the truth by `dt_s` under `known`.

        `frame_rate` (3,) is the orbital frame's inertial rate in F_o.
        """
        require_between("dt_s", dt_s, 1e-6, 10.0)
        quaternion, rate = propagate(
            self._inertia, self._quaternion, self._rate, known, frame_rate, dt_s
        )
        shape = rate.shape
        jitter = np.sqrt(self._noise.attitude_rad2_s * dt_s) * self._stream.standard_normal(shape)
        shake = np.sqrt(self._noise.rate_rad2_s3 * dt_s) * self._stream.standard_normal(shape)
        self._quaternion = multiply(quaternion, quaternion_from_rotation_vector(jitter))
        self._rate = rate + shake
        self._t_s += dt_s
