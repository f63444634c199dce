"""Types of arrays and pairs, and a whole turn."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Pair = tuple[float, float]
TURN = 2.0 * math.pi
