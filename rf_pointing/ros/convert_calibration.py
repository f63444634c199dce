"""Messages of the bias calibrator, made from core types, and the pointing model both ways."""

import numpy as np
from rf_pointing_msgs.action import FitModel
from rf_pointing_msgs.msg import PointingModel

from rf_pointing.calibration import BiasModel, FitResult, ModelVersion
from rf_pointing.core import MDEG
from rf_pointing.station.derive.axes import feed_model
from rf_pointing.station.description import StationDescription


def model_to_message(file: ModelVersion) -> PointingModel:
    names = list(file.model.coefficients)
    # The message has a row for every term; those that were not fitted have no variance.
    covariance = np.zeros((len(names), len(names)))
    places = [names.index(term) for term in file.fitted]
    covariance[np.ix_(places, places)] = file.covariance
    message = PointingModel(name=file.name, station=file.station, band=file.band, terms=names)
    message.values = [float(value) for value in file.model.coefficients.values()]
    message.covariance = covariance.ravel().tolist()
    return message


def model_from_message(message: PointingModel) -> BiasModel:
    if len(message.terms) != len(message.values):
        count = len(message.values)
        raise ValueError(f"values has {count} numbers, must have one for each of {len(message.terms)} terms")
    return BiasModel(dict(zip(message.terms, message.values, strict=True)))


def fit_to_result(fit: FitResult, file: ModelVersion, warnings: tuple[str, ...]) -> FitModel.Result:
    rms = fit.rms_rad()
    return FitModel.Result(
        success=True,
        message=(
            f"{file.name}: {file.observations} observations of {file.passes} passes, residual rms {rms[0] / MDEG:.2f} mdeg "
            f"cross-elevation, {rms[1] / MDEG:.2f} mdeg elevation; it runs in the shadow until it is accepted"
            + "".join(f"; doubtful: {doubt}" for doubt in warnings)
        ),
        model=model_to_message(file), observations=file.observations, rejected=file.rejected,
        passes=file.passes, rms_cross_elevation=rms[0], rms_elevation=rms[1],
        condition=fit.condition, advice=list(fit.separation_advice()),
    )  # fmt: skip


def in_force_to_message(
    file: ModelVersion | None, station: StationDescription, band: str
) -> PointingModel:  # fmt: skip
    """Return the model in force; without a file the one of the feed, which is zero on the axis."""
    if file is not None:
        return model_to_message(file)
    feed = feed_model(station.content, band)
    name = "feed offset" if feed != BiasModel.zero() else "none"
    message = PointingModel(name=name, station=station.name, band=band, terms=list(feed.coefficients))
    message.values = list(feed.coefficients.values())
    return message
