"""Beam patterns against closed forms and published antenna tables."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0

from rf_pointing.core import MDEG, MU
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD, Beam, BeamParams

PATTERNS = ("gaussian", "uniform", "tapered")
EXACT = 1e-12


@pytest.mark.parametrize("band", ["S", "X", "Ka"])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_power_is_half_at_half_the_beamwidth_in_any_direction(band: str, pattern: str) -> None:
    beam = Beam(BeamParams.for_band(band, pattern))
    angle = np.linspace(0.1, 6.2, 7)
    half = 0.5 * HALF_POWER_BEAMWIDTH_RAD[band]
    gain = beam.power_gain(half * np.cos(angle), half * np.sin(angle))
    assert gain == pytest.approx(np.full(7, 0.5), abs=EXACT)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_peak_is_one_and_the_pattern_is_smooth_through_it(pattern: str) -> None:
    beam = Beam(BeamParams.for_band("X", pattern))
    angle = np.array([0.0, 1e-9, 1e-6, 1e-4]) * 65.0 * MDEG
    assert beam.voltage(angle, 0.0) == pytest.approx(np.ones(4), abs=1e-7)
    assert beam.voltage(0.0, 0.0) == 1.0


def test_gaussian_is_equation_one_of_the_conscan_paper() -> None:
    h = 17.0 * MDEG
    beam = Beam(BeamParams(half_power_beamwidth_rad=h))
    x, y = 3.3 * MDEG, -5.1 * MDEG
    assert beam.power_gain(x, y) == pytest.approx(np.exp(-MU * (x**2 + y**2) / h**2), rel=EXACT)


def test_uniform_aperture_has_its_first_null_and_sidelobe_where_airy_put_them() -> None:
    beam = Beam(BeamParams.for_band("X", "uniform"))
    # Airy: half power at u = 1.61634, null at 3.83171, first sidelobe 17.57 dB down at 5.13562.
    scale = 0.5 * 65.0 * MDEG / 1.6163399
    assert abs(beam.voltage(3.8317060 * scale, 0.0)) < 1e-6
    assert 10.0 * np.log10(beam.power_gain(5.1356223 * scale, 0.0)) == pytest.approx(-17.57, abs=0.01)
    assert beam.voltage(5.1356223 * scale, 0.0) < 0.0


def test_full_taper_with_exponent_one_has_sidelobes_of_24_6_db() -> None:
    beam = Beam(BeamParams(pattern="tapered", edge_taper_db=60.0, taper_exponent=1))
    angle = np.linspace(60.0, 150.0, 2000) * MDEG
    gain_db = 10.0 * np.log10(beam.power_gain(angle, 0.0) + 1e-12)
    past_null = np.argmax(np.diff(gain_db) > 0.0)
    # Silver, circular aperture (1 - rho^2): 24.6 dB; the 60-dB pedestal moves it by less than 0.1 dB.
    assert gain_db[past_null:].max() == pytest.approx(-24.6, abs=0.1)


def test_taper_of_zero_db_is_the_uniform_aperture() -> None:
    angle = np.linspace(0.0, 200.0, 41) * MDEG
    tapered = Beam(BeamParams(pattern="tapered", edge_taper_db=0.0, taper_exponent=2))
    assert tapered.voltage(angle, 0.0) == pytest.approx(
        Beam(BeamParams(pattern="uniform")).voltage(angle, 0.0), abs=1e-12
    )


def test_a_tapered_beam_is_the_transform_of_its_illumination() -> None:
    """Illumination p + (1 - p)(1 - rho^2)^n: its Hankel transform by quadrature, over the half-power width."""
    beam = Beam(BeamParams(half_power_beamwidth_rad=1e-3, pattern="tapered", edge_taper_db=11.0, taper_exponent=2))
    rho, weight = np.polynomial.legendre.leggauss(60)
    rho, weight = 0.5 * (rho + 1.0), 0.5 * weight
    edge = 10.0 ** (-11.0 / 20.0)
    illumination = weight * rho * (edge + (1.0 - edge) * (1.0 - rho**2) ** 2)

    def voltage(u: float) -> float:
        return float(illumination @ j0(u * rho) / illumination.sum())

    half = brentq(lambda u: voltage(u) ** 2 - 0.5, 1.0, 4.0)
    for share in (1e-5, 2.5e-5, 0.3, 1.7, 2.9, 5.3):
        assert beam.voltage(share * 0.5e-3, 0.0) == pytest.approx(voltage(share * half), abs=1e-10)


def test_near_the_axis_the_uniform_beam_is_a_parabola() -> None:
    """1 - u^2/8, and 1.6163399 at half power: 1.2e-9 below the peak at u = 1e-4."""
    beam = Beam(BeamParams(half_power_beamwidth_rad=0.2 * 1.6163399, pattern="uniform"))
    u = np.array([0.3e-4, 0.9e-4, 1.1e-4])
    assert 1.0 - beam.voltage(0.1 * u, 0.0) == pytest.approx(u**2 / 8.0, abs=1e-13)


def test_unknown_band_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="band='Q' must be one of S, X, Ka"):
        BeamParams.for_band("Q")
