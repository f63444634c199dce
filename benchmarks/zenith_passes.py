"""Passes near the zenith with a scan: what the turn and the way over the top lose.

scripts/run-python benchmarks/zenith_passes.py [--station leo_3m7] [--band X] [--sensor conscan] [--peak 88.7 ...]

A satellite 700 km high passes at each peak elevation (deg), on both sides of the zenith.  Printed: the branch of the
certificate and the seconds beyond half power that it expects, those flown by the whole simulated
station (of the whole pass, and from a minute after its start), and those that no course of the axes avoids.

The last is a bound: an azimuth axis of any acceleration at its full rate, an elevation axis without limits,
on either side of the zenith at any time.  The beam is then off by cos(el) |sin(az - az of the target)|.
"""

import argparse
import dataclasses
import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter1d
from scipy.optimize import brentq

from rf_pointing.core.pass_outcome import PassOutcome
from rf_pointing.ephemeris import Elements, Pass, Site, TopocentricTrack, first_pass_above, tle_lines
from rf_pointing.planning import Branch
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.campaign.plan import beacons

START_S = 1151193600.0
LEAD_S, SETTLED_S, CLUSTER_S = 90.0, 60.0, 0.1
HEIGHT_RATIO = (6978.0 / 7078.0) ** 1.5
# Steps in time and azimuth of the bound, and how far from the zenith in time nothing need be lost.
STEP_S, AZIMUTHS, REACH_S = 0.05, 18_000, 60.0


class Flown(NamedTuple):
    """Branch of the certificate, seconds lost in all and after the first minute, and those of the bound."""

    branch: Branch
    lost_s: float
    settled_lost_s: float
    least_s: float


def overhead(site: Site, peak_deg: float, east: bool, mask_rad: float) -> tuple[Elements, Pass]:
    """Return a satellite whose next pass peaks at `peak_deg` on one side of the zenith, and the pass."""
    first = beacons(START_S)[3]
    base = dataclasses.replace(first, mean_motion_rad_s=first.mean_motion_rad_s * HEIGHT_RATIO)

    def turned(node_rad: float) -> tuple[Elements, Pass]:
        elements = dataclasses.replace(base, ascending_node_rad=(base.ascending_node_rad + node_rad) % (2.0 * math.pi))
        return elements, first_pass_above(TopocentricTrack(elements, site), START_S, 0.8, mask_rad, 2.0 * 86400.0)

    _, near = turned(0.0)

    def beyond(node_rad: float) -> float:
        elements = dataclasses.replace(base, ascending_node_rad=(base.ascending_node_rad + node_rad) % (2.0 * math.pi))
        times = np.arange(near.aos_t_s - 200.0, near.los_t_s + 200.0, 0.5)
        look = TopocentricTrack(elements, site).sample(times)
        highest = int(np.argmax(look.elevation_rad))
        # Signed: the zenith distance is negative where the azimuth turns the other way.
        sign = math.copysign(1.0, float(look.azimuth_rate_rad_s[highest]))
        return sign * (90.0 - math.degrees(float(look.elevation_rad[highest])))

    wanted = (90.0 - peak_deg) * (1.0 if east else -1.0)
    nodes = np.linspace(-0.35, 0.35, 29)
    values = np.array([beyond(float(node)) for node in nodes]) - wanted
    crossing = np.flatnonzero((np.sign(values[1:]) != np.sign(values[:-1])) & (np.abs(np.diff(values)) < 60.0))
    place = int(crossing[np.argmin(np.abs(values[crossing]))])
    node_rad = float(brentq(lambda node: beyond(node) - wanted, nodes[place], nodes[place + 1], xtol=1e-6))
    return turned(node_rad)


def least_lost_s(site: Site, elements: Elements, window: Pass, width_rad: float, rate_rad_s: float) -> float:
    """Return the seconds beyond half power that no course of an azimuth axis of this rate avoids."""
    middle_s = 0.5 * (window.aos_t_s + window.los_t_s)
    times = np.arange(max(window.aos_t_s, middle_s - REACH_S), min(window.los_t_s, middle_s + REACH_S), STEP_S)
    look = TopocentricTrack(elements, site).sample(times)
    # Both sides of the zenith: half a turn of azimuth is all there is.
    cell_rad = math.pi / AZIMUTHS
    axis, lost_s = cell_rad * np.arange(AZIMUTHS), np.zeros(AZIMUTHS)
    # A cell more on the way, half a cell less off the target: no course is rounded to a worse one.
    reach = math.floor(rate_rad_s * STEP_S / cell_rad) + 1
    for azimuth, level in zip(look.azimuth_rad, np.cos(look.elevation_rad), strict=True):
        off = level * (np.abs(np.sin(axis - azimuth)) - 0.5 * cell_rad) > math.sin(0.5 * width_rad)
        lost_s = minimum_filter1d(lost_s, 2 * reach + 1, mode="wrap") + STEP_S * off
    return float(lost_s.min())


def fly(station: str, band: str | None, sensor: str, elements: Elements, window: Pass, file: Path) -> Flown:
    """Return what a pass was expected to lose, and lost."""
    file.write_text("\n".join((elements.name, *tle_lines(elements))) + "\n")
    source = {"source.elements": str(file), "source.satellite": str(elements.catalogue_number)}
    changes: dict[str, dict[str, object]] = {"ephemeris_publisher": dict(source), "rf_receiver": dict(source)}
    setup = StationSetup(station, band, changes=changes)
    controller = setup.controller()
    log = simulate_pass(setup, window, math.floor(window.aos_t_s) - LEAD_S, sensor)
    assert log.certificate is not None
    chosen, width_rad = log.certificate.chosen, controller.corrections.half_power_beamwidth_rad
    if chosen is None:
        raise ValueError(log.certificate.reason)
    times, errors = np.array(log.t_s), np.hypot(*log.errors_rad().T)
    whole, settled = (
        PassOutcome.of(errors[(times >= begin_s) & (times <= window.los_t_s)], width_rad, CLUSTER_S).lost_s
        for begin_s in (window.aos_t_s, window.aos_t_s + SETTLED_S)
    )
    rate_rad_s = controller.plan.machine.rate_limit_rad_s[0]
    return Flown(chosen, whole, settled, least_lost_s(setup.station.site, elements, window, width_rad, rate_rad_s))


def main() -> None:
    """Fly every pass and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--station", default="leo_3m7")
    parser.add_argument("--band")
    parser.add_argument("--sensor", default="conscan")
    parser.add_argument("--peak", type=float, nargs="+", default=[88.7])
    parser.add_argument("--mask", type=float, default=10.0, help="elevation at which the passes begin and end, deg")
    options = parser.parse_args()
    site = StationSetup(options.station).station.site
    with tempfile.TemporaryDirectory() as folder:
        for peak_deg in options.peak:
            for east in (True, False):
                elements, window = overhead(site, peak_deg, east, math.radians(options.mask))
                flown = fly(
                    options.station, options.band, options.sensor, elements, window, Path(folder) / "overhead.tle"
                )
                print(
                    f"{options.sensor}, {math.degrees(window.peak_elevation_rad):.2f} deg: {flown.branch.label}: expected "
                    f"{flown.branch.lost_s:.1f} s in the turn, {flown.branch.acquisition_s:.1f} s of acquisition; flown "
                    f"{flown.lost_s:.1f} s, {flown.settled_lost_s:.1f} s after the first minute; no course loses less "
                    f"than {flown.least_s:.1f} s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
