"""The error of the beam over time, what it costs, and what program track alone would have made of it.

    loss = -10 log10 exp(-4 ln 2 (error / beamwidth)^2)    (Gaussian beam, half power at half a beamwidth)

The error is target minus beam.  The tracking loop moves the beam by its offset; without it the error would have been
larger by that offset: alone = error + offset.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, gaussian_loss_db
from rf_pointing.report.recording import Recording
from rf_pointing.report.summary import ErrorStatistics, Spread
from rf_pointing.report.timeline import TRACKING_MODES, Timeline

__all__ = ["ErrorSeries", "error_series", "statistics_of"]

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ErrorSeries:
    """Samples of the error in order of stamp; `error_rad` and `alone_rad` are (n, 2), the rest (n,).

    `source` is "true" or "sensed"; `alone_rad` is NaN outside the tracking modes, `loss_db` where no beam is known or
    the beam is not meant to be on the target; `dropped` counts the samples that were not finite.
    """

    source: str
    stamp_ns: Ints
    error_rad: Floats
    alone_rad: Floats
    mode: NDArray[np.str_]
    beamwidth_rad: Floats
    dropped: int

    @property
    def radial_rad(self) -> Floats:
        """Angle between target and beam."""
        return np.hypot(self.error_rad[:, 0], self.error_rad[:, 1])

    @property
    def loss_db(self) -> Floats:
        """Pointing loss, positive."""
        return gaussian_loss_db(self.radial_rad, self.beamwidth_rad)


def error_series(recording: Recording, modes: Timeline | None) -> ErrorSeries | None:
    """Return the true error, else the sensed one, else None."""
    for name, source in (("sim/pointing_error", "true"), ("pointing_error", "sensed")):
        data = recording.get(name)
        if data is None or data.stamp_ns is None or not np.any(data["valid"]):
            continue
        order = np.flatnonzero(data["valid"])
        order = order[np.argsort(data.stamp_ns[order], kind="stable")]
        error = np.stack([data["cross_elevation"], data["elevation"]], axis=-1)[order]
        finite = np.all(np.isfinite(error), axis=1)
        return _series(source, data.stamp_ns[order][finite], error[finite], modes, int(np.sum(~finite)))
    return None


def _series(source: str, stamp_ns: Ints, error_rad: Floats, modes: Timeline | None, dropped: int) -> ErrorSeries:
    n = len(stamp_ns)
    mode = np.full(n, "", dtype=np.str_)
    width, alone = np.full(n, np.nan), np.full((n, 2), np.nan)
    if modes is not None:
        mode = modes.mode_at(stamp_ns)
        tracking = np.isin(mode, TRACKING_MODES)
        width = np.where(tracking, modes.beamwidth_rad_at(stamp_ns), np.nan)
        alone = np.where(tracking[:, None], error_rad + modes.offset_rad_at(stamp_ns), np.nan)
    return ErrorSeries(source, stamp_ns, error_rad, alone, mode, width, dropped)


def statistics_of(error_rad: Floats, beamwidth_rad: Floats) -> ErrorStatistics:
    """Return the statistics of errors (n, 2) seen by beams (n,), all null when n is 0."""
    radial = np.hypot(error_rad[:, 0], error_rad[:, 1])
    loss = gaussian_loss_db(radial, beamwidth_rad)
    loss = loss[np.isfinite(loss)]
    inside = (radial <= 0.5 * beamwidth_rad)[np.isfinite(beamwidth_rad)]
    return ErrorStatistics(
        samples=len(radial),
        cross_elevation=_spread(error_rad[:, 0]),
        elevation=_spread(error_rad[:, 1]),
        radial=_spread(radial),
        mean_loss_db=float(np.mean(loss)) if len(loss) else None,
        max_loss_db=float(np.max(loss)) if len(loss) else None,
        inside_half_power_percent=100.0 * float(np.mean(inside)) if len(inside) else None,
    )


def _spread(error_rad: Floats) -> Spread:
    if len(error_rad) == 0:
        return Spread(rms_mdeg=None, p95_mdeg=None, max_mdeg=None)
    magnitude = np.abs(error_rad) / MDEG
    return Spread(
        rms_mdeg=float(np.sqrt(np.mean(np.square(magnitude)))),
        p95_mdeg=float(np.percentile(magnitude, 95.0)),
        max_mdeg=float(np.max(magnitude)),
    )
