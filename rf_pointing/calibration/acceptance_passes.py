"""Shadow running: a new model is scored on live passes, with the active one, before it is accepted.

Per pass the rms miss on the sky of both models is kept; the verdict is a paired t test of its
difference over passes (docs/decisions/0064).
"""

import math
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.observations import Observations
from rf_pointing.core import Array, Params, parameter, wrap_rad


@dataclass(frozen=True, kw_only=True)
class AcceptanceRules(Params):
    """When a verdict is given, and which one a candidate needs to be accepted."""

    fewest_passes: int = parameter(3, "passes before a verdict", 2, 1000)
    t_limit: float = parameter(
        2.0, "paired t value beyond which a model is better or worse", 0.5, 10.0
    )
    accept: str = parameter(
        "better",
        "verdict that a candidate needs to be accepted; with 'not worse' it need not have been observed",
        choices=("better", "not worse"),
    )


@dataclass(frozen=True)
class Verdict:
    """Outcome so far: `word` (better, worse, undecided) for the candidate, and its numbers."""

    word: str
    passes: int
    active_rms_rad: float
    candidate_rms_rad: float
    t_value: float


@dataclass(eq=False)
class AcceptanceScore:
    """Running score of `candidate` against `active`."""

    active: BiasModel
    candidate: BiasModel
    rules: AcceptanceRules
    # Rows of each pass, and the sums of the squared misses of both models over them.
    _sums: dict[int, Array] = field(default_factory=dict)

    def add(self, observations: Observations) -> None:
        """Score observations of one or more passes; a pass may come in pieces."""
        # Exact forms of both: near the zenith the printed one would score its own error.
        active, candidate = (
            _misses(model, observations) for model in (self.active, self.candidate)
        )
        for number in observations.passes.tolist():
            rows = observations.pass_id == number
            sums = np.array([np.sum(rows), np.sum(active[rows]), np.sum(candidate[rows])])
            self._sums[number] = self._sums.get(number, np.zeros(3)) + sums

    def verdict(self) -> Verdict:
        """Return the outcome so far; raises ValueError before the first observation."""
        if not self._sums:
            raise ValueError("observations=0: the shadow score has nothing to judge yet")
        counts, active, candidate = np.array(list(self._sums.values())).T
        # Over passes, as the errors within one are correlated; rms, as misses of 80 and 200 mdeg
        # are the same finding, which mean squares would call scatter.
        t_value = _paired_t(np.sqrt(active / counts) - np.sqrt(candidate / counts))
        word = "undecided"
        if len(counts) >= self.rules.fewest_passes and abs(t_value) >= self.rules.t_limit:
            word = "better" if t_value > 0.0 else "worse"
        rms = [math.sqrt(np.sum(squares) / np.sum(counts)) for squares in (active, candidate)]
        return Verdict(word, len(counts), rms[0], rms[1], t_value)


def _paired_t(gain: Array) -> float:
    """Return the t value of the mean of `gain` (n,); 0 for one value, which decides nothing."""
    # Without spread any gain is certain; a model against itself has neither and stays undecided.
    mean, spread = float(np.mean(gain)), float(np.std(gain))
    if len(gain) < 2 or mean == 0.0:
        return 0.0
    return (
        mean / spread * math.sqrt(len(gain) - 1) if spread > 0.0 else math.copysign(math.inf, mean)
    )


def _misses(model: BiasModel, data: Observations) -> Array:
    azimuth, elevation = model.apply(*data.motion(), temperature_k=data.temperature_k)
    across = wrap_rad(data.observed_azimuth_rad - azimuth) * np.cos(data.true_elevation_rad)
    return np.asarray(across**2 + (data.observed_elevation_rad - elevation) ** 2)
