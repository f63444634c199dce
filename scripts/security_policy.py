"""Print the SROS2 policy of a station: what each node publishes, receives, serves and calls.

    scripts/run-python scripts/security_policy.py [--namespace /gs1] [--station FILE] > policy.xml

Every node of the station is made and configured, and what it has then in the graph is its enclave
NAMESPACE/NODE; nothing else is allowed there.  An operator's enclave receives and calls everything.
Without --station the policy is that of `STATIONS`: config/sros2/gs1.xml, which a test compares with
the nodes.
"""

import argparse
import gc
import importlib.util
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
import yaml
from rclpy.action.graph import get_action_client_names_and_types_by_node, get_action_server_names_and_types_by_node
from rclpy.signals import SignalHandlerOptions

from rf_pointing.ros.graph import (
    ALARMS,
    ARRAY_NODES,
    DESCRIPTION,
    DESIGNATE,
    EXECUTIVE,
    NODES,
    OPERATOR_PAGE,
    RADIO,
    RECEIVER_NODES,
    ROTCTLD,
)
from rf_pointing.ros.leased_services import LEASED, SIGNED
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.station.description import read_station

NAMESPACE = "/gs1"
OF_STATION = (
    *NODES, *ARRAY_NODES, *RECEIVER_NODES, DESIGNATE, EXECUTIVE, ALARMS, RADIO, ROTCTLD, DESCRIPTION, OPERATOR_PAGE,
)  # fmt: skip
WITHOUT_STATION = ("simulation_clock", OPERATOR_PAGE)
ON_A_DRIVE: dict[str, Any] = {"drive.type": "simulated_rotator", "wind.anemometer": True}
WITH_A_RADIO: dict[str, Any] = {"radio.transponders.any.downlink_mhz": 2250.0}
STATIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("dss13", WITH_A_RADIO), ("leo_3m7", ON_A_DRIVE | {"receiver.type": "rtl_tcp"}),
)  # fmt: skip
DRIVE_TOPICS = (
    ("publish", "drive/set_point"),
    ("publish", "drive/enable"),
    ("subscribe", "drive/state"),
    ("publish", "second_stage/command"),
    ("subscribe", "second_stage/state"),
)
"""Topics of a drive of the type `topic`, which waits for its driver's first message."""
OPERATOR = "operator"
GRAPH_WITHIN_S = 30.0
"""Discovery brings what is made and what is freed into the graph a moment later."""
RULES = {"topic": ("publish", "subscribe"), "service": ("reply", "request"), "action": ("execute", "call")}
"""Who offers is named first."""


@dataclass
class Access:
    """The names that one enclave may use, by what it does with them."""

    names: dict[str, set[str]] = field(
        default_factory=lambda: {rule: set() for pair in RULES.values() for rule in pair}
    )

    def add(self, rule: str, names: Iterable[str]) -> None:
        """Add what does not belong to an action, which has a rule of its own."""
        self.names[rule] |= {name for name in names if "/_action/" not in name}


def made(node: Any) -> dict[str, set[str]]:
    """Return the names of what the node made through rclpy, without actions and what ROS adds."""
    return {
        "publish": {each.topic_name for each in node.publishers},
        "subscribe": {each.topic_name for each in node.subscriptions if "/_action/" not in each.topic_name},
        "reply": {each.service_name for each in node.services},
        "request": {each.service_name for each in node.clients},
    }


def accesses(node: Any) -> Access:
    """Return what a configured node has in the graph.

    An earlier node of its name stays there until the collector has freed it, and hides this one.
    Raises ValueError where a name is missing after `GRAPH_WITHIN_S`.
    """
    gc.collect()
    until = time.monotonic() + GRAPH_WITHIN_S
    while True:
        found = in_graph(node)
        # Who takes the feedback of another one's goals is allowed what its client is.
        found.add("call", {each.topic_name.partition("/_action/")[0] for each in node.subscriptions
                           if "/_action/" in each.topic_name})  # fmt: skip
        missing = {name for rule, names in made(node).items() for name in names - found.names[rule]}
        if not missing:
            return found
        if time.monotonic() > until:
            raise ValueError(f"{node.get_name()}: {min(missing)} is not in the graph after {GRAPH_WITHIN_S:g} s")
        time.sleep(0.01)


def in_graph(node: Any) -> Access:
    """Return what the graph has of a node at this moment."""
    found = Access()
    looks = {
        "publish": node.get_publisher_names_and_types_by_node,
        "subscribe": node.get_subscriber_names_and_types_by_node,
        "reply": node.get_service_names_and_types_by_node,
        "request": node.get_client_names_and_types_by_node,
        "execute": partial(get_action_server_names_and_types_by_node, node),
        "call": partial(get_action_client_names_and_types_by_node, node),
    }
    for rule, look in looks.items():
        found.add(rule, (name for name, _ in look(node.get_name(), node.get_namespace())))
    return found


def node_classes() -> list[type[ManagedNode]]:
    """Return the class of every managed node of the package."""
    spec = importlib.util.spec_from_file_location("parameter_page", Path(__file__).with_name("parameter_page.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    found: list[type[ManagedNode]] = module.node_classes()
    return found


@contextmanager
def ros(namespace: str, station: Path) -> Iterator[None]:
    """Give every node that is made meanwhile the namespace and the station."""
    given: dict[str, Any] = {
        f"/**/{name}": {"station": str(station)} for name in OF_STATION if name not in WITHOUT_STATION
    }
    given[f"/**/{OPERATOR_PAGE}"] = {"page.port": 0}
    given["/**"] = {"use_sim_time": True}
    given["/**/ephemeris_publisher"] |= {"source.refraction": "measured", "source.satellite": "Moon"}
    given["/**/rf_receiver"]["source.satellite"] = "Moon"
    # One of two controllers has all that the only one has.
    given["/**/pointing_controller"]["lifecycle.standby"] = "first"
    given[f"/**/{EXECUTIVE}"]["executive.folder"] = str(station.with_suffix(""))
    given[f"/**/{ALARMS}"]["folder"] = str(station.with_suffix(""))
    file = station.with_suffix(".parameters.yaml")
    file.write_text(yaml.safe_dump({name: {"ros__parameters": values} for name, values in given.items()}))
    rules = ["-r", f"__ns:={namespace}", "-r", "/clock:=clock", "--params-file", str(file), "--log-level", "FATAL"]
    rclpy.init(args=["--ros-args", *rules], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()


def collect(namespace: str, station: Path, policy: dict[str, Access]) -> None:
    """Add to `policy` what the nodes of a station do; ValueError if one cannot be configured."""
    with ros(namespace, station):
        for kind in node_classes():
            if kind.__module__.rpartition(".")[2] not in OF_STATION:
                continue
            node = kind()
            try:
                node.trigger_configure()
                # Only a station with an array, or with a receiver, has these.
                if node._state_name != "inactive" and node.get_name() not in (*ARRAY_NODES, *RECEIVER_NODES, RADIO):
                    raise ValueError(f"{node.get_name()}: {node._state_health().message}")
                own = policy.setdefault(node.get_name(), Access())
                for rule, names in accesses(node).names.items():
                    own.add(rule, names)
            finally:
                node.end()
                node.lock.release()
                node.destroy_node()


def station_policy(namespace: str, station: str = "") -> dict[str, Access]:
    """Return what each node may use, by enclave, on one station or on all of `STATIONS`."""
    policy: dict[str, Access] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, changes) in enumerate(((station, {}),) if station else STATIONS):
            path = Path(folder) / f"{number}.yaml"
            read_station(name).write(path, changes)
            collect(namespace, path, policy)
    for rule, name in DRIVE_TOPICS:
        policy["antenna_servo"].add(rule, [f"{namespace}/{name}"])
    for access in policy.values():
        # Who has the key of the commands signs the same calls.
        if access.names["request"] & {f"{namespace}/{name}" for name in LEASED}:
            access.add("request", [f"{namespace}/{SIGNED}"])
    operator = policy[OPERATOR] = Access()
    for node in policy.copy().values():
        for offered, used in RULES.values():
            operator.add(used, node.names[offered])
    operator.add("publish", ["/rosout", "/parameter_events"])
    # It records every topic of a pass.
    policy[EXECUTIVE].add("subscribe", operator.names["subscribe"])
    return dict(sorted(policy.items()))


def policy_xml(namespace: str, policy: dict[str, Access]) -> str:
    """Return the policy as `ros2 security` reads it, version 0.2.0 of its schema."""
    root = ET.Element("policy", version="0.2.0")
    enclaves = ET.SubElement(root, "enclaves")
    for name, access in policy.items():
        profiles = ET.SubElement(ET.SubElement(enclaves, "enclave", path=f"{namespace}/{name}"), "profiles")
        profile = ET.SubElement(profiles, "profile", ns=namespace, node=name)
        for kind, rules in RULES.items():
            for rule in rules:
                if access.names[rule]:
                    listed = ET.SubElement(profile, f"{kind}s", {rule: "ALLOW"})
                    for each in sorted(access.names[rule]):
                        ET.SubElement(listed, kind).text = each
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def main() -> None:
    """Print the policy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--namespace", default=NAMESPACE)
    parser.add_argument("--station", default="", help="name or file of the description (default: all that are shipped)")
    options = parser.parse_args()
    print(policy_xml(options.namespace, station_policy(options.namespace, options.station)), end="")


if __name__ == "__main__":
    main()
