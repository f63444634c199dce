"""The frame of an array of patches on a dish, and its errors against the Fisher information of the samples."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import j0, jnp_zeros

from rf_pointing.rf.dish_array import (
    BETWEEN,
    PERIOD_S,
    SEPARATION,
    SNAPSHOTS,
    DishArrayParams,
    direction_sigmas_rad,
    least_level_db_hz,
)

SHIPPED = DishArrayParams()


def test_the_arrays_frame_is_three_turns_of_the_beams() -> None:
    array = DishArrayParams(roll_rad=0.4, axis_cross_elevation_rad=0.3, axis_elevation_rad=-0.2)
    wanted = Rotation.from_euler("ZXY", [0.4, -0.2, -0.3]).as_matrix()
    np.testing.assert_allclose(array.rotation, wanted, atol=1e-15)
    # The array's own axis: right of the beam and below it.
    axis = array.rotation.T @ [0.0, 0.0, 1.0]
    assert axis[0] > 0.0 > axis[1]


def patches(array: DishArrayParams) -> np.ndarray:
    """Wave number times the places (M, 2) of the patches."""
    angle = 2.0 * math.pi * np.arange(array.elements) / array.elements
    rim = 2.0 * math.pi / array.wavelength_m * array.radius_m
    return rim * np.column_stack([np.cos(angle), np.sin(angle)])


def test_sigmas_are_those_of_the_fisher_information_and_of_least_squares() -> None:
    """Slepian-Bangs: F = L tr(R^-1 dR R^-1 dR) of R = I + S a a^H, for a direction on the axis."""
    array, level_db_hz = DishArrayParams(elements=7, radius_m=0.2, element_loss_db=20.0, phase_sigma_rad=0.05), 40.0
    places, snr = patches(array), 10.0 ** (0.1 * 20.0) * PERIOD_S / SNAPSHOTS
    ones = np.ones(array.elements, dtype=complex)
    slope = 1j * places[:, 0]
    covariance = np.eye(array.elements) + snr * np.outer(ones, ones)
    # The source's power and direction are unknown together; on the axis of a circle they do not mix.
    bend = snr * (np.outer(slope, ones) + np.outer(ones, np.conj(slope)))
    turned = np.linalg.solve(covariance, bend)
    bound = 1.0 / math.sqrt(SNAPSHOTS * np.trace(turned @ turned).real)
    noise, phases = direction_sigmas_rad(array, level_db_hz)
    assert noise == pytest.approx(bound, rel=1e-12)
    # Directions (2,) by least squares from phases of which each has the sigma of the calibration.
    spread = np.linalg.pinv(places)
    assert phases == pytest.approx(0.05 * math.sqrt((spread @ spread.T)[0, 0]), rel=1e-12)


@pytest.mark.parametrize("phase_sigma_rad", [0.0, 0.3])
def test_the_least_level_sets_the_beam_apart_from_its_first_sidelobe(phase_sigma_rad: float) -> None:
    """Twelve patches are nearly a ring, whose pattern is J0: 0.4028 at its first sidelobe."""
    array = SHIPPED.replace(phase_sigma_rad=phase_sigma_rad)
    total = 10.0 ** (0.1 * least_level_db_hz(array)) * PERIOD_S / SNAPSHOTS
    sidelobe = abs(j0(jnp_zeros(0, 1)[0])) + BETWEEN
    apart = (1.0 - sidelobe) / SEPARATION - 2.0 * phase_sigma_rad**2 / array.elements
    assert SNAPSHOTS * total**2 / (1.0 + total) == pytest.approx(1.0 / apart, rel=0.015)


@pytest.mark.parametrize(("rim", "valid"), [(6.0, True), (6.9, True), (7.6, False)])
def test_no_level_is_enough_once_a_hexagon_has_its_grating_lobe(rim: float, valid: bool) -> None:
    """Six patches see two directions alike from 4 pi / sqrt(3) = 7.26 of phase at the rim on."""
    radius_m = rim * SHIPPED.wavelength_m / (2.0 * math.pi)
    level_db_hz = least_level_db_hz(SHIPPED.replace(elements=6, radius_m=radius_m, phase_sigma_rad=0.0))
    assert (level_db_hz < math.inf) is valid
    assert level_db_hz > 0.0


def test_with_few_sidelobes_the_samples_alone_set_the_least_level() -> None:
    """A small circle sees no sidelobe: what is left is the SNR that a valid direction needs."""
    total = 10.0 ** (0.1 * least_level_db_hz(SHIPPED.replace(radius_m=0.05, phase_sigma_rad=0.0))) * PERIOD_S
    total /= SNAPSHOTS
    assert SNAPSHOTS * total**2 / (1.0 + total) == pytest.approx(60.0, rel=1e-9)
