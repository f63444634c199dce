"""The radio part, simulated: phases of nine carriers over nine paths and four couplings, with receiver noise.

One draw of forward-link noise per carrier, shared by the nine paths (the return elements differ by frequency), one of
return-link noise per carrier and path; Gaussian, so each link needs 10 dB (PI83 section 8.3, listing RF).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams, path_lengths
from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan, carrier_phases
from rf_pointing.array_sensors.arrays.interferometer.link import LinkParams, link_snr
from rf_pointing.array_sensors.arrays.interferometer.range_accuracy import phase_variance
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import Params, parameter

__all__ = [
    "LOWEST_SNR",
    "RadioParams",
    "amplitude_sigma",
    "require_gaussian_regime",
    "signal_to_noise_ratios",
    "simulate_amplitudes",
    "simulate_phases",
]

Array = NDArray[np.float64]
LOWEST_SNR = 10.0
"""Power ratio below which phase noise is not Gaussian and loops lose lock (10 dB)."""


@dataclass(frozen=True, kw_only=True)
class RadioParams(Params):
    """Radiated powers per carrier and element; the defaults are the report's simulation."""

    forward_power_w: float = parameter(2.2, "radiated by the active centre element", low=1e-9, high=1e6)
    return_power_w: float = parameter(1.1, "radiated by each passive element", low=1e-9, high=1e6)
    hardware_phase_rad: float = parameter(0.0, "sigma of a fixed, unknown phase of carrier and path", low=0.0, high=1.0)


def signal_to_noise_ratios(
    outward_m: ArrayLike, back_m: ArrayLike, radio: RadioParams, plan: CarrierPlan, link: LinkParams
) -> tuple[Array, Array]:
    """Return the power ratios of the forward link (..., K) and of the return links (..., K, n, n)."""
    out = np.asarray(outward_m, dtype=np.float64)[..., None]
    back = np.asarray(back_m, dtype=np.float64)[..., None, :, :]
    forward = link_snr(radio.forward_power_w, out, plan.forward_carriers_hz, link)
    return forward, link_snr(radio.return_power_w, back, plan.return_carriers_hz[:, None, None], link)


def require_gaussian_regime(snr_forward: ArrayLike, snr_return: ArrayLike) -> None:
    """Raise ValueError if any link is below 10 dB, where the noise model does not hold."""
    for name, snr in (("forward", snr_forward), ("return", snr_return)):
        lowest = float(np.min(snr))
        if lowest < LOWEST_SNR:
            raise ValueError(f"{name} link snr={lowest:.4g} must be >= {LOWEST_SNR} for Gaussian phase noise")


def simulate_phases(
    position_m: ArrayLike,
    attitude: ArrayLike,
    arrays: ArrayParams,
    radio: RadioParams,
    plan: CarrierPlan,
    link: LinkParams,
    rng: np.random.Generator,
    trials: int = 1,
) -> Array:
    """Return `trials` sets of phases in [0, 2 pi), (trials, K, 3, 3), of one relative pose."""
    lengths = path_lengths(position_m, attitude, arrays)
    outward, back = lengths[0, 0], lengths[1:, 1:]
    snr = signal_to_noise_ratios(outward, back, radio, plan, link)
    require_gaussian_regime(*snr)
    forward_sigma, return_sigma = (np.sqrt(phase_variance(ratio)) for ratio in snr)
    noise = rng.normal(size=(trials, plan.count, 1, 1)) * forward_sigma[:, None, None]
    noise = noise + rng.normal(size=(trials, plan.count, 3, 3)) * return_sigma
    return np.mod(carrier_phases(outward + arrays.transponder_delay_m, back, plan) + noise, 2.0 * np.pi)


def amplitude_sigma(
    range_m: ArrayLike, radio: RadioParams, plan: CarrierPlan, link: LinkParams, variant: str = CORRECTED
) -> Array:
    """Return the noise sigma (...) of one coupling, largest coupling one, from K carriers.

    "corrected": mean over the carriers, return power; "published": what the listing computes - only the last
    carrier's draw survives, is divided by nine all the same, and the forward power stands for the return power.
    """
    distance = np.asarray(range_m, dtype=np.float64)[..., None]
    if is_published(variant):
        snr = link_snr(radio.forward_power_w, distance, plan.return_carriers_hz, link)
        return np.sqrt(phase_variance(snr[..., -1])) / plan.count
    snr = link_snr(radio.return_power_w, distance, plan.return_carriers_hz, link)
    return np.asarray(np.sqrt(np.sum(phase_variance(snr), axis=-1)) / plan.count)


def simulate_amplitudes(amplitudes: ArrayLike, sigma: float, rng: np.random.Generator, trials: int = 1) -> Array:
    """Return `trials` noisy sets (trials, 2, 2) of the four couplings."""
    return np.asarray(amplitudes, dtype=np.float64) + rng.normal(size=(trials, 2, 2)) * sigma
