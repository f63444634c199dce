"""The live part of `calibrate`: campaign, fit, some passes with the new model in the shadow, acceptance.

Simulated time stands still while nothing is tracked, so that the plan of the passes holds however long a fit takes.
"""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.action import ActionClient
from rf_pointing_msgs.action import FitModel, RunCampaign
from std_srvs.srv import Trigger

from rf_pointing.ephemeris import Pass
from rf_pointing.nodes import convert_planning
from rf_pointing.nodes.processes import SIMULATED_STATION
from rf_pointing.nodes.track import NotStartedError, Run

__all__ = ["CalibrationRun", "Outcome"]

ANSWER_S = 60.0
CLOCK = SIMULATED_STATION[:1]


@dataclass(frozen=True)
class Outcome:
    """How a calibration ended: name of the fitted model (empty: none), whether it is in force, what the shadow said.

    `settled` is True when the shadow decided, also against the new model: the better of the two is in force.
    """

    model: str = ""
    accepted: bool = False
    settled: bool = False
    shadow: str = ""


class CalibrationRun(Run):
    """One calibration on the live graph: `windows` are tracked for the fit, `shadow` beside its result.

    `on_fit` is called when a model has been fitted, before anything else is observed, and `say` with what the user should
    know.
    """

    def __init__(
        self,
        options: argparse.Namespace,
        windows: Sequence[Pass],
        shadow: Sequence[Pass],
        output: Path,
        say: Callable[[str], None],
        on_fit: Callable[[], None],
    ) -> None:
        super().__init__(options, [*windows, *shadow][0], output)
        self._windows, self._shadow, self._say, self._on_fit = windows, shadow, say, on_fit
        self._shown, self._count = 0, 0
        self._campaign = ActionClient(self._node, RunCampaign, "bias_calibrator/run_campaign")
        self._fit = ActionClient(self._node, FitModel, "bias_calibrator/fit_model")

    def calibrate(self) -> Outcome:
        """Bring the graph up, run the campaign, fit, run the shadow and accept the model if it did better there."""
        self._processes.start(SIMULATED_STATION)
        self._bring_up()
        if self._windows:
            campaign = self._observe(self._windows, resume=self._options.resume)
            if self._stopping:
                self._say(f"interrupted with {campaign.observations} observations")
                return Outcome()
        fit = self._result(self._goal(self._fit, FitModel.Goal(), None))
        self._say(fit.message)
        if not fit.success:
            return Outcome()
        self._on_fit()
        shadow = self._observe(self._shadow, resume=True)
        if self._stopping:
            self._say(f"interrupted; {fit.model.name} is not in force")
            return Outcome(fit.model.name)
        if shadow.verdict != "better":
            self._say(f"{self._call('bias_calibrator/reject').message}: the old model stays in force")
            enough = shadow.verdict == "undecided" and shadow.passes_observed >= len(self._shadow)
            return Outcome(fit.model.name, settled=enough, shadow=shadow.message)
        answer = self._call("bias_calibrator/accept")
        self._say(answer.message)
        return Outcome(fit.model.name, answer.success, answer.success, shadow.message)

    def _observe(self, windows: Sequence[Pass], *, resume: bool) -> RunCampaign.Result:
        """Run a campaign of these passes; time runs only meanwhile."""
        self._shown, self._count = 0, len(windows)
        passes = [convert_planning.pass_to_message(window) for window in windows]
        goal = RunCampaign.Goal(passes=passes, sensor=self._options.sensor, resume=resume)
        handle = self._goal(self._campaign, goal, self._show)
        self._change(CLOCK, "activate")
        result = self._result(handle)
        self._change(CLOCK, "deactivate")
        self._progress.end()
        self._say(result.message)
        return result

    def _goal(self, client: ActionClient, goal: Any, feedback: Any) -> Any:
        self._until(client.server_is_ready, "bias_calibrator offers no actions")
        future = client.send_goal_async(goal, feedback_callback=feedback)
        self._until(future.done, "bias_calibrator does not answer to a goal")
        if not future.result().accepted:
            raise NotStartedError(f"bias_calibrator refused the goal: {self._processes.complaint('bias_calibrator')}")
        return future.result()

    def _result(self, handle: Any) -> Any:
        result, cancelled = handle.get_result_async(), False
        while not result.done():
            self.spin(0.1)
            self._check_alive()
            if self._stopping and not cancelled:
                cancelled = True
                handle.cancel_goal_async()
        return result.result().result

    def _call(self, name: str) -> Trigger.Response:
        client = self._node.create_client(Trigger, name)
        self._until(client.service_is_ready, f"{name} is not offered")
        future = client.call_async(Trigger.Request())
        self._until(future.done, f"{name} does not answer")
        return future.result()

    def _until(self, condition: Callable[[], bool], complaint: str) -> None:
        deadline_s = time.monotonic() + ANSWER_S
        while not condition():
            self._check_alive()
            if time.monotonic() > deadline_s:
                raise NotStartedError(complaint)
            self.spin(0.05)

    def _show(self, message: Any) -> None:
        state = message.feedback
        if not sys.stderr.isatty() and state.pass_number == self._shown:
            return
        self._shown = state.pass_number
        text = (
            f"pass {state.pass_number} of {self._count}, {state.target}: {state.observations} observations, "
            f"{state.sectors_filled} of 36 sectors"
        )
        print(
            f"\r{text:<78}" if sys.stderr.isatty() else text, end="" if sys.stderr.isatty() else "\n", file=sys.stderr
        )
