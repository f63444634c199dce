"""From a YAML file to the sections of a description, with every problem in it and its line.

Nothing stops at the first problem: an unusable value is noted and left out (None), and the rest is
read on, so that a user mends a file once.
"""

import dataclasses
import math
import types
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import yaml

from rf_pointing.core import parameter_unit, require_between, require_choice
from rf_pointing.core.checks import brief, near_names, require_finite, require_id
from rf_pointing.core.whole_file import YamlError, compose_yaml, read_whole
from rf_pointing.station.description.content import Content

MOST_VALUES = 3600
"""Longest list of a description, and most points of a horizon: a point every 0.1 deg."""
MOST_PROBLEMS = 100
"""The file is not read on after so many: whatever it is, it is not a description."""


class StationError(ValueError):
    """A description that cannot be used; `problems` are all of them, by lines (0: none)."""

    def __init__(self, file: str, problems: Iterable[tuple[int, str]]) -> None:
        self.problems = sorted(set(problems))
        super().__init__("\n".join(f"{file}{f':{line}' if line else ''}: {text}" for line, text in self.problems))


def nearest(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean X?" for the known name nearest to `name`, else what is known."""
    names = sorted(known)
    if found := near_names(name, names):
        return f"; did you mean {found[0]}?"
    return f"; it has {', '.join(names)}" if len(names) <= 20 else ""


class Reader:
    """Reads one file; `problems` and the line of every key grow with it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[tuple[int, str]] = []
        self.lines: dict[str, int] = {"": 1}

    def note(self, key: str, text: str) -> None:
        """Note a problem at the line of `key`, or of the nearest section above it."""
        while key not in self.lines:
            key = key.rpartition(".")[0]
        self.problems.append((self.lines[key], text))

    def wrong(self, key: str, text: str) -> None:
        """Note a problem of `key` whose text goes on after its name."""
        self.note(key, f"{key}{text}")

    def refuse(self) -> None:
        """Raise `StationError` with all problems, if there are any."""
        if self.problems:
            raise StationError(str(self.path), self.problems)

    def content(self, text: str | None = None) -> Content:
        """Return the file's content; a value that is None although it must not be has a problem.

        `text` stands for a file that is not written yet.
        """
        try:
            root = compose_yaml(read_whole(self.path, encoding="utf-8-sig") if text is None else text)
        except YamlError as error:
            raise StationError(str(self.path), [(error.line, error.why)]) from error
        except (OSError, ValueError) as error:
            raise StationError(str(self.path), [(1, f"cannot be read: {error}")]) from error
        if not isinstance(root, yaml.MappingNode):
            raise StationError(str(self.path), [(1, "a station description must map keys to values")])
        content: Content = self._section(Content, root, "")
        return content

    def _section(self, kind: Any, node: yaml.Node, key: str) -> Any:
        hints, fields = get_type_hints(kind), {item.name: item for item in dataclasses.fields(kind)}
        values: dict[str, Any] = {}
        for name, below in self._items(node, key):
            if len(self.problems) > MOST_PROBLEMS:
                self.refuse()
            if name not in fields:
                owner = key or "the description"
                self.note(_join(key, name), f"{_join(key, name)}: no such key of {owner}{nearest(name, fields)}")
                continue
            values[name] = self._value(hints[name], fields[name].metadata, below, _join(key, name))
        for name, item in fields.items():
            if name in values:
                continue
            if item.default is not dataclasses.MISSING or item.default_factory is not dataclasses.MISSING:
                continue
            values[name] = None
            unit = parameter_unit(name)
            described = item.metadata["description"] + (f" [{unit}]" if unit != "1" else "")
            self.note(key, f"{_join(key, name)} is missing: {described}")
        return kind(**values)

    def _items(self, node: yaml.Node, key: str) -> list[tuple[str, yaml.Node]]:
        if not isinstance(node, yaml.MappingNode):
            raise ValueError(f"{key}={getattr(node, 'value', '')!s} must be a section of keys and values")
        found: dict[str, yaml.Node] = {}
        for name_node, below in node.value:
            name = str(name_node.value)
            try:
                require_id(f"a key of {key or 'the description'}", name)
            except ValueError as error:
                self.problems.append((name_node.start_mark.line + 1, str(error)))
                continue
            # A second one would silently win over the first.
            if name in found:
                self.problems.append((name_node.start_mark.line + 1, f"{_join(key, name)} is given twice"))
            found[name] = below
            self.lines[_join(key, name)] = name_node.start_mark.line + 1
        return list(found.items())

    def _value(self, kind: Any, rules: Mapping[str, Any], node: yaml.Node, key: str) -> Any:
        if get_origin(kind) in (Union, types.UnionType):
            kinds = [each for each in get_args(kind) if each is not type(None)]
            scalar = isinstance(node, yaml.ScalarNode)
            kind = next((each for each in kinds if (each is str) == scalar), kinds[0]) if len(kinds) > 1 else kinds[0]
        try:
            return self._read(kind, rules, node, key)
        except StationError:
            raise
        except ValueError as error:
            self.note(key, str(error))
            return None

    def _read(self, kind: Any, rules: Mapping[str, Any], node: yaml.Node, key: str) -> Any:
        if dataclasses.is_dataclass(kind):
            return self._section(kind, node, key)
        if get_origin(kind) is dict:
            inner = get_args(kind)[1]
            rows = self._items(node, key)
            if inner is Any:
                return {name: self._open(below, _join(key, name)) for name, below in rows}
            return {name: self._value(inner, {}, below, _join(key, name)) for name, below in rows}
        if get_origin(kind) is tuple:
            return self._tuple(get_args(kind), rules, node, key)
        return _scalar(kind, rules, node, key)

    def _open(self, node: yaml.Node, key: str) -> Any:
        """Return whatever is below, and note the lines of its keys."""
        if isinstance(node, yaml.MappingNode):
            return {name: self._open(below, _join(key, name)) for name, below in self._items(node, key)}
        if isinstance(node, yaml.SequenceNode):
            return [self._open(each, key) for each in node.value]
        return _plain(node)

    def _tuple(self, kinds: tuple[Any, ...], rules: Mapping[str, Any], node: yaml.Node, key: str) -> tuple[Any, ...]:
        many = kinds[-1] is Ellipsis
        if not isinstance(node, yaml.SequenceNode):
            raise ValueError(f"{key} must be a list" + ("" if many else f" of {len(kinds)} values"))
        if not many and len(node.value) != len(kinds):
            raise ValueError(f"{key} has {len(node.value)} values, must have {len(kinds)}")
        if len(node.value) > MOST_VALUES:
            raise ValueError(f"{key} has {len(node.value)} values, must have <= {MOST_VALUES}")
        rows = enumerate(zip(kinds[:1] * len(node.value) if many else kinds, node.value, strict=True))
        return tuple(self._read(kind, rules, below, f"{key}[{index}]") for index, (kind, below) in rows)


def _join(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name


def _plain(node: yaml.Node) -> Any:
    value = yaml.constructor.SafeConstructor().construct_object(node, deep=True)
    if isinstance(value, str) and not node.style:
        # A number of YAML 1.2, as 8e9 without a sign, that YAML 1.1 takes for a text.
        with suppress(ValueError):
            number = float(value)
            return number if math.isfinite(number) else value
    return value


def _scalar(kind: Any, rules: Mapping[str, Any], node: yaml.Node, key: str) -> Any:
    if not isinstance(node, yaml.ScalarNode):
        raise ValueError(f"{key} must be one value")
    value = _plain(node)
    if kind is str:
        # A name like 2024 or on is a text to its user, whatever YAML takes it for.
        text = str(node.value)
        if not text.isprintable():
            # A name stands in the subject of an e-mail, and in file names.
            raise ValueError(f"{key}={brief(text)} must be one line of printable signs")
        if rules.get("choices"):
            require_choice(key, text, rules["choices"])
        return text
    if kind is bool:
        if not isinstance(value, bool):
            raise ValueError(f"{key}={node.value} must be true or false")
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{key}={node.value} must be a number")
    if kind is int and not isinstance(value, int):
        raise ValueError(f"{key}={node.value} must be a whole number")
    require_finite(key, value)
    value = value if kind is int else float(value)
    require_between(key, value, rules.get("low"), rules.get("high"))
    return value
