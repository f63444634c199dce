"""The daily motion from differences of levels: planted truths, the independence of the level, memory."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rf_pointing.core import gaussian_loss_db
from rf_pointing.station.service.sidereal import SIDEREAL_DAY_S, TERMS, Sample, SiderealMotion

WIDTH_RAD, T_S = math.radians(0.25), 1.8e9
EVEN = np.ones(2)


def made(swing_deg: float = 7.0) -> SiderealMotion:
    return SiderealMotion(WIDTH_RAD, math.radians(3.0), math.radians(swing_deg), t_s=T_S)


def planted(random: np.random.Generator, swing_deg: float) -> SiderealMotion:
    """Return a motion with coefficients of the sizes that are believed at first."""
    found = made(swing_deg)
    found.mean = random.normal(0.0, np.sqrt(np.diag(found.covariance)))
    return found


def pair(
    truth: SiderealMotion, t_s: float, places: np.ndarray, random: np.random.Generator,
    sigma_db: float,
) -> list[Sample]:  # fmt: skip
    """Return two levels of a Gaussian beam half a minute apart, under any weather."""
    weather_db = random.normal(60.0, 5.0)
    found = []
    for number, place in enumerate(places):
        at_s = t_s + 30.0 * number
        loss_db = float(gaussian_loss_db(np.linalg.norm(truth.at(at_s) - place), WIDTH_RAD))
        found.append(
            Sample(
                at_s, place, weather_db - loss_db + random.normal(0.0, sigma_db / math.sqrt(2.0))
            )
        )
    return found


@pytest.mark.parametrize("swing_deg", [0.05, 1.0, 6.0])
def test_a_planted_motion_is_found_from_levels_of_any_strength(
    random: np.random.Generator, swing_deg: float
) -> None:
    """Two days, six differences an hour near the target: the third day to a tenth of a beamwidth."""
    truth, found = planted(random, swing_deg), made(swing_deg)
    found.place(T_S, truth.at(T_S), 0.1 * WIDTH_RAD)
    for number in range(2 * 24 * 60):
        t_s = T_S + 60.0 * number
        sigma = math.sqrt(np.linalg.eigvalsh(found.covariance_rad2(t_s))[-1])
        if number % 10 and sigma < 0.06 * WIDTH_RAD:
            continue
        middle = found.at(t_s)
        for axis in range(2):
            step = 0.15 * WIDTH_RAD * np.eye(2)[axis]
            found.learn(
                *pair(truth, t_s, np.array([middle - step, middle + step]), random, 0.1), EVEN, 0.1
            )
    later = T_S + SIDEREAL_DAY_S * np.linspace(2.0, 3.0, 200)
    off = np.linalg.norm(found.at(later) - truth.at(later), axis=1)
    assert np.max(off) < 0.1 * WIDTH_RAD
    assert off[0] < 4.0 * math.sqrt(np.trace(found.covariance_rad2(later[0])))


@given(level_db=st.floats(-50.0, 50.0))
def test_what_is_learned_does_not_depend_on_the_level(level_db: float) -> None:
    places = np.array([[0.0, 0.0], [0.1 * WIDTH_RAD, 0.0]])
    here, there = made(), made()
    for motion, added in ((here, 0.0), (there, level_db)):
        motion.place(T_S, np.zeros(2), 0.3 * WIDTH_RAD)
        samples = [Sample(T_S + row, place, added - 0.2 * row) for row, place in enumerate(places)]
        motion.learn(*samples, EVEN, 0.1)
    np.testing.assert_allclose(there.mean, here.mean, atol=1e-9 * WIDTH_RAD + 1e-12)


def test_a_manoeuvre_is_seen_and_learned_anew(random: np.random.Generator) -> None:
    truth, found = planted(random, 0.1), made(0.1)
    found.place(T_S, truth.at(T_S), 0.02 * WIDTH_RAD)
    for number in range(600):
        t_s = T_S + 600.0 * number
        if number == 300:
            truth.mean[0] += 0.4 * WIDTH_RAD
        middle = found.at(t_s)
        for axis in range(2):
            step = 0.15 * WIDTH_RAD * np.eye(2)[axis]
            found.learn(
                *pair(truth, t_s, np.array([middle - step, middle + step]), random, 0.1), EVEN, 0.1
            )
        if number == 299:
            assert found.manoeuvres == 0
    assert found.manoeuvres >= 1
    assert np.linalg.norm(found.at(t_s) - truth.at(t_s)) < 0.1 * WIDTH_RAD


def test_what_is_kept_comes_back_and_what_cannot_be_is_refused() -> None:
    first, second = made(), made()
    first.place(T_S, np.array([1e-3, -2e-3]), 1e-4)
    second.restore(json.loads(json.dumps(first.values())))
    np.testing.assert_array_equal(second.mean, first.mean)
    np.testing.assert_allclose(second.covariance_rad2(T_S + 1e5), first.covariance_rad2(T_S + 1e5))
    for name, wrong, said in (
        ("mean", [0.0], f"must have {2 * TERMS} rows"),
        ("mean", [math.nan] * 2 * TERMS, "must be finite"),
        ("covariance", (-np.eye(2 * TERMS)).tolist(), "no negative variance"),
    ):
        with pytest.raises(ValueError, match=said):
            made().restore({**first.values(), name: wrong})
