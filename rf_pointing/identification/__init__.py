"""What the antenna is like, from its own motion: excitation, frequency response, OKID/ERA, reduction, validation."""

from rf_pointing.identification.balance import balanced_reduction, hankel_singular_values
from rf_pointing.identification.era import Realization, realize, suggested_order
from rf_pointing.identification.excitation import ExcitationParams, excitation_rad_s, predicted_travel_rad
from rf_pointing.identification.experiment import IdentificationExperiment, Recording
from rf_pointing.identification.identify import IdentificationParams, Identified, high_pass, identify
from rf_pointing.identification.modal import PoleResidue, refit_residues, restore_integrator
from rf_pointing.identification.model import Modes, StateSpace, modes_of
from rf_pointing.identification.model_file import ModelRecord, load_models, save_models
from rf_pointing.identification.okid import ObserverMarkov, observer_markov, system_markov
from rf_pointing.identification.sample_collector import SampleCollector
from rf_pointing.identification.spectra import FrequencyResponse, frequency_response, peak_frequencies_hz
from rf_pointing.identification.study import CROSS, STRAIGHT, ResponseStudy, study
from rf_pointing.identification.validate import CrossCheck, StraightCheck, check_cross, check_straight

__all__ = [
    "CROSS",
    "STRAIGHT",
    "CrossCheck",
    "ExcitationParams",
    "FrequencyResponse",
    "IdentificationExperiment",
    "IdentificationParams",
    "Identified",
    "ModelRecord",
    "Modes",
    "ObserverMarkov",
    "PoleResidue",
    "Realization",
    "Recording",
    "ResponseStudy",
    "SampleCollector",
    "StateSpace",
    "StraightCheck",
    "balanced_reduction",
    "check_cross",
    "check_straight",
    "excitation_rad_s",
    "frequency_response",
    "hankel_singular_values",
    "high_pass",
    "identify",
    "load_models",
    "modes_of",
    "observer_markov",
    "peak_frequencies_hz",
    "predicted_travel_rad",
    "realize",
    "refit_residues",
    "restore_integrator",
    "save_models",
    "study",
    "suggested_order",
    "system_markov",
]
