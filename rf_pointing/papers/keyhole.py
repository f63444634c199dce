"""Passes through the zenith flown without ROS, to hold the certificate's loss against what the
antenna then loses.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import JointReading, angular_distance_rad, gaussian_loss_db
from rf_pointing.core.types import Array
from rf_pointing.papers.keyhole_passes import AVERAGING_S, KeyholeCase
from rf_pointing.planning import GateParams, MachineParams
from rf_pointing.planning.over_the_top import plunged
from rf_pointing.servo import dss13_plant
from rf_pointing.simulation.closed_loop import TARGET_LEAD_S, PointedAntenna, ticks
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import (
    AntennaParams,
    SimulatedAntenna,
    SimulationParams,
)
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.station.pointing.params import ControllerParams, PointingParams

HALF_POWER_DB, DEEPEST_DB = 3.0, 60.0
BEFORE_S, AFTER_S = 30.0, 15.0
"""How long before and after the crossing a pass is flown: the lags of the mount build up before."""
NO_SUN = GateParams(sun_radius_rad=0.0)
"""The crossing alone is compared: a pass that the Sun forbids is as good as any."""


@dataclass(frozen=True, kw_only=True)
class Loss:
    """Loss of one crossing: signal lost, time below half power, and loss integrated in decibels (60
    dB at most).
    """

    signal_s: float
    below_s: float
    db_s: float

    @classmethod
    def of(cls, error_rad: Array, step_s: float, beamwidth_rad: float) -> "Loss":
        """Return the loss of a Gaussian beam at the errors (n,) of even times."""
        loss_db = gaussian_loss_db(error_rad, beamwidth_rad)
        return cls(
            signal_s=float(np.sum(1.0 - 10.0 ** (-0.1 * loss_db)) * step_s),
            below_s=float(np.sum(loss_db > HALF_POWER_DB) * step_s),
            db_s=float(np.sum(np.minimum(loss_db, DEEPEST_DB)) * step_s),
        )


@dataclass(frozen=True, kw_only=True)
class KeyholeRun:
    """The loss that the certificate predicts for a pass, and the loss of the flown pass."""

    name: str
    station: str
    aos_t_s: float
    peak_rad: float
    beamwidth_rad: float
    keyhole_s: float
    over: bool
    predicted: Loss
    simulated: Loss


def fly(case: KeyholeCase) -> KeyholeRun | None:
    """Return prediction and simulation of one pass, None when the axes can follow all of it.

    It is flown from shortly before the crossing to shortly after.
    """
    controller = _controller(case)
    controller.plan.take_profiles([pass_profile(case.track, case.window)])
    begin_s = _begin(case, controller)
    if begin_s is None:
        return None
    certificate = controller.plan.certificate
    assert certificate is not None
    branch = certificate.chosen
    assert branch is not None
    assert branch.crossing is not None
    crossing = branch.crossing
    first_s, last_s = float(crossing.t_s[0]), float(crossing.t_s[-1])
    antenna = _antenna(controller, case, begin_s)
    times, angles = _flown(case, controller, antenna, begin_s, last_s + AFTER_S)
    inside = times >= first_s
    return KeyholeRun(
        name=case.window.name,
        station=case.station,
        aos_t_s=case.window.aos_t_s,
        peak_rad=case.window.peak_elevation_rad,
        beamwidth_rad=case.beamwidth_rad,
        keyhole_s=branch.keyhole_s,
        over=branch.over,
        predicted=Loss.of(
            crossing.error_rad, float(crossing.t_s[1] - crossing.t_s[0]), case.beamwidth_rad
        ),
        simulated=Loss.of(angles[inside], antenna.params.tick_s, case.beamwidth_rad),
    )


def _controller(case: KeyholeCase) -> PointingController:
    machine = MachineParams(
        half_power_beamwidth_rad=case.beamwidth_rad, least_share=0.0, sun_radius_rad=0.0
    )
    params = ControllerParams(
        pointing=PointingParams(lag_averaging_s=AVERAGING_S),
        limits=case.limits,
        machine=machine,
        gate=NO_SUN,
    )
    controller = PointingController(params)
    controller.take_model(case.calibrated)
    return controller


def _begin(case: KeyholeCase, controller: PointingController) -> float | None:
    """Certify the pass, and return when to begin to fly it: on the target, before the crossing if
    there is one.
    """
    early = JointReading(
        t_s=case.window.aos_t_s, position_rad=np.array([3.0, 0.5]), velocity_rad_s=np.zeros(2)
    )
    controller.take_joints(early)
    controller.start(case.window.aos_t_s, case.window, "program")
    certificate = controller.plan.certificate
    assert certificate is not None
    branch = certificate.chosen
    assert branch is not None
    if branch.crossing is None:
        return None
    return max(case.window.aos_t_s + 1.0, math.floor(float(branch.crossing.t_s[0])) - BEFORE_S)


def _antenna(controller: PointingController, case: KeyholeCase, start_s: float) -> SimulatedAntenna:
    """Return an antenna that stands where the target is at the start, with travel beyond the
    controller's limits.
    """
    target = case.track.target_at(start_s, near_azimuth_rad=_near(controller, case))
    here = np.array([target.azimuth_rad, target.elevation_rad])
    over = controller.plan.course.plunge_at(start_s)
    azimuth, elevation = (plunged(here, 0.0 * here, 0.0 * here)[0] if over else here).tolist()
    loops = LoopParams()
    preprocessor = loops.preprocessor.replace(
        travel_min_rad=(-7.0, -0.1), travel_max_rad=(13.0, 3.2)
    )
    # A crossing over the top, or a turn the long way round, must not end at a stop: the loss is
    # that of the path alone.
    plant = dss13_plant()
    plant = plant.replace(
        azimuth=plant.azimuth.replace(travel_min_rad=-7.5, travel_max_rad=13.5),
        elevation=plant.elevation.replace(travel_max_rad=3.3),
    )
    return SimulatedAntenna(
        AntennaParams(
            antenna=SimulationParams(
                start_azimuth_rad=azimuth,
                start_elevation_rad=elevation,
                lag_averaging_s=AVERAGING_S,
            ),
            plant=plant,
            loops=loops.replace(preprocessor=preprocessor),
            mount=case.mount,
            safety=SafetyParams(gate=NO_SUN),
        )
    )


def _near(controller: PointingController, case: KeyholeCase) -> float:
    return (
        0.5 * (case.window.azimuth_min_rad + case.window.azimuth_max_rad)
        + controller.plan.course.turns_rad
    )


def _flown(
    case: KeyholeCase,
    controller: PointingController,
    antenna: SimulatedAntenna,
    start_s: float,
    end_s: float,
) -> tuple[Array, Array]:
    """Return times (n,) and angles (n,) between beam and target."""
    period_s = controller.params.pointing.period_s
    for step in range(round(TARGET_LEAD_S / period_s)):
        controller.take_target(case.track.target_at(round(start_s + step * period_s, 6)))
    antenna.enable()
    pointed = PointedAntenna(antenna, controller, case.track, start_s)
    count = round((min(end_s, case.window.los_t_s - 3.0) - start_s) / antenna.params.tick_s) - 1
    times, beam = [], []
    for _, tick in ticks(pointed, count, first=1):
        times.append(tick.t_s)
        beam.append((tick.boresight.azimuth_rad, tick.boresight.elevation_rad))
    looks = case.track.sample(np.array(times))
    pointing = np.array(beam)
    angles = angular_distance_rad(
        looks.azimuth_rad, looks.elevation_rad, pointing[:, 0], pointing[:, 1]
    )
    return np.array(times), np.asarray(angles)
