"""What the active spacecraft's receiver hands to the tracker for one sequence of carriers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import as_finite_array, require_finite

__all__ = ["InterferometerMeasurement"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class InterferometerMeasurement:
    """Phases of S slots over nine paths around the epoch `t_s`, and the four couplings.

    `phase_rad` and `phase_rate_rad_s` (S, 3, 3) hold at each slot's middle; `amplitudes` (2, 2) are normalised to the
    expected maximum and averaged over the carriers, of standard deviation `amplitude_sigma`; `snr_forward` (S,) and
    `snr_return` (S, 3, 3) are the receiver's own power ratios; `locked` (S, 3, 3) says which loops held lock.
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
        if locked.shape != (slots, 3, 3) or locked.dtype != np.bool_:
            raise ValueError(
                f"locked has shape {locked.shape} and type {locked.dtype}, must be {(slots, 3, 3)} of bool"
            )
        object.__setattr__(self, "locked", locked)
