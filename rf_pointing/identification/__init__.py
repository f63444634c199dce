"""Models of the antenna from its own motion: excitation, OKID/ERA, reduction, validation."""

from rf_pointing.identification.experiment import ExcitationParams, IdentificationExperiment, Recording, SampleCollector
from rf_pointing.identification.model import StateSpace, modes_of
from rf_pointing.identification.study import STRAIGHT, CrossCheck, ResponseStudy, StraightCheck, save_models, study

__all__ = [
    "STRAIGHT",
    "CrossCheck",
    "ExcitationParams",
    "IdentificationExperiment",
    "Recording",
    "ResponseStudy",
    "SampleCollector",
    "StateSpace",
    "StraightCheck",
    "modes_of",
    "save_models",
    "study",
]
