"""Procedures: a network of blocks of directives, written as YAML and checked before anything runs.

    version: 1
    name: precalibration
    parameters: {satellite: null}          # null: the caller must give it
    blocks:
      point:
        after: [configure]                 # all of these are completed or skipped first
        before: {antenna.fault: ""}        # preconditions
        directives:
          - send: antenna_servo/resume
            with: {speed: "${speed}"}      # a parameter, or the actual value of device.attribute
            expect: {antenna.mode: holding}
            when: {antenna.mode: parked}   # left out where this does not hold
        then: {antenna.moving: false}      # postconditions
        fails: {tracking.mode: idle}       # an anomaly at once, when all of these show
        window_s: [-300, 0]                # start within these times from the procedure's zero
        timeout_s: 120                     # of each response and condition; or a ${parameter}
        optional: true                     # its failure does not hold the procedure up
        skippable: true                    # the operator may skip it

The dictionary of directives says which names exist and which arguments each takes.
"""

import dataclasses
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Any

from rf_pointing.core import is_number, names_in, parse_yaml, require_choice
from rf_pointing.operations.expected_state import Condition, ExpectedState, read_conditions

_PLACE = re.compile(r"^\$\{([A-Za-z_][\w.]*)\}$")
_PROCEDURE_KEYS = {"version", "name", "parameters", "blocks"}
_BLOCK_KEYS = {"after", "before", "directives", "then", "fails", "window_s", "timeout_s", "optional", "skippable"}
_DIRECTIVE_KEYS = {"send", "with", "expect", "when"}
TIMEOUT_S = 60.0
LARGEST_FILE = 1_000_000
"""Longest text of a procedure, in characters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Directive:
    """One request to one device, and the state that shows its success."""

    name: str
    arguments: Mapping[str, Any]
    expected: tuple[Condition, ...]
    when: tuple[Condition, ...] = ()

    def filled(self, parameters: Mapping[str, Any], expected_state: ExpectedState) -> dict[str, Any]:
        """Return the arguments with every place-holder replaced; ValueError for an unknown one."""
        return {
            key: _filled(f"{self.name}: {key}", value, parameters, expected_state)
            for key, value in self.arguments.items()
        }

    def shown(self, arguments: Mapping[str, Any]) -> str:
        """Return filled arguments in a line: a number or a text, else where its value is from."""
        return ", ".join(
            f"{key}={value}" if isinstance(value, str | int | float) else f"{key} from {str(self.arguments[key])[2:-1]}"
            for key, value in arguments.items()
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Directives that are sent one after the other; times in s from the procedure's zero."""

    name: str
    after: tuple[str, ...]
    before: tuple[Condition, ...]
    directives: tuple[Directive, ...]
    then: tuple[Condition, ...]
    fails: tuple[Condition, ...]
    window_s: tuple[float, float]
    timeout_s: float
    optional: bool
    skippable: bool
    timeout_from: str = ""
    """Parameter that gives the timeout, in place of the number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Procedure:
    """A directed network of blocks without a cycle; None marks a parameter the caller must give."""

    name: str
    parameters: Mapping[str, Any]
    blocks: Mapping[str, Block]

    def with_parameters(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return all parameters; ValueError for an unknown or a missing one."""
        unknown = sorted(set(given) - set(self.parameters))
        if unknown:
            raise ValueError(f"{self.name} has no parameter {', '.join(unknown)}; it has {', '.join(self.parameters)}")
        values = {**self.parameters, **given}
        missing = [name for name, value in values.items() if value is None]
        if missing:
            raise ValueError(f"{self.name} needs {', '.join(missing)}")
        return values

    def with_timeouts(self, parameters: Mapping[str, Any]) -> "Procedure":
        """Return the procedure with numbers for the place-holders of its times."""
        blocks = {}
        for name, block in self.blocks.items():
            timeout_s = parameters[block.timeout_from] if block.timeout_from else block.timeout_s
            if not is_number(timeout_s) or timeout_s <= 0.0:
                raise ValueError(f"{name}.timeout_s={timeout_s!r} must be > 0 s")
            blocks[name] = dataclasses.replace(block, timeout_s=float(timeout_s))
        return dataclasses.replace(self, blocks=blocks)


def read_procedure(text: str, dictionary: Mapping[str, Collection[str]]) -> Procedure:
    """Return the procedure of a YAML text.

    `dictionary`: the arguments of each directive by its name.  Raises ValueError with the place of
    the first mistake: unknown names, a cycle, conditions that cannot be tested.
    """
    if len(text) > LARGEST_FILE:
        raise ValueError(f"a procedure of {len(text)} characters must have <= {LARGEST_FILE}")
    return procedure_from(parse_yaml(text), dictionary)


def procedure_from(content: Any, dictionary: Mapping[str, Collection[str]]) -> Procedure:
    """Return the procedure of the values of a YAML text, as `read_procedure`."""
    given = _mapping("the procedure", content, _PROCEDURE_KEYS)
    if given.get("version") != 1:
        raise ValueError(f"version={given.get('version')!r} must be 1")
    name = str(given.get("name") or "")
    if not name:
        raise ValueError("name='' must say what the procedure is")
    parameters = _mapping("parameters", given.get("parameters") or {})
    blocks = {
        str(key): _block(str(key), value, parameters, dictionary)
        for key, value in _mapping("blocks", given.get("blocks")).items()
    }
    if not blocks:
        raise ValueError(f"{name} must have at least one block")
    _require_network(blocks)
    return Procedure(name=name, parameters=parameters, blocks=blocks)


def _block(name: str, given: Any, parameters: Mapping[str, Any], dictionary: Mapping[str, Collection[str]]) -> Block:
    values = _mapping(f"block {name}", given, _BLOCK_KEYS)
    directives = values.get("directives") or []
    if not isinstance(directives, Sequence) or isinstance(directives, str):
        raise ValueError(f"{name}.directives must be a list")
    timeout_s = values.get("timeout_s", TIMEOUT_S)
    place = _PLACE.match(timeout_s) if isinstance(timeout_s, str) else None
    if not (place and place[1] in parameters) and not (is_number(timeout_s) and timeout_s > 0.0):
        raise ValueError(f"{name}.timeout_s={timeout_s!r} must be > 0 s, or a parameter")
    flags = {key: values.get(key, False) for key in ("optional", "skippable")}
    for key, flag in flags.items():
        if not isinstance(flag, bool):
            raise ValueError(f"{name}.{key}={flag!r} must be true or false")
    return Block(
        name=name, after=names_in(f"{name}.after", values.get("after")),
        before=read_conditions(f"{name}.before", values.get("before") or {}),
        directives=tuple(
            _directive(f"{name}.directives[{k}]", each, parameters, dictionary) for k, each in enumerate(directives)
        ),
        then=read_conditions(f"{name}.then", values.get("then") or {}),
        fails=read_conditions(f"{name}.fails", values.get("fails") or {}),
        window_s=_window(name, values.get("window_s")),
        timeout_s=TIMEOUT_S if place else float(timeout_s), timeout_from=place[1] if place else "",
        **flags,
    )  # fmt: skip


def _directive(
    where: str, given: Any, parameters: Mapping[str, Any], dictionary: Mapping[str, Collection[str]]
) -> Directive:
    values = _mapping(where, given, _DIRECTIVE_KEYS)
    name = str(values.get("send") or "")
    require_choice(f"{where}: send", name, sorted(dictionary))
    arguments = _mapping(f"{where}.with", values.get("with") or {}, set(dictionary[name]))
    for key, value in arguments.items():
        place = _PLACE.match(value) if isinstance(value, str) else None
        if place and "." not in place[1] and place[1] not in parameters:
            raise ValueError(
                f"{where}: {key}={value}: {place[1]} must be one of the parameters {', '.join(parameters)}"
            )
    expected = read_conditions(f"{where}.expect", values.get("expect") or {})
    when = read_conditions(f"{where}.when", values.get("when") or {})
    return Directive(name=name, arguments=arguments, expected=expected, when=when)


def _require_network(blocks: Mapping[str, Block]) -> None:
    for block in blocks.values():
        unknown = [name for name in block.after if name not in blocks]
        if unknown:
            raise ValueError(f"{block.name}.after: {', '.join(unknown)} must be one of {', '.join(blocks)}")
    try:
        TopologicalSorter({name: block.after for name, block in blocks.items()}).prepare()
    except CycleError as error:
        raise ValueError(f"blocks wait for each other: {' after '.join(error.args[1])}") from error


def _window(name: str, given: Any) -> tuple[float, float]:
    if given is None:
        return -math.inf, math.inf
    if not isinstance(given, Sequence) or len(given) != 2 or not all(map(is_number, given)):
        raise ValueError(f"{name}.window_s={given!r} must be two times in s")
    first_s, last_s = map(float, given)
    if first_s >= last_s:
        raise ValueError(f"{name}.window_s={[first_s, last_s]}: the first must be < the last")
    return first_s, last_s


def _filled(where: str, value: Any, parameters: Mapping[str, Any], expected_state: ExpectedState) -> Any:
    place = _PLACE.match(value) if isinstance(value, str) else None
    if place is None:
        return value
    if place[1] in parameters:
        return parameters[place[1]]
    seen = expected_state.actual(place[1])
    if seen is None:
        raise ValueError(f"{where}: {place[1]} is not known yet")
    return seen.value


def _mapping(where: str, given: Any, known: Collection[str] | None = None) -> dict[str, Any]:
    if not isinstance(given, Mapping):
        raise ValueError(f"{where} must be a mapping, not {type(given).__name__}")
    unknown = sorted(str(key) for key in given if known is not None and key not in known)
    if unknown:
        raise ValueError(f"{where}: unknown {', '.join(unknown)}; known are {', '.join(sorted(known or ()))}")
    return {str(key): value for key, value in given.items()}
