"""What the machine may do: limits of travel and the choice of turn for a pass."""

from rf_pointing.planning.limits import AxisLimits, choose_turns, refusal

__all__ = ["AxisLimits", "choose_turns", "refusal"]
