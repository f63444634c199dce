"""The live part of `calibrate`: campaign, fit, passes in the shadow, acceptance.

Simulated time stands still while nothing is tracked, so that the plan of the passes holds however
long a fit takes.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.action import ActionClient
from rf_pointing_msgs.action import FitModel, RunCampaign
from std_srvs.srv import Trigger

from rf_pointing.calibration import Campaign, FitResult, Observations
from rf_pointing.commands.station_run import StationRun
from rf_pointing.ephemeris import Elements, Pass
from rf_pointing.nodes import convert_planning

Fit = tuple[Observations, FitResult]


@dataclass(frozen=True, eq=False)
class Schedule:
    """What is tracked: `windows` for the fit (none when the sky is full), then `shadow`."""

    elements: list[Elements]
    campaign: Campaign
    windows: list[Pass]
    shadow: list[Pass]


@dataclass(frozen=True)
class Outcome:
    """How a calibration ended: the fitted model (empty: none), and the verdict of the shadow.

    `fit` is made of the observations before the shadow added its own.  `settled` is True when the
    shadow decided, also against the new model: the better of the two is in force.
    """

    model: str = ""
    fit: Fit | None = None
    settled: bool = False
    shadow: str = ""


class CalibrationRun(StationRun):
    """One calibration on the live graph; `read_fit` returns the observations and their fit."""

    def __init__(
        self, options: argparse.Namespace, schedule: Schedule, output: Path, read_fit: Callable[[], Fit]
    ) -> None:
        super().__init__("calibrate", options, [*schedule.windows, *schedule.shadow][0], output)
        self._options, self._schedule, self._read_fit = options, schedule, read_fit
        self._shown, self._count = 0, 0
        self._campaign = ActionClient(self.node, RunCampaign, "bias_calibrator/run_campaign")
        self._fit = ActionClient(self.node, FitModel, "bias_calibrator/fit_model")

    def calibrate(self) -> Outcome:
        """Bring the graph up, run campaign, fit and shadow; accept the model if it is better."""
        self.bring_up(self._campaign, self._fit)
        if self._schedule.windows:
            campaign = self._observe(self._schedule.windows, resume=self._options.resume)
            if self.stopping:
                self.say(f"interrupted with {campaign.observations} observations")
                return Outcome()
        fit = self.result(self.send(self._fit, FitModel.Goal(), "bias_calibrator"))
        self.say(fit.message)
        if not fit.success:
            return Outcome()
        # Before the shadow adds observations: the report is that of the fit.
        made = self._read_fit()
        shadow = self._observe(self._schedule.shadow, resume=True)
        if self.stopping:
            self.say(f"interrupted; {fit.model.name} is not in force")
            return Outcome(fit.model.name, made)
        if shadow.verdict != "better":
            self.say(f"{self._call('bias_calibrator/reject').message}: the old model stays in force")
            enough = shadow.verdict == "undecided" and shadow.passes_observed >= len(self._schedule.shadow)
            return Outcome(fit.model.name, made, enough, shadow.message)
        answer = self._call("bias_calibrator/accept")
        self.say(answer.message)
        return Outcome(fit.model.name, made, answer.success, shadow.message)

    def _observe(self, windows: Sequence[Pass], *, resume: bool) -> RunCampaign.Result:
        """Run a campaign of these passes; time runs only meanwhile."""
        self._shown, self._count = 0, len(windows)
        passes = [convert_planning.pass_to_message(window) for window in windows]
        goal = RunCampaign.Goal(passes=passes, sensor=self._options.sensor, resume=resume)
        handle = self.send(self._campaign, goal, "bias_calibrator", self._show)
        self.run_time()
        result = self.result(handle)
        self.hold_time()
        if sys.stderr.isatty():
            print(file=sys.stderr)
        self.say(result.message)
        return result

    def _call(self, name: str) -> Trigger.Response:
        client = self.node.create_client(Trigger, name)
        self.graph.wait_until(client.service_is_ready, name)
        future = client.call_async(Trigger.Request())
        self.graph.wait_until(future.done, f"an answer of {name}")
        return future.result()

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
