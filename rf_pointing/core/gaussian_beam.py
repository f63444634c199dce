"""The Gaussian beam of every radio part: P/P_nom = exp(-MU eps^2 / h^2) (CONSCAN eq. 1).

h is the half-power beamwidth.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Exponent of the Gaussian beam: the power falls to exp(-mu/4) = 1/2 at half the half-power
# beamwidth.
MU = 4.0 * math.log(2.0)
_DB_AT_ONE_BEAMWIDTH = 10.0 * MU / math.log(10.0)


def gaussian_gain(error_rad: ArrayLike, beamwidth_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the power at angles off the beam axis over that on it, for a half-power width."""
    return np.asarray(np.exp(-MU * np.square(np.divide(error_rad, beamwidth_rad))))


def gaussian_loss_db(error_rad: ArrayLike, beamwidth_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the loss of an offset in dB for a half-power width: -10 log10 of `gaussian_gain`."""
    return np.asarray(_DB_AT_ONE_BEAMWIDTH * np.square(np.divide(error_rad, beamwidth_rad)))
