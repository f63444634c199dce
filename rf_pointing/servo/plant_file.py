"""A plant as plain keys and numbers for a file, angles in degrees: every key must be there, and no other.

No default fills a gap: an antenna with a forgotten inertia is another antenna.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

from rf_pointing.core import Params, from_degrees, to_degrees
from rf_pointing.servo.parameters import AxisParams, PlantParams

__all__ = ["plant_from_mapping", "plant_to_mapping"]

_AXES = ("azimuth", "elevation")


def plant_to_mapping(params: PlantParams) -> dict[str, Any]:
    """Return the plant as nested plain values; the inverse is `plant_from_mapping`."""
    return {name: _plain(getattr(params, name)) for name in _AXES} | _plain(params, leave_out=_AXES)


def plant_from_mapping(values: Mapping[str, Any]) -> PlantParams:
    """Return the plant that `values` describe.

    Raises
    ------
    ValueError
        For a missing or unknown key (named with its axis), or a value outside its range.
    """
    axes: dict[str, Any] = {}
    for name in _AXES:
        if not isinstance(values.get(name), Mapping):
            raise ValueError(f"plant needs {name} with its own keys")
        axes[name] = AxisParams(**_core(AxisParams, values[name], f"{name}."))
    rest = {key: value for key, value in values.items() if key not in _AXES}
    return PlantParams(**axes, **_core(PlantParams, rest, "", leave_out=_AXES))


def _plain(params: Params, leave_out: tuple[str, ...] = ()) -> dict[str, Any]:
    names = [item.name for item in dataclasses.fields(params) if item.name not in leave_out]
    edge = dict(to_degrees(name, getattr(params, name)) for name in names)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in edge.items()}


def _core(
    kind: type[Params], values: Mapping[str, Any], prefix: str, leave_out: tuple[str, ...] = ()
) -> dict[str, Any]:
    names = [item.name for item in dataclasses.fields(kind) if item.name not in leave_out]
    known = {to_degrees(name, 0.0)[0] for name in names}
    unknown, missing = sorted(set(values) - known), sorted(known - set(values))
    if unknown:
        raise ValueError(f"plant has no key {', '.join(prefix + key for key in unknown)}")
    if missing:
        raise ValueError(f"plant needs {', '.join(prefix + key for key in missing)}")
    core = dict(from_degrees(key, value) for key, value in values.items())
    return {name: tuple(value) if isinstance(value, list) else value for name, value in core.items()}
