"""Small runs of the parts that studies are made of, number by number as recorded.

Their laws have tests of their own, which many trials blur: a factor that changes a hundredth of a result shows here.
"""

import math
from collections.abc import Callable
from dataclasses import astuple

import numpy as np
import pytest
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, direction_from_angles
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.relative_pose import RelativePose
from rf_pointing.array_sensors.interferometer.sequence import SequenceParams
from rf_pointing.array_sensors.interferometer.system import ArrayParams, CarrierPlan, two_way_ranges
from rf_pointing.controllers import PositionLoopParams, dss13_loops, load_lqg_designs
from rf_pointing.core import MDEG, random_stream
from rf_pointing.papers import (
    conscan,
    interferometer_simulation,
    keyhole_passes,
    monopulse,
    monopulse_dropouts,
    monopulse_loop,
    satcal_campaign,
    satcal_orbit,
    servo_linear,
    servo_monopulse,
    servo_pass,
    servo_sampled,
    servo_wind,
    tripulse_attitude,
    tripulse_noise,
)
from rf_pointing.papers.orbit import measurements, motion
from rf_pointing.rf import DropoutParams, Dropouts
from rf_pointing.servo import WindParams, dss13_plant
from test.papers.recorded import DATA, Array, check_numbers, flat

Within = tuple[float, float]
CLOSED: Within = (1e-9, 1e-10)
"""Relative and absolute, of closed forms."""
CLOSE: Within = (1e-5, 1e-10)
SOLVED: Within = (1e-4, 1e-10)
"""Of searches and solved systems."""
FLOWN: Within = (1e-3, 1e-8)
"""Of flights: friction and encoder steps make the last bits of a loop larger."""
EPOCH, GRAVITY = 827385062.07, motion.Gravity()
ORBIT = satcal_campaign.IRS_P3
MAURITIUS = satcal_campaign.SITES["Mauritius"]


def stream(name: str) -> np.random.Generator:
    return random_stream(11, name)


def summary(*parts: ArrayLike) -> Array:
    """Return mean, root mean square and last value of every part."""
    arrays = [np.ravel(np.asarray(part, dtype=np.float64)) for part in parts]
    return np.array([number for a in arrays for number in (a.mean(), math.sqrt(np.mean(a**2)), a[-1])])


def first_pass() -> measurements.Look:
    times = EPOCH + np.arange(-140.0, 21.0, 4.0)
    return measurements.look(times, motion.propagate(EPOCH, ORBIT.state(), times, GRAVITY).states, MAURITIUS, GRAVITY)


def some_passes(days: float, step_s: float) -> list[measurements.Look]:
    return measurements.visits(
        MAURITIUS, satcal_campaign.IRS_P3_APRIL, satcal_campaign.APRIL_T_S, days, GRAVITY, step_s=step_s,
        lowest_rad=math.radians(10.0),
    )  # fmt: skip


def interferometer_trials(sharpen: bool, listing: bool) -> Array:
    pose = RelativePose(position_m=3e4 * direction_from_angles(0.4, -0.2), attitude=attitude_from_euler(0.1, -0.2, 0.7))
    found = interferometer_simulation.run_trials(
        pose, 8, stream("trials"), ArrayParams(), RadioParams(), CarrierPlan(), LinkParams(),
        interferometer_simulation.LISTING if listing else SequenceParams(), "published" if listing else "corrected",
        sharpen,
    )  # fmt: skip
    return flat(found.range_m, found.forward_rad, found.reverse_rad, found.roll_rad, found.wrong_lanes)


def interferometer_errors() -> Array:
    found = interferometer_simulation._errors("case", 3, 2e4, (20.0, -10.0), 30.0, trials=6)
    meant = interferometer_simulation._errors("case", 3, 2e4, (20.0, -10.0), 30.0, corrected=True, trials=6)
    return flat(found.rms(), meant.rms())


def carrier_steps() -> Array:
    plan, position = CarrierPlan(), 900.0 * direction_from_angles(0.1, 0.2)
    phases = interferometer_simulation.simulate_phases(
        position, np.eye(3), ArrayParams(), RadioParams(), plan, LinkParams(), stream("phases"), 2
    )
    ranges = two_way_ranges(position, np.eye(3), ArrayParams()) + 0.004
    sharp, spread = interferometer_simulation.sharpened_ranges(phases, ranges, plan)
    amplitudes = interferometer_simulation.simulate_amplitudes([[1.0, 0.2], [0.3, 0.9]], 0.01, stream("amplitudes"), 2)
    return flat(sharp, spread[0, :2], amplitudes)


def flown(**changes: object) -> Array:
    setup = servo_pass.PassSetup(
        plant=dss13_plant(), start_s=-20.0, end_s=-8.0, bandwidth_hz=0.2, late_s=(0.02, 0.05), radio_noise_rad=1e-5,
        wind=WindParams(mean_speed_m_s=8.0), **changes,
    )  # type: ignore[arg-type]  # fmt: skip
    found = servo_pass.fly(setup).after(-15.0)
    return flat(
        [len(found.t_s), found.t_s[0], len(found.radio_rad)],
        summary(*(part.T[axis] for part in (found.beam_rad, found.encoder_rad, found.deviation_rad) for axis in (0, 1))),
        found.radio_rad[[0, 20]],
    )  # fmt: skip


def monopulse_flight(flip_s: float = math.inf) -> Array:
    setup = monopulse_loop.MonopulsePass(start_s=-20.0, end_s=-8.0, wind_m_s=8.0, late_s=0.03, settle_s=4.0)
    radio = monopulse_loop.PlainRadio(setup, 0.3, 45.0, flip_s=flip_s)
    log = monopulse_loop.fly(setup, radio)
    axes, radial = log.rms_rad(setup.settle_s)
    return flat(
        len(log.t_s), log.t_s[[0, -1]], axes, radial, log.error_rad[[0, 99]], log.command_velocity_rad_s[[0, -1]],
        np.mean(log.transparent), bool(radio.fault), min(radio.fault_s, 1e9),
    )  # fmt: skip


def dropouts_flight() -> Array:
    setup = monopulse_loop.MonopulsePass(start_s=-40.0, end_s=24.0, late_s=0.05, wind_m_s=8.0)
    short = DropoutParams(count=2, shortest_s=0.5, longest_s=6.0, gap_s=5.0)
    dropouts = Dropouts(short, setup.start_s + 35.0, setup.end_s - 4.0, stream("dropouts"))
    radio = monopulse_dropouts.AutotrackRadio(setup, 0.3, 45.0, dropouts)
    log = monopulse_loop.fly(setup, radio)
    return flat(
        dropouts.start_s, dropouts.stop_s, [t_s for t_s, _ in radio.modes], summary(*log.error_rad.T),
        monopulse_dropouts.reacquisition_times_s(radio.modes, dropouts),
    )  # fmt: skip


def qualities() -> Array:
    numbers: list[float] = []
    for axis, laws in ((0, dss13_loops("tuned")), (1, load_lqg_designs())):
        response = servo_sampled.AxisResponse(dss13_plant(ideal=True), axis, servo_sampled.Variation(1.03, 0.8))
        law = servo_sampled.LawResponse(laws[axis])
        for radio in (None, servo_sampled.published_radio(0.2), servo_sampled.station_radio(0.15)):
            numbers += astuple(servo_sampled.loop_quality(response, law, radio, 8.0))
        numbers.append(response.closed_radius(law.matrices))
    return np.array(numbers, dtype=np.float64)


def closed_loop_responses() -> Array:
    loop = PositionLoopParams()
    system = servo_linear.closed_loop(dss13_plant(ideal=True), (loop, loop.replace(notch_enabled=False)), (0.1, 0.05))
    points = np.array([0.01, 0.3, 1.7])
    outputs = (
        (system.beam, servo_linear.COMMAND),
        (system.encoder, servo_linear.WIND),
        (system.offset, servo_linear.RATE),
    )
    parts = [system.response(points, output, inputs) for output, inputs in outputs]
    return flat(*parts, system.response(points, system.beam, servo_linear.DEVIATION))


def satcal_runs() -> satcal_campaign.Runs:
    points = satcal_campaign.points_of(some_passes(2.5, 60.0), 1e-4)
    planted = satcal_campaign.model_of({"azimuth_offset": 0.2, "elevation_offset": -0.1})
    return satcal_campaign.many_runs(
        points, planted, ("azimuth_offset", "elevation_offset"), 3, stream("satcal"), satcal_campaign.ORBIT_PRIORS
    )


def satcal_points() -> Array:
    points = satcal_campaign.points_of([first_pass(), first_pass()], 1e-4)
    shift = satcal_campaign.orbit_error_m(points, stream("shift"))
    angles = satcal_campaign.orbit_error(points, stream("shift"))
    seen = satcal_campaign.observed(points, satcal_campaign.MAURITIUS, stream("noise"), angles)
    runs = satcal_runs()
    return flat(
        len(points), shift[[0, 40, 41]], np.array(angles)[:, 5], seen.residual_azimuth_rad[:2],
        seen.residual_elevation_rad[:2], runs.truth, runs.values, runs.sigma, runs.spread_over_sigma(),
    )  # fmt: skip


def preliminary() -> Array:
    check = satcal_orbit.preliminary_check(
        satcal_campaign.MAURITIUS, [satcal_campaign.MAURITIUS.replace(azimuth_offset=0.003)], stream("preliminary")
    )
    return flat(check.uncorrected, check.corrected, check.elevation_deg, check.rms(np.array([[3.0, 1.0], [4.0, 1.0]])))


def tripulse_run() -> Array:
    found = tripulse_attitude.run_tripulse(3, 5, step_s=20.0)
    return flat(found.projection_errors, found.attitude_errors_rad, tripulse_attitude._mean_score(found))


def generated_orbits() -> Array:
    found = [keyhole_passes._generated(number, stream(f"keyhole {number}")) for number in (0, 1)]
    return flat(*([e.catalogue_number, e.epoch_t_s, e.inclination_rad, e.ascending_node_rad, e.eccentricity,
                   e.mean_anomaly_rad, e.mean_motion_rad_s * 1e3, keyhole_passes._perigee_m(e)] for e in found))  # fmt: skip


NUMBERS: dict[str, tuple[Within, Callable[[], ArrayLike]]] = {
    "interferometer: trials": (CLOSE, lambda: interferometer_trials(False, False)),
    "interferometer: sharpened trials": (CLOSE, lambda: interferometer_trials(True, False)),
    "interferometer: trials of the listing": (CLOSE, lambda: interferometer_trials(False, True)),
    "interferometer: cases": (CLOSE, interferometer_errors),
    "interferometer: carrier steps": (CLOSE, carrier_steps),
    "servo: flown": (FLOWN, lambda: flown(cluster=3, mean_of=2)),
    "servo: flown from rest": (FLOWN, lambda: flown(settled=False, radio_delay_s=0.2)),
    "servo: sampled": (CLOSE, qualities),
    "servo: radio loop": (
        CLOSE,
        lambda: flat(servo_sampled.RadioLoop(0.2, 3, 4, 0.13).response(np.array([0.01, 1.3, 7.0]))),
    ),
    "servo: closed loop": (CLOSE, closed_loop_responses),
    "servo: stability limit": (SOLVED, lambda: servo_monopulse._limit_hz(0.5, 30.0, 2.0)),
    "servo: wind gain": (CLOSE, servo_wind._wind_gain),
    "monopulse: flight": (FLOWN, monopulse_flight),
    "monopulse: flipped flight": (FLOWN, lambda: monopulse_flight(6.0)),
    "monopulse: dropouts": (FLOWN, dropouts_flight),
    "monopulse: drawn dropouts": (
        CLOSED,
        lambda: monopulse_dropouts.draw_dropouts(monopulse_loop.MonopulsePass(end_s=150.0), 3).stop_s,
    ),
    "monopulse: errors over their covariance": (
        SOLVED,
        lambda: monopulse.monopulse_normalised_errors(45.0, MDEG * np.array([2.0, -1.0]), 5, stream("honest")),
    ),
    "monopulse: false lock": (CLOSE, lambda: monopulse.sidelobe_lock_s(stream("lock"))[1]),
    "conscan: errors over their covariance": (
        SOLVED,
        lambda: conscan.conscan_normalised_errors(30.0, MDEG * np.array([2.0, -1.0]), 5, stream("honest")),
    ),
    "satcal: points": (CLOSE, satcal_points),
    "satcal: preliminary orbit": (FLOWN, preliminary),
    "tripulse: run": (SOLVED, tripulse_run),
    "tripulse: widths at 0 dB": (CLOSE, lambda: tripulse_noise._widths_at_0_db(3)),
    "keyhole: generated orbits": (CLOSE, generated_orbits),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_every_number_is_the_recorded_one(name: str) -> None:
    within, numbers = NUMBERS[name]
    check_numbers(DATA / "numbers.csv", name, numbers(), *within)
