"""From raw samples of a pass to calibration points, in the paper's order (SATCAL 3, Figure 1).

validation -> 3-sigma outliers against the ephemeris -> one sample per second -> three points per 30
s -> corrections; then all passes together -> 25 to 30 points in each of the 36 sectors.  Every
stage reports what it dropped and why.

Lines and parabolas are fitted to what the reference orbit AND the model known so far leave over: a
lag of one second makes the bias of a high pass bend far more within 30 s than a parabola can.
Start with BiasModel.zero() and run the pipeline again with the first fit; pieces that did not
follow a parabola then come back.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.coverage import Coverage, SectorRule, select_by_sector
from rf_pointing.calibration.ionosphere import Ionosphere
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.raw_tracking import RawTracking, StageReport, validate
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.calibration.thinning import Thinned, find_outliers, smooth, thin
from rf_pointing.core import wrap_rad

Array = NDArray[np.float64]

# A perfect simulation scatters by nothing; a sigma of zero would divide by zero in the fit.
_LEAST_SIGMA_RAD = 1e-6


@dataclass(frozen=True, eq=False)
class ProcessedPass:
    """Calibration points of one pass, and what each stage reports of it."""

    observations: Observations
    reports: tuple[StageReport, ...]


def process_pass(
    raw: RawTracking, reference: ReferenceTrack, pass_id: int, ionosphere: Ionosphere | None, model: BiasModel
) -> ProcessedPass:
    """Run the stages on one pass.  Raises ValueError if nothing is left, naming the stage.

    `reference` is apparent: refraction and light time are in it, and only the ionosphere is left to
    correct (None: not at all).  `model` is the best known so far: taken off before the fits to
    pieces, put back on the points.
    """
    sound, validation = validate(raw, reference)
    if not np.any(sound):
        raise ValueError(f"pass {pass_id}: {validation.text()}")
    t_s = raw.t_s[sound]
    residuals = _residuals(raw, sound, reference, ionosphere, model)
    keep, dropped = find_outliers(t_s, residuals)
    outliers = StageReport(stage="outliers", before=len(t_s), after=int(np.sum(keep)), dropped=dropped)
    # Where range or range rate are wrong, so is the time or the target of the angles.
    stacked = np.stack([value[keep] for value in residuals.values()], axis=1)
    thinned = thin(t_s[keep], stacked)
    smoothed = smooth(thinned.t_s, thinned.residuals, thinned.sigma)
    names = tuple(residuals)
    observations = _points(raw, reference, smoothed, pass_id, model)
    count = len(observations)
    reports = (
        validation,
        outliers,
        _piece_report("thinning", outliers.after, thinned, names),
        _piece_report("smoothing", len(thinned.t_s), smoothed, names),
        StageReport(
            stage="corrections", before=count, after=count, dropped={}, note="ionosphere" if ionosphere else "none"
        ),
    )
    return ProcessedPass(observations, reports)


def select_observations(
    passes: Sequence[Observations], rule: SectorRule, *, require_full: bool
) -> tuple[Observations, Coverage, StageReport]:
    """Choose the points of each sector from all passes; `require_full` refuses a thin sector."""
    together = Observations.concatenate(list(passes))
    rows, dropped = select_by_sector(together.true_azimuth_rad, together.true_elevation_rad, together.pass_id, rule)
    chosen = together.select(rows)
    coverage = rule.coverage(chosen.true_azimuth_rad, chosen.true_elevation_rad)
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


def _residuals(
    raw: RawTracking,
    sound: NDArray[np.bool_],
    reference: ReferenceTrack,
    ionosphere: Ionosphere | None,
    model: BiasModel,
) -> dict[str, Array]:
    track = reference.at(raw.t_s[sound])
    known = model.offset_rad(*track.motion())
    found = {name: value[sound] - getattr(track, name) for name, value in raw.channels.items()}
    # Encoders count turns: only the azimuth difference folded into half a turn is a residual.
    found["azimuth_rad"] = wrap_rad(found["azimuth_rad"] - known[0])
    found["elevation_rad"] -= known[1]
    if ionosphere is not None:
        found["elevation_rad"] -= ionosphere.bending(track.elevation_rad, track.range_m)
        if "range_m" in found:
            found["range_m"] -= ionosphere.delay_m(track.elevation_rad)
    return found


def _points(
    raw: RawTracking, reference: ReferenceTrack, smoothed: Thinned, pass_id: int, model: BiasModel
) -> Observations:
    track = reference.at(smoothed.t_s)
    known = model.offset_rad(*track.motion())
    # The angles are the first channels of a pass.
    azimuth, elevation = smoothed.residuals.T[:2]
    sigma = np.maximum(smoothed.sigma.T[:2], _LEAST_SIGMA_RAD)
    return Observations(
        station=raw.station,
        band=raw.band,
        t_s=smoothed.t_s,
        pass_id=np.full(len(smoothed.t_s), pass_id),
        observed_azimuth_rad=track.azimuth_rad + known[0] + azimuth,
        observed_elevation_rad=track.elevation_rad + known[1] + elevation,
        sigma_azimuth_rad=sigma[0],
        sigma_elevation_rad=sigma[1],
        **track.truth(),
    )


def _piece_report(stage: str, before: int, result: Thinned, names: tuple[str, ...]) -> StageReport:
    scatter = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, result.noise, strict=True))
    return StageReport(
        stage=stage, before=before, after=len(result.t_s), dropped=result.dropped, note=f"scatter {scatter}"
    )
