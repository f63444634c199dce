"""How the bias model of DSS-13 in Ka band came about: a fit to simulated observations of the Ka-band station.

    scripts/run-python benchmarks/ka_model.py [FILE]

38 arcs over the whole sky, the mount errors of the configuration files; each observation has 2 mdeg of noise, each arc a
direction error of 1.5 mdeg of its own, as an orbit has.  The covariance is that of whole arcs (sandwich).
"""

import sys

import numpy as np

from rf_pointing import __version__
from rf_pointing.calibration import (
    TERM_NAMES,
    FitOptions,
    ModelVersion,
    Observations,
    fit_bias_model,
    held_at_zero,
    write_model,
)
from rf_pointing.core import MDEG, random_stream
from rf_pointing.core.dates import from_utc_text
from rf_pointing.simulation import StationSetup
from rf_pointing.station.description import STATIONS

ARCS, POINTS, STEP_S = 38, 43, 8.0
NOISE_RAD, ARC_RAD = 2.0 * MDEG, 1.5 * MDEG
BEGIN_UTC, CREATED_UTC = "2006-03-12T02:00:00", "2006-03-14T12:00:00"
LAGS = tuple(name for name in TERM_NAMES if name.endswith("_lag"))


def observations() -> Observations:
    """Return what the station would have observed."""
    setup = StationSetup("dss13", "Ka")
    mount = setup.sets("antenna_servo")["mount"].model()
    random, count = random_stream(1, "Ka model"), ARCS * POINTS
    arc, step = np.divmod(np.arange(count), POINTS)
    since_s = STEP_S * step
    first = np.column_stack([random.uniform(-np.pi, np.pi, ARCS), np.radians(random.uniform(12.0, 70.0, ARCS))])
    rate = np.radians(random.uniform(-0.03, 0.03, (ARCS, 2)))
    sky = first[arc] + rate[arc] * since_s[:, None]
    still = np.zeros(count)
    seen = np.array(
        [mount.apply(*direction, *rate[k], 0.0, 0.0) for direction, k in zip(sky, arc, strict=True)], dtype=float
    )
    wrong = ARC_RAD * random.standard_normal((ARCS, 2))[arc] + NOISE_RAD * random.standard_normal((count, 2))
    stretch = np.column_stack([1.0 / np.cos(sky[:, 1]), np.ones(count)])
    seen += wrong * stretch
    return Observations(
        station="Goldstone DSS-13",
        band="Ka",
        t_s=from_utc_text(BEGIN_UTC) + 3600.0 * arc + since_s,
        pass_id=arc,
        observed_azimuth_rad=seen[:, 0],
        observed_elevation_rad=seen[:, 1],
        true_azimuth_rad=sky[:, 0],
        true_elevation_rad=sky[:, 1],
        azimuth_rate_rad_s=rate[arc, 0],
        elevation_rate_rad_s=rate[arc, 1],
        azimuth_acceleration_rad_s2=still,
        elevation_acceleration_rad_s2=still,
        sigma_azimuth_rad=NOISE_RAD * stretch[:, 0],
        sigma_elevation_rad=np.full(count, NOISE_RAD),
    )


def fitted() -> ModelVersion:
    """Return the model with its covariance."""
    terms = [name for name in TERM_NAMES if name not in LAGS]
    found = fit_bias_model(
        observations(), terms=terms, held=held_at_zero(terms), options=FitOptions(covariance="sandwich", edit_sigma=0.0)
    )
    return ModelVersion.from_fit(
        found, name="dss13-ka", software=f"rf_pointing {__version__}", created_t_s=from_utc_text(CREATED_UTC)
    )


if __name__ == "__main__":
    write_model(sys.argv[1] if len(sys.argv) > 1 else STATIONS / "bias_model_dss13_ka.yaml", fitted())
