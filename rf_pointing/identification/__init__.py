"""Models of the antenna from its own motion: excitation, OKID/ERA, reduction, validation."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.identification.experiment import (
        ExcitationParams,
        IdentificationExperiment,
        Recording,
        SampleCollector,
    )
    from rf_pointing.identification.model import StateSpace, modes_of
    from rf_pointing.identification.study import (
        STRAIGHT,
        CrossCheck,
        ResponseStudy,
        StraightCheck,
        load_models,
        save_models,
    )

__getattr__ = lazily(__name__, __file__)
