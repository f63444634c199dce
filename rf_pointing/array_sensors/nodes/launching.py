"""Processes of the launch files of the array sensors: each graph has simulation time of its own."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory

from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, CLOCK
from rf_pointing.ros.launching import AUTOSTART, NETWORK, PACKAGE, Argument, LaunchFile, Process
from rf_pointing.ros.launching import network_environment as environment


def array_processes(names: Sequence[str], values: Mapping[str, Any]) -> list[Process]:
    """Return a process for each node, named `executable` or `below/executable`."""
    found = []
    for name in names:
        *below, executable = name.split("/")
        own = {"use_sim_time": executable != CLOCK, "lifecycle.autostart": values["autostart"]}
        found.append(
            Process(
                executable=executable,
                namespace="/".join([values["namespace"], *below]),
                nodes=(executable,),
                parameters=(values["params_file"], {executable: own}),
                # Every graph has a clock of its own, so two graphs may run at different times on
                # one machine.
                remappings=(("/clock", f"/{values['namespace'].strip('/')}/clock"),),
                environment=environment(values["network"]),
                respawn=values["autostart"],
            )
        )
    return found


def _launch_file(name: str) -> LaunchFile:
    parameters = (
        Path(get_package_share_directory(PACKAGE)) / "config" / "array_sensors" / f"{name}.yaml"
    )
    arguments = (
        Argument("namespace", "namespace of the graph", name),
        Argument("params_file", "parameters of its nodes", str(parameters)),
        AUTOSTART,
        NETWORK,
    )
    nodes = (CLOCK, *ARRAY_SYSTEMS[name].nodes)
    return LaunchFile(
        name, f"the simulated graph of {name}", arguments, partial(array_processes, nodes)
    )


DOA, INTERFEROMETER, TRIPULSE = (
    _launch_file(name) for name in ("doa", "interferometer", "tripulse")
)
"""The graph of each array sensor, at real speed."""
