"""Calibration data of a mount with a planted error: points all over the sky, and raw passes of CBERS-2."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from rf_pointing.calibration import BiasModel, Ionosphere, Observations, RawTracking, write_observations
from rf_pointing.core import MDEG, RadioRefraction
from rf_pointing.core.target_motion import ANGLES
from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, site, tle_lines, verification_elements
from test.calibration.conftest import write_tracking

STATION = "Goldstone DSS-13"
PLANTED = BiasModel.zero().replace(azimuth_offset=100.0 * MDEG, elevation_offset=-50.0 * MDEG)


@cache
def points(passes: int = 12) -> Observations:
    """Return arcs all over the sky seen through the planted model, 1 mdeg of noise."""
    random, parts = np.random.default_rng(3), []
    for number in range(passes):
        t = np.arange(60.0)
        rate = random.uniform(-4e-3, 4e-3, 2) * (1.0, 0.3)
        curve = random.uniform(-4e-5, 4e-5, 2)
        start = (random.uniform(0.0, 2.0 * math.pi), random.uniform(0.4, 1.1))
        motion = [start[k] + rate[k] * t + 0.5 * curve[k] * t**2 for k in (0, 1)]
        motion += [rate[k] + curve[k] * t for k in (0, 1)] + [np.full(60, curve[k]) for k in (0, 1)]
        azimuth, elevation = PLANTED.apply(*motion)
        parts.append(
            Observations(
                station=STATION, band="X", t_s=1e9 + 1000.0 * number + t, pass_id=np.full(60, number),
                observed_azimuth_rad=azimuth + random.normal(0.0, 1.0 * MDEG, 60),
                observed_elevation_rad=elevation + random.normal(0.0, 1.0 * MDEG, 60),
                **dict(zip(("true_azimuth_rad", "true_elevation_rad", *ANGLES[2:]), motion, strict=True)),
                sigma_azimuth_rad=np.full(60, 1.0 * MDEG), sigma_elevation_rad=np.full(60, 1.0 * MDEG),
            )
        )  # fmt: skip
    return Observations.concatenate(parts)


def at_one_elevation() -> Observations:
    """Return the same with every point of every pass at 40 deg of elevation, and at rest there."""
    data = points()
    flat, rest = np.full(len(data), math.radians(40.0)), np.zeros(len(data))
    moved = data.observed_elevation_rad - data.true_elevation_rad + flat
    still = {"elevation_rate_rad_s": rest, "elevation_acceleration_rad_s2": rest}
    return replace(data, true_elevation_rad=flat, observed_elevation_rad=moved, **still)


@cache
def raw_passes() -> tuple[RawTracking, ...]:
    """Return four passes of CBERS-2 at 2 samples/s, seen through the planted model and an ionosphere."""
    seen, random = Ionosphere(electrons_per_m2=5e17, frequency_hz=2.25e9), np.random.default_rng(5)
    elements = find_elements(verification_elements(), "28057")
    track, found = TopocentricTrack(elements, site(STATION)), []
    for window in find_passes(track, elements.epoch_t_s, 86400.0, math.radians(15.0))[:4]:
        look = track.sample(np.arange(window.aos_t_s, window.los_t_s, 0.5))
        bent = look.elevation_rad + seen.bending(look.elevation_rad, look.range_m)
        noise = random.normal(0.0, 2.0 * MDEG, (2, len(bent)))
        found.append(
            RawTracking(
                station=STATION, band="X", target="28057", t_s=look.t_s,
                azimuth_rad=look.azimuth_rad + 100.0 * MDEG + noise[0], elevation_rad=bent - 50.0 * MDEG + noise[1],
                range_m=None, range_rate_m_s=None, good=np.arange(len(bent)) > 9,
            )
        )  # fmt: skip
    return tuple(found)


def write_campaign(folder: Path) -> None:
    """Write the data as the files that `fit_bias_model` takes.

    `points.csv`, `few.csv` (one pass), `flat.csv` (one elevation); `raw*.csv`, the same without
    refraction as `dry*.csv` and with time tags 0.5 s late as `late*.csv`; `cbers.tle`.
    """
    for name, data in (("points", points()), ("few", points(1)), ("flat", at_one_elevation())):
        write_observations(folder / f"{name}.csv", data)
    air = RadioRefraction.standard(site(STATION).altitude_m)
    for number, raw in enumerate(raw_passes()):
        write_tracking(folder / f"raw{number}.csv", raw)
        write_tracking(folder / f"dry{number}.csv", replace(raw, elevation_rad=air.remove(raw.elevation_rad)))
        write_tracking(folder / f"late{number}.csv", replace(raw, t_s=raw.t_s + 0.5))
    elements = find_elements(verification_elements(), "28057")
    (folder / "cbers.tle").write_text("\n".join([elements.name, *tle_lines(elements)]) + "\n")
