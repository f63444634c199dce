"""LQG designs of both axes as a JSON file: gains, weights, margins, and the identified model they were made for.

The package brings the designs for DSS-13; `benchmarks/lqg_tuning.py` made them, its output lies beside it.
"""

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from rf_pointing.controllers.lqg_design import LqgDesign
from rf_pointing.core import AXES

__all__ = ["load_lqg_designs", "save_lqg_designs"]

_FORMAT = "rf_pointing LQG designs 1"
_PACKAGED = "dss13_lqg.json"


def save_lqg_designs(path: Path, azimuth: LqgDesign, elevation: LqgDesign) -> None:
    """Write both designs to `path`."""
    content = {"format": _FORMAT, "azimuth": azimuth.to_mapping(), "elevation": elevation.to_mapping()}
    path.write_text(json.dumps(content, indent=1) + "\n")


def load_lqg_designs(path: Path | None = None) -> tuple[LqgDesign, LqgDesign]:
    """Return the designs (azimuth, elevation) in `path`, those for DSS-13 without one.

    Raises
    ------
    ValueError
        For an unreadable file, another format, or an unknown or missing key.
    """
    source = files("rf_pointing.controllers").joinpath(_PACKAGED) if path is None else path
    try:
        content = json.loads(source.read_text())
    except (OSError, json.JSONDecodeError) as error:
        raise ValueError(f"{source}: no LQG designs: {error}") from error
    if not isinstance(content, Mapping) or content.get("format") != _FORMAT:
        raise ValueError(f"{source}: format must be {_FORMAT!r}")
    unknown, missing = sorted(set(content) - {"format", *AXES}), sorted(set(AXES) - set(content))
    if unknown or missing:
        raise ValueError(f"{source}: unknown keys {unknown}, lacks {missing}")
    azimuth, elevation = (LqgDesign.from_mapping(content[axis]) for axis in AXES)
    return azimuth, elevation
