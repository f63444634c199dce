"""What comes from the station: angles, range and range rate of one pass at the full rate, not yet trusted."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["CHANNELS", "RawTracking", "StageReport", "split_passes"]

Array = NDArray[np.float64]

_NEIGHBOURS = 2
CHANNELS = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")


@dataclass(frozen=True, kw_only=True, eq=False)
class RawTracking:
    """Samples of one pass of `target` over `station`, arrays (n,); values may still be wrong in any way.

    `good` is the station's own flag for transmission and quality.  Range and range rate may be absent (None); `notes` say
    what of the message they come from was left out.
    """

    station: str
    band: str
    target: str
    t_s: Array
    azimuth_rad: Array
    elevation_rad: Array
    range_m: Array | None
    range_rate_m_s: Array | None
    good: NDArray[np.bool_]
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


@dataclass(frozen=True, kw_only=True)
class StageReport:
    """What one stage of the pipeline did: rows in, rows out, and why rows were dropped."""

    stage: str
    before: int
    after: int
    dropped: Mapping[str, int]
    note: str = ""

    def text(self) -> str:
        """Return one line for people."""
        reasons = ", ".join(f"{count} {reason}" for reason, count in self.dropped.items() if count)
        line = f"{self.stage}: {self.before} -> {self.after}" + (f" (dropped {reasons})" if reasons else "")
        return f"{line}; {self.note}" if self.note else line


def split_passes(raw: RawTracking, gap_s: float) -> list[RawTracking]:
    """Return the samples between gaps longer than `gap_s`; one wrong time tag is no gap.

    Orbit errors belong to one pass: a day of passes in one file must not share them.
    """
    rows = np.flatnonzero(np.isfinite(raw.t_s))
    if len(rows) < 2 * _NEIGHBOURS + 1:
        return [raw]
    padded = np.pad(raw.t_s[rows], _NEIGHBOURS, mode="edge")
    usual = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1), axis=1)
    cuts = rows[np.flatnonzero(np.abs(np.diff(usual)) > gap_s) + 1]
    values = {"t_s": raw.t_s, "good": raw.good, **raw.channels}
    parts = {name: np.split(value, cuts) for name, value in values.items()}
    return [replace(raw, **{name: part[k] for name, part in parts.items()}) for k in range(len(cuts) + 1)]


def _column(name: str, value: ArrayLike, length: int | None) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim != 1 or (length is not None and len(array) != length):
        raise ValueError(f"{name} has shape {array.shape}, must be ({'n' if length is None else length},)")
    return array
