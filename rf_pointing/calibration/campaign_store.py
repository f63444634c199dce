"""A campaign on disk: one file per pass, written whole, so that a killed process loses at most the pass in work."""

from pathlib import Path

from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.tracking_csv import read_observations, write_observations

__all__ = ["load_campaign", "save_pass"]


def save_pass(folder: str | Path, points: Observations) -> Path:
    """Write the points of one pass and return the file; the same pass again replaces it."""
    if len(points.passes) != 1:
        raise ValueError(f"passes={len(points.passes)} must be 1: one file holds one pass")
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    target = place / f"pass_{int(points.passes[0]):06d}.csv"
    write_observations(target, points)
    return target


def load_campaign(folder: str | Path) -> Observations:
    """Return the points of all passes of a campaign; a pass cut off while it was written is not among them."""
    files = sorted(Path(folder).glob("pass_*.csv"))
    if not files:
        raise ValueError(f"{folder} holds no passes (pass_*.csv)")
    return Observations.concatenate([read_observations(file) for file in files])
