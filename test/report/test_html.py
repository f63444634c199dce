"""Numbers and tables as a reader sees them."""

import pytest

from rf_pointing.report.html import number, render


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (1.04321, "1.04"), (0.9996, "1.00"), (0.005621, "0.00562"), (64.99, "65.0"), (742.3, "742"),
        (41_812.0, "41\u202f800"), (-0.0312, "-0.0312"), (0.0, "0"), (45_000, "45\u202f000"),
        (None, "–"),
    ],
)  # fmt: skip
def test_numbers_have_three_figures_and_no_powers_of_ten(value: float | None, shown: str) -> None:
    assert number(value) == shown


def page_of_table(head: tuple[str, ...], *rows: tuple[str | float | None, ...]) -> str:
    return render("table.html", title=head[0], head=head, rows=rows, words=(0,), figures={}, caption="")


def test_empty_cells_show_a_dash_and_words_align_left() -> None:
    shown = page_of_table(("name", "value"), ("a", None), ("", 1.5))
    assert '<td class="text">a</td><td>–</td>' in shown
    assert '<td class="text">–</td><td>1.50</td>' in shown
