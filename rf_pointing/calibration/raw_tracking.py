"""Samples of one pass as the station delivers them, and which of them are sound."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.core import Array, BoolArray, IntArray, wrap_rad

# Two on each side: a median of five takes two wrong time tags in a row.
_NEIGHBOURS = 2
_JUMP_STEPS = 2.5
# Great circle on the sky: no mount is off by so much, and no wrong unit by less.
_ANOTHER_UNIT_RAD = 0.2
# Half a radian within a point; 80 deg of elevation at a height of 800 km.
_FASTEST_RAD_S = 0.05
CHANNELS = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")


@dataclass(frozen=True, kw_only=True, eq=False)
class RawTracking:
    """Samples of one pass of `target` over `station`, arrays (n,); any value may be wrong.

    `t_s` are UTC seconds since 1970.  `good` is the station's own flag for transmission and
    quality.  Range and range rate may be absent (None); `notes` name what was left out of the
    message they come from.
    """

    station: str
    band: str
    target: str
    t_s: Array
    azimuth_rad: Array
    elevation_rad: Array
    range_m: Array | None
    range_rate_m_s: Array | None
    good: BoolArray
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("station", "band", "target"):
            if not getattr(self, name):
                raise ValueError(f"{name}='' must not be empty")
        object.__setattr__(self, "t_s", _column("t_s", self.t_s, None))
        for name in CHANNELS:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _column(name, getattr(self, name), len(self.t_s)))
        good = np.asarray(self.good, dtype=bool)
        if good.shape != self.t_s.shape:
            raise ValueError(f"good has shape {good.shape}, must be {self.t_s.shape}")
        object.__setattr__(self, "good", good)

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def channels(self) -> dict[str, Array]:
        """Return the measured channels that are present."""
        return {name: getattr(self, name) for name in CHANNELS if getattr(self, name) is not None}

    def turned(self, turn: Callable[[Array, Array], tuple[Array, Array]]) -> "RawTracking":
        """Return the same samples with other angles: of the axes for the sky, or of the sky."""
        azimuth_rad, elevation_rad = turn(self.azimuth_rad, self.elevation_rad)
        return replace(self, azimuth_rad=azimuth_rad, elevation_rad=elevation_rad)

    @property
    def over(self) -> BoolArray:
        """Return where (n,) the dish is over the top: its axis is beyond 90 deg."""
        # An elevation axis never reaches half a turn: beyond it the angle has another unit.
        return np.asarray((self.elevation_rad > 0.5 * np.pi) & (self.elevation_rad <= np.pi))


@dataclass(frozen=True, kw_only=True)
class StageReport:
    """Result of one stage of the pipeline: rows in, rows out, and why rows were dropped."""

    stage: str
    before: int
    after: int
    dropped: Mapping[str, int]
    note: str = ""

    def text(self) -> str:
        """Return one line for people."""
        reasons = ", ".join(f"{count} {reason}" for reason, count in self.dropped.items() if count)
        line = f"{self.stage}: {self.before} -> {self.after}" + (
            f" (dropped {reasons})" if reasons else ""
        )
        return f"{line}; {self.note}" if self.note else line


def split_passes(raw: RawTracking, gap_s: float) -> list[RawTracking]:
    """Return the samples between gaps longer than `gap_s`; one wrong time tag is not a gap.

    Orbit errors belong to one pass: a day of passes in one file must not share them.  A pass is
    also cut where the dish goes over the top: beyond 90 deg the angles are those of another side.
    """
    # The medians of the neighbours jump where a pass ends, and do not where one time tag is wrong.
    rows = np.flatnonzero(np.isfinite(raw.t_s))
    if len(rows) < 2 * _NEIGHBOURS + 1:
        return [raw]
    padded = np.pad(raw.t_s[rows], _NEIGHBOURS, mode="edge")
    usual = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1), axis=1)
    over = raw.over[rows]
    # One wrong angle is not another side.
    padded_over = np.pad(over.astype(np.float64), _NEIGHBOURS, mode="edge")
    side = np.median(
        np.lib.stride_tricks.sliding_window_view(padded_over, 2 * _NEIGHBOURS + 1), axis=1
    )
    cuts = rows[np.flatnonzero((np.abs(np.diff(usual)) > gap_s) | (np.diff(side) != 0.0)) + 1]
    values = {"t_s": raw.t_s, "good": raw.good, **raw.channels}
    parts = {name: np.split(value, cuts) for name, value in values.items()}
    return [
        replace(raw, **{name: part[k] for name, part in parts.items()})
        for k in range(len(cuts) + 1)
    ]


def _column(name: str, value: ArrayLike, length: int | None) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim != 1 or (length is not None and len(array) != length):
        raise ValueError(
            f"{name} has shape {array.shape}, must be ({'n' if length is None else length},)"
        )
    return array


def validate(raw: RawTracking, reference: ReferenceTrack) -> tuple[BoolArray, StageReport]:
    """Return which samples are sound (n,); the others have one reason each (SATCAL 3)."""
    keep, dropped = np.ones(len(raw), dtype=bool), {}
    infinite = np.any([~np.isfinite(value) for value in (raw.t_s, *raw.channels.values())], axis=0)
    # Each check sees only what the ones before it have kept: times are compared with sound ones.
    checks: dict[str, Callable[[IntArray], BoolArray]] = {
        "flagged by the station": lambda rows: ~raw.good[rows],
        "not finite": lambda rows: infinite[rows],
        "angle out of range": lambda rows: _out_of_range(raw)[rows],
        "time jump": lambda rows: _jumps(raw.t_s[rows]),
        "repeated time": lambda rows: _repeats(raw.t_s[rows]),
        "time not increasing": lambda rows: _backward(raw.t_s[rows]),
        "outside the reference orbit": lambda rows: ~reference.covers(raw.t_s[rows]),
        "azimuth turns too fast": lambda rows: _turns(reference, raw.t_s[rows]),
    }
    for reason, is_wrong in checks.items():
        rows = np.flatnonzero(keep)
        wrong = rows[is_wrong(rows)]
        keep[wrong] = False
        dropped[reason] = len(wrong)
    report = StageReport(
        stage="validation", before=len(raw), after=int(np.sum(keep)), dropped=dropped
    )
    return keep, report


def require_unit(raw: RawTracking, reference: ReferenceTrack) -> None:
    """Raise ValueError if the angles meet the reference in another unit only, with the factor."""
    rows = np.isfinite(raw.t_s) & np.isfinite(raw.azimuth_rad) & np.isfinite(raw.elevation_rad)
    rows &= reference.covers(np.where(rows, raw.t_s, np.inf))
    times, places = np.unique(raw.t_s[rows], return_index=True)
    if len(times) < 2:
        return
    at, azimuth, elevation = (
        reference.at(times), raw.azimuth_rad[rows][places], raw.elevation_rad[rows][places],
    )  # fmt: skip

    def distance(factor: float) -> float:
        across = wrap_rad(factor * azimuth - at.azimuth_rad) * np.cos(at.elevation_rad)
        return float(np.median(np.hypot(across, factor * elevation - at.elevation_rad)))

    words = {
        np.pi / 180.0: "large: degrees read as radians?",
        180.0 / np.pi: "small: radians read as degrees?",
    }
    for factor, cause in words.items():
        if distance(1.0) > _ANOTHER_UNIT_RAD > distance(factor):
            raise ValueError(
                f"the angles of {raw.target} are {180.0 / np.pi:.1f} times too {cause} Times {factor:.4g} they are "
                f"{np.degrees(distance(factor)):.2f} deg from the reference, as they are {np.degrees(distance(1.0)):.0f} deg"
            )


def _out_of_range(raw: RawTracking) -> BoolArray:
    # NaN compares as False and is counted under its own reason.
    with np.errstate(invalid="ignore"):
        wrong: BoolArray = np.abs(raw.azimuth_rad) > 3.0 * np.pi
        wrong |= (raw.elevation_rad < -np.pi / 2.0) | (raw.elevation_rad > np.pi)
        if raw.range_m is not None:
            wrong |= raw.range_m <= 0.0
    return wrong


def _jumps(t_s: Array) -> BoolArray:
    # One time tag in the future must not condemn the rest, as "must increase" would.
    if len(t_s) < 2 * _NEIGHBOURS + 1:
        return np.zeros(len(t_s), dtype=bool)
    padded = np.concatenate([t_s[:_NEIGHBOURS][::-1], t_s, t_s[-_NEIGHBOURS:][::-1]])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1)
    step = np.median(np.abs(np.diff(t_s)))
    return np.asarray(np.abs(t_s - np.median(windows, axis=1)) > _JUMP_STEPS * step)


def _turns(reference: ReferenceTrack, t_s: Array) -> BoolArray:
    # Above 80 deg of a low pass a mean of 10 s distorts the bias that it shows: which points are
    # kept depends on the model known so far, and a fit may stay where it began.
    if len(t_s) < 2:
        return np.zeros(len(t_s), dtype=bool)
    return np.asarray(np.abs(reference.at(t_s).azimuth_rate_rad_s) > _FASTEST_RAD_S)


def _repeats(t_s: Array) -> BoolArray:
    wrong = np.ones(len(t_s), dtype=bool)
    wrong[np.unique(t_s, return_index=True)[1]] = False
    return wrong


def _backward(t_s: Array) -> BoolArray:
    before = np.concatenate([[-np.inf], np.maximum.accumulate(t_s)[:-1]])
    return np.asarray(t_s <= before)
