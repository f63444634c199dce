"""Orbits from passes against planted ones: is the error what the covariance says, and how much better than elements?

    scripts/run-python benchmarks/orbit_from_passes.py --trials 300

The satellite is CBERS 2 with elements 10 days old, the station the shipped 3.7-m dish (and two others).  Each trial draws
the error of the elements from their law, drag, field beyond degree 8 and radiation, clock and angle biases of each station
(memory of a day), refraction 5 % off, and noise of a normal point of 5 s.  Printed are the shares of trials inside the 68
and 95 % volumes of the covariance of position at the next pass (trials scatter by 2.7 and 1.3 %), and the errors there.
"""

import argparse
import dataclasses
import math
import time

import numpy as np
from scipy.stats import chi2

from rf_pointing.core import MDEG, random_stream
from rf_pointing.core.dates import DAY_S
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.sgp4_orbit import Sgp4Orbit
from rf_pointing.ephemeris.sites import Site
from rf_pointing.ephemeris.tle import verification_elements
from rf_pointing.ephemeris.uncertainty import ElementUncertainty
from rf_pointing.orbit.determination import Dynamics, Orbits, PassData, Prior, Priors, covariance_of_elements, determine
from rf_pointing.orbit.measurements import measured_from
from rf_pointing.orbit.passes import forces_of, motion_of_site, teme_state

STATIONS = {
    "Stuttgart": Site.from_degrees(48.745, 9.103, 520.0),
    "Svalbard": Site.from_degrees(78.23, 15.4, 450.0),
    "Bangalore": Site.from_degrees(13.03, 77.51, 800.0),
}
AGE_S = 10.0 * DAY_S
NOISE_RAD = 3.0 * MDEG
STEP_S, LOWEST_RAD = 5.0, math.radians(5.0)
PRIORS = Priors(azimuth_bias_rad=5.0 * MDEG, elevation_bias_rad=5.0 * MDEG)
BENDING_RAD = 2.5e-4
"""Refraction is about this much divided by the tangent of the elevation."""


@dataclasses.dataclass(frozen=True)
class Case:
    """What is tracked: passes of `stations`, how many of each, and a manoeuvre between."""

    name: str
    stations: tuple[str, ...]
    passes: int = 2
    burn: bool = False


CASES = (
    Case("two passes of one station", ("Stuttgart",)),
    Case("three stations", tuple(STATIONS), passes=1),
    Case("a manoeuvre between", ("Stuttgart",), burn=True),
)


@dataclasses.dataclass(frozen=True)
class Planted:
    """The truth of every trial, and what was measured of it."""

    truth: np.ndarray
    prior: Prior
    passes: list[PassData]
    dynamics: Dynamics
    next_t_s: np.ndarray


def windows(states: np.ndarray, t_s: np.ndarray, site: Site) -> list[np.ndarray]:
    """Return the indices of each pass of the nominal orbit above the least elevation."""
    up = np.flatnonzero(measured_from(states, motion_of_site(site, t_s))[:, 1] > LOWEST_RAD)
    parts = np.split(up, np.flatnonzero(np.diff(up) > 1) + 1)
    return [part for part in parts if len(part) > 40]


def plant(case: Case, trials: int, seed: int) -> Planted:
    """Return trials of a case; the fit gets the covariance of what is drawn."""
    rng = random_stream(seed, case.name)
    (elements,) = (one for one in verification_elements() if one.catalogue_number == 28057)
    epoch_t_s = elements.epoch_t_s
    state = teme_state(Sgp4Orbit(elements, IersEarthOrientation(), max_age_s=14.0 * DAY_S), epoch_t_s)
    forces = forces_of(elements, state)
    t_s = epoch_t_s + np.arange(0.0, 1.5 * DAY_S, STEP_S)
    plain = Dynamics(forces=forces)
    nominal = plain.states(epoch_t_s, np.concatenate([state, [1.0, 0.0, 1.0]])[np.newaxis], t_s)[0]
    seen = {name: windows(nominal, t_s, STATIONS[name]) for name in case.stations}
    first, second = seen[case.stations[0]][:2]
    burn_t_s = float(t_s[(first[-1] + second[0]) // 2]) if case.burn else None
    dynamics = dataclasses.replace(plain, manoeuvre_t_s=burn_t_s)
    chosen = [(name, t_s[part]) for name, parts in seen.items() for part in parts[: case.passes]]
    end_s = max(times[-1] for _, times in chosen)
    following = next(part for part in seen[case.stations[0]] if t_s[part[0]] > end_s)
    next_t_s = t_s[following][:: len(following) // 5]

    covariance = covariance_of_elements(state, AGE_S, ElementUncertainty())
    errors = rng.standard_normal((trials, 6)) @ np.linalg.cholesky(covariance).T
    burns = 0.3 * rng.standard_normal((trials, 3)) if case.burn else np.zeros((trials, 0))
    drawn = rng.standard_normal((trials, 3)) * [PRIORS.air, PRIORS.field, PRIORS.radiation] + [1.0, 0.0, 1.0]
    truth = np.concatenate([np.broadcast_to(state, (trials, 6)), drawn[:, :1], burns, drawn[:, 1:]], axis=1)
    passes, biases = [], {}
    for name, times in sorted(chosen, key=lambda one: float(one[1][0])):
        motion = motion_of_site(STATIONS[name], times)
        states = dynamics.states(epoch_t_s, truth, times)
        true = measured_from(states, motion, light=True)
        sky = 1.0 / np.cos(true[..., 1])
        sigma = np.array([PRIORS.clock_s, PRIORS.azimuth_bias_rad, PRIORS.elevation_bias_rad, PRIORS.refraction])
        if name not in biases:
            biases[name] = times[0], sigma * rng.standard_normal((trials, 4))
        before_s, old = biases[name]
        kept = np.array([math.exp(-(times[0] - before_s) / PRIORS.memory_s)] * 3 + [1.0])
        bias = kept * old + np.sqrt(1.0 - kept**2) * sigma * rng.standard_normal((trials, 4))
        biases[name] = times[0], bias
        clock, azimuth, elevation, air = bias.T[..., np.newaxis]
        rates = motion.angle_rates(states)
        noise = NOISE_RAD * rng.standard_normal((2, trials, len(times)))
        bending = BENDING_RAD / np.tan(np.mean(true[..., 1], axis=0))
        values = np.stack([
            true[..., 0] - clock * rates[0] + sky * (azimuth + noise[0]),
            true[..., 1] - clock * rates[1] + elevation + air * bending + noise[1],
        ], axis=-1)  # fmt: skip
        passes.append(PassData(
            station=name, t_s=times, motion=motion, kinds=("azimuth_rad", "elevation_rad"), values=values,
            sigma=np.full(2, NOISE_RAD), bending_rad=bending,
        ))  # fmt: skip
    prior = Prior(epoch_t_s=epoch_t_s, states=state + errors, covariance=covariance)
    return Planted(truth, prior, passes, dynamics, next_t_s)


def outcome(planted: Planted, found: Orbits) -> dict[str, float]:
    """Return the shares inside both volumes at the middle of the next pass, and errors (m) there."""
    t_s = planted.next_t_s[len(planted.next_t_s) // 2 :][:1]
    truth = planted.dynamics.states(planted.prior.epoch_t_s, planted.truth, t_s)[:, 0, :3]
    states, covariance = found.at(t_s)
    error, spread = states[:, 0, :3] - truth, covariance[:, 0, :3, :3]
    square = np.einsum("ti,tij,tj->t", error, np.linalg.inv(spread), error)
    more = np.zeros((len(planted.truth), len(planted.dynamics.names) - 6 + 2))
    more[:, [0, -1]] = 1.0
    known = np.concatenate([planted.prior.states, more], axis=1)
    of_elements = planted.dynamics.states(planted.prior.epoch_t_s, known, t_s)[:, 0, :3] - truth
    sizes = np.linalg.norm(error, axis=1)
    return {
        "68": float(np.mean(square < chi2.ppf(0.68, 3))), "95": float(np.mean(square < chi2.ppf(0.95, 3))),
        "rms_m": float(np.sqrt(np.mean(sizes**2))),
        "sigma_m": float(np.sqrt(np.mean(np.trace(spread, axis1=1, axis2=2)))),
        "elements_m": float(np.sqrt(np.mean(np.sum(of_elements**2, axis=1)))),
        "better": float(np.median(np.linalg.norm(of_elements, axis=1) / sizes)),
        "ahead_min": float(t_s[0] - max(one.t_s[-1] for one in planted.passes)) / 60.0,
    }  # fmt: skip


def main() -> None:
    """Print a line for each case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=300)
    parser.add_argument("--at-once", type=int, default=50, help="trials that are solved together (memory)")
    options = parser.parse_args()
    print("case | trials | in 68 % | in 95 % | rms m | sigma m | elements m | better (median) | min ahead | s")
    for case in CASES:
        begun, parts = time.process_time(), []
        for seed, count in enumerate(range(0, options.trials, options.at_once), start=1):
            planted = plant(case, min(options.at_once, options.trials - count), seed)
            found = determine(planted.prior, planted.passes, planted.dynamics, PRIORS)
            parts.append((len(planted.truth), outcome(planted, found)))
        shares = np.array([count for count, _ in parts]) / options.trials
        means = {key: float(shares @ [part[key] for _, part in parts]) for key in parts[0][1]}
        for key in ("rms_m", "sigma_m", "elements_m"):
            means[key] = math.sqrt(float(shares @ [part[key] ** 2 for _, part in parts]))
        print(
            f"{case.name} | {options.trials} | {100 * means['68']:.1f} | {100 * means['95']:.1f} | {means['rms_m']:.0f} | "
            f"{means['sigma_m']:.0f} | {means['elements_m']:.0f} | {means['better']:.0f} | {means['ahead_min']:.0f} | "
            f"{time.process_time() - begun:.0f}"
        )


if __name__ == "__main__":
    main()
