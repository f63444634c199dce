"""The monopulse tracker of a station: measures clusters and calibrates its feed.

A cluster of the calibration scan waits until encoders and scan centre are known on either side of
its middle.  The scan is over when the mode is; what it found is used from then on and kept in the
file, YAML with the numbers of `MonopulseCalibration`.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from rf_pointing.core import Array, JointReading, Mode, MonopulseCluster, PointingError
from rf_pointing.core.signals import BeamPosition
from rf_pointing.core.whole_file import parse_yaml, read_whole, write_whole
from rf_pointing.tracking.monopulse import MonopulseCalibration, MonopulseParams, MonopulseTracker
from rf_pointing.tracking.monopulse_scan import MonopulseCalibrator, MonopulseScanParams

FORMAT = "rf_pointing/monopulse_calibration/1"
FIELDS = ("response_real", "response_imaginary", "offset_real", "offset_imaginary")
# Clusters that wait for encoders and status; more than 2 s of them means that one is missing.
MOST_WAITING = 20


def write_calibration(path: Path, calibration: MonopulseCalibration) -> None:
    """Write the file; an existing one is replaced as a whole."""
    content = {"format": FORMAT} | {name: list(getattr(calibration, name)) for name in FIELDS}
    write_whole(path, yaml.safe_dump(content, sort_keys=False))


def read_calibration(path: Path) -> MonopulseCalibration:
    """Return the calibration of a file; ValueError names the file and what is wrong with it."""
    text = read_whole(path)
    try:
        content = parse_yaml(text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ValueError(f"{path}: format must be {FORMAT}")
    try:
        return MonopulseCalibration.from_mapping({name: content.get(name) for name in FIELDS})
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}: {error}") from error


@dataclass(frozen=True)
class CalibrationOutcome:
    """Result of the last calibration scan; `refused` if it could not be used."""

    message: str = "ideal feed"
    refused: bool = False
    scans: int = 0


class ClusterTracker:
    """One `MonopulseTracker` with its calibration; `calibration_file` may be empty."""

    def __init__(self, monopulse: MonopulseParams, scan: MonopulseScanParams, calibration_file: str) -> None:
        self._file, self._scan = Path(calibration_file) if calibration_file else None, scan
        calibration = read_calibration(self._file) if self._file and self._file.is_file() else None
        self.tracker = MonopulseTracker(monopulse, calibration)
        self.outcome = CalibrationOutcome(message=f"read from {self._file}" if calibration else "ideal feed")
        self.counts = {"valid": 0, "invalid": 0}
        self.last_reason = ""
        self._beam = BeamPosition()
        self._calibrator: MonopulseCalibrator | None = None
        self._waiting: list[MonopulseCluster] = []

    @property
    def calibrating(self) -> bool:
        """Whether a calibration scan runs; encoder angles matter only then."""
        return self._calibrator is not None

    def retune(self, monopulse: MonopulseParams) -> None:
        """Take new parameters; a calibration stays in force."""
        known = self.tracker.calibration if self.outcome.scans or self._file else None
        self.tracker = MonopulseTracker(monopulse, known)

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles, while a calibration scan runs."""
        if self.calibrating:
            self._beam.take_joints(reading)

    def take_status(self, t_s: float, scan_centre_rad: Array, _offset_rad: Array, mode: str) -> None:
        """Note the scan centre (2,), axis angles, and whether the calibration scan runs."""
        if mode == Mode.CALIBRATE and self._calibrator is None:
            self._calibrator = MonopulseCalibrator(self._scan)
            self._beam.clear()
            self._waiting.clear()
        elif mode != Mode.CALIBRATE and self._calibrator is not None:
            self._conclude(self._calibrator)
            self._calibrator = None
        if self.calibrating:
            self._beam.take_centre(t_s, scan_centre_rad)

    def take_cluster(self, cluster: MonopulseCluster) -> PointingError:
        """Return the pointing error of a cluster, valid or not."""
        error = self.tracker.measure(cluster)
        self.counts["valid" if error.valid else "invalid"] += 1
        self.last_reason = error.reason
        if self._calibrator is not None:
            self._waiting.append(cluster)
            self._place(self._calibrator)
        return error

    def _place(self, calibrator: MonopulseCalibrator) -> None:
        while self._waiting:
            middle_s = float(np.mean(self._waiting[0].t_s))
            away = self._beam.offset(middle_s) if np.isfinite(middle_s) else np.zeros(2)
            if away is None and not self._beam.too_old(middle_s):
                break
            cluster = self._waiting.pop(0)
            if away is not None:
                calibrator.add(cluster, float(away[0]), float(away[1]))
        del self._waiting[: max(0, len(self._waiting) - MOST_WAITING)]

    def _conclude(self, calibrator: MonopulseCalibrator) -> None:
        scans = self.outcome.scans + 1
        try:
            found = calibrator.solve()
            calibration = found.calibration
            self.tracker = MonopulseTracker(self.tracker.params, calibration)
            if self._file:
                write_calibration(self._file, calibration)
        # A calibration in force stays so: a bad scan must not cost the pass its sensor.
        except (ValueError, OSError) as reason:
            self.outcome = CalibrationOutcome(f"calibration not used: {reason}", refused=True, scans=scans)
            return
        kept = f", kept in {self._file}" if self._file else ""
        words = f"calibrated, chi squared {found.chi_squared:.2f}{kept}"
        self.outcome = CalibrationOutcome(words, scans=scans)
