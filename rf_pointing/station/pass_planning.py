"""From a track and a station to pass certificates: the sky's motion, the bias model, the beam, and the planner."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.ephemeris import Pass, TopocentricTrack, find_passes, sun
from rf_pointing.planning import AxisLimits, Certificate, HorizonMask, MachineParams, PassProfile, certify
from rf_pointing.planning.certificate import STEP_S
from rf_pointing.rf import MU

__all__ = ["axis_motion", "certificate_of", "pass_profile", "passes_above_mask"]

Array = NDArray[np.float64]
SAMPLE_S = 1.0
MOST_SAMPLES = 4000


def pass_profile(track: TopocentricTrack, window: Pass, step_s: float = SAMPLE_S) -> PassProfile:
    """Return the pass sampled at even steps of at most `step_s`, in no more than `MOST_SAMPLES` rows."""
    count = min(MOST_SAMPLES, max(2, int(np.ceil(window.duration_s / step_s)) + 1))
    times = np.linspace(window.aos_t_s, window.los_t_s, count)
    looks = track.sample(times)
    solar = TopocentricTrack(sun(), track.site, refraction=track.refraction).sample(times)
    return PassProfile(
        name=window.name,
        t_s=times,
        position_rad=np.column_stack([looks.azimuth_rad, looks.elevation_rad]),
        velocity_rad_s=np.column_stack([looks.azimuth_rate_rad_s, looks.elevation_rate_rad_s]),
        acceleration_rad_s2=np.column_stack([looks.azimuth_acceleration_rad_s2, looks.elevation_acceleration_rad_s2]),
        sun_rad=np.column_stack([solar.azimuth_rad, solar.elevation_rad]),
    )


def axis_motion(profile: PassProfile, model: BiasModel) -> tuple[Array, Array, Array]:
    """Return the motion (n, 2) of the axes that holds the beam on the pass.

    In the hole about the mount's zenith, where the model has no solution, its correction at the rim is carried through.
    """
    motion = profile.position_rad, profile.velocity_rad_s, profile.acceleration_rad_s2
    try:
        return model.apply_moving(*motion)
    except ValueError:
        low = motion[0].copy()
        low[:, 1] = np.minimum(low[:, 1], math.radians(85.0))
        corrected = model.apply_moving(low, *motion[1:])[0] - low
        return motion[0] + corrected, motion[1], motion[2]


def certificate_of(
    profile: PassProfile,
    model: BiasModel,
    issued_t_s: float,
    present_rad: tuple[float, float],
    machine: MachineParams,
    limits: AxisLimits,
    mask: HorizonMask,
) -> Certificate:
    """Return the certificate of a pass for the beam of the machine's parameters (Gaussian, CONSCAN eq. 1)."""
    fine = profile.resampled(STEP_S)
    width = machine.half_power_beamwidth_rad

    def gain(error_rad: Array) -> Array:
        return np.asarray(np.exp(-MU * (error_rad / width) ** 2))

    return certify(fine, axis_motion(fine, model), issued_t_s, present_rad, machine, limits, mask, gain)


def passes_above_mask(track: TopocentricTrack, start_t_s: float, span_s: float, mask: HorizonMask, least_rad: float) -> list[Pass]:
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
