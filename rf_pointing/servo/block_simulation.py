"""Fast exact simulation of a sampled linear model: many samples per matrix product.

For a block of N samples   y = O x + T u,   x' = A^N x + R u   with O the stacked C A^k, T the block Toeplitz matrix of
the Markov parameters and R the stacked A^(N-1-k) B.  One product per block replaces N small ones.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import as_finite_array, require_between

__all__ = ["BlockSimulator"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Block:
    """Matrices of one block: outputs from state and inputs, next state from state and inputs."""

    combined: Array
    outputs: int


class BlockSimulator:
    """Simulates x(k+1) = a x + b u, y = c x + d u in blocks of `block` samples."""

    def __init__(self, a: Array, b: Array, c: Array, d: Array, block: int = 32) -> None:
        require_between("block", block, 1, 4096)
        self._size, self._inputs = b.shape
        self._outputs, self._length = c.shape[0], block
        self._matrices = (a, b, c, d)
        self._block = self._lifted(block)

    def run(self, inputs: ArrayLike, start: ArrayLike) -> tuple[Array, Array]:
        """Return outputs (samples, q) and the final state (n,) for `inputs` (samples, m) from the state `start` (n,)."""
        u = as_finite_array("inputs", inputs, (None, self._inputs))
        state = as_finite_array("start", start, (self._size,)).copy()
        whole, rest = divmod(len(u), self._length)
        outputs = np.empty((len(u), self._outputs))
        width = self._length * self._outputs
        packed = np.empty(self._size + self._length * self._inputs)
        blocks = u[: whole * self._length].reshape(whole, self._length * self._inputs)
        shaped = outputs[: whole * self._length].reshape(whole, width)
        for index in range(whole):
            packed[: self._size], packed[self._size :] = state, blocks[index]
            result = self._block.combined @ packed
            shaped[index], state = result[:width], result[width:]
        if rest:
            tail = self._lifted(rest)
            result = tail.combined @ np.concatenate([state, u[-rest:].ravel()])
            outputs[-rest:] = result[: tail.outputs].reshape(rest, self._outputs)
            state = result[tail.outputs :]
        return outputs, state

    def _lifted(self, length: int) -> _Block:
        a, b, c, d = self._matrices
        size, m, q = self._size, self._inputs, self._outputs
        powers = [np.eye(size)]
        for _ in range(length):
            powers.append(a @ powers[-1])
        combined = np.zeros((length * q + size, size + length * m))
        for k in range(length):
            combined[k * q : (k + 1) * q, :size] = c @ powers[k]
            combined[k * q : (k + 1) * q, size + k * m : size + (k + 1) * m] = d
            for j in range(k):
                combined[k * q : (k + 1) * q, size + j * m : size + (j + 1) * m] = c @ powers[k - 1 - j] @ b
            combined[length * q :, size + k * m : size + (k + 1) * m] = powers[length - 1 - k] @ b
        combined[length * q :, :size] = powers[length]
        return _Block(combined, length * q)
