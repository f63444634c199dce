"""LQG law of one axis with integral action: its design, its file, its loop.

    v(k) = -K x(k),   x(k+1) = A x(k) + B v(k) + L (-e(k) - C x(k)),   u = N(z) [ S(z) v + F r' ]

x holds the axis angle and drive rate (as deviations from the command), the states of the notch N
and of the shaping section S, and a slow rate disturbance; the last makes the integral action.  e is
command minus encoder.

A design is made by `lqg_design.py` from a model of the axis.  The package brings those for
DSS-13, which `benchmarks/lqg_tuning.py` made; its output lies next to it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.controllers.filters import LawMatrices, SectionParams, before_sections, notch_section
from rf_pointing.controllers.position_law import LawState, PositionLaw
from rf_pointing.core import AXES, Params, parameter
from rf_pointing.core.types import Array
from rf_pointing.core.whole_file import parse_json, read_whole

MATRICES = ("a", "b", "c", "state_gain", "observer_gain", "model_a", "model_b", "model_c", "model_d")
FORMAT = "rf_pointing LQG designs 1"
_PACKAGED = "dss13_lqg.json"


@dataclass(frozen=True, kw_only=True)
class LqgWeights(Params):
    """The choices of the designer: the notch and the section in series, and three ratios."""

    notch_frequency_hz: float = parameter(description="notch in the rate command", low=0.01, high=100.0)
    notch_damping: float = parameter(description="width of the notch", low=0.01, high=3.0)
    shaping_zero_hz: float = parameter(description="zeros of the section", low=0.01, high=100.0)
    shaping_zero_damping: float = parameter(description="damping of its zeros", low=0.0, high=5.0)
    shaping_pole_hz: float = parameter(description="poles of the section", low=0.01, high=100.0)
    shaping_pole_damping: float = parameter(description="damping of its poles", low=0.001, high=5.0)
    control_weight: float = parameter(description="price of rate over price of angle", low=1e-9, high=1e6)
    disturbance_intensity: float = parameter(
        description="variance per step of the rate disturbance over encoder variance", low=1e-12, high=1e6
    )
    rate_intensity: float = parameter(
        description="variance per step of the drive rate over encoder variance", low=0.0, high=1e6
    )

    @property
    def notch(self) -> SectionParams:
        """The notch's own parameter set."""
        return notch_section(self.notch_frequency_hz, self.notch_damping)

    @property
    def shaping(self) -> SectionParams:
        """The section's own parameter set."""
        return SectionParams(
            zero_hz=self.shaping_zero_hz,
            zero_damping=self.shaping_zero_damping,
            pole_hz=self.shaping_pole_hz,
            pole_damping=self.shaping_pole_damping,
        )


LqgGains = tuple[Array, Array, Array, Array, Array]
"""a (7, 7), b (7, 1), c (1, 7), state gain (1, 7), observer gain (7, 1)."""


@dataclass(frozen=True, slots=True)
class LqgDesign:
    """Matrices of the law, the drive it was made for and the margins found on the full model.

    `a` (7, 7), `b` (7, 1), `c` (1, 7), `state_gain` (1, 7), `observer_gain` (7, 1); `model_a` (n,
    n) to `model_d` (1, 1) is the identified model from rate command to encoder,
    `drive_bandwidth_rad_s` and `drive_gain` what was read off it; `peak_sensitivity`,
    `gain_margin_db`, `phase_margin_rad` are of the encoder loop on it.
    """

    a: Array
    b: Array
    c: Array
    state_gain: Array
    observer_gain: Array
    model_a: Array
    model_b: Array
    model_c: Array
    model_d: Array
    sample_s: float
    drive_bandwidth_rad_s: float
    drive_gain: float
    weights: LqgWeights
    peak_sensitivity: float
    gain_margin_db: float
    phase_margin_rad: float

    @property
    def notch(self) -> SectionParams:
        """The notch's own parameter set."""
        return self.weights.notch

    def matrices(self, sample_s: float) -> LawMatrices:
        """Return the law from error to rate command, sampled; its feedforward lies outside.

        Raises
        ------
        ValueError
            If `sample_s` is not the sampling time of the design.
        """
        # The matrices of a design hold for one sampling time; there is no conversion that keeps its
        # margins.
        if abs(sample_s - self.sample_s) > 1e-6:
            raise ValueError(f"sample_s={sample_s} must be {self.sample_s}, the sampling time of the LQG design")
        gains = self.a, self.b, self.c, self.state_gain, self.observer_gain
        return law_matrices(gains, self.weights, sample_s)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> "LqgDesign":
        """Return the design in `values`; an unknown or missing key is an error."""
        unknown, missing = sorted(set(values) - set(cls.__slots__)), sorted(set(cls.__slots__) - set(values))
        if unknown or missing:
            raise ValueError(f"LQG design has unknown keys {unknown} and lacks {missing}")
        parts: dict[str, Any] = {name: np.array(values[name], dtype=np.float64) for name in MATRICES}
        numbers = {name: values[name] for name in cls.__slots__ if name not in MATRICES and name != "weights"}
        return cls(**parts, **numbers, weights=LqgWeights.from_mapping(values["weights"]))


def law_matrices(gains: LqgGains, weights: LqgWeights, sample_s: float) -> LawMatrices:
    """Return the law of these gains from error to rate command, its filters included."""
    a, b, c, state_gain, observer_gain = gains
    core = a - b @ state_gain - observer_gain @ c
    law = core, -observer_gain, -state_gain, np.zeros((1, 1))
    # In the order of the loop, so that the states are those of the code that runs.
    return before_sections(law, (weights.shaping, weights.notch), sample_s)


def load_lqg_designs(path: Path | None = None) -> tuple[LqgDesign, LqgDesign]:
    """Return the designs (azimuth, elevation) in `path`, those for DSS-13 without one.

    Raises
    ------
    ValueError
        For an unreadable file, another format, or an unknown or missing key.
    """
    source = Path(__file__).with_name(_PACKAGED) if path is None else path
    try:
        content = parse_json(read_whole(source))
    except (OSError, ValueError) as error:
        raise ValueError(f"{source}: no LQG designs: {error}") from error
    if not isinstance(content, Mapping) or content.get("format") != FORMAT:
        raise ValueError(f"{source}: format must be {FORMAT!r}")
    unknown, missing = sorted(set(content) - {"format", *AXES}), sorted(set(AXES) - set(content))
    if unknown or missing:
        raise ValueError(f"{source}: unknown keys {unknown}, lacks {missing}")
    try:
        azimuth, elevation = (LqgDesign.from_mapping(content[axis]) for axis in AXES)
    except (TypeError, KeyError, AttributeError, OverflowError) as error:
        raise ValueError(f"{source}: no LQG designs: {type(error).__name__}: {error}") from error
    return azimuth, elevation


@dataclass(frozen=True, kw_only=True)
class LqgLoopParams(Params):
    """Parameters that may change while the law runs; the law itself is the design."""

    feedforward_gain: float = parameter(1.0, "share of the command's rate fed forward", low=0.0, high=1.2)
    feedforward_band_hz: float = parameter(10.0, "low-pass of the feedforward", low=0.1, high=100.0)
    feedforward_lead_s: float = parameter(0.0, "acceleration fed forward: lag to make up for", low=0.0, high=1.0)
    rate_limit_rad_s: float = parameter(math.radians(2.0), "largest rate command", low=1e-6, high=10.0)


@dataclass(slots=True, kw_only=True)
class LqgLoopState(LawState):
    """State of every law, the estimate (7,) and the regulator's output."""

    estimate: Array
    regulator_rad_s: float = 0.0


class LqgLoop(PositionLaw[LqgLoopParams, LqgLoopState]):
    """One axis' LQG law; starts from a zero estimate."""

    def __init__(self, design: LqgDesign, params: LqgLoopParams) -> None:
        state, weights = LqgLoopState(estimate=np.zeros(len(design.a))), design.weights
        super().__init__(params, state, weights.shaping, weights.notch, params.feedforward_band_hz, design.sample_s)
        self._design = design
        self._step = np.hstack([design.a - design.observer_gain @ design.c, design.b, -design.observer_gain])

    def retune(self, params: LqgLoopParams) -> None:
        """Take new parameters without a jump: the estimated disturbance takes over."""
        taken = (self.params.feedforward_gain - params.feedforward_gain) * self._feedforward.state.memory[0]
        self._feedforward.retune(params.feedforward_band_hz)
        self._state.estimate = self._state.estimate + taken * self._constant_output()
        self._shaping.shift(taken)
        self.params = params

    def _constant_output(self) -> Array:
        """Return the change of the estimate (7,) with which the law gives one unit more, for good.

        Both filters of the estimate hold the unit; the disturbance, which acts where the rate does,
        explains it.
        """
        change = np.zeros(len(self._design.a))
        # 3 and 5 are the low-pass states of notch and section: a constant fills them, and no other
        # filter state.
        change[[3, 5]] = 1.0
        change[-1] = -(1.0 + float(self._design.state_gain[0] @ change)) / self._design.state_gain[0, -1]
        return change

    def _settled(self, error_rad: float, command_rad_s: float, fed_rad_s: float) -> LqgLoopState:
        wanted = command_rad_s - fed_rad_s
        gain = self._design.state_gain[0]
        estimate = wanted * self._constant_output()
        estimate[0] = -error_rad
        # The disturbance takes what the angle error would command, so that the output is as wanted.
        estimate[-1] += gain[0] * error_rad / gain[-1]
        return LqgLoopState(error_rad=error_rad, command_rad_s=command_rad_s, estimate=estimate, regulator_rad_s=wanted)

    def _feedback(self) -> float:
        self._state.regulator_rad_s = -float(self._design.state_gain[0] @ self._state.estimate)
        return self._state.regulator_rad_s

    def _advance(self, dt_s: float, applied_rad_s: float) -> None:
        if abs(dt_s - self._design.sample_s) > 1e-6:
            raise ValueError(f"dt_s={dt_s} must be {self._design.sample_s}, the sampling time of the design")
        state = self._state
        # The estimator works on what went out: neither a saturated drive nor a change of mode winds
        # it up.
        really = state.regulator_rad_s + applied_rad_s - state.command_rad_s
        state.estimate = self._step @ np.concatenate([state.estimate, (really, state.error_rad)])
