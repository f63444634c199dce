"""Parameter files without ROS: later over earlier, nested or dotted, and errors that name file, node and key."""

import math
from pathlib import Path

import pytest

from rf_pointing.core.parameter_files import read_parameter_files
from rf_pointing.planning import AxisLimits
from rf_pointing.servo import WindParams
from rf_pointing.station.antenna.loops import LoopParams

CONFIG = Path(__file__).parents[2] / "config"


def written(folder: Path, text: str, name: str = "station.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_degrees_of_the_file_become_radians(tmp_path: Path) -> None:
    path = written(tmp_path, "/**/pointing_controller:\n  ros__parameters:\n    limits: {azimuth_max_deg: 90.0}\n")
    limits = read_parameter_files([path])["pointing_controller"].group("limits", AxisLimits())
    assert limits.azimuth_max_rad == pytest.approx(math.pi / 2.0)
    assert limits.azimuth_min_rad == AxisLimits().azimuth_min_rad


def test_nested_and_dotted_names_are_the_same(tmp_path: Path) -> None:
    nested = written(tmp_path, "/**/a:\n  ros__parameters: {loops: {azimuth: {integral_gain: 2.5}}}\n", "nested.yaml")
    dotted = written(tmp_path, "/**/a:\n  ros__parameters: {loops.azimuth.integral_gain: 2.5}\n", "dotted.yaml")
    for path in (nested, dotted):
        assert read_parameter_files([path])["a"].group("loops", LoopParams()).azimuth.integral_gain == 2.5


def test_later_files_win_key_by_key(tmp_path: Path) -> None:
    first = written(tmp_path, "/**/a:\n  ros__parameters: {wind: {mean_speed_m_s: 1.0, seed_is: 2}}\n", "first.yaml")
    second = written(tmp_path, "/gs1/a:\n  ros__parameters: {wind: {mean_speed_m_s: 3.0}}\n", "second.yaml")
    assert read_parameter_files([first, second])["a"].values == {"wind.mean_speed_m_s": 3.0, "wind.seed_is": 2}


def test_a_list_becomes_a_pair(tmp_path: Path) -> None:
    path = written(tmp_path, "a:\n  ros__parameters: {loops: {preprocessor: {rate_limit_deg_s: [1.0, 0.5]}}}\n")
    loops = read_parameter_files([path])["a"].group("loops", LoopParams())
    assert loops.preprocessor.rate_limit_rad_s == pytest.approx((math.radians(1.0), math.radians(0.5)))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a: [", r"station\.yaml: not YAML"),
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
    with pytest.raises(ValueError, match=r"binary\.yaml: not YAML"):
        read_parameter_files([path])


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ("{wind: {mean_sped_m_s: 1.0}}", r"^servo: wind\.mean_sped_m_s: WindParams has no such parameter$"),
        ("{wind: {mean_speed_m_s: -1.0}}", r"^servo: wind\.mean_speed_m_s=-1\.0 must be >= 0\.0$"),
        ("{wind: {mean_speed_m_s: .nan}}", r"^servo: wind\.mean_speed_m_s=nan must be finite$"),
        ("{wind: {mean_speed_m_s: strong}}", r"^servo: wind\.mean_speed_m_s='strong' must be a number$"),
        ("{wind: {from_azimuth_deg: west}}", r"^servo: wind\.from_azimuth_deg='west' must be a number$"),
    ],
)
def test_a_refused_value_names_node_and_key(tmp_path: Path, values: str, complaint: str) -> None:
    path = written(tmp_path, f"/**/servo:\n  ros__parameters: {values}\n")
    with pytest.raises(ValueError, match=complaint):
        read_parameter_files([path])["servo"].group("wind", WindParams())


def test_a_prefix_does_not_take_what_only_begins_like_it(tmp_path: Path) -> None:
    path = written(tmp_path, "a:\n  ros__parameters: {wind: {mean_speed_m_s: 2.0}, winding: {x: 1.0}}\n")
    assert read_parameter_files([path])["a"].group("wind", WindParams()).mean_speed_m_s == 2.0


@pytest.mark.parametrize("band", ["s", "x", "ka"])
def test_our_own_files_are_read(band: str) -> None:
    nodes = read_parameter_files([CONFIG / "dss13.yaml", CONFIG / f"band_{band}.yaml"])
    assert {"antenna_servo", "rf_receiver", "pointing_controller", "monopulse_tracker", "conscan_tracker"} <= set(nodes)
