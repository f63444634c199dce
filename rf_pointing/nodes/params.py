"""ROS parameters that mirror the core's parameter sets: description, unit and range on each.

A set of the core in radians appears under its prefix in degrees: `limits.rate_rad_s` is the
parameter `limits.rate_deg_s`.  A change is tried on a copy of the whole set first; a refused key
leaves every set as it was.  What a node reads only when it is configured can change only before.
"""

import dataclasses
from collections.abc import Callable, Collection, Mapping
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from rf_pointing.core import Params, leaves, parameter_unit, to_degrees, with_leaves

_LARGEST = 1.0e308
_WHEN_CONFIGURED = "read when the node is configured"
_STANDARD = ("use_sim_time", "start_type_description_service", "qos_overrides.")


class ParameterGroups:
    """The parameter sets of one node, each under a prefix ("" for none).

    Once the node is `configured` it has read them, and only the live ones may change.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._groups: dict[str, Params] = {}
        self._owner: dict[str, tuple[str, str]] = {}
        self._listeners: list[Callable[[], None]] = []
        self._checks: list[Callable[[Mapping[str, Any]], None]] = []
        self._live: set[str] = set()
        self.reasons: list[str] = []
        self.configured = False
        node.add_on_set_parameters_callback(self._try)
        node.add_post_set_parameters_callback(self._apply)

    def declare(self, prefix: str, defaults: Params, *, live: bool | Collection[str] = False) -> None:
        """Declare every field below `defaults`; why a value from YAML is refused goes to `reasons`.

        `live`: whether changes take effect while the node is configured, or the names of the fields
        for which they do (a nested set counts as a whole).
        """
        self._groups[prefix] = defaults
        given: list[Parameter] = []
        for edge, (item, value) in leaves(defaults).items():
            name = f"{prefix}.{edge}" if prefix else edge
            at_once = live if isinstance(live, bool) else edge.partition(".")[0] in live
            given.append(self._declare_one(name, value, _descriptor(item, edge, at_once)))
            self._owner[name] = (prefix, edge)
            if at_once:
                self._live.add(name)
        try:
            self._groups.update(self._candidates(given))
        except ValueError as error:
            self.reasons.append(str(error))

    def value(self, prefix: str) -> Any:
        """Return the present set under `prefix`, as the core's frozen dataclass."""
        return self._groups[prefix]

    def declared(self) -> dict[str, Params]:
        """Return the sets by prefix, as they are now, in the order of their declaration."""
        return dict(self._groups)

    def is_live(self, name: str) -> bool:
        """Return whether the parameter of this name may change while the node is configured."""
        return name in self._live

    def put(self, prefix: str, wanted: Params) -> None:
        """Set the parameters under `prefix` to those of `wanted`, which the node uses already."""
        present, configured = leaves(self._groups[prefix]), self.configured
        # Only what differs: each changed parameter is an event for every listener of the graph.
        changed = {edge: value for edge, (_, value) in leaves(wanted).items() if value != present[edge][1]}
        self.configured = False
        try:
            results = self._node.set_parameters([
                Parameter(f"{prefix}.{edge}" if prefix else edge, value=value) for edge, value in changed.items()
            ])  # fmt: skip
        finally:
            self.configured = configured
        for result in results:
            if not result.successful:
                raise ValueError(result.reason)

    def on_change(self, listener: Callable[[], None]) -> None:
        """Call `listener` after every accepted change."""
        self._listeners.append(listener)

    def check_with(self, check: Callable[[Mapping[str, Any]], None]) -> None:
        """Call `check(sets by prefix)` before every change, which its ValueError refuses."""
        self._checks.append(check)

    def refuse_unknown(self) -> None:
        """Note every key that was given to this node and that it does not declare."""
        # rclpy has no public way to read the overrides; without this a misspelt key is ignored.
        given = getattr(self._node, "_parameter_overrides", {})
        for name in given:
            reason = f"{name}: no such parameter of {self._node.get_name()}"
            known = self._node.has_parameter(name) or name.startswith(_STANDARD)
            if not known and reason not in self.reasons:
                self.reasons.append(reason)

    def _declare_one(self, name: str, default: Any, descriptor: ParameterDescriptor) -> Parameter:
        # An empty tuple has no element from which rclpy could derive the type.
        if default == ():
            return self._declare_empty(name, descriptor)
        default = list(default) if isinstance(default, tuple) else default
        try:
            return self._node.declare_parameter(name, default, descriptor)
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            self.reasons.append(f"{name}: {error}")
            return self._node.declare_parameter(name, default, descriptor, ignore_override=True)

    def _declare_empty(self, name: str, descriptor: ParameterDescriptor) -> Parameter:
        """Declare an array of doubles without elements."""
        # rclpy takes an empty list for an array of bytes, which no list of doubles could replace.
        declared = self._declare_one(name, (0.0,), descriptor)
        if name in getattr(self._node, "_parameter_overrides", {}):
            return declared
        empty = Parameter(name, Parameter.Type.DOUBLE_ARRAY, [])
        self._node.set_parameters([empty])
        return empty

    def _candidates(self, changes: list[Parameter]) -> dict[str, Params]:
        # One candidate per set: fields that constrain each other can change together.
        by_prefix: dict[str, dict[str, Any]] = {}
        for change in changes:
            if change.name in self._owner:
                prefix, edge = self._owner[change.name]
                by_prefix.setdefault(prefix, {})[edge] = _plain(change.value)
        return {prefix: self._replaced(prefix, values) for prefix, values in by_prefix.items()}

    def _replaced(self, prefix: str, values: dict[str, Any]) -> Params:
        try:
            return with_leaves(self._groups[prefix], values)
        except ValueError as error:
            raise ValueError(f"{prefix}.{error}" if prefix else str(error)) from error

    def _try(self, changes: list[Parameter]) -> SetParametersResult:
        try:
            self._refuse_late(changes)
            candidates = self._candidates(changes)
            for check in self._checks if candidates else ():
                check(self._groups | candidates)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:
            # Whatever a trial raises would be raised by the change, in the middle of a motion.
            return SetParametersResult(successful=False, reason=f"{type(error).__name__}: {error}")
        return SetParametersResult(successful=True)

    def _refuse_late(self, changes: list[Parameter]) -> None:
        """Raise ValueError for a change of what the configured node will not read again."""
        for change in changes if self.configured else ():
            late = change.name in self._owner and change.name not in self._live
            if late and _plain(change.value) != _plain(self._node.get_parameter(change.name).value):
                node = self._node.get_name()
                raise ValueError(f"{change.name} is {_WHEN_CONFIGURED}: deactivate {node} and clean it up first")

    def _apply(self, changes: list[Parameter]) -> None:
        candidates = self._candidates(changes)
        if candidates:
            self._groups.update(candidates)
            for listener in self._listeners:
                listener()


def _plain(value: Any) -> Any:
    """Return the value of a parameter, an array as a tuple."""
    return value if isinstance(value, (bool, int, float, str)) else tuple(value)


def _descriptor(item: "dataclasses.Field[Any]", edge: str, live: bool) -> ParameterDescriptor:
    unit = parameter_unit(edge)
    descriptor = ParameterDescriptor(description=f"{item.metadata['description']} [{unit}]")
    choices = item.metadata.get("choices")
    constraints = [f"one of {', '.join(choices)}"] if choices else []
    descriptor.additional_constraints = "; ".join(constraints if live else [*constraints, _WHEN_CONFIGURED])
    low, high = (to_degrees(item.name, item.metadata.get(side))[1] for side in ("low", "high"))
    if item.type is int:
        # A range of ROS has both ends; 2^53 is the largest integer to which a float still counts.
        bounds = (int(low) if low is not None else -(2**53), int(high) if high is not None else 2**53)
        descriptor.integer_range = [IntegerRange(from_value=bounds[0], to_value=bounds[1], step=0)]
    elif item.type is float:
        bounds_f = (low if low is not None else -_LARGEST, high if high is not None else _LARGEST)
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(bounds_f[0]), to_value=float(bounds_f[1]))
        ]
    return descriptor
