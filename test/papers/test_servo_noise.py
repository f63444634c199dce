"""Averaging of a cluster: its closed form against a direct sum, and what counts as noise in the loop."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.papers import servo_noise
from rf_pointing.papers.servo_noise import averaging_gain, noise_rows
from rf_pointing.papers.servo_pass import PassSetup


@pytest.mark.parametrize("cut_off_hz", [0.0, 3.0, 8.0, 14.0])
def test_averaging_gain_is_one_over_the_mean_of_the_squared_kernel(cut_off_hz: float) -> None:
    x = math.pi * 0.02 * (cut_off_hz + (25.0 - cut_off_hz) * (np.arange(200_000) + 0.5) / 200_000)
    passed = np.mean((np.sin(5.0 * x) / (5.0 * np.sin(x))) ** 2)
    assert averaging_gain(cut_off_hz) == pytest.approx(1.0 / passed, rel=1e-6)


def test_the_lowest_cut_off_of_a_gain_is_on_a_grid_of_a_twentieth_of_a_hertz() -> None:
    found = servo_noise._cut_off_hz(50.0)
    assert averaging_gain(found) >= 50.0 > averaging_gain(found - 0.05)
    assert (found - 1.0) / 0.05 == pytest.approx(round((found - 1.0) / 0.05), abs=1e-6)


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> list[PassSetup]:
    """Return the passes flown: a slow error, and noise that the mean of a cluster makes smaller."""
    flown: list[PassSetup] = []

    def fly(setup: PassSetup) -> SimpleNamespace:
        flown.append(setup)
        slow = np.column_stack([np.full(400, 5.0), 2e-3 * np.cos(np.arange(400.0))])
        sign = (-1.0) ** np.arange(400)[:, None]
        return SimpleNamespace(radio_rad=slow + sign * setup.radio_noise_rad * np.array([[1.0, 1.0]]) / setup.cluster)

    monkeypatch.setattr(servo_noise, "fly", fly)
    return flown


def test_noise_in_the_loop_is_20_db_below_the_elevation_error_and_taken_alone(flights: list[PassSetup]) -> None:
    rows = noise_rows(seed=4)
    # Standard deviations as 5 to 1.
    assert rows[2].ours == pytest.approx(25.0)
    assert (rows[2].paper, rows[2].tolerance) == (4.7, 0.6)
    assert [(setup.radio_noise_rad > 0.0, setup.cluster) for setup in flights] == [
        (False, 1), (False, 5), (True, 1), (True, 5),
    ]  # fmt: skip
    assert flights[-1].radio_noise_rad == pytest.approx(0.1 * 2e-3 / math.sqrt(2.0), rel=0.01)
    for setup in flights:
        assert (setup.bandwidth_hz, setup.late_s, setup.start_s, setup.end_s) == (0.04, (0.05, 0.05), -60.0, 60.0)
        assert setup.seed == 4
        assert [law.notch_enabled for law in setup.loops] == [False, False]  # type: ignore[union-attr]


def test_the_rows_without_a_flight_are_the_closed_forms(flights: list[PassSetup]) -> None:
    white, coloured, _ = noise_rows()
    assert white.ours == pytest.approx(10.0 * math.log10(5.0))
    assert (white.paper, white.tolerance) == (7.0, 0.05)
    assert coloured.ours == pytest.approx(10.0 * math.log10(averaging_gain(8.0)))
    assert (coloured.paper, coloured.tolerance) == (17.0, 1.0)
    assert coloured.explained
    assert not coloured.holds


@pytest.mark.parametrize(
    ("r_s", "cut_off_hz", "explained"), [(37.3, 12.1, True), (38.0, 12.1, False), (37.3, 11.9, False)]
)
def test_seventeen_db_are_explained_while_no_cut_off_near_8_hz_gives_them(
    r_s: float, cut_off_hz: float, explained: bool, monkeypatch: pytest.MonkeyPatch, flights: list[PassSetup]
) -> None:
    monkeypatch.setattr(servo_noise, "averaging_gain", lambda cut_off: r_s if cut_off else 5.0)
    monkeypatch.setattr(servo_noise, "_cut_off_hz", lambda _ratio: cut_off_hz)
    assert noise_rows()[1].explained is explained
