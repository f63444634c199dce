"""When a measurement arrives: its stamp must not lie ahead of the clock, or everything after it would count as late."""

from rf_pointing.core import require_finite

__all__ = ["LARGEST_LEAD_S", "require_arrived"]

LARGEST_LEAD_S = 5.0
"""Simulation time reaches the nodes one by one, so a stamp may be ahead of a node's clock by some of its steps."""


def require_arrived(t_s: float, now_s: float) -> None:
    """Raise ValueError if a measurement of `t_s` cannot have been made by `now_s`."""
    require_finite("t_s", t_s)
    if t_s > now_s + LARGEST_LEAD_S:
        raise ValueError(f"t_s={t_s} is {t_s - now_s:.6g} s ahead of the clock, must be <= {LARGEST_LEAD_S} s")
