"""LQG with integral action for one axis, designed with python-control from an identified model.

The regulator and the estimator are made for the drive (its pole and integrator, read off the
identified model) behind a notch and a section next to the bending mode.  The mode itself is left to
these, because a law that knows its phase is lost when the frequency moves by 10 %.  Gain, phase and
sensitivity margins are taken on the whole identified model.  Imported only on demand:
python-control brings matplotlib with it.
"""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import control
import numpy as np

from rf_pointing.controllers.filters import section_matrices
from rf_pointing.controllers.lqg import FORMAT, MATRICES, LqgDesign, LqgWeights
from rf_pointing.core import as_finite_array, require_between
from rf_pointing.core.types import Array

_NOTCH, _SHAPING = slice(2, 4), slice(4, 6)
_LOW = (3, 5)
"""States of the notch and of the section, and their low-pass states, which alone are filled by a
constant.
"""


def drive_of(a: Array, b: Array, c: Array, sample_s: float) -> tuple[float, float]:
    """Return bandwidth (rad/s) and gain of the drive in an identified rate-to-angle model.

    The bandwidth is that of the slowest real pole inside the unit circle, the gain the residue of
    the integrator.

    Raises
    ------
    ValueError
        If the model has no integrator or no real drive pole.
    """
    poles, vectors = np.linalg.eig(a)
    residues = (c @ vectors)[0] * np.linalg.solve(vectors, b.astype(np.complex128))[:, 0]
    # Identified poles are never exactly 1: the caller restores the integrator, here it is only
    # found again.
    integrator = int(np.argmin(np.abs(poles - 1.0)))
    if abs(poles[integrator] - 1.0) > 1e-6:
        raise ValueError(
            f"pole nearest to the integrator is {poles[integrator]:.6f}, must be 1 (restore it first)"
        )
    real = [
        pole.real
        for pole in np.delete(poles, integrator)
        if abs(pole.imag) < 1e-9 and 0.0 < pole.real < 1.0
    ]
    if not real:
        raise ValueError("model has no real pole between 0 and 1 for the drive")
    return -math.log(max(real)) / sample_s, float(residues[integrator].real) / sample_s


def design_lqg(
    a: Array, b: Array, c: Array, d: Array, sample_s: float, weights: LqgWeights
) -> LqgDesign:
    """Return the controller for the identified model (a, b, c, d) sampled every `sample_s` seconds.

    Raises
    ------
    ValueError
        If the closed loop on that model is unstable; the message carries its spectral radius.
    """
    require_between("sample_s", sample_s, 1e-4, 1.0)
    a, b, c, d = (
        as_finite_array(name, value, (None, None))
        for name, value in zip("abcd", (a, b, c, d), strict=True)
    )
    bandwidth, gain = drive_of(a, b, c, sample_s)
    plant, entry, shown = _design_plant(bandwidth, gain, sample_s, weights)
    size = len(plant)
    price = np.zeros((size, size))
    price[0, 0] = 1.0
    feedback, _, _ = control.dlqr(plant, entry, price, np.array([[weights.control_weight]]))
    law = _with_disturbance(plant, entry, shown, gain, bandwidth, sample_s)
    noise = np.diag(
        [0.0, weights.rate_intensity, *np.zeros(size - 2), weights.disturbance_intensity]
    )
    filter_gain, _, _ = control.dlqe(law[0], np.eye(size + 1), law[2], noise, np.array([[1.0]]))
    # Cancelling a constant disturbance fills the filters with it; what the regulator makes of that
    # comes on top.
    state_gain = np.hstack([np.asarray(feedback), [[1.0 + sum(feedback[0, low] for low in _LOW)]]])
    observer_gain = law[0] @ np.asarray(filter_gain)
    margins = _margins(
        control.ss(a, b, c, d, sample_s), law, state_gain, observer_gain, weights, sample_s
    )
    return LqgDesign(
        *law, state_gain, observer_gain, a, b, c, d, sample_s, bandwidth, gain, weights, *margins
    )


def as_mapping(design: LqgDesign) -> dict[str, Any]:
    """Return plain numbers and lists, as `LqgDesign.from_mapping` reads them."""
    values = {name: getattr(design, name) for name in design.__slots__}
    plain = {name: value.tolist() if name in MATRICES else value for name, value in values.items()}
    return plain | {"weights": dataclasses.asdict(design.weights)}


def save_lqg_designs(path: Path, azimuth: LqgDesign, elevation: LqgDesign) -> None:
    """Write both designs to `path`, which `loops.lqg_file` may name."""
    content = {"format": FORMAT, "azimuth": as_mapping(azimuth), "elevation": as_mapping(elevation)}
    path.write_text(json.dumps(content, indent=1) + "\n")


def controller_system(
    law: tuple[Array, Array, Array],
    state_gain: Array,
    observer_gain: Array,
    weights: LqgWeights,
    sample_s: float,
) -> control.StateSpace:
    """Return the law from error to rate command, notch included, as a python-control system."""
    a, b, c = law
    core = control.ss(
        a - b @ state_gain - observer_gain @ c, -observer_gain, -state_gain, [[0.0]], sample_s
    )
    filters = [
        control.ss(*section_matrices(part, sample_s), sample_s)
        for part in (weights.notch, weights.shaping)
    ]
    return filters[0] * filters[1] * core


def _margins(
    model: control.StateSpace,
    law: tuple[Array, Array, Array],
    state_gain: Array,
    observer_gain: Array,
    weights: LqgWeights,
    sample_s: float,
) -> tuple[float, float, float]:
    loop = model * controller_system(law, state_gain, observer_gain, weights, sample_s)
    radius = float(np.max(np.abs(control.feedback(loop, 1).poles())))
    if radius >= 1.0:
        raise ValueError(
            f"spectral radius {radius:.5f} of the loop on the identified model must be < 1"
        )
    # From the response: given a state space, python-control takes the margins of its transfer
    # function, which loses digits at this order.
    omega = np.geomspace(0.05, math.pi / sample_s * 0.999, 4000)
    response = loop(np.exp(1j * omega * sample_s))
    phase_deg = np.degrees(np.unwrap(np.angle(response)))
    gain_margin, phase_margin, *_ = control.stability_margins((np.abs(response), phase_deg, omega))
    return (
        float(np.max(1.0 / np.abs(1.0 + response))),
        20.0 * math.log10(gain_margin),
        math.radians(phase_margin),
    )


def _design_plant(
    bandwidth: float, gain: float, sample_s: float, weights: LqgWeights
) -> tuple[Array, Array, Array]:
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
    )


def _with_disturbance(
    plant: Array, entry: Array, shown: Array, gain: float, bandwidth: float, sample_s: float
) -> tuple[Array, Array, Array]:
    """Append a constant rate disturbance that enters where the command does, behind the filters."""
    column = np.vstack([_drive(bandwidth, gain, sample_s)[1], np.zeros((len(plant) - 2, 1))])
    a = np.block([[plant, column], [np.zeros((1, len(plant))), np.ones((1, 1))]])
    return a, np.vstack([entry, [[0.0]]]), np.hstack([shown, [[0.0]]])
