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
    count: int,
    sources: int,
    snr_db: float,
    response: ArrayResponse | None = None,
    excluded: str = "",
    towards: np.ndarray = TOWARDS,
) -> list[ResponseMisfit]:
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
