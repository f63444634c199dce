"""Pass certificates from a track and a station: sky motion, bias model, beam and planner.

Every certificate may be kept as a JSON file.
"""

import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rf_pointing.calibration import BiasModel, LagHistory, without_lags
from rf_pointing.core import LONGEST_NAME, Array, Motion, Pair, Params, gaussian_gain, parameter
from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.core.whole_file import write_whole
from rf_pointing.ephemeris import ElementUncertainty, Pass, Site, TopocentricTrack, sky_uncertainty, sun
from rf_pointing.planning import (
    AxisLimits,
    Certificate,
    Gate,
    GateParams,
    HorizonMask,
    MachineParams,
    PassProfile,
    SensorCost,
    certificate_values,
    certify,
)
from rf_pointing.planning.branch_motion import Lag, no_lag
from rf_pointing.planning.certificate import Slew, branch_cost
from rf_pointing.station.pointing.prediction import axis_motion

if TYPE_CHECKING:
    from rf_pointing.ephemeris import CataloguePass

SAMPLE_S = 1.0
SUN_STEP_S = 60.0
# A geostationary "pass" lasts for days.
MOST_SAMPLES = 4000


@dataclass(frozen=True, kw_only=True)
class PlanningRules:
    """The antenna that passes are planned for: its errors, its axes, and where they may not go."""

    model: BiasModel
    machine: MachineParams
    limits: AxisLimits
    mask: HorizonMask
    gate: GateParams
    lag_averaging_s: float
    mount: Kinematics = LEVEL
    swept_rad2_s: float = 0.0
    """Sky that a search sweeps in a second; 0: the prediction alone is followed."""


@dataclass(frozen=True, kw_only=True)
class PlannedPass:
    """One coming pass: its motion on the sky, and its certificate."""

    window: Pass
    profile: PassProfile
    certificate: Certificate


def planned_certificate(
    track: TopocentricTrack, window: "Pass | CataloguePass", free_t_s: float, encoder_rad: Pair,
    rules: PlanningRules, sun_table: "SolarTable | None" = None,
) -> tuple[Certificate, PassProfile]:  # fmt: skip
    """Return the certificate of a pass for an antenna at `encoder_rad` from `free_t_s` on.

    A tilt axis leans to the side on which less of the pass is lost.  The profile is on the sky.
    """
    profile = pass_profile(track, window, sun_table=sun_table)
    table = sun_table or SolarTable(track.site, track.refraction, free_t_s, SUN_STEP_S)
    azimuth, elevation = table.at(np.array([free_t_s]))[0].tolist()
    # With a table one of many passes is planned: a plunge that no axis reaches is not tabulated.
    plunge_allowed = sun_table is None or rules.limits.elevation_max_rad > 0.5 * np.pi
    found = []
    for mount in rules.mount.leaning_from(float(profile.position_rad[np.argmax(profile.position_rad[:, 1]), 0])):
        here = replace(rules, mount=mount)
        gate = Gate(rules.gate, rules.limits, rules.mask, rules.machine.axes, mount)
        slew = _once_it_leans(mount, partial(gate.slew, sun_rad=mount.axes_at(azimuth, elevation)))
        own = profile.on(mount)
        found.append(certificate_of(own, here, free_t_s, encoder_rad, plunge_allowed=plunge_allowed, slew=slew))
    return min(found, key=lambda one: branch_cost(one.branches[0])), profile.resampled()


def _once_it_leans(mount: Kinematics, slew: Slew) -> Slew:
    """Return the slew after a tilt axis is set, which may take half a turn of it."""

    def slewed(start: Pair, goal: Pair) -> tuple[float, str]:
        needed_s, barred = slew(start, goal)
        return mount.leaning_s + needed_s, barred

    return slewed if mount.leaning_s else slew


def pass_profile(
    track: TopocentricTrack, window: "Pass | CataloguePass", step_s: float = SAMPLE_S,
    sun_table: "SolarTable | None" = None, law: ElementUncertainty | None = None,
) -> PassProfile:  # fmt: skip
    """Return the pass at even steps of at most `step_s`, in at most `MOST_SAMPLES` rows.

    By the `law` it says how uncertain the target is where it is nearest.
    """
    count = min(MOST_SAMPLES, max(2, int(np.ceil(window.duration_s / step_s)) + 1))
    times = np.linspace(window.aos_t_s, window.los_t_s, count)
    looks = track.sample(times)
    table = sun_table or SolarTable(track.site, track.refraction, window.aos_t_s, window.duration_s)
    nearest = int(np.argmin(looks.range_m))
    known = None if law is None else sky_uncertainty(track, float(times[nearest]), law)
    return PassProfile(
        name=window.name,
        t_s=times,
        position_rad=np.column_stack([looks.azimuth_rad, looks.elevation_rad]),
        velocity_rad_s=np.column_stack([looks.azimuth_rate_rad_s, looks.elevation_rate_rad_s]),
        acceleration_rad_s2=np.column_stack([looks.azimuth_acceleration_rad_s2, looks.elevation_acceleration_rad_s2]),
        sun_rad=table.at(times),
        range_m=looks.range_m,
        satellite_gain_db=looks.satellite_gain_db,
        along_sigma_s=known.along_track_s if known else 0.0,
        cross_sigma_m=known.cross_track_rad * float(looks.range_m[nearest]) if known else 0.0,
    )


class SolarTable:
    """The Sun over a site in a span of time, interpolated between minutes."""

    def __init__(self, site: Site, refraction: RadioRefraction | None, start_t_s: float, span_s: float) -> None:
        # The Sun's ephemeris is slow to compute, and the Sun is slow.
        self._minutes = np.linspace(start_t_s, start_t_s + span_s, max(2, int(np.ceil(span_s / SUN_STEP_S)) + 1))
        solar = TopocentricTrack(sun(), site, refraction=refraction).sample(self._minutes)
        self._azimuth, self._elevation = np.unwrap(solar.azimuth_rad), solar.elevation_rad

    def at(self, times: Array) -> Array:
        """Return azimuth and elevation (n, 2) at times (n,) of the span."""
        columns = (np.interp(times, self._minutes, values) for values in (self._azimuth, self._elevation))
        return np.column_stack(list(columns))


def certificate_of(
    profile: PassProfile, rules: PlanningRules, issued_t_s: float, encoder_rad: Pair, *,
    plunge_allowed: bool = True, slew: Slew | None = None, cost: SensorCost | None = None,
) -> Certificate:  # fmt: skip
    """Return the certificate of a pass for a Gaussian beam (CONSCAN eq. 1).

    The profile, as the encoders, is in the angles of the axes of `rules.mount`.

    Lags that build up over `rules.lag_averaging_s` are those of the motion that the beam makes,
    crossing included; with 0 they are those of the target's own.
    """
    fine, model, machine = profile.resampled(), rules.model, rules.machine
    gain = partial(gaussian_gain, beamwidth_rad=machine.half_power_beamwidth_rad)
    plunges = (False, True) if plunge_allowed else (False,)
    sky = Motion(fine.position_rad, fine.velocity_rad_s, fine.acceleration_rad_s2)
    history = LagHistory(model, rules.lag_averaging_s) if rules.lag_averaging_s > 0.0 and model.has_lags else None
    held = without_lags(model) if history else model
    sides: dict[bool, tuple[Array, Array, Array]] = {over: axis_motion(sky, held, plunge=over) for over in plunges}
    lag: Lag = history.lead if history else no_lag
    return certify(
        fine, sides, issued_t_s, encoder_rad, machine, rules.limits, rules.mask, gain, lag, slew, cost, rules.mount
    )


@dataclass(frozen=True, kw_only=True)
class StoreParams(Params):
    """Where certificates are kept."""

    certificate_folder: str = parameter("", "folder of the stored certificates; empty: they are only published")


def store_certificate(params: StoreParams, certificate: Certificate) -> Path | None:
    """Write the certificate to its folder; return the file, None without a folder."""
    if not params.certificate_folder:
        return None
    name = "".join(letter if letter.isalnum() else "_" for letter in certificate.name[:LONGEST_NAME])
    begin = datetime.fromtimestamp(certificate.aos_t_s, UTC)
    path = Path(params.certificate_folder) / f"{name}-{begin:%Y%m%dT%H%M%S}.json"
    write_whole(path, json.dumps(certificate_values(certificate), indent=1) + "\n")
    return path
