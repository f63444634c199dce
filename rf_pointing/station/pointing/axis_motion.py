"""The axis motion that holds the beam on the sky's motion: the bias model, direct or over the top, zenith included."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.core import Motion
from rf_pointing.planning import plunged

__all__ = ["axis_motion"]

Array = NDArray[np.float64]
RIM_RAD = math.radians(85.0)


def axis_motion(sky: Motion, model: BiasModel, *, plunge: bool = False) -> Motion:
    """Return the motion (n, 2) of the axes that holds the beam on `sky` (n, 2), azimuth continuous.

    In the hole about the mount's zenith, where the model has no solution, its correction at the rim is carried through.
    """
    motion = Motion(*plunged(*sky)) if plunge else sky
    try:
        return Motion(*model.apply_moving(*motion))
    except ValueError:
        low = sky.position.copy()
        low[:, 1] = np.minimum(low[:, 1], RIM_RAD)
        still = np.zeros_like(low)
        beside = plunged(low, still, still)[0] if plunge else low
        return motion._replace(position=motion.position + model.apply_moving(beside, still, still)[0] - beside)
