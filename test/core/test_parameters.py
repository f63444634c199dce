"""Parameter sets: checked on construction and on replacement, in radians inside and degrees at the edge.

Parameter files without ROS: later over earlier, nested or dotted, and errors that name file, node and key.
"""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import Params, from_degrees, leaves, parameter, parameter_unit, to_degrees, with_leaves
from rf_pointing.core.parameters import read_parameter_files


@dataclass(frozen=True, kw_only=True)
class Inner(Params):
    """Set inside a set."""

    rate_rad_s: float = parameter(0.01, "rate", low=0.0, high=0.2)
    pair_rad: tuple[float, float] = parameter((0.1, 0.2), "two angles", low=-1.0, high=1.0)


@dataclass(frozen=True, kw_only=True)
class Outer(Params):
    """Every kind of field."""

    low_rad: float = parameter(-0.5, "lower end", low=-2.0, high=2.0)
    high_rad: float = parameter(0.5, "upper end", low=-2.0, high=2.0)
    count: int = parameter(3, "how many", low=1, high=9)
    name: str = parameter("X", "name")
    kind: str = parameter("a", "kind", choices=("a", "b"))
    on: bool = parameter(True, "switch")
    inner: Inner = parameter(Inner(), "set inside")

    def check_together(self) -> None:
        """Refuse an empty interval."""
        if self.low_rad >= self.high_rad:
            raise ValueError(f"low_rad={self.low_rad} must be < high_rad={self.high_rad}")


@dataclass(frozen=True, kw_only=True)
class Needed(Params):
    """A field without a default."""

    must_s: float = parameter(description="has no default")
    may_s: float = parameter(1.0, "has one")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"low_rad": -2.1}, r"low_rad=-2\.1 must be >= -2\.0"),
        ({"high_rad": 2.1}, r"high_rad=2\.1 must be <= 2\.0"),
        ({"low_rad": math.nan}, r"low_rad=nan must be finite"),
        ({"low_rad": "wide"}, r"low_rad='wide' must be a number"),
        ({"low_rad": True}, r"low_rad=True must be a number"),
        ({"count": 0}, r"count=0 must be >= 1"),
        ({"count": 2.0}, r"count=2\.0 must be a whole number"),
        ({"inner": 3.0}, r"inner=3\.0 must be Inner"),
        ({"kind": "c"}, r"kind='c' must be one of a, b"),
        ({"name": 7}, r"name=7 must be of type str"),
        ({"on": "yes"}, r"on='yes' must be of type bool"),
        ({"low_rad": 0.6}, r"low_rad=0\.6 must be < high_rad=0\.5"),
    ],
)
def test_a_refused_value_names_field_value_and_bound_and_leaves_the_original(
    changes: dict[str, Any], complaint: str
) -> None:
    original = Outer()
    with pytest.raises(ValueError, match=f"^{complaint}$"):
        original.replace(**changes)
    with pytest.raises(ValueError, match=f"^{complaint}$"):
        Outer(**changes)
    assert original == Outer()


@pytest.mark.parametrize("pair", [(0.0, 1.1), (math.nan, 0.0), ("x", 0.0), (True, 0.0)])
def test_a_refused_element_is_named_by_its_place(pair: tuple[Any, Any]) -> None:
    place = 0 if pair[1] == 0.0 else 1
    with pytest.raises(ValueError, match=rf"^pair_rad\[{place}\]="):
        Inner(pair_rad=pair)


def test_sets_are_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Outer().count = 4  # type: ignore[misc]


def test_a_field_without_a_description_is_refused() -> None:
    with pytest.raises(ValueError, match="description='' must say what the parameter is"):
        parameter(1.0)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("rate_rad_s", "rad/s"), ("jerk_rad_s3", "rad/s^3"), ("rate_deg_s", "deg/s"), ("height_m", "m"),
        ("speed_m_s", "m/s"), ("level_db_hz", "dB-Hz"), ("area_m2", "m^2"), ("period_s", "s"),
        ("word_bits", "bit"), ("gain", "1"),
    ],
)  # fmt: skip
def test_the_unit_is_the_end_of_the_name(name: str, unit: str) -> None:
    assert parameter_unit(name) == unit


@pytest.mark.parametrize("name", ["angle_rad", "rate_rad_s", "acceleration_rad_s2", "jerk_rad_s3"])
def test_degrees_are_the_edge_form_of_radians_and_back(name: str) -> None:
    edge, degrees = to_degrees(name, (0.1, -2.0))
    assert edge == name.replace("_rad", "_deg")
    np.testing.assert_allclose(degrees, np.degrees([0.1, -2.0]), rtol=1e-15)
    assert from_degrees(edge, degrees) == (name, pytest.approx((0.1, -2.0), rel=1e-15))


@pytest.mark.parametrize("name", ["range_m", "radius_m", "gradient", "trad_eoff", "_radio_m"])
def test_names_of_other_units_stay_as_they_are(name: str) -> None:
    assert to_degrees(name, 3.0) == (name, 3.0)


def test_an_open_bound_stays_open() -> None:
    assert to_degrees("angle_rad", None) == ("angle_deg", None)


def test_leaves_lists_every_field_below_by_its_edge_name() -> None:
    found = {name: value for name, (_, value) in leaves(Outer()).items()}
    assert list(found) == ["low_deg", "high_deg", "count", "name", "kind", "on", "inner.rate_deg_s", "inner.pair_deg"]
    assert found["low_deg"] == pytest.approx(math.degrees(-0.5))
    assert found["inner.pair_deg"] == pytest.approx((math.degrees(0.1), math.degrees(0.2)))


def test_with_leaves_checks_the_set_as_a_whole() -> None:
    """Each end alone would be refused against the other's default; together they fit."""
    moved = with_leaves(Outer(), {"low_deg": 60.0, "high_deg": 80.0})
    assert (moved.low_rad, moved.high_rad) == pytest.approx((math.radians(60.0), math.radians(80.0)))
    with pytest.raises(ValueError, match=r"^low_rad=.* must be < high_rad="):
        with_leaves(Outer(), {"low_deg": 60.0})


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"widht": 1.0}, r"^widht: Outer has no such parameter$"),
        ({"inner.rat_deg_s": 1.0}, r"^inner\.rat_deg_s: Inner has no such parameter$"),
        ({"iner.rate_deg_s": 1.0}, r"^Outer has no parameter iner\.rate_deg_s$"),
        ({"count.rate_deg_s": 1.0}, r"^Outer has no parameter count\.rate_deg_s$"),
        ({"inner.rate_deg_s": 100.0}, r"^inner\.rate_deg_s=100\.0 must be <= 11\.459\d*$"),
        ({"inner.pair_deg": [0.0, -58.0]}, r"^inner\.pair_deg\[1\]=-58\.0 must be >= -57\.29\d*$"),
        ({"inner.pair_deg": 3.0}, r"^inner\.pair_deg=3\.0 must be a list of values$"),
        ({"inner.pair_deg": [3.0]}, r"^inner\.pair_deg=\(3\.0,\) must have 2 values$"),
        ({"low_rad": 0.1}, r"^low_rad: Outer has no such parameter$"),
        ({"inner.rate_deg_s": "fast"}, r"^inner\.rate_deg_s='fast' must be a number$"),
        ({"inner.pair_deg": ["a", 1.0]}, r"^inner\.pair_deg\[0\]='a' must be a number$"),
        ({"inner": 3.0}, r"^inner=3\.0 must be Inner$"),
    ],
)
def test_with_leaves_names_the_key(values: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        with_leaves(Outer(), values)


def test_from_mapping_takes_core_units_and_lists() -> None:
    made = Inner.from_mapping({"rate_rad_s": 0.05, "pair_rad": [0.3, 0.4]})
    assert made == Inner(rate_rad_s=0.05, pair_rad=(0.3, 0.4))
    assert Inner.from_mapping({"pair_rad": np.array([0.3, 0.4])}).pair_rad == (0.3, 0.4)


def test_from_mapping_refuses_unknown_and_missing_keys() -> None:
    with pytest.raises(ValueError, match="Inner has no parameter rate; it has rate_rad_s, pair_rad"):
        Inner.from_mapping({"rate": 1.0})
    with pytest.raises(ValueError, match="Needed needs must_s"):
        Needed.from_mapping({"may_s": 2.0})
    assert Needed.from_mapping({"must_s": 2.0}) == Needed(must_s=2.0)


@dataclass(frozen=True, kw_only=True)
class Edges(Params):
    """Bounds that do not survive the way to degrees and back."""

    angle_rad: float = parameter(-0.2, "angle", low=-0.2, high=0.3)
    angles_rad: tuple[float, ...] = parameter((-0.2, 0.3), "angles", low=-0.2, high=0.3)


def test_values_on_their_bounds_survive_the_way_to_degrees_and_back() -> None:
    values = {name: value for name, (_, value) in leaves(Edges()).items()}
    assert math.radians(values["angle_deg"]) < -0.2
    assert with_leaves(Edges(), values) == Edges()
    with pytest.raises(ValueError, match=r"angle_deg=-11\.46 must be >= -11\.459"):
        with_leaves(Edges(), {"angle_deg": -11.46})


def written(folder: Path, text: str, name: str = "station.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_nested_and_dotted_names_are_the_same(tmp_path: Path) -> None:
    nested = written(tmp_path, "/**/a:\n  ros__parameters: {loops: {azimuth: {integral_gain: 2.5}}}\n", "nested.yaml")
    dotted = written(tmp_path, "/**/a:\n  ros__parameters: {loops.azimuth.integral_gain: 2.5}\n", "dotted.yaml")
    for path in (nested, dotted):
        assert read_parameter_files([path]) == {"a": {"loops.azimuth.integral_gain": 2.5}}


def test_later_files_win_key_by_key(tmp_path: Path) -> None:
    first = written(tmp_path, "/**/a:\n  ros__parameters: {wind: {mean_speed_m_s: 1.0, seed_is: 2}}\n", "first.yaml")
    second = written(tmp_path, "/gs1/a:\n  ros__parameters: {wind: {mean_speed_m_s: 3.0}}\n", "second.yaml")
    assert read_parameter_files([first, second])["a"] == {"wind.mean_speed_m_s": 3.0, "wind.seed_is": 2}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a: [", r"station\.yaml: line 2: not YAML"),
        ("- a\n- b\n", r"station\.yaml: must map node names to ros__parameters"),
        ("", r"station\.yaml: must map node names to ros__parameters"),
        ("a: {parameters: {x: 1}}", r"station\.yaml: a must hold ros__parameters and nothing else"),
        ("a: {ros__parameters: {x: 1}, more: 2}", r"station\.yaml: a must hold ros__parameters and nothing else"),
        ("a: 3", r"station\.yaml: a must hold ros__parameters and nothing else"),
        ("a: {ros__parameters: 3}", r"station\.yaml: ros__parameters of a must map names to values"),
    ],
)
def test_a_file_that_is_not_a_parameter_file_is_named(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        read_parameter_files([written(tmp_path, text)])


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^parameter file .*nowhere\.yaml: No such file or directory$"):
        read_parameter_files([tmp_path / "nowhere.yaml"])
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"binary\.yaml: byte 0 is not UTF-8"):
        read_parameter_files([path])


def test_sets_inside_a_set_are_found_by_name() -> None:
    assert Outer().sets() == {"inner": Inner()}
    assert Inner().sets() == {}
