"""Imports flow in one direction: the table of docs/architecture.md, held against the code."""

import ast
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "rf_pointing"
ARCHITECTURE = PACKAGE.parent / "docs" / "architecture.md"
IMPORTED_AS = {
    "erfa": "pyerfa", "astropy_iers_data": "astropy-iers-data", "yaml": "PyYAML",
    "serial": "pyserial", "zmq": "pyzmq",
}  # fmt: skip
BASE = {"numpy"}
SIBLING = BASE | {"scipy"}
SIBLINGS = {
    **dict.fromkeys(("servo", "controllers", "rf", "planning", "identification", "radiometry", "orbit"), SIBLING),
    "ephemeris": SIBLING | {"sgp4", "erfa", "astropy_iers_data", "requests", "urllib3"},
    "tracking": SIBLING | {"yaml"},
    "calibration": SIBLING | {"yaml"},
    "operations": {"icalendar"},
    "drives": BASE | {"serial"},
    # The last two are optional: their sources say what to install.
    "designate": SIBLING,
    "receiver": SIBLING | {"serial", "zmq", "SoapySDR"},
}
COMPOSED = set().union(*SIBLINGS.values())
CORE_OF_ARRAYS = {f"array_sensors/{room}" for room in ("attitude", "doa", "interferometer", "tripulse")}
ALLOWED_THIRD_PARTY = {
    "core": BASE | {"yaml"},
    **SIBLINGS,
    # Alarms go to webhooks.
    "station": COMPOSED | {"requests"},
    "simulation": COMPOSED,
    "api": COMPOSED | {"pandas"},
    "report": COMPOSED | {"matplotlib", "rosbags", "jinja2", "markupsafe", "pandas", "pyarrow"},
    "ros": None,
    "web": None,
    "nodes": None,
    "commands": None,
    **dict.fromkeys(CORE_OF_ARRAYS, SIBLING),
    "array_sensors/report": COMPOSED | {"matplotlib", "rosbags"},
    "array_sensors/nodes": None,
    "papers": COMPOSED | {"matplotlib"},
}
LIVE = "api/live.py"
"""The part of the front door that needs ROS; it is imported when it is called."""
STATION = {"core", *SIBLINGS, "station", "simulation", "report"}
"""What runs the station without ROS: none of it may import array sensors or papers, nor may nodes and commands."""
ALLOWED_ROOMS = {
    "core": set(),
    **{room: {"core"} for room in SIBLINGS},
    # A schedule turns the antenna between passes by the rules of planning.
    "operations": {"core", "planning"},
    # Places on the Earth are those of the sites.
    "designate": {"core", "ephemeris"},
    # Noise and level as the simulated receiver has them.
    "receiver": {"core", "rf"},
    # Passes and the mount's model are those of a calibration; frames and elements are of ephemeris.
    "orbit": {"core", "calibration", "ephemeris"},
    # Fluxes of bodies and patterns of beams are those of the link budget.
    "radiometry": {"core", "rf"},
    "station": {"core", *SIBLINGS},
    "simulation": {"core", "station", *SIBLINGS},
    "report": {"core", "station", "simulation", *SIBLINGS},
    "api": STATION,
    "ros": STATION,
    "web": {"core", "ros", "station"},
    "nodes": STATION | {"ros", "web"},
    "commands": STATION | {"ros", "nodes", "api"},
    **dict.fromkeys(CORE_OF_ARRAYS, {"core", *SIBLINGS, "station"} | CORE_OF_ARRAYS),
    "array_sensors/report": STATION | CORE_OF_ARRAYS,
    "array_sensors/nodes": STATION | {"ros", "nodes", "commands", "api", "array_sensors/report"} | CORE_OF_ARRAYS,
    "papers": STATION | CORE_OF_ARRAYS | {"api", "commands"},
}


def room_of(parts: tuple[str, ...] | list[str]) -> str:
    """Return the room of a module: its package, inside `array_sensors` with the room there."""
    return "/".join(parts[:2]) if parts[0] == "array_sensors" and len(parts) > 1 else parts[0]


def modules() -> list[Path]:
    return sorted(path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE)


def imported_names(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
    return names


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_module_imports_only_what_its_room_may(path: Path) -> None:
    inside = path.relative_to(PACKAGE)
    room = room_of(inside.parent.parts)
    if room == "array_sensors":
        return
    third_party = None if inside.as_posix() == LIVE else ALLOWED_THIRD_PARTY[room]
    for name in imported_names(path):
        top, *rest = name.split(".")
        if top == "rf_pointing":
            if rest:
                allowed = ALLOWED_ROOMS[room] | {room} | ({"ros"} if inside.as_posix() == LIVE else set())
                assert room_of(rest) in allowed, f"{room} may not import {name}"
        elif third_party is not None and top not in sys.stdlib_module_names:
            assert top in third_party, f"{room} may not import {name}"


NETWORK = {"requests", "urllib3", "httpx", "urllib.request", "http.client", "ftplib"}


def test_two_modules_talk_to_servers() -> None:
    users = {path.relative_to(PACKAGE).as_posix() for path in modules() if imported_names(path) & NETWORK}
    assert {name for name in users if not name.startswith(("drives/", "nodes/", "ros/", "web/"))} == {
        "ephemeris/fetching.py",
        "station/clients/alarm_hooks.py",
    }


def test_every_room_is_in_the_table() -> None:
    rooms = {room_of(path.relative_to(PACKAGE).parent.parts) for path in modules()}
    assert rooms - {"array_sensors"} == set(ALLOWED_THIRD_PARTY)


@pytest.mark.parametrize("room", ["core", *SIBLINGS])
def test_the_table_of_the_documentation_names_the_same_libraries(room: str) -> None:
    (row,) = (line for line in ARCHITECTURE.read_text().splitlines() if line.startswith("| `") and f"`{room}/`" in line)
    named = {name.strip() for name in row.strip("|").split("|")[2].split(",")} - ALLOWED_ROOMS[room] - {"core"}
    assert named == {IMPORTED_AS.get(name, name) for name in ALLOWED_THIRD_PARTY[room]}
