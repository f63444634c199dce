"""From a track and a station to pass certificates: the sky's motion, the bias model, the beam, and the planner."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.ephemeris import Pass, TopocentricTrack, find_passes, sun
from rf_pointing.geometry import MU, Motion
from rf_pointing.planning import AxisLimits, Branch, Certificate, HorizonMask, MachineParams, PassProfile, certify
from rf_pointing.planning.certificate import STEP_S
from rf_pointing.station.axis_motion import axis_motion

__all__ = ["PlannedPass", "branch_path", "certificate_of", "pass_profile", "passes_above_mask", "plan_passes"]

Array = NDArray[np.float64]
SAMPLE_S = 1.0
SUN_STEP_S = 60.0
MOST_SAMPLES = 4000


@dataclass(frozen=True, kw_only=True)
class PlannedPass:
    """One coming pass: its motion on the sky, its certificate, and the axes' path (n, 2) on the branch taken, if any."""

    window: Pass
    profile: PassProfile
    certificate: Certificate
    axes_rad: Array | None


def plan_passes(
    track: TopocentricTrack,
    start_t_s: float,
    span_s: float,
    present_rad: tuple[float, float],
    model: BiasModel,
    machine: MachineParams,
    limits: AxisLimits,
    mask: HorizonMask,
    least_rad: float,
) -> list[PlannedPass]:
    """Return every pass of a span with its certificate; each starts from where the one before has left the axes."""
    planned, free_t_s = [], start_t_s
    for window in passes_above_mask(track, start_t_s, span_s, mask, least_rad):
        profile = pass_profile(track, window)
        certificate = certificate_of(profile, model, free_t_s, present_rad, machine, limits, mask)
        fine, chosen = profile.resampled(STEP_S), certificate.chosen
        axes = None
        if chosen is not None:
            axes = branch_path(fine, model, chosen)
            present_rad, free_t_s = chosen.end_rad, window.los_t_s
        planned.append(PlannedPass(window=window, profile=fine, certificate=certificate, axes_rad=axes))
    return planned


def branch_path(fine: PassProfile, model: BiasModel, branch: Branch) -> Array:
    """Return the axis angles (n, 2) of a branch at the times of the profile it was certified with."""
    sky = Motion(fine.position_rad, fine.velocity_rad_s, fine.acceleration_rad_s2)
    path: Array = axis_motion(sky, model, plunge=branch.plunge).position + np.array([2.0 * np.pi * branch.turns, 0.0])
    if branch.crossing is not None:
        first = int(np.searchsorted(fine.t_s, branch.crossing.t_s[0]))
        path[first : first + len(branch.crossing.t_s)] = branch.crossing.position_rad
    return path


def pass_profile(track: TopocentricTrack, window: Pass, step_s: float = SAMPLE_S) -> PassProfile:
    """Return the pass sampled at even steps of at most `step_s`, in no more than `MOST_SAMPLES` rows."""
    count = min(MOST_SAMPLES, max(2, int(np.ceil(window.duration_s / step_s)) + 1))
    times = np.linspace(window.aos_t_s, window.los_t_s, count)
    looks = track.sample(times)
    return PassProfile(
        name=window.name,
        t_s=times,
        position_rad=np.column_stack([looks.azimuth_rad, looks.elevation_rad]),
        velocity_rad_s=np.column_stack([looks.azimuth_rate_rad_s, looks.elevation_rate_rad_s]),
        acceleration_rad_s2=np.column_stack([looks.azimuth_acceleration_rad_s2, looks.elevation_acceleration_rad_s2]),
        sun_rad=_sun_at(times, track),
    )


def _sun_at(times: Array, track: TopocentricTrack) -> Array:
    """Return the Sun's azimuth and elevation (n, 2), interpolated between minutes: its ephemeris is slow, and so is it."""
    minutes = np.linspace(times[0], times[-1], max(2, int(np.ceil((times[-1] - times[0]) / SUN_STEP_S)) + 1))
    solar = TopocentricTrack(sun(), track.site, refraction=track.refraction).sample(minutes)
    azimuth = np.unwrap(solar.azimuth_rad)
    return np.column_stack([np.interp(times, minutes, azimuth), np.interp(times, minutes, solar.elevation_rad)])


def certificate_of(
    profile: PassProfile,
    model: BiasModel,
    issued_t_s: float,
    present_rad: tuple[float, float],
    machine: MachineParams,
    limits: AxisLimits,
    mask: HorizonMask,
    *,
    plunge_allowed: bool = True,
) -> Certificate:
    """Return the certificate of a pass for the beam of the machine's parameters (Gaussian, CONSCAN eq. 1)."""
    fine = profile.resampled(STEP_S)
    width = machine.half_power_beamwidth_rad

    def gain(error_rad: Array) -> Array:
        return np.asarray(np.exp(-MU * (error_rad / width) ** 2))

    ways = (False, True) if plunge_allowed else (False,)
    sky = Motion(fine.position_rad, fine.velocity_rad_s, fine.acceleration_rad_s2)
    axes = {plunge: tuple(axis_motion(sky, model, plunge=plunge)) for plunge in ways}
    return certify(fine, axes, issued_t_s, present_rad, machine, limits, mask, gain)


def passes_above_mask(
    track: TopocentricTrack, start_t_s: float, span_s: float, mask: HorizonMask, least_rad: float
) -> list[Pass]:
    """Return the passes above `least_rad`, each cut to the part that is above the horizon mask."""
    found = find_passes(track, start_t_s, span_s, least_rad)
    cut = []
    for window in found:
        profile = pass_profile(track, window)
        clear = np.flatnonzero(profile.position_rad[:, 1] >= mask.lowest_all(profile.position_rad[:, 0]))
        if len(clear) == len(profile.t_s):
            cut.append(window)
        elif len(clear) > 1:
            first, last = float(profile.t_s[clear[0]]), float(profile.t_s[clear[-1]])
            cut += find_passes(track, first, last - first, least_rad)
    return cut
