"""Link, atmosphere and system noise."""

import math

import numpy as np
import pytest

from rf_pointing.rf import AtmosphereParams, Link, LinkParams, NoiseParams
from rf_pointing.rf.noise import air_mass, atmosphere_loss_db, system_noise_k

ZENITH = 0.5 * math.pi


def ka_link(**changes: float) -> Link:
    return Link(LinkParams(**changes), AtmosphereParams(zenith_loss_db=0.14), NoiseParams(lna_k=45.0, dichroic_k=1.34))


# itur 0.4.0: ITU-R P.676-12 Annex 1, line by line through bent rays in the annual standard atmosphere, at 2.2 to 32 GHz.
@pytest.mark.parametrize(
    ("elevation_deg", "annex_1", "within"),
    [
        (5.5, (9.878, 9.930, 9.972, 10.117, 10.111, 10.041), 0.017),
        (10.0, (5.658, 5.667, 5.675, 5.703, 5.702, 5.688), 0.0052),
        (20.0, (2.911, 2.913, 2.914, 2.917, 2.917, 2.915), 0.0013),
    ],
)
def test_air_mass_is_that_of_the_lines_of_the_recommendation(
    elevation_deg: float, annex_1: tuple[float, ...], within: float
) -> None:
    """The cosecant, which its Annex 2 takes above 5 deg, is 3 to 6 % more at 5.5 deg."""
    np.testing.assert_allclose(annex_1, air_mass(np.radians(elevation_deg), 6000.0), rtol=within)


def test_air_mass_is_one_at_zenith_cosecant_high_up_and_finite_on_the_horizon() -> None:
    assert air_mass(ZENITH, 6000.0) == pytest.approx(1.0, abs=1e-12)
    elevation = np.radians([20.0, 45.0, 70.0])
    assert air_mass(elevation, 6000.0) == pytest.approx(1.0 / np.sin(elevation), rel=0.006)
    assert air_mass(0.0, 6000.0) == pytest.approx(math.sqrt(2.0 * 6_371_000.0 / 6000.0 + 1.0) - 0.0, rel=1e-12)


def test_air_mass_past_the_zenith_is_that_of_the_mirrored_elevation() -> None:
    assert air_mass(math.radians(110.0), 6000.0) == pytest.approx(air_mass(math.radians(70.0), 6000.0), rel=1e-12)


def test_below_the_horizon_is_refused() -> None:
    with pytest.raises(ValueError, match=r"elevation_rad=-0.1 must be >= 0"):
        air_mass(-0.1, 6000.0)


def test_air_that_halves_the_power_gives_half_of_each_sky() -> None:
    """3.0103 dB at the zenith: half of 4 K from behind and half of 280 K of the air, then the receiver."""
    half = AtmosphereParams(zenith_loss_db=10.0 * math.log10(2.0), physical_temperature_k=280.0)
    noise = NoiseParams(lna_k=20.0, dichroic_k=3.0, ground_k=7.0, cosmic_k=4.0)
    assert system_noise_k(noise, half, ZENITH) == pytest.approx(2.0 + 140.0 + 30.0, rel=1e-12)


def test_low_pass_loses_spreading_air_and_noise() -> None:
    link = ka_link()
    elevation = math.radians(10.0)
    air = float(atmosphere_loss_db(link.atmosphere, elevation) - atmosphere_loss_db(link.atmosphere, ZENITH))
    there, above = (float(system_noise_k(link.noise, link.atmosphere, each)) for each in (elevation, ZENITH))
    noise = 10.0 * math.log10(there / above)
    expected = 60.0 - 20.0 * math.log10(4.0) - air - noise
    assert link.carrier_to_noise_db_hz(2000e3, elevation) == pytest.approx(expected, abs=1e-12)
    assert air > 0.5
    assert noise > 1.0


def test_a_range_below_a_metre_is_a_range() -> None:
    assert ka_link(reference_range_m=1.0).carrier_to_noise_db_hz(0.1, ZENITH) == pytest.approx(80.0)


def test_range_of_zero_is_refused() -> None:
    with pytest.raises(ValueError, match=r"range_m=0.0 must be > 0"):
        ka_link().carrier_to_noise_db_hz(0.0, 1.0)


def test_without_air_the_level_of_a_range_is_that_of_the_link() -> None:
    """Four times as far is 12.04 dB less; the satellite's antenna adds its own gain."""
    params = LinkParams(zenith_carrier_to_noise_db_hz=57.3)
    assert params.level_db_hz(2000e3) == pytest.approx(57.3 - 12.0412, abs=1e-4)
    assert params.level_db_hz(2000e3) == pytest.approx(
        float(ka_link(zenith_carrier_to_noise_db_hz=57.3).carrier_to_noise_db_hz(2000e3, ZENITH))
    )
    assert params.level_db_hz(500e3, satellite_gain_db=-3.0) == pytest.approx(54.3)
