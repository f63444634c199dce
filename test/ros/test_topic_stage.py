"""A second stage behind topics: it is commanded while its state comes, and left alone with a warning when it is silent."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Vector3, Vector3Stamped

from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.topic_stage import COMMAND, STATE, join_stage
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

TRAVEL = 0.35e-3
PARAMS = AntennaParams(second_stage=SecondStageParams(travel_rad=TRAVEL, rate_rad_s=0.01))


@pytest.fixture
def bench(make_bench: Callable[..., Any]) -> Any:
    return make_bench(AntennaServo, station="dss13").up()


@pytest.fixture
def antenna(bench: Any) -> SimulatedAntenna:
    made = SimulatedAntenna(AntennaParams())
    join_stage(bench.node, made, PARAMS)
    return made


def state(bench: Any, right: float, up: float, late_s: float = 0.0) -> None:
    message = Vector3Stamped(vector=Vector3(x=right, y=up))
    message.header.stamp = stamp_from_seconds(bench.t_s - late_s)
    bench.give(STATE, message)


def command(antenna: SimulatedAntenna) -> None:
    axes = np.array((1.0, 0.5))
    antenna.stage.tick(0.02, axes + np.array((1e-4, 5e-5)), axes, tracking=True)


def test_commands_are_deflections_on_the_sky_and_its_state_turns_the_reading(
    bench: Any, antenna: SimulatedAntenna
) -> None:
    state(bench, 1e-4, -5e-5)
    for _ in range(5):
        command(antenna)
    sent = bench.sent[COMMAND][-1]
    assert sent.header.frame_id == "beam"
    assert 0.0 < sent.vector.x <= TRAVEL
    # The same residual on both axes' loops, but across the sky it is smaller by the cosine.
    assert sent.vector.x / sent.vector.y == pytest.approx(2.0 * math.cos(0.5), rel=0.4)
    encoders, upper = antenna.axes.encoder_rad, float(antenna.axes.encoder_rad[1])
    expected = encoders + np.array((1e-4 / math.cos(upper), -5e-5))
    np.testing.assert_allclose(antenna.reading(0.0).position_rad, expected, rtol=1e-12)
    assert (antenna.stage.mode, antenna.stage.warning) == ("follows", "")


def test_a_stage_that_never_spoke_or_falls_silent_is_centred_and_named(bench: Any, antenna: SimulatedAntenna) -> None:
    command(antenna)
    assert bench.sent[COMMAND][-1].vector.x == 0.0
    assert antenna.status(0.0).warning == f"second stage: no message on {STATE} yet; the mount points alone"
    state(bench, 1e-4, 0.0)
    command(antenna)
    assert bench.sent[COMMAND][-1].vector.x > 0.0
    bench.wait(0.6)
    for _ in range(10):
        command(antenna)
    assert bench.sent[COMMAND][-1].vector.x == 0.0
    assert (
        antenna.stage.warning == f"second stage: no message on {STATE} for 0.6 s, at most 0.5 s; the mount points alone"
    )
    assert antenna.reading(0.0).position_rad[0] != antenna.axes.encoder_rad[0], "it is where it was"


@pytest.mark.parametrize(
    ("right", "late_s", "reason"),
    [(0.02, 0.0, "deflection=0.02 rad must be <= 0.000525 rad"), (1e-4, -2.0, "2.0 s ahead of this computer's clock"),
     (math.nan, 0.0, "vector.x")],
)  # fmt: skip
def test_a_state_that_cannot_be_is_refused_and_counted(
    bench: Any, antenna: SimulatedAntenna, right: float, late_s: float, reason: str
) -> None:
    state(bench, right, 0.0, late_s)
    assert antenna.stage.device.problem == f"no message on {STATE} yet"
    assert any(reason in text for _, text in bench.log), bench.log
