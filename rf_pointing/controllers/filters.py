"""Filters of the position laws, retunable while they run: section, notch, low-pass.

    section      G(s) = (s^2/w_z^2 + 2 d_z s/w_z + 1) / (s^2/w_p^2 + 2 d_p s/w_p + 1)
    notch        G(s) = (s^2 + w^2) / (s^2 + 2 delta w s + w^2)                          (BWG eq. 8)
    feedforward  F(s) = 1 / (1 + s / w_b)

by the bilinear transform.  The section is prewarped at its zeros, which thus stay at w_z at any
sampling rate: unwarped, a 2.12-Hz notch sampled at 10 Hz would sit at 1.87 Hz.  Its two states are
the band-pass and low-pass outputs of a state-variable filter at w_p: they keep their meaning when
frequency, damping or step change, so a retune makes no jump.

Use: `output(x)` at a sample, then `update(dt_s)` with the time to the next one.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Params, parameter, require_between, require_finite
from rf_pointing.core.types import Array, Pair

LawMatrices = tuple[Array, Array, Array, Array]
"""State space a (n, n), b (n, 1), c (1, n), d (1, 1): x(k+1) = a x + b e, u = c x + d e."""

SectionConstants = tuple[float, float, float, float, float]
"""Tuned gain g, 1 / (1 + g (g + 2 d_p)), 2 d_p, shares of band-pass and high-pass."""


@dataclass(frozen=True, kw_only=True)
class SectionParams(Params):
    """Zeros, poles and switch of the section; its gain at zero frequency is one."""

    enabled: bool = parameter(True, "whether the section acts")
    zero_hz: float = parameter(2.12, "frequency of the zeros", low=0.01, high=500.0)
    zero_damping: float = parameter(0.0, "damping of the zeros, 0 for a notch to the ground", low=0.0, high=5.0)
    pole_hz: float = parameter(2.12, "frequency of the poles", low=0.01, high=500.0)
    pole_damping: float = parameter(0.2, "damping of the poles", low=0.001, high=5.0)


def notch_section(frequency_hz: float, damping: float, *, enabled: bool = True) -> SectionParams:
    """Return the notch as a section: undamped zeros at the frequency of its poles.

    The -3 dB band is 2 `damping` times the frequency wide.
    """
    return SectionParams(enabled=enabled, zero_hz=frequency_hz, pole_hz=frequency_hz, pole_damping=damping)


@dataclass(slots=True)
class FilterState:
    """Memory of this sample, the same for the next one, and the step between them.

    A section remembers its band-pass and its low-pass output, the feedforward its output and input.
    """

    memory: Pair = (0.0, 0.0)
    pending: Pair = (0.0, 0.0)
    dt_s: float = 0.02


class Section:
    """Filter: `output(x)` at a sample, then `update(dt_s)` with the time to the next one."""

    def __init__(self, params: SectionParams, dt_s: float = 0.02) -> None:
        self.state = FilterState()
        self.params = params
        self._prepare(params, dt_s)

    def retune(self, params: SectionParams) -> None:
        """Take new parameters; ValueError, and no change, from half the sampling rate on."""
        self._prepare(params, self.state.dt_s)
        self.params = params

    def reset(self, value: float) -> None:
        """Settle on a constant input."""
        require_finite("value", value)
        self.state = FilterState((0.0, value), (0.0, value), self.state.dt_s)

    def shift(self, value: float) -> None:
        """Add what the section would remember of a constant `value` as its input all along."""
        state = self.state
        state.memory, state.pending = ((band, low + value) for band, low in (state.memory, state.pending))

    def output(self, value: float) -> float:
        """Return the filtered value."""
        state = self.state
        if not self.params.enabled:
            # Kept settled on its input, so that switching it on in motion makes no jump.
            state.pending = 0.0, value
            return value
        result, state.pending = filter_sample(value, state.memory, self.constants)
        return result

    def update(self, dt_s: float) -> None:
        """Commit the sample given to `output`; the next one comes `dt_s` later."""
        state = self.state
        state.memory = state.pending
        # The tangent of the prewarping is not recomputed in every one of the equal steps.
        if dt_s != state.dt_s:
            self._prepare(self.params, dt_s)

    def _prepare(self, params: SectionParams, dt_s: float) -> None:
        require_between("dt_s", dt_s, 1e-5, 10.0)
        nyquist_hz = 0.5 / dt_s
        for name in ("zero_hz", "pole_hz") if params.enabled else ():
            if getattr(params, name) >= nyquist_hz:
                raise ValueError(f"{name}={getattr(params, name)} must be < {nyquist_hz} (half the sampling rate)")
        ratio, twice = params.pole_hz / params.zero_hz, 2.0 * params.pole_damping
        # Prewarped at the zeros; the poles keep their ratio to them.
        g = ratio * math.tan(math.pi * params.zero_hz * dt_s) if params.enabled else 0.0
        share = 2.0 * params.zero_damping * ratio
        self.constants: SectionConstants = (g, 1.0 / (1.0 + g * (g + twice)), twice, share, ratio * ratio)
        self.state.dt_s = dt_s


class RateFeedforward:
    """Low-pass of the rate: `output` at a sample, then `update` with the time to the next one."""

    def __init__(self, band_hz: float, dt_s: float = 0.02) -> None:
        self.state = FilterState(dt_s=dt_s)
        self.retune(band_hz)

    def retune(self, band_hz: float) -> None:
        """Take a new band limit from the next sample on."""
        require_between("band_hz", band_hz, 1e-3, 1e4)
        self._band_hz = band_hz

    def reset(self, rate_rad_s: float) -> None:
        """Settle on a constant rate."""
        settled = rate_rad_s, rate_rad_s
        self.state = FilterState(settled, settled, self.state.dt_s)

    def output(self, rate_rad_s: float) -> float:
        """Return the filtered rate of this sample."""
        state = self.state
        half = math.pi * self._band_hz * state.dt_s
        filtered, before = state.memory
        # Bilinear, as the notch: both lags stay what the lead of the feedforward makes up for.
        filtered = ((1.0 - half) * filtered + half * (before + rate_rad_s)) / (1.0 + half)
        state.pending = filtered, rate_rad_s
        return filtered

    def update(self, dt_s: float) -> None:
        """Commit the sample; the next one comes `dt_s` later."""
        self.state.memory, self.state.dt_s = self.state.pending, dt_s


def filter_sample(value: float, memory: Pair, constants: SectionConstants) -> tuple[float, Pair]:
    """Return output, and next band-pass and low-pass memory, for one sample."""
    band, low = memory
    g, h, twice_damping, band_share, high_share = constants
    inner = (g * (value - low) + band) * h
    passed = low + g * inner
    high = value - twice_damping * inner - passed
    return passed + band_share * inner + high_share * high, (2.0 * inner - band, low + 2.0 * g * inner)


def section_matrices(params: SectionParams, dt_s: float) -> LawMatrices:
    """Return the section, of two states of its own."""
    constants = Section(params, dt_s).constants
    # The matrices are those of the code that runs: it is linear, so three unit inputs show them.
    units = (0.0, (1.0, 0.0)), (0.0, (0.0, 1.0)), (1.0, (0.0, 0.0))
    columns = [filter_sample(value, memory, constants) for value, memory in units]
    out = np.array([[output for output, _ in columns]])
    rows = np.array([memory for _, memory in columns]).T
    return rows[:, :2], rows[:, 2:], out[:, :2], out[:, 2:]


def before_sections(law: LawMatrices, sections: Iterable[SectionParams], sample_s: float) -> LawMatrices:
    """Return a law sampled every `sample_s` with these sections behind it, those that act.

    Raises
    ------
    ValueError
        If a section lies at or above half the sampling rate.
    """
    a1, b1, c1, d1 = law
    for params in sections:
        if params.enabled:
            a2, b2, c2, d2 = section_matrices(params, sample_s)
            a1 = np.block([[a1, np.zeros((len(a1), 2))], [b2 @ c1, a2]])
            b1, c1, d1 = np.vstack([b1, b2 @ d1]), np.hstack([d2 @ c1, c2]), d2 @ d1
    return a1, b1, c1, d1
