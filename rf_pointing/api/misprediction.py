"""How far a satellite was off its prediction in a recorded pass, and what that may be.

    d(t) = orbit and clock errors + terms of the model + scale of the refraction + unexplained

by least squares with the priors of elements, model and air, where d is what tracking has added to
the prediction and what the sensor still saw beyond it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rf_pointing.calibration import BiasModel, ReferenceTrack
from rf_pointing.calibration.pass_errors import LOW_ORBIT_RATE_RAD_S, PassPriors, motion_partials
from rf_pointing.core import MDEG, Array, RadioRefraction, sky_offset_rad
from rf_pointing.ephemeris.look_angles import LookAngles
from rf_pointing.report import error_ledger as rows
from rf_pointing.report.replay_case import RecordedCase
from rf_pointing.report.replay_report import SENSED, Flown, settled_s
from rf_pointing.simulation.open_loop import RecordedTrack

INDEPENDENT_S = 10.0
"""Time over which directions found by tracking are averaged, and so are independent."""
REFRACTION_SIGMA = 0.05
"""Error of a refraction by the weather of the place, as a share of it."""
MODEL_TERMS = ("azimuth_offset", "collimation", "elevation_offset", "mislevel_east",
               "mislevel_north", "droop")  # fmt: skip
GROUPS = (rows.EPHEMERIS, rows.MODEL, rows.REFRACTION)
CLOCK_S, LEAST_M = 10.0, 1.0
"""Prior of a clock of which nothing is known, and of an orbit of which all is."""
# A mount that follows late looks like a clock: lags that its model lacks, in s and s^2.
LAGS = {"velocity_lag": 0.05, "acceleration_lag": 0.02}
LIKE_A_CLOCK = ("along_track_m", "azimuth_velocity_lag", "elevation_velocity_lag")
"""Unknowns that no pass alone separates from its clock."""
ROUNDS, LEAST_BEAMWIDTHS = 4, 0.02
FEWEST = 8
"""Directions (each of `INDEPENDENT_S`) without which nothing is concluded."""


def split_prediction(case: RecordedCase) -> tuple[Array, dict[str, Array], Array, dict[str, float]]:
    """Return times (n,), parts (n, 2) of the misprediction by cause, all of it, and sigmas in mdeg.

    The parts are what least squares with priors makes of it: sizes of the orbit errors by the age
    of the elements, of the model's terms by the model error of the band, 5 % of the refraction.
    """
    t_s, off = case.off_prediction()
    look, inside = case.track.sample(t_s), t_s >= case.window.aos_t_s
    along, cross, radial = _orbit_m(case)
    priors = PassPriors(along_track_m=along, cross_track_m=cross, radial_m=radial)
    columns, expected, sigma = _columns(case, look, priors)
    values, covariance, _ = _solved(*_rows(columns, off, expected, t_s, inside), sigma)
    values = expected + values
    slices = dict(zip(GROUPS, np.split(np.arange(len(columns)), np.cumsum([
        len(priors.names), len(MODEL_TERMS),
    ])), strict=True))  # fmt: skip
    by_cause = ((name, values[at], columns[at]) for name, at in slices.items())
    parts = {name: np.asarray(np.einsum("k,kjn->nj", *both)) for name, *both in by_cause}
    wide: dict[str, Array] = {
        name: np.einsum("kjn,kl,ljn->nj", columns[at], covariance[np.ix_(at, at)], columns[at])
        for name, at in slices.items()
    }
    sigmas = {n: math.sqrt(np.mean(np.sum(v[inside], axis=1))) / MDEG for n, v in wide.items()}
    return t_s, parts, off, sigmas


@dataclass(frozen=True, eq=False)
class TimedPass:
    """Directions of one pass as equations of what may be wrong, at independent times.

    `partials` (m, k) belong to `names`, of which `sizes` (k,) are the priors; `off` (m,) is what
    they have to make, in rad with noise of `noise_rad`.  The satellite was ahead of its prediction
    by `ahead_s` with one sigma, by its elements, the clock or a mount that follows late.
    """

    names: tuple[str, ...]
    partials: Array
    sizes: Array
    off: Array
    noise_rad: float
    ahead_s: float
    sigma_s: float


def timed_pass(case: RecordedCase) -> TimedPass:
    """Return a recorded pass as equations of clock, orbit, model and refraction.

    ValueError without directions that tracking has found.
    """
    targets = case.signals.of("target")
    if len(targets) < 2:
        raise ValueError(f"{case.path} holds no target: the prediction is not known")
    predicted = RecordedTrack(targets, case.track)
    t_s, off = case.off_prediction()
    seen = Flown.of(case.signals, SENSED, None)
    begin_s = settled_s(seen, case.window.aos_t_s) if len(seen.t_s) else math.inf
    inside = (t_s >= begin_s) & (t_s <= case.window.los_t_s)
    if np.count_nonzero(inside) < 2 or np.ptp(t_s[inside]) < FEWEST * INDEPENDENT_S:
        least = f"{FEWEST * INDEPENDENT_S:.0f} s"
        raise ValueError(f"{case.path} holds no {least} of directions that a sensor has found")
    along, cross, radial = _orbit_m(case)
    # No prior may be zero: a pass without elements has no errors of them.
    along, cross, radial = (max(each, LEAST_M) for each in (along, cross, radial))
    priors = PassPriors(
        along_track_m=along, cross_track_m=cross, radial_m=radial, clock_s=CLOCK_S,
        cross_track_drift_m_s=LOW_ORBIT_RATE_RAD_S * cross,
        radial_drift_m_s=LOW_ORBIT_RATE_RAD_S * radial,
    )  # fmt: skip
    terms = tuple(BiasModel.zero().coefficients)
    names = (*priors.names, *terms, "refraction")
    clock, known, total = names.index("clock_s"), predicted.sample(t_s), 0.0
    # However even the directions are: what the terms of a mount do not describe changes slowly.
    least_rad = LEAST_BEAMWIDTHS * case.beamwidth_rad
    alone = np.array([name not in LIKE_A_CLOCK for name in names])
    # A motion is straight for tenths of a second only.
    for _ in range(ROUNDS):
        look = predicted.sample(t_s + total)
        there, here = ((each.azimuth_rad, each.elevation_rad) for each in (look, known))
        left = off - np.column_stack(sky_offset_rad(*there, *here))
        columns, expected, sigma = _columns(case, look, priors, terms)
        partials, wanted = _rows(columns, left, expected, t_s, inside)
        values, covariance, noise_rad = _solved(partials[:, alone], wanted, sigma[alone], least_rad)
        place = int(np.sum(alone[:clock]))
        moved_s, total = total, total + float(values[place])
    # Back about the prediction as it was sent: passes with other shifts are solved together.
    return TimedPass(
        names=names, partials=partials, sizes=sigma, off=wanted + partials[:, clock] * moved_s,
        noise_rad=noise_rad, ahead_s=total, sigma_s=math.sqrt(covariance[place, place]),
    )  # fmt: skip


def _orbit_m(case: RecordedCase) -> tuple[float, float, float]:
    """Return sizes of the errors along, across and radially, by the age of the elements."""
    known = [each.uncertainty for each in case.signals.of("target")]
    ages = [each.age_s for each in known if each is not None]
    # Elements grow older by seconds in a pass: one age is enough.
    law = case.setup().sets("ephemeris_publisher")["uncertainty"]
    along, cross, radial = law.sigmas_m(ages[-1] if ages else 0.0)
    return along, cross, radial


def _columns(
    case: RecordedCase, look: LookAngles, priors: PassPriors, names: Sequence[str] = MODEL_TERMS
) -> tuple[Array, Array, Array]:
    """Return partials (k, 2, n) on the sky, expected values and sizes (k,) of what may be wrong."""
    motion = ReferenceTrack.of(look).motion()
    middle_s = 0.5 * (case.window.aos_t_s + case.window.los_t_s)
    ranges, still = (look.range_m, look.range_rate_m_s), (0.0, 0.0)
    orbit = motion_partials(look.t_s - middle_s, motion, *ranges, priors.names, still)
    # The printed form is linear: any size of a term gives its partials.
    zero = BiasModel.zero()
    terms = [np.stack(zero.replace(**{n: 1e-3}).offset_rad(*motion)) / 1e-3 for n in names]
    used = np.array([each.refraction_rad for each in case.signals.of("target")])
    applied = bool(np.any(np.abs(used) > 1e-9))
    true_rad = look.true_elevation_rad
    bend = look.elevation_rad - true_rad
    if not applied:
        altitude_m = case.track.site.altitude_m
        bend = RadioRefraction.standard(altitude_m).apply(true_rad) - true_rad
    columns = np.concatenate([
        np.moveaxis(np.stack(orbit), 2, 0), terms, [np.stack([np.zeros_like(bend), bend])],
    ])  # fmt: skip
    # The partials are those of the azimuth, errors are those on the sky.
    columns[:, 0] *= np.cos(look.elevation_rad)
    # A refraction that was left out is missing as a whole.
    expected = np.zeros(len(columns))
    expected[-1] = 0.0 if applied else 1.0
    model_rad = math.radians(case.description.content.bands[case.band].model_error_deg)
    each_rad = model_rad / math.sqrt(len(MODEL_TERMS))
    sizes = [LAGS.get(name.partition("_")[2], each_rad) for name in names]
    return columns, expected, np.array([*priors.sigma, *sizes, REFRACTION_SIGMA])


def _rows(
    columns: Array, off: Array, expected: Array, t_s: Array, inside: Any
) -> tuple[Array, Array]:  # fmt: skip
    """Return partials (m, k) and what they make beyond the expected (m,), at independent times."""
    rows_s = np.flatnonzero(inside)
    step = max(1, round(INDEPENDENT_S / float(np.median(np.diff(t_s)))))
    chosen = rows_s[step // 2 :: step]
    partials = columns[:, :, chosen].reshape(len(columns), -1).T
    return partials, off[chosen].T.ravel() - partials @ expected


def _solved(
    partials: Array, wanted: Array, sigma: Array, least_rad: float = 0.1 * MDEG
) -> tuple[Array, Array, float]:  # fmt: skip
    """Return values (k,), covariance, and the noise that what is left shows."""
    scale_rad, scaled = MDEG, partials * sigma
    values: Array = np.zeros(len(sigma))
    covariance: Array = np.eye(len(sigma))
    # What the columns leave says how well they fit; a few rounds settle it.
    for _ in range(5):
        information = scaled.T @ scaled / scale_rad**2 + np.eye(len(sigma))
        covariance = np.asarray(np.linalg.inv(information))
        values = np.asarray(covariance @ scaled.T @ wanted / scale_rad**2)
        scale_rad = max(float(np.sqrt(np.mean((wanted - scaled @ values) ** 2))), least_rad)
    return sigma * values, covariance * np.outer(sigma, sigma), scale_rad
