"""Faults of a simulated antenna's own parts, put in on request: for tests of what the control unit does about them."""

import math

from rf_pointing.core import require_choice, require_finite

__all__ = ["FAULTS", "InjectedFaults"]

Pair = tuple[float, float]
FAULTS = ("none", "encoder_frozen", "encoder_jump", "encoder_spike", "encoder_lie", "encoder_nan", "runaway", "gust",
          "anemometer_silent")  # fmt: skip
AZIMUTH = 0


class InjectedFaults:
    """At most one fault at a time, all of the azimuth axis; `value` in rad, rad/s or m/s."""

    def __init__(self) -> None:
        self.kind, self._value = "none", 0.0
        self._frozen: Pair | None = None
        self._ticks = 0

    def inject(self, kind: str, value: float) -> None:
        """Put in a fault in place of the one before; "none" takes it out."""
        require_choice("fault", kind, FAULTS)
        require_finite("value", value)
        self.kind, self._value, self._frozen, self._ticks = kind, value, None, 0

    def encoder(self, angles: Pair, tick_s: float) -> Pair:
        """Return what the encoders show instead of `angles`."""
        self._ticks += 1
        azimuth, elevation = angles
        if self.kind == "encoder_frozen":
            self._frozen = self._frozen or angles
            return self._frozen
        if self.kind == "encoder_jump" or (self.kind == "encoder_spike" and self._ticks <= 2):
            return azimuth + self._value, elevation
        if self.kind == "encoder_lie":
            return azimuth + self._value * self._ticks * tick_s, elevation
        return (math.nan if self.kind == "encoder_nan" else azimuth), elevation

    def rate_command(self, rates: Pair) -> Pair:
        """Return what the drives follow instead of `rates`."""
        return (self._value, rates[1]) if self.kind == "runaway" else rates

    def wind_speed(self, speed_m_s: float) -> float:
        """Return what the anemometer shows, NaN when it is silent."""
        if self.kind == "anemometer_silent":
            return math.nan
        return speed_m_s + self._value if self.kind == "gust" else speed_m_s
