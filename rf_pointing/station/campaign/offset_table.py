"""A table of observed offsets: what was added to a prediction until the target was in the beam.

    utc,target,azimuth_offset_deg,elevation_offset_deg
    2026-11-26T18:04:10,METEOR-M2 4,0.48,-0.31
    2026-11-26T18:30:00,Moon,0.51,-0.33

Offsets are those of the axes, under their names (`x_offset_deg` of an X-Y mount): azimuth is not
multiplied by cos(elevation).  They count from the prediction without a model.  A target is a name
or number among the elements, Sun, Moon, a radio source, a planet, `radec RA DEC` or `azel AZ EL`.
A fifth column `sigma_deg` may say how well the middle of the beam was found on the sky.
"""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from rf_pointing.calibration import Observations
from rf_pointing.calibration.terms import names_of
from rf_pointing.core import DATA_BYTES, LEVEL, Kinematics, RadioRefraction, is_number, parse_utc, read_whole
from rf_pointing.core.mount_types import MOUNTS
from rf_pointing.ephemeris import Elements, Site, TargetSource, TopocentricTrack, find_elements
from rf_pointing.ephemeris.source import body_of

SIGMA = "sigma_deg"
FOUND_WITHIN = 0.1
"""Accuracy of a row without a sigma, in beamwidths: that of a peak found by hand."""
LARGEST_DEG, FAR_M = 11.0, 1e16
# Numbers of the terms of `calibration/terms.py`: offsets, tilt of the lower axis, bending.
OFFSETS, TILT, BENDING = (1, 10), (8, 9), (3, 11)
FEWEST_TILTED, FEWEST_BENT = 8, 12
LEAST_SPAN_RAD = math.radians(25.0)


def columns_of(axes: tuple[str, str]) -> tuple[str, ...]:
    """Return the columns of a table of these axes; the last one may be left out."""
    return "utc", "target", *(f"{axis}_offset_deg" for axis in axes), SIGMA


def holds_offsets(path: Path) -> bool:
    """Return whether a CSV file is a table of offsets, of any mount, by its header."""
    header = _header(path)
    return any(columns_of(each.axes)[2] in header for each in MOUNTS.values())


def read_offsets(
    path: Path, station: str, band: str, site: Site, beamwidth_rad: float,
    elements: Sequence[Elements], max_age_s: float,
    refraction: RadioRefraction | Literal["standard"] | None = "standard", mount: Kinematics = LEVEL,
) -> Observations:  # fmt: skip
    """Return the rows as calibration points, each a pass of its own; ValueError names the line."""
    lines = read_whole(path, DATA_BYTES, "utf-8-sig").splitlines()
    header, columns = _header(path), columns_of(mount.axes)
    if set(header) - set(columns) or not set(columns[:-1]) <= set(header):
        needed = f"{','.join(columns[:-1])}, and {SIGMA} if it is known"
        raise ValueError(f"{path}: the columns must be {needed}; the mount is {mount.words}")
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
            t_s, offset = parse_utc(row["utc"].strip()), [_number(row, name) for name in columns[2:-1]]
            sigma = math.radians(_number(row, SIGMA)) if SIGMA in row else FOUND_WITHIN * beamwidth_rad
            rows.append((t_s, *_motion(tracks[target], t_s, mount), *np.radians(offset), sigma))
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
        range_m=range_m, range_rate_m_s=range_rate_m_s, mount=mount,
    )  # fmt: skip


def terms_of_offsets(points: Observations) -> tuple[str, ...]:
    """Return the terms that such points can tell apart, from which a fit chooses by BIC.

    The two offsets always; the tilt of the mount with `FEWEST_TILTED` rows in three quarters of the
    compass; collimation and droop with `FEWEST_BENT` rows over `LEAST_SPAN_RAD` of elevation.
    """
    azimuth, elevation = points.sky_rad()
    quarters = len(np.unique(np.floor(azimuth % math.tau / (0.5 * math.pi))))
    tilted = len(points) >= FEWEST_TILTED and quarters >= 3
    bent = len(points) >= FEWEST_BENT and float(np.ptp(elevation)) >= LEAST_SPAN_RAD
    names = names_of(points.mount.type)
    return tuple(names[number - 1] for number in OFFSETS + TILT * tilted + BENDING * bent)


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


def _motion(track: TopocentricTrack, t_s: float, mount: Kinematics) -> list[float]:
    look = mount.of_axes(track.target_at(t_s))
    # No error of an orbit moves a star.
    return [*look.motion, *((FAR_M, 0.0) if track.target.at_infinity else (look.range_m, look.range_rate_m_s))]


def _number(row: dict[str, str], name: str) -> float:
    try:
        value = float(row[name])
    except ValueError:
        raise ValueError(f"{name}={row[name]!r} must be a number") from None
    least = 1e-6 if name == SIGMA else -LARGEST_DEG
    if not is_number(value, least, LARGEST_DEG):
        raise ValueError(f"{name}={value:g} must be {least:g} to {LARGEST_DEG:g} deg")
    return value
