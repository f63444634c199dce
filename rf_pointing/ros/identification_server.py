"""The action `identify` of the antenna: an experiment in manual-rate mode, with its samples.

One goal at a time.  The end of the experiment, a cancelled goal, a stop and a deactivation all end
in the same controlled stop.  Publishes: manual_rate (one message per control tick).
"""

from rf_pointing_msgs.action import Identify
from rf_pointing_msgs.msg import ManualRate

from rf_pointing.core import AXES, random_stream
from rf_pointing.identification import IdentificationExperiment
from rf_pointing.ros import convert_identification as convert
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.one_goal import OneGoal
from rf_pointing.ros.qos import EXPERIMENT
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna

# Once a second at 50 Hz: enough for a progress line.
FEEDBACK_EVERY = 50


class IdentificationServer:
    """Belongs to one node; `tick` after every control tick while the node is active."""

    def __init__(self, node: ManagedNode) -> None:
        self._node = node
        self._antenna: SimulatedAntenna | None = None
        self._experiment: IdentificationExperiment | None = None
        self._axis, self._published = "", 0
        self._goal = OneGoal(node, Identify, "identify", self._begin, self._result, self._cancel)

    def configure(self, antenna: SimulatedAntenna) -> None:
        """Serve this antenna; create the samples' topic."""
        self._antenna = antenna
        self._samples = self._node.stream(ManualRate, "manual_rate", EXPERIMENT)

    def tick(self, t_s: float) -> None:
        """Publish the sample of this tick; conclude the goal once the axes rest after the end."""
        experiment = self._experiment
        if experiment is None or not self._goal.lasts or self._antenna is None:
            return
        if experiment.samples_taken > self._published:
            self._published = experiment.samples_taken
            rate, position, age_s = experiment.newest
            number = self._published - 1
            self._samples.publish(convert.manual_rate_to_message(t_s, self._axis, number, rate, position, age_s))
            if self._published % FEEDBACK_EVERY == 0:
                where = float(position[AXES.index(self._axis)])
                self._goal.report(Identify.Feedback(progress=experiment.progress, position=where))
        # Not before the axes rest: a goal that ends while they move would allow the next one.
        if experiment.finished and self._antenna.mode not in ("manual_rate", "stopping"):
            self._goal.finish()

    def end(self) -> None:
        """Conclude a goal that deactivation has interrupted."""
        self._goal.finish()

    def _begin(self, request: Identify.Goal) -> None:
        """Start the experiment; ValueError says why it cannot be."""
        self._axis, self._published, self._experiment = request.axis, 0, None
        experiment = self._made(request)
        if reason := self._antenna.identify(experiment):
            raise ValueError(reason)
        self._experiment = experiment

    def _made(self, request: Identify.Goal) -> IdentificationExperiment:
        params = convert.excitation_from_goal(request, self._antenna.params.tick_s)
        number = AXES.index(request.axis) if request.axis in AXES else 0
        start_rad = float(self._antenna.reading(0.0).position_rad[number])
        # A stream of each axis' own: the order of the axes changes no input.
        random = random_stream(request.seed, f"excitation {request.axis}")
        travel = self._antenna.axes.travel_rad[number]
        return IdentificationExperiment(params, request.axis, request.sequences, start_rad, travel, random)

    def _cancel(self) -> None:
        if self._experiment is not None:
            self._experiment.abort("the goal was cancelled")

    def _result(self, reason: str) -> Identify.Result:
        experiment, self._experiment = self._experiment, None
        result = Identify.Result(message=reason)
        if experiment is not None:
            result.message, result.samples_taken = experiment.abort_reason, experiment.samples_taken
            result.success = not experiment.abort_reason
        return result
