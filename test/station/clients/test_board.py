"""The operator's page without sockets: what it shows and when, what it lets an operator send."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core.dates import utc_text
from rf_pointing.planning import PassProfile
from rf_pointing.station.clients.board import READ, Board, PageParams, path_values
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.description import read_station

NOW_S, WALL_S, RATE_HZ = 1.8e9, 1000.0, 6.0


class Page:
    """A board of the namespace /gs1 with one viewer."""

    def __init__(self) -> None:
        self.sent: list[tuple[int, str, dict[str, Any]]] = []
        self.board = Board(
            RATE_HZ, "/gs1", lambda number, name, arguments: self.sent.append((number, name, dict(arguments)))
        )
        self.now_s, self.viewers = WALL_S, 1
        self.turn()

    def turn(self, seconds: float = 0.0) -> bool:
        self.now_s += seconds
        return self.board.turn(self.now_s, NOW_S + self.now_s - WALL_S, self.viewers)

    def shown(self, seconds: float = 0.0, **live: Any) -> dict[str, Any]:
        self.turn(seconds)
        found = self.board.sections(live)
        json.dumps(found, allow_nan=False)
        return found

    def request(self, name: str, /, **arguments: Any) -> list[tuple[bool, str]]:
        """Request a command; return the list in which its answer arrives."""
        answers: list[tuple[bool, str]] = []
        self.board.request(name, arguments, lambda *answer: answers.append(answer))
        return answers


@pytest.fixture
def page() -> Page:
    return Page()


# What is shown


def test_what_moves_is_shown_at_its_rate_and_the_rest_once_a_second(page: Page) -> None:
    assert set(page.shown()) == {"live", "station", "sun", "path", "certificate", "nodes", "events"}
    due, views, slow = 0, 0, 0
    for _ in range(200):
        if page.turn(0.03):
            due += 1
            slow += "nodes" in page.board.sections({})
    assert due == pytest.approx(6.0 * RATE_HZ, abs=1)
    assert slow in (5, 6)
    # Without viewers the streams are looked at once a second, and the first viewer gets everything at once.
    page.viewers = 0
    views = sum(page.turn(0.01) for _ in range(600))
    assert views == pytest.approx(6, abs=1)
    page.viewers = 2
    found = page.shown(0.01)
    assert found["live"]["viewers"] == 2
    assert "nodes" in found


@given(st.floats(0.0, 1e6))
def test_a_wait_is_up_to_the_next_view_and_at_most_50_ms(pause_s: float) -> None:
    page = Page()
    page.turn(pause_s)
    # After a pause the views are not made up.
    for _ in range(3):
        assert 0.001 <= page.board.wait_s <= 0.05
        while not page.turn(page.board.wait_s):
            assert 0.001 <= page.board.wait_s <= 0.05
        assert not page.turn(0.4 / RATE_HZ)


def test_nodes_are_shown_with_their_checks_and_their_silence(page: Page) -> None:
    for node, check, level, message in (
        ("/gs2/antenna_servo", "device", 0, "good"), ("/gs10/antenna_servo", "device", 0, "good"),
        ("/gs1/rf_receiver", "state", 1, "slow"), ("/gs1/antenna_servo", "device", 0, "good"),
        ("/gs1/antenna_servo", "device", 2, "lost"),
    ):  # fmt: skip
        page.board.note_check(node, check, level, message)
    assert page.shown(3.0)["nodes"] == [
        {"name": "antenna_servo", "silent_s": 0, "checks": [["device", 2, "lost"]]},
        {"name": "rf_receiver", "silent_s": 0, "checks": [["state", 1, "slow"]]},
    ]
    page.board.note_check("/gs1/rf_receiver", "state", 0, "active")
    assert [row["silent_s"] for row in page.shown(1.4)["nodes"]] == [4, 0]


def test_no_more_than_200_nodes_and_checks_are_kept_and_those_go_on(page: Page) -> None:
    for index in [*range(202), 7]:
        page.board.note_check("/gs1/one", f"check {index}", 0, "first")
        page.board.note_check(f"/gs1/node{index}", "state", index == 7, "first")
    nodes = {row["name"]: row["checks"] for row in page.shown(1.0)["nodes"]}
    assert (len(nodes), len(nodes["one"]), nodes["node7"]) == (200, 200, [["state", True, "first"]])


def test_limits_horizon_and_sun_are_those_in_force(page: Page) -> None:
    station = read_station("dss13")
    values = station.parameters("pointing_controller", station.default_band)
    values = {name: values[name] for name in READ["pointing_controller"] if name in values}
    assert page.shown()["sun"] is None
    page.board.note_parameters("pointing_controller", values)
    page.board.note_parameters("ephemeris_publisher", {"source.along_track_offset_s": 0.25})
    found = page.shown(1.0)
    assert found["station"]["limits_deg"] == pytest.approx([-220.0, 220.0, 4.0, 89.5])
    assert found["station"]["offsets"] == "along track 0.25 s"
    assert len(found["station"]["mask_deg"]) == 181
    sun = found["sun"]
    with pytest.raises(ValueError, match="latitude_deg"):
        page.board.note_parameters("pointing_controller", values | {"sun.site.latitude_deg": 95.0})
    assert page.shown(1.0)["sun"] == pytest.approx(sun, abs=0.02)
    page.board.note_parameters("pointing_controller", values | {"sun.site.latitude_deg": -30.0})
    assert math.dist(page.shown(1.0)["sun"], sun) > 1.0


@pytest.mark.parametrize("name", ["dss13", "xy_7m3", "polar_3m"])
def test_the_sky_plot_has_the_direction_of_the_axes_and_the_bars_their_names(page: Page, name: str) -> None:
    station = read_station(name)
    values = station.parameters("pointing_controller", station.default_band)
    mount, angles = kinematics_of(station.content), (20.0, 30.0)
    page.board.note_parameters("pointing_controller", {each: values[each] for each in READ["pointing_controller"]})
    found = page.board.sections({"encoder_deg": list(angles)})
    assert found["station"]["axes"] == mount.axes
    shown = found["live"].get("sky_deg", found["live"]["encoder_deg"])
    wanted = np.degrees(mount.sky_at(*np.radians(angles).tolist()))
    assert shown == pytest.approx(wanted, abs=1e-3)


def profile(target: str, begin_s: float, length_s: float, count: int = 4) -> PassProfile:
    pairs = {name: np.radians(np.column_stack([1.234 * np.arange(count), np.full(count, 30.0)])) for name in
             ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "sun_rad")}  # fmt: skip
    return PassProfile(
        name=target, t_s=NOW_S + begin_s + np.linspace(0.0, length_s, count), range_m=np.full(count, 1e6),
        satellite_gain_db=np.zeros(count), **pairs,
    )  # fmt: skip


def test_the_path_is_that_of_the_pass_that_lasts_or_comes_next(page: Page) -> None:
    page.board.profiles = [profile("A", -100.0, 90.0), profile("B", -100.0, 150.0), profile("C", 500.0, 90.0)]
    for t_s, name in ((-20.0, "A"), (-10.0, "B"), (49.9, "B"), (50.0, "C"), (589.9, "C"), (590.0, None)):
        path = page.shown(1.0, t_s=NOW_S + t_s)["path"]
        assert (path and path["target"]) == name


@given(st.integers(2, 2000))
def test_a_path_has_45_to_91_points_at_even_times_and_both_ends(count: int) -> None:
    values = path_values(profile("BIRD", 0.0, 600.0, count))
    points = np.array(values["points_deg"])
    assert (values["aos_s"], values["los_s"]) == (NOW_S, NOW_S + 600.0)
    assert min(count, 45) <= len(points) <= 92
    steps = np.diff(points[:-1, 0])
    assert np.all(np.abs(steps - steps[0]) < 0.02) if len(steps) else True
    assert points[[0, -1], 0] == pytest.approx([0.0, 1.234 * (count - 1)], abs=0.006)


# Commands


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("dance", {}, "command 'dance' must be one of stop_antenna"),
        ("park", {"speed": 1.0}, "park has no argument 'speed'; it takes none"),
        ("track", {"target_pass": {}}, "track has no argument 'target_pass'; it takes aos_utc, sensor"),
        ("night_skip", {"name": "x" * 201}, "name has 201 characters, must be <= 200"),
        ("set_cross_track", {"value": True}, "value=True must be a number"),
        ("set_cross_track", {"value": "1"}, "value='1' must be a number"),
        ("set_cross_track", {"value": math.inf}, "value=inf must be finite"),
        ("set_cross_track", {"value": 10**400}, "value=10000000000000000000 must be finite, at most 1e+18"),
        ("track", {"aos_utc": "yesterday"}, "aos_utc='yesterday' must be one of the 0 coming passes"),
    ],
)
def test_a_command_that_makes_no_sense_is_refused_with_a_sentence(
    page: Page, name: str, arguments: dict[str, Any], words: str
) -> None:
    ((accepted, text),) = page.request(name, **arguments)
    assert (accepted, page.sent) == (False, [])
    assert words in text
    assert page.shown()["events"][0]["text"] == f"{name}: {text}"


def test_commands_are_answered_by_their_numbers_and_shown_with_the_next_view(page: Page) -> None:
    page.shown()
    first, second = page.request("park"), page.request("night_skip", name="p1")
    assert page.sent == [(1, "park", {}), (2, "night_skip", {"name": "p1"})]
    assert "events" not in page.shown()
    page.board.responded(2, False, "no pass p1")
    assert (first, second) == ([], [(False, "no pass p1")])
    page.board.responded(1, True, "")
    # A second answer, and one of nobody.
    page.board.responded(1, True, "again")
    page.board.responded(9, True, "")
    page.board.ended(2, "track", False, {"message": ""})
    assert first == [(True, "accepted")]
    events = page.shown()["events"]
    assert [(row["text"], row["accepted"]) for row in events] == [
        ("track ended: no message", False), ("park: accepted", True), ("night_skip: no pass p1", False)
    ]  # fmt: skip
    assert events[0]["utc"] == utc_text(NOW_S)[:19]
    third = page.request("stow")
    page.board.responded(3, False, "")
    assert third == [(False, "refused")]


def test_a_shown_pass_is_tracked_by_its_rise_unless_a_night_runs(page: Page) -> None:
    rises = [utc_text(NOW_S + 100.0), utc_text(NOW_S + 6000.0)]
    page.board.keep("passes", {"target": "BIRD", "rows": [{"aos_utc": each} for each in rises]})
    page.request("track", aos_utc=rises[1])
    page.request("track", aos_utc=rises[0], sensor="none")
    assert [arguments for _, _, arguments in page.sent] == [
        {"target_pass": 1, "sensor": "auto"}, {"target_pass": 0, "sensor": "none"}
    ]  # fmt: skip
    page.board.keep("executive", {"state": "running"})
    for seconds, runs in ((4.9, True), (0.1, False)):
        page.turn(seconds)
        assert bool(page.request("track", aos_utc=rises[0])) is runs
    page.board.keep("executive", {"state": "paused"})
    assert page.request("track", aos_utc=rises[0]) == []


# Address


def test_an_address_that_others_reach_needs_a_token_file() -> None:
    with pytest.raises(ValueError, match="address=0.0.0.0 can be reached by other computers: token_file='' must name"):
        PageParams(address="0.0.0.0")
    assert PageParams(address="0.0.0.0", token_file="token").address == "0.0.0.0"
    assert PageParams(address="::1").address == "::1"
    with pytest.raises(ValueError, match="address=station must be an IP address"):
        PageParams(address="station")
