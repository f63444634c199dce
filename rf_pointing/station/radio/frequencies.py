"""Frequencies of a radio that follows a satellite: Doppler, transponder, converters.

A signal that arrives at t left the satellite at t - tau, and one that is sent at t arrives there at
t + tau.  With q = tau'(t), the range rate over c as a receiver sees it:

    received  f = f_down (1 - q(t)),   sent  f = f_up (1 - p)/(1 - 2 p),   p = q(t + 2 tau)

The two passbands of a transponder are held at the satellite: a point x above the middle of the
downlink is x above that of the uplink, and x below it where the transponder inverts.  A rig behind
a converter with the oscillator L is tuned to |f - L|.
"""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

from rf_pointing.core import SPEED_OF_LIGHT_M_S, Target
from rf_pointing.station.description.content import RigSection, TransponderSection

KEPT = 1000
"""Most targets that are kept; they come 2 s ahead, ten in a second."""
GAP_S = 1.0
"""Longest time between two of them: a line misses a low orbit by 0.7 Hz at 1 GHz then."""


@dataclass(frozen=True)
class Dial:
    """Frequencies on the air and on the dial of one rig, in Hz."""

    section: RigSection

    def of(self, frequency_hz: float) -> float:
        """Return what the rig is tuned to, in its own steps."""
        step_hz = self.section.step_hz
        plain_hz = abs(frequency_hz - 1e6 * self.section.oscillator_mhz) + self.section.offset_hz
        return round(round(plain_hz / step_hz) * step_hz, 1)

    def frequency_hz(self, dial_hz: float, near_hz: float) -> float:
        """Return the frequency on the air of a tuning, on `near_hz`'s side of the oscillator."""
        oscillator_hz = 1e6 * self.section.oscillator_mhz
        plain_hz = dial_hz - self.section.offset_hz
        return oscillator_hz - plain_hz if near_hz < oscillator_hz else oscillator_hz + plain_hz


class Channel(NamedTuple):
    """Middle of both passbands, and half of their width, in Hz; `up_hz` is None without uplink."""

    down_hz: float
    up_hz: float | None
    half_hz: float
    inverting: bool

    @classmethod
    def of(cls, section: TransponderSection) -> "Channel":
        """Return the channel of a section of the description."""
        up_hz = None if section.uplink_mhz is None else 1e6 * section.uplink_mhz
        half_hz = 500.0 * section.passband_khz
        return cls(1e6 * section.downlink_mhz, up_hz, half_hz, section.inverting)

    def uplink_hz(self, above_hz: float) -> float | None:
        """Return the uplink of a point of the downlink so far above its middle."""
        if self.up_hz is None:
            return None
        return self.up_hz - above_hz if self.inverting else self.up_hz + above_hz

    def above_hz(self, uplink_hz: float) -> float:
        """Return how far above the middle of the downlink a point of the uplink is."""
        above_hz = uplink_hz - (self.up_hz or 0.0)
        return -above_hz if self.inverting else above_hz


class Shifts(NamedTuple):
    """Frequency at the ground over that at the satellite, received and sent."""

    down: float
    up: float


class Motion:
    """Range and range rate of the target over time, from messages ahead of it."""

    def __init__(self) -> None:
        self.name = ""
        self._known: deque[Target] = deque(maxlen=KEPT)

    def take(self, target: Target) -> None:
        """Take the next target; it replaces those of later times, or another satellite's."""
        if target.name != self.name:
            self._known.clear()
        while self._known and self._known[-1].t_s >= target.t_s:
            self._known.pop()
        self.name = target.name
        self._known.append(target)

    def at(self, t_s: float) -> Shifts | None:
        """Return the shifts at a time, None where the target is not known."""
        now = self._rate(t_s)
        if now is None:
            return None
        ahead = self._rate(t_s + 2.0 * now[1] / SPEED_OF_LIGHT_M_S) or now
        q, p = now[0] / SPEED_OF_LIGHT_M_S, ahead[0] / SPEED_OF_LIGHT_M_S
        return Shifts(1.0 - q, (1.0 - p) / (1.0 - 2.0 * p))

    def _rate(self, t_s: float) -> tuple[float, float] | None:
        """Return range rate and range at a time, between the two messages around it."""
        later = None
        for each in reversed(self._known):
            if each.t_s <= t_s:
                if later is None or later.t_s - each.t_s > GAP_S:
                    return (each.range_rate_m_s, each.range_m) if each.t_s == t_s else None
                share = (t_s - each.t_s) / (later.t_s - each.t_s)
                faster_m_s = later.range_rate_m_s - each.range_rate_m_s
                range_m = each.range_m + share * (later.range_m - each.range_m)
                return each.range_rate_m_s + share * faster_m_s, range_m
            later = each
        return None
