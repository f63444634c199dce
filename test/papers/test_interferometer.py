from dataclasses import replace

import pytest

from rf_pointing.papers import interferometer, interferometer_claims, interferometer_simulation
from rf_pointing.papers.interferometer import rows


def test_no_cell_of_the_tables_would_hold_with_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interferometer, "simulation_rows", lambda *_: [])
    tables = [row for row in rows() if "Table" in row.source]
    assert len(tables) > 20
    assert not any(replace(row, ours=0.0, due=None).holds for row in tables)


@pytest.mark.parametrize(
    ("module", "function", "quantity"),
    [
        (interferometer_claims, "range_variance_from_gradients", "Var(rho)/sigma^2"),
        (interferometer_claims, "range_requirement_m", "sigma of a range for the distance requirement"),
        (interferometer_simulation, "required_power_w", "forward power for 20 dB at 100 km"),
        (interferometer, "link_powers_w", "forward power at the printed 3.424 GHz"),
    ],
)
def test_an_explanation_is_measured_and_fails_with_another_number(
    module, function: str, quantity: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    exact = getattr(module, function)

    def wrong(*args, **more):
        found = exact(*args, **more)
        return tuple(3.0 * each for each in found) if isinstance(found, tuple) else 3.0 * found

    monkeypatch.setattr(module, function, wrong)
    if module is not interferometer_simulation:
        monkeypatch.setattr(interferometer, "simulation_rows", lambda *_: [])
    broken = [row.quantity for row in rows() if not row.accepted]
    assert any(name.startswith(quantity) for name in broken), broken


def test_statements_hold_for_another_seed_too() -> None:
    assert [row.quantity for row in rows(seed=5) if not row.accepted] == []
