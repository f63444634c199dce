"""The papers' tables, recomputed: one module per paper with `rows(seed) -> list[Row]`."""

from rf_pointing.reproduce.row import Row
from rf_pointing.reproduce.table import as_table

__all__ = ["Row", "as_table"]
