"""The simulated receiver: the one part, with the antenna, that knows where the satellite really is.

The real satellite runs ahead of or behind its elements by `along_track_offset_s`.  Boresights come in, one per control
tick; every `cluster_samples` of them give a cluster of sum and difference samples, a carrier power and the true error.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.geometry import (
    Boresight,
    CarrierPower,
    MonopulseCluster,
    Params,
    PointingError,
    parameter,
    random_stream,
    sky_offset_rad,
)
from rf_pointing.rf import (
    AtmosphereParams,
    Beam,
    BeamParams,
    Link,
    LinkParams,
    MonopulseFeed,
    MonopulseFeedParams,
    NoiseParams,
    Receiver,
    ReceiverParams,
)

__all__ = ["Reception", "SignalParams", "SimulatedReceiver"]


@dataclass(frozen=True, kw_only=True)
class SignalParams(Params):
    """Satellite signal, feed and receiver of the simulation."""

    link: LinkParams = parameter(LinkParams(), "strength of the signal")
    atmosphere: AtmosphereParams = parameter(AtmosphereParams(), "loss in the air")
    noise: NoiseParams = parameter(NoiseParams(), "parts of the system noise")
    beam: BeamParams = parameter(BeamParams(), "beam of the antenna")
    feed: MonopulseFeedParams = parameter(MonopulseFeedParams(), "monopulse feed")
    receiver: ReceiverParams = parameter(ReceiverParams(), "receiver")
    cluster_samples: int = parameter(5, "samples in one cluster", low=3, high=100)
    seed: int = parameter(1, "seed of every noise source", low=0, high=2**31 - 1)


class Reception(NamedTuple):
    """What one cluster of boresights gives; `truth` is target minus beam, known to a simulation only."""

    cluster: MonopulseCluster
    power: CarrierPower
    truth: PointingError


class SimulatedReceiver:
    """Collects boresights; `take` returns a `Reception` for every full cluster."""

    def __init__(self, params: SignalParams, real_track: TopocentricTrack) -> None:
        self.params = params
        self._track = real_track
        self._link = Link(params.link, params.atmosphere, params.noise)
        feed = MonopulseFeed(params.feed, params.beam)
        random = random_stream(params.seed, "receiver")
        self._receiver = Receiver(params.receiver, Beam(params.beam), feed, random)
        self._boresights: list[Boresight] = []

    def take(self, boresight: Boresight) -> Reception | None:
        """Take one boresight; times must increase, a gap or a step back starts a new cluster."""
        if self._boresights and boresight.t_s <= self._boresights[-1].t_s:
            self._boresights.clear()
        self._boresights.append(boresight)
        if len(self._boresights) < self.params.cluster_samples:
            return None
        cluster, self._boresights = self._boresights, []
        return self._receive(cluster)

    def _receive(self, cluster: list[Boresight]) -> Reception:
        t_s = np.array([sample.t_s for sample in cluster])
        look = self._track.sample(t_s)
        right, up = sky_offset_rad(
            look.azimuth_rad,
            look.elevation_rad,
            [sample.azimuth_rad for sample in cluster],
            [sample.elevation_rad for sample in cluster],
        )
        above = look.elevation_rad > 0.0
        level = np.where(above, self._link.carrier_to_noise_db_hz(look.range_m, np.abs(look.elevation_rad)), -np.inf)
        sample_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
        truth = PointingError(
            t_s=float(t_s[-1]),
            sensor="truth",
            cross_elevation_rad=float(right[-1]),
            elevation_rad=float(up[-1]),
            carrier_to_noise_db_hz=max(float(level[-1]), 0.0),
        )
        return Reception(
            self._receiver.cluster(t_s, right, up, level, sample_s),
            self._receiver.carrier_power(float(t_s[-1]), sample_s * len(t_s), right, up, level),
            truth,
        )
