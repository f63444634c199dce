"""From a tracked pass to calibration data: encoder angles corrected by the sensed error against the ephemeris.

An observation is where the encoders would stand with the beam exactly on the target; its true angles are the ephemeris'.
"""

import math

import numpy as np

from rf_pointing.calibration import BiasModel, FitResult, Observations, Prior, fit_bias_model
from rf_pointing.geometry import JointReading, PointingError, Target, nearest_turn_rad
from rf_pointing.station.target_buffer import TargetBuffer

__all__ = ["CalibrationLog"]

PRIOR_ANGLE_RAD = math.radians(0.2)
PRIOR_LAG_S = 0.5
PASS_GAP_S = 120.0


class CalibrationLog:
    """Collects one observation every `spacing_s` while a sensor gives valid errors, and fits the 14 terms to them."""

    def __init__(self, station: str, band: str, spacing_s: float, sigma_rad: float) -> None:
        self.station, self.band = station, band
        self._spacing_s, self._sigma_rad = spacing_s, sigma_rad
        self._target = TargetBuffer()
        self._target_name = ""
        self._joints: JointReading | None = None
        self._rows: list[tuple[float, ...]] = []
        self._pass = 0

    def __len__(self) -> int:
        return len(self._rows)

    def take_target(self, target: Target) -> None:
        """Note where the ephemeris puts the target; another target starts another pass."""
        if target.name != self._target_name:
            self._target_name = target.name
            self._target.clear()
        self._target.add(target)

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""
        self._joints = reading

    def take_error(self, error: PointingError) -> None:
        """Turn a valid error into an observation if one is due; the readings must be within a tenth of a second."""
        joints = self._joints
        if joints is None or not error.valid or abs(joints.t_s - error.t_s) > 0.1:
            return
        if self._rows and error.t_s - self._rows[-1][0] < self._spacing_s:
            return
        if not self._target.covers(error.t_s, error.t_s):
            return
        self._rows.append(self._row(error, joints))

    def fit(self, present: BiasModel) -> FitResult:
        """Return the fit of all 14 terms, held near the present model where the passes cannot tell.

        Raises ValueError for too few or unusable observations.
        """
        if len(self._rows) < 30:
            raise ValueError(f"{len(self._rows)} observations, must have at least 30: track a pass with a sensor first")
        priors = {
            term.name: Prior(
                present.coefficients[term.name], PRIOR_ANGLE_RAD if term.unit.startswith("rad") else PRIOR_LAG_S
            )
            for term in present.terms
        }
        return fit_bias_model(self.observations(), terms=tuple(priors), priors=priors)

    def observations(self) -> Observations:
        """Return what was collected."""
        columns = np.array(self._rows).T
        return Observations(
            station=self.station,
            band=self.band,
            t_s=columns[0],
            pass_id=columns[1].astype(np.int64),
            observed_azimuth_rad=columns[2],
            observed_elevation_rad=columns[3],
            true_azimuth_rad=columns[4],
            true_elevation_rad=columns[5],
            azimuth_rate_rad_s=columns[6],
            elevation_rate_rad_s=columns[7],
            azimuth_acceleration_rad_s2=columns[8],
            elevation_acceleration_rad_s2=columns[9],
            sigma_azimuth_rad=self._sigma_rad / np.cos(columns[5]),
            sigma_elevation_rad=np.full(len(self._rows), self._sigma_rad),
        )

    def _row(self, error: PointingError, joints: JointReading) -> tuple[float, ...]:
        position = joints.position_rad + (error.t_s - joints.t_s) * joints.velocity_rad_s
        true = self._target.at([error.t_s])
        azimuth = position[0] + error.cross_elevation_rad / math.cos(position[1])
        if self._rows and error.t_s - self._rows[-1][0] > PASS_GAP_S:
            self._pass += 1
        return (
            error.t_s,
            float(self._pass),
            float(azimuth),
            float(position[1] + error.elevation_rad),
            nearest_turn_rad(float(true.position[0, 0]), float(azimuth)),
            float(true.position[0, 1]),
            *(float(value) for value in (*true.velocity[0], *true.acceleration[0])),
        )
