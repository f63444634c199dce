"""Observed and true angles of one station, checked before anything is fitted to them.

The true angles, rates and accelerations come from a reference orbit; the bias model explains
observed minus true.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import LEVEL, Kinematics, as_finite_array, to_degrees, wrap_rad
from rf_pointing.core.target_motion import ANGLES
from rf_pointing.core.types import Array, BoolArray, IntArray

# Difference on the sky of observed and true direction above which the data must be wrong.
LARGEST_BIAS_RAD = 0.2
# A turn of all azimuths alike is another north; anything else scatters more.
_TURNED_SPREAD_RAD = np.radians(1.0)
# Cable wraps allow a turn and a half; degrees taken for radians are far beyond.
_LARGEST_AZIMUTH_RAD = 3.0 * np.pi
_TURN = 2.0 * np.pi
_MOTION = ("true_azimuth_rad", "true_elevation_rad", *ANGLES[2:])
_OBSERVED = (
    "observed_azimuth_rad", "observed_elevation_rad", "sigma_azimuth_rad", "sigma_elevation_rad",
)  # fmt: skip
_OPTIONAL = ("range_m", "range_rate_m_s", "temperature_k")
# Rows farther apart say little: the remainder grows with the cube of their distance.
_NEIGHBOURS_S = 20.0
_FEWEST_JUDGED = 10
_LARGEST_SHARE = 0.5
# Changes from one row to the next below which nothing is judged: files carry few digits.
_MOVES = {"rad": np.radians(0.02), "rad_s": np.radians(0.001), "m": 1000.0}
_DERIVATIVES = (
    ("true_azimuth_rad", "azimuth_rate_rad_s", "rad"),
    ("true_elevation_rad", "elevation_rate_rad_s", "rad"),
    ("azimuth_rate_rad_s", "azimuth_acceleration_rad_s2", "rad_s"),
    ("elevation_rate_rad_s", "elevation_acceleration_rad_s2", "rad_s"),
    ("range_m", "range_rate_m_s", "m"),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Angle observations of one station in one band; every array has shape (n,).

    `t_s` are UTC seconds; `pass_id` numbers the pass an observation belongs to, times increase
    within a pass. Rates and accelerations are those of the true motion.  `sigma_azimuth_rad` is in
    azimuth, not on the sky (the on-sky sigma divided by cos El).  `range_m` and `range_rate_m_s`
    are needed for orbit-error parameters, `temperature_k` for thermal terms.  Angles of
    another `mount` are those of its lower and upper axis.  Raises ValueError for anything that
    cannot be such data.
    """

    station: str
    band: str
    t_s: Array
    pass_id: IntArray
    observed_azimuth_rad: Array
    observed_elevation_rad: Array
    true_azimuth_rad: Array
    true_elevation_rad: Array
    azimuth_rate_rad_s: Array
    elevation_rate_rad_s: Array
    azimuth_acceleration_rad_s2: Array
    elevation_acceleration_rad_s2: Array
    sigma_azimuth_rad: Array
    sigma_elevation_rad: Array
    range_m: Array | None = None
    range_rate_m_s: Array | None = None
    temperature_k: Array | None = None
    mount: Kinematics = LEVEL

    def __post_init__(self) -> None:
        if not self.station:
            raise ValueError("station='' must name the station")
        object.__setattr__(self, "t_s", _finite("t_s", self.t_s, None))
        if len(self.t_s) == 0:
            raise ValueError("observations: 0 rows, must have at least 1")
        for name in (*_OBSERVED, *_MOTION):
            object.__setattr__(self, name, _finite(name, getattr(self, name), len(self.t_s)))
        for name in _OPTIONAL:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _finite(name, getattr(self, name), len(self.t_s)))
        # A cast of floats would turn pass 1.5 into pass 1 and join two passes.
        object.__setattr__(self, "pass_id", _pass_numbers(self.pass_id, len(self.t_s)))
        _check_times(self.t_s, self.pass_id)
        _check_angles(self)
        for name in ("sigma_azimuth_rad", "sigma_elevation_rad"):
            _refuse_where(getattr(self, name) <= 0.0, name, getattr(self, name), "must be > 0")

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def residual_azimuth_rad(self) -> Array:
        """Return observed minus true azimuth, folded into half a turn."""
        difference = self.observed_azimuth_rad - self.true_azimuth_rad
        return difference - _TURN * np.round(difference / _TURN)

    @property
    def residual_elevation_rad(self) -> Array:
        """Return observed minus true elevation."""
        return self.observed_elevation_rad - self.true_elevation_rad

    @property
    def passes(self) -> IntArray:
        """Return the pass numbers present, ascending."""
        return np.unique(self.pass_id)

    def select(self, chosen: ArrayLike) -> "Observations":
        """Return the rows of a boolean mask or of an index array."""
        rows = np.asarray(chosen)
        return replace(
            self,
            **{
                name: value[rows]
                for name, value in vars(self).items()
                if isinstance(value, np.ndarray)
            },
        )

    def motion(self) -> tuple[Array, ...]:
        """Return true azimuth, elevation, rates and accelerations, as the bias model takes them."""
        return tuple(getattr(self, name) for name in _MOTION)

    @staticmethod
    def concatenate(parts: "Sequence[Observations]") -> "Observations":
        """Return all parts as one; raises ValueError for mixed stations, bands or columns."""
        if not parts:
            raise ValueError("observations: 0 parts, must have at least 1")
        for name in ("station", "band", "mount"):
            values = sorted({str(getattr(part, name)) for part in parts})
            if len(values) > 1:
                raise ValueError(
                    f"{name} is mixed: {', '.join(values)}; one model belongs to one {name}"
                )
        joined: dict[str, Any] = {}
        for name in COLUMNS:
            values = [getattr(part, name) for part in parts]
            missing = sum(value is None for value in values)
            # A gap filled with zeros would be a range of zero: orbit errors at infinite angles.
            if 0 < missing < len(values):
                raise ValueError(f"{name} is given for some parts only")
            if not missing:
                joined[name] = np.concatenate(values)
        return replace(parts[0], **joined)

    def sky_rad(self) -> tuple[Array, Array]:
        """Return the true azimuth and elevation (n,)."""
        return self.mount.directions(self.true_azimuth_rad, self.true_elevation_rad)


COLUMNS = tuple(
    item.name for item in fields(Observations) if item.name not in ("station", "band", "mount")
)
"""Names of the columns of observations."""


def _finite(name: str, value: ArrayLike, length: int | None) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 1 and not np.all(np.isfinite(array)):
        row = int(np.flatnonzero(~np.isfinite(array))[0])
        raise ValueError(f"{name}[{row}]={array[row]} must be finite")
    return as_finite_array(name, array, (length,))


def _pass_numbers(value: ArrayLike, length: int) -> IntArray:
    numbers = np.asarray(value)
    if numbers.shape != (length,) or not np.issubdtype(numbers.dtype, np.integer):
        raise ValueError(
            f"pass_id has shape {numbers.shape} and type {numbers.dtype}, must be {length} integers"
        )
    return numbers.astype(np.int64)


def _check_times(t_s: Array, pass_id: IntArray) -> None:
    # By pass, in the order of the rows: passes may be interleaved, as two antennas' files are.
    order = np.lexsort((np.arange(len(t_s)), pass_id))
    step = np.diff(t_s[order])
    same_pass = np.diff(pass_id[order]) == 0
    wrong = np.flatnonzero(same_pass & (step <= 0.0))
    if len(wrong):
        row, before = int(order[wrong[0] + 1]), int(order[wrong[0]])
        word = "repeats" if step[wrong[0]] == 0.0 else "is earlier than"
        raise ValueError(
            f"t_s[{row}]={t_s[row]:.6f} {word} t_s[{before}]={t_s[before]:.6f} of pass {pass_id[row]}; "
            "times must increase within a pass"
        )


def _check_angles(data: Observations) -> None:
    for kind in ("observed", "true"):
        azimuth = getattr(data, f"{kind}_azimuth_rad")
        elevation = getattr(data, f"{kind}_elevation_rad")
        outside = np.abs(azimuth) > _LARGEST_AZIMUTH_RAD
        _refuse_where(
            outside, f"{kind}_azimuth_rad", azimuth, "must be within 3 pi; degrees given?"
        )
        outside = (elevation < -np.pi / 2.0) | (elevation > np.pi)
        reason = "must be within -pi/2..pi; degrees given, or azimuth and elevation swapped?"
        _refuse_where(outside, f"{kind}_elevation_rad", elevation, reason)
    across = data.residual_azimuth_rad * np.cos(data.true_elevation_rad)
    distance = np.hypot(across, data.residual_elevation_rad)
    turn = float(np.median(data.residual_azimuth_rad))
    spread = float(np.median(np.abs(wrap_rad(data.residual_azimuth_rad - turn))))
    reason = f"rad must be <= {LARGEST_BIAS_RAD}; swapped columns, another station or degrees?"
    # One bad row among good ones is not another north.
    if data.mount.level and spread < _TURNED_SPREAD_RAD and abs(turn) > LARGEST_BIAS_RAD:
        reason = f"rad must be <= {LARGEST_BIAS_RAD}: {north_text(turn)}"
    _refuse_where(distance > LARGEST_BIAS_RAD, "observed minus true direction", distance, reason)


def north_text(turn_rad: float) -> str:
    """Return what it means that all azimuths are off by the same angle."""
    degrees = np.degrees(turn_rad)
    return (
        f"all azimuths are {degrees:+.2f} deg off: an offset, or counted from magnetic north (a declination of "
        f"{-degrees:+.2f} deg) or from grid north?"
    )


def _refuse_where(wrong: BoolArray, name: str, value: Array, reason: str) -> None:
    if np.any(wrong):
        row = int(np.flatnonzero(wrong)[0])
        raise ValueError(
            f"{name}[{row}]={value[row]:.6g} {reason} ({int(np.sum(wrong))} of {len(value)} rows)"
        )


def require_derivatives(points: Observations) -> None:
    """Raise ValueError naming a column that is not the derivative of its partner in most rows.

    Between two neighbours of a pass  x(t + h) - x(t) = h (x'(t) + x'(t + h)) / 2 + O(h^3).
    """
    # Nothing else shows such an error: a rate in rad/s where deg/s are expected, or with its sign
    # turned, gives a fit as good as any, with lags that are wrong by the same factor.
    rows = np.lexsort((points.t_s, points.pass_id))
    step = np.diff(points.t_s[rows])
    near = (np.diff(points.pass_id[rows]) == 0) & (step <= _NEIGHBOURS_S)
    for name, rate_name, unit in _DERIVATIVES:
        value, rate = getattr(points, name), getattr(points, rate_name)
        if value is None or rate is None:
            continue
        moved = np.diff(value[rows])
        moved = wrap_rad(moved) if name == "true_azimuth_rad" else moved
        expected = 0.5 * step * (rate[rows][1:] + rate[rows][:-1])
        larger = np.maximum(np.abs(moved), np.abs(expected))
        judged = near & (larger > _MOVES[unit])
        wrong = judged & (np.abs(moved - expected) > _LARGEST_SHARE * larger)
        # Most rows must be wrong: single ones may be outliers, which the fit edits out.
        if np.sum(judged) >= _FEWEST_JUDGED and np.sum(wrong) > 0.5 * np.sum(judged):
            first = int(np.flatnonzero(wrong)[0])
            share = f"{int(np.sum(wrong))} of {int(np.sum(judged))} rows"
            raise ValueError(
                _not_the_change(points, rows[first : first + 2], name, rate_name, share)
            )


def _not_the_change(
    points: Observations, pair: IntArray, name: str, rate_name: str, share: str
) -> str:
    # In the units of the file, which the reader of the message has before them.
    edge, values = to_degrees(name, getattr(points, name)[pair].tolist())
    rate_edge, rates = to_degrees(rate_name, getattr(points, rate_name)[pair].tolist())
    return (
        f"{rate_edge} is not the change of {edge}: rows {pair[0]} and {pair[1]}, {np.diff(points.t_s[pair])[0]:g} s apart, "
        f"have {edge} {values[0]:.6g}, {values[1]:.6g} and {rate_edge} {rates[0]:.6g}, {rates[1]:.6g} "
        f"({share}); another unit, another sign or swapped columns?"
    )
