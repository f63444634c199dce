"""The bounds of scripts/house only fall, and end at what is wanted."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

SCRIPT = Path(__file__).parents[1] / "scripts" / "house.py"
NUMBERS = st.integers(0, 1000)


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("house", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Its dataclasses look themselves up there.
    sys.modules["house"] = module
    spec.loader.exec_module(module)
    return module


house = load()


@given(today=NUMBERS, wanted=NUMBERS, measured=NUMBERS, least=st.booleans())
def test_a_tightened_bound_is_never_looser_and_holds_what_was_measured_or_wanted(
    today: int, wanted: int, measured: int, least: bool
) -> None:
    before = house.Bound(today, wanted, least)
    after = house.Bound(before.tightened(measured), wanted, least)
    assert not after.looser_than(today)
    assert after.today in (today, wanted, measured)
    row, bounds = house.Row("key", "", measured), {"key": after}
    assert house.broken(row, bounds) == house.broken(row, {"key": before})


@pytest.mark.parametrize(
    ("first", "then", "raised"),
    [
        ("{ at_most = 5, wanted = 1 }", "{ at_most = 4, wanted = 1 }", []),
        ("{ at_most = 5, wanted = 1 }", "{ at_most = 6, wanted = 1 }", ["key = 6 was 5"]),
        ("{ at_least = 5, wanted = 9 }", "{ at_least = 4, wanted = 9 }", ["key = 4 was 5"]),
        ("{ at_most = 5, wanted = 1 }", "{ at_most = 6, wanted = 1, because = 'measured' }", []),
    ],
)
def test_a_bound_looser_than_a_committed_one_needs_its_reason(
    tmp_path: Path, first: str, then: str, raised: list[str]
) -> None:
    git = ["git", "-C", str(tmp_path), "-c", "user.name=t", "-c", "user.email=t@example.org"]
    (tmp_path / "scripts").mkdir()
    (file := tmp_path / house.BOUNDS).write_text(f"key = {first}\n")
    for command in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "bounds"]):
        subprocess.run([*git, *command], check=True)
    file.write_text(f"key = {then}\n")
    assert [line.split(" in ")[0] for line in house.loosened(tmp_path, house.bounds_of(file.read_text()))] == raised


def test_tightening_writes_what_was_measured_and_leaves_the_rest() -> None:
    text = "# why\na = { at_most = 9, wanted = 2 }\nb = { at_least = 1.5, wanted = 3 }\n"
    rows = [house.Row("a", "", 5), house.Row("b", "", 2.5)]
    assert house.tightened(text, rows) == text.replace("9", "5").replace("1.5", "2.5")
