"""The weight of the radar angles in closed form, and the arcs that a batch is made of."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.core import random_stream
from rf_pointing.papers import satcal_orbit
from rf_pointing.papers.orbit.batch import Arc, OrbitResult
from rf_pointing.papers.orbit.measurements import Look, look, measured, visits
from rf_pointing.papers.orbit.motion import Gravity, propagate
from rf_pointing.papers.satcal_campaign import APRIL_T_S, IRS_P3_APRIL, SITES, model_of
from rf_pointing.papers.satcal_orbit import BatchCheck, batch_check

Array = NDArray[np.float64]
ANGLE_RAD = math.radians(0.01)
LOWEST_RAD = math.radians(10.0)


def result(information: float) -> OrbitResult:
    return OrbitResult(0.0, np.zeros(6), np.eye(6) / information, (), 1.0, 1, ())


@pytest.mark.parametrize(("share", "target_m"), [(3.0, 20.0), (0.2, 7.0), (40.0, 200.0)])
def test_the_weight_of_the_angles_gives_the_target_shift(share: float, target_m: float) -> None:
    """With information n and t n, x = w n t s (1 + t) / (n + w n t) for a weight w relative to 0.01 deg."""
    shift = np.array([0.0, 300.0, 0.0, 1.0, 2.0, 3.0])
    sigma = satcal_orbit._weight_for(target_m, result(0.5), result(0.5 * (1.0 + share)), shift)
    weight = (ANGLE_RAD / sigma) ** 2
    assert weight * 300.0 * (1.0 + share) / (1.0 + weight * share) == pytest.approx(target_m, rel=1e-6)


@pytest.fixture(scope="module")
def arcs() -> list[Arc]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(satcal_orbit, "_BATCH_DAYS", 0.5)
        return satcal_orbit._network_arcs(random_stream(1, "network"))


def test_the_network_measures_range_and_range_rate_above_ten_degrees_every_30_s(arcs: list[Arc]) -> None:
    assert [(arc.site.name, arc.kind) for arc in arcs] == [
        (name, kind) for name in ("Mauritius", "Bangalore", "Lucknow") for kind in ("range_m", "range_rate_m_s")
    ]
    grid = APRIL_T_S + 30.0 * np.arange(1440)
    states = propagate(APRIL_T_S, IRS_P3_APRIL.state(), grid, Gravity()).states
    misses = []
    for arc in arcs:
        seen = measured(grid, states, arc.site)
        up = seen[:, 1] > LOWEST_RAD
        np.testing.assert_array_equal(arc.t_s, grid[up])
        column, sigma = (2, 10.0) if arc.kind == "range_m" else (3, 0.05)
        assert set(arc.sigma) == {sigma}
        misses.append((arc.values - seen[up, column]) / sigma)
    assert np.std(np.concatenate(misses)) == pytest.approx(1.0, abs=0.15)
    assert abs(np.mean(np.concatenate(misses))) < 0.25


@pytest.fixture(scope="module")
def passes() -> list[Look]:
    found = visits(SITES["Sriharikota"], IRS_P3_APRIL, APRIL_T_S, 0.5, Gravity(), step_s=60.0, lowest_rad=LOWEST_RAD)
    times = found[0].t_s
    # Of the integrated orbit, on which the batch is fitted: plans of passes are good to kilometres.
    states = propagate(APRIL_T_S, IRS_P3_APRIL.state(), times, Gravity()).states
    return [look(times, states, SITES["Sriharikota"], Gravity())]


def test_radar_arcs_are_the_true_angles_with_bias_and_noise(passes: Sequence[Look]) -> None:
    count = len(passes[0].t_s)
    model = model_of({"azimuth_offset": 0.3, "elevation_offset": -0.1})
    offsets = satcal_orbit._offsets(passes, model)
    assert np.degrees(offsets[:, 0]) == pytest.approx([0.3, -0.1])
    noise = random_stream(1, "radar").standard_normal((2, 2, count))
    found = satcal_orbit._radar_arcs(passes, {"one": offsets, "two": 2.0 * offsets}, noise, 2e-3)
    assert [arc.kind for arc in found] == ["azimuth_rad", "elevation_rad"] * 2
    for place, arc in enumerate(found):
        radar, axis = divmod(place, 2)
        true = getattr(passes[0], arc.kind)
        assert arc.values == pytest.approx(true + (radar + 1) * offsets[axis] + ANGLE_RAD * noise[radar, axis])
        assert set(arc.sigma) == {2e-3}
        assert arc.site.name == "Sriharikota"


@pytest.fixture(scope="module")
def batch(passes: list[Look]) -> BatchCheck:
    planted = {"radar": model_of({"azimuth_offset": 0.3, "elevation_offset": -0.1})}
    fitted = {"radar": model_of({"azimuth_offset": 0.27, "elevation_offset": -0.09})}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(satcal_orbit, "_BATCH_DAYS", 0.5)
        return batch_check(planted, fitted, passes, 25.0, random_stream(2, "batch"))


def test_raw_angles_shift_the_orbit_by_the_target_and_corrected_ones_by_what_is_left(batch: BatchCheck) -> None:
    assert np.linalg.norm(batch.raw_shift[:3]) == pytest.approx(25.0, rel=0.03)
    assert np.linalg.norm(batch.predicted_shift[:3]) == pytest.approx(25.0, rel=0.01)
    # A tenth of the bias is left.
    assert batch.corrected_shift == pytest.approx(0.1 * batch.raw_shift, rel=0.05, abs=0.02)


def test_the_batch_counts_its_measurements_and_states_the_accuracy_of_ranges_alone(
    batch: BatchCheck, arcs: list[Arc], passes: list[Look]
) -> None:
    assert batch.measurements == {"network": sum(len(arc.t_s) for arc in arcs), "angles": 2 * len(passes[0].t_s)}
    assert 0.5 < batch.range_only_sigma_m < 50.0
    assert 0.01 < batch.angle_sigma_deg < 10.0
