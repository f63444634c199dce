"""Noise of the receiving system: the two-port against its definition, and the rows."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.papers.receive import CHIP, TwoPortNoise, rows
from rf_pointing.rf.noise import REFERENCE_K


@given(
    st.floats(1.0, 80.0), st.floats(1e-4, 2e-2), st.floats(0.0, 0.95), st.floats(-math.pi, math.pi),
    st.floats(5.0, 200.0), st.floats(-100.0, 100.0),
)  # fmt: skip
def test_noise_temperature_is_the_noise_of_both_sources_over_that_of_the_generator(
    resistance: float, conductance: float, size: float, angle: float, real: float, imaginary: float
) -> None:
    product = size * math.sqrt(resistance * conductance) * complex(math.cos(angle), math.sin(angle))
    device, generator = TwoPortNoise(resistance, conductance, product), complex(real, imaginary)
    power = resistance + abs(generator) ** 2 * conductance + 2.0 * (generator * product).real
    assert device.noise_k(generator) == pytest.approx(REFERENCE_K * power / real, rel=1e-9)
    assert device.noise_k(generator) >= device.least_noise_k - 1e-9


def test_every_row_holds_or_is_a_misprint_and_only_what_is_printed_wrong_is_explained() -> None:
    found = rows()
    assert all(row.accepted for row in found)
    explained = [row.quantity for row in found if not row.holds]
    assert explained == [
        "noise of the plate at 290 K, 33.7 GHz", "noise of the plate at 290 K, 34.5 GHz", "T_n as printed",
    ]  # fmt: skip
    due = {row.quantity: row.ours for row in found}
    assert due["noise of the plate at 290 K, 32.0 GHz"] == pytest.approx(1.33, abs=0.005)
    assert due["noise of the plate at 290 K, 33.7 GHz"] == pytest.approx(7.45, abs=0.005)
    assert due["noise of the plate at 290 K, 34.5 GHz"] == pytest.approx(5.75, abs=0.005)


def test_the_printed_form_is_infinite_at_the_best_match() -> None:
    best = CHIP.best_impedance_ohm
    assert CHIP.printed_noise_k(best + 1e-9) > 1e6
    assert CHIP.noise_k(best) == pytest.approx(CHIP.least_noise_k, rel=1e-9)
