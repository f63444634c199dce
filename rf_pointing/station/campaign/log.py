"""From a tracked pass to calibration data: axis angles plus the sensed error.

An observation is where the encoders would be with the beam exactly on the target; its true angles
are those of the ephemeris.  The error of monopulse is that of the beam, so it belongs to the
encoders.  That of a scan (conscan, step-track) is the target's distance from the centre of the
scan: where the encoders are meanwhile is part of the scan.
"""

import math
from collections import Counter, deque
from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np

from rf_pointing.calibration import (
    BiasModel,
    Coverage,
    FitOptions,
    FitResult,
    ObservationJournal,
    Observations,
    PassPriors,
    Prior,
    SectorRule,
    fit_bias_model,
)
from rf_pointing.calibration.observations import COLUMNS as OBSERVED
from rf_pointing.core import MDEG, JointReading, Motion, PointingError, Target, nearest_turn_rad
from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.core.signals import TimeBuffer
from rf_pointing.core.target_motion import ANGLES
from rf_pointing.core.types import Array
from rf_pointing.planning import plunged
from rf_pointing.station.pointing.prediction import TargetBuffer
from rf_pointing.tracking.sensors import SENSORS

# How far a term may have moved from the present model; acceleration lags are hardly known at all.
PRIOR_SIGMA = {"rad": math.radians(0.2), "rad/K": math.radians(0.02), "s": 0.5, "s^2": 10.0}
PASS_GAP_S = 120.0
# Encoders this old, moved on by their rate, are off by less than a mdeg in a fast pass.
LARGEST_JOINT_AGE_S = 0.1
KEPT_RANGES = 64
FEWEST = 30
SHOWN_REASONS = 3
MOST_REASONS = 100
BLOCK_ROWS = 256
COLUMNS = tuple(name for name in OBSERVED if name != "temperature_k")
"""Columns of an observation that is taken here, without temperature."""
TEMPERATURE_S = 3600.0
"""Age up to which a temperature counts: that of a mount follows the day."""


def scans(name: str) -> bool:
    """Return whether the beam moves while the sensor or mode of this name tracks."""
    return name in SENSORS and SENSORS[name].scans


def priors_near(model: BiasModel, names: Collection[str]) -> dict[str, Prior]:
    """Return priors that hold the terms `names` near `model`."""
    known = model.coefficients
    return {term.name: Prior(known[term.name], PRIOR_SIGMA[term.unit]) for term in model.terms if term.name in names}


class CalibrationLog:
    """Collects an observation every `spacing_s` while a sensor is valid, and fits the terms.

    Errors beyond `largest_error_rad` are left out, as is what is observed within `settle_s` of them
    or of the first valid error.  Estimates of a scan overlap, so they are taken every
    `scan_spacing_s`.  With a `journal` every observation is on the disk before the next
    one, and those already in it count.  What a disk does not take is kept and tried again with the
    next observation; `problem` reports it.  A campaign that begins with a temperature stores one
    with every observation, for thermal terms.
    """

    def __init__(
        self, station: str, band: str, spacing_s: float, sigma_rad: float, *,
        scan_spacing_s: float = 0.0, largest_error_rad: float = math.inf, settle_s: float = 0.0,
        journal: ObservationJournal | None = None, mount: Kinematics = LEVEL,
    ) -> None:  # fmt: skip
        self.station, self.band, self.mount = station, band, mount
        self._spacing_s, self._scan_spacing_s = spacing_s, max(scan_spacing_s, spacing_s)
        self._sigma_rad, self._journal = sigma_rad, journal
        self._largest_error_rad, self._settle_s = largest_error_rad, settle_s
        self._sensed_since_s: float | None = None
        self._sensed_s = -math.inf
        self._target = TargetBuffer()
        self._ranges: deque[tuple[float, float, float]] = deque(maxlen=KEPT_RANGES)
        self._target_name = ""
        self._joints: JointReading | None = None
        self._centres, self._mode = TimeBuffer(), ""
        self._reasons: Counter[str] = Counter()
        self._points = None if journal is None else journal.points
        # What came since: a row as an object of its own takes 4 kB, and joining such rows again
        # and again leaves the memory in pieces.
        self._blocks: list[Array] = []
        self._filled = 0
        self._temperature, self._stored = (-math.inf, 0.0), False
        self._waiting: list[Observations] = []
        self.problem = ""
        self._pass, self._last_s, self._new_pass = -1, -math.inf, True
        if self._points is not None:
            self._pass = int(np.max(self._points.pass_id))

    def __len__(self) -> int:
        return self._filled + (0 if self._points is None else len(self._points))

    def take_target(self, target: Target) -> None:
        """Note where the ephemeris puts the target; another target starts another pass."""
        if target.name != self._target_name:
            self._target_name, self._new_pass, self._sensed_since_s = target.name, True, None
            self._target.clear()
            self._ranges.clear()
        self._target.add(self.mount.of_axes(target))
        self._ranges.append((target.t_s, target.range_m, target.range_rate_m_s))

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""
        self._joints = reading

    def take_status(self, t_s: float, scan_centre_rad: Array, _offset_rad: Array, mode: str, _sensor: str) -> None:
        """Note the commanded axis angles (2,) without scans, and the mode, of the controller."""
        self._centres.add(t_s, scan_centre_rad)
        self._mode = mode

    def take_temperature(self, t_s: float, temperature_k: float) -> None:
        """Note the temperature at the antenna."""
        self._temperature = t_s, temperature_k

    def _thermal(self, t_s: float) -> tuple[dict[str, Any], str]:
        """Return the column of the temperature, {} where none is stored, or why it is missing."""
        known_s, kelvin = self._temperature
        fresh = abs(t_s - known_s) <= TEMPERATURE_S
        # The first observation decides: a column is given for all rows or for none.
        if not len(self):
            self._stored = fresh
        elif self._points is not None:
            self._stored = self._points.temperature_k is not None
        if not self._stored:
            return {}, ""
        late = f"no temperature for {TEMPERATURE_S:.0f} s, which this campaign stores"
        return {"temperature_k": np.array([kelvin])}, "" if fresh else late

    def take_error(self, error: PointingError) -> Observations | None:
        """Turn a valid error into an observation (one row) if one is due, and return it.

        Raises ValueError for readings that no antenna can have, such as a target far from the beam.
        """
        position, reason = self._position(error)
        if position is None or not self._settled(error):
            near = f"target more than {self._largest_error_rad / MDEG:.3g} mdeg from the beam"
            long = f"less than {self._settle_s:g} s on the target"
            self._note(reason or (near if self._sensed_since_s is None else long))
            return None
        spacing_s = self._scan_spacing_s if scans(error.sensor) else self._spacing_s
        if 0.0 <= error.t_s - self._last_s < spacing_s:
            return None
        if not self._target.covers(error.t_s, error.t_s):
            self._note("no target is known at its time")
            return None
        thermal, missing = self._thermal(error.t_s)
        if missing:
            self._note(missing)
            return None
        starts = self._new_pass or not 0.0 <= error.t_s - self._last_s <= PASS_GAP_S
        row = replace(self._row(error, position, self._pass + starts), **thermal)
        self._waiting.append(row)
        self.write_waiting()
        self._pass, self._new_pass, self._last_s = self._pass + starts, False, error.t_s
        if self._filled == BLOCK_ROWS * len(self._blocks):
            self._blocks.append(np.empty((BLOCK_ROWS, len(self._columns))))
        values = [getattr(row, name)[0] for name in self._columns]
        self._blocks[-1][self._filled % BLOCK_ROWS] = values
        self._filled += 1
        return row

    def _note(self, reason: str) -> None:
        self._reasons[reason] += 1
        # Reasons hold numbers: each may come once, and nobody empties the table between campaigns.
        if len(self._reasons) > MOST_REASONS:
            self._reasons = Counter(dict(self._reasons.most_common(SHOWN_REASONS)))

    def begin_pass(self) -> None:
        """Count the reasons of `reasons` anew."""
        self._reasons.clear()

    def reasons(self) -> str:
        """Return why errors gave no observation since `begin_pass`, the most frequent first."""
        if not self._reasons:
            return "no pointing error was received"
        return "; ".join(f"{count} errors: {reason}" for reason, count in self._reasons.most_common(SHOWN_REASONS))

    def write_waiting(self) -> None:
        """Write what is not on the disk yet, if it takes it now; see `problem`."""
        if self._journal is None or not self._waiting:
            self._waiting.clear()
            return
        try:
            self._journal.append(Observations.concatenate(self._waiting))
        except OSError as error:
            count, why = len(self._waiting), error.strerror or error
            self.problem = f"{count} observations are in memory only: {self._journal.path} cannot be written: {why}"
            return
        self._waiting.clear()
        self.problem = ""

    def begin_anew(self, name: str) -> None:
        """Begin a new campaign; the file of the old one is renamed to include `name`.

        Raises ValueError while observations of the old one are not on the disk: they would be lost.
        """
        self.write_waiting()
        if self.problem:
            raise ValueError(self.problem)
        if self._journal is not None:
            self._journal.set_aside(name)
        self._points, self._blocks, self._filled = None, [], 0
        self._pass, self._last_s, self._new_pass = -1, -math.inf, True

    def fit(
        self, present: BiasModel, *, terms: tuple[str, ...] = (),
        pass_priors: PassPriors | None = None, form: str = "rotation",
    ) -> FitResult:  # fmt: skip
        """Return the fit of `terms` (empty: those of `present`), the others held at its values.

        Terms are held near the present model where the passes cannot tell.  Raises ValueError for
        too few or unusable observations.
        """
        if len(self) < FEWEST:
            raise ValueError(f"{len(self)} observations, must have at least {FEWEST}: track a pass with a sensor first")
        chosen = terms or tuple(present.coefficients)
        base = present.replace(**{name: 0.0 for name in chosen if name not in present.coefficients})
        return fit_bias_model(
            self.observations(),
            terms=chosen,
            held={name: value for name, value in base.coefficients.items() if name not in chosen},
            priors=priors_near(base, chosen),
            pass_priors=pass_priors,
            # Scaled by the residuals: sensors' sigmas leave out what servo and wind add.
            options=FitOptions(form=form, scale_covariance=True),
        )

    def observations(self) -> Observations:
        """Return all observations; ValueError without one."""
        parts = [] if self._points is None else [self._points]
        if self._filled:
            columns = dict(zip(self._columns, np.concatenate(self._blocks)[: self._filled].T.copy(), strict=True))
            pass_id = columns.pop("pass_id").astype(np.int64)
            parts.append(
                Observations(station=self.station, band=self.band, mount=self.mount, pass_id=pass_id, **columns)
            )
        # Joined once, not at every call.
        points = Observations.concatenate(parts)
        self._points, self._blocks, self._filled = points, [], 0
        return points

    @property
    def _columns(self) -> tuple[str, ...]:
        return (*COLUMNS, "temperature_k") if self._stored else COLUMNS

    def coverage(self, rule: SectorRule) -> Coverage:
        """Return how the sectors of the sky are filled."""
        if not len(self):
            return Coverage(rule, np.zeros(rule.count, dtype=np.int64))
        points = self.observations()
        return rule.coverage(*points.sky_rad())

    def _position(self, error: PointingError) -> tuple[Array | None, str]:
        """Return the axis angles (2,) that an error belongs to, or None and why."""
        if not error.valid:
            return None, f"not valid ({error.reason or error.sensor})"
        if scans(error.sensor):
            # The trackers' errors arrive side by side; only that of the scan in force is about it.
            if self._mode != error.sensor:
                return None, f"{error.sensor} does not track (mode {self._mode or 'unknown'})"
            centre = self._centres.at(error.t_s)
            return centre, "" if centre is not None else "the centre of the scan at its time is not known"
        if scans(self._mode):
            return None, f"the beam scans (mode {self._mode})"
        joints = self._joints
        if joints is None or abs(joints.t_s - error.t_s) > LARGEST_JOINT_AGE_S:
            return None, f"no encoder angles within {LARGEST_JOINT_AGE_S:g} s"
        # The error is stamped in the middle of its integration, the encoders when they were read.
        return joints.position_rad + (error.t_s - joints.t_s) * joints.velocity_rad_s, ""

    def _settled(self, error: PointingError) -> bool:
        """Note a valid error; return whether the beam has been near the target for long enough."""
        if self._sensed_since_s is None or not 0.0 <= error.t_s - self._sensed_s <= PASS_GAP_S:
            self._sensed_since_s = error.t_s
        self._sensed_s = error.t_s
        # Off its axis a sensor is not calibrated: 5 % of the offset is more than any other error.
        # And where the beam was off, the mount's lags have not settled: they would end in the lag
        # terms (docs/math/calibration_campaign.md).
        if math.hypot(error.cross_elevation_rad, error.elevation_rad) > self._largest_error_rad:
            self._sensed_since_s = None
            return False
        return error.t_s - self._sensed_since_s >= self._settle_s

    def _row(self, error: PointingError, position: Array, pass_id: int) -> Observations:
        true = self._target.at([error.t_s])
        # Over the top the same direction is another pair of axis angles: the model applies there.
        over = float(position[1]) > 0.5 * math.pi
        true = Motion(*plunged(*true)) if over else true
        elevation = float(true.position[0, 1])
        cosine = abs(math.cos(elevation))
        azimuth = float(position[0] + error.cross_elevation_rad / abs(math.cos(position[1])))
        up_rad = -error.elevation_rad if over else error.elevation_rad
        times, ranges, rates = np.array(sorted(self._ranges)).T
        sigma = np.sqrt(np.maximum(np.diag(error.covariance_rad2), 0.0) + self._sigma_rad**2)
        single = {
            "t_s": error.t_s, "observed_azimuth_rad": azimuth,
            "observed_elevation_rad": position[1] + up_rad,
            "true_azimuth_rad": nearest_turn_rad(float(true.position[0, 0]), azimuth),
            "true_elevation_rad": elevation,
            **dict(zip(ANGLES[2:], [*true.velocity[0], *true.acceleration[0]], strict=True)),
            "sigma_azimuth_rad": sigma[0] / cosine, "sigma_elevation_rad": sigma[1],
            "range_m": np.interp(error.t_s, times, ranges),
            "range_rate_m_s": np.interp(error.t_s, times, rates),
        }  # fmt: skip
        columns: dict[str, Any] = {name: np.array([value]) for name, value in single.items()}
        return Observations(
            station=self.station, band=self.band, mount=self.mount, pass_id=np.array([pass_id]), **columns
        )
