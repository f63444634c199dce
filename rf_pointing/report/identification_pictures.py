"""Pictures of an identified response: Bode, coherence, Hankel singular values."""

from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.identification import ResponseStudy
from rf_pointing.report.picture_style import AXIS_COLOURS, DASHED, LIMIT_COLOUR, figure, marked_level

LEAST_COHERENCE = 0.8
_MEASURED, _MODEL = AXIS_COLOURS
_VALID = "#e8f1e4"


def draw_response(path: Path, response: ResponseStudy) -> None:
    """Save magnitude, phase, coherence and Hankel singular values of one response as PNG."""
    measured = response.measured
    shown = measured.frequency_hz > 0.0
    frequency = measured.frequency_hz[shown]
    modelled = response.identified.model.response(frequency)[:, 0, 0]
    with figure(path, 8.0, 9.0) as drawn:
        magnitude, phase, coherence, hankel = drawn.subplots(4, 1, height_ratios=(3, 2, 2, 2))
        for axes, of in ((magnitude, _decibel), (phase, _degrees)):
            axes.semilogx(frequency, of(measured.response[shown]), color=_MEASURED, lw=0.7, label="measured")
            axes.semilogx(frequency, of(modelled), color=_MODEL, lw=1.4, label="model")
        coherence.semilogx(frequency, measured.coherence[shown], color=_MEASURED, lw=0.7)
        marked_level(coherence, LEAST_COHERENCE, f"{LEAST_COHERENCE:g}")
        for axes in (magnitude, phase, coherence):
            _mark_valid(axes, response)
            axes.set_xlim(frequency[0], frequency[-1])
        magnitude.set_ylabel("gain, dB (rad per rad/s)")
        magnitude.set_title(f"{response.driven} rate to {response.shown} encoder", loc="left")
        magnitude.legend(loc="lower left")
        phase.set_ylabel("phase, deg")
        coherence.set(ylabel="coherence", ylim=(0.0, 1.02), xlabel="frequency, Hz")
        _draw_hankel(hankel, response)


def _draw_hankel(axes: Any, response: ResponseStudy) -> None:
    values, order = response.identified.hankel[:40], response.identified.model.order
    axes.semilogy(np.arange(1, len(values) + 1), values / values[0], "o", ms=3.5, color=_MEASURED)
    axes.axvline(order + 0.5, color=LIMIT_COLOUR, lw=0.9, ls=DASHED)
    axes.annotate(f"order of the model: {order}", (order + 0.8, 0.3), color=LIMIT_COLOUR, fontsize=9.0)
    axes.set(xlabel="number", ylabel="Hankel singular\nvalue, relative")


def _mark_valid(axes: Any, response: ResponseStudy) -> None:
    """Shade the frequencies whose coherence is large enough to be believed."""
    valid = response.measured.valid(LEAST_COHERENCE)
    where = axes.get_xaxis_transform()
    frequency = response.measured.frequency_hz
    axes.fill_between(frequency, 0.0, 1.0, where=valid, transform=where, color=_VALID, lw=0.0, zorder=0)


def _decibel(response: Any) -> Any:
    return 20.0 * np.log10(np.abs(response))


def _degrees(response: Any) -> Any:
    return np.degrees(np.angle(response))
