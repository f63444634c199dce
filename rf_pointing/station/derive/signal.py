"""The simulated receiver: what sky, air and amplifier add to the carrier."""

import math

import numpy as np

from rf_pointing.core.derived import Rows, Value, rounded, tuned
from rf_pointing.core.parameters import flat, leaves
from rf_pointing.receiver.params import LEVELS, UNKNOWN_FLOOR_DBM, SignalReceiverParams
from rf_pointing.receiver.params import OUTLET_FORMATS as FORMATS
from rf_pointing.station.derive.axes import link
from rf_pointing.station.derive.band import Band

# Loss of the clear atmosphere at the zenith over frequency: those of the three bands of DSS-13
# (docs/math/link.md) and what little is left of it at VHF.
_LOSS_MHZ, _LOSS_DB = (100.0, 2300.0, 8450.0, 32000.0, 50000.0), (0.03, 0.035, 0.04, 0.14, 0.6)
COSMIC_K, AIR_K, GROUND_K = 2.725, 275.0, 8.0
TICK_S = 0.02


OPEN = "link", "iq", "signal", "level"
"""Sections of `receiver` whose keys are those of the node's parameters."""


def receiver(of: Band) -> dict[str, Value]:
    """The receiver of the station, as signal_receiver takes it."""
    section = of.content.receiver
    given = {f"{name}.{key}": value for name in OPEN for key, value in flat(getattr(section, name)).items()}
    own = {"type": section.type, "options": section.options}
    return (
        {name: Value(value, f"receiver.{name}") for name, (_, value) in leaves(SignalReceiverParams()).items()}
        | {name: Value(value, f"receiver.{name}") for name, value in (own | given).items()}
        | {
            "period_s": Value(section.power_period_s, "receiver.power_period_s"),
            "frequency_hz": Value(1e6 * of.section.frequency_mhz, "bands.*.frequency_mhz"),
            "system_noise_k": system_noise(of),
        }
    )


def level_known(of: Band) -> bool:
    """Whether the C/N0 of the receiver is one: a power without its noise is not."""
    taken = {name: each.value for name, each in receiver(of).items()}
    return taken["type"] not in LEVELS or taken["level.kind"] != "dbm" or taken["level.floor_dbm"] > UNKNOWN_FLOOR_DBM


def radio(of: Band) -> dict[str, Value]:
    """The radio of a simulated station whose receiver takes samples."""
    taken = {name: each.value for name, each in receiver(of).items()}
    received_hz = abs(taken["frequency_hz"] - 1e6 * taken["iq.converter_mhz"])
    return {
        "carrier_hz": Value(received_hz, "receiver.iq.converter_mhz"),
        "doppler_hz": Value(taken["frequency_hz"], "bands.*.frequency_mhz"),
        "centre_hz": Value(1e6 * taken["iq.centre_mhz"] or received_hz, "receiver.iq.centre_mhz"),
        "generator.rate_hz": Value(taken["iq.rate_hz"], "receiver.iq.rate_hz"),
        "generator.channels": Value(taken["signal.channels"], "receiver.signal.channels"),
    }


def outlet(of: Band) -> dict[str, Value]:
    """How the radio of a simulated station is reached."""
    taken = {name: each.value for name, each in receiver(of).items()}
    kind = taken["type"] if taken["type"] in FORMATS else FORMATS[0]
    host = {"localhost": "127.0.0.1"}.get(taken["link.host"], taken["link.host"])
    return {
        "format": Value(kind, "receiver.type"),
        "host": Value(host, "receiver.link.host"),
        "port": Value(taken["link.port"], "receiver.link.port"),
    }


def system_noise(of: Band) -> Value:
    """System noise temperature at the zenith."""
    given, low = of.section.system_noise_k, of.section.frequency_mhz < 1000.0
    noise_k = given if given is not None else 400.0 if low else 120.0
    return Value(noise_k, "bands.*.system_noise_k", "120 K, below 1 GHz 400 K, unless given")


def signal(of: Band) -> Rows:
    """Signal, noise and clusters of the simulated receiver."""
    section = of.section
    loss_db = rounded(float(np.interp(math.log(section.frequency_mhz), np.log(_LOSS_MHZ), _LOSS_DB)), 3)
    noise_k = system_noise(of).value
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
        "receiver": {"system_noise_k": system_noise(of)},
        "cluster_samples": tuned(
            max(3, round(of.content.receiver.power_period_s / TICK_S)), "samples in a power period"
        ),
    }  # fmt: skip
