"""What an identification leaves in a folder: recordings, models, pictures, table of errors."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.identification import CrossCheck, Recording, ResponseStudy, StraightCheck, modes_of, save_models
from rf_pointing.report.identification_pictures import LEAST_COHERENCE, draw_response


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
    return {
        "driven": response.driven,
        "shown": response.shown,
        "held_out_sequences": len(checks),
        "errors": [check.error for check in checks],
        "worst_error": response.worst_error,
        "gain_factor": max(gains) if gains else None,
        "bias_rad_s": biases or None,
        "valid_band_hz": _band(response),
        "modes_hz": modes_of(response.identified.model).frequency_hz.tolist(),
        "order": response.identified.model.order,
        "condition": response.identified.condition,
    }


def _band(response: ResponseStudy) -> tuple[float, float] | None:
    try:
        return response.measured.valid_band_hz(LEAST_COHERENCE)
    except ValueError:
        return None
