"""One published number beside ours: the line every `reproduce` command prints."""

import math
from dataclasses import dataclass

__all__ = ["Row"]


@dataclass(frozen=True, kw_only=True)
class Row:
    """A published number, ours, and whether ours lies within the tolerance.

    `tolerance` is absolute, in `unit`.  With `bound` "<=" or ">=" the paper's number is a one-sided limit.  A row that
    does not hold needs a `remark` with the measured reason; `explained` says that it carries one.
    """

    quantity: str
    source: str
    paper: float
    ours: float
    unit: str
    tolerance: float
    bound: str = "=="
    remark: str = ""
    explained: bool = False

    def __post_init__(self) -> None:
        if self.bound not in ("==", "<=", ">="):
            raise ValueError(f"bound={self.bound!r} must be one of ==, <=, >=")
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance={self.tolerance} must be finite and >= 0")
        if self.explained and not self.remark:
            raise ValueError(f"explained={self.explained} needs a remark for {self.quantity!r}")

    @property
    def holds(self) -> bool:
        """Whether ours lies within the tolerance of the paper's number (one-sided where `bound` says so)."""
        if not math.isfinite(self.ours):
            return False
        if self.bound == "<=":
            return self.ours <= self.paper + self.tolerance
        if self.bound == ">=":
            return self.ours >= self.paper - self.tolerance
        return abs(self.ours - self.paper) <= self.tolerance

    @property
    def accepted(self) -> bool:
        """Whether the row holds or carries its measured explanation."""
        return self.holds or self.explained
