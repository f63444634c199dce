"""From raw samples of a pass to calibration points, in the paper's order (SATCAL 3, Figure 1).

validation -> 3-sigma outliers against the ephemeris -> one sample per second -> three points per 30
s -> corrections; then all passes together -> 25 to 30 points in each of the 36 sectors.  Every
stage reports what it dropped and why.

Means are taken of what the reference orbit, the model and the orbit errors known so far leave over:
a lag of one second makes the bias of a high pass bend far more within 10 s than a line can.  Start
with BiasModel.zero() and run the pipeline again with the fit until it stays: then nothing is left
that a mean could distort, and the points have no bias at any elevation.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.coverage import Coverage, SectorRule, select_by_sector
from rf_pointing.calibration.ionosphere import Ionosphere
from rf_pointing.calibration.mount import risen
from rf_pointing.calibration.noise import noise_of
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassErrors, displaced, lags_of, motion_partials
from rf_pointing.calibration.raw_tracking import RawTracking, StageReport, require_unit, validate
from rf_pointing.calibration.reference import COLUMNS, ReferenceTrack
from rf_pointing.calibration.thinning import Thinned, find_outliers, smooth, thin
from rf_pointing.core import Array, BoolArray, IntArray, Kinematics, Pair, wrap_rad
from rf_pointing.core.target_motion import ANGLES

# A perfect simulation scatters by nothing; a sigma of zero would divide by zero in the fit.
_LEAST_SIGMA_RAD = 1e-6


@dataclass(frozen=True, kw_only=True)
class PriorKnowledge:
    """Prior knowledge of the antenna and of the orbits, before the data are processed.

    `form` is that of the fit: of skew axes with long lags the two differ by 20 mdeg at 84 deg.
    `errors` are those of the passes by number; `sigma_scale` are the factors of sigma in azimuth
    and elevation that the fit before measured.
    """

    model: BiasModel
    form: str = "rotation"
    errors: Mapping[int, PassErrors] = field(default_factory=dict)
    sigma_scale: Pair = (1.0, 1.0)

    @property
    def lags_s(self) -> Pair:
        """The velocity lags with which the fit sees errors of the passes."""
        return lags_of(self.model.coefficients) if self.form == "rotation" else (0.0, 0.0)

    def bias_rad(self, columns: Mapping[str, Array]) -> Array:
        """Return observed minus true angles (2, n) of a motion, in the form of the fit."""
        motion = [columns[name] for name in ANGLES]
        if self.form == "printed":
            return np.stack(self.model.offset_rad(*motion))
        return np.stack(self.model.apply(*motion)) - np.stack(motion[:2])


@dataclass(frozen=True, eq=False)
class TrackedPass:
    """Samples of one pass and its reference.

    `reference` is apparent: refraction and light time are in it, and only the `ionosphere` is left
    to correct (None: not at all).  For a dish over the top it becomes that of its axis angles,
    where the terms of the mount apply.
    """

    raw: RawTracking
    reference: ReferenceTrack
    ionosphere: Ionosphere | None = None

    def __post_init__(self) -> None:
        if (
            np.median(self.raw.over) > 0.5
            and float(np.median(self.reference.elevation_rad)) <= 0.5 * np.pi
        ):
            object.__setattr__(self, "reference", self.reference.over_the_top())

    @cached_property
    def validation(self) -> tuple[BoolArray, StageReport]:
        """Which samples are sound, and the report of it."""
        return validate(self.raw, self.reference)

    @cached_property
    def track(self) -> ReferenceTrack:
        """The reference at the sound samples."""
        return self.reference.at(self.raw.t_s[self.validation[0]])

    @cached_property
    def residuals(self) -> dict[str, Array]:
        """Measured minus reference of every channel at the sound samples; the angles are first."""
        found = {
            name: value[self.validation[0]] - getattr(self.track, name)
            for name, value in self.raw.channels.items()
        }
        if self.ionosphere is not None:
            up_rad = self.track.sky_rad()[1]
            height_rad = np.minimum(up_rad, np.pi - up_rad)
            bending = self.ionosphere.bending(height_rad, self.track.range_m)
            angles = self.track.motion()[:2]
            across, along = risen(self.track.mount, angles[0], angles[1], bending)
            found["azimuth_rad"] -= across
            found["elevation_rad"] -= along
            if "range_m" in found:
                found["range_m"] -= self.ionosphere.delay_m(height_rad)
        return found


@dataclass(frozen=True, eq=False)
class Processed:
    """Calibration points of all passes, what each stage reports, and which passes gave none."""

    points: Observations
    reports: tuple[StageReport, ...]
    notes: tuple[str, ...]


class RawPasses:
    """Raw passes of one campaign, numbered from `first`: validated once, processed repeatedly.

    Raises ValueError if no pass has a sound sample, naming the stage, and for angles in another
    unit.
    """

    def __init__(self, passes: Sequence[TrackedPass], first: int) -> None:
        for one in passes:
            require_unit(one.raw, one.reference)
        self._numbers = {
            first + k: one for k, one in enumerate(passes) if np.sum(one.validation[0]) > 1
        }
        self._lost = tuple(
            f"pass {first + k} of {one.raw.target}: {one.validation[1].text()}"
            for k, one in enumerate(passes)
            if first + k not in self._numbers
        )
        if not self._numbers:
            raise ValueError(f"no pass gives calibration points: {'; '.join(self._lost[:3])}")
        used = list(self._numbers.values())
        # What some passes do not have can judge none of them.
        self._names = [
            name for name in used[0].residuals if all(name in one.residuals for one in used)
        ]
        self._validation = _summed([one.validation[1] for one in passes])
        self._residuals = {
            name: np.concatenate([one.residuals[name] for one in used]) for name in self._names
        }
        self._tracks = _joined([one.track for one in used])
        self._passes = np.repeat(list(self._numbers), [len(one.track.t_s) for one in used])

    def process(self, known: PriorKnowledge) -> Processed:
        """Return the points of all passes.

        What is `known` is taken off before the means and put back on the points.
        """
        t_s, residuals = self._tracks["t_s"], dict(self._residuals)
        paths = {
            number: _displaced(one, known.errors.get(number))
            for number, one in self._numbers.items()
        }
        shift = self._known_rad(
            known, self._tracks, [paths[n].at(one.track.t_s) for n, one in self._numbers.items()]
        )
        # Encoders count turns: only the azimuth difference folded into half a turn is a residual.
        residuals["azimuth_rad"] = wrap_rad(residuals["azimuth_rad"] - shift[0])
        residuals["elevation_rad"] = residuals["elevation_rad"] - shift[1]
        # On the sky: in azimuth the noise of a high pass grows so fast that a piece loses its top.
        on_sky = residuals | {
            "azimuth_rad": residuals["azimuth_rad"] * np.cos(self._tracks["elevation_rad"])
        }
        keep, dropped = find_outliers(t_s, self._passes, on_sky)
        outliers = StageReport(
            stage="outliers", before=len(t_s), after=int(np.sum(keep)), dropped=dropped
        )
        # Where range or range rate are wrong, so is the time or the target of the angles.
        stacked = np.stack([value[keep] for value in residuals.values()], axis=1)
        thinned = thin(t_s[keep], self._passes[keep], stacked)
        smoothed = smooth(thinned.t_s, thinned.passes, thinned.residuals)
        smoothed, tracks, sigma = self._with_sigma(smoothed, paths)
        points = self._points(smoothed, tracks, sigma, known)
        count = len(points)
        corrected = any(one.ionosphere for one in self._numbers.values())
        reports = (
            self._validation, outliers, self._report("thinning", outliers.after, thinned),
            self._report("smoothing", len(thinned.t_s), smoothed),
            StageReport(
                stage="corrections", before=count, after=count, dropped={},
                note="ionosphere" if corrected else "none",
            ),
        )  # fmt: skip
        empty = sorted(set(self._numbers) - set(points.passes.tolist()))
        return Processed(
            points, reports, (*self._lost, *(f"pass {number}: too few samples" for number in empty))
        )

    def _known_rad(
        self, known: PriorKnowledge, tracks: Mapping[str, Array], paths: Sequence[ReferenceTrack]
    ) -> Array:
        """Return the known part (2, n) of observed minus reference angles."""
        path = _joined(paths)
        moved = (
            wrap_rad(path["azimuth_rad"] - tracks["azimuth_rad"]),
            path["elevation_rad"] - tracks["elevation_rad"],
        )
        return np.stack(moved) + known.bias_rad(path)

    def _with_sigma(
        self, smoothed: Thinned, paths: Mapping[int, ReferenceTrack]
    ) -> tuple[Thinned, dict[str, Array], Array]:
        """Return the points along a line, the target's motion at them, and their sigma (2, n)."""
        # A single point is not a pass, and has no motion.
        _, place, counts = np.unique(smoothed.passes, return_inverse=True, return_counts=True)
        smoothed = smoothed.select(counts[place] > 1, "alone in a pass")
        if len(smoothed.t_s) == 0:
            raise ValueError("no pass gives two calibration points")
        times = ((path, smoothed.t_s[smoothed.passes == number]) for number, path in paths.items())
        tracks = _joined([path.at(t_s) for path, t_s in times if len(t_s)])
        sigma, straight = noise_of(smoothed, tracks["elevation_rad"])
        left = {name: value[straight] for name, value in tracks.items()}
        return (
            smoothed.select(straight, "not along a line"),
            left,
            np.maximum(sigma[straight].T, _LEAST_SIGMA_RAD),
        )

    def _points(
        self, smoothed: Thinned, tracks: dict[str, Array], sigma: Array, known: PriorKnowledge
    ) -> Observations:
        # The true motion is that with the errors known so far, about which they are linear; their
        # linear part is put back, for the fit finds whole errors and not their changes.
        one = next(iter(self._numbers.values()))
        raw, mount = one.raw, one.reference.mount
        shift = known.bias_rad(tracks) + _error_shift_rad(known, tracks, smoothed.passes, mount)
        # The angles are the first channels of a pass.
        azimuth, elevation = smoothed.residuals.T[:2]
        angles = ("azimuth_rad", "elevation_rad")
        return Observations(
            station=raw.station, band=raw.band, mount=mount, pass_id=smoothed.passes,
            observed_azimuth_rad=tracks["azimuth_rad"] + shift[0] + azimuth,
            observed_elevation_rad=tracks["elevation_rad"] + shift[1] + elevation,
            sigma_azimuth_rad=sigma[0] * known.sigma_scale[0],
            sigma_elevation_rad=sigma[1] * known.sigma_scale[1],
            **{f"true_{name}" if name in angles else name: value for name, value in tracks.items()},
        )  # fmt: skip

    def _report(self, stage: str, before: int, result: Thinned) -> StageReport:
        scatter = ", ".join(
            f"{name} {value:.3g}" for name, value in zip(self._names, result.noise, strict=True)
        )
        note = f"scatter {scatter}" if np.any(result.freedom) else "samples as they are"
        return StageReport(
            stage=stage, before=before, after=len(result.t_s), dropped=result.dropped, note=note
        )


def _joined(tracks: Sequence[ReferenceTrack]) -> dict[str, Array]:
    """Return the columns of all tracks, one after the other."""
    return {name: np.concatenate([getattr(one, name) for one in tracks]) for name in COLUMNS}


def _displaced(one: TrackedPass, errors: PassErrors | None) -> ReferenceTrack:
    return one.reference if errors is None else displaced(one.reference, errors)


def _error_shift_rad(
    known: PriorKnowledge, tracks: Mapping[str, Array], passes: IntArray, mount: Kinematics
) -> Array:
    """Return the shifts (2, n) of the angles that are linear in the errors of the passes."""
    errors = known.errors
    if not errors:
        return np.zeros((2, len(passes)))
    names = tuple(next(iter(errors.values())).values)
    numbers, place = np.unique(passes, return_inverse=True)
    # A pass of which nothing is known yet has no error.
    found = [errors.get(number) for number in numbers.tolist()]
    values = np.array([[one.values[name] if one else 0.0 for name in names] for one in found])
    middle = np.array([one.middle_t_s if one else 0.0 for one in found])[place]
    motion = [tracks[name] for name in ANGLES]
    elapsed_s = tracks["t_s"] - middle
    partials = motion_partials(
        elapsed_s, motion, tracks["range_m"], tracks["range_rate_m_s"], names, known.lags_s, mount
    )
    return np.stack([np.einsum("ij,ij->i", axis, values[place]) for axis in partials])


def _summed(reports: Sequence[StageReport]) -> StageReport:
    dropped: Counter[str] = Counter()
    for report in reports:
        dropped.update(report.dropped)
    before, after = (
        sum(getattr(report, name) for report in reports) for name in ("before", "after")
    )
    note = "" if len(reports) == 1 else f"{len(reports)} passes"
    return StageReport(
        stage=reports[0].stage, before=before, after=after, dropped=dropped, note=note
    )


def select_observations(
    passes: Sequence[Observations], rule: SectorRule, *, require_full: bool
) -> tuple[Observations, Coverage, StageReport]:
    """Choose the points of each sector from all passes; `require_full` refuses a thin sector."""
    together = Observations.concatenate(list(passes))
    rows, dropped = select_by_sector(*together.sky_rad(), together.pass_id, rule)
    chosen = together.select(rows)
    coverage = rule.coverage(*chosen.sky_rad())
    # Thin sectors let terms trade places: a paper's campaign is refused, an operator's is reported.
    if require_full:
        coverage.require_full()
    report = StageReport(
        stage="selection",
        before=len(together),
        after=len(chosen),
        dropped=dropped,
        note=f"{rule.count - len(coverage.thin)} of {rule.count} sectors have at least {rule.fewest}",
    )
    return chosen, coverage, report
