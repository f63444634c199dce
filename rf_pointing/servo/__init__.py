"""How the antenna moves: drives, structure, friction, encoders, wind; the DSS-13 preset."""

from rf_pointing.servo.linear_model import LinearModel, discretise, linear_model
from rf_pointing.servo.parameters import AxisParams, PlantParams
from rf_pointing.servo.plant import AntennaPlant, PlantState
from rf_pointing.servo.presets import dss13_plant
from rf_pointing.servo.wind import GustFilter, Wind, WindParams, wind_torque_n_m

__all__ = [
    "AntennaPlant",
    "AxisParams",
    "GustFilter",
    "LinearModel",
    "PlantParams",
    "PlantState",
    "Wind",
    "WindParams",
    "discretise",
    "dss13_plant",
    "linear_model",
    "wind_torque_n_m",
]
