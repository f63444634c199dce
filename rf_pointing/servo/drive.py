"""The nonlinear part of one axis over one substep: limits, friction, brakes, gear play.

All of it enters the exact linear step as inputs held over the substep: the rate command the drive
can follow, the friction that may at most stop the axis, and the difference between the true gear
torque and a linear spring.
"""

import math
from typing import NamedTuple

from rf_pointing.servo.parameters import AxisParams


class DriveConstants(NamedTuple):
    """Constants of one axis for one substep; torques are divided by the inertia."""

    rate_decay: float
    """Share of a rate that is left after the substep."""
    response_s: float
    """Rate after the substep over an acceleration held during it."""
    rate_limit: float
    rate_gap: float
    """Largest gap between commanded and present rate, at full torque."""
    friction: float
    breakaway_excess: float
    """Breakaway torque over friction torque, less one."""
    stribeck_rate: float
    brake: float
    gear_stiffness: float
    """In 1/s^2."""
    gear_damping: float
    """In 1/s."""
    gear_preload: float
    gear_play: float
    step_s: float


def drive_constants(axis: AxisParams, step_s: float) -> DriveConstants:
    """Return the constants of one axis for substeps of `step_s`."""
    bandwidth, inertia = axis.drive_bandwidth_rad_s, axis.inertia_kg_m2
    decay = math.exp(-bandwidth * step_s)
    stiffness = axis.gear_frequency_rad_s**2
    return DriveConstants(
        rate_decay=decay,
        response_s=(1.0 - decay) / bandwidth,
        rate_limit=axis.rate_limit_rad_s,
        rate_gap=axis.acceleration_limit_rad_s2 / bandwidth,
        friction=axis.coulomb_friction_n_m / inertia,
        breakaway_excess=axis.static_friction_ratio - 1.0,
        stribeck_rate=axis.stribeck_rate_rad_s,
        brake=axis.brake_torque_n_m / inertia,
        gear_stiffness=stiffness,
        gear_damping=2.0 * axis.gear_damping * axis.gear_frequency_rad_s,
        # Without countertorque both trains float in the middle of their play.
        gear_preload=axis.countertorque_n_m / inertia / stiffness
        if axis.countertorque_n_m > 0.0
        else -axis.backlash_rad,
        gear_play=axis.backlash_rad,
        step_s=step_s,
    )


def axis_inputs(
    rate: float, command: float, wind: float, powered: bool, braked: bool, drive: DriveConstants
) -> tuple[float, float, float]:
    """Return rate command (rad/s), friction and wind (rad/s^2) to hold over the substep.

    `rate` is the axis rate at its start.  Friction and brake are bounded by what brings the axis to
    rest at its end, which makes sticking exact at any step.  Without power the motors give no
    torque: the command follows the rate, and the accelerations are scaled so that the rate loop of
    the linear model, which still acts, takes nothing away.
    """
    # Unpacked once, bounds without calls: this runs for every axis in every substep.
    decay, response, rate_limit, rate_gap, friction, excess, stribeck, brake, _, _, _, _, step = (
        drive
    )
    if powered:
        # The rate limit first: a command beyond it must not ask for more torque than one at it.
        command = (
            -rate_limit
            if command < -rate_limit
            else command
            if command < rate_limit
            else rate_limit
        )
        least, most = rate - rate_gap, rate + rate_gap
        command = least if command < least else command if command < most else most
    else:
        command = rate
    gain = response if powered else step
    holding = brake if braked else 0.0
    if friction > 0.0:
        ratio = rate / stribeck
        holding += friction * (1.0 + excess * math.exp(-ratio * ratio))
    # Friction can at most stop the axis within the substep; more would drive it backwards.
    free = decay * rate + (1.0 - decay) * command + gain * wind
    opposing = -free / gain
    opposing = -holding if opposing < -holding else opposing if opposing < holding else holding
    return command, opposing * gain / response, wind * gain / response


def gear_correction(deflection: float, rate: float, drive: DriveConstants) -> float:
    """Return by what (rad/s^2) the paired gear trains differ from a spring and damper.

    Each train has half the stiffness and half the damping while its teeth touch, is wound up by the
    preload and has a play of twice the half width; without countertorque the preload is minus the
    half width: both float mid-play.
    """
    stiffness, damping, preload, play, step = drive[8:]
    # Evaluated where the gear will be in mid-step; at the start it would brake a load that floats
    # freely.
    deflection += 0.5 * step * rate
    if -preload <= deflection <= preload:
        return 0.0
    forward, backward = (
        _tooth_wind(preload + deflection, play),
        _tooth_wind(preload - deflection, play),
    )
    # A train within its play carries neither spring nor damping force.
    touching = 0.5 * (forward != 0.0) + 0.5 * (backward != 0.0)
    return stiffness * (deflection - 0.5 * (forward - backward)) + damping * rate * (1.0 - touching)


def _tooth_wind(wound: float, play: float) -> float:
    """Return how far a train wound by `wound` is pressed: not at all within its play."""
    return max(wound, 0.0) + min(wound + 2.0 * play, 0.0)
