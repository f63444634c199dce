"""Numbers of one scan, as they are printed, kept as JSON and handed to the fit of a bias model."""

import dataclasses
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core.dates import utc_text
from rf_pointing.core.signals import AXES
from rf_pointing.radiometry.scan_fit import WIDTH, Samples, ScanFit
from rf_pointing.radiometry.sources import Flux
from rf_pointing.radiometry.y_factor import Figures, Sigma
from rf_pointing.station.campaign.offset_table import columns_of

# Sigma of an offset, in beamwidths, up to which a table takes it.
WELL_KNOWN = 0.2
# Least sigma in a table, in beamwidths: play and gusts are not in the noise of the power.
SUREST = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanNumbers:
    """A scan with its fit; `print(result)` shows it.

    Attributes
    ----------
    t_s, azimuth_rad, elevation_rad : middle of the scan, and where the target was.
    axis_offset_rad : what added to `axes` without a model holds the beam on the target.
    samples, fit : powers with the beam's offsets, and what was fitted.
    flux, figures : of a body: its flux, Y, G/T, system noise and efficiency; None for a carrier.
    """

    name: str
    station: str
    band: str
    pattern: str
    beamwidth_rad: float
    t_s: float
    azimuth_rad: float
    elevation_rad: float
    axis_offset_rad: tuple[float, float]
    samples: Samples = field(repr=False)
    fit: ScanFit = field(repr=False)
    axes: tuple[str, str] = AXES
    flux: Flux | None = None
    figures: Figures | None = None

    def values(self) -> dict[str, Any]:
        """Return the result as names and plain values, angles in degrees."""
        fit = self.fit
        offset, sigma = np.degrees([fit.offset_rad, fit.sigma_rad]).tolist()
        found: dict[str, Any] = {
            "utc": utc_text(self.t_s), "target": self.name, "station": self.station,
            "band": self.band, "pattern": self.pattern,
            "azimuth_deg": math.degrees(self.azimuth_rad) % 360.0,
            "elevation_deg": math.degrees(self.elevation_rad), "cross_elevation_deg": offset[0],
            "cross_elevation_sigma_deg": sigma[0], "elevation_offset_deg": offset[1],
            "elevation_sigma_deg": sigma[1], "beamwidth_deg": math.degrees(fit.values[WIDTH]),
            "ellipticity": fit.ellipticity, "shape": fit.shape, "snr": fit.snr,
            "chi_squared": fit.chi_squared, "powers": len(self.samples.t_s), "edited": fit.edited,
        }  # fmt: skip
        if self.figures is not None and self.flux is not None:
            found |= {"flux_jy": self.flux.flux_w_m2_hz * 1e26, "flux_source": self.flux.source}
            for each in dataclasses.fields(Figures):
                value = getattr(self.figures, each.name)
                both = isinstance(value, Sigma)
                found[each.name] = value.value if both else value
                found |= {f"{each.name}_sigma": value.sigma} if both else {}
        return found

    def __str__(self) -> str:
        values, fit, flux, got = self.values(), self.fit, self.flux, self.figures
        edited = "".join(f"; edited {count} by {reason}" for reason, count in fit.edited.items())
        lines = [
            "{target}, {utc}, az {azimuth_deg:.2f} el {elevation_deg:.2f} deg, "
            "{band} band, {pattern}",
            "  offset {cross_elevation_deg:+.4f} +- {cross_elevation_sigma_deg:.4f} deg across, "
            "{elevation_offset_deg:+.4f} +- {elevation_sigma_deg:.4f} deg up",
            "  beam {beamwidth_deg:.3f} deg ({shape}), ellipticity {ellipticity:.3f}, "
            "level {snr:.0f} sigma, chi^2 {chi_squared:.2f} of {powers} powers" + edited,
        ]
        if got is not None and flux is not None:
            lines.append(
                "  Y {y:.4f} on {flux_jy:.4g} Jy "
                f"+- {flux.relative_error:.0%} ({flux.source}), size correction {{correction:.3f}}"
            )
            parts = ["  G/T {g_over_t_db_k:.2f} +- {g_over_t_db_k_sigma:.2f} dB/K"]
            if got.system_noise_k is not None:
                noise = "T_sys {system_noise_k:.0f} +- {system_noise_k_sigma:.0f} K"
                parts.append(f"{noise} (gain as stated)")
            if got.efficiency is not None:
                share = "efficiency {efficiency:.2f} +- {efficiency_sigma:.2f}"
                parts.append(f"{share} (T_sys as stated)")
            lines.append(", ".join(parts))
        return "\n".join(lines).format(**values)

    def append(self, path: str | Path) -> None:
        """Append the offsets to a table that `fit_bias_model` takes, and begin it where it is new.

        ValueError for an offset that is not known on both axes.
        """
        sigma, most = max(self.fit.sigma_rad), WELL_KNOWN * self.beamwidth_rad
        if sigma > most:
            raise ValueError(
                f"{self.name}: the offset is known to {math.degrees(sigma):.3f} deg, must be <= "
                f"{math.degrees(most):.3f} deg for a table"
            )
        file, head = Path(path), ",".join(columns_of(self.axes))
        numbers = np.degrees([*self.axis_offset_rad, max(sigma, SUREST * self.beamwidth_rad)])
        row = ",".join([utc_text(self.t_s), self.name, *(f"{each:.6f}" for each in numbers)])
        text = f"{row}\n" if file.exists() else f"{head}\n{row}\n"
        with file.open("a", encoding="utf-8") as table:
            table.write(text)

    def to_json(self) -> str:
        """Return values and samples as JSON."""
        columns = {name: column.tolist() for name, column in self.samples._asdict().items()}
        return json.dumps(self.values() | {"samples": columns}, indent=1)
