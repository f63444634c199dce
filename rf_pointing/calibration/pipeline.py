"""From raw samples of a pass to calibration points, in the paper's order (SATCAL 3, Figure 1).

validation -> 3-sigma outliers against the ephemeris -> one sample per second -> three points per 30 s -> corrections;
then all passes together -> 25 to 30 points in each of the 36 sectors.  Every stage says what it dropped and why.

Lines and parabolas are fitted to what the reference orbit AND the model known so far leave over: a lag of one second
makes the bias of a high pass bend far more within 30 s than a parabola can.  Start with BiasModel.zero() and run the
pipeline again with the first fit; pieces that did not follow a parabola then come back.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.corrections import Corrections
from rf_pointing.calibration.coverage import Coverage, SectorRule, select_by_sector
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.raw_tracking import CHANNELS, RawTracking, StageReport, validate
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.calibration.thinning import Thinned, find_outliers, smooth, thin
from rf_pointing.core import Params, parameter, wrap_rad

__all__ = ["PipelineOptions", "ProcessedPass", "process_pass", "select_observations"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PipelineOptions(Params):
    """The numbers of SATCAL 3."""

    outlier_sigma: float = parameter(3.0, "samples beyond this many sigma off their neighbours go", low=2.0, high=20.0)
    thin_s: float = parameter(1.0, "length of a thinned sample", low=0.1, high=10.0)
    thin_fewest: int = parameter(4, "raw samples a thinned one needs", low=3, high=1000)
    piece_s: float = parameter(30.0, "length of a smoothing piece", low=3.0, high=600.0)
    piece_points: int = parameter(3, "points taken from a piece", low=1, high=100)
    piece_fewest: int = parameter(15, "thinned samples a piece needs", low=4, high=1000)
    piece_scatter: float = parameter(
        1.6, "pieces whose points scatter this many times more than their sigma go", low=1.0, high=100.0
    )
    least_sigma_rad: float = parameter(1e-6, "sigma of a point is never below this", low=1e-9, high=0.01)


@dataclass(frozen=True, eq=False)
class ProcessedPass:
    """Calibration points of one pass and the stage reports; `ranges` are the smoothed range channels by name.

    Each entry of `ranges` is (t_s, corrected value, sigma), for the orbit check.
    """

    observations: Observations
    ranges: dict[str, tuple[Array, Array, Array]]
    noise: dict[str, float]
    reports: tuple[StageReport, ...]


def process_pass(
    raw: RawTracking,
    reference: ReferenceTrack,
    pass_id: int,
    corrections: Corrections,
    model: BiasModel,
    options: PipelineOptions | None = None,
) -> ProcessedPass:
    """Run the stages on one pass.  Raises ValueError if nothing is left, naming the stage.

    `model` is the best known so far; it is taken off before the fits to pieces and put back on the points.
    """
    chosen = options or PipelineOptions()
    sound, validation = validate(raw, reference)
    if not np.any(sound):
        raise ValueError(f"pass {pass_id}: {validation.text()}")
    t_s = raw.t_s[sound]
    residuals = _residuals(raw, sound, reference, corrections, model)
    keep, dropped = find_outliers(t_s, residuals, chosen.outlier_sigma)
    outliers = StageReport(stage="outliers", before=len(t_s), after=int(np.sum(keep)), dropped=dropped)
    stacked = np.stack([value[keep] for value in residuals.values()], axis=1)
    thinned = thin(t_s[keep], stacked, second_s=chosen.thin_s, fewest=chosen.thin_fewest, pool_s=chosen.piece_s)
    smoothed = smooth(
        thinned.t_s,
        thinned.residuals,
        thinned.sigma,
        piece_s=chosen.piece_s,
        points=chosen.piece_points,
        fewest=chosen.piece_fewest,
        worst_scatter=chosen.piece_scatter,
    )
    names = tuple(residuals)
    observations, ranges = _points(raw, reference, smoothed, names, pass_id, corrections, model, chosen)
    reports = (
        validation,
        outliers,
        _piece_report("thinning", outliers.after, thinned, names),
        _piece_report("smoothing", len(thinned.t_s), smoothed, names),
        StageReport(
            stage="corrections",
            before=len(observations),
            after=len(observations),
            dropped={},
            note=corrections.text(),
        ),
    )
    return ProcessedPass(observations, ranges, dict(zip(names, thinned.noise.tolist(), strict=True)), reports)


def select_observations(
    passes: Sequence[Observations], rule: SectorRule, *, require_full: bool
) -> tuple[Observations, Coverage, StageReport]:
    """Group all passes and choose the points of each sector; `require_full` refuses a sky with empty sectors."""
    together = Observations.concatenate(list(passes))
    selection = select_by_sector(together.true_azimuth_rad, together.true_elevation_rad, together.pass_id, rule)
    if require_full:
        selection.coverage.require_full()
    chosen = together.select(selection.chosen)
    thin_sectors = len(selection.coverage.thin)
    report = StageReport(
        stage="selection",
        before=len(together),
        after=len(chosen),
        dropped=selection.dropped,
        note=f"{rule.count - thin_sectors} of {rule.count} sectors have at least {rule.fewest}",
    )
    return chosen, selection.coverage, report


def _residuals(
    raw: RawTracking,
    sound: NDArray[np.bool_],
    reference: ReferenceTrack,
    corrections: Corrections,
    model: BiasModel,
) -> dict[str, Array]:
    t_s = raw.t_s[sound]
    track = _track(reference, t_s, corrections)
    known = model.offset_rad(*track.motion())
    found = {}
    for name, value in raw.channels.items():
        difference = value[sound] - getattr(track, name)
        found[name] = difference
    found["azimuth_rad"] = wrap_rad(found["azimuth_rad"] - known[0])
    found["elevation_rad"] -= known[1] + corrections.bending(track.elevation_rad, track.range_m)
    if "range_m" in found:
        found["range_m"] = found["range_m"] - corrections.extra_range_m(track.elevation_rad)
    return found


def _track(reference: ReferenceTrack, t_s: Array, corrections: Corrections) -> ReferenceTrack:
    return reference.delayed(t_s) if corrections.light_time else reference.at(t_s)


def _points(
    raw: RawTracking,
    reference: ReferenceTrack,
    smoothed: Thinned,
    names: tuple[str, ...],
    pass_id: int,
    corrections: Corrections,
    model: BiasModel,
    options: PipelineOptions,
) -> tuple[Observations, dict[str, tuple[Array, Array, Array]]]:
    track = _track(reference, smoothed.t_s, corrections)
    residual = dict(zip(names, smoothed.residuals.T, strict=True))
    sigma = dict(zip(names, smoothed.sigma.T, strict=True))
    known = model.offset_rad(*track.motion())
    observations = Observations(
        station=raw.station,
        band=raw.band,
        t_s=smoothed.t_s,
        pass_id=np.full(len(smoothed.t_s), pass_id),
        observed_azimuth_rad=track.azimuth_rad + known[0] + residual["azimuth_rad"],
        observed_elevation_rad=track.elevation_rad + known[1] + residual["elevation_rad"],
        true_azimuth_rad=track.azimuth_rad,
        true_elevation_rad=track.elevation_rad,
        azimuth_rate_rad_s=track.azimuth_rate_rad_s,
        elevation_rate_rad_s=track.elevation_rate_rad_s,
        azimuth_acceleration_rad_s2=track.azimuth_acceleration_rad_s2,
        elevation_acceleration_rad_s2=track.elevation_acceleration_rad_s2,
        sigma_azimuth_rad=np.maximum(sigma["azimuth_rad"], options.least_sigma_rad),
        sigma_elevation_rad=np.maximum(sigma["elevation_rad"], options.least_sigma_rad),
        range_m=track.range_m,
        range_rate_m_s=track.range_rate_m_s,
    )
    ranges = {
        name: (smoothed.t_s, getattr(track, name) + residual[name], sigma[name])
        for name in CHANNELS[2:]
        if name in residual
    }
    return observations, ranges


def _piece_report(stage: str, before: int, result: Thinned, names: tuple[str, ...]) -> StageReport:
    scatter = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, result.noise, strict=True))
    return StageReport(
        stage=stage, before=before, after=len(result.t_s), dropped=result.dropped, note=f"scatter {scatter}"
    )
