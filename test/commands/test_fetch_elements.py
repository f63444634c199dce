"""`fetch_elements` and the commands that take an address: what they print, and their exit codes."""

import json
from pathlib import Path

import pytest

from rf_pointing.commands import fetch_elements, plan_passes
from rf_pointing.ephemeris import fetching
from rf_pointing.ephemeris.element_files import cache_folder, kept_file
from rf_pointing.ephemeris.fetching import Outcome, Record
from test.ephemeris.conftest import source
from test.ephemeris.element_server import FRESH, NOW_S, RULE_S, Source

__all__ = ["source"]


def run(*argv: str) -> int:
    with pytest.raises(SystemExit) as stopped:
        fetch_elements.main(list(argv))
    return int(stopped.value.code or 0)


def test_the_exit_code_is_that_of_the_worst_address(
    source: Source, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cache, first, second = ["--cache", str(tmp_path)], source.address, f"{source.address}&MORE=1"
    assert run(*cache, first) == 0
    source.status = 403
    assert run(*cache, "--every", "0", first) == 1
    shown = capsys.readouterr()
    assert [line for line in shown.out.splitlines() if line.startswith("http")] == [f"{first}: new", f"{first}: kept"]
    assert "problem: http://127.0.0.1" in shown.out
    assert shown.err.startswith("fetch_elements: http://127.0.0.1")
    # Kept addresses are listed, or requested again: one has nothing.
    assert run(*cache, "--json", "--every", "0", first, second) == 2
    assert [row["state"] for row in json.loads(capsys.readouterr().out)] == ["kept", "none"]
    assert run(*cache, "--list", "--json", first) == 1
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["address"], row["state"], row["objects"]) == (first, "kept", 4)
    assert row["newest_h"] <= row["median_h"] <= row["oldest_h"]
    assert len(source.asked) == 4
    source.status = 200
    assert run(*cache, "--every", "0", "--json") == 0
    assert sorted(row["address"] for row in json.loads(capsys.readouterr().out)) == [first, second]
    assert run(*cache, "--list", "http://other/x") == 2
    assert "keeps no elements of these addresses" in capsys.readouterr().err


def outcome(state: str = "kept", problem: str = "", fresh_t_s: float = NOW_S - 1000.0) -> Outcome:
    epochs = (NOW_S - 60.0 * 3600.0, NOW_S - 47.9 * 3600.0, NOW_S - 1234.5678)
    record = Record(
        address="http://a/x", epochs_t_s=epochs, problem=problem, requested_t_s=NOW_S - 1000.0, interval_s=RULE_S,
        fresh_t_s=fresh_t_s, objects=3,
    )  # fmt: skip
    return Outcome(state=state, file=Path("kept.tle"), record=record)


def test_what_is_kept_is_printed_with_its_age(capsys: pytest.CaptureFixture[str]) -> None:
    fetch_elements.show(outcome("new"), NOW_S)
    assert capsys.readouterr().out.splitlines() == [
        "http://a/x: new",
        "  3 objects, confirmed 0.3 h ago, in kept.tle",
        "  age of the elements: newest 0.3 h, median 47.9 h, oldest 2.5 d",
        "  may be requested again at 2006-06-28T14:50:00.000Z",
    ]
    fetch_elements.show(outcome("none", "answered 403"), NOW_S)
    assert capsys.readouterr().out.splitlines()[:-1] == ["http://a/x: none", "  problem: answered 403"]
    assert fetch_elements.values(outcome(problem="answered 403"), NOW_S) == {
        "address": "http://a/x", "state": "kept", "problem": "answered 403", "file": "kept.tle", "objects": 3,
        "confirmed_age_h": 0.278, "oldest_h": 60.0, "median_h": 47.9, "newest_h": 0.343,
        "again_utc": "2006-06-28T14:50:00.000Z",
    }  # fmt: skip
    assert fetch_elements.values(outcome(fresh_t_s=0.0), NOW_S)["confirmed_age_h"] is None


def test_a_command_takes_an_address_and_goes_on_with_the_kept_file(
    source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    argv = ["--elements", source.address, "--satellite", str(FRESH[0].catalogue_number), "--json", "--hours", "24"]
    plan_passes.main(argv)
    first = json.loads(capsys.readouterr().out)
    assert first
    assert len(source.asked) == 1
    # Two hours later the source is gone: the plan is the same, and says so.
    state = kept_file(source.address, cache_folder())
    record = state.with_name(f".{state.name}.json")
    record.write_text(json.dumps(json.loads(record.read_text()) | {"requested_t_s": 0.0, "hold_t_s": 0.0}))
    source.status = 500
    fetching.current_elements.cache_clear()
    plan_passes.main(argv)
    text = capsys.readouterr()
    assert json.loads(text.out) == first
    assert "answered 500 Internal Server Error; the elements that were confirmed 0.0 h ago are used" in text.err
    # Without any elements it ends with the reason.
    with pytest.raises(SystemExit) as stopped:
        plan_passes.main(["--elements", f"{source.address}&MORE=1"])
    assert stopped.value.code == 2
    assert "answered 500 Internal Server Error" in capsys.readouterr().err
