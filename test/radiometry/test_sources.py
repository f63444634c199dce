"""Fluxes against published values, discs against closed forms, and figures against both."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import MU
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.dates import parse_utc
from rf_pointing.radiometry import sources
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.sources import EPOCH_2016_S, JANSKY, YEAR_S, flux_of, moon_brightness_k
from rf_pointing.radiometry.y_factor import figures, side_lobe_noise_k, source_noise_k
from rf_pointing.rf.beam import Beam, BeamParams
from rf_pointing.rf.budget import DISC_RAD, disc_noise_k, gain_of_beam_dbi, sun_brightness_k

NOW_S = parse_utc("2026-11-26T18:00:00")


@pytest.mark.parametrize(
    ("name", "megahertz", "epoch_year", "jansky", "within"),
    [
        # Baars et al. 1977, table 5: their own polynomials, at their epoch; 36 years of fading add 3 %.
        ("Cassiopeia A", 1400.0, 1980, 10 ** (5.745 - 0.770 * math.log10(1400.0)), 0.08),
        ("Cassiopeia A", 8000.0, 1980, 10 ** (5.745 - 0.770 * math.log10(8000.0)), 0.08),
        ("Cygnus A", 4000.0, 1980, 10 ** (7.161 - 1.244 * math.log10(4000.0)), 0.05),
        ("Taurus A", 8000.0, 1970, 10 ** (3.915 - 0.299 * math.log10(8000.0)), 0.08),
        ("Virgo A", 2700.0, 1980, 10 ** (5.023 - 0.856 * math.log10(2700.0)), 0.06),
    ],
)
def test_both_published_scales_agree_within_their_stated_errors(name, megahertz, epoch_year, jansky, within) -> None:
    flux = flux_of(name, 1e6 * megahertz, EPOCH_2016_S + (epoch_year - 2016) * YEAR_S)
    assert flux.flux_w_m2_hz / JANSKY == pytest.approx(jansky, rel=within)
    assert flux.relative_error <= within


def test_a_spectrum_is_continuous_where_one_scale_takes_over() -> None:
    for name in ("Cassiopeia A", "Taurus A", "Virgo A", "Cygnus A"):
        end_hz = {"Virgo A": 3e9, "Cygnus A": 12e9}.get(name, 4e9)
        below, above = (flux_of(name, end_hz * share, NOW_S).flux_w_m2_hz for share in (1.0 - 1e-9, 1.0 + 1e-9))
        assert below == pytest.approx(above, rel=1e-7)


@given(st.floats(0.2, 29.0), st.floats(0.0, math.tau))
def test_the_moon_is_between_new_and_full_and_lags_behind_its_phase(cm: float, phase: float) -> None:
    kelvin, error = moon_brightness_k(0.01 * cm, phase)
    assert 120.0 < kelvin < 300.0
    assert error <= 0.04
    # Warmest after the full Moon: as warm before the lag as after it.
    warmest = max(np.linspace(0.0, math.pi, 181), key=lambda p: moon_brightness_k(0.01 * cm, p)[0])
    assert math.radians(38.0) <= warmest <= math.radians(47.0)


def test_the_moon_at_3_cm_is_that_of_the_measurements() -> None:
    """Mezger and Strassl 1959, 1420 MHz: 250 +- 12 K; Strezhneva and Troitskii 1961, 3.2 cm: 210 K."""
    assert moon_brightness_k(0.032, math.radians(45.0 + 90.0))[0] == pytest.approx(210.0, rel=0.03)


def test_fluxes_without_a_published_value_are_refused() -> None:
    with pytest.raises(ValueError, match="name='3C 84' has no published flux here; those that have one: Sun, Moon"):
        flux_of("3C 84", 2e9, NOW_S)
    with pytest.raises(ValueError, match="frequency_hz of the flux of Virgo A=.* must be <= 25"):
        flux_of("Virgo A", 32e9, NOW_S)
    with pytest.raises(ValueError, match="sun_flux_sfu"):
        flux_of(sources.SUN, 2e9, NOW_S, sun_flux_sfu=-1.0)


# Discs


@given(st.floats(0.01, 4.0))
def test_the_response_on_the_axis_is_the_closed_form_of_a_gaussian_beam(radius: float) -> None:
    """K = x / (1 - exp(-x)), x = mu r^2 / h^2."""
    x = MU * radius**2
    assert DiscResponse(BeamParams()).correction(radius) == pytest.approx(x / -math.expm1(-x), rel=1e-9)


@pytest.mark.parametrize("pattern", ["gaussian", "tapered"])
@pytest.mark.parametrize("beamwidth_deg", [0.2, 0.65, 2.4])
def test_the_response_is_that_of_the_link_budget_over_rings(pattern: str, beamwidth_deg: float) -> None:
    beam = BeamParams(half_power_beamwidth_rad=math.radians(beamwidth_deg), pattern=pattern)
    apart = np.radians(np.linspace(0.0, 1.2 * beamwidth_deg, 7))
    rings = disc_noise_k(1.0, 0.0, Beam(beam), apart) * 4.0 / DISC_RAD**2
    width = beam.half_power_beamwidth_rad
    assert DiscResponse(beam).power((apart / width) ** 2, DISC_RAD / width, 3.0) == pytest.approx(
        rings, rel=3e-3, abs=2e-5
    )


# Figures of merit


@given(st.floats(0.3, 5.0), st.floats(50.0, 500.0), st.floats(1e9, 12e9))
def test_the_figures_are_those_that_made_the_y_factor(
    beamwidth_deg: float, system_k: float, frequency_hz: float
) -> None:
    """A dish on the Sun, its noise added up over rings by the link budget."""
    beam = BeamParams(half_power_beamwidth_rad=math.radians(beamwidth_deg))
    gain = gain_of_beam_dbi(beamwidth_deg)
    sun_k = float(disc_noise_k(sun_brightness_k(frequency_hz), gain, Beam(beam), 0.0)[0]) * 10.0**-0.02
    wavelength_m = SPEED_OF_LIGHT_M_S / frequency_hz
    diameter_m = wavelength_m / math.pi * math.sqrt(10.0 ** (0.1 * gain) / 0.6)
    found = figures(
        (1.0 + sun_k / system_k, 0.001), flux_of("Sun", frequency_hz, NOW_S), frequency_hz, beam, air_loss_db=0.2,
        gain_dbi=gain, system_noise_k=system_k, diameter_m=diameter_m,
    )  # fmt: skip
    assert found.g_over_t_db_k.value == pytest.approx(gain - 10.0 * math.log10(system_k), abs=0.01)
    assert found.system_noise_k.value == pytest.approx(system_k, rel=3e-3)
    assert found.efficiency.value == pytest.approx(0.6, rel=3e-3)
    # The quiet Sun is known to a fifth: 0.87 dB.
    assert found.g_over_t_db_k.sigma >= 0.86


def test_the_sun_in_a_side_lobe_adds_less_the_farther_it_is() -> None:
    sun = flux_of("Sun", 8.4e9, NOW_S)
    near, far = (side_lobe_noise_k(sun, 8.4e9, math.radians(angle)) for angle in (2.0, 20.0))
    assert near / far == pytest.approx(10.0**2.5)
    assert near < source_noise_k(sun, 8.4e9, 45.0)
