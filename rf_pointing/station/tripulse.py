"""Tripulse from satellite to attitude: what the simulated satellite sends, and what is made of the stations' reports."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.arrays.tripulse_array import TripulseArrayParams
from rf_pointing.arrays.tripulse_receiver import TripulseMeasurement
from rf_pointing.arrays.tripulse_signal import TripulseFrame, TripulseSignalParams
from rf_pointing.arrays.tripulse_source import StationLine, TripulseSource, TripulseSourceParams
from rf_pointing.attitude.geostationary_scene import (
    GeostationaryParams,
    SceneMoment,
    WobbleParams,
    scene_moment,
    station_view,
)
from rf_pointing.attitude.ground_stations import GroundStation
from rf_pointing.attitude.station_attitude import (
    StationAttitude,
    StationAttitudeEstimator,
    StationAttitudeParams,
    StationObservation,
)
from rf_pointing.station.arrival import require_arrived

__all__ = ["SAME_EPOCH_S", "SimulatedTripulse", "TripulseAttitude", "TripulseTransmission", "observation"]

Array = NDArray[np.float64]
SAME_EPOCH_S = 1e-3
"""Frames of one epoch leave the satellite within less than this."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TripulseTransmission:
    """Truth of one epoch and the frame that each station received."""

    moment: SceneMoment
    frames: list[TripulseFrame]


class SimulatedTripulse:
    """Geosynchronous satellite over its stations; it steers by a nadir-pointing attitude and is off by the wobble."""

    def __init__(
        self,
        array: TripulseArrayParams,
        signal: TripulseSignalParams,
        link: TripulseSourceParams,
        orbit: GeostationaryParams,
        wobble: WobbleParams,
        stations: list[GroundStation],
        seed: int,
    ) -> None:
        self._orbit, self._wobble, self._stations = orbit, wobble, stations
        self.source = TripulseSource(array, signal, link, seed=seed)

    def step(self, t_s: float) -> TripulseTransmission:
        """Return what is sent and received at `t_s`; ValueError if a station does not see the satellite."""
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


class TripulseAttitude:
    """Gathers the measurements of one epoch and estimates once all stations have reported, or the next epoch begins."""

    def __init__(
        self, params: StationAttitudeParams, orbit: GeostationaryParams, stations: list[GroundStation]
    ) -> None:
        self.estimator = StationAttitudeEstimator(params)
        self._orbit = orbit
        self._stations = {station.name: station for station in stations}
        self._epoch_s: float | None = None
        self._heard: set[str] = set()

    def take(self, measured: TripulseMeasurement, now_s: float) -> list[StationAttitude]:
        """Return the attitudes that `measured` completes: none, one, or two where the epoch before had stayed open.

        Raises
        ------
        ValueError : if the station is unknown, or the measurement is late, repeated or ahead of the clock.
        """
        require_arrived(measured.t_s, now_s)
        if measured.station not in self._stations:
            raise ValueError(f"station={measured.station!r} must be one of {', '.join(self._stations)}")
        if self._epoch_s is not None and measured.t_s < self._epoch_s - SAME_EPOCH_S:
            raise ValueError(f"t_s={measured.t_s} of station {measured.station} is late: the epoch is {self._epoch_s}")
        reference = station_view(self._orbit, [self._stations[measured.station]], measured.t_s).reference[0]
        found = self._begin(measured.t_s)
        self.estimator.observe(observation(measured, reference))
        self._heard.add(measured.station)
        if len(self._heard) == len(self._stations):
            found.append(self.estimator.estimate(measured.t_s))
        return found

    def _begin(self, t_s: float) -> list[StationAttitude]:
        """Close the epoch before `t_s`, if it is another; an incomplete one still gives its attitude, or the reason."""
        if self._epoch_s is not None and t_s <= self._epoch_s + SAME_EPOCH_S:
            return []
        open_before = self._epoch_s is not None and len(self._heard) < len(self._stations)
        found = [self.estimator.estimate(self._epoch_s)] if open_before and self._epoch_s is not None else []
        self._epoch_s, self._heard = t_s, set()
        return found


def observation(measured: TripulseMeasurement, reference: Array) -> StationObservation:
    """Return a station's measurement as the attitude estimator takes it."""
    return StationObservation(
        t_s=measured.t_s,
        station=measured.station,
        projections=measured.projections,
        covariance=measured.covariance,
        reference=reference,
        valid=measured.valid,
        reason=measured.reason,
    )
