"""How the antenna moves: drives, structure, friction, encoders, wind; the DSS-13 preset."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.servo.linear_model import LinearModel, discretise
    from rf_pointing.servo.parameters import AxisParams, PlantParams
    from rf_pointing.servo.plant import AntennaPlant, PlantState
    from rf_pointing.servo.presets import dss13_plant
    from rf_pointing.servo.wind import (
        GustFilter,
        RecordedWind,
        Wind,
        WindParams,
        WindSource,
        wind_torque_n_m,
    )

__getattr__ = lazily(__name__, __file__)
