"""Scans of a source: the request, what follows from the band, and what came of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rf_pointing.api.keywords import angle_rad
from rf_pointing.api.passes import StationPass
from rf_pointing.api.target import Target
from rf_pointing.core import id_of, utc_text
from rf_pointing.ephemeris import TopocentricTrack, sun
from rf_pointing.ephemeris.celestial_frame import EARTH_RATE_RAD_S
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.scan_fit import ScanFitParams, fit_scan
from rf_pointing.radiometry.sources import SUN, Flux
from rf_pointing.radiometry.y_factor import figures, side_lobe_noise_k, source_noise_k
from rf_pointing.rf.noise import atmosphere_loss_db, system_noise_k
from rf_pointing.simulation import merged
from rf_pointing.station.clients.scan_samples import ScanSamples
from rf_pointing.station.radio.scan_numbers import ScanNumbers
from rf_pointing.station.radio.sky_flux import flux_at, has_flux
from rf_pointing.tracking.scan_program import EAST, FRAMES, ScanProgram, ScanProgramParams

if TYPE_CHECKING:
    from rf_pointing.api.station import Station

# Edge of a scan and time per beamwidth, and how far the baseline is beyond the edge.
HALF_WIDTH_BEAMS, BEAM_S, BASELINE_BEAMS = 1.5, 4.0, 1.5
# Distance of the points of a scan from the target: where the power has fallen by half.
POINT_BEAMS = 0.5
# Share of the planned rates and accelerations that a scan takes by default: above 66 deg of
# elevation the azimuth has no more, and the controller makes the scan smaller.
SHARE = 0.4
# Noise of the Sun in the side lobes, of the source's, at which a scan is refused.
LARGEST_SUN = 0.1
SETTLING_S = 60.0
# A simulated antenna may look into the Sun: there is nothing to burn.
SUN_ALLOWED: dict[str, dict[str, object]] = {
    "pointing_controller": {"gate.sun_radius_deg": 0.0, "machine.sun_radius_deg": 0.0},
    "antenna_servo": {"safety.gate.sun_radius_deg": 0.0},
}


@dataclass(frozen=True, kw_only=True)
class ScanRequest:
    """A scan of one target by a station.

    Attributes
    ----------
    pattern, frame : of `tracking.scan_program`: cross, five_point, nine_point, raster, drift,
        circle, lissajous, rosette; cross_elevation, azimuth, right_ascension.
    half_width_deg, rate_deg_s, baseline_deg : by default 1.5 beamwidths and the radius of the
        source, a beamwidth in 4 s as far as the axes can, and a baseline only on noise, not on the
        carrier of a satellite.
    dwell_s, lines, repetitions : at each point, of a raster, of the whole pattern.
    sun_flux_sfu : flux of the Sun that day at this frequency; of the quiet Sun if None.
    """

    station: "Station"
    target: Target
    pattern: str = "cross"
    frame: str = ""
    half_width_deg: float | None = None
    rate_deg_s: float | None = None
    baseline_deg: float | None = None
    dwell_s: float = 5.0
    lines: int = 9
    repetitions: int = 2
    sun_flux_sfu: float | None = None

    def __post_init__(self) -> None:
        self.station.description.require_mount("scan")

    def flux(self, t_s: float) -> Flux | None:
        """Return the flux of the target, None for one that sends a carrier or has none."""
        asked = self.target.name, self.station.frequency_hz, t_s
        return flux_at(*asked, self.sun_flux_sfu) if has_flux(*asked) else None

    def program(self, t_s: float) -> ScanProgramParams:
        """Return the scan at a time, with what was left open derived from beam and axes."""
        flux, beam_rad = self.flux(t_s), math.radians(self.station.beamwidth_deg)
        fastest, hardest = (SHARE * min(each) for each in self.station.controller.machine.planned)
        beams = POINT_BEAMS if self.pattern.endswith("_point") else HALF_WIDTH_BEAMS
        wide_rad = beams * beam_rad + (flux.radius_rad if flux else 0.0)
        half_rad = angle_rad("half_width", self.half_width_deg, None, wide_rad)
        rate = angle_rad("rate", self.rate_deg_s, None, min(beam_rad / BEAM_S, fastest))
        drift = self.pattern == "drift"
        if drift:
            rate = EARTH_RATE_RAD_S * self._cosine_of_declination(t_s)
        baseline = half_rad + BASELINE_BEAMS * beam_rad if flux and not drift else 0.0
        return ScanProgramParams(
            pattern=self.pattern, frame=self.frame or (EAST if drift else FRAMES[0]),
            half_width_rad=half_rad, rate_rad_s=rate,
            move_rate_rad_s=max(rate, min(fastest, beam_rad)),
            acceleration_rad_s2=min(hardest, beam_rad), dwell_s=self.dwell_s, lines=self.lines,
            repetitions=self.repetitions,
            baseline_rad=angle_rad("baseline", self.baseline_deg, None, baseline),
        )  # fmt: skip

    def _cosine_of_declination(self, t_s: float) -> float:
        look = self.station.track_of(self.target).target_at(t_s)
        latitude_rad, elevation_rad = self.station.site.latitude_rad, look.elevation_rad
        sine = math.cos(latitude_rad) * math.cos(elevation_rad) * math.cos(look.azimuth_rad)
        sine += math.sin(latitude_rad) * math.sin(elevation_rad)
        return math.sqrt(max(1.0 - sine**2, 0.0))

    def window(self, start_t_s: float) -> StationPass:
        """Return the time from `start_t_s` on in which the target is up for the whole scan.

        ValueError where it does not rise within a day, or not for so long.
        """
        program, passes = self.program(start_t_s), self.station.passes
        lowest_rad = self.station.lowest_rad + program.half_width_rad
        up = passes(self.target, start_t_s=start_t_s, hours=24.0, mask_rad=lowest_rad)
        needed_s = ScanProgram(program).duration_s + SETTLING_S
        for one in up:
            if one.duration_s >= needed_s:
                # Again, and alone: the azimuths of a whole day are more than a turn.
                from_s, hours = one.aos_t_s + 1.0, needed_s / 3600.0
                return passes(self.target, start_t_s=from_s, hours=hours, mask_rad=lowest_rad)[0]
        longest_s = max((one.duration_s for one in up), default=0.0)
        raise ValueError(
            f"{self.target.name} is above {math.degrees(lowest_rad):.1f} deg for {longest_s:.0f} s "
            f"at most in the day after {utc_text(start_t_s)}, the scan takes {needed_s:.0f} s"
        )

    def result(self, taken: ScanSamples) -> "ScanResult":
        """Return what the powers of a scan tell; ValueError names what makes them useless."""
        station, signal, t_s = self.station, self._signal, taken.t_s
        middle_s = float(np.mean(t_s))
        track, flux = station.track_of(self.target), self.flux(middle_s)
        self.require_dark(middle_s, flux)
        strength = sky = None
        if len(taken):
            look = track.sample(t_s)
            noise_k = partial(system_noise_k, signal.noise, signal.atmosphere)
            if flux is not None:
                sky = noise_k(np.abs(taken.elevation_rad)) / noise_k(np.abs(look.elevation_rad))
            elif not track.target.at_infinity:
                spreading = (float(np.mean(look.range_m)) / look.range_m) ** 2
                strength = spreading * 10.0 ** (0.1 * look.satellite_gain_db)
        samples, radius_rad = taken.samples(strength, sky), flux.radius_rad if flux else 0.0
        fit = fit_scan(
            samples, ScanFitParams(beam=signal.beam, radius_rad=radius_rad, carrier=flux is None)
        )  # fmt: skip
        mount, middle = station.controller.kinematics, track.target_at(middle_s)
        azimuth_rad, elevation_rad = middle.azimuth_rad, middle.elevation_rad
        axes = mount.of_axes(middle)
        model = station.model.offset_rad(*axes.motion)
        across_rad, along_rad = mount.across(azimuth_rad, elevation_rad) @ fit.offset_rad
        found = None
        if flux is not None:
            dish = station.description.content.dish
            stated_k = system_noise_k(signal.noise, signal.atmosphere, elevation_rad)
            found = figures(
                fit.y_factor(), flux, station.frequency_hz, signal.beam, gain_dbi=signal.gain_dbi,
                air_loss_db=float(atmosphere_loss_db(signal.atmosphere, elevation_rad)),
                system_noise_k=float(stated_k),
                diameter_m=dish.diameter_m if dish else None,
            )  # fmt: skip
        return ScanResult(
            name=self.target.name, station=station.name, band=station.band, pattern=self.pattern,
            beamwidth_rad=math.radians(station.beamwidth_deg), t_s=middle_s,
            azimuth_rad=azimuth_rad, elevation_rad=elevation_rad,
            axis_offset_rad=(
                float(model[0]) + float(across_rad) / math.cos(axes.elevation_rad),
                float(model[1]) + float(along_rad),
            ),
            axes=mount.axes,
            samples=samples, fit=fit, flux=flux, figures=found,
        )  # fmt: skip

    @property
    def _signal(self) -> Any:
        return self.station.description.sets("rf_receiver", self.station.band)["signal"]

    def require_dark(self, t_s: float, flux: Flux | None) -> None:
        """Refuse a source so near the Sun that it shines into the side lobes."""
        if flux is None or flux.name == SUN:
            return
        station, signal, frequency_hz = self.station, self._signal, self.station.frequency_hz
        tracks = station.track_of(self.target), TopocentricTrack(sun(), station.site)
        places = [
            np.array([[look.azimuth_rad, look.elevation_rad]])
            for look in (track.target_at(t_s) for track in tracks)
        ]  # fmt: skip
        if places[1][0, 1] <= 0.0:
            return
        apart_rad = float(angle_between(*places)[0])
        shines = flux_at(SUN, frequency_hz, t_s, self.sun_flux_sfu)
        adds_k = side_lobe_noise_k(shines, frequency_hz, apart_rad)
        radius = flux.radius_rad / signal.beam.half_power_beamwidth_rad
        own_k = source_noise_k(flux, frequency_hz, signal.gain_dbi)
        own_k /= DiscResponse(signal.beam).correction(radius)
        if adds_k > LARGEST_SUN * own_k:
            raise ValueError(
                f"the Sun is {math.degrees(apart_rad):.1f} deg from {flux.name}: a side lobe may "
                f"add {adds_k:.2g} K to the {own_k:.2g} K of the source, must be <= "
                f"{LARGEST_SUN * own_k:.2g} K"
            )


class ScanResult(ScanNumbers):
    """A scan with its fit, as `Station.scan` returns it; `draw` makes a picture."""

    def draw(self, path: str | Path) -> None:
        """Draw the pattern's cuts and the map of the powers into a PNG."""
        from rf_pointing.report.plan_picture import draw_scan

        draw_scan(self.samples, self.fit, str(self).splitlines()[0], Path(path))

    def keep(self, folder: Path | None, table: Path | None) -> None:
        """Print the scan, write numbers and picture into a folder, and add it to a table."""
        print(self, flush=True)
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            time = utc_text(self.t_s)[:19].replace("-", "").replace(":", "")
            place = folder / f"{id_of(self.name)}-{time}"
            place.with_suffix(".json").write_text(self.to_json(), encoding="utf-8")
            self.draw(place.with_suffix(".png"))
        if table is not None:
            self.append(table)


def simulated(
    request: ScanRequest, start_t_s: float, seed: int, bandwidth_hz: float,
    changes: Mapping[str, Mapping[str, object]] | None,
) -> ScanResult:  # fmt: skip
    """Return a scan by the whole station simulated in this process."""
    station = request.station
    taken = ScanSamples(station.controller.kinematics)
    request.require_dark(start_t_s, request.flux(start_t_s))
    one = request.window(start_t_s)
    flux_sfu = request.sun_flux_sfu or 0.0
    radio = {"signal.receiver.noise_bandwidth_hz": bandwidth_hz, "signal.sun_flux_sfu": flux_sfu}
    allowed = SUN_ALLOWED if request.target.name == SUN else {}
    over = merged({"rf_receiver": radio}, allowed, changes)
    ended = station.simulate_scan(one, request.program(one.aos_t_s), taken, seed, over)
    if ended:
        raise ValueError(f"the scan is not complete: {ended}")
    return request.result(taken)
