"""The plan of a day: certificates of all that is tracked, mask, Sun and travel, and reasons for the rest."""

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rf_pointing import planning
from rf_pointing.api.plan import table_text
from rf_pointing.calibration import BiasModel
from rf_pointing.core import EARTH_MU_M3_S2, MU
from rf_pointing.ephemeris import Elements, ElementUncertainty, TopocentricTrack, find_passes, moon, site
from rf_pointing.planning import HorizonMask
from rf_pointing.station.pointing.certificates import PlanningRules, planned_certificate
from rf_pointing.station.pointing.multi_satellite_plan import AntennaDay, DayPlan, Fate, PlannedAntenna, Wish, plan_day

START_S = 1151347200.0
PLACE = site("Goldstone DSS-13")
LEAST_RAD = math.radians(5.0)
RULES = PlanningRules(
    model=BiasModel.zero(), machine=planning.MachineParams(), limits=planning.AxisLimits(),
    mask=HorizonMask(), gate=planning.GateParams(), lag_averaging_s=0.0,
)  # fmt: skip
HILL = HorizonMask(
    azimuth_rad=tuple(np.radians([0.0, 150.0, 180.0, 210.0])), elevation_rad=tuple(np.radians([3.0, 3.0, 22.0, 3.0]))
)


@pytest.fixture(scope="module")
def satellites() -> list[Elements]:
    """Return thirty low satellites."""
    rng = np.random.Generator(np.random.PCG64(7))
    made = []
    for number in range(1, 31):
        angles = rng.uniform(0.0, 2.0 * math.pi, 3)
        made.append(
            Elements(
                name=f"S{number}", catalogue_number=number, epoch_t_s=START_S - rng.uniform(0.0, 86400.0),
                inclination_rad=rng.uniform(0.6, 1.8), ascending_node_rad=angles[0], eccentricity=0.001,
                argument_of_perigee_rad=angles[1], mean_anomaly_rad=angles[2], drag_per_earth_radius=1e-5,
                mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / (6.378e6 + rng.uniform(450e3, 1200e3)) ** 3),
            )
        )  # fmt: skip
    return made


def antenna(rules: PlanningRules = RULES, place: tuple[float, float] = (0.0, 1.2)) -> PlannedAntenna:
    return PlannedAntenna(site=PLACE, rules=rules, encoder_rad=place, least_rad=LEAST_RAD)


def day(satellites: list[Elements], rules: PlanningRules = RULES, hours: float = 12.0, **options: float) -> DayPlan:
    wishes = [Wish(target=one, priority=one.catalogue_number % 3) for one in satellites]
    return plan_day(wishes, antenna(rules), START_S, hours * 3600.0, **options)


@pytest.mark.parametrize("swept_deg2_s", [0.0, 0.02])
@pytest.mark.parametrize("beamwidth_deg", [0.3, 3.0])
def test_a_pass_counts_the_share_that_targets_drawn_by_the_law_of_their_age_give(
    satellites: list[Elements], swept_deg2_s: float, beamwidth_deg: float
) -> None:
    machine = planning.MachineParams(half_power_beamwidth_rad=math.radians(beamwidth_deg))
    rules = dataclasses.replace(RULES, machine=machine, swept_rad2_s=swept_deg2_s * math.radians(1.0) ** 2)
    old = [dataclasses.replace(one, epoch_t_s=one.epoch_t_s - 8.0 * 86400.0) for one in satellites]
    plan = AntennaDay([Wish(target=one) for one in old], antenna(rules), START_S, 3.6e4, gap_s=0.0, max_age_s=864000.0)
    rng = np.random.Generator(np.random.PCG64(3))
    for window in plan.wanted[:8]:
        sigmas_m = np.array(ElementUncertainty().sigmas_m(window.tca_t_s - window.target.epoch_t_s)[:2])
        along, cross = sigmas_deg = np.degrees(sigmas_m / window.tca_range_m)
        off = sigmas_deg * rng.standard_normal((40000, 2))
        expected = np.exp(-MU * np.sum(off**2, axis=1) / beamwidth_deg**2)
        if swept_deg2_s:
            # A search takes the directions in order of their probability, a strip not below the beam.
            cross = max(cross, 0.25 * beamwidth_deg)
            levels = math.pi * along * cross * np.sum((off / sigmas_deg) ** 2, axis=1)
            found_s = np.maximum(levels - 0.25 * math.pi * beamwidth_deg**2, 0.0) / swept_deg2_s
            expected = 1.0 - found_s / window.duration_s
        share = plan.candidate(window).share
        assert share == pytest.approx(max(0.0, float(np.mean(expected))), abs=0.02)
        assert share < 0.5 or beamwidth_deg > 1.0 or swept_deg2_s


def test_tracked_passes_have_certificates_that_follow_on_each_other(satellites: list[Elements]) -> None:
    plan = day(satellites)
    tracked = [item for item in plan.passes if item.fate is Fate.TRACKED]
    assert len(tracked) > 20
    free_s, place = START_S, (0.0, 1.2)
    for item in tracked:
        assert item.certificate is not None
        branch = item.certificate.chosen
        assert branch is not None
        assert item.window.aos_t_s >= free_s
        # Issued where the antenna is when the pass before ends, and in time for the slew from there.
        assert item.certificate.issued_t_s == free_s
        track = TopocentricTrack(item.window.target, PLACE)
        again, _ = planned_certificate(track, item.window, free_s, place, RULES)
        assert again.chosen is not None
        assert again.chosen.label == branch.label
        assert again.chosen.lost_s == pytest.approx(branch.lost_s, abs=0.05)
        free_s, place = item.window.los_t_s, branch.end_rad
    assert all(item.reason for item in plan.passes if item.fate is not Fate.TRACKED)
    assert not any(item.reason for item in tracked)


def test_a_hill_cuts_passes_where_the_search_of_one_satellite_does(satellites: list[Elements]) -> None:
    rules = dataclasses.replace(RULES, mask=HILL)
    plan = day(satellites, rules)
    count = 0
    for one in satellites:
        mine = [item.window for item in plan.passes if item.window.target is one]
        wanted = find_passes(TopocentricTrack(one, PLACE), START_S, 12.0 * 3600.0, HILL.above(LEAST_RAD))
        # One that lasts already is joined after the slew to it.
        first = int(bool(wanted) and wanted[0].rises_before)
        assert [w.aos_t_s for w in mine[first:]] == pytest.approx([w.aos_t_s for w in wanted[first:]], abs=0.05)
        assert [w.los_t_s for w in mine] == pytest.approx([w.los_t_s for w in wanted], abs=0.05)
        peaks = [w.peak_elevation_rad for w in wanted[first:]]
        assert [w.peak_elevation_rad for w in mine[first:]] == pytest.approx(peaks, abs=1e-5)
        assert [(w.rises_before, w.sets_after) for w in mine] == [(w.rises_before, w.sets_after) for w in wanted]
        count += len(wanted)
    assert count > len(day(satellites).passes) * 0.9


def test_a_pass_through_the_sun_is_barred_and_the_plan_is_made_without_it(satellites: list[Elements]) -> None:
    free = day(satellites)
    tracked = [item for item in free.passes if item.fate is Fate.TRACKED and item.profile is not None]
    by_angle = min(tracked, key=lambda item: float(item.profile.sun_angle_rad().min()))
    angle_rad = float(by_angle.profile.sun_angle_rad().min())
    machine = RULES.machine.replace(sun_radius_rad=min(angle_rad + 1e-3, 0.5))
    assert angle_rad < 0.4
    plan = day(satellites, dataclasses.replace(RULES, machine=machine))
    (same,) = (
        i
        for i in plan.passes
        if i.window.target is by_angle.window.target and i.window.aos_t_s == by_angle.window.aos_t_s
    )
    assert same.fate is Fate.BARRED
    assert "deg from the Sun, must be >=" in same.reason


def test_a_keyhole_is_counted_and_bars_a_pass_of_a_slow_antenna(satellites: list[Elements]) -> None:
    certified = [i for i in day(satellites, hours=24.0).passes if i.certificate]
    crossing = [(i, i.certificate.chosen.crossing) for i in certified]
    high = [i for i, found in crossing if found is not None and not found.at_stop]
    assert high
    assert all(i.window.tca_azimuth_rate_rad_s > RULES.machine.planned.rate_rad_s[0] for i in high)
    slow = RULES.machine.replace(rate_limit_rad_s=(math.radians(0.3),) * 2, least_share=0.99)
    plan = day(satellites, dataclasses.replace(RULES, machine=slow))
    barred = [item for item in plan.passes if "would be lost" in item.reason]
    assert barred
    assert all(item.fate is Fate.BARRED for item in barred)


def test_an_object_that_never_sets_is_tracked_between_the_others(satellites: list[Elements]) -> None:
    still = dataclasses.replace(
        satellites[0], inclination_rad=1e-4, eccentricity=1e-4, mean_motion_rad_s=2.0 * math.pi / 86164.1,
        catalogue_number=99, name="GEO",
    )  # fmt: skip
    for node in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False):
        placed = dataclasses.replace(still, ascending_node_rad=float(node))
        plan = day([placed])
        if plan.passes:
            break
    (item,) = plan.passes
    assert (item.fate, item.window.rises_before, item.window.sets_after) == (Fate.TRACKED, True, True)
    # All but the slew from where the antenna is.
    assert 12.0 * 3600.0 - 220.0 < item.window.duration_s <= 12.0 * 3600.0
    low = [Wish(target=one, priority=1) for one in satellites[:3]]
    alone, plan = (plan_day(wishes, antenna(), START_S, 12.0 * 3600.0) for wishes in (low, [Wish(target=placed), *low]))
    tracked = [item for item in plan.passes if item.fate is Fate.TRACKED]
    pieces = [item.window for item in tracked if item.window.name == "GEO"]
    others = [item.window for item in tracked if item.window.name != "GEO"]
    assert others == [item.window for item in alone.passes if item.fate is Fate.TRACKED]
    assert len(pieces) > 3
    # All but the passes of the others and two slews for each of them.
    spent_s = sum(window.duration_s for window in (*pieces, *others))
    assert 12.0 * 3600.0 - 600.0 - 2 * 220.0 * len(others) < spent_s <= 12.0 * 3600.0


@given(share=st.floats(0.0, 0.7), azimuth_rad=st.floats(-3.0, 3.0))
@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_pass_in_progress_is_joined_as_soon_as_the_slew_allows(
    satellites: list[Elements], share: float, azimuth_rad: float
) -> None:
    satellite, axes = satellites[0], RULES.machine.axes
    track = TopocentricTrack(satellite, PLACE)
    whole = max(find_passes(track, START_S, 43200.0, LEAST_RAD), key=lambda w: w.duration_s)
    start_s, place = whole.aos_t_s + share * whole.duration_s, (azimuth_rad, 1.2)
    plan = plan_day([Wish(target=satellite)], antenna(place=place), start_s, 3600.0)

    def late_s(t_s: float) -> float:
        (left,) = find_passes(track, t_s, whole.los_t_s - t_s, LEAST_RAD)
        path = left.aos_azimuth_rad, left.azimuth_min_rad, left.azimuth_max_rad, left.los_azimuth_rad
        turns = planning.turns_within(RULES.limits, path, (track.target_at(t_s).elevation_rad, LEAST_RAD))
        return start_s + min(axes.slew_s(place, begin) for begin, _ in turns) - t_s

    item = plan.passes[0]
    assert item.window.los_t_s == pytest.approx(whole.los_t_s, abs=0.1)
    assert late_s(item.window.aos_t_s) <= 0.0
    # It is joined no more than a step late.
    assert item.window.aos_t_s == start_s or late_s(max(start_s, item.window.aos_t_s - 40.0)) > -10.0
    assert item.fate is Fate.TRACKED or "would be lost" in item.reason


GEOSTATIONARY = Elements(
    name="GEO", catalogue_number=99, epoch_t_s=START_S, inclination_rad=0.001, ascending_node_rad=0.0, eccentricity=1e-5,
    argument_of_perigee_rad=0.0, mean_anomaly_rad=math.radians(75.0), drag_per_earth_radius=0.0,
    mean_motion_rad_s=7.2921159e-5,
)  # fmt: skip
"""It stays 49 deg high in the south of the antenna."""


@pytest.mark.parametrize("body", [moon(), GEOSTATIONARY], ids=["Moon", "GEO"])
def test_what_stays_up_for_hours_fills_the_gaps_that_passes_leave(satellites: list[Elements], body: Any) -> None:
    bodies = [body]
    low = [Wish(target=one) for one in satellites[:6]]
    alone, plan = (
        plan_day(wishes, antenna(), START_S, 43200.0)
        for wishes in (low, [*(Wish(target=body) for body in bodies), *low])
    )
    names = {body.name for body in bodies}
    fillers = [item for item in plan.passes if item.window.name in names and item.fate is Fate.TRACKED]
    tracked = [item.window for item in plan.passes if item.fate is Fate.TRACKED]
    # No pass is given up for what is up for hours, not even of the same priority.
    assert [w for w in tracked if w.name not in names] == [
        item.window for item in alone.passes if item.fate is Fate.TRACKED
    ]
    assert len(fillers) > 3
    assert all(item.filler for item in fillers)
    # Also the first piece, where the body has just risen, and between passes on two turns.
    assert all(item in fillers for item in plan.passes if item.filler)
    hours = sum(item.window.duration_s for item in fillers) / 3600.0
    assert f"{body.name} is tracked in {len(fillers)} gaps, {hours:.1f} h" in table_text(plan)
    assert all(one.los_t_s <= other.aos_t_s for one, other in itertools.pairwise(tracked))
    stays = {body.name: find_passes(TopocentricTrack(body, PLACE), START_S, 43200.0, LEAST_RAD) for body in bodies}
    for item in fillers:
        begin_s, end_s = item.window.aos_t_s + 0.1, item.window.los_t_s - 0.1
        assert any(w.aos_t_s <= begin_s < end_s <= w.los_t_s for w in stays[item.window.name])
        number = getattr(body, "catalogue_number", None)
        assert (item.age_s == item.along_rad == 0.0, item.window.catalogue_number) == (number is None, number)


def test_the_expected_error_is_that_of_the_elements_age(satellites: list[Elements]) -> None:
    item = day(satellites).passes[-1]
    age_s = item.window.tca_t_s - item.window.target.epoch_t_s
    along_m = 700.0 + 1000.0 * age_s / 86400.0 + 200.0 * (age_s / 86400.0) ** 2
    target = TopocentricTrack(item.window.target, PLACE).target_at(item.window.tca_t_s)
    assert item.along_rad == pytest.approx(along_m / target.range_m, rel=1e-4)
