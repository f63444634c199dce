"""Report of the array sensors in a bag: pictures, and true against claimed errors."""

import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.report.pictures import draw_attitude, draw_pose
from rf_pointing.array_sensors.report.series import (
    ArraySeries,
    array_sensors,
    read_attitude_series,
    read_pose_series,
)
from rf_pointing.report.html import Cell, render

SCHEMA = "rf_pointing/array_summary/1"
_CAPTION = (
    "Estimates and truth of the same stamps on the left, errors in the band of three claimed deviations on the right. "
    "A dotted line is a hand-off: from there on another station is received."
)
NUMBER = re.compile(r"\d[\d.e+-]*")
_AXES = [f"{what} {axis}" for what in ("rms", "claimed") for axis in "xyz"]
_READ = {"attitude": read_attitude_series, "relative_pose": read_pose_series}
_DRAW = {"attitude": draw_attitude, "relative_pose": draw_pose}


@dataclass(frozen=True, kw_only=True)
class ArrayErrors:
    """Errors of one quantity of a sensor over its valid epochs.

    Rms and median claimed deviation (x, y, z) in `unit`.  `inside` is the share of all errors
    within three claimed deviations, `nees` the mean normalised squared error, of which 3 is
    expected; without a valid epoch the four are None.
    """

    sensor: str
    quantity: str
    unit: str
    epochs: int
    valid: int
    rms: tuple[float, ...] | None
    claimed: tuple[float, ...] | None
    inside: float | None
    nees: float | None


def report_array_sensors(bag: Path, folder: Path) -> Path | None:
    """Write the page of a bag that holds array sensors and return its path.

    None when it holds none.  The executable `report` finds this function through the entry point
    group `rf_pointing.reports`.
    """
    # A bag of the antenna is not an error: every report writer is called for every bag.
    if not array_sensors(bag):
        return None
    write_array_report(bag, folder)
    return folder / "array_report.html"


def write_array_report(bag: Path | str, output_dir: Path | str) -> list[ArrayErrors]:
    """Write `array_report.html`, `array_summary.json` and a picture of every array sensor.

    Return the errors.

    Raises
    ------
    ValueError The recording cannot be read, holds no array sensor, or one without a stamp in common
        with its truth.
    """
    path, folder = Path(bag), Path(output_dir)
    sensors = array_sensors(path)
    if not sensors:
        raise ValueError(
            f"path={path} holds no attitude or relative_pose with its truth below sim/"
        )
    folder.mkdir(parents=True, exist_ok=True)
    errors: list[ArrayErrors] = []
    figures: dict[Path, str] = {}
    reasons: dict[str, dict[str, int]] = {}
    for namespace, what in sensors.items():
        series = _READ[what](path, namespace)
        name, title = namespace.strip("/").replace("/", "_") or "root", f"{namespace}/{what}"
        picture = folder / f"{name}_{what}.png"
        measured = array_errors(title, series)
        _DRAW[what](series, picture, _heading(title, measured))
        figures[picture] = title
        errors += measured
        reasons[title] = _counted(series.reasons)
    page = render(
        "table.html",
        title=f"Array sensors of {path.name}",
        head=("sensor", "quantity", "epochs", "valid", *_AXES, "inside 3σ, %", "NEES of 3"),
        rows=_rows(errors),
        words=(0, 1),
        notices={
            f"{title}: epochs without a valid estimate": [
                f"{count}: {reason}" for reason, count in found.items()
            ]
            for title, found in reasons.items()
            if found
        },
        figures=figures,
        caption=_CAPTION,
    )
    (folder / "array_report.html").write_text(page, encoding="utf-8")
    lines = [asdict(each) for each in errors]
    summary = {"schema": SCHEMA, "bag": str(path), "errors": lines, "reasons": reasons}
    (folder / "array_summary.json").write_text(
        json.dumps(summary, indent=1) + "\n", encoding="utf-8"
    )
    return errors


def _heading(title: str, errors: Sequence[ArrayErrors]) -> str:
    """Return the title of a picture: how many epochs are valid, and the NEES of each quantity."""
    found = [f"{title}: {errors[0].valid} of {errors[0].epochs} epochs valid"]
    found += [
        f"NEES of the {each.quantity} {each.nees:.2f}" for each in errors if each.nees is not None
    ]
    return ", ".join(found) + (" (3 is expected)" if len(found) > 1 else "")


def array_errors(sensor: str, series: ArraySeries) -> list[ArrayErrors]:
    found = []
    if series.position_m is not None:
        nees = series.nees(0, series.position_error_m)
        found.append(
            _line(
                sensor,
                "position",
                "m",
                series,
                series.position_error_m,
                series.position_sigma_m,
                nees,
            )
        )
    degrees = (np.degrees(series.rotation_error_rad), np.degrees(series.rotation_sigma_rad))
    nees = series.nees(series.covariance.shape[-1] - 3, series.rotation_error_rad)
    return [*found, _line(sensor, "attitude", "deg", series, *degrees, nees)]


def _counted(reasons: Sequence[str]) -> dict[str, int]:
    """Return how often each reason was given, the most frequent first; reasons that differ in their
    numbers only are one, with the numbers of the first.
    """
    alike: dict[str, list[str]] = {}
    for reason in reasons:
        alike.setdefault(NUMBER.sub("#", reason), []).append(reason)
    ordered = sorted(alike.values(), key=len, reverse=True)
    return {each[0]: len(each) for each in ordered}


def _line(
    sensor: str,
    quantity: str,
    unit: str,
    series: ArraySeries,
    error: NDArray[np.float64],
    sigma: NDArray[np.float64],
    nees: NDArray[np.float64],
) -> ArrayErrors:
    valid = series.valid
    count = int(np.sum(valid))
    some = count > 0
    return ArrayErrors(
        sensor=sensor,
        quantity=quantity,
        unit=unit,
        epochs=len(valid),
        valid=count,
        rms=tuple(np.sqrt(np.mean(error[valid] ** 2, axis=0)).tolist()) if some else None,
        # Median, not mean: the first epochs after a start claim degrees.
        claimed=tuple(np.median(sigma[valid], axis=0).tolist()) if some else None,
        inside=float(np.mean(np.abs(error[valid]) <= 3.0 * sigma[valid])) if some else None,
        nees=float(np.mean(nees[valid])) if some else None,
    )


def _rows(errors: Sequence[ArrayErrors]) -> list[list[Cell]]:
    return [
        [
            each.sensor,
            f"{each.quantity}, {each.unit}",
            each.epochs,
            each.valid,
            *(each.rms or [None] * 3),
            *(each.claimed or [None] * 3),
            None if each.inside is None else 100.0 * each.inside,
            each.nees,
        ]
        for each in errors
    ]
