"""A second stage on its antenna: what it gains in wind, its margins, and what it leaves to the mount."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.controllers import dss13_loops
from rf_pointing.controllers.second_stage import SecondStage
from rf_pointing.core import JointTrajectory
from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.papers.servo_pass import PassSetup, fly
from rf_pointing.servo import WindParams, dss13_plant
from rf_pointing.servo.second_stage import StagePlant
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna, SimulationParams
from rf_pointing.station.antenna.stage_design import StageDesign, design_stage
from rf_pointing.station.antenna.tuning import gust_acceleration, judged, plant_axis

MRAD, TICK_S, WIND = 1e-3, 0.02, WindParams(mean_speed_m_s=12.0)
STAGE = SecondStageParams(travel_rad=0.35 * MRAD, rate_rad_s=10.0 * MRAD, bandwidth_hz=5.0)


def design(latency_s: float) -> StageDesign:
    return design_stage(STAGE.replace(latency_s=latency_s), dss13_plant(), dss13_loops("tuned"), WIND, TICK_S)


def test_the_error_of_the_mount_alone_is_that_of_the_tuner() -> None:
    gusts = gust_acceleration(dss13_plant(), WIND, 12.0)
    for number, axis in enumerate(design(0.1).axes):
        alone = judged(plant_axis(dss13_plant(), number, TICK_S), dss13_loops("tuned")[number], 12.0)
        assert axis.before_rad == pytest.approx(gusts[number] * alone.rms_s2_per_m_s, rel=0.02)


@pytest.mark.parametrize(("latency_s", "least"), [(0.02, 6.0), (0.05, 5.0), (0.1, 3.0)])
def test_a_subreflector_of_5_hz_makes_the_wind_error_of_a_34_m_dish_3_times_smaller(
    latency_s: float, least: float
) -> None:
    found = design(latency_s)
    found.require_useful()
    linear = found.before_rad / found.after_rad
    case = PassSetup(plant=dss13_plant(), loops=dss13_loops("tuned"), wind=WIND, start_s=-60.0, end_s=60.0)
    errors = [fly(each).after(-30.0).beam_rad for each in (case, replace(case, stage=found))]
    before, after = (math.sqrt(float(np.mean(each**2))) for each in errors)
    assert min(linear, before / after) >= least
    # Gusts of a minute, and the whole sky: the share is that of the exact responses all the same.
    assert before / after == pytest.approx(linear, rel=0.25)


@pytest.mark.parametrize(
    ("params", "reason"),
    [
        (STAGE.replace(latency_s=0.3), r"second_stage.latency_s=0.3, bandwidth_hz=5: azimuth: .* must be >= 1.25"),
        (STAGE.replace(travel_rad=1e-5), r"azimuth: travel_deg=0.000573 must be >= 0.0008"),
        (
            STAGE.replace(radio_bandwidth_hz=0.5),
            r"the tracking loop of 0.5 Hz has a sensitivity peak of .*, must be <= 2",
        ),
    ],
)
def test_a_stage_that_would_not_serve_is_refused_by_name_value_and_bound(
    params: SecondStageParams, reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        design_stage(params, dss13_plant(), dss13_loops("tuned"), WIND, TICK_S).require_useful()


@pytest.mark.parametrize("hz", [0.1, 0.7, 2.0])
def test_law_and_stage_in_time_have_the_response_of_the_design(hz: float) -> None:
    found = design(0.05)
    wide = found.params.replace(travel_rad=0.1, rate_rad_s=10.0)
    law, stage = SecondStage(wide, found.taps), StagePlant(wide)
    s, z = 2j * math.pi * hz, np.exp(2j * math.pi * hz * TICK_S)
    # Seen at the ticks, with the images that the hold makes about multiples of the sampling rate.
    images = s + 2j * math.pi / TICK_S * np.arange(-500, 501)
    lag = np.exp(-images * 0.05) / (1.0 + images / (2.0 * math.pi * 5.0))
    stage_alone = np.sum(lag * (1.0 - 1.0 / z) / (images * TICK_S))
    expected = stage_alone * (found.taps.T @ z ** -np.arange(len(found.taps)))
    ticks = round(20.0 / hz / TICK_S)
    seen, wave = [], 1e-5 * np.exp(s * TICK_S * np.arange(ticks))
    for value in wave.real:
        seen.append(stage.deflection_rad)
        stage.command(law.step((value, value), TICK_S, follow=True))
        stage.step(TICK_S)
    late = slice(ticks // 2, None)
    basis = np.column_stack([wave.real[late], wave.imag[late]])
    fitted = np.linalg.lstsq(basis, np.array(seen)[late], rcond=None)[0]
    np.testing.assert_allclose(fitted[0] - 1j * fitted[1], expected, rtol=1e-4)


def antenna(**stage: float) -> SimulatedAntenna:
    params = AntennaParams(
        antenna=SimulationParams(start_azimuth_rad=0.5, start_elevation_rad=0.7),
        second_stage=STAGE.replace(**stage),
    )  # fmt: skip
    made = SimulatedAntenna(params)
    made.enable()
    return made


def step_to(made: SimulatedAntenna, goal: tuple[float, float], seconds: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return deflection and reading of every tick of a motion to a goal that is held."""
    seen, begun_s = [], made.t_s
    for k in range(1, round(seconds / TICK_S)):
        t_s = round(begun_s + k * TICK_S, 6)
        if k % 5 == 1:
            points = t_s + 0.1 * np.arange(1.0, 10.0)
            made.accept(JointTrajectory(t_s=points, position_rad=np.tile(goal, (9, 1)), velocity_rad_s=np.zeros((9, 2)),
                                        acceleration_rad_s2=np.zeros((9, 2))), t_s)  # fmt: skip
        reading, _ = made.step(t_s)
        seen.append((made.hardware.stage.deflection_rad, reading.position_rad))
    return seen


def test_the_mount_takes_the_deflection_over_and_the_reading_is_the_beams() -> None:
    made = antenna()
    seen = step_to(made, (0.5 + 2.0 * MRAD, 0.7 - 1.0 * MRAD), 40.0)
    deflections = np.array([each for each, _ in seen])
    assert made.mode == AntennaMode.TRACKING
    assert np.abs(deflections).max() > 0.01 * MRAD, "it follows what the mount leaves"
    assert np.abs(deflections).max() <= STAGE.travel_rad
    assert np.abs(deflections[-100:]).max() < 2e-3 * MRAD, "offloaded: noise and friction are left"
    shift = seen[-1][1] - made.axes.encoder_rad
    assert abs(shift[0]) < 3e-3 * MRAD
    assert seen[-1][1] == pytest.approx((0.5 + 2.0 * MRAD, 0.7 - 1.0 * MRAD), abs=5e-3 * MRAD)


def test_outside_of_tracking_it_is_centred() -> None:
    made = antenna()
    step_to(made, (0.5 + 5.0 * MRAD, 0.7), 1.0)
    assert np.abs(made.hardware.stage.deflection_rad).max() > 0.0
    assert made.park() == ""
    for _ in range(300):
        made.step(round(made.t_s + TICK_S, 6))
    assert np.abs(made.hardware.stage.deflection_rad).max() < 1e-9
    assert made.stage is not None
    assert made.stage.mode == "centred"


def test_a_mount_pushed_beyond_the_travel_is_left_alone_with_a_warning_until_it_is_back() -> None:
    made = antenna(travel_rad=4e-5, hand_back_s=0.1)
    step_to(made, (0.5, 0.7), 2.0)
    made.injected.inject("encoder_jump", 2e-4)
    step_to(made, (0.5, 0.7), 0.2)
    warning = "second stage: the mount is farther off than its travel of 0.002292 deg; it is centred"
    assert made.status(made.t_s).warning == warning
    step_to(made, (0.5, 0.7), 10.0)
    assert made.status(made.t_s).warning == ""
    assert made.stage is not None
    assert made.stage.mode == "follows"


def test_without_one_nothing_is_made() -> None:
    made = SimulatedAntenna(AntennaParams())
    assert (made.stage, made.hardware.stage) == (None, None)
