"""Which passes, or pieces of them, a campaign can track: from elements, or a sky full of beacons.

Real catalogues give a few passes an hour, so a campaign lasts days.  `beacons` are the elements of
a made-up constellation dense enough to fill the 36 sectors in about an hour: fast ones at 600 km
for the lags, slow ones at 3000 km.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.calibration import CandidatePass, ReferenceTrack
from rf_pointing.calibration.reference import COLUMNS
from rf_pointing.core import LEVEL, MDEG, Kinematics, Pair, Params, RadioRefraction, parameter
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.ephemeris import Elements, Pass, Site, TargetSource, TopocentricTrack, find_passes

# The pass is followed from lower than its points: the search needs time before the first one.
LEAST_MASK_RAD = math.radians(1.0)
# Orbits lead so far beyond a station that it sees beacons at 600 km towards the pole as well.
LEAST_INCLINATION_RAD, BEYOND_RAD = math.radians(50.0), math.radians(14.5)


@dataclass(frozen=True, kw_only=True)
class ArcRules(Params):
    """How passes are cut into candidates."""

    arcs_s: tuple[float, ...] = parameter((), "lengths of candidates; none: whole passes", 1.0, 1e5)
    every_s: float = parameter(20.0, "time between the starts of two candidates of a pass", 1.0, 3600.0)
    spacing_s: float = parameter(1.0, "time between two points", 0.1, 600.0)
    lowest_rad: float = parameter(math.radians(10.0), "lowest elevation of a candidate", 0.0, 1.5)
    highest_rad: float = parameter(math.radians(89.0), "highest elevation of a candidate", 0.1, 1.5707)
    sigma_rad: float = parameter(2.0 * MDEG, "standard deviation of one point on the sky", 1e-7, 0.1)
    fastest_rad_s: float = parameter(
        math.radians(1.5), "pieces with a higher azimuth rate are left out: the antenna would not follow", 1e-5, 10.0
    )
    travel_rad: tuple[float, ...] = parameter(
        (), "ends of the lower and of the upper axis, outside of which pieces are left out; none: unlimited",
        -20.0, 20.0,
    )  # fmt: skip
    lead_s: float = parameter(0.0, "time before the first point, in which the azimuth rate counts too", 0.0, 600.0)


def candidate_arcs(
    targets: Sequence[Elements | TargetSource], site: Site, start_t_s: float, duration_s: float, rules: ArcRules,
    mount: Kinematics = LEVEL,
) -> tuple[list[CandidatePass], list[str]]:  # fmt: skip
    """Return every candidate, named after its satellite, and the reasons of what is left out."""
    found: list[CandidatePass] = []
    left_out: list[str] = []
    # One for all: its coefficients cost more than the track of a satellite.
    air = RadioRefraction.standard(site.altitude_m)
    for one in targets:
        try:
            found += _arcs_of(TopocentricTrack(one, site, refraction=air), start_t_s, duration_s, rules, mount)
        except ValueError as reason:
            left_out.append(str(reason))
    return found, left_out


def _arcs_of(
    track: TopocentricTrack, start_t_s: float, duration_s: float, rules: ArcRules, mount: Kinematics
) -> list[CandidatePass]:
    found: list[CandidatePass] = []
    for begin, end in _visible(track, start_t_s, duration_s, rules):
        look = track.sample(np.arange(begin - rules.lead_s, end + 0.5 * rules.spacing_s, rules.spacing_s))
        whole = ReferenceTrack.of(look).on(mount)
        # What the antenna cannot follow, and what it cannot reach.
        missed = np.abs(whole.azimuth_rate_rad_s) > rules.fastest_rad_s
        for angle, low, high in zip(whole.motion(), rules.travel_rad[::2], rules.travel_rad[1::2], strict=False):
            missed |= (angle < low) | (angle > high)
        fast_s = whole.t_s[missed]
        found += [
            _candidate(track.name, whole, a, b, rules)
            for a, b in _cut(begin, end, rules)
            if not rules.arcs_s or not np.any((fast_s >= a - rules.lead_s) & (fast_s <= b))
        ]
    return found


def window_of(candidate: CandidatePass, elements: Elements, site: Site, acquisition_s: float) -> Pass:
    """Return the pass to track for a candidate, from `acquisition_s` before its first point."""
    begin = candidate.start_t_s - acquisition_s
    track = TopocentricTrack(elements, site)
    found = find_passes(track, begin, candidate.end_t_s - begin, LEAST_MASK_RAD)
    if not found:
        raise ValueError(f"{candidate.name} is below the horizon from {begin:.0f} s on")
    return found[0]


def beacons(epoch_t_s: float, latitude_rad: float = 0.0) -> list[Elements]:
    """Return 225 satellites at 600 km and 225 at 3000 km for a latitude, BEACON 001 onwards."""
    count, turn = 15, 2.0 * math.pi
    inclination_rad = max(LEAST_INCLINATION_RAD, min(abs(latitude_rad) + BEYOND_RAD, 0.5 * math.pi))
    # Planes are staggered by a third of the spacing, or all would cross a latitude together.
    orbits = [
        (height_m, turn * plane / count, turn * ((place + plane / 3.0) / count % 1.0))
        for height_m in (6.0e5, 3.0e6)
        for plane in range(count)
        for place in range(count)
    ]
    return [
        Elements(
            name=f"BEACON {number:03d}", catalogue_number=90000 + number, epoch_t_s=epoch_t_s,
            inclination_rad=inclination_rad, ascending_node_rad=node, eccentricity=0.001,
            argument_of_perigee_rad=0.0, mean_anomaly_rad=anomaly,
            mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / (EARTH_RADIUS_M + height_m) ** 3),
            drag_per_earth_radius=0.0, international_designator="06001A",
        )
        for number, (height_m, node, anomaly) in enumerate(orbits, start=1)
    ]  # fmt: skip


def _visible(track: TopocentricTrack, start_t_s: float, duration_s: float, rules: ArcRules) -> list[Pair]:
    """Return the stretches above the lowest elevation, without what is above the highest."""
    step_s = min(rules.every_s, 30.0)
    t_s = start_t_s + step_s * np.arange(int(duration_s / step_s) + 1, dtype=np.float64)
    elevation = track.sample(t_s).elevation_rad
    inside = (elevation >= rules.lowest_rad) & (elevation <= rules.highest_rad)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    return [(float(t_s[a]), float(t_s[b - 1])) for a, b in edges.reshape(-1, 2) if b - 1 > a]


def _cut(begin: float, end: float, rules: ArcRules) -> list[Pair]:
    if not rules.arcs_s:
        return [(begin, end)]
    starts = np.arange(begin, end, rules.every_s).tolist()
    return [(start, start + arc_s) for arc_s in rules.arcs_s for start in starts if start + arc_s <= end]


def _candidate(name: str, whole: ReferenceTrack, begin: float, end: float, rules: ArcRules) -> CandidatePass:
    rows = (whole.t_s >= begin - 1e-3) & (whole.t_s <= end + 1e-3)
    part = replace(whole, **{name: getattr(whole, name)[rows] for name in COLUMNS})
    return CandidatePass(name=name, track=part, sigma_rad=rules.sigma_rad)
