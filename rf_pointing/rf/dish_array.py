"""Array of patches on a dish: its geometry, its level, and its frame against the beam.

The array's frame is turned against the beam's, whose axes are to the right (cross-elevation), up
(elevation) and along the beam: d_array = R d, R = Rz(roll) Rx(elevation) Ry(-cross).
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Array, Pair, Params, parameter

PERIOD_S = 0.1
"""Time between two directions of an array, and length of the block that each is made of."""
SNAPSHOTS = 32
"""Snapshots of a block; they fill its time, so each holds the noise of 320 Hz."""
SEPARATION = 36.0
"""Least kappa (1 - rho) of a valid direction, against the direction that is most like it."""
MAIN_LOBE = 3.0
"""Within so much of phase at the rim a direction is the same lobe: sidelobes begin at 3.83."""
LATTICE = 0.25
"""Spacing of the directions that are compared, in phase at the rim."""
BETWEEN = 0.01
"""By how much a lobe may be higher than at the lattice: (LATTICE / sqrt 2)^2 / 4 = 0.008."""
LEAST_EFFECTIVE_SNR = 60.0
"""Least kappa = L S^2 / (1 + S) of a valid direction, S the SNR of all patches of a block of L."""


@dataclass(frozen=True, kw_only=True)
class DishArrayParams(Params):
    """Patches evenly spaced on a circle, on or around a dish, that receive what the dish does."""

    elements: int = parameter(12, "number of patches on the circle", 5, 64)
    radius_m: float = parameter(0.12, "radius of the circle", 1e-3, 10.0)
    wavelength_m: float = parameter(0.1332, "wavelength of the carrier", 1e-3, 30.0)
    element_loss_db: float = parameter(
        25.0, "C/N0 of the dish less that of one patch", -20.0, 120.0
    )
    roll_rad: float = parameter(
        0.0, "angle from the axis of the first patch to cross-elevation", -math.pi, math.pi
    )
    axis_cross_elevation_rad: float = parameter(0.0, "array's axis right of the beam by", -0.8, 0.8)
    axis_elevation_rad: float = parameter(0.0, "array's axis above the beam by", -0.8, 0.8)
    phase_sigma_rad: float = parameter(0.02, "what the calibration leaves of the phases", 0.0, 0.5)

    @property
    def rotation(self) -> Array:
        """R (3, 3): takes components in the beam's frame to those in the array's."""
        (c, s), (a, b), (e, f) = (
            (math.cos(angle), math.sin(angle))
            for angle in (self.roll_rad, self.axis_cross_elevation_rad, self.axis_elevation_rad)
        )
        across = np.array([[a, 0.0, -b], [0.0, 1.0, 0.0], [b, 0.0, a]])
        above = np.array([[1.0, 0.0, 0.0], [0.0, e, -f], [0.0, f, e]])
        roll = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(roll @ above @ across)


def direction_sigmas_rad(array: DishArrayParams, level_db_hz: float) -> Pair:
    """Return how far off each axis of a direction is, rms: from block to block, and all the time.

    `level_db_hz` is the C/N0 of the dish on the axis of its beam.  The first is the Cramer-Rao
    bound of one Gaussian source on M patches, S = M SNR: (1 + 1/S) / (L S (k r)^2) rad^2.  The
    second is what the unknown phases leave: sigma sqrt(2 / M) / (k r).
    """
    rim = 2.0 * math.pi * array.radius_m / array.wavelength_m
    level = 10.0 ** (0.1 * (level_db_hz - array.element_loss_db))
    total = array.elements * level * PERIOD_S / SNAPSHOTS
    noise = math.sqrt((1.0 + 1.0 / total) / (SNAPSHOTS * total)) / rim
    return noise, array.phase_sigma_rad * math.sqrt(2.0 / array.elements) / rim


def least_level_db_hz(array: DishArrayParams) -> float:
    """Return the C/N0 of all patches at which half of the directions near the axis are valid.

    Infinite where no level is enough: a grating lobe, or phases that are too little known.
    """
    rim = 2.0 * math.pi * array.radius_m / array.wavelength_m
    # Opposite directions are alike: the last step may be missing.
    steps = np.arange(-rim, rim, LATTICE)
    right, up = (part.ravel() for part in np.meshgrid(steps, steps))
    size = np.hypot(right, up)
    outside = (size >= MAIN_LOBE) & (size <= rim)
    angles = 2.0 * math.pi * np.arange(array.elements) / array.elements
    phases = np.outer(right[outside], np.cos(angles)) + np.outer(up[outside], np.sin(angles))
    likeness = np.abs(np.exp(1j * phases).mean(axis=1)).max(initial=0.0) + BETWEEN
    spare = (1.0 - likeness) / SEPARATION - 2.0 * array.phase_sigma_rad**2 / array.elements
    if spare <= 0.0:
        return math.inf
    kappa = max(1.0 / spare, LEAST_EFFECTIVE_SNR)
    total = (kappa + math.sqrt(kappa**2 + 4.0 * SNAPSHOTS * kappa)) / (2.0 * SNAPSHOTS)
    return 10.0 * math.log10(total * SNAPSHOTS / PERIOD_S)
