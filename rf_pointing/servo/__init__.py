"""How the antenna moves: drives, gears, flexible modes, friction, limits, encoders and wind; the DSS-13 preset."""

from rf_pointing.servo.drive import axis_inputs, drive_constants, gear_correction, tooth_wind
from rf_pointing.servo.gust import GustFilter, davenport_psd
from rf_pointing.servo.linear_model import LinearModel, discretise, linear_model, matrix_exponential
from rf_pointing.servo.parameters import AxisParams, PlantParams
from rf_pointing.servo.plant import AntennaPlant
from rf_pointing.servo.presets import BENDING_FREQUENCY_HZ, dss13_plant, linear_axis
from rf_pointing.servo.state import PlantState
from rf_pointing.servo.wind import (
    Wind,
    WindParams,
    WindState,
    gust_torque_n_m,
    torque_constants,
    wind_torque_n_m,
)

__all__ = [
    "BENDING_FREQUENCY_HZ",
    "AntennaPlant",
    "AxisParams",
    "GustFilter",
    "LinearModel",
    "PlantParams",
    "PlantState",
    "Wind",
    "WindParams",
    "WindState",
    "axis_inputs",
    "davenport_psd",
    "discretise",
    "drive_constants",
    "dss13_plant",
    "gear_correction",
    "gust_torque_n_m",
    "linear_axis",
    "linear_model",
    "matrix_exponential",
    "tooth_wind",
    "torque_constants",
    "wind_torque_n_m",
]
