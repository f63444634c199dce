"""The motion of one pass on the sky, as a table that can be made finer without losing the zenith.

Azimuth has a spike near the zenith that no interpolation of azimuths survives; the direction as a
unit vector has none.  So the table is refined on the vector u(t), a quintic through position, rate
and acceleration, and turned back into angles.
"""

from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.core import Array, angular_distance_rad, as_finite_array, unit_vector_from_azel
from rf_pointing.core.hermite import quintic_coefficients
from rf_pointing.core.kinematics import Kinematics, motion_of_vectors, vectors_of_motion

STEP_S = 0.1
# A pass of 83 min.  Longer ones are of high orbits, the Moon and the Sun.
MOST_STEPS = 50_000


@dataclass(frozen=True, kw_only=True)
class PassProfile:
    """Apparent direction (n, 2) of a target at `t_s` (n,), azimuth continuous, and of the Sun.

    Columns are azimuth, elevation; units rad, rad/s, rad/s^2.  `range_m` (n,) is its distance,
    `satellite_gain_db` (n,) that of its antenna towards the station, against the antenna's axis.
    The target may be early or late by `along_sigma_s` and off its track by `cross_sigma_m`, one
    sigma each, 0 where nothing is known.
    """

    name: str
    t_s: Array
    position_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    sun_rad: Array
    range_m: Array
    satellite_gain_db: Array
    along_sigma_s: float = 0.0
    cross_sigma_m: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_s", as_finite_array("t_s", self.t_s, (None,)))
        for name in ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "sun_rad"):
            object.__setattr__(self, name, as_finite_array(name, getattr(self, name), (len(self.t_s), 2)))
        for name in ("range_m", "satellite_gain_db"):
            object.__setattr__(self, name, as_finite_array(name, getattr(self, name), (len(self.t_s),)))
        if np.any(self.range_m < 1.0):
            raise ValueError(f"range_m={float(self.range_m.min())} must be >= 1")
        for name in ("along_sigma_s", "cross_sigma_m"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name}={getattr(self, name)} must be >= 0")
        if len(self.t_s) < 2 or np.any(np.diff(self.t_s) <= 0.0):
            raise ValueError(f"t_s must have at least 2 increasing times, has {len(self.t_s)}")

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last."""
        return float(self.t_s[-1] - self.t_s[0])

    @property
    def _motion(self) -> tuple[Array, Array, Array]:
        return self.position_rad, self.velocity_rad_s, self.acceleration_rad_s2

    def on(self, mount: Kinematics) -> "PassProfile":
        """Return the pass, on the sky by now, in the angles of a mount's axes."""
        if mount.level:
            return self
        position, velocity, acceleration = mount.to_axes(*self._motion)
        still = np.zeros_like(self.sun_rad)
        return replace(
            self, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration,
            sun_rad=mount.to_axes(self.sun_rad, still, still)[0],
        )  # fmt: skip

    def resampled(self) -> "PassProfile":
        """Return the same pass at even steps of at most `STEP_S`, both ends included.

        A pass of many hours, which is slow, has longer steps: `MOST_STEPS` of them.
        """
        steps = min(int(np.ceil(self.duration_s / STEP_S)), MOST_STEPS)
        return self._at(np.linspace(self.t_s[0], self.t_s[-1], steps + 1))

    def between(self, start_s: float, end_s: float) -> "PassProfile":
        """Return the piece of the pass from `start_s` to `end_s`, both within it."""
        inner = self.t_s[(self.t_s > start_s) & (self.t_s < end_s)]
        return self._at(np.concatenate([[start_s], inner, [end_s]]))

    def _at(self, times: Array) -> "PassProfile":
        motion = _interpolated(times, self.t_s, vectors_of_motion(*self._motion))
        position, velocity, acceleration = motion_of_vectors(*motion)
        turn = 2.0 * np.pi
        # The refined azimuth starts on the turn of the table, wherever arctan2 puts it.
        azimuth = np.unwrap(position[:, 0])
        near = float(np.interp(times[0], self.t_s, self.position_rad[:, 0]))
        position[:, 0] = azimuth + turn * np.round((near - azimuth[0]) / turn)
        sun = unit_vector_from_azel(*self.sun_rad.T)
        # The Sun moves 0.25 deg in a minute: straight lines between its directions do.
        east, north, up = (np.interp(times, self.t_s, part) for part in sun.T)
        return replace(
            self,
            t_s=times,
            position_rad=position,
            velocity_rad_s=velocity,
            acceleration_rad_s2=acceleration,
            sun_rad=np.column_stack([np.arctan2(east, north), np.arctan2(up, np.hypot(east, north))]),
            range_m=np.interp(times, self.t_s, self.range_m),
            satellite_gain_db=np.interp(times, self.t_s, self.satellite_gain_db),
        )

    def sun_angle_rad(self) -> Array:
        """Return the angle (n,) between target and Sun."""
        return angular_distance_rad(*self.position_rad.T, *self.sun_rad.T)


def _interpolated(times: Array, knots: Array, motion: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """Return the quintic through the knots' motion (n, 3) at `times`, with its derivatives."""
    first = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    h = (knots[first + 1] - knots[first])[:, None]
    t = (times - knots[first])[:, None]
    (p0, v0, a0), (p1, v1, a1) = (tuple(part[index] for part in motion) for index in (first, first + 1))
    c3, c4, c5 = quintic_coefficients((p0, v0, a0), (p1, v1, a1), h)
    return (
        p0 + t * (v0 + t * (0.5 * a0 + t * (c3 + t * (c4 + t * c5)))),
        v0 + t * (a0 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
        a0 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
    )
