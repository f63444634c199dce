"""The Gaussian beam that every radio part shares: P/P_nom = exp(-MU eps^2 / h^2), h the half-power beamwidth."""

import math

__all__ = ["MU"]

MU = 4.0 * math.log(2.0)
"""Exponent of the Gaussian beam: the power falls to exp(-mu/4) = 1/2 at half the half-power beamwidth."""
