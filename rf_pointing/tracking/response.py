"""Response of a sensed error to motion of the beam: 1 if right, -1 if the sign is flipped."""

import math
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

    def with_pair(self, moved_rad: complex, change_rad: complex, variance_rad2: float) -> "ResponseSums":
        """Return the sums with one more pair; `variance_rad2` is that of the change, per axis."""
        # A weight without bound would silence all other pairs.
        if not variance_rad2 > 0.0:
            raise ValueError(f"variance_rad2={variance_rad2} must be > 0")
        return ResponseSums(
            self.product - moved_rad.conjugate() * change_rad / variance_rad2,
            self.weight + abs(moved_rad) ** 2 / variance_rad2,
        )

    def faded(self, share: float) -> "ResponseSums":
        """Return the sums with the past counting `share` as much."""
        return ResponseSums(self.product * share, self.weight * share)

    def estimate(self) -> ResponseEstimate | None:
        """Return the response, None before the beam has moved."""
        if self.weight <= 0.0:
            return None
        return ResponseEstimate(self.product / self.weight, 1.0 / math.sqrt(self.weight))
