"""What `track` refuses, in one line that names it, before anything runs or moves."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements

from .conftest import processes_of, start_track

pytestmark = pytest.mark.graph

DEADLINE_S = 280.0


@pytest.fixture(scope="module")
def elements(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """Files of elements: good ones of long ago, and some with a digit changed."""
    folder = tmp_path_factory.mktemp("elements")
    lines = tle_lines(find_elements(verification_elements(), "28057"))
    (folder / "good.tle").write_text("\n".join(lines))
    (folder / "changed.tle").write_text("\n".join(lines).replace("98.", "97.", 1))
    (folder / "cut.tle").write_text(lines[0] + "\n" + lines[1][:50])
    (folder / "empty.tle").write_text("")
    return SimpleNamespace(**{path.stem: str(path) for path in folder.iterdir()})


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--satellite 99999998", "satellite='99999998' is not among"),
        ("--station Nowhere", "Nowhere:1: no such file, and no shipped station"),
        ("--band Q", "band='Q' of Goldstone DSS-13 must be one of S, X, Ka"),
        ("--start 2012-01-01", "days from the epoch 2006-06-26"),
        ("--start 2001-01-01", "days from the epoch 2006-06-26"),
        ("--start tomorrow", "start='tomorrow' must be an ISO time"),
        ("--elements {good} --start 2006-08-01", "days from the epoch 2006-06-26"),
        ("--elements {changed}", "changed.tle: .*checksum"),
        ("--elements {cut}", "cut.tle: "),
        ("--elements {empty}", "empty.tle: "),
        ("--elements /nowhere.tle", "elements='/nowhere.tle' does not exist"),
        ("--satellite 14128", "none rises above the mask"),
        ("--min-peak 89.99", "has no pass above 89.99 deg"),
        ("--speed nan", "speed=nan must be between"),
        ("--speed fast", "speed='fast' must be a factor or max"),
    ],
)
def test_a_wrong_argument_is_named_in_one_line_and_nothing_is_started(
    line: str, words: str, elements: SimpleNamespace, tmp_path: Path
) -> None:
    arguments = line.format(**vars(elements)).split()
    said = refused(*arguments, "--output", str(tmp_path / "new"))
    assert re.search(words, said), said
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("/**/antenna_servo: {ros__parameters: {safety: {gate: {hard_deg: 1.0}}}}", "station description: tuning"),
        (
            "/**/antenna_servo: {ros__parameters: {mount: {azimuth_offset_deg: 100.0}}}",
            "antenna_servo: mount.azimuth_offset_deg=100.0 must be <= 5.0",
        ),
        ("/**/antenna_srvo: {ros__parameters: {wind: {mean_speed_m_s: 1.0}}}", "antenna_srvo is not a node; there are"),
        (
            "/**/rf_receiver: {ros__parameters: {signal: {seed: 3}}}",
            "rf_receiver signal.seed: given by the command line",
        ),
    ],
)
def test_what_a_parameter_file_cannot_set_is_refused_before_anything_starts(
    tmp_path: Path, text: str, words: str
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text + "\n")
    assert words in refused("--params-file", str(file), "--output", str(tmp_path / "new"))


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
    """Return the one line that `track` says of arguments that it refuses with exit code 2."""
    said = ended_with_2(*arguments)
    assert len(said.strip().splitlines()) == 1, said
    return said


def test_an_existing_bag_directory_is_refused(tmp_path: Path) -> None:
    assert "exists already" in refused("--record", str(tmp_path))
    (tmp_path / "bag").mkdir()
    assert "holds a bag already" in refused("--output", str(tmp_path))
