"""Puts a recording together from samples that arrive one by one, and knows which are missing.

A lost sample spoils its sequence, for the input is no longer known to be what the antenna was
given: nothing is filled in.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import AXES, as_finite_array, require_between, require_choice
from rf_pointing.identification.experiment import Recording

__all__ = ["SampleCollector"]

Array = NDArray[np.float64]


class SampleCollector:
    """Samples of one experiment on `axis`: `sequences` of `samples`, `sample_s` apart."""

    def __init__(self, axis: str, sequences: int, samples: int, sample_s: float) -> None:
        require_choice("axis", axis, AXES)
        require_between("sequences", sequences, 1, 1000)
        require_between("samples", samples, 1, None)
        self._axis, self._sample_s = axis, sample_s
        self._input = np.zeros((sequences, samples))
        self._encoder = np.zeros((sequences, samples, 2))
        self._heard = np.zeros((sequences, samples), dtype=bool)

    @property
    def heard(self) -> int:
        """Number of samples taken."""
        return int(np.count_nonzero(self._heard))

    def take(self, axis: str, sample: int, rate_rad_s: ArrayLike, position_rad: ArrayLike) -> None:
        """Take sample number `sample` (from 0): rate command (2,) and encoder angles (2,).

        Raises
        ------
        ValueError
            For another axis, a number outside the experiment or taken before, or a non-finite value.
        """
        if axis != self._axis:
            raise ValueError(f"axis={axis!r} must be {self._axis!r}, the axis of this experiment")
        require_between("sample", sample, 0, self._heard.size - 1)
        where = divmod(sample, self._heard.shape[1])
        if self._heard[where]:
            raise ValueError(f"sample={sample} was taken before")
        rate = as_finite_array("rate_rad_s", rate_rad_s, (2,))
        self._encoder[where] = as_finite_array("position_rad", position_rad, (2,))
        self._input[where] = rate[AXES.index(axis)]
        self._heard[where] = True

    def recording(self) -> tuple[Recording, int]:
        """Return the complete sequences, and how many samples are missing from the others.

        Raises
        ------
        ValueError
            If no sequence is complete.
        """
        complete = np.all(self._heard, axis=1)
        if not np.any(complete):
            raise ValueError(f"no sequence is complete: {self.heard} of {self._heard.size} samples taken")
        missing = int(np.count_nonzero(~self._heard))
        return Recording(self._axis, self._sample_s, self._input[complete], self._encoder[complete]), missing
