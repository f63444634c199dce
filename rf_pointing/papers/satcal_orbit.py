"""The orbits of SATCAL: one station (Table 2), batch with radar angles (Table 6)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.core.target_motion import TargetMotion
from rf_pointing.core.types import Array
from rf_pointing.papers.satcal_batch import Arc, OrbitResult, fit_orbit, preliminary_orbit, times_of
from rf_pointing.papers.satcal_campaign import APRIL_T_S, INJECTION_T_S, IRS_P3, IRS_P3_APRIL, SITES
from rf_pointing.papers.satcal_looks import look
from rf_pointing.papers.satcal_motion import Elements, Gravity, Site, measured, propagate

_GRAVITY = Gravity()
_ARC_S = np.arange(-140.0, 21.0, 2.0)
_RANGE_M, _ANGLE_RAD = 10.0, math.radians(0.01)
_RANGE_RATE_M_S = 0.05
_BATCH_DAYS, _STEP_S = 2.5, 30.0
_LOWEST_RAD = math.radians(10.0)
_WEIGHT_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class PreliminaryCheck:
    """Errors (runs, 2) of semi-major axis (km) and inclination (deg) against the reference."""

    uncorrected: Array
    corrected: Array
    elevation_deg: tuple[float, float]

    @staticmethod
    def rms(errors: Array) -> Array:
        """Return the rms of both columns (2,)."""
        return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))


def preliminary_check(
    planted: BiasModel, fitted: Sequence[BiasModel], random: np.random.Generator
) -> PreliminaryCheck:
    """Determine the orbit of Table 2 from 160 s over Mauritius, with raw angles and with each
    fitted correction.
    """
    site, times = SITES["Mauritius"], INJECTION_T_S + _ARC_S
    truth = propagate(INJECTION_T_S, IRS_P3.state(), times, _GRAVITY).states
    seen = look(times, truth, site, _GRAVITY)
    middle = Elements.from_state(truth[len(times) // 2])
    offset = planted.offset_rad(*seen.angles)
    raw, better = [], []
    for model in fitted:
        noise = random.standard_normal((3, len(times)))
        angles = np.stack([seen.azimuth_rad, seen.elevation_rad]) + offset + _ANGLE_RAD * noise[:2]
        distance = seen.range_m + _RANGE_M * noise[2]
        raw.append(_element_error(site, times, distance, angles, middle))
        # The motion of the true pass: a fitted model is applied as in operation, where it is known
        # to seconds.
        known = np.stack(model.offset_rad(*seen.angles))
        better.append(_element_error(site, times, distance, angles - known, middle))
    degrees = np.degrees(seen.elevation_rad)
    return PreliminaryCheck(
        np.array(raw), np.array(better), (float(np.min(degrees)), float(np.max(degrees)))
    )


def _element_error(
    site: Site, times: Array, distance: Array, angles: Array, truth: Elements
) -> tuple[float, float]:
    orbit = preliminary_orbit(
        site,
        times,
        distance,
        angles[0],
        angles[1],
        sigma_range_m=_RANGE_M,
        sigma_angle_rad=_ANGLE_RAD,
        gravity=_GRAVITY,
    )
    found = Elements.from_state(orbit.state)
    return (
        1e-3 * (found.semi_major_axis_m - truth.semi_major_axis_m),
        math.degrees(found.inclination_rad - truth.inclination_rad),
    )


@dataclass(frozen=True, eq=False)
class BatchCheck:
    """Shift of the batch orbit (6,) by raw and by corrected radar angles, against the same orbit
    with unbiased ones.
    """

    angle_sigma_deg: float
    raw_shift: Array
    corrected_shift: Array
    predicted_shift: Array
    range_only_sigma_m: float
    measurements: dict[str, int]


def batch_check(
    planted: dict[str, BiasModel],
    fitted: dict[str, BiasModel],
    radar_passes: Sequence[TargetMotion],
    target_shift_m: float,
    random: np.random.Generator,
) -> BatchCheck:
    """Fit 2.5 days of range, range rate and radar angles; the angle weight is chosen so that raw
    angles cost `target_shift_m` (linear theory), because the paper does not give its weights.
    """
    network = _network_arcs(random)
    # Drawn once: raw, corrected and unbiased angles share it.
    noise = random.standard_normal((len(planted), 2, sum(len(seen.t_s) for seen in radar_passes)))
    start = IRS_P3_APRIL.state()
    ranges_only = fit_orbit(APRIL_T_S, start, network, _GRAVITY)

    # The same noise for raw, corrected and unbiased angles: the shifts differ by the biases alone.
    raw = {name: _offsets(radar_passes, model) for name, model in planted.items()}
    better = {name: raw[name] - _offsets(radar_passes, fitted[name]) for name in planted}
    none = {name: np.zeros_like(offset) for name, offset in raw.items()}
    times = times_of([*network, *_radar_arcs(radar_passes, none, noise, _ANGLE_RAD)])
    # Propagated once: five fits start from the same orbit and its partials.
    begun = propagate(APRIL_T_S, ranges_only.state, times, _GRAVITY, with_partials=True)

    def solved(left_over: dict[str, Array], sigma_rad: float) -> OrbitResult:
        arcs = _radar_arcs(radar_passes, left_over, noise, sigma_rad)
        return fit_orbit(APRIL_T_S, ranges_only.state, [*network, *arcs], _GRAVITY, orbit=begun)

    biases = [0.0] * len(network) + [axis for offset in raw.values() for axis in offset]
    trial = solved(none, _ANGLE_RAD)
    sigma_rad = _weight_for(target_shift_m, ranges_only, trial, trial.shift_from(biases))
    clean = solved(none, sigma_rad)
    return BatchCheck(
        angle_sigma_deg=math.degrees(sigma_rad),
        raw_shift=solved(raw, sigma_rad).state - clean.state,
        corrected_shift=solved(better, sigma_rad).state - clean.state,
        predicted_shift=clean.shift_from(biases),
        range_only_sigma_m=float(np.sqrt(np.trace(ranges_only.covariance[:3, :3]))),
        measurements={"network": sum(len(arc.t_s) for arc in network), "angles": noise.size},
    )


def _network_arcs(random: np.random.Generator) -> list[Arc]:
    """Return range and range rate of the S-band network, one point every `_STEP_S`."""
    times = APRIL_T_S + np.arange(0.0, _BATCH_DAYS * 86400.0, _STEP_S)
    states = propagate(APRIL_T_S, IRS_P3_APRIL.state(), times, _GRAVITY).states
    arcs = []
    for name in ("Mauritius", "Bangalore", "Lucknow"):
        seen = measured(times, states, SITES[name])
        up = seen[:, 1] > _LOWEST_RAD
        for column, kind, sigma in (
            (2, "range_m", _RANGE_M),
            (3, "range_rate_m_s", _RANGE_RATE_M_S),
        ):
            values = seen[up, column] + sigma * random.standard_normal(int(np.sum(up)))
            arcs.append(Arc(SITES[name], kind, times[up], values, np.full(len(values), sigma)))
    return arcs


def _offsets(passes: Sequence[TargetMotion], model: BiasModel) -> Array:
    """Return the bias of azimuth and elevation (2, n) along all passes."""
    return np.concatenate([np.stack(model.offset_rad(*seen.angles)) for seen in passes], axis=1)


def _radar_arcs(
    passes: Sequence[TargetMotion], left_over: dict[str, Array], noise: Array, sigma_rad: float
) -> list[Arc]:
    times = np.concatenate([seen.t_s for seen in passes])
    true = [
        np.concatenate([getattr(seen, kind) for seen in passes])
        for kind in ("azimuth_rad", "elevation_rad")
    ]
    arcs = []
    for radar, bias in enumerate(left_over.values()):
        for axis, kind in enumerate(("azimuth_rad", "elevation_rad")):
            values = true[axis] + bias[axis] + _ANGLE_RAD * noise[radar, axis]
            arcs.append(
                Arc(SITES["Sriharikota"], kind, times, values, np.full(len(times), sigma_rad))
            )
    return arcs


def _weight_for(
    target_m: float, ranges_only: OrbitResult, with_angles: OrbitResult, shift: Array
) -> float:
    """Return the angle sigma at which linear theory gives a position shift of `target_m`.

    The information of the angles is the difference of the two fits; it scales with 1 / sigma^2.
    """
    network = np.linalg.inv(ranges_only.covariance)
    total = np.linalg.inv(with_angles.covariance)
    angles, pull = (total - network) * _ANGLE_RAD**2, (total @ shift) * _ANGLE_RAD**2
    # Bisection in the logarithm: the shift falls monotonically with the weight.
    low, high = math.log(_ANGLE_RAD / 100.0), math.log(_ANGLE_RAD * 1e5)
    for _ in range(_WEIGHT_ROUNDS):
        middle = 0.5 * (low + high)
        weight = math.exp(-2.0 * middle)
        moved = np.linalg.norm(np.linalg.solve(network + weight * angles, weight * pull)[:3])
        low, high = (middle, high) if moved > target_m else (low, middle)
    return math.exp(0.5 * (low + high))
