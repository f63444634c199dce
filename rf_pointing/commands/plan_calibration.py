"""Executable `plan_calibration`: the campaign that fills the sky, or the passes that help most.

Without --improve it prints the campaign.  With --improve TERM... it prints the passes that reduce
the sigma of these terms most, given the covariance of --model.  With --scan TARGET... these bodies
and satellites are scanned, and what helps most is planned of scans and passes together:

    plan_calibration --station my_dish.yaml --start 2026-06-21T18:00:00 --hours 10 --count 25 \
        --scan Moon "Cassiopeia A" --schedule night.csv
    station queue night.csv --start

Exit code 0: planned, every sector filled; 1: planned, sectors stay thin; 2: refused.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing import calibration
from rf_pointing.api.scan import SETTLING_S, ScanRequest
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.calibration import CandidatePass, PassPriors, SectorRule, Slew
from rf_pointing.calibration.terms import names_of
from rf_pointing.commands.options import add_options, command, ending_with_reason, requested, say, say_of_elements
from rf_pointing.core import MDEG, require_between, utc_text
from rf_pointing.ephemeris import TargetSource, read_source, verification_elements
from rf_pointing.operations.pass_list import to_csv, to_json
from rf_pointing.operations.schedule import ScheduledPass
from rf_pointing.station.campaign.plan import ArcRules, beacons, candidate_arcs
from rf_pointing.tracking.scan_program import PATTERNS, ScanProgram

PROGRAM = "plan_calibration"
HOUR_S = 3600.0
MAX_AGE_S = 14.0 * 86400.0
SCAN_BEAMS, SCAN_EVERY_S = 0.02, 600.0
"""Accuracy of a scan that a plan counts on, in beamwidths, and time between possible starts."""


@dataclass(frozen=True, kw_only=True)
class CampaignRequest:
    """Possible passes, and the plan to make of them: the sky, or terms to `improve`."""

    station: Station
    target: Target
    beacons: bool
    start_s: float
    hours: float
    rules: ArcRules
    slew: Slew
    fewest: int
    improve: list[str]
    model: Path | None
    count: int
    orbit_prior_m: float
    scan: tuple[str, ...] = ()
    pattern: str = "cross"
    schedule: Path | None = None

    def candidates(self) -> list[CandidatePass]:
        """Return what could be tracked or scanned; ValueError where nothing could."""
        require_between("hours", self.hours, 0.01, 24.0 * 28.0)
        targets = (replace(self.target, satellite=name) for name in self.scan)
        scans = [one for target in targets for one in self._scans(target)]
        tracked = self._passes() if self.beacons or self.target.location or not self.scan else []
        found = [*scans, *(one for one in tracked if one.name not in self._scanned)]
        if not found:
            lowest = f"{math.degrees(self.rules.lowest_rad):.0f} deg"
            raise ValueError(f"no target rises above {lowest} in {self.hours:g} h")
        return found

    @property
    def _scanned(self) -> set[str]:
        # A satellite may be given by its number.
        return {replace(self.target, satellite=name).name for name in self.scan}

    def _scans(self, target: Target) -> list[CandidatePass]:
        """Return the possible scans of a target: three points that weigh as one."""
        request = ScanRequest(station=self.station, target=target, pattern=self.pattern)
        length_s = ScanProgram(request.program(self.start_s)).duration_s + SETTLING_S
        sigma_rad = SCAN_BEAMS * math.radians(self.station.beamwidth_deg) * math.sqrt(3.0)
        # Points are at whole spacings from the rise.
        step_s = 0.5 * length_s
        every_s = step_s * math.ceil(SCAN_EVERY_S / step_s)
        own = {"arcs_s": (length_s,), "every_s": every_s, "spacing_s": step_s, "sigma_rad": sigma_rad}
        return self._arcs([target.found], replace(self.rules, **own))

    def _arcs(self, targets: Sequence[TargetSource], rules: ArcRules) -> list[CandidatePass]:
        station, span_s = self.station, self.hours * HOUR_S
        mount = station.controller.kinematics
        found, refused = candidate_arcs(targets, station.site, self.start_s, span_s, rules, mount)
        for reason in refused:
            say(PROGRAM, f"left out: {reason}")
        return found

    def _passes(self) -> list[CandidatePass]:
        start_s, span_s = self.start_s, self.hours * HOUR_S
        if self.beacons:
            elements = beacons(start_s, self.station.site.latitude_rad)
        elif self.target.location:
            say_of_elements(self.target)
            elements = read_source(self.target.location).elements
        else:
            elements = verification_elements()
        # The greatest age over the campaign counts: older elements are wrong by kilometres.
        fresh = [one for one in elements if abs(start_s + 0.5 * span_s - one.epoch_t_s) < MAX_AGE_S - 0.5 * span_s]
        if not fresh:
            raise ValueError(f"none of {len(elements)} elements is within 14 days of start={utc_text(start_s)}")
        return self._arcs(fresh, self.rules)

    def write(self, chosen: Sequence[CandidatePass]) -> None:
        """Write the plan as a schedule of the executive, where one is wanted."""
        if self.schedule is None:
            return
        items = [self._item(one) for one in sorted(chosen, key=lambda one: one.start_t_s)]
        text = to_csv(items) if self.schedule.suffix == ".csv" else to_json(items)
        self.schedule.write_text(text, encoding="utf-8")

    def _item(self, one: CandidatePass) -> ScheduledPass:
        azimuth, elevation = one.track.sky_rad()
        path = np.unwrap(azimuth).tolist()
        return ScheduledPass(
            target=one.name, name=one.name, aos_t_s=one.start_t_s, los_t_s=one.end_t_s,
            scan=self.pattern if one.name in self._scanned else "", peak_rad=float(np.max(elevation)),
            azimuth_path_rad=(path[0], min(path), max(path), path[-1]),
            elevation_rad=(float(elevation[0]), float(elevation[-1])),
        )  # fmt: skip


def campaign(request: CampaignRequest, candidates: list[CandidatePass]) -> int:
    """Print the campaign; return the exit code."""
    rule = SectorRule(fewest=request.fewest, most=max(30, request.fewest))
    plan = calibration.plan_campaign(candidates, rule, request.slew)
    for one in plan.passes:
        peak = math.degrees(float(np.max(one.track.sky_rad()[1])))
        print(f"{utc_text(one.start_t_s)}  {one.end_t_s - one.start_t_s:6.0f} s  peak {peak:4.1f} deg  {one.name}")
    request.write(plan.passes)
    filled = rule.count - len(plan.coverage.thin)
    print(f"{len(plan.passes)} of {len(candidates)} candidates fill {filled} of {rule.count} sectors")
    if plan.full_at_t_s is not None:
        after_h = (plan.full_at_t_s - request.start_s) / HOUR_S
        print(f"all filled at {utc_text(plan.full_at_t_s)}, {after_h:.2f} h after the start")
        return 0
    for sector in plan.coverage.thin:
        print(f"thin: {rule.name(sector)} has {plan.coverage.counts[sector]} of {rule.fewest}")
    return 1


def advice(request: CampaignRequest, candidates: list[CandidatePass]) -> int:
    """Print the passes that help most; return the exit code."""
    if request.model:
        file = calibration.read_model(request.model)
        file.check_for(request.station.name, file.band, file.valid_from_t_s)
        file.model.on(request.station.controller.kinematics)
        terms, covariance = file.fitted, file.covariance
    else:
        # A station that was never calibrated knows no term, not even those to be improved.
        own = names_of(request.station.controller.kinematics.type)
        terms = tuple(dict.fromkeys((*own, *request.improve)))
        covariance = calibration.uninformed_covariance(terms)
    before = dict(zip(terms, np.sqrt(np.diag(covariance)), strict=True))
    improve = request.improve or list(terms)
    found = calibration.next_best_passes(
        terms, covariance, candidates, chosen=improve, count=request.count,
        pass_priors=PassPriors.of_orbit(request.orbit_prior_m), slew=request.slew,
    )  # fmt: skip
    for one in found:
        after = dict(zip(terms, one.sigma, strict=True))
        sigma = ", ".join(f"{name} {after[name] / before[name]:.3f}" for name in improve)
        print(f"{utc_text(one.start_t_s)}  {one.name}: sigma times {one.factor:.3f}; since the start: {sigma}")
    request.write([one.candidate for one in found])
    return 0


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Plan a calibration campaign.")
    add = parser.add_argument
    add_options(parser, "elements")
    add("--beacons", action="store_true", help="the simulated sky of `calibrate` instead of a catalogue")
    add_options(parser, "station band start", start={"required": True, "help": "begin of the campaign"})
    add("--hours", type=float, default=24.0, help="how far ahead (default: 24)")
    add("--arc", type=float, nargs="*", default=[], metavar="S",
        help="lengths of pieces of passes (default: whole passes)")  # fmt: skip
    add("--spacing", type=float, default=10.0, metavar="S", help="time between points (default: 10)")
    add("--settle", type=float, default=60.0, metavar="S", help="in addition to the slew (default: 60)")
    add("--fewest", type=int, default=25, help="points in each sector (default: 25)")
    add("--sigma", type=float, metavar="MDEG", help="of one point (default: the station's)")
    add("--improve", nargs="+", default=[], metavar="TERM",
        help="advise the passes that reduce the sigma of these terms most")  # fmt: skip
    add("--scan", nargs="+", default=[], metavar="TARGET",
        help="bodies and satellites that are scanned, not tracked; alone, or with --elements")  # fmt: skip
    add("--pattern", choices=PATTERNS, default="cross", help="of the scans (default: cross)")
    add("--schedule", type=Path, metavar="FILE", help="CSV or JSON of the plan, for the executive")
    add("--model", type=Path, metavar="FILE", help="last model; its covariance is where --improve starts")
    add("--count", type=int, default=5, help="how many passes to advise (default: 5)")
    add("--orbit-prior", dest="orbit_prior_m", type=float, default=200.0, metavar="M",
        help="orbit error of each pass that the next fit allows for (default: 200; 0: none)")  # fmt: skip
    return parser


def request_with(
    *,
    arc: list[float],
    spacing: float,
    sigma: float | None,
    settle: float,
    station: Station,
    scan: list[str],
    **others: Any,
) -> CampaignRequest:
    """Return the request of the options."""
    sigma_rad = station.calibrator.sigma_rad if sigma is None else sigma * MDEG
    rules = ArcRules(arcs_s=tuple(arc), spacing_s=spacing, sigma_rad=sigma_rad)
    own = {"rules": rules, "slew": Slew(settle_s=settle), "scan": tuple(scan)}
    return CampaignRequest(station=station, **own, **others)


request_from = partial(requested, arguments, request_with)
"""Returns the request of a command line."""


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing plan_calibration`."""
    with ending_with_reason(PROGRAM):
        request = request_from(argv)
        candidates = request.candidates()
        planned = advice if request.improve or request.scan else campaign
        sys.exit(planned(request, candidates))
