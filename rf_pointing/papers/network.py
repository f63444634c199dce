"""Rows of the optical subnet: weather, coverage, telescope and link of a network of stations.

Shaik, Wonica and Wilhelm, "Optical subnet concepts for the Deep Space Network", TDA Progress Report
42-115 (OPTICAL).  Weather and availability are those of `planning/availability.py`, which plans of
a network use.  Coverage is spherical, with a fixed declination and the coordinates of the tables,
which are whole degrees.
"""

import math

import numpy as np
from scipy.integrate import trapezoid
from scipy.optimize import brentq
from scipy.special import j0
from scipy.stats import poisson

from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.types import Array, BoolArray
from rf_pointing.papers.row import Row
from rf_pointing.papers.two_stage import two_stage_rows
from rf_pointing.planning.availability import (
    WEATHER_M,
    availability,
    clear_probability,
    weather_correlation,
)

CLOUDY = 0.34
PLUTO_RAD = math.radians(-20.7)
"""Declination of Pluto in 2015."""
SITES = {
    "TMF": (-118.0, 34.0),
    "Mauna Kea": (-155.0, 20.0),
    "Siding Spring": (149.0, -31.0),
    "Ziarat": (68.0, 30.0),
    "Calar Alto": (-2.0, 37.0),
    "Cerro Pachan": (-71.0, -30.0),
}
"""Longitude and latitude of Table 4(a), deg."""
COS = ("TMF", "Siding Spring", "Calar Alto")
STEPS = 86400
"""Hour angles of one turn of the sky."""
LINE_DB, ZENITH_DB = 6.2, 2.35
"""Telemetry line of the mission, and loss at the zenith."""
F1_M, F_M, APART_M, BEHIND_M = 5.0, 77.5, 4.5, 7.75
WAVELENGTH_M, RANGE_M = 532e-9, 30.0 * 1.495978707e11
PLANCK_J_S = 6.62607015e-34
SYMBOLS, SLOT_S, DEAD_S, ERROR_RATE = 256, 10e-9, 3.2046e-6, 0.013
BACKGROUND = 7.36e-5
"""Detected background per slot."""
IDEAL = (
    (60.0, 6, 0.88),
    (60.0, 7, 0.91),
    (60.0, 8, 0.94),
    (75.0, 6, 0.92),
    (75.0, 7, 0.95),
    (75.0, 8, 0.96),
)
"""Zenith distance, stations and availability of ideal networks."""
DECIBELS = (
    ("night, ideal", 1716.0, 8.5),
    ("day, ARF, ideal", 1056.0, 6.4),
    ("day, conventional, ideal", 377.0, 2.0),
    ("average, ARF, ideal", 1386.0, 7.6),
    ("average, conventional, ideal", 1047.0, 6.4),
    ("night, Pluto", 1215.0, 7.0),
    ("day, ARF, Pluto", 774.0, 5.1),
    ("day, conventional, Pluto", 298.0, 0.94),
    ("average, ARF, Pluto", 994.0, 6.2),
    ("average, conventional, Pluto", 757.0, 5.0),
)
"""Rates (kb/s) and gains (dB) over 240 kb/s of Table 9."""


def rows(seed: int = 1) -> list[Row]:
    """Return every row of the paper; `seed` is that of wind and sensor of two-stage pointing."""
    found = [*weather_rows(), *coverage_rows(), *telescope_rows(), *link_rows(), *rate_rows()]
    return [*found, *two_stage_rows(seed)]


def weather_rows() -> list[Row]:
    """Return availabilities of equatorial stations, and the distance of independent weather."""
    far = {n: clear_probability([CLOUDY] * n, 1e9 * (1.0 - np.eye(n))) for n in (1, 2, 3)}
    apart_km = WEATHER_M * math.sqrt(2.0 * math.log(100.0)) / 1e3
    found = [
        Row("one station", "OPTICAL IV.B", 0.66, far[1], "", 0.001),
        Row(
            "two stations", "OPTICAL eq. 2", 0.88, far[2], "", 0.005, remark=f"exactly {far[2]:.4f}"
        ),
        Row(
            "three stations",
            "OPTICAL eq. 2",
            0.96,
            far[3],
            "",
            0.005,
            remark=f"exactly {far[3]:.4f}",
        ),
        Row(
            "seven stations, shares as rounded in the text",
            "OPTICAL Table 6",
            0.91,
            0.65 * far[2] + 0.35 * far[3],
            "",
            0.005,
            remark="0.9111",
        ),
        Row(
            "eight stations, shares as rounded in the text",
            "OPTICAL Table 6",
            0.94,
            0.34 * far[2] + 0.66 * far[3],
            "",
            0.001,
            due=(0.9347, 0.9349),
            remark="0.9348 rounds to 93; the exact share of two thirds gives 0.9353, which rounds to 94",
        ),
        Row(
            "correlation at 151.7 km",
            "OPTICAL eq. 1",
            0.01,
            weather_correlation(1e3 * apart_km),
            "",
            1e-6,
        ),
        Row("distance at which rho is 0.01", "OPTICAL IV.B", 150.0, apart_km, "km", 2.0),
        Row(
            "spacing of six stations",
            "OPTICAL IV.D",
            7000.0,
            math.tau * 6378.137 / 6.0,
            "km",
            330.0,
        ),
    ]
    for zenith_deg, count, paper in IDEAL:
        clear = _available([(360.0 * k / count, 0.0) for k in range(count)], 0.0, zenith_deg)[1]
        high = (zenith_deg, count) == (75.0, 8)
        found.append(
            Row(
                f"{count} stations on the equator to {zenith_deg:.0f} deg",
                "OPTICAL Table 6",
                paper,
                clear,
                "",
                0.005,
                remark="0.9693, which rounds to 97" if high else "",
                due=(0.9692, 0.9694) if high else None,
            )
        )
    return found


def coverage_rows() -> list[Row]:
    """Return coverage and availability of the actual sites for Pluto."""
    line_deg = math.degrees(math.acos(ZENITH_DB / LINE_DB))
    cos, ldos = [SITES[name] for name in COS], list(SITES.values())
    share = {deg: _available(cos, PLUTO_RAD, deg)[0] for deg in (60.0, line_deg, 70.0)}
    six = {deg: _available(ldos, PLUTO_RAD, deg) for deg in (60.0, 65.0, line_deg, 70.0)}
    gap_h = 24.0 * (1.0 - share[70.0])
    return [
        Row(
            "zenith distance of the -6.2 dB line",
            "OPTICAL IV.A",
            70.0,
            line_deg,
            "deg",
            0.5,
            due=(67.6, 67.8),
            remark="arccos(2.35 / 6.2); the text calls it approximately 70 deg",
        ),
        Row(
            "coverage of COS 3x3 to 60 deg",
            "OPTICAL IV.D",
            100.0,
            100.0 * share[60.0],
            "%",
            0.5,
            due=(61.0, 61.2),
            remark="100 % is that of ideal sites on the equator; the actual sites see Pluto 61.1 % of the time",
        ),
        Row(
            "coverage of COS 3x3 on the -6.2 dB line",
            "OPTICAL Table 7",
            79.0,
            100.0 * share[line_deg],
            "%",
            0.5,
        ),
        Row(
            "coverage of COS 3x3 to 70 deg",
            "OPTICAL Table 7",
            79.0,
            100.0 * share[70.0],
            "%",
            0.5,
            due=(83.7, 83.9),
            remark="79 % belongs to 67.7 deg, and the gaps of 4 h to 70 deg: two limits in one statement",
        ),
        Row("gaps of COS 3x3 to 70 deg", "OPTICAL IV.D", 4.0, gap_h, "h", 0.15),
        Row(
            "coverage of LDOS 6 to 60 deg", "OPTICAL Table 7", 95.0, 100.0 * six[60.0][0], "%", 0.5
        ),
        Row("coverage of LDOS 6 to 65 deg", "OPTICAL IV.D", 100.0, 100.0 * six[65.0][0], "%", 0.0),
        Row(
            "availability of LDOS 6 on the -6.2 dB line",
            "OPTICAL Table 6",
            0.81,
            six[line_deg][1],
            "",
            0.01,
        ),
        Row(
            "availability of LDOS 6 to 70 deg",
            "OPTICAL Table 6",
            0.81,
            six[70.0][1],
            "",
            0.01,
            due=(0.838, 0.840),
            remark="81 % belongs to the line of 67.7 deg, which the paper calls 70 deg",
        ),
    ]


def telescope_rows() -> list[Row]:
    """Return the Ritchey-Chretien prescription of Table 1."""
    m, source = F_M / F1_M, "OPTICAL Table 1"
    behind = m * (F1_M - APART_M)
    ratio = behind / APART_M
    scale = 1e3 / F_M
    return [
        Row("secondary magnification", source, 15.5, m, "", 1e-9),
        Row("secondary to focus", source, BEHIND_M, behind, "m", 0.005),
        Row(
            "secondary radius of curvature",
            source,
            -1.069,
            -2.0 * (F1_M - APART_M) * m / (m - 1.0),
            "m",
            5e-4,
        ),
        Row(
            "primary aspheric deformation K1", source, -1.0009, -1.0 - 2.0 / m**3 * ratio, "", 5e-5
        ),
        Row(
            "secondary aspheric deformation K2",
            source,
            -1.3062,
            -1.0 - 2.0 / (m - 1.0) ** 3 * (m * (2.0 * m - 1.0) + ratio),
            "",
            5e-5,
        ),
        Row("scale at the focus", source, 12.9, scale, "urad/mm", 0.05),
        Row(
            "sidereal rate against the tracking rate",
            "OPTICAL Table 2",
            0.005,
            360.0 / 86164.09,
            "deg/s",
            0.0,
            "<=",
        ),
    ]


def link_rows() -> list[Row]:
    """Return the link of Appendix A, and its misprints."""
    gain = 0.8145 * (math.pi * 0.75 / WAVELENGTH_M) ** 2
    space = (WAVELENGTH_M / (4.0 * math.pi * RANGE_M)) ** 2
    receiver = (math.pi * 10.0 / WAVELENGTH_M) ** 2 * (1.0 - 0.3**2)
    power_w = 7.0 * gain * 0.8 * _pointing() * space * receiver * 0.7 * 0.6 * 0.24
    photon_j = PLANCK_J_S * SPEED_OF_LIGHT_M_S / WAVELENGTH_M
    symbol_s = SYMBOLS * SLOT_S + DEAD_S
    detected = power_w * 0.21 / photon_j
    needed, without = (_required(background) for background in (BACKGROUND, 0.0))
    source, printed = "OPTICAL App. A", 0.228e-11
    return [
        Row("transmitter gain", source, 0.160e14, gain, "", 0.005e14),
        Row("pointing efficiency", source, 0.893, _pointing(), "", 0.005),
        Row("space loss", source, 0.890e-40, space, "", 0.005e-40),
        Row(
            "receiver gain",
            source,
            0.446e16,
            receiver,
            "",
            0.01e16,
            due=(3.16e15, 3.18e15),
            remark="the printed gain contradicts the printed power: (pi D / lambda)^2 0.91 is 3.17e15, which gives it",
        ),
        Row("received power", source, printed, power_w, "W", 0.01e-11),
        Row("received power", source, -86.4, 10.0 * math.log10(power_w * 1e3), "dBm", 0.05),
        Row(
            "detected photoelectrons a second",
            source,
            0.255e7,
            detected,
            "1/s",
            0.01e7,
            due=(1.27e6, 1.29e6),
            remark="printed twice too large, and the symbol time half: the product is right",
        ),
        Row(
            "symbol time",
            source,
            0.290e-5,
            symbol_s,
            "s",
            0.005e-5,
            due=(5.764e-6, 5.765e-6),
            remark="256 slots of 10 ns and 3.2046 us of dead time",
        ),
        Row("detected photoelectrons a symbol", source, 7.36, detected * symbol_s, "", 0.05),
        Row(
            "detected background a slot",
            source,
            BACKGROUND,
            detected * symbol_s * 1e-5,
            "",
            2e-7,
            remark="extinction of 1e5 leaks 7.36e-5 of the symbol; the sky of 0.323e-17 W would give 1.8e-8",
        ),
        Row("required photoelectrons a symbol", source, 3.69, needed, "", 0.005),
        Row(
            "required without background",
            "ln(0.5 / BER)",
            math.log(0.5 / ERROR_RATE),
            without,
            "",
            0.01,
            remark="of equal counts one is drawn",
        ),
        Row("margin", source, 3.0, 10.0 * math.log10(7.36 / needed), "dB", 0.05),
        Row("peak power", source, 4000.0, 7.0 * symbol_s / SLOT_S, "W", 50.0),
        Row(
            "beam at 30 AU against the Earth's diameter",
            "OPTICAL IV.D",
            12756.0,
            1.121e-6 * RANGE_M / 1e3,
            "km",
            0.0,
            "<=",
        ),
    ]


def rate_rows() -> list[Row]:
    """Return rates and gains of Table 9, and the losses of the atmosphere in the text."""
    rate = math.log2(SYMBOLS) / (SYMBOLS * SLOT_S + DEAD_S) / 1e3
    wrong_db = ZENITH_DB / math.cos(math.radians(70.0))
    b = -math.log(0.2 / CLOUDY) / (0.23 * (30.0 - ZENITH_DB))
    return [
        Row("uncoded rate", "OPTICAL App. A", 1387.8, rate, "kb/s", 0.05),
        Row("coded rate", "OPTICAL Table 9", 1215.0, 0.877 * rate, "kb/s", 3.0),
        *(
            Row(
                f"gain, {name}",
                "OPTICAL Table 9",
                gain_db,
                10.0 * math.log10(kbps / 240.0),
                "dB",
                0.06,
            )
            for name, kbps, gain_db in DECIBELS
        ),
        Row(
            "between both lines",
            "OPTICAL Table 9",
            LINE_DB - 4.7,
            10.0 * math.log10(1716.0 / 1215.0),
            "dB",
            0.01,
        ),
        Row(
            "loss at 60 deg",
            "OPTICAL IV.B",
            4.7,
            ZENITH_DB / math.cos(math.radians(60.0)),
            "dB",
            0.01,
        ),
        Row(
            "loss at 70 deg",
            "OPTICAL IV.A",
            17.0,
            wrong_db,
            "dB",
            0.5,
            due=(6.8, 6.9),
            remark="three air masses of 2.35 dB are 6.9 dB; 17 dB contradicts the line of 6.2 dB as well",
        ),
        Row(
            "slope b of eq. 2 from w(30 dB) = 0.8",
            "OPTICAL IV.B",
            0.11,
            b,
            "1/dB",
            0.005,
            due=(0.083, 0.084),
            remark="of q = 0.34; 0.11 is that of q = 0.40, while TMF has 0.34",
        ),
    ]


def _available(
    places: list[tuple[float, float]], declination_rad: float, zenith_deg: float
) -> tuple[float, float]:
    """Return coverage and availability over a turn of the sky, to a zenith distance."""
    seen = np.column_stack([_seen(place, declination_rad, zenith_deg) for place in places])
    return availability(seen, [CLOUDY] * len(places), 1e9 * (1.0 - np.eye(len(places))))


def _seen(place: tuple[float, float], declination_rad: float, zenith_deg: float) -> BoolArray:
    longitude, latitude = map(math.radians, place)
    angles = math.tau * (np.arange(STEPS) + 0.5) / STEPS + longitude
    cosine = math.sin(latitude) * math.sin(declination_rad) + math.cos(latitude) * math.cos(
        declination_rad
    ) * np.cos(angles)
    return np.asarray(cosine >= math.cos(math.radians(zenith_deg)))


def _required(background: float) -> float:
    """Return the signal counts a symbol for the bit error rate (Poisson, equal counts drawn)."""
    bits = 0.5 * SYMBOLS / (SYMBOLS - 1.0)
    return float(
        brentq(lambda signal: bits * (1.0 - _right(signal, background)) - ERROR_RATE, 0.5, 20.0)
    )


def _right(signal: float, background: float) -> float:
    """Return the probability that the slot with the signal has the most counts."""
    counts = np.arange(60)
    own = poisson.pmf(counts, signal + background)
    at, below = poisson.pmf(counts, background), poisson.cdf(counts - 1, background)
    if background == 0.0:
        at, below = (counts == 0).astype(float), (counts > 0).astype(float)
    # All others below, or k of them equal: one of k + 1 is drawn.
    up_to = at + below
    safe = np.maximum(at, 1e-300)
    ties = np.where(
        at > 1e-15, (up_to**SYMBOLS - below**SYMBOLS) / (SYMBOLS * safe), below ** (SYMBOLS - 1)
    )
    return float(np.sum(own * ties))


def _pointing() -> float:
    """Return the mean gain of a truncated Gaussian beam with bias and jitter of 0.1 urad."""
    edge = np.linspace(0.0, 1.0, 801)
    field = np.exp(-((1.12 * edge) ** 2)) * edge

    def gain(angle_rad: Array) -> Array:
        phase = math.pi * 0.75 / WAVELENGTH_M * angle_rad
        wave = trapezoid(field * j0(phase[..., None] * edge), edge)
        return np.asarray((wave / trapezoid(field, edge)) ** 2)

    points, weights = np.polynomial.hermite_e.hermegauss(24)
    x, y = np.meshgrid(0.1e-6 + 0.1e-6 * points, 0.1e-6 * points, indexing="ij")
    weight = np.outer(weights, weights) / weights.sum() ** 2
    return float(np.sum(weight * gain(np.hypot(x, y))))
