"""A station description with other values, and its text."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import yaml

from rf_pointing.core.whole_file import compose_yaml, read_whole
from rf_pointing.station.description.content import BandReceiverSection, ReceiverSection
from rf_pointing.station.description.description import StationDescription


def received_by(station: StationDescription, section: ReceiverSection) -> StationDescription:
    """Return the same station with another receiver, which is that of every band."""
    own = BandReceiverSection()
    bands = {name: replace(each, receiver=own) for name, each in station.content.bands.items()}
    return _other(station, receiver=section, bands=bands)


def leaning(station: StationDescription, train_rad: float) -> StationDescription:
    """Return the same station with its tilt axis set to an azimuth."""
    train_deg = round(math.degrees(train_rad), 3)
    return _other(station, mount=replace(station.content.mount, train_deg=train_deg))


def _other(station: StationDescription, **sections: Any) -> StationDescription:
    content = replace(station.content, **sections)
    return StationDescription(station.path, content, station.mask, station.lines)


def text_with(station: StationDescription, changes: Mapping[str, Any]) -> str:
    """Return the text of a description with other values for dotted keys, files by whole paths."""
    # The nodes of YAML and not its values: numbers stay as the user wrote them.
    root = compose_yaml(read_whole(station.path, encoding="utf-8-sig"))
    models = {f"bands.{name}.bias_model": station.bias_model_file(name) for name in station.bands}
    files = {key: str(model) for key, model in models.items() if model}
    if horizon := station.content.mount.horizon_file:
        files["mount.horizon_file"] = str((station.path.parent / horizon).resolve())
    for key, value in {**files, **changes}.items():
        _put(root, key.split("."), value)
    return str(yaml.serialize(root, Dumper=yaml.SafeDumper))


def _put(section: yaml.MappingNode, keys: Sequence[str], value: Any) -> None:
    """Set the value at `keys` below a section of YAML nodes."""
    rows = {str(name.value): index for index, (name, _) in enumerate(section.value)}
    name, below = keys[0], keys[1:]
    if below:
        if name not in rows:
            section.value.append((yaml.compose(name), yaml.compose("{}")))
            rows[name] = -1
        _put(section.value[rows[name]][1], below, value)
        return
    plain = list(value) if isinstance(value, tuple) else value
    row = (yaml.compose(f'"{name}"'), yaml.compose(yaml.safe_dump(plain)))
    if name in rows:
        section.value[rows[name]] = row
    else:
        section.value.append(row)
