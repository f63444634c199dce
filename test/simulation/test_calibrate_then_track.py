"""A campaign over the beacons, a fit, and then program track alone: the sequence of scripts/calibrate without dynamics."""

import math

import numpy as np
import pytest

from rf_pointing.calibration import PassPriors, SectorRule, Slew, plan_campaign, read_model
from rf_pointing.core import MDEG, random_stream
from rf_pointing.ephemeris import TopocentricTrack, first_pass_above, site
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import StationSetup
from rf_pointing.station.campaign.log import CalibrationLog
from rf_pointing.station.campaign.plan import ArcRules, beacons, candidate_arcs, window_of
from rf_pointing.station.description import STATIONS
from test.simulation.kinematic_station import KinematicParams, KinematicStation

STATION = site("Goldstone DSS-13")
START_S = 1151193600.0


def rms_mdeg(misses: np.ndarray) -> float:
    """Return the rms of the distance from the target."""
    return float(np.sqrt(np.mean(np.sum(misses**2, axis=1)))) / MDEG


@pytest.fixture(scope="module")
def campaign() -> tuple:
    """Fly the campaign; return the station with the old model, the fit and the observations."""
    setup = StationSetup()
    mount = setup.sets("antenna_servo")["mount"].model()
    old = read_model(STATIONS / "bias_model_dss13_x.yaml").model
    random = random_stream(1, "c")
    station = KinematicStation(KinematicParams(), mount, old, random)
    sky = beacons(START_S)
    rules = ArcRules(arcs_s=(60.0, 120.0, 240.0), every_s=60.0, spacing_s=1.0, lowest_rad=0.19)
    candidates, _ = candidate_arcs(sky, STATION, START_S + 180.0, 2520.0, rules)
    plan = plan_campaign(candidates, SectorRule(fewest=12), Slew(settle_s=55.0))
    log = CalibrationLog("Goldstone DSS-13", "X", 0.5, 1.0 * MDEG, largest_error_rad=6.0 * MDEG, settle_s=25.0)
    by_name = {one.name: one for one in sky}
    for one in plan.passes:
        elements = by_name[one.name]
        window = window_of(one, elements, STATION, 45.0)
        station.track(TopocentricTrack(elements, STATION), window, sensor=True, log=log)
    fit = log.fit(old, pass_priors=PassPriors(along_track_m=5.0, cross_track_m=5.0, radial_m=5.0))
    return station, fit, plan


def test_the_campaign_covers_most_of_the_sky(campaign: tuple) -> None:
    _, fit, plan = campaign
    assert len(plan.coverage.thin) <= 9
    assert fit.passes >= len(plan.passes) - 1, "a pass may be edited away as a whole"


@pytest.mark.parametrize(("start", "peak_deg"), [(1151424000.0, 19.0), (None, 40.0)])
def test_program_track_alone_misses_little_where_it_missed_by_more_than_100_mdeg(
    campaign: tuple, start: float | None, peak_deg: float
) -> None:
    station, fit, _ = campaign
    source = SourceParams(satellite="28057")
    track = load_track(source)
    start_s = load_elements(source).epoch_t_s if start is None else start
    window = first_pass_above(
        track, start_s, math.radians(peak_deg), math.radians(10.0 if start is None else 16.0), 172800.0
    )
    settled = slice(round(60.0 / station.params.period_s), None)
    before = rms_mdeg(station.track(track, window, sensor=False)[settled])
    calibrated = KinematicStation(station.params, station.mount, fit.model, random_stream(1, "x"))
    after = rms_mdeg(calibrated.track(track, window, sensor=False)[settled])
    assert before > 100.0
    assert after < 5.0


def test_the_fit_finds_the_planted_mount_and_the_averaged_lags_by_their_expansion(campaign: tuple) -> None:
    """A lag x on a rate averaged over T is an acceleration lag of -x T beside itself."""
    station, fit, _ = campaign
    planted, found = station.mount.coefficients, fit.model.coefficients
    average_s = station.params.lag_averaging_s
    for axis, tolerance_s2 in (("azimuth", 0.3), ("elevation", 0.5)):
        lag_s = planted[f"{axis}_velocity_lag"]
        assert found[f"{axis}_velocity_lag"] == pytest.approx(lag_s, abs=0.01)
        expected = planted[f"{axis}_acceleration_lag"] - lag_s * average_s
        assert found[f"{axis}_acceleration_lag"] == pytest.approx(expected, abs=tolerance_s2)
    for name in ("azimuth_offset", "azimuth_encoder_sine", "azimuth_encoder_cosine", "mislevel_east", "mislevel_north"):
        assert found[name] == pytest.approx(planted[name], abs=1.0 * MDEG)
