"""The limits of the machine, and the one function every commanded position passes.

A position outside a limit is refused with the axis, the limit and by how much; from outside, motion inward stays allowed.
"""

import math
from dataclasses import dataclass

from rf_pointing.core import Params, parameter, require_finite

__all__ = ["AxisLimits", "choose_turns", "refusal"]

SAME_RAD = 1e-9


@dataclass(frozen=True, kw_only=True)
class AxisLimits(Params):
    """Travel of both axes that the controller keeps, inside the servo's own stops."""

    azimuth_min_rad: float = parameter(math.radians(-220.0), "smallest azimuth", low=-20.0, high=20.0)
    azimuth_max_rad: float = parameter(math.radians(220.0), "largest azimuth", low=-20.0, high=20.0)
    elevation_min_rad: float = parameter(math.radians(4.0), "smallest elevation", low=-0.2, high=3.2)
    elevation_max_rad: float = parameter(math.radians(89.5), "largest elevation", low=-0.2, high=3.4)

    def check_together(self) -> None:
        """Refuse an empty travel."""
        for axis in ("azimuth", "elevation"):
            low, high = getattr(self, f"{axis}_min_rad"), getattr(self, f"{axis}_max_rad")
            if low >= high:
                raise ValueError(f"{axis}_min_rad={low} must be < {axis}_max_rad={high}")


def refusal(
    limits: AxisLimits, azimuth_rad: float, elevation_rad: float, present_rad: tuple[float, float] | None = None
) -> str:
    """Return "" when the position may be commanded, else which limit it breaks and by how much.

    `present_rad` is where the axes are: an axis that is itself outside may be commanded anywhere that is not further out.
    """
    for index, (axis, wanted) in enumerate((("azimuth", azimuth_rad), ("elevation", elevation_rad))):
        require_finite(axis, wanted)
        low, high = getattr(limits, f"{axis}_min_rad"), getattr(limits, f"{axis}_max_rad")
        if present_rad is not None:
            low, high = min(low, present_rad[index]), max(high, present_rad[index])
        if not low <= wanted <= high:
            bound, past = (low, low - wanted) if wanted < low else (high, wanted - high)
            return (
                f"{axis} {math.degrees(wanted):.3f} deg is {math.degrees(past):.3f} deg "
                f"past the limit {math.degrees(bound):.3f} deg"
            )
    return ""


def choose_turns(limits: AxisLimits, azimuth_min_rad: float, azimuth_max_rad: float, present_rad: float) -> int:
    """Return the whole turns to add to a pass so that all of it lies within the azimuth travel.

    Of the turns that fit, the one whose pass lies nearest to the present azimuth.  Raises ValueError when none fits.
    """
    turn = 2.0 * math.pi
    first = math.ceil((limits.azimuth_min_rad - azimuth_min_rad) / turn)
    last = math.floor((limits.azimuth_max_rad - azimuth_max_rad) / turn)
    if first > last:
        raise ValueError(
            f"azimuth {math.degrees(azimuth_min_rad):.1f} to {math.degrees(azimuth_max_rad):.1f} deg fits no turn within "
            f"the travel {math.degrees(limits.azimuth_min_rad):.1f} to {math.degrees(limits.azimuth_max_rad):.1f} deg"
        )
    middle = 0.5 * (azimuth_min_rad + azimuth_max_rad)
    away = {turns: abs(middle + turns * turn - present_rad) for turns in range(first, last + 1)}
    nearest = min(away.values())
    # Half a turn either way is a tie: the lower one, not the one that the last bits prefer.
    return next(turns for turns in away if away[turns] <= nearest + SAME_RAD)
