"""The weight of the radar angles in closed form, and the arcs that a batch is made of."""

import math
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.core import random_stream
from rf_pointing.papers import satcal_orbit
from rf_pointing.papers.orbit.batch import Arc, OrbitResult
from rf_pointing.papers.orbit.measurements import Elements, Look, look, measured, visits
from rf_pointing.papers.orbit.motion import Gravity, Trajectory, propagate
from rf_pointing.papers.satcal_campaign import APRIL_T_S, INJECTION_T_S, IRS_P3, IRS_P3_APRIL, SITES, model_of
from rf_pointing.papers.satcal_orbit import BatchCheck, batch_check, preliminary_check

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


def test_the_weight_is_sought_between_a_hundredth_and_a_hundred_thousand_times_the_noise() -> None:
    shift = np.array([0.0, 300.0, 0.0, 1.0, 2.0, 3.0])
    for target_m, times in ((1e9, 0.01), (0.0, 1e5)):
        sigma = satcal_orbit._weight_for(target_m, result(0.5), result(1.0), shift)
        assert sigma == pytest.approx(times * ANGLE_RAD, rel=1e-9)


def test_network_noise_is_drawn_arc_by_arc_and_added(arcs: list[Arc]) -> None:
    grid = APRIL_T_S + 30.0 * np.arange(1440)
    states = propagate(APRIL_T_S, IRS_P3_APRIL.state(), grid, Gravity()).states
    random = random_stream(1, "network")
    for arc in arcs:
        seen = measured(grid, states, arc.site)
        up = seen[:, 1] > LOWEST_RAD
        noise = arc.sigma * random.standard_normal(len(arc.t_s))
        true = seen[up, 2 if arc.kind == "range_m" else 3]
        assert arc.values == pytest.approx(true + noise, rel=1e-9, abs=1e-6)


def test_the_network_measures_over_whole_days(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Array] = []

    def kept(epoch_t_s: float, state: Array, t_s: Array, gravity: Gravity) -> Trajectory:
        asked.append(t_s)
        return propagate(epoch_t_s, state, t_s, gravity)

    monkeypatch.setattr(satcal_orbit, "_BATCH_DAYS", 0.01)
    monkeypatch.setattr(satcal_orbit, "propagate", kept)
    satcal_orbit._network_arcs(random_stream(1, "network"))
    assert asked[0] == pytest.approx(APRIL_T_S + 30.0 * np.arange(29))


def test_every_preliminary_run_draws_its_own_noise_and_is_corrected_with_its_own_model() -> None:
    planted = model_of({"azimuth_offset": 0.3, "elevation_offset": -0.1})
    models = [planted, model_of({"azimuth_offset": 0.25})]
    random = random_stream(3, "runs")
    once = preliminary_check(planted, models, random_stream(3, "runs"))
    first, second = (preliminary_check(planted, [model], random) for model in models)
    assert once.uncorrected == pytest.approx(np.concatenate([first.uncorrected, second.uncorrected]))
    assert once.corrected == pytest.approx(np.concatenate([first.corrected, second.corrected]))


def test_a_preliminary_orbit_without_noise_is_exact_where_the_model_is() -> None:
    planted = model_of({"azimuth_offset": 0.3, "elevation_offset": -0.1})
    shapes: list[tuple[int, ...]] = []

    def nothing(shape: tuple[int, ...]) -> Array:
        shapes.append(shape)
        return np.zeros(shape)

    silent = SimpleNamespace(standard_normal=nothing)
    check = preliminary_check(planted, [planted], silent)  # type: ignore[arg-type]
    # Two angles and the range, every 2 s from -140 to 20 s.
    assert shapes == [(3, 81)]
    assert np.abs(check.corrected).max() < 1e-3
    assert np.abs(check.uncorrected).min() > 1e-2


def test_the_batch_draws_one_noise_for_each_angle_of_each_radar(passes: list[Look]) -> None:
    planted = {"one": model_of({"azimuth_offset": 0.3}), "two": model_of({"elevation_offset": 0.1})}
    shapes: list[tuple[int, ...]] = []

    class Random:
        def standard_normal(self, shape: tuple[int, ...]) -> Array:
            shapes.append(shape)
            return np.zeros(shape)

    def stop(*_: object, **__: object) -> None:
        raise InterruptedError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(satcal_orbit, "_network_arcs", lambda _: [])
        patch.setattr(satcal_orbit, "fit_orbit", stop)
        with pytest.raises(InterruptedError):
            batch_check(planted, planted, passes, 25.0, Random())  # type: ignore[arg-type]
    assert shapes == [(2, 2, len(passes[0].t_s))]


def test_ranges_alone_are_as_good_as_the_trace_of_their_position_covariance(
    monkeypatch: pytest.MonkeyPatch, passes: list[Look]
) -> None:
    covariance = np.diag([1.0, 4.0, 11.0, 100.0, 100.0, 100.0])
    made = OrbitResult(0.0, IRS_P3_APRIL.state(), covariance, (), 1.0, 1, ())
    monkeypatch.setattr(satcal_orbit, "_network_arcs", lambda _: [])
    monkeypatch.setattr(satcal_orbit, "fit_orbit", lambda *_, **__: made)
    monkeypatch.setattr(satcal_orbit, "_weight_for", lambda *_: math.radians(0.07))
    monkeypatch.setattr(OrbitResult, "shift_from", lambda _, biases: np.full(6, float(len(biases))))
    models = {"one": model_of({}), "two": model_of({})}
    check = batch_check(models, models, passes, 25.0, random_stream(1, "batch"))
    assert check.range_only_sigma_m == pytest.approx(4.0)
    assert check.angle_sigma_deg == pytest.approx(0.07)
    # An entry for each angle of each radar.
    assert check.predicted_shift == pytest.approx(np.full(6, 4.0))
    assert check.measurements == {"network": 0, "angles": 4 * len(passes[0].t_s)}


def test_a_preliminary_run_sees_true_angles_and_range_with_bias_and_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    site, times = SITES["Mauritius"], INJECTION_T_S + np.arange(-140.0, 21.0, 2.0)
    truth = propagate(INJECTION_T_S, IRS_P3.state(), times, Gravity()).states
    seen = look(times, truth, site, Gravity())
    asked: list[tuple[Array, Array, Elements]] = []

    def kept(_site: object, _times: object, distance: Array, angles: Array, middle: Elements) -> tuple[float, float]:
        asked.append((distance, angles, middle))
        return 1.0, 2.0

    monkeypatch.setattr(satcal_orbit, "_element_error", kept)
    planted, fitted = model_of({"azimuth_offset": 0.3, "elevation_offset": -0.1}), model_of({"azimuth_offset": 0.2})
    noise = SimpleNamespace(standard_normal=lambda shape: np.arange(1.0, 4.0)[:, None] * np.ones(shape))
    preliminary_check(planted, [fitted], noise)  # type: ignore[arg-type]
    true = np.stack([seen.azimuth_rad, seen.elevation_rad])
    for (distance, angles, middle), bias_deg in zip(asked, ((0.3, -0.1), (0.1, -0.1)), strict=True):
        assert distance == pytest.approx(seen.range_m + 30.0, abs=1e-6)
        due = true + np.radians(bias_deg)[:, None] + ANGLE_RAD * np.array([[1.0], [2.0]])
        assert angles == pytest.approx(due, abs=1e-12)
        assert middle.state() == pytest.approx(truth[40], rel=1e-9)


def test_errors_of_the_elements_are_in_kilometres_and_degrees() -> None:
    site, times = SITES["Mauritius"], INJECTION_T_S + np.arange(-140.0, 21.0, 2.0)
    truth = propagate(INJECTION_T_S, IRS_P3.state(), times, Gravity()).states
    seen, middle = look(times, truth, site, Gravity()), Elements.from_state(truth[40])
    other = middle.replace(
        semi_major_axis_m=middle.semi_major_axis_m - 3000.0, inclination_rad=middle.inclination_rad + 0.01
    )
    angles = np.stack([seen.azimuth_rad, seen.elevation_rad])
    found = satcal_orbit._element_error(site, times, seen.range_m, angles, other)
    assert found == pytest.approx((3.0, -math.degrees(0.01)), abs=1e-4)
