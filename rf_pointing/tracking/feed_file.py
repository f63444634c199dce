"""The file that keeps the calibration of a monopulse feed: YAML, with the numbers of `MonopulseCalibration`."""

from pathlib import Path

import yaml

from rf_pointing.core.whole_file import write_whole
from rf_pointing.tracking import MonopulseCalibration

__all__ = ["read_calibration", "write_calibration"]

FORMAT = "rf_pointing/monopulse_calibration/1"
FIELDS = ("response_real", "response_imaginary", "offset_real", "offset_imaginary")


def write_calibration(path: Path, calibration: MonopulseCalibration) -> None:
    """Write the file; an existing one is replaced as a whole."""
    content = {"format": FORMAT} | {name: list(getattr(calibration, name)) for name in FIELDS}
    write_whole(path, yaml.safe_dump(content, sort_keys=False))


def read_calibration(path: Path) -> MonopulseCalibration:
    """Return the calibration of a file; ValueError names the file and what is wrong with it."""
    try:
        content = yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        raise ValueError(f"{path}: not YAML: {error}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ValueError(f"{path}: format must be {FORMAT}")
    try:
        return MonopulseCalibration.from_mapping({name: content.get(name) for name in FIELDS})
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}: {error}") from error
