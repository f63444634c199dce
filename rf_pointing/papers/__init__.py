"""The papers' tables, recomputed: one module per paper with `rows(seed) -> list[Row]`."""

from rf_pointing.papers.row import Row, as_table

__all__ = ["Row", "as_table"]
