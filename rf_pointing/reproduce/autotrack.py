"""What is asked of monopulse, search and coast, measured on the simulated station: the parts of `track` without ROS."""

import math

import numpy as np

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.geometry import MDEG
from rf_pointing.reproduce.autotrack_cases import Case, first_time_s, fly, low_orbit_pass, reacquisitions_s
from rf_pointing.reproduce.row import Row
from rf_pointing.simulation import PassLog

__all__ = ["rows"]

COMMAND_S = 0.1
SETTLED_S = 25.0
DROPOUTS = 10
KA_45_DB_HZ = {"signal.link.zenith_carrier_to_noise_db_hz": 45.0, "signal.link.reference_range_m": 1.1e6}
"""45 dB-Hz at about the distance of the satellite during the case."""
LINK_45_DB_HZ = {"link.zenith_carrier_to_noise_db_hz": 45.0, "link.reference_range_m": 1.1e6}


def rows(seed: int = 1) -> list[Row]:
    """Return the numbers asked of monopulse, search and coast beside ours."""
    return [_ka_row(seed), _sign_flip_row(seed), *_dropout_rows(seed)]


def radial_rms_mdeg(log: PassLog, mode: str, from_s: float) -> float:
    """Return the radial rms of the true error in a mode from a time on."""
    chosen = (np.array(log.mode) == mode) & (np.array(log.t_s) >= from_s)
    errors = log.errors_rad()[chosen]
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) / MDEG if len(errors) else math.inf


def _ka_row(seed: int) -> Row:
    window = low_orbit_pass()
    case = Case("Ka", "monopulse", 90.0, {"rf_receiver": KA_45_DB_HZ, "pointing_controller": LINK_45_DB_HZ}, seed)
    log = fly(case, window)
    held_s = first_time_s(log, "monopulse") - window.aos_t_s
    return Row(
        quantity="total radial error, monopulse, Ka, 45 dB-Hz, wind 8 m/s, LEO pass", source="required", paper=2.0,
        ours=radial_rms_mdeg(log, "monopulse", window.aos_t_s + SETTLED_S), unit="mdeg rms", tolerance=0.0, bound="<=",
        remark=f"acquired {held_s:.1f} s after the start, the satellite 0.15 s ahead of its elements",
    )  # fmt: skip


def _sign_flip_row(seed: int) -> Row:
    window, flip_s = low_orbit_pass(), 35.0
    log = fly(Case("Ka", "monopulse", 45.0, {"rf_receiver": {"signal.sign_flip_after_s": flip_s}}, seed), window)
    begin_s, found_s = log.t_s[0] + flip_s, first_time_s(log, "hand_back")
    largest = max(
        math.hypot(x, y)
        for t_s, x, y in zip(log.t_s, log.cross_elevation_rad, log.elevation_rad, strict=True)
        if begin_s <= t_s <= found_s
    )
    return Row(
        quantity="both differences turned over in flight: time to hand back", source="required", paper=2.0,
        ours=found_s - begin_s, unit="s", tolerance=0.0, bound="<=", explained=True,
        remark=f"the beam rested on the target: from some tenths of a millidegree the error grows e-fold in 0.8 s, and was "
        f"{largest / MDEG:.1f} mdeg at most when it was found; nothing shows a flip of a beam without error",
    )  # fmt: skip


def _dropout_rows(seed: int) -> list[Row]:
    window = low_orbit_pass(40.0, 10.0)
    receiver = {
        "signal.dropouts.count": DROPOUTS,
        "signal.dropouts.gap_s": 8.0,
        "signal.dropouts_after_s": 60.0,
        "signal.dropouts_within_s": window.duration_s - 90.0,
    }
    log = fly(Case("X", "monopulse", window.duration_s, {"rf_receiver": receiver}, seed), window)
    times = reacquisitions_s(log, "monopulse")
    late = np.array(log.command_t_s)[1:-1] > window.aos_t_s + 1.0
    accelerations = np.diff(np.array(log.command_rad), 2, axis=0) / COMMAND_S**2
    steepest = float(np.max(np.abs(accelerations[late])))
    limit = min(CommandPreprocessorParams().acceleration_limit_rad_s2)
    return [
        Row(
            quantity="random dropouts of 0.5-20 s reacquired, X, wind 8 m/s", source="required", paper=DROPOUTS,
            ours=float(np.sum(np.isfinite(times))), unit="of 10", tolerance=0.0,
            remark=f"slowest {np.max(times):.1f} s after the carrier is back, median {np.median(times):.1f} s",
        ),
        Row(
            quantity="largest acceleration of the command in that pass", source="required", paper=math.degrees(limit),
            ours=math.degrees(steepest), unit="deg/s^2", tolerance=1e-6, bound="<=",
        ),
    ]  # fmt: skip
