"""Where the target is, how wide the beam and how strong the source, of the powers of one scan.

    P_i = A l_i R(u_i) + (b0 + b1 t_i) s_i + b2 y_i,   u^2 = d' M d / h^2,  d = target - beam_i
    M = [[1 - e1, -e2], [-e2, 1 + e1]]

R is the beam's pattern over the source's disc (`disc.py`), l_i the strength of the signal against
its mean (range of a satellite), s_i the noise expected along the beam's elevation over that at the
target's, and y_i that elevation off the target's, with what is left of its slope.  A carrier's
power has no baseline, b = 0.

The variance of a power follows from the stated ones, fitted as c0 + c1 P + c2 P^2 and taken at the
model's power and not at the measured one, which would weigh low values more.  With it least squares
is efficient: the covariance is the Cramer-Rao bound, times chi squared where that is above 1.  What
does not belong to the source is edited with its reason, or refuses the scan.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.rf.beam import BeamParams

NAMES = ("cross_elevation", "elevation", "width", "e1", "e2", "level", "baseline", "drift", "tilt")
X, Y, WIDTH, E1, E2, LEVEL, BASE, DRIFT, TILT = range(9)
# Choices of the fitted shape: nothing, the width, that along each axis, or an ellipse.
SHAPES = {"fixed": 0, "width": 1, "axes": 2, "ellipse": 3}
# Level over its sigma from which the shape is fitted; below, it would cost accuracy.
WIDTH_SNR, ELLIPSE_SNR = 20.0, 60.0
# Sigma of width over beamwidth and of e1, e2 up to which they are fitted.
WELL = 0.03
HELD_SIGMA = 0.05
"""Standard deviation of a width and of ellipticities that a scan leaves open, as shares."""
# Fitted over expected width beyond which it is not this antenna's beam.
WIDEST, NARROWEST = 1.6, 0.6
FEWEST = 12
SINGULAR = 1e-11
ROUNDS = 12
# Each round edits what is this share of the worst residual: one burst moves the whole model.
WORST = 0.5
# A beam that strays less than this from a line, in beamwidths, tells nothing across it: there the
# target is taken to lie on the line, within this many beamwidths.
LINE, LINE_SIGMA = 0.05, 0.5


class Samples(NamedTuple):
    """Powers of a scan, all (n,): time, power, its sigma, the beam off the target, l and s."""

    t_s: Array
    power: Array
    sigma: Array
    cross_elevation_rad: Array
    elevation_rad: Array
    strength: Array
    sky: Array

    def kept(self, mask: NDArray[np.bool_]) -> "Samples":
        """Return those of the mask (n,)."""
        return Samples(*(column[mask] for column in self))


@dataclass(frozen=True, kw_only=True)
class ScanFitParams(Params):
    """Known beam and source, and bounds of what is edited."""

    beam: BeamParams = parameter(BeamParams(), "beam as it is expected")
    radius_rad: float = parameter(0.0, "radius of the source", low=0.0, high=0.1)
    carrier: bool = parameter(False, "whether the power is that of a carrier, without the noise")
    shape: str = parameter("auto", "what is fitted of the shape", choices=("auto", *SHAPES))
    pattern_error: float = parameter(
        0.003,
        "error of the pattern, of the level: smaller than it no noise is seen",
        low=0.0,
        high=0.1,
    )
    edit_sigmas: float = parameter(5.0, "residual at which a power is edited", low=3.0, high=100.0)
    most_edited: float = parameter(
        0.25, "share of edited powers at which the scan is refused", low=0.0, high=0.9
    )
    least_snr: float = parameter(
        5.0, "level over its sigma below which nothing was seen", low=2.0, high=100.0
    )


@dataclass(frozen=True, kw_only=True)
class ScanFit:
    """Result of a scan; the offset is target minus the beam's centre of the scan.

    Attributes
    ----------
    values, covariance : (9,) and (9, 9) of `NAMES`: rad, rad, rad, 1, 1, power, power, power/s and
        power/rad; zero in the covariance for what was not fitted.
    chi_squared : per degree of freedom, with the pattern's error in the variances.
    on_axis : R(0): the level is that of a point with the flux of the disc.
    used : which samples (n,) were; `edited`: how many were not, by reason.
    """

    values: Array
    covariance: Array
    chi_squared: float
    shape: str
    on_axis: float
    used: NDArray[np.bool_]
    edited: dict[str, int]

    @property
    def offset_rad(self) -> tuple[float, float]:
        """Cross-elevation and elevation of the target off the centre."""
        return float(self.values[X]), float(self.values[Y])

    @property
    def sigma_rad(self) -> tuple[float, float]:
        """Standard deviations of the offset."""
        return float(math.sqrt(self.covariance[X, X])), float(math.sqrt(self.covariance[Y, Y]))

    @property
    def snr(self) -> float:
        """Level over its sigma."""
        return float(self.values[LEVEL] / math.sqrt(self.covariance[LEVEL, LEVEL]))

    @property
    def ellipticity(self) -> float:
        """Share by which the wide axis of the beam exceeds the narrow one, about."""
        return float(np.hypot(self.values[E1], self.values[E2]))

    def y_factor(self) -> tuple[float, float]:
        """Return power on the source over that off it, and its sigma."""
        level, base = self.on_axis * float(self.values[LEVEL]), float(self.values[BASE])
        slope = np.array([self.on_axis / base, -level / base**2])
        part = self.covariance[np.ix_((LEVEL, BASE), (LEVEL, BASE))]
        return 1.0 + level / base, float(math.sqrt(slope @ part @ slope))


def fit_scan(samples: Samples, params: ScanFitParams) -> ScanFit:
    """Return where the target is; ValueError names what makes the scan useless."""
    problem = _Problem(samples, params)
    used, edited = np.ones(len(samples.t_s), dtype=bool), dict[str, int]()
    clipped = _clipped(samples)
    if clipped.any():
        used, edited = ~clipped, {"clipped power": int(clipped.sum())}
    values = problem.start(used)
    for _ in range(ROUNDS):
        values, covariance, residual, shape = problem.solve(values, used)
        wrong = problem.outlying(values, residual, used)
        for reason, rows in wrong.items():
            fresh = used & rows
            edited[reason] = edited.get(reason, 0) + int(fresh.sum())
            used = used & ~rows
        if not any(rows.any() for rows in wrong.values()):
            break
    else:
        values, covariance, residual, shape = problem.solve(values, used)
    share = 1.0 - float(np.mean(used))
    if share > params.most_edited:
        problem.require_seen(values, covariance, np.ones_like(used))
        words = ", ".join(f"{count} by {reason}" for reason, count in edited.items())
        raise ValueError(
            f"{share:.0%} of the powers had to be edited ({words}), must be <= "
            f"{params.most_edited:.0%}"
        )
    problem.judge(values, covariance, residual, used)
    freedom = max(int(used.sum()) - len(problem.free(shape)), 1)
    chi_squared = float(np.sum(residual[used] ** 2)) / freedom
    return ScanFit(
        values=values, covariance=covariance * max(chi_squared, 1.0), chi_squared=chi_squared,
        shape=shape, on_axis=problem.on_axis(values), used=used,
        edited={reason: count for reason, count in edited.items() if count},
    )  # fmt: skip


class _Problem:
    """The model of one scan; residuals are in standard deviations."""

    def __init__(self, samples: Samples, params: ScanFitParams) -> None:
        count = len(samples.t_s)
        if count < FEWEST:
            raise ValueError(f"{count} powers are too few for a fit, must be >= {FEWEST}")
        finite = all(np.isfinite(column).all() for column in samples)
        if not finite or not (samples.sigma > 0.0).all():
            raise ValueError("powers, sigmas and beam positions must be finite, sigmas > 0")
        self.samples, self.params = samples, params
        self._response = DiscResponse(params.beam)
        self._beamwidth = params.beam.half_power_beamwidth_rad
        self._since_s = samples.t_s - float(np.mean(samples.t_s))
        # The scale of the power: a carrier has 1e-17 W, and the solver's tolerances are relative.
        self._scale = float(np.max(np.abs(samples.power)))
        self._noise = _noise_law(samples)
        offsets = np.column_stack([samples.cross_elevation_rad, samples.elevation_rad])
        _, spread, axes = np.linalg.svd(offsets - offsets.mean(axis=0), full_matrices=False)
        on_a_line = spread[1] < LINE * self._beamwidth * math.sqrt(count)
        self._across = axes[1] if on_a_line else None
        self._flat = float(np.std(samples.elevation_rad)) < LINE * self._beamwidth

    def free(self, shape: str) -> list[int]:
        """Return the fitted of `NAMES`."""
        own = [WIDTH, E1, E2][: SHAPES[shape]]
        baseline = [BASE, DRIFT, TILT][: 2 if self._flat else 3]
        return [X, Y, *own, LEVEL, *([] if self.params.carrier else baseline)]

    def gain(self, values: Array, samples: Samples | None = None) -> Array:
        """Return R (n,) at the samples of the scan, or at others."""
        taken = self.samples if samples is None else samples
        x, y = values[X] - taken.cross_elevation_rad, values[Y] - taken.elevation_rad
        return self._gain_at(x, y, values)

    def _gain_at(self, x: Array, y: Array, values: Array) -> Array:
        """Return R (..., n) of a target at `x` and `y` off the beam."""
        e1, e2 = values[E1], values[E2]
        u2 = (
            np.maximum(x**2 * (1.0 - e1) - 2.0 * e2 * x * y + y**2 * (1.0 + e1), 0.0)
            / values[WIDTH] ** 2
        )
        farthest = 2.0 + float(np.sqrt(u2.max()))
        return self._response.power(u2, self.params.radius_rad / float(values[WIDTH]), farthest)

    def on_axis(self, values: Array) -> float:
        """Return R(0)."""
        radius = self.params.radius_rad / float(values[WIDTH])
        return 1.0 / self._response.correction(radius)

    def model(self, values: Array, samples: Samples | None = None) -> Array:
        """Return the powers (n,) of the scan, or of one whose beam went elsewhere."""
        taken = self.samples if samples is None else samples
        base = (values[BASE] + values[DRIFT] * self._since_s) * taken.sky
        base = base + values[TILT] * taken.elevation_rad
        return np.asarray(values[LEVEL] * taken.strength * self.gain(values, taken) + base)

    def sigma(self, values: Array) -> Array:
        """Return the standard deviations (n,) at the model's powers."""
        power = np.maximum(self.model(values), 0.0)
        c0, c1, c2 = self._noise
        error = self.params.pattern_error * values[LEVEL]
        # What the pattern is wrong by goes with its slope: nothing far off the source.
        slope = np.sqrt(np.clip(self.gain(values), 0.0, 1.0))
        return np.asarray(np.sqrt(c0 + c1 * power + c2 * power**2 + (error * slope) ** 2))

    def start(self, used: NDArray[np.bool_]) -> Array:
        """Return the best of the directions on a grid, with the level that belongs to each."""
        taken, since = self.samples.kept(used), self._since_s[used]
        step = 0.35 * max(self._beamwidth, self.params.radius_rad)
        axes = [
            np.arange(column.min() - step, column.max() + 1.5 * step, step)
            for column in (taken.cross_elevation_rad, taken.elevation_rad)
        ]
        found = np.zeros(9)
        found[WIDTH] = self._beamwidth
        rows = [taken.sky, since * taken.sky, taken.elevation_rad][: len(self.free("fixed")) - 3]
        base, power = np.reshape(rows, (-1, len(since))) / taken.sigma, taken.power / taken.sigma
        # What the baseline explains is taken out of the power and of the beam of every direction.
        known = np.linalg.qr(base.T)[0]
        left, best = power - known @ (known.T @ power), 0.0
        y, strength = axes[1][:, None] - taken.elevation_rad, taken.strength / taken.sigma
        for x in axes[0]:
            beam = self._gain_at(x - taken.cross_elevation_rad, y, found) * strength
            seen = beam - (beam @ known) @ known.T
            # A beam that the baseline explains but for the rounding shows nothing.
            size = np.sum(seen**2, axis=1) + 1e-20 * np.sum(beam**2, axis=1) + 1e-300
            shown = np.maximum(seen @ left, 0.0) ** 2 / size
            at = int(np.argmax(shown))
            if shown[at] > best:
                best, found[[X, Y]] = float(shown[at]), (x, axes[1][at])
                columns = np.vstack([beam[at], base]).T
                fitted, *_ = np.linalg.lstsq(columns, power, rcond=None)
                found[LEVEL : LEVEL + len(fitted)] = fitted
        if not best:
            raise ValueError("no source was seen: the power rises nowhere like the beam")
        return found

    def solve(self, start: Array, used: NDArray[np.bool_]) -> tuple[Array, Array, Array, str]:
        """Return values, covariance and all residuals of the fit to the used samples, its shape."""
        if (given := self.params.shape) != "auto":
            found = self._solved(start, used, given)
            if not self._well(found[1]):
                raise ValueError(
                    f"shape={given} is not determined by this scan, must be auto or a simpler one"
                )
            return *found, given
        found = self._solved(start, used, "fixed")
        snr = found[0][LEVEL] / math.sqrt(found[1][LEVEL, LEVEL])
        if self._across is not None or snr < WIDTH_SNR:
            return *found, "fixed"
        for shape in ("ellipse", "axes", "width")[0 if snr >= ELLIPSE_SNR else 2 :]:
            try:
                finer = self._solved(found[0], used, shape)
            except ValueError:
                # Too few places for this shape.
                continue
            if self._well(finer[1]):
                return *finer, shape
        return *found, "fixed"

    def _well(self, covariance: Array) -> bool:
        """Return whether the shape is known: what hardly is takes the offset with it."""
        sigma = np.sqrt(np.diagonal(covariance))
        return bool(max(sigma[WIDTH] / self._beamwidth, sigma[E1], sigma[E2]) < WELL)

    def _solved(
        self, start: Array, used: NDArray[np.bool_], shape: str
    ) -> tuple[Array, Array, Array]:
        free, values = self.free(shape), start.copy()
        values[[E1, E2][max(SHAPES[shape] - 1, 0) :]] = 0.0
        if shape == "fixed":
            values[WIDTH] = self._beamwidth
        units = self._units()[free]
        for _ in range(2):
            sigma, kept = self.sigma(values), values.copy()

            def misfit(steps: Array, sigma: Array = sigma, kept: Array = kept) -> Array:
                trial = kept.copy()
                trial[free] += steps * units
                trial[WIDTH] = max(trial[WIDTH], 0.2 * self._beamwidth)
                trial[[E1, E2]] = np.clip(trial[[E1, E2]], -0.9, 0.9)
                left = np.asarray((self.samples.power - self.model(trial)) / sigma)[used]
                if self._across is None:
                    return left
                return np.append(
                    left, trial[[X, Y]] @ self._across / (LINE_SIGMA * self._beamwidth)
                )

            found = least_squares(
                misfit, np.zeros(len(free)), method="lm", jac="2-point", xtol=1e-10, ftol=1e-12
            )
            values = kept.copy()
            values[free] += found.x * units
        values[[E1, E2]] = np.clip(values[[E1, E2]], -0.9, 0.9)
        information = found.jac.T @ found.jac
        names = [NAMES[index].replace("_", "-") for index in free]
        covariance = np.zeros((9, 9))
        inverse = _inverse(information, names)
        covariance[np.ix_(free, free)] = inverse * np.outer(units, units)
        residual = np.asarray((self.samples.power - self.model(values)) / self.sigma(values))
        for index in sorted({WIDTH, E1, E2} - set(free)):
            # What is held is not known: its part of the offset is considered.
            moved = values.copy()
            moved[index] += HELD_SIGMA * self._units()[index]
            change = ((self.model(moved) - self.model(values)) / self.sigma(values))[used]
            part = (inverse @ found.jac[: len(change)].T @ change * units)[:2]
            covariance[:2, :2] += np.outer(part, part)
        return values, covariance, residual

    def _units(self) -> Array:
        width, span_s = self._beamwidth, max(float(np.ptp(self._since_s)), 1e-3)
        scale = self._scale
        return np.array([width] * 3 + [1.0, 1.0, scale, scale, scale / span_s, scale / width])

    def outlying(
        self, values: Array, residual: Array, used: NDArray[np.bool_]
    ) -> dict[str, NDArray[np.bool_]]:
        """Return the samples to edit by reason."""
        found = {}
        second = self._second_source(values, residual, used)
        if second is not None:
            place, rows = second
            where = ", ".join(f"{math.degrees(each):+.2f}" for each in place)
            return {f"a second source ({where} deg)": used & rows}
        # The median is not moved by what is edited.
        scale = max(1.0, 1.4826 * float(np.median(np.abs(residual[used]))))
        worst = float(np.abs(residual[used]).max())
        far = np.abs(residual) > max(self.params.edit_sigmas * scale, WORST * worst)
        found["interference"] = used & far & (residual > 0.0)
        found["dropout"] = used & far & (residual < 0.0)
        return found

    def _second_source(
        self, values: Array, residual: Array, used: NDArray[np.bool_]
    ) -> tuple[tuple[float, float], NDArray[np.bool_]] | None:
        """Return where a second source is, and the samples in its beam."""
        taken, width = self.samples, float(values[WIDTH])
        reach = 1.2 * width + self.params.radius_rad
        offsets = np.column_stack([taken.cross_elevation_rad, taken.elevation_rad])
        centre, sigma = values[[X, Y]], self.sigma(values)
        away = used & (np.hypot(*(offsets - centre).T) > reach)
        if int(away.sum()) < FEWEST:
            return None
        best: tuple[float, Array] = (8.0, centre)
        trial = values.copy()
        # At most 200 of the places that the beam was at.
        step = 0.35 * width
        for place in step * np.unique(np.round(offsets[away] / step), axis=0)[:200]:
            trial[X], trial[Y] = place
            shape = values[LEVEL] * self.gain(trial) / sigma
            near = used & (np.hypot(*(offsets - place).T) < width)
            power = float(np.sum(shape[near] ** 2))
            # Seen in most of its beam: a single burst is edited as interference.
            if int(near.sum()) < FEWEST or not power:
                continue
            level = float(np.sum((shape * residual)[near])) / power
            robust = float(np.median((residual / np.maximum(shape, 1e-12))[near]))
            snr = level * math.sqrt(power)
            strong = level > 0.02 and robust > 0.5 * level and snr > best[0]
            if strong and np.hypot(*(place - centre)) > reach:
                best = snr, place
        if best[1] is centre:
            return None
        x, y = best[1].tolist()
        return (x, y), np.asarray(np.hypot(*(offsets - best[1]).T) < width)

    def require_seen(self, values: Array, covariance: Array, used: NDArray[np.bool_]) -> None:
        """Raise ValueError where nothing in the scan rises like the beam."""
        snr = float(values[LEVEL] / math.sqrt(covariance[LEVEL, LEVEL]))
        if self.params.carrier:
            # Noise has a power, too, where no carrier is: only what rises above a constant is seen.
            taken, flat = self.samples.kept(used), 1.0 / self.sigma(values)[used]
            beam = taken.strength * self.gain(values, taken) * flat
            beam -= flat * float(beam @ flat) / float(flat @ flat)
            snr = float(beam @ (taken.power * flat)) / math.sqrt(float(beam @ beam) + 1e-300)
        if not snr >= (least := self.params.least_snr):
            words = f"its level is {snr:.1f} sigma, must be >= {least:g}"
            raise ValueError(f"no source was seen: {words}")

    def judge(
        self, values: Array, covariance: Array, residual: Array, used: NDArray[np.bool_]
    ) -> None:
        """Refuse a scan whose samples contradict its model, by the name of the likely cause."""
        params, taken, width = self.params, self.samples.kept(used), float(values[WIDTH])
        self.require_seen(values, covariance, used)
        if not NARROWEST <= width / self._beamwidth <= WIDEST:
            raise ValueError(
                f"the beam is {math.degrees(width):.3f} deg wide, must be {NARROWEST:g} to "
                f"{WIDEST:g} times the {math.degrees(self._beamwidth):.3f} deg of the band"
            )
        nearest = np.hypot(
            values[X] - taken.cross_elevation_rad, values[Y] - taken.elevation_rad
        ).min()
        across, up = taken.cross_elevation_rad, taken.elevation_rad
        inside = across.min() <= values[X] <= across.max() and up.min() <= values[Y] <= up.max()
        # Between two rows of a nine-point scan nothing is nearer than half a spacing.
        if nearest > (0.75 if inside else 0.5) * width + params.radius_rad:
            raise ValueError(
                f"the target lies {math.degrees(nearest):.3f} deg outside of the scan: "
                "scan wider, or from there"
            )
        self._judge_time(values, residual, used)
        self._judge_baseline(values, residual, used)

    def _judge_time(self, values: Array, residual: Array, used: NDArray[np.bool_]) -> None:
        """Refuse time tags that are late: the peak is then moved against the beam's motion."""
        taken = self.samples
        rates = [
            np.gradient(part, taken.t_s)
            for part in (taken.cross_elevation_rad, taken.elevation_rad)
        ]
        step_s = 1e-3
        moved = taken._replace(
            cross_elevation_rad=taken.cross_elevation_rad - rates[0] * step_s,
            elevation_rad=taken.elevation_rad - rates[1] * step_s,
        )
        slope = (self.model(values, moved) - self.model(values)) / step_s / self.sigma(values)
        columns = self._columns(values)[used]
        # What the other unknowns explain of it is not a late tag.
        fitted, *_ = np.linalg.lstsq(columns, np.column_stack([slope, residual])[used], rcond=None)
        left = np.column_stack([slope, residual])[used] - columns @ fitted
        power = float(left[:, 0] @ left[:, 0])
        if power <= 1e-6 * float(slope[used] @ slope[used]):
            return
        late_s, sigma_s = float(left[:, 0] @ left[:, 1]) / power, power**-0.5
        speed = float(np.sqrt(np.mean(rates[0][used] ** 2 + rates[1][used] ** 2)))
        if abs(late_s) > 6.0 * sigma_s and abs(late_s) * speed > 0.04 * float(values[WIDTH]):
            word = "late" if late_s > 0.0 else "early"
            raise ValueError(
                f"the time tags of the powers are {abs(late_s):.2f} s {word} against the axes: "
                "the peak lies elsewhere on the way back"
            )

    def _columns(self, values: Array) -> Array:
        sigma, model = self.sigma(values), self.model(values)
        columns, units = [], self._units()
        for index in self.free("ellipse"):
            trial = values.copy()
            trial[index] += 1e-5 * units[index]
            columns.append((self.model(trial) - model) / (1e-5 * sigma))
        return np.column_stack(columns)

    def _judge_baseline(self, values: Array, residual: Array, used: NDArray[np.bool_]) -> None:
        """Refuse power that comes and goes off the source: rain, clouds, or a gain that drifts."""
        off = used & (self.gain(values) < 0.1)
        if self.params.carrier or int(off.sum()) < 4 * FEWEST:
            return
        parts = np.array_split(np.flatnonzero(off), 12)
        means = np.array([np.mean(residual[part]) for part in parts])
        counts = np.array([len(part) for part in parts])
        chi_squared = float(np.sum(counts * means**2)) / len(parts)
        sigma = self.sigma(values)
        swing = max(abs(float(np.mean((residual * sigma)[part]))) for part in parts)
        if chi_squared > 6.0 and swing > 0.02 * float(values[LEVEL]):
            raise ValueError(
                f"off the source the power comes and goes by {swing / values[LEVEL]:.0%} of the "
                "source's: rain, clouds, a gain that drifts, or the air near the horizon"
            )


def _clipped(samples: Samples) -> NDArray[np.bool_]:
    """Return the samples (n,) at a ceiling: noise never gives the largest power many times."""
    at_top = samples.power >= samples.power.max()
    return np.asarray(at_top if int(at_top.sum()) >= 4 else np.zeros(len(at_top), dtype=bool))


def _noise_law(samples: Samples) -> tuple[float, float, float]:
    """Return c0, c1, c2 >= 0 of the variance over the power, that of the stated sigmas."""
    from scipy.optimize import nnls

    power, variance = np.maximum(samples.power, 0.0), samples.sigma**2
    top = max(float(power.max()), 1e-300)
    columns = np.column_stack([np.ones_like(power), power / top, (power / top) ** 2])
    found, _ = nnls(columns / variance[:, None], np.ones_like(variance))
    return float(found[0]), float(found[1] / top), float(found[2] / top**2)


def _inverse(information: Array, names: list[str]) -> Array:
    """Return the covariance; ValueError names the unknowns that the scan leaves open."""
    scale = np.sqrt(np.diagonal(information))
    if not (scale > 0.0).all():
        raise ValueError(f"the scan does not determine {names[int(np.argmin(scale))]}")
    scaled = information / np.outer(scale, scale)
    eigenvalues, vectors = np.linalg.eigh(scaled)
    if eigenvalues[0] < SINGULAR:
        weak = [name for name, part in zip(names, np.abs(vectors[:, 0]), strict=True) if part > 0.3]
        raise ValueError(
            f"the scan does not determine {' and '.join(weak)}: the beam was at too few places"
        )
    return np.asarray(np.linalg.inv(scaled) / np.outer(scale, scale))
