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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter, require_between, require_finite

Array = NDArray[np.float64]

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
class SectionState:
    """Memory of this sample, the same for the next one, and the step between them."""

    band: float = 0.0
    low: float = 0.0
    pending_band: float = 0.0
    pending_low: float = 0.0
    dt_s: float = 0.02


class Section:
    """Filter: `output(x)` at a sample, then `update(dt_s)` with the time to the next one."""

    def __init__(self, params: SectionParams, dt_s: float = 0.02) -> None:
        self.state = SectionState()
        self.params = params
        self._prepare(params, dt_s)

    def retune(self, params: SectionParams) -> None:
        """Take new parameters; ValueError, and no change, from half the sampling rate on."""
        self._prepare(params, self.state.dt_s)
        self.params = params

    def reset(self, value: float) -> None:
        """Settle on a constant input."""
        require_finite("value", value)
        self.state = SectionState(0.0, value, 0.0, value, self.state.dt_s)

    def shift(self, value: float) -> None:
        """Add what the section would remember of a constant `value` as its input all along."""
        self.state.low += value
        self.state.pending_low += value

    def output(self, value: float) -> float:
        """Return the filtered value."""
        state = self.state
        if not self.params.enabled:
            # Kept settled on its input, so that switching it on in motion makes no jump.
            state.pending_band, state.pending_low = 0.0, value
            return value
        result, state.pending_band, state.pending_low = filter_sample(value, state.band, state.low, self.constants)
        return result

    def update(self, dt_s: float) -> None:
        """Commit the sample given to `output`; the next one comes `dt_s` later."""
        state = self.state
        state.band, state.low = state.pending_band, state.pending_low
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


@dataclass(slots=True)
class FeedforwardState:
    """Rate and input of the sample before, of this sample, and the step between them."""

    filtered: float = 0.0
    input: float = 0.0
    pending_filtered: float = 0.0
    pending_input: float = 0.0
    dt_s: float = 0.02


class RateFeedforward:
    """Low-pass of the rate: `output` at a sample, then `update` with the time to the next one."""

    def __init__(self, band_hz: float, dt_s: float = 0.02) -> None:
        self.state = FeedforwardState(dt_s=dt_s)
        self.retune(band_hz)

    def retune(self, band_hz: float) -> None:
        """Take a new band limit from the next sample on."""
        require_between("band_hz", band_hz, 1e-3, 1e4)
        self._band_hz = band_hz

    def reset(self, rate_rad_s: float) -> None:
        """Settle on a constant rate."""
        self.state = FeedforwardState(rate_rad_s, rate_rad_s, rate_rad_s, rate_rad_s, self.state.dt_s)

    def output(self, rate_rad_s: float) -> float:
        """Return the filtered rate of this sample."""
        state = self.state
        half = math.pi * self._band_hz * state.dt_s
        total = state.input + rate_rad_s
        # Bilinear, as the notch: both lags stay what the lead of the feedforward makes up for.
        state.pending_filtered = ((1.0 - half) * state.filtered + half * total) / (1.0 + half)
        state.pending_input = rate_rad_s
        return state.pending_filtered

    def update(self, dt_s: float) -> None:
        """Commit the sample; the next one comes `dt_s` later."""
        state = self.state
        state.filtered, state.input, state.dt_s = state.pending_filtered, state.pending_input, dt_s


def filter_sample(value: float, band: float, low: float, constants: SectionConstants) -> tuple[float, float, float]:
    """Return output, next band-pass and next low-pass memory for one sample."""
    g, h, twice_damping, band_share, high_share = constants
    inner = (g * (value - low) + band) * h
    passed = low + g * inner
    high = value - twice_damping * inner - passed
    return passed + band_share * inner + high_share * high, 2.0 * inner - band, low + 2.0 * g * inner


def section_matrices(params: SectionParams, dt_s: float) -> tuple[Array, Array, Array, Array]:
    """Return a (2, 2), b (2, 1), c (1, 2), d (1, 1) of the section in its own states."""
    constants = Section(params, dt_s).constants
    # The matrices are those of the code that runs: it is linear, so three unit inputs show them.
    columns = [filter_sample(value, band, low, constants) for value, band, low in ((0, 1, 0), (0, 0, 1), (1, 0, 0))]
    out, band, low = np.array(columns, dtype=np.float64).T
    rows = np.stack([band, low])
    return rows[:, :2], rows[:, 2:], out[None, :2], out[None, 2:]
