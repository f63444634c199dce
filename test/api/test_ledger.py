"""A planted cause is found, and a recording gives the ledger of the pass that it is of."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.commands import budget as command
from rf_pointing.commands import report as report_command
from rf_pointing.report.error_ledger import COLOURS, LAG, MODEL, SCAN, UNEXPLAINED, WIND
from rf_pointing.report.recorded_signals import read_pass
from rf_pointing.report.replay_case import RecordedCase
from test.api.headless_bag import HeadlessBag
from test.scripts import script_module

SECONDS, SCANNED_S, LARGEST = 12.0, 40.0, 0.1
"""Lengths of the flights, of one with a scan, and share of the largest cause within which every other one is found."""


@pytest.fixture(scope="module")
def script() -> Any:
    return script_module("benchmarks/error_ledger.py")


@pytest.fixture(scope="module")
def case(script: Any) -> Any:
    return script.Case("leo_3m7", "program", SECONDS)


@pytest.fixture(scope="module")
def flown(script: Any, case: Any) -> HeadlessBag:
    """12 m/s of wind on a dish whose model is 20 mdeg more off, by program track."""
    flight: HeadlessBag = case.flown(script.merged(case.causes[MODEL][0], case.causes[WIND][0]))
    return flight


def test_two_planted_causes_are_found_and_a_recording_has_the_same_ledger(
    script: Any, case: Any, flown: HeadlessBag, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    planted = script.merged(case.causes[MODEL][0], case.causes[WIND][0])
    truth = case.truth(planted)
    report_command.main([str(flown.write(tmp_path / "run")), "--ledger"])
    assert "wind and structure" in capsys.readouterr().out
    # The command leaves it with the report.
    assert "Error ledger" in (tmp_path / "run" / "report.html").read_text()
    found = rp.Ledger.read(tmp_path / "run")
    assert found is not None
    print(found, truth)
    near = LARGEST * max(truth.values())
    for row, true_mdeg in truth.items():
        assert found.cause(row).rms_mdeg == pytest.approx(true_mdeg, abs=near), row
    assert found.largest.name == MODEL
    errors = np.hypot(*flown.log.errors_rad()[np.array(flown.log.t_s) >= case.one.aos_t_s].T)
    assert found.rms_mdeg == pytest.approx(np.sqrt(np.mean(errors**2)) / np.radians(1e-3), rel=1e-6)
    assert found.sum_db == pytest.approx(found.loss_db, rel=1e-9)
    predicted = case.ledger(planted)
    assert predicted.source == "predicted"
    for name in COLOURS:
        one, other = found.cause(name), predicted.cause(name)
        assert (one.rms_mdeg, one.loss_db) == pytest.approx((other.rms_mdeg, other.loss_db), rel=1e-3, abs=1e-3), name


def test_what_nothing_has_measured_is_named(flown: HeadlessBag, tmp_path: Path) -> None:
    real = flown.write(tmp_path / "real", without=("sim/pointing_error",), run=False)
    found = rp.ledger(real)
    assert found.source == "sensed"
    assert any("no valid pointing_error in the pass" in each for each in found.remarks)
    assert any("no run.yaml" in each for each in found.remarks)
    other = RecordedCase(real, read_pass(real), "dss13")
    assert any("another station or version" in each for each in other.remarks)
    assert found.cause(LAG).rms_mdeg > 0.0
    for missing in ("tracking_status", "joint_states"):
        bag = flown.write(tmp_path / missing, without=(missing,))
        with pytest.raises(ValueError, match=missing):
            rp.ledger(bag)


def test_a_real_pass_is_split_by_what_its_tracking_shows(script: Any, tmp_path: Path) -> None:
    case = script.Case("leo_3m7", None, SCANNED_S)
    begin_s, end_s = (case.one.aos_t_s + each for each in (32.0, 38.0))
    flown, truth = case.flown(case.causes[MODEL][0]), ("sim/pointing_error",)
    found = rp.ledger(flown.write(tmp_path / "run", without=truth, run=False, hole_s=(begin_s, end_s)))
    text = str(found)
    print(text)
    # What was not recorded is named.
    assert "joint_states has 1 gaps, the longest 6.0 s, 32 s after acquisition" in text
    assert "% of the errors of the pass were recorded" in text
    assert found.source == "sensed"
    assert found.sum_db == pytest.approx(found.loss_db, rel=1e-9)
    assert "the prediction is off by" in found.cause(MODEL).note
    assert "±" in found.cause(MODEL).note
    # The circle of a conscan is known from the command, whatever else is not.
    assert found.cause(SCAN).rms_mdeg > 10.0
    assert found.cause(UNEXPLAINED).rms_mdeg > 0.0


def test_the_command_prints_the_table_and_keeps_it(
    case: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    station = str(tmp_path / "station.yaml")
    case.station.description.write(tmp_path / "station.yaml", {})
    command.main(["--station", station, "--minutes", "0.1", "--sensor", "program", "--late", "0.5", "--wind", "0",
                  "--output", str(tmp_path / "budget")])  # fmt: skip
    text = capsys.readouterr().out
    assert "elements off by 0.5 s, wind of 0 m/s" in text
    assert all(name in text for name in COLOURS)
    assert rp.Ledger.read(tmp_path / "budget") is not None
    for refused, reason in ((["--sensor", "sonar"], "sonar"), (["--min-peak", "89.9"], "does not rise that high")):
        with pytest.raises(SystemExit) as ended:
            command.main(["--station", station, *refused])
        assert ended.value.code == 2
        assert reason in capsys.readouterr().err
