"""Orbits of the three articles: every row holds or is explained, and is the recorded one."""

from rf_pointing.papers import orbit
from test.papers.recorded import DATA, check_rows


def test_the_rows_hold_or_are_explained_and_are_the_recorded_ones() -> None:
    rows = orbit.rows()
    assert [row.quantity for row in rows if not row.accepted] == []
    assert len([row for row in rows if not row.holds]) == 5
    check_rows(DATA / "rows.csv", "orbit", rows, within=1e-4)
