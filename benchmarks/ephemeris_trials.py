"""Trials of the ephemeris at weathers, orbits and days drawn at random; the suite has small ones.

scripts/run-python benchmarks/ephemeris_trials.py [SEED]

Prints, for each part, what was found; the exit status says whether the bounds are kept.
"""

import contextlib
import dataclasses
import math
import sys

import numpy as np

from rf_pointing.core.dates import DAY_S, from_utc_text
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import (
    TopocentricTrack,
    find_elements,
    find_passes,
    read_elements,
    site,
    tle_lines,
    verification_elements,
)
from rf_pointing.ephemeris.earth_orientation import (
    PREDICTED_DAYS,
    IersEarthOrientation,
    orientation_table,
    predicted,
    predicted_sigmas,
)
from rf_pointing.ephemeris.time_scales import leap_seconds

WEATHERS, DECAYS, EPOCHS, DAYS = 4000, 100, 20000, 1000
ARCSEC = math.radians(1.0 / 3600.0)


def weathers(rng: np.random.Generator) -> bool:
    """Apply and remove the refraction of accepted weathers from -90 deg to 270 deg."""
    grid = np.radians(
        np.concatenate([np.linspace(-90.0, -6.1, 100), np.linspace(-6.0, 2.0, 1601), np.linspace(2.1, 270.0, 500)])
    )
    done = refused = 0
    closure = largest = 0.0
    while done < WEATHERS:
        pressure_hpa, humidity = rng.uniform(300.0, 1100.0), rng.uniform(0.0, 1.0)
        temperature_k = rng.uniform(298.0 if done % 2 else 180.0, 330.0)
        with contextlib.suppress(ValueError):
            weather = RadioRefraction(
                pressure_hpa=pressure_hpa, temperature_k=temperature_k, relative_humidity=humidity
            )
            done += 1
            try:
                apparent = weather.apply(grid)
            except ValueError:
                refused += 1
                continue
            closure = max(closure, float(np.max(np.abs(weather.remove(apparent) - grid))))
            largest = max(largest, (-0.5 - weather.remove(-0.5)) / -weather.remove(0.0))
    print(f"refraction: {done} weathers, {refused} without a root, closure {closure:.1e} rad, "
          f"below the horizon at most {largest:.2f} times its value on it")  # fmt: skip
    return refused == 0 and closure < 1e-13


def decays(rng: np.random.Generator) -> bool:
    """Search passes over the fourteen days of elements whose object decays in them."""
    base, found, ends = find_elements(verification_elements(), "28057"), 0, []
    for _ in range(DECAYS):
        elements = dataclasses.replace(
            base,
            mean_motion_rad_s=rng.uniform(15.9, 16.4) * 2.0 * math.pi / DAY_S,
            eccentricity=rng.uniform(1e-4, 9e-3),
            inclination_rad=rng.uniform(0.5, 2.2),
            argument_of_perigee_rad=rng.uniform(0.0, 2.0 * math.pi),
            drag_per_earth_radius=10.0 ** rng.uniform(-3.5, -2.2),
        )
        track = TopocentricTrack(elements, site("Madrid DSS-63"))
        ends.append((track.spans_t_s[0][1] - elements.epoch_t_s) / DAY_S)
        found += len(find_passes(track, elements.epoch_t_s, 13.9 * DAY_S, math.radians(5.0)))
    finite = [end for end in ends if math.isfinite(end)]
    print(f"decay: {DECAYS} objects, {len(finite)} decay after {min(finite):.2f} to {max(finite):.2f} days, "
          f"{found} passes, no search refused")  # fmt: skip
    return len(finite) > DECAYS // 2


def epochs(rng: np.random.Generator) -> bool:
    """Write and read the epochs around the ends of years."""
    base, worst_s = find_elements(verification_elements(), "28057"), 0.0
    for _ in range(EPOCHS):
        year = int(rng.integers(1958, 2057))
        t_s = from_utc_text(f"{year}-01-01T00:00:00") + rng.uniform(-2e-3, 2e-3)
        (back,) = read_elements("\n".join(tle_lines(dataclasses.replace(base, epoch_t_s=t_s))))
        worst_s = max(worst_s, abs(back.epoch_t_s - t_s))
    print(f"TLE: {EPOCHS} epochs within 2 ms of a new year, read back within {1e3 * worst_s:.3f} ms")
    return worst_s < 0.44e-3


def orientation(rng: np.random.Generator) -> bool:
    """Predict the Earth's orientation from random days since 1978 and compare with what came."""
    table, kept = orientation_table(), True
    measured = int(np.searchsorted(table.t_s, table.last_measured_t_s)) + 1
    ahead = np.array([30.0, 60.0, 90.0, 180.0, 365.0, 500.0, 730.0, 1000.0])
    ends = rng.integers(2200, measured - 1000, DAYS)
    misses = []
    for end in ends.tolist():
        foretold = predicted(table.t_s[: end + 1], tuple(v[: end + 1] for v in table.values), ahead)
        misses.append([f - v[end + ahead.astype(int)] for f, v in zip(foretold, table.values, strict=True)])
    rms = np.sqrt(np.mean(np.square(misses), axis=0))
    for column, days in enumerate(ahead):
        ut1_s, pole_rad = predicted_sigmas(days)
        x, y = rms[1:, column] / ARCSEC * 1e3
        print(f"orientation: {days:5.0f} days ahead: UT1 {1e3 * rms[0, column]:6.1f} ms (stated {1e3 * ut1_s:6.1f}), "
              f"pole {x:5.1f} and {y:5.1f} mas (stated {1e3 * pole_rad / ARCSEC:5.1f})")  # fmt: skip
        kept &= bool(np.all(rms[:, column] < 1.2 * np.array([ut1_s, pole_rad, pole_rad])))
    held = []
    for end in rng.integers(2200, measured - 3000, DAYS).tolist():
        past = tuple(v[: end + 1] for v in table.values)
        ut1, x, y = predicted(table.t_s[: end + 1], past, np.array([float(PREDICTED_DAYS)]))
        known_s = float(leap_seconds().tai_minus_utc_s(float(table.t_s[end + PREDICTED_DAYS])))
        truth = IersEarthOrientation().at(float(table.t_s[end + int(rng.integers(PREDICTED_DAYS + 300, 3000))]))
        held.append((ut1[0] + known_s - truth.ut1_minus_utc_s, x[0] - truth.pole_x_rad, y[0] - truth.pole_y_rad))
    ut1_s, x, y = np.sqrt(np.mean(np.square(held), axis=0))
    stated_s, stated_rad = predicted_sigmas(PREDICTED_DAYS + 1.0)
    print(f"orientation: held values: UT1-UTC {1e3 * ut1_s:.0f} ms (stated {1e3 * stated_s:.0f}), pole "
          f"{1e3 * x / ARCSEC:.0f} and {1e3 * y / ARCSEC:.0f} mas (stated {1e3 * stated_rad / ARCSEC:.0f})")  # fmt: skip
    return kept and bool(ut1_s < 1.2 * stated_s and max(x, y) < 1.2 * stated_rad)


def main() -> int:
    """Run all parts; 0 where every bound is kept."""
    rng = np.random.default_rng(int(sys.argv[1]) if len(sys.argv) > 1 else 1978)
    kept = [part(rng) for part in (weathers, decays, epochs, orientation)]
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
