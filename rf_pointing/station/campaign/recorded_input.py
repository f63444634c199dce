"""The input of a calibration: files of points or raw tracking data, and their reference."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from rf_pointing.calibration import (
    Observations,
    RawTracking,
    ReferenceTrack,
    read_observations,
    read_tdm,
    read_tracking,
    require_derivatives,
    split_passes,
)
from rf_pointing.core import JOURNAL_BYTES, LEVEL, Kinematics, RadioRefraction, read_whole
from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, find_elements

REFERENCE_STEP_S = 2.0
# Longer than any loss of signal within a pass, shorter than the time between two passes.
PASS_GAP_S = 1200.0


def holds_points(path: Path) -> bool:
    """Return whether a CSV file holds calibration points (else raw tracking data)."""
    # By the header, not by the name: both kinds of table are .csv.
    lines = read_whole(path, JOURNAL_BYTES, "utf-8-sig").splitlines()
    header = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return "observed_" in header


def read_points(paths: Sequence[Path], mount: Kinematics = LEVEL) -> Observations | None:
    """Return the points of all files, passes numbered from file to file; None without files."""
    parts: list[Observations] = []
    for path in paths:
        points = read_observations(path, mount)
        try:
            require_derivatives(points)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        shift = int(np.max(parts[-1].pass_id)) + 1 - int(np.min(points.pass_id)) if parts else 0
        # Two files may both begin with pass 0, and orbit errors belong to one pass.
        parts.append(replace(points, pass_id=points.pass_id + shift))
    return Observations.concatenate(parts) if parts else None


def read_raw(path: Path, band: str, mount: Kinematics = LEVEL) -> list[RawTracking]:
    """Return the passes of a CSV file or a TDM in angles of the axes.

    A TDM has azimuth and elevation; `band` is that of messages that name none.
    """
    if path.suffix == ".csv":
        tracks = [read_tracking(path, mount)]
    else:
        tracks = [one.turned(mount.of_directions) for one in read_tdm(path, band=band)]
    return [one for track in tracks for one in split_passes(track, PASS_GAP_S)]


def reference_of(
    raw: RawTracking, elements: Sequence[Elements], site: Site, max_age_s: float,
    refraction: RadioRefraction | Literal["standard"] | None = "standard",
    mount: Kinematics = LEVEL,
) -> ReferenceTrack:  # fmt: skip
    """Return the apparent motion of the target of `raw` by its elements, over its samples.

    `refraction` None is right for angles from which it has been taken off.
    """
    track = TopocentricTrack(find_elements(elements, raw.target), site, max_age_s=max_age_s, refraction=refraction)
    times = raw.t_s[np.isfinite(raw.t_s)]
    if len(times) == 0:
        raise ValueError(f"tracking data of {raw.target}: no finite time")
    # Not their ends: one time tag in the far future must not stretch the reference.
    low, high = np.percentile(times, [2.0, 98.0])
    margin = 0.1 * (high - low) + 30.0
    look = track.sample(np.arange(low - margin, high + margin, REFERENCE_STEP_S))
    return ReferenceTrack.of(look).on(mount)
