"""Laws of both axes: exchanged without a jump, refused as a whole, and watched for oscillation.

Gains that the antenna could not live with are refused before they run.
"""

import json
import math
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.controllers import PositionLoop, PositionLoopParams, dss13_loops, load_lqg_designs
from rf_pointing.core import MDEG, Motion, Params, random_stream
from rf_pointing.planning import DriveWatchParams, WindWatchParams
from rf_pointing.servo import AntennaPlant, PlantParams, WindParams, dss13_plant
from rf_pointing.station.antenna.loops import AxisLoops, LoopParams, closed_loop_pole, require_stable
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

TICK_S = 0.02
PLANT = dss13_plant()
RATE_STEP_RAD_S = math.radians(1e-4)
"""Wind and encoder noise move the rate command by more from tick to tick; an exchange may not move it by as much."""


def moving(params: LoopParams) -> tuple[AxisLoops, Motion, np.ndarray]:
    """Return loops that have followed a steady ramp with a steady error for a minute, with its last inputs."""
    loops = AxisLoops(params, PLANT, TICK_S)
    rate, error = np.array([5e-3, -3e-3]), np.array([2e-6, -1e-6])
    loops.reset(np.zeros(2), np.zeros(2))
    for k in range(3000):
        command = Motion(rate * k * TICK_S, rate, np.zeros(2))
        measured = command.position - error * (k < 1000)
        loops.rates(command, measured)
    return loops, command, measured


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (LoopParams(), LoopParams(law="lqg")),
        (LoopParams(law="lqg"), LoopParams()),
        (LoopParams(), LoopParams(elevation=dss13_loops("published")[1].replace(notch_enabled=False))),
        (LoopParams(), LoopParams(azimuth=dss13_loops("tuned")[0].replace(feedforward_gain=0.0))),
        (
            LoopParams(law="lqg"),
            LoopParams(law="lqg", lqg_azimuth=LoopParams().lqg_azimuth.replace(feedforward_gain=0.5)),
        ),
    ],
)
def test_an_exchange_in_motion_makes_no_jump(before: LoopParams, after: LoopParams) -> None:
    loops, command, measured = moving(before)
    given = loops.rates(command, measured)
    loops.retune(after, PLANT)
    np.testing.assert_allclose(loops.rates(command, measured), given, atol=RATE_STEP_RAD_S)
    assert loops.params is after


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"elevation": PositionLoopParams(proportional_gain=40.0)}, r"elevation\.proportional_gain=40\.0.*unstable"),
        ({"elevation": PositionLoopParams(notch_frequency_hz=26.0)}, r"zero_hz=26\.0 must be < 25\.0"),
        ({"law": "lqg", "lqg_file": "/nowhere/designs.json"}, "/nowhere/designs.json: no LQG designs"),
    ],
)
def test_an_impossible_set_is_refused_and_changes_nothing(bad: dict, words: str) -> None:
    """Azimuth comes first and its gains are good; they may not be taken either."""
    pestered, calm = moving(LoopParams())[0], moving(LoopParams())[0]
    candidate = LoopParams(**{"azimuth": dss13_loops("published")[0], **bad})
    with pytest.raises(ValueError, match=words):
        pestered.retune(candidate, PLANT)
    assert pestered.params == LoopParams()
    command, measured = Motion(np.ones(2), np.zeros(2), np.zeros(2)), np.array([1.0 - 1e-5, 1.0 + 2e-5])
    for _ in range(20):
        np.testing.assert_array_equal(pestered.rates(command, measured), calm.rates(command, measured))


def test_designs_come_from_the_file_that_is_named(tmp_path: Path) -> None:
    """The azimuth design in the place of the elevation design: unstable there, and the refusal says so."""
    packaged = json.loads(files("rf_pointing.controllers").joinpath("dss13_lqg.json").read_text())
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(json.dumps(packaged))
    bad.write_text(json.dumps(packaged | {"elevation": packaged["azimuth"]}))
    AxisLoops(LoopParams(law="lqg", lqg_file=str(good)), PLANT, TICK_S)
    with pytest.raises(ValueError, match=r"^elevation LQG of control_weight=.*unstable at 2\.\d+ Hz"):
        AxisLoops(LoopParams(law="lqg", lqg_file=str(bad)), PLANT, TICK_S)


# The whole antenna


def hold(loops: LoopParams = LoopParams(), wind_m_s: float = 0.0, **safety: Params) -> SimulatedAntenna:  # noqa: B008
    wind = WindParams(mean_speed_m_s=wind_m_s)
    antenna = SimulatedAntenna(AntennaParams(loops=loops, wind=wind, safety=SafetyParams(**safety)))
    antenna.enable()
    return antenna


def run(antenna: SimulatedAntenna, seconds: float, start: int = 0) -> int:
    for tick in range(start, start + round(seconds / TICK_S)):
        antenna.step(round(1e9 + tick * TICK_S, 6))
    return start + round(seconds / TICK_S)


@pytest.mark.parametrize("law", ["pi", "lqg"])
def test_both_laws_hold_the_antenna_in_wind_below_a_millidegree(law: str) -> None:
    antenna = hold(LoopParams(law=law), 8.0)
    tick, moved = run(antenna, 10.0), []
    for _ in range(500):
        tick = run(antenna, TICK_S, tick)
        moved.append(antenna.reading(0.0).position_rad - antenna.status(0.0).commanded_rad)
    assert np.sqrt(np.mean(np.sum(np.square(moved), axis=1))) < 1.0 * MDEG


def slow_drive(delay_s: float):
    plant = dss13_plant()
    return plant.replace(elevation=plant.elevation.replace(drive_delay_s=delay_s))


@pytest.mark.parametrize("delay_s", [0.2, 0.3])
def test_an_oscillation_cuts_the_drives_and_latches_with_its_reason(delay_s: float) -> None:
    """A drive that becomes slow: the loop swings regularly at first (0.2 s), or saturates before that shows (0.3 s).

    The watch for runaway drives knows of the delay; it would cut them for their rate before the swings are counted.
    """
    antenna = hold(wind_m_s=8.0, drive=DriveWatchParams(delay_s=0.4, excess_rad_s=1.0))
    tick = run(antenna, 5.0)
    antenna.retune(slow_drive(delay_s), LoopParams())
    swings = []
    for _ in range(round(60.0 / TICK_S)):
        tick = run(antenna, TICK_S, tick)
        swings.append(abs(antenna.reading(0.0).position_rad[1] - math.radians(60.0)))
        if antenna.mode == "fault":
            break
    status = antenna.status(0.0)
    assert status.mode == "fault"
    assert status.fault.startswith("drives cut: elevation: oscillation of ")
    assert status.fault.endswith(" mdeg")
    assert max(swings) < math.radians(0.5), "cut before the structure is shaken"
    assert antenna.axes.loops.watch[1].oscillating
    assert not antenna.axes.loops.watch[0].oscillating
    tick = run(antenna, 5.0, tick)
    np.testing.assert_array_equal(antenna.status(0.0).rate_command_rad_s, 0.0)
    assert np.max(np.abs(antenna.reading(0.0).velocity_rad_s)) < 1e-9, "the brakes hold"

    antenna.deactivate()
    antenna.enable()
    assert antenna.mode == "fault"
    assert antenna.status(0.0).fault == status.fault, "latched over deactivation"
    antenna.retune(slow_drive(0.0), LoopParams())
    assert antenna.reset_fault() == ""
    assert antenna.mode == "holding"
    before = antenna.reading(0.0).position_rad
    run(antenna, 20.0, tick)
    assert antenna.mode == "holding"
    np.testing.assert_allclose(antenna.reading(0.0).position_rad, before, atol=5.0 * MDEG)


@pytest.mark.parametrize("phase", range(5))
def test_an_lqg_loop_is_cut_at_half_a_degree_whatever_the_phase_at_which_its_drive_turns_slow(phase: int) -> None:
    """Saturated, it swings ever more slowly and unlike; its period is not waited for."""
    antenna = hold(LoopParams(law="lqg"), 4.0, drive=DriveWatchParams(delay_s=0.4, excess_rad_s=1.0))
    tick = run(antenna, 5.0 + 0.74 * phase)
    antenna.retune(slow_drive(0.3), antenna.axes.loops.params)
    largest = 0.0
    for _ in range(round(15.0 / TICK_S)):
        tick = run(antenna, TICK_S, tick)
        largest = max(largest, abs(antenna.reading(0.0).position_rad[1] - math.radians(60.0)))
        if antenna.mode == "fault":
            break
    assert antenna.status(0.0).fault.startswith("drives cut: elevation: oscillation of ")
    assert largest < math.radians(0.55), "one tick and the detector's high-pass beyond 0.5"


def test_a_storm_is_not_taken_for_an_oscillation() -> None:
    for law in ("pi", "lqg"):
        antenna = hold(LoopParams(law=law), 20.0, wind=WindWatchParams(gust_limit_m_s=60.0, mean_limit_m_s=60.0))
        run(antenna, 60.0)
        assert antenna.mode == "holding"


EDGE_LOW, EDGE_HIGH = 0.98, 1.02
"""A gain this far from the computed edge decays or grows visibly within the simulated time."""


@pytest.fixture(scope="module")
def plant() -> PlantParams:
    return dss13_plant(ideal=True)


def gains(proportional: float) -> PositionLoopParams:
    return PositionLoopParams(proportional_gain=proportional, integral_gain=0.5)


def swing(plant: PlantParams, loop: PositionLoopParams) -> tuple[float, float]:
    """Return the largest elevation error of two spans of 50 s, 100 s apart, after a step of 0.1 mrad."""
    antenna = AntennaPlant(plant, random_stream(1, "encoder"))
    loops = [PositionLoop(loop, TICK_S) for _ in range(2)]
    start = antenna.encoder_rad
    errors = []
    for _ in range(round(200.0 / TICK_S)):
        measured = antenna.encoder_rad
        rates = [each.output(start[i] + 1e-4 * i, 0.0, measured[i]) for i, each in enumerate(loops)]
        antenna.step(rates, (0.0, 0.0), TICK_S)
        for each, rate in zip(loops, rates, strict=True):
            each.update(TICK_S, rate)
        errors.append(abs(measured[1] - start[1] - 1e-4))
    span = round(50.0 / TICK_S)
    return max(errors[span : 2 * span]), max(errors[3 * span :])


def test_the_computed_edge_is_where_the_simulated_loop_begins_to_grow(plant: PlantParams) -> None:
    def radius(proportional: float) -> float:
        return abs(closed_loop_pole(plant, (PositionLoopParams(), gains(proportional)), TICK_S))

    low, high = 0.5, 50.0
    assert radius(low) < 1.0 < radius(high)
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if radius(middle) < 1.0 else (low, middle)
    wide = plant.replace(
        elevation=plant.elevation.replace(rate_limit_rad_s=10.0, acceleration_limit_rad_s2=100.0),
        azimuth=plant.azimuth.replace(rate_limit_rad_s=10.0, acceleration_limit_rad_s2=100.0),
    )
    early, late = swing(wide, gains(EDGE_LOW * low))
    assert late < early
    early, late = swing(wide, gains(EDGE_HIGH * low))
    assert late > early


@pytest.mark.parametrize("laws", [dss13_loops("published"), dss13_loops("tuned"), load_lqg_designs()])
def test_the_laws_that_come_with_the_package_are_accepted(laws: tuple) -> None:
    require_stable(dss13_plant(), laws, TICK_S)


def test_a_dead_time_counts(plant: PlantParams) -> None:
    late = plant.replace(azimuth=plant.azimuth.replace(drive_delay_s=0.3))
    laws = dss13_loops("tuned")
    assert abs(closed_loop_pole(plant, laws, TICK_S)) < 1.0 < abs(closed_loop_pole(late, laws, TICK_S))
    with pytest.raises(ValueError, match=r"^azimuth"):
        require_stable(late, laws, TICK_S)
