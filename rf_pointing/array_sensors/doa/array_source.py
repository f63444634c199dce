"""Simulated signal source and array: one block of seeded snapshots per step of time.

The stand-in for the antennas and their receivers; a real array replaces it and nothing behind it
changes.
"""

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.snapshots import draw_snapshots
from rf_pointing.core import Params, as_finite_array, parameter, random_stream, require_finite
from rf_pointing.core.types import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class ArraySourceParams(Params):
    """Signals of the simulated receivers."""

    snapshots: int = parameter(100, "snapshots per block, L", low=1, high=100000)
    waveform: str = parameter(
        "constant_modulus", "amplitude law of the sources", choices=("constant_modulus", "gaussian")
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotBlock:
    """Complex samples (M, L) of all elements, in units of the noise of one element, ending at
    `t_s`.
    """

    t_s: float
    snapshots: ComplexArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ArraySourceState:
    """Everything that the next block depends on.

    The random generator and the time of the last block.
    """

    generator: dict[str, Any]
    t_s: float | None


class ArraySource:
    """Uniform circular array in the field of K sources.

    `response` holds its coupling and gain errors.
    """

    def __init__(
        self,
        array: CircularArrayParams,
        params: ArraySourceParams,
        *,
        seed: int,
        name: str = "array_source",
        response: ArrayResponse | None = None,
    ) -> None:
        if response is not None and len(response.gain) != array.elements:
            raise ValueError(
                f"response has {len(response.gain)} gains, must be elements={array.elements}"
            )
        self.array = array
        self.params = params
        self._matrix = None if response is None else response.matrix
        self._stream = random_stream(seed, name)
        self._t_s: float | None = None

    @property
    def state(self) -> ArraySourceState:
        """A copy of the state, to stop here and resume with `restore`."""
        return ArraySourceState(
            generator=copy.deepcopy(dict(self._stream.bit_generator.state)), t_s=self._t_s
        )

    def restore(self, state: ArraySourceState) -> None:
        """Continue from `state`: the following blocks are those that followed it."""
        self._stream.bit_generator.state = copy.deepcopy(state.generator)
        self._t_s = state.t_s

    def step(self, t_s: float, directions: Array, snr_db: Array) -> SnapshotBlock:
        """Return the block ending at `t_s` of sources at unit vectors `directions` (K, 3), `snr_db`
        (K,) per element.

        Raises
        ------
        ValueError
            If time does not advance, a direction is not a unit vector, or a source lies
            behind the array.
        """
        require_finite("t_s", t_s)
        if self._t_s is not None and t_s <= self._t_s:
            raise ValueError(f"t_s={t_s} must be > the last block's {self._t_s}")
        towards = as_finite_array("directions", directions, (None, 3))
        power_db = as_finite_array("snr_db", snr_db, (len(towards),))
        # A planar array cannot tell front and back: a source behind would be measured as one in
        # front.
        behind = np.flatnonzero(towards[:, 2] <= 0.0)
        if len(behind):
            raise ValueError(
                f"directions[{behind[0]}] has z={towards[behind[0], 2]}, must be > 0: behind the array"
            )
        # Diagonal: the stations are independent transmitters.
        powers = np.diag(10.0 ** (power_db / 10.0)).astype(np.complex128)
        samples = draw_snapshots(
            self.array,
            towards,
            powers,
            self.params.snapshots,
            self._stream,
            waveform=self.params.waveform,
            response=self._matrix,
        )
        self._t_s = t_s
        return SnapshotBlock(t_s=t_s, snapshots=samples)
