"""Systematic errors of the data that the terms would take in, by name and size.

A wrong site, refraction applied twice and a wrong clock look like a mount: the fit absorbs most of
them, and its residuals and sigmas look fine.  Each leaves a trace of its own:

* refraction R(E) is not a sum of 1, cos E and sin E below 20 deg of elevation;
* an antenna at another place sees every pass displaced by the same metres;
* a late pass is displaced along its track, by kilometres where the others are within metres;
* time tags that are late in all passes move both axes by one time, and the ranges with them;
* a wrong north turns all azimuths, by more than a mount is ever off.

With the partials D of a suspect next to those of the terms and of the passes' errors, its size is
estimated like a term.  The suspect that explains most is named.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration.fit_problem import FitProblem
from rf_pointing.calibration.fit_result import FitResult
from rf_pointing.calibration.observations import Observations, north_text
from rf_pointing.calibration.outlying_passes import MEASURABLE_FROM, without_pass
from rf_pointing.calibration.pass_errors import PassPriors, site_partials
from rf_pointing.calibration.pipeline import TrackedPass
from rf_pointing.core import wrap_rad
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.core.types import Array

# A suspect must be this many sigma off, and as large as this to matter.
_SURE_SIGMA = 5.0
_LEAST_REFRACTION, _WRONG_REFRACTION = 0.05, 0.3
_LEAST_SITE_M = 20.0
_LEAST_CLOCK_S = 0.05
# Lags of two axes are equal by chance in one of 30 mounts, if they are known as well as this.
_EQUAL_SIGMA, _EQUAL_SHARE, _EQUAL_S = 3.0, 0.01, 0.01
# A mount's azimuth is surveyed to a fraction of a degree; declination and convergence are larger.
_LARGEST_NORTH_RAD = np.radians(2.0)
_TURNED_SPREAD_RAD = np.radians(1.0)
# Ratio of sigma to a median of absolute values, and the fewest others that can judge one value.
_MEDIAN_TO_SIGMA, _FEWEST_OTHERS = 1.4826, 4
_LEAST_LATE_S, _FARTHEST, _JUDGED = 0.015, 3, 1.5
_FEWEST_RANGED = 20


@dataclass(frozen=True)
class SystematicError:
    """A systematic error: `size` and `sigma` in `unit`, a sentence, whether to refuse the fit."""

    kind: str
    size: float
    sigma: float
    unit: str
    text: str
    refuse: bool


def refraction_and_site(fit: FitResult, points: Observations, refraction: RadioRefraction) -> SystematicError | None:
    """Return the wrong refraction or the wrong site that explains the residuals best, if any does.

    `refraction` is that of the station's air; it has been added to the reference or not.
    """
    bending = refraction.apply(points.true_elevation_rad) - points.true_elevation_rad
    columns = {"refraction": np.stack([np.zeros_like(bending), bending])[..., np.newaxis]}
    if points.range_m is not None and points.range_rate_m_s is not None:
        columns["site"] = np.stack(site_partials(points))
    estimates = _estimates(fit, points, columns)
    kind, estimate = max(estimates.items(), key=lambda item: item[1].gain)
    if estimate.gain <= _SURE_SIGMA**2:
        return None
    return _refraction(estimate) if kind == "refraction" else _site(estimate)


def common_clock(fit: FitResult, known: Mapping[str, float]) -> SystematicError | None:
    """Return the clock error that both lags of `fit` show alike, beyond the lags in `known`."""
    lags = ("azimuth_velocity_lag", "elevation_velocity_lag")
    if any(name not in fit.names for name in lags):
        return None
    places = [fit.names.index(name) for name in lags]
    moved = fit.values[places] - [known[name] for name in lags]
    covariance = fit.covariance[np.ix_(places, places)]
    apart = float(np.sqrt(np.array([1.0, -1.0]) @ covariance @ [1.0, -1.0]))
    weight = np.linalg.solve(covariance, np.ones(2))
    size, sigma = float(weight @ moved / np.sum(weight)), float(np.sum(weight) ** -0.5)
    # A delay of 0.5 s is not a pure lag: its third order and the means of 10 s leave some ms.
    equal = abs(moved[0] - moved[1]) < _EQUAL_SIGMA * apart + _EQUAL_SHARE * abs(size)
    if not equal or abs(size) < max(_LEAST_CLOCK_S, _SURE_SIGMA * sigma):
        return None
    return SystematicError(
        "clock", -size, sigma, "s",
        f"both axes lag by the same {size:+.3f} +/- {sigma:.3f} s in all passes: the time tags are "
        f"{_late(-size)}, or the mount delays both axes alike, which angles do not tell apart",
        refuse=apart < _EQUAL_S,
    )  # fmt: skip


def clock_by_ranges(passes: Sequence[TrackedPass]) -> SystematicError | None:
    """Return the clock error that the measured ranges of all passes have in common, if any.

    A range is wrong by its rate times the clock error, whatever the mount does; along-track errors
    of the orbits do the same, but differ from pass to pass.
    """
    late = []
    for one in passes:
        if "range_m" not in one.residuals or len(one.track.t_s) < _FEWEST_RANGED:
            continue
        rate = one.track.range_rate_m_s
        left = one.residuals["range_m"] - np.median(one.residuals["range_m"])
        good = np.abs(left) < 10.0 * max(_MEDIAN_TO_SIGMA * float(np.median(np.abs(left))), 1.0)
        # Next to a bias of the ranges, which every station has.
        late.append(-float(np.polyfit(rate[good], one.residuals["range_m"][good], 1)[0]))
    if len(late) < _FEWEST_OTHERS:
        return None
    size, sigma = float(np.mean(late)), float(np.std(late, ddof=1) / np.sqrt(len(late)))
    if abs(size) < max(_LEAST_CLOCK_S, _SURE_SIGMA * sigma):
        return None
    return SystematicError(
        "clock", size, sigma, "s",
        f"the ranges of all passes are {_late(size)} (+/- {sigma:.3f} s): the time tags are wrong, and the lags with them",
        refuse=True,
    )  # fmt: skip


def wrong_north(points: Observations, convergence_rad: float) -> SystematicError | None:
    """Return the turn of all azimuths that no mount has; `convergence_rad` is that of the grid."""
    size, sigma = _turn(points)
    if abs(size) < _LARGEST_NORTH_RAD or sigma > _TURNED_SPREAD_RAD:
        return None
    return SystematicError(
        "north", float(np.degrees(size)), float(np.degrees(sigma)), "deg", _north(size, convergence_rad), True
    )


def north_doubt(fit: FitResult, convergence_rad: float) -> SystematicError | None:
    """Return an azimuth offset that is the convergence of the grid within its sigma."""
    if "azimuth_offset" not in fit.names:
        return None
    size, sigma = fit.coefficients["azimuth_offset"], fit.sigma_of("azimuth_offset")
    if abs(size) < np.radians(1.0) and not (
        abs(convergence_rad) > 20.0 * sigma and abs(size + convergence_rad) < _EQUAL_SIGMA * sigma
    ):
        return None
    text = _north(size, convergence_rad) + "; the term azimuth_offset takes it off"
    return SystematicError("north", float(np.degrees(size)), float(np.degrees(sigma)), "deg", text, refuse=False)


def late_passes(fit: FitResult, points: Observations) -> dict[int, SystematicError]:
    """Return the passes that are displaced along their track far more than the others are."""
    if fit.pass_priors is None or len(fit.pass_errors) <= _FEWEST_OTHERS:
        return {}
    by_clock = "clock_s" in fit.pass_priors.names
    name = "clock_s" if by_clock else "along_track_m"
    if name not in fit.pass_priors.names:
        return {}
    start = _searched_from(fit.pass_priors)
    values = np.array([one.values[name] for one in fit.pass_errors])
    found = {}
    # Only the farthest: each costs a search for the sizes of the others.
    apart = np.abs(values - np.median(values))
    far = np.flatnonzero(apart > _JUDGED * _MEDIAN_TO_SIGMA * np.median(apart))
    for k in far[np.argsort(-apart[far])][:_FARTHEST].tolist():
        number = fit.pass_errors[k].pass_id
        speed = 1.0 if by_clock else _ground_speed(points, number)
        along, sigma, size = without_pass(fit, start, k, name)
        usual = max(size, _LEAST_LATE_S * speed)
        if abs(along) < _SURE_SIGMA * float(np.hypot(usual, sigma)):
            continue
        late = -along / speed
        what = "" if by_clock else f", or its target {abs(along) / 1e3:.2f} km off along the track"
        text = f"pass {number} is {_late(late)} where the others are within {usual / speed:.3f} s{what}"
        found[number] = SystematicError("late pass", late, sigma / speed, "s", text, refuse=False)
    return found


@dataclass(frozen=True, eq=False)
class _Estimate:
    values: Array
    sigma: Array
    gain: float


def _estimates(fit: FitResult, points: Observations, columns: Mapping[str, Array]) -> dict[str, _Estimate]:
    """Return the size of each suspect next to all terms, and by how much it lowers chi-square."""
    widths = [part.shape[-1] for part in columns.values()]
    problem = FitProblem(points, fit.names, dict(fit.held), dict(fit.priors), fit.pass_priors, fit.form)
    factor = problem.factor_with(fit, np.concatenate(list(columns.values()), axis=-1))
    scale = 1.0 if fit.noise is None else max(1.0, 0.5 * (fit.noise[0].factor + fit.noise[1].factor))
    found, start = {}, len(fit.names)
    # The triangle's columns are terms, suspects and the right side: each suspect is tried alone.
    terms, right = factor[:, : len(fit.names)], factor[:, -1]
    basis, _ = np.linalg.qr(terms / np.linalg.norm(terms, axis=0))
    for (kind, _), width in zip(columns.items(), widths, strict=True):
        own = factor[:, start : start + width]
        start += width
        # What is left of them once the terms are in; the right side needs no such step.
        own = own - basis @ (basis.T @ own)
        inverse, explained = np.linalg.inv(own.T @ own), own.T @ right
        values = inverse @ explained
        gain = float(values @ explained) / scale
        found[kind] = _Estimate(values, np.sqrt(scale * np.diag(inverse)), gain)
    return found


def _refraction(estimate: _Estimate) -> SystematicError | None:
    size, sigma = float(estimate.values[0]), float(estimate.sigma[0])
    if abs(size) < _LEAST_REFRACTION:
        return None
    wrong = abs(size) > _WRONG_REFRACTION
    if size > 0.0:
        cause = "was it removed from the reference, or added to the angles twice?"
    else:
        cause = "was it removed from the angles already (--refraction-removed)?"
    cause = cause if wrong else "give --weather"
    text = f"the angles contain {size:+.2f} +/- {sigma:.2f} of the refraction more than the reference: {cause}"
    return SystematicError("refraction", size, sigma, "of the refraction", text, refuse=wrong)


def _site(estimate: _Estimate) -> SystematicError | None:
    east, north, up = estimate.values.tolist()
    size = float(np.linalg.norm(estimate.values))
    sigma = float(np.sqrt(np.sum((estimate.values * estimate.sigma) ** 2))) / size
    if size < _LEAST_SITE_M:
        return None
    text = (
        f"the antenna is {size:.0f} +/- {sigma:.0f} m away from the site given: {east:+.0f} m east, {north:+.0f} m north, "
        f"{up:+.0f} m up of it"
    )
    return SystematicError("site", size, sigma, "m", text, refuse=True)


def _turn(points: Observations) -> tuple[float, float]:
    """Return the median azimuth residual and its spread over the passes."""
    turns = [float(np.median(points.residual_azimuth_rad[points.pass_id == number])) for number in points.passes]
    size = float(np.median(turns))
    return size, _MEDIAN_TO_SIGMA * float(np.median(np.abs(wrap_rad(np.array(turns) - size))))


def _north(size_rad: float, convergence_rad: float) -> str:
    return f"{north_text(size_rad)} The convergence of the UTM grid here is {np.degrees(convergence_rad):+.2f} deg"


def _searched_from(priors: PassPriors) -> PassPriors:
    """Return the same errors with sizes that are larger than any that occurs."""
    wide = {**dict(zip(MEASURABLE_FROM.names, MEASURABLE_FROM.sigma.tolist(), strict=True)), "clock_s": 1.0}
    return priors.replace(**{name: wide.get(name, getattr(priors, name)) for name in priors.names})


def _ground_speed(points: Observations, number: int) -> float:
    """Return the speed (m/s) of the target of a pass as seen from the ground."""
    chosen = points.select(points.pass_id == number)
    range_m, rate = np.asarray(chosen.range_m), np.asarray(chosen.range_rate_m_s)
    turning = np.hypot(chosen.azimuth_rate_rad_s * np.cos(chosen.true_elevation_rad), chosen.elevation_rate_rad_s)
    return float(np.median(np.hypot(range_m * turning, rate)))


def _late(seconds: float) -> str:
    return f"{abs(seconds):.3f} s {'late' if seconds > 0.0 else 'early'}"
