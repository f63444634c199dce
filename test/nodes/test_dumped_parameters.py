"""A dump of a node's parameters starts the same node again; a name that does not exist is refused with the nearest one."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.signals import SignalHandlerOptions

from rf_pointing.commands import check_drive, plan_passes
from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.station_node import StationNode
from rf_pointing.simulation.pass_simulation import StationSetup
from rf_pointing.station.description import STATIONS, read_station, shipped_stations
from rf_pointing.station.description.description import OF_EVERY_NODE, require_known

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
import parameter_page

KINDS = parameter_page.node_classes()
OF_STATION = [kind for kind in KINDS if "array_sensors" not in kind.__module__]
UNCONFIGURED = LifecycleState(state_id=1, label="unconfigured")


class Started:
    """A node under `/gs1` with these arguments, and a client of its parameter services."""

    def __init__(self, kind: type[ManagedNode], domain: int, *arguments: str) -> None:
        # `start_parameter_services` of rclpy: what the genuine command line uses.
        rclpy.init(args=["--ros-args", "-r", "__ns:=/gs1", *arguments], domain_id=domain,
                   signal_handler_options=SignalHandlerOptions.NO)  # fmt: skip
        try:
            self.node = kind()
        except Exception:
            rclpy.shutdown()
            raise
        self.client_node = Node("dump", use_global_arguments=False)
        self.client = AsyncParameterClient(self.client_node, self.node.get_fully_qualified_name())
        self.executor = SingleThreadedExecutor()
        for each in (self.node, self.client_node):
            self.executor.add_node(each)

    def answer(self, future: Any) -> Any:
        for _ in range(3000):
            self.executor.spin_once(timeout_sec=0.01)
            if future.done():
                return future.result()
        raise AssertionError("no answer of the parameter service")

    def dump(self) -> dict[str, Any]:
        """Return every parameter as `ros2 param dump` gets it."""
        for _ in range(3000):
            self.executor.spin_once(timeout_sec=0.01)
            if self.client.services_are_ready():
                break
        names = sorted(self.answer(self.client.list_parameters()).result.names)
        values = self.answer(self.client.get_parameters(names)).values
        return {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=True)}

    def close(self) -> None:
        self.executor.shutdown()
        self.node.end()
        self.node.lock.release()
        for each in (self.node, self.client_node):
            each.destroy_node()
        rclpy.shutdown()


@pytest.fixture
def started(ros_domain: int) -> Iterator[Callable[..., Started]]:
    """Yield a maker of nodes; the one before is closed first."""
    made: list[Started] = []

    def make(kind: type[ManagedNode], *arguments: str) -> Started:
        if made:
            made.pop().close()
        made.append(Started(kind, ros_domain, *arguments))
        return made[-1]

    yield make
    for each in made:
        each.close()


def nested(flat: dict[str, Any]) -> dict[str, Any]:
    """The form of `ros2 param dump`: a mapping for each part of a name."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *parents, last = name.split(".")
        below = tree
        for parent in parents:
            below = below.setdefault(parent, {})
        below[last] = list(value) if hasattr(value, "tolist") or isinstance(value, tuple) else value
    return tree


def written(path: Path, node: str, flat: dict[str, Any]) -> Path:
    path.write_text(yaml.safe_dump({node: {"ros__parameters": nested(flat)}}))
    return path


def refusal(station: str, node: str) -> str:
    """Return why a node refuses the mount of a station, "" if it takes it."""
    try:
        read_station(station).require_mount(node)
    except ValueError as error:
        return str(error)
    return ""


SHIPPED = shipped_stations()
CASES = [
    # Each kind of node on two stations, each station with several kinds.
    *(
        (kind, SHIPPED[(number + apart) % len(SHIPPED)])
        for number, kind in enumerate(kind for kind in KINDS if issubclass(kind, StationNode))
        for apart in (0, 3)
    ),
    *((kind, "") for kind in KINDS if not issubclass(kind, StationNode)),
]


@pytest.mark.parametrize(("kind", "station"), CASES, ids=lambda each: getattr(each, "__name__", each or "-"))
def test_a_dump_gives_the_same_node_back(
    kind: type[ManagedNode], station: str, started: Callable[..., Started], tmp_path: Path
) -> None:
    first = started(kind, *(["-p", f"station:={station}"] if station else []))
    name = first.node.get_name()
    if station and (refused := refusal(station, name)):
        assert first.node.parameters.reasons == [refused]
        return
    dumped = first.dump()
    assert len(dumped) > 3
    file = written(tmp_path / "dump.yaml", first.node.get_fully_qualified_name(), dumped)
    second = started(kind, "--params-file", str(file))
    assert second.node.parameters.reasons == []
    second.node.parameters.refuse_unknown()
    assert second.node.parameters.reasons == []
    again = second.dump()
    assert {name: as_plain(value) for name, value in again.items()} == {
        name: as_plain(value) for name, value in dumped.items()
    }
    if station:
        # The numbers of the description are in force, as `ros2 param get` reads them back.
        wanted = read_station(station).parameters(second.node.get_name())
        assert {name: as_plain(dumped[name]) for name in wanted} == {
            name: as_plain(each) for name, each in wanted.items()
        }
        # A simulation without ROS takes the same file.
        read_station(station).check_file(second.node.get_name(), read_parameter_files([file])[second.node.get_name()])


def as_plain(value: Any) -> Any:
    return list(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value


NEAREST = "no such parameter of antenna_servo; did you mean wrap_file?"


def test_a_node_refuses_an_unknown_name_with_the_nearest(started: Callable[..., Started]) -> None:
    subject = started(AntennaServo, "-p", "station:=dss13", "-p", "wrap_fil:=x")
    assert subject.node.on_configure(UNCONFIGURED) == TransitionCallbackReturn.FAILURE
    assert subject.node.parameters.reasons == [f"wrap_fil: {NEAREST}"]
    subject.dump()
    (result,) = subject.answer(subject.client.set_parameters([Parameter("wrapfile", value="x")])).results
    assert (result.successful, result.reason) == (False, f"wrapfile: {NEAREST}")


def test_without_ros_an_unknown_name_is_refused_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path / "own.yaml", "/**/antenna_servo", {"drive.tpye": "hamlib", "wrap_fil": "x"})
    for use in (lambda: StationSetup(files=[file]), lambda: check_drive.read_drive([file])):
        with pytest.raises(ValueError, match=r"antenna_servo: no such parameter drive.tpye; did you mean drive.type\?"):
            use()
    with pytest.raises(ValueError, match=r"antena_servo is not a node of a station; did you mean antenna_servo\?"):
        require_known("antena_servo", [])
    station = tmp_path / "stations" / "dish.yaml"
    station.parent.mkdir()
    text = (STATIONS / "leo_3m7.yaml").read_text()
    station.write_text(text + "\ntuning:\n  machine.sun_radus_deg: 2.0\n")
    with pytest.raises(SystemExit) as ended:
        plan_passes.main(["--station", str(station)])
    assert ended.value.code == 2
    assert (
        "tuning.machine.sun_radus_deg: no parameter of that name; did you mean machine.sun_radius_deg?"
        in capsys.readouterr().err
    )


def test_what_is_known_without_ros_is_what_the_nodes_declare(ros_domain: int) -> None:
    for node, rows in parameter_page.declarations().items():
        declared = {row.name for row in rows}
        if node in {kind.__module__.rsplit(".", 1)[-1] for kind in OF_STATION}:
            require_known(node, declared)
            for name in ("wrap_file", "certificate_folder", "publisher.span_s"):
                if name not in declared:
                    with pytest.raises(ValueError, match="no such parameter"):
                        require_known(node, [name])
            assert declared & set(OF_EVERY_NODE)
