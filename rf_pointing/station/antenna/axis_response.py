"""Exact responses of one axis of the plant to rate commands, held by the sampling, and to wind.

Gusts have Davenport's spectrum (`servo/wind.py`).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rf_pointing.controllers import LawMatrices
from rf_pointing.controllers.margins import closed_radius
from rf_pointing.core import AXES, Array, ComplexArray
from rf_pointing.servo import PlantParams, discretise
from rf_pointing.servo.linear_model import linear_model
from rf_pointing.servo.wind import GUST_LENGTH_M


@dataclass(frozen=True, slots=True)
class Variation:
    """How the antenna differs from the one the controller was made for.

    `gear` is the share of the gear's stiffness that is left: a swing across the play meets the
    spring, and its damper, for a part of the time.
    """

    frequency: float = 1.0
    residue: float = 1.0
    gear: float = 1.0

    def __str__(self) -> str:
        if self.gear != 1.0:
            return f"with {self.gear:g} of its gear's stiffness, as small swings in its play find it"
        return f"with its modes at {self.frequency:g} and their residues at {self.residue:g} of known"


AS_KNOWN = Variation()


class AxisResponse:
    """Responses of one axis of a plant on a grid `frequency_hz` (f,); the other axis is at rest.

    Dead times count as whole periods of `sample_s`.
    """

    def __init__(
        self, plant: PlantParams, axis: int, variation: Variation, frequency_hz: Array, sample_s: float
    ) -> None:
        name = AXES[axis]
        model = linear_model(_varied(plant, name, variation))
        kept = [i for i, state in enumerate(model.state_names) if name in state]
        block = np.ix_(kept, kept)
        self.a, self.command = model.a[block], model.b_command[kept][:, [axis]]
        self.wind = model.b_wind[kept][:, [axis]]
        self.outputs = np.vstack([model.encoder[axis, kept], model.beam[axis, kept]])
        self.sample_s, self.late = sample_s, round(getattr(plant, name).drive_delay_s / sample_s)
        self.step = discretise(self.a, self.command, sample_s)
        self.frequency_hz = frequency_hz

    @classmethod
    def on_own_grid(
        cls, plant: PlantParams, axis: int, sample_s: float, variation: Variation = AS_KNOWN
    ) -> "AxisResponse":
        """Return an axis on a grid that is dense at its modes."""
        rough = cls(plant, axis, variation, np.ones(1), sample_s)
        poles = np.exp(np.linalg.eigvals(rough.a) * sample_s).astype(np.complex128)
        return cls(plant, axis, variation, frequency_grid(poles, sample_s), sample_s)

    @cached_property
    def from_command(self) -> ComplexArray:
        """Response (f, 2) of encoder and beam to the rate command."""
        z: ComplexArray = np.asarray(np.exp(2j * np.pi * self.frequency_hz * self.sample_s))
        found = self._solve(z, self.step[:, :-1], self.step[:, -1:])
        return np.asarray(found * z[:, None] ** -self.late) if self.late else found

    @cached_property
    def from_wind(self) -> ComplexArray:
        """Response (f, 2) of encoder and beam to wind acceleration."""
        s: ComplexArray = np.asarray(2j * np.pi * self.frequency_hz, dtype=np.complex128)
        return self._solve(s, self.a, self.wind)

    @cached_property
    def sampled(self) -> LawMatrices:
        """State space from the rate command to the encoder, its dead time included."""
        a, b, c = self.step[:, :-1], self.step[:, -1:], self.outputs[:1]
        for _ in range(self.late):
            a = np.block([[a, b], [np.zeros((1, len(a) + 1))]])
            b, c = np.eye(len(a))[:, -1:], np.hstack([c, [[0.0]]])
        return a, b, c, np.zeros((1, 1))

    def closed_radius(self, law: LawMatrices) -> float:
        """Return the spectral radius of the encoder loop under a law from error to rate."""
        return closed_radius(self.sampled, law)

    def _solve(self, points: ComplexArray, a: Array, b: Array) -> ComplexArray:
        systems = points[:, None, None] * np.eye(len(a)) - a
        solved = np.linalg.solve(systems, b.astype(np.complex128)[None])
        return np.asarray((self.outputs @ solved)[:, :, 0])


def davenport_psd(frequency_hz: Array, mean_speed_m_s: float, drag_coefficient: float) -> Array:
    """Return the one-sided spectrum of the gust speed in (m/s)^2/Hz at `frequency_hz` > 0."""
    x = GUST_LENGTH_M * frequency_hz / mean_speed_m_s
    scale = 4.0 * drag_coefficient * mean_speed_m_s**2 / frequency_hz
    return np.asarray(scale * x**2 / (1.0 + x**2) ** (4.0 / 3.0))


def _varied(plant: PlantParams, name: str, variation: Variation) -> PlantParams:
    axis = getattr(plant, name)
    changed = axis.replace(
        mode_frequency_hz=tuple(variation.frequency * value for value in axis.mode_frequency_hz),
        mode_encoder_residue=tuple(
            variation.residue * value for value in axis.mode_encoder_residue
        ),
        mode_beam_residue=tuple(variation.residue * value for value in axis.mode_beam_residue),
    )  # fmt: skip
    if variation.gear != 1.0:
        stiffness = variation.gear * axis.gear_stiffness_n_m
        damping = math.sqrt(variation.gear) * axis.gear_damping
        changed = changed.replace(gear_stiffness_n_m=stiffness, gear_damping=damping)
    return plant.replace(**{name: changed})


def frequency_grid(poles: ComplexArray, sample_s: float) -> Array:
    """Return frequencies up to half the sampling rate, dense at oscillating poles (of z)."""
    nyquist_hz = 0.5 / sample_s
    points = [np.geomspace(2e-5 * nyquist_hz, 0.98 * nyquist_hz, 300)]
    spread = np.tan(np.linspace(-1.5, 1.5, 41))
    for pole in poles[(poles.imag > 1e-9) & (np.abs(poles) > 0.5)]:
        wide = max(-math.log(abs(pole)), 1e-3) * spread
        points.append((np.angle(pole) + wide) / (2.0 * math.pi * sample_s))
    grid = np.concatenate(points)
    return np.unique(grid[(grid > 1e-5 * nyquist_hz) & (grid <= 0.98 * nyquist_hz)])
