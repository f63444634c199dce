"""What an operator told the ephemeris publisher, kept over a restart: the target, its offsets, and the hold.

A file that belongs to another configuration (elements, satellite, station, offsets at the start) is out of date: what the
configuration says now counts.
"""

import dataclasses
from typing import Any

from rf_pointing.core.kept_state import KeptState
from rf_pointing.ephemeris.source import SourceParams

__all__ = ["TargetMemory"]


class TargetMemory:
    """The state file of one publisher; an empty name remembers nothing."""

    def __init__(self, name: str, configured: SourceParams) -> None:
        self._state, self._configured = KeptState(name), configured
        kept = self._state.recover()
        mine = kept.get("configured") == dataclasses.asdict(configured)
        self._kept: dict[str, Any] = kept if mine else {}

    @property
    def source(self) -> SourceParams:
        """The source as it was last, or as configured."""
        kept = dict(self._kept.get("source", {}))
        if "weather" in kept:
            kept["weather"] = self._configured.weather.replace(**kept["weather"])
        return self._configured.replace(**kept)

    @property
    def peak_rad(self) -> float:
        """Least peak of the passes that were asked for."""
        return float(self._kept.get("peak_rad", 0.0))

    @property
    def hold_t_s(self) -> float | None:
        """Instant at which the target is held, None when it moves."""
        held_s = self._kept.get("hold_t_s")
        return None if held_s is None else float(held_s)

    def keep(self, source: SourceParams, peak_rad: float, hold_t_s: float | None) -> None:
        """Write what has changed."""
        configured = dataclasses.asdict(self._configured)
        self._kept = {"source": dataclasses.asdict(source), "peak_rad": peak_rad, "hold_t_s": hold_t_s}
        self._state.keep({"configured": configured, **self._kept})

    @property
    def problem(self) -> str:
        """Why the file does not hold what it should, empty when it does."""
        return self._state.problem
