"""How well a network could know an orbit: `orbit_covariance`, before anything is built."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rf_pointing.api.keywords import time_s
from rf_pointing.api.station import Station
from rf_pointing.api.target import MAX_AGE_S, Target
from rf_pointing.core import MDEG, Array, to_utc_text
from rf_pointing.ephemeris import Elements, ElementUncertainty, Site
from rf_pointing.orbit.determination import rtn_axes
from rf_pointing.orbit.measurements import measured_from
from rf_pointing.orbit.passes import forces_of, motion_of_site, prior_of
from rf_pointing.orbit.study import Considered, Knowledge, Tracking, known_orbit

Place = Station | tuple[str, float, float]
"""A station, or the name, latitude and longitude (deg) of a place without one."""
UNITS = {
    "angle_mdeg": ("angle_sigma_rad", MDEG), "angle_bias_mdeg": ("angle_bias_rad", MDEG),
    "range_m": ("range_sigma_m", 1.0), "range_bias_m": ("range_bias_m", 1.0),
    "rate_m_s": ("rate_sigma_m_s", 1.0), "rate_bias_m_s": ("rate_bias_m_s", 1.0),
    "memory_h": ("memory_s", 3600.0),
    "satellite_clock_m": ("satellite_clock_m", 1.0), "zenith_delay_m": ("zenith_delay_m", 1.0),
    "step_s": ("step_s", 1.0), "lowest_deg": ("lowest_rad", math.radians(1.0)),
}  # fmt: skip
"""Words of `tracking`, the parameter that each is, and its unit."""


@dataclass(frozen=True, eq=False)
class OrbitCovariance:
    """Covariance of an orbit along its time; `print` shows it hour by hour."""

    title: str
    site: str
    tracked_until_t_s: float
    known: Knowledge = field(repr=False)
    rtn_m: Array = field(repr=False)
    """Radial, along-track and cross-track sigma (n, 3)."""
    sky_mdeg: Array = field(repr=False)
    """Cross-elevation and elevation sigma (n, 2) as seen from the site."""
    elevation_deg: Array = field(repr=False)

    @property
    def looks(self) -> list[dict[str, float | str]]:
        """When the site sees the satellite after the tracking, where it is known worst there."""
        seen = (self.known.t_s > self.tracked_until_t_s) & (self.elevation_deg > 5.0)
        rows = np.flatnonzero(seen)
        if not len(rows):
            return []
        parts = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        return [
            {
                "utc": to_utc_text(float(self.known.t_s[part[0]]))[:19],
                "hours_after": float(self.known.t_s[part[0]] - self.tracked_until_t_s) / 3600.0,
                "worst_mdeg": float(np.max(np.linalg.norm(self.sky_mdeg[part], axis=1))),
            }
            for part in parts
        ]

    def to_json(self) -> str:
        """Return everything as JSON; times are s since 1970."""
        known = self.known
        columns = {
            "t_s": known.t_s, "sigma_m": known.sigma_m(), "formal_m": known.sigma_m(known.formal),
            "radial_m": self.rtn_m[:, 0], "along_m": self.rtn_m[:, 1], "cross_m": self.rtn_m[:, 2],
            "cross_elevation_mdeg": self.sky_mdeg[:, 0], "elevation_mdeg": self.sky_mdeg[:, 1],
            "elevation_deg": self.elevation_deg,
        }  # fmt: skip
        return json.dumps({
            "title": self.title, "site": self.site, "tracked_until_t_s": self.tracked_until_t_s,
            "considered_m": {name: known.sigma_m(part).tolist() for name,
            part in known.parts.items()},
            "tracked": dict(zip(known.names, known.tracked.astype(int).tolist(), strict=True)),
            "looks": self.looks, **{name: values.tolist() for name, values in columns.items()},
        })  # fmt: skip

    def draw(self, path: str | Path) -> None:
        """Draw the sigmas over time, and what each station tracks, into a PNG."""
        from rf_pointing.report.plan_picture import draw_covariance

        draw_covariance(self.known, self.rtn_m, self.tracked_until_t_s, self.title, Path(path))

    def __str__(self) -> str:
        known, lines = self.known, [self.title]
        for name, share in zip(known.names, np.mean(known.tracked, axis=1), strict=True):
            lines.append(f"  {name} measures in {100.0 * share:.1f} % of the time")
        hours = (known.t_s - known.t_s[0]) / 3600.0
        for hour in np.unique(np.concatenate([np.linspace(0.0, hours[-1], 9)])):
            row = int(np.argmin(np.abs(hours - hour)))
            radial, along, cross = self.rtn_m[row]
            lines.append(
                f"  {hours[row]:6.1f} h: radial {radial:.1f}, along {along:.1f}, cross "
                f"{cross:.1f} m "
                f"(noise alone {known.sigma_m(known.formal)[row]:.1f} m in all)"
            )
        worst = {name: float(np.max(known.sigma_m(part))) for name, part in known.parts.items()}
        lines.append("  considered, at most: " + ", ".join(f"{name} {size:.1f} m" for name,
            size in worst.items()))  # fmt: skip
        lines += [
            f"  seen from {self.site} {one['utc']}, {one['hours_after']:.1f} h after: known to "
            f"{one['worst_mdeg']:.1f} mdeg"
            for one in self.looks[:10]
        ]
        return "\n".join(lines)


def tracking_of(words: Mapping[str, float]) -> Tracking:
    """Return the tracking that words in the units of people say; ValueError for an unknown one."""
    unknown = sorted(set(words) - set(UNITS))
    if unknown:
        raise ValueError(f"tracking={', '.join(unknown)} must be of {', '.join(UNITS)}")
    return Tracking(**{UNITS[name][0]: value * UNITS[name][1] for name, value in words.items()})


def orbit_covariance(
    target: Target,
    stations: Sequence[Place],
    tracking: Mapping[str, float],
    *,
    start: str | None = None,
    start_t_s: float | None = None,
    hours: float = 24.0,
    predict_hours: float = 24.0,
    considered: Considered | None = None,
) -> OrbitCovariance:
    """Return how well a network would know an orbit, without any data.

    Parameters
    ----------
    target : the satellite by its elements.
    stations : `Station`, or (name, latitude, longitude in deg); the first one looks at it again.
    tracking : what each measures, as {"angle_mdeg": 3.0, "range_m": 10.0}: noise, biases
        (angle_bias_mdeg, range_bias_m, rate_bias_m_s) with their memory_h, step_s, lowest_deg.
    start, start_t_s : begin of the tracking; by default the epoch of the elements.
    hours, predict_hours : length of the tracking, and of the prediction after it.
    considered : errors of the Earth, the stations and their clocks that are not estimated.

    Raises
    ------
    ValueError
        Tracking that measures nothing, no station that sees the satellite, or an orbit that is not
        determined.

    Examples
    --------
    >>> rp.orbit_covariance(rp.elements("CBERS 2"), [rp.Station("leo_3m7")], {"angle_mdeg": 3.0})
    """
    elements = target.found
    if not isinstance(elements, Elements):
        raise ValueError(f"{target.name} is not tracked from mean elements")
    if not (hours > 0.0 and predict_hours >= 0.0 and stations):
        given = f"hours={hours}, predict_hours={predict_hours}, stations={len(stations)}"
        raise ValueError(f"{given} must be > 0, >= 0 and >= 1")
    does = tracking_of(tracking)
    begin_s = time_s("start", start, start_t_s) or elements.epoch_t_s
    t_s = begin_s + np.arange(0.0, 3600.0 * (hours + predict_hours) + 0.5 * does.step_s,
        does.step_s)  # fmt: skip
    prior = prior_of(elements, begin_s, ElementUncertainty(), MAX_AGE_S)
    motions = {}
    for one in stations:
        if isinstance(one, Station):
            name, site = one.name, one.site
        else:
            name, site = one[0], Site.from_degrees(one[1], one[2], 0.0)
        if name in motions:
            raise ValueError(f"stations: {name!r} is given twice")
        motions[name] = motion_of_site(site, t_s)
    known = known_orbit(
        begin_s, prior.states[0], motions, t_s, does, forces=forces_of(elements, prior.states[0]),
        considered=considered, until_t_s=begin_s + 3600.0 * hours,
    )  # fmt: skip
    axes, (site_name, motion) = rtn_axes(known.states), next(iter(motions.items()))
    # The picture and the text show positions, not velocities.
    turned = axes @ known.total[:, :3, :3] @ np.swapaxes(axes, 1, 2)
    title = f"{target.name} tracked by {', '.join(motions)} for {hours:g} h"
    return OrbitCovariance(
        f"{title} from {to_utc_text(begin_s)[:19]}", site_name,
        begin_s + 3600.0 * hours, known, np.sqrt(np.diagonal(turned, axis1=1, axis2=2)),
        known.on_sky(motion) / MDEG,
        np.degrees(measured_from(known.states, motion)[:, 1]),
    )  # fmt: skip
