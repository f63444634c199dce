"""A simulated satellite whose circular array receives ground stations: truth of the DOA filter.

The satellite holds nadir by a torque that it knows and publishes.  Stations above their horizon and
in front of the array transmit in turn, one block of snapshots each period, or all together in one
channel.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.array_sensors.attitude.ground_stations import GroundPlace, view_stations
from rf_pointing.array_sensors.attitude.multiplicative_filter import ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import Orbit
from rf_pointing.array_sensors.attitude.quaternion import (
    quaternion_from_roll_pitch_yaw,
    quaternion_to_matrix,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams
from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams
from rf_pointing.array_sensors.doa.attitude_chain import ChannelBlock, HeldTorque
from rf_pointing.array_sensors.doa.simulated_satellite import (
    NadirHoldParams,
    SatelliteTruth,
    SimulatedSatellite,
)
from rf_pointing.core import Params, parameter, random_stream
from rf_pointing.core.types import Array

# The step of DOA, so that truth and filter integrate alike however long the period of the blocks
# is.
_STEP_S = 0.25


@dataclass(frozen=True, kw_only=True)
class DoaScenarioParams(Params):
    """Link, access of the stations and true attitude at the start."""

    snr_db: float = parameter(
        0.0, "signal-to-noise ratio of a station per element", low=-60.0, high=80.0
    )
    access: str = parameter(
        "in_turn",
        "in_turn: one station each period; together: all in one channel",
        choices=("in_turn", "together"),
    )
    elevation_min_rad: float = parameter(
        math.radians(10.0), "lowest elevation of the satellite", low=0.0, high=1.5
    )
    boresight_cosine_min: float = parameter(
        0.15, "smallest cos(theta) that the array receives", low=1e-3, high=1.0
    )
    roll_rad: float = parameter(
        math.radians(15.0), "true roll at the start", low=-math.pi, high=math.pi
    )
    pitch_rad: float = parameter(math.radians(-10.0), "true pitch at the start", low=-1.5, high=1.5)
    yaw_rad: float = parameter(
        math.radians(40.0), "true yaw at the start", low=-math.pi, high=math.pi
    )
    rate_rad_s: float = parameter(
        math.radians(0.05), "true rate at the start, each axis", low=-0.1, high=0.1
    )
    unknown_torque_n_m: float = parameter(
        0.0, "constant torque besides that of disturbance.torque_n_m, each axis", low=-1.0, high=1.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DoaMoment:
    """Truth at one instant, the torque held from then on, and the snapshots if any station is
    received.
    """

    truth: SatelliteTruth
    torque: HeldTorque
    heard: ChannelBlock | None


class SimulatedDoa:
    """Satellite, orbit, stations and array, stepped by time; starts at the first step."""

    def __init__(
        self,
        array: CircularArrayParams,
        receiver: ArraySourceParams,
        orbit: Orbit,
        stations: Sequence[GroundPlace],
        satellite: SatelliteParams,
        hold: NadirHoldParams,
        noise: ProcessNoiseParams,
        scenario: DoaScenarioParams,
        seed: int,
        *,
        response: ArrayResponse | None = None,
    ) -> None:
        self._orbit, self._stations, self._scenario = orbit, stations, scenario
        self._bodies = (satellite, hold, noise)
        self._seed = seed
        # A stream of its own: the torque does not change with the noise drawn before.
        drawn = noise.torque_n_m * random_stream(seed, "doa torque").standard_normal(3)
        self._unknown_n_m = drawn + scenario.unknown_torque_n_m
        self._source = ArraySource(array, receiver, seed=seed, response=response)
        self._satellite: SimulatedSatellite | None = None
        self._torque: KnownTorque | None = None
        self._turn = 0

    def step(self, t_s: float) -> DoaMoment:
        """Advance to `t_s` under the torque held so far; ValueError if time does not advance."""
        satellite = self._advanced(t_s)
        rate = self._orbit.point(t_s).frame_rate_rad_s
        self._torque = satellite.hold_torque(rate)
        truth = satellite.state
        return DoaMoment(
            truth=truth,
            torque=HeldTorque(t_s=t_s, known=self._torque),
            heard=self._hear(t_s, truth.quaternion),
        )

    def _advanced(self, t_s: float) -> SimulatedSatellite:
        if self._satellite is None or self._torque is None:
            self._satellite = self._started(t_s)
            return self._satellite
        before_s = self._satellite.state.t_s
        if t_s <= before_s:
            raise ValueError(f"t_s={t_s} must be > the last step's {before_s}")
        count = math.ceil((t_s - before_s) / _STEP_S - 1e-9)
        torque = replace(self._torque, control_n_m=self._torque.control_n_m + self._unknown_n_m)
        for index in range(count):
            # Frame rate at the middle of the step: at its start the truth would lag by half a step
            # every step.
            middle_s = before_s + (index + 0.5) * (t_s - before_s) / count
            rate = self._orbit.point(middle_s).frame_rate_rad_s
            self._satellite.step((t_s - before_s) / count, torque, rate)
        return self._satellite

    def _started(self, t_s: float) -> SimulatedSatellite:
        scenario, (satellite, hold, noise) = self._scenario, self._bodies
        turn = quaternion_from_roll_pitch_yaw(
            [scenario.roll_rad, scenario.pitch_rad, scenario.yaw_rad]
        )
        rate = (
            quaternion_to_matrix(turn).T @ self._orbit.point(t_s).frame_rate_rad_s
            + scenario.rate_rad_s
        )
        return SimulatedSatellite(
            satellite, hold, noise, t_s=t_s, quaternion=turn, rate_rad_s=rate, seed=self._seed
        )

    def _hear(self, t_s: float, quaternion: Array) -> ChannelBlock | None:
        view = view_stations(self._orbit, self._stations, t_s)
        directions = view.reference @ quaternion_to_matrix(quaternion)
        in_front = directions[:, 2] >= self._scenario.boresight_cosine_min
        heard = np.flatnonzero(view.visible(self._scenario.elevation_min_rad) & in_front)
        if not len(heard):
            return None
        if self._scenario.access == "in_turn":
            # Counted over all steps: the stations in view change, so their index alone would favour
            # some.
            heard = heard[[self._turn % len(heard)]]
            self._turn += 1
        block = self._source.step(
            t_s, directions[heard], np.full(len(heard), self._scenario.snr_db)
        )
        return ChannelBlock(
            transmitters=tuple(self._stations[index].name for index in heard.tolist()), block=block
        )
