"""Packages that load what they export when it is first used, so that an import costs what it needs.

An `__init__` lists its exports as imports that only a type checker carries out, and ends with

    __getattr__ = lazily(__name__, __file__)

A name must differ from those of the package's modules: Python binds a loaded module to its name.
"""

import ast
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any


def lazily(package: str, file: str) -> Callable[[str], Any]:
    """Return the `__getattr__` (PEP 562) of the `package` whose imports are in `file`."""
    homes = {
        name.name: node.module
        for node in ast.walk(ast.parse(Path(file).read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
    }

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(homes[name]), name)
        setattr(importlib.import_module(package), name, value)
        return value

    return load


def installed(group: str) -> dict[str, Any]:
    """Return the entry points of a group in all installed packages, by name."""
    # Imported here: it costs 2 MB, and most stations have nothing of another package.
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=group)}
