"""Scans of a source: what is asked for, what follows from the band, and what came of it."""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rf_pointing.api.passes import StationPass
from rf_pointing.api.target import Target
from rf_pointing.core.checks import id_of
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris.celestial import sun
from rf_pointing.ephemeris.celestial_frame import EARTH_RATE_RAD_S
from rf_pointing.ephemeris.track import TopocentricTrack
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.scan_fit import WIDTH, Samples, ScanFit, ScanFitParams, fit_scan
from rf_pointing.radiometry.sources import SUN, Flux
from rf_pointing.radiometry.y_factor import Figures, Sigma, figures, side_lobe_noise_k, source_noise_k
from rf_pointing.rf.noise import atmosphere_loss_db, system_noise_k
from rf_pointing.station.campaign.offset_table import COLUMNS, SIGMA
from rf_pointing.station.clients.scan_samples import ScanSamples
from rf_pointing.station.derive.band import Band
from rf_pointing.station.derive.signal import gain_dbi
from rf_pointing.station.radio.sky_flux import flux_at, has_flux
from rf_pointing.tracking.scan_program import ScanProgram, ScanProgramParams

if TYPE_CHECKING:
    from rf_pointing.api.station import Station

HALF_WIDTH_BEAMS, BEAM_S, BASELINE_BEAMS = 1.5, 4.0, 1.5
"""Edge of a scan and time per beamwidth, and how far the baseline is beyond the edge."""
POINT_BEAMS = 0.5
"""Distance of the points of a scan from the target: where the power has fallen by half."""
SHARE = 0.4
"""Share of the planned rates and accelerations that a scan takes unless it is told: above 66 deg of
elevation the azimuth has no more, and the controller makes the scan smaller."""
LARGEST_SUN = 0.1
"""Noise of the Sun in the side lobes, of the source's, at which a scan is refused."""
SETTLING_S = 60.0
WELL_KNOWN = 0.2
"""Sigma of an offset, in beamwidths, up to which it is one."""
SUN_ALLOWED: dict[str, dict[str, object]] = {
    "pointing_controller": {"gate.sun_radius_deg": 0.0, "machine.sun_radius_deg": 0.0},
    "antenna_servo": {"safety.gate.sun_radius_deg": 0.0},
}
"""A simulated antenna may look into the Sun: there is nothing to burn."""


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

    def flux(self, t_s: float) -> Flux | None:
        """Return the flux of the target, None for one that sends a carrier or has none."""
        name, frequency_hz = self.target.name, self.station.frequency_hz
        return flux_at(name, frequency_hz, t_s, self.sun_flux_sfu) if has_flux(name, frequency_hz, t_s) else None

    def program(self, t_s: float) -> ScanProgramParams:
        """Return the scan at a time, with what was left open derived from beam and axes."""
        flux, planned = self.flux(t_s), self.station.controller.machine.planned
        beam_rad = math.radians(self.station.beamwidth_deg)
        radius_rad = flux.radius_rad if flux else 0.0
        points = self.pattern.endswith("_point")
        wide_rad = (POINT_BEAMS if points else HALF_WIDTH_BEAMS) * beam_rad + radius_rad
        half_rad = wide_rad if self.half_width_deg is None else math.radians(self.half_width_deg)
        fastest, hardest = (SHARE * min(limits) for limits in planned)
        rate = min(beam_rad / BEAM_S, fastest) if self.rate_deg_s is None else math.radians(self.rate_deg_s)
        if self.pattern == "drift":
            look = self.station.track_of(self.target).sample([t_s])
            rate = EARTH_RATE_RAD_S * self._cosine_of_declination(look.azimuth_rad[0], look.elevation_rad[0])
        away_rad = half_rad + BASELINE_BEAMS * beam_rad if flux and self.pattern != "drift" else 0.0
        baseline = away_rad if self.baseline_deg is None else math.radians(self.baseline_deg)
        return ScanProgramParams(
            pattern=self.pattern, frame=self.frame or ("right_ascension" if self.pattern == "drift" else "cross_elevation"),
            half_width_rad=half_rad, rate_rad_s=rate, move_rate_rad_s=max(rate, min(fastest, beam_rad)),
            acceleration_rad_s2=min(hardest, beam_rad), dwell_s=self.dwell_s, lines=self.lines,
            repetitions=self.repetitions, baseline_rad=baseline,
        )  # fmt: skip

    def _cosine_of_declination(self, azimuth_rad: float, elevation_rad: float) -> float:
        latitude_rad = self.station.site.latitude_rad
        sine = math.sin(latitude_rad) * math.sin(elevation_rad)
        sine += math.cos(latitude_rad) * math.cos(elevation_rad) * math.cos(azimuth_rad)
        return math.sqrt(max(1.0 - sine**2, 0.0))

    def window(self, start_t_s: float) -> StationPass:
        """Return the time from `start_t_s` on in which the target is up for the whole scan.

        ValueError where it does not rise within a day, or not for so long.
        """
        program = self.program(start_t_s)
        lowest_rad = self.station.lowest_rad + program.half_width_rad
        up = self.station.passes(self.target, start_t_s=start_t_s, hours=24.0, mask_rad=lowest_rad)
        needed_s = ScanProgram(program).duration_s + SETTLING_S
        longest = max((one.duration_s for one in up), default=0.0)
        for one in up:
            if one.duration_s >= needed_s:
                # Again, and alone: the azimuths of a whole day are more than a turn.
                part = self.station.passes(
                    self.target, start_t_s=one.aos_t_s + 1.0, hours=needed_s / 3600.0, mask_rad=lowest_rad
                )
                return part[0]
        raise ValueError(
            f"{self.target.name} is above {math.degrees(lowest_rad):.1f} deg for {longest:.0f} s at most in the day "
            f"after {utc_text(start_t_s)}, the scan takes {needed_s:.0f} s"
        )

    def result(self, taken: ScanSamples) -> "ScanResult":
        """Return what the powers of a scan tell; ValueError names what makes them useless."""
        station, t_s = self.station, taken.t_s
        middle_s = float(np.mean(t_s))
        track, flux = station.track_of(self.target), self.flux(middle_s)
        look = track.sample(t_s) if len(taken) else None
        strength = None
        if flux is None and look is not None and not track.target.at_infinity:
            strength = (float(np.mean(look.range_m)) / look.range_m) ** 2 * 10.0 ** (0.1 * look.satellite_gain_db)
        signal = station.description.sets("rf_receiver", station.band)["signal"]
        sky = None
        if flux is not None and look is not None:
            noise_k = [
                system_noise_k(signal.noise, signal.atmosphere, np.abs(each))
                for each in (taken.elevation_rad, look.elevation_rad)
            ]
            sky = noise_k[0] / noise_k[1]
        samples = taken.samples(strength, sky)
        self.require_dark(middle_s, flux)
        known = ScanFitParams(beam=signal.beam, radius_rad=flux.radius_rad if flux else 0.0, carrier=flux is None)
        fit = fit_scan(samples, known)
        motion = track.sample([middle_s])
        angles = (
            motion.azimuth_rad, motion.elevation_rad, motion.azimuth_rate_rad_s, motion.elevation_rate_rad_s,
            motion.azimuth_acceleration_rad_s2, motion.elevation_acceleration_rad_s2,
        )  # fmt: skip
        model = [float(part[0]) for part in station.model.offset_rad(*angles)]
        azimuth_rad, elevation_rad = float(motion.azimuth_rad[0]), float(motion.elevation_rad[0])
        found = None
        if flux is not None:
            content = station.description.content
            loss_db = float(atmosphere_loss_db(signal.atmosphere, elevation_rad))
            stated_k = float(system_noise_k(signal.noise, signal.atmosphere, elevation_rad))
            found = figures(
                fit.y_factor(), flux, station.frequency_hz, signal.beam, air_loss_db=loss_db,
                gain_dbi=gain_dbi(Band(content, station.band)), system_noise_k=stated_k,
                diameter_m=content.dish.diameter_m if content.dish else None,
            )  # fmt: skip
        return ScanResult(
            request=self, t_s=middle_s, azimuth_rad=azimuth_rad, elevation_rad=elevation_rad, samples=samples, fit=fit,
            axis_offset_rad=(
                model[0] + fit.offset_rad[0] / math.cos(elevation_rad), model[1] + fit.offset_rad[1],
            ),
            flux=flux, figures=found,
        )  # fmt: skip

    def require_dark(self, t_s: float, flux: Flux | None) -> None:
        """Refuse a source beside which the Sun shines into the side lobes."""
        station = self.station
        if flux is None or flux.name == SUN:
            return
        looks = [
            track.sample([t_s]) for track in (station.track_of(self.target), TopocentricTrack(sun(), station.site))
        ]
        places = [np.column_stack([look.azimuth_rad, look.elevation_rad]) for look in looks]
        if looks[1].elevation_rad[0] <= 0.0:
            return
        apart_rad = float(angle_between(*places)[0])
        adds_k = side_lobe_noise_k(
            flux_at(SUN, station.frequency_hz, t_s, self.sun_flux_sfu), station.frequency_hz, apart_rad
        )
        beam = station.controller.machine.half_power_beamwidth_rad
        own_k = source_noise_k(flux, station.frequency_hz, gain_dbi(Band(station.description.content, station.band)))
        own_k /= DiscResponse(station.description.sets("rf_receiver", station.band)["signal"].beam).correction(
            flux.radius_rad / beam
        )
        if adds_k > LARGEST_SUN * own_k:
            raise ValueError(
                f"the Sun is {math.degrees(apart_rad):.1f} deg from {flux.name}: a side lobe may add {adds_k:.2g} K to the "
                f"{own_k:.2g} K of the source, must be <= {LARGEST_SUN * own_k:.2g} K"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanResult:
    """A scan with its fit; `print(result)` shows it, `draw` makes a picture.

    Attributes
    ----------
    t_s, azimuth_rad, elevation_rad : middle of the scan, and where the target was.
    axis_offset_rad : what added to the axes without a model holds the beam on the target.
    samples, fit : powers with the beam's offsets, and what was fitted.
    flux, figures : of a body: its flux, Y, G/T, system noise and efficiency; None for a carrier.
    """

    request: ScanRequest = field(repr=False)
    t_s: float
    azimuth_rad: float
    elevation_rad: float
    axis_offset_rad: tuple[float, float]
    samples: Samples = field(repr=False)
    fit: ScanFit = field(repr=False)
    flux: Flux | None = None
    figures: Figures | None = None

    @property
    def name(self) -> str:
        """Name of the target."""
        return self.request.target.name

    def values(self) -> dict[str, Any]:
        """Return the result as names and plain values, angles in degrees."""
        offset, sigma = np.degrees(self.fit.offset_rad).tolist(), np.degrees(self.fit.sigma_rad).tolist()
        found: dict[str, Any] = {
            "utc": utc_text(self.t_s), "target": self.name, "station": self.request.station.name,
            "band": self.request.station.band, "pattern": self.request.pattern,
            "azimuth_deg": math.degrees(self.azimuth_rad), "elevation_deg": math.degrees(self.elevation_rad),
            "cross_elevation_deg": offset[0], "cross_elevation_sigma_deg": sigma[0], "elevation_offset_deg": offset[1],
            "elevation_sigma_deg": sigma[1], "beamwidth_deg": math.degrees(self.fit.values[WIDTH]),
            "ellipticity": self.fit.ellipticity, "shape": self.fit.shape, "snr": self.fit.snr,
            "chi_squared": self.fit.chi_squared, "powers": len(self.samples.t_s), "edited": self.fit.edited,
        }  # fmt: skip
        if self.figures is not None and self.flux is not None:
            found |= {"flux_jy": self.flux.flux_w_m2_hz * 1e26, "flux_source": self.flux.source}
            for each in dataclasses.fields(Figures):
                value = getattr(self.figures, each.name)
                found |= (
                    {each.name: value.value, f"{each.name}_sigma": value.sigma}
                    if isinstance(value, Sigma)
                    else {each.name: value}
                )
        return found

    def __str__(self) -> str:
        values, fit = self.values(), self.fit
        edited = "".join(f"; edited {count} by {reason}" for reason, count in fit.edited.items())
        lines = [
            f"{self.name}, {values['utc']}, az {values['azimuth_deg'] % 360.0:.2f} el {values['elevation_deg']:.2f} deg, "
            f"{values['band']} band, {values['pattern']}",
            f"  offset {values['cross_elevation_deg']:+.4f} +- {values['cross_elevation_sigma_deg']:.4f} deg across, "
            f"{values['elevation_offset_deg']:+.4f} +- {values['elevation_sigma_deg']:.4f} deg up",
            f"  beam {values['beamwidth_deg']:.3f} deg ({fit.shape}), ellipticity {fit.ellipticity:.3f}, level "
            f"{fit.snr:.0f} sigma, chi^2 {fit.chi_squared:.2f} of {values['powers']} powers{edited}",
        ]
        if self.figures is not None and self.flux is not None:
            got = self.figures
            lines.append(
                f"  Y {got.y.value:.4f} on {values['flux_jy']:.4g} Jy +- {self.flux.relative_error:.0%} ({self.flux.source}), "
                f"size correction {got.correction:.3f}"
            )
            parts = [f"G/T {got.g_over_t_db_k.value:.2f} +- {got.g_over_t_db_k.sigma:.2f} dB/K"]
            if got.system_noise_k is not None:
                parts.append(
                    f"T_sys {got.system_noise_k.value:.0f} +- {got.system_noise_k.sigma:.0f} K (gain as stated)"
                )
            if got.efficiency is not None:
                parts.append(f"efficiency {got.efficiency.value:.2f} +- {got.efficiency.sigma:.2f} (T_sys as stated)")
            lines.append("  " + ", ".join(parts))
        return "\n".join(lines)

    def append(self, path: str | Path) -> None:
        """Append the offsets to a table that `fit_bias_model` takes, and begin it where it is new.

        ValueError for an offset that is not known on both axes.
        """
        sigma = max(self.fit.sigma_rad)
        width = math.radians(self.request.station.beamwidth_deg)
        if sigma > WELL_KNOWN * width:
            raise ValueError(
                f"{self.name}: the offset is known to {math.degrees(sigma):.3f} deg, must be <= "
                f"{math.degrees(WELL_KNOWN * width):.3f} deg for a table"
            )
        file = Path(path)
        head = "" if file.exists() else ",".join((*COLUMNS, SIGMA)) + "\n"
        azimuth, elevation = np.degrees(self.axis_offset_rad).tolist()
        # Never surer than a thousandth of a beam: play and wind have no part in the noise.
        least = math.degrees(max(sigma, 1e-3 * width))
        with file.open("a", encoding="utf-8") as table:
            table.write(f"{head}{utc_text(self.t_s)},{self.name},{azimuth:.6f},{elevation:.6f},{least:.6f}\n")

    def to_json(self) -> str:
        """Return values and samples as JSON."""
        columns = {name: column.tolist() for name, column in self.samples._asdict().items()}
        return json.dumps(self.values() | {"samples": columns}, indent=1)

    def keep(self, folder: Path | None, table: Path | None) -> None:
        """Print the scan, write numbers and picture into a folder, and add it to a table."""
        print(self, flush=True)
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            stem = f"{id_of(self.name)}-{utc_text(self.t_s)[:19].replace('-', '').replace(':', '')}"
            (folder / f"{stem}.json").write_text(self.to_json(), encoding="utf-8")
            self.draw(folder / f"{stem}.png")
        if table is not None:
            self.append(table)

    def draw(self, path: str | Path) -> None:
        """Draw the pattern's cuts and the map of the powers into a PNG."""
        from rf_pointing.report.scan_picture import draw_scan

        draw_scan(self.samples, self.fit, str(self).splitlines()[0], Path(path))


def simulated(
    request: ScanRequest, start_t_s: float, seed: int, bandwidth_hz: float,
    changes: Mapping[str, Mapping[str, object]] | None,
) -> ScanResult:  # fmt: skip
    """Return a scan by the whole station simulated in this process."""
    station, taken = request.station, ScanSamples()
    request.require_dark(start_t_s, request.flux(start_t_s))
    one = request.window(start_t_s)
    own: dict[str, dict[str, object]] = {
        "rf_receiver": {
            "signal.receiver.noise_bandwidth_hz": bandwidth_hz, "signal.sun_flux_sfu": request.sun_flux_sfu or 0.0,
        },
    }  # fmt: skip
    for node, values in [*(SUN_ALLOWED.items() if request.target.name == SUN else ()), *(changes or {}).items()]:
        own[node] = own.get(node, {}) | dict(values)
    ended = station.simulate_scan(one, request.program(one.aos_t_s), taken, seed, own)
    if ended:
        raise ValueError(f"the scan is not complete: {ended}")
    return request.result(taken)
