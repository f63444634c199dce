"""What is counted as a reacquisition, and a pass that ends without a carrier."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers.monopulse_dropouts import AutotrackRadio, draw_dropouts, reacquisition_times_s
from rf_pointing.papers.monopulse_loop import CLUSTER, TICK_S, MonopulsePass, fly
from rf_pointing.rf import DropoutParams, Dropouts

TRACKED = (10.0, "monopulse")


@pytest.mark.parametrize(
    ("modes", "stop_s", "expected"),
    [
        ([TRACKED], 30.0, 0.0),
        ([TRACKED, (25.0, "coast"), (31.5, "monopulse")], 30.0, 1.5),
        ([TRACKED, (25.0, "coast"), (31.0, "search"), (34.0, "monopulse"), (40.0, "monopulse")], 30.0, 4.0),
        ([TRACKED, (25.0, "coast"), (30.0, "monopulse")], 30.0, 0.0),
        ([TRACKED, (25.0, "coast"), (31.0, "search")], 30.0, math.inf),
        ([], 30.0, math.inf),
    ],
)
def test_a_dropout_counts_from_its_end_until_monopulse_tracks(
    modes: list[tuple[float, str]], stop_s: float, expected: float
) -> None:
    dropouts = SimpleNamespace(stop_s=np.array([stop_s]))
    assert reacquisition_times_s(modes, dropouts).tolist() == [pytest.approx(expected)]  # type: ignore[arg-type]


def test_dropouts_leave_the_first_forty_seconds_free_and_are_8_s_apart() -> None:
    for seed in range(20):
        dropouts = draw_dropouts(MonopulsePass(start_s=-100.0, end_s=100.0, seed=seed), 5)
        assert dropouts.start_s[0] >= -60.0
        assert dropouts.stop_s[-1] <= 100.0
        assert np.min(dropouts.start_s[1:] - dropouts.stop_s[:-1]) >= 8.0
        assert np.max(dropouts.stop_s - dropouts.start_s) <= 20.0


def test_a_pass_may_end_without_a_carrier() -> None:
    setup = MonopulsePass(start_s=-10.0, end_s=-10.0 + 4 * CLUSTER * TICK_S)
    none = Dropouts(DropoutParams(count=0, gap_s=0.0), setup.start_s, setup.end_s, random_stream(1, "none"))
    radio = AutotrackRadio(setup, 0.3, -30.0, none)
    log = fly(setup, radio)
    assert len(log.t_s) == 4 * CLUSTER
    assert not radio.state.integrating
