"""A private ROS domain and real processes for the graph tests."""

import os
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from ament_index_python.packages import get_package_prefix

from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.managed_graph import TAKEN_UP_S, LifecycleClient, NodeProcesses, Waiting
from rf_pointing.ros.repeated_call import RepeatedCall
from rf_pointing.station.derive.nodes import NODES
from rf_pointing.station.description import read_station
from test.conftest import within

STATION_NODES = set(NODES) - {"simulation_clock", "operator_page"}
TARGETED = ("ephemeris_publisher", "rf_receiver")
DEADLINE_S = 60.0
"""On an idle machine; a busy one gets as much more as it is slower."""


@pytest.fixture(scope="session", autouse=True)
def private_domain(ros_domain: int) -> int:
    """Keep every test of the folder to the session's own domain."""
    return ros_domain


def executable(name: str) -> str:
    return str(Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing" / name)


def start_track(*arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        # Whatever was calibrated in the working folder must not change what is tested.
        [executable("track"), "--models", "", *arguments],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def processes_of(namespace: str) -> list[int]:
    """Return the processes that were started for a namespace and still run."""
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                command = (folder / "cmdline").read_bytes().decode(errors="replace")
            except OSError:
                continue
            if f"__ns:={namespace}\0" in command:
                found.append(int(folder.name))
    return found


def left_segments() -> set[str]:
    """Return the shared-memory segments of Fast DDS that no living process uses."""
    used = ""
    for maps in Path("/proc").glob("[0-9]*/maps"):
        try:
            used += maps.read_text(errors="replace")
        except OSError:
            continue
    return {path.name for path in Path("/dev/shm").glob("*fast*") if str(path) not in used}


def ask(live: SimpleNamespace, service_type: Any, name: str, request: Any, *, again: bool = False) -> Any:
    """Call a service, by a name relative to the test's namespace or an absolute one, and return its answer.

    A server that has just been started may lose its first answer: a question that changes nothing can be put again.
    """
    client = live.node.create_client(service_type, name if name.startswith("/") else f"{live.namespace}/{name}")
    taken_up_s = time.monotonic() + TAKEN_UP_S
    live.spin_until(lambda: time.monotonic() > taken_up_s and client.service_is_ready(), name)
    call = RepeatedCall(client, request) if again else client.call_async(request)
    live.spin_until(call.done, f"the answer of {name}")
    answer = call.result()
    live.node.destroy_client(client)
    return answer


@contextmanager
def live_graph(folder: Path, ros_domain: int) -> Iterator[SimpleNamespace]:
    """A test node with its executor, and processes in a namespace of their own that end with the context."""
    namespace = f"/t{os.getpid()}_{time.monotonic_ns() % 10**9}"
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = rclpy.create_node("probe", namespace=namespace, context=context)
    executor = make_executor(context)
    executor.add_node(node)

    def spin_until(condition: Callable[[], bool], what: str) -> None:
        began_s = time.monotonic()
        while not condition():
            assert within(time.monotonic() - began_s, DEADLINE_S), (
                f"waited {time.monotonic() - began_s:.0f} s for {what}"
            )
            executor.spin_once(timeout_sec=0.05)

    def start(
        names: list[str], parameters: str = "", state: str = "activate", simulated: bool = False,
        autostart: bool = False, station: dict[str, Any] | None = None, processes: int = 1,
    ) -> Any:  # fmt: skip
        """Start nodes with `parameters` (YAML) and with other values for the keys of the description `station`."""
        if station is not None:
            read_station("dss13").write(folder / "station.yaml", station)
        place, target = "dss13" if station is None else str(folder / "station.yaml"), {"source.satellite": "28057"}
        own = {
            f"/**/{name}": {"ros__parameters": {"station": place} | (target if name in TARGETED else {})}
            for name in STATION_NODES.intersection(each.rpartition("/")[2] for each in names)
        }
        files = [folder / "in_use.yaml"]
        files[-1].write_text(yaml.safe_dump(own))
        if parameters:
            files.append(folder / "extra.yaml")
            files[-1].write_text(parameters)
        running = NodeProcesses(namespace, files, folder / "logs", processes=processes)
        started.append(running)
        running.start(names, simulated_time=simulated, autostart=autostart)
        if autostart:
            return running
        client = LifecycleClient(node, namespace, Waiting(lambda s: executor.spin_once(timeout_sec=s), DEADLINE_S))
        client.wait_for(names)
        if state == "start":
            return SimpleNamespace(processes=running, client=client, refused=[])
        refused = client.change(names, "configure")
        if state == "activate" and not refused:
            refused = client.change(names, "activate")
        return SimpleNamespace(processes=running, client=client, refused=refused)

    started: list[NodeProcesses] = []
    try:
        yield SimpleNamespace(node=node, executor=executor, namespace=namespace, spin_until=spin_until, start=start)
    finally:
        for processes in started:
            processes.stop()
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)
    assert processes_of(namespace) == []


@pytest.fixture
def live(tmp_path: Path, ros_domain: int) -> Iterator[SimpleNamespace]:
    """A live graph of one test."""
    with live_graph(tmp_path, ros_domain) as graph:
        yield graph


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
