"""A calibration as a client of `bias_calibrator`: campaign, fit, shadow, acceptance."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.action import ActionClient
from rf_pointing_msgs.action import FitModel, RunCampaign

from rf_pointing.calibration import FitResult, Observations
from rf_pointing.ephemeris import Pass
from rf_pointing.ros import convert_planning
from rf_pointing.ros.station_run import RunSetup, StationRun
from rf_pointing.station.campaign.schedule import CalibrationSchedule

Fit = tuple[Observations, FitResult]


@dataclass(frozen=True)
class CalibrationOutcome:
    """How a calibration ended: the fitted model (empty: none), and the `verdict` on it.

    `fit` is made of the observations before the shadow added its own.  `settled` is True when the
    shadow decided, also against the new model: the better of the two is in force.  `fault` is what
    stopped the campaign.  `why` are the reasons of a campaign without a fit.
    """

    model: str = ""
    fit: Fit | None = None
    settled: bool = False
    verdict: str = ""
    fault: str = ""
    why: tuple[str, ...] = ()


class CalibrationRun(StationRun):
    """One calibration on the live graph; `fit` returns the fit of the observations on the disk.

    Simulated time stands still while nothing is tracked, so that the plan of the passes holds
    however long a fit takes.
    """

    def __init__(
        self, setup: RunSetup, schedule: CalibrationSchedule, sensor: str, fit: Callable[[], Fit], *, resume: bool
    ) -> None:
        super().__init__(setup)
        self._schedule, self._sensor, self._made, self._resume = schedule, sensor, fit, resume
        self._shown, self._count, self._told = 0, 0, list[str]()
        self._campaign = ActionClient(self.node, RunCampaign, "bias_calibrator/run_campaign")
        self._fit = ActionClient(self.node, FitModel, "bias_calibrator/fit_model")

    def calibrate(self) -> CalibrationOutcome:
        """Bring the graph up, run campaign, fit and shadow; accept the model if it is better."""
        self.bring_up(self._campaign, self._fit)
        if self._schedule.windows:
            campaign = self._observe(self._schedule.windows, resume=self._resume)
            if self.stopping:
                self.say(f"interrupted with {campaign.observations} observations")
                return CalibrationOutcome(why=("it was interrupted", *self._told))
            if campaign.fault:
                return CalibrationOutcome(fault=campaign.fault, why=(campaign.message,))
        fit = self.result(self.send(self._fit, FitModel.Goal(), "bias_calibrator"))
        self.say(fit.message)
        if not fit.success:
            return CalibrationOutcome(why=(fit.message, *self._told))
        # Before the shadow adds observations: the report is that of the fit.
        made = self._made()
        judged = self._observe(self._schedule.acceptance_passes, resume=True)
        if self.stopping:
            self.say(f"interrupted; {fit.model.name} is not in force")
            return CalibrationOutcome(fit.model.name, made)
        if judged.fault:
            return CalibrationOutcome(fit.model.name, made, fault=judged.fault)
        if judged.verdict != "better":
            self.say(f"{self.request('bias_calibrator/reject').message}: the old model stays in force")
            enough = judged.verdict == "undecided" and judged.passes_observed >= len(self._schedule.acceptance_passes)
            return CalibrationOutcome(fit.model.name, made, enough, judged.message)
        answer = self.request("bias_calibrator/accept")
        self.say(answer.message)
        return CalibrationOutcome(fit.model.name, made, answer.success, judged.message)

    def _observe(self, windows: Sequence[Pass], *, resume: bool) -> RunCampaign.Result:
        """Run a campaign of these passes; time runs only meanwhile."""
        self._shown, self._count = 0, len(windows)
        passes = [convert_planning.pass_to_message(window) for window in windows]
        goal = RunCampaign.Goal(passes=passes, sensor=self._sensor, resume=resume)
        handle = self.send(self._campaign, goal, "bias_calibrator", self._show)
        self.run_time()
        result = self.result(handle)
        self.hold_time()
        if sys.stderr.isatty():
            print(file=sys.stderr)
        self.say(result.message)
        self._told.append(result.message)
        return result

    def _show(self, message: Any) -> None:
        state = message.feedback
        text = (
            f"pass {state.pass_number} of {self._count}, {state.target}: so far {state.observations} observations, "
            f"{state.sectors_filled} of 36 sectors"
        )
        if sys.stderr.isatty():
            print(f"\r{text:<78}", end="", file=sys.stderr)
        elif state.pass_number != self._shown:
            print(text, file=sys.stderr)
        self._shown = state.pass_number
