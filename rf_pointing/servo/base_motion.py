"""Motion of the base of a simulated antenna: the sea, a turn, and the IMU that measures it.

Roll, pitch and yaw are sums of sinusoids of equal power and random phase, a narrow band about one
period each, so their rms is as given and attitude, rates and accelerations are exact at any time.

Sea state 5 is a significant wave height of 2.5 to 4 m (WMO code table 3700).  In it the shipped
`ship_2m4`, a ship of 40 m, rolls by 4 deg, pitches by 1.5 deg and yaws by 1 deg (rms), with
periods of 8, 5 and 12 s.  These angles are assumed, not measured: at three times the rms the ship
rolls by 12 deg.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Params, parameter, random_stream
from rf_pointing.core.angles import azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.core.moving_base import (
    OF_ROS,
    BaseSample,
    deck_attitude,
    quaternion_of_matrix,
    turned_by,
)
from rf_pointing.core.types import TURN, Array, Pair

WAVES = 12
BAND = 0.3
"""Half width of a band over its middle frequency."""


@dataclass(frozen=True, kw_only=True)
class BaseMotionParams(Params):
    """True motion of the base, and errors of the simulated IMU."""

    roll_rms_rad: float = parameter(0.0, "rms of the roll", 0.0, 0.5)
    pitch_rms_rad: float = parameter(0.0, "rms of the pitch", 0.0, 0.5)
    yaw_rms_rad: float = parameter(0.0, "rms of the yaw", 0.0, 0.5)
    roll_period_s: float = parameter(8.0, "middle period of the roll", 1.0, 100.0)
    pitch_period_s: float = parameter(5.0, "middle period of the pitch", 1.0, 100.0)
    yaw_period_s: float = parameter(12.0, "middle period of the yaw", 1.0, 100.0)
    heading_rad: float = parameter(0.0, "azimuth of the bow", -6.3, 6.3)
    turn_rate_rad_s: float = parameter(0.0, "rate at which the bow turns clockwise", -1.0, 1.0)
    turn_from_t_s: float = parameter(0.0, "UTC time in s since 1970 from which it turns", 0.0, 1e11)
    imu_period_s: float = parameter(0.01, "time between two samples of the IMU", 0.002, 0.1)
    latency_s: float = parameter(0.02, "time from a sample of the IMU to its arrival", 0.0, 0.4)
    attitude_noise_rad: float = parameter(
        math.radians(0.02), "white noise of the attitude", 0.0, 0.1
    )
    gyro_noise_rad_s: float = parameter(math.radians(0.02), "white noise of the rates", 0.0, 0.1)
    lost_from_t_s: float = parameter(
        1e11, "UTC time in s since 1970 from which the IMU is silent", 0.0, 1e11
    )
    lost_s: float = parameter(0.0, "time for which it is silent", 0.0, 1e6)


class BaseMotion:
    """Motion of one run; `attitude` and `rate_rad_s` are the truth, `samples` are measured."""

    def __init__(self, params: BaseMotionParams, seed: int) -> None:
        self.params = params
        draws = random_stream(seed, "base")
        middle = TURN / np.array(
            [[params.roll_period_s], [params.pitch_period_s], [params.yaw_period_s]]
        )
        # Uneven frequencies: a sum of even ones repeats itself.
        spread = np.sort(draws.uniform(-BAND, BAND, (3, WAVES)), axis=1)
        self._frequency = middle * (1.0 + spread)
        rms = np.array([[params.roll_rms_rad], [params.pitch_rms_rad], [params.yaw_rms_rad]])
        self._amplitude = rms * math.sqrt(2.0 / WAVES)
        self._phase = draws.uniform(0.0, TURN, (3, WAVES))
        self._noise = random_stream(seed, "imu")
        self._measured = -1

    def _angles(self, t_s: float) -> tuple[Array, Array]:
        """Return roll, pitch and yaw of ROS (3,) and their rates (3,)."""
        phase = self._frequency * t_s + self._phase
        angles = np.sum(self._amplitude * np.sin(phase), axis=1)
        rates = np.sum(self._amplitude * self._frequency * np.cos(phase), axis=1)
        params = self.params
        turned = params.turn_rate_rad_s * max(0.0, t_s - params.turn_from_t_s)
        angles[2] += 0.5 * math.pi - params.heading_rad - turned
        rates[2] -= params.turn_rate_rad_s if t_s >= params.turn_from_t_s else 0.0
        return angles, rates

    def attitude(self, t_s: float) -> Array:
        """Return the rotation (3, 3) from x forward, y left, z up to east, north, up."""
        roll, pitch, yaw = self._angles(t_s)[0].tolist()
        return deck_attitude(roll, pitch, yaw)

    def rate_rad_s(self, t_s: float) -> Array:
        """Return the rates (3,) about x forward, y left, z up."""
        (roll, pitch, _), (p, q, r) = self._angles(t_s)
        sine, cosine, level = math.sin(roll), math.cos(roll), math.cos(pitch)
        return np.array([
            p - math.sin(pitch) * r, cosine * q + level * sine * r, -sine * q + level * cosine * r,
        ])  # fmt: skip

    def sky_at(self, t_s: float, first_rad: float, second_rad: float) -> Pair:
        """Return azimuth and elevation of a direction by starboard, bow and up of the deck."""
        east_north_up = self.attitude(t_s) @ OF_ROS.T @ unit_vector_from_azel(first_rad, second_rad)
        azimuth, elevation = azel_from_unit_vector(east_north_up)
        return float(azimuth), float(elevation)

    def samples(self, t_s: float) -> list[BaseSample]:
        """Return the samples that have arrived since the last call, at `t_s` at the latest."""
        params = self.params
        newest = math.floor((t_s - params.latency_s) / params.imu_period_s + 1e-6)
        # Before the first call the IMU has measured as well, which nobody received.
        first = newest if self._measured < 0 else self._measured + 1
        self._measured = newest
        times = [round(number * params.imu_period_s, 6) for number in range(first, newest + 1)]
        silent = params.lost_from_t_s, params.lost_from_t_s + params.lost_s
        return [self.sample(each) for each in times if not silent[0] <= each < silent[1]]

    def sample(self, t_s: float) -> BaseSample:
        """Return one measurement with its noise."""
        noise = self._noise.standard_normal((2, 3))
        attitude = self.attitude(t_s) @ turned_by(self.params.attitude_noise_rad * noise[0])
        rate = self.rate_rad_s(t_s) + self.params.gyro_noise_rad_s * noise[1]
        return BaseSample(t_s=t_s, quaternion=quaternion_of_matrix(attitude), rate_rad_s=rate)
