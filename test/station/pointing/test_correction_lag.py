"""Offsets led against the mount's lags: the simulated mount's beam goes where the offset says."""

import math
from itertools import pairwise

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.core import MDEG
from rf_pointing.station.antenna.mount import MountError, MountParams, RateAverage
from rf_pointing.station.pointing.correction_lag import CorrectionLag

PERIOD_S, TICK_S, AVERAGING_S = 0.1, 0.02, 5.0
MODEL = MountParams(azimuth_velocity_lag_s=-1.0, elevation_velocity_lag_s=-1.9).model()
START_RAD = np.array([1.0, 0.6])


def pulled_in(t_s: np.ndarray) -> np.ndarray:
    """195 mdeg down and half as much to the side within 2 s, as after a search."""
    share = np.clip(t_s / 2.0, 0.0, 1.0)
    return np.outer(share**3 * (10.0 - 15.0 * share + 6.0 * share**2), [100.0 * MDEG, -195.0 * MDEG])


def rates_at(t_s: np.ndarray) -> np.ndarray:
    return (pulled_in(t_s + 1e-4) - pulled_in(t_s - 1e-4)) / 2e-4


def beam_error_mdeg(averaging_s: float) -> float:
    """Largest distance of the simulated mount's beam from where the offset says, when commanded with the lead."""
    lag, mount, mean = CorrectionLag(averaging_s), MountError(MODEL), RateAverage(AVERAGING_S)
    worst, before = 0.0, START_RAD
    for period in range(300):
        times = PERIOD_S * (period + np.arange(3))
        offset = pulled_in(times)
        lead = lag.lead(times, rates_at(times), MODEL)
        for tick in range(5):
            share = tick / 5.0
            axes = START_RAD + (1.0 - share) * (offset + lead.position)[0] + share * (offset + lead.position)[1]
            t_s = float(times[0]) + tick * TICK_S
            beam = mount.remove(t_s, axes, mean.rate_rad_s, mean.acceleration_rad_s2)
            mean.update(TICK_S, (axes - before) / TICK_S + mount.drift_rad_s)
            before = axes
            wanted = START_RAD + pulled_in(np.array([t_s]))[0]
            worst = max(worst, float(np.max(np.abs(beam - wanted))) / MDEG)
    return worst


def test_the_beam_goes_where_it_was_sent_and_not_a_fifth_of_the_way_beside_it() -> None:
    assert beam_error_mdeg(0.0) > 30.0
    assert beam_error_mdeg(AVERAGING_S) < 4.0


def test_its_derivatives_belong_to_it_and_the_coming_leads_are_those_that_come() -> None:
    lag, found = CorrectionLag(AVERAGING_S), []
    for period in range(100):
        times = PERIOD_S * (period + np.arange(10))
        found.append(lag.lead(times, rates_at(times), MODEL))
    for earlier, later in pairwise(found):
        np.testing.assert_allclose(earlier.position[1:], later.position[:-1], atol=1e-12)
    position, velocity = np.array([(m.position[0], m.velocity[0]) for m in found]).transpose(1, 0, 2)
    steps = 0.5 * PERIOD_S * (velocity[1:] + velocity[:-1])
    np.testing.assert_allclose(np.diff(position, axis=0), steps, atol=0.02 * MDEG)


@pytest.mark.parametrize(("averaging_s", "model"), [(0.0, MODEL), (AVERAGING_S, BiasModel.zero())])
def test_without_lags_or_their_time_nothing_is_added(averaging_s: float, model: BiasModel) -> None:
    times = PERIOD_S * np.arange(10)
    for part in CorrectionLag(averaging_s).lead(times, rates_at(times), model):
        assert not part.any()


def test_a_new_pass_begins_at_rest() -> None:
    lag, times = CorrectionLag(AVERAGING_S), PERIOD_S * np.arange(10)
    for late_s in (0.0, 0.5, 1.0):
        lag.lead(times + late_s, rates_at(times + late_s), MODEL)
    lag.restart()
    assert not lag.lead(times + 100.0, np.full((10, 2), math.radians(0.1)), MODEL).position[0].any()
