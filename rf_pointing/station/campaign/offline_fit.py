"""A bias model from points and raw passes: processed, fitted, and searched for systematic errors.

Raw passes are processed until the terms stay: the points are means of what model and orbit errors
leave over, and the noise of slow residuals is known after a fit only.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.special import stdtrit

from rf_pointing import calibration
from rf_pointing.calibration import (
    BiasModel,
    FitOptions,
    FitResult,
    ModelVersion,
    Observations,
    PassPriors,
    PriorKnowledge,
    RawPasses,
    SectorRule,
    StageReport,
    TrackedPass,
    systematic_errors,
)
from rf_pointing.calibration.fit_result import Nuisance, Prior
from rf_pointing.calibration.outlying_passes import MEASURABLE_FROM
from rf_pointing.calibration.pass_errors import SharedErrors, seen_from
from rf_pointing.calibration.systematic_errors import SystematicError, WrongDataError
from rf_pointing.calibration.terms import names_of
from rf_pointing.core import DAY_S, LEVEL, MDEG, Kinematics, RadioRefraction
from rf_pointing.ephemeris import Elements, ElementUncertainty, Site, find_elements
from rf_pointing.station.campaign.log import priors_near
from rf_pointing.station.campaign.wrong_causes import cause_of

# Rounds of pipeline and fit; in sigma, what the last one may still have moved a term.
MOST_ROUNDS, SETTLED = 6, 0.05
# Shares by which the bending of standard air, and of measured weather, is off.
AIR_SIGMA, WEATHER_SIGMA = 0.1, 0.03
# Chi-square that a wrong site or wrong air must gain to be free in the fit.
MAYBE_WRONG = 4.0
# A size measured from n sets of elements holds 68 and 95 % when it is 1 + 1.25 / (n - 1) times as
# large: Student's t.
FEW_SETS = 1.25
# Elements are three times worse than they should be in one of 400 sets.
AGE_FACTOR = 3.0
FEWEST_FOR_SIZES, FEWEST_SATELLITES = 8, 4
# Causes whose size is that of a fit next to them.
MEASURED = frozenset({"clock", "site"})
# A site that moves by less than this is where the fit has it.
SETTLED_M = 100.0
# So few passes cannot judge one of them by the others.
FEWEST_TIMED = 4
FEWEST_HELD_OUT = 4
# With fewer rows of a table of offsets a wrong one does not show.
FEWEST_ROWS = 3
ANY_RAD = 0.5 * math.pi


@dataclass(frozen=True, kw_only=True)
class FitRequest:
    """Data and terms of a fit, their antenna, and prior knowledge.

    Attributes
    ----------
    station, band, site : owner of the data; data of another one are refused.
    terms : the terms offered, by default the 14 of the `mount`; the others keep the values of
        `known`, or zero.
    select : choose among them by BIC.  held_out : predict each pass by a fit without it.
    form : of the model, "printed" or "rotation".  robust : Huber weights instead of squares.
    orbit_prior_m : orbit error that the fit allows for in each pass, along, across and radially;
        None: as large as the passes show it.
    time_error_s : lateness of the time tags of files, known and taken off; None: unknown, and
        equal lags of both axes are refused.
    refraction : air of the data of files; None: their angles are free of it.
    sectors : take 25 to 30 points of each sector of the sky; require_full : refuse empty sectors.
    known : the best model known, the prior of every term.
    elements : of the targets, () if they are not known.
    """

    station: str
    band: str
    site: Site
    terms: tuple[str, ...] = calibration.TERM_NAMES
    select: bool = False
    held_out: bool = False
    form: Literal["printed", "rotation"] = "rotation"
    robust: bool = False
    orbit_prior_m: float | None = None
    time_error_s: float | None = None
    refraction: RadioRefraction | Literal["standard"] | None = "standard"
    sectors: bool = False
    require_full: bool = False
    known: ModelVersion | None = None
    elements: Sequence[Elements] = ()
    mount: Kinematics = LEVEL

    def __post_init__(self) -> None:
        if self.terms == calibration.TERM_NAMES:
            object.__setattr__(self, "terms", names_of(self.mount.type))

    @property
    def model(self) -> BiasModel:
        """The best model known; that of a perfect antenna without one."""
        return self.known.model.on(self.mount) if self.known else BiasModel.zero(self.mount)

    @property
    def coefficients(self) -> dict[str, float]:
        """Its terms."""
        return dict(self.model.coefficients)

    @property
    def convergence_rad(self) -> float:
        """The angle from true to UTM grid north at the station."""
        place, width = self.site, np.radians(6.0)
        east = place.longitude_rad - width * (np.floor(place.longitude_rad / width) + 0.5)
        return float(np.arctan(np.tan(east) * np.sin(place.latitude_rad)))


@dataclass(frozen=True, eq=False)
class FitData:
    """Calibration points (None without any) and raw passes; `recorded` by the station itself.

    The station's own recordings have one clock, one site and one refraction.  `offered` are the
    terms that few points can tell apart; () where the request decides.  A choice has those of
    `always`, whatever the data show.
    """

    points: Observations | None
    passes: Sequence[TrackedPass]
    recorded: bool = False
    offered: tuple[str, ...] = ()
    always: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fit, its points, the reports of the pipeline, what was left out, and what is doubtful.

    `full` is the fit of all terms offered, None where only the chosen ones were fitted.  The data
    do not show the terms `kept`, which the chosen ones depend on.  Passes that are late by less
    than `least_late_s` need not be named; 0 where their clocks were not judged.  All of them may be
    late by times between those of `open_clock_s`; None where the clock is known.
    """

    result: FitResult
    full: FitResult | None
    points: Observations
    stages: list[StageReport]
    notes: list[str]
    warnings: list[str]
    kept: tuple[str, ...] = ()
    least_late_s: float = 0.0
    open_clock_s: tuple[float, float] | None = None


class OfflineFit:
    """One fit of one set of data; `run` gives it."""

    def __init__(self, request: FitRequest, data: FitData) -> None:
        self._request, self._data = request, data
        self._free = set[str]()
        # By how much the references of raw passes are those of another place.
        self._away_m = np.zeros(3)
        # Passes are late, where a place far off was another explanation.
        self._at_place = False
        self._first = int(np.max(data.points.pass_id)) + 1 if data.points is not None else 0

    @cached_property
    def _raw(self) -> RawPasses | None:
        return self._processed(0.0) if self._data.passes else None

    def _processed(self, late_s: float) -> RawPasses:
        """Return the pipeline of the passes as their true place sees them, without a lateness."""
        passes = self._data.passes
        if np.any(self._away_m):
            passes = [replace(one, reference=seen_from(one.reference, self._away_m)) for one in passes]
        if late_s:
            passes = [replace(one, raw=replace(one.raw, t_s=one.raw.t_s - late_s)) for one in passes]
        return RawPasses(passes, self._first)

    def run(self) -> Fitted:
        """Return the fit.

        Raises ValueError for data with a systematic error that the terms would take in, and names
        the cause where one of those that are known explains what the passes have in common.
        """
        try:
            return self._run()
        except ValueError as error:
            request = self._request
            # A fit that settles next to it measures it better than medians of distances.
            if isinstance(error, WrongDataError) and error.kinds <= MEASURED:
                raise
            # The causes are looked for among angles that are azimuth and elevation.
            if not request.mount.level:
                raise
            cause = cause_of(self._data.passes, request.elements, request.site, request.refraction)
            if not cause:
                raise
            raise ValueError(f"no model is fitted: {cause}. Without that: {error}") from error

    def _run(self) -> Fitted:
        request, passes = self._request, self._data.passes
        known, late = PriorKnowledge(model=request.model, form=request.form), dict[int, SystematicError]()
        every, stages, notes = self._collected(known, late)
        disagreement, least_s = None, 0.0
        notes += dict.fromkeys(note for one in passes for note in one.raw.notes)
        _refuse_wrong([systematic_errors.wrong_north(every, request.convergence_rad)])
        # Points alone are fitted once, and with `select` the terms need not be separable together.
        if self._data.always and len(every) < FEWEST_ROWS:
            raise ValueError(f"the table of offsets has {len(every)} rows, must have >= {FEWEST_ROWS}")
        if self._raw is None and request.select and not self._measures_orbit(every):
            result, kept = self._fit_of_chosen(every, PassPriors.of_orbit(request.orbit_prior_m or 0.0), None, None)
            return Fitted(result, None, every, stages, notes, [], kept)
        result = self._first_fit(every, known)
        judged = False
        for _ in range(MOST_ROUNDS):
            before, count = result, len(late)
            # Without the latest pass another one may stand out, and no more once none does.
            if not judged:
                if len(every.passes) > FEWEST_TIMED:
                    # A clock of its own for each pass: only their differences count.
                    timed = systematic_errors.timed(result.pass_priors)
                    clocks = self._fit_of(every, request.terms, timed, edit_sigma=0.0)
                    found, disagreement, least_s = systematic_errors.late_passes(clocks, every, self._sets)
                    late |= found
                judged = len(late) == count
            if self._raw is None and judged:
                break
            known = _known_after(result, known)
            self._move_site(result)
            every, stages, _ = self._collected(known, late)
            result = self._fit_of_all(every, before)
            if judged and np.all(np.abs(result.values - before.values) < SETTLED * result.sigma):
                break
        clock = self._common_clock(result, known, late) if request.time_error_s is None else None
        # The station's own clock is not doubted because nothing proves it.
        clock = None if self._data.recorded and clock is not None and not clock.refuse else clock
        air, gains = systematic_errors.refraction_and_site(result, every, self._air)
        if gains["refraction"] > MAYBE_WRONG:
            self._free.add("refraction")
            result = self._fit_of_all(every, result)
        site_gain = math.inf if "site" in self._free else gains["site"]
        result, site = self._at_its_site(result, every, site_gain) if site_gain > MAYBE_WRONG else (result, None)
        # A site that is far off makes late passes, and passes late by two times make a clock.
        site = None if self._at_place and disagreement else site
        far = site is not None and site.size > systematic_errors.FAR_SITE_M
        clock = None if far or disagreement else clock
        disagreement = None if far else disagreement
        reasons = self._doubtful(result, [disagreement, clock, air, site])
        warnings = [*reasons, *self._orbit_warnings(result)]
        full, kept = result, tuple[str, ...]()
        if request.select:
            result, kept = self._fit_of_chosen(every, full.pass_priors, full.shared, full)
        notes += [one.text for one in late.values()]
        unknown = request.time_error_s is None and not self._data.recorded
        open_s = systematic_errors.open_clock(full, request.coefficients) if unknown else None
        return Fitted(result, full, every, stages, notes, warnings, kept, least_s, open_s)

    def _collected(
        self, known: PriorKnowledge, out: Collection[int], late_s: float = 0.0
    ) -> tuple[Observations, list[StageReport], list[str]]:
        """Return all points but those of the passes `out`, and what the pipeline reports.

        `late_s` is taken off all time tags.
        """
        parts = [_earlier(self._data.points, late_s)] if self._data.points is not None else []
        stages: list[StageReport] = []
        notes: list[str] = []
        if self._raw is not None:
            made = (self._raw if late_s == 0.0 else self._processed(late_s)).process(known)
            parts.append(made.points)
            stages, notes = list(made.reports), list(made.notes)
        together = Observations.concatenate(parts)
        for name in ("station", "band"):
            if (found := getattr(together, name)) != (wanted := getattr(self._request, name)):
                raise ValueError(f"the data are of {name} {found!r}, must be of {wanted!r}")
        together = together.select(~np.isin(together.pass_id, list(out)))
        if self._request.sectors or self._request.require_full:
            full = self._request.require_full
            together, _, selection = calibration.select_observations([together], SectorRule(), require_full=full)
            stages.append(selection)
        return together, stages, notes

    def _measures_orbit(self, points: Observations) -> bool:
        """Return whether the sizes of the orbit errors are to be measured and can be."""
        # Without ranges a displacement in metres gives no angle.
        ranges = points.range_m is not None and points.range_rate_m_s is not None
        return self._request.orbit_prior_m is None and ranges

    def _fit_of_all(self, points: Observations, before: FitResult | None) -> FitResult:
        """Return the fit of all terms offered, with the orbit errors given or measured.

        `before` is a fit near it, from which fewer rounds are needed.
        """
        names = self._request.terms
        if not self._measures_orbit(points):
            return self._fit_of(points, names, PassPriors.of_orbit(self._request.orbit_prior_m or 0.0), before)
        last = before

        def fit(priors: PassPriors, shared: SharedErrors | None) -> FitResult:
            nonlocal last
            last = self._fit_of(points, names, priors, last, shared)
            return last

        wider = 1.0 + FEW_SETS / max(len(set(self._sets.values())) - 1, 1)
        first = MEASURABLE_FROM, self._shared()
        if before is not None and before.pass_priors:
            first = before.pass_priors, before.shared.times(1.0 / wider) if before.shared else None
        priors, shared = calibration.measured_pass_priors(fit, first=first)
        return fit(priors, shared.times(wider) if shared else None)

    def _first_fit(self, points: Observations, known: PriorKnowledge) -> FitResult:
        """Return the first fit, with the site free where the antenna is far from it.

        Passes that are late look like a place kilometres off, and the other way round: where the
        passes scatter less about the times of their groups than as seen from there, it is they.
        """
        if not self._measures_orbit(points):
            return self._fit_of_all(points, None)
        self._free.add("site")
        try:
            free = self._fit_of(points, self._request.terms, MEASURABLE_FROM, None, self._shared())
        except ValueError:
            # Few passes do not separate terms and site: the fit without it says what it lacks.
            free = None
        if free is None or not systematic_errors.far_site(free):
            self._free.discard("site")
            return self._fit_of_all(points, free)
        given, here_s = points, self._scatter_s(points)
        for _ in range(MOST_ROUNDS):
            step_m, known = self._move_site(free), _known_after(free, known)
            if step_m < SETTLED_M:
                break
            points, *_ = self._collected(known, ())
            free = self._fit_of_all(points, free)
        if here_s < self._scatter_s(points):
            self._free.discard("site")
            self._away_m, self._at_place = np.zeros(3), True
            self.__dict__.pop("_raw", None)
            return self._fit_of_all(given, None)
        return free

    def _scatter_s(self, points: Observations) -> float:
        """Return by how much passes of one group are late by different times, at this site."""
        free, self._free = self._free, self._free - {"site"}
        try:
            timed = systematic_errors.timed(MEASURABLE_FROM)
            clocks = self._fit_of(points, self._request.terms, timed, edit_sigma=0.0)
            return systematic_errors.scatter_of_lateness(clocks, self._sets)
        except ValueError:
            return math.inf
        finally:
            self._free = free

    def _move_site(self, result: FitResult) -> float:
        """See the passes from where a fit with a free site has the antenna; return how far off.

        Displacements of kilometres are not linear.
        """
        step_m = result.nuisance_values[-3:]
        if "site" not in self._free or self._data.points is not None:
            return 0.0
        self._away_m = self._away_m + step_m
        self.__dict__.pop("_raw", None)
        return float(np.linalg.norm(step_m))

    def _shared(self) -> SharedErrors | None:
        """Return the errors that passes of one satellite share, None where nothing tells them.

        With one pass each they are those of the passes, and with one satellite they are a lag.
        """
        if not 1 < len(set(self._sets.values())) < len(self._sets):
            return None
        return SharedErrors(sets=self._sets, latitude_rad=self._request.site.latitude_rad, priors=MEASURABLE_FROM)

    @cached_property
    def _sets(self) -> dict[int, str]:
        """The set of elements of each raw pass; points name no target, each has its own."""
        return {self._first + k: one.raw.target for k, one in enumerate(self._data.passes)}

    def _nuisances(self, points: Observations) -> list[Nuisance]:
        """Return what is wrong alike for all passes, where it was found to matter."""
        sigma = WEATHER_SIGMA if isinstance(self._request.refraction, RadioRefraction) else AIR_SIGMA
        found = []
        if "refraction" in self._free:
            found.append(systematic_errors.refraction_nuisance(points, self._air, sigma))
        if "site" in self._free:
            found.append(systematic_errors.site_nuisance(points))
        return found

    @cached_property
    def _air(self) -> RadioRefraction:
        air = self._request.refraction
        return air if isinstance(air, RadioRefraction) else RadioRefraction.standard(self._request.site.altitude_m)

    def _common_clock(self, result: FitResult, known: PriorKnowledge, late: Collection[int]) -> SystematicError | None:
        """Return the clock error of all passes, if the lags of `result` show one."""
        found = systematic_errors.common_clock(result, self._request.coefficients)
        for _ in range(MOST_ROUNDS):
            if found is None:
                return None
            # A delay of half a second is more than lags of that time: it is taken off, then fitted.
            taken, known = found.size, _known_after(result, known)
            points, *_ = self._collected(known, late, taken)
            result = self._fit_of(points, result.names, result.pass_priors, result, result.shared)
            found = systematic_errors.common_clock(result, self._request.coefficients, taken)
            if found is not None and abs(found.size - taken) < SETTLED * found.sigma:
                break
        return found

    def _fit_of_chosen(
        self, points: Observations, orbit: PassPriors | None, shared: SharedErrors | None, full: FitResult | None
    ) -> tuple[FitResult, tuple[str, ...]]:
        """Return the fit of the terms that the data support, and which of them others need."""
        names = self._request.terms
        held = {name: value for name, value in self._request.coefficients.items() if name not in names}
        chosen = calibration.select_terms(
            points, names, held=held, pass_priors=orbit, about=full, shared=shared, nuisances=self._nuisances(points),
            always=self._data.always,
        )  # fmt: skip
        result = self._fit_of(points, chosen.names, orbit, None, shared)
        return replace(result, covariance=result.covariance * np.outer(chosen.widening, chosen.widening)), chosen.kept

    def _fit_of(
        self, points: Observations, names: tuple[str, ...], orbit: PassPriors | None,
        start: FitResult | None = None, shared: SharedErrors | None = None, *,
        edit_sigma: float = 3.0,
    ) -> FitResult:  # fmt: skip
        """Return the fit of `names`.

        A term that was offered and not chosen is zero; one not offered keeps its known value.
        """
        request, offered = self._request, self._request.terms
        base = BiasModel.zero(request.mount).replace(**dict.fromkeys(offered, 0.0) | request.coefficients)
        rest = {name: value for name, value in base.coefficients.items() if name not in names}
        # What is fitted in any case: its sigma may be that of a wide beam.
        wide = {each: Prior(0.0, ANY_RAD) for each in names if each in self._data.always}
        options = FitOptions(
            form=request.form, scale_covariance=True,
            huber_sigma=1.5 if request.robust else 0.0, edit_sigma=0.0 if request.robust else edit_sigma,
        )  # fmt: skip
        return calibration.fit_bias_model(
            points, terms=names, held={name: 0.0 if name in offered else value for name, value in rest.items()},
            priors=priors_near(base, names) if request.known else wide, pass_priors=orbit,
            start=start, options=options, shared=shared, nuisances=self._nuisances(points),
        )  # fmt: skip

    def _at_its_site(
        self, result: FitResult, points: Observations, gain: float
    ) -> tuple[FitResult, SystematicError | None]:
        """Return the fit in which the site is free, and the wrong site, if the data show one."""
        self._free.add("site")
        free = self._fit_of_all(points, result)
        found = systematic_errors.wrong_site(free, gain, self._away_m)
        if found is None:
            self._free.discard("site")
        return (free, found) if found else (result, None)

    def _doubtful(self, result: FitResult, others: Sequence[SystematicError | None]) -> list[str]:
        """Return the systematic errors that the data show; ValueError where they spoil the fit."""
        request = self._request
        # What is wrong everywhere first: a wrong clock moves the passes as a wrong site would.
        found = [systematic_errors.clock_by_ranges(self._data.passes), *others]
        found.append(systematic_errors.north_doubt(result, request.convergence_rad))
        if not self._data.recorded:
            _refuse_wrong(found)
        return [one.text for one in found if one is not None]

    def _orbit_warnings(self, result: FitResult) -> list[str]:
        """Return what doubts orbit errors that were measured from the same passes.

        They agree with these passes by construction. The age of the elements and the number of the
        passes are known without them.
        """
        if self._request.orbit_prior_m is not None or result.pass_priors is None:
            return []
        warnings = []
        if result.passes < FEWEST_FOR_SIZES:
            warnings.append(
                f"the orbit errors are measured from {result.passes} passes, which know their size to "
                f"{100.0 / np.sqrt(2.0 * result.passes):.0f} %: sigma may be too small by as much"
            )
        satellites = len(set(self._sets.values()))
        if result.shared is not None and satellites < FEWEST_SATELLITES:
            beyond = stdtrit(satellites - 1, 0.995) / (1.0 + FEW_SETS / (satellites - 1))
            warnings.append(
                f"the orbit errors that passes of one satellite share are measured from {satellites} satellites: 1 % of "
                f"the lags are more than {beyond:.1f} sigma off; track others too"
            )
        if len(self._sets) > 1 and satellites == 1 and self._data.points is None:
            # A late satellite is a lag; without lags it moves the offsets by a few sigma.
            taken = "lags" if any(name.endswith("_lag") for name in result.names) else "terms"
            warnings.append(
                f"one satellite ({self._sets[0]}) carries the fit: an error of its elements is in the {taken}, and sigma "
                "does not hold it; track others too"
            )
        elements, passes = self._request.elements, self._data.passes
        if not elements or not passes:
            return warnings
        ages_s = [float(one.raw.t_s[0]) - find_elements(elements, one.raw.target).epoch_t_s for one in passes]
        expected = np.sqrt(np.mean([np.square(ElementUncertainty().sigmas_m(age)) for age in ages_s], axis=0))
        sizes = dict(zip(result.pass_priors.names, result.orbit_sigma.tolist(), strict=True))
        for name, size in zip(("along_track_m", "cross_track_m", "radial_m"), expected.tolist(), strict=True):
            if name in sizes and sizes[name] > AGE_FACTOR * size:
                warnings.append(
                    f"{name} of the passes is {sizes[name]:.0f}, {sizes[name] / size:.1f} times that of elements up to "
                    f"{max(map(abs, ages_s)) / DAY_S:.1f} days old: targets, clock or elements are wrong"
                )
        return warnings


def _earlier(points: Observations, seconds: float) -> Observations:
    """Return the points with the true motion of that much earlier."""
    if seconds == 0.0:
        return points
    azimuth, elevation, *rates = points.motion()
    bend = rates[2:]
    moved: dict[str, Any] = {"t_s": points.t_s - seconds}
    for name, angle, rate, acceleration in zip(
        ("azimuth", "elevation"), (azimuth, elevation), rates, bend, strict=False
    ):
        moved[f"true_{name}_rad"] = angle - seconds * (rate - 0.5 * seconds * acceleration)
        moved[f"{name}_rate_rad_s"] = rate - seconds * acceleration
    if points.range_m is not None and points.range_rate_m_s is not None:
        moved["range_m"] = points.range_m - seconds * points.range_rate_m_s
    return replace(points, **moved)


def _refuse_wrong(found: Sequence[SystematicError | None]) -> None:
    """Raise ValueError for the systematic errors with which a fit would be wrong."""
    wrong = [one for one in found if one is not None and one.refuse]
    if wrong:
        text = "; ".join(one.text for one in wrong)
        raise WrongDataError(f"no model is fitted: {text}", frozenset(one.kind for one in wrong))


def _known_after(result: FitResult, before: PriorKnowledge) -> PriorKnowledge:
    """Return what a fit tells of model, orbit errors and noise, for the next round."""
    scale = before.sigma_scale
    if result.noise is not None:
        azimuth, elevation = (float(np.sqrt(one.factor)) for one in result.noise)
        scale = (scale[0] * azimuth, scale[1] * elevation)
    return PriorKnowledge(
        model=result.model, form=before.form, errors={one.pass_id: one for one in result.pass_errors}, sigma_scale=scale
    )


def remarks(request: FitRequest, done: Fitted) -> list[str]:
    """Return what a reader should know of a fit: terms chosen, orbit errors, passes held out."""
    least = f"a pass late by less than {done.least_late_s:.2f} s may not show among the errors of the orbits"
    return [
        *_choice_remarks(request, done), *_orbit_remarks(request, done.result),
        *([least] if done.least_late_s > 0.0 else []), *_clock_remarks(done),
        *_prediction_remarks(request, done),
    ]  # fmt: skip


def _choice_remarks(request: FitRequest, done: Fitted) -> list[str]:
    """Return which of the offered terms the data support, and which not."""
    if not request.select:
        return []
    seen = [name for name in done.result.names if name not in done.kept]
    rest = [name for name in request.terms if name not in done.result.names]
    needed = f"; not seen, but fitted since others depend on them: {', '.join(done.kept)}" if done.kept else ""
    return [f"chosen by BIC: {', '.join(seen)}{needed}; not supported by the data, zero: {', '.join(rest) or 'none'}"]


def _clock_remarks(done: Fitted) -> list[str]:
    """Return which clocks the lags hold for."""
    if done.open_clock_s is None:
        return []
    low, high = done.open_clock_s
    return [
        f"the lags are those of a right clock: with time tags {low:+.2f} to {high:+.2f} s late in all "
        "passes the angles are as likely, and both velocity lags as much longer"
    ]


def _orbit_remarks(request: FitRequest, result: FitResult) -> list[str]:
    """Return which errors of the orbit the sigma of `result` allows for."""
    if result.pass_priors is not None:
        sizes = ", ".join(
            f"{size:.0f} m {name.removesuffix('_m').replace('_', '-')}"
            for name, size in zip(result.pass_priors.names, result.orbit_sigma.tolist(), strict=True)
        )
        measured = " as the passes show them" if request.orbit_prior_m is None else ""
        return [f"sigma allows for orbit errors of {sizes} in each pass{measured}"]
    if request.orbit_prior_m is None:
        return ["sigma is that of an exact reference: without range and range rate orbit errors cannot be estimated"]
    return []


def _prediction_remarks(request: FitRequest, done: Fitted) -> list[str]:
    """Return how well fits without a pass predict it, with the result's terms and with all."""
    if not request.held_out:
        return []
    points, result = done.points, done.result
    if len(points.passes) < FEWEST_HELD_OUT:
        raise ValueError(f"passes={len(points.passes)} must be >= {FEWEST_HELD_OUT} to hold one out and fit the others")
    found = []
    for words, names in (("these terms", result.names), ("all terms offered", request.terms)):
        held = {name: value for name, value in result.coefficients.items() if name not in names}
        if words == "these terms" or set(names) != set(result.names):
            one = calibration.held_out_passes(points, names, held=held, pass_priors=result.pass_priors)
            worst = int(np.argmax(one.rms_rad))
            found.append(
                f"passes held out are predicted to {one.total_rms_rad / MDEG:.2f} mdeg rms with {words}, the worst "
                f"({one.pass_ids[worst]}) to {one.rms_rad[worst] / MDEG:.2f} mdeg"
            )
    return found


def summary(points: Observations, result: FitResult) -> str:
    """Return the outcome of a fit of these points in one line."""
    rms = [value / MDEG for value in result.rms_rad()]
    used = points.select(result.used)
    rule = SectorRule()
    full = rule.count - len(rule.coverage(*used.sky_rad()).thin)
    return (
        f"{len(used)} observations of {result.passes} passes, {len(result.rejected)} edited out; residual rms {rms[0]:.2f} "
        f"mdeg cross-elevation, {rms[1]:.2f} mdeg elevation; condition {result.condition:.0f}; {full} of {rule.count} "
        f"sectors have {rule.fewest} observations"
    )
