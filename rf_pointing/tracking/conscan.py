"""Conscan tracker: carrier powers and true beam positions in, pointing errors out.

The positions are where the beam really was (encoders at the samples' times), so the scan need be
neither uniform nor complete.  Any origin that moves with the target will do: the scan centre, or
the predicted direction.  `DelayEstimator` learns the delay between position and power.
"""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rf_pointing.core import CarrierPower, Params, PointingError, Sensor, parameter
from rf_pointing.tracking.beam_fit import PowerWindow
from rf_pointing.tracking.conscan_estimate import ConscanParams, estimate_window
from rf_pointing.tracking.response import ResponseSums

# The median of three: one bad sample among them does not decide.
FEWEST_WITNESSES = 3
# Faded count of pairs below which a response to the motion looks like the target's own.
FEWEST_PAIRS = 2.5
# By which the noise of a receiver may differ between the samples of a window, its power's own share
# included.
LARGEST_CHANGE = 1e4


@dataclass(frozen=True, slots=True, kw_only=True)
class ConscanState:
    """Samples of the running window, count and reason of rejected ones."""

    window: PowerWindow = field(default_factory=PowerWindow.empty)
    rejected: int = 0
    last_rejection: str = ""


class ConscanTracker:
    """Gives one pointing error per window, or one per sample once the window is full.

    With an estimate per sample the origin must not move with the corrections made (use the
    predicted direction), or `recentre` must follow every one.
    """

    def __init__(self, params: ConscanParams) -> None:
        self.params = params
        self.state = ConscanState()

    def beam_time_s(self, power: CarrierPower) -> float:
        """Return when the beam gave this power: mid-integration, less the delay of the chain."""
        return power.t_s - 0.5 * power.integration_s - self.params.delay_s

    def add(
        self, power: CarrierPower, beam_offset_cross_elevation_rad: float, beam_offset_elevation_rad: float
    ) -> PointingError | None:
        """Take one sample; return target minus origin when an estimate is due, else None.

        The offsets are where the beam was, relative to the origin, at `beam_time_s(power)`.  A
        sample that cannot be used is counted in `state` with its reason and changes nothing else.
        """
        fault = self._fault(power, beam_offset_cross_elevation_rad, beam_offset_elevation_rad)
        if fault:
            self.state = replace(self.state, rejected=self.state.rejected + 1, last_rejection=fault)
            return None
        t_s = self.beam_time_s(power)
        sample = (t_s, power.power_w, power.sigma_w, beam_offset_cross_elevation_rad, beam_offset_elevation_rad,
                  power.carrier_to_noise_db_hz)  # fmt: skip
        window = self.state.window.with_sample(sample, self.params.window_samples, t_s - self.params.max_age_s)
        sliding = self.params.updates == "sample"
        enough = min(self.params.fewest_samples, self.params.window_samples) if sliding else self.params.window_samples
        due = len(window) >= enough
        self.state = replace(self.state, window=PowerWindow.empty() if due and not sliding else window)
        return self._measure(window) if due else None

    def recentre(self, cross_elevation_rad: float, elevation_rad: float) -> None:
        """Move the origin by this much; the samples of the window stay usable."""
        self.state = replace(self.state, window=self.state.window.moved(cross_elevation_rad, elevation_rad))

    def retune(self, params: ConscanParams) -> None:
        """Take new parameters; the samples of the window stay only if their beam positions do."""
        if params.delay_s != self.params.delay_s:
            self.reset()
        self.params = params

    def reset(self) -> None:
        """Forget the samples of the running window, as after a long loss of the carrier."""
        self.state = replace(self.state, window=PowerWindow.empty())

    def _fault(self, power: CarrierPower, beam_cross_elevation_rad: float, beam_elevation_rad: float) -> str:
        values = (power.t_s, power.power_w, power.sigma_w, power.integration_s, power.carrier_to_noise_db_hz,
                  beam_cross_elevation_rad, beam_elevation_rad)  # fmt: skip
        if not all(map(math.isfinite, values)):
            return "power, time and beam offset must be finite"
        if power.power_w <= 0.0:
            return f"power_w={power.power_w} must be > 0"
        if power.sigma_w <= 0.0:
            return f"sigma_w={power.sigma_w} must be > 0"
        if not 0.0 < power.sigma_w * power.sigma_w / power.power_w < math.inf:
            return f"sigma_w={power.sigma_w} for power_w={power.power_w} is beyond what can be squared"
        if power.carrier_to_noise_db_hz < self.params.lock_db_hz:
            return f"no lock: C/N0 {power.carrier_to_noise_db_hz:.1f} dB-Hz is below {self.params.lock_db_hz:.1f} dB-Hz"
        offset = math.hypot(beam_cross_elevation_rad, beam_elevation_rad)
        if offset > 2.0 * self.params.half_power_beamwidth_rad:
            return f"beam offset {offset} rad must be <= {2.0 * self.params.half_power_beamwidth_rad}, two beamwidths"
        if len(self.state.window) and self.beam_time_s(power) <= self.state.window.rows.item(-1, 0):
            return f"t_s={power.t_s} must be later than that of the sample before"
        return self._unlike_the_others(power)

    def _unlike_the_others(self, power: CarrierPower) -> str:
        """Return why the sample cannot be of the receiver that gave the others."""
        # sigma^2 / power is 2 N0 / T (CONSCAN B-5), whatever the beam does.
        rows = self.state.window.rows
        if len(rows) < FEWEST_WITNESSES or rows.item(-1, 0) < self.beam_time_s(power) - self.params.max_age_s:
            return ""
        witnesses = (0, len(rows) // 2, -1)
        noise = power.sigma_w * power.sigma_w / power.power_w
        usual = sorted(rows.item(row, 2) ** 2 / rows.item(row, 1) for row in witnesses)
        if usual[1] <= LARGEST_CHANGE * noise and noise <= LARGEST_CHANGE * usual[1]:
            return ""
        return (
            f"sigma_w^2/power_w={noise:.3g} W must be within {LARGEST_CHANGE:.0f} times that of the samples before, "
            f"{usual[1]:.3g} W"
        )

    def _measure(self, window: PowerWindow) -> PointingError:
        found = estimate_window(self.params, window)
        if found.left_out is not None:
            self._leave_out(window, found.left_out)
        sums, right_up_rad = np.add.reduce(window.rows).tolist(), found.error_rad.tolist()
        return PointingError(
            t_s=sums[0] / len(window), sensor=Sensor.CONSCAN, cross_elevation_rad=right_up_rad[0],
            elevation_rad=right_up_rad[1], covariance_rad2=found.covariance_rad2,
            carrier_to_noise_db_hz=sums[5] / len(window), valid=not found.reason,
            reason=found.reason,
        )  # fmt: skip

    def _leave_out(self, window: PowerWindow, row: int) -> None:
        """Reject a sample that does not follow the beam as all others do."""
        # A separate window is spent already; only a sliding one keeps its other samples.
        power_w, level = window.power_w[row], window.carrier_to_noise_db_hz[row]
        kept = window.without(row) if len(self.state.window) else self.state.window
        fault = f"power_w={power_w:.3g} at C/N0 {level:.1f} dB-Hz does not follow the beam as the other samples do"
        self.state = ConscanState(window=kept, rejected=self.state.rejected + 1, last_rejection=fault)


@dataclass(frozen=True, kw_only=True)
class DelayParams(Params):
    """Scan period and memory of the estimate."""

    period_s: float = parameter(32.0, "time of one turn of the scan", 0.1, 3600.0)
    memory: float = parameter(0.95, "weight of the past at each new pair", 0.0, 1.0)
    largest_sigma_s: float = parameter(0.5, "uncertainty above which no delay is given", 1e-6, 600.0)


class DelayEstimate(NamedTuple):
    """Delay with its standard deviation; `gain` is 1 for a well known beamwidth."""

    delay_s: float
    sigma_s: float
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayState:
    """Sums so far, and the last estimate with its variance per axis.

    `scatter` is the sum of |change|^2 over the variance, `pairs` the number of pairs, both fading
    like `sums`.
    """

    sums: ResponseSums = ResponseSums()
    scatter: float = 0.0
    pairs: float = 0.0
    last: complex | None = None
    last_variance_rad2: float = 0.0


# A delay tau makes every estimate R(w tau) times the true error, w the scan's angular rate
# (counter-clockwise).  Moving the scan's origin by d must change the estimate by -d; it changes it
# by -R(w tau) d, so the phase of the response is w tau.
class DelayEstimator:
    """Learns the delay from separate estimates and the shifts of the origin between them."""

    def __init__(self, params: DelayParams) -> None:
        self.params = params
        self.state = DelayState()

    def add(self, error: PointingError, moved_cross_elevation_rad: float, moved_elevation_rad: float) -> None:
        """Add one estimate and the origin's shift since the last; invalid ones break the chain."""
        if not error.valid:
            self.state = replace(self.state, last=None)
            return
        now = complex(error.cross_elevation_rad, error.elevation_rad)
        variance = 0.5 * float(np.trace(error.covariance_rad2))
        sums, scatter, pairs = self.state.sums, self.state.scatter, self.state.pairs
        if self.state.last is not None:
            moved = complex(moved_cross_elevation_rad, moved_elevation_rad)
            change, spread = now - self.state.last, variance + self.state.last_variance_rad2
            memory = self.params.memory
            sums = sums.faded(memory).with_pair(moved, change, spread)
            scatter, pairs = memory * scatter + abs(change) ** 2 / spread, memory * pairs + 1.0
        self.state = DelayState(sums=sums, scatter=scatter, pairs=pairs, last=now, last_variance_rad2=variance)

    def estimate(self) -> DelayEstimate | None:
        """Return the delay within half a period, None while it is not known well enough.

        A target that moves by itself scatters the changes beyond their variance; the uncertainty
        grows by as much.
        """
        response, pairs = self.state.sums.estimate(), self.state.pairs
        if response is None or pairs < FEWEST_PAIRS:
            return None
        unexplained = self.state.scatter - abs(response.value) ** 2 * self.state.sums.weight
        excess = max(1.0, unexplained / (2.0 * (pairs - 1.0)))
        per_rad = self.params.period_s / (2.0 * math.pi)
        sigma_s = response.phase_sigma_rad * per_rad * math.sqrt(excess)
        if sigma_s > self.params.largest_sigma_s:
            return None
        return DelayEstimate(response.phase_rad * per_rad, sigma_s, abs(response.value))
