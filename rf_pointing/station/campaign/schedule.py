"""The passes of a calibration: first those that fill the sky, then those that judge the fit.

The second ones are tracked with the new model in the shadow of the old one, after the campaign, on
passes that the fit has not seen.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration import (
    AcceptanceRules,
    Campaign,
    FitResult,
    Observations,
    PassPriors,
    SectorRule,
    Slew,
    plan_campaign,
    read_model,
)
from rf_pointing.core import IntArray, Params, parameter, utc_text
from rf_pointing.ephemeris import Elements, Pass
from rf_pointing.station.campaign.calibrator import journal_of
from rf_pointing.station.campaign.log import CalibrationLog
from rf_pointing.station.campaign.model_keeper import ModelKeeper
from rf_pointing.station.campaign.plan import ArcRules, candidate_arcs, window_of
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.description import StationDescription

ARCS_S = (60.0, 120.0, 240.0)
"""Lengths of the pieces of passes that the plan chooses from."""
SHADOW_ARCS_S = (60.0,)
LARGEST_SLEW_S = 180.0
"""From the end of a pass, or from the start, to the first point of the next one."""
SPACING_S = 0.5
"""Time between two observations."""
SETTLE_S = 25.0
"""Valid errors before the first observation: the lags follow changes of rate over 10 s."""
ACQUISITION_S = 45.0
"""From the start of a pass until the search is over and the lags of the mount have settled."""


@dataclass(frozen=True, kw_only=True)
class CampaignParams(Params):
    """How much of the sky a calibration observes, and how its model is judged."""

    longest_s: float = parameter(4800.0, "length of the campaign at most", 60.0, 86400.0)
    fewest: int = parameter(25, "observations in each sector", low=1)
    acceptance_passes: int = parameter(3, "passes in the shadow before a model is accepted", 2, 20)
    acceptance_span_s: float = parameter(1800.0, "time in which these are found", 60.0, 86400.0)
    orbit_prior_m: float = parameter(5.0, "error of the orbits that the fit allows for in each pass", 0.01, 1e6)

    def calibrator_parameters(self) -> dict[str, dict[str, float | int | str | bool]]:
        """Return the parameters of `bias_calibrator` for this campaign, by their sets."""
        return {
            "orbit": {f"{name}_m": self.orbit_prior_m for name in ("along_track", "cross_track", "radial")},
            "calibrator": {"spacing_s": SPACING_S, "settle_s": SETTLE_S},
            "shadow": {"fewest_passes": self.acceptance_passes, "accept": "better"},
        }


@dataclass(frozen=True, eq=False)
class CalibrationSchedule:
    """The passes to track: `windows` for the fit (none when the sky is full), then the others."""

    elements: list[Elements]
    campaign: Campaign
    windows: list[Pass]
    acceptance_passes: list[Pass]

    def __str__(self) -> str:
        coverage, judging = self.campaign.coverage, self.acceptance_passes
        filled = f"{coverage.rule.count - len(coverage.thin)} of {coverage.rule.count} sectors"
        last = f"{len(judging)} more in the shadow until {utc_text(judging[-1].los_t_s)}"
        if not self.windows:
            return f"{filled} are full already; {last}"
        first, end = utc_text(self.windows[0].aos_t_s), utc_text(self.windows[-1].los_t_s)
        return f"{len(self.windows)} passes from {first} to {end} fill {filled}; {last}"


def schedule_calibration(
    station: StationDescription, elements: list[Elements], start_s: float, params: CampaignParams,
    kept: Observations | None = None,
) -> CalibrationSchedule:  # fmt: skip
    """Return the passes to track from `start_s` on, and after the last of the `kept` observations.

    Raises ValueError when there are too few of them.
    """
    rule = SectorRule(fewest=params.fewest, most=max(30, params.fewest))
    filled = rule.coverage(*kept.sky_rad()).counts if kept is not None else None
    begin_s = max(start_s, float(np.max(kept.t_s)) if kept is not None else start_s) + LARGEST_SLEW_S
    campaign = _planned(station, elements, begin_s, params.longest_s, ARCS_S, rule, filled)
    if not campaign.passes and campaign.coverage.thin:
        raise ValueError(f"longest={params.longest_s} s leaves no satellite to track")
    windows = _windows_of(station, elements, campaign)
    begin_s = (windows[-1].los_t_s if windows else begin_s) + LARGEST_SLEW_S
    rest = _planned(station, elements, begin_s, params.acceptance_span_s, SHADOW_ARCS_S, rule)
    judging = _windows_of(station, elements, rest)[: params.acceptance_passes]
    if len(judging) < params.acceptance_passes:
        raise ValueError(
            f"shadow={params.acceptance_passes}: only {len(judging)} passes can be tracked after the campaign"
        )
    return CalibrationSchedule(elements, campaign, windows, judging)


def _planned(
    station: StationDescription, elements: list[Elements], begin_s: float, span_s: float,
    arcs_s: tuple[float, ...], rule: SectorRule, filled: IntArray | None = None,
) -> Campaign:  # fmt: skip
    """Return the campaign of pieces within `span_s` that fills what `filled` leaves thin."""
    rules = ArcRules(
        arcs_s=arcs_s, every_s=60.0, spacing_s=SPACING_S, lowest_rad=math.radians(11.0), lead_s=ACQUISITION_S
    )
    mount, travel_deg = kinematics_of(station.content), [axis.travel_deg for axis in station.content.mount.pair]
    ends = tuple(np.radians(travel_deg).ravel().tolist())
    if not mount.level:
        rules = rules.replace(travel_rad=ends)
    candidates, _ = candidate_arcs(elements, station.site, begin_s, span_s, rules, mount)
    slew = Slew(settle_s=ACQUISITION_S + 10.0, travel_rad=ends[:2])
    return plan_campaign(candidates, rule, slew, filled)


def _windows_of(station: StationDescription, elements: list[Elements], campaign: Campaign) -> list[Pass]:
    """Return the passes to track, each from its acquisition on."""
    by_name = {one.name: one for one in elements}
    return [window_of(one, by_name[one.name], station.site, ACQUISITION_S) for one in campaign.passes]


def fit_of_kept(
    station: StationDescription, band: str, folder: str, orbit_prior_m: float
) -> tuple[Observations, FitResult]:
    """Return the observations on the disk and the fit that the calibrator makes of them."""
    mount = kinematics_of(station.content)
    journal = journal_of(folder, station.name, band, mount)
    sigma_rad = station.sets("bias_calibrator", band)["calibrator"].sigma_rad
    log = CalibrationLog(station.name, band, SPACING_S, sigma_rad, journal=journal, mount=mount)
    points, file = log.observations(), station.bias_model_file(band)
    start = read_model(file) if file else None
    keeper = ModelKeeper(station.name, band, folder, start, AcceptanceRules(), mount)
    keeper.begin(float(np.max(points.t_s)))
    return points, log.fit(keeper.model, pass_priors=PassPriors.of_orbit(orbit_prior_m))
