"""Reading a nested mapping with errors that name the key: the checks behind the model file.

A fitted bias model with all that an operator must know of it: where it comes from, how certain it is, when it holds.

The file in which a fitted bias model lives: readable YAML or JSON, degrees and seconds, complete with covariance.

The suffix decides the format (.yaml, .yml, .json).  Reading checks every key; an error names it.
"""

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.terms import Term, all_terms
from rf_pointing.core import require_choice, require_finite
from rf_pointing.core.dates import from_utc_text, to_utc_text

__all__ = ["FORMAT", "ModelVersion", "Section", "from_mapping", "read_model", "stamp_text", "to_mapping", "write_model"]


class Section:
    """One mapping of a file: every key must be known, every needed key present, every value of its type."""

    def __init__(self, value: Any, path: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> None:
        if not isinstance(value, Mapping):
            raise ValueError(f"{path or 'file'} must be a mapping of keys to values")
        self.path, self.values = path, value
        unknown = [str(key) for key in value if key not in needed + optional]
        if unknown:
            raise ValueError(f"{self.key(unknown[0])} is not a known key; known: {', '.join(needed + optional)}")
        missing = [key for key in needed if key not in value]
        if missing:
            raise ValueError(f"{self.key(missing[0])} is missing")

    def key(self, name: str) -> str:
        """Return the full path of a key."""
        return f"{self.path}.{name}" if self.path else name

    def has(self, name: str) -> bool:
        """Return whether an optional key is given and not null."""
        return self.values.get(name) is not None

    def section(self, name: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> "Section":
        """Return a nested mapping."""
        return Section(self.values[name], self.key(name), needed, optional)

    def text(self, name: str) -> str:
        """Return a non-empty text."""
        value = self.values[name]
        if not isinstance(value, str) or not value:
            raise ValueError(f"{self.key(name)}={value!r} must be a text")
        return value

    def flag(self, name: str) -> bool:
        """Return true or false."""
        value = self.values[name]
        if not isinstance(value, bool):
            raise ValueError(f"{self.key(name)}={value!r} must be true or false")
        return value

    def number(self, name: str) -> float:
        """Return a finite number."""
        value = self.values[name]
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f"{self.key(name)}={value!r} must be a number")
        require_finite(self.key(name), value)
        return float(value)

    def whole(self, name: str) -> int:
        """Return a whole number >= 0."""
        value = self.values[name]
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise ValueError(f"{self.key(name)}={value!r} must be a whole number >= 0")
        return value

    def time(self, name: str) -> float:
        """Return UTC seconds since 1970 of an ISO text ending in Z."""
        text = self.text(name)
        if not text.endswith("Z"):
            raise ValueError(f"{self.key(name)}={text!r} must be a time like 2026-03-21T05:11:02Z")
        try:
            return from_utc_text(text)
        except ValueError as error:
            raise ValueError(f"{self.key(name)}: {error}") from None

    def texts(self, name: str) -> tuple[str, ...]:
        """Return a list of texts."""
        value = self.values[name]
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise ValueError(f"{self.key(name)} must be a list of texts")
        return tuple(value)

    def numbers(self, name: str, count: int) -> list[list[float]]:
        """Return a square matrix of finite numbers."""
        value = self.values[name]
        square = isinstance(value, list) and len(value) == count
        if not square or not all(isinstance(row, list) and len(row) == count for row in value):
            raise ValueError(f"{self.key(name)} must be a list of {count} lists of {count} numbers")
        for i, row in enumerate(value):
            for j, item in enumerate(row):
                if isinstance(item, bool) or not isinstance(item, (int, float)):
                    raise ValueError(f"{self.key(name)}[{i}][{j}]={item!r} must be a number")
                require_finite(f"{self.key(name)}[{i}][{j}]", item)
        return [[float(item) for item in row] for row in value]


Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelVersion:
    """A named version of a bias model and where it comes from; times are UTC seconds since 1970.

    `fitted` are the terms that were estimated, in the order of `covariance` (k, k) in core units; the others were
    fixed.  `valid_until_t_s` None: until replaced.
    """

    name: str
    station: str
    band: str
    software: str
    created_t_s: float
    valid_from_t_s: float
    valid_until_t_s: float | None
    first_t_s: float
    last_t_s: float
    observations: int
    rejected: int
    passes: int
    form: str
    condition: float
    rms_cross_elevation_rad: float
    rms_elevation_rad: float
    mean_azimuth_rad: float
    mean_elevation_rad: float
    model: BiasModel
    fitted: tuple[str, ...]
    covariance: Array

    @classmethod
    def from_fit(
        cls, result: FitResult, *, name: str, software: str, created_t_s: float, valid_until_t_s: float | None = None
    ) -> "ModelVersion":
        """Make the file of a fit; it is valid from its creation."""
        rms, mean = result.rms_rad(), result.mean_rad()
        return cls(
            name=name,
            station=result.station,
            band=result.band,
            software=software,
            created_t_s=created_t_s,
            valid_from_t_s=created_t_s,
            valid_until_t_s=valid_until_t_s,
            first_t_s=result.first_t_s,
            last_t_s=result.last_t_s,
            observations=int(np.sum(result.used)),
            rejected=len(result.rejected),
            passes=result.passes,
            form=result.form,
            condition=result.condition,
            rms_cross_elevation_rad=rms[0],
            rms_elevation_rad=rms[1],
            mean_azimuth_rad=mean[0],
            mean_elevation_rad=mean[1],
            model=result.model,
            fitted=result.names,
            covariance=result.covariance,
        )

    def check_for(self, station: str, band: str, t_s: float) -> None:
        """Raise ValueError if this model belongs to another station or band or is not valid at `t_s`."""
        if self.station != station:
            raise ValueError(f"model {self.name!r} is of station {self.station!r}, must be of {station!r}")
        if self.band != band:
            raise ValueError(f"model {self.name!r} is of band {self.band!r}, must be of {band!r}")
        if t_s < self.valid_from_t_s or (self.valid_until_t_s is not None and t_s > self.valid_until_t_s):
            until = "replaced" if self.valid_until_t_s is None else stamp_text(self.valid_until_t_s)
            raise ValueError(
                f"model {self.name!r} is valid from {stamp_text(self.valid_from_t_s)} until {until}, not at {stamp_text(t_s)}"
            )


def stamp_text(t_s: float) -> str:
    """Return a time as model files have it: ISO 8601 with a Z."""
    return to_utc_text(t_s) + "Z"


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
