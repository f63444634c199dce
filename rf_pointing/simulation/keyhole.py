"""Passes through the zenith flown without ROS, to hold the certificate's loss against what the antenna then loses."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import TrackerIntegratorParams
from rf_pointing.ephemeris import SITES, Pass, TopocentricTrack, first_pass_above, site, verification_elements
from rf_pointing.geometry import MU, JointReading, angular_distance_rad, random_stream
from rf_pointing.planning import AxisLimits, MachineParams
from rf_pointing.servo import WindParams, dss13_plant
from rf_pointing.station.antenna import AntennaParams, LoopParams, SimulatedAntenna
from rf_pointing.station.mount import MountParams
from rf_pointing.station.pass_planning import pass_profile
from rf_pointing.station.pointing import PointingController, PointingParams
from rf_pointing.tracking import AutotrackParams, ConscanParams, SpiralParams

__all__ = ["KeyholeCase", "KeyholeRun", "fly", "high_passes"]

Array = NDArray[np.float64]
LOW_PERIOD_S = 7500.0
"""Orbits with a shorter period are low."""
LEAST_PEAK_RAD = math.radians(78.0)
MARGIN_S = 15.0
TARGET_LEAD_S = 2.0
MOST_TRIES = 1000
DAYS = 7
BEAMS_DEG = (0.065, 0.264, 1.0)


@dataclass(frozen=True, kw_only=True)
class KeyholeCase:
    """One pass to fly, and the beam that follows it."""

    track: TopocentricTrack
    window: Pass
    beamwidth_rad: float


@dataclass(frozen=True, kw_only=True)
class KeyholeRun:
    """What the certificate said of a pass and what happened."""

    peak_rad: float
    beamwidth_rad: float
    keyhole_s: float
    predicted_lost_s: float
    simulated_lost_s: float
    predicted_below_s: float
    simulated_below_s: float


def high_passes(count: int, seed: int) -> Iterator[KeyholeCase]:
    """Yield passes that need a crossing, of random low orbits of the verification set over random stations."""
    random = random_stream(seed, "keyhole")
    low = [e for e in verification_elements() if e.period_s < LOW_PERIOD_S and e.eccentricity < 0.02]
    seen: set[tuple[str, str, int]] = set()
    for _ in range(MOST_TRIES):
        elements = low[random.integers(len(low))]
        station = list(SITES)[random.integers(len(SITES))]
        day = int(random.integers(DAYS))
        if (elements.name, station, day) in seen:
            continue
        seen.add((elements.name, station, day))
        track = TopocentricTrack(elements, site(station))
        try:
            window = first_pass_above(
                track, elements.epoch_t_s + 86400.0 * day, LEAST_PEAK_RAD, math.radians(5.0), 86400.0
            )
        except ValueError:
            continue
        yield KeyholeCase(track=track, window=window, beamwidth_rad=math.radians(float(random.choice(BEAMS_DEG))))
        count -= 1
        if count == 0:
            return


def fly(case: KeyholeCase) -> KeyholeRun:
    """Return prediction and simulation of one pass; it is flown from shortly before the crossing to shortly after."""
    controller = _controller(case)
    profile = pass_profile(case.track, case.window)
    controller.plan.take_profiles([profile])
    start_s = _begin(case, controller)
    branch = controller.plan.branch
    assert branch is not None
    assert branch.crossing is not None
    first_s, last_s = float(branch.crossing.t_s[0]), float(branch.crossing.t_s[-1])
    antenna = _antenna(controller, case, start_s)
    times, angles = _flown(case, controller, antenna, start_s, last_s + MARGIN_S)
    inside = (times >= first_s) & (times <= last_s)
    received = np.exp(-MU * (angles[inside] / case.beamwidth_rad) ** 2)
    return KeyholeRun(
        peak_rad=case.window.peak_elevation_rad,
        beamwidth_rad=case.beamwidth_rad,
        keyhole_s=branch.keyhole_s,
        predicted_lost_s=branch.lost_signal_s,
        simulated_lost_s=float(np.sum(1.0 - received) * antenna.params.tick_s),
        predicted_below_s=branch.lost_s,
        simulated_below_s=float(np.sum(received < 10.0**-0.3) * antenna.params.tick_s),
    )


def _controller(case: KeyholeCase) -> PointingController:
    return PointingController(
        PointingParams(), AxisLimits(azimuth_min_rad=-6.0, azimuth_max_rad=12.0, elevation_max_rad=math.radians(90.0)),
        AutotrackParams(), TrackerIntegratorParams(), SpiralParams(), ConscanParams(),
        MachineParams(half_power_beamwidth_rad=case.beamwidth_rad, least_share=0.0, sun_radius_rad=0.0),
    )  # fmt: skip


def _begin(case: KeyholeCase, controller: PointingController) -> float:
    """Certify the pass, and return when to begin to fly it: on the target, before the crossing."""
    early = JointReading(t_s=case.window.aos_t_s, position_rad=np.array([3.0, 0.5]), velocity_rad_s=np.zeros(2))
    controller.take_joints(early)
    controller.start(case.window.aos_t_s, case.window, "program")
    branch = controller.plan.branch
    assert branch is not None
    if branch.crossing is None:
        raise ValueError(f"{case.window.name}: the axes can follow this pass")
    return max(case.window.aos_t_s + 1.0, math.floor(float(branch.crossing.t_s[0])) - MARGIN_S)


def _antenna(controller: PointingController, case: KeyholeCase, start_s: float) -> SimulatedAntenna:
    """Return an antenna that stands where the target is at the start."""
    target = case.track.target_at(start_s, near_azimuth_rad=_near(controller, case))
    loops = LoopParams()
    preprocessor = loops.preprocessor.replace(travel_min_rad=(-7.0, -0.1), travel_max_rad=(13.0, 1.7))
    plant = dss13_plant()
    axis = {"travel_min_rad": -7.5, "travel_max_rad": 13.5}
    plant = plant.replace(azimuth=plant.azimuth.replace(**axis))
    return SimulatedAntenna(
        AntennaParams(start_azimuth_rad=target.azimuth_rad, start_elevation_rad=target.elevation_rad),
        plant, loops.replace(preprocessor=preprocessor), WindParams(mean_speed_m_s=0.0), MountParams().model(),
    )  # fmt: skip


def _near(controller: PointingController, case: KeyholeCase) -> float:
    return 0.5 * (case.window.azimuth_min_rad + case.window.azimuth_max_rad) + controller.plan.turns_rad


def _flown(
    case: KeyholeCase, controller: PointingController, antenna: SimulatedAntenna, start_s: float, end_s: float
) -> tuple[Array, Array]:
    """Return times (n,) and angles (n,) between beam and target."""
    every = round(controller.params.period_s / antenna.params.tick_s)
    for step in range(round(TARGET_LEAD_S / controller.params.period_s)):
        controller.take_target(case.track.target_at(round(start_s + step * controller.params.period_s, 6)))
    antenna.enable()
    times, beam = [], []
    for tick in range(1, round((min(end_s, case.window.los_t_s - 3.0) - start_s) / antenna.params.tick_s)):
        t_s = round(start_s + tick * antenna.params.tick_s, 6)
        reading, boresight = antenna.step(t_s)
        if tick % every == 0:
            controller.take_joints(reading)
            controller.take_target(case.track.target_at(round(t_s + TARGET_LEAD_S, 6)))
            trajectory, _ = controller.step(t_s)
            if trajectory is not None:
                antenna.accept(trajectory, t_s)
        times.append(t_s)
        beam.append((boresight.azimuth_rad, boresight.elevation_rad))
    looks = case.track.sample(np.array(times))
    pointing = np.array(beam)
    angles = angular_distance_rad(looks.azimuth_rad, looks.elevation_rad, pointing[:, 0], pointing[:, 1])
    return np.array(times), np.asarray(angles)
