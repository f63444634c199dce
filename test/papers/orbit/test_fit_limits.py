"""Where a fit ends: its iterations, its rank and what it names, its smallest number of measurements."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.papers.orbit import batch
from rf_pointing.papers.orbit.batch import Arc, fit_orbit
from rf_pointing.papers.orbit.measurements import Elements, look
from rf_pointing.papers.orbit.motion import Gravity, Site, propagate, propagate_together

Array = NDArray[np.float64]
EPOCH, GRAVITY = 827385062.07, Gravity()
SITE = Site(name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45))
START = Elements(
    semi_major_axis_m=7205497.854, eccentricity=0.002332, inclination_rad=math.radians(98.789565),
    node_rad=math.radians(156.612388), perigee_rad=math.radians(243.5181), mean_anomaly_rad=math.radians(325.4653),
).state()  # fmt: skip
OFF = np.array([3e3, -2e3, 1e3, 3.0, 2.0, -4.0])


def arcs(elapsed_s: list[float], scale: float = 1.0) -> list[Arc]:
    times = EPOCH + np.array(elapsed_s)
    seen = look(times, propagate(EPOCH, START, times, GRAVITY).states, SITE, GRAVITY)
    sigmas = {"range_m": 10.0, "azimuth_rad": 2e-4, "elevation_rad": 2e-4}
    return [Arc(SITE, kind, times, getattr(seen, kind), scale * sigma) for kind, sigma in sigmas.items()]


PASS = [-140.0, -100.0, -60.0, -20.0, 20.0, 60.0]


def test_a_fit_that_starts_at_the_truth_takes_one_iteration_and_one_that_does_not_takes_more() -> None:
    assert fit_orbit(EPOCH, START, arcs(PASS), GRAVITY).iterations == 1
    assert fit_orbit(EPOCH, START + OFF, arcs(PASS), GRAVITY).iterations == 3


def test_the_last_iteration_allowed_may_settle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "_MAX_ITERATIONS", 3)
    assert fit_orbit(EPOCH, START + OFF, arcs(PASS), GRAVITY).iterations == 3
    monkeypatch.setattr(batch, "_MAX_ITERATIONS", 2)
    with pytest.raises(ValueError, match="has not settled after 2 iterations"):
        fit_orbit(EPOCH, START + OFF, arcs(PASS), GRAVITY)


def test_a_step_far_below_the_sigma_of_the_state_ends_the_fit() -> None:
    assert fit_orbit(EPOCH, START + 1e-3 * OFF, arcs(PASS, scale=1e7), GRAVITY).iterations == 1


def test_six_measurements_of_two_instants_determine_an_orbit() -> None:
    found = fit_orbit(EPOCH, START + 0.1 * OFF, arcs([-140.0, 60.0]), GRAVITY)
    assert np.linalg.norm((found.state - START)[:3]) < 1.0
    assert max(float(np.max(np.abs(each))) for each in found.residuals) < 0.1


def test_an_arc_is_one_row_of_finite_times_of_a_known_kind() -> None:
    with pytest.raises(ValueError, match="kind="):
        Arc(SITE, "doppler", np.zeros(2), np.zeros(2), np.ones(2))
    for times in (np.zeros((2, 2)), np.array([0.0, math.nan])):
        with pytest.raises(ValueError, match="t_s"):
            Arc(SITE, "range_m", times, 1.0, 1.0)
    with pytest.raises(ValueError, match="values"):
        Arc(SITE, "range_m", np.zeros(2), math.nan, 1.0)
    single = Arc(SITE, "range_m", [0, 1], 5, 1)  # type: ignore[arg-type]
    assert isinstance(single.t_s, np.ndarray)
    assert single.values.tolist() == [5.0, 5.0]


def test_an_orbit_at_its_epoch_is_the_state_and_partials_are_given_where_asked_for() -> None:
    found = propagate(EPOCH, START, [EPOCH, EPOCH], GRAVITY)
    assert found.states == pytest.approx(np.stack([START, START]))
    assert found.partials is None
    asked = propagate(EPOCH, START, [EPOCH], GRAVITY, with_partials=True)
    assert asked.partials == pytest.approx(np.eye(6)[None], abs=1e-6)


@pytest.mark.parametrize(
    ("epoch", "elapsed_s"), [({}, 20.0), ({"epoch_t_s": EPOCH}, 20.0), ({"epoch_t_s": EPOCH}, -20.0)]
)
def test_disturbances_act_at_the_time_of_the_states(epoch: dict[str, float], elapsed_s: float) -> None:
    times: list[float] = []

    def acceleration(t_s: float, states: Array) -> Array:
        times.append(t_s)
        return np.zeros((len(states), 3))

    air: Any = SimpleNamespace(acceleration=acceleration)
    propagate_together(START[None], [elapsed_s], GRAVITY, disturbances=air, **epoch)
    begun = epoch.get("epoch_t_s", 0.0)
    assert times[0] == begun
    assert sorted((begun, begun + elapsed_s)) == pytest.approx([min(times), max(times)], rel=1e-12, abs=1e-6)
