"""Whole chains of the three sensors, number by number as recorded: a snapshot, which shows what a change of the code moves.

What is true of them and of their parts (covariances that are honest, bounds that are kept) is tested beside each module.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.ground_stations import stations_along_track
from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams
from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySourceParams
from rf_pointing.array_sensors.doa.attitude_chain import DoaAttitude, DoaChainParams
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeParams
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.estimator import DoaEstimatorParams
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
from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.papers.tripulse_attitude import run_tripulse
from test.papers.recorded import PRINTED_NUMBER, check_numbers, flat

Array = NDArray[np.float64]
DATA = Path(__file__).parents[1] / "data" / "array_sensors" / "numbers.csv"
START_S = 1_767_225_600.0
INTERLEAVED = TripulseSignalParams(scheme="interleaved", pattern="SxSy")
RESPONSE = ArrayResponse(
    gain=np.exp(0.02j * np.arange(12.0) ** 2), coupling=np.array([0.1j, 0.05, 0.0, 0.01, 0.0, 0.0])
)


def summed(reason: str) -> list[float]:
    """Return how long a reason is without its numbers, and their sum."""
    return [float(len(PRINTED_NUMBER.sub("", reason))), sum(float(number) for number in PRINTED_NUMBER.findall(reason))]


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
                made.phase_rad.ravel()[::17], made.phase_rate_rad_s.ravel()[::23], made.amplitudes,
                len(output.status), summed(output.reason),
            )
        )  # fmt: skip
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
    "docking: nested": lambda: docking("nested", 2e3, STEADY),
    "docking: simultaneous": lambda: docking("simultaneous", 300.0, ROUGH),
    "docking: near, unknown excitation": lambda: docking("nested", 30.0, STEADY, excitation=(0.7, 1.2)),
    "docking: lost": lambda: docking("nested", 5e3, STEADY, lost=3),
}  # fmt: skip


@pytest.mark.parametrize("name", NUMBERS)
def test_every_number_is_the_recorded_one(name: str) -> None:
    check_numbers(DATA, name, NUMBERS[name](), 1e-4, 1e-5)
