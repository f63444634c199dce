"""Every pass of some days is flown as the whole station flies it, whoever flies it and in whatever order."""

import dataclasses
import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.api import ensemble as module
from rf_pointing.commands import simulate
from rf_pointing.ephemeris import ElementUncertainty
from rf_pointing.simulation.draws import Draw


def short(monkeypatch: pytest.MonkeyPatch) -> list[rp.Target]:
    """Return targets whose passes of the next hours are cut to a few seconds, in small batches."""
    found = module.find_passes
    monkeypatch.setattr(
        module, "find_passes",
        lambda *of: [dataclasses.replace(each, los_t_s=each.aos_t_s + 4.0) for each in found(*of)],
    )  # fmt: skip
    return [rp.elements("28057")]


def test_results_depend_neither_on_workers_nor_on_an_interruption(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    station, targets = rp.Station("leo_3m7"), short(monkeypatch)
    seen: list[int] = []
    whole = rp.ensemble(
        station, targets, days=0.3, trials=2, workers=2, output=tmp_path / "a.jsonl",
        progress=lambda done, _all: seen.append(done),
    )  # fmt: skip
    assert seen[-1] == whole.planned == len(whole.rows) > 2
    lines = (tmp_path / "a.jsonl").read_text().splitlines()
    # Cut off in the middle of a line, as by a process that was killed.
    (tmp_path / "b.jsonl").write_text("\n".join([*lines[:3], lines[3][:40]]))
    again = rp.ensemble(station, targets, days=0.3, trials=2, workers=1, output=tmp_path / "b.jsonl")
    assert again.rows == whole.rows
    assert 0.0 < whole.summary["availability"] <= 1.0
    with pytest.raises(ValueError, match="is of another ensemble"):
        rp.ensemble(station, targets, days=0.3, trials=2, seed=2, output=tmp_path / "b.jsonl")


def test_its_processes_end_with_the_first_one_however_that_ends(tmp_path: Path) -> None:
    arguments = ["--station", "leo_3m7", "--days", "1", "--workers", "2", "--output", str(tmp_path / "o.jsonl")]
    first = subprocess.Popen([sys.executable, "-m", "rf_pointing", "simulate", *arguments])
    children = Path(f"/proc/{first.pid}/task/{first.pid}/children")

    def flying(of: list[str]) -> list[str]:
        paths = [Path(f"/proc/{each}/cmdline") for each in of]
        return [each.parent.name for each in paths if each.exists() and "spawn_main" in each.read_text()]

    deadline_s = time.monotonic() + 120.0
    while len(workers := flying(children.read_text().split())) < 2 and time.monotonic() < deadline_s:
        time.sleep(0.1)
    first.kill()
    first.wait()
    assert len(workers) == 2
    while time.monotonic() < deadline_s and flying(workers):
        time.sleep(0.1)
    assert not flying(workers)


def test_the_command_prints_and_keeps_what_the_function_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The rows of a rotator, whose motors start and stop, are those of its simulation."""
    short(monkeypatch)
    kept, words = tmp_path / "o.jsonl", ["--station", "rotator_2m", "--sensor", "program", "--days", "0.5"]
    simulate.main([*words, "--workers", "1", "--output", str(kept)])
    said = capsys.readouterr().out
    assert "target within the half-power beam" in said
    flown = [row for row in map(json.loads, kept.read_text().splitlines()[1:]) if not row["refused"]]
    assert all(row["held_s"] <= row["duration_s"] and math.isfinite(row["loss_db"]) for row in flown)
    assert max(row["starts"] for row in flown) > 0
    assert "starts of both motors of a rotator" in said


def test_draws_have_the_wind_and_the_errors_of_the_law() -> None:
    station = rp.Station("leo_3m7")
    window = station.passes(rp.elements("28057"), days=1.0)[0].window
    law, age_s = ElementUncertainty(), 43200.0
    draws = [Draw.of(window, trial, 1, 5.0, law, age_s) for trial in range(4000)]
    along_m, cross_m, _ = law.sigmas_m(age_s)
    # Four standard errors of 4000 draws.
    assert np.mean([each.wind_m_s for each in draws]) == pytest.approx(5.0, rel=0.035)
    assert np.std([each.along_track_s for each in draws]) == pytest.approx(along_m / 7500.0, rel=0.045)
    sigma = cross_m / window.smallest_range_m
    assert np.std([each.cross_track_rad for each in draws]) == pytest.approx(sigma, rel=0.045)
    assert draws[17] == Draw.of(window, 17, 1, 5.0, law, age_s) != draws[18]
    assert len({each.seed for each in draws}) == len(draws)


def test_what_an_ensemble_does_not_fly_is_refused_by_name() -> None:
    station, target = rp.Station("leo_3m7"), rp.elements("28057")
    with pytest.raises(ValueError, match="without any are Sun"):
        rp.ensemble(station, [rp.elements("Sun")], start="2026-06-21T09:00:00")
    with pytest.raises(ValueError, match="X band of LEO 3.7 m has"):
        rp.ensemble(station, [target], sensor="monopulse")
    with pytest.raises(ValueError, match="targets"):
        rp.ensemble(station, [])
    with pytest.raises(ValueError, match="no pass of"):
        rp.ensemble(station, [target], days=1.0, min_peak_deg=89.9)
