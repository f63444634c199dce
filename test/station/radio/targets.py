"""Targets of which only range and range rate count."""

from rf_pointing.core import Target


def target(t_s: float, name: str = "RS-44", rate_m_s: float = 6500.0) -> Target:
    """Return a target 1000 km away."""
    rest = dict.fromkeys(
        set(Target.__slots__) - {"t_s", "name", "range_m", "range_rate_m_s", "uncertainty"}, 0.0
    )
    return Target(t_s=t_s, name=name, range_m=1e6, range_rate_m_s=rate_m_s, **rest)
