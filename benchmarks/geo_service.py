"""Services of inclined satellites against a step-track every ten minutes: loss, motor starts, memory.

    scripts/run-python benchmarks/geo_service.py --days 30

A satellite of 0, 1, 3 and 6 deg inclination by SGP4, seen from two stations; the service knows its
direction at the start and nothing of its motion.  The receiver has noise, scintillation of 0.1 dB
over minutes, fades of the weather, and the Sun's noise.  On day 20 the beacon is lost for 6 h.  The
step-track peaks with a cross of five points every ten minutes.
"""

import argparse
import math
import sys
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.api.station import Station
from rf_pointing.core import MU, angular_distance_rad
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import Elements, TopocentricTrack, sun
from rf_pointing.ephemeris.sites import Site
from rf_pointing.station.service.keeper import Service, ServiceParams
from rf_pointing.station.service.sidereal import SiderealMotion

STEP_S, RESTING_STEP_S, TABLE_S = 4.0, 12.0, 60.0
BEGIN = "2026-02-15T00:00:00"
LOSS_DAY, LOSS_S = 20.0, 6.0 * 3600.0
NOISE_DB, SCINTILLATION_DB, SCINTILLATION_S = 0.1, 0.1, 120.0
FADE_DB, FADE_S = 1.0, 7200.0
RATE_DEG_S = 0.5
"""Slow motors, as such dishes have them."""
EVERY_S, CROSS_BEAMS = 600.0, 0.15
GEOSTATIONARY_REV_S = 86164.09


def satellite(inclination_deg: float, longitude_deg: float, epoch_s: float) -> Elements:
    """Return a satellite that stays at a longitude, but for its inclination."""
    mean_motion = math.tau / GEOSTATIONARY_REV_S
    # Greenwich's angle at the epoch, and the place on the orbit that makes up the longitude.
    greenwich = math.radians(280.46061837 + 360.98564736629 * (epoch_s / 86400.0 - 10957.5))
    return Elements(
        name=f"GEO {inclination_deg:g}", catalogue_number=99001, epoch_t_s=epoch_s,
        inclination_rad=math.radians(max(inclination_deg, 0.02)), ascending_node_rad=0.8, eccentricity=2e-4,
        argument_of_perigee_rad=0.3, mean_anomaly_rad=(greenwich + math.radians(longitude_deg) - 1.1) % math.tau,
        mean_motion_rad_s=mean_motion, drag_per_earth_radius=0.0, international_designator="26001A",
    )  # fmt: skip


class Sky:
    """Directions of a satellite and the Sun over a site, and the level that an antenna receives."""

    def __init__(self, elements: Elements, site: Site, width_rad: float, days: float, seed: int) -> None:
        self.start_s, self.width_rad = elements.epoch_t_s, width_rad
        self.times = self.start_s + np.arange(0.0, days * 86400.0 + 7200.0, TABLE_S)
        looks = TopocentricTrack(elements, site, max_age_s=60.0 * 86400.0).sample(self.times)
        self.satellite = np.column_stack([looks.azimuth_rad, looks.elevation_rad])
        solar = TopocentricTrack(sun(), site).sample(self.times)
        self.solar = np.column_stack([np.unwrap(solar.azimuth_rad), solar.elevation_rad])
        random = np.random.default_rng(seed)
        self._random, self._noise = random, random.normal(size=(2, len(self.times)))
        for row, correlation_s in enumerate((SCINTILLATION_S, FADE_S)):
            fade = math.exp(-TABLE_S / correlation_s)
            for place in range(1, len(self.times)):
                self._noise[row, place] = (
                    fade * self._noise[row, place - 1] + math.sqrt(1.0 - fade**2) * self._noise[row, place]
                )

    def at(self, table: np.ndarray, t_s: float) -> tuple[float, float]:
        place = (t_s - self.start_s) / TABLE_S
        low = min(int(place), len(table) - 2)
        share = place - low
        return tuple((1.0 - share) * table[low] + share * table[low + 1])

    def error_rad(self, t_s: float, beam: np.ndarray) -> float:
        return float(angular_distance_rad(*self.at(self.satellite, t_s), *beam))

    def sun_noise_db(self, t_s: float, beam: np.ndarray) -> float:
        apart = float(angular_distance_rad(*self.at(self.solar, t_s), *beam))
        return 10.0 * math.log10(1.0 + 15.0 * math.exp(-MU * (apart / max(self.width_rad, 0.0093)) ** 2))

    def level_db(self, t_s: float, beam: np.ndarray) -> float:
        low = min(int((t_s - self.start_s) / TABLE_S), len(self.times) - 1)
        weather = SCINTILLATION_DB * self._noise[0, low] + FADE_DB * self._noise[1, low]
        loss = 10.0 * MU / math.log(10.0) * (self.error_rad(t_s, beam) / self.width_rad) ** 2
        noise = NOISE_DB * float(self._random.normal())
        return 60.0 + weather + noise - min(loss, 40.0) - self.sun_noise_db(t_s, beam)


@dataclass
class Mount:
    """Axes with a rate and steps; `starts` counts those of each motor."""

    beam: np.ndarray
    resolution_rad: float
    starts: np.ndarray = field(default_factory=lambda: np.zeros(2, dtype=int))
    goal: np.ndarray | None = None

    def send(self, goal: tuple[float, float]) -> None:
        self.goal = np.round(np.array(goal) / self.resolution_rad) * self.resolution_rad
        self.starts += np.abs(self.goal - self.beam) > 0.5 * self.resolution_rad

    def move(self, seconds: float) -> bool:
        """Go on; return whether the axes still move."""
        if self.goal is None:
            return False
        most = math.radians(RATE_DEG_S) * seconds
        left = self.goal - self.beam
        self.beam = self.beam + np.clip(left, -most, most)
        self.goal = None if np.all(np.abs(left) <= most) else self.goal
        return self.goal is not None


@dataclass
class Outcome:
    """Losses over time, and starts."""

    times: list[float] = field(default_factory=list)
    powers: list[float] = field(default_factory=list)
    spans: list[float] = field(default_factory=list)
    starts: int = 0
    first_day: int = 0

    def note(self, t_s: float, error_beams: float, span_s: float) -> None:
        self.times.append(t_s)
        self.powers.append(math.exp(-MU * min(error_beams, 3.0) ** 2))
        self.spans.append(span_s)

    def loss_db(self, from_s: float = -math.inf, to_s: float = math.inf) -> float:
        chosen = [(p, s) for t, p, s in zip(self.times, self.powers, self.spans, strict=True) if from_s <= t < to_s]
        return -10.0 * math.log10(sum(p * s for p, s in chosen) / sum(s for _, s in chosen))


def serve(sky: Sky, days: float, resolution_rad: float) -> tuple[Outcome, Service]:
    """Run a service from a known first direction."""
    first = sky.at(sky.satellite, sky.start_s)
    motion = SiderealMotion(sky.width_rad, constant_rad=math.radians(3.0), daily_rad=math.radians(7.0))
    # Where the satellite is at the start is known, how it moves is not.
    motion.place(sky.start_s, np.zeros(2), 0.1 * sky.width_rad)
    service = Service("GEO", ServiceParams(), motion, lambda _t_s: first, lambda t_s: sky.at(sky.solar, t_s))
    mount, outcome, t_s = Mount(np.array(first), resolution_rad), Outcome(), sky.start_s
    lost_s = sky.start_s + LOSS_DAY * 86400.0
    while t_s < sky.start_s + days * 86400.0:
        span_s = STEP_S if mount.goal is not None or service.busy else RESTING_STEP_S
        t_s += span_s
        moving = mount.move(span_s)
        level = None if lost_s <= t_s < lost_s + LOSS_S else sky.level_db(t_s, mount.beam)
        goal = service.step(t_s, (float(mount.beam[0]), float(mount.beam[1])), level, moving=moving)
        if goal is not None:
            mount.send(goal)
        outcome.note(t_s, sky.error_rad(t_s, mount.beam) / sky.width_rad, span_s)
        if t_s < sky.start_s + 86400.0:
            outcome.first_day = int(mount.starts.sum())
    outcome.starts = int(mount.starts.sum())
    return outcome, service


def step_track(sky: Sky, days: float, resolution_rad: float) -> Outcome:
    """Peak with a cross of five points every ten minutes, and stay there."""
    mount, outcome, t_s = (Mount(np.array(sky.at(sky.satellite, sky.start_s)), resolution_rad), Outcome(), sky.start_s)
    length = CROSS_BEAMS * sky.width_rad

    def wait(seconds: float) -> float:
        nonlocal t_s
        levels = []
        for _ in range(max(1, round(seconds / STEP_S))):
            t_s += STEP_S
            if not mount.move(STEP_S):
                levels.append(sky.level_db(t_s, mount.beam))
            outcome.note(t_s, sky.error_rad(t_s, mount.beam) / sky.width_rad, STEP_S)
        return float(np.mean(levels)) if levels else 0.0

    while t_s < sky.start_s + days * 86400.0:
        begun_s = t_s
        for axis in range(2):
            stretch = np.array([1.0 / math.cos(mount.beam[1]), 1.0])
            centre, step = mount.beam.copy(), np.eye(2)[axis] * length * stretch
            levels = [wait(3.0 * STEP_S)]
            for place in (centre + step, centre - step):
                mount.send((float(place[0]), float(place[1])))
                levels.append(wait(4.0 * STEP_S))
            bend = 2.0 * levels[0] - levels[1] - levels[2]
            share = np.clip(0.5 * (levels[1] - levels[2]) / bend, -1.5, 1.5) if bend > 0.1 else 0.0
            best = centre + share * step
            mount.send((float(best[0]), float(best[1])))
        wait(EVERY_S - (t_s - begun_s))
    outcome.starts = int(mount.starts.sum())
    return outcome


def main() -> None:
    """Print a row for each station and inclination; exit code 1 where a promise is not kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=float, default=30.0)
    parser.add_argument("--inclinations", type=float, nargs="+", default=[0.0, 1.0, 3.0, 6.0])
    parser.add_argument("--stations", nargs="+", default=["rotator_2m", "geo_7m"])
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print("station      incl   loss  worst day  6 h lost   starts/day  first day  step-track  peaks  kept")
    bad = 0
    for name in options.stations:
        station = Station(name)
        width_rad = station.controller.machine.half_power_beamwidth_rad
        axis = station.description.content.mount.azimuth
        resolution_rad = math.radians(axis.resolution_deg or 360.0 / 2 ** (axis.encoder_bits or 18))
        for inclination in options.inclinations:
            longitude = math.degrees(station.site.longitude_rad) + 12.0
            elements = satellite(inclination, longitude, parse_utc(BEGIN))
            sky = Sky(elements, station.site, width_rad, options.days, options.seed)
            outcome, service = serve(sky, options.days, resolution_rad)
            usual = step_track(sky, min(options.days, 3.0), resolution_rad)
            start, days = sky.start_s, math.floor(options.days)
            daily = [outcome.loss_db(start + day * 86400.0, start + (day + 1) * 86400.0) for day in range(days)]
            lost = math.nan
            if options.days > LOSS_DAY:
                lost_s = start + LOSS_DAY * 86400.0
                lost = outcome.loss_db(lost_s, lost_s + LOSS_S)
            rate, usual_rate = outcome.starts / options.days, usual.starts / min(options.days, 3.0)
            kept = outcome.loss_db() <= 0.3 and rate <= usual_rate / 3.0 and not lost > 0.5
            bad += not kept
            print(
                f"{name:<12} {inclination:4.0f} {outcome.loss_db():6.3f} {max(daily):10.3f} {lost:9.3f} "
                f"{rate:12.1f} {outcome.first_day:10d} {usual_rate:11.1f} {service.peaks:6d}  {'yes' if kept else 'NO'}"
            )
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
