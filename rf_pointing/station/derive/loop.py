"""The tracking loop of the controller, its tolerances, and what it expects of the beam's motion."""

import math

from rf_pointing.core import MDEG, Rows, Value, rounded, tuned
from rf_pointing.core.parameters import flat
from rf_pointing.station.derive import axes
from rf_pointing.station.derive.band import REFERENCE_M, Band
from rf_pointing.station.derive.signal import level_known

GUST_POWER = 2.5
"""Growth with the diameter of what the encoders miss: 0.06 mdeg in 1 s at 34 m, 0.36 at 70 m."""
# Cycles of the loop within its delay, a gain margin of 4.3, and the delay of errors and commands.
# Twice as many, with the steps of a rotator, swing by three of them for as long as the pass lasts.
LOOP_DELAY, LEAD_S = 0.058, 0.2
# As the parameters of the watch hold them, to the last bit.
GUSTS_DEG = tuple(math.degrees(each * MDEG) for each in (0.1, 0.2, 0.4, 0.8))
VIBRATION_DEG = (0.0, math.degrees(0.2 * MDEG), 6e-4)


def pointing(of: Band) -> Rows:
    """Tolerances of the controller."""
    h, dead_band = of.beamwidth_deg, rounded(1.1 * of.dead_band_deg)
    return {
        "on_target_deg": tuned(
            min(max(0.05, 0.1 * h, 2.5 * of.step_deg, dead_band), 5.0),
            "0.1 h, at least 0.05 deg, 2.5 encoder steps, and 1.1 times the dead band or smallest move of a rotator",
        ),
        "stop_deceleration_deg_s2": tuned(
            rounded(0.625 * min(of.accelerations_deg_s2)), "0.625 of the smaller commanded acceleration"
        ),
    }


def integrator(of: Band) -> Rows:
    """The tracking loop."""
    bandwidth_hz = 0.2
    if of.positions:
        drive = axes.drive(of)
        wait_s = drive["rotator.latency_s"].value + 0.5 * drive["rotator.minimum_interval_s"].value
        bandwidth_hz = rounded(min(bandwidth_hz, LOOP_DELAY / (LEAD_S + wait_s)))
    return {
        "bandwidth_hz": tuned(
            bandwidth_hz,
            "0.2 Hz, a fifth of the position loop's; a drive that takes positions: at most 0.058 "
            "over 0.2 s, its latency and half its interval",
        ),
        "mean_of": tuned(5, "five errors"),
        "offset_limit_deg": tuned(min(max(0.6, 1.5 * of.beamwidth_deg), 20.0), "1.5 h, from 0.6 to 20 deg"),
        "acceleration_deg_s2": tuned(
            0.25 * min(of.accelerations_deg_s2), "a quarter of the commanded acceleration"
        ),
        "sample_s": Value(of.content.receiver.power_period_s, "receiver.power_period_s"),
    }  # fmt: skip


def second_stage(of: Band) -> Rows:
    """The fast actuator before the mount, and the tracking loop around it."""
    section = of.content.second_stage
    if section is None:
        return {}
    given = flat(of.content.tuning) | flat(of.section.tuning)
    bandwidth_hz = given.get("integrator.bandwidth_hz", integrator(of)["bandwidth_hz"].value)
    return {name: Value(each, f"second_stage.{name}") for name, each in vars(section).items()} | {
        "radio_bandwidth_hz": tuned(float(bandwidth_hz), "integrator.bandwidth_hz")
    }


def trim(of: Band) -> Rows:
    """Filter of the ephemeris error."""
    error = of.section.model_error_deg
    return {
        "bias_deg": Value(error, "bands.*.model_error_deg"),
        "bias_walk_deg": tuned(0.02 * error, "0.02 of model_error_deg in 1 s"),
    }


def lock_watch(of: Band) -> Rows:
    """Motion of the beam that the encoders miss: gusts that bend a large dish, their own steps."""
    gusts = max(1.0, (of.wind_diameter_m / REFERENCE_M) ** GUST_POWER)
    vibration = max(gusts, of.step_deg / math.sqrt(12.0) / VIBRATION_DEG[1])
    return {
        "half_power_beamwidth_deg": of.width,
        "compares_level": Value(level_known(of), "receiver", "whether the noise of a power is known"),
        "gust_deg": tuned(
            tuple(each * gusts for each in GUSTS_DEG),
            "0.0001 to 0.0008 deg, above 34 m with the power 2.5 of the diameter",
        ),
        "vibration_deg": tuned(
            tuple(each * vibration for each in VIBRATION_DEG),
            "0 to 0.0006 deg, above 34 m as the gusts, at least the rms of an encoder step",
        ),
    }
