"""The 36 sectors of the sky that a campaign must fill (SATCAL 3): 12 in azimuth, 3 in elevation.

Below 10 deg refraction is uncertain, above 80 deg two terms grow without bound (tan El, sec El).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, BoolArray, IntArray, Params, parameter


@dataclass(frozen=True, kw_only=True)
class SectorRule(Params):
    """How the sky is cut and how many observations each sector gets."""

    azimuth_sectors: int = parameter(12, "sectors around the horizon", 1, 360)
    elevation_edges_rad: tuple[float, ...] = parameter(
        (math.radians(10.0), math.radians(30.0), math.radians(60.0), math.radians(80.0)),
        "edges of the elevation bands", 0.0, math.pi / 2.0,
    )  # fmt: skip
    fewest: int = parameter(25, "observations a sector must have", 1, 10_000)
    most: int = parameter(30, "observations a sector may have", 1, 10_000)

    ordered = ("fewest <= most",)

    def check_together(self) -> None:
        """Refuse bands that do not rise."""
        if any(
            high <= low
            for low, high in zip(
                self.elevation_edges_rad, self.elevation_edges_rad[1:], strict=False
            )
        ):
            raise ValueError(f"elevation_edges_rad={self.elevation_edges_rad} must increase")

    @property
    def count(self) -> int:
        """Return the number of sectors."""
        return self.azimuth_sectors * (len(self.elevation_edges_rad) - 1)

    def sector_of(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> IntArray:
        """Return the sector (0 .. count - 1, band by band) of each direction, -1 outside.

        Axis angles beyond 90 deg count where they point on the sky.
        """
        width = 2.0 * np.pi / self.azimuth_sectors
        azimuth, elevation = on_the_sky(azimuth_rad, elevation_rad)
        column = np.floor(np.mod(azimuth, 2.0 * np.pi) / width).astype(np.int64)
        edges = np.array(self.elevation_edges_rad)
        band = np.searchsorted(edges, elevation, side="right") - 1
        # An azimuth a rounding below 2 pi would be in the sector after the last one.
        inside = (band >= 0) & (band < len(edges) - 1)
        return np.where(
            inside, band * self.azimuth_sectors + np.minimum(column, self.azimuth_sectors - 1), -1
        )

    def name(self, sector: int) -> str:
        """Return the bounds of a sector in words."""
        band, column = divmod(sector, self.azimuth_sectors)
        width = 360.0 / self.azimuth_sectors
        low, high = (math.degrees(edge) for edge in self.elevation_edges_rad[band : band + 2])
        return f"az {column * width:.0f}-{(column + 1) * width:.0f} el {low:.0f}-{high:.0f} deg"

    def coverage(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> "Coverage":
        """Return how many directions fall into each sector."""
        sectors = self.sector_of(azimuth_rad, elevation_rad)
        return Coverage(self, np.bincount(sectors[sectors >= 0], minlength=self.count))


def on_the_sky(azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> tuple[Array, Array]:
    """Return the direction (n,) of axis angles (n,): of a dish over the top on the other side."""
    azimuth = np.asarray(azimuth_rad, dtype=np.float64)
    elevation = np.asarray(elevation_rad, dtype=np.float64)
    over = elevation > 0.5 * np.pi
    return np.where(over, azimuth + np.pi, azimuth), np.where(over, np.pi - elevation, elevation)


@dataclass(frozen=True, eq=False)
class Coverage:
    """Observations per sector: `counts` (count,)."""

    rule: SectorRule
    counts: IntArray

    @property
    def thin(self) -> tuple[int, ...]:
        """Return the sectors with fewer observations than the rule wants."""
        return tuple(np.flatnonzero(self.counts < self.rule.fewest).tolist())

    def require_full(self) -> None:
        """Raise ValueError naming the sectors that are not filled."""
        if self.thin:
            worst = "; ".join(
                f"{self.rule.name(sector)} has {self.counts[sector]}" for sector in self.thin[:4]
            )
            more = f" and {len(self.thin) - 4} more" if len(self.thin) > 4 else ""
            raise ValueError(
                f"{len(self.thin)} of {self.rule.count} sectors have < {self.rule.fewest}: {worst}{more}"
            )


def select_by_sector(
    azimuth_rad: Array, elevation_rad: Array, pass_id: IntArray, rule: SectorRule
) -> tuple[BoolArray, dict[str, int]]:
    """Return which rows to take (n,) and how many are dropped for which reason.

    At most `rule.most` per sector, spread evenly over and within its passes.
    """
    sectors = rule.sector_of(azimuth_rad, elevation_rad)
    # Else the sectors at the horizon, full of points, would outvote the others.
    chosen = np.zeros(len(sectors), dtype=bool)
    for sector in range(rule.count):
        rows = np.flatnonzero(sectors == sector)
        chosen[_shared_out(rows, pass_id[rows], rule.most)] = True
    low = int(np.sum(on_the_sky(azimuth_rad, elevation_rad)[1] < rule.elevation_edges_rad[0]))
    outside = int(np.sum(sectors < 0))
    dropped = {
        f"below {math.degrees(rule.elevation_edges_rad[0]):.0f} deg": low,
        f"above {math.degrees(rule.elevation_edges_rad[-1]):.0f} deg": outside - low,
        f"sector has {rule.most} already": int(np.sum(sectors >= 0)) - int(np.sum(chosen)),
    }
    return chosen, dropped


def _shared_out(rows: IntArray, pass_id: IntArray, most: int) -> IntArray:
    """Return up to `most` rows, one from each pass in turn, spread within the pass."""
    if len(rows) <= most:
        return rows
    # The orbit error of a pass does not average out: thirty points of one pass count as few.
    ranked = []
    for number in np.unique(pass_id):
        own = rows[pass_id == number]
        order = np.argsort(_spread_rank(len(own)), kind="stable")
        ranked += [(turn, int(row)) for turn, row in enumerate(own[order])]
    return np.array([row for _, row in sorted(ranked)[:most]], dtype=np.int64)


def _spread_rank(count: int) -> IntArray:
    """Return ranks 0 .. count - 1 of which the first lie spread over the range (bit-reversed)."""
    # Bit reversal halves the gaps again and again: any number of first ranks is spread evenly.
    bits = max(1, (count - 1).bit_length())
    reversed_bits = [int(format(k, f"0{bits}b")[::-1], 2) for k in range(count)]
    return np.argsort(np.argsort(reversed_bits, kind="stable"), kind="stable")
