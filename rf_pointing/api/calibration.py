"""Fit a bias model to recordings, files or points, and keep it with its report."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from rf_pointing import __version__, calibration
from rf_pointing.api.station import Station
from rf_pointing.calibration import BiasModel, FitResult, Ionosphere, ModelVersion, Observations, TrackedPass
from rf_pointing.calibration.terms import names_of
from rf_pointing.core import DAY_S, RadioRefraction
from rf_pointing.ephemeris import Elements, read_source
from rf_pointing.station.campaign import offset_table, recorded_input
from rf_pointing.station.campaign.offline_fit import FitData, FitRequest, Fitted, OfflineFit, remarks, summary

TABULAR = (".csv", ".tdm", ".kvn", ".txt")
ELECTRONS_PER_TECU = 1e16


@dataclass(frozen=True, kw_only=True)
class DataFiles:
    """Files of a fit, and what is known of the data in them.

    Attributes
    ----------
    paths : rosbag2 recordings, CSV (points, raw data of one pass, or offsets), CCSDS TDM.
    elements : of the targets of CSV and TDM, which need them.
    max_age_s : greatest age of these elements.
    refraction, time_error_s, ionosphere : air, lateness of the time tags, and ionosphere of the
        raw data of CSV and TDM.
    namespace : antenna, where a recording holds several.
    largest_error_rad : samples of recordings with a larger sensed error are left out; None: the
        station's own limit, a tenth of its beam.
    allow_damage : take the sound part of damaged recordings.
    """

    paths: Sequence[Path]
    elements: Sequence[Elements] = ()
    max_age_s: float = 14.0 * DAY_S
    refraction: RadioRefraction | Literal["standard"] | None = "standard"
    time_error_s: float | None = None
    ionosphere: Ionosphere | None = None
    namespace: str | None = None
    largest_error_rad: float | None = None
    allow_damage: bool = False

    def read(self, station: Station) -> FitData:
        """Return the data of all files as those of a station; ValueError names what is wrong."""
        tables = [path for path in self.paths if path.is_file() and path.suffix in TABULAR]
        offsets = [path for path in tables if path.suffix == ".csv" and offset_table.holds_offsets(path)]
        mount = station.controller.kinematics
        rows = self._offsets(offsets, station) if offsets else None
        if rows is not None and len(offsets) == len(self.paths):
            # Nothing measures the orbits of single rows.
            alone = replace(rows, range_m=None, range_rate_m_s=None)
            terms = offset_table.terms_of_offsets(alone)
            return FitData(alone, [], offered=terms, always=terms[:2])
        others = [path for path in tables if path not in offsets]
        of_points = [path for path in others if path.suffix == ".csv" and recorded_input.holds_points(path)]
        points = _joined(recorded_input.read_points(of_points, mount), rows)
        raw = [
            one
            for path in others
            if path not in of_points
            for one in recorded_input.read_raw(path, station.band, mount)
        ]
        if self.time_error_s:
            raw = [replace(one, t_s=one.t_s - self.time_error_s) for one in raw]
        passes = [TrackedPass(one, self._reference(one, station), self.ionosphere) for one in raw]
        for path in self.paths:
            if path not in tables:
                passes += self._recorded(path, station)
        return FitData(points, passes, recorded=len(tables) < len(self.paths))

    def _offsets(self, paths: Sequence[Path], station: Station) -> Observations:
        parts = [
            offset_table.read_offsets(
                path, station.name, station.band, station.site, math.radians(station.beamwidth_deg), self.elements,
                self.max_age_s, self.refraction, station.controller.kinematics,
            )
            for path in paths
        ]  # fmt: skip
        points = Observations.concatenate(parts)
        return replace(points, pass_id=np.arange(len(points)))

    def _reference(self, raw: calibration.RawTracking, station: Station) -> calibration.ReferenceTrack:
        if not self.elements:
            raise ValueError("elements: tracking data of CSV and TDM need --elements FILE for their reference")
        return recorded_input.reference_of(
            raw, self.elements, station.site, self.max_age_s, self.refraction, station.controller.kinematics
        )

    def _recorded(self, path: Path, station: Station) -> list[TrackedPass]:
        # Reading a recording loads a ROS message library, which CSV and TDM do without.
        from rf_pointing.report.tracking_from_bag import tracking_from_bag

        own_rad = station.calibrator.largest_error_rad
        limit_rad = own_rad if self.largest_error_rad is None else self.largest_error_rad
        recorded = tracking_from_bag(
            path, station.name, station.band, namespace=self.namespace,
            largest_error_rad=limit_rad, allow_damage=self.allow_damage,
        )  # fmt: skip
        mount = station.controller.kinematics
        return [TrackedPass(raw, reference.on(mount), self.ionosphere) for raw, reference in recorded]


def _joined(points: Observations | None, rows: Observations | None) -> Observations | None:
    """Return points and rows of offsets as one, each row a pass of its own."""
    if points is None or rows is None:
        return rows if points is None else points
    rows = replace(rows, pass_id=rows.pass_id + int(np.max(points.pass_id)) + 1)
    if points.range_m is None or points.range_rate_m_s is None:
        rows = replace(rows, range_m=None, range_rate_m_s=None)
    return Observations.concatenate([points, rows])


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted bias model with its covariance, its points, and what a reader should know of it.

    `print(fit)` shows the outcome, remarks, and what is doubtful; `write` keeps the model.
    """

    version: ModelVersion
    done: Fitted = field(repr=False)
    data: FitData = field(repr=False)
    remarks: list[str] = field(repr=False)

    @property
    def model(self) -> BiasModel:
        """The bias model; `Station(..., model=fit.model)` points with it."""
        return self.version.model

    @property
    def result(self) -> FitResult:
        """Estimates, covariance, correlation, residuals and rank."""
        return self.done.result

    @property
    def points(self) -> Observations:
        """The observations that were fitted."""
        return self.done.points

    def __str__(self) -> str:
        done, result = self.done, self.result
        return "\n".join([
            summary(done.points, result),
            *self.remarks,
            *(f"not separable: {advice}" for advice in result.separation_advice()),
            *(f"doubtful: {doubt}" for doubt in (*done.warnings, *calibration.warnings_of(result, done.points))),
            *(f"left out: {note}" for note in done.notes),
        ])  # fmt: skip

    def write(self, path: str | Path, *, report: str | Path | None = None) -> Path:
        """Write the model file and its report; return the page of the report.

        `report` is its folder, by default next to the model.
        """
        # Matplotlib is loaded where a report is wanted.
        from rf_pointing.report.calibration_report import write_calibration_report

        path = Path(path)
        calibration.write_model(path, self.version)
        return write_calibration_report(
            report or path.parent / f"{path.stem}_report", self.points, self.result, name=self.version.name,
            stages=self.done.stages, notes=[*self.done.notes, *self.done.warnings], remarks=self.remarks,
        )  # fmt: skip

    def write_points(self, path: str | Path) -> None:
        """Write the points of the fit as CSV."""
        calibration.write_observations(Path(path), self.points)

    def write_tdm(self, path: str | Path) -> None:
        """Write the good samples of the raw data as a CCSDS TDM; ValueError without raw data."""
        require_raw(self.data, path)
        raw, own = [one.raw for one in self.data.passes], self.version
        mount = self.data.passes[0].reference.mount
        calibration.write_tdm(path, raw, originator=own.software, created_t_s=own.created_t_s, mount=mount)


def require_raw(data: FitData, path: str | Path) -> None:
    """Raise ValueError unless there are raw data to write to `path`."""
    if not data.passes:
        raise ValueError(f"tdm={path}: the files hold calibration points only, no raw data to write")


def fit(
    data: Observations | str | Path | Sequence[str | Path],
    station: Station,
    *,
    elements: str | Path = "",
    ionosphere_tecu: float | None = None,
    carrier_hz: float | None = None,
    terms: Sequence[str] = calibration.TERM_NAMES,
    select: bool = False,
    form: Literal["printed", "rotation"] = "rotation",
    robust: bool = False,
    orbit_prior_m: float | None = None,
    time_error_s: float | None = None,
    known: ModelVersion | None = None,
    name: str = "",
) -> Fit:
    """Fit the bias model of a station and band.

    Parameters
    ----------
    data : points (`Observations`), or files: rosbag2 recordings, CSV, CCSDS TDM.
    station : the owner of the data.
    elements : of the targets of raw CSV and TDM data: file, folder or address.
    ionosphere_tecu, carrier_hz : vertical electron content (1e16 per m^2) and carrier frequency
        during the raw data; none by default.
    terms : the terms offered; `select` chooses among them by BIC.
    form : of the model.  robust : Huber weights instead of squares.
    orbit_prior_m : orbit error of each pass that the fit allows for; None: as large as they show.
    time_error_s : lateness of the time tags of files that is known; None: unknown.
    known : the best model known, the prior of every term.
    name : version of the model; by default made from the data's time.

    Raises
    ------
    ValueError
        Data of another station, terms that the data cannot separate, a systematic error that would
        spoil the model, or a file that cannot be read.

    Examples
    --------
    >>> found = rp.fit(sorted(Path("runs").glob("*/bag")), rp.Station("my_dish.yaml"))
    >>> print(found)
    >>> found.write("my_model.yaml")
    """
    station.description.require_mount("a fit of the bias model")
    targets = list(read_source(str(elements)).elements) if elements else []
    request = FitRequest(
        station=station.name, band=station.band, site=station.site, elements=targets, terms=tuple(terms), select=select,
        form=form, robust=robust, orbit_prior_m=orbit_prior_m, time_error_s=time_error_s, known=known,
        mount=station.controller.kinematics,
    )  # fmt: skip
    if isinstance(data, Observations):
        return fitted(request, FitData(data, []), name)
    ionosphere = None
    if ionosphere_tecu is not None and carrier_hz is not None:
        ionosphere = Ionosphere(electrons_per_m2=ionosphere_tecu * ELECTRONS_PER_TECU, frequency_hz=carrier_hz)
    paths = [Path(data)] if isinstance(data, str | Path) else [Path(each) for each in data]
    files = DataFiles(paths=paths, elements=targets, time_error_s=time_error_s, ionosphere=ionosphere)
    return fitted(request, files.read(station), name)


def fitted(request: FitRequest, data: FitData, name: str = "", created_t_s: float | None = None) -> Fit:
    """Return the fit of data that have been read.

    Data that carry few terms choose among those, unless the request names its own.
    """
    if data.offered and request.terms == names_of(request.mount.type):
        request = replace(request, terms=data.offered, select=True)
    done = OfflineFit(request, data).run()
    version = ModelVersion.from_fit(
        done.result, name=name or f"fit-{done.result.last_t_s:.0f}", software=f"rf_pointing {__version__}",
        created_t_s=time.time() if created_t_s is None else created_t_s,
    )  # fmt: skip
    return Fit(version, done, data, remarks(request, done))
