"""MUSIC for several simultaneous sources: the K largest maxima, each refined by Newton's method.

Signal fraction g = |V^H C a|^2 / |C a|^2 with V the K principal eigenvectors.  MUSIC needs sources
that are less than fully correlated and farther apart than the noise blurs them; the result states
where fewer than K separate maxima exist.
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.doa.array import CircularArrayParams, phase_radius_rad
from rf_pointing.array_sensors.doa.covariance import eigen
from rf_pointing.array_sensors.doa.music import refine_peaks, steered_lattice
from rf_pointing.core.types import Array, ComplexArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SeveralDirections:
    """Directions (k, 3) found for one covariance, best first, with k <= `sources`.

    `fraction` (k,) is 1 for a perfect source; `reason` is empty when all were found, else says what
    is missing.
    """

    direction: Array
    fraction: Array
    sources: int
    reason: str

    @property
    def complete(self) -> bool:
        """Whether all `sources` were found as separate directions."""
        return not self.reason


def estimate_several(
    array: CircularArrayParams,
    covariance: ComplexArray,
    sources: int,
    response: ComplexArray | None = None,
) -> SeveralDirections:
    """Return the directions of `sources` sources behind one covariance (M, M).

    Raises
    ------
    ValueError
        If `sources` is not below the number of elements, or the covariance has lower rank
        than that.
    """
    signal = eigen(
        covariance, array.elements if response is None else len(response), sources
    ).vectors[:, :sources]
    # Finer than for one source: two maxima closer than a lattice step would merge into one start.
    spacing = 0.2 / phase_radius_rad(array)
    starts = _lattice_maxima(array, signal, spacing, response)
    peaks = refine_peaks(
        array, np.broadcast_to(signal, (len(starts), *signal.shape)), starts, response
    )
    # Two starts often climb to the same maximum: keep the best and drop what lies within half a
    # step of it.
    order = np.argsort(-peaks.fraction)
    order = order[peaks.converged[order]]
    chosen: list[int] = []
    for index in order:
        apart = [
            np.linalg.norm(peaks.direction[index] - peaks.direction[other]) > 0.5 * spacing
            for other in chosen
        ]
        if len(chosen) < sources and all(apart):
            chosen.append(int(index))
    missing = sources - len(chosen)
    reason = (
        f"{len(chosen)} of {sources} sources resolved: the others have no separate maximum"
        if missing
        else ""
    )
    return SeveralDirections(
        direction=peaks.direction[chosen],
        fraction=peaks.fraction[chosen],
        sources=sources,
        reason=reason,
    )


def _lattice_maxima(
    array: CircularArrayParams, signal: ComplexArray, spacing: float, response: ComplexArray | None
) -> Array:
    """Return the lattice points (n, 3) that no neighbour exceeds, on a square lattice of direction
    cosines.
    """
    points, received = steered_lattice(array, spacing)
    if response is not None:
        received = received @ response.T
    along = np.sum(np.abs(received @ signal.conj()) ** 2, axis=-1) / np.sum(
        np.abs(received) ** 2, axis=-1
    )
    place = np.rint(points[:, :2] / spacing).astype(int)
    place -= place.min(axis=0)
    side = int(place.max()) + 1
    # A border of -1 outside the unit circle, so that points at the rim compare with something
    # lower.
    value = np.full((side + 2, side + 2), -1.0)
    value[place[:, 0] + 1, place[:, 1] + 1] = along
    highest = np.ones(len(points), dtype=np.bool_)
    for i in range(3):
        for j in range(3):
            highest &= along >= value[place[:, 0] + i, place[:, 1] + j]
    return np.asarray(points[highest])
