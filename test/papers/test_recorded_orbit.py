"""Orbits, places of Sun and Moon, looks, partials and fits, number by number as recorded.

Their laws are tested beside; a term of a series or a step of an iteration that changes a millionth shows here.
"""

from collections.abc import Callable

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.orbit import forces
from rf_pointing.papers import satcal_batch as batch
from rf_pointing.papers import satcal_looks, satcal_motion
from test.papers.recorded import DATA, Array, check_numbers, flat

EPOCH, GRAVITY = 827385062.07, satcal_motion.Gravity()
SITE = satcal_motion.Site(name="Lucknow", latitude_rad=0.47, longitude_rad=1.41, height_m=120.0)
ORBIT = satcal_motion.Elements(
    semi_major_axis_m=7.21e6,
    eccentricity=0.012,
    inclination_rad=1.72,
    node_rad=2.7,
    perigee_rad=4.25,
    mean_anomaly_rad=5.6,
)


def sun_and_moon() -> Array:
    days = (-3000.0, 0.0, 77.7, 9876.5)
    return flat(*(place(EPOCH + 86400.0 * day) for day in days for place in (forces.sun_m, forces.moon_m)))


def disturbances() -> Array:
    states = np.stack([ORBIT.state(), ORBIT.replace(mean_anomaly_rad=1.0, node_rad=0.4).state()])
    each = (
        forces.Disturbances(ballistic_m2_kg=0.02, air_density_kg_m3=1e-12, air_height_m=7e5, air_scale_m=9e4),
        forces.Disturbances(ballistic_m2_kg=0.0, sun=True), forces.Disturbances(moon=True),
    )  # fmt: skip
    return flat(
        *(one.acceleration(EPOCH, states) * 1e9 for one in each), forces.Disturbances().acceleration(0.0, states)
    )


def perturbed() -> Array:
    air = forces.Disturbances(ballistic_m2_kg=1.0, air_density_kg_m3=1e-11, sun=True, moon=True)
    times = EPOCH + np.array([-2500.0, -10.0, 0.0, 0.0, 4000.0])
    found = satcal_motion.propagate(EPOCH, ORBIT.state(), times, GRAVITY, disturbances=air, with_partials=True)
    assert found.partials is not None
    return flat(found.states, found.partials[[0, 4]])


def one_pass() -> satcal_looks.Look:
    found = satcal_looks.visits(SITE, ORBIT, EPOCH, 0.6, GRAVITY, step_s=8.0, lowest_rad=0.2)
    return found[-1]


def passes() -> Array:
    found = satcal_looks.visits(SITE, ORBIT, EPOCH, 1.7, GRAVITY, step_s=20.0, lowest_rad=0.16)
    return flat(len(found), *((len(one.t_s), one.t_s[0] - EPOCH, np.max(one.elevation_rad)) for one in found))


def looks() -> Array:
    seen = one_pass()
    rows = [2, len(seen.t_s) // 2, -1]
    states = satcal_motion.propagate(EPOCH, ORBIT.state(), seen.t_s[rows], GRAVITY).states
    slopes = (
        seen.azimuth_rate_rad_s, seen.elevation_rate_rad_s, seen.azimuth_acceleration_rad_s2,
        seen.elevation_acceleration_rad_s2,
    )  # fmt: skip
    return flat(
        seen.azimuth_rad[rows], seen.elevation_rad[rows], seen.range_m[rows], seen.range_rate_m_s[rows],
        *(1e3 * slope[rows] for slope in slopes), satcal_motion.measured(seen.t_s[rows], states, SITE),
        1e6 * satcal_motion.partials(seen.t_s[rows], states, SITE),
    )  # fmt: skip


def elements() -> Array:
    numbers = []
    for change in (
        {},
        {"eccentricity": 0.7, "inclination_rad": 2.6},
        {"eccentricity": 0.3, "node_rad": 6.0, "perigee_rad": 0.1},
    ):
        orbit = ORBIT.replace(**change)
        back = satcal_motion.Elements.from_state(orbit.state())
        numbers += [*orbit.state(), back.semi_major_axis_m, back.eccentricity, back.inclination_rad, back.node_rad]
        numbers += [back.perigee_rad, back.mean_anomaly_rad]
    return np.array(numbers)


def preliminary() -> Array:
    seen = one_pass()
    noise = random_stream(11, "preliminary").standard_normal((3, len(seen.t_s)))
    found = batch.preliminary_orbit(
        SITE, seen.t_s, seen.range_m + 8.0 * noise[0], seen.azimuth_rad + 3e-4 * noise[1],
        seen.elevation_rad + 3e-4 * noise[2], sigma_range_m=9.0, sigma_angle_rad=2e-4, gravity=GRAVITY,
    )  # fmt: skip
    residuals = [float(np.sqrt(np.mean(each**2))) for each in found.residuals]
    return flat(
        found.epoch_t_s - EPOCH, found.state, np.sqrt(np.diag(found.covariance)), found.covariance[0, 1:], residuals,
        found.condition, found.iterations, found.shift_from([1.0, 1e-4, -2e-4]),
    )  # fmt: skip


def start() -> Array:
    seen = one_pass()
    noise = random_stream(11, "start").standard_normal((3, len(seen.t_s)))
    ranges = seen.range_m + 80.0 * noise[0]
    epoch, state = batch.starting_state(
        SITE, seen.t_s, ranges, seen.azimuth_rad + 3e-3 * noise[1], seen.elevation_rad + 3e-3 * noise[2], GRAVITY
    )
    return flat(epoch - EPOCH, state)


RUNS: dict[str, tuple[float, Callable[[], Array]]] = {
    "Sun and Moon": (1e-9, sun_and_moon),
    "air and tides": (1e-8, disturbances),
    "perturbed orbit with partials": (1e-5, perturbed),
    "passes": (1e-5, passes),
    "looks": (1e-6, looks),
    "elements": (1e-9, elements),
    "secular": (1e-9, lambda: satcal_looks.secular_states(ORBIT, np.array([86400.0, 5e5]), GRAVITY).ravel()),
    "start of a noisy pass": (1e-7, start),
    "preliminary orbit": (1e-4, preliminary),
}
"""Each with how far it may move, relatively."""


@pytest.mark.parametrize("name", RUNS)
def test_every_number_is_the_recorded_one(name: str) -> None:
    within, run = RUNS[name]
    check_numbers(DATA / "orbit_numbers.csv", name, run(), within, 1e-9)
