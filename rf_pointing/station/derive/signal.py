"""The simulated receiver: what sky, air and amplifiers add to the carrier, and how strong it is."""

import math

import numpy as np

from rf_pointing.core import Rows, Value, flat, leaves, rounded, tuned, with_leaves
from rf_pointing.receiver.params import OUTLET_FORMATS as FORMATS
from rf_pointing.receiver.params import SignalReceiverParams
from rf_pointing.rf.budget import gain_of_beam_dbi, zenith_level_db_hz
from rf_pointing.rf.noise import Stage, cascade_k, noise_of_figure_k, noise_of_plate_k, sky_k
from rf_pointing.station.derive.band import TICK_S, Band
from rf_pointing.station.description.content import NoiseSection, StageSection

# Loss of the clear atmosphere at the zenith over frequency: those of the three bands of DSS-13
# (docs/math/link.md) and what little is left of it at VHF.
_LOSS_MHZ, _LOSS_DB = (100.0, 2300.0, 8450.0, 32000.0, 50000.0), (0.03, 0.035, 0.04, 0.14, 0.6)
COSMIC_K, AIR_K, GROUND_K = 2.725, 275.0, 8.0
ZENITH_LEVEL = "zenith_carrier_to_noise_db_hz"

OPEN = "link", "iq", "signal", "level"
"""Sections of `receiver` whose keys are those of the node's parameters."""


def receiver(of: Band) -> dict[str, Value]:
    """The receiver of the station, as signal_receiver takes it."""
    section = of.content.receiver
    sections = {name: getattr(section, name) for name in OPEN}
    own = {"type": section.type, "options": section.options}
    return (
        {name: Value(value, f"receiver.{name}") for name, (_, value) in leaves(SignalReceiverParams()).items()}
        | {name: Value(value, f"receiver.{name}") for name, value in (own | flat(sections)).items()}
        | {
            "period_s": Value(section.power_period_s, "receiver.power_period_s"),
            "frequency_hz": Value(1e6 * of.section.frequency_mhz, "bands.*.frequency_mhz"),
            "system_noise_k": system_noise(of),
        }
    )


def level_known(of: Band) -> bool:
    """Whether the C/N0 of the receiver is one: a power without its noise is not."""
    taken = {name: each.value for name, each in receiver(of).items()}
    return with_leaves(SignalReceiverParams(), taken).level_known


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
        "file": Value(taken["link.file"], "receiver.link.file"),
    }


def system_noise(of: Band) -> Value:
    """System noise temperature at the zenith."""
    noise_k = clear_noise_k(of)
    if of.section.noise is not None:
        return Value(noise_k, "bands.*.noise", "sky, ground, plate and chain at the zenith")
    return Value(noise_k, "bands.*.system_noise_k", "120 K, below 1 GHz 400 K, unless given")


def signal(of: Band) -> Rows:
    """Signal, noise and clusters of the simulated receiver."""
    loss_db = air_loss_db(of)
    noise_k = clear_noise_k(of)
    stated = of.section.noise
    return {
        "link": link(of),
        "beam": {"half_power_beamwidth_deg": of.width},
        "atmosphere": {"zenith_loss_db": tuned(loss_db, "by frequency, 0.03 dB at VHF to 0.14 dB at 32 GHz")},
        "noise": {
            "lna_k": tuned(max(0.0, noise_k - GROUND_K - _sky_k(COSMIC_K, loss_db)),
                           "what sky and ground leave of system_noise_k"),
            "dichroic_k": tuned(0.0, "none"),
        } if stated is None else noise_parts(stated, of.section.frequency_mhz),
        "receiver": {"system_noise_k": system_noise(of)},
        "frequency_hz": Value(1e6 * of.section.frequency_mhz, "bands.*.frequency_mhz"),
        "gain_dbi": Value(gain_dbi(of), "bands.*.gain_dbi", "26000 deg^2 / h^2 unless given"),
        "cluster_samples": tuned(
            max(3, round(of.content.receiver.power_period_s / TICK_S)), "samples in a power period"
        ),
    }  # fmt: skip


def noise_parts(stated: NoiseSection, frequency_mhz: float) -> Rows:
    """Return the noise of each part, for a band that states them."""
    chain = [_stage(each) for each in stated.chain]
    return {
        "lna_k": Value(rounded(cascade_k(chain)), "bands.*.noise.chain", "T_1 + T_2/G_1 + ... (Friis)"),
        "dichroic_k": Value(rounded(noise_of_plate_k(stated.dichroic_loss_db)), "bands.*.noise.dichroic_loss_db"),
        "ground_k": Value(stated.spillover_k, "bands.*.noise.spillover_k"),
        "cosmic_k": Value(rounded(sky_k(1e6 * frequency_mhz)), "bands.*.frequency_mhz", "2.725 K and the Galaxy"),
    }


def link(of: Band) -> Rows:
    """Strength of the carrier to expect."""
    section = of.section
    level = Value(section.zenith_carrier_to_noise_db_hz, f"bands.*.{ZENITH_LEVEL}")
    range_m = 1e3 * section.reference_range_km
    if section.satellite_eirp_dbw is not None:
        found = zenith_level_db_hz(
            section.satellite_eirp_dbw, gain_dbi(of), 1e6 * section.frequency_mhz, range_m, air_loss_db(of),
            clear_noise_k(of),
        )  # fmt: skip
        level = Value(rounded(found), "bands.*.satellite_eirp_dbw", "EIRP + G - spreading - air - 10 log kT")
    return {ZENITH_LEVEL: level, "reference_range_m": Value(range_m, "bands.*.reference_range_km")}


def gain_dbi(of: Band) -> float:
    """Return the gain of the antenna."""
    given = of.section.gain_dbi
    return rounded(gain_of_beam_dbi(of.beamwidth_deg)) if given is None else given


def air_loss_db(of: Band) -> float:
    """Return the loss of the clear atmosphere at the zenith."""
    log_mhz = math.log(of.section.frequency_mhz)
    return rounded(float(np.interp(log_mhz, np.log(_LOSS_MHZ), _LOSS_DB)), 3)


def clear_noise_k(of: Band) -> float:
    """Return the system noise at the zenith: that of the parts, or as one number."""
    section = of.section
    if section.noise is not None:
        parts = {name: each.value for name, each in noise_parts(section.noise, section.frequency_mhz).items()}
        return rounded(sum(parts.values()) - parts["cosmic_k"] + _sky_k(parts["cosmic_k"], air_loss_db(of)))
    if section.system_noise_k is not None:
        return section.system_noise_k
    return 400.0 if section.frequency_mhz < 1000.0 else 120.0


def _sky_k(cosmic_k: float, loss_db: float) -> float:
    passed: float = 10.0 ** (-0.1 * loss_db)
    return cosmic_k * passed + AIR_K * (1.0 - passed)


def _stage(section: StageSection) -> Stage:
    if section.loss_db is not None:
        return Stage.of_loss(section.loss_db, section.physical_k)
    figure_db, noise_k = section.noise_figure_db, section.noise_k
    return Stage(noise_of_figure_k(figure_db) if figure_db is not None else noise_k or 0.0, section.gain_db)
