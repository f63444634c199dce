"""A ground station's Tripulse receiver: from a frame of samples to the satellite's line of sight.

Channels, coherent detection (two tones or the tracker), one complex value per beam, ratios, exact
inversion.  From 12 dB in the sum beam on it uses the ratios (9) with the variance (17); below, the
posterior that does not divide by the sum beam.

The ratios repeat every 2 lambda/(N d).  The level of the sum beam shows in which period the station
lies: with u = N d eps/lambda it is sin(pi u)/(pi u) of its peak, and |u|/(2 - |u|) of that one
period away.  Two tones: the level is taken against the reference tones, which pass the same space
and the same rain; interleaved: against the C/N0 of the link.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.tripulse.beams import (
    beam_signals,
    invert_ratios,
    invert_with_weights,
    monopulse_ratios,
    ratio_and_slope,
)
from rf_pointing.array_sensors.tripulse.channels import Channels, channelise, detect_with_references
from rf_pointing.array_sensors.tripulse.robust import posterior_projection_error, signal_matrix
from rf_pointing.array_sensors.tripulse.signal import (
    TripulseFrame,
    TripulseSignalParams,
    segment_beams,
    segment_times_s,
)
from rf_pointing.array_sensors.tripulse.tracker import TrackerParams, predict, start, update
from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class TripulseReceiverParams(Params):
    """Expectations of the receiver, and when it believes a frame."""

    largest_shift_hz: float = parameter(5e4, "largest frequency shift searched", low=1.0, high=1e8)
    # Below 12 dB the ratio is biased by the noise of the sum beam, and its variance has no finite
    # value.
    ratio_snr_min_db: float = parameter(
        12.0, "sum SNR from which the plain ratio is used", low=0.0, high=60.0
    )
    snr_min_db: float = parameter(3.0, "lowest sum SNR of a measurement", low=-30.0, high=60.0)
    # A third of the 0.1 deg that the paper gives the initial attitude sensor.
    prior_sigma: float = parameter(
        math.radians(0.1) / 3.0, "standard deviation of each initial projection", low=1e-9, high=1.0
    )
    # At 0.75 the level one period away is 4.4 dB lower: twice the tolerance and its noise.
    largest_error_fraction: float = parameter(
        0.75,
        "largest projection error believed, as a fraction of lambda/(N d)",
        low=0.01,
        high=0.99,
    )
    element_carrier_to_noise_db_hz: float = parameter(
        37.0, "nominal C/N0 of one array element", low=-20.0, high=120.0
    )
    reference_carrier_to_noise_db_hz: float = parameter(
        80.0, "nominal C/N0 of each reference tone", low=-20.0, high=160.0
    )
    level_tolerance_db: float = parameter(
        2.0,
        "largest difference between the level of the sum beam and the nominal one",
        low=0.1,
        high=10.0,
    )

    def check_together(self) -> None:
        """Refuse a range of errors over which the level does not tell one period from the next."""
        fraction = self.largest_error_fraction
        step_db = 20.0 * math.log10((2.0 - fraction) / fraction)
        if step_db < 2.0 * self.level_tolerance_db:
            raise ValueError(
                f"level_tolerance_db={self.level_tolerance_db} must be <= {0.5 * step_db:.3g}, half the step to the "
                f"next period at largest_error_fraction={fraction}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class TripulseMeasurement:
    """Projections (2,) of the station's direction on the array axes, with covariance (2, 2), at
    `t_s`.

    An invalid measurement carries its reason, and the steering with the prior's covariance, so that
    it adds nothing. `estimator` is "ratio" or "posterior"; `sum_snr_db` that of the coherent sum of
    a frame's sum segments.
    """

    t_s: float
    station: str
    sequence: int
    projections: Array
    covariance: Array
    sum_snr_db: float
    shift_hz: float
    estimator: str
    valid: bool
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Detected:
    """Segments (n,) with the phase taken out, noise variance of one segment, and the reason of a
    lost lock.
    """

    values: ComplexArray
    noise_variance: float
    lost: str


@dataclass(frozen=True, kw_only=True)
class TripulseReceiver:
    """Stateless: every frame is acquired anew, so that a lost frame or a lost lock costs nothing
    later.

    `failed` marks elements that the satellite reports as dead, besides those of `array`; their
    effect is then inverted exactly.
    """

    array: TripulseArrayParams
    signal: TripulseSignalParams
    params: TripulseReceiverParams = field(default_factory=TripulseReceiverParams)
    tracker: TrackerParams = field(default_factory=TrackerParams)
    failed: NDArray[np.bool_] | None = None

    def measure(self, frame: TripulseFrame) -> TripulseMeasurement:
        """Return the line of sight of one frame.

        Raises
        ------
        ValueError : if the frame has the wrong length or holds values that are not finite.
        """
        channels = channelise(self.signal, frame.samples, self.params.largest_shift_hz)
        found = self._detect(channels)
        beams, noises = self._beam_means(found)
        # The measured power holds the noise too: hence minus one; floored, since a logarithm
        # follows.
        snr = max(abs(beams[0]) ** 2 / noises[0] - 1.0, 1e-6)
        # Checked before the SNR: after a slip the ratio may have either sign, at any power.
        if found.lost:
            return self._invalid(frame, channels, snr, found.lost)
        snr_db = 10.0 * math.log10(snr)
        if snr_db < self.params.snr_min_db:
            return self._invalid(
                frame, channels, snr, f"sum SNR {snr_db} dB must be >= {self.params.snr_min_db} dB"
            )
        try:
            return self._estimate(frame, channels, found, beams, noises, snr_db)
        # Estimators refuse in words; the frame stays on the wire as an invalid measurement with
        # that reason.
        except ValueError as refused:
            return self._invalid(frame, channels, snr, str(refused))

    def _estimate(
        self,
        frame: TripulseFrame,
        channels: Channels,
        found: _Detected,
        beams: ComplexArray,
        noises: Array,
        snr_db: float,
    ) -> TripulseMeasurement:
        if snr_db >= self.params.ratio_snr_min_db:
            estimator = "ratio"
            error, covariance = self._from_ratio(frame.steering, beams, noises)
        else:
            estimator = "posterior"
            error, covariance = self._from_posterior(found, beams, noises)
        fraction = float(np.max(np.abs(error) / self.array.unambiguous_projection))
        if fraction > self.params.largest_error_fraction:
            raise ValueError(
                f"projection error {error} is {fraction} of the unambiguous lambda/(N d), must be <= "
                f"{self.params.largest_error_fraction}: the beam may be a lobe away"
            )
        self._require_level(frame.steering, error, self._level(channels, beams[0], snr_db), snr_db)
        projections = frame.steering + error
        if math.hypot(float(projections[0]), float(projections[1])) >= 1.0:
            raise ValueError(f"projections={projections} are longer than one: not a direction")
        return TripulseMeasurement(
            t_s=frame.t_s,
            station=frame.station,
            sequence=frame.sequence,
            projections=projections,
            covariance=covariance,
            sum_snr_db=snr_db,
            shift_hz=channels.shift_hz,
            estimator=estimator,
            valid=True,
            reason="",
        )

    def _level(self, channels: Channels, total: complex, snr_db: float) -> float:
        """Return the amplitude of the sum beam in units of one nominal element."""
        link = self.params
        if self.signal.scheme == "interleaved":
            sum_db_hz = snr_db - 10.0 * math.log10(self.signal.beam_time_s(0))
            return math.pow(10.0, (sum_db_hz - link.element_carrier_to_noise_db_hz) / 20.0)
        lower, upper = np.abs(channels.lower_reference), np.abs(channels.upper_reference)
        reference = math.sqrt(float(np.median(lower) * np.median(upper)))
        nominal_db = link.element_carrier_to_noise_db_hz - link.reference_carrier_to_noise_db_hz
        return abs(total) / reference * math.pow(10.0, -nominal_db / 20.0)

    def _require_level(self, steering: Array, error: Array, level: float, snr_db: float) -> None:
        """Raise ValueError unless the sum beam has the level that it has at `error`."""
        weights = element_weights(self.array, steering, failed=self.failed)
        expected = abs(complex(beam_signals(self.array, weights, steering + error)[0]))
        gap_db = 20.0 * math.log10(level / expected)
        # Three sigmas of the amplitude's own noise, in dB.
        noise_db = 3.0 * 20.0 / math.log(10.0) * math.sqrt(0.5 * 10.0 ** (-snr_db / 10.0))
        allowed_db = self.params.level_tolerance_db + noise_db
        if abs(gap_db) > allowed_db:
            cause = (
                "the nominal level is wrong"
                if gap_db > 0.0
                else "the station may be in another lobe"
            )
            raise ValueError(
                f"ambiguous: the sum beam is {gap_db:.3g} dB from its nominal level at this direction, must be within "
                f"{allowed_db:.3g} dB: {cause}"
            )

    def _detect(self, channels: Channels) -> _Detected:
        noise_variance = channels.noise_density / self.signal.segment_s
        if self.signal.scheme == "interleaved":
            return self._track(channels.tone, noise_variance)
        values, lost = detect_with_references(
            channels.tone, channels.lower_reference, channels.upper_reference, noise_variance
        )
        return _Detected(values=values, noise_variance=noise_variance, lost=lost)

    def _track(self, tone: ComplexArray, noise_variance: float) -> _Detected:
        """Follow the sum segments and divide every later segment by the phase predicted for it."""
        beams, times = segment_beams(self.signal), segment_times_s(self.signal)
        first = int(np.argmax(beams == 0))
        state = start(self.tracker, float(times[first]), complex(tone[first]), noise_variance)
        values = tone * np.exp(-1j * state.estimate[1])
        for index in range(first + 1, len(tone)):
            state = predict(self.tracker, state, float(times[index]))
            # A segment is turned by the phase predicted before it is used itself: it must not
            # correct its own reference.
            values[index] = tone[index] * np.exp(-1j * state.estimate[1])
            if beams[index] == 0:
                state = update(self.tracker, state, complex(tone[index]), noise_variance)
                if state.lost:
                    break
        return _Detected(values=values, noise_variance=noise_variance, lost=state.lost)

    def _beam_means(self, found: _Detected) -> tuple[ComplexArray, Array]:
        beams = segment_beams(self.signal)
        counts = np.array([np.sum(beams == beam) for beam in range(3)])
        means = np.array([np.mean(found.values[beams == beam]) for beam in range(3)])
        return means, found.noise_variance / counts

    def _from_ratio(
        self, steering: Array, beams: ComplexArray, noises: Array
    ) -> tuple[Array, Array]:
        # The receiver counts exp(+j w t): with the paper's convention every error would have the
        # wrong sign.
        ratios = monopulse_ratios(beams, "exp(+jwt)")
        weights = element_weights(self.array, steering, failed=self.failed)
        if self._is_uniform:
            error = invert_ratios(self.array, ratios)
        else:
            error = invert_with_weights(self.array, weights, steering, ratios)
        _, slope = ratio_and_slope(self.array, weights, steering + error)
        sum_noise, *delta_noises = noises / abs(beams[0]) ** 2
        # (17) with unequal noise; the noise of the sum beam is common to both ratios.
        covariance = 0.5 * (sum_noise + 2.0 * sum_noise**2) * np.outer(ratios, ratios)
        covariance = covariance + 0.5 * (1.0 + sum_noise) * np.diag(delta_noises)
        inverse = np.linalg.inv(slope)
        return error, inverse @ covariance @ inverse.T

    def _from_posterior(
        self, found: _Detected, beams: ComplexArray, noises: Array
    ) -> tuple[Array, Array]:
        if not self._is_uniform:
            raise ValueError(
                f"sum SNR is below {self.params.ratio_snr_min_db} dB: too low for a non-uniform aperture"
            )
        signals, variances = beams[None, :], noises
        if self.signal.scheme == "interleaved":
            signals, variances = self._cycle_means(found)
        # The estimators below 12 dB use the paper's time convention: hence the conjugate.
        matrix = signal_matrix(signals.conj(), variances)
        prior = np.full(2, self.params.prior_sigma)
        posterior = posterior_projection_error(self.array, matrix, len(signals), variances, prior)
        return posterior.projection_error, posterior.covariance

    def _cycle_means(self, found: _Detected) -> tuple[ComplexArray, Array]:
        pattern = segment_beams(self.signal)[: len(self.signal.pattern)]
        cycles = found.values.reshape(self.signal.cycles, len(pattern))
        means = np.stack(
            [np.mean(cycles[:, pattern == beam], axis=1) for beam in range(3)], axis=-1
        )
        return means, found.noise_variance / np.array(
            [np.sum(pattern == beam) for beam in range(3)]
        )

    @property
    def _is_uniform(self) -> bool:
        dead = self.failed is not None or bool(self.array.failed.strip())
        return not dead and self.array.taper_edge == 1.0 and self.array.phase_bits == 0

    def _invalid(
        self, frame: TripulseFrame, channels: Channels, snr: float, reason: str
    ) -> TripulseMeasurement:
        return TripulseMeasurement(
            t_s=frame.t_s,
            station=frame.station,
            sequence=frame.sequence,
            projections=frame.steering,
            # The prior's covariance: a consumer that overlooks `valid` gains nothing from this
            # measurement.
            covariance=self.params.prior_sigma**2 * np.eye(2),
            sum_snr_db=10.0 * math.log10(snr),
            shift_hz=channels.shift_hz,
            estimator="none",
            valid=False,
            reason=reason,
        )
