"""Observer/Kalman identification: Markov parameters of the system from measured input and output.

    y(k) = D u(k) + sum_{i=1..p} ( b_i u(k-i) + a_i y(k-i) )       observer Markov parameters, by least squares
    Y(0) = D,   Y(k) = b_k + sum_{i=1..k} a_i Y(k-i)               system Markov parameters (a_i, b_i = 0 for i > p)

Juang, Phan, Horta and Longman 1991 (the method behind SOCIT's "okid", DSS13-ID Sec. III-D), one
input and one output.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import require_between

__all__ = ["ObserverMarkov", "observer_markov", "system_markov"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ObserverMarkov:
    """Observer Markov parameters: `direct` D, `inputs` b_1..b_p and `outputs` a_1..a_p; residual rms in output units.

    `condition` is the condition number of the scaled least-squares problem.
    """

    direct: float
    inputs: Array
    outputs: Array
    residual_rms: float
    condition: float


def observer_markov(inputs: ArrayLike, outputs: ArrayLike, order: int) -> ObserverMarkov:
    """Return the observer Markov parameters of `order` p from sequences (sequences, samples).

    Raises
    ------
    ValueError
        If the data are too short for the order or do not excite it (rank deficiency).
    """
    u, y = np.atleast_2d(inputs).astype(np.float64), np.atleast_2d(outputs).astype(np.float64)
    if u.shape != y.shape:
        raise ValueError(f"inputs has shape {u.shape}, outputs has {y.shape}: must be equal")
    require_between("order", order, 1, u.shape[1] // 4)
    scale_u, scale_y = float(np.std(u)), float(np.std(y))
    if scale_u == 0.0 or scale_y == 0.0:
        raise ValueError(f"inputs have rms {scale_u} and outputs {scale_y}: both must be > 0")
    rows = np.vstack([_regressors(a / scale_u, b / scale_y, order) for a, b in zip(u, y, strict=True)])
    target = np.concatenate([b[order:] for b in y]) / scale_y
    triangle: Array = np.asarray(np.linalg.qr(np.column_stack([rows, target]), mode="r"))
    solution, _, rank, singular = np.linalg.lstsq(triangle[:-1, :-1], triangle[:-1, -1], rcond=1e-13)
    if rank < rows.shape[1]:
        raise ValueError(f"order={order} needs {rows.shape[1]} independent regressors, the data excite {rank}")
    ratio = scale_y / scale_u
    markov: Array = np.asarray(solution, dtype=np.float64)
    return ObserverMarkov(
        float(markov[0]) * ratio,
        np.asarray(markov[1 : order + 1] * ratio, dtype=np.float64),
        markov[order + 1 :].copy(),
        float(abs(triangle[-1, -1])) * scale_y / np.sqrt(len(target)),
        float(singular[0] / singular[-1]),
    )


def system_markov(observer: ObserverMarkov, count: int) -> Array:
    """Return the system Markov parameters Y(0)..Y(count - 1)."""
    order = len(observer.inputs)
    forcing = np.zeros(count)
    forcing[0] = observer.direct
    forcing[1 : order + 1] = observer.inputs[: count - 1]
    markov = np.zeros(count)
    for k in range(count):
        reach = min(k, order)
        markov[k] = forcing[k] + observer.outputs[:reach] @ markov[k - reach : k][::-1]
    return markov


def _regressors(u: Array, y: Array, order: int) -> Array:
    """Return rows u(k), u(k-1)..u(k-p), y(k-1)..y(k-p) for k = p..n-1."""
    windows_u = np.lib.stride_tricks.sliding_window_view(u, order + 1)[:, ::-1]
    windows_y = np.lib.stride_tricks.sliding_window_view(y[:-1], order)[:, ::-1]
    return np.hstack([windows_u, windows_y])
