"""The losses of a ledger add up, whatever its parts are, and its file is the ledger again."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import MDEG, MU, PassOutcome
from rf_pointing.report import write_report
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.error_ledger import COLOURS, LEDGER, Cause, Ledger, shared
from rf_pointing.report.night_report import night_of, write_night
from test.report.test_night_report import record, state

WIDTH_RAD = 1e-3
ROUNDING_DB = 1e-9
SIZES = st.floats(0.0, 3.0 * WIDTH_RAD)
SEEDS = st.integers(0, 2**31)


def parts_of(seed: int, sizes: list[float]) -> dict[str, Any]:
    random = np.random.default_rng(seed)
    return {f"cause {k}": size * random.standard_normal((50, 2)) for k, size in enumerate(sizes)}


@given(SEEDS, st.lists(SIZES, min_size=1, max_size=6))
def test_losses_add_up_to_that_of_the_pass_and_do_not_know_an_order(seed: int, sizes: list[float]) -> None:
    parts = parts_of(seed, sizes)
    radial = np.hypot(*sum(parts.values()).T)
    found = shared(parts, WIDTH_RAD)
    whole_db = PassOutcome.of(radial, WIDTH_RAD, 0.1).mean_loss_db
    assert sum(loss for _, loss in found.values()) == pytest.approx(whole_db, rel=1e-9, abs=ROUNDING_DB)
    turned = shared(dict(reversed(parts.items())), WIDTH_RAD)
    for name, (rms, loss) in found.items():
        assert rms == pytest.approx(math.sqrt(np.mean(np.sum(parts[name] ** 2, axis=1))) / MDEG)
        assert turned[name] == pytest.approx((rms, loss), rel=1e-9, abs=ROUNDING_DB)


@given(SEEDS, st.floats(1e-3, 0.02), st.floats(1e-3, 0.02))
def test_small_parts_that_are_square_to_each_other_cost_their_squares(seed: int, one: float, other: float) -> None:
    random = np.random.default_rng(seed)
    right, up = random.standard_normal((2, 400)) * np.array([[one], [other]]) * WIDTH_RAD
    still = np.zeros_like(right)
    found = shared({"one": np.column_stack([right, still]), "other": np.column_stack([still, up])}, WIDTH_RAD)
    for name, part in (("one", right), ("other", up)):
        square = float(np.mean(part**2)) / WIDTH_RAD**2
        # The first term of the Gaussian beam; the next is as much smaller as the error squared.
        assert found[name][1] == pytest.approx(10.0 * MU / math.log(10.0) * square, rel=0.05)


def test_a_cause_that_another_undoes_has_its_loss_with_the_other_sign() -> None:
    part = np.full((10, 2), 1e-4)
    found = shared({"one": 2.0 * part, "other": -part}, WIDTH_RAD)
    assert found["one"][1] == pytest.approx(-2.0 * found["other"][1])
    assert found["other"][1] < 0.0


def a_ledger(loss_db: float = 0.5) -> Ledger:
    causes = tuple(Cause(name, 10.0 * k, loss_db * k / 45.0, f"note {k}") for k, name in enumerate(COLOURS))
    return Ledger("SAT 1, runs/x", "true", 600.0, 65.0, 123.4, loss_db, causes, ("no weather/wind",))


def test_what_is_written_is_read_again_and_a_damaged_file_is_named(tmp_path: Path) -> None:
    found = a_ledger()
    assert [each.name for each in found.write(tmp_path / "run")] == ["ledger.json", "ledger.png"]
    assert Ledger.read(tmp_path / "run") == found
    assert Ledger.read(tmp_path) is None
    assert found.largest.name == "unexplained"
    assert found.short == "unexplained 0.10 dB, 20 %"
    assert found.sum_db == pytest.approx(0.5)
    with pytest.raises(ValueError, match="cause='storm' must be one of search, ephemeris and time"):
        found.cause("storm")
    for broken in ("{", "[]", '{"causes": [{"name": 1}]}', json.dumps(found.values() | {"more": 1})):
        (tmp_path / LEDGER).write_text(broken)
        with pytest.raises(ValueError, match="ledger"):
            Ledger.read(tmp_path)


def test_the_report_has_bar_and_table_of_a_ledger_and_names_a_broken_one(
    tmp_path: Path, synthetic_run: type[Any], types: Definitions
) -> None:
    bag = tmp_path / "bag"
    synthetic_run(seconds=4.0, mode=lambda _: "monopulse").write(bag, types, {})
    write_report(bag, tmp_path)
    assert "Error ledger" not in (tmp_path / "report.html").read_text()
    a_ledger().write(tmp_path)
    write_report(bag, tmp_path)
    text = (tmp_path / "report.html").read_text()
    for part in ("Error ledger", "Where the loss comes from", "wind and structure", "note 3", "no weather/wind"):
        assert part in text
    (tmp_path / LEDGER).write_text("{}")
    write_report(bag, tmp_path)
    assert "is not the ledger of a pass" in (tmp_path / "report.html").read_text()


def test_the_morning_report_has_the_largest_cause_of_each_pass_that_has_a_ledger(tmp_path: Path) -> None:
    folder = tmp_path / "report-1"
    folder.mkdir()
    a_ledger(0.9).write(tmp_path / "passes" / "SAT 1")
    (tmp_path / "passes" / "SAT 2").mkdir()
    (tmp_path / "passes" / "SAT 2" / LEDGER).write_text("{")
    write_night(night_of(state([record("SAT 1", 600.0), record("SAT 2", 3600.0)]), "Dish"), folder)
    text = (folder / "night.html").read_text()
    assert text.count("most by") == 1
    assert "most by unexplained 0.18 dB, 20 %" in text
    assert json.loads((folder / "night.json").read_text())["ledgers"] == {"SAT 1": "unexplained 0.18 dB, 20 %"}
