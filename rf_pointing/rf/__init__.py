"""Beam, link and receiver: the radio signal of a target from where the beam really points."""

from rf_pointing.rf.beam import HALF_POWER_BEAMWIDTH_RAD, Beam, BeamParams
from rf_pointing.rf.disturbances import (
    DropoutParams,
    Dropouts,
    InterferenceParams,
    SpinParams,
    interference_volts,
    spin_gain_db,
)
from rf_pointing.rf.feed import FeedVoltages, MonopulseFeed, MonopulseFeedParams
from rf_pointing.rf.link import EirpParams, Link, LinkParams, free_space_loss_db, zenith_carrier_to_noise_db_hz
from rf_pointing.rf.noise import (
    BOLTZMANN_J_K,
    AtmosphereParams,
    NoiseParams,
    air_mass,
    atmosphere_loss_db,
    system_noise_k,
)
from rf_pointing.rf.receiver import Receiver, ReceiverParams, ReceiverState

__all__ = [
    "BOLTZMANN_J_K",
    "HALF_POWER_BEAMWIDTH_RAD",
    "AtmosphereParams",
    "Beam",
    "BeamParams",
    "DropoutParams",
    "Dropouts",
    "EirpParams",
    "FeedVoltages",
    "InterferenceParams",
    "Link",
    "LinkParams",
    "MonopulseFeed",
    "MonopulseFeedParams",
    "NoiseParams",
    "Receiver",
    "ReceiverParams",
    "ReceiverState",
    "SpinParams",
    "air_mass",
    "atmosphere_loss_db",
    "free_space_loss_db",
    "interference_volts",
    "spin_gain_db",
    "system_noise_k",
    "zenith_carrier_to_noise_db_hz",
]
