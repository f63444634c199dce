"""Tripulse from satellite to attitude: simulated transmission, and epochs of the stations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rf_pointing.array_sensors.attitude.attitude_report import AttitudeReport, require_arrived
from rf_pointing.array_sensors.attitude.ground_stations import GroundPlace, view_stations
from rf_pointing.array_sensors.attitude.orbits import Orbit
from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.geostationary_scene import (
    SceneMoment,
    WobbleParams,
    scene_moment,
)
from rf_pointing.array_sensors.tripulse.receiver import TripulseMeasurement
from rf_pointing.array_sensors.tripulse.signal import TripulseFrame, TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import (
    StationLine,
    TripulseSource,
    TripulseSourceParams,
)
from rf_pointing.array_sensors.tripulse.station_attitude import (
    StationAttitude,
    StationAttitudeEstimator,
    StationAttitudeParams,
    StationObservation,
)
from rf_pointing.core import Params, parameter

# Frames of one epoch differ by the rounding of their stamps only.
SAME_EPOCH_S = 1e-3
"""Frames of one epoch leave the satellite within less than this."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TripulseTransmission:
    """Truth of one epoch and the frame that each station received."""

    moment: SceneMoment
    frames: list[TripulseFrame]


class SimulatedTripulse:
    """Geosynchronous satellite over its stations.

    It steers by a nadir-pointing attitude and is off by the wobble.
    """

    def __init__(
        self,
        array: TripulseArrayParams,
        signal: TripulseSignalParams,
        link: TripulseSourceParams,
        orbit: Orbit,
        wobble: WobbleParams,
        stations: Sequence[GroundPlace],
        seed: int,
    ) -> None:
        self._orbit, self._wobble, self._stations = orbit, wobble, stations
        self.source = TripulseSource(array, signal, link, seed=seed)

    def step(self, t_s: float) -> TripulseTransmission:
        """Return what is sent and received at `t_s`.

        ValueError if a station does not see the satellite.
        """
        moment = scene_moment(self._orbit, self._wobble, self._stations, t_s)
        frames = self.source.step(t_s, moment.rotation, self._lines_of_sight(moment))
        return TripulseTransmission(moment=moment, frames=frames)

    def _lines_of_sight(self, moment: SceneMoment) -> list[StationLine]:
        return [
            StationLine(
                name=station.name,
                direction=moment.view.reference[index],
                range_rate_m_s=float(moment.range_rate_m_s[index]),
                elevation_rad=float(moment.view.elevation_rad[index]),
            )
            for index, station in enumerate(self._stations)
        ]


@dataclass(frozen=True, kw_only=True)
class EpochParams(Params):
    """How the measurements of several stations come together."""

    wait_s: float = parameter(
        2.0, "how long an epoch waits for a station, in the time of the frames", low=0.0, high=1e3
    )


class TripulseAttitude:
    """Gathers the stations' measurements by epoch.

    An epoch is closed when all have reported, or it waited too long.
    """

    def __init__(
        self,
        params: StationAttitudeParams,
        epochs: EpochParams,
        orbit: Orbit,
        stations: Sequence[GroundPlace],
    ) -> None:
        self.estimator = StationAttitudeEstimator(params)
        self._epochs, self._orbit = epochs, orbit
        self._stations = {station.name: station for station in stations}
        self._open: dict[float, dict[str, StationObservation]] = {}
        self._closed_s = -math.inf

    def take(self, measured: TripulseMeasurement, now_s: float) -> list[StationAttitude]:
        """Return the attitudes of the epochs that `measured` closes, oldest first.

        Raises
        ------
        ValueError : if the station is unknown, or the measurement is late, repeated or ahead of the
            clock.
        """
        require_arrived(measured.t_s, now_s)
        if measured.station not in self._stations:
            raise ValueError(
                f"station={measured.station!r} must be one of {', '.join(self._stations)}"
            )
        if measured.t_s <= self._closed_s + SAME_EPOCH_S:
            raise ValueError(
                f"t_s={measured.t_s} of station {measured.station} is late: {self._closed_s} is closed"
            )
        seen = self._observation(measured)
        epoch = next(
            (e for s, e in self._open.items() if abs(s - measured.t_s) <= SAME_EPOCH_S), None
        )
        if epoch is None:
            epoch = self._open[measured.t_s] = {}
        if measured.station in epoch:
            raise ValueError(
                f"t_s={measured.t_s} of station {measured.station} was reported before"
            )
        epoch[measured.station] = seen
        return [self._close(t_s) for t_s in self._due()]

    def _due(self) -> list[float]:
        """Return the open epochs that are complete or too old, and those before them."""
        times = sorted(self._open)
        # An epoch waits in the time of the frames, not of the clock: a slow machine loses no
        # station.
        ended = [
            t_s
            for t_s in times
            if len(self._open[t_s]) == len(self._stations) or times[-1] - t_s > self._epochs.wait_s
        ]
        return [t_s for t_s in times if ended and t_s <= ended[-1]]

    def _close(self, t_s: float) -> StationAttitude:
        reports = self._open.pop(t_s).values()
        for seen in reports:
            self.estimator.observe(seen)
        # The newest stamp, so that a repeated report of a closed epoch is recognised as late.
        self._closed_s = max(seen.t_s for seen in reports)
        return self.estimator.estimate(self._closed_s)

    def _observation(self, measured: TripulseMeasurement) -> StationObservation:
        station = self._stations[measured.station]
        return StationObservation(
            t_s=measured.t_s,
            station=measured.station,
            projections=measured.projections,
            covariance=measured.covariance,
            reference=view_stations(self._orbit, [station], measured.t_s).reference[0],
            valid=measured.valid,
            reason=measured.reason,
        )


def attitude_report(found: StationAttitude) -> AttitudeReport:
    """Return what the estimator found in the common form of the attitude sensors."""
    return AttitudeReport(
        t_s=found.t_s,
        quaternion=found.quaternion,
        covariance_rad2=0.5 * (found.covariance_rad2 + found.covariance_rad2.T),
        valid=found.valid,
        reason=found.reason,
    )
