"""Simulated interferometer: from the true relative motion to what the receiver measures.

Every slot is simulated at its own time, so motion during the sequence is in the phases.  The
transponder is coherent (its oscillator keeps phase over the sequence).  A loop holds lock while its
links have 10 dB and both arrays face each other; a loop without lock reports a random phase and
rate, as a real one would, and `locked` False.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.interferometer.measurement import (
    InterferometerMeasurement,
    phase_rate_sigma_rad_s,
    phase_variance,
)
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion, moved, require_motion
from rf_pointing.array_sensors.interferometer.radio import (
    LOWEST_SNR,
    LinkParams,
    RadioParams,
    amplitude_sigma,
    signal_to_noise_ratios,
)
from rf_pointing.array_sensors.interferometer.relative_pose import reverse_direction
from rf_pointing.array_sensors.interferometer.system import (
    InterferometerSystem,
    path_lengths,
    path_rates_m_s,
)
from rf_pointing.core import random_stream, require_finite
from rf_pointing.core.types import Array

# Any rate a free-running loop may report; far outside of what a docking gives.
_LOST_RATE_RAD_S = 1e3


class InterferometerSource:
    """Seeded source of measurements; `state` and `restore` make a stopped run continue identically.

    `excitation`: amplitudes of the passive y and z dipoles, one as designed.  Fixed errors of
    phases, rates and couplings follow the seed.
    """

    def __init__(
        self,
        system: InterferometerSystem,
        radio: RadioParams,
        link: LinkParams,
        seed: int,
        excitation: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        if not all(np.isfinite(excitation)) or min(excitation) <= 0.0:
            raise ValueError(f"excitation={excitation} must be finite and > 0")
        self.system, self.radio, self.link = system, radio, link
        self.excitation = np.array(excitation)
        self._carriers = system.schedule.carriers(system.plan)
        shape = (system.plan.count, 3, 3)
        # A stream of its own: hardware errors do not change with the number of measurements drawn
        # before.
        hardware = random_stream(seed, "interferometer hardware")
        self._hardware_rad = (hardware.normal(size=shape) * radio.hardware_phase_rad)[
            self._carriers
        ]
        self._hardware_rate_rad_s = hardware.normal(size=(3, 3)) * radio.hardware_rate_rad_s
        self._hardware_coupling = hardware.normal(size=(2, 2)) * radio.hardware_coupling
        self._rng = random_stream(seed, "interferometer")

    @property
    def state(self) -> dict[str, Any]:
        """The random generator's complete state."""
        return dict(self._rng.bit_generator.state)

    def restore(self, state: dict[str, Any]) -> None:
        """Continue as the source that `state` was taken from."""
        self._rng.bit_generator.state = state

    def measure(self, t_s: float, motion: RelativeMotion) -> InterferometerMeasurement:
        """Return the measurement of the sequence centred on `t_s`, `motion` being the truth at that
        time.
        """
        require_finite("t_s", t_s)
        motion = require_motion(motion)
        slots = moved(motion, self.system.schedule.offsets_s(self.system.plan))
        lengths = path_lengths(slots.position_m, slots.attitude, self.system.arrays)
        snr_forward, snr_return = self._ratios(lengths)
        locked = (
            (snr_return >= LOWEST_SNR)
            & (snr_forward >= LOWEST_SNR)[:, None, None]
            & _facing(motion)
        )
        phases, rates = self._loops(slots, lengths, snr_forward, snr_return, locked)
        amplitudes, sigma = self._couplings(motion)
        return InterferometerMeasurement(
            t_s=t_s,
            phase_rad=np.mod(phases, 2.0 * np.pi),
            phase_rate_rad_s=rates,
            amplitudes=amplitudes,
            amplitude_sigma=sigma,
            snr_forward=snr_forward,
            snr_return=snr_return,
            locked=locked,
        )

    def _ratios(self, lengths: Array) -> tuple[Array, Array]:
        forward, back = signal_to_noise_ratios(
            lengths[:, 0, 0], lengths[:, 1:, 1:], self.radio, self.system.plan, self.link
        )
        slots = np.arange(len(self._carriers))
        return forward[slots, self._carriers], back[slots, self._carriers]

    def _loops(
        self,
        slots: RelativeMotion,
        lengths: Array,
        snr_forward: Array,
        snr_return: Array,
        locked: NDArray[np.bool_],
    ) -> tuple[Array, Array]:
        arrays, dwell_s = self.system.arrays, self.system.schedule.dwell_s
        path_rates = path_rates_m_s(
            slots.position_m, slots.velocity_m_s, slots.attitude, slots.rate_rad_s, arrays
        )
        forward = np.sqrt(phase_variance(snr_forward))
        back = np.sqrt(phase_variance(snr_return) + self.radio.phase_noise_rad**2)
        phases = self._of_paths(lengths[:, 0, 0] + arrays.transponder_delay_m, lengths[:, 1:, 1:])
        rates = self._of_paths(path_rates[:, 0, 0], path_rates[:, 1:, 1:])
        phases = phases + self._hardware_rad + self._noise(forward, back)
        rates = (
            rates
            + self._hardware_rate_rad_s
            + self._noise(*(phase_rate_sigma_rad_s(sigma, dwell_s) for sigma in (forward, back)))
        )
        # Drawn always, whether a loop lost lock or not: later noise must not depend on it.
        lost_phases = self._rng.uniform(0.0, 2.0 * np.pi, phases.shape)
        lost_rates = self._rng.normal(0.0, _LOST_RATE_RAD_S, rates.shape)
        return np.where(locked, phases, lost_phases), np.where(locked, rates, lost_rates)

    def _of_paths(self, outward: Array, back: Array) -> Array:
        # Phase from lengths, phase rate from rates: both links' wave numbers of each slot's
        # carrier.
        forward_wave = self.system.plan.forward_wave_rad_m[self._carriers, None, None]
        return_wave = self.system.plan.return_wave_rad_m[self._carriers, None, None]
        return forward_wave * outward[:, None, None] + return_wave * back

    def _noise(self, forward_sigma: Array, return_sigma: Array) -> Array:
        common = self._rng.normal(size=len(forward_sigma)) * forward_sigma
        return common[:, None, None] + self._rng.normal(size=return_sigma.shape) * return_sigma

    def _couplings(self, motion: RelativeMotion) -> tuple[Array, float]:
        distance = float(np.linalg.norm(motion.position_m))
        sigma = float(
            np.hypot(
                amplitude_sigma(distance, self.radio, self.system.plan, self.link),
                self.radio.phase_noise_rad,
            )
        )
        true = (
            coupling_amplitudes(motion.position_m / distance, motion.attitude) * self.excitation
            + self._hardware_coupling
        )
        return true + self._rng.normal(size=(2, 2)) * sigma, sigma


def _facing(motion: RelativeMotion) -> bool:
    """Return whether each array has the other in front of it."""
    return bool(
        motion.position_m[0] > 0.0
        and reverse_direction(motion.position_m, motion.attitude)[0] < 0.0
    )
