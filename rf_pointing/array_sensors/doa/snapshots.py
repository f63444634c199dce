"""Simulated snapshots of an array: x = C A s + n (DOA eq. (8)), noise of unit power per element.

`draw_snapshots` makes the samples.  `draw_covariances` draws the sample covariance of one source
from its exact law, at M^2 instead of M L random numbers: a rotation of the L snapshots puts the
whole waveform, of energy g, into the first one, so L R = x x^H + B B^H with x = sqrt(SNR g) a + n
and B B^H the complex Wishart matrix of the L - 1 others (B lower triangular, Bartlett 1933).  g = L
for constant modulus, Gamma(L) for a Gaussian waveform.
"""

import numpy as np

from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering
from rf_pointing.core import require_between, require_choice
from rf_pointing.core.types import Array, ComplexArray


def complex_normal(stream: np.random.Generator, shape: tuple[int, ...]) -> ComplexArray:
    """Return circular complex Gaussian samples with E|z|^2 = 1."""
    parts = stream.standard_normal((*shape, 2))
    return np.asarray(parts.view(np.complex128)[..., 0] * np.sqrt(0.5))


def draw_snapshots(
    array: CircularArrayParams,
    directions: Array,
    source_covariance: ComplexArray,
    snapshots: int,
    stream: np.random.Generator,
    *,
    waveform: str = "gaussian",
    response: ComplexArray | None = None,
) -> ComplexArray:
    """Return snapshots (..., M, L) of K sources at `directions` (..., K, 3).

    Parameters
    ----------
    source_covariance : (K, K) Hermitian; its diagonal is the SNR per element (ratio) of each
        source.
    waveform : "gaussian", or "constant_modulus" (random phases, uncorrelated sources only).
    response : (M, M) coupling and gain matrix C; identity when None.

    Raises
    ------
    ValueError
        If `snapshots` < 1, the covariance is not K x K positive semidefinite, or
        constant-modulus sources correlate.
    """
    require_between("snapshots", snapshots, 1, None)
    require_choice("waveform", waveform, ("gaussian", "constant_modulus"))
    manifold = steering(array, directions).swapaxes(-1, -2)
    if response is not None:
        manifold = response @ manifold
    lead, count = directions.shape[:-2], directions.shape[-2]
    factor = _root(source_covariance, count)
    samples = complex_normal(stream, (*lead, count, snapshots))
    if waveform == "constant_modulus":
        if np.any(np.abs(factor - np.diag(np.diag(factor))) > 0.0):
            raise ValueError(
                "waveform='constant_modulus' needs uncorrelated sources, source_covariance is not diagonal"
            )
        samples = samples / np.abs(samples)
    noise = complex_normal(stream, (*lead, array.elements, snapshots))
    return np.asarray(manifold @ (factor @ samples) + noise, dtype=np.complex128)


def draw_covariances(
    array: CircularArrayParams,
    direction: Array,
    snr: float,
    snapshots: int,
    stream: np.random.Generator,
    *,
    waveform: str = "gaussian",
) -> ComplexArray:
    """Return sample covariances (n, M, M) of one source at `direction` (n, 3), `snr` per element
    (ratio).
    """
    require_between("snr", snr, 0.0, None)
    require_between("snapshots", snapshots, 1, None)
    require_choice("waveform", waveform, ("gaussian", "constant_modulus"))
    count = len(direction)
    # Sum of |s|^2 over the snapshots: the only property of the waveform that the covariance keeps.
    energy = (
        stream.gamma(snapshots, size=count)
        if waveform == "gaussian"
        else np.full(count, float(snapshots))
    )
    first = np.sqrt(snr * energy)[:, None] * steering(array, direction) + complex_normal(
        stream, (count, array.elements)
    )
    # Bartlett's decomposition draws the covariance of the noise without drawing its snapshots.
    rest = _wishart_root(count, array.elements, snapshots - 1, stream)
    outer = first[:, :, None] * first[:, None, :].conj()
    return np.asarray(
        (outer + rest @ rest.conj().swapaxes(-1, -2)) / snapshots, dtype=np.complex128
    )


def _wishart_root(
    count: int, elements: int, degrees: int, stream: np.random.Generator
) -> ComplexArray:
    if degrees < elements:
        return complex_normal(stream, (count, elements, degrees))
    rows, columns = np.tril_indices(elements, -1)
    root = np.zeros((count, elements, elements), dtype=np.complex128)
    root[:, rows, columns] = complex_normal(stream, (count, len(rows)))
    diagonal = np.arange(elements)
    root[:, diagonal, diagonal] = np.sqrt(stream.gamma(degrees - diagonal, size=(count, elements)))
    return root


def _root(source_covariance: ComplexArray, count: int) -> ComplexArray:
    matrix = np.asarray(source_covariance, dtype=np.complex128)
    if matrix.shape != (count, count):
        raise ValueError(f"source_covariance has shape {matrix.shape}, must be ({count}, {count})")
    if not np.allclose(
        matrix, matrix.conj().T, rtol=0.0, atol=1e-12 * float(np.abs(matrix).max(initial=1.0))
    ):
        raise ValueError("source_covariance is not Hermitian")
    if np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0 and np.all(
        np.diag(matrix).real >= 0.0
    ):
        return np.asarray(np.diag(np.sqrt(np.diag(matrix).real)), dtype=np.complex128)
    values, vectors = np.linalg.eigh(matrix)
    if values[0] < -1e-12 * abs(values[-1]):
        raise ValueError(f"source_covariance has eigenvalue {values[0]} must be >= 0")
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)), dtype=np.complex128)
