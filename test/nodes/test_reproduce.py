"""`reproduce`: its options reach the papers that have use for them, and are refused by the others."""

from concurrent.futures import Executor
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="nodes need ROS 2", exc_type=ImportError)

from rf_pointing.nodes.reproduce import main, papers
from rf_pointing.reproduce.row import Row


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replace doa's computation by one that holds, and return what it was asked."""
    seen: dict[str, Any] = {}

    def rows(
        seed: int = 1, *, trials: int = 2, executor: Executor | None = None, music_inside: bool = False
    ) -> list[Row]:
        seen.update(seed=seed, trials=trials, executor=executor, music_inside=music_inside)
        return [Row(quantity="one", source="here", paper=1.0, ours=1.0, unit="1", tolerance=0.0)]

    monkeypatch.setattr("rf_pointing.reproduce.doa.rows", rows)
    return seen


def run(*words: str) -> int | str | None:
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    return ended.value.code


def test_every_paper_is_listed_and_no_part_of_one() -> None:
    assert {"doa", "interferometer", "tripulse"} <= set(papers())
    assert not {"row", "table", "interferometer_claims"} & set(papers())


def test_full_tables_are_asked_for_by_options(asked: dict[str, Any]) -> None:
    assert run("doa", "--trials", "200", "--workers", "2", "--music-inside", "--seed", "7") == 0
    assert isinstance(asked.pop("executor"), Executor)
    assert asked == {"seed": 7, "trials": 200, "music_inside": True}


def test_without_options_a_paper_runs_by_its_own_defaults(asked: dict[str, Any]) -> None:
    assert run("doa") == 0
    assert asked == {"seed": 1, "trials": 2, "executor": None, "music_inside": False}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("satcal", "--workers", "2"), "satcal has no use for --workers"),
        (("tripulse", "--trials", "3"), "tripulse has no use for --trials"),
        (("doa", "--trials", "0"), "--trials=0 must be >= 1"),
        (("doa", "--workers", "-1"), "--workers=-1 must be >= 1"),
    ],
)
def test_options_without_meaning_are_refused(
    words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str], asked: dict[str, Any]
) -> None:
    assert run(*words) == 2
    assert message in capsys.readouterr().err
