"""`reproduce`: its options reach the papers that have use for them, and are refused by the others."""

import importlib
import inspect
import json
import pkgutil
import subprocess
import sys
from concurrent.futures import Executor
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="nodes need ROS 2")

from rf_pointing import papers
from rf_pointing.papers.reproduce import PAPERS, main
from rf_pointing.papers.row import Row
from test.papers.test_recorded_rows import CLOSED_FORMS, TABLES


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replace doa's computation by one that holds, and return what it was asked."""
    seen: dict[str, Any] = {}

    def rows(
        seed: int = 1, *, trials: int = 2, executor: Executor | None = None, music_inside: bool = False
    ) -> list[Row]:
        seen.update(seed=seed, trials=trials, executor=executor, music_inside=music_inside)
        return [Row(quantity="one", source="here", paper=1.0, ours=1.0, unit="1", tolerance=0.0)]

    monkeypatch.setattr("rf_pointing.papers.doa.rows", rows)
    return seen


def run(*words: str) -> int | str | None:
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    return ended.value.code


def test_wrong_values_are_planted_into_the_explained_rows_of_every_paper() -> None:
    papers_planted = " ".join(paper for *_, paper in TABLES.values()).split()
    assert {*papers_planted, *CLOSED_FORMS} == set(PAPERS)


def test_the_module_is_the_command() -> None:
    command = [sys.executable, "-m", "rf_pointing.papers.reproduce", "receive"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)
    assert done.returncode == 0, done.stderr
    assert "3 explained, 0 open" in done.stdout


def test_full_tables_are_asked_for_by_options(asked: dict[str, Any]) -> None:
    assert run("doa", "--trials", "200", "--workers", "2", "--music-inside", "--seed", "7") == 0
    assert isinstance(asked.pop("executor"), Executor)
    assert asked == {"seed": 7, "trials": 200, "music_inside": True}


def test_without_options_a_paper_runs_by_its_own_defaults(asked: dict[str, Any]) -> None:
    assert run("doa") == 0
    assert asked == {"seed": 1, "trials": 2, "executor": None, "music_inside": False}


def test_the_exit_code_is_one_where_a_row_is_not_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    good = Row(quantity="one", source="here", paper=1.0, ours=1.0, unit="1", tolerance=0.0)
    far = Row(quantity="two", source="here", paper=1.0, ours=2.0, unit="1", tolerance=0.0)
    for rows, code in (([good], 0), ([far, good], 1), ([good, far], 1), ([], 0)):
        monkeypatch.setattr("rf_pointing.papers.satcal.rows", lambda _seed, rows=rows: rows)
        assert run("satcal") == code


def test_sweeps_go_to_the_dask_scheduler_asked_for(asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    clients: list[str] = []

    class Client(nullcontext["Client"]):
        def __init__(self, *where: str, **_: str) -> None:
            super().__init__(self)
            clients.extend(where)

        def get_executor(self) -> str:
            return "the cluster's executor"

    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=Client))
    assert run("doa", "--dask", "tcp://host:8786") == 0
    assert (asked["executor"], clients) == ("the cluster's executor", ["tcp://host:8786"])


def test_missing_extra_and_unreachable_scheduler_are_named(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def unreachable(address: str, **_: str) -> None:
        raise OSError(f"timed out connecting to {address}")

    for module, message in (
        (None, "--dask needs the extra `sweep`"),
        (SimpleNamespace(Client=unreachable), "--dask=tcp://host:1: timed out connecting to tcp://host:1"),
    ):
        monkeypatch.setitem(sys.modules, "distributed", module)
        assert run("doa", "--dask", "tcp://host:1") == 2
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("satcal", "--workers", "2"), "satcal has no use for --workers"),
        (("satcal", "--dask", "tcp://host:8786"), "satcal has no use for --dask"),
        (("doa", "--dask", "tcp://host:8786", "--workers", "2"), "choose one"),
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


@pytest.mark.parametrize("paper", PAPERS)
@pytest.mark.parametrize("number", [float, np.float64, np.float32, np.int64, int])
@pytest.mark.parametrize("bound", ["==", "<=", ">="])
def test_rows_of_numpy_numbers_are_printed_as_json(
    paper: str, number: Any, bound: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    row = Row(
        quantity="one", source="here", paper=number(2), ours=number(2), unit="1", tolerance=number(0), bound=bound,
        remark="measured", due=(number(1), number(3)),
    )  # fmt: skip
    monkeypatch.setattr(f"rf_pointing.papers.{paper}.rows", lambda _seed: [row])
    assert run(paper, "--json") == 0
    (printed,) = json.loads(capsys.readouterr().out)
    assert printed["ours"] == 2.0
    assert printed["holds"] is True
    assert printed["explained"] is True


def test_random_numbers_are_those_of_seed_1_unless_another_is_given() -> None:
    seeds: dict[str, object] = {}
    for found in pkgutil.walk_packages(papers.__path__, f"{papers.__name__}."):
        module = importlib.import_module(found.name)
        for name, function in inspect.getmembers(module, inspect.isfunction):
            seed = inspect.signature(function).parameters.get("seed")
            if seed is not None and seed.default is not inspect.Parameter.empty:
                seeds[f"{function.__module__}.{name}"] = seed.default
    assert len(seeds) > 20
    assert set(seeds.values()) == {1}, seeds
