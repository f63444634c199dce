"""Detects within 2 s that monopulse follows a wrong null: flipped sign, turned phase, sidelobe.

* Signs and phases: what the beam does and what the error does about it, weighed as evidence.
* Steepness: over a sliding window the error is regressed on the beam by the encoders, e = e0 - G d
  (`ResponseSums`): G is 1 if right, -1 if the sign is flipped.
* Level: on a sidelobe the C/N0 is far below the link's while the error is small.  Once a search has
  learned what the link really gives, that counts.
"""

import cmath
import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rf_pointing.core import MDEG, Array, ComplexArray, Params, PointingError, parameter
from rf_pointing.tracking.response import ResponseEstimate, ResponseSums
from rf_pointing.tracking.scan import ScanParams

LARGEST_PROBE_BEAMWIDTHS = 0.1
# Between two errors; after a longer one everything begins again.
LONGEST_GAP_S = 1.0
# For so long its velocity has changed when a target that wanders is first seen.
SETTLED_S = 1.0
# A response turned by 120 deg explains the errors better than the right one from 60 deg on.
TURN = cmath.exp(2j * math.pi / 3.0)
SIDELOBE = "sidelobe: "
SIGN_FLIP = "sign flip: the error grows while it is corrected, in {}"


@dataclass(frozen=True, kw_only=True)
class LockWatchParams(Params):
    """Errors of a right lock, its probe, and how sure a verdict must be."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", 1e-6, 1.4)
    evidence: float = parameter(8.0, "logarithm of the likelihood ratio from which a lock is a false one", 2.0, 100.0)
    fade_s: float = parameter(30.0, "time in which evidence fades", 0.1, 3600.0)
    gust_rad: tuple[float, ...] = parameter(
        (0.1 * MDEG, 0.2 * MDEG, 0.4 * MDEG, 0.8 * MDEG),
        "strengths of gusts: motion of the beam in 1 s that the encoders do not see, rms per axis", 1e-9, 0.1,
    )  # fmt: skip
    vibration_rad: tuple[float, ...] = parameter(
        (0.0, 0.2 * MDEG, 0.6 * MDEG), "strengths of such motion from one cluster to the next", 0.0, 0.1
    )
    weather_s: float = parameter(10.0, "time for which gusts and vibration keep their strength", 0.1, 3600.0)
    drift_rad_s: float = parameter(0.5 * MDEG, "velocity of the target against the prediction, rms per axis", 1e-9, 0.1)
    drift_change_rad_s: tuple[float, ...] = parameter(
        (0.05 * MDEG, 4.0 * MDEG),
        "strengths of the change of that velocity in 1 s, rms: mostly the first, the others while lags of the mount settle",
        1e-9, 0.1,
    )  # fmt: skip
    settling_share: float = parameter(0.01, "share of the time of each of those others", 1e-6, 0.5)
    probe_rad: float = parameter(0.0, "radius of the circle of the beam while monopulse tracks, 0: none", 0.0, 0.01)
    probe_period_s: float = parameter(1.0, "time of one turn of that circle", 0.4, 60.0)
    probe_ramp_s: float = parameter(1.0, "time over which its radius grows from zero", 0.1, 60.0)
    window_s: float = parameter(2.0, "time over which the steepness is measured", 0.1, 60.0)
    unmodelled_beamwidths: float = parameter(
        0.03, "motion of the beam that the encoders do not see, for the steepness", 0.0, 0.5
    )
    sigmas: float = parameter(4.0, "certainty of the steepness in standard deviations", 1.0, 10.0)
    steepest: float = parameter(2.0, "response above which it is a sidelobe", 1.1, 10.0)
    compares_level: bool = parameter(
        True, "whether the receiver's C/N0 is on the link's scale; false for a total power without its noise"
    )
    level_clusters: int = parameter(3, "clusters in a row for which it must be", 1, 100)
    level_drop_db: float = parameter(10.0, "C/N0 below the link's that is a sidelobe", 3.0, 30.0)

    def check_together(self) -> None:
        """Refuse a watch that knows no weather, and a probe that leaves the middle of the beam."""
        for name in ("gust_rad", "vibration_rad", "drift_change_rad_s"):
            if not getattr(self, name):
                raise ValueError(f"{name} has 0 strengths, must have at least 1")
        largest_rad = LARGEST_PROBE_BEAMWIDTHS * self.half_power_beamwidth_rad
        if self.probe_rad > largest_rad:
            raise ValueError(
                f"probe_rad={self.probe_rad} must be <= {largest_rad}, {LARGEST_PROBE_BEAMWIDTHS} half_power_beamwidth_rad"
            )

    @property
    def probe(self) -> ScanParams | None:
        """The circle to command while monopulse tracks, None for none."""
        if self.probe_rad == 0.0:
            return None
        return ScanParams(radius_rad=self.probe_rad, period_s=self.probe_period_s, ramp_s=self.probe_ramp_s)


# Innovations under a Kalman filter of the target's motion, target = beam + error.  Against the
# prediction the target's velocity changes slowly (acceleration noise), the wind moves the beam
# unseen by the encoders (random walk of strength q), receiver and vibration add white noise R.  For
# every response of unit size the gains are the same, so the filter runs on beam and error apart.
# Whatever the loop made of earlier errors, their innovations are white.  Nobody knows how strong
# wind and vibration are: a bank of filters tries several.
@dataclass(frozen=True, slots=True, kw_only=True)
class InnovationBank:
    """Filters: position and velocity (2, n) of beam and error, covariance per axis (3, n)."""

    t_s: float
    position_rad: ComplexArray
    velocity_rad_s: ComplexArray
    covariance: Array

    @classmethod
    def begin(
        cls, t_s: float, beam_rad: complex, error_rad: complex, noise_rad2: Array, velocity_rad_s: Array | float
    ) -> "InnovationBank":
        """Return filters after a first measurement with R (n,) and a velocity known to 1 sigma."""
        start = np.repeat(np.array([[beam_rad], [error_rad]]), len(noise_rad2), axis=1)
        still = np.zeros_like(noise_rad2)
        covariance = np.array([noise_rad2, still, still + velocity_rad_s**2])
        return cls(t_s=t_s, position_rad=start, velocity_rad_s=np.zeros_like(start), covariance=covariance)

    def step(
        self, t_s: float, beam_rad: complex, error_rad: complex, noise_rad2: Array, walk: Array,
        acceleration: Array | float,
    ) -> tuple["InnovationBank", ComplexArray, Array]:  # fmt: skip
        """Return the bank after a later measurement, and what was new in it.

        New in beam and error (2, n), cross-elevation + j elevation; variance (n,) per axis.
        `noise_rad2` (n,) is R per axis, `walk` (n,) q in rad/sqrt(s), `acceleration` (n,) or one
        for all the density of the noise that changes the velocity, rad/s^1.5.
        """
        dt, power = t_s - self.t_s, acceleration**2
        position, mixed, speed = self.covariance
        position = position + dt * (2.0 * mixed + dt * speed + walk**2 + power * dt**2 / 3.0)
        mixed = mixed + dt * (speed + 0.5 * power * dt)
        variance = position + noise_rad2
        gain, rate_gain = position / variance, mixed / variance
        expected = self.position_rad + dt * self.velocity_rad_s
        new = np.array([[beam_rad], [error_rad]]) - expected
        covariance = np.array([(1.0 - gain) * position, (1.0 - gain) * mixed, speed + dt * power - rate_gain * mixed])
        velocity = self.velocity_rad_s + rate_gain * new
        bank = InnovationBank(
            t_s=t_s, position_rad=expected + gain * new, velocity_rad_s=velocity, covariance=covariance
        )
        return bank, new, variance


class Response(NamedTuple):
    """A motion b changes the error by -(direct b + mirrored b*); `fault` is what is wrong."""

    direct: complex
    mirrored: complex
    fault: str


# The right one first; all of unit size, so that one filter serves them all.
RESPONSES = (
    Response(1.0, 0.0, ""),
    Response(0.0, -1.0, SIGN_FLIP.format("cross-elevation")),
    Response(0.0, 1.0, SIGN_FLIP.format("elevation")),
    Response(-1.0, 0.0, SIGN_FLIP.format("both axes")),
    Response(TURN, 0.0, "phase: the error is turned by more than 60 deg"),
    Response(TURN.conjugate(), 0.0, "phase: the error is turned by more than -60 deg"),
)
DIRECT = np.array([[response.direct] for response in RESPONSES])
MIRRORED = np.array([[response.mirrored] for response in RESPONSES])


@dataclass(frozen=True, slots=True, kw_only=True)
class LockWatchState:
    """State of the watch.

    Filters; probability of each weather under each response, and evidence for each response; rows
    of time, error, beam, variance per axis; low clusters in a row.
    """

    bank: InnovationBank | None = None
    weather: tuple[tuple[float, ...], ...] = ()
    sums: tuple[float, ...] = (0.0,) * len(RESPONSES)
    rows: tuple[tuple[float, complex, complex, float], ...] = ()
    low_clusters: int = 0


# A beam that does b beyond expectation changes the error by -b if the sensor is right, by something
# else in a false lock.  Each false response is compared with the right one by the logarithm of the
# likelihood ratio, summed from cluster to cluster and never below zero (E. S. Page, Continuous
# Inspection Schemes, Biometrika 41, 1954): while the response is right and the model holds, a sum
# passes x at most once in e^x clusters on average.  Each response keeps its own probabilities of
# every weather, so gusts that look like a flip in calm air do not once they have been learned.
class LockWatch:
    """Collects errors and beam positions; `add` returns the fault, or "" without one."""

    def __init__(self, params: LockWatchParams) -> None:
        self.params = params
        self.state = LockWatchState()
        weathers = itertools.product(params.gust_rad, params.vibration_rad, params.drift_change_rad_s)
        self._walk, self._shake, self._wander = np.array(list(weathers)).T
        usual = np.where(self._wander == params.drift_change_rad_s[0], 1.0, params.settling_share)
        self._usual = usual / usual.sum()
        self._drift = np.maximum(params.drift_rad_s, self._wander * SETTLED_S)

    def add(
        self, error: PointingError, beam_cross_elevation_rad: float, beam_elevation_rad: float,
        expected_carrier_to_noise_db_hz: float | None = None,
    ) -> str:  # fmt: skip
        """Add an error and the beam's offset from the prediction then; return why it is false."""
        if not error.valid:
            return ""
        sensed = complex(error.cross_elevation_rad, error.elevation_rad)
        beam = complex(beam_cross_elevation_rad, beam_elevation_rad)
        (right, _), (_, up) = error.covariance_rad2.tolist()
        noise = 0.5 * (right + up)
        floor = self.params.unmodelled_beamwidths * self.params.half_power_beamwidth_rad
        oldest = error.t_s - self.params.window_s
        level_fault = self._level_fault(error, sensed, expected_carrier_to_noise_db_hz)
        low = self.state.low_clusters + 1 if level_fault else 0
        recent = [row for row in self.state.rows if oldest <= row[0] < error.t_s]
        rows = (*recent, (error.t_s, sensed, beam, noise + floor**2))
        bank, weather, sums = self._weigh(error.t_s, sensed, beam, noise)
        self.state = LockWatchState(bank=bank, weather=weather, sums=sums, rows=rows, low_clusters=low)
        # A carrier that comes or goes within a cluster is not a sidelobe.
        if low >= self.params.level_clusters:
            return level_fault
        likeliest = int(np.argmax(self.state.sums))
        if self.state.sums[likeliest] >= self.params.evidence:
            return RESPONSES[likeliest].fault
        return self._steepness_fault()

    def reset(self) -> None:
        """Forget everything, as after a change of sensor or a new calibration."""
        self.state = LockWatchState()

    def response(self) -> ResponseEstimate | None:
        """Return the response over the window, None while the beam has not moved."""
        rows = self.state.rows
        if len(rows) < 3:
            return None
        weights = [1.0 / row[3] for row in rows]
        total = sum(weights)
        mean_beam = sum([w * row[2] for w, row in zip(weights, rows, strict=True)]) / total
        # About the mean of the beam the mean of the errors has no part in the sums.
        return ResponseSums.of([(beam - mean_beam, sensed, variance) for _, sensed, beam, variance in rows]).estimate()

    def _weigh(
        self, t_s: float, error_rad: complex, beam_rad: complex, noise_rad2: float
    ) -> tuple[InnovationBank, tuple[tuple[float, ...], ...], tuple[float, ...]]:
        """Return bank, weather and evidence after one more error and beam.

        Both are cross-elevation + j elevation.
        """
        params, state = self.params, self.state
        noise = noise_rad2 + self._shake**2
        if state.bank is None or not 0.0 < t_s - state.bank.t_s <= LONGEST_GAP_S:
            bank = InnovationBank.begin(t_s, beam_rad, error_rad, noise, self._drift)
            weather = (tuple(self._usual.tolist()),) * len(RESPONSES)
            return bank, weather, LockWatchState().sums
        gap_s = t_s - state.bank.t_s
        bank, (beam, error), variance = state.bank.step(t_s, beam_rad, error_rad, noise, self._walk, self._wander)
        # Log likelihood of the measurement per response (rows) and weather (columns).
        left = error + DIRECT * beam + MIRRORED * np.conj(beam)
        joint = np.log(state.weather) + (-0.5 * np.abs(left) ** 2 / variance - np.log(variance))
        explained = np.logaddexp.reduce(joint, axis=1)
        stays = math.exp(-gap_s / params.weather_s)
        known = stays * np.exp(joint - explained[:, None]) + (1.0 - stays) * self._usual
        # No single cluster decides.
        says = np.minimum(explained - explained[0], params.evidence / 3.0)
        sums = np.maximum(0.0, math.exp(-gap_s / params.fade_s) * np.array(state.sums) + says)
        weather = tuple(map(tuple, known.tolist()))
        return bank, weather, tuple(sums.tolist())

    def _level_fault(self, error: PointingError, sensed: complex, expected_db_hz: float | None) -> str:
        if expected_db_hz is None or abs(sensed) > 0.3 * self.params.half_power_beamwidth_rad:
            return ""
        drop = expected_db_hz - error.carrier_to_noise_db_hz
        if drop > self.params.level_drop_db:
            return f"{SIDELOBE}C/N0 is {drop:.1f} dB below the link's with a small error"
        return ""

    def _steepness_fault(self) -> str:
        # The false null of a sidelobe is several times as steep as the main beam's, G = 1.
        found = self.response()
        if found is None or abs(found.value) - self.params.sigmas * found.sigma <= self.params.steepest:
            return ""
        return f"{SIDELOBE}the error changes {abs(found.value):.1f} times as fast as the beam moves"
