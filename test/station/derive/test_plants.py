"""Plants and loops of mounts: scaled by diameter, held in the wind, stable with a margin."""

import math

import pytest

from rf_pointing.controllers import dss13_loops
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
