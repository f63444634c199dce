"""The JSON schema of a station description, from the same declarations as its reader.

    python3 -m rf_pointing.station.description.schema > config/stations/station.schema.json

Editors complete and check a file that begins with

    # yaml-language-server: $schema=PATH/station.schema.json
"""

import dataclasses
import json
import types
from collections.abc import Mapping
from typing import Any, Union, get_args, get_origin, get_type_hints

from rf_pointing.core import leaves, parameter_unit
from rf_pointing.ephemeris import SITES
from rf_pointing.station.antenna.mount import MountParams
from rf_pointing.station.derive.nodes import described_parameters, owner_of_name
from rf_pointing.station.description.content import Content

SCHEMA = "station.schema.json"
_KINDS = {float: "number", int: "integer", str: "string", bool: "boolean"}


def schema() -> dict[str, Any]:
    """Return the schema of one description file."""
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "title": "Station description of rf_pointing"}
    return head | _section(Content)


def _section(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    rows, needed = {}, []
    for item in dataclasses.fields(kind):
        described = item.metadata["description"]
        unit = parameter_unit(item.name)
        text = described if unit == "1" else f"{described} [{unit}]"
        rows[item.name] = {"description": text} | _value(hints[item.name], item.metadata, item.name)
        no_default = item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING
        if no_default:
            needed.append(item.name)
        elif isinstance(item.default, (float, int, str, bool)):
            rows[item.name]["default"] = item.default
    found = {"type": "object", "description": (kind.__doc__ or "").strip(), "properties": rows}
    return found | {"required": needed, "additionalProperties": False}


def _value(kind: Any, rules: Mapping[str, Any], name: str) -> dict[str, Any]:
    if get_origin(kind) in (Union, types.UnionType):
        kinds = [each for each in get_args(kind) if each is not type(None)]
        several = [_value(each, rules, name) for each in kinds]
        if name == "site":
            several[-1]["enum"] = sorted(SITES)
        return several[0] if len(several) == 1 else {"anyOf": several}
    if dataclasses.is_dataclass(kind):
        return _section(kind)
    if get_origin(kind) is dict:
        return _table(get_args(kind)[1], name)
    if get_origin(kind) is tuple:
        kinds = list(get_args(kind))
        items = _value(kinds[0], rules, name)
        if kinds[-1] is Ellipsis:
            return {"type": "array", "items": items}
        return {"type": "array", "items": items, "minItems": len(kinds), "maxItems": len(kinds)}
    found: dict[str, Any] = {"type": _KINDS[kind]}
    for bound, word in (("low", "minimum"), ("high", "maximum")):
        if rules.get(bound) is not None and kind is not str:
            found[word] = rules[bound]
    if rules.get("choices"):
        found["enum"] = [str(choice) for choice in rules["choices"]]
    return found


def _table(inner: Any, name: str) -> dict[str, Any]:
    if inner is not Any:
        return {"type": "object", "minProperties": 1, "additionalProperties": _value(inner, {}, name)}
    if name == "mount_errors":
        return {"type": "object", "properties": {edge: {"type": "number"} for edge in leaves(MountParams())},
            "additionalProperties": False}  # fmt: skip
    if name == "tuning":
        # Dotted names are completed; a nested group is checked when the file is read.
        names = sorted(each for each in described_parameters() if owner_of_name(each).startswith("tuning."))
        return {"type": "object", "properties": {each: {} for each in names}}
    return {"type": "object", "properties": {"type": {"type": "string"}}}


def schema_text() -> str:
    """Return the schema as the file that is published."""
    return json.dumps(schema(), indent=1) + "\n"


if __name__ == "__main__":
    print(schema_text(), end="")
