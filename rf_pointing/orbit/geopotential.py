"""The Earth's attraction beyond its point mass: EGM96 to degree 12, by Cunningham's recursion.

With x, y, z Earth-fixed, w = R (x + i y) / r^2 and the solid harmonics U_nm = V_nm + i W_nm,

    U_00 = R / r,   U_mm = (2 m - 1) w U_(m-1)(m-1)
    (n - m) U_nm = (2 n - 1) (z R / r^2) U_(n-1)m - (n + m - 1) (R / r)^2 U_(n-2)m

every component of the acceleration is linear in them (Montenbruck and Gill, Satellite Orbits,
3.2.5).  Coefficients: Lemoine et al., NASA/TP-1998-206861, tide free, fully normalised.
"""

import math
from functools import lru_cache

import numpy as np

from rf_pointing.core import EARTH_MU_M3_S2, Array, ComplexArray

EGM96_RADIUS_M = 6378136.3
MOST_DEGREES = 12
# Positions whose harmonics the processor's cache holds.
_AT_ONCE = 512
# Degree by degree from 2, C of every order and then S, in units of 1e-9.
_EGM96 = """
-484165.371736 -0.186987635955 2439.14352398 0 1.19528012031 -1400.16683654 957.254173792
2029.98882184 904.627768605 721.072657057 0 248.513158716 -619.025944205 1414.35626958
539.873863789 -536.321616971 350.694105785 990.771803829 -188.560802735 0 -473.440265853
662.671572540 -200.928369177 308.853169333 68.5323475630 -62.1012128528 652.438297612
-451.955406071 -295.301647654 174.971983203 0 -94.4226127525 -323.349612668 -214.847190624
49.6658876769 -669.384278219 -149.957994714 -76.0879384947 48.1732442832 57.1730990516
-86.2142660109 -267.133325490 9.67616121092 0 26.2890545501 -373.728201347 9.02694517163
-471.408154267 -536.488432483 -237.192006935 90.9789371450 279.872910488 329.743816488
250.398657706 -275.114355257 1.93765507243 -358.856860645 1.09185148045 0 95.4336911867
93.0667596042 -217.198608738 -123.800392323 17.7377719872 151.789817739 24.4415707993 49.6711667324
23.3422047893 80.2978722615 -19.1877757009 -244.600105471 -25.5352403037 -65.7361610961
67.2811580072 -124.092493016 0 59.0060493411 65.4175425859 -86.3454445021 70.0233016934
89.1462164788 309.238461807 74.7440473633 120.533165603 27.6714300853 143.387502749 22.2288318564
-160.811502143 -9.00179225336 -16.6165092924 62.6941938248 -118.366323475 188.436022794
-47.7475386132 0 21.6834947618 -32.2196647116 -74.2287409462 19.4666779475 -54.1113191483
222.903525945 -96.5152667886 -3.08566220421 96.6412847714 52.6222488569 83.5115775652
-94.2413882081 -6.89895048176 -84.0764549716 -49.3395938185 -37.5885236598 8.11460540925
40.4927981694 125.491334939 100.538634409 0 -131.314331796 -51.5791657390 -153.768828694
-79.2806255331 -50.5370221897 -79.5667053872 -3.36629641314 -91.8705975922 -37.6516222392
-24.0148449520 -50.9613707522 15.1687209933 18.6309749878 -30.9871239854 -38.9580205051
37.7848029452 -1.18676592395 4.11565188074 -5.98410841300 -31.4231072723 -52.1882681927
46.0344448746 0 -26.8604146166 -99.0693862047 -148.131804260 -63.6666511980 49.4736238169
34.4769584593 -89.8252808977 24.3989612237 41.7731829829 -18.3364561788 -69.6662308185
37.7252636558 -54.0654977836 14.2979642253 39.3995876403 -68.6908127934 30.9411128730 3.41523275208
-18.6909958587 -25.3769398865 42.2880630662 -6.17619654902 11.2502994122 -2.49532607390 0
-43.5675748979 32.0975937619 24.4264863505 4.15081109011 7.82536279033 39.1765484449 35.6131849382
16.9361024629 25.2692598301 30.8375794212 -6.37946501558 -11.1780601900
"""


@lru_cache(maxsize=1)
def coefficients() -> ComplexArray:
    """Return C - i S (13, 13) by degree and order, without normalisation; 0 below degree 2."""
    numbers = iter(np.array(_EGM96.split(), dtype=np.float64))
    found = np.zeros((MOST_DEGREES + 1, MOST_DEGREES + 1), dtype=np.complex128)
    for n in range(2, MOST_DEGREES + 1):
        cosines, sines = ([next(numbers) for _ in range(n + 1)] for _ in range(2))
        for m, (c, s) in enumerate(zip(cosines, sines, strict=True)):
            share = (1 if m == 0 else 2) * (2 * n + 1)
            scale = math.sqrt(share * math.factorial(n - m) / math.factorial(n + m))
            found[n, m] = 1e-9 * scale * complex(c, -s)
    return found


@lru_cache(maxsize=16)
def _weights(*bands: tuple[int, int]) -> Array:
    """Return what V and W (columns, as `_harmonics` has them) add to x, y and z of each band."""
    weights = np.zeros((len(bands), 3, _first(max(band[1] for band in bands) + 2)), np.complex128)
    for found, (lowest, highest) in zip(weights, bands, strict=True):
        for n in range(lowest, highest + 1):
            row = _first(n + 1)
            for m in range(n + 1):
                c = coefficients()[n, m]
                # The derivatives of a harmonic are harmonics of the next degree.
                found[2, row + m] -= (n - m + 1) * c
                half = 1.0 if m == 0 else 0.5
                found[:2, row + m + 1] -= half * c
                if m > 0:
                    turned = 0.5 * (n - m + 2) * (n - m + 1) * c
                    found[:2, row + m - 1] += turned * np.array([1.0, -1.0])
    # The real part of x and z, the imaginary one of y.
    weights[:, 1] *= -1j
    return np.stack([weights.real, -weights.imag], axis=-1).reshape(3 * len(bands), -1)


def _first(degree: int) -> int:
    """Return the row of order 0 of a degree."""
    return degree * (degree + 1) // 2


@lru_cache(maxsize=1)
def _recursion() -> list[tuple[Array, Array]]:
    """Return the factors of the recursion, by degree, for orders below it and one less."""
    orders = [np.arange(n, dtype=np.float64).reshape(-1, 1, 1) for n in range(MOST_DEGREES + 2)]
    return [((2 * n - 1) / (n - m), ((n + m - 1) / (n - m))[:-1]) for n, m in enumerate(orders)]


def _harmonics(position_m: Array, degree: int) -> Array:
    """Return V_nm and W_nm (rows, 2, m) up to `degree` at Earth-fixed positions (m, 3)."""
    square = np.einsum("ij,ij->i", position_m, position_m)
    x, y, up = EGM96_RADIUS_M * position_m.T / square
    ratio = EGM96_RADIUS_M**2 / square
    rows = np.empty((_first(degree + 1), 2, len(square)))
    rows[0] = np.sqrt(ratio), np.zeros_like(ratio)
    # A whole degree at once: loops over orders would cost more than the arithmetic.
    for n, (rise, fall) in enumerate(_recursion()[1 : degree + 1], start=1):
        place, last = _first(n), _first(n - 1)
        np.multiply(rise * up, rows[last:place], out=rows[place : place + n])
        rows[place : place + n - 1] -= fall * ratio * rows[_first(n - 2) : last]
        v, w = (2 * n - 1) * rows[place - 1]
        rows[place + n] = x * v - y * w, x * w + y * v
    return rows


def attraction(position_m: Array, *bands: tuple[int, int]) -> Array:
    """Return the acceleration (bands, ..., 3) of the harmonics in each band of degrees, m/s^2.

    `position_m` (..., 3) is Earth-fixed.  A band is its first and last degree, both included and in
    [2, 12]; the point mass is not part of any.
    """
    weights, flat = _weights(*bands), position_m.reshape(-1, 3)
    last = max(band[1] for band in bands)
    found = np.empty((len(bands), 3, len(flat)))
    for first in range(0, len(flat), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        rows = _harmonics(flat[part], last + 1)
        found[..., part] = (weights @ rows.reshape(weights.shape[1], -1)).reshape(
            *found.shape[:2], -1
        )
    scale = EARTH_MU_M3_S2 / EGM96_RADIUS_M**2
    return np.asarray(scale * np.moveaxis(found, 1, -1)).reshape(len(bands), *position_m.shape)
