"""A table of observed offsets: what was added to a prediction until the target was in the beam.

    utc,target,azimuth_offset_deg,elevation_offset_deg
    2026-11-26T18:04:10,METEOR-M2 4,0.48,-0.31
    2026-11-26T18:30:00,Moon,0.51,-0.33

Offsets are those of the axes: azimuth is not multiplied by cos(elevation).  They count from the
prediction without a model.  A target is a name or number among the elements, Sun, Moon, a radio
source, a planet or `radec RA DEC`.  A fifth column `sigma_deg` may say how well the middle of the
beam was found on the sky.
"""

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from rf_pointing.calibration import Observations
from rf_pointing.core import DATA_BYTES, Array, RadioRefraction, is_number, parse_utc, read_whole
from rf_pointing.ephemeris import Elements, Site, TargetSource, TopocentricTrack, find_elements
from rf_pointing.ephemeris.source import body_of

COLUMNS = ("utc", "target", "azimuth_offset_deg", "elevation_offset_deg")
SIGMA = "sigma_deg"
FOUND_WITHIN = 0.1
"""Accuracy of a row without a sigma, in beamwidths: that of a peak found by hand."""
LARGEST_DEG, FAR_M = 11.0, 1e16
OFFSETS = ("azimuth_offset", "elevation_offset")
TILT = ("mislevel_east", "mislevel_north")
BENDING = ("collimation", "droop")
FEWEST_TILTED, FEWEST_BENT = 8, 12
LEAST_SPAN_RAD = math.radians(25.0)


def holds_offsets(path: Path) -> bool:
    """Return whether a CSV file is a table of offsets, by its header."""
    return COLUMNS[2] in _header(path)


def read_offsets(
    path: Path, station: str, band: str, site: Site, beamwidth_rad: float,
    elements: Sequence[Elements], max_age_s: float,
    refraction: RadioRefraction | Literal["standard"] | None = "standard",
) -> Observations:  # fmt: skip
    """Return the rows as calibration points, each a pass of its own; ValueError names the line."""
    lines = read_whole(path, DATA_BYTES, "utf-8-sig").splitlines()
    header = _header(path)
    if set(header) - {*COLUMNS, SIGMA} or not set(COLUMNS) <= set(header):
        raise ValueError(f"{path}: the columns must be {','.join(COLUMNS)}, and {SIGMA} if it is known")
    tracks: dict[str, TopocentricTrack] = {}
    rows = []
    for number, cells in enumerate(csv.reader(lines), start=1):
        if not cells or cells[0].startswith("#") or [cell.strip() for cell in cells] == header:
            continue
        try:
            row = dict(zip(header, cells, strict=True))
            target = row["target"].strip()
            if target not in tracks:
                source = _source(elements, target)
                tracks[target] = TopocentricTrack(source, site, max_age_s=max_age_s, refraction=refraction)
            t_s, offset = parse_utc(row["utc"].strip()), [_number(row, name) for name in COLUMNS[2:]]
            sigma = math.radians(_number(row, SIGMA)) if SIGMA in row else FOUND_WITHIN * beamwidth_rad
            rows.append((t_s, *_motion(tracks[target], t_s), *np.radians(offset), sigma))
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from None
    t_s, azimuth, elevation, *motion, range_m, range_rate_m_s, azimuth_offset, elevation_offset, sigma = np.array(
        sorted(rows)
    ).T
    return Observations(
        station=station, band=band, t_s=t_s, pass_id=np.arange(len(t_s)),
        observed_azimuth_rad=azimuth + azimuth_offset, observed_elevation_rad=elevation + elevation_offset,
        true_azimuth_rad=azimuth, true_elevation_rad=elevation, azimuth_rate_rad_s=motion[0],
        elevation_rate_rad_s=motion[1], azimuth_acceleration_rad_s2=motion[2], elevation_acceleration_rad_s2=motion[3],
        sigma_azimuth_rad=sigma / np.maximum(np.cos(elevation), 1e-3), sigma_elevation_rad=sigma,
        range_m=range_m, range_rate_m_s=range_rate_m_s,
    )  # fmt: skip


def terms_of_offsets(points: Observations) -> tuple[str, ...]:
    """Return the terms that such points can tell apart, from which a fit chooses by BIC.

    The two offsets always; the tilt of the mount with `FEWEST_TILTED` rows in three quarters of the
    compass; collimation and droop with `FEWEST_BENT` rows over `LEAST_SPAN_RAD` of elevation.
    """
    found: Callable[[Array], int] = lambda values: len(np.unique(values))  # noqa: E731
    quarters = found(np.floor(points.true_azimuth_rad % math.tau / (0.5 * math.pi)))
    tilted = len(points) >= FEWEST_TILTED and quarters >= 3
    bent = len(points) >= FEWEST_BENT and float(np.ptp(points.true_elevation_rad)) >= LEAST_SPAN_RAD
    return OFFSETS + TILT * tilted + BENDING * bent


def _header(path: Path) -> list[str]:
    lines = read_whole(path, DATA_BYTES, "utf-8-sig").splitlines()
    first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return [name.strip() for name in first.split(",")]


def _source(elements: Sequence[Elements], target: str) -> Elements | TargetSource:
    if (body := body_of(target)) is not None:
        return body
    if not elements:
        raise ValueError(f"target={target!r} needs --elements FILE: without it only bodies")
    return find_elements(elements, target)


def _motion(track: TopocentricTrack, t_s: float) -> list[float]:
    look = track.sample([t_s])
    names = ("azimuth", "elevation")
    # No error of an orbit moves a star.
    far = track.target.at_infinity
    place = [FAR_M, 0.0] if far else [float(look.range_m[0]), float(look.range_rate_m_s[0])]
    return [
        float(getattr(look, f"{axis}{ending}")[0])
        for ending in ("_rad", "_rate_rad_s", "_acceleration_rad_s2")
        for axis in names
    ] + place


def _number(row: dict[str, str], name: str) -> float:
    try:
        value = float(row[name])
    except ValueError:
        raise ValueError(f"{name}={row[name]!r} must be a number") from None
    least = 1e-6 if name == SIGMA else -LARGEST_DEG
    if not is_number(value, least, LARGEST_DEG):
        raise ValueError(f"{name}={value:g} must be {least:g} to {LARGEST_DEG:g} deg")
    return value
