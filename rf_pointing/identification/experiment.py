"""The identification experiment, one control tick at a time: what to command, what was measured, when to stop.

One axis is driven in manual-rate mode while both encoders are recorded.  The whole input is made,
and its travel checked, before anything moves; sequences run to alternating sides so that the axis
stays near its start.  On the way the measured travel is watched as well, and `abort` ends the
motion at once.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import AXES, as_finite_array, require_between, require_choice
from rf_pointing.identification.excitation import ExcitationParams, excitation_rad_s, predicted_travel_rad

__all__ = ["IdentificationExperiment", "Recording"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Recording:
    """Rate input (sequences, samples) of the driven `axis` and encoder angles (sequences, samples, 2), in radians."""

    axis: str
    sample_s: float
    input_rad_s: Array
    encoder_rad: Array

    def output_rad(self, axis: str) -> Array:
        """Return the encoder angles (sequences, samples) of one axis."""
        require_choice("axis", axis, AXES)
        return np.asarray(self.encoder_rad[:, :, AXES.index(axis)])


class IdentificationExperiment:
    """Call `command` once per sample until `finished`; then `recording` holds the complete sequences.

    `travel_rad` (low, high) bounds the driven axis; `margin_rad` is kept from both ends.
    """

    def __init__(
        self,
        params: ExcitationParams,
        axis: str,
        sequences: int,
        start_rad: float,
        travel_rad: tuple[float, float],
        random: np.random.Generator,
        margin_rad: float = 0.01,
    ) -> None:
        require_choice("axis", axis, AXES)
        require_between("sequences", sequences, 1, 1000)
        require_between("margin_rad", margin_rad, 0.0, None)
        self._params, self._axis = params, AXES.index(axis)
        signs = np.where(np.arange(sequences) % 2 == 0, 1.0, -1.0)
        self._input = np.array([sign * excitation_rad_s(params, random) for sign in signs])
        self._low, self._high = travel_rad[0] + margin_rad, travel_rad[1] - margin_rad
        self._check_travel(axis, start_rad)
        self._encoder = np.zeros((*self._input.shape, 2))
        self._sample = 0
        self._abort = ""

    @property
    def sample_s(self) -> float:
        """Time between two commands."""
        return self._params.sample_s

    @property
    def peak_rad_s(self) -> float:
        """Largest rate of the whole input."""
        return float(np.max(np.abs(self._input)))

    @property
    def samples_taken(self) -> int:
        """Number of commands given so far."""
        return self._sample

    @property
    def newest(self) -> tuple[Array, Array]:
        """The latest rate command (2,) and the encoder angles (2,) it was given at.

        Raises
        ------
        ValueError
            Before the first command.
        """
        if self._sample == 0:
            raise ValueError("no sample has been taken")
        where = divmod(self._sample - 1, self._input.shape[1])
        return self._rates(where), self._encoder[where].copy()

    @property
    def finished(self) -> bool:
        """Whether no further command follows: all samples taken, or aborted."""
        return bool(self._abort) or self._sample == self._input.size

    @property
    def abort_reason(self) -> str:
        """Why the experiment ended early, "" if it did not."""
        return self._abort

    @property
    def progress(self) -> float:
        """Share of the samples taken, 0 to 1."""
        return self._sample / self._input.size

    @property
    def duration_s(self) -> float:
        """Length of the whole experiment."""
        return self._input.size * self._params.sample_s

    def abort(self, reason: str) -> None:
        """End the experiment; the next command is zero."""
        if not reason:
            raise ValueError("reason='' must say why the experiment ends")
        if not self.finished:
            self._abort = reason

    def command(self, encoder_rad: ArrayLike) -> Array:
        """Take the encoder angles (2,) of this sample and return the rate command (2,) to hold until the next one."""
        encoder = as_finite_array("encoder_rad", encoder_rad, (2,))
        if not self._low <= encoder[self._axis] <= self._high:
            self.abort(f"{AXES[self._axis]} {encoder[self._axis]:.6f} rad left {self._low:.6f} to {self._high:.6f} rad")
        rate = np.zeros(2)
        if self.finished:
            return rate
        where = divmod(self._sample, self._input.shape[1])
        self._encoder[where] = encoder
        self._sample += 1
        return self._rates(where)

    def recording(self) -> Recording:
        """Return the sequences that were completed.

        Raises
        ------
        ValueError
            If not even one was.
        """
        complete = self._sample // self._input.shape[1]
        if complete == 0:
            raise ValueError(f"no sequence is complete: {self._sample} of {self._input.shape[1]} samples taken")
        return Recording(
            AXES[self._axis], self._params.sample_s, self._input[:complete].copy(), self._encoder[:complete].copy()
        )

    def _rates(self, where: tuple[int, int]) -> Array:
        rates = np.full(2, self._params.idle_rate_rad_s)
        rates[self._axis] = self._input[where]
        return rates

    def _check_travel(self, axis: str, start_rad: float) -> None:
        require_between("start_rad", start_rad, self._low, self._high)
        below, above = predicted_travel_rad(self._input.ravel(), self._params.sample_s)
        if start_rad + below < self._low or start_rad + above > self._high:
            raise ValueError(
                f"{axis} would run from {start_rad + below:.4f} to {start_rad + above:.4f} rad, "
                f"must stay within {self._low:.4f} and {self._high:.4f} rad"
            )
