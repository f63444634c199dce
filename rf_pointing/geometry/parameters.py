"""Parameter sets: one frozen dataclass per block, with description and range on every field.

The unit is the end of the field's name (`_rad`, `_rad_s`, `_s`, `_hz`, `_db` ...).  The same fields serve the
numeric core (radians), YAML files and ROS parameters (degrees: `_rad` becomes `_deg`), so a range is written once.

    @dataclass(frozen=True, kw_only=True)
    class RateLimits(Params):
        rate_rad_s: float = parameter(0.014, "largest axis rate", low=0.0, high=0.2)
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, Self, TypeVar

import numpy as np

from rf_pointing.geometry.checks import require_between, require_choice

__all__ = ["Params", "from_degrees", "leaves", "parameter", "parameter_unit", "to_degrees", "with_leaves"]

P = TypeVar("P", bound="Params")

_UNITS = {
    "_rad_s3": "rad/s^3",
    "_rad_s2": "rad/s^2",
    "_rad_s": "rad/s",
    "_rad": "rad",
    "_deg_s3": "deg/s^3",
    "_deg_s2": "deg/s^2",
    "_deg_s": "deg/s",
    "_deg": "deg",
    "_m_s": "m/s",
    "_db_hz": "dB-Hz",
    "_dbw": "dBW",
    "_dbi": "dBi",
    "_db": "dB",
    "_hz": "Hz",
    "_kg_m2": "kg m^2",
    "_n_m": "N m",
    "_hpa": "hPa",
    "_bits": "bit",
    "_k": "K",
    "_m2": "m^2",
    "_m": "m",
    "_s": "s",
}


def parameter(
    default: Any = dataclasses.MISSING,
    description: str = "",
    *,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] | None = None,
) -> Any:
    """Declare one field of a `Params` class; `low` and `high` are in the field's own unit."""
    if not description:
        raise ValueError("description='' must say what the parameter is")
    metadata = {"description": description, "low": low, "high": high, "choices": choices}
    return dataclasses.field(default=default, metadata=metadata)


def parameter_unit(name: str) -> str:
    """Return the unit that the end of `name` states, "1" where it states none."""
    for suffix, unit in _UNITS.items():
        if name.endswith(suffix):
            return unit
    return "1"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Params:
    """Base of every parameter set: fields are checked on construction and on `replace`."""

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            _check(item, getattr(self, item.name))
        self.check_together()

    def check_together(self) -> None:
        """Refuse combinations of fields; subclasses override, each message naming both fields."""

    def replace(self, **changes: Any) -> Self:
        """Return a checked copy with `changes`; the original stays as it is if a value is refused."""
        return dataclasses.replace(self, **changes)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """Build from `values` in core units; an unknown or missing key is an error."""
        known = {item.name: item for item in dataclasses.fields(cls)}
        unknown = sorted(set(values) - set(known))
        if unknown:
            raise ValueError(f"{cls.__name__} has no parameter {', '.join(unknown)}; it has {', '.join(known)}")
        missing = [n for n, f in known.items() if f.default is dataclasses.MISSING and n not in values]
        if missing:
            raise ValueError(f"{cls.__name__} needs {', '.join(missing)}")
        return cls(**{name: _tuple(value) for name, value in values.items()})


def leaves(params: Params, prefix: str = "") -> "dict[str, tuple[dataclasses.Field[Any], Any]]":
    """Return every field below `params` by its dotted edge name (degrees), with its declaration and edge value."""
    found: dict[str, tuple[dataclasses.Field[Any], Any]] = {}
    for item in dataclasses.fields(params):
        value = getattr(params, item.name)
        if isinstance(value, Params):
            found |= leaves(value, f"{prefix}{item.name}.")
        else:
            edge, edge_value = to_degrees(item.name, value)
            found[prefix + edge] = (item, edge_value)
    return found


def with_leaves(params: P, values: Mapping[str, Any]) -> P:
    """Return `params` with the fields named by dotted edge names (degrees) replaced, checked as a whole.

    The inverse of `leaves`.  Raises ValueError naming the key for an unknown one or a refused value.
    """
    changes: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if rest:
            nested.setdefault(head, {})[rest] = value
        else:
            field, changes_value = from_degrees(head, _tuple(value))
            changes[field] = changes_value
    for head, below in nested.items():
        inner = getattr(params, head, None)
        if not isinstance(inner, Params):
            raise ValueError(f"{type(params).__name__} has no parameter {head}.{next(iter(below))}")
        try:
            changes[head] = with_leaves(inner, below)
        except ValueError as error:
            raise ValueError(f"{head}.{error}") from error
    known = {item.name for item in dataclasses.fields(params)}
    unknown = sorted(set(changes) - known)
    if unknown:
        raise ValueError(f"{to_degrees(unknown[0], 0.0)[0]}: {type(params).__name__} has no such parameter")
    return params.replace(**changes)


def to_degrees(name: str, value: Any) -> tuple[str, Any]:
    """Return the edge form of a core field: `x_rad` becomes `x_deg` with the value converted."""
    return _converted(name, value, "_rad", "_deg", math.degrees)


def from_degrees(name: str, value: Any) -> tuple[str, Any]:
    """Return the core form of an edge field: `x_deg` becomes `x_rad` with the value converted."""
    return _converted(name, value, "_deg", "_rad", math.radians)


def _converted(name: str, value: Any, old: str, new: str, convert: Any) -> tuple[str, Any]:
    stem, separator, rest = name.rpartition(old)
    if not separator or rest not in ("", "_s", "_s2", "_s3"):
        return name, value
    if value is None:
        converted = None
    elif isinstance(value, (tuple, list)):
        converted = tuple(convert(v) for v in value)
    else:
        converted = convert(value)
    return f"{stem}{new}{rest}", converted


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, (list, np.ndarray)) else value


def _check(item: "dataclasses.Field[Any]", value: Any) -> None:
    bounds = item.metadata
    if bounds.get("choices"):
        require_choice(item.name, value, bounds["choices"])
        return
    if item.type in (float, int) and (isinstance(value, bool) or not isinstance(value, (int, float))):
        raise ValueError(f"{item.name}={value!r} must be a number")
    if item.type in (bool, str) and not isinstance(value, item.type):
        raise ValueError(f"{item.name}={value!r} must be of type {item.type.__name__}")
    elements = enumerate(value) if isinstance(value, tuple) else [(None, value)]
    for index, element in elements:
        if isinstance(element, (int, float)) and not isinstance(element, bool):
            name = item.name if index is None else f"{item.name}[{index}]"
            require_between(name, element, bounds.get("low"), bounds.get("high"))
