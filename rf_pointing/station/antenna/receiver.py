"""The simulated receiver: the one part, with the antenna, that knows where the satellite really is.

The real satellite runs ahead of or behind its elements by `along_track_offset_s`.  Boresights come
in, one per control tick; every `cluster_samples` of them give a cluster of sum and difference
samples, a carrier power and the true error.  Of a body of the sky the power is the total one, in
`noise_bandwidth_hz`: k B (T_sys + T_A), T_A that of its disc in the beam, sigma = P / sqrt(B t).
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rf_pointing.core import (
    Boresight,
    CarrierPower,
    MonopulseCluster,
    Params,
    PointingError,
    parameter,
    random_stream,
    sky_offset_rad,
)
from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.core.types import Array
from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.y_factor import source_noise_k
from rf_pointing.receiver.params import GeneratorParams
from rf_pointing.rf import (
    AtmosphereParams,
    Beam,
    BeamParams,
    DropoutParams,
    Dropouts,
    InterferenceParams,
    Link,
    LinkParams,
    MonopulseFeed,
    MonopulseFeedParams,
    NoiseParams,
    Receiver,
    ReceiverParams,
    SpinParams,
    spin_gain_db,
)
from rf_pointing.rf.noise import BOLTZMANN_J_K, atmosphere_loss_db, system_noise_k
from rf_pointing.station.radio.sky_flux import flux_at, has_flux

FARTHEST_BEAMS = 10.0
"""Distance off the axis, in beamwidths, from which a body adds what it does there."""
BLOCK = 50
"""Look angles computed at once: a second of ticks in one vectorised call."""
NO_LINE_DB_HZ = -40.0
TIME_TOLERANCE_S = 1e-5


@dataclass(frozen=True, kw_only=True)
class SignalParams(Params):
    """Satellite signal, feed and receiver of the simulation."""

    link: LinkParams = parameter(LinkParams(), "strength of the signal")
    atmosphere: AtmosphereParams = parameter(AtmosphereParams(), "loss in the air")
    noise: NoiseParams = parameter(NoiseParams(), "parts of the system noise")
    beam: BeamParams = parameter(BeamParams(), "beam of the antenna")
    feed: MonopulseFeedParams = parameter(MonopulseFeedParams(), "monopulse feed")
    receiver: ReceiverParams = parameter(ReceiverParams(), "receiver")
    dropouts: DropoutParams = parameter(DropoutParams(count=0), "interruptions of the carrier")
    spin: SpinParams = parameter(SpinParams(depth=0.0), "modulation of the power by the satellite's spin")
    interference: InterferenceParams = parameter(
        InterferenceParams(level_db_hz=NO_LINE_DB_HZ), "line offset from the carrier; none at the lowest level"
    )
    dropouts_after_s: float = parameter(40.0, "time after the first reception before the first one", 0.0, 1e5)
    dropouts_within_s: float = parameter(600.0, "time in which all of them fall", 1.0, 1e5)
    sign_flip_after_s: float = parameter(
        0.0, "time after the first reception at which both differences are turned over; 0: never", 0.0, 1e5
    )
    cluster_samples: int = parameter(5, "samples in one cluster", 3, 100)
    sample_s: float = parameter(0.02, "time between two samples, that of the boresights", 0.001, 0.1)
    seed: int = parameter(1, "seed of every noise source", 0, 2**31 - 1)
    frequency_hz: float = parameter(8.4e9, "frequency, for the noise of bodies", 1e6, 1e11)
    gain_dbi: float = parameter(68.0, "gain, for the noise of bodies", -10.0, 100.0)
    sun_flux_sfu: float = parameter(0.0, "flux of the Sun here, in 1e-22 W/m^2/Hz; 0: of the quiet Sun", 0.0, 1e6)


@dataclass(frozen=True, kw_only=True)
class RadioParams(Params):
    """A simulated software-defined radio behind the simulated antenna."""

    carrier_hz: float = parameter(8.45e9, "frequency that arrives at the radio without Doppler", 1e5, 4e11)
    doppler_hz: float = parameter(8.45e9, "frequency that the satellite sends", 1e6, 4e11)
    centre_hz: float = parameter(8.45e9, "frequency to which the radio is tuned", 1e5, 4e11)
    generator: GeneratorParams = parameter(GeneratorParams(rate_hz=2.4e5), "transmitter, noise and converter")


class Reception(NamedTuple):
    """A cluster of samples (None of one channel), carrier power, and true target minus beam."""

    cluster: MonopulseCluster | None
    power: CarrierPower
    truth: PointingError


class Arriving(NamedTuple):
    """Signal where a beam points: true error, C/N0 on the target, range rate; all (n,)."""

    cross_elevation_rad: Array
    elevation_rad: Array
    level_db_hz: Array
    range_rate_m_s: Array

    def truth(self, t_s: float) -> PointingError:
        """Return the true target minus beam at the last of the times, `t_s`."""
        return PointingError(
            t_s=t_s,
            sensor="truth",
            cross_elevation_rad=float(self.cross_elevation_rad[-1]),
            elevation_rad=float(self.elevation_rad[-1]),
            # The wire carries finite numbers; 0 dB-Hz is far below what any tracker uses.
            carrier_to_noise_db_hz=max(float(self.level_db_hz[-1]), 0.0),
        )


class _Ahead:
    """Look angles at evenly spaced times ahead, computed a block at a time."""

    def __init__(self, track: TopocentricTrack) -> None:
        self.track = track
        self._times: Array = np.zeros(0)
        self._rows: Array = np.zeros((0, 5))

    def at(self, t_s: Array) -> Array:
        """Return azimuth, elevation, range, its rate and the gain (n, 5) at even times (n,)."""
        first = int(np.searchsorted(self._times, t_s[0] - TIME_TOLERANCE_S))
        # Compared with a tolerance: times are sums of ticks.
        found = self._times[first : first + len(t_s)]
        if len(found) < len(t_s) or float(np.max(np.abs(found - t_s))) > TIME_TOLERANCE_S:
            step_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
            self._times = t_s[0] + step_s * np.arange(max(BLOCK, len(t_s)))
            look = self.track.sample(self._times)
            self._rows = np.column_stack(
                [look.azimuth_rad, look.elevation_rad, look.range_m, look.range_rate_m_s, look.satellite_gain_db]
            )
            first = 0
        rows: Array = self._rows[first : first + len(t_s)]
        return rows


class ArrivingSignal:
    """The signal that reaches an antenna at these boresights, before any receiver.

    What is off the beam is across and along the upper axis of the `mount`, as the feed sees it.
    """

    def __init__(self, params: SignalParams, real_track: TopocentricTrack, mount: Kinematics = LEVEL) -> None:
        self.params, self._mount = params, mount
        self._ahead = _Ahead(real_track)
        self._link = Link(params.link, params.atmosphere, params.noise)
        self._first_s: float | None = None
        self._dropouts: Dropouts | None = None
        # Made once: a feed is turned over in flight, between two clusters.
        self._feeds = (MonopulseFeed(params.feed, params.beam), MonopulseFeed(_turned_over(params.feed), params.beam))
        self.feed = self._feeds[0]
        self._disc = DiscResponse(params.beam)
        self.elevation_rad: Array = np.zeros(0)
        """Elevation (n,) of the source at the last boresights."""

    @property
    def track(self) -> TopocentricTrack:
        """Real motion of what is received."""
        return self._ahead.track

    @property
    def target(self) -> str:
        """Name of the satellite that is received."""
        return self.track.name

    def tune(self, real_track: TopocentricTrack) -> None:
        """Receive another satellite from now on."""
        self._ahead = _Ahead(real_track)

    def at(self, t_s: Array, boresights: list[Boresight]) -> Arriving:
        """Return what arrives at even times (n,), those of the boresights."""
        azimuth, elevation, range_m, range_rate_m_s, gain_db = self._ahead.at(t_s).T
        self.elevation_rad = elevation
        right, up = sky_offset_rad(
            azimuth, elevation, [each.azimuth_rad for each in boresights], [each.elevation_rad for each in boresights]
        )
        if not self._mount.level:
            # The feed turns against the sky so slowly that one angle serves a cluster.
            middle = boresights[len(boresights) // 2]
            right, up = self._mount.across(middle.azimuth_rad, middle.elevation_rad) @ np.stack([right, up])
        # Below the horizon there is no signal, whatever the geometry of the beam.
        level = self._link.carrier_to_noise_db_hz(range_m, np.abs(elevation)) + gain_db
        level = np.where(elevation > 0.0, level, -np.inf)
        return Arriving(right, up, self._disturbed(t_s, level), range_rate_m_s)

    def _disturbed(self, t_s: Array, level_db_hz: Array) -> Array:
        """Return the C/N0 with the spin in it and the dropouts taken out.

        All but the spin, and so the turned feed, count from the first reception.
        """
        params = self.params
        if params.spin.depth > 0.0:
            level_db_hz = level_db_hz + spin_gain_db(params.spin, t_s)
        # Counted from the first signal, so that a pass has its dropouts however long it slews
        # before.
        if self._first_s is None and float(level_db_hz[0]) > -np.inf:
            self._first_s = float(t_s[0])
            begin_s = self._first_s + params.dropouts_after_s
            random = random_stream(params.seed, "dropouts")
            self._dropouts = Dropouts(params.dropouts, begin_s, begin_s + params.dropouts_within_s, random)
        if self._first_s is None or self._dropouts is None:
            return level_db_hz
        if 0.0 < params.sign_flip_after_s <= float(t_s[0]) - self._first_s:
            self.feed = self._feeds[1]
        return self._dropouts.level_db_hz(t_s, level_db_hz) if params.dropouts.count else level_db_hz


class SimulatedReceiver(ArrivingSignal):
    """Collects boresights; `take` returns a `Reception` for every full cluster."""

    def __init__(self, params: SignalParams, real_track: TopocentricTrack, mount: Kinematics = LEVEL) -> None:
        super().__init__(params, real_track, mount)
        random = random_stream(params.seed, "receiver")
        line = params.interference if params.interference.level_db_hz > NO_LINE_DB_HZ else None
        self._receiver = Receiver(params.receiver, Beam(params.beam), self.feed, random, line)
        self._boresights: list[Boresight] = []
        self._newest = -1
        self._random = random

    def take(self, boresight: Boresight) -> Reception | None:
        """Take one boresight; return the reception when it completes a cluster.

        A cluster ends on the grid of `cluster_samples` times `sample_s` and needs every sample.
        After a gap or a step back in time the next complete cluster counts.
        """
        index = round(boresight.t_s / self.params.sample_s)
        # A cluster over a gap would average two directions of the beam.
        if self._boresights and index != self._newest + 1:
            self._boresights.clear()
        # After a step back in time the receiver's phase does not go on: it starts anew, or the gap
        # would be a jump.
        if index <= self._newest:
            self._receiver.state = replace(self._receiver.state, t_s=None)
        self._newest = index
        self._boresights.append(boresight)
        if index % self.params.cluster_samples:
            return None
        cluster, self._boresights = self._boresights, []
        return self._receive(cluster) if len(cluster) == self.params.cluster_samples else None

    def _receive(self, cluster: list[Boresight]) -> Reception:
        t_s = np.array([sample.t_s for sample in cluster])
        right, up, level, _ = arriving = self.at(t_s, cluster)
        self._receiver.feed = self.feed
        sample_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
        taken, power = (float(t_s[-1]), sample_s * len(t_s)), self._receiver.carrier_power
        return Reception(
            self._receiver.cluster(t_s, right, up, level, sample_s),
            self._total_power(*taken, cluster, arriving)
            if has_flux(self.target, self.params.frequency_hz, taken[0])
            else power(*taken, right, up, level),
            arriving.truth(float(t_s[-1])),
        )

    def _total_power(
        self, t_s: float, integration_s: float, boresights: list[Boresight], arriving: Arriving
    ) -> CarrierPower:
        """Return the noise power of the system and of the body."""
        params, receiver = self.params, self.params.receiver
        # The beam looks along its own elevation, whatever it is off the body.
        elevation = np.abs([each.elevation_rad for each in boresights])
        flux = flux_at(self.target, params.frequency_hz, t_s, params.sun_flux_sfu or None)
        loss = 10.0 ** (0.1 * atmosphere_loss_db(params.atmosphere, elevation))
        width = params.beam.half_power_beamwidth_rad
        apart2 = (arriving.cross_elevation_rad**2 + arriving.elevation_rad**2) / width**2
        # Far off there are but side lobes, which a table would reach in vain.
        apart2 = np.minimum(apart2, FARTHEST_BEAMS**2)
        gain = self._disc.power(apart2, flux.radius_rad / width, FARTHEST_BEAMS)
        source_k = source_noise_k(flux, params.frequency_hz, params.gain_dbi) * gain / loss
        # A source below the horizon is behind the Earth.
        source_k = np.where(self.elevation_rad > 0.0, source_k, 0.0)
        noise_k = system_noise_k(params.noise, params.atmosphere, elevation)
        kelvin = float(np.mean(noise_k + source_k))
        mean_w = BOLTZMANN_J_K * kelvin * receiver.noise_bandwidth_hz
        sigma = 1.0 / math.sqrt(receiver.noise_bandwidth_hz * integration_s)
        power_w = mean_w * (1.0 + sigma * self._random.standard_normal())
        return CarrierPower(
            t_s=t_s, integration_s=integration_s, power_w=power_w, sigma_w=power_w * sigma,
            carrier_to_noise_db_hz=receiver.floor_db_hz,
        )  # fmt: skip


def _turned_over(feed: MonopulseFeedParams) -> MonopulseFeedParams:
    """Return the feed with both differences negated."""
    right, up = (phase - math.copysign(math.pi, phase) for phase in feed.difference_phase_rad)
    return feed.replace(difference_phase_rad=(right, up))
