"""Paths of slews among random hills and Suns, against two checks that share no code with the finder.

    scripts/run-python benchmarks/slew_paths.py --trials 50000 --seed 1

Each scene has a horizon, a Sun, a travel and rates of its own, and many starts and goals.  Of every allowed slew the motion
is stepped as the servo makes it: chase at the limits, braking with 0.8 of them, a new leg once the command rests at the
corner before and the axes, which lag by up to a second, are 0.3 deg from it.  Every step and every stop from it is held
against horizon, Sun and travel.  Of every refused one a grid of half a degree is searched for a path with room to spare.
The exit status says whether anything was violated or missed.
"""

import argparse
import math
import sys
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, maximum_filter

from rf_pointing.planning import AxisLimits, AxisRates, Gate, GateParams, HorizonMask

Array = NDArray[np.float64]
DEG = math.pi / 180.0
STEP_S = 0.1
# What the last guard in front of the drives tolerates before it stops the axes.
TOLERANCE_RAD = 0.05 * DEG
CORNER_RAD = 0.3 * DEG
REST_RAD_S = 1e-3 * DEG
# The encoders follow the command by at most so much.
LAG_S = 1.0
GRID_RAD = 0.5 * DEG
FINE_RAD = 0.02 * DEG
# A path that the grid finds has so much room above hills and around the Sun, which moves on for so long.
ROOM_RAD = 1.0 * DEG
SUN_MOVES_S = 600.0
EARTH_RATE_RAD_S = 2.0 * math.pi / 86400.0


@dataclass(frozen=True)
class Scene:
    """One horizon, Sun, travel and machine."""

    mask: HorizonMask
    limits: AxisLimits
    axes: AxisRates
    sun: tuple[float, float] | None
    radius_rad: float

    def horizon(self, azimuth: Array) -> Array:
        """Return the horizon's elevation, from a table of three turns."""
        turns = 2.0 * math.pi * np.arange(-3, 5)
        points = (turns[:, None] + np.array(self.mask.azimuth_rad)).ravel()
        return np.asarray(np.interp(azimuth, points, np.tile(self.mask.elevation_rad, len(turns))))

    def highest(self, fine: Array, turn_rad: float) -> Array:
        """Return the horizon's elevation a turn away on a grid of `FINE_RAD` that leaves out no surveyed top."""
        found = self.horizon(fine + turn_rad)
        turns = 2.0 * math.pi * np.arange(-3, 5) - turn_rad
        rows = np.round(((turns[:, None] + np.array(self.mask.azimuth_rad)).ravel() - fine[0]) / FINE_RAD).astype(int)
        tops = np.tile(self.mask.elevation_rad, len(turns))
        near = (rows >= 0) & (rows < len(fine))
        np.maximum.at(found, rows[near], tops[near])
        return found

    def under(self, place: Array) -> Array:
        """Return how far places (..., 2) are below the horizon on either side."""
        azimuth, elevation = place[..., 0], place[..., 1]
        # Nearer than 4 deg to the zenith no horizon reaches, so neither side hides the other.
        return np.maximum(self.horizon(azimuth) - elevation, self.horizon(azimuth + math.pi) - (math.pi - elevation))

    def from_sun(self, place: Array) -> Array:
        """Return the angle of places (..., 2) from the Sun, from the chord between unit vectors."""
        if self.sun is None:
            return np.full(place.shape[:-1], math.pi)
        chord = np.linalg.norm(_vector(place) - _vector(np.array(self.sun)), axis=-1)
        return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def _vector(place: Array) -> Array:
    level = np.cos(place[..., 1])
    return np.stack([level * np.sin(place[..., 0]), level * np.cos(place[..., 0]), np.sin(place[..., 1])], axis=-1)


def random_scene(random: np.random.Generator) -> Scene:
    """Return hills up to 75 deg, some as steep as a mast, a Sun in two of three scenes."""
    azimuths = np.unique(np.concatenate([random.uniform(0.0, 360.0, random.integers(2, 14)), [0.0]]))
    heights = np.where(random.random(len(azimuths)) < 0.5, random.uniform(0.0, 8.0, len(azimuths)),
                       random.uniform(0.0, 75.0, len(azimuths)) * random.random())  # fmt: skip
    for _ in range(random.integers(0, 3)):
        at, width, high = random.uniform(5.0, 350.0), random.uniform(0.1, 2.0), random.uniform(10.0, 75.0)
        keep = np.abs(azimuths - at) > 2.0 * width
        azimuths = np.concatenate([azimuths[keep], at + width * np.array([-1.0, 0.0, 1.0])])
        order = np.argsort(azimuths)
        heights = np.concatenate([heights[keep], [5.0, high, 5.0]])[order]
        azimuths = azimuths[order]
    over = random.random() < 0.3
    reach, low = random.uniform(190.0, 300.0), random.uniform(0.0, 6.0)
    limits = AxisLimits(azimuth_min_rad=-reach * DEG, azimuth_max_rad=reach * DEG, elevation_min_rad=low * DEG,
                        elevation_max_rad=(180.0 - low if over else random.uniform(60.0, 90.0)) * DEG)  # fmt: skip
    pairs = random.uniform(1.0, 6.0, 2) * DEG, random.uniform(0.3, 3.0, 2) * DEG
    axes = AxisRates(*((float(first), float(second)) for first, second in pairs))
    sun = (random.uniform(-math.pi, math.pi), random.uniform(0.0, 85.0) * DEG) if random.random() < 0.67 else None
    mask = HorizonMask(azimuth_rad=tuple((azimuths * DEG).tolist()), elevation_rad=tuple((heights * DEG).tolist()))
    return Scene(mask, limits, axes, sun, float(random.uniform(0.5, 10.0)) * DEG)


def random_places(scene: Scene, random: np.random.Generator, count: int) -> Array:
    """Return places (count, 2) within the travel, a quarter of them on the horizon or about the Sun."""
    low, high = np.array(scene.limits.lowest_rad), np.array(scene.limits.highest_rad)
    places = random.uniform(low, high, (count, 2))
    near = random.random(count)
    above = scene.horizon(places[:, 0]) + random.uniform(-0.5, 3.0, count) * DEG
    places[near < 0.17, 1] = above[near < 0.17]
    if scene.sun is not None:
        about = np.array(scene.sun) + random.normal(0.0, 1.5 * scene.radius_rad, (count, 2))
        places[near > 0.92] = about[near > 0.92]
    return np.clip(places, low, high)


def violations(scene: Scene, starts: Array, ways: list[list[tuple[float, float]]], lag_s: Array) -> Array:
    """Step the slews (n) by their corners and return by how much each breaks something at worst."""
    corners = np.full((len(ways), max(map(len, ways)) + 1, 2), np.nan)
    for row, way in enumerate(ways):
        corners[row, : len(way)] = way
        corners[row, len(way) :] = way[-1]
    rate, limit = np.array(scene.axes.rate_rad_s), np.array(scene.axes.acceleration_rad_s2)
    low = np.minimum(scene.limits.lowest_rad, starts)
    high = np.maximum(scene.limits.highest_rad, starts)
    place, velocity, encoder = starts.copy(), np.zeros_like(starts), starts.copy()
    index, everyone = np.zeros(len(ways), dtype=np.int64), np.arange(len(ways))
    deepest, nearest = np.maximum(scene.under(starts), 0.0), np.minimum(scene.from_sun(starts), scene.radius_rad)
    worst = np.full(len(ways), -math.inf)
    shares = np.array([0.0, 0.4375, 0.75, 1.0])[:, None, None]
    follow = np.where(lag_s > 0.0, STEP_S / np.maximum(lag_s, STEP_S), 1.0)[:, None]
    for _ in range(int(3600.0 / STEP_S)):
        goal = corners[everyone, index]
        reached = np.max(np.abs(goal - encoder), axis=1) < CORNER_RAD
        reached &= np.max(np.abs(velocity), axis=1) < REST_RAD_S
        index = np.minimum(index + reached, corners.shape[1] - 1)
        goal = corners[everyone, index]
        gap = goal - place
        side = np.where(gap < 0.0, -1.0, 1.0)
        wanted = side * _stoppable(np.abs(gap), side * velocity, 0.8 * limit)
        faster = np.clip((wanted - velocity) / STEP_S, -limit, limit)
        then = np.clip(velocity + faster * STEP_S, -rate, rate)
        place, velocity = place + 0.5 * (velocity + then) * STEP_S, then
        encoder = encoder + follow * (place - encoder)
        stops = place + shares * velocity * np.abs(velocity) / (2.0 * limit)
        under = scene.under(stops)
        broken = np.max(under - deepest, axis=0)
        if scene.sun is not None:
            near = scene.from_sun(stops)
            broken = np.maximum(broken, np.max(nearest - near, axis=0))
            nearest = np.maximum(nearest, np.minimum(near[0], scene.radius_rad))
        broken = np.maximum(broken, np.max(np.maximum(stops - high, low - stops), axis=(0, 2)))
        worst = np.maximum(worst, broken)
        deepest = np.minimum(deepest, np.maximum(under[0], 0.0))
        if np.all(index == corners.shape[1] - 1) and np.max(np.abs(gap)) < 1e-4 * DEG:
            return worst
    raise RuntimeError("a slew has not arrived within an hour")


def _stoppable(distance: Array, rate: Array, braking: Array) -> Array:
    """Return the largest rate after a step from which an axis stops within a distance."""
    left = np.maximum((distance - 0.5 * rate * STEP_S) / (braking * STEP_S**2), 0.0)
    whole = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * left) - 1.0))
    return np.asarray(braking * STEP_S * (whole + (left - 0.5 * whole * (whole + 1.0)) / (whole + 1.0)))


class Grid:
    """Places of a scene with room to spare, and which of them are connected."""

    def __init__(self, scene: Scene) -> None:
        low, high = np.array(scene.limits.lowest_rad), np.array(scene.limits.highest_rad)
        self._low, self._shape = low, np.floor((high - low) / GRID_RAD).astype(int) + 1
        azimuth = low[0] + GRID_RAD * np.arange(self._shape[0])
        elevation = low[1] + GRID_RAD * np.arange(self._shape[1])
        # Masts are thinner than a cell: the highest of many points within the room counts.
        fine = np.arange(low[0] - 2.0 * ROOM_RAD, high[0] + 2.0 * ROOM_RAD, FINE_RAD)
        wide = round((ROOM_RAD + GRID_RAD) / FINE_RAD) * 2 + 1
        front, back = (maximum_filter(scene.highest(fine, turn), wide) for turn in (0.0, math.pi))
        lowest = np.interp(azimuth, fine, front) + ROOM_RAD
        highest = math.pi - np.interp(azimuth, fine, back) - ROOM_RAD
        free = (elevation >= lowest[:, None]) & (elevation <= highest[:, None])
        places = np.stack(np.meshgrid(azimuth, elevation, indexing="ij"), axis=-1)
        kept = scene.radius_rad + ROOM_RAD + EARTH_RATE_RAD_S * SUN_MOVES_S
        self._labels = label(free & (scene.from_sun(places) > kept))[0]

    def connects(self, start: Array, goal: Array) -> bool:
        """Return whether a path with room to spare leads from one place to the other."""
        here, there = (tuple(np.round((place - self._low) / GRID_RAD).astype(int)) for place in (start, goal))
        if any(index >= size for cell in (here, there) for index, size in zip(cell, self._shape, strict=True)):
            return False
        return bool(self._labels[here] != 0 and self._labels[here] == self._labels[there])


def main() -> int:
    """Try the slews and print what was found; 1 for a violation or a missed path."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=50_000, help="slews to ask for")
    parser.add_argument("--each", type=int, default=1000, help="slews in one scene")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbose", action="store_true", help="print the slews that were violated or missed")
    options = parser.parse_args()
    random, counts, worst_rad, longest_s, spent_s = np.random.default_rng(options.seed), Counter(), -math.inf, 0.0, 0.0
    for _ in range(math.ceil(options.trials / options.each)):
        scene = random_scene(random)
        gate = Gate(GateParams(sun_radius_rad=scene.radius_rad), scene.limits, scene.mask, scene.axes)
        starts, goals = random_places(scene, random, options.each), random_places(scene, random, options.each)
        ways, rows, refused = [], [], []
        for row, (start, goal) in enumerate(zip(starts.tolist(), goals.tolist(), strict=True)):
            begun = time.perf_counter()
            decision = gate.check("slew", tuple(start), np.array([goal]), sun_rad=scene.sun)
            taken = time.perf_counter() - begun
            longest_s, spent_s = max(longest_s, taken), spent_s + taken
            if decision.allowed:
                counts["detours" if decision.way else "straight"] += 1
                ways.append(list(decision.way) or [tuple(goal)])
                rows.append(row)
            elif "no detour" in decision.reason:
                refused.append(row)
            else:
                counts["goals forbidden"] += 1
        if ways:
            lag = random.uniform(0.0, LAG_S, len(ways))
            broken = violations(scene, starts[rows], ways, lag)
            counts["violations"] += int(np.sum(broken > TOLERANCE_RAD))
            worst_rad = max(worst_rad, float(np.max(broken)))
            for bad in np.flatnonzero(broken > TOLERANCE_RAD) if options.verbose else ():
                print("violated by", broken[bad] / DEG, scene, starts[rows[bad]].tolist(), ways[bad])
        grid = Grid(scene) if refused else None
        for row in refused:
            assert grid is not None
            missed = grid.connects(starts[row], goals[row])
            counts["missed" if missed else "no path"] += 1
            if missed and options.verbose:
                print("missed", scene, starts[row].tolist(), goals[row].tolist())
    print(", ".join(f"{count} {word}" for word, count in sorted(counts.items())))
    print(f"worst excess {worst_rad / DEG:.4f} deg (the guard stops at {TOLERANCE_RAD / DEG} deg); a decision took "
          f"{spent_s / options.trials * 1e3:.2f} ms on average, {longest_s * 1e3:.0f} ms at most")  # fmt: skip
    return int(counts["violations"] > 0 or counts["missed"] > 0)


if __name__ == "__main__":
    sys.exit(main())
