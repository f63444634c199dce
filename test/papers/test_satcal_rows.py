"""`reproduce satcal`: what each table is computed from, the remarks of its rows, and where its explanations end."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers import satcal, satcal_campaign
from rf_pointing.papers.orbit.measurements import Look, visits
from rf_pointing.papers.orbit.motion import Gravity, Trajectory, propagate
from rf_pointing.papers.satcal_campaign import (
    APRIL_T_S,
    INJECTION_T_S,
    IRS_P3,
    IRS_P3_APRIL,
    MAURITIUS,
    MAURITIUS_DEG,
    ORBIT_PRIORS,
    PCMC_DEG,
    SITES,
    Runs,
    many_runs,
    model_of,
    points_of,
    sky_filling_points,
)
from rf_pointing.papers.satcal_orbit import BatchCheck, PreliminaryCheck
from test.papers.recorded import changed

LOWEST_RAD = math.radians(10.0)


def few_passes() -> list[Look]:
    return visits(SITES["Sriharikota"], IRS_P3_APRIL, APRIL_T_S, 1.5, Gravity(), step_s=60.0, lowest_rad=LOWEST_RAD)


def batch(scale: float) -> BatchCheck:
    shifts = scale * (1e-2 * np.arange(12.0).reshape(2, 6) - np.array([[20.0, 3.0, 9.0, 0.0, 0.0, 0.0]] * 2))
    shifts[0, 3:] *= 1.9
    return BatchCheck(
        angle_sigma_deg=0.01, raw_shift=shifts[0], corrected_shift=0.1 * shifts[1], predicted_shift=shifts[0] + 0.2,
        range_only_sigma_m=2.0, measurements={"network": 100, "angles": 50},
    )  # fmt: skip


def planted_runs() -> tuple[Runs, Runs]:
    """Return a fit with priors of the orbit and one without; two terms are hard to tell apart."""
    points = points_of(few_passes(), math.radians(0.01))
    names = ("azimuth_offset", "azimuth_velocity_lag", "elevation_offset", "droop")
    model = model_of({"azimuth_offset": 0.4, "azimuth_velocity_lag": 0.5, "elevation_offset": -0.2})
    random = random_stream(1, "planted campaigns")
    first, second = (
        many_runs(points, model, names, count, random, priors) for count, priors in ((4, ORBIT_PRIORS), (3, None))
    )
    return first, second


def test_only_the_first_coefficient_carries_the_remark() -> None:
    runs, _ = planted_runs()
    rows = satcal.coefficient_rows("Table 1", runs, "few")
    assert [row.remark for row in rows] == ["few", "", "", ""]


def test_honesty_says_what_is_lost_without_orbit_parameters() -> None:
    runs, _ = planted_runs()
    ones = np.ones((4, 4))
    # Spreads of 2 to 5 sigma; one run of four with all terms within three.
    off = np.array([[2.0, 3.5, 4.0, 5.0]] * 3 + [[2.0, 2.0, 2.0, 2.0]])
    white = Runs(runs.names, runs.truth, runs.truth + off, ones, runs.first)
    rows = satcal.honesty_rows("Table 1", runs, white)
    largest = math.sqrt((3.0 * 25.0 + 4.0) / 4.0)
    assert rows[0].remark == (
        f"without orbit parameters: sigma 2.0 to {largest:.1f} times too small, 25 % of 4 runs within 3 sigma"
    )
    assert satcal.honesty_rows("Table 1", runs, None)[0].remark == ""


def test_estimates_lie_within_three_sigma_on_either_side() -> None:
    runs, _ = planted_runs()
    sigma = np.full((2, 4), 0.5)
    values = runs.truth + np.array([[1.4, -1.4, 1.6, -1.6], [0.0, 1.49, -1.51, 3.0]])
    found = Runs(runs.names, runs.truth, values, sigma, runs.first).within_three_sigma()
    assert found.tolist() == [[True, True, False, False], [True, True, False, False]]


def test_velocities_say_how_a_shift_along_the_orbit_turns_them() -> None:
    first, _ = satcal._velocity_rows(batch(1.0), 30.0)
    # 30 m of 2 pi / 6080 s.
    assert "a shift of 30.0 m along" in first.remark
    assert "turns the velocity by 3.1 cm/s" in first.remark


def test_the_batch_states_its_measurements_weight_and_shift() -> None:
    runs, _ = planted_runs()
    made = replace(batch(1.0), predicted_shift=batch(1.0).raw_shift + np.array([0.3, 0.4, 0.0, 9.0, 9.0, 9.0]))
    with changed(satcal, batch_check=lambda *_: made):
        rows = satcal._batch_rows(1, {"PCMC-1": runs}, [])
    raw = float(np.linalg.norm(made.raw_shift[:3]))
    assert rows[0].ours == pytest.approx(raw)
    assert rows[1].ours == pytest.approx(np.linalg.norm(made.corrected_shift[:3]))
    assert rows[-1].ours == pytest.approx(0.5 / raw)
    for words in ("100 ranges", "50 radar angles", "good to 2.0 m", "weighted 0.0100 deg"):
        assert words in rows[0].remark


def test_a_velocity_is_explained_up_to_a_quarter_off_the_turned_position() -> None:
    turned = 2.0 * math.pi / 6080.0
    for share, explained in ((0.76, True), (0.74, False), (1.24, True), (1.26, False)):
        shift = np.array([100.0, 0.0, 0.0, 0.0, share * 100.0 * turned, 0.0])
        first, _ = satcal._velocity_rows(replace(batch(1.0), raw_shift=shift), 100.0)
        assert first.explained is explained
        assert first.ours == pytest.approx(share * 1e4 * turned)


def test_terms_that_correlate_by_nine_tenths_are_named() -> None:
    runs, _ = planted_runs()
    asked: list[float] = []

    def inseparable(threshold: float) -> tuple[tuple[str, str, float], ...]:
        asked.append(threshold)
        return (("droop", "elevation_offset", -0.97),)

    first = SimpleNamespace(inseparable=inseparable)
    rows = satcal.honesty_rows("Table 1", replace(runs, first=first), None)  # type: ignore[arg-type]
    assert rows[2].remark == "term pairs with |correlation| >= 0.9: x11-x10 -0.97"
    assert asked == [0.9]


def test_the_worst_spread_is_the_farthest_from_one_on_either_side() -> None:
    runs, _ = planted_runs()
    ones = np.ones((2, 4))
    for spreads, worst in (((1.0, 1.9, 0.3, 1.0), 1), ((1.0, 1.1, 0.3, 1.0), 2)):
        values = runs.truth + np.array(spreads)
        made = Runs(runs.names, runs.truth, np.array([values, values]), ones, runs.first)
        row = satcal.honesty_rows("Table 1", made, None)[1]
        assert row.ours == pytest.approx(spreads[worst])
        assert f"({satcal._short(runs.names[worst])})" in row.quantity


def test_the_closure_covers_more_than_a_turn_of_azimuth_and_rates_of_both_signs() -> None:
    seen: list[np.ndarray] = []

    class Off:
        """Gives azimuth back exactly and one elevation 2e-3 rad too low."""

        def apply(self, *motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            seen.extend(motion)
            return motion[0], motion[1]

        def remove(self, *motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            off = np.zeros_like(motion[1])
            off[3, 4] = -2e-3
            return motion[0], motion[1] + off

    with changed(satcal, MAURITIUS=Off()):
        row = satcal._closure(1)
    assert row.ours == pytest.approx(math.degrees(2e-3))
    azimuth, elevation, *rates = seen
    assert np.degrees(azimuth[0]) == pytest.approx(np.arange(-270.0, 270.1, 5.0))
    assert np.degrees(elevation[:, 0]) == pytest.approx(np.arange(5.0, 89.1, 1.0))
    for rate, size in zip(rates, (5e-3, 5e-3, 1e-4, 1e-4), strict=True):
        assert -size <= rate.min() < -0.99 * size
        assert 0.99 * size < rate.max() <= size


def test_the_campaign_plans_three_satellites_of_one_kind_over_30_days() -> None:
    asked: list[Any] = []
    with changed(satcal, sky_filling_points=lambda *words: asked.extend(words)):
        satcal._mauritius_points()
    site, satellites, epoch_t_s, days, sigma_rad = asked
    assert (site, epoch_t_s, days) == (SITES["Mauritius"], INJECTION_T_S, 30.0)
    assert math.degrees(sigma_rad) == pytest.approx(0.01)
    places = [(math.degrees(each.node_rad), math.degrees(each.mean_anomaly_rad)) for each in satellites]
    assert places == [pytest.approx(place) for place in ((156.6, 325.5), (200.0, 100.0), (156.6, 200.0))]
    assert all(
        each == IRS_P3.replace(node_rad=each.node_rad, mean_anomaly_rad=each.mean_anomaly_rad) for each in satellites
    )


def test_points_fill_the_sectors_asked_for_from_all_satellites_at_10_s() -> None:
    asked: list[Any] = []

    def select(parts: list[Any], rule: Any, *, require_full: bool) -> tuple[str, str]:
        asked.extend((parts, rule, require_full))
        return "chosen", "coverage"

    with changed(satcal_campaign, select_observations=select):
        found = sky_filling_points(SITES["Mauritius"], [IRS_P3_APRIL, IRS_P3_APRIL], APRIL_T_S, 0.5, 1e-4)
    assert found == "chosen"
    (points,), rule, full = asked
    assert (rule, full) == (satcal_campaign.SectorRule(), True)
    one = visits(SITES["Mauritius"], IRS_P3_APRIL, APRIL_T_S, 0.5, Gravity(), step_s=10.0, lowest_rad=LOWEST_RAD)
    expected = points_of([*one, *one], 1e-4)
    np.testing.assert_array_equal(points.t_s, expected.t_s)
    np.testing.assert_array_equal(points.pass_id, expected.pass_id)
    assert set(points.sigma_azimuth_rad) == {1e-4}


def test_points_end_at_80_degrees_of_elevation_and_a_pass_above_it_has_none() -> None:
    seen = few_passes()[0]

    def raised(elevation_deg: list[float]) -> Look:
        count = len(elevation_deg)
        parts = {name: getattr(seen, name)[:count] for name in Look.__dataclass_fields__}
        return Look(**parts | {"elevation_rad": np.radians(elevation_deg)})

    points = points_of([raised([85.0, 84.0]), raised([50.0, 79.9, 80.1]), raised([11.0])], 1e-4)
    assert np.degrees(points.true_elevation_rad) == pytest.approx([50.0, 79.9, 11.0])
    assert list(points.pass_id) == [1, 1, 2]


def test_the_radar_passes_lie_above_ten_degrees_and_peak_at_35_40_62_and_39_degrees() -> None:
    asked: list[np.ndarray] = []

    def kept(epoch_t_s: float, state: np.ndarray, t_s: np.ndarray, gravity: Gravity) -> Trajectory:
        asked.append(t_s)
        return propagate(epoch_t_s, state, t_s, gravity)

    with changed(satcal, propagate=kept):
        found = satcal._radar_passes()
    # 2.5 days.
    np.testing.assert_array_equal(asked[0], APRIL_T_S + 10.0 * np.arange(21600))
    peaks = [math.degrees(np.max(seen.elevation_rad)) for seen in found]
    assert peaks == pytest.approx([35.3, 39.6, 62.5, 39.1], abs=0.1)
    for seen in found:
        assert np.diff(seen.t_s) == pytest.approx(np.full(len(seen.t_s) - 1, 10.0))
        # A step later or earlier the satellite is below.
        assert np.all(np.degrees(seen.elevation_rad) >= 10.0)
        assert np.degrees(seen.elevation_rad[[0, -1]]) == pytest.approx([10.0, 10.0], abs=0.95)
        slope = np.gradient(seen.elevation_rad, seen.t_s)[1:-1]
        assert slope == pytest.approx(seen.elevation_rate_rad_s[1:-1], abs=2e-4)
    hours = [(seen.t_s[0] - APRIL_T_S) / 3600.0 for seen in found]
    assert hours == pytest.approx([4.64, 17.46, 41.17, 53.75], abs=0.02)


@pytest.mark.parametrize("effort", [None, satcal.Effort(campaigns=5, white=3, radars=4, orbits=2)])
def test_the_command_computes_each_table_from_its_own_campaigns(effort: satcal.Effort | None) -> None:
    runs = effort or satcal.Effort()
    points, passes, asked = few_passes(), few_passes(), []
    campaign = points_of(points, 1e-4)

    def fits(points: Any, model: Any, names: Any, count: int, random: np.random.Generator, priors: Any) -> str:
        asked.append((model, names, count, priors, float(random.standard_normal()), set(points.sigma_azimuth_rad)))
        return f"fits {len(asked)}"

    def row(*words: Any) -> list[tuple[Any, ...]]:
        return [words]

    def drawn(seed: int, name: str) -> float:
        return float(random_stream(seed, name).standard_normal())

    with changed(
        satcal, many_runs=fits, _mauritius_points=lambda: campaign, _radar_passes=lambda: passes,
        _closure=lambda seed: ("closure", seed), coefficient_rows=row, honesty_rows=row, residual_rows=row,
        _preliminary_rows=row, _batch_rows=row,
    ):  # fmt: skip
        words: list[Any] = satcal.rows(effort=effort) if effort else satcal.rows()
    radar = {math.radians(0.0057)}
    assert asked == [
        (MAURITIUS, tuple(MAURITIUS_DEG), runs.campaigns, ORBIT_PRIORS, drawn(1, "satcal mauritius"), {1e-4}),
        (MAURITIUS, tuple(MAURITIUS_DEG), runs.white, None, drawn(1, "satcal white"), {1e-4}),
        *(
            (model_of(table), tuple(table), runs.radars, ORBIT_PRIORS, drawn(1, f"satcal {name}"), radar)
            for name, table in PCMC_DEG.items()
        ),
    ]
    assert words[:2] == [
        ("closure", 1),
        ("Table 1", "fits 1", f"one campaign, {len(campaign)} points, {len(campaign.passes)} passes"),
    ]
    assert words[2:7] == [
        ("Table 1", "fits 1", "fits 2"),
        ("Table 3, PCMC-1", "fits 3", "four passes"), ("Table 3, PCMC-2", "fits 4", "four passes"),
        ("Table 3, PCMC-1", "fits 3", None), ("Table 3, PCMC-2", "fits 4", None),
    ]  # fmt: skip
    assert [(name, fit) for name, _, fit in words[7:9]] == [("PCMC-1", "fits 3"), ("PCMC-2", "fits 4")]
    assert words[9:] == [(1, "fits 1", runs.orbits), (1, {"PCMC-1": "fits 3", "PCMC-2": "fits 4"}, passes)]


def test_every_preliminary_orbit_is_corrected_with_another_campaign() -> None:
    runs, _ = planted_runs()
    asked: list[Any] = []

    def check(*words: Any) -> PreliminaryCheck:
        asked.extend(words)
        return PreliminaryCheck(np.array([[15.0, 0.08]]), np.array([[0.9, 0.01]]), (20.0, 50.0))

    with changed(satcal, preliminary_check=check):
        satcal._preliminary_rows(1, runs, 3)
    planted, models, random = asked
    assert planted == MAURITIUS
    assert [[model.coefficients[name] for name in runs.names] for model in models] == runs.values[:3].tolist()
    assert all(model.coefficients["collimation"] == MAURITIUS.coefficients["collimation"] for model in models)
    assert random.standard_normal() == random_stream(1, "satcal preliminary orbit").standard_normal()


def test_the_batch_is_asked_for_the_published_shift_with_the_fits_of_both_radars() -> None:
    runs, _ = planted_runs()
    asked: list[Any] = []
    with changed(satcal, batch_check=lambda *words: asked.extend(words) or batch(1.0)):
        satcal._batch_rows(1, {"PCMC-1": runs}, [])
    planted, fitted, passes, target_m, random = asked
    assert planted == {name: model_of(table) for name, table in PCMC_DEG.items()}
    assert fitted == {"PCMC-1": runs.first.model}
    assert (list(passes), target_m) == ([], 23.517)
    assert random.standard_normal() == random_stream(1, "satcal batch orbit").standard_normal()
