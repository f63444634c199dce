"""A fitted bias model with all that an operator must know of it: where it comes from, how certain it is, when it holds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.core.dates import to_utc_text

__all__ = ["ModelVersion", "stamp_text"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelVersion:
    """A named version of a bias model and where it comes from; times are UTC seconds since 1970.

    `fitted` are the terms that were estimated, in the order of `covariance` (k, k) in core units; the others were
    fixed.  `valid_until_t_s` None: until replaced.
    """

    name: str
    station: str
    band: str
    software: str
    created_t_s: float
    valid_from_t_s: float
    valid_until_t_s: float | None
    first_t_s: float
    last_t_s: float
    observations: int
    rejected: int
    passes: int
    form: str
    condition: float
    rms_cross_elevation_rad: float
    rms_elevation_rad: float
    mean_azimuth_rad: float
    mean_elevation_rad: float
    model: BiasModel
    fitted: tuple[str, ...]
    covariance: Array

    @classmethod
    def from_fit(
        cls, result: FitResult, *, name: str, software: str, created_t_s: float, valid_until_t_s: float | None = None
    ) -> "ModelVersion":
        """Make the file of a fit; it is valid from its creation."""
        rms, mean = result.rms_rad(), result.mean_rad()
        return cls(
            name=name,
            station=result.station,
            band=result.band,
            software=software,
            created_t_s=created_t_s,
            valid_from_t_s=created_t_s,
            valid_until_t_s=valid_until_t_s,
            first_t_s=result.first_t_s,
            last_t_s=result.last_t_s,
            observations=int(np.sum(result.used)),
            rejected=len(result.rejected),
            passes=result.passes,
            form=result.form,
            condition=result.condition,
            rms_cross_elevation_rad=rms[0],
            rms_elevation_rad=rms[1],
            mean_azimuth_rad=mean[0],
            mean_elevation_rad=mean[1],
            model=result.model,
            fitted=result.names,
            covariance=result.covariance,
        )

    def check_for(self, station: str, band: str, t_s: float) -> None:
        """Raise ValueError if this model belongs to another station or band or is not valid at `t_s`."""
        if self.station != station:
            raise ValueError(f"model {self.name!r} is of station {self.station!r}, must be of {station!r}")
        if self.band != band:
            raise ValueError(f"model {self.name!r} is of band {self.band!r}, must be of {band!r}")
        if t_s < self.valid_from_t_s or (self.valid_until_t_s is not None and t_s > self.valid_until_t_s):
            until = "replaced" if self.valid_until_t_s is None else stamp_text(self.valid_until_t_s)
            raise ValueError(
                f"model {self.name!r} is valid from {stamp_text(self.valid_from_t_s)} until {until}, not at {stamp_text(t_s)}"
            )


def stamp_text(t_s: float) -> str:
    """Return a time as model files have it: ISO 8601 with a Z."""
    return to_utc_text(t_s) + "Z"
