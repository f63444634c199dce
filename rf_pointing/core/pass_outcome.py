"""The Gaussian beam, and what held, tracked and lost mean: the outcome of a pass is made here.

    g       = max(exp(-mu (error / h)^2), g_sidelobe)    power received over that on the axis
    held    = error <= h / 2                             the target is within the half-power beam
    tracked = seconds of the pass in which it is held; lost = all its other seconds
    loss    = -10 log10(mean of g over the pass)

h is the half-power beamwidth.  The Gaussian main lobe (CONSCAN eq. 1) ends in the sidelobes: below
-40 dB its number means nothing, and a mean of decibels would be that number.  The certificate
applies this to the motion that it plans, the controller to what axes and sensor tell it, the report
to the true error where a simulation knows it.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core.constants import MU

_DB_AT_ONE_BEAMWIDTH = 10.0 * MU / math.log(10.0)
# The envelope of the sidelobes of a parabolic dish some beamwidths from the axis.
SIDELOBE_DB = 40.0
SIDELOBE_POWER = 10.0 ** (-0.1 * SIDELOBE_DB)
HALF_POWER = 0.5
# Share of a pass that must be held, unless the station requires another.
LEAST_SHARE = 0.8
# Why a pass ends that was not interrupted.
LOSS_OF_SIGNAL = "loss of signal"
SCANNED = "the scan is complete"
# The prefix that the controller gives to what the antenna publishes.
OF_ANTENNA = "antenna fault: "
NOT_OFFERED = "is not offered"  # of a node that is not there, or not there again


def gaussian_gain(error_rad: ArrayLike, beamwidth_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the power at angles off the beam axis over that on it, for a half-power width."""
    return np.asarray(np.exp(-MU * np.square(np.divide(error_rad, beamwidth_rad))))


def gaussian_loss_db(error_rad: ArrayLike, beamwidth_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the loss of an offset in dB for a half-power width: -10 log10 of `gaussian_gain`."""
    return np.asarray(_DB_AT_ONE_BEAMWIDTH * np.square(np.divide(error_rad, beamwidth_rad)))


def received_power(error_rad: ArrayLike, beamwidth_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the power g (n,) received over that on the axis, never below the sidelobes."""
    power: NDArray[np.float64] = np.maximum(gaussian_gain(error_rad, beamwidth_rad), SIDELOBE_POWER)
    return power


def pointing_loss_db(power: ArrayLike) -> NDArray[np.float64]:
    """Return the loss (n,) of a power g, or of its mean, in dB: 0 to `SIDELOBE_DB`."""
    # A difference: without a loss it is 0.0, and not printed as -0.00.
    return np.asarray(0.0 - 10.0 * np.log10(np.clip(power, SIDELOBE_POWER, 1.0)))


def error_of_power_rad(power: float, beamwidth_rad: float) -> float:
    """Return how far off the axis the target is with this power; inverts `received_power`."""
    return beamwidth_rad * math.sqrt(-math.log(min(max(power, SIDELOBE_POWER), 1.0)) / MU)


def is_held(error_rad: ArrayLike, beamwidth_rad: ArrayLike) -> NDArray[np.bool_]:
    """Return where (n,) the target is within the half-power beam; an unknown error is not."""
    # The comparison is False for NaN, too.
    return np.asarray(np.asarray(error_rad) <= 0.5 * np.asarray(beamwidth_rad))


@dataclass(frozen=True, slots=True)
class PassOutcome:
    """Seconds tracked and lost, and the integral of g over both; outcomes of parts add up."""

    tracked_s: float = 0.0
    lost_s: float = 0.0
    received_s: float = 0.0

    @classmethod
    def of(cls, error_rad: ArrayLike, beamwidth_rad: ArrayLike, step_s: float) -> Self:
        """Return the outcome of samples (n,) of the error, each of which stands for `step_s`.

        A sample that is not a number is lost: nobody knows where the beam was.
        """
        error, width = np.broadcast_arrays(np.atleast_1d(error_rad), np.atleast_1d(beamwidth_rad))
        held = is_held(error, width)
        power = np.where(np.isfinite(error), received_power(error, width), SIDELOBE_POWER)
        return cls(
            step_s * int(held.sum()), step_s * int((~held).sum()), step_s * float(power.sum())
        )

    @classmethod
    def unseen(cls, seconds: float) -> Self:
        """Return the outcome of time in which nothing was received."""
        return cls(0.0, seconds, SIDELOBE_POWER * seconds)

    def __add__(self, other: "PassOutcome") -> "PassOutcome":
        return PassOutcome(
            self.tracked_s + other.tracked_s,
            self.lost_s + other.lost_s,
            self.received_s + other.received_s,
        )

    @property
    def duration_s(self) -> float:
        """Time of the pass that has been counted."""
        return self.tracked_s + self.lost_s

    @property
    def share(self) -> float:
        """Share of the time that was tracked, 0 before any."""
        return self.tracked_s / self.duration_s if self.duration_s > 0.0 else 0.0

    @property
    def mean_loss_db(self) -> float:
        """Loss of the mean power, 0 before any."""
        return (
            float(pointing_loss_db(self.received_s / self.duration_s))
            if self.duration_s > 0.0
            else 0.0
        )

    def why_not_tracked(self, reason: str, fault: str, least_share: float) -> str:
        """Return why the pass does not count as tracked, "" when it does.

        It does when it ended with the loss of signal, without a fault, and at least `least_share`
        of it was held.
        """
        if fault:
            return fault
        if reason != LOSS_OF_SIGNAL:
            return reason
        if self.share < least_share:
            return f"{100.0 * self.share:.0f} % of the pass was held, must be >= {100.0 * least_share:.0f} %"
        return ""
