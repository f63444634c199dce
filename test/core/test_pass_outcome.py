"""Held, tracked, lost and mean loss: closed forms, additivity, and a beam that ends in its sidelobes."""

import math

import numpy as np
import pytest

from rf_pointing.core.pass_outcome import (
    LOSS_OF_SIGNAL,
    SIDELOBE_DB,
    PassOutcome,
    error_of_power_rad,
    gaussian_gain,
    gaussian_loss_db,
    is_held,
    pointing_loss_db,
    received_power,
)

WIDTH_RAD = 0.0011


def test_the_half_power_beam_ends_at_half_the_beamwidth_and_at_half_the_power() -> None:
    edge = 0.5 * WIDTH_RAD
    assert received_power(edge, WIDTH_RAD) == pytest.approx(0.5, rel=1e-12)
    assert is_held([0.999 * edge, edge, 1.001 * edge, math.nan], WIDTH_RAD).tolist() == [True, True, False, False]


def test_a_gain_and_its_decibels_are_those_of_the_exponential_beam(random: np.random.Generator) -> None:
    errors, widths = random.uniform(0.0, 120.0, 200), random.uniform(17.0, 264.0, 200)
    gain = np.exp(-4.0 * math.log(2.0) * np.square(errors / widths))
    np.testing.assert_allclose(gaussian_gain(errors, widths), gain, rtol=1e-12)
    np.testing.assert_allclose(gaussian_loss_db(errors, widths), -10.0 * np.log10(gain), rtol=1e-12, atol=1e-12)


def test_no_error_costs_more_than_the_sidelobes() -> None:
    loss = pointing_loss_db(received_power(np.array([0.0, 3.0, 1e3]) * WIDTH_RAD, WIDTH_RAD))
    assert loss.tolist() == [0.0, SIDELOBE_DB, SIDELOBE_DB]


def test_the_power_gives_the_error_back(random: np.random.Generator) -> None:
    for error in random.uniform(0.0, 1.5, 20) * WIDTH_RAD:
        power = float(received_power(error, WIDTH_RAD))
        assert error_of_power_rad(power, WIDTH_RAD) == pytest.approx(error, rel=1e-9)
    assert error_of_power_rad(2.0, WIDTH_RAD) == 0.0


def test_the_mean_loss_is_that_of_the_mean_power_not_the_mean_of_decibels() -> None:
    """1 s far outside of 100 s costs 0.044 dB; the mean of decibels of a Gaussian would be 12 dB."""
    errors = np.zeros(1000)
    errors[:10] = 10.0 * WIDTH_RAD
    found = PassOutcome.of(errors, WIDTH_RAD, 0.1)
    assert (found.tracked_s, found.lost_s) == (pytest.approx(99.0), pytest.approx(1.0))
    assert found.share == pytest.approx(0.99)
    assert found.mean_loss_db == pytest.approx(-10.0 * math.log10(0.99 + 1e-6), abs=1e-9)


def test_parts_of_a_pass_add_up(random: np.random.Generator) -> None:
    errors, widths = random.exponential(WIDTH_RAD, 300), random.uniform(0.5, 2.0, 300) * WIDTH_RAD
    whole = PassOutcome.of(errors, widths, 0.1)
    parts = PassOutcome.of(errors[:77], widths[:77], 0.1) + PassOutcome.of(errors[77:], widths[77:], 0.1)
    for name in ("tracked_s", "lost_s", "received_s"):
        assert getattr(parts, name) == pytest.approx(getattr(whole, name), rel=1e-12)


def test_an_unknown_error_is_lost_time_without_power() -> None:
    unknown = PassOutcome.of([math.nan, math.nan], WIDTH_RAD, 0.5)
    assert unknown == PassOutcome.unseen(1.0)
    assert (unknown.lost_s, unknown.mean_loss_db) == (1.0, pytest.approx(SIDELOBE_DB))
    nothing = PassOutcome()
    assert (nothing.share, nothing.mean_loss_db, nothing.duration_s) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("tracked_s", "reason", "fault", "why"),
    [
        (80.0, LOSS_OF_SIGNAL, "", ""),
        (79.0, LOSS_OF_SIGNAL, "", "79 % of the pass was held, must be >= 80 %"),
        (100.0, "the goal was cancelled", "", "the goal was cancelled"),
        (100.0, LOSS_OF_SIGNAL, "drives cut", "drives cut"),
    ],
)
def test_a_pass_is_tracked_to_its_end_without_a_fault_and_for_long_enough(
    tracked_s: float, reason: str, fault: str, why: str
) -> None:
    outcome = PassOutcome(tracked_s, 100.0 - tracked_s, tracked_s)
    assert outcome.why_not_tracked(reason, fault, 0.8) == why


def test_no_power_is_a_gain_and_none_costs_more_than_the_sidelobes() -> None:
    """A power that noise lifts above the axis's own costs nothing; it does not earn decibels."""
    assert pointing_loss_db([1.2, 1.0, 0.1, 0.0]).tolist() == [0.0, 0.0, 10.0, SIDELOBE_DB]
