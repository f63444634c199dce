"""The link budget of a band as a table: noise, G/T and C/N0 over elevation, or along a pass."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rf_pointing.api.passes import StationPass
from rf_pointing.core.dates import utc_text
from rf_pointing.core.types import Array
from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.ephemeris.celestial import moon, sun
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.rf.budget import LinkBudget
from rf_pointing.rf.link import Link
from rf_pointing.rf.noise import air_mass
from rf_pointing.station.antenna.receiver import SignalParams
from rf_pointing.station.derive.band import Band
from rf_pointing.station.derive.signal import gain_dbi

if TYPE_CHECKING:
    from rf_pointing.api.station import Station

ELEVATIONS_DEG = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0)
PARTS = ("cosmic", "air", "ground", "dichroic", "chain", "sun", "moon", "system")


@dataclass(frozen=True, eq=False)
class LinkBudgetTable:
    """Link budget of one band; `columns` are (n,) by their names, units at the end of each.

    `name` is that of the satellite, "" for a table over elevation, whose satellite flies at the
    height that the station's reference range is.  `utc` are the times along a pass.
    """

    station: str
    band: str
    name: str
    numbers: dict[str, float]
    columns: dict[str, Array] = field(repr=False)
    minutes: Array = field(repr=False)
    """After the rise of the pass; empty without one."""
    utc: tuple[str, ...] = ()

    @classmethod
    def of(cls, station: "Station", one: StationPass | None = None, step_s: float = 10.0) -> "LinkBudgetTable":
        """Return the table of a station, along a pass if one is given."""
        budget = budget_of(station)
        if one is None:
            elevation = np.radians(ELEVATIONS_DEG)
            height_m = budget.link.params.reference_range_m
            range_m = height_m * air_mass(elevation, height_m)
            columns, times, extra_db = budget.parts_k(elevation), np.zeros(0), 0.0 * range_m
        else:
            times = np.arange(one.aos_t_s, one.los_t_s, step_s)
            look = station.track_of(one.target).sample(times)
            elevation, range_m, extra_db = look.elevation_rad, look.range_m, look.satellite_gain_db
            target = np.column_stack([look.azimuth_rad, elevation])
            apart = {name: _distance(station, body, times, target) for name, body in (("sun", sun()), ("moon", moon()))}
            columns = budget.parts_k(elevation, apart["sun"], apart["moon"])
        level = budget.carrier_to_noise_db_hz(range_m, elevation, columns["system"]) + extra_db
        return cls(
            station=station.name,
            band=station.band,
            name="" if one is None else one.name,
            numbers={
                "frequency_mhz": 1e-6 * budget.frequency_hz,
                "half_power_beamwidth_deg": station.beamwidth_deg,
                "gain_dbi": budget.gain_dbi,
                "satellite_eirp_dbw": budget.eirp_dbw,
            },
            columns={
                "elevation_deg": np.degrees(elevation),
                "range_km": 1e-3 * range_m,
                **{f"{name}_k": columns[name] for name in PARTS},
                "g_over_t_db_k": budget.figure_of_merit_db_k(columns["system"]),
                "carrier_to_noise_db_hz": level,
            },
            minutes=(times - times[:1]) / 60.0,
            utc=tuple(map(utc_text, times.tolist())),
        )

    def to_json(self) -> str:
        """Return numbers and columns as JSON."""
        columns = {name: np.round(column, 4).tolist() for name, column in self.columns.items()}
        head = {"station": self.station, "band": self.band, "satellite": self.name, **self.numbers}
        return json.dumps(head | ({"utc": list(self.utc)} if self.utc else {}) | columns, indent=1)

    def draw(self, path: str | Path) -> None:
        """Draw noise, G/T and C/N0 into a PNG."""
        from rf_pointing.report.budget_picture import draw_budget

        title = f"{self.station}, {self.band} band, {self.name or 'over elevation'}"
        draw_budget(self.columns, self.minutes, title, Path(path))

    def __str__(self) -> str:
        numbers = self.numbers
        shown = {name: column for name, column in self.columns.items() if name != "moon_k" or column.any()}
        shown = {name: column for name, column in shown.items() if name != "sun_k" or column.any()}
        heads = [name.rpartition("_")[0].replace("carrier_to_noise_db", "C/N0").replace("g_over_t_db", "G/T")
                 for name in shown]  # fmt: skip
        rows = [[f"{value:.1f}" for value in row] for row in np.column_stack(list(shown.values())).tolist()]
        times = [[each[11:19]] for each in self.utc] or [[] for _ in rows]
        table = [["utc", *heads] if self.utc else heads] + [a + b for a, b in zip(times, rows, strict=True)]
        return "\n".join([
            f"{self.station}, {self.band} band: {numbers['frequency_mhz']:g} MHz, "
            f"beam {numbers['half_power_beamwidth_deg']:.3g} deg, gain {numbers['gain_dbi']:.1f} dBi, "
            f"satellite {self.name or 'at the reference height'} {numbers['satellite_eirp_dbw']:.1f} dBW",
            "deg, km, K, dB/K, dB-Hz",
            *("".join(f"{cell:>10}" for cell in row) for row in table),
        ])  # fmt: skip


def budget_of(station: "Station") -> LinkBudget:
    """Return the budget by the parameters of the simulated receiver of the station's band."""
    description, band = station.description, station.band
    signal: SignalParams = description.sets("rf_receiver", band)["signal"]
    numbers = Band(description.content, band)
    return LinkBudget(
        frequency_hz=1e6 * numbers.section.frequency_mhz,
        gain_dbi=gain_dbi(numbers),
        link=Link(signal.link, signal.atmosphere, signal.noise),
        beam=signal.beam,
    )


def _distance(station: "Station", body: object, times: Array, target: Array) -> Array:
    look = TopocentricTrack(body, station.site).sample(times)  # type: ignore[arg-type]
    apart = angle_between(target, np.column_stack([look.azimuth_rad, look.elevation_rad]))
    # One below the horizon is behind the Earth.
    return np.where(look.elevation_rad > 0.0, apart, math.pi)
