"""Manual-rate mode: an identification experiment, one at a time, gives the rate commands in place of the position laws."""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.identification import IdentificationExperiment

__all__ = ["ManualRate"]

Array = NDArray[np.float64]
SAME_S = 1e-9


class ManualRate:
    """`begin` an experiment that is not refused, ask for its `rates` once a tick of `tick_s`, and `end` it."""

    def __init__(self, tick_s: float) -> None:
        self._tick_s = tick_s
        self._experiment: IdentificationExperiment | None = None

    def refusal(self, experiment: IdentificationExperiment, limits: CommandPreprocessorParams) -> str:
        """Return why an experiment does not suit this antenna, "" if it does."""
        if abs(experiment.sample_s - self._tick_s) > SAME_S:
            return f"sample_s={experiment.sample_s} must be {self._tick_s}, the control period"
        limit = min(limits.rate_limit_rad_s)
        if experiment.peak_rad_s > limit:
            return f"peak_rad_s={experiment.peak_rad_s} must be <= {limit}, the rate limit"
        return ""

    def begin(self, experiment: IdentificationExperiment) -> None:
        """Take the rate commands from this experiment."""
        self._experiment = experiment

    def rates(self, measured_rad: Array, barred: str) -> tuple[Array, str]:
        """Return the rate commands (2,) for encoder angles (2,), and why the experiment ends here ("" if it goes on).

        `barred` says why the motion must not go on, "" if it may.
        """
        assert self._experiment is not None
        if not self._experiment.finished and not barred:
            rates = self._experiment.command(measured_rad)
            if not self._experiment.abort_reason:
                return rates, ""
        return np.zeros(2), self._experiment.abort_reason or barred or "complete"

    def end(self, reason: str) -> None:
        """Let the experiment go; one that has not finished is aborted for this reason."""
        if self._experiment is not None and not self._experiment.finished:
            self._experiment.abort(reason)
        self._experiment = None
