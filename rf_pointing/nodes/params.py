"""ROS parameters that mirror the core's parameter sets: description, unit and range on every one, set atomically.

A set of the core in radians appears under its prefix in degrees: `limits.rate_rad_s` is the parameter
`limits.rate_deg_s`.  A change is tried on a copy of the whole set first; a refused key leaves every set as it was.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from rf_pointing.geometry import Params, from_degrees, parameter_unit, to_degrees

__all__ = ["ParameterGroups"]

_LARGEST = 1.0e308
_STANDARD = ("use_sim_time", "start_type_description_service", "qos_overrides.")


class ParameterGroups:
    """The parameter sets of one node, each under a prefix ("" for none)."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._groups: dict[str, Params] = {}
        self._owner: dict[str, tuple[str, str]] = {}
        self._listeners: list[Callable[[], None]] = []
        self.refusals: list[str] = []
        node.add_on_set_parameters_callback(self._try)
        node.add_post_set_parameters_callback(self._apply)

    def declare(self, prefix: str, defaults: Params) -> None:
        """Declare every field of `defaults`; a refused value from YAML is kept in `refusals` for `on_configure`."""
        self._groups[prefix] = defaults
        for item in dataclasses.fields(defaults):
            edge, value = to_degrees(item.name, getattr(defaults, item.name))
            name = f"{prefix}.{edge}" if prefix else edge
            self._owner[name] = (prefix, item.name)
            self._declare_one(name, list(value) if isinstance(value, tuple) else value, _descriptor(item, edge))
        self._load(prefix)

    def value(self, prefix: str) -> Any:
        """Return the present set under `prefix`, as the core's frozen dataclass."""
        return self._groups[prefix]

    def on_change(self, listener: Callable[[], None]) -> None:
        """Call `listener` after every accepted change."""
        self._listeners.append(listener)

    def refuse_unknown(self) -> None:
        """Note every key that was given to this node and that nothing declared."""
        given = getattr(self._node, "_parameter_overrides", {})
        for name in given:
            if not self._node.has_parameter(name) and not name.startswith(_STANDARD):
                self.refusals.append(f"{name}: no such parameter of {self._node.get_name()}")

    def _declare_one(self, name: str, default: Any, descriptor: ParameterDescriptor) -> None:
        try:
            self._node.declare_parameter(name, default, descriptor)
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            self.refusals.append(f"{name}: {error}")
            self._node.declare_parameter(name, default, descriptor, ignore_override=True)

    def _load(self, prefix: str) -> None:
        values = [self._node.get_parameter(name) for name, (owner, _) in self._owner.items() if owner == prefix]
        try:
            self._groups.update(self._candidates(values))
        except ValueError as error:
            self.refusals.append(str(error))

    def _candidates(self, changes: list[Parameter]) -> dict[str, Params]:
        by_prefix: dict[str, dict[str, Any]] = {}
        for change in changes:
            if change.name in self._owner:
                prefix, field = self._owner[change.name]
                value = change.value
                value = tuple(value) if isinstance(value, (list, tuple)) or hasattr(value, "typecode") else value
                edge = change.name.removeprefix(f"{prefix}.") if prefix else change.name
                by_prefix.setdefault(prefix, {})[field] = from_degrees(edge, value)[1]
        return {prefix: self._replaced(prefix, fields) for prefix, fields in by_prefix.items()}

    def _replaced(self, prefix: str, fields: dict[str, Any]) -> Params:
        try:
            return self._groups[prefix].replace(**fields)
        except ValueError as error:
            raise ValueError(f"{prefix}.{error}" if prefix else str(error)) from error

    def _try(self, changes: list[Parameter]) -> SetParametersResult:
        try:
            self._candidates(changes)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, changes: list[Parameter]) -> None:
        candidates = self._candidates(changes)
        if candidates:
            self._groups.update(candidates)
            for listener in self._listeners:
                listener()


def _descriptor(item: "dataclasses.Field[Any]", edge: str) -> ParameterDescriptor:
    unit = parameter_unit(edge)
    descriptor = ParameterDescriptor(description=f"{item.metadata['description']} [{unit}]")
    choices = item.metadata.get("choices")
    if choices:
        descriptor.additional_constraints = f"one of {', '.join(choices)}"
    low, high = (to_degrees(item.name, item.metadata.get(side))[1] for side in ("low", "high"))
    if item.type is int:
        bounds = (int(low) if low is not None else -(2**53), int(high) if high is not None else 2**53)
        descriptor.integer_range = [IntegerRange(from_value=bounds[0], to_value=bounds[1], step=0)]
    elif item.type is float:
        bounds_f = (low if low is not None else -_LARGEST, high if high is not None else _LARGEST)
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(bounds_f[0]), to_value=float(bounds_f[1]))]
    return descriptor
