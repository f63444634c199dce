"""Antennas of a network: the worst first, alarms once, and what is wrong with one that disagrees."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core.dates import utc_text
from rf_pointing.station.clients import network
from rf_pointing.station.clients.board import Board, PageParams, namespaces_of

NOW_S, WALL_S = 1.8e9, 1000.0
LEVELS = st.integers(network.OK, network.FAULT)
NAMES = st.sampled_from(["drive lost", "disk", "high wind", "fault", "clock"])
SPACES = st.builds("/gs{}".format, st.integers(0, 30))
STATUS = {
    "antenna": "tracking", "tracking": "conscan", "target": "BIRD", "t_s": NOW_S, "carrier_to_noise_db_hz": 51.2,
    "error_beamwidths": [0.03, 0.04], "fault": "", "level": 0,
}  # fmt: skip


def lines_of(levels: dict[str, int]) -> list[dict[str, Any]]:
    return [{"antenna": antenna, "level": level, "name": ""} for antenna, level in levels.items()]


@given(levels=st.dictionaries(SPACES, LEVELS, min_size=1), data=st.data())
def test_the_worst_are_first_whatever_the_order_and_none_falls_by_getting_worse(
    levels: dict[str, int], data: st.DataObject
) -> None:
    lines = lines_of(levels)
    found = network.worst_first(lines)
    assert network.worst_first(data.draw(st.permutations(lines))) == found
    assert {each["antenna"]: each["level"] for each in found} == levels
    places = [each["antenna"] for each in found]
    for one, two in pairwise(found):
        numbers = [int(each["antenna"].removeprefix("/gs")) for each in (one, two)]
        assert (-one["level"], numbers[0]) < (-two["level"], numbers[1])
    antenna = data.draw(st.sampled_from(places))
    worse = levels | {antenna: data.draw(st.integers(levels[antenna], network.FAULT))}
    again = [each["antenna"] for each in network.worst_first(lines_of(worse))]
    assert again.index(antenna) <= places.index(antenna)


ROWS = st.fixed_dictionaries({
    "name": NAMES, "level": st.integers(1, 2), "message": st.text(max_size=5), "acknowledged": st.booleans(),
    "raised_utc": st.integers(0, 9).map(lambda s: utc_text(NOW_S + s)),
})  # fmt: skip
ALARMS = st.dictionaries(SPACES, st.lists(ROWS, unique_by=lambda row: row["name"]))


@given(alarms=ALARMS)
def test_every_alarm_is_one_row_with_all_its_antennas(alarms: dict[str, list[dict[str, Any]]]) -> None:
    found = network.merged_alarms(alarms)
    having = {(antenna, row["name"]): row for antenna, rows in alarms.items() for row in rows}
    assert len({each["name"] for each in found}) == len(found)
    assert {(antenna, each["name"]) for each in found for antenna in each["messages"]} == set(having)
    for each in found:
        rows = {antenna: having[antenna, each["name"]] for antenna in each["messages"]}
        assert each["messages"] == {antenna: row["message"] for antenna, row in rows.items()}
        assert set(each["open"]) == {antenna for antenna, row in rows.items() if not row["acknowledged"]}
        assert each["level"] == max(row["level"] for row in rows.values())
        assert each["raised_utc"] == min(row["raised_utc"] for row in rows.values())
    order = [(not each["open"], -each["level"]) for each in found]
    assert order == sorted(order)


@given(offset_s=st.floats(-1e6, 1e6), late_s=st.lists(st.floats(0.0, 1.2), min_size=1, max_size=10))
def test_a_wrong_clock_is_found_through_late_looks_and_a_right_one_is_not(offset_s: float, late_s: list[float]) -> None:
    ahead_s = [offset_s - each for each in late_s]
    found = network.clock_finding(ahead_s, simulated=False)
    assert network.clock_finding(ahead_s, simulated=True) == []
    if -0.3 < offset_s < 0.1:
        assert not found
    elif offset_s < -1.5 or offset_s > 1.3:
        assert found[0][0] == network.ERROR
        assert ("ahead of" if offset_s > 0.0 else "behind") in found[0][1]


@given(names=st.dictionaries(SPACES, st.sampled_from(["", "Dish", "Horn"])), level=LEVELS)
def test_antennas_of_one_name_name_each_other(names: dict[str, str], level: int) -> None:
    lines = [
        {"antenna": antenna, "name": name, "level": level, "worst": "", "more": []} for antenna, name in names.items()
    ]
    for line in network.with_same_names(lines):
        words = " ".join([line["worst"], *line["more"]])
        others = {each for each, name in names.items() if name == line["name"] != "" and each != line["antenna"]}
        assert {each for each in names if f"{each} " in f"{words.replace(',', ' ')} "} == others
        assert line["level"] == (max(level, network.WARNING) if others else level)


class Antenna:
    """The board of /gs1, of which everything has just arrived."""

    def __init__(self) -> None:
        self.board = Board(6.0, "/gs1", lambda *_: None)
        self.wall_s = WALL_S
        self.later(0.0)
        for name in ("antenna", "tracking"):
            self.board.seen(name)
        self.board.keep("station", {"name": "Dish", "band": "X"})

    def later(self, seconds: float) -> None:
        self.wall_s += seconds
        self.board.turn(self.wall_s, NOW_S, 1)

    def line(self, **live: Any) -> dict[str, Any]:
        return network.antenna_line("/gs1", self.board, STATUS | live, [])

    def alarm(self, *, acknowledged: bool = False) -> None:
        row = {"name": "disk", "level": 2, "message": "full", "acknowledged": acknowledged, "raised_utc": ""}
        self.board.keep("executive", {"alarms": [row]})

    def plan(self, *begin_s: float, state: str = "waiting") -> None:
        times = [(utc_text(NOW_S + each), utc_text(NOW_S + each + 600.0)) for each in begin_s]
        self.board.keep("schedule", [{"target": "NEXT", "aos_utc": a, "los_utc": b, "state": state} for a, b in times])


def test_a_line_has_the_worst_that_an_antenna_reports() -> None:
    one = Antenna()
    line = one.line()
    assert (line["level"], line["worst"], line["target"], line["carrier"]) == (0, "", "BIRD", 51.2)
    assert line["beamwidths"] == pytest.approx(0.05)
    one.board.note_check("/gs1/rf_receiver", "device", 1, "noisy")
    assert one.line()["level"] == network.WARNING
    one.board.note_check("/gs1/station_alarms", "alarms", 2, "drive_lost: no answer; so; disk: 1 GB: free")
    assert [each["message"] for each in network.alarms_of(one.board)] == ["no answer; so", "1 GB: free"]
    one.alarm(acknowledged=True)
    assert (one.line()["level"], one.line()["worst"]) == (network.WARNING, "disk: full")
    one.alarm()
    assert (one.line()["level"], one.line()["worst"]) == (network.ERROR, "disk: full")
    line = one.line(fault="following error")
    assert (line["level"], line["worst"]) == (network.FAULT, "fault latched: following error")
    assert line["more"] == ["disk: full", "rf_receiver: noisy"]
    one.later(7.0)
    line = one.line(fault="following error")
    assert (line["level"], line["worst"], line["target"]) == (network.ERROR, "silent for 7 s", "")


@pytest.mark.parametrize(
    ("begin_s", "state", "found"),
    [
        ((-7200.0, 60.0), "waiting", {"target": "NEXT", "in_s": 60}),
        ((-60.0, 6000.0), "active", {"target": "NEXT", "left_s": 540}),
        ((-86400.0,), "waiting", {"text": "plan is over since 23.8 h"}),
        ((60.0,), "skipped", {"text": "no pass left to track"}),
        ((), "waiting", {"text": "no plan"}),
    ],
)
def test_the_next_pass_counts_from_the_time_of_the_antenna(
    begin_s: tuple[float, ...], state: str, found: dict[str, Any]
) -> None:
    one = Antenna()
    one.plan(*begin_s, state=state)
    line = one.line()
    assert line["next"] == found
    assert [each["begin_s"] for each in line["plan"]] == [each for each in begin_s if each > -7800.0]


def test_namespaces_are_read_and_wrong_ones_named() -> None:
    assert namespaces_of("/gs1, gs2 /site/gs3/") == ["/gs1", "/gs2", "/site/gs3"]
    for text, words in (("/gs1,/gs-2", "/gs-2 must be a namespace"), ("gs1 /gs1", "names /gs1 twice")):
        with pytest.raises(ValueError, match=words):
            PageParams(antennas=text)
