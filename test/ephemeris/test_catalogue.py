"""Catalogue search: the single-object search as reference on random orbits, dips, cut passes and refused objects."""

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import EARTH_MU_M3_S2, random_stream, unit_vector_from_azel
from rf_pointing.core.dates import from_utc_text
from rf_pointing.ephemeris import (
    CatalogueSky,
    Elements,
    Site,
    TopocentricTrack,
    find_catalogue_passes,
    find_passes,
    site,
    verification_elements,
)

START_T_S = 1151347200.0
DAY_S = 86400.0
MASK_RAD = math.radians(5.0)
EVENT_S = 0.02
PEAK_RAD = 5e-6
"""Interpolation is good to 1 m, seen from 300 km or more."""


def random_orbits(count: int) -> list[Elements]:
    """Perigee 400 to 1500 km, half of them eccentric up to 0.7."""
    rng = random_stream(3, "catalogue orbits")
    orbits = []
    for number in range(1, count + 1):
        eccentricity = rng.uniform(0.0, 0.7) if number % 2 else rng.uniform(0.0, 0.01)
        axis_m = (6.378e6 + rng.uniform(400e3, 1500e3)) / (1.0 - eccentricity)
        angles = rng.uniform(0.0, 2.0 * math.pi, 3)
        orbits.append(
            Elements(
                name=f"orbit {number}", catalogue_number=number,
                epoch_t_s=START_T_S - rng.uniform(0.0, DAY_S),
                inclination_rad=rng.uniform(0.2, 1.9), ascending_node_rad=angles[0],
                eccentricity=eccentricity, argument_of_perigee_rad=angles[1],
                mean_anomaly_rad=angles[2], mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / axis_m**3),
                drag_per_earth_radius=1e-5,
            )
        )  # fmt: skip
    return orbits


def hills(azimuth_rad: np.ndarray) -> np.ndarray:
    """Return heights of up to 20 deg: they cut passes, part some, and hide others."""
    return 0.17 + 0.17 * np.sin(5.0 * azimuth_rad)


def level(azimuth_rad: np.ndarray) -> np.ndarray:
    return np.full_like(azimuth_rad, MASK_RAD)


@pytest.mark.parametrize(
    ("options", "horizon"),
    [
        ({}, level), ({}, hills), ({"light_time": "none", "refraction": None}, MASK_RAD),
        ({"light_time": "transmit"}, MASK_RAD),
    ],
)  # fmt: skip
def test_every_pass_is_that_of_the_single_search(options: dict, horizon: Any) -> None:
    """A level horizon is the mask of its height: there the search of one object takes the number."""
    orbits, place = random_orbits(8), site("Canberra DSS-43")
    found = find_catalogue_passes(orbits, place, START_T_S, DAY_S, horizon, **options)
    mask = MASK_RAD if horizon is level else horizon
    assert found.unsearched == ()
    assert len(found.passes) > 25
    assert [p.aos_t_s for p in found.passes] == sorted(p.aos_t_s for p in found.passes)
    for orbit in orbits:
        ours = [p for p in found.passes if p.target is orbit]
        wanted = find_passes(TopocentricTrack(orbit, place, **options), START_T_S, DAY_S, mask)
        assert len(ours) == len(wanted), orbit.name
        for mine, single in zip(ours, wanted, strict=True):
            assert mine.aos_t_s == pytest.approx(single.aos_t_s, abs=EVENT_S)
            assert mine.los_t_s == pytest.approx(single.los_t_s, abs=EVENT_S)
            assert mine.peak_elevation_rad == pytest.approx(single.peak_elevation_rad, abs=PEAK_RAD)
            assert math.cos(mine.aos_azimuth_rad - single.aos_azimuth_rad) > 1.0 - 1e-8
            assert math.cos(mine.los_azimuth_rad - single.los_azimuth_rad) > 1.0 - 1e-8
            assert (mine.rises_before, mine.sets_after) == (single.rises_before, single.sets_after)


def test_a_dip_below_the_mask_shorter_than_the_step_separates_two_passes() -> None:
    """A mask put just above the lowest point that an eccentric orbit reaches between two maxima."""
    place = site("Madrid DSS-63")
    orbit = dataclasses.replace(
        random_orbits(1)[0], inclination_rad=1.1, eccentricity=0.7, mean_motion_rad_s=2.0 * math.pi / 43000.0,
        argument_of_perigee_rad=4.9, ascending_node_rad=2.0,
    )  # fmt: skip
    track = TopocentricTrack(orbit, place)
    t_s = START_T_S + np.arange(0.0, DAY_S, 5.0)
    elevation = track.sample(t_s).elevation_rad
    dips = np.flatnonzero((elevation[1:-1] < elevation[:-2]) & (elevation[1:-1] < elevation[2:])) + 1
    lowest = [float(elevation[i]) for i in dips if elevation[i] > 0.2]
    assert lowest
    mask = lowest[0] + 2e-6
    ours = find_catalogue_passes([orbit], place, START_T_S, DAY_S, mask).passes
    wanted = find_passes(track, START_T_S, DAY_S, mask)
    gaps = [b.aos_t_s - a.los_t_s for a, b in itertools.pairwise(wanted)]
    assert min(gaps) < 200.0
    np.testing.assert_allclose([p.aos_t_s for p in ours], [p.aos_t_s for p in wanted], rtol=0.0, atol=0.5)
    np.testing.assert_allclose([p.los_t_s for p in ours], [p.los_t_s for p in wanted], rtol=0.0, atol=0.5)


def test_objects_that_cannot_be_searched_are_listed_with_the_reason(goldstone: Site) -> None:
    elements = verification_elements()
    found = find_catalogue_passes(elements, goldstone, START_T_S, DAY_S, MASK_RAD)
    reasons = {one.catalogue_number: reason for one, reason in found.unsearched}
    assert "days from its epoch, must be <= 14.00 days" in reasons[88888]
    assert reasons[28350].endswith("outside the usable span of COSMOS 2405: any time to 2006-06-17T05:45:46.673Z")
    searched = {p.target.catalogue_number for p in found.passes}
    assert 28057 in searched
    assert not searched & set(reasons)


def test_the_sky_is_that_of_the_single_search_and_what_it_cannot_know_points_down(goldstone: Site) -> None:
    """Where nothing is looked for; object 28350 cannot be propagated to that day."""
    sky = CatalogueSky(verification_elements(), goldstone, START_T_S)
    directions, known = sky.directions(START_T_S + np.array([0.0, 30.0]))
    lost = [row for row, one in enumerate(sky.elements) if one.catalogue_number == 28350]
    assert len(lost) == 1
    assert not known[lost[0]]
    for row, one in enumerate(sky.elements):
        if not known[row]:
            np.testing.assert_array_equal(directions[row], [[0.0, 0.0, -1.0]] * 2)
            continue
        track = TopocentricTrack(one, goldstone, refraction=None)
        sample = track.sample(np.array([START_T_S + 30.0]))
        wanted = unit_vector_from_azel(float(sample.azimuth_rad[0]), float(sample.elevation_rad[0]))
        np.testing.assert_allclose(directions[row, 1], wanted, atol=1e-6)
    assert np.count_nonzero(known) > 3


@pytest.mark.parametrize("elevation_rad", [-0.0101, 1.571])
def test_an_elevation_that_no_pass_is_sought_above_is_refused(elevation_rad: float, goldstone: Site) -> None:
    with pytest.raises(ValueError, match="min_elevation_rad="):
        find_catalogue_passes([], goldstone, START_T_S, DAY_S, elevation_rad)
    for taken_rad in (-0.01, 0.5 * math.pi):
        assert find_catalogue_passes([], goldstone, START_T_S, DAY_S, taken_rad).passes == ()


def test_elements_from_before_a_leap_second_are_moved_by_it(cbers: Elements, goldstone: Site) -> None:
    """Epoch 2005-12-31, search on 2006-01-04: the second of 2006-01-01 lies between."""
    before = dataclasses.replace(cbers, epoch_t_s=from_utc_text("2005-12-31T12:00:00"))
    start = from_utc_text("2006-01-04T00:00:00")
    ours = find_catalogue_passes([before], goldstone, start, DAY_S, MASK_RAD).passes
    wanted = find_passes(TopocentricTrack(before, goldstone), start, DAY_S, MASK_RAD)
    np.testing.assert_allclose([p.aos_t_s for p in ours], [p.aos_t_s for p in wanted], rtol=0.0, atol=EVENT_S)
    with pytest.raises(ValueError, match=r"a leap second lies within 2 days .* use find_passes"):
        find_catalogue_passes([before], goldstone, start - 3.0 * DAY_S, DAY_S, MASK_RAD)


def test_what_a_pass_of_the_catalogue_states_is_what_the_track_of_its_object_does() -> None:
    orbits, place = random_orbits(6), site("Canberra DSS-43")
    checked = 0
    for one in find_catalogue_passes(orbits, place, START_T_S, DAY_S, MASK_RAD).passes:
        track = TopocentricTrack(one.target, place)
        peak = track.target_at(one.tca_t_s)
        assert one.name == one.target.name
        assert one.duration_s == one.los_t_s - one.aos_t_s
        assert math.cos(one.tca_azimuth_rad - peak.azimuth_rad) > 1.0 - 1e-7
        assert one.tca_range_m == pytest.approx(peak.range_m, rel=1e-5)
        assert one.tca_azimuth_rate_rad_s == pytest.approx(abs(peak.azimuth_rate_rad_s), rel=1e-3)
        for t_s, elevation_rad in ((one.aos_t_s, one.aos_elevation_rad), (one.los_t_s, one.los_elevation_rad)):
            assert elevation_rad == pytest.approx(track.target_at(t_s).elevation_rad, abs=PEAK_RAD)
        azimuth = track.sample(np.linspace(one.aos_t_s, one.los_t_s, 400)).azimuth_rad
        first, smallest, largest, last = one.azimuth_path_rad
        turn = first - azimuth[0]
        assert math.cos(turn) > 1.0 - 1e-7
        assert last - first == pytest.approx(azimuth[-1] - azimuth[0], abs=1e-4)
        # Thirteen places along the pass miss little of how far it goes.
        assert smallest - turn == pytest.approx(float(np.min(azimuth)), abs=0.05)
        assert largest - turn == pytest.approx(float(np.max(azimuth)), abs=0.05)
        checked += 1
    assert checked > 15


def test_angles_of_a_pass_of_the_catalogue_are_apparent_with_refraction_and_true_without(
    cbers: Elements, goldstone: Site
) -> None:
    lifted, plain = (
        find_catalogue_passes([cbers], goldstone, START_T_S, DAY_S, MASK_RAD, refraction=air).passes
        for air in ("standard", None)
    )
    air = TopocentricTrack(cbers, goldstone).refraction
    for one, other in zip(lifted, plain, strict=True):
        assert one.aos_elevation_rad == pytest.approx(MASK_RAD, abs=1e-5)
        assert other.aos_elevation_rad == pytest.approx(MASK_RAD, abs=1e-5)
        # Seen earlier by the time in which it climbs by the refraction, about 0.16 deg here.
        assert 0.5 < other.aos_t_s - one.aos_t_s < 30.0
        assert one.peak_elevation_rad == pytest.approx(float(air.apply(other.peak_elevation_rad)), abs=1e-6)
