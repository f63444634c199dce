"""Setups, grids, criteria and remarks of the servo rows, on planted flights and loops; and the flown pass itself."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.controllers import PositionLoopParams, dss13_loops, dss13_lqg_loops, load_lqg_designs
from rf_pointing.core import MDEG, random_stream
from rf_pointing.identification import CrossCheck, ExcitationParams, StraightCheck
from rf_pointing.papers import (
    servo,
    servo_feedforward,
    servo_identification,
    servo_monopulse,
    servo_noise,
    servo_pass,
    servo_wind,
)
from rf_pointing.papers.servo_pass import PassErrors, PassSetup
from rf_pointing.papers.servo_sampled import LoopQuality, RadioLoop, Variation, published_radio, station_radio
from rf_pointing.papers.servo_trajectory import LowOrbitPass, MotionTable
from rf_pointing.servo import WindParams, dss13_plant

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
PLAIN, NOTCH = PositionLoopParams(notch_enabled=False), PositionLoopParams()
QUIET = PLAIN.replace(feedforward_gain=0.0)
IDEAL = dss13_plant(ideal=True)


class Flights:
    """Stands in for `fly`: notes every setup and returns errors of these sizes in turn.

    They are ten times as large in the first second from rest, and before `settled_s` of a settled pass; a second after
    that they are zero.
    """

    def __init__(self, *sizes: float, settled_s: float) -> None:
        self.setups: list[PassSetup] = []
        self._sizes, self._settled_s = sizes, settled_s

    def __call__(self, setup: PassSetup) -> PassErrors:
        size = MDEG * self._sizes[len(self.setups) % len(self._sizes)]
        self.setups.append(setup)
        t_s = np.arange(setup.start_s, setup.end_s + 0.5)
        error = size * np.column_stack([np.full(len(t_s), 3.0), np.full(len(t_s), -4.0)])
        error[t_s < (self._settled_s if setup.settled else setup.start_s + 1.0)] *= 10.0
        error[t_s == self._settled_s + 1.0] = 0.0
        return PassErrors(t_s, error, error, error, error)


class Orbit:
    """Stands in for the orbit of a pass: notes the times asked for."""

    def __init__(self) -> None:
        self.t_s = np.zeros(0)

    def at(self, t_s: Array) -> MotionTable:
        self.t_s = t_s
        count = len(t_s)
        elevation = np.linspace(0.5, 1.0, count)
        ones = np.ones(count)
        return MotionTable(
            t_s,
            np.column_stack([ones, elevation]),
            np.column_stack([2e-3 * ones, -3e-3 * np.linspace(0.0, 1.0, count)]),
            np.column_stack([1e-5 / np.cos(elevation), -2e-5 * np.linspace(0.2, 1.0, count)]),
        )


def test_all_rows_of_the_servo_come_in_order_and_with_one_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    seeded: list[int] = []
    for name in ("feedforward_rows", "monopulse_rows"):
        monkeypatch.setattr(servo, name, lambda name=name: [name])
    for name in ("noise_rows", "wind_rows", "identification_rows"):
        monkeypatch.setattr(servo, name, lambda seed, name=name: seeded.append(seed) or [name])
    names = ["feedforward_rows", "monopulse_rows", "noise_rows", "wind_rows", "identification_rows"]
    assert servo.rows(4) == servo.rows() == names
    assert seeded == [4, 4, 4, 1, 1, 1]


# Feedforward.


def test_two_settled_passes_with_and_without_feedforward_and_one_from_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    # With feedforward, without, from rest.
    flights, orbit = Flights(0.01, 20.0, 1.0, settled_s=-140.0), Orbit()
    monkeypatch.setattr(servo_feedforward, "fly", flights)
    monkeypatch.setattr(servo_feedforward, "_gain", list)
    monkeypatch.setattr(
        servo_feedforward, "PassSetup", lambda **names: PassSetup(**names) if names else SimpleNamespace(orbit=orbit)
    )
    rows = servo_feedforward.feedforward_rows()
    assert [(setup.loops, setup.start_s, setup.end_s, setup.settled) for setup in flights.setups] == [
        ((PLAIN, PLAIN), -200.0, 200.0, True),
        ((QUIET, QUIET), -200.0, 200.0, True),
        ((PLAIN, PLAIN), -400.0, -370.0, False),
    ]
    np.testing.assert_allclose(orbit.t_s, -140.0 + 0.02 * np.arange(17000), atol=1e-9)
    ours = [row.ours for row in rows]
    # Peaks of the settled passes; root mean squares of the 31 seconds, the first ten times as large.
    start = math.sqrt((30.0 + 100.0) / 31.0)
    assert ours[:4] == pytest.approx([0.04, 0.03, 4.0 * start, 3.0 * start])
    # Over accelerations of 2e-5 and 1e-5 on the sky by k_i = 1.8.
    assert ours[4:6] == pytest.approx([80.0 * MDEG * 1.8 / 2e-5, 60.0 * MDEG * 1.8 / 1e-5])
    assert ours[6] == pytest.approx(2000.0)
    assert [(row.paper, row.tolerance, row.bound) for row in rows] == [
        (1.4, 0.0, "<="), (0.2, 0.0, "<="), (1.4, 0.4, "=="), (0.2, 0.1, "=="), (1.0, 0.03, "=="), (1.0, 0.03, "=="),
        (10.0, 0.0, ">="),
    ]  # fmt: skip
    assert rows[4].remark == "80.00 mdeg"
    assert rows[5].remark == "60.00 mdeg"


def test_the_gain_rows_are_read_off_the_responses_of_the_elevation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Low-pass filters of 3 and 0.7 Hz; beyond 4 Hz the first one tracks a twentieth worse than the second."""
    grids: list[Array] = []

    def gain(frequency_hz: Array, with_it: bool) -> ComplexArray:
        without = 1.0 / (1.0 + 1j * frequency_hz / 0.7)
        better = 1.0 / (1.0 + 1j * frequency_hz / 3.0)
        return np.where(frequency_hz > 4.0, 1.0 - 1.05 * np.abs(1.0 - without), better) if with_it else without

    def planted(plant: object, loops: tuple[PositionLoopParams, PositionLoopParams]) -> SimpleNamespace:
        assert plant == IDEAL
        assert loops in ((PLAIN, PLAIN), (QUIET, QUIET))

        def response(frequency_hz: Array, output: object, inputs: slice) -> ComplexArray:
            assert output == "encoder"
            grids.append(frequency_hz)
            shown = np.full((len(frequency_hz), 2, 2), 9.0 + 0j)
            rate = 0.1 / (1.0 + frequency_hz)
            part = gain(frequency_hz, loops[0] == PLAIN) - 2j * np.pi * frequency_hz * rate
            shown[:, 1, 1] = part if inputs == slice(0, 2) else rate
            return shown

        return SimpleNamespace(response=response, encoder="encoder")

    monkeypatch.setattr(servo_feedforward, "closed_loop", planted)
    better, peak = servo_feedforward._gain()
    (grid,) = {id(one): one for one in grids}.values()
    expected = np.concatenate([np.geomspace(1e-3, 15.0, 2000), np.linspace(1.9, 2.4, 1001)])
    assert len(grid) == 3001
    np.testing.assert_allclose(grid, np.sort(expected), rtol=1e-12)
    assert better.ours == np.min(grid[grid > 4.0])
    # Down by 1 dB at 0.5088 of the corner.
    assert better.remark == "flat within 1 dB up to 1.53 Hz, without feedforward up to 0.36 Hz"
    # A low-pass filter is largest at the lower end of 2.12 Hz +- 0.2 Hz.
    low = np.min(grid[grid > 1.92])
    assert peak.ours == pytest.approx(math.sqrt((1.0 + (low / 0.7) ** 2) / (1.0 + (low / 3.0) ** 2)))
    for row in (better, peak):
        assert (row.paper, row.tolerance, row.bound) == (1.0, 0.0, ">=")


# Monopulse.


def test_the_plant_of_a_case_has_its_own_elevation_drive_and_pinion() -> None:
    assert servo_monopulse._plant() == IDEAL
    turned = dss13_plant(ideal=True, pinion_angle_rad=math.radians(60.0))
    found = servo_monopulse._plant(beta=0.33, pinion_deg=60.0)
    assert found.azimuth == turned.azimuth
    gain = 0.33 * turned.elevation.amplifier_gain
    assert found.elevation == turned.elevation.replace(amplifier_gain=gain)


def test_the_limits_are_those_of_plain_loop_notch_and_weaker_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, float]] = []
    monkeypatch.setattr(servo_monopulse, "_limit_hz", lambda **names: asked.append(names) or 0.1 * len(asked))
    rows = servo_monopulse._limits()
    assert asked == [{}, {"notch_hz": 2.12}, {"beta": 0.33}]
    assert [row.ours for row in rows] == pytest.approx([0.1, 0.2, 0.3])
    assert [(row.paper, row.tolerance) for row in rows] == [(0.0635, 0.0085), (0.5, 0.1), (0.45, 0.15)]


def test_a_limit_is_that_of_the_elevation_with_a_notch_where_one_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servo_monopulse, "stability_limit_hz", lambda *asked: asked)
    limit = servo_monopulse._limit_hz.__wrapped__
    assert limit() == (IDEAL, (PLAIN, PLAIN), 1)
    notched = NOTCH.replace(notch_frequency_hz=0.7)
    assert limit(beta=0.5, notch_hz=0.7) == (servo_monopulse._plant(beta=0.5), (notched, notched), 1)
    assert limit(pinion_deg=60.0)[0] == servo_monopulse._plant(pinion_deg=60.0)


def test_peak_errors_are_those_of_the_settled_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    flights = Flights(0.5, settled_s=-80.0)
    monkeypatch.setattr(servo_monopulse, "fly", flights)
    peaks = servo_monopulse._peak_errors.__wrapped__
    assert peaks(0.04) == pytest.approx((2.0, 1.5))
    peaks(0.3, notch=True, beta=0.33, pinion_deg=60.0, period_s=0.02)
    published, other = flights.setups
    assert published == PassSetup(
        plant=IDEAL, loops=(PLAIN, PLAIN), bandwidth_hz=0.04, late_s=(0.00529, 0.0467), radio_period_s=0.1,
        radio_delay_s=0.1, start_s=-150.0, end_s=80.0,
    )  # fmt: skip
    assert (other.radio_period_s, other.radio_delay_s, other.bandwidth_hz) == (0.02, 0.0, 0.3)
    assert other.plant == servo_monopulse._plant(beta=0.33, pinion_deg=60.0)
    assert other.loops == (NOTCH, NOTCH)


@pytest.mark.parametrize(
    ("high", "low", "bounded", "explained"),
    [(0.45, 0.35, 0.9, True), (0.4, 0.39, 0.9, True), (0.39, 0.35, 0.9, False), (0.45, 0.41, 0.9, False),
     (0.45, 0.35, 1.1, False), (0.45, 0.4, 0.9, False)],
)  # fmt: skip
def test_a_notch_tuned_low_is_explained_while_the_sampled_loop_is_stable(
    high: float, low: float, bounded: float, explained: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def limit_hz(notch_hz: float) -> float:
        return {1.1: high, 0.9: low}[round(notch_hz / 2.12, 6)]

    flights = Flights(bounded / 4.0, settled_s=-15.0)
    monkeypatch.setattr(servo_monopulse, "fly", flights)
    monkeypatch.setattr(servo_monopulse, "_limit_hz", limit_hz)
    above, below = servo_monopulse._mistuning()
    assert (above.ours, below.ours, below.explained) == (high, low, explained)
    assert f"({bounded:.2f} mdeg)" in below.remark
    (setup,) = flights.setups
    assert setup == PassSetup(
        loops=(NOTCH, NOTCH.replace(notch_frequency_hz=0.9 * 2.12)), bandwidth_hz=0.4, late_s=(0.00529, 0.0467),
        start_s=-60.0, end_s=0.0,
    )  # fmt: skip
    for row in (above, below):
        assert (row.paper, row.tolerance, row.bound) == (0.4, 0.0, ">=")


def test_notch_and_amplifier_gain_are_held_against_the_plain_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[object, ...]] = []

    def peaks(f_m: float, notch: bool = False, beta: float = 1.0) -> tuple[float, float]:
        return {(0.04, False, 1.0): 4.5, (0.3, True, 1.0): 0.5, (0.2, False, 0.33): 0.75}[f_m, notch, beta], math.nan

    def sensitivity(*args: object) -> float:
        asked.append(args)
        return 1.0 + 0.1 * len(asked)

    monkeypatch.setattr(servo_monopulse, "_peak_errors", peaks)
    monkeypatch.setattr(servo_monopulse, "peak_sensitivity", sensitivity)
    notch, beta = servo_monopulse._gains()
    assert (notch.ours, notch.paper, notch.tolerance) == (pytest.approx(9.0), 9.0, 3.0)
    assert (beta.ours, beta.paper, beta.tolerance) == (pytest.approx(6.0), 7.0, 3.0)
    weak = servo_monopulse._plant(beta=0.33)
    assert asked == [
        (IDEAL, (NOTCH, NOTCH), 1, 0.3), (IDEAL, (NOTCH, NOTCH), 1, 0.4),
        (weak, (PLAIN, PLAIN), 1, 0.2), (weak, (PLAIN, PLAIN), 1, 0.4),
    ]  # fmt: skip
    assert "4.50 mdeg to 0.500 mdeg; Ms 1.10." in notch.remark
    assert "4.50 mdeg to 0.750 mdeg; Ms 1.30." in beta.remark


def test_the_bandwidth_of_a_pinion_follows_its_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    def peaks(f_m: float, pinion_deg: float) -> tuple[float, float]:
        assert f_m == pytest.approx(0.04 * (1.0 + 0.01 * pinion_deg))
        return 1.4 - 0.01 * pinion_deg, 0.12

    monkeypatch.setattr(servo_monopulse, "_limit_hz", lambda pinion_deg=0.0: 0.06 * (1.0 + 0.01 * pinion_deg))
    monkeypatch.setattr(servo_monopulse, "_peak_errors", peaks)
    rows = servo_monopulse._pinion()
    assert [row.ours for row in rows] == pytest.approx([
        1.4, 0.12, math.hypot(1.4, 0.12), 0.8, 0.12, math.hypot(0.8, 0.12), 0.8 / 1.4, 0.5, 0.12, math.hypot(0.5, 0.12),
        0.5 / 1.4,
    ])  # fmt: skip
    assert [row.paper for row in rows] == pytest.approx([
        1.43, 0.14, 1.44, 0.76, 0.08, 0.77, 0.76 / 1.43, 0.35, 0.07, 0.36, 0.35 / 1.43,
    ])  # fmt: skip
    assert [row.tolerance for row in rows] == [0.05, 0.02, 0.05, 0.14, 0.02, 0.14, 0.10, 0.11, 0.05, 0.11, 0.08]
    assert [row.unit for row in rows] == ["mdeg"] * 6 + ["1"] + ["mdeg"] * 3 + ["1"]
    assert [bool(row.remark) for row in rows] == [True] * 3 + [False] * 8


def test_sampling_rows_compare_periods_and_the_deviation_without_monopulse(monkeypatch: pytest.MonkeyPatch) -> None:
    orbit = Orbit()
    monkeypatch.setattr(servo_monopulse, "PassSetup", lambda: SimpleNamespace(orbit=orbit))
    monkeypatch.setattr(
        servo_monopulse, "_peak_errors", lambda f_m, period_s=0.1: (f_m * (50.0 if period_s == 0.1 else 40.0),)
    )
    sampled, opened = servo_monopulse._sampling()
    np.testing.assert_allclose(orbit.t_s, -80.0 + 0.1 * np.arange(1600), atol=1e-9)
    assert (sampled.ours, sampled.paper, sampled.tolerance) == (pytest.approx(1.25), 1.0, 0.05)
    assert opened.ours == pytest.approx(3e-3 * 0.0467 / MDEG / 2.0)
    assert (opened.paper, opened.tolerance, opened.bound) == (2.0, 0.0, ">=")


# Noise.


def test_cut_offs_are_tried_from_1_to_20_hz(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[float] = []
    monkeypatch.setattr(servo_noise, "averaging_gain", lambda cut_off: tried.append(cut_off) or cut_off)
    assert servo_noise._cut_off_hz(15.01) == pytest.approx(15.05)
    assert tried == pytest.approx([1.0 + 0.05 * k for k in range(380)])


@pytest.mark.parametrize(("r_s", "explained"), [(37.3 * 1.0045, True), (37.3 * 1.0058, False), (37.3 * 0.9942, False)])
def test_averaging_is_explained_within_half_a_percent_of_its_integral(
    r_s: float, explained: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float] = []
    monkeypatch.setattr(servo_noise, "averaging_gain", lambda cut_off: r_s if cut_off else 5.0)
    monkeypatch.setattr(servo_noise, "_cut_off_hz", lambda ratio: asked.append(ratio) or 12.1)
    monkeypatch.setattr(servo_noise, "_in_the_loop", float)
    assert servo_noise.noise_rows()[1].explained is explained
    assert set(asked) == {50.0}
    assert servo_noise.noise_rows()[2].ours == 1.0


# Wind.


@pytest.mark.parametrize(("worst", "expected"), [((-2.5, -1.8), 0.25), ((-2.1, -1.0), 0.5)])
def test_wind_rejection_compares_each_axis_with_and_without_feedforward(
    worst: tuple[float, float], expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def planted(plant: object, loops: tuple[PositionLoopParams, ...]) -> SimpleNamespace:
        assert plant == IDEAL
        assert loops in ((PLAIN, PLAIN), (QUIET, QUIET))

        def response(frequency_hz: Array, output: object, inputs: slice) -> ComplexArray:
            assert (output, inputs) == ("beam", slice(4, 6))
            assert (len(frequency_hz), frequency_hz[0], frequency_hz[-1]) == (400, 1e-3, pytest.approx(10.0))
            shown = np.full((len(frequency_hz), 2, 2), -2.0 + 0j)
            if loops[0] == PLAIN:
                shown[:, 0, 1] = shown[:, 1, 0] = 9.0
                shown[7, 0, 0], shown[9, 1, 1] = worst
            return shown

        return SimpleNamespace(response=response, beam="beam")

    monkeypatch.setattr(servo_wind, "closed_loop", planted)
    (row,) = servo_wind._rejection()
    assert row.ours == pytest.approx(expected)
    assert (row.paper, row.tolerance) == (0.0, 1e-9)


def test_the_wind_gain_is_the_rms_of_both_gusts_over_the_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    orbit, plant = Orbit(), dss13_plant()

    def torque(wind: WindParams, along: float, across: float, azimuth: float, elevation: float) -> tuple[float, float]:
        assert wind == WindParams(mean_speed_m_s=8.0)
        assert azimuth == 1.0
        # Cubes show the step of the differences: 1e-6 of them is left.
        gust = along - 8.0
        return 3e5 * (gust + 1e6 * gust**3) + 4e5 * across, 5e5 * gust - 6e5 * (
            across + 2e6 * across**3
        ) + 1e9 * across**2

    monkeypatch.setattr(servo_wind, "LowOrbitPass", lambda: orbit)
    monkeypatch.setattr(servo_wind, "wind_torque_n_m", torque)
    cross, elevation = servo_wind._wind_gain.__wrapped__()
    np.testing.assert_allclose(orbit.t_s, -160.0 + 4.0 * np.arange(85))
    cosines = math.sqrt(np.mean(np.cos(np.linspace(0.5, 1.0, 85)) ** 2))
    assert cross == pytest.approx(cosines * math.hypot(6e5, 0.75 * 4e5) / plant.azimuth.inertia_kg_m2, rel=1e-6)
    assert elevation == pytest.approx(math.hypot(5e5, 0.75 * 18e5) / plant.elevation.inertia_kg_m2, rel=1e-6)


def test_qualities_are_taken_per_axis_at_8_m_s_on_the_ideal_antenna(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servo_wind, "AxisResponse", lambda *asked: asked)
    monkeypatch.setattr(servo_wind, "_response", servo_wind._response.__wrapped__)
    monkeypatch.setattr(servo_wind, "loop_quality", lambda *asked: asked)
    radio, variation = published_radio(0.2), Variation(0.9, 1.3)
    assert servo_wind._qualities(("az", "el"), radio, variation) == [
        ((IDEAL, 0, variation), "az", radio, 8.0), ((IDEAL, 1, variation), "el", radio, 8.0),
    ]  # fmt: skip


@pytest.mark.parametrize("radio", [None, RadioLoop(0.25, mean_of=3, cluster=4, wait_s=0.13)])
def test_a_flown_error_is_radial_of_the_settled_pass_on_the_whole_plant(
    radio: RadioLoop | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    flights = Flights(0.2, settled_s=-160.0)
    monkeypatch.setattr(servo_wind, "fly", flights)
    # One of the 341 errors is zero.
    assert servo_wind._flown_mdeg((PLAIN, NOTCH), radio, 5) == pytest.approx(math.sqrt(340.0 / 341.0))
    loop = {"bandwidth_hz": 0.25, "mean_of": 3, "cluster": 4, "radio_delay_s": 0.13}
    none = {"bandwidth_hz": 0.0, "mean_of": 1, "cluster": 1, "radio_delay_s": 0.0}
    assert flights.setups == [
        PassSetup(
            plant=dss13_plant(), loops=(PLAIN, NOTCH), start_s=-180.0, end_s=180.0, wind=WindParams(mean_speed_m_s=8.0),
            seed=5, **(loop if radio else none),
        )
    ]  # fmt: skip


def test_the_best_controllers_are_flown_with_the_loop_whose_margins_they_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sensitivities 1.5 and 1.7 as designed; the worst of all antennas and waits counts."""
    flown: list[tuple[object, object, int]] = []
    totals: list[tuple[object, RadioLoop, Variation]] = []

    def qualities(laws: object, radio: RadioLoop, variation: Variation) -> list[object]:
        off = variation != Variation()
        quality = LoopQuality(1.0, 1.5 + 0.2 * off, 1.4 + 3.0 * radio.wait_s * off, True)
        return [quality, (laws, radio, variation)]

    def flown_mdeg(laws: object, radio: object, seed: int) -> float:
        flown.append((laws, radio, seed))
        return 0.1 * len(flown)

    def total(found: list[object]) -> float:
        totals.append(found[1])
        _, radio, variation = totals[-1]
        return radio.bandwidth_hz + radio.wait_s + variation.residue - variation.frequency

    monkeypatch.setattr(servo_wind, "_qualities", qualities)
    monkeypatch.setattr(servo_wind, "_peak", lambda found: max(found[0].encoder_peak, found[0].radio_peak))
    monkeypatch.setattr(servo_wind, "_flown_mdeg", flown_mdeg)
    monkeypatch.setattr(servo_wind, "_total_mdeg", total)
    monkeypatch.setattr(servo_wind, "_responses", lambda *laws: laws)
    monkeypatch.setattr(servo_wind, "_rejection", list)
    tuned, designs, beside = dss13_loops("tuned"), load_lqg_designs(), dss13_lqg_loops()
    monkeypatch.setattr(servo_wind, "load_lqg_designs", lambda: designs)
    rows = servo_wind.wind_rows()
    f_m = servo_wind.TUNED_RADIO_BANDWIDTH_HZ
    assert len(rows) == 16
    lqg = ((designs[0], beside[0]), (designs[1], beside[1]))
    loops = [published_radio(f_m), station_radio(f_m)]
    expected = [((PLAIN, PLAIN), None), *((laws, loop) for laws in (tuned, lqg) for loop in loops)]
    assert [laws for laws, _, _ in flown] == [laws for laws, _ in expected]
    assert [radio for _, radio, _ in flown] == [radio for _, radio in expected]
    assert {seed for _, _, seed in flown} == {1}
    for place, row in enumerate(rows):
        limit = (0.5, 2.0, 2.0, 0.5)[place % 4]
        assert (row.paper, row.bound, row.tolerance) == (limit, "<=", 0.0)
    assert [row.ours for row in rows[::4]] == pytest.approx([0.2, 0.3, 0.4, 0.5])
    assert [row.ours for row in rows[1::4]] == pytest.approx([1.5] * 4)
    assert [row.ours for row in rows[2::4]] == pytest.approx([1.7, 2.0, 1.7, 2.0])
    # The largest of all antennas: residues 1.3, modes 10 % low.
    assert [row.ours for row in rows[3::4]] == pytest.approx([f_m + 0.1 + 0.4, f_m + 0.2 + 0.4] * 2)
    assert totals[0] == (designs, station_radio(0.5 * f_m), Variation())
    assert totals[1] == (designs, station_radio(f_m), Variation())
    assert {radio.wait_s for _, radio, _ in totals[2:]} == {0.1, 0.06, 0.13, 0.2}
    assert "0.10 mdeg" in rows[0].remark
    # Explained where a reason is given, and only the station's loop of the LQG has one.
    assert [row.explained for row in rows] == [False] * 15 + [True]
    assert f"linear {f_m + 0.2:.3f} mdeg, at half the f_m {0.5 * f_m + 0.2:.3f}" in rows[15].remark


# Identification.


def test_an_identification_drives_one_axis_with_a_bias_at_both_in_calm_air(monkeypatch: pytest.MonkeyPatch) -> None:
    made: dict[str, tuple[object, ...]] = {}
    rates: list[Array] = []

    class Experiment:
        finished = False

        def __init__(self, *args: object) -> None:
            made["experiment"] = args
            self._left = 3

        def command(self, encoder_rad: Array) -> Array:
            self._left -= 1
            self.finished = self._left == 0
            return encoder_rad

        def recording(self) -> str:
            return "recording"

    class Antenna:
        def __init__(self, *args: object) -> None:
            made["antenna"] = args

        def step(self, k: int) -> None:
            rates.append(made["antenna"][3](k, np.array([0.1 * k, 0.2])))

    monkeypatch.setattr(servo_identification, "IdentificationExperiment", Experiment)
    monkeypatch.setattr(servo_identification, "BareAntenna", Antenna)
    monkeypatch.setattr(servo_identification, "Wind", lambda *args: args)
    monkeypatch.setattr(
        servo_identification, "AntennaPlant", lambda params, *rest: SimpleNamespace(params=params, rest=rest)
    )
    params = ExcitationParams()
    plant = dss13_plant(bending="identified")
    for axis, start, limits in (("azimuth", 0.0, plant.azimuth), ("elevation", math.radians(60.0), plant.elevation)):
        rates.clear()
        assert servo_identification.record(axis, 5, 3, params) == "recording"
        given, driven, sequences, start_rad, travel, random = made["experiment"]
        assert (given, driven, sequences, start_rad) == (params, axis, 5, start)
        assert travel == (limits.travel_min_rad, limits.travel_max_rad)
        assert random.random() == random_stream(3, f"excitation {axis}").random()
        antenna, (wind, gusts), sample_s, _ = made["antenna"]
        assert antenna.params == plant
        assert antenna.rest[1] == (0.0, math.radians(60.0))
        assert wind == WindParams(mean_speed_m_s=0.3, from_azimuth_rad=1.0)
        assert gusts.random() == random_stream(3, f"wind {axis}").random()
        assert sample_s == params.sample_s
        bias = 0.0023 * math.radians(0.08)
        np.testing.assert_allclose(rates, [[0.1 * k + bias, 0.2 + bias] for k in range(3)], rtol=1e-12)


def test_both_axes_are_recorded_with_four_sequences_to_fit_and_four_held_out(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[object, ...]] = []

    def studied(recordings: dict[str, object], held_out: int) -> list[SimpleNamespace]:
        assert (recordings, held_out) == ({"azimuth": 1, "elevation": 2}, 4)
        return [SimpleNamespace(driven="a", shown="b")]

    monkeypatch.setattr(servo_identification, "record", lambda *args: asked.append(args) or len(asked))
    monkeypatch.setattr(servo_identification, "study", studied)
    monkeypatch.setattr(servo_identification, "_frequencies", lambda studies: list(studies))
    monkeypatch.setattr(servo_identification, "_errors", lambda _: [])
    assert servo_identification.identification_rows() == [("a", "b")]
    assert asked == [("azimuth", 8, 1, ExcitationParams()), ("elevation", 8, 1, ExcitationParams())]


def test_every_published_mode_is_held_against_the_nearest_one_found(monkeypatch: pytest.MonkeyPatch) -> None:
    found_hz = np.array([0.9, 1.7, 2.1, 3.3, 4.3, 5.4])
    monkeypatch.setattr(
        servo_identification,
        "modes_of",
        lambda model: SimpleNamespace(frequency_hz=found_hz + (0.0, 0.01)[model == "el"]),
    )
    studies = {
        (driven, shown): SimpleNamespace(identified=SimpleNamespace(model=driven[:2]))
        for driven in ("azimuth", "elevation")
        for shown in ("azimuth", "elevation")
    }
    rows = servo_identification._frequencies(studies)
    assert [row.paper for row in rows] == [
        1.65, 3.24, 4.24, 1.62, 3.26, 4.21, 5.76, 2.01, 3.15, 5.22, 1.98, 3.21, 5.30,
    ]  # fmt: skip
    assert [row.ours for row in rows] == pytest.approx(
        [1.7, 3.3, 4.3, 1.7, 3.3, 4.3, 5.4, 2.11, 3.31, 5.41, 2.11, 3.31, 5.41]
    )
    assert [row.tolerance for row in rows] == pytest.approx([0.02 * row.paper for row in rows])
    assert rows[3].quantity == "mode frequency, azimuth to elevation"


def test_the_worst_held_out_sequence_counts_in_percent() -> None:
    straight = [StraightCheck(error=error, gain_factor=factor) for error, factor in ((0.002, 0.01), (0.001, 0.02))]
    cross = [CrossCheck(error=0.03, bias=2e-6), CrossCheck(error=0.05, bias=1e-6)]
    studies = {}
    for scale, driven in ((1.0, "azimuth"), (2.0, "elevation")):
        for shown in ("azimuth", "elevation"):
            own = [replace(check, error=scale * check.error) for check in (straight if driven == shown else cross)]
            # Checks of the other kind, much larger, do not count.
            other = [replace(check, error=0.9) for check in (cross if driven == shown else straight)]
            measured = SimpleNamespace(valid_band_hz=lambda scale=scale: (0.1 * scale, 8.0))
            studies[driven, shown] = SimpleNamespace(checks=[*own, *other], measured=measured)
    rows = servo_identification._errors(studies)
    assert [row.ours for row in rows] == pytest.approx([0.2, 2.0, 5.0, 0.4, 2.0, 10.0])
    assert [row.paper for row in rows] == [0.31, 1.32, 6.81, 0.23, 2.18, 4.66]
    assert {(row.bound, row.tolerance, row.unit) for row in rows} == {("<=", 0.0, "%")}
    assert [row.source for row in rows] == [f"DSS13-ID Table {number}" for number in (2, 2, 4, 3, 3, 5)]
    assert "from 0.20 to 8.0 Hz" in rows[3].remark
    assert rows[2].remark.startswith("fitted bias 0.0014, 0.0007 V")


# The flown pass.


def test_a_pass_without_radio_deviates_by_its_lateness_and_hears_nothing() -> None:
    setup = PassSetup(plant=IDEAL, start_s=-20.0, end_s=-18.0, late_s=(0.02, 0.05))
    found = servo_pass.fly(setup)
    t_s = -20.0 + 0.02 * np.arange(1, 101)
    np.testing.assert_allclose(found.t_s, t_s, atol=1e-9)
    here, orbit = LowOrbitPass().at(t_s).position_rad, LowOrbitPass()
    truth = np.column_stack([orbit.at(t_s - 0.02).position_rad[:, 0], orbit.at(t_s - 0.05).position_rad[:, 1]])
    sky = np.column_stack([np.cos(truth[:, 1]), np.ones(100)])
    np.testing.assert_allclose(found.deviation_rad, (truth - here) * sky, rtol=1e-9, atol=1e-14)
    # In motion with its target from the beginning, the antenna follows the ephemeris.
    np.testing.assert_allclose(found.beam_rad, found.deviation_rad, atol=2e-5)
    np.testing.assert_allclose(found.encoder_rad, 0.0, atol=2e-5)
    assert found.radio_rad.shape == (0, 2)
    late = found.after(-19.0)
    assert len(late.t_s) == 51
    assert late.t_s[0] == pytest.approx(-19.0)
    for name in ("beam_rad", "encoder_rad", "deviation_rad"):
        np.testing.assert_array_equal(getattr(late, name), getattr(found, name)[-51:])


@pytest.mark.parametrize("settled", [True, False])
def test_a_settled_pass_begins_in_motion_on_its_first_point(settled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[list[float]] = []
    monkeypatch.setattr(
        servo_pass.LawsOnCommand, "settle", lambda _self, _plant, *point: begun.append(np.concatenate(point).tolist())
    )
    servo_pass.fly(PassSetup(start_s=-20.0, end_s=-19.9, settled=settled))
    first = LowOrbitPass().at([-20.0])
    assert begun == [[*first.position_rad[0], *first.velocity_rad_s[0]]] * settled


def test_the_offset_of_the_radio_and_its_rate_are_added_to_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ramp of the offset: without its rate it would be followed late."""
    ramp = np.array([2e-4, -3e-4])
    heard: list[tuple[int, Array, float]] = []

    class Radio:
        def __init__(self, _setup: PassSetup) -> None:
            self.taken: list[Array] = []

        def tick(self, k: int, joint_error: Array, scale: float) -> None:
            heard.append((k, joint_error, scale))

        def at(self, k: int) -> tuple[Array, Array]:
            return 0.02 * k * ramp, ramp

    monkeypatch.setattr(servo_pass, "_Radio", Radio)
    found = servo_pass.fly(PassSetup(plant=IDEAL, loops=(PLAIN, PLAIN), start_s=-20.0, end_s=-10.0))
    sky = np.cos(LowOrbitPass().at(found.t_s).position_rad[:, 1])
    expected = -(found.t_s + 20.0)[:, None] * ramp * np.column_stack([sky, np.ones(len(sky))])
    np.testing.assert_allclose(found.encoder_rad[200:], expected[200:], atol=2e-5)
    # What the radio hears at a tick is the error of the axes at its beginning.
    assert [k for k, _, _ in heard] == list(range(500))
    scales = np.array([scale for _, _, scale in heard])
    np.testing.assert_allclose(scales[1:], sky[:-1], rtol=1e-9)
    errors = np.array([error for _, error, _ in heard])
    np.testing.assert_allclose(errors[1:, 0] * scales[1:], found.beam_rad[:-1, 0], rtol=1e-9)
    np.testing.assert_allclose(errors[1:, 1], found.beam_rad[:-1, 1], rtol=1e-9)


def test_errors_on_the_sky_are_those_of_the_axes_by_the_cosine_of_the_targets_elevation() -> None:
    """A law without gains leaves the antenna where it stands: the errors are the motion itself."""
    still = PositionLoopParams(proportional_gain=0.0, integral_gain=0.0, feedforward_gain=0.0, notch_enabled=False)
    setup = PassSetup(plant=IDEAL, loops=(still, still), start_s=-20.0, end_s=-18.0, late_s=(0.02, 0.05), settled=False)
    found, orbit = servo_pass.fly(setup), LowOrbitPass()
    first = orbit.at([-20.0]).position_rad
    ahead = orbit.at(found.t_s).position_rad
    truth = np.column_stack(
        [orbit.at(found.t_s - late).position_rad[:, axis] for axis, late in enumerate((0.02, 0.05))]
    )
    sky = np.column_stack([np.cos(truth[:, 1]), np.ones(100)])
    np.testing.assert_allclose(found.beam_rad, (truth - first) * sky, atol=1e-9)
    np.testing.assert_allclose(found.encoder_rad, (ahead - first) * sky, atol=1e-9)


class Integrator:
    """Stands in for the integrator: notes what acts, and when."""

    def __init__(self, params: object) -> None:
        self.params = params
        self.updates: list[tuple[float, Array]] = []

    def update(self, t_s: float, error_rad: Array) -> None:
        self.updates.append((t_s, error_rad))

    def at(self, t_s: float) -> tuple[Array, Array]:
        return np.array([t_s, 2.0]), np.array([3.0, 4.0])


@pytest.mark.parametrize("cluster", [0, 1, 3])
def test_radio_errors_are_means_of_the_last_samples_of_a_period_and_act_late(
    cluster: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(servo_pass, "TrackerIntegrator", Integrator)
    radio = servo_pass._Radio(PassSetup(bandwidth_hz=0.3, cluster=cluster, radio_delay_s=0.16, mean_of=3))
    for k in range(30):
        radio.tick(k, np.array([1.0 * k, -2.0 * k]), 0.5)
    integrator = radio._integrator
    assert (integrator.params.bandwidth_hz, integrator.params.sample_s, integrator.params.mean_of) == (0.3, 0.1, 3)
    # Clusters end at ticks 4, 9, 14, ... and act 8 ticks later.
    back = 0.5 * (max(cluster, 1) - 1)
    assert [t_s for t_s, _ in integrator.updates] == pytest.approx([0.02 * k for k in (12, 17, 22, 27)])
    expected = [[k - back, -2.0 * (k - back)] for k in (4, 9, 14, 19)]
    np.testing.assert_allclose([error for _, error in integrator.updates], expected)
    np.testing.assert_allclose(radio.taken, expected)
    offset, rate = radio.at(40)
    assert (offset.tolist(), rate.tolist()) == ([pytest.approx(0.8), 2.0], [3.0, 4.0])


def test_radio_noise_is_of_the_sky_and_larger_on_the_azimuth_axis() -> None:
    radio = servo_pass._Radio(
        PassSetup(bandwidth_hz=0.3, radio_noise_rad=0.2, radio_period_s=0.02, radio_delay_s=0.0, seed=4)
    )
    random = random_stream(4, "radio")
    for k in range(5):
        radio.tick(k, np.array([1.0, 2.0]), 0.5)
        np.testing.assert_allclose(radio.taken[-1], np.array([1.0, 2.0]) + random.standard_normal(2) * [0.4, 0.2])


def test_a_radio_without_bandwidth_is_off() -> None:
    radio = servo_pass._Radio(PassSetup())
    for k in range(10):
        radio.tick(k, np.ones(2), 0.5)
    assert radio.taken == []
    assert [part.tolist() for part in radio.at(9)] == [[0.0, 0.0], [0.0, 0.0]]
