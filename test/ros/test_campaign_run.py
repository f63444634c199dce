"""A calibration as client of the calibrator: what it asks for in which order, and what each outcome means."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rf_pointing_msgs.action import FitModel, RunCampaign
from rf_pointing_msgs.msg import PointingModel
from std_srvs.srv import Trigger

from rf_pointing.ephemeris import TopocentricTrack, find_passes, verification_elements
from rf_pointing.ros.campaign_run import CalibrationOutcome, CalibrationRun
from rf_pointing.ros.graph import DRIVE_NODES, NODES
from rf_pointing.ros.station_run import RunSetup
from rf_pointing.station.description import read_station
from test.ros.fake_station import BEGIN_S, FakeStation, fake

__all__ = ["fake"]

CAMPAIGN, FIT = "bias_calibrator/run_campaign", "bias_calibrator/fit_model"
ACCEPT, REJECT = "bias_calibrator/accept", "bias_calibrator/reject"
RUNS = [("activate", NODES[:1]), ("deactivate", NODES[:1])]
"""Simulated time goes on only while passes are tracked."""
MADE: Any = ("points", "fit")


@pytest.fixture(scope="module")
def windows() -> list[Any]:
    (elements,) = (one for one in verification_elements() if one.catalogue_number == 28057)
    track = TopocentricTrack(elements, read_station("dss13").site)
    return find_passes(track, elements.epoch_t_s, 4.0 * 86400.0, 0.1)[:7]


@pytest.fixture
def calibrator(fake: FakeStation) -> FakeStation:
    """Return a station whose campaigns and fit succeed, and whose new model is better."""
    done = RunCampaign.Result(message="campaign done", observations=900)
    better = RunCampaign.Result(message="shadow done", verdict="better", passes_observed=3)
    fake.ready_s = 0.0
    fake.results = {
        CAMPAIGN: [done, better],
        FIT: FitModel.Result(success=True, message="fitted", model=PointingModel(name="new")),
    }
    for name in (ACCEPT, REJECT):
        fake.services[name] = lambda _: Trigger.Response(success=True, message="as you wish")
    return fake


@pytest.fixture
def make(calibrator: FakeStation, windows: list[Any], tmp_path: Path) -> Callable[..., CalibrationRun]:
    def make(campaign: int = 4, *, resume: bool = False, real: bool = False) -> CalibrationRun:
        setup = RunSetup(
            program="calibrate", namespace="/gs1", nodes=DRIVE_NODES if real else NODES, simulated=not real,
            parameter_files=(), logs=tmp_path / "logs", bag=tmp_path / "bag", notes={}, begin_s=BEGIN_S + 30.0,
            awaited="the first pass",
        )  # fmt: skip
        schedule: Any = SimpleNamespace(windows=windows[:campaign], acceptance_passes=windows[4:])

        def fit() -> Any:
            calibrator.log.append("fit of the report")
            return MADE

        return CalibrationRun(setup, schedule, "monopulse", fit, resume=resume)

    return make


def after_start(fake: FakeStation) -> list[Any]:
    return fake.log[4:]


def test_a_better_model_is_accepted_and_time_runs_only_while_passes_are_tracked(
    calibrator: FakeStation, make: Callable[..., CalibrationRun], capsys: pytest.CaptureFixture[str]
) -> None:
    assert make().calibrate() == CalibrationOutcome("new", MADE, True, "shadow done")
    assert after_start(calibrator) == [CAMPAIGN, *RUNS, FIT, "fit of the report", CAMPAIGN, *RUNS, ACCEPT]
    campaign, _, shadow = (goal for _, goal in calibrator.goals)
    assert ([len(goal.passes) for goal in (campaign, shadow)], campaign.sensor) == ([4, 3], "monopulse")
    assert (campaign.resume, shadow.resume) == (False, True)
    lines = capsys.readouterr().err.splitlines()[1:]
    assert lines == [f"calibrate: {text}" for text in ("campaign done", "fitted", "shadow done", "as you wish")]


def test_a_full_sky_is_fitted_at_once_and_a_resumed_campaign_continues(
    calibrator: FakeStation, make: Callable[..., CalibrationRun]
) -> None:
    shadow = calibrator.results[CAMPAIGN][1]
    make(resume=True).calibrate()
    assert [goal.resume for _, goal in calibrator.goals if isinstance(goal, RunCampaign.Goal)] == [True, True]
    calibrator.results[CAMPAIGN] = [shadow]
    calibrator.recorder.closed, calibrator.log[:] = False, []
    (Path(calibrator.recorder.given[1])).rmdir()
    assert make(campaign=0).calibrate().settled
    assert after_start(calibrator)[0] == FIT


@pytest.mark.parametrize(
    ("changes", "outcome", "last"),
    [
        ({"accepted": False}, CalibrationOutcome("new", MADE, False, "shadow done"), ACCEPT),
        ({"shadow": {"message": "no better", "verdict": "undecided", "passes_observed": 3}},
         CalibrationOutcome("new", MADE, True, "no better"), REJECT),
        ({"shadow": {"message": "no better", "verdict": "undecided", "passes_observed": 2}},
         CalibrationOutcome("new", MADE, False, "no better"), REJECT),
        ({"shadow": {"message": "worse", "verdict": "worse", "passes_observed": 3}},
         CalibrationOutcome("new", MADE, False, "worse"), REJECT),
        ({"campaign": {"message": "ended", "fault": "drive: overload"}},
         CalibrationOutcome(fault="drive: overload", why=("ended",)), RUNS[1]),
        ({"shadow": {"message": "ended", "fault": "drive: overload", "verdict": "better"}},
         CalibrationOutcome("new", MADE, fault="drive: overload"), RUNS[1]),
        ({"fit": {"success": False, "message": "3 observations"}},
         CalibrationOutcome(why=("3 observations", "campaign done")), FIT),
    ],
)  # fmt: skip
def test_every_outcome_has_its_words_and_its_last_request(
    calibrator: FakeStation, make: Callable[..., CalibrationRun], changes: dict[str, Any],
    outcome: CalibrationOutcome, last: Any,
) -> None:  # fmt: skip
    for place, name in enumerate(("campaign", "shadow")):
        if name in changes:
            calibrator.results[CAMPAIGN][place] = RunCampaign.Result(**changes[name])
    if "fit" in changes:
        calibrator.results[FIT] = FitModel.Result(**changes["fit"])
    if "accepted" in changes:
        calibrator.services[ACCEPT] = lambda _: Trigger.Response(success=False, message="no")
    assert make().calibrate() == outcome
    assert calibrator.log[-1] == last


@pytest.mark.parametrize(
    ("at_s", "outcome"),
    [(0.5, CalibrationOutcome(why=("it was interrupted", "campaign done"))), (2.6, CalibrationOutcome("new", MADE))],
)
def test_the_user_ends_campaign_or_shadow(
    calibrator: FakeStation, make: Callable[..., CalibrationRun], at_s: float, outcome: CalibrationOutcome
) -> None:
    run = make()
    calibrator.at(at_s, run.interrupt)
    assert run.calibrate() == outcome
    assert len(calibrator.cancelled_s) == 1
    assert calibrator.log[-1] == RUNS[1]


@pytest.mark.parametrize("terminal", [False, True])
def test_progress_is_a_line_per_pass_or_one_line_of_a_terminal(
    calibrator: FakeStation, make: Callable[..., CalibrationRun], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], terminal: bool,
) -> None:  # fmt: skip
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    rows = ((0.4, 1, 5), (0.5, 1, 9), (0.6, 2, 12), (2.5, 1, 15))
    for at_s, number, observations in rows:
        state = RunCampaign.Feedback(pass_number=number, target="A", observations=observations, sectors_filled=1)
        calibrator.at(at_s, lambda state=state: calibrator.feedback(SimpleNamespace(feedback=state)))
    make().calibrate()
    shown = capsys.readouterr().err
    of = {0.4: 4, 0.5: 4, 0.6: 4, 2.5: 3}
    texts = [
        f"pass {number} of {of[at_s]}, A: so far {seen} observations, 1 of 36 sectors" for at_s, number, seen in rows
    ]
    if terminal:
        drawn = shown.partition("\r")[2].partition("\n")[0]
        assert [part.rstrip() for part in drawn.split("\r")] == texts[:3]
        assert "\ncalibrate: campaign done\n" in shown
    else:
        # The second campaign begins its lines anew.
        assert [line for line in shown.splitlines() if line.startswith("pass")] == [texts[0], *texts[2:]]
