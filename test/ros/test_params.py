"""ROS parameters mirror the core's sets: described, bounded, set atomically, in degrees outside and radians inside."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter

from rf_pointing.core import Params, leaves, parameter
from rf_pointing.ros.params import ParameterGroups


@dataclass(frozen=True, kw_only=True)
class Loop(Params):
    """Set inside a set."""

    gain: float = parameter(0.5, "gain", low=0.0, high=50.0)


@dataclass(frozen=True, kw_only=True)
class Axis(Params):
    """Every kind of field."""

    low_rad: float = parameter(-0.5, "lower end", low=-2.0, high=2.0)
    high_rad: float = parameter(0.5, "upper end", low=-2.0, high=2.0)
    open_s: float = parameter(1.0, "no bounds")
    count: int = parameter(3, "how many", low=1, high=9)
    kind: str = parameter("a", "kind", choices=("a", "b"))
    on: bool = parameter(True, "switch")
    rates_rad_s: tuple[float, float] = parameter((0.1, 0.2), "rates", low=0.0, high=1.0)
    loop: Loop = parameter(Loop(), "loop")

    def check_together(self) -> None:
        """Refuse an empty travel."""
        if self.low_rad >= self.high_rad:
            raise ValueError(f"low_rad={self.low_rad} must be < high_rad={self.high_rad}")


NAMES = ["low_deg", "high_deg", "open_s", "count", "kind", "on", "rates_deg_s", "loop.gain"]
MakeNode = Callable[..., Any]


def groups(node: Any) -> ParameterGroups:
    made = ParameterGroups(node)
    made.declare("axis", Axis())
    return made


def unchanged(made: ParameterGroups) -> bool:
    """Whether the set is the default, apart from the rounding of degrees."""
    present, default = (
        {name: value for name, (_, value) in leaves(axis).items()} for axis in (made.value("axis"), Axis())
    )
    return all(present[k] == (pytest.approx(v, rel=1e-14) if k.endswith("_deg_s") else v) for k, v in default.items())


def set_all(node: Any, **values: Any) -> Any:
    return node.set_parameters_atomically(
        [Parameter(f"axis.{k.replace('__', '.')}", value=v) for k, v in values.items()]
    )


def test_every_field_is_declared_with_description_and_unit(make_node: MakeNode) -> None:
    node = make_node()
    groups(node)
    texts = {name: node.describe_parameter(f"axis.{name}").description for name in NAMES}
    assert texts["low_deg"] == "lower end [deg]"
    assert texts["open_s"] == "no bounds [s]"
    assert texts["loop.gain"] == "gain [1]"
    assert texts["rates_deg_s"] == "rates [deg/s]"


def test_every_number_has_a_range_in_edge_units(make_node: MakeNode) -> None:
    node = make_node()
    groups(node)
    (low,) = node.describe_parameter("axis.low_deg").floating_point_range
    assert (low.from_value, low.to_value) == pytest.approx((math.degrees(-2.0), math.degrees(2.0)))
    (count,) = node.describe_parameter("axis.count").integer_range
    assert (count.from_value, count.to_value) == (1, 9)
    assert node.describe_parameter("axis.open_s").floating_point_range, "a range keeps NaN out"
    assert (
        node.describe_parameter("axis.kind").additional_constraints == "one of a, b; read when the node is configured"
    )
    assert node.describe_parameter("axis.on").type == ParameterType.PARAMETER_BOOL


def test_given_values_reach_the_core_in_radians(make_node: MakeNode) -> None:
    made = groups(make_node(given={"axis.high_deg": 45.0, "axis.rates_deg_s": [1.0, 2.0], "axis.loop.gain": 7.0}))
    axis = made.value("axis")
    assert made.reasons == []
    assert axis.high_rad == pytest.approx(math.pi / 4.0)
    assert axis.rates_rad_s == pytest.approx((math.radians(1.0), math.radians(2.0)))
    assert axis.loop.gain == 7.0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"axis.high_deg": 200.0}, ["axis.high_deg", "114.59"]),
        ({"axis.high_deg": math.nan}, ["axis.high_deg", "nan"]),
        ({"axis.open_s": math.nan}, ["axis.open_s", "nan"]),
        ({"axis.high_deg": 1}, ["axis.high_deg", "DOUBLE"]),
        ({"axis.count": 10}, ["axis.count", "9"]),
        ({"axis.rates_deg_s": [1.0, math.nan]}, ["axis.rates_deg_s[1]=nan must be finite"]),
        ({"axis.low_deg": 60.0}, ["axis.low_rad=1.047", "must be < high_rad=0.5"]),
    ],
)
def test_a_refused_value_of_a_file_is_noted_with_key_and_bound(
    make_node: MakeNode, given: dict[str, Any], words: list[str]
) -> None:
    made = groups(make_node(given=given))
    text = "; ".join(made.reasons)
    assert all(word in text for word in words), text
    assert unchanged(made)


def test_unknown_keys_are_noted_and_standard_ones_are_not(make_node: MakeNode) -> None:
    made = groups(make_node(given={"axis.hihg_deg": 1.0, "use_sim_time": False}))
    made.refuse_unknown()
    assert made.reasons == ["axis.hihg_deg: no such parameter of subject; did you mean axis.high_deg?"]


def test_a_change_reaches_core_and_listeners_once(make_node: MakeNode) -> None:
    node = make_node()
    made = groups(node)
    heard: list[float] = []
    made.on_change(lambda: heard.append(made.value("axis").loop.gain))
    assert set_all(node, loop__gain=2.0, high_deg=50.0).successful
    assert heard == [2.0]
    assert made.value("axis").high_rad == pytest.approx(math.radians(50.0))
    assert node.get_parameter("axis.loop.gain").value == 2.0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"loop__gain": 2.0, "high_deg": 200.0}, ["axis.high_deg", "114.59"]),
        ({"loop__gain": 2.0, "low_deg": 60.0}, ["axis.low_rad", "high_rad"]),
        ({"loop__gain": 2.0, "kind": "c"}, ["axis.kind='c'", "a, b"]),
        ({"loop__gain": 2.0, "rates_deg_s": [1.0]}, ["axis.rates_deg_s", "2 values"]),
        ({"loop__gain": math.nan}, ["axis.loop.gain", "nan"]),
        ({"loop__gain": "high"}, ["Wrong parameter type, expected 'Type.DOUBLE' got 'Type.STRING'"]),
        ({"count": 3.0}, ["Wrong parameter type, expected 'Type.INTEGER' got 'Type.DOUBLE'"]),
    ],
)
def test_a_refused_change_leaves_every_set_as_it_was(
    make_node: MakeNode, values: dict[str, Any], words: list[str]
) -> None:
    node = make_node()
    made = groups(node)
    result = set_all(node, **values)
    assert not result.successful
    assert all(word in result.reason for word in words), result.reason
    assert unchanged(made)
    assert node.get_parameter("axis.loop.gain").value == 0.5


def test_a_parameter_cannot_be_deleted(make_node: MakeNode) -> None:
    node = make_node()
    made = groups(node)
    result = node.set_parameters_atomically([Parameter("axis.loop.gain", Parameter.Type.NOT_SET)])
    assert not result.successful
    assert unchanged(made)


def test_a_change_spanning_two_sets_is_all_or_nothing(make_node: MakeNode) -> None:
    node = make_node()
    made = groups(node)
    made.declare("other", Loop())
    changes = [Parameter("other.gain", value=9.0), Parameter("axis.low_deg", value=60.0)]
    assert not node.set_parameters_atomically(changes).successful
    assert made.value("other").gain == 0.5


@dataclass(frozen=True, kw_only=True)
class Periods(Params):
    """An array that may be empty."""

    periods_s: tuple[float, ...] = parameter((), "periods", low=0.0, high=9.0)


def test_an_empty_array_is_one_of_doubles_and_can_be_filled(make_node: MakeNode) -> None:
    node = make_node()
    made = ParameterGroups(node)
    made.declare("", Periods())
    assert node.describe_parameter("periods_s").type == ParameterType.PARAMETER_DOUBLE_ARRAY
    assert made.value("") == Periods()
    assert node.set_parameters([Parameter("periods_s", value=[2.0, 3.0])])[0].successful
    assert made.value("").periods_s == (2.0, 3.0)


# Parameters of a configured node


def configured(node: Any) -> ParameterGroups:
    made = ParameterGroups(node)
    made.declare("axis", Axis(), live=("loop", "high_deg"))
    made.configured = True
    return made


@pytest.mark.parametrize("late", [{"low_deg": -20.0}, {"kind": "b"}, {"on": False}, {"rates_deg_s": [1.0, 2.0]}])
def test_what_a_configured_node_has_read_is_refused_and_named(make_node: MakeNode, late: dict[str, Any]) -> None:
    """Shown by `ros2 param get` and not in force would be the worst of both."""
    node = make_node()
    made = configured(node)
    result = set_all(node, loop__gain=2.0, **late)
    assert not result.successful
    (name,) = late
    assert result.reason == f"axis.{name} is read when the node is configured: deactivate subject and clean it up first"
    assert unchanged(made)
    made.configured = False
    assert set_all(node, **late).successful


def test_the_clock_of_a_configured_node_stays(make_node: MakeNode) -> None:
    """One call made time 0, which latched the fault that the clock had jumped by 57 years."""
    node = make_node()
    configured(node)
    result = node.set_parameters_atomically([Parameter("use_sim_time", value=True)])
    assert result.reason.startswith("use_sim_time is read when the node is configured")
    assert not node.get_clock().ros_time_is_active


def test_live_parameters_change_and_others_may_be_set_to_what_they_are(make_node: MakeNode) -> None:
    node = make_node()
    made = configured(node)
    same = {name: node.get_parameter(f"axis.{name}").value for name in ("low_deg", "rates_deg_s", "kind")}
    assert set_all(node, loop__gain=2.0, high_deg=50.0, **same).successful
    assert made.value("axis").loop.gain == 2.0
    assert made.value("axis").high_rad == pytest.approx(math.radians(50.0))


def test_describing_a_parameter_says_when_it_is_read(make_node: MakeNode) -> None:
    node = make_node()
    configured(node)
    said = {name: node.describe_parameter(f"axis.{name}").additional_constraints for name in NAMES}
    assert said["kind"] == "one of a, b; read when the node is configured"
    assert said["low_deg"] == "read when the node is configured"
    assert (said["loop.gain"], said["high_deg"]) == ("", "")
