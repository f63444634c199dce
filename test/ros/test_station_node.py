"""A node of a station begins with the description's numbers, and different descriptions do not track together."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.parameter import Parameter
from rf_pointing_msgs.msg import StationInUse

from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.planning import AxisLimits
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.params import ParameterGroups
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.station_watches import CLOCK_AGE_S, StationCensus
from rf_pointing.station.derive.nodes import NODES
from rf_pointing.station.description import owner, read_station, shipped_stations

CONTROLLER = "pointing_controller"
MakeNode = Callable[..., Any]


def limits_of(node: Any, station: str = "dss13") -> ParameterGroups:
    groups = ParameterGroups(node)
    groups.take_station(read_station(station).parameters(CONTROLLER), lambda name: owner(CONTROLLER, name))
    groups.declare("limits", AxisLimits(), live=True)
    return groups


def test_a_file_cannot_set_what_the_description_gives_and_says_where_it_is_given(make_node: MakeNode) -> None:
    node = make_node(given={"limits.azimuth_min_deg": -10.0})
    groups = limits_of(node)
    assert groups.reasons == ["limits.azimuth_min_deg is given by the station description: mount.azimuth.travel_deg"]
    assert node.get_parameter("limits.azimuth_min_deg").value == -220.0


def test_what_may_change_while_the_node_runs_still_may(make_node: MakeNode) -> None:
    node = make_node()
    groups = limits_of(node)
    (result,) = node.set_parameters([Parameter("limits.azimuth_min_deg", value=-100.0)])
    assert result.successful
    assert groups.station_key("limits.azimuth_min_deg") == "mount.azimuth.travel_deg"


BAD = {
    "unknown to all": "tuning: {machne.reserve: 0.2}",
    "of the controller": "tuning: {machine.reserve: 2.0}",
    "of the tracker": "tuning: {monopulse.slope: 9.0}",
}


@pytest.mark.parametrize(
    ("problem", "node", "refused"),
    [
        ("unknown to all", CONTROLLER, "machne.reserve: no parameter of that name"),
        ("of the controller", CONTROLLER, "machine.reserve=2.0 must be <= 0.5"),
        ("of the controller", "monopulse_tracker", ""),
        ("of the tracker", CONTROLLER, "monopulse.slope=9.0 must be"),
        ("of the tracker", "monopulse_tracker", "monopulse.slope=9.0 must be"),
    ],
)
def test_a_node_refuses_what_concerns_it_and_the_controller_everything(
    problem: str, node: str, refused: str, tmp_path: Path
) -> None:
    file = tmp_path / "dish.yaml"
    read_station("rotator_2m").write(file, {})
    file.write_text(file.read_text() + BAD[problem] + "\n")
    nodes = tuple(NODES) if node == CONTROLLER else (node,)
    if not refused:
        assert read_station(file, nodes).sets(node)
        return
    with pytest.raises(ValueError, match=refused):
        read_station(file, nodes)


def in_use(node: str, digest: str = "a" * 16, band: str = "X") -> StationInUse:
    return StationInUse(node=node, station="Dish", band=band, digest=digest)


def graph(*names: str) -> SimpleNamespace:
    """A controller that sees these nodes of its namespace publish."""
    return SimpleNamespace(
        get_fully_qualified_name=lambda: "/gs1/pointing_controller",
        get_publishers_info_by_topic=lambda _: [SimpleNamespace(node_name=n, node_namespace="/gs1") for n in names],
    )


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (
            in_use("/gs1/rf_receiver", digest="b" * 16),
            "rf_receiver on Dish, X band, digest bbbbbbbbbbbb; this node on Dish",
        ),
        (in_use("/gs1/rf_receiver", band="S"), "rf_receiver on Dish, S band"),
        (in_use("/gs1/rf_receiver"), ""),
    ],
)
def test_nodes_on_another_description_or_band_are_named(other: StationInUse, words: str) -> None:
    census = StationCensus()
    for message in (in_use("/gs1/pointing_controller"), other):
        census.note(message)
    found = census.difference(graph("pointing_controller", "rf_receiver"))
    assert words in found if words else found == ""


def test_what_a_node_that_has_ended_ran_on_does_not_count() -> None:
    census = StationCensus()
    for message in (in_use("/gs1/pointing_controller"), in_use("/gs1/rf_receiver", digest="b" * 16)):
        census.note(message)
    assert census.difference(graph("pointing_controller")) == ""


@pytest.mark.parametrize("name", shipped_stations())
def test_a_copy_with_changes_differs_in_them_alone(tmp_path: Path, name: str) -> None:
    station, copy = read_station(name), tmp_path / "copy.yaml"
    station.write(copy, {})
    assert read_station(copy).digest == station.digest
    station.write(copy, {"mount.pass_elevation_deg": 21.0, "tuning.spiral.rate_deg_s": 0.01})
    changed = read_station(copy)
    assert changed.digest != station.digest
    for node in (CONTROLLER, "ephemeris_publisher", "antenna_servo"):
        before, after = station.parameters(node), changed.parameters(node)
        differing = {each for each in before if before[each] != after[each]}
        assert differing <= {"publisher.mask_deg", "spiral.rate_deg_s", "pointing.on_target_deg"}, node


def sent(name: str, stamp_s: float) -> DiagnosticArray:
    message = DiagnosticArray(status=[DiagnosticStatus(hardware_id=name)])
    message.header.stamp = stamp_from_seconds(stamp_s)
    return message


def test_a_clock_that_differs_is_named_with_its_size_and_delays_are_none(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(PointingControllerNode)
    assert bench.step("configure")

    def give(**ahead_s: float) -> Any:
        for delay_s in (0.001, 0.4, 0.002, 0.9, 0.003, 0.05):
            for name, offset_s in ahead_s.items():
                bench.give("/diagnostics", sent(f"/{name}", bench.t_s + offset_s - delay_s))
        return bench.health("clocks")

    for _ in range(4):
        bench.give("/diagnostics", sent("/seldom", bench.t_s + 1.0))
    health = give(same_computer=0.0, ahead=0.05, behind=-0.2)
    assert health.message == (
        "the clock of ahead is 49 ms ahead of this computer's; "
        "the clock of behind is 201 ms behind this computer's, or its messages are late"
    )
    assert health.values == {"offset_ms ahead": "49.0", "offset_ms behind": "-201.0", "offset_ms same_computer": "-1.0"}
    # Messages of half a minute ago tell nothing of now.
    levels = [health.level]
    for offsets_s in ({"ahead": 0.05}, {"same_computer": 0.0}):
        bench.wait(CLOCK_AGE_S + 1.0)
        levels.append(give(**offsets_s).level)
    assert levels == [ERROR, WARN, OK]
    # This node takes all of them late, its own as well.
    bench.wait(CLOCK_AGE_S + 1.0)
    health = give(pointing_controller=-0.15, same_computer=-0.16, ahead=0.05)
    assert health.values == {"offset_ms ahead": "49.0", "offset_ms same_computer": "-10.0"}
