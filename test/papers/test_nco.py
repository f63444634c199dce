"""The spur-reduced oscillator: rows of the paper, and its samples against the exact expectation."""

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers import nco
from rf_pointing.receiver.nco import Oscillator
from rf_pointing.receiver.params import OscillatorParams


def test_every_row_holds_or_is_explained() -> None:
    rows = nco.rows(1)
    assert all(row.accepted for row in rows), [row for row in rows if not row.accepted]
    assert [row.quantity for row in rows if row.explained] == ["noise at any frequency against the bound, 5 bits"]


@pytest.mark.parametrize("dithers", [0, 1, 2, 3])
def test_the_mean_of_the_samples_is_the_expected_waveform(dithers: int) -> None:
    oscillator = Oscillator(OscillatorParams(phase_bits=4, dithers=dithers), random_stream(3, "mean"))
    cycles = random_stream(4, "phases").random(50)
    mean = np.mean([oscillator.samples(cycles).real for _ in range(4000)], axis=0)
    assert mean == pytest.approx(nco.expected_cosine(cycles, 4, dithers), abs=0.03 if dithers else 1e-4)


@pytest.mark.parametrize(("bits", "level_dbc"), [(4, -40.26), (6, -64.40), (7, -76.44), (8, -88.48)])
def test_the_worst_spurs_of_one_dither(bits: int, level_dbc: float) -> None:
    assert nco.spur_dbc(bits, 1) == pytest.approx(level_dbc, abs=0.01)
