"""Refuses position laws that the antenna could not live with: the sampled closed loop must be stable.

The plant is the linear model behind its dead time, stepped exactly over one control period; the laws are those that
run, filters included.  Each axis is closed alone first, so that the refusal can name it, then both together.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import LawMatrices, LqgDesign, PositionLoopParams, law_matrices
from rf_pointing.core import AXES
from rf_pointing.servo import PlantParams, discretise, linear_model

__all__ = ["closed_loop_pole", "require_stable"]

Array = NDArray[np.float64]
Law = PositionLoopParams | LqgDesign

_EDGE = 1e-6
"""Integrators left open lie on the unit circle, a double one within the square root of the rounding error of it."""


def require_stable(plant: PlantParams, laws: Sequence[Law], tick_s: float) -> None:
    """Raise ValueError, naming the axis, unless the laws (azimuth, elevation) are stable on the antenna."""
    for closed in ((0,), (1,), (0, 1)):
        pole = closed_loop_pole(plant, laws, tick_s, closed)
        if abs(pole) > 1.0 + _EDGE:
            who = " and ".join(AXES[axis] for axis in closed)
            frequency_hz = abs(math.atan2(pole.imag, pole.real)) / (2.0 * math.pi * tick_s)
            gains = "; ".join(_gains(AXES[axis], laws[axis]) for axis in closed)
            raise ValueError(
                f"{gains}: the closed loop of {who} is unstable at {frequency_hz:.2f} Hz, "
                f"spectral radius {abs(pole):.4f} must be <= 1"
            )


def closed_loop_pole(plant: PlantParams, laws: Sequence[Law], tick_s: float, closed: Sequence[int] = (0, 1)) -> complex:
    """Return the pole (of z) farthest from the origin, with the loops of the axes in `closed` closed."""
    a, b, encoder = _sampled(plant, tick_s)
    for axis in closed:
        a, b, encoder = _close(a, b, encoder, axis, law_matrices(laws[axis], tick_s))
    poles = np.linalg.eigvals(a)
    return complex(poles[np.argmax(np.abs(poles))])


def _gains(axis: str, law: Law) -> str:
    if isinstance(law, LqgDesign):
        return f"{axis} LQG of control_weight={law.weights.control_weight}"
    return f"{axis}.proportional_gain={law.proportional_gain}, {axis}.integral_gain={law.integral_gain}"


def _sampled(plant: PlantParams, tick_s: float) -> tuple[Array, Array, Array]:
    """Return a, b (n, 2), encoder (2, n) of the plant over one control period, dead times as whole periods."""
    model = linear_model(plant)
    step, size = discretise(model.a, model.b_command, tick_s), len(model.a)
    a, b, encoder = step[:, :size], step[:, size:], model.encoder
    for axis, limits in enumerate((plant.azimuth, plant.elevation)):
        for _ in range(round(limits.drive_delay_s / tick_s)):
            a, b, encoder = _delay(a, b, encoder, axis)
    return a, b, encoder


def _delay(a: Array, b: Array, encoder: Array, axis: int) -> tuple[Array, Array, Array]:
    """Put one sample of delay before the command of an axis."""
    size = len(a)
    longer = np.zeros((size + 1, size + 1))
    longer[:size, :size], longer[:size, size] = a, b[:, axis]
    entry = np.vstack([b, np.zeros((1, 2))])
    entry[:, axis] = 0.0
    entry[size, axis] = 1.0
    return longer, entry, np.hstack([encoder, np.zeros((2, 1))])


def _close(a: Array, b: Array, encoder: Array, axis: int, law: LawMatrices) -> tuple[Array, Array, Array]:
    """Close the loop of an axis: command = law(-encoder)."""
    la, lb, lc, ld = law
    entry, shown = b[:, axis : axis + 1], encoder[axis : axis + 1]
    closed = np.block([[a - entry @ ld @ shown, entry @ lc], [-lb @ shown, la]])
    return closed, np.vstack([b, np.zeros((len(la), 2))]), np.hstack([encoder, np.zeros((2, len(la)))])
