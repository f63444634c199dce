"""The bias model of an antenna: its terms, its data, its fit, and the files of all three."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
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
    from rf_pointing.calibration.pipeline import (
        PriorKnowledge,
        Processed,
        RawPasses,
        TrackedPass,
        select_observations,
    )
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

__getattr__ = lazily(__name__, __file__)
