"""Messages of the bias calibrator, made from what the core returns."""

from rf_pointing_msgs.action import FitModel
from rf_pointing_msgs.msg import PointingModel

from rf_pointing.calibration import BiasModel, FitResult, ModelFile
from rf_pointing.geometry import MDEG
from rf_pointing.nodes.convert import model_to_message

__all__ = ["fit_to_result", "no_model_to_message"]


def fit_to_result(fit: FitResult, file: ModelFile) -> FitModel.Result:
    rms = fit.rms_rad()
    return FitModel.Result(
        success=True,
        message=(
            f"{file.name}: {file.observations} observations of {file.passes} passes, residual rms {rms[0] / MDEG:.2f} mdeg "
            f"cross-elevation, {rms[1] / MDEG:.2f} mdeg elevation; accept or reject it"
        ),
        model=model_to_message(file),
        observations=file.observations,
        rejected=file.rejected,
        passes=file.passes,
        rms_cross_elevation=rms[0],
        rms_elevation=rms[1],
        condition=fit.condition,
        advice=list(fit.separation_advice()),
    )


def no_model_to_message(station: str) -> PointingModel:
    """Return the model that corrects nothing."""
    zero = BiasModel.zero().coefficients
    return PointingModel(name="none", station=station, terms=list(zero), values=list(zero.values()))
