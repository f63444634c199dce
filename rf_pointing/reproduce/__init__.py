"""The papers' tables, recomputed: one module per paper with `rows(seed) -> list[Row]`."""

from rf_pointing.reproduce.row import Row

__all__ = ["Row"]
