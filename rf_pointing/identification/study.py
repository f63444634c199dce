"""From the recordings of one or both axes to models, their errors on held-out sequences, and where they can be believed.

The straight response of every recorded axis, and the cross responses where both were recorded: the
check of a cross response needs the straight model of the axis that was not driven.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from rf_pointing.core import require_between
from rf_pointing.identification.experiment import Recording
from rf_pointing.identification.identify import IdentificationParams, Identified, identify
from rf_pointing.identification.model_file import ModelRecord
from rf_pointing.identification.spectra import FrequencyResponse, frequency_response
from rf_pointing.identification.validate import CrossCheck, StraightCheck, check_cross, check_straight

__all__ = ["CROSS", "STRAIGHT", "ResponseStudy", "study"]

# A drive with its integrator, three modes and the gear.
STRAIGHT = IdentificationParams(order=10)
CROSS = IdentificationParams(order=12, realization_order=16, observer_order=200, integrator=False, high_pass_hz=0.3)


@dataclass(frozen=True, slots=True)
class ResponseStudy:
    """One response: measured in the frequency domain, identified, and checked on every held-out sequence."""

    driven: str
    shown: str
    measured: FrequencyResponse
    identified: Identified
    checks: tuple[StraightCheck, ...] | tuple[CrossCheck, ...]

    @property
    def straight(self) -> bool:
        """Whether the driven axis itself is shown."""
        return self.driven == self.shown

    @property
    def worst_error(self) -> float:
        """Largest relative error on a held-out sequence."""
        return max(check.error for check in self.checks)

    def record(self, provenance: str) -> ModelRecord:
        """Return the response as it goes into a model file."""
        hankel = tuple(self.identified.hankel.tolist())
        return ModelRecord(self.driven, self.shown, self.identified.model, hankel, self.worst_error, provenance)


def study(
    recordings: Mapping[str, Recording],
    held_out: int,
    straight: IdentificationParams = STRAIGHT,
    cross: IdentificationParams = CROSS,
) -> list[ResponseStudy]:
    """Return the studies of all responses, straight ones first; the last `held_out` sequences are not fitted.

    Raises
    ------
    ValueError
        If a recording has not more than `held_out` sequences, or its data do not support the orders asked for.
    """
    for axis, recording in recordings.items():
        require_between(f"held_out ({axis})", held_out, 1, len(recording.input_rad_s) - 1)
    straights = [_straight(recording, held_out, straight) for recording in recordings.values()]
    models = {found.driven: found for found in straights}
    crosses = [
        _cross(recording, other, models[other], held_out, cross)
        for axis, recording in recordings.items()
        for other in recordings
        if other != axis
    ]
    return [*straights, *crosses]


def _straight(data: Recording, held_out: int, params: IdentificationParams) -> ResponseStudy:
    measured, found = _found(data, data.axis, held_out, params)
    outputs = data.output_rad(data.axis)
    checks = [
        check_straight(found.model, u, y)
        for u, y in zip(data.input_rad_s[-held_out:], outputs[-held_out:], strict=True)
    ]
    return ResponseStudy(data.axis, data.axis, measured, found, tuple(checks))


def _cross(
    data: Recording, shown: str, other: ResponseStudy, held_out: int, params: IdentificationParams
) -> ResponseStudy:
    measured, found = _found(data, shown, held_out, params)
    outputs = data.output_rad(shown)
    checks = [
        check_cross(found.model, other.identified.model, u, y)
        for u, y in zip(data.input_rad_s[-held_out:], outputs[-held_out:], strict=True)
    ]
    return ResponseStudy(data.axis, shown, measured, found, tuple(checks))


def _found(
    data: Recording, shown: str, held_out: int, params: IdentificationParams
) -> tuple[FrequencyResponse, Identified]:
    inputs, outputs = data.input_rad_s, data.output_rad(shown)
    measured = frequency_response(inputs, outputs, data.sample_s)
    return measured, identify(inputs[:-held_out], outputs[:-held_out], data.sample_s, params)
