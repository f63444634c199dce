"""An experiment of `identify` on a real antenna: every sample is published once, and its goal ends when the axes rest."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from rf_pointing_msgs.action import Identify

from rf_pointing.nodes.antenna_servo import AntennaServo

SAMPLES = 120


def goal(axis: str = "azimuth", **changes: Any) -> Identify.Goal:
    values = {
        "kind": "white", "sequences": 1, "samples": SAMPLES, "mean": 0.0, "rms": math.radians(0.02),
        "peak": math.radians(0.1), "idle": 0.0, "seed": 3,
    }  # fmt: skip
    return Identify.Goal(axis=axis, **{**values, **changes})


@pytest.fixture
def bench(make_bench: Callable[..., Any]) -> Any:
    made = make_bench(AntennaServo).up()
    made.run(0.1)
    return made


@pytest.mark.parametrize("axis", ["azimuth", "elevation"])
def test_each_sample_is_published_once_and_each_fiftieth_is_feedback(bench: Any, axis: str) -> None:
    taken = bench.goal("identify", goal(axis))
    assert bench.goal("identify", goal()) is None, "one at a time"
    bench.run(0.02 * SAMPLES - 0.02)
    assert (taken.end, len(bench.sent["manual_rate"])) == ("", SAMPLES - 1)
    bench.run(5.0)
    assert (taken.end, taken.result.message, taken.result.samples_taken) == ("succeeded", "", SAMPLES)
    sent = bench.sent["manual_rate"]
    assert ([each.sample for each in sent], {each.axis for each in sent}) == (list(range(SAMPLES)), {axis})
    number = ["azimuth", "elevation"].index(axis)
    assert [each.progress for each in taken.feedback] == pytest.approx([50 / SAMPLES, 100 / SAMPLES])
    assert [each.position for each in taken.feedback] == [sent[count].position[number] for count in (49, 99)]
    moved = [max(abs(each.rate[axis_number]) for each in sent) for axis_number in (number, 1 - number)]
    assert moved[0] > 0.0 == moved[1], "the other axis holds"
    assert bench.sent["antenna_status"][-1].mode == "holding", "the axes rest when the goal ends"
    assert bench.goal("identify", goal()) is not None


@pytest.mark.parametrize(("how", "message"), [("cancel", "the goal was cancelled"), ("deactivate", "")])
def test_an_interrupted_experiment_ends_once_with_the_samples_until_then(bench: Any, how: str, message: str) -> None:
    taken = bench.goal("identify", goal())
    bench.run(0.6)
    if how == "cancel":
        assert taken.cancel()
        bench.run(5.0)
    else:
        assert bench.step("deactivate")
    assert (taken.end, taken.result.success) == ({"cancel": "canceled", "deactivate": "aborted"}[how], False)
    assert taken.result.samples_taken == len(bench.sent["manual_rate"]) < 40
    assert message in taken.result.message


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (goal("roll"), "axis='roll' must be one of"),
        (goal(sequences=0), "sequences=0 must be >= 1"),
        (goal("elevation", samples=100_000, mean=math.radians(0.07)), "elevation would run from"),
    ],
)
def test_a_refused_experiment_ends_at_once_with_the_reason(bench: Any, request_: Any, words: str) -> None:
    taken = bench.goal("identify", request_)
    assert (taken.end, words in taken.result.message, taken.result.samples_taken) == ("aborted", True, 0)
    assert any(line.startswith("goal refused: ") and words in line for _, line in bench.log)
    assert bench.goal("identify", goal()).end == ""


def test_seed_and_axis_give_the_input(make_bench: Callable[..., Any]) -> None:
    def inputs(wanted: Identify.Goal) -> list[list[float]]:
        bench = make_bench(AntennaServo).up()
        bench.run(0.1)
        bench.goal("identify", wanted)
        bench.run(0.4)
        return [list(each.rate) for each in bench.sent["manual_rate"]]

    first = inputs(goal())
    assert inputs(goal()) == first
    assert inputs(goal(seed=4)) != first
    assert [rates[::-1] for rates in inputs(goal("elevation"))] != first
