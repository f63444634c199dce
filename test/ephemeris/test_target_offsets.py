"""The operator's offsets: each moves the target by what it says; sets are kept by name."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import Elements, Site, TopocentricTrack
from rf_pointing.ephemeris.target_offsets import OFFSETS, OffsetSets, TargetOffsets

PASS_S = 1151431000.0
"""CBERS-2 over Goldstone, near the middle of a pass."""
SIZE_RAD, SIZE_S = math.radians(0.3), 2.0


@pytest.fixture(scope="module")
def plain(cbers: Elements, goldstone: Site) -> TopocentricTrack:
    return TopocentricTrack(cbers, goldstone, refraction=None)


def direction(track: TopocentricTrack, t_s: float) -> np.ndarray:
    """Return the unit vector east, north, up."""
    seen = track.target_at(t_s)
    e = math.cos(seen.elevation_rad)
    return np.array([e * math.sin(seen.azimuth_rad), e * math.cos(seen.azimuth_rad), math.sin(seen.elevation_rad)])


def equatorial(vector: np.ndarray, site: Site) -> tuple[float, float]:
    """Return local right ascension (rad, from the meridian, east positive) and declination."""
    east, north, up = vector
    pole = north * math.cos(site.latitude_rad) + up * math.sin(site.latitude_rad)
    south = up * math.cos(site.latitude_rad) - north * math.sin(site.latitude_rad)
    return math.atan2(east, south), math.asin(pole)


def test_right_ascension_and_declination_are_added_to_those_of_date(plain: TopocentricTrack) -> None:
    right, declination = equatorial(direction(plain, PASS_S), plain.site)
    for offsets, wanted in (
        ({"right_ascension_offset_rad": SIZE_RAD}, (right + SIZE_RAD, declination)),
        ({"declination_offset_rad": -SIZE_RAD}, (right, declination - SIZE_RAD)),
        (
            {"right_ascension_offset_rad": -SIZE_RAD, "declination_offset_rad": SIZE_RAD},
            (right - SIZE_RAD, declination + SIZE_RAD),
        ),
    ):
        found = equatorial(direction(plain.with_offsets(**offsets), PASS_S), plain.site)
        assert found == pytest.approx(wanted, abs=1e-12)


def test_cross_elevation_is_a_great_circle_to_the_right(plain: TopocentricTrack) -> None:
    here, there = (direction(each, PASS_S) for each in (plain, plain.with_offsets(cross_elevation_offset_rad=SIZE_RAD)))
    right = np.array([here[1], -here[0], 0.0]) / math.hypot(here[0], here[1])
    assert there == pytest.approx(math.cos(SIZE_RAD) * here + math.sin(SIZE_RAD) * right, abs=1e-12)


def test_azimuth_and_elevation_are_added_as_seen(cbers: Elements, goldstone: Site) -> None:
    track = TopocentricTrack(cbers, goldstone, refraction=RadioRefraction())
    before = track.target_at(PASS_S)
    offsets = {"azimuth_offset_rad": SIZE_RAD, "elevation_offset_rad": -SIZE_RAD}
    after = track.with_offsets(**offsets).target_at(PASS_S)
    assert after.azimuth_rad == pytest.approx(before.azimuth_rad + SIZE_RAD, abs=1e-12)
    assert after.elevation_rad == pytest.approx(before.elevation_rad - SIZE_RAD, abs=1e-12)
    assert after.refraction_rad == pytest.approx(before.refraction_rad, abs=1e-12)


def test_time_moves_orbit_and_earth(plain: TopocentricTrack) -> None:
    later = plain.target_at(PASS_S + SIZE_S)
    found = plain.with_offsets(time_offset_s=SIZE_S).target_at(PASS_S)
    assert (found.azimuth_rad, found.elevation_rad) == (later.azimuth_rad, later.elevation_rad)


@given(values=st.fixed_dictionaries({name: st.floats(-0.02, 0.02) for name in OFFSETS}))
def test_the_rates_are_the_derivatives_of_the_angles(plain: TopocentricTrack, values: dict[str, float]) -> None:
    track, step_s = plain.with_offsets(**values), 0.05
    times = PASS_S + step_s * np.array([-1.0, 0.0, 1.0])
    seen = track.sample(times)
    for axis in ("azimuth", "elevation"):
        angle = getattr(seen, f"{axis}_rad")
        kinds = ("rate_rad_s", "acceleration_rad_s2")
        rate, acceleration = (getattr(seen, f"{axis}_{kind}")[1] for kind in kinds)
        assert (angle[2] - angle[0]) / (2.0 * step_s) == pytest.approx(rate, abs=1e-7)
        bend = (angle[2] - 2.0 * angle[1] + angle[0]) / step_s**2
        assert bend == pytest.approx(acceleration, abs=2e-6)
    one = track.target_at(PASS_S)
    assert one.azimuth_rad == pytest.approx(seen.azimuth_rad[1] % math.tau, abs=1e-12)
    assert one.elevation_rad == pytest.approx(seen.elevation_rad[1], abs=1e-12)


@pytest.mark.parametrize("name", OFFSETS)
def test_each_offset_is_named_in_its_unit_and_zero_moves_nothing(plain: TopocentricTrack, name: str) -> None:
    edge = name.replace("_rad", "_deg")
    value = 0.25 if name.endswith("_s") else math.radians(0.25)
    found = plain.with_offsets(**{name: value}).target_at(PASS_S)
    word, _, unit = edge.rpartition("_offset_")
    assert found.offsets == f"{word.replace('_', ' ')} 0.25 {unit}"
    before = plain.target_at(PASS_S)
    assert (found.azimuth_rad, found.elevation_rad) != (before.azimuth_rad, before.elevation_rad)
    assert plain.with_offsets(**{name: 0.0}).target_at(PASS_S) == before
    with pytest.raises(ValueError, match=rf"{name}=61.0 must be"):
        TargetOffsets(**{name: 61.0})


# Named sets


def test_sets_outlive_the_node_and_belong_to_their_band(tmp_path: Path) -> None:
    state = str(tmp_path / "ephemeris_publisher.json")
    offsets = TargetOffsets(azimuth_offset_rad=0.01, time_offset_s=1.5)
    OffsetSets(state, "X").keep("feed A", offsets)
    again, other = OffsetSets(state, "X"), OffsetSets(state, "S")
    assert (again.names, other.names) == (["feed A"], [])
    assert again.recall("feed A") == offsets.offsets
    other.keep("feed A", TargetOffsets())
    assert OffsetSets(state, "X").recall("feed A") == offsets.offsets
    again = OffsetSets(state, "X")
    again.forget("feed A")
    assert OffsetSets(state, "X").names == []
    assert OffsetSets(state, "S").names == ["feed A"]
    for act in (again.recall, again.forget):
        with pytest.raises(ValueError, match="name='feed A' must be"):
            act("feed A")


def test_bad_names_and_files_are_refused_with_their_reason(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    with pytest.raises(ValueError, match=r"name='\.\./x' must be"):
        OffsetSets(str(state), "X").keep("../x", TargetOffsets())
    with pytest.raises(ValueError, match="publisher.state_file='' must name a file"):
        OffsetSets("", "X").keep("a", TargetOffsets())
    file = tmp_path / "offset_sets.json"
    for row in ({"azimuth_offset_rad": 9.0}, {"nonsense": 1.0}, [], {"time_offset_s": "x"}):
        file.write_text(json.dumps({"X": {"a": row}}))
        with pytest.raises(ValueError, match="offset_sets.json: set 'a'"):
            OffsetSets(str(state), "X")
