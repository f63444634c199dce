"""The link budget of a band as a table: noise, G/T and C/N0 over elevation, or along a pass."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rf_pointing.api.passes import StationPass
from rf_pointing.core import Array, utc_text
from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.ephemeris.celestial import CelestialTarget, moon, sun
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.rf.budget import noise_parts_k
from rf_pointing.rf.link import Link
from rf_pointing.rf.noise import air_mass, system_noise_k
from rf_pointing.station.derive.band import Band
from rf_pointing.station.derive.signal import gain_dbi

if TYPE_CHECKING:
    from rf_pointing.api.station import Station

ELEVATIONS_DEG = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0)
STEP_S = 10.0


@dataclass(frozen=True, eq=False)
class LinkBudgetTable:
    """Link budget of one band; `columns` are (n,) by their names, units at the end of each.

    `title` names station, band and satellite.  `utc` are the times along a pass; over elevation the
    satellite flies at the height that the reference range is.
    """

    title: str
    frequency_mhz: float
    gain_dbi: float
    columns: dict[str, Array] = field(repr=False)
    utc: tuple[str, ...] = ()

    @classmethod
    def of(cls, station: "Station", one: StationPass | None = None) -> "LinkBudgetTable":
        """Return the table of a station, along a pass if one is given."""
        signal = station.description.sets("rf_receiver", station.band)["signal"]
        link, band = Link(signal.link, signal.atmosphere, signal.noise), Band(station.description.content, station.band)
        if one is None:
            elevation, height_m = np.radians(ELEVATIONS_DEG), link.params.reference_range_m
            range_m, times = height_m * air_mass(elevation, height_m), np.zeros(0)
            gain_db = np.zeros_like(elevation)
            apart = [np.full_like(elevation, math.inf)] * 2
        else:
            times = np.arange(one.aos_t_s, one.los_t_s, STEP_S)
            look = station.track_of(one.target).sample(times)
            elevation, range_m, gain_db = look.elevation_rad, look.range_m, look.satellite_gain_db
            apart = [_distance(station, body, times, look.azimuth_rad, elevation) for body in (sun(), moon())]
        gain, frequency_hz = gain_dbi(band), 1e6 * band.section.frequency_mhz
        parts = noise_parts_k(link, signal.beam, gain, frequency_hz, elevation, *apart)
        # The receiver's level, less what Sun and Moon cost.
        clear_k = system_noise_k(link.noise, link.atmosphere, elevation)
        level = link.carrier_to_noise_db_hz(range_m, elevation) + gain_db - 10.0 * np.log10(parts["system"] / clear_k)
        return cls(
            f"{station.name}, {station.band} band, {'over elevation' if one is None else one.name}",
            1e-6 * frequency_hz,
            gain,
            {
                "elevation_deg": np.degrees(elevation), "range_km": 1e-3 * range_m,
                **{f"{name}_k": column for name, column in parts.items()},
                "g_over_t_db_k": gain - 10.0 * np.log10(parts["system"]), "carrier_to_noise_db_hz": level,
            },
            tuple(map(utc_text, times.tolist())),
        )  # fmt: skip

    def to_json(self) -> str:
        """Return numbers and columns as JSON."""
        head = {"title": self.title, "frequency_mhz": self.frequency_mhz, "gain_dbi": self.gain_dbi, "utc": self.utc}
        return json.dumps(head | {name: np.round(each, 4).tolist() for name, each in self.columns.items()}, indent=1)

    def draw(self, path: str | Path) -> None:
        """Draw noise, G/T and C/N0 into a PNG."""
        from rf_pointing.report.plan_picture import draw_budget

        draw_budget(self.columns, STEP_S / 60.0 * np.arange(float(len(self.utc))), self.title, Path(path))

    def __str__(self) -> str:
        # Sun and Moon are shown where they are in the beam.
        shown = {
            name: each for name, each in self.columns.items() if name not in ("sun_k", "moon_k") or each.max() > 0.05
        }
        units = {"carrier_to_noise_db_hz": "C/N0", "g_over_t_db_k": "G/T"}
        heads = ["utc"] * bool(self.utc) + [units.get(name, name.rpartition("_")[0]) for name in shown]
        rows = [[f"{value:.1f}" for value in row] for row in np.column_stack(list(shown.values())).tolist()]
        cells = [[time[11:19], *row] for time, row in zip(self.utc, rows, strict=True)] if self.utc else rows
        head = f"{self.title}: {self.frequency_mhz:g} MHz, gain {self.gain_dbi:.1f} dBi (deg, km, K, dB/K, dB-Hz)"
        return "\n".join([head, *("".join(f"{cell:>10}" for cell in row) for row in (heads, *cells))])


def _distance(station: "Station", body: CelestialTarget, times: Array, azimuth: Array, elevation: Array) -> Array:
    look = TopocentricTrack(body, station.site).sample(times)
    apart = angle_between(
        np.column_stack([azimuth, elevation]), np.column_stack([look.azimuth_rad, look.elevation_rad])
    )
    # One below the horizon is behind the Earth.
    return np.where(look.elevation_rad > 0.0, apart, math.inf)
