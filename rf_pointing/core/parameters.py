"""Parameter sets: one frozen dataclass per block, with description and range on every field.

The unit is the end of the field's name (`_rad`, `_rad_s`, `_s`, `_hz`, `_db` ...).  The same fields
serve the numeric core (radians), YAML files and ROS parameters (degrees: `_rad` becomes `_deg`), so
a range is written once.

    @dataclass(frozen=True, kw_only=True)
    class RateLimits(Params):
        rate_rad_s: float = parameter(0.014, "largest axis rate", low=0.0, high=0.2)

`read_parameter_files` reads the YAML files of the nodes without ROS, so that the same file drives
the graph and the simulation:

    /**/antenna_servo:
      ros__parameters:
        wind: {mean_speed_m_s: 8.0}
"""

import dataclasses
import math
import operator
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar, get_args, get_origin

import numpy as np

from rf_pointing.core.checks import require_between, require_choice
from rf_pointing.core.whole_file import parse_yaml, read_whole

P = TypeVar("P", bound="Params")
_ORDERS = {"<": operator.lt, "<=": operator.le, ">=": operator.ge}

_UNITS = {
    "_rad_s3": "rad/s^3", "_rad_s2": "rad/s^2", "_rad_s": "rad/s", "_rad": "rad",
    "_deg_s3": "deg/s^3", "_deg_s2": "deg/s^2", "_deg_s": "deg/s", "_deg": "deg", "_m_s": "m/s",
    "_db_hz": "dB-Hz", "_dbw": "dBW", "_dbi": "dBi", "_db": "dB", "_mhz": "MHz", "_hz": "Hz",
    "_kg_m2": "kg m^2", "_n_m": "N m", "_hpa": "hPa", "_bits": "bit", "_k": "K", "_m2": "m^2",
    "_km": "km", "_m": "m", "_s": "s",
}  # fmt: skip


def parameter(
    default: Any = dataclasses.MISSING, description: str = "", low: float | None = None,
    high: float | None = None, *, choices: Collection[str] | None = None,
) -> Any:  # fmt: skip
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

    ordered = tuple[str, ...]()
    """Orders that fields keep, as "shortest_s <= longest_s"; of tuples, value by value."""

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            _check_type(item, item.name, value)
            _check_range(item.name, value, item.metadata["low"], item.metadata["high"])
        for name, sign, other in map(str.split, self.ordered):
            pair = getattr(self, name), getattr(self, other)
            one, two = (each if isinstance(each, tuple) else (each,) for each in pair)
            for value, bound in zip(one, two, strict=False):
                if not _ORDERS[sign](value, bound):
                    raise ValueError(f"{name}={value} must be {sign} {other}={bound}")
        self.check_together()

    def check_together(self) -> None:
        """Refuse combinations of fields; subclasses override, each message naming both fields."""

    def replace(self, **changes: Any) -> Self:
        """Return a checked copy with `changes`; the original stays as it is."""
        return dataclasses.replace(self, **changes)

    def sets(self) -> "dict[str, Params]":
        """Return the nested sets by name, as the nodes declare them and the files group them."""
        values = {item.name: getattr(self, item.name) for item in dataclasses.fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, Params)}

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """Build from `values` in core units; an unknown or missing key is an error."""
        known = {item.name: item for item in dataclasses.fields(cls)}
        unknown = sorted(set(values) - set(known))
        if unknown:
            raise ValueError(
                f"{cls.__name__} has no parameter {', '.join(unknown)}; it has {', '.join(known)}"
            )
        missing = [
            n for n, f in known.items() if f.default is dataclasses.MISSING and n not in values
        ]
        if missing:
            raise ValueError(f"{cls.__name__} needs {', '.join(missing)}")
        return cls(**{name: _tuple(value) for name, value in values.items()})


def leaves(params: Params, prefix: str = "") -> "dict[str, tuple[dataclasses.Field[Any], Any]]":
    """Return every field below `params` by dotted edge name (degrees), declaration and value."""
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
    """Return `params` with the fields of dotted edge names (degrees) replaced, checked together.

    The inverse of `leaves`.  Raises ValueError naming the key for an unknown one or a refused
    value.
    """
    known = {to_degrees(item.name, None)[0]: item for item in dataclasses.fields(params)}
    changes: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if rest:
            nested.setdefault(head, {})[rest] = value
        elif head not in known:
            raise ValueError(f"{head}: {type(params).__name__} has no such parameter")
        else:
            changes[known[head].name] = from_edge(known[head], head, _tuple(value))
    for head, below in nested.items():
        inner = getattr(params, head, None)
        if not isinstance(inner, Params):
            raise ValueError(f"{type(params).__name__} has no parameter {head}.{next(iter(below))}")
        try:
            changes[head] = with_leaves(inner, below)
        except ValueError as error:
            raise ValueError(f"{head}.{error}") from error
    # All at once: two fields that bound each other could not be changed one by one.
    return params.replace(**changes)


def to_degrees(name: str, value: Any) -> tuple[str, Any]:
    """Return the edge form of a core field: `x_rad` becomes `x_deg` with the value converted."""
    return _converted(name, value, "_rad", "_deg", math.degrees)


def from_degrees(name: str, value: Any) -> tuple[str, Any]:
    """Return the core form of an edge field: `x_deg` becomes `x_rad` with the value converted."""
    return _converted(name, value, "_deg", "_rad", math.radians)


def _converted(name: str, value: Any, old: str, new: str, convert: Any) -> tuple[str, Any]:
    stem, separator, rest = name.rpartition(old)
    # `_rad` inside a name is a unit only at its end, alone or per time.
    if not separator or rest not in ("", "_s", "_s2", "_s3"):
        return name, value
    if isinstance(value, (tuple, list)):
        value = tuple(convert(element) for element in value)
    elif value is not None:
        value = convert(value)
    return f"{stem}{new}{rest}", value


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, (list, np.ndarray)) else value


def from_edge(item: "dataclasses.Field[Any]", edge: str, value: Any) -> Any:
    """Return the core form of a value from outside; errors name value and bounds in degrees.

    A value on a bound stays on it: degrees to radians and back is off by a rounding error.
    """
    _check_type(item, edge, value)
    if edge == item.name:
        _check_range(edge, value, item.metadata["low"], item.metadata["high"])
        return value
    low, high = item.metadata["low"], item.metadata["high"]
    _check_range(edge, value, *(to_degrees(item.name, bound)[1] for bound in (low, high)))
    low, high = -math.inf if low is None else low, math.inf if high is None else high
    core = from_degrees(edge, value)[1]
    if isinstance(core, tuple):
        return tuple(min(max(element, low), high) for element in core)
    return min(max(core, low), high)


def _check_type(item: "dataclasses.Field[Any]", name: str, value: Any) -> None:
    kind = item.type
    if item.metadata["choices"]:
        require_choice(name, value, item.metadata["choices"])
    elif get_origin(kind) is tuple:
        if not isinstance(value, tuple):
            raise ValueError(f"{name}={value!r} must be a list of values")
        if get_args(kind)[-1] is not Ellipsis and len(value) != len(get_args(kind)):
            raise ValueError(f"{name}={value} must have {len(get_args(kind))} values")
        for index, element in enumerate(value):
            _check_kind(f"{name}[{index}]", element, get_args(kind)[0])
    else:
        _check_kind(name, value, kind)


def _check_kind(name: str, value: Any, kind: Any) -> None:
    if kind in (float, int):
        # True is an int to Python, and no number to anybody who writes a parameter file.
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f"{name}={value!r} must be a number")
        if kind is int and not isinstance(value, int):
            raise ValueError(f"{name}={value!r} must be a whole number")
    elif not isinstance(value, kind):
        wanted = kind.__name__ if issubclass(kind, Params) else f"of type {kind.__name__}"
        raise ValueError(f"{name}={value!r} must be {wanted}")


def _check_range(name: str, value: Any, low: float | None, high: float | None) -> None:
    elements = (
        [(f"{name}[{i}]", v) for i, v in enumerate(value)]
        if isinstance(value, tuple)
        else [(name, value)]
    )
    for element_name, element in elements:
        if isinstance(element, (int, float)) and not isinstance(element, bool):
            require_between(element_name, element, low, high)


def read_parameter_files(paths: Sequence[Path]) -> dict[str, dict[str, Any]]:
    """Return the parameters of every node by dotted edge name, later files over earlier ones."""
    merged: dict[str, dict[str, Any]] = {}
    for path in paths:
        try:
            text = read_whole(path)
        except OSError as error:
            raise ValueError(f"parameter file {path}: {error.strerror}") from error
        try:
            content = parse_yaml(text)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
        if not isinstance(content, Mapping):
            raise ValueError(f"{path}: must map node names to ros__parameters")
        # A node may be named by any namespace; its last part is what counts here.
        for key, section in content.items():
            if not isinstance(section, Mapping) or set(section) != {"ros__parameters"}:
                raise ValueError(f"{path}: {key} must hold ros__parameters and nothing else")
            if not isinstance(section["ros__parameters"], Mapping):
                raise ValueError(f"{path}: ros__parameters of {key} must map names to values")
            values = flat(section["ros__parameters"])
            merged.setdefault(str(key).rsplit("/", 1)[-1], {}).update(values)
    return merged


def flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested names as dotted ones, lists as tuples."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{name}.")
        else:
            found[f"{prefix}{name}"] = _tuple(value)
    return found
