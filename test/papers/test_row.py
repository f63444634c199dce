"""A row holds or not at its exact limits, refuses what has no meaning, and is printed with its verdict."""

import math
from dataclasses import replace

import pytest

from rf_pointing.papers.row import Row, as_table, near

PLAIN = Row(quantity="gain", source="paper A", paper=4.0, ours=4.5, unit="dB", tolerance=0.5)


@pytest.mark.parametrize(
    ("bound", "tolerance", "factor", "least", "most"),
    [
        ("==", 0.5, 1.0, 3.5, 4.5),
        ("==", 0.0, 1.0, 4.0, 4.0),
        ("<=", 0.5, 1.0, -math.inf, 4.5),
        (">=", 0.5, 1.0, 3.5, math.inf),
        ("==", 0.0, 2.0, 2.0, 8.0),
        ("==", 0.0, 1.25, 3.2, 5.0),
    ],
)
def test_a_row_holds_up_to_its_limits_and_no_further(
    bound: str, tolerance: float, factor: float, least: float, most: float
) -> None:
    row = replace(PLAIN, bound=bound, tolerance=tolerance, factor=factor)
    for limit, outwards in ((least, -1.0), (most, 1.0)):
        if math.isinf(limit):
            assert replace(row, ours=1e9 * outwards).holds
        else:
            assert replace(row, ours=limit).holds
            assert not replace(row, ours=limit + 1e-9 * outwards).holds
    for never in (math.inf, -math.inf, math.nan):
        assert not replace(row, ours=never).holds


@pytest.mark.parametrize(
    "changes",
    [
        {"bound": "<"},
        {"tolerance": -0.1},
        {"tolerance": math.inf},
        {"factor": 0.9, "tolerance": 0.0},
        {"factor": math.inf, "tolerance": 0.0},
        {"factor": 2.0},
        {"factor": 1.1},
        {"factor": 2.0, "tolerance": 0.0, "bound": ">="},
        {"factor": 2.0, "tolerance": 0.0, "paper": 0.0},
        {"due": (8.0, 10.0)},
        {"due": (10.0, 8.0), "remark": "why"},
        {"due": (8.0, math.inf), "remark": "why"},
    ],
    ids=str,
)
def test_a_row_without_meaning_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=str(next(iter(changes)))):
        replace(PLAIN, **changes)  # type: ignore[arg-type]


def test_a_row_is_accepted_where_it_holds_or_carries_its_reason() -> None:
    far = replace(PLAIN, ours=9.0)
    assert PLAIN.accepted
    assert not far.accepted
    explained = replace(far, due=(8.0, 10.0), remark="why")
    assert explained.accepted
    for wrong in (7.9, 10.1, math.nan):
        assert not replace(explained, ours=wrong).accepted


def test_the_limits_of_a_due_number_are_its_share_about_it() -> None:
    assert near(-10.0, 0.1) == (-11.0, -9.0)
    assert near(None, 0.1) is None


def test_a_small_factor_is_printed_as_one() -> None:
    row = replace(PLAIN, tolerance=0.0, factor=1.2)
    assert as_table([row]).splitlines()[2].split()[-2:] == ["x/1.2", "yes"]


def test_the_table_has_a_line_for_every_row_its_remark_and_the_count_of_verdicts() -> None:
    rows = [
        PLAIN,
        replace(PLAIN, quantity="loss of the second kind", ours=0.25, bound=">=", remark="measured"),
        replace(PLAIN, quantity="ratio", ours=6.0, tolerance=0.0, factor=2.5),
        replace(PLAIN, quantity="misprint", ours=40.0, due=(39.0, 41.0), remark="x" * 70 + " " + "y" * 70),
    ]
    assert as_table(rows).splitlines() == [
        "quantity                 source   paper  ours  unit  tolerance  holds",
        "-----------------------  -------  -----  ----  ----  ---------  ---------",
        "gain                     paper A  4      4.5   dB    0.5        yes",
        "loss of the second kind  paper A  >= 4   0.25  dB    0.5        NO", "    measured",
        "ratio                    paper A  4      6     dB    x/2.5      yes",
        "misprint                 paper A  4      40    dB    0.5        explained",
        "    " + "x" * 70, "    " + "y" * 70, "2 of 4 rows hold, 1 explained, 1 open",
    ]  # fmt: skip
