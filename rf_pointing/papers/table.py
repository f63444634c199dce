"""The rows as a table for a terminal: numbers in columns, the remark below the row it belongs to."""

import textwrap
from collections.abc import Sequence

from rf_pointing.papers.row import Row

__all__ = ["as_table"]

WIDTH = 118
HEAD = ("quantity", "source", "paper", "ours", "unit", "tolerance", "holds")


def as_table(rows: Sequence[Row]) -> str:
    """Return the table of `rows`; `holds` reads yes, no, or explained."""
    cells = [HEAD, *(_cells(row) for row in rows)]
    widths = [max(len(cell[column]) for cell in cells) for column in range(len(HEAD))]
    lines = [_line(HEAD, widths), "  ".join("-" * width for width in widths)]
    for row, cell in zip(rows, cells[1:], strict=True):
        lines.append(_line(cell, widths))
        if row.remark:
            lines += textwrap.wrap(row.remark, WIDTH, initial_indent="    ", subsequent_indent="    ")
    kept = sum(row.holds for row in rows)
    explained = sum(row.explained and not row.holds for row in rows)
    lines.append(f"{kept} of {len(rows)} rows hold, {explained} explained, {len(rows) - kept - explained} open")
    return "\n".join(lines)


def _cells(row: Row) -> tuple[str, ...]:
    sign = "" if row.bound == "==" else f"{row.bound} "
    verdict = "yes" if row.holds else "explained" if row.explained else "NO"
    numbers = (f"{sign}{row.paper:.6g}", f"{row.ours:.6g}")
    return row.quantity, row.source, *numbers, row.unit, f"{row.tolerance:.3g}", verdict


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    return "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()
