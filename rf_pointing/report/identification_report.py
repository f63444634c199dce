"""Files of an identification in one folder: recordings, models, pictures, table of errors."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core import MDEG
from rf_pointing.identification import CrossCheck, Recording, ResponseStudy, StraightCheck, modes_of, save_models
from rf_pointing.report import picture_style as style
from rf_pointing.report.picture_style import AXIS_COLOURS, LIMIT_COLOUR, figure, marked_level
from rf_pointing.station.antenna.tuning import AxisModel, TunedAxis, loop_curves

LEAST_COHERENCE = 0.8
_MEASURED, _MODEL = AXIS_COLOURS


def save_recordings(path: Path, recordings: Mapping[str, Recording]) -> None:
    """Save inputs (rad/s) and encoders (rad) of every axis as a compressed numpy file."""
    arrays: dict[str, Any] = {}
    for axis, recording in recordings.items():
        arrays |= {f"{axis}_input_rad_s": recording.input_rad_s, f"{axis}_encoder_rad": recording.encoder_rad}
        arrays[f"{axis}_sample_s"] = np.array(recording.sample_s)
    np.savez_compressed(path, **arrays)


def write_identification(folder: Path, studies: Sequence[ResponseStudy], provenance: str) -> None:
    """Write models.json, errors.json, errors.txt and one picture per response into `folder`."""
    save_models(folder / "models.json", studies, provenance)
    rows = [_row(response) for response in studies]
    (folder / "errors.json").write_text(json.dumps(rows, indent=1) + "\n")
    (folder / "errors.txt").write_text(error_table(studies) + "\n")
    for response in studies:
        draw_response(folder / f"{response.driven}_to_{response.shown}.png", response)


def error_table(studies: Sequence[ResponseStudy]) -> str:
    """Return the table of errors on the held-out sequences as text."""
    lines = [f"{'response':<24}{'error':>9}{'gain off':>10}   {'valid band':<16}modes"]
    for row in map(_row, studies):
        gain = "" if row["gain_factor"] is None else f"{100.0 * row['gain_factor']:.2f} %"
        band = "none" if row["valid_band_hz"] is None else "{:.2f}-{:.1f} Hz".format(*row["valid_band_hz"])
        modes = " ".join(f"{frequency:.3f}" for frequency in row["modes_hz"])
        name = f"{row['driven']} to {row['shown']}"
        lines.append(f"{name:<24}{100.0 * row['worst_error']:>7.2f} %{gain:>10}   {band:<16}{modes} Hz")
    lines.append(f"error and gain: worst of the held-out sequences; valid band: coherence >= {LEAST_COHERENCE:g}")
    return "\n".join(lines)


def _row(response: ResponseStudy) -> dict[str, Any]:
    checks = response.checks
    gains = [check.gain_factor for check in checks if isinstance(check, StraightCheck)]
    biases = [check.bias for check in checks if isinstance(check, CrossCheck)]
    band_hz: tuple[float, float] | None = None
    with suppress(ValueError):
        band_hz = response.measured.valid_band_hz(LEAST_COHERENCE)
    return {
        "driven": response.driven, "shown": response.shown, "held_out_sequences": len(checks),
        "errors": [check.error for check in checks], "worst_error": response.worst_error,
        "gain_factor": max(gains) if gains else None, "bias_rad_s": biases or None,
        "valid_band_hz": band_hz,
        "modes_hz": modes_of(response.identified.model).frequency_hz.tolist(),
        "order": response.identified.model.order, "condition": response.identified.condition,
    }  # fmt: skip


def draw_response(path: Path, response: ResponseStudy) -> None:
    """Save magnitude, phase, coherence and Hankel singular values of one response as PNG."""
    measured = response.measured
    shown = measured.frequency_hz > 0.0
    frequency = measured.frequency_hz[shown]
    modelled = response.identified.model.response(frequency)[:, 0, 0]
    with figure(path, 8.0, 9.0) as drawn:
        magnitude, phase, coherence, hankel = drawn.subplots(4, 1, height_ratios=(3, 2, 2, 2))
        for values, colour, width, label in (
            (measured.response[shown], _MEASURED, 0.7, "measured"),
            (modelled, _MODEL, 1.4, "model"),
        ):
            magnitude.semilogx(frequency, 20.0 * np.log10(np.abs(values)), color=colour, lw=width, label=label)
            phase.semilogx(frequency, np.degrees(np.angle(values)), color=colour, lw=width)
        coherence.semilogx(frequency, measured.coherence[shown], color=_MEASURED, lw=0.7)
        marked_level(coherence, LEAST_COHERENCE, f"{LEAST_COHERENCE:g}")
        for axes in (magnitude, phase, coherence):
            # Only there is the measured response to be believed.
            axes.fill_between(measured.frequency_hz, 0.0, 1.0, where=measured.valid(LEAST_COHERENCE),
                              transform=axes.get_xaxis_transform(), color="#e8f1e4", lw=0.0, zorder=0)  # fmt: skip
            axes.set_xlim(frequency[0], frequency[-1])
        magnitude.set_ylabel("gain, dB (rad per rad/s)")
        magnitude.set_title(f"{response.driven} rate to {response.shown} encoder", loc="left")
        magnitude.legend(loc="lower left")
        phase.set_ylabel("phase, deg")
        coherence.set(ylabel="coherence", ylim=(0.0, 1.02), xlabel="frequency, Hz")
        strength = response.identified.hankel[:40] / response.identified.hankel[0]
        order = response.identified.model.order
        hankel.semilogy(np.arange(1, len(strength) + 1), strength, "o", ms=3.5, color=_MEASURED)
        hankel.axvline(order + 0.5, color=LIMIT_COLOUR, lw=0.9, ls=style.DASHED)
        hankel.annotate(f"order of the model: {order}", (order + 0.8, 0.3), color=LIMIT_COLOUR, fontsize=9.0)
        hankel.set(xlabel="number", ylabel="Hankel singular\nvalue, relative")


def draw_loops(
    path: Path, rows: Sequence[tuple[TunedAxis, TunedAxis | None, AxisModel]], wind_m_s: float,
    gusts: Mapping[str, float],
) -> None:  # fmt: skip
    """Save sensitivity, step and wind response of tuned axes and of their loops before as PNG."""
    with figure(path, 4.5 * len(rows) + 1.0, 9.0) as drawn:
        panels = drawn.subplots(3, len(rows), squeeze=False)
        for (sensitivity, step, wind), (tuned, before, axis) in zip(panels.T, rows, strict=True):
            unit = gusts.get(tuned.name, 1.0) / (MDEG if gusts else 1.0)
            for one, colour, label in ((before, style.ALONE_COLOUR, "before"), (tuned, _MODEL, "tuned")):
                if one is None or not np.isfinite(one.worst_peak):
                    continue
                shown = loop_curves(one.law, axis, wind_m_s)
                frequency_hz = shown.frequency_hz
                sensitivity.loglog(frequency_hz, shown.sensitivity, color=colour, label=label)
                step.plot(shown.time_s, shown.step, color=colour)
                wind.semilogx(frequency_hz, unit * shown.running_rms, color=colour)
            peak = tuned.margins.peak_sensitivity
            band_hz = (1e-3 / axis.sample_s, 0.5 / axis.sample_s)
            marked_level(sensitivity, peak, f"{peak:.2f}")
            sensitivity.set(ylabel="|S|", xlabel="frequency, Hz", xlim=band_hz, ylim=(1e-3, 4.0))
            sensitivity.set_title(tuned.name, loc="left")
            sensitivity.legend(loc="lower right")
            step.set(ylabel="encoder after a unit step", xlabel="s")
            name = "mdeg" if gusts else "rad per rad/s$^2$"
            wind.set(ylabel=f"rms error below f, {name}", xlabel="frequency, Hz", xlim=band_hz)
