"""The file in which a fitted bias model lives: readable YAML or JSON, degrees and seconds, complete with covariance.

The suffix decides the format (.yaml, .yml, .json).  Reading checks every key; an error names it.
"""

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.model_version import ModelVersion, stamp_text
from rf_pointing.calibration.schema import Section
from rf_pointing.calibration.terms import Term, all_terms
from rf_pointing.core import require_choice

__all__ = ["FORMAT", "from_mapping", "read_model", "to_mapping", "write_model"]

Array = NDArray[np.float64]

FORMAT = "rf_pointing/bias_model/1"
_ROUNDING = 1e-9
_SIGMA_AGREES = 1e-3
_KEYS = (
    "format",
    "name",
    "station",
    "band",
    "software",
    "created_utc",
    "validity",
    "data",
    "fit",
    "terms",
    "covariance",
)
_EDGE = {"rad": ("deg", math.degrees(1.0)), "s": ("s", 1.0), "s^2": ("s2", 1.0), "rad/K": ("deg_k", math.degrees(1.0))}


def write_model(path: str | Path, file: ModelVersion) -> None:
    """Write the file in one step, so that a reader sees the old one or the new one; `read_model` is the inverse."""
    target, mapping = Path(path), to_mapping(file)
    if _is_json(target):
        text = json.dumps(mapping, indent=2) + "\n"
    else:
        import yaml

        text = yaml.safe_dump(mapping, sort_keys=False, default_flow_style=None, width=120)
    part = target.with_name(target.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, target)


def read_model(path: str | Path) -> ModelVersion:
    """Read and check a model file; raises ValueError naming file and key."""
    source = Path(path)
    text = source.read_text(encoding="utf-8")
    try:
        return from_mapping(_parsed(source, text))
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None


def to_mapping(file: ModelVersion) -> dict[str, Any]:
    """Return the file's content in edge units (degrees, seconds); `from_mapping` is the inverse."""
    known = all_terms()
    sigma = dict(zip(file.fitted, np.sqrt(np.diag(file.covariance)), strict=True))
    scale = np.array([_edge(known[name])[1] for name in file.fitted])
    until = None if file.valid_until_t_s is None else stamp_text(file.valid_until_t_s)
    return {
        "format": FORMAT,
        "name": file.name,
        "station": file.station,
        "band": file.band,
        "software": file.software,
        "created_utc": stamp_text(file.created_t_s),
        "validity": {"from_utc": stamp_text(file.valid_from_t_s), "until_utc": until},
        "data": {
            "first_utc": stamp_text(file.first_t_s),
            "last_utc": stamp_text(file.last_t_s),
            "observations": file.observations,
            "rejected": file.rejected,
            "passes": file.passes,
        },
        "fit": {
            "form": file.form,
            "condition": file.condition,
            "rms_cross_elevation_deg": math.degrees(file.rms_cross_elevation_rad),
            "rms_elevation_deg": math.degrees(file.rms_elevation_rad),
            "mean_azimuth_deg": math.degrees(file.mean_azimuth_rad),
            "mean_elevation_deg": math.degrees(file.mean_elevation_rad),
        },
        "terms": {
            name: _term_entry(known[name], value, sigma.get(name)) for name, value in file.model.coefficients.items()
        },
        "covariance": {
            "order": list(file.fitted),
            "unit": [_edge(known[name])[0] for name in file.fitted],
            "matrix": (file.covariance * np.outer(scale, scale)).tolist(),
        },
    }


def from_mapping(mapping: Mapping[str, Any]) -> ModelVersion:
    """Build from the content of a file; raises ValueError naming the key."""
    top = Section(mapping, "", _KEYS)
    require_choice("format", top.text("format"), (FORMAT,))
    validity = top.section("validity", ("from_utc", "until_utc"))
    data = top.section("data", ("first_utc", "last_utc", "observations", "rejected", "passes"))
    rms = ("rms_cross_elevation_deg", "rms_elevation_deg", "mean_azimuth_deg", "mean_elevation_deg")
    fit = top.section("fit", ("form", "condition", *rms))
    model, fitted = _read_terms(top)
    _check_order(validity, "from_utc", "until_utc")
    _check_order(data, "first_utc", "last_utc")
    return ModelVersion(
        name=top.text("name"),
        station=top.text("station"),
        band=top.text("band"),
        software=top.text("software"),
        created_t_s=top.time("created_utc"),
        valid_from_t_s=validity.time("from_utc"),
        valid_until_t_s=validity.time("until_utc") if validity.has("until_utc") else None,
        first_t_s=data.time("first_utc"),
        last_t_s=data.time("last_utc"),
        observations=data.whole("observations"),
        rejected=data.whole("rejected"),
        passes=data.whole("passes"),
        form=fit.text("form"),
        condition=fit.number("condition"),
        rms_cross_elevation_rad=math.radians(fit.number(rms[0])),
        rms_elevation_rad=math.radians(fit.number(rms[1])),
        mean_azimuth_rad=math.radians(fit.number(rms[2])),
        mean_elevation_rad=math.radians(fit.number(rms[3])),
        model=model,
        fitted=fitted,
        covariance=_read_covariance(top, fitted),
    )


def _parsed(source: Path, text: str) -> Any:
    if _is_json(source):
        try:
            return json.loads(text)
        except json.JSONDecodeError as error:
            raise ValueError(f"line {error.lineno}: {error.msg}") from None
    import yaml

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        raise ValueError(f"line {mark.line + 1 if mark else '?'}: not readable as YAML") from None


def _is_json(path: Path) -> bool:
    require_choice("suffix", path.suffix, (".yaml", ".yml", ".json"))
    return path.suffix == ".json"


def _edge(term: Term) -> tuple[str, float]:
    return _EDGE[term.unit]


def _term_entry(term: Term, value: float, sigma: float | None) -> dict[str, Any]:
    unit, scale = _edge(term)
    entry: dict[str, Any] = {f"value_{unit}": float(value * scale), "used": value != 0.0, "fixed": sigma is None}
    if sigma is not None:
        entry[f"sigma_{unit}"] = float(sigma * scale)
    return entry


def _read_terms(top: Section) -> tuple[BiasModel, tuple[str, ...]]:
    known, values, fitted = all_terms(), {}, []
    for name in top.section("terms", (), tuple(known)).values:
        unit, scale = _edge(known[name])
        holder = top.section("terms", (), tuple(known))
        entry = holder.section(name, (f"value_{unit}", "used", "fixed"), (f"sigma_{unit}",))
        values[name] = entry.number(f"value_{unit}") / scale
        if entry.flag("used") != (values[name] != 0.0):
            raise ValueError(f"{entry.key('used')}={entry.flag('used')} contradicts {entry.key('value_' + unit)}")
        if not entry.flag("fixed"):
            fitted.append(name)
    return BiasModel(values), tuple(fitted)


def _read_covariance(top: Section, fitted: tuple[str, ...]) -> Array:
    section = top.section("covariance", ("order", "unit", "matrix"))
    order = section.texts("order")
    if set(order) != set(fitted):
        raise ValueError(f"{section.key('order')} is {', '.join(order)}; must be the fitted terms {', '.join(fitted)}")
    if order != fitted:
        raise ValueError(f"{section.key('order')} must be in the order of the terms")
    known = all_terms()
    if section.texts("unit") != tuple(_edge(known[name])[0] for name in order):
        raise ValueError(f"{section.key('unit')} must be {', '.join(_edge(known[name])[0] for name in order)}")
    scale = np.array([_edge(known[name])[1] for name in order])
    matrix = np.array(section.numbers("matrix", len(order))).reshape(len(order), len(order)) / np.outer(scale, scale)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0) or np.any(np.diag(matrix) <= 0.0):
        raise ValueError(f"{section.key('matrix')} must be symmetric with a positive diagonal")
    sigma = np.sqrt(np.diag(matrix))
    if np.min(np.linalg.eigvalsh(matrix / np.outer(sigma, sigma)), initial=1.0) < -_ROUNDING:
        raise ValueError(f"{section.key('matrix')} must be positive semidefinite: no data have such a covariance")
    _check_sigma(top, fitted, sigma * scale)
    return matrix


def _check_sigma(top: Section, fitted: tuple[str, ...], sigma: Array) -> None:
    """Refuse a term whose own sigma is not the one of the covariance (edge units)."""
    known = all_terms()
    terms = top.section("terms", (), tuple(known))
    for name, expected in zip(fitted, sigma.tolist(), strict=True):
        unit = _edge(known[name])[0]
        entry = terms.section(name, (f"value_{unit}", "used", "fixed", f"sigma_{unit}"))
        if not math.isclose(entry.number(f"sigma_{unit}"), expected, rel_tol=_SIGMA_AGREES):
            raise ValueError(
                f"{entry.key('sigma_' + unit)}={entry.number('sigma_' + unit)} contradicts the covariance: {expected:g}"
            )


def _check_order(section: Section, first: str, last: str) -> None:
    if section.has(last) and section.time(last) < section.time(first):
        raise ValueError(f"{section.key(last)}={section.text(last)} must not be before {first}={section.text(first)}")
