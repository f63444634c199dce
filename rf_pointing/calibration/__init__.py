"""What to add to hit it: the bias model of an antenna, its data, its fit and its check on an orbit."""

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.fit import fit_bias_model, held_at_zero
from rf_pointing.calibration.fit_options import FitOptions, Prior
from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.model_file import ModelFile, read_model, write_model
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.calibration.terms import EXTENSION_TERMS, TERM_NAMES, TERMS, Term

__all__ = [
    "EXTENSION_TERMS",
    "TERMS",
    "TERM_NAMES",
    "BiasModel",
    "FitOptions",
    "FitResult",
    "ModelFile",
    "Observations",
    "PassPriors",
    "Prior",
    "Term",
    "fit_bias_model",
    "held_at_zero",
    "read_model",
    "write_model",
]
