"""The simulated receiver: what sky, air and amplifier add to the carrier."""

import math

import numpy as np

from rf_pointing.core.derived import Rows, Value, rounded, tuned
from rf_pointing.station.derive.axes import link
from rf_pointing.station.derive.band import Band

# Loss of the clear atmosphere at the zenith over frequency: those of the three bands of DSS-13
# (docs/math/link.md) and what little is left of it at VHF.
_LOSS_MHZ, _LOSS_DB = (100.0, 2300.0, 8450.0, 32000.0, 50000.0), (0.03, 0.035, 0.04, 0.14, 0.6)
COSMIC_K, AIR_K, GROUND_K = 2.725, 275.0, 8.0
TICK_S = 0.02


def signal(of: Band) -> Rows:
    """Signal, noise and clusters of the simulated receiver."""
    section = of.section
    loss_db = rounded(float(np.interp(math.log(section.frequency_mhz), np.log(_LOSS_MHZ), _LOSS_DB)), 3)
    noise_k = section.system_noise_k
    if noise_k is None:
        noise_k = 400.0 if section.frequency_mhz < 1000.0 else 120.0
    passed = 10.0 ** (-0.1 * loss_db)
    sky_k = COSMIC_K * passed + AIR_K * (1.0 - passed)
    return {
        "link": link(of),
        "beam": {"half_power_beamwidth_deg": of.width},
        "atmosphere": {"zenith_loss_db": tuned(loss_db, "by frequency, 0.03 dB at VHF to 0.14 dB at 32 GHz")},
        "noise": {
            "lna_k": tuned(max(0.0, noise_k - GROUND_K - sky_k), "what sky and ground leave of system_noise_k"),
            "dichroic_k": tuned(0.0, "none"),
        },
        "receiver": {
            "system_noise_k": Value(noise_k, "bands.*.system_noise_k", "120 K, below 1 GHz 400 K, unless given")
        },
        "cluster_samples": tuned(
            max(3, round(of.content.receiver.power_period_s / TICK_S)), "samples in a power period"
        ),
    }  # fmt: skip
