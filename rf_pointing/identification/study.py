"""From the recordings of one or both axes to models and their errors on held-out sequences.

The straight response of every recorded axis, and the cross responses where both were recorded: the
check of a cross response needs the straight model of the axis that was not driven.  The errors are
the numbers of DSS13-ID Tables 2 to 5,

    error(k) = |y_m - k y_s| / |y_m|                                        (DSS13-ID eq. 8, 9)

with the gain k that makes it smallest; delta = |k - 1| (eq. 10).  In the cross responses a small
constant rate at the input of the other axis is fitted as well (eq. 7).
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, ComplexArray, as_finite_array, require_between
from rf_pointing.core.whole_file import parse_json, read_whole
from rf_pointing.identification.experiment import Recording
from rf_pointing.identification.identify import IdentificationParams, Identified, identify
from rf_pointing.identification.model import StateSpace
from rf_pointing.identification.spectra import FrequencyResponse, frequency_response

# The number changes with every change of the keys, so that an old file is not misread.
FORMAT = "rf_pointing identified models 2"


@dataclass(frozen=True, slots=True)
class StraightCheck:
    """Relative error with the best gain, and how far that gain is from one; ratios, not percent."""

    error: float
    gain_factor: float


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """Relative error with the fitted bias, and that bias at the other axis' input in its unit."""

    error: float
    bias: float


def check_straight(model: StateSpace, inputs: ArrayLike, outputs: ArrayLike) -> StraightCheck:
    """Return the errors of one sequence (samples,); the output counts from its first sample."""
    measured = np.asarray(outputs, dtype=np.float64)
    # The encoder counts from anywhere; the model from zero.
    measured = measured - measured[0]
    simulated = model.simulate(inputs)[:, 0]
    # Least squares in one number.
    gain = float(simulated @ measured / (simulated @ simulated))
    size = float(np.linalg.norm(measured))
    best = float(np.linalg.norm(measured - gain * simulated)) / size
    return StraightCheck(best, abs(gain - 1.0))


def check_cross(cross: StateSpace, straight: StateSpace, inputs: ArrayLike, outputs: ArrayLike) -> CrossCheck:
    """Return the error of one sequence (samples,) of a cross response.

    `straight` is the model of the axis that was not driven: its response to one constant rate is
    fitted and added.
    """
    measured = np.asarray(outputs, dtype=np.float64)
    simulated = cross.simulate(inputs)[:, 0]
    drift = straight.simulate(np.ones(len(measured)))[:, 0]
    columns = np.column_stack([drift, np.ones(len(measured))])
    # The bias of the other axis' input is fitted per sequence: it drifts.
    weights = np.linalg.lstsq(columns, measured - simulated, rcond=None)[0]
    residual = measured - simulated - columns @ weights
    size = float(np.linalg.norm(measured - measured[0]))
    return CrossCheck(float(np.linalg.norm(residual)) / size, float(weights[0]))


# A drive with its integrator, three modes and the gear.
STRAIGHT = IdentificationParams(order=10)
# A cross response is weak: a longer observer averages more noise, two more states hold both axes'
# modes, and its low end is drowned by the unmeasured rate of the other axis.
CROSS = IdentificationParams(order=12, realization_order=16, observer_order=200, integrator=False, high_pass_hz=0.3)


@dataclass(frozen=True, slots=True)
class ResponseStudy:
    """One response: measured, identified, and checked on every held-out sequence."""

    driven: str
    shown: str
    measured: FrequencyResponse
    identified: Identified
    checks: tuple[StraightCheck, ...] | tuple[CrossCheck, ...]

    @property
    def worst_error(self) -> float:
        """Largest relative error on a held-out sequence."""
        return max(check.error for check in self.checks)


def study(
    recordings: Mapping[str, Recording], held_out: int, straight: IdentificationParams = STRAIGHT,
    cross: IdentificationParams = CROSS,
) -> list[ResponseStudy]:  # fmt: skip
    """Return the studies of all responses, straight ones first, on the last `held_out` sequences.

    Raises ValueError if a recording has no more than `held_out` sequences, or does not support the
    orders.
    """
    for axis, recording in recordings.items():
        require_between(f"held_out ({axis})", held_out, 1, len(recording.input_rad_s) - 1)
    # The check of a cross response needs the straight model of the axis that was not driven.
    straights = {axis: _study(recording, axis, held_out, straight) for axis, recording in recordings.items()}
    crosses = [
        _study(recording, other, held_out, cross, straights[other].identified.model)
        for axis, recording in recordings.items()
        for other in recordings
        if other != axis
    ]
    return [*straights.values(), *crosses]


def _study(
    data: Recording, shown: str, held_out: int, params: IdentificationParams, other: StateSpace | None = None
) -> ResponseStudy:
    """Return the study of one response; a cross one with the straight model of the `other` axis."""
    # The measured response uses all sequences; only the fit leaves the last ones out.
    inputs, outputs = data.input_rad_s, data.output_rad(shown)
    measured = frequency_response(inputs, outputs, data.sample_s)
    found = identify(inputs[:-held_out], outputs[:-held_out], data.sample_s, params)
    kept = list(zip(inputs[-held_out:], outputs[-held_out:], strict=True))
    checks: tuple[StraightCheck, ...] | tuple[CrossCheck, ...]
    if other is None:
        checks = tuple(check_straight(found.model, u, y) for u, y in kept)
    else:
        checks = tuple(check_cross(found.model, other, u, y) for u, y in kept)
    return ResponseStudy(data.axis, shown, measured, found, checks)


def save_models(path: Path, studies: Sequence[ResponseStudy], provenance: str) -> None:
    """Write the models (rate command in rad/s to encoder in rad) with their worst errors to `path`.

    The measured response goes with each, at the frequencies where its coherence says that it is
    one.  `provenance` says from which data and how they were made.
    """
    responses = [
        {
            "input": response.driven, "output": response.shown,
            "sample_s": response.identified.model.sample_s,
            **{name: getattr(response.identified.model, name).tolist() for name in "abcd"},
            "hankel": response.identified.hankel.tolist(), "error": response.worst_error,
            "provenance": provenance, **_measured(response.measured),
        }
        for response in studies
    ]  # fmt: skip
    path.write_text(json.dumps({"format": FORMAT, "responses": responses}, indent=1) + "\n")


def _measured(found: FrequencyResponse) -> dict[str, list[float]]:
    kept = found.valid() & (found.frequency_hz > 0.0)
    response = found.response[kept]
    return {
        "measured_hz": found.frequency_hz[kept].tolist(),
        "measured_real": response.real.tolist(),
        "measured_imag": response.imag.tolist(),
    }


@dataclass(frozen=True, slots=True)
class KeptModel:
    """A straight response of a models file: model, error, and what was measured (f,)."""

    model: StateSpace
    error: float
    measured_hz: Array
    measured: ComplexArray


def load_models(path: Path) -> dict[str, KeptModel]:
    """Return the straight responses in `path` by their axis; ValueError for another file."""
    try:
        content = parse_json(read_whole(path))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: no identified models: {error}") from error
    if not isinstance(content, Mapping) or content.get("format") != FORMAT:
        raise ValueError(f"{path}: format must be {FORMAT!r}; identify_antenna writes it")
    found = {}
    try:
        for one in content["responses"]:
            if one["input"] != one["output"]:
                continue
            a, b, c, d = (np.array(one[name], dtype=np.float64) for name in "abcd")
            names = ("measured_real", "measured_imag", "measured_hz")
            real, imag, hz = (np.array(one[name], dtype=np.float64) for name in names)
            as_finite_array("measured", np.stack([real, imag, hz]), (3, None))
            model = StateSpace(a, b, c, d, float(one["sample_s"]))
            found[str(one["input"])] = KeptModel(model, float(one["error"]), hz, real + 1j * imag)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        kind = type(error).__name__
        raise ValueError(f"{path}: no identified models: {kind}: {error}") from error
    return found
