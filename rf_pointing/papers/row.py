"""A published number and ours: the row that every `reproduce` command prints, and its table."""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

WIDTH = 118
HEAD = ("quantity", "source", "paper", "ours", "unit", "tolerance", "holds")


@dataclass(frozen=True)
class Row:
    """A published number, ours, and whether ours lies within the tolerance.

    `tolerance` is absolute, in `unit`.  With `bound` "<=" or ">=" the paper's number is a limit on
    one side.  With a `factor` above 1 ours may be that much larger or smaller than the paper's
    number, and no more: an absolute tolerance above the number itself would accept a zero.
    `due` are the limits between which the measured reason in `remark` puts ours: a row that does
    not hold is explained there, and nowhere else.

    Raises
    ------
    ValueError
        If `bound` is unknown, `tolerance` is negative or not finite, `factor` is below 1 or has a
        bound or a tolerance as well, or `due` does not rise or lacks its remark.
    """

    quantity: str
    source: str
    paper: float
    ours: float
    unit: str
    tolerance: float
    bound: str = "=="
    remark: str = ""
    due: tuple[float, float] | None = None
    factor: float = 1.0

    def __post_init__(self) -> None:
        # Papers compute with numpy, whose scalars pass for float here.  Comparing them gives
        # numpy.bool_, which json refuses to write: plain Python from here on.
        for name in ("paper", "ours", "tolerance", "factor"):
            object.__setattr__(self, name, float(getattr(self, name)))
        if self.due is not None:
            object.__setattr__(self, "due", (float(self.due[0]), float(self.due[1])))
        if self.bound not in ("==", "<=", ">="):
            raise ValueError(f"bound={self.bound!r} must be one of ==, <=, >=")
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance={self.tolerance} must be finite and >= 0")
        if not (math.isfinite(self.factor) and self.factor >= 1.0):
            raise ValueError(f"factor={self.factor} must be finite and >= 1")
        if self.factor > 1.0 and (self.bound != "==" or self.tolerance > 0.0 or self.paper <= 0.0):
            raise ValueError(
                f"factor={self.factor} goes with a positive number, without bound and tolerance"
            )
        if self.due is not None and not (
            self.remark and -math.inf < self.due[0] <= self.due[1] < math.inf
        ):
            raise ValueError(
                f"due={self.due} must be two finite limits with a remark for {self.quantity!r}"
            )

    @property
    def holds(self) -> bool:
        """Whether ours lies within the tolerance of the paper's number (one-sided where `bound`
        says so).
        """
        # An infinite time or a NaN is a failure to measure and never holds, whatever the bound.
        if not math.isfinite(self.ours):
            return False
        if self.bound == "<=":
            return self.ours <= self.paper + self.tolerance
        if self.bound == ">=":
            return self.ours >= self.paper - self.tolerance
        if self.factor > 1.0:
            return self.paper / self.factor <= self.ours <= self.paper * self.factor
        return abs(self.ours - self.paper) <= self.tolerance

    @property
    def explained(self) -> bool:
        """Whether ours is what the measured reason makes of it."""
        return self.due is not None and self.due[0] <= self.ours <= self.due[1]

    @property
    def accepted(self) -> bool:
        """Whether the row holds or carries its measured explanation."""
        return self.holds or self.explained


def near(due: float | None, within: float) -> tuple[float, float] | None:
    """Return the limits of a number to the share `within`, None without a reason for one."""
    return None if due is None else (due - within * abs(due), due + within * abs(due))


def as_table(rows: Sequence[Row]) -> str:
    """Return the table of `rows`; `holds` reads yes, no, or explained."""
    cells = [HEAD, *(_cells(row) for row in rows)]
    widths = [max(len(cell[column]) for cell in cells) for column in range(len(HEAD))]
    lines = [_line(HEAD, widths), "  ".join("-" * width for width in widths)]
    for row, cell in zip(rows, cells[1:], strict=True):
        lines.append(_line(cell, widths))
        if row.remark:
            # Below the row: a column of remarks would be wider than any terminal.
            lines += textwrap.wrap(
                row.remark, WIDTH, initial_indent="    ", subsequent_indent="    "
            )
    kept = sum(row.holds for row in rows)
    explained = sum(row.explained and not row.holds for row in rows)
    lines.append(
        f"{kept} of {len(rows)} rows hold, {explained} explained, {len(rows) - kept - explained} open"
    )
    return "\n".join(lines)


def _cells(row: Row) -> tuple[str, ...]:
    sign = "" if row.bound == "==" else f"{row.bound} "
    verdict = "yes" if row.holds else "explained" if row.explained else "NO"
    numbers = (f"{sign}{row.paper:.6g}", f"{row.ours:.6g}")
    allowed = f"x/{row.factor:g}" if row.factor > 1.0 else f"{row.tolerance:.3g}"
    return row.quantity, row.source, *numbers, row.unit, allowed, verdict


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    return "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()
