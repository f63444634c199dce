"""Every kind of motion is asked for at the gate by whoever makes it: controller or servo, none goes round it."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import JointReading, JointTrajectory, PointingError
from rf_pointing.ephemeris import Pass
from rf_pointing.identification import ExcitationParams, IdentificationExperiment
from rf_pointing.planning import Gate, HorizonMask
from rf_pointing.planning.gate import MOTIONS
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna, SimulationParams
from rf_pointing.station.pointing.controller import PointingController

DEG = math.pi / 180.0
START_S = 1_151_384_000.0
TICK_S = SimulationParams().tick_s


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """The kinds that were asked for."""
    kinds: set[str] = set()
    check = Gate.check

    def noted(self: Gate, kind: str, *arguments: Any, **named: Any) -> Any:
        kinds.add(kind)
        return check(self, kind, *arguments, **named)

    monkeypatch.setattr(Gate, "check", noted)
    return kinds


def standing(antenna_deg: tuple[float, float]) -> JointReading:
    return JointReading(t_s=0.0, position_rad=np.array(antenna_deg) * DEG, velocity_rad_s=np.zeros(2))


def controller_motions(rig: Callable[..., Any], window: Pass) -> None:
    def strong(t_s: float, _: Any) -> list[PointingError]:
        return [PointingError(t_s=t_s - 0.06, sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=0.0,
                              carrier_to_noise_db_hz=60.0)]  # fmt: skip

    def without_carrier(t_s: float, _: Any) -> list[PointingError]:
        return [replace(strong(t_s, _)[0], carrier_to_noise_db_hz=0.0)]

    made = rig("monopulse")
    list(made.run(window.aos_t_s, 8.0, without_carrier))
    list(made.run(window.aos_t_s + 8.0, 6.0, strong))
    assert made.controller.calibrate() == ""
    list(made.run(window.aos_t_s + 14.0, 1.0, strong))
    approach = made.controller.plan.approach
    assert approach(START_S, standing((-170.0, 40.0)), np.array([170.0, 20.0]) * DEG) is None
    made.controller.plan.clear()
    made.controller.plan.gate = Gate(
        made.controller.plan.gate.params, made.controller.params.limits.replace(elevation_max_rad=176.0 * DEG),
        HorizonMask(), made.controller.plan.machine.axes,
    )  # fmt: skip
    assert approach(START_S, standing((10.0, 40.0)), np.array([30.0, 150.0]) * DEG) is None


def servo_motions(random: np.random.Generator) -> None:
    antenna = SimulatedAntenna()
    antenna.enable()
    t_s = START_S
    goal = JointTrajectory(t_s=[t_s + 0.1], position_rad=np.array([[130.0, 50.0]]) * DEG, velocity_rad_s=np.zeros((1, 2)),
                           acceleration_rad_s2=np.zeros((1, 2)))  # fmt: skip
    assert antenna.accept(goal, t_s, "operator") == ""
    antenna.stop()
    for _ in range(50):
        t_s = round(t_s + TICK_S, 6)
        antenna.step(t_s)
    excitation = ExcitationParams(sample_s=TICK_S)
    here = float(antenna.reading(t_s).position_rad[1])
    assert antenna.identify(IdentificationExperiment(excitation, "elevation", 1, here, (0.04, 1.6), random)) == ""
    antenna.stop()
    for _ in range(50):
        t_s = round(t_s + TICK_S, 6)
        antenna.step(t_s)
    assert antenna.park() == ""
    assert antenna.stow() == ""


def test_every_kind_of_motion_passes_the_gate_where_it_is_made(
    asked: set[str], rig: Callable[..., Any], window: Pass, random: np.random.Generator
) -> None:
    controller_motions(rig, window)
    by_controller, _ = set(asked), asked.clear()
    assert {"slew", "unwind", "flip", "track", "scan", "calibration"} <= by_controller
    servo_motions(random)
    assert {"track", "preset", "manual", "park", "stow"} <= asked
    assert by_controller | asked == set(MOTIONS)


def test_the_controller_goes_to_the_start_of_a_pass_over_a_hill_that_is_in_the_way(
    make_controller: Callable[..., PointingController], window: Pass
) -> None:
    """A hill of 30 deg between the antenna and the start; the pass itself is clear of it."""
    start = np.array([window.aos_azimuth_rad, window.aos_elevation_rad]) / DEG
    ridge = start[0] + 20.0
    hill = HorizonMask(
        azimuth_rad=tuple(sorted((azimuth * DEG) % (2.0 * math.pi) for azimuth in (ridge - 5.0, ridge, ridge + 5.0))),
        elevation_rad=(0.0, 30.0 * DEG, 0.0),
    )
    controller = make_controller(mask=hill)
    here = np.array([start[0] + 40.0, 10.0])
    controller.take_joints(standing((here[0], here[1])))
    t_s = window.aos_t_s - 120.0
    controller.start(t_s, window, "program")
    corners: list[tuple[float, float]] = []
    for step in range(1, 12):
        trajectory, _ = controller.step(round(t_s + 0.1 * step, 6))
        assert trajectory is not None
        position = trajectory.position_rad[-1]
        corners.append((round(float(position[0]), 9), round(float(position[1]), 9)))
        controller.take_joints(JointReading(t_s=0.0, position_rad=position, velocity_rad_s=np.zeros(2)))
    distinct = list(dict.fromkeys(corners))
    assert len(distinct) == 3
    assert distinct[0][1] == distinct[1][1] > 30.0 * DEG
    assert distinct[-1] == pytest.approx(tuple(start * DEG))


def test_a_pass_whose_start_cannot_be_reached_is_refused_with_the_reason(
    make_controller: Callable[..., PointingController], window: Pass
) -> None:
    walls = HorizonMask(
        azimuth_rad=tuple(angle * DEG for angle in range(0, 360, 10)),
        elevation_rad=tuple((85.0 if step % 2 else -5.0) * DEG for step in range(36)),
    )
    controller = make_controller(mask=walls)
    controller.take_joints(standing((window.aos_azimuth_rad / DEG - 60.0, 40.0)))
    with pytest.raises(ValueError, match="no way to the start: .* below the horizon mask"):
        controller.start(window.aos_t_s - 60.0, window, "program")
    assert not controller.busy
