"""Design of the LQG law of one axis, with integral action, from a model of the axis.

    K: least sum of y^2 + w_u v^2 of the drive behind notch and section
    L = A P C' / (C P C' + 1),   P the variance before a reading        (Kalman's predictor)

Regulator and estimator are made for the drive (its pole and integrator, read off the model) behind
a notch and a section next to the bending mode.  The mode itself is left to these, because a law
that knows its phase is lost when the frequency moves by 10 %.  The margins are taken on the whole
model.
"""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are

from rf_pointing.controllers.filters import section_matrices
from rf_pointing.controllers.lqg import FORMAT, MATRICES, LqgDesign, LqgGains, LqgWeights, law_matrices
from rf_pointing.controllers.margins import closed_radius, loop_margins, sampled_response
from rf_pointing.core import as_finite_array, require_between
from rf_pointing.core.types import Array

_NOTCH, _SHAPING = slice(2, 4), slice(4, 6)
_LOW = [3, 5]
"""States of the notch and of the section, and their low-pass states, which alone are filled by a
constant.
"""


def drive_of(a: Array, b: Array, c: Array, sample_s: float) -> tuple[float, float]:
    """Return bandwidth (rad/s) and gain of the drive in a rate-to-angle model.

    The bandwidth is that of the slowest real pole inside the unit circle, the gain the residue of
    the integrator.

    Raises
    ------
    ValueError
        If the model has no integrator or no real drive pole.
    """
    poles, vectors = np.linalg.eig(a)
    # Identified poles are never exactly 1: the caller restores the integrator, here it is only
    # found again.
    integrator = int(np.argmin(np.abs(poles - 1.0)))
    if abs(poles[integrator] - 1.0) > 1e-6:
        raise ValueError(
            f"pole nearest to the integrator is {poles[integrator]:.6f}, must be 1 (restore it)"
        )  # fmt: skip
    # Dead times put poles at zero, where eigenvectors may be parallel: one left vector suffices.
    right = vectors[:, integrator]
    values, lefts = np.linalg.eig(a.T)
    left = lefts[:, int(np.argmin(np.abs(values - 1.0)))]
    residue = ((c @ right) * (left @ b) / (left @ right)).item().real
    real = [
        pole.real
        for pole in np.delete(poles, integrator)
        if abs(pole.imag) < 1e-9 and 1e-3 < pole.real < 1.0
    ]  # fmt: skip
    if not real:
        raise ValueError("model has no real pole between 0 and 1 for the drive")
    return -math.log(max(real)) / sample_s, residue / sample_s


def lqg_gains(bandwidth: float, gain: float, sample_s: float, weights: LqgWeights) -> LqgGains:
    """Return regulator and estimator for a drive of this bandwidth (rad/s) and gain."""
    plant, entry, shown = _design_plant(bandwidth, gain, sample_s, weights)
    size = len(plant)
    price, effort = np.diag([1.0, *np.zeros(size - 1)]), weights.control_weight
    cost = solve_discrete_are(plant, entry, price, np.array([[effort]]))
    feedback = (entry.T @ cost @ plant) / (effort + entry.T @ cost @ entry)
    a, b, c = _with_disturbance(plant, entry, shown, gain, bandwidth, sample_s)
    noise = np.diag(
        [0.0, weights.rate_intensity, *np.zeros(size - 2), weights.disturbance_intensity]
    )  # fmt: skip
    variance = solve_discrete_are(a.T, c.T, noise, np.eye(1))
    # The law predicts over one sample, so A acts on the gain of the reading once.
    observer_gain = a @ variance @ c.T / (c @ variance @ c.T + 1.0)
    # Cancelling a constant disturbance fills the filters with it; what the regulator makes of that
    # comes on top.
    state_gain = np.hstack([feedback, [[1.0 + float(feedback[0, _LOW].sum())]]])
    return a, b, c, state_gain, observer_gain


def design_lqg(
    a: Array, b: Array, c: Array, d: Array, sample_s: float, weights: LqgWeights
) -> LqgDesign:  # fmt: skip
    """Return the controller for the model (a, b, c, d) sampled every `sample_s` seconds.

    Raises
    ------
    ValueError
        If the closed loop on that model is unstable; the message carries its spectral radius.
    """
    require_between("sample_s", sample_s, 1e-4, 1.0)
    a, b, c, d = (
        as_finite_array(name, value, (None, None))
        for name, value in zip("abcd", (a, b, c, d), strict=True)
    )  # fmt: skip
    bandwidth, gain = drive_of(a, b, c, sample_s)
    found = lqg_gains(bandwidth, gain, sample_s, weights)
    law = law_matrices(found, weights, sample_s)
    radius = closed_radius((a, b, c, d), law)
    if radius >= 1.0:
        raise ValueError(
            f"spectral radius {radius:.5f} of the loop on the identified model must be < 1"
        )  # fmt: skip
    grid = np.geomspace(0.05, math.pi / sample_s * 0.999, 4000) / (2.0 * math.pi)
    both = (sampled_response(system, grid, sample_s)[:, 0, 0] for system in ((a, b, c, d), law))
    margins = loop_margins(grid, np.prod(list(both), axis=0))
    return LqgDesign(
        *found, a, b, c, d, sample_s, bandwidth, gain, weights,
        margins.peak_sensitivity, margins.gain_margin_db, margins.phase_margin_rad,
    )  # fmt: skip


def as_mapping(design: LqgDesign) -> dict[str, Any]:
    """Return plain numbers and lists, as `LqgDesign.from_mapping` reads them."""
    values = {name: getattr(design, name) for name in design.__slots__}
    plain = {name: value.tolist() if name in MATRICES else value for name, value in values.items()}
    return plain | {"weights": dataclasses.asdict(design.weights)}


def save_lqg_designs(path: Path, azimuth: LqgDesign, elevation: LqgDesign) -> None:
    """Write both designs to `path`, which `loops.lqg_file` may name."""
    content = {"format": FORMAT, "azimuth": as_mapping(azimuth), "elevation": as_mapping(elevation)}
    path.write_text(json.dumps(content, indent=1) + "\n")


def _design_plant(
    bandwidth: float, gain: float, sample_s: float, weights: LqgWeights
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Return the sampled drive behind the filters: angle, rate, then band and low of each."""
    drive, entry = _drive(bandwidth, gain, sample_s)
    na, nb, nc, nd = section_matrices(weights.notch, sample_s)
    sa, sb, sc, sd = section_matrices(weights.shaping, sample_s)
    plant, command = np.zeros((6, 6)), np.zeros((6, 1))
    plant[:2, :2], plant[:2, _NOTCH], plant[:2, _SHAPING] = drive, entry @ nc, entry @ nd @ sc
    plant[_NOTCH, _NOTCH], plant[_NOTCH, _SHAPING], plant[_SHAPING, _SHAPING] = na, nb @ sc, sa
    command[:2], command[_NOTCH], command[_SHAPING] = entry @ nd @ sd, nb @ sd, sb
    return plant, command, np.eye(6)[:1]


def _drive(bandwidth: float, gain: float, sample_s: float) -> tuple[Array, Array]:
    decay = math.exp(-bandwidth * sample_s)
    reach = (1.0 - decay) / bandwidth
    return np.array([[1.0, gain * reach], [0.0, decay]]), np.array(
        [[gain * (sample_s - reach)], [1.0 - decay]]
    )  # fmt: skip


def _with_disturbance(
    plant: Array, entry: Array, shown: Array, gain: float, bandwidth: float, sample_s: float
) -> tuple[Array, Array, Array]:
    """Append a constant rate disturbance that enters where the command does, behind the filters."""
    column = np.vstack([_drive(bandwidth, gain, sample_s)[1], np.zeros((len(plant) - 2, 1))])
    a = np.block([[plant, column], [np.zeros((1, len(plant))), np.ones((1, 1))]])
    return a, np.vstack([entry, [[0.0]]]), np.hstack([shown, [[0.0]]])
