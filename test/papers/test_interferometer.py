import pytest

from rf_pointing.papers.interferometer import rows
from rf_pointing.papers.interferometer_claims import settled_error_deg
from rf_pointing.papers.row import Row


@pytest.fixture(scope="module")
def found() -> list[Row]:
    return rows()


def test_every_row_holds_or_carries_its_measured_explanation(found) -> None:
    assert [row.quantity for row in found if not row.accepted] == []


def test_all_four_tables_are_there_with_every_legible_cell(found) -> None:
    counts = {name: sum(row.source == f"PI83 Table {name}" for row in found) for name in ("7-1", "8-1", "8-2", "8-3")}
    assert counts == {"7-1": 40, "8-1": 95, "8-2": 6, "8-3": 2}


def test_only_known_misprints_and_slips_do_not_hold(found) -> None:
    broken = {row.quantity for row in found if not row.holds}
    assert len(broken) == 14
    assert {"CFT, K = 2: power ratio", "Var(rho)/sigma^2", "sigma of a range for the distance requirement"} <= broken


def test_statements_hold_for_another_seed_too() -> None:
    assert [row.quantity for row in rows(seed=5) if not row.accepted] == []


def test_nine_separate_ranges_keep_the_attitude_error_and_bend_the_direction_by_half_of_it() -> None:
    attitude, direction = settled_error_deg(10.0)
    assert attitude == pytest.approx(10.0, abs=0.01)
    assert direction == pytest.approx(5.0, abs=0.2)
