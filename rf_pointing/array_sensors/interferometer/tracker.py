"""Tracker of the relative pose: acquires without prior knowledge, tracks, coasts, starts anew.

A reading is rejected, with its reason, when

* loops lost lock or have less than 10 dB,
* a lane decision was arbitrary, or is further from a whole number than its sigma allows,
* repeated phases disagree,
* ranges and couplings contradict each other (wrong lane of a path),
* without a prediction, the links are too weak for every lane, or their power is that of another
  range (wrong lane of all paths),
* they contradict the prediction (wrong lane of all paths, or a manoeuvre).

A rejected reading changes nothing.  The pose coasts on its rates with growing covariance until the
coasting limit; then the tracker drops it and acquires anew.  After a reading that is sound in
itself but contradicts the prediction one of the two is wrong: no pose is given until one is
accepted.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from rf_pointing.array_sensors.interferometer.initializer import Geometry, geometry_from_pose
from rf_pointing.array_sensors.interferometer.measurement import InterferometerMeasurement
from rf_pointing.array_sensors.interferometer.measurement_model import (
    TrackedMotion,
    cartesian_covariance,
    expected_path_accelerations_m_s2,
    expected_path_rates_m_s,
)
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.interferometer.radio import (
    LOWEST_SNR,
    LinkParams,
    RadioParams,
    link_snr,
)
from rf_pointing.array_sensors.interferometer.rate_filter import (
    FilterParams,
    FilterState,
    predict,
    start,
    update,
)
from rf_pointing.array_sensors.interferometer.reading import (
    ErrorFloor,
    PathMotion,
    Reading,
    read_ranges,
)
from rf_pointing.array_sensors.interferometer.sequence import SequenceParams
from rf_pointing.array_sensors.interferometer.snapshot import (
    Snapshot,
    chi_square_limit,
    coarse_geometry,
    refine,
)
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array

ACQUIRING, TRACKING, COASTING = "acquiring", "tracking", "coasting"


@dataclass(frozen=True, kw_only=True)
class TrackerParams(Params):
    """Gates and limits of the tracker."""

    # Noise moves a lane by far less when the power is right; 0.5 would accept every decision.
    lane_guard: float = parameter(
        0.35, "largest distance of a lane from a whole number", low=0.05, high=0.5
    )
    visit_agreement: float = parameter(
        0.7, "smallest resultant of repeated phases", low=0.0, high=1.0
    )
    # Five sigma of the decision below half a lane: a wrong one is as rare as that.
    widest_lane_sigma: float = parameter(
        0.1, "largest sigma of a lane at acquisition", low=0.01, high=0.5
    )
    # A lane error of the two coarsest steps at short range is 20 dB; antenna patterns are a few.
    level_tolerance_db: float = parameter(
        6.0,
        "largest difference of the power from that of the range at acquisition",
        low=0.5,
        high=60.0,
    )
    # A wrong lane is hundreds of sigma: the gate can be wide and never reject a sound reading.
    gate_sigma: float = parameter(5.0, "residual gates, in normal deviates", low=1.0, high=20.0)
    coast_limit_s: float = parameter(
        20.0, "longest time without an accepted reading", low=0.1, high=1e4
    )
    # Five sequences, some ten seconds: a short interference must not end a docking.
    most_rejected: int = parameter(
        5, "readings refused in a row before acquiring anew", low=1, high=1000
    )
    # At grazing directions s_x is the root of a small difference of noisy squares.
    widest_angle_rad: float = parameter(
        1.4, "largest angle off boresight of either array", low=0.1, high=1.55
    )
    acquisition_iterations: int = parameter(
        8, "passes of the sequence without prior", low=2, high=50
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseEstimate:
    """Relative motion and its covariance (12, 12).

    Position, velocity, rotation vector, angular rate.  Position and velocity in the active frame,
    rotation vector (of A) and rate in the passive frame.
    """

    t_s: float
    motion: RelativeMotion
    covariance: Array
    excitation: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerOutput:
    """Status acquiring, tracking or coasting.

    The reason whenever the reading was refused; the pose if there is one.
    """

    t_s: float
    status: str
    reason: str
    estimate: PoseEstimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerState:
    """Complete state: the filter (None while acquiring), time of the last accepted reading,
    rejections in a row, whether one of them contradicted the prediction.
    """

    filter: FilterState | None = None
    accepted_t_s: float = 0.0
    rejected: int = 0
    doubted: bool = False


class _ContradictionError(ValueError):
    """A sound reading that the prediction excludes."""


@dataclass(frozen=True, kw_only=True)
class InterferometerTracker:
    """Pure function of state and measurement: `step` returns the next state and what to publish."""

    system: InterferometerSystem = field(default_factory=InterferometerSystem)
    params: TrackerParams = field(default_factory=TrackerParams)
    filter_params: FilterParams = field(default_factory=FilterParams)
    floor: ErrorFloor = field(default_factory=ErrorFloor)
    radio: RadioParams = field(default_factory=RadioParams)
    link: LinkParams = field(default_factory=LinkParams)

    def step(
        self, state: TrackerState, measurement: InterferometerMeasurement
    ) -> tuple[TrackerState, TrackerOutput]:
        """Return the state after `measurement` and the output at its epoch."""
        if state.filter is not None and measurement.t_s <= state.filter.t_s:
            reason = f"t_s={measurement.t_s} must be > the last epoch {state.filter.t_s}"
            return state, self._output(state.filter, COASTING, reason)
        predicted = (
            None
            if state.filter is None
            else predict(state.filter, measurement.t_s, self.filter_params)
        )
        try:
            accepted = self._accepted(predicted, measurement)
        except ValueError as reason:
            if isinstance(reason, _ContradictionError):
                state = replace(state, doubted=True)
            return self._refused(state, predicted, measurement.t_s, str(reason))
        after = TrackerState(filter=accepted, accepted_t_s=measurement.t_s, rejected=0)
        return after, self._output(accepted, TRACKING, "")

    def coast(
        self, state: TrackerState, t_s: float, reason: str
    ) -> tuple[TrackerState, TrackerOutput]:
        """Return the state and output at `t_s` when no measurement came, or none that could be
        read.
        """
        if state.filter is not None and t_s < state.filter.t_s:
            raise ValueError(f"t_s={t_s} must be >= the last epoch {state.filter.t_s}")
        predicted = None if state.filter is None else predict(state.filter, t_s, self.filter_params)
        return self._refused(state, predicted, t_s, reason)

    def _accepted(
        self, predicted: FilterState | None, measurement: InterferometerMeasurement
    ) -> FilterState:
        self._check_loops(measurement)
        reading = self._reading(predicted, measurement)
        snapshot = self._snapshot(reading, predicted)
        if predicted is None:
            self._check_level(measurement, snapshot)
            # The first reading both starts and updates the filter: the inflated start leaves the
            # weight to the update.
            prior = start(measurement.t_s, snapshot, reading, self.filter_params)
            return update(prior, reading, self.system).state
        return self._corrected(predicted, reading, snapshot)

    def _reading(
        self, predicted: FilterState | None, measurement: InterferometerMeasurement
    ) -> Reading:
        # Predicted path rates resolve cycles at lower power; after a manoeuvre only the measured
        # ones are right.
        if predicted is not None:
            expected = PathMotion(
                rates_m_s=expected_path_rates_m_s(predicted.tracked, self.system),
                accelerations_m_s2=expected_path_accelerations_m_s2(predicted.tracked, self.system),
            )
            reading = read_ranges(measurement, self.system, self.floor, expected)
            if not self._doubt(reading):
                return reading
        reading = read_ranges(measurement, self.system, self.floor)
        if doubt := self._doubt(reading):
            raise ValueError(doubt)
        if predicted is None and reading.lane_sigma > self.params.widest_lane_sigma:
            raise ValueError(
                f"links too weak: a lane has sigma {reading.lane_sigma:.3g}, must be <= "
                f"{self.params.widest_lane_sigma} without a prediction"
            )
        if reading.lane_margin < self.params.gate_sigma:
            raise ValueError(
                f"links too weak: at another acceleration other lanes are only {reading.lane_margin:.3g} sigma "
                f"worse, must be >= {self.params.gate_sigma}"
            )
        return reading

    def _check_level(self, measurement: InterferometerMeasurement, snapshot: Snapshot) -> None:
        range_m = float(np.linalg.norm(snapshot.tracked.motion.position_m))
        carriers = self.system.schedule.carriers(self.system.plan)
        links = (
            (
                "forward",
                self.radio.forward_power_w,
                self.system.plan.forward_carriers_hz,
                measurement.snr_forward,
            ),
            (
                "return",
                self.radio.return_power_w,
                self.system.plan.return_carriers_hz,
                measurement.snr_return,
            ),
        )
        for name, power_w, carriers_hz, snr in links:
            expected = np.mean(link_snr(power_w, range_m, carriers_hz[carriers], self.link))
            over_db = 10.0 * float(np.log10(np.mean(snr) / expected))
            if abs(over_db) > self.params.level_tolerance_db:
                raise ValueError(
                    f"power of the {name} link is {over_db:+.1f} dB from that at {range_m:.6g} m, must be within "
                    f"{self.params.level_tolerance_db} dB (wrong lane of all paths?)"
                )

    def _check_loops(self, measurement: InterferometerMeasurement) -> None:
        if not np.all(measurement.locked):
            slot, active, passive = np.argwhere(~measurement.locked)[0]
            lost = int(np.sum(~measurement.locked))
            raise ValueError(
                f"{lost} loops without lock, first: slot {slot}, path A{active + 1}-P{passive + 1}"
            )
        for name, snr in (("forward", measurement.snr_forward), ("return", measurement.snr_return)):
            if np.min(snr) < LOWEST_SNR:
                raise ValueError(
                    f"{name} link snr={float(np.min(snr)):.3g} must be >= {LOWEST_SNR}"
                )

    def _doubt(self, reading: Reading) -> str:
        if reading.visit_agreement < self.params.visit_agreement:
            return (
                f"repeated phases agree to {reading.visit_agreement:.3g}, must be >= {self.params.visit_agreement}: "
                "path rate wrong or changing"
            )
        if reading.worst_lane > self.params.lane_guard:
            return f"lane residual {reading.worst_lane:.3g} must be <= {self.params.lane_guard}: cycle not resolved"
        if reading.lane_deviation > self.params.gate_sigma:
            return (
                f"a lane is {reading.lane_deviation:.3g} sigma from a whole number, must be <= "
                f"{self.params.gate_sigma}: a phase is wrong, or all are (wrong lane?)"
            )
        return ""

    def _snapshot(self, reading: Reading, predicted: FilterState | None) -> Snapshot:
        prior = None if predicted is None else _seen(predicted.tracked)
        fit = self.filter_params.track_excitation
        # Without prior the first direction is radius/range off; two passes are enough from a
        # prediction.
        passes = self.params.acquisition_iterations if predicted is None else 2
        sequence = SequenceParams(iterations=passes, estimate_excitation=fit)
        geometry, excitation = coarse_geometry(reading, prior, self.system, sequence)
        snapshot = refine(geometry, excitation, reading, self.system, fit)
        self._gate(
            "ranges and couplings contradict each other",
            snapshot.chi_square,
            snapshot.degrees_of_freedom,
        )
        if np.min(snapshot.tracked.excitation) <= 0.0:
            raise ValueError(f"excitation={snapshot.tracked.excitation} must be > 0")
        self._check_angles(snapshot)
        return snapshot

    def _check_angles(self, snapshot: Snapshot) -> None:
        seen = _seen(snapshot.tracked)
        for side, (x, y, z) in (("active", seen.forward), ("passive", -seen.reverse)):
            angle = math.atan2(math.hypot(y, z), x)
            if angle > self.params.widest_angle_rad:
                raise ValueError(
                    f"{side} array sees the other {np.degrees(angle):.4g} deg off boresight, "
                    f"must be <= {np.degrees(self.params.widest_angle_rad):.4g} deg"
                )

    def _corrected(
        self, predicted: FilterState, reading: Reading, snapshot: Snapshot
    ) -> FilterState:
        motion = RelativeMotion(
            position_m=snapshot.tracked.motion.position_m,
            # Pose from the reading, rates from the prediction: the reading alone has no transverse
            # velocity.
            velocity_m_s=predicted.tracked.motion.velocity_m_s,
            attitude=snapshot.tracked.motion.attitude,
            rate_rad_s=predicted.tracked.motion.rate_rad_s,
        )
        around = TrackedMotion(motion=motion, excitation=snapshot.tracked.excitation)
        result = update(predicted, reading, self.system, around)
        try:
            self._gate(
                "reading contradicts the prediction", result.chi_square, result.degrees_of_freedom
            )
        except ValueError as error:
            raise _ContradictionError(str(error)) from error
        return result.state

    def _gate(self, what: str, chi_square: float, degrees_of_freedom: int) -> None:
        limit = chi_square_limit(degrees_of_freedom, self.params.gate_sigma)
        # Written so that NaN is rejected.
        if not chi_square <= limit:
            raise ValueError(
                f"{what} (wrong lane?): chi-square {chi_square:.4g} must be <= {limit:.4g}"
            )

    def _refused(
        self, state: TrackerState, predicted: FilterState | None, t_s: float, reason: str
    ) -> tuple[TrackerState, TrackerOutput]:
        if predicted is None:
            return state, TrackerOutput(t_s=t_s, status=ACQUIRING, reason=reason, estimate=None)
        rejected = state.rejected + 1
        silent_s = t_s - state.accepted_t_s
        if silent_s > self.params.coast_limit_s or rejected > self.params.most_rejected:
            reason = (
                f"dropped after {silent_s:.4g} s and {rejected} refused readings, last: {reason}"
            )
            return TrackerState(), TrackerOutput(
                t_s=t_s, status=ACQUIRING, reason=reason, estimate=None
            )
        after = replace(state, filter=predicted, rejected=rejected)
        output = self._output(predicted, COASTING, reason)
        return after, replace(output, estimate=None) if state.doubted else output

    def _output(self, state: FilterState, status: str, reason: str) -> TrackerOutput:
        estimate = PoseEstimate(
            t_s=state.t_s,
            motion=state.tracked.motion,
            covariance=cartesian_covariance(state.tracked.motion, state.covariance),
            excitation=state.tracked.excitation,
        )
        return TrackerOutput(t_s=state.t_s, status=status, reason=reason, estimate=estimate)


def _seen(tracked: TrackedMotion) -> Geometry:
    return geometry_from_pose(tracked.motion.position_m, tracked.motion.attitude)
