"""Scans with a planted truth: total power of a dish of 3.7 m, or a carrier."""

import math
from functools import cache

import numpy as np

from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.scan_fit import Samples
from rf_pointing.rf.beam import BeamParams
from rf_pointing.tracking.scan_program import ScanProgram, ScanProgramParams

S_BAND_RAD = math.radians(2.4)
BEAM = BeamParams(half_power_beamwidth_rad=S_BAND_RAD)
SYSTEM_K, PERIOD_S = 150.0, 0.1


@cache
def way_of(params: ScanProgramParams) -> np.ndarray:
    """Return times and offsets (3, n)."""
    program = ScanProgram(params)
    t_s = np.arange(0.0, program.duration_s, PERIOD_S)
    return np.vstack([t_s, np.array([program.offset(t)[:2] for t in t_s]).T])


def scan_of(
    random: np.random.Generator,
    *,
    pattern: str = "cross",
    beam: BeamParams = BEAM,
    offset_rad: tuple[float, float] = (0.004, -0.007),
    ellipse: tuple[float, float] = (0.0, 0.0),
    widened: float = 1.0,
    source_k: float = 60.0,
    radius_rad: float = 0.0,
    bandwidth_hz: float = 1e6,
    drift_k_s: float = 0.0,
    tilt_k_rad: float = 0.0,
    repetitions: int = 2,
) -> Samples:
    """Return the total powers of a scan, as temperatures."""
    h = beam.half_power_beamwidth_rad
    frame = "right_ascension" if pattern == "drift" else "cross_elevation"
    t_s, x, y = way_of(
        ScanProgramParams(
            pattern=pattern, frame=frame, half_width_rad=1.5 * h, rate_rad_s=0.15 * h, move_rate_rad_s=0.6 * h,
            acceleration_rad_s2=0.6 * h, repetitions=repetitions, dwell_s=4.0,
        )
    )  # fmt: skip
    dx, dy, (e1, e2) = offset_rad[0] - x, offset_rad[1] - y, ellipse
    u2 = (dx**2 * (1.0 - e1) - 2.0 * e2 * dx * dy + dy**2 * (1.0 + e1)) / (widened * h) ** 2
    gain = DiscResponse(beam).power(u2, radius_rad / (widened * h), 6.0)
    mean = SYSTEM_K + source_k * gain + drift_k_s * (t_s - t_s.mean()) + tilt_k_rad * y
    relative = 1.0 / math.sqrt(bandwidth_hz * PERIOD_S)
    power = mean * (1.0 + relative * random.standard_normal(len(t_s)))
    return Samples(t_s, power, power * relative, x, y, np.ones_like(t_s), np.ones_like(t_s))
