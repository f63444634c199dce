"""Sensors held against each other: how soon a fault is seen, and that a sound antenna has none."""

import math

import numpy as np
import pytest

from rf_pointing.planning import AxisWatch, AxisWatchParams

DEG = math.pi / 180.0
TICK_S = 0.02
PARAMS = AxisWatchParams()


class Axis:
    """An azimuth that moves at a steady rate under watch; the elevation stands."""

    def __init__(self, rate_deg_s: float) -> None:
        self.watch = AxisWatch(PARAMS, TICK_S)
        self.rate, self.ticks = rate_deg_s * DEG, 0

    @property
    def angle(self) -> float:
        return 1.0 + self.rate * self.ticks * TICK_S

    def tick(self, shown: float | None = None) -> tuple[float, str]:
        self.ticks += 1
        used, reason = self.watch.step((self.angle if shown is None else shown, 0.5), (self.rate, 0.0))
        return used[0], reason


def moving(rate_deg_s: float) -> Axis:
    axis = Axis(rate_deg_s)
    for _ in range(50):
        assert axis.tick()[1] == ""
    return axis


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("wrong", [math.nan, math.inf, 30.0 * DEG, -0.05 * DEG])
def test_up_to_three_wrong_samples_are_bridged(count: int, wrong: float) -> None:
    axis = moving(0.5)
    for _ in range(count):
        used, reason = axis.tick(axis.angle + wrong)
        assert reason == ""
        assert used == pytest.approx(axis.angle, abs=1e-9)
    for _ in range(20):
        assert axis.tick()[1] == ""


@pytest.mark.parametrize(("wrong", "words"), [(5.0 * DEG, "encoder jumped by"), (math.nan, "gives no number")])
def test_the_fourth_wrong_sample_is_a_fault(wrong: float, words: str) -> None:
    axis = moving(0.5)
    said = [axis.tick(axis.angle + wrong)[1] for _ in range(4)]
    assert said[:3] == ["", "", ""]
    assert words in said[3]


@pytest.mark.parametrize("rate_deg_s", [0.05, 0.3, -2.0])
def test_a_frozen_encoder_is_seen_within_200_ms(rate_deg_s: float) -> None:
    axis = moving(rate_deg_s)
    frozen = axis.angle
    said = [axis.tick(frozen)[1] for _ in range(10)]
    assert any("encoder stands still" in words or "jumped" in words for words in said)


@pytest.mark.parametrize("lie_deg_s", [0.3, -1.0])
def test_a_lying_encoder_is_seen_within_200_ms(lie_deg_s: float) -> None:
    axis = moving(0.2)
    said = [axis.tick(axis.angle + axis.rate * TICK_S + lie_deg_s * DEG * TICK_S * (tick + 1))[1] for tick in range(10)]
    assert any("more than the drive" in words for words in said)


def test_encoder_noise_is_no_fault(random: np.random.Generator) -> None:
    watch = AxisWatch(PARAMS, TICK_S)
    angle = 0.0
    for tick in range(5000):
        rate = 2.0 * DEG * math.sin(0.3 * tick * TICK_S)
        angle += rate * TICK_S
        assert watch.step((angle + 2e-6 * random.standard_normal(), 0.0), (rate, 0.0))[1] == ""


def test_the_cause_is_gone_when_the_sensors_agree_again() -> None:
    axis = moving(0.5)
    for _ in range(6):
        axis.tick(math.nan)
    assert axis.watch.cause == "azimuth encoder gives no number"
    for _ in range(10):
        axis.tick()
    assert axis.watch.cause == ""
    jumped = moving(0.5)
    for _ in range(4):
        jumped.tick(jumped.angle + 5.0 * DEG)
    assert "more than the drive" in jumped.watch.cause
