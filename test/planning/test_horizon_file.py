"""Horizon masks in the layouts of surveys and programs: the same points, however they stand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.planning.horizon_file import WALL_DEG, in_order, read_horizon

POINTS = [(0.0, 3.0), (80.0, 4.5), (160.0, 12.0), (240.0, 6.0), (320.0, 7.0)]
SOUTH = [*POINTS[2:], *POINTS[:2]]


def table(rows: list[tuple[float, float]], between: str = " ", more: str = "") -> str:
    return "".join(f"{azimuth}{between}{elevation}{more}\n" for azimuth, elevation in rows)


LAYOUTS = {
    "begins in the south": table(SOUTH),
    "falls": table(POINTS[::-1]),
    "falls from the south": table(SOUTH[::-1]),
    "closed at 360 deg": table([*POINTS, (360.0, 3.0)]),
    "-180 to 180 deg": table([((a + 180.0) % 360.0 - 180.0, e) for a, e in POINTS]),
    "tabs": table(POINTS, "\t"),
    "semicolons and decimal commas": table(POINTS, ";").replace(".", ","),
    "CSV with a head": "Azimuth,Elevation\n" + table(POINTS, ", "),
    "more columns, named": "bearing,altitude,latitude,longitude\n" + table(POINTS, ",", ",52.1,6.8"),
    "columns the other way round": '"alt";"az"\n' + table([(e, a) for a, e in POINTS], ";"),
    "signs of degrees": "".join(f"{azimuth}° {elevation}°\n" for azimuth, elevation in POINTS),
    "HeyWhatsThat": '"bearing","altitude","latitude","longitude","distance (mi)","elevation (ft)"\n'
    + table(POINTS, ",", ",42.1,-71.2,3.2,410"),
    "units in the head": "az_deg el_deg\n" + table(POINTS),
    "head of words": "Horizon of my garden\n" + table(POINTS),
    "comments of three kinds": "# N.I.N.A.\n; a survey\n// of 2026\n" + table(POINTS, " ", "  # tree"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_points(layout: str) -> None:
    points, wrong = read_horizon(LAYOUTS[layout])
    assert not wrong
    assert [(azimuth, elevation) for _, azimuth, elevation in in_order(points)] == POINTS


@pytest.mark.parametrize("between", [" ", ",", "\n"])
def test_a_row_or_a_column_of_heights_is_even_from_north(between: str) -> None:
    points, wrong = read_horizon(between.join(["5"] * 90 + ["7"] * 90))
    assert not wrong
    assert [row[1:] for row in (*points[:2], *points[90:92])] == [(0.0, 5.0), (2.0, 5.0), (180.0, 7.0), (182.0, 7.0)]
    assert points[-1][0] == (180 if between == "\n" else 1)


def test_two_heights_at_one_azimuth_are_a_wall() -> None:
    rows = [(0.0, 3.0), (80.0, 3.0), (80.0, 20.0), (160.0, 20.0), (160.0, 3.0), (250.0, 3.0)]
    for shown in (rows, rows[2:] + rows[:2], rows[::-1]):
        points = in_order([(k, *row) for k, row in enumerate(shown)])
        assert [row[1:] for row in points] == [
            (0.0, 3.0), (80.0, 3.0), (80.0 + WALL_DEG, 20.0), (160.0, 20.0), (160.0 + WALL_DEG, 3.0), (250.0, 3.0),
        ]  # fmt: skip


def test_lines_without_a_point_are_named_and_points_out_of_order_stay() -> None:
    _, wrong = read_horizon("0 3\n80 nan\n160 5 6\n240\n300 x\n1.2.3 4\n")
    assert [number for number, _ in wrong] == [2, 3, 4, 5, 6]
    shuffled = [(1, 0.0, 1.0), (2, 90.0, 1.0), (3, 45.0, 1.0), (4, 200.0, 1.0), (5, 120.0, 1.0)]
    assert in_order(shuffled) == shuffled


@given(st.lists(st.integers(0, 359), min_size=3, max_size=30, unique=True), st.integers(0, 29), st.booleans())
def test_turning_and_reversing_a_survey_changes_nothing(azimuths: list[int], turn: int, back: bool) -> None:
    rising = [(0, float(azimuth), 0.1 * azimuth) for azimuth in sorted(azimuths)]
    turned = rising[turn % len(rising) :] + rising[: turn % len(rising)]
    assert in_order(turned[::-1] if back else turned) == rising
