"""The watch over the array is silent on a known response and finds one that is not as known."""

from functools import partial

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams
from rf_pointing.array_sensors.doa.estimator import DoaEstimator, DoaEstimatorParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.doa.response_watch import ResponseMisfit, ResponseWatch

ARRAY, PARAMS = CircularArrayParams(), WatchParams()
TOWARDS = np.array([[0.1, 0.2, np.sqrt(0.95)], [-0.5, 0.3, np.sqrt(0.66)]])
IDEAL = np.ones(12, complex)
NONE = np.zeros(6, complex)


def misfits(
    count: int, sources: int, snr_db: float, response: ArrayResponse | None = None,
    excluded: str = "", towards: np.ndarray = TOWARDS,
) -> list[ResponseMisfit]:  # fmt: skip
    """Return the misfits of `count` blocks, of all their sources."""
    source = ArraySource(ARRAY, ArraySourceParams(), seed=3, response=response)
    estimator = DoaEstimator(ARRAY, DoaEstimatorParams(sources=sources, excluded=excluded))
    steps = (source.step(float(k), towards[:sources], np.full(sources, snr_db)) for k in range(count))
    return [each.misfit for block in steps for each in estimator.estimate(block)]


def doubts(found: list[ResponseMisfit], phase_sigma_rad: float = 0.0) -> list[str]:
    """Return what the watch says after each misfit."""
    watch, said = ResponseWatch(), []
    for each in found:
        watch = watch.with_direction(PARAMS, each)
        said.append(watch.doubt(PARAMS, phase_sigma_rad, each.freedom))
    return said


@pytest.mark.parametrize("snr_db", [-6.0, 14.0])
@pytest.mark.parametrize(("sources", "excluded"), [(1, ""), (1, "3, 8"), (2, "")])
def test_misfit_of_a_known_array_is_its_noise(snr_db: float, sources: int, excluded: str) -> None:
    found = misfits(150, sources, snr_db, excluded=excluded)
    share = [each.squared / (each.freedom * each.noise_rad2) for each in found]
    # Four standard errors of the mean; first order in 1 / (L SNR).
    within = 4.0 * np.sqrt(2.0 / (found[0].freedom * len(found)))
    assert np.mean(share) == pytest.approx(1.0, abs=within + (0.1 if snr_db < 0.0 else 0.0))
    assert not any(doubts(found))


def test_coupling_that_is_not_calibrated_is_found_with_its_size() -> None:
    coupling = np.array([0.18j, 0.0, 0.0, 0.0, 0.0, 0.0])
    response = ArrayResponse(gain=IDEAL, coupling=coupling)
    said = doubts(misfits(40, 1, 0.0, response, towards=TOWARDS[1:]))
    # Of fewer than five directions the sums say nothing yet.
    assert said[3] == ""
    assert "deg off their known response" in said[-1]
    # Two neighbours of 0.18 in quadrature, less what all elements have in common.
    assert 3.0 < float(said[-1].split(" deg off")[0].split()[-1]) < 20.0


def test_phases_are_found_unless_they_are_stated() -> None:
    stream, sigma = np.random.default_rng(2), 0.17
    found = partial(misfits, 60, 1, 0.0)
    for _ in range(3):
        response = ArrayResponse(gain=np.exp(1j * sigma * stream.standard_normal(12)), coupling=NONE)
        assert doubts(found(response))[-1]
        assert not any(doubts(found(response), sigma))
        assert doubts(found(response), 0.2 * sigma)[-1]


def test_gains_count_only_where_they_bend_directions() -> None:
    level = 10.0 ** (np.random.default_rng(4).standard_normal(12) / 20.0)
    response = ArrayResponse(gain=level.astype(complex), coupling=NONE)
    assert not any(doubts(misfits(60, 1, 0.0, response)))
    assert doubts(misfits(60, 2, 0.0, response))[-1]


@pytest.mark.parametrize(("apart", "merged"), [(0.13, True), (0.3, False)])
def test_two_sources_with_one_maximum_leave_another_that_noise_does_not_make(apart: float, merged: bool) -> None:
    towards = np.array([[x, 0.2, np.sqrt(0.96 - x**2)] for x in (0.3, 0.3 + apart)])
    found = misfits(40, 2, 0.0, towards=towards)
    beyond = [each.squared > each.by_chance(0.0, PARAMS.false_alarm) for each in found]
    # Of each block one, where its signals have one maximum between them.
    assert np.sum(beyond) == (len(found) // 2 if merged else 0)
    # Chi-square of 16 degrees exceeds 39.3 with 1e-3.
    one = ResponseMisfit(squared=1.0, noise_rad2=0.02, freedom=16)
    assert one.by_chance(0.1, 1e-3) == pytest.approx(39.25 * (1.15 * 0.02 + 0.01), rel=0.002)


def test_the_size_that_is_named_is_the_excess_over_the_noise_per_element() -> None:
    watch, params = ResponseWatch(), WatchParams(directions=(1e4,))
    for _ in range(50):
        watch = watch.with_direction(params, ResponseMisfit(squared=9 * (1e-4 + 0.05**2), noise_rad2=1e-4, freedom=9))
    assert watch.doubt(params, 0.0, 9).startswith("the elements are at least 2.9 deg off")
    # Fewer than five directions say nothing, however far off.
    watch = ResponseWatch()
    for number in range(1, 8):
        watch = watch.with_direction(params, ResponseMisfit(squared=9.0, noise_rad2=1e-4, freedom=9))
        assert bool(watch.doubt(params, 0.0, 9)) is (number > 5)
