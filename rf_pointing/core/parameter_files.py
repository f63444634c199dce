"""The YAML parameter files of the nodes, read without ROS: the same file drives the graph and the simulation.

/**/antenna_servo:
  ros__parameters:
    wind: {mean_speed_m_s: 8.0}
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml

from rf_pointing.core import Params, with_leaves

__all__ = ["NodeParameters", "read_parameter_files"]

P = TypeVar("P", bound=Params)


class NodeParameters:
    """What the files say to one node: dotted names and values, as on the edge (degrees)."""

    def __init__(self, node: str, values: Mapping[str, Any]) -> None:
        self.node, self.values = node, dict(values)

    def group(self, prefix: str, defaults: P) -> P:
        """Return `defaults` with the values under `prefix`; errors name node and key."""
        start = f"{prefix}." if prefix else ""
        chosen = {k.removeprefix(start): v for k, v in self.values.items() if k.startswith(start)}
        try:
            return with_leaves(defaults, chosen)
        except ValueError as error:
            raise ValueError(f"{self.node}: {start}{error}") from error


def read_parameter_files(paths: Sequence[Path]) -> dict[str, NodeParameters]:
    """Return the parameters of every node, later files over earlier ones."""
    merged: dict[str, dict[str, Any]] = {}
    for path in paths:
        try:
            content = yaml.safe_load(path.read_text())
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise ValueError(f"{path}: not YAML: {error}") from error
        except OSError as error:
            raise ValueError(f"parameter file {path}: {error.strerror}") from error
        if not isinstance(content, Mapping):
            raise ValueError(f"{path}: must map node names to ros__parameters")
        for key, section in content.items():
            if not isinstance(section, Mapping) or set(section) != {"ros__parameters"}:
                raise ValueError(f"{path}: {key} must hold ros__parameters and nothing else")
            if not isinstance(section["ros__parameters"], Mapping):
                raise ValueError(f"{path}: ros__parameters of {key} must map names to values")
            merged.setdefault(str(key).rsplit("/", 1)[-1], {}).update(_flat(section["ros__parameters"]))
    return {node: NodeParameters(node, values) for node, values in merged.items()}


def _flat(section: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in section.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
