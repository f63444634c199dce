"""What the antenna is like, from its own motion: excitation, OKID/ERA, reduction, validation."""

from rf_pointing.identification.experiment import (
    ExcitationParams,
    IdentificationExperiment,
    Recording,
    SampleCollector,
    excitation_rad_s,
    predicted_travel_rad,
)
from rf_pointing.identification.identify import (
    IdentificationParams,
    Identified,
    PoleResidue,
    identify,
    refit_residues,
    restore_integrator,
)
from rf_pointing.identification.model import ModelRecord, StateSpace, load_models, modes_of, save_models
from rf_pointing.identification.realization import (
    balanced_reduction,
    observer_markov,
    realize,
    system_markov,
)
from rf_pointing.identification.spectra import FrequencyResponse, frequency_response
from rf_pointing.identification.study import (
    STRAIGHT,
    CrossCheck,
    ResponseStudy,
    StraightCheck,
    check_cross,
    check_straight,
    study,
)

__all__ = [
    "STRAIGHT",
    "CrossCheck",
    "ExcitationParams",
    "FrequencyResponse",
    "IdentificationExperiment",
    "IdentificationParams",
    "Identified",
    "ModelRecord",
    "PoleResidue",
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
    "identify",
    "load_models",
    "modes_of",
    "observer_markov",
    "predicted_travel_rad",
    "realize",
    "refit_residues",
    "restore_integrator",
    "save_models",
    "study",
    "system_markov",
]
