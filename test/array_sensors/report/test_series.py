"""Attitudes and poses of a bag beside the truth of the same stamp, their pictures and their report."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from rf_pointing.array_sensors.attitude.quaternion import (
    multiply,
    quaternion_from_roll_pitch_yaw,
    quaternion_from_rotation_vector,
)
from rf_pointing.array_sensors.report.page import array_errors, report_array_sensors, write_array_report
from rf_pointing.array_sensors.report.pictures import draw_attitude, draw_pose
from rf_pointing.array_sensors.report.series import ArraySeries, hand_offs, read_attitude_series, read_pose_series
from rf_pointing.commands.report import main as report_main
from rf_pointing.report.bag_writer import BagWriter
from rf_pointing.report.definitions import Definitions

START_NS = 1_767_225_600 * 10**9
EPOCHS = 60
ERROR_RAD = np.array([2e-4, -1e-4, 5e-4])
ERROR_M = np.array([0.02, -0.3, 0.1])
SIGMA_RAD, SIGMA_M = 3e-4, 0.2

Plan = Callable[[int], dict[str, bytes]]


@pytest.fixture
def bag_of(tmp_path: Path, types: Definitions) -> Callable[[dict[str, str], Plan, int], Path]:
    def write(topics: dict[str, str], plan: Plan, count: int = EPOCHS) -> Path:
        path = tmp_path / "bag"
        with BagWriter(path, types) as bag:
            for topic, type_name in topics.items():
                bag.register(topic, type_name)
            for epoch in range(count):
                for topic, data in plan(epoch).items():
                    bag.write(topic, START_NS + epoch, data)
        return path

    return write


def truth_at(epoch: int) -> np.ndarray:
    return quaternion_from_roll_pitch_yaw([0.02 * epoch, 0.1 * np.sin(0.2 * epoch), 3.0 + 0.02 * epoch])


@pytest.fixture
def attitude_bag(maker: Any, bag_of: Any) -> Path:
    """Truth at 60 epochs; estimates, off by ERROR_RAD, of all but the first; valid from the tenth on."""

    def quaternion(values: np.ndarray) -> Any:
        return maker.message("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, values), strict=True)))

    def plan(epoch: int) -> dict[str, bytes]:
        header = maker.header(START_NS + epoch * 10**9)
        found = multiply(quaternion_from_rotation_vector(ERROR_RAD), truth_at(epoch))
        truth = maker.serialized(
            "geometry_msgs/msg/QuaternionStamped", header=header, quaternion=quaternion(truth_at(epoch))
        )
        estimate = maker.serialized(
            "rf_pointing_msgs/msg/Attitude", header=header, valid=epoch >= 10,
            reason="" if epoch >= 10 else f"sigma {0.1 / (1 + epoch):.3g} rad must be <= 0.035 rad",
            orientation=quaternion(found), covariance=(SIGMA_RAD**2 * np.eye(3)).ravel(),
        )  # fmt: skip
        block = maker.serialized(
            "rf_pointing_msgs/msg/ArraySnapshots", header=header, sequence=epoch,
            transmitters=["usingen" if epoch < 30 else "kourou"], elements=0, snapshots=0,
            samples_i=np.zeros(0), samples_q=np.zeros(0),
        )  # fmt: skip
        heard = {"/sat/sim/attitude": truth, "/sat/array_snapshots": block}
        return heard | ({"/sat/attitude": estimate} if epoch else {})

    topics = {
        "/sat/attitude": "rf_pointing_msgs/msg/Attitude",
        "/sat/sim/attitude": "geometry_msgs/msg/QuaternionStamped",
        "/sat/array_snapshots": "rf_pointing_msgs/msg/ArraySnapshots",
    }
    return bag_of(topics, plan)


@pytest.fixture
def pose_bag(maker: Any, bag_of: Any) -> Path:
    """Truth and estimates, off by ERROR_M and ERROR_RAD."""

    def pose(epoch: int, offset_m: np.ndarray, turn_rad: np.ndarray) -> bytes:
        q = multiply(quaternion_from_rotation_vector(turn_rad), truth_at(epoch))
        place = np.array([100.0 - epoch, 3.0, -2.0]) + offset_m
        inner = maker.message(
            "geometry_msgs/msg/Pose",
            position=maker.message("geometry_msgs/msg/Point", **dict(zip("xyz", map(float, place), strict=True))),
            orientation=maker.message("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, q), strict=True))),
        )
        covariance = np.diag(np.repeat([SIGMA_M**2, SIGMA_RAD**2], 3)).ravel()
        full = maker.message("geometry_msgs/msg/PoseWithCovariance", pose=inner, covariance=covariance)
        header = maker.header(START_NS + epoch * 2 * 10**9)
        return maker.serialized("geometry_msgs/msg/PoseWithCovarianceStamped", header=header, pose=full)

    def plan(epoch: int) -> dict[str, bytes]:
        none = np.zeros(3)
        return {
            "/dock/relative_pose": pose(epoch, ERROR_M, ERROR_RAD),
            "/dock/sim/relative_pose": pose(epoch, none, none),
        }

    return bag_of(dict.fromkeys(plan(0), "geometry_msgs/msg/PoseWithCovarianceStamped"), plan)


def test_attitude_error_is_the_rotation_from_truth_to_estimate(attitude_bag: Path) -> None:
    series = read_attitude_series(attitude_bag, "/sat")
    assert series.t_s.tolist() == list(range(EPOCHS - 1))
    assert series.valid.tolist() == [False] * 9 + [True] * 50
    np.testing.assert_allclose(series.rotation_error_rad, np.tile(ERROR_RAD, (EPOCHS - 1, 1)), atol=1e-12)
    np.testing.assert_allclose(series.rotation_sigma_rad, SIGMA_RAD)


def test_pose_error_is_estimate_minus_truth(pose_bag: Path) -> None:
    series = read_pose_series(pose_bag, "/dock")
    assert series.t_s.tolist() == [2.0 * k for k in range(EPOCHS)]
    np.testing.assert_allclose(series.position_error_m, np.tile(ERROR_M, (EPOCHS, 1)), atol=1e-12)
    np.testing.assert_allclose(series.rotation_error_rad, np.tile(ERROR_RAD, (EPOCHS, 1)), atol=1e-12)
    np.testing.assert_allclose(series.position_sigma_m, SIGMA_M)
    np.testing.assert_allclose(series.rotation_sigma_rad, SIGMA_RAD)


def test_bag_without_common_stamps_is_refused(attitude_bag: Path) -> None:
    with pytest.raises(ValueError, match="0 estimates and 0 true values have no stamp in common"):
        read_attitude_series(attitude_bag, "/elsewhere")


def holds_colour(path: Path, colour: str) -> bool:
    off = 255.0 * imread(path)[:, :, :3] - list(bytes.fromhex(colour))
    # Versions of matplotlib round a blended pixel up or down.
    return bool(np.min(np.max(np.abs(off), axis=-1)) < 1.5)


@pytest.mark.parametrize("kind", ["attitude", "pose"])
def test_picture_shows_truth_estimate_and_error(kind: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    if kind == "attitude":
        draw_attitude(read_attitude_series(request.getfixturevalue("attitude_bag"), "/sat"), path, "Title")
    else:
        draw_pose(read_pose_series(request.getfixturevalue("pose_bag"), "/dock"), path, "Title")
    for colour in ("0072b2", "d55e00", "333333"):
        assert holds_colour(path, colour), colour


def test_picture_of_a_run_that_never_became_valid_is_drawn(attitude_bag: Path, tmp_path: Path) -> None:
    found = read_attitude_series(attitude_bag, "/sat")
    never = replace(found, valid=np.zeros(len(found.t_s), dtype=np.bool_))
    path = tmp_path / "picture.png"
    draw_attitude(never, path, "Title")
    assert holds_colour(path, "8a8a8a")


def test_report_counts_reasons_and_marks_the_hand_off(attitude_bag: Path, tmp_path: Path) -> None:
    series = read_attitude_series(attitude_bag, "/sat")
    # Time counts from the first estimate, one second after the first truth.
    assert series.hand_offs == ((29.0, "kourou"),)
    write_array_report(attitude_bag, tmp_path / "report")
    summary = json.loads((tmp_path / "report" / "array_summary.json").read_text())
    assert summary["reasons"] == {"/sat/attitude": {"sigma 0.05 rad must be <= 0.035 rad": 9}}
    assert [(row["sensor"], row["epochs"], row["valid"]) for row in summary["errors"]] == [("/sat/attitude", 59, 50)]
    page = (tmp_path / "report" / "array_report.html").read_text()
    assert "9: sigma 0.05 rad must be &lt;= 0.035 rad" in page
    assert "NEES of 3" in page
    assert holds_colour(tmp_path / "report" / "sat_attitude.png", "a6761d")


@pytest.mark.parametrize("first", [0, 1, 2])
def test_stations_that_take_turns_are_handed_over_once_each(first: int) -> None:
    views = {0: ["south", "middle"], 40: ["south", "middle", "north"], 80: ["middle", "north"], 120: ["north", "pole"]}
    in_view = [next(names for start, names in sorted(views.items(), reverse=True) if k >= start) for k in range(160)]
    in_turn = [[names[(k + first) % len(names)]] for k, names in enumerate(in_view)]
    for heard in (in_turn, in_view):
        received = {k * 10**9: SimpleNamespace(transmitters=names) for k, names in enumerate(heard)}
        found = hand_offs(received, 0)
        assert [name for _, name in found] == ["north", "pole"]
        assert np.all(np.abs(np.array([time_s for time_s, _ in found]) - [41.0, 121.0]) <= 1.0)


def test_report_of_a_pose_has_its_picture_numbers_and_page(pose_bag: Path, tmp_path: Path) -> None:
    position, attitude = write_array_report(pose_bag, tmp_path / "report")
    np.testing.assert_allclose(position.rms, np.abs(ERROR_M), rtol=1e-9)
    assert (position.unit, attitude.unit, attitude.valid) == ("m", "deg", EPOCHS)
    folder = tmp_path / "report"
    assert holds_colour(folder / "dock_relative_pose.png", "d55e00")
    summary = json.loads((folder / "array_summary.json").read_text())
    assert [row["quantity"] for row in summary["errors"]] == ["position", "attitude"]
    page = (folder / "array_report.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert "/dock/relative_pose" in page


def test_executable_reports_the_sensors_of_a_bag_without_antenna(
    attitude_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report_main([str(attitude_bag), "--output", str(tmp_path / "report")])
    assert capsys.readouterr().out.split() == [str(tmp_path / "report" / "array_report.html")]


def test_bag_without_sensors_is_refused(tmp_path: Path, types: Definitions, bag_of: Any) -> None:
    path = bag_of({"/sat/attitude": "rf_pointing_msgs/msg/Attitude"}, lambda _: {}, 1)
    with pytest.raises(ValueError, match="holds no attitude or relative_pose with its truth"):
        write_array_report(path, tmp_path / "report")


def drawn_series(valid: np.ndarray, positions: bool = True) -> tuple[ArraySeries, np.ndarray]:
    """Return a series with correlated covariances, and its errors (position, rotation) by epoch."""
    random, count = np.random.default_rng(3), len(valid)
    size = 6 if positions else 3
    roots = random.standard_normal((count, size, size)) * np.r_[[0.3] * 3, [2e-3] * 3][-size:, None]
    # Twice as large as claimed: many lie beyond three deviations.
    errors = 2.0 * np.einsum("nij,nj->ni", roots, random.standard_normal((count, size)))
    true = np.array([truth_at(epoch) for epoch in range(count)])
    found = [multiply(quaternion_from_rotation_vector(turn), q) for turn, q in zip(errors[:, -3:], true, strict=True)]
    place = random.standard_normal((count, 3)) if positions else None
    series = ArraySeries(
        t_s=np.arange(float(count)), true_position_m=place, position_m=None if place is None else place + errors[:, :3],
        true_quaternion=true, quaternion=np.array(found), covariance=roots @ roots.swapaxes(1, 2), valid=valid,
    )  # fmt: skip
    return series, errors


@pytest.mark.parametrize("positions", [True, False])
def test_errors_of_a_report_are_those_of_the_valid_epochs_in_its_units(positions: bool) -> None:
    valid = np.arange(30) % 4 != 0
    series, drawn = drawn_series(valid, positions)
    lines = array_errors("/sat/pose", series)
    assert [(each.quantity, each.unit) for each in lines] == ([("position", "m")] if positions else []) + [
        ("attitude", "deg")
    ]
    for line, first, unit in zip(
        lines, (0, 3) if positions else (0,), (1.0, np.degrees(1.0))[-len(lines) :], strict=True
    ):
        errors, covariance = (
            drawn[valid, first : first + 3],
            series.covariance[valid, first : first + 3, first : first + 3],
        )
        sigma = np.sqrt(np.einsum("nii->ni", covariance))
        assert (line.epochs, line.valid) == (30, 22)
        np.testing.assert_allclose(line.rms, unit * np.sqrt(np.mean(errors**2, axis=0)), rtol=1e-6)
        np.testing.assert_allclose(line.claimed, unit * np.median(sigma, axis=0), rtol=1e-9)
        assert line.inside == pytest.approx(np.mean(np.abs(errors) <= 3.0 * sigma))
        nees = [e @ np.linalg.solve(c, e) for e, c in zip(errors, covariance, strict=True)]
        assert line.nees == pytest.approx(np.mean(nees), rel=1e-6)


def test_a_sensor_that_was_never_valid_has_no_errors_and_says_so() -> None:
    series, _ = drawn_series(np.zeros(5, dtype=bool), positions=False)
    (line,) = array_errors("/sat/attitude", series)
    assert (line.epochs, line.valid, line.rms, line.claimed, line.inside, line.nees) == (5, 0, None, None, None, None)


def test_a_station_heard_for_the_first_time_is_handed_over_once_the_first_turns_are_over() -> None:
    """Of two stations two whole turns are four blocks: who comes within them is no hand-off."""
    for first, found in ((3, ()), (4, ((4.0, "north"),)), (5, ((5.0, "north"),)), (7, ((7.0, "north"),))):
        names = ["south"] * first + ["north"] * 10
        received = {index * 10**9: SimpleNamespace(transmitters=[name]) for index, name in enumerate(names)}
        assert hand_offs(received, 0) == found


def test_a_station_that_pauses_for_two_turns_is_not_new_and_after_more_it_is() -> None:
    for pause, found in ((4, ()), (5, ((11.0, "south"),))):
        names = ["north", "south"] * 3 + ["north"] * (pause - 1) + ["south"] + ["north", "south"] * 3
        received = {(index + 2) * 10**9: SimpleNamespace(transmitters=[name]) for index, name in enumerate(names)}
        assert hand_offs(received, 10**9) == found


def test_several_stations_of_one_block_are_handed_over_together() -> None:
    blocks = [["south"]] * 9 + [["pole", "north"]] * 3
    received = {index * 10**9: SimpleNamespace(transmitters=names) for index, names in enumerate(blocks)}
    assert hand_offs(received, 2 * 10**9) == ((7.0, "north, pole"),)


def test_a_summary_is_readable_line_by_line(attitude_bag: Path, tmp_path: Path) -> None:
    write_array_report(attitude_bag, tmp_path)
    text = (tmp_path / "array_summary.json").read_text()
    assert text.startswith('{\n "schema": "rf_pointing/array_summary/1",\n "bag": ')
    assert text.endswith("}\n")


def test_a_position_needs_its_truth_and_a_truth_its_position() -> None:
    series, drawn = drawn_series(np.ones(4, dtype=bool))
    np.testing.assert_allclose(series.position_error_m, drawn[:, :3], atol=1e-12)
    for missing in ("position_m", "true_position_m"):
        with pytest.raises(ValueError, match="an attitude sensor has no position"):
            _ = replace(series, **{missing: None}).position_error_m


def test_a_bag_of_the_antenna_alone_leaves_no_folder(tmp_path: Path, bag_of: Any) -> None:
    bag = bag_of({"/sat/attitude": "rf_pointing_msgs/msg/Attitude"}, lambda _: {}, 1)
    assert report_array_sensors(bag, tmp_path / "report") is None
    assert not (tmp_path / "report").exists()
