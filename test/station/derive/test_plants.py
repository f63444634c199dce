"""Plants and loops of mounts: scaled by diameter, held in the wind, stable with a margin."""

import math

import numpy as np
import pytest

from rf_pointing.controllers import PositionLoop, PositionLoopParams, dss13_loops
from rf_pointing.servo import dss13_plant
from rf_pointing.station.antenna.loops import closed_loop_pole
from rf_pointing.station.derive.plants import MountAxis, plant_of, position_loops, wind_torque_n_m

DEG = math.pi / 180.0
FAST = MountAxis(
    rate_rad_s=6.0 * DEG, acceleration_rad_s2=5.0 * DEG, stop_rad=(-5.0, 4.0), encoder_bits=18, backlash_rad=None
)
SLOW = MountAxis(
    rate_rad_s=0.8 * DEG, acceleration_rad_s2=0.5 * DEG, stop_rad=(-0.1, 1.7), encoder_bits=12, backlash_rad=1e-4
)


def test_the_torque_of_the_wind_is_that_of_its_pressure_on_the_dish() -> None:
    """20 m/s: 245 Pa on 10.75 m^2, with a moment of a tenth of the diameter of 3.7 m."""
    assert wind_torque_n_m(3.7, 20.0) == pytest.approx(245.0 * 10.752 * 0.37, rel=1e-4)


@pytest.mark.parametrize("diameter_m", [20.0, 68.0])
def test_a_flexible_mount_is_the_34_m_antenna_scaled(diameter_m: float) -> None:
    """Modes with 1 / D, inertia with D^4, and a drive that is no faster than that of the large one."""
    scale = 34.0 / diameter_m
    plant, reference = plant_of("flexible", diameter_m, (SLOW, SLOW), 5.0), dss13_plant()
    for axis, own in ((plant.azimuth, reference.azimuth), (plant.elevation, reference.elevation)):
        assert axis.inertia_kg_m2 == pytest.approx(own.inertia_kg_m2 / scale**4)
        stiffness = own.gear_stiffness_n_m * scale**2 / scale**4
        assert axis.gear_stiffness_n_m == pytest.approx(stiffness)
        assert axis.mode_frequency_hz == pytest.approx([min(60.0, scale * hz) for hz in own.mode_frequency_hz])
        assert axis.drive_bandwidth_rad_s == pytest.approx(own.drive_bandwidth_rad_s * min(scale, 1.0))
        assert axis.countertorque_n_m == pytest.approx(0.01 * axis.inertia_kg_m2)
        assert axis.brake_torque_n_m == pytest.approx(
            max(2.0 * DEG * axis.inertia_kg_m2, 1.1 * wind_torque_n_m(diameter_m, 5.0))
        )
    assert plant.cross_mode_frequency_hz == pytest.approx(scale * reference.cross_mode_frequency_hz)
    # Without a play of its own it has that of the large one.
    assert plant_of("flexible", diameter_m, (FAST, SLOW), 5.0).azimuth.backlash_rad == reference.azimuth.backlash_rad


@pytest.mark.parametrize("diameter_m", [12.0, 20.0, 68.0])
def test_loops_of_a_flexible_mount_are_the_tuned_ones_at_its_modes_and_stable_at_twice_their_gain(
    diameter_m: float,
) -> None:
    scale = 34.0 / diameter_m
    plant = plant_of("flexible", diameter_m, (SLOW, SLOW), 5.0)
    loops = position_loops("flexible", diameter_m, plant)
    for index, (loop, tuned, axis) in enumerate(
        zip(loops, dss13_loops("tuned"), (plant.azimuth, plant.elevation), strict=True)
    ):
        assert loop.notch_frequency_hz == pytest.approx(min(scale * tuned.notch_frequency_hz, 20.0))
        assert loop.shaping_zero_hz == pytest.approx(min(scale * tuned.shaping_zero_hz, 20.0))
        assert loop.shaping_pole_hz == pytest.approx(min(scale * tuned.shaping_pole_hz, 20.0))
        lag_s = 1.0 / axis.drive_bandwidth_rad_s + axis.drive_delay_s + 0.01
        assert loop.drive_lag_s == pytest.approx(lag_s)
        notch_s = tuned.notch_damping / (math.pi * loop.notch_frequency_hz)
        assert loop.feedforward_lead_s == pytest.approx(lag_s + 0.05 / math.pi + notch_s)
        # Reduced in steps of 0.9 and 0.81, as far as it must be.
        slower = min(scale, 1.0)
        steps = math.log(loop.proportional_gain / (slower * tuned.proportional_gain)) / math.log(0.9)
        assert steps == pytest.approx(round(steps), abs=1e-6)
        assert round(steps) >= 0
        assert loop.integral_gain == pytest.approx(slower**2 * tuned.integral_gain * 0.81 ** round(steps))

        def pole(gain: float, loop=loop, index=index) -> float:
            risen = loop.replace(
                proportional_gain=gain * loop.proportional_gain, integral_gain=gain * loop.integral_gain
            )
            return abs(closed_loop_pole(plant, (risen, risen), 0.02, (index,)))

        assert pole(2.0) <= 1.0 + 1e-6
        if round(steps) > 0:
            assert pole(2.0 / 0.9) > 1.0


def test_the_34_m_antenna_keeps_its_tuned_loops() -> None:
    plant = plant_of("flexible", 34.0, (SLOW, SLOW), 5.0)
    for loop, tuned in zip(position_loops("flexible", 34.0, plant), dss13_loops("tuned"), strict=True):
        assert loop == tuned.replace(rate_limit_rad_s=SLOW.rate_rad_s)


RANDOM_PLANTS = 50


def swing(loop: PositionLoopParams, own: MountAxis, lag_s: float, dead_s: float, start_rad: float) -> np.ndarray:
    """Return the errors of 30 s of a loop on a planted drive with its limits, released off its goal."""
    law, tick_s = PositionLoop(loop), 0.02
    law.reset(start_rad, 0.0, start_rad, 0.0)
    queue = [0.0] * max(1, round(dead_s / tick_s))
    position, rate, errors = start_rad, 0.0, []
    for _ in range(1500):
        command = law.output(0.0, 0.0, position, 0.0)
        law.update(tick_s, command)
        queue.append(command)
        wanted = (queue.pop(0) - rate) / lag_s
        rate += tick_s * float(np.clip(wanted, -own.acceleration_rad_s2, own.acceleration_rad_s2))
        rate = float(np.clip(rate, -own.rate_rad_s, own.rate_rad_s))
        position += tick_s * rate
        errors.append(position)
    return np.array(errors)


def test_the_first_loops_of_fifty_rate_drives_settle_without_saturating_to_and_fro(
    random: np.random.Generator,
) -> None:
    """Drives that were never identified: half as slow again as stated, released a slew's lag off."""
    for _ in range(RANDOM_PLANTS):
        rate_deg_s, latency_s = float(np.exp(random.uniform(-1.2, 2.3))), float(random.uniform(0.0, 0.5))
        own = MountAxis(
            rate_rad_s=rate_deg_s * DEG, acceleration_rad_s2=rate_deg_s * DEG * float(random.uniform(0.3, 3.0)),
            stop_rad=(-5.0, 4.0), encoder_bits=18, backlash_rad=None,
        )  # fmt: skip
        diameter_m = float(np.exp(random.uniform(0.5, 3.7)))
        structure = "stiff" if diameter_m < 10.0 else "flexible"
        plant = plant_of(structure, diameter_m, (own, own), 15.0)
        late = plant.azimuth.replace(drive_delay_s=latency_s)
        plant = plant.replace(azimuth=late, elevation=late)
        loop, _ = position_loops(structure, diameter_m, plant, first=True)
        # Closed form: over a dead time L, k_p e^(-s L) / s swings at k_p L = pi / 2.
        lag_s = 1.0 / late.drive_bandwidth_rad_s + latency_s + 0.01
        share = loop.proportional_gain * lag_s
        assert 0.0 < share <= 0.2 + 1e-9
        assert 0.5 * math.pi / share >= 7.8
        assert loop.proportional_gain**2 * lag_s * own.rate_rad_s <= 0.6 * own.acceleration_rad_s2 * (1.0 + 1e-9)
        assert loop.integral_gain == pytest.approx(0.25 * loop.proportional_gain**2)
        errors = swing(loop, own, 1.5 / late.drive_bandwidth_rad_s, 1.5 * latency_s, own.rate_rad_s * lag_s)
        half = len(errors) // 2
        assert np.max(np.abs(errors)) < 1.3 * abs(errors[0])
        assert np.max(np.abs(errors[half:])) < max(0.35 * abs(errors[0]), 1e-5)
        crossings = int(np.sum(np.diff(np.sign(errors[np.abs(errors) > 1e-4 * abs(errors[0])])) != 0))
        assert crossings <= 3, (rate_deg_s, latency_s, diameter_m)
