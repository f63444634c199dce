"""The one command of a `pip install`: `rf-pointing NAME ...` starts an executable of the package.

Without a name it lists them.  In a ROS install `ros2 run rf_pointing NAME` does the same.
"""

import ast
import importlib
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rf_pointing.core.lazy import installed
from rf_pointing.ros import NODE_USAGE

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ROOMS = ("commands", "nodes", "array_sensors.nodes", "papers")
"""Packages of the executables."""
EXECUTABLES = "rf_pointing.executables"
"""Entry point group of all executables; setup.py has the table."""
ROS = ("rclpy", "rf_pointing_msgs", "builtin_interfaces", "ament_index_python")


def main(argv: list[str] | None = None) -> None:
    """Start the executable that the first argument names; exit code 2 for one that is not there."""
    given = sys.argv[1:] if argv is None else argv
    found = installed(EXECUTABLES)
    if not given or given[0] in ("-h", "--help"):
        # `rf-pointing | head` ends as any other program does.
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
        print("\n".join(listing(found)))
        return
    name = given[0].replace("-", "_")
    if name not in found:
        # Not that of core/checks: a bare Python has no numpy.
        from difflib import get_close_matches

        near = get_close_matches(name, found, cutoff=0.4)
        hint = f", did you mean {near[0]}?" if near else ";"
        sys.exit(_refusal(f"there is no {given[0]!r}{hint} `rf-pointing` lists what there is"))
    sys.argv = [name, *given[1:]]
    try:
        start = found[name].load()
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ROS:
            raise
        sys.exit(_refusal(f"{name} needs ROS 2 Jazzy with this package built in it: {error}"))
    sys.exit(start())


def start() -> None:
    """Start the executable by whose name this program was called, as `ros2 run` does."""
    name = Path(sys.argv[0]).name
    module = next(each for room in ROOMS if _path(each := f"rf_pointing.{room}.{name}").is_file())
    if ".nodes." in module and {"-h", "--help"} & set(sys.argv[1:]):
        # Read, not imported: the libraries of a node take three times as long as its help.
        print(f"{_docstring(module)}\n{NODE_USAGE}")
        return
    if ".nodes." in module:
        # Until a node takes signals itself, in `ros/main_loop.py`, it ends by them without a trace.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(importlib.import_module(module).main())


def listing(found: "dict[str, EntryPoint]") -> list[str]:
    """Return the usage and a line for each executable, the commands before the nodes."""
    lines = ["usage: rf-pointing NAME [ARGUMENT ...]; rf-pointing NAME --help says more", ""]
    nodes = [name for name, point in found.items() if ".nodes." in point.module]
    for title, names in (("commands:", sorted(found.keys() - nodes)), ("nodes of the graph (ROS 2):", sorted(nodes))):
        lines += [title, *(f"  {name:<24}{summary(found[name].module)}" for name in names), ""]
    return lines[:-1]


def summary(module: str) -> str:
    """Return what an executable does in a line, read without importing it."""
    first = " ".join(_docstring(module).partition("\n\n")[0].split())
    return first.partition(": ")[2] or first


def _path(module: str) -> Path:
    return Path(__file__).parent.joinpath(*module.split(".")[1:]).with_suffix(".py")


def _docstring(module: str) -> str:
    return ast.get_docstring(ast.parse(_path(module).read_text(encoding="utf-8"))) or ""


def _refusal(text: str) -> int:
    print(f"rf-pointing: {text}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    main()
