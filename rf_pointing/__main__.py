"""The one command of a `pip install`: `rf-pointing NAME ...` starts an executable of the package.

Without a name it lists them.  In a ROS install `ros2 run rf_pointing NAME` does the same.
"""

import ast
import difflib
import signal
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

EXECUTABLES = "rf_pointing.executables"
"""Entry point group of all executables; setup.py has the table."""
ROS = ("rclpy", "rf_pointing_msgs", "builtin_interfaces", "ament_index_python")


def main(argv: list[str] | None = None) -> None:
    """Start the executable that the first argument names; exit code 2 for one that is not there."""
    given = sys.argv[1:] if argv is None else argv
    found = {point.name: point for point in entry_points(group=EXECUTABLES)}
    if not given or given[0] in ("-h", "--help"):
        # `rf-pointing | head` ends as any other program does.
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
        print("\n".join(listing(found)))
        return
    name = given[0].replace("-", "_")
    if name not in found:
        near = difflib.get_close_matches(name, found, n=1, cutoff=0.4)
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


def listing(found: dict[str, EntryPoint]) -> list[str]:
    """Return the usage and a line for each executable, the commands before the nodes."""
    lines = ["usage: rf-pointing NAME [ARGUMENT ...]; rf-pointing NAME --help says more", ""]
    nodes = [name for name, point in found.items() if ".nodes." in point.module]
    for title, names in (("commands:", sorted(found.keys() - nodes)), ("nodes of the graph (ROS 2):", sorted(nodes))):
        lines += [title, *(f"  {name:<24}{summary(found[name].module)}" for name in names), ""]
    return lines[:-1]


def summary(module: str) -> str:
    """Return what an executable does in a line, read without importing it."""
    path = Path(__file__).parent.joinpath(*module.split(".")[1:]).with_suffix(".py")
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    first = " ".join(docstring.partition("\n\n")[0].split())
    return first.partition(": ")[2] or first


def _refusal(text: str) -> int:
    print(f"rf-pointing: {text}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    main()
