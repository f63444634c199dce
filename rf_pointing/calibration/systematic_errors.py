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

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.fit_problem import FitProblem
from rf_pointing.calibration.fit_result import FitResult, Nuisance
from rf_pointing.calibration.mount import risen
from rf_pointing.calibration.observations import Observations, north_text
from rf_pointing.calibration.outlying_passes import MEASURABLE_FROM, free_errors
from rf_pointing.calibration.pass_errors import PassPriors, site_partials
from rf_pointing.calibration.pipeline import TrackedPass
from rf_pointing.core import Array, Pair, RadioRefraction, wrap_rad

Places = NDArray[np.int64]

# A suspect must be this many sigma off, and as large as this to matter.
_SURE_SIGMA = 5.0
_LEAST_REFRACTION, _WRONG_REFRACTION = 0.05, 0.3
_LEAST_SITE_M, FAR_SITE_M, _SITE_SIGMA_M = 20.0, 1000.0, 1e4
_LEAST_CLOCK_S = 0.05
# Lags of two axes are equal by chance in one of 30 mounts, if they are known as well as this.
_EQUAL_SIGMA, _EQUAL_SHARE, _EQUAL_S = 3.0, 0.01, 0.01
# A mount's azimuth is surveyed to a fraction of a degree; declination and convergence are larger.
_LARGEST_NORTH_RAD = np.radians(2.0)
_TURNED_SPREAD_RAD = np.radians(1.0)
# Ratio of sigma to a median of absolute values, and the fewest others that can judge one value.
_MEDIAN_TO_SIGMA, _FEWEST_OTHERS = 1.4826, 4
# By which clocks are off; by which passes scatter, 110 m to 7 km along the track.
_LATE_S, _SCATTER_S, _LEAST_LATE_S = (
    (0.2, 2.0, 20.0), tuple(0.015 * 2.0 ** (0.5 * k) for k in range(13)), 0.015,
)  # fmt: skip
# -ln of the probability that some passes are late.
_MOST_GROUPS, _GROUP_COST, _ALONE = 5, 2.0, 2
# Sigma beyond the lateness that is named in half of the campaigns: 95 of 100.
_NAMED_SIGMA = 3.0
# Chi-square by which an explanation is better than by chance in a hundred fits.
_LIKELY = 12.0
# Chi-square by which a clock must be better before it is reported.
_HINT = 4.0
# A clock that is farther off shows by itself.
_OPEN_S = 3.0
# What two acceleration lags may leave of chi-square for one clock; imaginary part of a real root.
_ONE_CLOCK, _REAL = 12.0, 1e-4
# Lags of mounts, and the steps by which the times of a clock are tried.
_LAG_S, _LAG_S2, _TIMES = 0.5, 0.3, 4000
# So much likelier is sure.
_ODDS = 20.0
_FEWEST_RANGED = 20


class WrongDataError(ValueError):
    """Data whose systematic errors, of these `kinds`, would spoil a fit."""

    def __init__(self, text: str, kinds: frozenset[str]) -> None:
        super().__init__(text)
        self.kinds = kinds


@dataclass(frozen=True)
class SystematicError:
    """A systematic error: `size` and `sigma` in `unit`, a sentence, whether to refuse the fit."""

    kind: str
    size: float
    sigma: float
    unit: str
    text: str
    refuse: bool


def refraction_and_site(
    fit: FitResult, points: Observations, refraction: RadioRefraction
) -> tuple[SystematicError | None, dict[str, float]]:
    """Return the wrong refraction if it explains the residuals best, and the gains of both.

    A gain is that in chi-square of "refraction" and of "site".

    `refraction` is that of the station's air; it has been added to the reference or not.
    """
    columns = {"refraction": _bending(points, refraction)}
    free = any(one.name == "site" for one in fit.nuisances)
    if not free and points.range_m is not None and points.range_rate_m_s is not None:
        columns["site"] = np.stack(site_partials(points))
    estimates = _estimates(fit, points, columns)
    kind, estimate = max(estimates.items(), key=lambda item: item[1].gain)
    gains = {name: one.gain for name, one in estimates.items()}
    # The lesser one takes in what the other explains.
    if kind == "refraction" and estimate.gain > _SURE_SIGMA**2:
        return _refraction(estimate), {"refraction": estimate.gain, "site": 0.0}
    return None, {"site": 0.0} | gains


def site_nuisance(points: Observations) -> Nuisance:
    """Return that the antenna is anywhere within ten kilometres of its site."""
    return Nuisance("site", np.stack(site_partials(points)), np.full(3, _SITE_SIGMA_M))


def far_site(fit: FitResult) -> bool:
    """Return whether a fit with `site_nuisance` shows the antenna so far away that all is off.

    Kilometres make late passes and clocks of their own, and 45 mdeg of tilt for each five.  The
    height does not count: refraction that is applied twice or not at all looks like 3 km of it.
    """
    values, covariance = fit.nuisance_values[-3:], fit.nuisance_covariance[-3:, -3:]
    sure = values @ np.linalg.solve(covariance, values) > _SURE_SIGMA**2
    return bool(sure and np.hypot(values[0], values[1]) > FAR_SITE_M)


def wrong_site(fit: FitResult, gain_before: float, away_m: Array) -> SystematicError | None:
    """Return the wrong site that a fit with `site_nuisance`, its last one, shows.

    `away_m` (3,) are taken off its reference already.  The sizes of the orbit errors are those next
    to it: with a wrong site they are too large, and hide it.  Few satellites make them too small,
    so the chi-square that it gained with the sizes before counts too.
    """
    values, covariance = away_m + fit.nuisance_values[-3:], fit.nuisance_covariance[-3:, -3:]
    gain = float(values @ np.linalg.solve(covariance, values))
    if gain < _LIKELY:
        return None
    return _site(
        _Estimate(values, np.sqrt(np.diag(covariance)), gain if gain_before > _LIKELY else _LIKELY)
    )


def refraction_nuisance(
    points: Observations, refraction: RadioRefraction, sigma: float
) -> Nuisance:
    """Return that the bending is off by a share `sigma` in all passes."""
    return Nuisance("refraction", _bending(points, refraction), np.array([sigma]))


def _bending(points: Observations, refraction: RadioRefraction) -> Array:
    elevation_rad = points.sky_rad()[1]
    bending = refraction.apply(elevation_rad) - elevation_rad
    if not points.mount.level:
        angles = points.motion()
        return risen(points.mount, angles[0], angles[1], bending)[..., np.newaxis]
    return np.stack([np.zeros_like(bending), bending])[..., np.newaxis]


def open_clock(fit: FitResult, known: Mapping[str, float]) -> Pair | None:
    """Return between which times (s) the tags of all passes may be late with these angles.

    With them the mount has no acceleration lags within two sigma.  None for mounts that have some,
    or without lags.
    """
    lags = _lags_beyond(fit, known)
    if lags is None or len(lags[0]) < 4:
        return None
    times = np.linspace(-_OPEN_S, _OPEN_S, _TIMES)
    left = _accelerations(lags[0], times)
    misfit = np.einsum("ti,ij,tj->t", left, np.linalg.inv(lags[1][2:, 2:]), left)
    least = float(np.min(misfit))
    near = times[misfit < least + _HINT]
    return (float(near[0]), float(near[-1])) if least <= _ONE_CLOCK else None


def _lags_beyond(fit: FitResult, known: Mapping[str, float]) -> tuple[Array, Array] | None:
    """Return x6, x13 and, where fitted, x7, x14 beyond those known, and their covariance."""
    by_number = {term.number: term.name for term in fit.model.terms if term.number}
    names = [by_number[number] for number in (6, 13, 7, 14)]
    if any(name not in fit.names for name in names[:2]):
        return None
    places = [fit.names.index(name) for name in names if name in fit.names]
    moved = fit.values[places] - [known.get(name, 0.0) for name in names[: len(places)]]
    return moved, fit.covariance[np.ix_(places, places)]


def common_clock(
    fit: FitResult, known: Mapping[str, float], taken_s: float = 0.0
) -> SystematicError | None:
    """Return the clock error that explains the lags of `fit` beyond those `known`, if one does.

    Time tags late by tau make of the lags x6, x7 of an axis

        x6 - tau,    x7 - x6 tau + tau^2 / 2

    Either both axes lag by the same time, or one tau takes the acceleration lags of both away.
    What was found is exact when `taken_s` of it is taken off the time tags of the fit already.
    """
    lags = _lags_beyond(fit, known)
    if lags is None:
        return None
    moved, covariance = lags
    return _equal_lags(moved[:2], covariance[:2, :2], taken_s) or (
        _without_acceleration(moved, covariance, taken_s) if len(moved) == 4 else None
    )


def _equal_lags(moved: Array, covariance: Array, taken_s: float) -> SystematicError | None:
    apart = float(np.sqrt(np.array([1.0, -1.0]) @ covariance @ [1.0, -1.0]))
    weight = np.linalg.solve(covariance, np.ones(2))
    size, sigma = float(weight @ moved / np.sum(weight)) - taken_s, float(np.sum(weight) ** -0.5)
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


def _without_acceleration(
    moved: Array, covariance: Array, taken_s: float
) -> SystematicError | None:
    """Return the clock error without which neither axis has an acceleration lag.

    Two times may do so: where data do not decide between them both are named.
    """
    weight = np.linalg.inv(covariance[2:, 2:])

    def misfit(tau: Array) -> Array:
        left = _accelerations(moved, tau)
        return np.asarray(np.einsum("ti,ij,tj->t", left, weight, left))

    # Chi-square is a quartic of tau, which is least at a real root of its derivative.
    ones, rates = weight @ np.ones(2), weight @ moved[:2]
    roots = np.roots(
        [
            0.5 * np.sum(ones), 1.5 * float(ones @ moved[:2]),
            float(rates @ moved[:2] + ones @ moved[2:]), float(rates @ moved[2:]),
        ]
    )  # fmt: skip
    real = np.sort(roots.real[np.abs(roots.imag) < _REAL * (1.0 + np.abs(roots))])
    times, between = real[::2], [-math.inf, *real[1::2].tolist(), math.inf]
    slopes = moved[:2] + times[:, np.newaxis]
    # Without lags no clock makes an acceleration lag, and its error is any.
    sigmas = np.maximum(np.einsum("ti,ij,tj->t", slopes, weight, slopes), 1e-12) ** -0.5
    each = np.array(
        [
            _clock_odds(moved, covariance, misfit, one, (between[k], between[k + 1]), taken_s)
            for k, one in enumerate(zip(times.tolist(), sigmas.tolist(), strict=True))
        ]
    )
    odds, best = float(np.sum(each)), int(np.argmax(each))
    tau, sigma = float(times[best] + taken_s), float(sigmas[best])
    gain, here = misfit(np.array([-taken_s]))[0] - np.min(misfit(times)), np.min(misfit(times))
    # Mounts that have acceleration lags of their own tell nothing of a clock.
    explained = here <= _ONE_CLOCK and odds > 1.0 / _ODDS
    least = _HINT if explained else _LIKELY
    if here <= _ONE_CLOCK and (abs(tau) < _LEAST_CLOCK_S or gain < least):
        return None
    lags = "s^2 and ".join(
        f"{value:+.3f} +/- {size:.3f} "
        for value, size in zip(
            _accelerations(moved, np.array([-taken_s]))[0],
            np.sqrt(np.diag(covariance))[2:],
            strict=True,
        )
    )
    if not explained:
        text = (f"the axes have acceleration lags of {lags}s^2, which a clock error does not explain: whether the time tags "
                "are late in all passes the angles do not tell, and the lags hold for this clock only")  # fmt: skip
        return SystematicError("clock", tau, sigma, "s", text, refuse=False)
    likely = np.argsort(-each)[: int(np.sum(each > each[best] / _ODDS))]
    late = " or ".join(
        f"{_late(times[k] + taken_s)} (+/- {sigmas[k]:.3f} s)" for k in likely.tolist()
    )
    text = (
        f"the time tags of all passes are {late}: with them the axes have acceleration lags of "
        f"{lags}s^2, without this error none"
    )
    if odds < _ODDS:
        text = (
            f"the time tags of all passes are {late}, or the axes have acceleration lags of "
            f"{lags}s^2, which angles do not tell apart"
        )
    return SystematicError(
        "clock", tau, sigma, "s", text, refuse=bool(gain > _SURE_SIGMA**2 or odds > 1.0)
    )


def _clock_odds(
    moved: Array, covariance: Array, misfit: Callable[[Array], Array],
    about: Pair, between: Pair, taken_s: float,
) -> float:  # fmt: skip
    """Return how much likelier than lags alone a clock `about` a time (and sigma) is, by mounts.

    Each lag of a mount is nothing or of its usual size, as likely; next to a clock it has none of
    acceleration.  A clock that an equal lag of one axis happens to cancel is unlikely.
    """
    own = np.sqrt(np.diag(covariance))

    def likely(value: Array, spread: Array, size: float) -> Any:
        wide = np.hypot(spread, size)
        return 0.5 * (_normal(value, spread) + _normal(value, wide))

    still = np.array([-taken_s])
    none = likely(moved[:2] - taken_s, own[:2], _LAG_S).prod()
    none *= likely(_accelerations(moved, still)[0], own[2:], _LAG_S2).prod()
    step = 12.0 * min(about[1], _LAG_S) / _TIMES
    each = about[0] + step * np.arange(-_TIMES / 2, _TIMES / 2)
    each = each[(each > between[0]) & (each < between[1])]
    # A lag of nothing is narrower than the steps: what is summed keeps its area.
    rates = likely(each[:, np.newaxis] + moved[:2], np.hypot(own[:2], step), _LAG_S).prod(axis=1)
    area = 2.0 * np.pi * math.sqrt(np.linalg.det(covariance[2:, 2:]))
    clock = rates * np.exp(-0.5 * misfit(each)) / area * _normal(each + taken_s, _LAG_S)
    return float(np.sum(clock) * step / max(none, 1e-300))


def _accelerations(moved: Array, tau: Array) -> Array:
    """Return the acceleration lags (t, 2) that are left when the clock is `tau` (t,) later."""
    bent = 0.5 * np.multiply.outer(tau**2, np.ones(2))
    return np.asarray(moved[2:] + np.multiply.outer(tau, moved[:2]) + bent)


def _normal(value: Any, sigma: Any) -> Any:
    return np.exp(-0.5 * (value / sigma) ** 2) / (math.sqrt(2.0 * np.pi) * sigma)


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
    if not points.mount.level:
        return None
    size, sigma = _turn(points)
    if abs(size) < _LARGEST_NORTH_RAD or sigma > _TURNED_SPREAD_RAD:
        return None
    return SystematicError(
        "north", float(np.degrees(size)), float(np.degrees(sigma)), "deg",
        _north(size, convergence_rad), True,
    )  # fmt: skip


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
    return SystematicError(
        "north", float(np.degrees(size)), float(np.degrees(sigma)), "deg", text, refuse=False
    )


def late_passes(
    fit: FitResult, points: Observations, sets: Mapping[int, str] | None = None
) -> tuple[dict[int, SystematicError], SystematicError | None, float]:
    """Return the passes whose clock is late as that of most others is not.

    `fit` has a clock in each pass (`timed`), which takes in errors along the track too.  `sets`
    names the elements of each pass, whose errors they share.  Lateness falls into groups; where
    none of them has most of the passes, the second value says so, and nobody is late.  The third
    is the lateness (s) of one pass that is named in 95 of 100 such campaigns, 0 if none is judged.
    """
    if fit.pass_priors is None or len(fit.pass_errors) <= _FEWEST_OTHERS:
        return {}, None, 0.0
    numbers = [one.pass_id for one in fit.pass_errors]
    late, covariance, labels = _lateness_of(fit, sets)
    counts = np.bincount(labels)
    most = labels == np.argmax(counts)
    usual = max(float(np.std(late[most])), _LEAST_LATE_S)
    least_s = _named_from(usual, len(late))
    if 2 * np.max(counts) <= len(late):
        first, second = (
            np.sort(late[labels == k] - np.median(late))
            for k in np.argsort(-counts, kind="stable")[:2]
        )
        text = (f"the passes are late by different times, and no time has most of them: {len(first)} and {len(second)} of "
                f"{len(late)} differ by {abs(np.median(first) - np.median(second)):.3f} s")  # fmt: skip
        return {}, SystematicError(
            "late pass", float(np.median(first) - np.median(second)), usual, "s", text, refuse=True
        ), least_s  # fmt: skip
    late -= np.mean(late[most])
    apart = np.eye(len(late)) - most / np.sum(most)
    sigma = np.sqrt(np.diag(apart @ covariance @ apart.T))
    found = {}
    for k in np.flatnonzero(~most).tolist():
        what = ""
        if points.range_m is not None and points.range_rate_m_s is not None:
            off_km = abs(late[k]) * _ground_speed(points, numbers[k]) / 1e3
            what = f", or its target {off_km:.2f} km off along the track"
        text = (
            f"pass {numbers[k]} is {_late(late[k])} where the others are within {usual:.3f} s{what}"
        )
        found[numbers[k]] = SystematicError(
            "late pass", float(late[k]), float(sigma[k]), "s", text, refuse=False
        )
    return found, None, least_s


def scatter_of_lateness(fit: FitResult, sets: Mapping[int, str]) -> float:
    """Return by how much (s) the passes of `fit` scatter about the times of their groups."""
    late, _, labels = _lateness_of(fit, sets)
    groups = [late[labels == k] for k in np.unique(labels)]
    square = sum(float(np.sum((one - np.mean(one)) ** 2)) for one in groups)
    return math.sqrt(square / max(len(late) - len(groups), 1))


def _lateness_of(fit: FitResult, sets: Mapping[int, str] | None) -> tuple[Array, Array, Places]:
    """Return lateness (g,) of the passes of a fit (`timed`), its covariance, and their groups."""
    clocks, covariance = free_errors(fit, _searched_from(fit.pass_priors or timed(None)), "clock_s")
    numbers, late = [one.pass_id for one in fit.pass_errors], -clocks
    names = [(sets or {}).get(number, f"pass {number}") for number in numbers]
    sets_of = np.unique(names, return_inverse=True)[1].astype(np.int64)
    return late, covariance, _groups_of(late, covariance, sets_of)


def _named_from(scatter_s: float, count: int) -> float:
    """Return by how much one of `count` passes must be late to be named, the others scattering.

    A share f of them late by d raises the likelihood by count / 2 ln(1 + f (1 - f) (d / s)^2) and
    costs their choice and the breadth of what lateness may be.
    """
    apart = 1.0 / count - count**-2.0
    cost = _GROUP_COST + math.log(count * max(_LATE_S[0] / scatter_s, 1.0))
    return scatter_s * (math.sqrt(math.expm1(2.0 * cost / count) / apart) + _NAMED_SIGMA)


def timed(priors: PassPriors | None) -> PassPriors:
    """Return priors in which a clock stands for the errors along the track."""
    if priors is None:
        return PassPriors(clock_s=1.0)
    return priors.replace(along_track_m=0.0, clock_s=1.0)


def _groups_of(late: Array, covariance: Array, sets: Places) -> Places:
    """Return the group (g,) of each pass by its lateness.

    Groups are of greatest likelihood for passes that scatter, those of one set of elements together
    too, and for groups that are late by any time.  More of them must be worth their number.
    """
    count = len(late)
    likely = _Lateness.of(late, covariance, sets)
    own = np.array(
        [
            float(np.median(late[sets == one])) if np.sum(sets == one) > _ALONE else 0.0
            for one in sets
        ]
    )
    labels = np.zeros(count, dtype=np.int64)
    best = (likely.of_groups(labels), 0, labels)
    for values in (late, late - own):
        order, cuts = np.argsort(values, kind="stable"), list[int]()
        for _ in range(min(_MOST_GROUPS, count // 2) - 1):
            tried = []
            for cut in sorted({*range(1, count)} - {*cuts}):
                labels = np.zeros(count, dtype=np.int64)
                labels[order] = np.searchsorted(np.sort([*cuts, cut]), np.arange(count), "right")
                tried.append((likely.of_groups(labels), -cut, labels))
            # The widest gap is often between two late passes.
            found = max(tried, key=lambda one: one[:2])
            cuts.append(-found[1])
            best = max(best, found, key=lambda one: one[0])
    return best[2]


@dataclass(frozen=True, eq=False)
class _Lateness:
    """The likelihood of lateness for each scatter (s,) of passes and of sets of elements."""

    late: Array
    inverse: Array
    log_determinant: Array

    @classmethod
    def of(cls, late: Array, covariance: Array, sets: Places) -> "_Lateness":
        together = (sets[:, np.newaxis] == sets).astype(np.float64)
        scatter = np.array(list(product(_SCATTER_S, (0.0, *_SCATTER_S[2::4]))))[..., np.newaxis]
        every = np.stack([np.eye(len(late)), together])
        total = covariance + np.tensordot(scatter[..., 0] ** 2, every, axes=1)
        return cls(late, np.asarray(np.linalg.inv(total)), np.linalg.slogdet(total)[1])

    def of_groups(self, labels: Places) -> float:
        """Return that of groups which are each late by any time, less what choosing them costs."""
        sizes, count = np.bincount(labels), len(labels)
        others = np.delete(sizes, np.argmax(sizes))
        cost = sum(_GROUP_COST + math.log(math.comb(count, k)) for k in others.tolist())
        seen = self.inverse @ self.late
        misfit, best = seen @ self.late + self.log_determinant, []
        if len(sizes) == 1:
            return -0.5 * float(np.min(misfit))
        group = np.eye(len(sizes))[labels]
        right: Any = seen @ group
        for late_s in _LATE_S:
            own = group.T @ self.inverse @ group + late_s**-2.0 * np.eye(len(sizes))
            gain = np.einsum(
                "si,si->s", right, np.linalg.solve(own, right[..., np.newaxis])[..., 0]
            )
            size = np.linalg.slogdet(own)[1] + 2.0 * len(sizes) * math.log(late_s)
            best.append(np.min(misfit - gain + size))
        return -0.5 * float(min(best)) - cost


@dataclass(frozen=True, eq=False)
class _Estimate:
    values: Array
    sigma: Array
    gain: float


def _estimates(
    fit: FitResult, points: Observations, columns: Mapping[str, Array]
) -> dict[str, _Estimate]:
    """Return the size of each suspect next to all terms, and by how much it lowers chi-square."""
    widths = [part.shape[-1] for part in columns.values()]
    problem = FitProblem(
        points, fit.names, dict(fit.held), dict(fit.priors), fit.pass_priors, fit.form, fit.shared,
        fit.nuisances,
    )  # fmt: skip
    factor = problem.factor_with(fit, np.concatenate(list(columns.values()), axis=-1))
    scale = (
        1.0 if fit.noise is None else max(1.0, 0.5 * (fit.noise[0].factor + fit.noise[1].factor))
    )
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
    return SystematicError(
        "site", size, sigma, "m", text, refuse=bool(estimate.gain > _SURE_SIGMA**2)
    )


def _turn(points: Observations) -> Pair:
    """Return the median azimuth residual and its spread over the passes."""
    turns = [
        float(np.median(points.residual_azimuth_rad[points.pass_id == number]))
        for number in points.passes
    ]
    size = float(np.median(turns))
    return size, _MEDIAN_TO_SIGMA * float(np.median(np.abs(wrap_rad(np.array(turns) - size))))


def _north(size_rad: float, convergence_rad: float) -> str:
    return f"{north_text(size_rad)} The convergence of the UTM grid here is {np.degrees(convergence_rad):+.2f} deg"


def _searched_from(priors: PassPriors) -> PassPriors:
    """Return the same errors with sizes that are larger than any that occurs."""
    wide = {
        **dict(zip(MEASURABLE_FROM.names, MEASURABLE_FROM.sigma.tolist(), strict=True)),
        "clock_s": 1.0,
    }
    return priors.replace(**{name: wide.get(name, getattr(priors, name)) for name in priors.names})


def _ground_speed(points: Observations, number: int) -> float:
    """Return the speed (m/s) of the target of a pass as seen from the ground."""
    chosen = points.select(points.pass_id == number)
    range_m, rate = np.asarray(chosen.range_m), np.asarray(chosen.range_rate_m_s)
    turning = np.hypot(
        chosen.azimuth_rate_rad_s * np.cos(chosen.true_elevation_rad), chosen.elevation_rate_rad_s
    )
    return float(np.median(np.hypot(range_m * turning, rate)))


def _late(seconds: float) -> str:
    return f"{abs(seconds):.3f} s {'late' if seconds > 0.0 else 'early'}"
