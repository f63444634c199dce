"""Link budget: discs in the beam, the chain by Friis, gain, and the level of a satellite."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import MU, SPEED_OF_LIGHT_M_S
from rf_pointing.rf.beam import Beam, BeamParams
from rf_pointing.rf.budget import (
    DISC_RAD,
    disc_noise_k,
    gain_of_beam_dbi,
    noise_parts_k,
    sun_brightness_k,
    zenith_level_db_hz,
)
from rf_pointing.rf.link import Link, LinkParams
from rf_pointing.rf.noise import (
    BOLTZMANN_J_K,
    AtmosphereParams,
    NoiseParams,
    Stage,
    cascade_k,
    noise_of_figure_k,
    noise_of_plate_k,
    sky_k,
    system_noise_k,
)


def gaussian(width_rad: float) -> Beam:
    return Beam(BeamParams(half_power_beamwidth_rad=width_rad))


@pytest.mark.parametrize("width_deg", [0.017, 0.065, 0.65, 2.4, 30.0])
def test_a_beam_in_the_middle_of_the_disc_is_the_closed_form_of_a_gaussian(width_deg: float) -> None:
    width = math.radians(width_deg)
    found = disc_noise_k(1e4, 40.0, gaussian(width), 0.0)
    filled = math.pi * width**2 / (4.0 * math.log(2.0)) * (1.0 - math.exp(-MU * (DISC_RAD / width) ** 2))
    assert found == pytest.approx(1e4 * 1e4 / (4.0 * math.pi) * filled, rel=2e-4)


def test_a_wide_beam_receives_flux_times_effective_area_by_its_pattern() -> None:
    """k T = S A / 2, S = 2 k T_b Omega / wavelength^2, A = G wavelength^2 / 4 pi; 10 sfu at 245 MHz."""
    width, frequency = math.radians(40.0), 245e6
    gain_dbi, wavelength = gain_of_beam_dbi(40.0), SPEED_OF_LIGHT_M_S / frequency
    area = 10.0 ** (0.1 * gain_dbi) * wavelength**2 / (4.0 * math.pi)
    apart = np.radians([0.0, 5.0, 20.0, 40.0])
    found = disc_noise_k(sun_brightness_k(frequency), gain_dbi, gaussian(width), apart)
    np.testing.assert_allclose(
        found, 10e-22 * area / (2.0 * BOLTZMANN_J_K) * np.exp(-MU * (apart / width) ** 2), rtol=1e-3
    )


def test_the_disc_as_a_sum_of_points_off_the_axis() -> None:
    width, apart = math.radians(0.4), math.radians(0.5)
    line = (np.arange(801) - 400.0) / 400.0 * DISC_RAD
    x, y = np.meshgrid(line, line)
    inside = np.hypot(x, y) <= DISC_RAD
    power = np.exp(-MU * ((x + apart) ** 2 + y**2) / width**2)[inside].sum() * (line[1] - line[0]) ** 2
    found = disc_noise_k(225.0, 45.0, gaussian(width), apart)
    assert found == pytest.approx(225.0 * 10.0**4.5 / (4.0 * math.pi) * power, rel=2e-3)


def test_the_quiet_sun_has_the_floor_of_the_10_7_cm_flux() -> None:
    """67 sfu at 2.8 GHz, to the width of the table between its frequencies."""
    wavelength = SPEED_OF_LIGHT_M_S / 2.8e9
    flux = 2.0 * BOLTZMANN_J_K * sun_brightness_k(2.8e9) * math.pi * DISC_RAD**2 / wavelength**2
    assert 1e22 * flux == pytest.approx(67.0, abs=2.0)
    assert 9e3 < sun_brightness_k(36e9) < 11e3


stages = st.builds(Stage, st.floats(0.0, 1e4), st.floats(-30.0, 40.0))


@given(st.lists(stages, max_size=4), st.lists(stages, max_size=4))
def test_a_chain_is_its_first_part_and_what_follows_seen_through_its_gain(
    first: list[Stage], rest: list[Stage]
) -> None:
    gain = 10.0 ** (0.1 * sum(stage.gain_db for stage in first))
    assert cascade_k([*first, *rest]) == pytest.approx(cascade_k(first) + cascade_k(rest) / gain, rel=1e-9, abs=1e-9)


@given(st.floats(0.0, 30.0), st.floats(1.0, 400.0))
def test_a_cold_load_behind_a_loss_is_the_noise_figure_of_an_attenuator(loss_db: float, kelvin: float) -> None:
    """At 290 K a loss has a noise figure of itself; what it emits is its own noise behind its loss."""
    assert Stage.of_loss(loss_db).noise_k == pytest.approx(noise_of_figure_k(loss_db), rel=1e-12, abs=1e-12)
    behind = Stage.of_loss(loss_db, kelvin).noise_k * 10.0 ** (-0.1 * loss_db)
    assert noise_of_plate_k(loss_db, kelvin) == pytest.approx(behind, rel=1e-9, abs=1e-9)


def test_the_sky_at_408_mhz_and_at_vhf_is_that_of_the_surveys() -> None:
    """Coldest parts of the 408-MHz survey: 12 K; the mean at 150 MHz: 150 to 350 K."""
    assert 12.0 < sky_k(408e6) < 20.0
    assert 150.0 < sky_k(150e6) < 350.0
    assert sky_k(8e9) == pytest.approx(2.725, abs=0.01)


def test_the_parts_add_up_to_the_noise_of_the_receiver_and_the_sun_to_what_it_is_in_the_beam() -> None:
    link = Link(LinkParams(), AtmosphereParams(), NoiseParams(lna_k=60.0, dichroic_k=1.3))
    elevation, gain_dbi = np.radians([5.0, 30.0, 90.0]), gain_of_beam_dbi(2.4)
    beam = BeamParams(half_power_beamwidth_rad=math.radians(2.4))
    clear = noise_parts_k(link, beam, gain_dbi, 2.25e9, elevation)
    np.testing.assert_allclose(clear["system"], system_noise_k(link.noise, link.atmosphere, elevation), rtol=1e-12)
    apart = np.radians([0.0, 1.2, 90.0])
    with_sun = noise_parts_k(link, beam, gain_dbi, 2.25e9, elevation, apart)
    passed = clear["cosmic"] / link.noise.cosmic_k
    sun_k = passed * disc_noise_k(sun_brightness_k(2.25e9), gain_dbi, Beam(beam), apart)
    np.testing.assert_allclose(with_sun["system"] - clear["system"], sun_k, rtol=1e-9, atol=1e-9)
    assert sun_k[0] > 200.0


@given(st.floats(-30.0, 60.0), st.floats(0.0, 70.0), st.floats(1e8, 4e10), st.floats(1e5, 4e7), st.floats(10.0, 1e3))
def test_the_level_is_the_power_received_over_the_noise_density(
    eirp_dbw: float, gain_dbi: float, frequency_hz: float, range_m: float, noise_k: float
) -> None:
    """Flux of the satellite over a sphere, times effective area, over k T."""
    area = 10.0 ** (0.1 * gain_dbi) * (SPEED_OF_LIGHT_M_S / frequency_hz) ** 2 / (4.0 * math.pi)
    power = 10.0 ** (0.1 * (eirp_dbw - 1.5)) / (4.0 * math.pi * range_m**2) * area
    found = zenith_level_db_hz(eirp_dbw, gain_dbi, frequency_hz, range_m, 1.5, noise_k)
    assert found == pytest.approx(10.0 * math.log10(power / (BOLTZMANN_J_K * noise_k)), abs=1e-9)
