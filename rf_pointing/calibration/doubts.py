"""What speaks against a fit: passes it threw away, orbit errors it did not allow for or that are larger than it was told.

Without errors of the passes, independent residuals of a pass of n points sum up to sqrt(n) of their size.  A sum that is
larger comes from something that the whole pass has in common, which the white covariance takes for n measurements.
"""

import numpy as np

from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_error_size import size_ratios

__all__ = ["doubts_of", "pass_correlation"]

_LARGER = 2.0


def doubts_of(fit: FitResult, points: Observations) -> tuple[str, ...]:
    """Return one sentence for each reason to doubt `fit` to `points`: passes left out whole, a (white) sigma too small."""
    return (*_lost_passes(fit, points), *_small_sigma(fit, points))


def _lost_passes(fit: FitResult, points: Observations) -> tuple[str, ...]:
    lost = [number for number in points.passes.tolist() if not np.any(fit.used[points.pass_id == number])]
    if not lost:
        return ()
    return (f"pass {', '.join(map(str, lost))} was edited out whole: another target, a wrong clock or orbit?",)


def _small_sigma(fit: FitResult, points: Observations) -> tuple[str, ...]:
    if fit.pass_priors is not None:
        ratios = zip(
            fit.pass_priors.names, fit.pass_priors.sigma.tolist(), size_ratios(fit, fit.pass_priors), strict=True
        )
        return tuple(
            f"{name} of the passes is {ratio:.1f} times what the fit was told ({size:.3g}): sigma is too small"
            for name, size, ratio in ratios
            if ratio > _LARGER
        )
    larger = pass_correlation(fit, points)
    if larger <= _LARGER:
        return ()
    return (
        f"the residuals of a pass hang together, their sums are {larger:.1f} times those of independent ones: the orbit of "
        "each pass is off, and sigma is too small by about as much",
    )


def pass_correlation(fit: FitResult, points: Observations) -> float:
    """Return how many times larger than sqrt(n) of their size the sums of the residuals of passes of n points are (rms)."""
    squares, count = 0.0, 0
    for residual, sigma in (
        (fit.residual_azimuth_rad, points.sigma_azimuth_rad),
        (fit.residual_elevation_rad, points.sigma_elevation_rad),
    ):
        size = residual[fit.used] / sigma[fit.used]
        size = size / np.sqrt(np.mean(size**2))
        _, place, lengths = np.unique(points.pass_id[fit.used], return_inverse=True, return_counts=True)
        squares += float(np.sum(np.bincount(place, weights=size) ** 2 / lengths))
        count += len(lengths)
    return float(np.sqrt(squares / count))
