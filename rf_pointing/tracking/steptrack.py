"""Step-track: four points around the target, any power meter, one pointing error per round.

The beam rests at right, above, left and below in turn; the powers measured there give the direction
by the exact Gaussian beam (ln P is linear in it).  The meter need not know its own noise: the
scatter of n samples around the fit sets the covariance, larger by nu / (nu - 2), nu = n - 3: the
mean square of Student's t, which a scatter known to nu degrees of freedom makes of the errors.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.core import MDEG, CarrierPower, Params, PointingError, Sensor, parameter
from rf_pointing.core.derived import BandNumbers, Rows, tuned
from rf_pointing.tracking.beam_fit import PowerWindow, beam_design, fit_beam
from rf_pointing.tracking.scan import ONCE_A_ROUND, LoopRate, Offset, Pattern

SMALLEST_SCATTER = 1e-12  # relative variance of a meter without noise; keeps the covariance positive
# Samples kept of one round, which may never end.
MOST_SAMPLES = 10000
# Step of a station's step-track in beamwidths: 0.08 dB of loss.
STEP = 0.08
# Right, above, left, below: each move leads to a neighbour, so it is short.
POINTS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


@dataclass(frozen=True, kw_only=True)
class StepTrackParams(Params):
    """Steps and dwell times."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", 1e-6, 1.4)
    step_beamwidths: float = parameter(0.2, "distance of the points from the centre", 0.02, 0.5)
    dwell_s: float = parameter(3.0, "time at rest on one point", 0.1, 600.0)
    move_s: float = parameter(1.5, "time from point to point", 0.05, 60.0)
    samples_per_point: int = parameter(2, "power samples needed on every point", 2, 1000)
    tolerance: float = parameter(0.2, "distance from the point, in steps, within which a sample counts", 0.01, 0.6)
    lock_db_hz: float = parameter(10.0, "smallest C/N0 of a sample that is used", 0.0, 120.0)
    valid_range_beamwidths: float = parameter(0.7, "largest error that is believed", 0.05, 2.0)

    @property
    def age_s(self) -> float:
        """How long before the end of a round its samples lie on average."""
        return 2.0 * (self.move_s + self.dwell_s)

    @property
    def loop(self) -> LoopRate:
        """How the tracking loop follows the rounds."""
        return ONCE_A_ROUND

    def pattern(self) -> Pattern:
        """Return the motion of the beam."""
        return StepTracker(self).offset

    @property
    def step_rad(self) -> float:
        """Distance of the points from the centre."""
        return self.step_beamwidths * self.half_power_beamwidth_rad


def steptrack_of_band(of: BandNumbers) -> Rows:
    """Return the rows of `StepTrackParams`; a move is a quintic over the diagonal of the square."""
    sample_s = of.power_period_s
    across = math.sqrt(2.0) * STEP * of.beamwidth_deg
    rate, acceleration = min(of.rates_deg_s), min(of.accelerations_deg_s2)
    move_s = max(0.6, 1.875 * across / (0.5 * rate), math.sqrt(5.7735 * across / acceleration))
    return {
        "half_power_beamwidth_deg": of.width,
        "step_beamwidths": tuned(STEP, "0.08 of a beamwidth: 0.08 dB"),
        "dwell_s": tuned(0.7 if sample_s <= 0.1 else 7.0 * sample_s, "seven samples"),
        "move_s": tuned(move_s, "0.6 s, longer where half the rate or the acceleration is reached"),
        "samples_per_point": tuned(5, "of seven"),
        "tolerance": tuned(0.5, "half a step"),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTrackState:
    """Samples of this round, how many on each point, and the rejections."""

    window: PowerWindow
    counts: tuple[int, ...] = (0, 0, 0, 0)
    rejected: int = 0
    last_rejection: str = ""


class StepTracker:
    """Collects power samples at rest; a full round gives one pointing error of the centre."""

    def __init__(self, params: StepTrackParams) -> None:
        self.params = params
        self.state = StepTrackState(window=PowerWindow.empty())

    def offset(self, t_since_start_s: float) -> Offset:
        """Return where the beam must be from the centre, and its rates; moves are quintic."""
        leg = self.params.move_s + self.params.dwell_s
        index, within = divmod(max(t_since_start_s, 0.0), leg)
        end = POINTS[int(index) % 4]
        start = POINTS[(int(index) - 1) % 4] if index >= 1.0 else (0.0, 0.0)
        s = min(within / self.params.move_s, 1.0)
        share = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        rate = 30.0 * s**2 * (1.0 - s) ** 2 / self.params.move_s
        step = self.params.step_rad
        x, y = (end[0] - start[0]) * step, (end[1] - start[1]) * step
        return Offset(start[0] * step + share * x, start[1] * step + share * y, rate * x, rate * y)

    def add(
        self, power: CarrierPower, beam_offset_cross_elevation_rad: float, beam_offset_elevation_rad: float
    ) -> PointingError | None:
        """Add one power; return the error of the centre when a round is complete."""
        point = self._place(power, beam_offset_cross_elevation_rad, beam_offset_elevation_rad)
        if isinstance(point, str):
            self.state = replace(self.state, rejected=self.state.rejected + 1, last_rejection=point)
            return None
        sample = (_middle_s(power), power.power_w, power.sigma_w, beam_offset_cross_elevation_rad,
                  beam_offset_elevation_rad, power.carrier_to_noise_db_hz)  # fmt: skip
        window = self.state.window.with_sample(sample, MOST_SAMPLES, -math.inf)
        counts = tuple(count + (index == point) for index, count in enumerate(self.state.counts))
        self.state = replace(self.state, window=window, counts=counts)
        if min(counts) < self.params.samples_per_point:
            return None
        self.reset()
        return self._measure(window)

    def reset(self) -> None:
        """Begin a new round, as after a correction."""
        self.state = replace(self.state, window=PowerWindow.empty(), counts=(0, 0, 0, 0))

    def _place(self, power: CarrierPower, x_rad: float, y_rad: float) -> int | str:
        """Return the point on which the beam rests, or why the sample does not count."""
        if not all(map(math.isfinite, (power.t_s, power.power_w, power.carrier_to_noise_db_hz, x_rad, y_rad))):
            return "power, time and beam offset must be finite"
        if power.power_w <= 0.0:
            return f"power_w={power.power_w} must be > 0"
        if power.sigma_w < 0.0:
            return f"sigma_w={power.sigma_w} must be >= 0"
        if len(self.state.window) and _middle_s(power) <= self.state.window.rows[-1, 0]:
            return f"t_s={power.t_s} must be later than that of the sample before"
        if power.carrier_to_noise_db_hz < self.params.lock_db_hz:
            level = power.carrier_to_noise_db_hz
            return f"no lock: C/N0 {level:.1f} dB-Hz is below {self.params.lock_db_hz:.1f} dB-Hz"
        step = self.params.step_rad
        distances = [math.hypot(x_rad / step - point[0], y_rad / step - point[1]) for point in POINTS]
        nearest = min(range(4), key=distances.__getitem__)
        if distances[nearest] > self.params.tolerance:
            return "the beam moves between two points"
        return nearest

    def _measure(self, window: PowerWindow) -> PointingError:
        h = self.params.half_power_beamwidth_rad
        design = beam_design(window.beam_rad, h)
        # First with a noise of unit size, whose misfit is the real size; then with that, which also
        # sets the bias.
        noise = np.full(len(window), float(np.mean(window.power_w)))
        try:
            scatter = max(float(fit_beam(design, window.power_w, noise).chi_squared), SMALLEST_SCATTER)
            found = fit_beam(design, window.power_w, noise * scatter)
        except np.linalg.LinAlgError:
            error, covariance = np.zeros(2), np.eye(2) * h**2
            least, most = float(np.min(window.power_w)), float(np.max(window.power_w))
            reason = f"power_w from {least:.3g} to {most:.3g} W in one round: a sample outweighs the others"
        else:
            # Two samples a point or more: five degrees of freedom at least.
            freedom = len(window) - 3
            error, limit = found.error_rad, self.params.valid_range_beamwidths
            covariance = found.covariance_rad2 * (freedom / (freedom - 2.0))
            beamwidths = float(np.hypot(error[0], error[1])) / h
            reason = "" if found.converged else "the fit did not converge"
            if beamwidths > limit:
                reason = f"error of {beamwidths:.2f} beamwidths is outside {limit:.2f} beamwidths"
        return PointingError(
            t_s=float(np.mean(window.t_s)), sensor=Sensor.STEPTRACK,
            cross_elevation_rad=float(error[0]), elevation_rad=float(error[1]),
            covariance_rad2=np.asarray(covariance),
            carrier_to_noise_db_hz=float(np.mean(window.carrier_to_noise_db_hz)), valid=not reason,
            reason=reason,
        )  # fmt: skip


def _middle_s(power: CarrierPower) -> float:
    return power.t_s - 0.5 * power.integration_s
