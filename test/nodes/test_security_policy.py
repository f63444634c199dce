"""config/sros2/gs1.xml allows each node what it has in the graph, and no more."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType

import pytest

from test.scripts import script_module

ROOT = Path(__file__).parents[2]
SHIPPED = ROOT / "config" / "sros2" / "gs1.xml"
NAMES = {
    "topics": ("topic", {"publish", "subscribe"}),
    "services": ("service", {"reply", "request"}),
    "actions": ("action", {"call", "execute"}),
}
"""Elements of a profile in the schema 0.2.0 of sros2, what they hold, and their attributes."""


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return script_module("scripts/security_policy.py")


def rules(node: str) -> dict[str, set[str]]:
    """Return the names that the shipped policy allows a node, by rule."""
    (profile,) = ET.parse(SHIPPED).findall(f".//enclave[@path='/gs1/{node}']/profiles/profile")
    return {rule: {each.text or "" for each in listed} for listed in profile for rule in listed.attrib}


def test_the_shipped_policy_is_what_the_nodes_have_in_the_graph(script: ModuleType, ros_domain: int) -> None:
    made = script.policy_xml(script.NAMESPACE, script.station_policy(script.NAMESPACE))
    assert SHIPPED.read_text() == made, "run scripts/run-python scripts/security_policy.py > config/sros2/gs1.xml"


def test_the_policy_has_the_shape_of_its_schema() -> None:
    root = ET.parse(SHIPPED).getroot()
    assert (root.tag, root.attrib, [each.tag for each in root]) == ("policy", {"version": "0.2.0"}, ["enclaves"])
    for each in root[0]:
        assert (each.tag, set(each.attrib), [child.tag for child in each]) == ("enclave", {"path"}, ["profiles"])
        (profile,) = each[0]
        assert (profile.tag, set(profile.attrib)) == ("profile", {"ns", "node"})
        for listed in profile:
            name, allowed = NAMES[listed.tag]
            assert set(listed.attrib) <= allowed
            assert set(listed.attrib.values()) == {"ALLOW"}
            assert listed, "an empty list is none of the schema"
            assert all(child.tag == name and (child.text or "").startswith("/") for child in listed)


def test_only_the_commanders_may_move_the_antenna() -> None:
    commanders = {"pointing_controller", "rotctld_server"}
    nodes = {each.get("path", "").rpartition("/")[2] for each in ET.parse(SHIPPED).iter("enclave")}
    assert {node for node in nodes if "/gs1/joint_trajectory" in rules(node).get("publish", ())} == commanders
    assert {node for node in nodes if "/gs1/antenna_servo/signed" in rules(node).get("request", ())} == {
        "operator", "operator_page", "rotctld_server", "station_executive",
    }  # fmt: skip
    assert not rules("operator")["publish"] - {"/rosout", "/parameter_events"}


def test_an_action_is_named_at_the_namespace_or_below_the_node_that_serves_it_as_the_page_says() -> None:
    text = (ROOT / "docs" / "nodes_and_topics.md").read_text().partition("\n## Actions\n")[2].partition("\n### ")[0]
    listed = dict(re.findall(r"^\| `(\S+)` \| (\w+) \|", text, re.MULTILINE))
    enclaves = [each.attrib["path"].removeprefix("/gs1/") for each in ET.parse(SHIPPED).iter("enclave")]
    served = {
        action.removeprefix("/gs1/"): node
        for node in enclaves
        for action in (each.text or "" for rule in ET.parse(SHIPPED).findall(
            f".//enclave[@path='/gs1/{node}']//actions[@execute='ALLOW']") for each in rule)
    }  # fmt: skip
    assert served == listed
    for action, node in served.items():
        # Where other names of the node stand: what works on its own store is below it, as services are.
        assert action in ("track_pass", "scan", "run_schedule", "identify") or action.startswith(f"{node}/"), action
