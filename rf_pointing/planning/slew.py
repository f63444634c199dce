"""Time of a slew from rest to rest at the machine's limits: t = d/v + v/a, or 2 sqrt(d/a) when v is not reached."""

import math

__all__ = ["slew_time_s"]


def slew_time_s(distance_rad: float, rate_rad_s: float, acceleration_rad_s2: float) -> float:
    """Return the time to move one axis by `distance_rad` (either sign) from rest to rest."""
    distance = abs(distance_rad)
    if distance < rate_rad_s**2 / acceleration_rad_s2:
        return 2.0 * math.sqrt(distance / acceleration_rad_s2)
    return distance / rate_rad_s + rate_rad_s / acceleration_rad_s2
