"""Every sensor of `track` in every band, on the simulated station: one low pass each.

CBERS-2 at up to 40 deg, 0.15 s ahead of its elements, wind 8 m/s, the station of the configuration
files.  The requirement is the DSN's pointing accuracy: 28, 8 and 2 mdeg at S, X and Ka band.  A
scan is part of the error of the beam: the remark gives the error of its centre, and what both cost.
"""

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import product

import numpy as np

from rf_pointing.core import MDEG, MU
from rf_pointing.core.types import Array
from rf_pointing.papers.autotrack_cases import (
    RADIO_MODES,
    Case,
    command_accelerations_rad_s2,
    fly,
    low_orbit_pass,
)
from rf_pointing.papers.row import Row
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.simulation import PassLog

BANDS = ("S", "X", "Ka")
SENSORS = ("monopulse", "conscan", "steptrack", "auto")
REQUIRED_MDEG = {"S": 28.0, "X": 8.0, "Ka": 2.0}
# A pass of medium height: near the zenith the keyhole would be measured instead of the sensor.
PEAK_DEG, MASK_DEG = 40.0, 20.0
CLUSTER_S = 0.1
SETTLED_S = 20.0
"""After the first radio mode that lasts; from then on every cluster counts, whatever the mode."""
LASTING_S = 5.0
ROUND_S = {"conscan": 4.0, "steptrack": 5.2, "monopulse": 0.1}
"""Time over which a scan comes back to its centre: the mean of the beam over it is the centre."""


@dataclass(frozen=True)
class Tracked:
    """One pass: when a radio mode took over for good, errors of the beam and of the scan's centre,
    loss, share of time.
    """

    band: str
    sensor: str
    acquired_s: float
    beam_rad: float
    centre_rad: float
    loss_db: float
    share: float
    modes: tuple[str, ...]
    acceleration_rad_s2: float


def rows(seed: int = 1, executor: Executor | None = None) -> list[Row]:
    """Return the error of every sensor in every band.

    With an executor the passes are shared out.
    """
    cases = list(product(BANDS, SENSORS))
    spread: Callable[..., object] = map if executor is None else executor.map
    found = spread(tracked, *zip(*cases, strict=True), [seed] * len(cases))
    return [_row(item) for item in found]  # type: ignore[attr-defined]


def tracked(band: str, sensor: str, seed: int = 1, seconds: float = math.inf) -> Tracked:
    """Fly one pass, or its first seconds, and return what came of it."""
    window = low_orbit_pass(PEAK_DEG, MASK_DEG)
    log = fly(Case(band, sensor, min(seconds, window.duration_s), seed=seed), window)
    # Short contacts during the search do not count as acquired.
    begun_s = _lasting_s(log, window.aos_t_s)
    late = np.array(log.t_s) >= begun_s + SETTLED_S
    errors, modes = log.errors_rad()[late], np.array(log.mode)[late]
    # A pass without acquisition is a row that does not hold, not a missing row.
    if not len(errors):
        return Tracked(band, sensor, math.inf, math.nan, math.nan, math.nan, 0.0, (), math.nan)
    # The mean over a whole scan is its centre; the longest scan of the modes in use decides.
    count = round(max(ROUND_S.get(mode, 0.1) for mode in set(modes)) / CLUSTER_S)
    centre = np.column_stack(
        [np.convolve(axis, np.full(count, 1.0 / count), "valid") for axis in errors.T]
    )
    beamwidth = HALF_POWER_BEAMWIDTH_RAD[band]
    # Power at the true offsets: what the pointing costs the link, scan included.
    received = np.exp(-MU * np.sum(errors**2, axis=1) / beamwidth**2)
    accelerations = command_accelerations_rad_s2(log, window.aos_t_s + 1.0)
    return Tracked(
        band=band,
        sensor=sensor,
        acquired_s=begun_s - window.aos_t_s,
        beam_rad=_radial_rms(errors),
        centre_rad=_radial_rms(centre),
        loss_db=-10.0 * math.log10(float(np.mean(received))),
        share=float(np.mean(np.isin(modes, RADIO_MODES))),
        modes=tuple(mode for mode in RADIO_MODES if mode in modes),
        acceleration_rad_s2=float(np.max(np.abs(accelerations))),
    )


def _lasting_s(log: PassLog, aos_t_s: float) -> float:
    """Return when the first radio mode began that lasted, infinite if none did."""
    begun_s, before = math.inf, ""
    for t_s, mode in zip(log.t_s, log.mode, strict=True):
        if mode != before:
            before, begun_s = mode, t_s if mode in RADIO_MODES and t_s > aos_t_s else math.inf
        if t_s - begun_s > LASTING_S:
            return begun_s
    return math.inf


def _radial_rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def _row(found: Tracked) -> Row:
    remark = (
        f"centre {found.centre_rad / MDEG:.2f} mdeg, {found.loss_db:.3f} dB lost, held from {found.acquired_s:.1f} s on, "
        f"{found.share:.1%} of the time after ({', '.join(found.modes)}), command up to "
        f"{math.degrees(found.acceleration_rad_s2):.2f} deg/s^2"
    )
    return Row(
        f"{found.band} {found.sensor}: radial error of the beam", "DSN requirement", REQUIRED_MDEG[found.band],
        found.beam_rad / MDEG, "mdeg rms", 0.0, bound="<=", remark=remark,
    )  # fmt: skip
