"""Simulated plant and position loops of a mount, from diameter, rates, encoders and wind.

A structure of diameter D is that of the 34-m antenna scaled: its modes go with 1/D, its inertia
with D^4.  A small mount is stiff: one gear with play, no paired drives, and modes far above the
loop.  The inertia about an axis includes the motors through the gears, so it is at least what lets
the motors hold the antenna in the wind at which it is stowed, T_wind <= 0.9 I a.

A drive that takes rates and was not identified has the loop

    k_p = c / L,    k_i = k_p^2 / 4,    c = min(0.2, sqrt(0.6 a L / v))

with L its lag: that of the structure's rate loop, `drive.rotator.latency_s` and half a period.  The
first bound leaves a gain margin of pi / (2 c) = 7.9 over a dead time L.  With the second the lag of
a slew, L v, is braked by k_p^2 L v within the 0.6 of the acceleration a that commands leave, so
the drive does not saturate to and fro.
"""

import math
from dataclasses import dataclass

from rf_pointing.controllers import PositionLoopParams, dss13_loops
from rf_pointing.controllers.position_loop import FEEDFORWARD_LAG_S
from rf_pointing.core import AXES, Rows, Value, leaves, tuned
from rf_pointing.servo import AxisParams, PlantParams, dss13_plant
from rf_pointing.station.antenna.loops import closed_loop_pole
from rf_pointing.station.derive.axes import preprocessor
from rf_pointing.station.derive.band import (
    AXIS_KEYS,
    REFERENCE_M,
    STIFF_BACKLASH_DEG,
    STIFF_DRIVE_RAD_S,
    TICK_S,
    Band,
    drive_acceleration_deg_s2,
    encoder_bits,
)
from rf_pointing.station.derive.watches import oscillation, rate_latency_s, takes_rates

STIFF_GEAR_HZ = 30.0
COARSE_NOISE_RAD = math.radians(5e-4)
HIGHEST_MODE_HZ = 60.0
MOMENT = 0.1
"""Moment coefficient of the wind on a reflector (servo/wind.py)."""
AIR_DENSITY = 1.225
HOLDING_RESERVE = 1.1
GAIN_MARGIN = 2.0
SHARE, BRAKING = 0.2, 0.6
"""Largest k_p L of a loop, and share of the acceleration that commanded motion leaves to it."""
LONGEST_DEAD_S = 0.5


@dataclass(frozen=True, kw_only=True)
class MountAxis:
    """Parts of an axis, in rad."""

    rate_rad_s: float
    acceleration_rad_s2: float
    stop_rad: tuple[float, float]
    encoder_bits: int
    backlash_rad: float | None


def plant_and_loops(of: Band) -> tuple[Rows, Rows]:
    """Return the rows of the plant and of everything that closes or guards its loops."""
    structure, diameter = of.structure, of.wind_diameter_m
    azimuth, elevation = (
        MountAxis(
            rate_rad_s=math.radians(axis.rate_deg_s),
            acceleration_rad_s2=math.radians(drive_acceleration_deg_s2(axis)),
            stop_rad=(math.radians(stop[0]), math.radians(stop[1])),
            encoder_bits=encoder_bits(axis),
            backlash_rad=None if axis.backlash_deg is None else math.radians(axis.backlash_deg),
        )
        for axis, stop in zip(of.axes, of.stops_deg, strict=True)
    )
    plant = plant_of(structure, diameter, (azimuth, elevation), of.content.wind.mean_limit_m_s)
    first = takes_rates(of.content.drive)
    if first:
        # What guards the gains of an operator, too, is a plant with the latency of the device.
        dead_s = min(rate_latency_s(of), LONGEST_DEAD_S)
        plant = plant.replace(
            azimuth=plant.azimuth.replace(drive_delay_s=dead_s), elevation=plant.elevation.replace(drive_delay_s=dead_s)
        )
    rows: dict[str, Value] = {}
    for name, (_, value) in leaves(plant).items():
        axis, _, last = name.rpartition(".")
        given = axis in AXES and last in AXIS_KEYS
        formula = f"{structure} structure of {diameter:g} m (plants.py)"
        rows[name] = Value(value, f"mount.{axis}.{AXIS_KEYS[last]}") if given else tuned(value, formula)
    laws = position_loops(structure, diameter, plant, first=first)
    watch = oscillation(of, tuple(law.drive_lag_s for law in laws))
    loops: dict[str, Rows | Value] = {"preprocessor": preprocessor(of), "oscillation": watch}
    formula = f"PI loop of a {structure} structure with a gain margin of 2"
    for axis, own, loop in zip(AXES, of.axes, laws, strict=True):
        rate = f"mount.{axis}.rate_deg_s"
        if first:
            share = loop.proportional_gain * loop.drive_lag_s
            formula = f"k_p = c / L, k_i = k_p^2 / 4, c = {share:.2g}, L = {loop.drive_lag_s:.3g} s; {FIRST_LOOP}"
        for name, (_, value) in leaves(loop).items():
            loops[f"{axis}.{name}"] = Value(value, rate if name == "rate_limit_deg_s" else "", formula)
        loops[f"lqg_{axis}.rate_limit_deg_s"] = Value(own.rate_deg_s, rate)
    return rows, loops


FIRST_LOOP = "until identify_antenna has measured it"


def wind_torque_n_m(diameter_m: float, speed_m_s: float) -> float:
    """Return the torque of a wind on the dish about an axis."""
    area = 0.25 * math.pi * diameter_m**2
    return 0.5 * AIR_DENSITY * speed_m_s**2 * area * diameter_m * MOMENT


def plant_of(structure: str, diameter_m: float, axes: tuple[MountAxis, MountAxis], stow_wind_m_s: float) -> PlantParams:
    """Return the plant of a "flexible" or "stiff" mount with a dish of this diameter."""
    reference = dss13_plant()
    torque = wind_torque_n_m(diameter_m, stow_wind_m_s)
    azimuth, elevation = (
        _axis(structure, own, REFERENCE_M / diameter_m, axis, torque)
        for own, axis in zip((reference.azimuth, reference.elevation), axes, strict=True)
    )
    cross_hz = min(HIGHEST_MODE_HZ, reference.cross_mode_frequency_hz * REFERENCE_M / diameter_m)
    return reference.replace(azimuth=azimuth, elevation=elevation, cross_mode_frequency_hz=cross_hz)


def _axis(structure: str, reference: AxisParams, scale: float, axis: MountAxis, torque_n_m: float) -> AxisParams:
    stiff = structure == "stiff"
    inertia = max(1.0, reference.inertia_kg_m2 / scale**4, HOLDING_RESERVE * torque_n_m / axis.acceleration_rad_s2)
    share = inertia / reference.inertia_kg_m2
    bandwidth = STIFF_DRIVE_RAD_S if stiff else reference.drive_bandwidth_rad_s * min(scale, 1.0)
    gear = (2.0 * math.pi * STIFF_GEAR_HZ) ** 2 * inertia if stiff else share * reference.gear_stiffness_n_m * scale**2
    backlash = axis.backlash_rad
    if backlash is None:
        backlash = math.radians(STIFF_BACKLASH_DEG) if stiff else reference.backlash_rad
    per_gain = reference.drive_bandwidth_per_gain_hz
    if bandwidth != reference.drive_bandwidth_rad_s:
        per_gain = bandwidth / (2.0 * math.pi * reference.amplifier_gain)
    return reference.replace(
        drive_bandwidth_per_gain_hz=per_gain, inertia_kg_m2=inertia, gear_stiffness_n_m=gear,
        backlash_rad=backlash,
        countertorque_n_m=0.0 if stiff else 0.01 * inertia,
        coulomb_friction_n_m=2.5e-5 * inertia,
        # Highest of all modes at most: above it nothing of the loop is left.
        mode_frequency_hz=tuple(min(HIGHEST_MODE_HZ, scale * hz) for hz in reference.mode_frequency_hz),
        rate_limit_rad_s=axis.rate_rad_s,
        acceleration_limit_rad_s2=axis.acceleration_rad_s2,
        brake_torque_n_m=max(math.radians(2.0) * inertia, HOLDING_RESERVE * torque_n_m),
        travel_min_rad=axis.stop_rad[0],
        travel_max_rad=axis.stop_rad[1],
        encoder_bits=axis.encoder_bits,
        # A coarse encoder repeats itself within a fraction of its step, a fine one within one.
        encoder_noise_rad=min(2.0 * math.pi / 2**axis.encoder_bits, COARSE_NOISE_RAD),
    )  # fmt: skip


def position_loops(
    structure: str, diameter_m: float, plant: PlantParams, *, first: bool = False
) -> tuple[PositionLoopParams, PositionLoopParams]:
    """Return PI loops for azimuth and elevation that stay stable at twice their gain.

    The `first` loops of a device that was not identified are those of the module's docstring.
    """
    tuned = dss13_loops("tuned")
    scale = REFERENCE_M / diameter_m
    if structure == "flexible" and scale == 1.0 and not first:
        azimuth, elevation = (
            loop.replace(rate_limit_rad_s=axis.rate_limit_rad_s)
            for loop, axis in zip(tuned, (plant.azimuth, plant.elevation), strict=True)
        )
        return azimuth, elevation
    found = []
    for index, (loop, axis) in enumerate(zip(tuned, (plant.azimuth, plant.elevation), strict=True)):
        lag_s = 1.0 / axis.drive_bandwidth_rad_s + axis.drive_delay_s + 0.5 * TICK_S
        wanted = _stiff(lag_s, axis) if structure == "stiff" else _scaled(loop, scale, lag_s)
        if first:
            wanted = _first(wanted, lag_s, axis)
        found.append(_with_margin(wanted.replace(rate_limit_rad_s=axis.rate_limit_rad_s), plant, index))
    return found[0], found[1]


def _stiff(lag_s: float, axis: AxisParams) -> PositionLoopParams:
    """Return k_p = 0.2 / lag, k_i = k_p^2 / 4: double real pole of the loop without its lag.

    With a coarse encoder less: one step commands a twentieth of the rate at most.
    """
    gain = min(0.2 / lag_s, 0.05 * axis.rate_limit_rad_s * 2**axis.encoder_bits / (2.0 * math.pi))
    return PositionLoopParams(
        proportional_gain=gain, integral_gain=0.25 * gain**2,
        feedforward_lead_s=lag_s + FEEDFORWARD_LAG_S, notch_enabled=False, drive_lag_s=lag_s,
    )  # fmt: skip


def _first(loop: PositionLoopParams, lag_s: float, axis: AxisParams) -> PositionLoopParams:
    """Return the loop with the gains of the module's docstring, or its own where they are less."""
    braking = math.sqrt(BRAKING * axis.acceleration_limit_rad_s2 * lag_s / axis.rate_limit_rad_s)
    gain = min(loop.proportional_gain, min(SHARE, braking) / lag_s)
    return loop.replace(proportional_gain=gain, integral_gain=0.25 * gain**2)


def _scaled(loop: PositionLoopParams, scale: float, lag_s: float) -> PositionLoopParams:
    """Return the loop of the 34-m antenna with its filters at the scaled modes."""
    # A smaller dish has the same drive and the same sampling: its gains do not grow with its modes.
    slower = min(scale, 1.0)
    notch_hz = min(scale * loop.notch_frequency_hz, 0.4 / TICK_S)
    return loop.replace(
        proportional_gain=slower * loop.proportional_gain,
        integral_gain=slower**2 * loop.integral_gain,
        feedforward_lead_s=lag_s + FEEDFORWARD_LAG_S + loop.notch_damping / (math.pi * notch_hz),
        notch_frequency_hz=notch_hz,
        shaping_zero_hz=min(scale * loop.shaping_zero_hz, 0.4 / TICK_S),
        shaping_pole_hz=min(scale * loop.shaping_pole_hz, 0.4 / TICK_S),
        drive_lag_s=lag_s,
    )


def _with_margin(loop: PositionLoopParams, plant: PlantParams, axis: int) -> PositionLoopParams:
    """Return the loop with its gains reduced until it is stable at `GAIN_MARGIN` times both."""
    for _ in range(40):
        risen = loop.replace(
            proportional_gain=GAIN_MARGIN * loop.proportional_gain, integral_gain=GAIN_MARGIN * loop.integral_gain
        )
        laws = (risen, risen)
        if abs(closed_loop_pole(plant, laws, TICK_S, (axis,))) <= 1.0 + 1e-6:
            return loop
        loop = loop.replace(proportional_gain=0.9 * loop.proportional_gain, integral_gain=0.81 * loop.integral_gain)
    raise ValueError("no position loop of this mount is stable")
