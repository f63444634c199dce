"""Tunes the position law of an axis: least beam error in wind within a peak sensitivity.

    minimise  rms |(W_b - G_b C S W_e) gusts|   with   max |S| <= M,   S = 1 / (1 + G_e C)

on the axis as it is known, with its modes up to 10 % and their residues 30 % off, and, where its
gear has play and no preload, with a gear down to a twentieth as stiff: that is what a small swing
across the play meets, and where it would go on for ever.  G, W are the
responses of encoder and beam to rate command and wind acceleration, C the PI loop with its notch
and section, or the LQG law.  From a fifth of half the sampling rate on |C| stays below `most_gain`:
what lies there is not known, and the steps of the encoder come through.

Nelder-Mead from the plain loop, from notches at the modes that show most, and from the loops of
DSS-13 scaled to them.  A variation that is beyond the bound afterwards joins those that count.
"""

import cmath
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.optimize import minimize

from rf_pointing.controllers import LawMatrices, LqgDesign, PositionLoopParams
from rf_pointing.controllers.lqg import LqgWeights
from rf_pointing.controllers.lqg_design import design_lqg, drive_of, lqg_gains
from rf_pointing.controllers.margins import Margins, closed_radius, loop_margins, sampled_response
from rf_pointing.controllers.position_loop import FEEDFORWARD_LAG_S
from rf_pointing.core import AXES, Array, ComplexArray, Pair
from rf_pointing.identification import StateSpace
from rf_pointing.servo import PlantParams, WindParams, wind_torque_n_m
from rf_pointing.station.antenna.axis_response import AS_KNOWN, AxisResponse, Variation, davenport_psd, frequency_grid

# Mean wind that a loop is tuned for unless one is given.
USUAL_WIND_M_S = 8.0
# Peak of |S|: leaves a gain margin of 2 and a phase margin of 29 deg.
MOST_SENSITIVE = 2.0
# Share of the peak that is tuned for; the optimiser may stop a little beyond it.
RESERVE = 0.99
OFF = (AS_KNOWN, *(Variation(each, 1.3) for each in (0.9, 0.95, 1.0, 1.05, 1.1)))
OFF_FINE = tuple(Variation(0.9 + 0.01 * k, share) for k in range(21) for share in (0.7, 1.0, 1.3))
PLAY = tuple(Variation(gear=share) for share in (0.05, 0.1, 0.2, 0.5))
# From this share of half the sampling rate on, |C| times the period is at most `HIGH_GAIN`.
HIGH_SHARE, HIGH_GAIN = 0.2, 0.5
# Largest |dG C S| of a model that is believed, from this frequency on, of so many lines.
MOST_MISSED, LOWEST_HZ, COHERENT = 0.25, 0.05, 50
# Where an experiment of minutes tells a lag: slow poles of the wind turn lower frequencies.
MEASURED = (0.006, 0.008, 0.01, 0.012, 0.015)
SLOW = 0.05
# Largest turn of 1 + L between two frequencies: with more, the grid has jumped over a pole.
MOST_TURN = 0.5 * math.pi
# Least damping of the poles of notch and section.
LEAST_DAMPING = 0.02
# One step of the encoder commands at most this share of the largest rate.
STEP_SHARE = 0.05
PI_NAMES = (
    "proportional_gain", "integral_gain", "notch_frequency_hz", "notch_damping", "shaping_zero_hz",
    "shaping_zero_damping", "shaping_pole_hz", "shaping_pole_damping",
)  # fmt: skip
LQG_NAMES = tuple(LqgWeights.__dataclass_fields__)
_REFUSED = 1e3
_FIRST, _POLISH, _KEPT = 300, 400, {"pi": (6, 3, 2), "lqg": (2, 1)}
_VARIATIONS = 8
# Notch, zero and pole over the mode, each with its damping: azimuth and elevation of DSS-13.
_SHAPES = ((0.86, 0.047, 1.08, 0.39, 1.90, 0.61), (0.975, 0.072, 0.966, 0.0152, 1.86, 0.58))
Law = PositionLoopParams | LqgDesign


@dataclass(frozen=True, slots=True)
class Response:
    """An axis on a grid (f,), and its state space from rate command to encoder.

    `command` and `wind` (f, 2) lead to encoder and beam, from rad/s and from rad/s^2.
    """

    frequency_hz: Array
    command: ComplexArray
    wind: ComplexArray
    sampled: LawMatrices


@dataclass(frozen=True, kw_only=True)
class AxisModel:
    """One axis as the tuner knows it; `off` gives its response with its modes off their places.

    `modes_hz` (n,) are seen through the sampling.  `most_gain` (1/s) bounds |C| at high frequency.
    `play` are the variations of a gear with play.
    """

    name: str
    sample_s: float
    modes_hz: Array
    off: Callable[[Variation], Response]
    most_gain: float
    play: tuple[Variation, ...] = ()
    slow: tuple[float, ...] = (1e-3,)
    """Frequencies, in shares of the sampling rate, at which the lag is looked at."""

    @property
    def nominal(self) -> Response:
        """The axis as it is known."""
        return self.off(AS_KNOWN)

    @property
    def lag_s(self) -> float:
        """Lag of the axis behind a slow rate command, half a period of holding included."""
        found_s, slow_hz = 0.0, np.array(self.slow) / self.sample_s
        for _ in range(2):
            phase = np.angle(1j * sampled_response(self.nominal.sampled, slow_hz, self.sample_s)[:, 0, 0])
            found_s = max(0.0, -float(np.median(phase / slow_hz)) / (2.0 * math.pi))
            # Slow against the lag itself.
            slow_hz = np.minimum(slow_hz, SLOW / max(found_s, self.sample_s))
        return found_s


def plant_axis(plant: PlantParams, axis: int, sample_s: float) -> AxisModel:
    """Return an axis of a plant; the steps of its encoder bound the gain of its law."""
    name = AXES[axis]
    own = getattr(plant, name)

    def off(variation: Variation) -> Response:
        moved = AxisResponse.on_own_grid(plant, axis, sample_s, variation)
        return Response(moved.frequency_hz, moved.from_command, moved.from_wind, moved.sampled)

    known = AxisResponse(plant, axis, AS_KNOWN, np.ones(1), sample_s)
    poles = np.exp(np.linalg.eigvals(known.a) * sample_s)
    steps = STEP_SHARE * own.rate_limit_rad_s * 2**own.encoder_bits / (2.0 * math.pi)
    return AxisModel(
        name=name, sample_s=sample_s, modes_hz=_shown(poles, known.sampled, sample_s), off=off,
        most_gain=min(HIGH_GAIN / sample_s, steps),
        play=PLAY if own.backlash_rad > 0.0 and own.countertorque_n_m == 0.0 else (),
    )  # fmt: skip


def identified_axis(name: str, model: StateSpace, most_gain: float = math.inf) -> AxisModel:
    """Return an axis of an identified model, rate command to encoder.

    The encoder stands for the beam, and the wind acts as a rate does: an acceleration w as the rate
    w / w_d of a drive of bandwidth w_d.  A mode that is off keeps the phase at its peak.

    Raises
    ------
    ValueError
        If the model has no integrator, no drive, or grows by itself.
    """
    sample_s, system = model.sample_s, (model.a, model.b, model.c, model.d)
    values, right = np.linalg.eig(model.a)
    if (growing := np.abs(values) > 1.0 + 1e-6).any():
        frequency_hz = float(np.abs(np.angle(values[growing])).max()) / (2.0 * math.pi * sample_s)
        raise ValueError(f"{name}: the model grows by itself at {frequency_hz:.2f} Hz")
    try:
        bandwidth, _ = drive_of(model.a, model.b, model.c, sample_s)
    except ValueError as error:
        raise ValueError(f"{name}: {error}; identify with a higher order") from error
    others, left = np.linalg.eig(model.a.T)
    modes = []
    for index in np.flatnonzero(values.imag > 1e-9):
        row = left[:, np.argmin(np.abs(others - values[index]))]
        size = (model.c @ right[:, index]) * (row @ model.b) / (row @ right[:, index])
        modes.append((complex(values[index]), complex(size.item())))

    def off(variation: Variation) -> Response:
        moved = system
        if variation != AS_KNOWN:
            for pole, size in modes:
                place = pole**variation.frequency
                turn = cmath.exp(1j * (cmath.phase(place) - cmath.phase(pole)))
                rest = (1.0 - abs(place)) / (1.0 - abs(pole) + 1e-12)
                moved = _with_pole(moved, pole, -size)
                moved = _with_pole(moved, place, variation.residue * turn * rest * size)
        grid = frequency_grid(np.linalg.eigvals(moved[0]).astype(np.complex128), sample_s)
        encoder = sampled_response(moved, grid, sample_s)[:, 0, 0]
        both = np.column_stack([encoder, encoder])
        return Response(grid, both, both / bandwidth, moved)

    return AxisModel(
        name=name, sample_s=sample_s, modes_hz=_shown(values, system, sample_s), off=off,
        most_gain=min(HIGH_GAIN / sample_s, most_gain), slow=MEASURED,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class TunedAxis:
    """A law, its margins on the axis, the worst peak with the modes off, and its beam error.

    `rms_s2_per_m_s` times the wind acceleration per gust speed is the rms beam error in rad.
    """

    name: str
    law: Law
    lag_s: float
    lead_s: float
    margins: Margins
    worst_peak: float
    worst: Variation
    rms_s2_per_m_s: float


def tuned_axis(
    axis: AxisModel, law: str, wind_m_s: float, most_sensitive: float = MOST_SENSITIVE
) -> TunedAxis:  # fmt: skip
    """Return the law "pi" or "lqg" tuned for gusts about a mean wind.

    Raises
    ------
    ValueError
        If no law of that kind is stable with its peak within `most_sensitive`.
    """
    problem = Problem(axis, wind_m_s, most_sensitive * RESERVE)
    values = _search(problem, law)
    for _ in range(_VARIATIONS):
        tuned = judged(axis, problem.law(law, values), wind_m_s)
        if tuned.worst_peak <= most_sensitive:
            return tuned
        # Near the best already: a variation more moves it a little.
        problem = Problem(axis, wind_m_s, most_sensitive * RESERVE, (*problem.more, tuned.worst))
        for _ in range(2):
            _, values = _descended(problem, law, values, _POLISH)
    raise ValueError(
        f"{axis.name}: no {law} loop has |S| <= {most_sensitive:g} on every variation; "
        f"the best has {tuned.worst_peak:.2f} {tuned.worst}"
    )


def judged(axis: AxisModel, law: Law, wind_m_s: float) -> TunedAxis:
    """Return a law with what it does on the axis, exact and with every variation.

    An unstable variation has an infinite peak.
    """
    worst, where = 0.0, AS_KNOWN
    for variation in (*OFF_FINE, *axis.play):
        response = axis.off(variation)
        if (peak := _exact(response, law, axis.sample_s).peak_sensitivity) > worst:
            worst, where = peak, variation
    response = axis.nominal
    gain = sampled_response(law.matrices(axis.sample_s), response.frequency_hz, axis.sample_s)
    notch = law.notch
    led_s = notch.pole_damping / (math.pi * notch.pole_hz) if notch.enabled else 0.0
    return TunedAxis(
        name=axis.name, law=law, lag_s=axis.lag_s, lead_s=axis.lag_s + FEEDFORWARD_LAG_S + led_s,
        margins=_exact(response, law, axis.sample_s), worst_peak=worst, worst=where,
        rms_s2_per_m_s=_rms(response, gain[:, 0, 0], wind_m_s),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class LoopCurves:
    """Curves of a loop: |S| and the rms error of all gusts below (f,), and a step (n,)."""

    frequency_hz: Array
    sensitivity: Array
    running_rms: Array
    time_s: Array
    step: Array


def loop_curves(law: Law, axis: AxisModel, wind_m_s: float) -> LoopCurves:
    """Return what a picture shows of a law; nothing is fed forward in the step of the command."""
    response, matrices = axis.nominal, law.matrices(axis.sample_s)
    gain = sampled_response(matrices, response.frequency_hz, axis.sample_s)[:, 0, 0]
    density = _power(response, gain, wind_m_s)
    power = cumulative_trapezoid(density, response.frequency_hz, initial=0.0)
    (a, b, c, _), (la, lb, lc, ld) = response.sampled, matrices
    state, inner = np.zeros((len(a), 1)), np.zeros((len(la), 1))
    step = np.zeros(round(40.0 * axis.lag_s / axis.sample_s) + 50)
    for k in range(len(step)):
        # The encoder is read before the command of the same tick.
        step[k] = (c @ state).item()
        error = np.array([[1.0 - step[k]]])
        rate = lc @ inner + ld @ error
        state, inner = a @ state + b @ rate, la @ inner + lb @ error
    sensitivity = 1.0 / np.abs(1.0 + gain * response.command[:, 0])
    time_s = axis.sample_s * np.arange(float(len(step)))
    return LoopCurves(response.frequency_hz, sensitivity, np.sqrt(power), time_s, step)


class Problem:
    """The cost that the optimiser lowers, a function of the logarithms of a law's numbers."""

    def __init__(
        self, axis: AxisModel, wind_m_s: float, peak: float, more: tuple[Variation, ...] = ()
    ) -> None:  # fmt: skip
        self.axis, self._wind_m_s, self._peak, self.more = axis, wind_m_s, peak, more
        self.lag_s = axis.lag_s
        found = [axis.off(variation) for variation in (*OFF, *axis.play, *more)]
        self._nominal = found[0]
        self._drive = drive_of(*found[0].sampled[:3], axis.sample_s)
        # One long grid: the law is the same for all of them.
        self._cuts = np.cumsum([len(each.frequency_hz) for each in found])[:-1]
        frequency_hz = np.concatenate([each.frequency_hz for each in found])
        self._encoder = np.concatenate([each.command[:, 0] for each in found])
        self._z = np.exp(2j * np.pi * frequency_hz * axis.sample_s)
        self._sigma = (self._z - 1.0) / (self._z + 1.0)
        self._high = frequency_hz >= HIGH_SHARE * 0.5 / axis.sample_s

    def law(self, kind: str, values: Array) -> Law:
        """Return the law of these numbers (their logarithms)."""
        numbers = np.exp(values).tolist()
        if kind == "lqg":
            weights = LqgWeights(**dict(zip(LQG_NAMES, numbers, strict=True)))
            return design_lqg(*self._nominal.sampled, self.axis.sample_s, weights)
        given = dict(zip(PI_NAMES, numbers, strict=False))
        return PositionLoopParams(
            **given, notch_enabled=len(numbers) > 2, shaping_enabled=len(numbers) > 4,
            drive_lag_s=self.lag_s,
        )  # fmt: skip

    def cost(self, kind: str, values: Array) -> float:
        """Return log rms, with a price on what is beyond the bounds."""
        try:
            gain = self._gain(kind, np.exp(values))
        except (ValueError, np.linalg.LinAlgError):
            return _REFUSED
        loop = 1.0 + self._encoder * gain
        unstable = sum(not _stable(each) for each in np.split(loop, self._cuts))
        if unstable:
            return _REFUSED / 2.0 + unstable
        peak = 1.0 / float(np.min(np.abs(loop)))
        high = float(np.max(np.abs(gain[self._high])))
        over = max(0.0, peak / self._peak - 1.0), max(0.0, high / self.axis.most_gain - 1.0)
        rms = _rms(self._nominal, gain[: len(self._nominal.frequency_hz)], self._wind_m_s)
        return math.log(rms) + 20.0 * over[0] + 5.0 * over[1]

    def _gain(self, kind: str, numbers: Array) -> ComplexArray:
        """Return C on the long grid; ValueError for numbers out of range."""
        if kind == "lqg":
            return self._lqg_gain(LqgWeights(**dict(zip(LQG_NAMES, numbers.tolist(), strict=True))))
        sample_s, (kp, ki) = self.axis.sample_s, numbers[:2]
        gain: ComplexArray = np.asarray(kp + ki * sample_s / (self._z - 1.0), dtype=np.complex128)
        lag_s = self.lag_s
        if len(numbers) > 2:
            gain = gain * self._section(numbers[2], 0.0, numbers[2], numbers[3])
            lag_s += numbers[3] / (math.pi * numbers[2])
        if len(numbers) > 4:
            gain = gain * self._section(*numbers[4:])
            lag_s += numbers[7] / (math.pi * numbers[6]) - numbers[5] / (math.pi * numbers[4])
        # The bounds of the parameters, and their rule on k_i (PositionLoopParams).
        dampings = numbers[3::2]
        if kp > 50.0 or ki > 500.0 or kp <= ki * lag_s or (len(dampings) and dampings.max() > 2.0):
            raise ValueError("out of range")
        # A pole of the law between two points of the grid would hide what it does.
        if len(dampings) and min(numbers[3], numbers[-1]) < LEAST_DAMPING:
            raise ValueError("out of range")
        return gain

    def _section(self, zero_hz: float, zero: float, pole_hz: float, pole: float) -> ComplexArray:
        if not 0.01 < min(zero_hz, pole_hz) <= max(zero_hz, pole_hz) < 0.45 / self.axis.sample_s:
            raise ValueError("out of range")
        s = self._sigma / math.tan(math.pi * zero_hz * self.axis.sample_s)
        t = s * (zero_hz / pole_hz)
        return np.asarray((s * s + 2.0 * zero * s + 1.0) / (t * t + 2.0 * pole * t + 1.0))

    def _lqg_gain(self, weights: LqgWeights) -> ComplexArray:
        a, b, c, state_gain, observer_gain = lqg_gains(*self._drive, self.axis.sample_s, weights)
        poles, vectors = np.linalg.eig(a - b @ state_gain - observer_gain @ c)
        entry = np.linalg.solve(vectors, observer_gain.astype(np.complex128))[:, 0]
        sizes = (state_gain @ vectors)[0] * entry
        core: ComplexArray = (sizes / (self._z[:, None] - poles)).sum(axis=1)
        notch = weights.notch_frequency_hz, 0.0, weights.notch_frequency_hz, weights.notch_damping
        section = (
            weights.shaping_zero_hz, weights.shaping_zero_damping, weights.shaping_pole_hz,
            weights.shaping_pole_damping,
        )  # fmt: skip
        return core * self._section(*notch) * self._section(*section)


def require_described(
    tuned: TunedAxis, measured_hz: Array, response: ComplexArray, model: StateSpace
) -> None:  # fmt: skip
    """Raise ValueError, with the frequency, where a model misses its measured response (f,).

    What the model G leaves, dG, counts by the loop on it: the true |S| is at most |S| / (1 - |dG C
    S|).  Too low an order, a mode that moved, a drive that saturated show here.
    """
    kept = measured_hz >= LOWEST_HZ
    frequency_hz, response = measured_hz[kept], response[kept]
    if len(frequency_hz) < COHERENT:
        raise ValueError(
            f"{tuned.name}: the response was measured at {len(frequency_hz)} frequencies from "
            f"{LOWEST_HZ:g} Hz on, at least {COHERENT} are needed: shake the axis longer or harder"
        )
    matrices = tuned.law.matrices(model.sample_s)
    gain = sampled_response(matrices, frequency_hz, model.sample_s)[:, 0, 0]
    known = model.response(frequency_hz)[:, 0, 0]
    share = (response - known) * gain / (1.0 + known * gain)
    # What lines of the spectrum scatter about the response turns any way: the median of five
    # neighbours, of its two parts, leaves it out.
    near = np.lib.stride_tricks.sliding_window_view(share, 5)
    smooth = np.abs(np.median(near.real, axis=1) + 1j * np.median(near.imag, axis=1))
    worst = int(np.argmax(smooth))
    if smooth[worst] > MOST_MISSED:
        at = worst + 2
        raise ValueError(
            f"{tuned.name}: the model of order {model.order} does not describe the axis at "
            f"{frequency_hz[at]:.2f} Hz: it gives {abs(known[at]):.3g} rad per rad/s where "
            f"{abs(response[at]):.3g} was measured, which moves the loop by {smooth[worst]:.2f}, "
            f"at most {MOST_MISSED:g}; identify with a higher order, or more sequences"
        )


def gust_acceleration(plant: PlantParams, wind: WindParams, mean_m_s: float) -> Pair:
    """Return rms over the sky of the wind acceleration per gust speed, rad/s^2 per m/s.

    Cross-elevation and elevation; gusts along and across the mean wind.
    """
    step, blows = 1e-3, wind.replace(mean_speed_m_s=mean_m_s, from_azimuth_rad=0.0)
    squares = []
    for elevation in np.radians(np.arange(10.0, 90.0, 10.0)).tolist():
        for azimuth in np.radians(np.arange(0.0, 360.0, 30.0)).tolist():
            torques = (
                np.array(wind_torque_n_m(blows, mean_m_s + along, across, azimuth, elevation))
                for along, across in ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step))
            )
            up, down, right, left = torques
            gusts = (up - down) ** 2 + (wind.lateral_ratio * (right - left)) ** 2
            squares.append(gusts / (2.0 * step) ** 2 * (math.cos(elevation) ** 2, 1.0))
    inertia = plant.azimuth.inertia_kg_m2, plant.elevation.inertia_kg_m2
    cross, elevation_only = (np.sqrt(np.mean(squares, axis=0)) / inertia).tolist()
    return cross, elevation_only


def tuning_lines(tuned: TunedAxis, peak_kept: bool = True) -> list[str]:
    """Return the lines of a description's `tuning:` section that give an axis its law.

    `peak_kept`: the servo refuses the law where its sensitivity has grown by a quarter.
    """
    margins, name = tuned.margins, tuned.name
    lines = [
        f"  # {name}: |S| <= {margins.peak_sensitivity:.2f}, {tuned.worst_peak:.2f} at worst; "
        f"margins {margins.gain_margin_db:.1f} dB, "
        f"{math.degrees(margins.phase_margin_rad):.0f} deg"
    ]
    if isinstance(tuned.law, LqgDesign):
        return [*lines, f"  loops.lqg_{name}: {{feedforward_lead_s: {tuned.lead_s:.4f}}}"]
    values = {each: getattr(tuned.law, each) for each in PI_NAMES}
    given = {each: f"{float(f'{value:.5g}'):g}" for each, value in values.items()}
    given |= {
        "notch_enabled": str(tuned.law.notch_enabled).lower(),
        "shaping_enabled": str(tuned.law.shaping_enabled).lower(),
        "feedforward_lead_s": f"{tuned.lead_s:.4f}", "drive_lag_s": f"{tuned.lag_s:.4f}",
        "peak_sensitivity": f"{margins.peak_sensitivity if peak_kept else 0.0:.3f}",
    }  # fmt: skip
    pairs = [f"{key}: {value}" for key, value in given.items()]
    rows = [", ".join(pairs[k : k + 3]) for k in range(0, len(pairs), 3)]
    return [*lines, f"  loops.{name}:", "    {" + ",\n     ".join(rows) + "}"]


def _search(problem: Problem, kind: str) -> Array:
    """Return the best numbers found, in logarithms; of two alike those of the simpler law."""
    starts = _starts(problem) if kind == "pi" else _lqg_starts(problem)
    found = [_descended(problem, kind, start, _FIRST) for start in starts]
    for kept in _KEPT[kind]:
        # A law with fewer parts wins unless one with more is 1 % better.
        found.sort(key=lambda one: one[0] + 0.005 * len(one[1]))
        found = [_descended(problem, kind, values, _POLISH) for _, values in found[:kept]]
    cost, values = min(
        found, key=lambda one: one[0] + 0.005 * len(one[1]), default=(_REFUSED, np.zeros(0))
    )  # fmt: skip
    if cost >= _REFUSED / 2.0:
        raise ValueError(f"{problem.axis.name}: no {kind} loop of this response is stable")
    return values


def _descended(problem: Problem, kind: str, start: Array, most: int) -> tuple[float, Array]:
    options = {"maxfev": most, "xatol": 1e-3, "fatol": 1e-5, "adaptive": True}
    found = minimize(
        lambda values: problem.cost(kind, values), start, method="Nelder-Mead", options=options
    )  # fmt: skip
    return float(found.fun), np.asarray(found.x)


def _starts(problem: Problem) -> Iterator[Array]:
    """Yield the laws to begin with, each slowed until it is stable."""
    lag_s, top_hz = max(problem.lag_s, problem.axis.sample_s), 0.4 / problem.axis.sample_s
    lead = [min(0.34 / lag_s, 0.5 * top_hz), 0.6, min(0.67 / lag_s, top_hz), 0.62]
    gain = min(0.9 / lag_s, 0.9 * problem.axis.most_gain)
    quick, slow = (gain, 0.25 * gain**2), (0.05 * gain, 0.3 * gain)
    forms: list[tuple[Pair, list[float]]] = [(quick, []), (quick, [top_hz, 0.1, *lead])]
    for mode_hz in problem.axis.modes_hz[:2].tolist():
        notches = [[min(share * mode_hz, top_hz), 0.13] for share in (1.0, 1.6)]
        # Zeros so wide that they are two: the proportional part comes from the section.
        wide = [0.75 * mode_hz, 1.5, min(1.8 * mode_hz, top_hz), 0.5]
        scale = np.array([mode_hz, 1.0] * 3)
        forms.append((quick, [mode_hz, 0.2]))
        forms += [(quick, [*notch, *lead]) for notch in notches]
        forms += [(slow, [*notch, *wide]) for notch in notches]
        forms += [(quick, (scale * shape).tolist()) for shape in _SHAPES]
    for (gain, integral), form in forms:
        for slower in 0.8 ** np.arange(40):
            values = np.log([slower * gain, slower**2 * integral, *form])
            if problem.cost("pi", values) < _REFUSED / 2.0:
                yield values
                break


def _lqg_starts(problem: Problem) -> Iterator[Array]:
    """Yield weights about the tuned PI loop; where it has no filters they lie above the loop."""
    numbers = np.exp(_search(problem, "pi"))
    top_hz = 0.3 / problem.axis.sample_s
    filters = [*numbers[2:], *[top_hz, 0.1, top_hz, 0.7, top_hz, 0.7][len(numbers) - 2 :]]
    for rate in (1.0, 1e-6):
        for slow in 4.0 ** np.arange(10):
            values = np.log([*filters, slow / numbers[0] ** 2, 1.0 / slow, rate])
            if problem.cost("lqg", values) < _REFUSED / 2.0:
                yield values
                break


def _exact(response: Response, law: Law, sample_s: float) -> Margins:
    """Return the margins of the loop, with an infinite peak where a pole lies outside."""
    matrices = law.matrices(sample_s)
    gain = sampled_response(matrices, response.frequency_hz, sample_s)[:, 0, 0]
    if closed_radius(response.sampled, matrices) > 1.0 + 1e-6:
        return Margins(math.inf, 0.0, -math.inf, 0.0)
    return loop_margins(response.frequency_hz, gain * response.command[:, 0])


def _rms(response: Response, gain: ComplexArray, wind_m_s: float) -> float:
    return math.sqrt(float(trapezoid(_power(response, gain, wind_m_s), response.frequency_hz)))


def _power(response: Response, gain: ComplexArray, wind_m_s: float) -> Array:
    """Return the spectrum (f,) of the beam error per wind acceleration and gust speed."""
    (encoder, beam), (wind_encoder, wind_beam) = response.command.T, response.wind.T
    error = wind_beam - beam * gain * wind_encoder / (1.0 + encoder * gain)
    return np.asarray(np.abs(error) ** 2 * davenport_psd(response.frequency_hz, wind_m_s, 0.005))


def _stable(loop: ComplexArray) -> bool:
    """Return whether 1 + L turns by a half: two integrators, and -1 is not encircled."""
    turns = np.angle(loop[1:] / loop[:-1])
    return abs(float(turns.sum()) - math.pi) < 0.5 * math.pi and float(np.abs(turns).max()) < MOST_TURN


def _shown(poles: ComplexArray, system: LawMatrices, sample_s: float) -> Array:
    """Return the frequencies (n,) of the modes, the one first that moves the encoder most."""
    swinging = poles[(poles.imag > 1e-9) & (np.abs(poles) > 0.5)]
    frequency_hz = np.angle(swinging) / (2.0 * math.pi * sample_s)
    frequency_hz = frequency_hz[(frequency_hz > 0.01) & (frequency_hz < 0.4 / sample_s)]
    if not len(frequency_hz):
        return frequency_hz
    size = np.abs(sampled_response(system, frequency_hz, sample_s)[:, 0, 0])
    return np.asarray(frequency_hz[np.argsort(-size * frequency_hz)])


def _with_pole(system: LawMatrices, pole: complex, residue: complex) -> LawMatrices:
    """Return a system with one more pair of poles, residue over z - pole and the conjugate."""
    a, b, c, d = system
    turn = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
    shown = np.array([[2.0 * residue.real, 2.0 * residue.imag]])
    whole = np.block([[a, np.zeros((len(a), 2))], [np.zeros((2, len(a))), turn]])
    return whole, np.vstack([b, [[1.0], [0.0]]]), np.hstack([c, shown]), d
