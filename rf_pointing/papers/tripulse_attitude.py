"""TRIPULSE section 5 recomputed: attitude of two stations in the Y-Z plane about +Z, 2.5, 5 and 10 deg apart.

Gaussian noise on T_x and T_y of each station; errors are the rotation vector of R_hat R^T in the array frame, rms over
all trials.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_matrix, quaternion_to_rotation_vector
from rf_pointing.array_sensors.attitude.two_station import (
    bisector_rotation,
    direction_covariances,
    directions_from_projections,
)
from rf_pointing.array_sensors.attitude.wahba import attitude_covariance, fit_rotation
from rf_pointing.core import random_stream
from rf_pointing.papers.row import Row

__all__ = ["SEPARATIONS_DEG", "attitude_errors_rad", "attitude_rows", "predicted_rad", "station_directions"]

Array = NDArray[np.float64]

SEPARATIONS_DEG = (2.5, 5.0, 10.0)
SMALL, LARGE = 1e-4, 5e-2
TRIALS = 10_000
WITHIN = 4.0 / math.sqrt(2.0 * TRIALS)


def attitude_rows(seed: int = 1) -> list[Row]:
    """Return the statements of section 5 beside ours."""
    return [*_roll_pitch_rows(seed), *_yaw_rows(seed), *_method_rows(seed)]


def station_directions(separation_deg: float) -> Array:
    """Return the directions (2, 3) to both stations."""
    half = math.radians(separation_deg) / 2.0
    return np.array([[0.0, math.sin(side * half), math.cos(half)] for side in (-1.0, 1.0)])


def attitude_errors_rad(separation_deg: float, sigma: float, seed: int, trials: int = TRIALS) -> Array:
    """Return the rms roll, pitch and yaw errors (3,) for projection noise `sigma`."""
    reference = station_directions(separation_deg)
    rng = random_stream(seed, f"tripulse attitude {separation_deg} {sigma}")
    projections = reference[:, :2] + sigma * rng.normal(size=(trials, 2, 2))
    rotation = bisector_rotation(reference, directions_from_projections(projections))
    error = quaternion_to_rotation_vector(quaternion_from_matrix(rotation))
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def predicted_rad(separation_deg: float, sigma: float) -> Array:
    """Return the roll, pitch and yaw standard deviations (3,) of (31)."""
    reference = station_directions(separation_deg)
    spreads = direction_covariances(reference[:, :2], np.broadcast_to(sigma**2 * np.eye(2), (2, 2, 2)))
    return np.asarray(np.sqrt(np.diagonal(attitude_covariance(reference, spreads))))


def _roll_pitch_rows(seed: int) -> list[Row]:
    near, far = (attitude_errors_rad(separation, SMALL, seed) for separation in (2.5, 10.0))
    return [
        Row(
            quantity=f"{name} error at 10 deg of station separation over that at 2.5 deg",
            source="5.4, Fig. 6",
            paper=1.0,
            ours=float(far[axis] / near[axis]),
            unit="1",
            tolerance=math.sqrt(2.0) * WITHIN,
            remark="sigma / (sqrt(2) cos(sep/2)): 0.4 % more at 10 deg",
        )
        for axis, name in ((0, "roll"), (1, "pitch"))
    ]


def _yaw_rows(seed: int) -> list[Row]:
    found = []
    for separation in SEPARATIONS_DEG:
        small = float(attitude_errors_rad(separation, SMALL, seed)[2])
        theory = float(predicted_rad(separation, SMALL)[2])
        closed_form = SMALL / (math.sqrt(2.0) * math.sin(math.radians(separation) / 2.0))
        found += [
            Row(
                quantity=f"yaw error at {separation} deg, sigma = 1e-4, over (31)",
                source="5.4, Fig. 6",
                paper=1.0,
                ours=small / theory,
                unit="1",
                tolerance=WITHIN,
            ),
            Row(
                quantity=f"yaw of (31) at {separation} deg over sigma / (sqrt(2) sin(sep/2))",
                source="eq. (31)",
                paper=1.0,
                ours=theory / closed_form,
                unit="1",
                tolerance=1e-9,
            ),
        ]
    for separation in SEPARATIONS_DEG:
        ratio = float(attitude_errors_rad(separation, LARGE, seed)[2] / predicted_rad(separation, LARGE)[2])
        found.append(
            Row(
                quantity=f"departure of the yaw error from (31) at {separation} deg, sigma = 0.05",
                source="5.4, Fig. 6 (valid only for small errors)",
                paper=10.0,
                ours=100.0 * abs(ratio - 1.0),
                unit="%",
                tolerance=0.0,
                bound=">=",
                remark=f"measured over (31), which is of first order: {ratio:.3f}",
            )
        )
    return found


def _method_rows(seed: int) -> list[Row]:
    rng = random_stream(seed, "tripulse attitude methods")
    reference = _unit(rng.normal(size=(2000, 2, 3)))
    measured = _unit(reference + 0.05 * rng.normal(size=reference.shape))
    fit = fit_rotation(reference, measured)
    difference = float(np.max(np.abs(bisector_rotation(reference, measured) - fit.rotation)))
    return [
        Row(
            quantity="bisector construction against SVD, two stations, largest element",
            source="5.2",
            paper=0.0,
            ours=difference,
            unit="1",
            tolerance=1e-9,
        ),
        _weights_row(rng),
        _pitch_row(),
    ]


def _weights_row(rng: np.random.Generator) -> Row:
    """Cost (25) of the rotation from the printed H, without weights, over that with them."""
    weights = np.array([1.0, 4.0, 25.0])
    reference = _unit(rng.normal(size=(2000, 3, 3)))
    measured = _unit(reference + 0.05 * rng.normal(size=reference.shape))
    best = fit_rotation(reference, measured, weights)
    printed = fit_rotation(reference, measured).rotation
    gaps = measured - np.einsum("nij,nlj->nli", printed, reference)
    cost = np.sum(weights * np.sum(gaps**2, axis=-1), axis=-1)
    return Row(
        quantity="mean cost (25), weights 1, 4, 25, of the printed H over the least cost",
        source="5.2, H = sum t' t^T",
        paper=1.0,
        ours=float(np.mean(cost) / np.mean(best.cost)),
        unit="1",
        tolerance=1e-6,
        remark="the weights of (25) belong inside H; the printed H minimises the unweighted cost",
        explained=True,
    )


def _pitch_row() -> Row:
    reference = station_directions(5.0)
    turned = reference @ np.array([[1.0, 0.0, 1e-6], [0.0, 1.0, 0.0], [-1e-6, 0.0, 1.0]]).T
    beam = fit_rotation(reference, _unit(turned)).rotation @ np.array([0.0, 0.0, 1.0])
    return Row(
        quantity="first component of the error of the beam p' = z per pitch error",
        source="5.3, C_p(1,1)",
        paper=1.0,
        ours=float(beam[0]) / 1e-6,
        unit="1",
        tolerance=1e-3,
    )


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
