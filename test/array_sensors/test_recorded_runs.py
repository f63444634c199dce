"""Runs of the three sensors, number by number as recorded: a snapshot, which shows what a change of the code moves.

What is true of these runs (covariances that are honest, bounds that are kept) is tested beside each module.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.attitude.ground_stations import stations_along_track
from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams
from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams
from rf_pointing.array_sensors.doa.attitude_chain import DoaAttitude, DoaChainParams
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeParams
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.dish_array import DishArrayTracker, SimulatedDishArray
from rf_pointing.array_sensors.doa.estimator import DoaEstimator, DoaEstimatorParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.doa.simulated_doa import DoaScenarioParams, SimulatedDoa
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams
from rf_pointing.array_sensors.interferometer.docking import rep103_pose
from rf_pointing.array_sensors.interferometer.motion import DockingApproach
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.rate_filter import FilterParams
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem, Schedule
from rf_pointing.array_sensors.interferometer.tracker import InterferometerTracker, TrackerState
from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.receiver import TripulseReceiver, TripulseReceiverParams
from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import StationLine, TripulseSource, TripulseSourceParams
from rf_pointing.core import PointingError
from rf_pointing.papers.tripulse_attitude import run_tripulse
from rf_pointing.rf.dish_array import DishArrayParams
from test.papers.recorded import PRINTED_NUMBER, check_numbers, flat

Array = NDArray[np.float64]
DATA = Path(__file__).parents[1] / "data" / "array_sensors" / "numbers.csv"
START_S = 1_767_225_600.0
INTERLEAVED = TripulseSignalParams(scheme="interleaved", pattern="SxSy")
COARSE = TripulseArrayParams(n_x=12, n_y=14, taper_edge=0.6, phase_bits=4, failed="3:5, 12:14")
RESPONSE = ArrayResponse(
    gain=np.exp(0.02j * np.arange(12.0) ** 2), coupling=np.array([0.1j, 0.05, 0.0, 0.01, 0.0, 0.0])
)


def summed(reason: str) -> list[float]:
    """Return how long a reason is without its numbers, and their sum."""
    return [float(len(PRINTED_NUMBER.sub("", reason))), sum(float(number) for number in PRINTED_NUMBER.findall(reason))]


def tripulse(signal: TripulseSignalParams, array: TripulseArrayParams, **link: float) -> Array:
    """Return what was sent and measured in frames of a station off the steering, farther from one to the next."""
    sender = TripulseSource(array, signal, TripulseSourceParams(**link), seed=4)
    params = TripulseReceiverParams(element_carrier_to_noise_db_hz=link.get("element_carrier_to_noise_db_hz", 37.0))
    receiver, found = TripulseReceiver(array=array, signal=signal, params=params), []
    towards = np.array([0.05, -0.03, np.sqrt(1.0 - 0.05**2 - 0.03**2)])
    for k in range(5):
        line = StationLine(name="one", direction=towards, range_rate_m_s=-240.0 + 90.0 * k, elevation_rad=0.7)
        turn = 2e-3 * (k + 1) * np.array([1.0, -0.6, 0.2])
        (frame,) = sender.step(2.0 * k, Rotation.from_rotvec(turn).as_matrix(), [line])
        made = receiver.measure(frame)
        found.append(flat(frame.samples[:: len(frame.samples) // 5], frame.steering, made.projections, 1e8 * made.covariance,
                          made.sum_snr_db, made.shift_hz, made.valid, summed(made.reason)))  # fmt: skip
    return flat(*found)


def geostationary(**options: Any) -> Array:
    run = run_tripulse(4, 5, step_s=20.0, **options)
    found = [flat(each.quaternion, 1e8 * each.covariance_rad2, 1e8 * each.covariance_array_rad2, each.residual, each.t_s)
             for each in run.attitudes]  # fmt: skip
    return flat(run.projection_errors * 1e4, run.attitude_errors_rad * 1e4, *found)


def satellite(
    estimator: DoaEstimatorParams, params: DoaChainParams, response: ArrayResponse | None = None, **scenario: Any
) -> Array:
    """Return attitude, rate, spread and reasons of 45 s over two stations, at times before and after the start is decided."""
    array, orbit, noise = CircularArrayParams(), SunSynchronousOrbitParams(), ProcessNoiseParams()
    stations = stations_along_track(orbit, START_S - 600.0, spacing_s=300.0, aside_rad=0.06)
    truth = SimulatedDoa(array, ArraySourceParams(), orbit, stations, SatelliteParams(), NadirHoldParams(), noise,
                         DoaScenarioParams(**scenario), 5, response=response)  # fmt: skip
    filtering = (DoaAttitudeParams(), StartParams(settle_s=10.0), noise, GateParams(), WatchParams())
    chain = DoaAttitude(array, estimator, orbit, stations, SatelliteParams(), filtering, params, response=response)
    found = []
    for k in range(45):
        moment = truth.step(START_S + k)
        chain.take_torque(moment.torque, START_S + k)
        assert moment.heard is not None
        report = chain.take_block(moment.heard, START_S + k)
        if k in (3, 8, 14, 22, 31, 44):
            found.append(flat(
                moment.truth.quaternion, moment.truth.rate_rad_s * 1e3, moment.torque.known.control_n_m * 1e3,
                report.attitude.quaternion, 1e6 * report.attitude.covariance_rad2, 1e3 * report.rate.rate_rad_s,
                1e6 * report.rate.covariance_rad2_s2, summed(report.attitude.reason), summed(" ".join(report.refused)),
            ))  # fmt: skip
    return flat(*found)


def directions(params: DoaEstimatorParams, response: ArrayResponse | None = None, level_db: float = 3.0) -> Array:
    array = CircularArrayParams()
    source, found = ArraySource(array, ArraySourceParams(snapshots=60), seed=3, response=response), []
    towards = np.array([[0.3, 0.2, 0.93], [-0.5, 0.4, 0.77], [0.1, -0.6, 0.79]])[: params.sources]
    for k in range(4):
        block = source.step(
            0.5 * k, towards / np.linalg.norm(towards, axis=1, keepdims=True), level_db + np.arange(params.sources)
        )
        for each in DoaEstimator(array, params, response=response).estimate(block):
            bias = np.zeros(6) if each.bias_rad is None else each.bias_rad
            found.append(
                flat(each.direction, 1e4 * each.covariance_rad2, each.snr_db, each.valid, summed(each.reason), bias)
            )
    return flat(*found)


def dish(array: DishArrayParams, level_db_hz: float) -> Array:
    source, tracker, found = SimulatedDishArray(array, 3), DishArrayTracker(array), []
    for k, offset in enumerate(([0.02, -0.03], [-0.08, 0.05], [0.15, 0.1], [0.4, -0.2])):
        sent = PointingError(t_s=1.0 + k, sensor="truth", cross_elevation_rad=offset[0], elevation_rad=offset[1],
                             carrier_to_noise_db_hz=level_db_hz)  # fmt: skip
        made = tracker.measure(source.receive(sent))
        spread = np.zeros((2, 2)) if made.covariance_rad2 is None else 1e6 * made.covariance_rad2
        found.append(
            flat(
                made.t_s, made.cross_elevation_rad, made.elevation_rad, made.valid, made.carrier_to_noise_db_hz, spread
            )
        )
    return flat(*found)


def docking(order: str, start_m: float, radio: RadioParams, lost: int = -1, **options: Any) -> Array:
    """Return poses, rates and spreads of seven sequences of an approach; from number `lost` on two are without lock."""
    system = InterferometerSystem(schedule=Schedule(order=order))
    maker = InterferometerSource(system, radio, LinkParams(), 6, **options)
    tracker = InterferometerTracker(
        system=system, radio=radio, filter_params=FilterParams(track_excitation=bool(options))
    )
    approach, state, found = DockingApproach(start_range_m=start_m, time_constant_s=900.0), TrackerState(), []
    for k in range(7):
        truth = approach.motion_at(2.0 * k)
        made = maker.measure(2.0 * k, truth)
        if lost <= k < lost + 2:
            made = replace(made, locked=made.locked & (np.arange(3) > 0))
        state, output = tracker.step(state, made)
        found.append(
            flat(
                made.phase_rad.ravel()[::17],
                made.phase_rate_rad_s.ravel()[::23],
                made.amplitudes,
                len(output.status),
                summed(output.reason),
            )
        )
        if output.estimate is not None:
            pose, spread = rep103_pose(output.estimate), output.estimate.covariance
            sizes = np.sqrt(np.diag(spread))
            found.append(flat(
                pose.position_m, pose.orientation, 10.0 * pose.velocity_m_s, 1e3 * pose.angular_velocity_rad_s,
                1e3 * sizes, (spread / np.outer(sizes, sizes))[::3, ::2], 1e3 * np.sqrt(np.diag(pose.pose_covariance)),
                1e3 * np.sqrt(np.diag(pose.twist_covariance)), output.estimate.excitation,
            ))  # fmt: skip
    return flat(*found)


STEADY = RadioParams()
ROUGH = RadioParams(hardware_phase_rad=0.002, hardware_rate_rad_s=0.02, hardware_coupling=0.002)
NUMBERS: dict[str, Callable[[], ArrayLike]] = {
    "tripulse: two tones": lambda: tripulse(TripulseSignalParams(), TripulseArrayParams()),
    "tripulse: interleaved": lambda: tripulse(INTERLEAVED, TripulseArrayParams()),
    "tripulse: sum beam last": lambda: tripulse(INTERLEAVED.replace(pattern="xSyS"), TripulseArrayParams()),
    "tripulse: coarse array": lambda: tripulse(TripulseSignalParams(), COARSE),
    "tripulse: weak": lambda: tripulse(TripulseSignalParams(), TripulseArrayParams(), element_carrier_to_noise_db_hz=5.0),
    "tripulse: weak, interleaved": lambda: tripulse(INTERLEAVED, TripulseArrayParams(), element_carrier_to_noise_db_hz=9.0),
    "tripulse: lost": lambda: tripulse(TripulseSignalParams(), TripulseArrayParams(), element_carrier_to_noise_db_hz=-20.0),
    "tripulse: attitude": geostationary,
    "tripulse: attitude, interleaved": lambda: geostationary(signal=INTERLEAVED),
    "doa: in turn": lambda: satellite(DoaEstimatorParams(), DoaChainParams()),
    "doa: in turn, constants": lambda: satellite(
        DoaEstimatorParams(phase_sigma_rad=0.02), DoaChainParams(time_sigma_s=0.4, place_sigma_m=300.0)
    ),
    "doa: together": lambda: satellite(DoaEstimatorParams(), DoaChainParams(), access="together"),
    "doa: together, calibrated": lambda: satellite(
        DoaEstimatorParams(), DoaChainParams(place_sigma_m=500.0), RESPONSE, access="together"
    ),
    "doa: one source": lambda: directions(DoaEstimatorParams()),
    "doa: two sources": lambda: directions(DoaEstimatorParams(sources=2)),
    "doa: three sources, calibrated": lambda: directions(DoaEstimatorParams(sources=3), RESPONSE, 12.0),
    "doa: dead elements, unknown phases": lambda: directions(DoaEstimatorParams(excluded="2,7", phase_sigma_rad=0.05)),
    "doa: weak": lambda: directions(DoaEstimatorParams(), None, -13.0),
    "dish": lambda: dish(DishArrayParams(), 54.0),
    "dish, turned": lambda: dish(DishArrayParams(roll_rad=0.4, axis_cross_elevation_rad=0.1, axis_elevation_rad=-0.07), 44.0),
    "docking: nested": lambda: docking("nested", 2e3, STEADY),
    "docking: ascending": lambda: docking("ascending", 2e4, ROUGH),
    "docking: simultaneous": lambda: docking("simultaneous", 300.0, ROUGH),
    "docking: near, unknown excitation": lambda: docking("nested", 30.0, STEADY, excitation=(0.7, 1.2)),
    "docking: lost": lambda: docking("nested", 5e3, STEADY, lost=3),
}  # fmt: skip


@pytest.mark.parametrize("name", NUMBERS)
def test_every_number_is_the_recorded_one(name: str) -> None:
    check_numbers(DATA, name, NUMBERS[name](), 1e-4, 1e-5)
