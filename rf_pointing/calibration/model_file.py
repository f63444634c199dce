"""A version of the bias model and its file: YAML or JSON in degrees and seconds, with covariance.

The suffix decides the format (.yaml, .yml, .json).  Reading checks every key; an error names it.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.terms import ALL_TERMS, FURTHER_TERMS, MOUNT_TERMS, mount_of
from rf_pointing.core import Array, from_degrees, require_choice, require_finite, to_degrees
from rf_pointing.core.dates import from_utc_text, to_utc_text
from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, MOUNTS
from rf_pointing.core.whole_file import parse_json, parse_yaml, read_whole, write_whole

FORMAT = "rf_pointing/bias_model/1"
# Eigenvalues of a singular correlation matrix come out at minus a rounding.
_ROUNDING = 1e-9
_SIGMA_AGREES = 1e-3
# Characters of a line, for a term or a row of the covariance.
_LINE = 120
# Fields of the same name in the file and in a version; `_ANGLES` are in degrees in the file.
_TEXTS = ("name", "station", "band", "software")
_COUNTS = ("observations", "rejected", "passes")
_ANGLES = ("rms_cross_elevation", "rms_elevation", "mean_azimuth", "mean_elevation")
# Unit in the file of each unit of the core, and the factor to it.
_EDGE = {
    "rad": ("deg", math.degrees(1.0)), "s": ("s", 1.0), "s^2": ("s2", 1.0),
    "rad/K": ("deg_k", math.degrees(1.0)),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelVersion:
    """A named version of a bias model and where it comes from; times are UTC seconds since 1970.

    `fitted` are the terms that were estimated, in the order of `covariance` (k, k) in core units;
    the others were fixed.  `valid_until_t_s` None: until replaced.
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
        cls, result: FitResult, *, name: str, software: str, created_t_s: float
    ) -> "ModelVersion":
        """Return the version that a fit gives; it is valid from its creation until replaced."""
        rms, used = result.rms_rad(), result.used
        same = (
            "station", "band", "form", "condition", "model", "covariance", "first_t_s", "last_t_s",
            "passes",
        )  # fmt: skip
        same_name: dict[str, Any] = {field: getattr(result, field) for field in same}
        return cls(
            name=name, software=software, created_t_s=created_t_s, valid_from_t_s=created_t_s,
            valid_until_t_s=None, observations=int(np.sum(used)), rejected=len(result.rejected),
            rms_cross_elevation_rad=rms[0], rms_elevation_rad=rms[1],
            mean_azimuth_rad=float(np.mean(result.residual_azimuth_rad[used])),
            mean_elevation_rad=float(np.mean(result.residual_elevation_rad[used])),
            fitted=result.names, **same_name,
        )  # fmt: skip

    def check_for(self, station: str, band: str, t_s: float) -> None:
        """Raise ValueError if the model is of another station or band or not valid at `t_s`."""
        for kind, own, wanted in (("station", self.station, station), ("band", self.band, band)):
            if own != wanted:
                raise ValueError(f"model {self.name!r} is of {kind} {own!r}, must be of {wanted!r}")
        if not self.is_valid_at(t_s):
            until = "replaced" if self.valid_until_t_s is None else _stamp(self.valid_until_t_s)
            raise ValueError(
                f"model {self.name!r} is valid from {_stamp(self.valid_from_t_s)} until {until}, not at {_stamp(t_s)}"
            )

    def is_valid_at(self, t_s: float) -> bool:
        """Return whether `t_s` lies in the time for which the model is meant."""
        return self.valid_from_t_s <= t_s and (
            self.valid_until_t_s is None or t_s <= self.valid_until_t_s
        )


def write_model(path: str | Path, version: ModelVersion) -> None:
    """Write the file, the old or the new one at any instant; `read_model` is the inverse."""
    target, mapping = Path(path), _to_mapping(version)
    if _is_json(target):
        text = json.dumps(mapping, indent=2) + "\n"
    else:
        text = yaml.safe_dump(mapping, sort_keys=False, default_flow_style=None, width=_LINE)
    write_whole(target, text)


def read_model(path: str | Path) -> ModelVersion:
    """Read and check a model file; raises ValueError naming file and key."""
    source = Path(path)
    text = read_whole(source)
    try:
        return _from_mapping(_parsed(source, text))
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None


def _to_mapping(version: ModelVersion) -> dict[str, Any]:
    sigma = dict(zip(version.fitted, np.sqrt(np.diag(version.covariance)).tolist(), strict=True))
    scale = np.array([_edge(name)[1] for name in version.fitted])
    # No end is written as null, not left out: every key is there in every file.
    until = None if version.valid_until_t_s is None else _stamp(version.valid_until_t_s)
    return {
        "format": FORMAT, **{name: getattr(version, name) for name in _TEXTS},
        **_mount_entry(version.model), "created_utc": _stamp(version.created_t_s),
        "validity": {"from_utc": _stamp(version.valid_from_t_s), "until_utc": until},
        "data": {
            "first_utc": _stamp(version.first_t_s), "last_utc": _stamp(version.last_t_s),
            **{name: getattr(version, name) for name in _COUNTS},
        },
        "fit": {
            "form": version.form, "condition": version.condition,
            **{f"{name}_deg": math.degrees(getattr(version, f"{name}_rad")) for name in _ANGLES},
        },
        "terms": {
            name: _term_entry(name, value, sigma.get(name))
            for name, value in version.model.coefficients.items()
        },
        "covariance": {
            "order": list(version.fitted), "unit": [_edge(name)[0] for name in version.fitted],
            "matrix": (version.covariance * np.outer(scale, scale)).tolist(),
        },
    }  # fmt: skip


def _from_mapping(mapping: Any) -> ModelVersion:
    sections = ("created_utc", "validity", "data", "fit", "terms", "covariance")
    top = _Section(mapping, "", ("format", *_TEXTS, *sections), ("mount",))
    require_choice("format", top.text("format"), (FORMAT,))
    validity = top.section("validity", ("from_utc", "until_utc"))
    data = top.section("data", ("first_utc", "last_utc", *_COUNTS))
    fit = top.section("fit", ("form", "condition", *(f"{name}_deg" for name in _ANGLES)))
    model, sigma = _read_terms(top)
    _check_order(validity, "from_utc", "until_utc")
    _check_order(data, "first_utc", "last_utc")
    same_name: dict[str, Any] = {
        **{name: top.text(name) for name in _TEXTS},
        **{name: data.count(name) for name in _COUNTS},
        **{f"{name}_rad": math.radians(fit.number(f"{name}_deg")) for name in _ANGLES},
    }
    return ModelVersion(
        created_t_s=top.time("created_utc"), valid_from_t_s=validity.time("from_utc"),
        valid_until_t_s=validity.time("until_utc") if validity.has("until_utc") else None,
        first_t_s=data.time("first_utc"), last_t_s=data.time("last_utc"), form=fit.text("form"),
        condition=fit.number("condition"), model=model, fitted=tuple(sigma),
        covariance=_read_covariance(top, sigma), **same_name,
    )  # fmt: skip


def _parsed(source: Path, text: str) -> Any:
    if _is_json(source):
        try:
            return parse_json(text)
        except json.JSONDecodeError as error:
            raise ValueError(f"line {error.lineno}: {error.msg}") from None
    return parse_yaml(text)


def _is_json(path: Path) -> bool:
    require_choice("suffix", path.suffix, (".yaml", ".yml", ".json"))
    return path.suffix == ".json"


def _stamp(t_s: float) -> str:
    return to_utc_text(t_s) + "Z"


def _edge(name: str) -> tuple[str, float]:
    return _EDGE[ALL_TERMS[name].unit]


def _term_entry(name: str, value: float, sigma: float | None) -> dict[str, Any]:
    unit, scale = _edge(name)
    entry: dict[str, Any] = {
        f"value_{unit}": float(value * scale), "used": value != 0.0, "fixed": sigma is None,
    }  # fmt: skip
    if sigma is not None:
        entry[f"sigma_{unit}"] = sigma * scale
    return entry


def _mount_entry(model: BiasModel) -> dict[str, Any]:
    """Return how the axes lie; nothing for azimuth and elevation."""
    # The table of the mounts says which of them have a lower axis, a latitude or a tilt.
    mount = model.mount or Kinematics(type=mount_of(model.coefficients))
    own = (*MOUNTS[mount.type].keys, *(["latitude_deg"] if MOUNTS[mount.type].polar else []))
    every = {key: value for key, value in vars(mount).items() if not key.startswith("_")}
    edge = dict(to_degrees(name, value) for name, value in every.items() if name != "type")
    entry = {"type": mount.type} | {key: edge[key] for key in own}
    return {"mount": entry} if mount.type != AZIMUTH_ELEVATION else {}


def _read_mount(top: "_Section") -> Kinematics:
    """Return the mount; a file that says nothing is of azimuth and elevation."""
    if not top.has("mount"):
        return LEVEL
    entry = top.section("mount", ("type",), ("lower_axis", "latitude_deg", "tilt_deg"))
    values: dict[str, Any] = dict(from_degrees(name, value) for name, value in entry.values.items())
    try:
        return Kinematics(**values)
    except ValueError as error:
        raise ValueError(f"mount: {error}") from None


def _read_terms(top: "_Section") -> tuple[BiasModel, dict[str, tuple[str, float]]]:
    """Return the model, and key and sigma (unit of the file) of each fitted term."""
    values, sigma, mount = {}, {}, _read_mount(top)
    known = (*MOUNT_TERMS[mount.type], *FURTHER_TERMS[mount.type])
    terms = top.section("terms", (), tuple(term.name for term in known))
    for name in terms.values:
        unit, scale = _edge(name)
        entry = terms.section(name, (f"value_{unit}", "used", "fixed"), (f"sigma_{unit}",))
        values[name] = entry.number(f"value_{unit}") / scale
        # The flags are for readers; one that contradicts its value shows a file edited by hand.
        if entry.flag("used") != (values[name] != 0.0):
            raise ValueError(
                f"{entry.key('used')}={entry.flag('used')} contradicts {entry.key('value_' + unit)}"
            )
        if not entry.flag("fixed"):
            if not entry.has(f"sigma_{unit}"):
                raise ValueError(f"{entry.key(f'sigma_{unit}')} is missing")
            sigma[name] = entry.key(f"sigma_{unit}"), entry.number(f"sigma_{unit}")
    return BiasModel(values, mount), sigma


def _read_covariance(top: "_Section", stated: Mapping[str, tuple[str, float]]) -> Array:
    section, fitted = top.section("covariance", ("order", "unit", "matrix")), tuple(stated)
    order = section.texts("order")
    if order != fitted:
        raise ValueError(
            f"{section.key('order')} is {', '.join(order)}; must be the fitted terms in their order, {', '.join(fitted)}"
        )
    units, scale = [_edge(name)[0] for name in order], np.array([_edge(name)[1] for name in order])
    if list(section.texts("unit")) != units:
        raise ValueError(f"{section.key('unit')} must be {', '.join(units)}")
    matrix = np.array(section.matrix("matrix", len(order))).reshape(
        len(order), len(order)
    ) / np.outer(scale, scale)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0) or np.any(np.diag(matrix) <= 0.0):
        raise ValueError(f"{section.key('matrix')} must be symmetric with a positive diagonal")
    sigma = np.sqrt(np.diag(matrix))
    if np.min(np.linalg.eigvalsh(matrix / np.outer(sigma, sigma)), initial=1.0) < -_ROUNDING:
        raise ValueError(
            f"{section.key('matrix')} must be positive semidefinite: no data have such a covariance"
        )
    # People edit these files: a sigma that was changed without its covariance must not pass.
    for (key, value), expected in zip(stated.values(), (sigma * scale).tolist(), strict=True):
        if not math.isclose(value, expected, rel_tol=_SIGMA_AGREES):
            raise ValueError(f"{key}={value} contradicts the covariance: {expected:g}")
    return matrix


def _check_order(section: "_Section", first: str, last: str) -> None:
    if section.has(last) and section.time(last) < section.time(first):
        raise ValueError(
            f"{section.key(last)}={section.text(last)} must not be before {first}={section.text(first)}"
        )


class _Section:
    """One mapping of a file: keys known and complete, every value of its type."""

    def __init__(
        self, value: Any, path: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()
    ) -> None:
        if not isinstance(value, Mapping):
            raise ValueError(f"{path or 'file'} must be a mapping of keys to values")
        self.path, self.values = path, value
        unknown = [str(key) for key in value if key not in needed + optional]
        if unknown:
            raise ValueError(
                f"{self.key(unknown[0])} is not a known key; known: {', '.join(needed + optional)}"
            )
        missing = [key for key in needed if key not in value]
        if missing:
            raise ValueError(f"{self.key(missing[0])} is missing")

    def key(self, name: str) -> str:
        """Return the full path of a key."""
        return f"{self.path}.{name}" if self.path else name

    def has(self, name: str) -> bool:
        """Return whether an optional key is given and not null."""
        return self.values.get(name) is not None

    def section(
        self, name: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()
    ) -> "_Section":
        """Return a nested mapping."""
        return _Section(self.values[name], self.key(name), needed, optional)

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
        return _number(self.key(name), self.values[name])

    def count(self, name: str) -> int:
        """Return a whole number >= 0."""
        value = self.values[name]
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise ValueError(f"{self.key(name)}={value!r} must be a whole number >= 0")
        return value

    def time(self, name: str) -> float:
        """Return UTC seconds since 1970 of an ISO text ending in Z."""
        text = self.text(name)
        # Without the Z a reader would have to guess the time zone.
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

    def matrix(self, name: str, count: int) -> list[list[float]]:
        """Return a square matrix of finite numbers."""
        value, key = self.values[name], self.key(name)
        square = isinstance(value, list) and len(value) == count
        if not square or not all(isinstance(row, list) and len(row) == count for row in value):
            raise ValueError(f"{key} must be a list of {count} lists of {count} numbers")
        return [
            [_number(f"{key}[{i}][{j}]", item) for j, item in enumerate(row)]
            for i, row in enumerate(value)
        ]


def _number(key: str, value: Any) -> float:
    # YAML reads `yes` as a bool, which Python counts as an int.
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{key}={value!r} must be a number")
    require_finite(key, value)
    return float(value)
