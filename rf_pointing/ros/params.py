"""ROS parameters that mirror the core's parameter sets: description, unit and range on each.

A set of the core in radians appears under its prefix in degrees: `limits.rate_rad_s` is the
parameter `limits.rate_deg_s`.  A change is tried on a copy of the whole set first; a refused key
leaves every set as it was.  What a node reads only when it is configured can change only before.
What the station description gives cannot be set in a parameter file, so each number has one place.
"""

import dataclasses
from collections.abc import Callable, Collection, Mapping
from typing import Any, get_args

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from rf_pointing.core import Params, leaves, parameter_unit, to_degrees, with_leaves
from rf_pointing.station.description import same_value
from rf_pointing.station.description.reading import nearest

_LARGEST = 1.0e308
_WHEN_CONFIGURED = "read when the node is configured"
_CLOCK = "use_sim_time"
_STANDARD = (_CLOCK, "start_type_description_service", "qos_overrides.")


class ParameterGroups:
    """The parameter sets of one node, each under a prefix ("" for none).

    Once the node is `configured` it has read them, and only the live ones may change.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._groups: dict[str, Params] = {}
        self._owner: dict[str, tuple[str, str]] = {}
        self._listeners: list[Callable[[], object]] = []
        self._checks: list[Callable[[Mapping[str, Any]], None]] = []
        self.live: set[str] = set()
        """Parameters that may change while the node is configured."""
        self._station: Mapping[str, Any] = {}
        self.station_key: Callable[[str], str] = lambda _name: ""
        self.reasons: list[str] = []
        self.configured = self._restates = False
        node.add_on_set_parameters_callback(self._try)
        node.add_post_set_parameters_callback(self._apply)

    def take_station(self, values: Mapping[str, Any], key: Callable[[str], str]) -> None:
        """Begin with the station's `values` by parameter name in what is declared from now on.

        `key(name)` is the key of the description that gives a parameter, "" if none does.
        """
        self._station, self.station_key = values, key

    def declare(
        self, prefix: str, defaults: Params, *, live: bool | Collection[str] = False, group: str | None = None
    ) -> None:
        """Declare every field below `defaults`; why a value from YAML is refused goes to `reasons`.

        `live`: whether changes take effect while the node is configured, or the names of the fields
        for which they do (a nested set counts as a whole).  `group`: the name under which `value`
        returns the set, if it is not the prefix.
        """
        group = prefix if group is None else group
        self._groups[group] = defaults
        given: list[Parameter] = []
        for edge, (item, value) in leaves(defaults).items():
            name = f"{prefix}.{edge}" if prefix else edge
            at_once = live if isinstance(live, bool) else edge.partition(".")[0] in live
            if name in self._station:
                value = _of_type(item.type, self._station[name])
            given.append(self._declare_one(name, value, _descriptor(item, edge, at_once)))
            self._owner[name] = (group, edge)
            if at_once:
                self.live.add(name)
        try:
            self._groups.update(self._candidates(given))
        except ValueError as error:
            self.reasons.append(str(error))

    def value(self, prefix: str) -> Any:
        """Return the present set under `prefix`, as the core's frozen dataclass."""
        return self._groups[prefix]

    def declared(self) -> dict[str, Params]:
        """Return the sets by group, as they are now, in the order of their declaration."""
        return dict(self._groups)

    def names(self) -> dict[str, tuple[str, str]]:
        """Return set and edge name of every parameter by its name."""
        return dict(self._owner)

    def put(self, prefix: str, wanted: Params) -> None:
        """Set the parameters under `prefix` to those of `wanted`, which the node uses already."""
        present, configured = leaves(self._groups[prefix]), self.configured
        # Only what differs: each changed parameter is an event for every listener of the graph.
        changed = {edge: value for edge, (_, value) in leaves(wanted).items() if value != present[edge][1]}
        self.configured = False
        try:
            results = self._node.set_parameters(
                [Parameter(f"{prefix}.{edge}" if prefix else edge, value=value) for edge, value in changed.items()]
            )
        finally:
            self.configured = configured
        for result in results:
            if not result.successful:
                raise ValueError(result.reason)

    def restate(self, changed: Mapping[str, Any], station: Mapping[str, Any]) -> None:
        """Take other numbers of the description, of another band; a file keeps its own.

        `changed` are values by parameter name, `station` all that it gives from now on.
        """
        given = []
        for name, value in changed.items():
            if name == "band" or self.station_key(name) or not self._overridden(name):
                group, edge = self._owner[name]
                plain = _of_type(leaves(self._groups[group])[edge][0].type, value)
                # rclpy takes an empty list for one of bytes.
                kind = Parameter.Type.DOUBLE_ARRAY if plain == () else None
                given.append(Parameter(name, kind, list(plain) if isinstance(plain, tuple) else plain))
        self._station, self._restates = station, True
        try:
            result = self._node.set_parameters_atomically(given)
        finally:
            self._restates = False
        if not result.successful:
            raise ValueError(result.reason)

    def on_change(self, listener: Callable[[], object]) -> None:
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
            known = self._node.has_parameter(name) or name.startswith(_STANDARD)
            if not known and (reason := self.unknown(name)) not in self.reasons:
                self.reasons.append(reason)

    def unknown(self, name: str) -> str:
        """Return that there is no such parameter, with the name that is nearest to it."""
        return f"{name}: no such parameter of {self._node.get_name()}{nearest(name, self._owner)}"

    def _declare_one(self, name: str, default: Any, descriptor: ParameterDescriptor) -> Parameter:
        key = self.station_key(name)
        if key:
            constraints = (descriptor.additional_constraints, f"given by the station description: {key}")
            descriptor.additional_constraints = "; ".join(filter(None, constraints))
        overridden = self._overridden(name)
        # An empty list of a parameter file has no type, so rclpy knows no value.
        given = self._node._parameter_overrides[name].value if overridden else None
        empty = overridden and given is None
        override = () if given is None else _plain(given)
        # The same number, as in a dump of all parameters, contradicts nothing.
        refused = bool(key) and overridden and not same_value(default, override)
        if refused:
            self.reasons.append(f"{name} is given by the station description: {key}")
        elif empty and not isinstance(default, tuple):
            self.reasons.append(f"{name}: no value is given")
        # An empty tuple has no element from which rclpy could derive the type.
        declared = self._declare(name, (0.0,) if default == () else default, descriptor, refused or empty)
        if isinstance(default, tuple) and not (default if refused or not overridden else override):
            # rclpy takes an empty list for one of bytes, which no list of doubles could replace.
            declared = Parameter(name, Parameter.Type.DOUBLE_ARRAY, [])
            self._node.set_parameters([declared])
        return declared

    def _declare(self, name: str, default: Any, descriptor: ParameterDescriptor, ignore: bool) -> Parameter:
        default = list(default) if isinstance(default, tuple) else default
        try:
            return self._node.declare_parameter(name, default, descriptor, ignore_override=ignore)
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            self.reasons.append(f"{name}: {error}")
            return self._node.declare_parameter(name, default, descriptor, ignore_override=True)

    def _overridden(self, name: str) -> bool:
        """Return whether a parameter file or an argument gives a parameter."""
        return name in getattr(self._node, "_parameter_overrides", {})

    def _candidates(self, changes: list[Parameter]) -> dict[str, Params]:
        # One candidate per set: fields that constrain each other can change together.
        by_group: dict[str, dict[str, Any]] = {}
        for change in changes:
            if change.name in self._owner:
                group, edge = self._owner[change.name]
                by_group.setdefault(group, {})[edge] = _plain(change.value)
        return {group: self._replaced(group, values) for group, values in by_group.items()}

    def _replaced(self, group: str, values: dict[str, Any]) -> Params:
        try:
            return with_leaves(self._groups[group], values)
        except ValueError as error:
            raise ValueError(f"{group}.{error}" if group else str(error)) from error

    def _try(self, changes: list[Parameter]) -> SetParametersResult:
        try:
            if not self._restates:
                self._refuse_late(changes)
            candidates = self._candidates(changes)
            # Every band of a description has been checked; what guards an antenna is its own.
            for check in self._checks if candidates and not self._restates else ():
                check(self._groups | candidates)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:
            # Whatever a trial raises would be raised by the change, in the middle of a motion.
            return SetParametersResult(successful=False, reason=f"{type(error).__name__}: {error}")
        return SetParametersResult(successful=True)

    def _refuse_late(self, changes: list[Parameter]) -> None:
        """Raise ValueError for a change of what the configured node will not read again.

        What the station description gives is changed there, unless it may change while the node
        runs.
        """
        for change in changes:
            # A drive that waits for a simulated clock would have the wrong time at once.
            fixed = (change.name in self._owner and change.name not in self.live) or change.name == _CLOCK
            if not fixed or _plain(change.value) == _plain(self._node.get_parameter(change.name).value):
                continue
            if key := self.station_key(change.name):
                raise ValueError(f"{change.name} is given by the station description: {key}")
            if self.configured:
                node = self._node.get_name()
                raise ValueError(f"{change.name} is {_WHEN_CONFIGURED}: deactivate {node} and clean it up first")

    def _apply(self, changes: list[Parameter]) -> None:
        candidates = self._candidates(changes)
        if candidates:
            self._groups.update(candidates)
            for listener in self._listeners:
                listener()


def _of_type(kind: Any, value: Any) -> Any:
    """Return a value of the description as the parameter's type: 5 may stand for 5.0."""
    if kind is float:
        return float(value)
    return tuple(float(each) for each in value) if get_args(kind)[:1] == (float,) else _plain(value)


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
