"""Executable `plan_calibration`: the campaign that fills the sky, or the passes that help most.

Without --improve it prints the campaign.  With --improve TERM... it prints the passes that reduce
the sigma of these terms most, given the covariance of --model.  Exit code 0: planned, every sector
filled; 1: planned, sectors stay thin; 2: refused.
"""

import argparse
import math
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing import calibration
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.calibration import CandidatePass, PassPriors, SectorRule, Slew
from rf_pointing.calibration.terms import names_of
from rf_pointing.commands.options import add_options, command, ending_with_reason, requested, say, say_of_elements
from rf_pointing.core import MDEG, require_between, utc_text
from rf_pointing.ephemeris import read_source, verification_elements
from rf_pointing.station.campaign.plan import ArcRules, beacons, candidate_arcs

PROGRAM = "plan_calibration"
HOUR_S = 3600.0
MAX_AGE_S = 14.0 * 86400.0


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

    def candidates(self) -> list[CandidatePass]:
        """Return what could be tracked; ValueError where nothing could."""
        require_between("hours", self.hours, 0.01, 24.0 * 28.0)
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
        mount = self.station.controller.kinematics
        found, refused = candidate_arcs(fresh, self.station.site, start_s, span_s, self.rules, mount)
        for reason in refused:
            say(PROGRAM, f"left out: {reason}")
        if not found:
            raise ValueError(f"no target rises above {math.degrees(self.rules.lowest_rad):.0f} deg in {self.hours:g} h")
        return found


def campaign(request: CampaignRequest, candidates: list[CandidatePass]) -> int:
    """Print the campaign; return the exit code."""
    rule = SectorRule(fewest=request.fewest, most=max(30, request.fewest))
    plan = calibration.plan_campaign(candidates, rule, request.slew)
    for one in plan.passes:
        peak = math.degrees(float(np.max(one.track.sky_rad()[1])))
        print(f"{utc_text(one.start_t_s)}  {one.end_t_s - one.start_t_s:6.0f} s  peak {peak:4.1f} deg  {one.name}")
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
    found = calibration.next_best_passes(
        terms, covariance, candidates, chosen=request.improve, count=request.count,
        pass_priors=PassPriors.of_orbit(request.orbit_prior_m), slew=request.slew,
    )  # fmt: skip
    for one in found:
        after = dict(zip(terms, one.sigma, strict=True))
        sigma = ", ".join(f"{name} {after[name] / before[name]:.3f}" for name in request.improve)
        print(f"{utc_text(one.start_t_s)}  {one.name}: sigma times {one.factor:.3f}; since the start: {sigma}")
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
    add("--model", type=Path, metavar="FILE", help="last model; its covariance is where --improve starts")
    add("--count", type=int, default=5, help="how many passes to advise (default: 5)")
    add("--orbit-prior", dest="orbit_prior_m", type=float, default=200.0, metavar="M",
        help="orbit error of each pass that the next fit allows for (default: 200; 0: none)")  # fmt: skip
    return parser


def request_with(
    *, arc: list[float], spacing: float, sigma: float | None, settle: float, station: Station, **others: Any
) -> CampaignRequest:
    """Return the request of the options."""
    sigma_rad = station.calibrator.sigma_rad if sigma is None else sigma * MDEG
    rules = ArcRules(arcs_s=tuple(arc), spacing_s=spacing, sigma_rad=sigma_rad)
    return CampaignRequest(rules=rules, slew=Slew(settle_s=settle), station=station, **others)


request_from = partial(requested, arguments, request_with)
"""Returns the request of a command line."""


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing plan_calibration`."""
    with ending_with_reason(PROGRAM):
        request = request_from(argv)
        candidates = request.candidates()
        sys.exit(advice(request, candidates) if request.improve else campaign(request, candidates))
