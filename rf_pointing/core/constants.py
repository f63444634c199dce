"""Constants of nature, of the Earth and of beams that several folders need."""

import math

# Exact by the definition of the metre.
SPEED_OF_LIGHT_M_S = 299_792_458.0
# WGS 84, at the equator.
EARTH_RADIUS_M = 6_378_137.0
# WGS 84.
EARTH_MU_M3_S2 = 3.986_004_418e14
# 0 deg C, exact by definition.
ZERO_CELSIUS_K = 273.15
# Exponent of the Gaussian beam: the power falls to exp(-mu/4) = 1/2 at half the half-power
# beamwidth.
MU = 4.0 * math.log(2.0)
