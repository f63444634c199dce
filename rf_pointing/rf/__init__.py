"""Beam, link and receiver: the radio signal of a target from where the beam really points."""

from rf_pointing.rf.beam import HALF_POWER_BEAMWIDTH_RAD, Beam, BeamParams
from rf_pointing.rf.disturbances import DropoutParams, Dropouts, InterferenceParams, SpinParams, spin_gain_db
from rf_pointing.rf.feed import MonopulseFeed, MonopulseFeedParams
from rf_pointing.rf.link import Link, LinkParams
from rf_pointing.rf.noise import AtmosphereParams, NoiseParams
from rf_pointing.rf.receiver import Receiver, ReceiverParams

__all__ = [
    "HALF_POWER_BEAMWIDTH_RAD",
    "AtmosphereParams",
    "Beam",
    "BeamParams",
    "DropoutParams",
    "Dropouts",
    "InterferenceParams",
    "Link",
    "LinkParams",
    "MonopulseFeed",
    "MonopulseFeedParams",
    "NoiseParams",
    "Receiver",
    "ReceiverParams",
    "SpinParams",
    "spin_gain_db",
]
