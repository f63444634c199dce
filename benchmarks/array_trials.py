"""Many runs of each array sensor: is an answer that counts as valid ever wrong?

    scripts/run-python benchmarks/array_trials.py doa|tripulse|interferometer [SCENARIO ...] [--runs N]

Each run has its own seed, attitude and noise.  A line gives the runs that became valid, the time of
the first valid epoch, the NEES at the last valid epoch with the 95 % band of its mean and over all
valid epochs (correlated, so without a band), the valid epochs beyond 5 sigma in any axis and the
largest error of a valid epoch.  The NEES is that of the attitude (3), for the interferometer of
position, velocity, attitude and rate (12).  The exit status says whether no valid epoch was beyond
5 sigma.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from rf_pointing.array_sensors.attitude.ground_stations import GroundNetworkParams, GroundStation, stations_along_track
from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.quaternion import (
    conjugate,
    multiply,
    quaternion_from_rotation_vector,
    quaternion_to_roll_pitch_yaw,
    quaternion_to_rotation_vector,
)
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams
from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySourceParams
from rf_pointing.array_sensors.doa.attitude_chain import ChannelBlock, DoaAttitude, DoaChainParams
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeParams
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.estimator import DoaEstimatorParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.doa.simulated_doa import DoaScenarioParams, SimulatedDoa
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams
from rf_pointing.array_sensors.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
    frame_rotation,
    rotation_vector,
)
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion, moved
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams, required_power_w
from rf_pointing.array_sensors.interferometer.rate_filter import FilterParams
from rf_pointing.array_sensors.interferometer.reading import ErrorFloor
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from rf_pointing.array_sensors.interferometer.tracker import InterferometerTracker, TrackerState
from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.beams import shared_projection_sigma
from rf_pointing.array_sensors.tripulse.geostationary_scene import GeostationaryParams, WobbleParams
from rf_pointing.array_sensors.tripulse.receiver import TripulseReceiver, TripulseReceiverParams
from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import TripulseSourceParams
from rf_pointing.array_sensors.tripulse.station_attitude import StationAttitudeParams
from rf_pointing.array_sensors.tripulse.system import EpochParams, SimulatedTripulse, TripulseAttitude
from rf_pointing.core import random_stream
from rf_pointing.core.constants import EARTH_RADIUS_M

Array = NDArray[np.float64]
START_S = 1_767_225_600.0
FAR_SIGMAS = 5.0


@dataclass(frozen=True)
class Epochs:
    """What one run reported: time from its start, validity, error (n, m) and covariance (n, m, m)."""

    t_s: Array
    valid: NDArray[np.bool_]
    error: Array
    covariance: Array
    unit: str = "deg"

    @property
    def size(self) -> Array:
        """Length of the error of every epoch (n,): of the attitude in deg, or of the position in m."""
        length = np.linalg.norm(self.error[:, :3], axis=-1)
        return np.degrees(length) if self.unit == "deg" else length

    @property
    def nees(self) -> Array:
        """Normalised squared error of every epoch (n,)."""
        return np.einsum("ni,ni->n", self.error, np.linalg.solve(self.covariance, self.error[..., None])[..., 0])

    @property
    def far(self) -> int:
        """Valid epochs with an axis beyond 5 sigma."""
        sigma = np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))
        return int(np.sum(self.valid & np.any(np.abs(self.error) > FAR_SIGMAS * sigma, axis=-1)))


def report(name: str, runs: list[Epochs]) -> int:
    """Print the line of one scenario; return the valid epochs beyond 5 sigma."""
    good = [run for run in runs if run.valid.any()]
    far = sum(run.far for run in runs)
    if not good:
        print(f"{name}: 0 of {len(runs)} runs valid", flush=True)
        return far
    first = np.array([run.t_s[np.argmax(run.valid)] for run in good])
    last = np.array([run.nees[np.flatnonzero(run.valid)[-1]] for run in good])
    epochs = sum(int(run.valid.sum()) for run in runs)
    mean = np.concatenate([run.nees[run.valid] for run in good]).mean()
    band = chi2.ppf([0.025, 0.975], good[0].error.shape[1] * len(good)) / len(good)
    worst = max(float(run.size[run.valid].max()) for run in good)
    print(
        f"{name}: {len(good)} of {len(runs)} runs valid, first at {first.min():.0f}, {np.median(first):.0f}, "
        f"{first.max():.0f} s (least, median, most), NEES {last.mean():.2f} in {band[0]:.2f}..{band[1]:.2f} "
        "at the last valid epoch, "
        f"{mean:.2f} over all, {sum(run.far > 0 for run in runs)} runs with {far} of {epochs} "
        f"valid epochs beyond 5 sigma, largest error {worst:.3g} {good[0].unit}",
        flush=True,
    )
    return far


ORBIT = SunSynchronousOrbitParams()


def beside(apart_m: float) -> list[GroundStation]:
    """Two transmitters `apart_m` apart, 200 s ahead."""
    (site,) = stations_along_track(ORBIT, START_S, count=1, spacing_s=400.0, aside_rad=0.1)
    other = GroundStation(
        name="beside", latitude_rad=site.latitude_rad + apart_m / EARTH_RADIUS_M, longitude_rad=site.longitude_rad
    )
    return [site, other]


@dataclass(frozen=True)
class DoaCase:
    """A scene of DOA: stations, how they share the channel, duration and period of the blocks."""

    stations: Callable[[], list[GroundStation]]
    access: str = "in_turn"
    seconds: int = 240
    snr_db: float = 0.0
    start_rad: float = np.radians(60.0)
    torque_n_m: float = 0.0
    phase_rad: float = 0.0
    # What the estimator does not know, unless it is named below.
    off_deg: tuple[float, float] | None = None
    rate_rad_s: float = np.radians(0.05)
    gain_db: float = 0.0
    coupling_db: float | None = None
    dead: tuple[int, ...] = ()
    site_error_m: float = 0.0
    clock_error_s: float = 0.0
    # Of a clock whose error is drawn as the chain states it.
    clock_sigma_s: float = 0.0
    # What it knows.
    response_known: bool = False
    place_sigma_m: float = 0.0
    excluded: str = ""


def pair(aside_rad: float, spacing_s: float) -> Callable[[], list[GroundStation]]:
    """Return stations along the track, two of them in view at the start."""
    return lambda: stations_along_track(ORBIT, START_S - 2.0 * spacing_s, spacing_s=spacing_s, aside_rad=aside_rad)


DOA_CASES = {
    "one channel": DoaCase(pair(0.06, 300.0), "together"),
    "one channel, any attitude": DoaCase(pair(0.06, 300.0), "together", start_rad=np.pi),
    "one channel, 10 dB": DoaCase(pair(0.06, 300.0), "together", snr_db=10.0),
    "one channel, stations near each other": DoaCase(pair(0.03, 100.0), "together"),
    "one channel, stations across the track": DoaCase(pair(0.2, 200.0), "together"),
    "in turn": DoaCase(pair(0.06, 300.0)),
    "unknown torque of 2e-5 N m": DoaCase(pair(0.06, 300.0), torque_n_m=2e-5),
    "unknown torque of 5e-6 N m": DoaCase(pair(0.06, 300.0), torque_n_m=5e-6),
    "phases known to 10 deg": DoaCase(pair(0.06, 300.0), phase_rad=np.radians(10.0), clock_sigma_s=0.3),
    "phases known to 10 deg, one channel": DoaCase(pair(0.06, 300.0), "together", phase_rad=np.radians(10.0)),
    "1.5 km apart": DoaCase(lambda: beside(1.5e3)),
    "13 km apart": DoaCase(lambda: beside(13e3)),
    "52 km apart": DoaCase(lambda: beside(52e3), clock_sigma_s=0.3),
    "295 km apart": DoaCase(lambda: beside(295e3), clock_sigma_s=0.3),
    "one channel, start 45 to 60 deg off": DoaCase(pair(0.06, 300.0), "together", off_deg=(45.0, 60.0)),
    "-6 dB, any attitude": DoaCase(pair(0.06, 300.0), snr_db=-6.0, start_rad=np.pi),
    "turning at 2 deg/s": DoaCase(pair(0.06, 300.0), rate_rad_s=np.radians(2.0) / np.sqrt(3.0)),
    "a single station": DoaCase(lambda: beside(0.0)[:1], seconds=500),
    "two elements dead": DoaCase(pair(0.06, 300.0), dead=(3, 7)),
    "two elements dead, one channel": DoaCase(pair(0.06, 300.0), "together", dead=(3, 7)),
    "two elements dead, excluded, one channel": DoaCase(pair(0.06, 300.0), "together", dead=(3, 7), excluded="3, 7"),
    "gains off by 1 dB": DoaCase(pair(0.06, 300.0), gain_db=1.0),
    "gains off by 1 dB, one channel": DoaCase(pair(0.06, 300.0), "together", gain_db=1.0),
    "coupled by -15 dB": DoaCase(pair(0.06, 300.0), coupling_db=-15.0),
    "coupled by -15 dB, one channel": DoaCase(pair(0.06, 300.0), "together", coupling_db=-15.0),
    "coupled by -15 dB, calibrated, one channel": DoaCase(
        pair(0.06, 300.0), "together", coupling_db=-15.0, response_known=True
    ),
    "a station 20 km off": DoaCase(pair(0.06, 300.0), site_error_m=20e3),
    "a station 20 km off, places to 10 km": DoaCase(pair(0.06, 300.0), site_error_m=20e3, place_sigma_m=10e3),
    "clock 0.5 s ahead": DoaCase(pair(0.06, 300.0), clock_error_s=0.5),
}


def array_response(case: DoaCase, elements: int, stream: np.random.Generator) -> ArrayResponse:
    """Return phases, gains and coupling of the array of one run."""
    phases = case.phase_rad * stream.standard_normal(elements)
    level = 10.0 ** (case.gain_db * stream.standard_normal(elements) / 20.0) if case.gain_db else np.ones(elements)
    coupling = np.zeros(elements // 2, dtype=np.complex128)
    if case.coupling_db is not None:
        # Half as strong in amplitude to the second neighbour; any phase.
        coupling[:2] = 10.0 ** (case.coupling_db / 20.0) * np.exp(2j * np.pi * stream.random(2)) * [1.0, 0.5]
    return ArrayResponse(gain=level * np.exp(1j * phases), coupling=coupling)


def moved_station(station: GroundStation, by_m: float, stream: np.random.Generator) -> GroundStation:
    """Return the station `by_m` away, in any direction."""
    north, east = by_m / EARTH_RADIUS_M * direction_on_plane(stream)
    return GroundStation(
        name=station.name,
        latitude_rad=station.latitude_rad + north,
        longitude_rad=station.longitude_rad + east / np.cos(station.latitude_rad),
    )


def direction_on_plane(stream: np.random.Generator) -> Array:
    """Return a unit vector (2,)."""
    angle = 2.0 * np.pi * stream.random()
    return np.array([np.cos(angle), np.sin(angle)])


def doa_start(case: DoaCase, stream: np.random.Generator) -> tuple[float, float, float]:
    """Return roll, pitch and yaw at the start."""
    roll, pitch, yaw = case.start_rad * stream.uniform(-1.0, 1.0, 3) * [0.5, 0.5, 1.0]
    if case.off_deg is not None:
        axis = stream.standard_normal(3)
        turn = np.radians(stream.uniform(*case.off_deg)) * axis / np.linalg.norm(axis)
        roll, pitch, yaw = quaternion_to_roll_pitch_yaw(quaternion_from_rotation_vector(turn))
    return roll, min(max(pitch, -1.0), 1.0), yaw


def doa_run(case: DoaCase, seed: int) -> Epochs:
    """Return one run of the DOA chain at one block a second."""
    stream = random_stream(seed, "array_trials")
    array, satellite, noise = CircularArrayParams(), SatelliteParams(), ProcessNoiseParams()
    roll, pitch, yaw = doa_start(case, stream)
    scenario = DoaScenarioParams(
        snr_db=case.snr_db,
        access=case.access,
        unknown_torque_n_m=case.torque_n_m,
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        rate_rad_s=case.rate_rad_s,
    )
    stations = case.stations()
    response = array_response(case, array.elements, stream)
    truth = SimulatedDoa(
        array,
        ArraySourceParams(),
        ORBIT,
        stations,
        satellite,
        NadirHoldParams(),
        noise.replace(torque_n_m=0.0) if case.torque_n_m else noise,
        scenario,
        seed,
        response=response,
    )
    filtering = (DoaAttitudeParams(), StartParams(), noise, GateParams(), WatchParams())
    estimator = DoaEstimatorParams(phase_sigma_rad=case.phase_rad, excluded=case.excluded)
    if case.site_error_m:
        # The third is the first that is received.
        stations = [*stations[:2], moved_station(stations[2], case.site_error_m, stream), *stations[3:]]
    clock_error_s = case.clock_error_s
    if case.clock_sigma_s:
        clock_error_s += case.clock_sigma_s * stream.standard_normal()
    known = response if case.response_known else None
    chaining = DoaChainParams(place_sigma_m=case.place_sigma_m)
    chain = DoaAttitude(array, estimator, ORBIT, stations, satellite, filtering, chaining, response=known)
    rows: list[Any] = []
    for k in range(case.seconds):
        moment = truth.step(START_S + k)
        stamp_s = moment.truth.t_s + clock_error_s
        chain.take_torque(replace(moment.torque, t_s=stamp_s), stamp_s)
        try:
            found = (
                None
                if moment.heard is None
                else chain.take_block(received(moment.heard, case, stream, clock_error_s), stamp_s)
            )
        except ValueError as error:
            if "resolved" not in str(error):
                raise
            found = None
        if found is not None:
            turn = multiply(moment.truth.quaternion, conjugate(found.attitude.quaternion))
            error = quaternion_to_rotation_vector(turn)
            rows.append((float(k), found.attitude.valid, error, found.attitude.covariance_rad2))
    return Epochs(*(np.array(column) for column in zip(*rows, strict=True)))


def received(heard: ChannelBlock, case: DoaCase, stream: np.random.Generator, clock_error_s: float) -> ChannelBlock:
    """Return the block with the noise of the receiver only where an element is dead."""
    snapshots = heard.block.snapshots.copy()
    for index in case.dead:
        real, imaginary = stream.standard_normal((2, snapshots.shape[-1]))
        snapshots[index] = (real + 1j * imaginary) / np.sqrt(2.0)
    block = replace(heard.block, t_s=heard.block.t_s + clock_error_s, snapshots=snapshots)
    return replace(heard, block=block)


@dataclass(frozen=True)
class TripulseCase:
    """A scene of Tripulse: how far the attitude is from the one that steers, and the link."""

    tilt_deg: tuple[float, float] = (0.0, 0.5)
    third_station: bool = False
    scheme: str = "two_tone"
    element_db_hz: float = 37.0
    rain_db: float = 0.0
    quadrant_rad: float = np.radians(5.0)
    failed: str = ""
    taper_edge: float = 1.0


TRIPULSE_CASES = {
    "off by 1.3 to 5 deg": TripulseCase((1.3, 5.0)),
    "off by 1.3 to 5 deg, three stations": TripulseCase((1.3, 5.0), third_station=True),
    "off by 1.3 to 5 deg, interleaved": TripulseCase((1.3, 5.0), scheme="interleaved"),
    "off by 0.8 to 1.3 deg": TripulseCase((0.8, 1.3)),
    "off by 5 to 10 deg": TripulseCase((5.0, 10.0)),
    "off by 1.3 to 5 deg, tapered": TripulseCase((1.3, 5.0), taper_edge=0.5),
    "within 0.5 deg": TripulseCase(),
    "within 0.5 deg, three stations": TripulseCase(third_station=True),
    "within 0.5 deg, interleaved": TripulseCase(scheme="interleaved"),
    "within 0.5 deg, 6 dB of rain": TripulseCase(rain_db=6.0),
    "within 0.5 deg, 17 dB-Hz": TripulseCase(element_db_hz=17.0),
    "quadrants off by 10 deg": TripulseCase(quadrant_rad=np.radians(10.0)),
    "quadrants off by 10 deg, three stations": TripulseCase(quadrant_rad=np.radians(10.0), third_station=True),
    "within 0.5 deg, tapered to 0.4": TripulseCase(taper_edge=0.4),
    "ten dead elements, reported": TripulseCase(failed=", ".join(f"{m}:1" for m in range(1, 11))),
}


def tripulse_run(case: TripulseCase, seed: int) -> Epochs:
    """Return ten epochs of one attitude error, one a second."""
    stream = random_stream(seed, "array_trials")
    tilt, towards = np.radians(stream.uniform(*case.tilt_deg)), stream.uniform(0.0, 2.0 * np.pi)
    wobble = WobbleParams(
        roll_rad=tilt * np.cos(towards), pitch_rad=tilt * np.sin(towards), yaw_rad=np.radians(stream.uniform(-0.5, 0.5))
    )
    stations = GroundNetworkParams().stations()
    if case.third_station:
        stations.append(GroundStation(name="third", latitude_rad=0.6, longitude_rad=0.9))
    interleaved = case.scheme == "interleaved"
    signal = TripulseSignalParams(scheme=case.scheme, pattern="SxSy" if interleaved else "Sxy")
    array = TripulseArrayParams(taper_edge=case.taper_edge, failed=case.failed)
    link = TripulseSourceParams(
        element_carrier_to_noise_db_hz=case.element_db_hz - case.rain_db,
        reference_carrier_to_noise_db_hz=80.0 - case.rain_db,
        quadrant_phase_rad=case.quadrant_rad,
    )
    orbit = GeostationaryParams()
    truth = SimulatedTripulse(array, signal, link, orbit, wobble, stations, seed)
    nominal = TripulseReceiverParams(element_carrier_to_noise_db_hz=case.element_db_hz)
    receiver = TripulseReceiver(array=array, signal=signal, params=nominal)
    shared = float(np.max(shared_projection_sigma(array, case.quadrant_rad)))
    solver = TripulseAttitude(StationAttitudeParams(shared_sigma=shared), EpochParams(), orbit, stations)
    rows: list[Any] = []
    for k in range(10):
        sent = truth.step(START_S + k)
        measured = [receiver.measure(frame) for frame in sent.frames]
        for found in [each for one in measured for each in solver.take(one, START_S + k)]:
            turn = quaternion_to_rotation_vector(multiply(sent.moment.quaternion, conjugate(found.quaternion)))
            rows.append((float(k), found.valid, turn, found.covariance_rad2))
    return Epochs(*(np.array(column) for column in zip(*rows, strict=True)))


@dataclass(frozen=True)
class DockingCase:
    """A scene of the interferometer: where the other spacecraft is, how it moves, what the radio does."""

    range_m: float
    across_m_s: float = 0.1
    rate_rad_s: float = 2e-3
    seconds: int = 60
    phase_rad: float = 0.002
    known_phase_rad: float | None = None
    shared_phase_rad: float = 0.0
    snr_db: tuple[float, float] | None = None
    silent_s: tuple[float, float] = (0.0, 0.0)
    jolt_m_s: float = 0.0


DOCKING_CASES = {
    "200 m, 1.5 m/s across": DockingCase(200.0, 1.5),
    "200 m, 4 m/s across": DockingCase(200.0, 4.0),
    "2 km, 5 m/s across": DockingCase(2e3, 5.0),
    "2 km": DockingCase(2e3),
    "2 km, perfect hardware": DockingCase(2e3, phase_rad=0.0),
    "10 to 20 dB, 2 to 60 km": DockingCase(0.0, snr_db=(10.0, 20.0)),
    "20 to 30 dB, 2 to 60 km": DockingCase(0.0, snr_db=(20.0, 30.0)),
    "80 km": DockingCase(8e4),
    "30 m, turning at 2 deg/s": DockingCase(30.0, 0.2, np.radians(2.0)),
    "10 m, phases of 20 mrad": DockingCase(10.0, 0.05, phase_rad=0.02),
    "500 m, phases of 20 mrad": DockingCase(500.0, phase_rad=0.02),
    "phases of 0.5 rad shared by all paths": DockingCase(2e3, shared_phase_rad=0.5, known_phase_rad=0.002),
    "phases of 20 mrad, stated as 2 mrad": DockingCase(2e3, phase_rad=0.02, known_phase_rad=0.002),
    "silent for 12 s at 1 km": DockingCase(1e3, 1.0, silent_s=(20.0, 32.0)),
    "a jolt of 0.3 m/s at 1 km": DockingCase(1e3, 1.0, jolt_m_s=0.3),
}
PERIOD_S = 2.0


def wandering(truth: RelativeMotion, model: FilterParams, stream: np.random.Generator) -> RelativeMotion:
    """Return the motion a period later, with the white accelerations of the tracker's own model."""
    root = np.linalg.cholesky([[PERIOD_S**3 / 3.0, PERIOD_S**2 / 2.0], [PERIOD_S**2 / 2.0, PERIOD_S]])
    push = model.acceleration_density_m_s2 * root @ stream.standard_normal((2, 3))
    turn = model.angular_acceleration_density_rad_s2 * root @ stream.standard_normal((2, 3))
    later = moved(truth, PERIOD_S)
    return RelativeMotion(
        position_m=later.position_m + push[0],
        velocity_m_s=later.velocity_m_s + push[1],
        attitude=frame_rotation(turn[0]) @ later.attitude,
        rate_rad_s=later.rate_rad_s + turn[1],
    )


def docking_run(case: DockingCase, seed: int) -> Epochs:
    """Return one run of the interferometer at one reading in 2 s."""
    stream = random_stream(seed, "array_trials")
    system, model = InterferometerSystem(), FilterParams()
    range_m = case.range_m or float(stream.uniform(2e3, 6e4))
    forward = direction_from_angles(*stream.uniform(-0.3, 0.3, 2))
    across = np.cross(forward, stream.standard_normal(3))
    truth = RelativeMotion(
        position_m=range_m * forward,
        velocity_m_s=case.across_m_s * across / np.linalg.norm(across) - 0.02 * forward,
        attitude=attitude_from_euler(*stream.uniform(-0.3, 0.3, 2), stream.uniform(-3.0, 3.0)),
        rate_rad_s=case.rate_rad_s * stream.standard_normal(3) / np.sqrt(3.0),
    )
    phase = case.phase_rad if case.known_phase_rad is None else case.known_phase_rad
    floor = ErrorFloor(phase_rad=phase)
    radio = RadioParams(
        hardware_phase_rad=case.phase_rad, hardware_rate_rad_s=floor.phase_rate_rad_s, hardware_coupling=floor.amplitude
    )
    if case.snr_db is not None:
        wanted = 10.0 ** (0.1 * stream.uniform(*case.snr_db))
        powers = [float(required_power_w(wanted, range_m, link_hz, LinkParams())) for link_hz in (3.4e9, 2.4e9)]
        radio = radio.replace(forward_power_w=powers[0], return_power_w=powers[1])
    source = InterferometerSource(system, radio, LinkParams(), seed)
    shared = stream.uniform(-1.0, 1.0, system.plan.count) * case.shared_phase_rad
    tracker = InterferometerTracker(system=system, filter_params=model, floor=floor, radio=radio)
    state = TrackerState()
    rows: list[Any] = []
    for k in range(int(case.seconds / PERIOD_S)):
        t_s = PERIOD_S * k
        if t_s == 40.0:
            truth = replace(truth, velocity_m_s=truth.velocity_m_s + case.jolt_m_s * forward)
        measured = source.measure(t_s, truth)
        if not case.silent_s[0] < t_s <= case.silent_s[1]:
            turned = measured.phase_rad + shared[system.schedule.carriers(system.plan), None, None]
            state, output = tracker.step(state, replace(measured, phase_rad=np.mod(turned, 2.0 * np.pi)))
            if output.estimate is not None:
                found = output.estimate.motion
                error = np.concatenate(
                    [
                        truth.position_m - found.position_m,
                        truth.velocity_m_s - found.velocity_m_s,
                        rotation_vector(truth.attitude @ found.attitude.T),
                        truth.rate_rad_s - found.rate_rad_s,
                    ]
                )
                rows.append((t_s, True, error, output.estimate.covariance))
        truth = wandering(truth, model, stream)
    if not rows:
        rows = [(0.0, False, np.zeros(12), np.eye(12))]
    return Epochs(*(np.array(column) for column in zip(*rows, strict=True)), unit="m")


def main() -> int:
    """Print one line a scenario; return 1 if a valid epoch was beyond 5 sigma."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sensor", choices=["doa", "tripulse", "interferometer"])
    parser.add_argument("scenario", nargs="*")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--first-seed", type=int, default=1)
    given = parser.parse_args()
    seeds = range(given.first_seed, given.first_seed + given.runs)
    scenes: dict[str, dict[str, Callable[[int], Epochs]]] = {
        "doa": {name: partial(doa_run, case) for name, case in DOA_CASES.items()},
        "tripulse": {name: partial(tripulse_run, case) for name, case in TRIPULSE_CASES.items()},
        "interferometer": {name: partial(docking_run, case) for name, case in DOCKING_CASES.items()},
    }
    far = 0
    for name, run in scenes[given.sensor].items():
        if not given.scenario or name in given.scenario:
            far += report(name, [run(seed) for seed in seeds])
    return int(far > 0)


if __name__ == "__main__":
    sys.exit(main())
