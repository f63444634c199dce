"""The plan of a network: one owner at a time, certificates of each antenna, handovers, maintenance and bands."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from rf_pointing.core.constants import EARTH_MU_M3_S2
from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, moon
from rf_pointing.station.pointing.certificates import planned_certificate
from rf_pointing.station.pointing.multi_satellite_plan import DayPass, Fate, PlannedAntenna, Wish, plan_day
from rf_pointing.station.pointing.network_plan import NetworkDay, plan_days
from test.station.pointing.test_multi_satellite_plan import RULES

START_S = 1151347200.0
LEAST_RAD = math.radians(5.0)
REST = (0.0, 1.2)


def antenna(latitude_deg: float, longitude_deg: float, **more: object) -> PlannedAntenna:
    place = Site(latitude_rad=math.radians(latitude_deg), longitude_rad=math.radians(longitude_deg), altitude_m=500.0)
    given = {"rules": RULES, "encoder_rad": REST, "least_rad": LEAST_RAD, "of_band": {"X": RULES}} | more
    return PlannedAntenna(site=place, **given)  # type: ignore[arg-type]


WEST, EAST = antenna(35.0, -117.0), antenna(33.0, -105.0)


@pytest.fixture(scope="module")
def satellites() -> list[Elements]:
    """Return twelve low satellites."""
    rng = np.random.Generator(np.random.PCG64(11))
    made = []
    for number in range(1, 13):
        angles = rng.uniform(0.0, math.tau, 3)
        made.append(
            Elements(
                name=f"S{number}", catalogue_number=number, epoch_t_s=START_S - 3600.0,
                inclination_rad=rng.uniform(0.9, 1.8), ascending_node_rad=angles[0], eccentricity=0.001,
                argument_of_perigee_rad=angles[1], mean_anomaly_rad=angles[2], drag_per_earth_radius=1e-5,
                mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / (6.378e6 + rng.uniform(500e3, 900e3)) ** 3),
            )
        )  # fmt: skip
    return made


def planned(wishes: list[Wish], antennas: list[PlannedAntenna], hours: float = 8.0, **more: object) -> NetworkDay:
    names = [f"A{k}" for k in range(len(antennas))]
    given = {"names": names, "clear": [1.0] * len(antennas), "gap_s": 10.0} | more
    return plan_days(wishes, antennas, START_S, hours * 3600.0, **given)  # type: ignore[arg-type]


def tracked(found: NetworkDay, k: int) -> list[DayPass]:
    return [item for item in found.days[k].passes if item.fate is Fate.TRACKED]


def test_a_satellite_has_one_owner_and_each_antenna_time_for_its_slews(satellites: list[Elements]) -> None:
    found = planned([Wish(target=one, priority=one.catalogue_number % 2) for one in satellites], [WEST, EAST])
    assert found.better_by < 0.01
    for k, one in enumerate((WEST, EAST)):
        free_s, place = START_S, REST
        for item in tracked(found, k):
            assert item.certificate is not None
            track = TopocentricTrack(item.window.target, one.site)
            again, _ = planned_certificate(track, item.window, free_s, place, RULES)
            assert again.chosen is not None
            free_s, place = item.window.los_t_s, again.chosen.end_rad
    both = [item for k in (0, 1) for item in tracked(found, k)]
    assert min(len(tracked(found, k)) for k in (0, 1)) > 5
    for first, then in itertools.combinations(both, 2):
        apart_s = max(first.window.aos_t_s, then.window.aos_t_s) - min(first.window.los_t_s, then.window.los_t_s)
        assert first.window.target is not then.window.target or apart_s > -0.01
    # A handover takes no time from the contact: one antenna begins where the other ends.
    met = [
        (first, then) for first, then in itertools.permutations(both, 2)
        if first.window.target is then.window.target and abs(first.window.los_t_s - then.window.aos_t_s) < 0.01
    ]  # fmt: skip
    assert met
    for first, then in met:
        looks = [TopocentricTrack(first.window.target, one.site).target_at(then.window.aos_t_s) for one in (WEST, EAST)]
        assert looks[0].elevation_rad == pytest.approx(looks[1].elevation_rad, abs=0.02)
    reasons = [item.reason for day in found.days for item in day.passes if item.fate is Fate.YIELDS]
    assert any(reason.startswith("tracked by A") for reason in reasons)


def test_a_network_of_one_is_the_plan_of_its_antenna(satellites: list[Elements]) -> None:
    wishes = [Wish(target=one) for one in satellites]
    (mine,) = planned(wishes, [WEST]).days
    alone = plan_day(wishes, WEST, START_S, 8.0 * 3600.0, gap_s=10.0)

    def worth(day: object) -> float:
        rows = [item for item in day.passes if item.fate is Fate.TRACKED]  # type: ignore[attr-defined]
        return sum(0.2 + math.sin(item.window.peak_elevation_rad) for item in rows)

    assert worth(mine) == pytest.approx(worth(alone), rel=1e-3)


def test_what_never_sets_for_all_is_handed_round_without_a_gap() -> None:
    places = [antenna(-10.0, longitude) for longitude in (-120.0, 0.0, 120.0)]
    found = planned([Wish(target=moon())], places, 30.0)
    turns = sorted((item.window.aos_t_s, item.window.los_t_s, k) for k in range(3) for item in tracked(found, k))
    assert len(turns) >= 3
    for (_, los_s, first), (aos_s, _, then) in itertools.pairwise(turns):
        assert first != then
        assert aos_s == pytest.approx(los_s, abs=0.01)
    # After the first slew to it the Moon is never left.
    assert turns[-1][1] - turns[0][0] > 30.0 * 3600.0 - 400.0


def test_a_stay_that_fits_no_turn_is_tracked_as_its_certificate_unwinds() -> None:
    limits = RULES.limits.replace(azimuth_min_rad=-math.pi, azimuth_max_rad=math.pi)
    one = antenna(48.0, 9.0, rules=dataclasses.replace(RULES, limits=limits))
    found = planned([Wish(target=moon())], [one], 30.0)
    # In the south the Moon crosses the end of the travel.
    alone = plan_day([Wish(target=moon())], one, START_S, 30.0 * 3600.0, gap_s=10.0)
    assert len(tracked(found, 0)) == sum(item.fate is Fate.TRACKED for item in alone.passes) > 0


def test_nothing_is_tracked_in_maintenance_and_the_other_antenna_takes_over(satellites: list[Elements]) -> None:
    closed = ((START_S + 7200.0, START_S + 18000.0),)
    wishes = [Wish(target=one) for one in satellites]
    found = planned(wishes, [dataclasses.replace(WEST, closed=closed), EAST])
    for item in found.days[0].passes:
        assert item.window.los_t_s <= closed[0][0] + 0.01 or item.window.aos_t_s >= closed[0][1] - 0.01
    within = [item for item in tracked(found, 1) if closed[0][0] <= item.window.tca_t_s <= closed[0][1]]
    free = [
        item
        for item in tracked(planned(wishes, [WEST, EAST]), 1)
        if closed[0][0] <= item.window.tca_t_s <= closed[0][1]
    ]
    assert sum(item.window.duration_s for item in within) > sum(item.window.duration_s for item in free)
    # The first pass afterwards is certified from the rest of the antenna.
    first = next(item for item in tracked(found, 0) if item.window.aos_t_s >= closed[0][1] - 0.01)
    assert first.certificate is not None
    assert first.certificate.issued_t_s == closed[0][1]


def test_contact_that_is_owed_moves_passes_to_the_satellite_that_lacks_it(satellites: list[Elements]) -> None:
    def contact_s(found: NetworkDay, one: Elements) -> float:
        return sum(item.window.duration_s for item in tracked(found, 0) if item.window.target is one)

    wishes = [Wish(target=one) for one in satellites]
    before = planned(wishes, [WEST])
    least = min((one for one in satellites if any(i.window.target is one for i in before.days[0].passes)),
                key=lambda one: contact_s(before, one))  # fmt: skip
    offered_s = sum(i.window.duration_s for i in before.days[0].passes if i.window.target is least)
    assert contact_s(before, least) < offered_s
    owed = [dataclasses.replace(wish, contact_s=3.0 * offered_s * (wish.target is least)) for wish in wishes]
    assert contact_s(planned(owed, [WEST]), least) > contact_s(before, least)


def test_a_wish_with_a_band_goes_to_antennas_that_have_it_and_clouds_cost_worth(satellites: list[Elements]) -> None:
    narrow = dataclasses.replace(RULES, machine=RULES.machine.replace(half_power_beamwidth_rad=1e-3))
    has_ka = antenna(33.0, -105.0, of_band={"X": RULES, "Ka": narrow})
    wishes = [Wish(target=one, band="Ka") for one in satellites]
    found = planned(wishes, [WEST, has_ka])
    assert not found.days[0].passes
    chosen = tracked(found, 1)
    assert chosen
    assert all(i.certificate and i.certificate.machine.half_power_beamwidth_rad == 1e-3 for i in chosen)
    # Two antennas at one place: the one below the clearer sky has the satellites.
    twins = planned([Wish(target=satellites[0])], [WEST, WEST], clear=[0.4, 0.9])
    assert [len(tracked(twins, k)) > 0 for k in (0, 1)] == [False, True]
