"""Simulated snapshots: their covariance, and the direct draw of a covariance against real snapshots."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering
from rf_pointing.array_sensors.doa.covariance import sample_covariance
from rf_pointing.array_sensors.doa.music import estimate_directions
from rf_pointing.array_sensors.doa.snapshots import complex_normal, draw_covariances, draw_snapshots
from rf_pointing.papers.doa_study.directions import direction_from_polar

ARRAY = CircularArrayParams()
SOURCE = direction_from_polar(0.7, 1.1)


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(14)


def test_noise_has_unit_power_and_no_direction(stream: np.random.Generator) -> None:
    z = complex_normal(stream, (200_000,))
    assert np.mean(np.abs(z) ** 2) == pytest.approx(1.0, abs=0.01)
    assert abs(np.mean(z * z)) < 0.01


@pytest.mark.parametrize(("waveform", "together"), [("gaussian", 0.0), ("constant_modulus", 0.0), ("gaussian", 0.6j)])
def test_snapshots_have_the_covariance_of_the_model(
    waveform: str, together: complex, stream: np.random.Generator
) -> None:
    two = np.stack([SOURCE, direction_from_polar(0.3, 4.0)])
    powers = np.array([[2.0 + 0j, together], [-together, 0.5]])
    x = draw_snapshots(ARRAY, two, powers, 200_000, stream, waveform=waveform)
    a = steering(ARRAY, two).T
    assert np.abs(sample_covariance(x) - a @ powers @ a.conj().T - np.eye(12)).max() < 0.03


@pytest.mark.parametrize("waveform", ["gaussian", "constant_modulus"])
@pytest.mark.parametrize("snapshots", [4, 40])
def test_drawn_covariances_follow_the_law_of_real_snapshots(
    waveform: str, snapshots: int, stream: np.random.Generator
) -> None:
    """First and second moments of the covariance, and the error of MUSIC, agree within their Monte Carlo error."""
    count, snr = 3000, 0.4
    towards = np.tile(SOURCE, (count, 1))
    drawn = draw_covariances(ARRAY, towards, snr, snapshots, stream, waveform=waveform)
    samples = draw_snapshots(ARRAY, towards[:, None], np.array([[snr + 0j]]), snapshots, stream, waveform=waveform)
    real = sample_covariance(samples)
    scale = 6.0 / np.sqrt(count * snapshots)
    assert np.abs(drawn.mean(axis=0) - real.mean(axis=0)).max() < 1.4 * scale * 2
    spread = np.mean(np.abs(drawn - drawn.mean(axis=0)) ** 2) / np.mean(np.abs(real - real.mean(axis=0)) ** 2)
    assert spread == pytest.approx(1.0, abs=0.08)
    errors = [
        np.median(np.linalg.norm(estimate_directions(ARRAY, r).direction - SOURCE, axis=1)) for r in (drawn, real)
    ]
    assert errors[0] == pytest.approx(errors[1], rel=0.08)


def test_source_covariance_that_is_none_is_refused(stream: np.random.Generator) -> None:
    two = np.stack([SOURCE, direction_from_polar(0.3, 4.0)])
    for matrix, words in (
        (np.eye(3, dtype=complex), "shape"),
        (np.array([[1.0, 0.5], [0.1, 1.0]], dtype=complex), "Hermitian"),
        (np.array([[1.0, 2.0], [2.0, 1.0]], dtype=complex), "eigenvalue"),
    ):
        with pytest.raises(ValueError, match=words):
            draw_snapshots(ARRAY, two, matrix, 5, stream)


def test_correlated_constant_modulus_sources_are_refused(stream: np.random.Generator) -> None:
    two = np.stack([SOURCE, direction_from_polar(0.3, 4.0)])
    matrix = np.array([[1.0, 0.5], [0.5, 1.0]], dtype=complex)
    with pytest.raises(ValueError, match="uncorrelated"):
        draw_snapshots(ARRAY, two, matrix, 5, stream, waveform="constant_modulus")


def test_sources_of_no_power_and_negative_parts_of_rounding_are_taken_as_zero(stream: np.random.Generator) -> None:
    two = np.stack([SOURCE, direction_from_polar(0.3, 4.0)])
    alone = draw_snapshots(ARRAY, two, np.diag([0.0 + 0j, 0.0]), 4000, stream)
    assert np.abs(sample_covariance(alone) - np.eye(12)).max() < 0.1
    same = np.array([[1.0, 1.0], [1.0, 1.0]], dtype=complex)
    x = draw_snapshots(ARRAY, two, same, 100_000, stream)
    a = steering(ARRAY, two).T
    assert np.abs(sample_covariance(x) - a @ same @ a.conj().T - np.eye(12)).max() < 0.06
    for snr, words in ((-0.1, "snr=-0.1 must be >= 0.0"),):
        with pytest.raises(ValueError, match=words):
            draw_covariances(ARRAY, SOURCE[None], snr, 5, stream)
    for draw in (
        lambda kind: draw_covariances(ARRAY, SOURCE[None], 1.0, 5, stream, waveform=kind),
        lambda kind: draw_snapshots(ARRAY, two, np.eye(2, dtype=complex), 5, stream, waveform=kind),
    ):
        with pytest.raises(ValueError, match="waveform='square' must be one of gaussian, constant_modulus"):
            draw("square")
    with pytest.raises(ValueError, match="snapshots=0 must be >= 1"):
        draw_snapshots(ARRAY, two, np.eye(2, dtype=complex), 0, stream)
    with pytest.raises(ValueError, match="snapshots=0 must be >= 1"):
        draw_covariances(ARRAY, SOURCE[None], 1.0, 0, stream)
