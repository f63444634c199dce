"""Measurement of the active spacecraft's receiver in one sequence, and its phase noise.

sigma_phi^2 = 1/(2R) per link (PI83 eq. 7-3), 1/(2RF) + 1/(2RR) for the way out and back.  Noise of
the forward link is common to all nine paths.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import as_finite_array, require_finite
from rf_pointing.core.types import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class InterferometerMeasurement:
    """Phases of S slots over nine paths around the epoch `t_s`, and the four couplings.

    `phase_rad` and `phase_rate_rad_s` (S, 3, 3) hold at each slot's middle; `amplitudes` (2, 2) are
    normalised to the expected maximum and averaged over the carriers, of standard deviation
    `amplitude_sigma`; `snr_forward` (S,) and `snr_return` (S, 3, 3) are the receiver's own power
    ratios; `locked` (S, 3, 3) says which loops held lock.
    """

    t_s: float
    phase_rad: Array
    phase_rate_rad_s: Array
    amplitudes: Array
    amplitude_sigma: float
    snr_forward: Array
    snr_return: Array
    locked: NDArray[np.bool_]

    def __post_init__(self) -> None:
        require_finite("t_s", self.t_s)
        require_finite("amplitude_sigma", self.amplitude_sigma)
        if self.amplitude_sigma <= 0.0:
            raise ValueError(f"amplitude_sigma={self.amplitude_sigma} must be > 0")
        slots = len(np.atleast_1d(self.snr_forward))
        # Shapes are checked at the entry: a message with paths in another order would otherwise
        # give a plausible pose.
        shapes = {
            "phase_rad": (slots, 3, 3),
            "phase_rate_rad_s": (slots, 3, 3),
            "amplitudes": (2, 2),
            "snr_forward": (slots,),
            "snr_return": (slots, 3, 3),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, as_finite_array(name, getattr(self, name), shape))
        locked = np.asarray(self.locked)
        # numpy would take numbers for truth values: a loop that reports 0.4 is a fault of the
        # sender.
        if locked.shape != (slots, 3, 3) or locked.dtype != np.bool_:
            raise ValueError(
                f"locked has shape {locked.shape} and type {locked.dtype}, must be {(slots, 3, 3)} of bool"
            )
        object.__setattr__(self, "locked", locked)


def phase_variance(snr: ArrayLike) -> Array:
    """Return the phase variance 1/(2R) in rad^2 of one link (PI83 eq. 7-3); refuses R <= 0."""
    ratio = np.asarray(snr, dtype=np.float64)
    # Written so that NaN is rejected too.
    if not np.all(ratio > 0.0):
        raise ValueError(f"snr={float(np.min(ratio))} must be > 0")
    return 0.5 / ratio


def phase_rate_sigma_rad_s(phase_sigma_rad: ArrayLike, dwell_s: float) -> Array:
    """Return sqrt(12) sigma_phi/T.

    The Cramer-Rao bound of a tone's frequency, phase held at the dwell's middle.  The power ratio
    counts for the whole dwell, as if the bandwidth were 1/T: pessimistic when it is wider.
    """
    return np.asarray(np.sqrt(12.0) * np.asarray(phase_sigma_rad, dtype=np.float64) / dwell_s)
