"""What `track` refuses, in one line that names it, before anything runs or moves."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from .conftest import processes_of, start_track

pytestmark = pytest.mark.graph

DEADLINE_S = 280.0


def test_a_wrong_argument_is_named_in_one_line_and_nothing_is_started(tmp_path: Path) -> None:
    """One that the table of options refuses, one that needs the elements, and one in a user's file."""
    for line, words in (
        ("--speed fast", "speed='fast' must be a factor or max"),
        ("--satellite 14128", "none rises above the mask"),
    ):
        said = refused(*line.split(), "--output", str(tmp_path / "new"))
        assert words in said, said
        assert not (tmp_path / "new").exists()
    file = tmp_path / "mine.yaml"
    file.write_text("/**/antenna_servo: {ros__parameters: {mount: {azimuth_offset_deg: 100.0}}}\n")
    said = refused("--params-file", str(file), "--output", str(tmp_path / "new"))
    assert "antenna_servo: mount.azimuth_offset_deg=100.0 must be <= 5.0" in said, said


def test_a_second_graph_in_a_namespace_names_the_node_and_the_process_of_the_first(
    live: SimpleNamespace, tmp_path: Path
) -> None:
    first = live.start(["simulation_clock"], state="activate")
    said = ended_with_2("--namespace", live.namespace, "--output", str(tmp_path / "second"))
    process = first.processes.process_id("simulation_clock")
    assert f"{live.namespace}/simulation_clock already runs in ROS domain" in said
    assert f"(process {process})" in said
    assert first.processes.ended() == {}
    assert processes_of(live.namespace) == [process]


def ended_with_2(*arguments: str) -> str:
    """Return what `track` says when it ends with exit code 2 while it brings the graph up."""
    run = start_track(*arguments)
    said = run.communicate(timeout=DEADLINE_S)[1]
    assert run.returncode == 2, said
    return said


def refused(*arguments: str) -> str:
    """Return the one line that `track` says of arguments that it refuses with exit code 2, below its usage."""
    *usage, said = ended_with_2(*arguments).strip().splitlines()
    assert not usage or usage[0].startswith("usage: track"), usage
    return said
