"""Response of a sensed error to motion of the beam: 1 if right, -1 if the sign is flipped."""

import math
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ResponseEstimate:
    """The response G and the standard deviation of its real and of its imaginary part."""

    value: complex
    sigma: float

    @property
    def phase_rad(self) -> float:
        """Angle by which the sensed error is turned."""
        return math.atan2(self.value.imag, self.value.real)

    @property
    def phase_sigma_rad(self) -> float:
        """Standard deviation of the angle, for a response well above its spread."""
        return self.sigma / max(abs(self.value), self.sigma / math.pi)


@dataclass(frozen=True, slots=True)
class ResponseSums:
    """Running sums over pairs of beam motion and change of the sensed error.

    A beam moved by d changes the sensed error by -G d (both as cross-elevation + j elevation).
    Weighted sums give G = -sum w conj(d) e / sum w |d|^2, with standard deviation
    1/sqrt(sum w |d|^2) in each part, w = 1 / variance per axis.
    """

    product: complex = 0j
    weight: float = 0.0

    @classmethod
    def of(cls, pairs: Iterable[tuple[complex, complex, float]]) -> "ResponseSums":
        """Return the sums of pairs as `with_pair` takes them."""
        product, weight = 0j, 0.0
        for moved, change, variance in pairs:
            # A weight without bound would silence all other pairs.
            if not variance > 0.0:
                raise ValueError(f"variance_rad2={variance} must be > 0")
            product -= moved.conjugate() * change / variance
            weight += abs(moved) ** 2 / variance
        return cls(product, weight)

    def with_pair(self, moved_rad: complex, change_rad: complex, variance_rad2: float) -> "ResponseSums":
        """Return the sums with one more pair; `variance_rad2` is that of the change, per axis."""
        one = ResponseSums.of([(moved_rad, change_rad, variance_rad2)])
        return ResponseSums(self.product + one.product, self.weight + one.weight)

    def faded(self, share: float) -> "ResponseSums":
        """Return the sums with the past counting `share` as much."""
        return ResponseSums(self.product * share, self.weight * share)

    def estimate(self) -> ResponseEstimate | None:
        """Return the response, None before the beam has moved."""
        if self.weight <= 0.0:
            return None
        return ResponseEstimate(self.product / self.weight, 1.0 / math.sqrt(self.weight))
