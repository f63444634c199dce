"""The bias model of an antenna: its terms, its data, its fit, and the files of all three."""

from rf_pointing.calibration.acceptance_passes import AcceptanceRules, AcceptanceScore, Verdict
from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.campaign import (
    Campaign,
    CandidatePass,
    Slew,
    next_best_passes,
    plan_campaign,
    uninformed_covariance,
)
from rf_pointing.calibration.coverage import Coverage, SectorRule
from rf_pointing.calibration.fit import FitOptions, fit_bias_model, held_at_zero
from rf_pointing.calibration.fit_result import FitResult, Prior
from rf_pointing.calibration.ionosphere import Ionosphere
from rf_pointing.calibration.lag_history import LagHistory, LagState, without_lags
from rf_pointing.calibration.model_file import ModelVersion, read_model, write_model
from rf_pointing.calibration.model_store import ModelStore
from rf_pointing.calibration.observations import Observations, require_derivatives
from rf_pointing.calibration.outlying_passes import measured_pass_priors, warnings_of
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.calibration.pipeline import PriorKnowledge, Processed, RawPasses, TrackedPass, select_observations
from rf_pointing.calibration.raw_tracking import RawTracking, StageReport, split_passes
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.calibration.tdm import read_tdm, write_tdm
from rf_pointing.calibration.term_selection import held_out_passes, select_terms
from rf_pointing.calibration.terms import EXTENSION_TERMS, TERM_NAMES, TERMS, terms_by_name
from rf_pointing.calibration.tracking_csv import (
    ObservationJournal,
    read_observations,
    read_tracking,
    write_observations,
)

__all__ = [
    "EXTENSION_TERMS",
    "TERMS",
    "TERM_NAMES",
    "AcceptanceRules",
    "AcceptanceScore",
    "BiasModel",
    "Campaign",
    "CandidatePass",
    "Coverage",
    "FitOptions",
    "FitResult",
    "Ionosphere",
    "LagHistory",
    "LagState",
    "ModelStore",
    "ModelVersion",
    "ObservationJournal",
    "Observations",
    "PassPriors",
    "Prior",
    "PriorKnowledge",
    "Processed",
    "RawPasses",
    "RawTracking",
    "ReferenceTrack",
    "SectorRule",
    "Slew",
    "StageReport",
    "TrackedPass",
    "Verdict",
    "fit_bias_model",
    "held_at_zero",
    "held_out_passes",
    "measured_pass_priors",
    "next_best_passes",
    "plan_campaign",
    "read_model",
    "read_observations",
    "read_tdm",
    "read_tracking",
    "require_derivatives",
    "select_observations",
    "select_terms",
    "split_passes",
    "terms_by_name",
    "uninformed_covariance",
    "warnings_of",
    "without_lags",
    "write_model",
    "write_observations",
    "write_tdm",
]  # fmt: skip
