"""Message definitions as a bag stores them.

Profiles as a bag stores them.
"""

import json
import os
from pathlib import Path

import pytest
from rosbags.interfaces import QosDurability, QosHistory, QosReliability, QosTime

from rf_pointing.report.definitions import Definitions, definitions
from test.report.conftest import offered_qos


def test_our_types_keep_their_comments_also_inside_other_types(types: Definitions) -> None:
    schema = types.schema("rf_pointing_msgs/msg/PassList")
    assert schema.startswith("# The coming passes")
    assert "MSG: rf_pointing_msgs/Pass\n" in schema
    assert "continuous from aos_azimuth" in schema
    assert "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec" in schema


def test_hash_of_a_standard_type_is_the_one_of_jazzy(types: Definitions) -> None:
    expected = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    assert types.type_hash("sensor_msgs/msg/JointState") == expected


def test_hashes_of_our_types_are_those_of_the_compiled_package(types: Definitions) -> None:
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    shares = [Path(prefix, "share/rf_pointing_msgs/msg") for prefix in prefixes if prefix]
    compiled = [path for share in shares for path in sorted(share.glob("*.json"))]
    if not compiled:
        pytest.skip("rf_pointing_msgs is not installed in this environment")
    for path in compiled:
        described = json.loads(path.read_text())["type_hashes"][0]
        assert types.type_hash(described["type_name"]) == described["hash_string"]


def test_unknown_type_and_a_folder_without_interfaces_are_refused(types: Definitions, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="type_name='rf_pointing_msgs/msg/Nothing'"):
        types.schema("rf_pointing_msgs/msg/Nothing")
    with pytest.raises(ValueError, match="is not an interface package"):
        definitions(tmp_path)


@pytest.mark.parametrize("text", ["float64 [ missing\n", "missing_msgs/Part part\n"])
def test_a_definition_that_cannot_be_read_or_is_not_complete_names_its_type(tmp_path: Path, text: str) -> None:
    (tmp_path / "msg").mkdir()
    (tmp_path / "package.xml").write_text("<package><name>odd_msgs</name></package>")
    (tmp_path / "msg" / "Odd.msg").write_text(text)
    with pytest.raises(ValueError, match="odd_msgs/msg/Odd"):
        definitions(tmp_path).schema("odd_msgs/msg/Odd")


def test_a_profile_is_read_by_its_attributes_and_an_absent_duration_is_infinite() -> None:
    stored = offered_qos(depth=1, durability="TRANSIENT_LOCAL", deadline_ns=500_000_000)
    assert (stored.history, stored.depth) == (QosHistory.KEEP_LAST, 1)
    assert stored.reliability is QosReliability.RELIABLE
    assert stored.durability is QosDurability.TRANSIENT_LOCAL
    assert stored.deadline == QosTime(0, 500_000_000)
    assert stored.lifespan == QosTime(9223372036, 854775807)
