"""Scans of the whole simulated station: what the mount was given comes back, and G/T with it."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.api.scan import ScanRequest, ScanResult
from rf_pointing.ephemeris import verification_elements
from rf_pointing.rf.noise import system_noise_k
from rf_pointing.station.campaign.offset_table import read_offsets, terms_of_offsets
from rf_pointing.station.description import read_station
from rf_pointing.station.description.writing import leaning

START = "2026-06-21T09:00:00"
QUICK = {"repetitions": 1, "rate_deg_s": 1.0}


@pytest.fixture(scope="module")
def station() -> rp.Station:
    return rp.Station("leo_3m7", "S")


@pytest.fixture(scope="module")
def of_sun(station: rp.Station) -> ScanResult:
    return station.scan(rp.elements("Sun"), start=START, **QUICK)


def missed_rad(found: ScanResult, station: rp.Station, early_s: float = 0.0) -> float:
    """Return how far a scan is off what the simulated mount needs for a target that is early by so much."""
    mount, track = station.controller.kinematics, station.track_of(rp.elements(found.name))
    planted = station.description.sets("antenna_servo", station.band)["mount"].model(mount)
    seen, early = (mount.of_axes(track.target_at(found.t_s + each_s)) for each_s in (0.0, early_s))
    wanted = np.array(planted.offset_rad(*seen.motion)) + np.subtract(early.motion, seen.motion)[:2]
    return float(np.abs((found.axis_offset_rad - wanted) * [math.cos(seen.elevation_rad), 1.0]).max())


PLAY_RAD = math.radians(0.012)
"""Play of the gears of a stiff mount, 0.01 deg, and gusts."""


def test_the_sun_gives_the_offsets_of_the_mount_and_the_figures_of_the_description(
    of_sun: ScanResult, station: rp.Station
) -> None:
    assert missed_rad(of_sun, station) < PLAY_RAD
    assert math.degrees(of_sun.fit.values[2]) == pytest.approx(station.beamwidth_deg, rel=0.005)
    signal = station.description.sets("rf_receiver", "S")["signal"]
    stated_k = float(system_noise_k(signal.noise, signal.atmosphere, of_sun.elevation_rad))
    stated_db_k = signal.gain_dbi - 10.0 * math.log10(stated_k)
    assert of_sun.figures.g_over_t_db_k.value == pytest.approx(stated_db_k, abs=0.02)
    assert of_sun.figures.system_noise_k.value == pytest.approx(stated_k, rel=0.005)
    assert of_sun.figures.efficiency.value == pytest.approx(0.6, abs=0.03)


def test_a_model_in_force_is_part_of_the_offset(station: rp.Station, of_sun: ScanResult) -> None:
    """The axes' offset is that of the mount whatever the station knew already, and by other points."""
    given = rp.BiasModel.zero().replace(azimuth_offset=0.002, elevation_offset=-0.003)
    knowing, points = rp.Station("leo_3m7", "S", model=given), {"pattern": "five_point", "frame": "azimuth"}
    again = knowing.scan(rp.elements("Sun"), start=START, dwell_s=2.0, **points, **QUICK)
    assert missed_rad(again, station) < PLAY_RAD
    assert again.axis_offset_rad == pytest.approx(of_sun.axis_offset_rad, abs=PLAY_RAD)
    assert abs(again.fit.offset_rad[1] - of_sun.fit.offset_rad[1]) == pytest.approx(0.003, abs=PLAY_RAD)


def test_a_curve_in_celestial_axes_finds_the_same(station: rp.Station) -> None:
    curve = {"pattern": "rosette", "frame": "right_ascension", "half_width_deg": 2.4}
    found = station.scan(rp.elements("Sun"), start=START, **(QUICK | curve))
    assert missed_rad(found, station) < PLAY_RAD


@pytest.mark.parametrize("name", ["leo_3m7", "xy_7m3", "polar_3m", "tilt_5m"])
def test_a_satellite_is_scanned_by_its_carrier_on_any_mount_and_a_table_has_the_names_of_its_axes(
    name: str, tmp_path: Path
) -> None:
    """CBERS-2 is 0.05 s ahead of its elements, which the scan finds as well as the mount's errors."""
    description, target = read_station(name), rp.elements("CBERS 2")
    station = rp.Station(leaning(description, 0.5) if name == "tilt_5m" else description, "S")
    one, mount = station.passes(target, days=2, min_peak_deg=30.0)[0], station.controller.kinematics
    found = station.scan(target, start_t_s=one.tca_t_s - 60.0, pattern="cross", half_width_deg=2.0, **QUICK)
    assert found.figures is None
    assert found.fit.values[6] == 0.0
    assert missed_rad(found, station, 0.05) < 2.0 * PLAY_RAD
    found.append(tmp_path / "offsets.csv")
    given = tmp_path / "offsets.csv", station.name, "S", station.site, 0.01, verification_elements(), 1e9
    points = read_offsets(*given, mount=mount)
    assert (points.residual_azimuth_rad[0], points.residual_elevation_rad[0]) == pytest.approx(
        found.axis_offset_rad, abs=1e-7
    )
    assert terms_of_offsets(points) == tuple(f"{axis}_offset" for axis in mount.axes)


def test_the_table_is_one_that_a_fit_takes(of_sun: ScanResult, station: rp.Station, tmp_path: Path) -> None:
    table = tmp_path / "offsets.csv"
    of_sun.append(table)
    of_sun.append(table)
    points = read_offsets(table, station.name, "S", station.site, math.radians(station.beamwidth_deg), [], 1e9)
    offset = points.observed_elevation_rad - points.true_elevation_rad
    assert offset == pytest.approx([of_sun.axis_offset_rad[1]] * 2, abs=1e-6)
    assert len(list(csv.reader(table.read_text().splitlines()))) == 3


def test_the_result_is_printed_kept_and_drawn(of_sun: ScanResult, tmp_path: Path) -> None:
    text = str(of_sun)
    for part in ("G/T 14.", "(the quiet Sun (RSTN))", "chi^2"):
        assert part in text
    kept = json.loads(of_sun.to_json())
    assert kept["g_over_t_db_k"] == pytest.approx(of_sun.figures.g_over_t_db_k.value)
    assert len(kept["samples"]["power"]) == len(of_sun.samples.power)
    of_sun.draw(tmp_path / "scan.png")
    assert (tmp_path / "scan.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("target", "changes", "words"),
    [
        (
            "Moon",
            {"rate_deg_s": 9.0},
            "rate_rad_s=0.157.* must|the scan needs 9 deg/s of rate, the axes are planned with",
        ),
        ("3C 273", {}, "no source was seen"),
        ("Moon", {"repetitions": 900}, r"Moon is above \d+.\d deg for \d+ s at most in the day after 2026"),
        ("Moon", {"pattern": "zigzag"}, "pattern='zigzag' must be"),
    ],
)
def test_what_cannot_be_scanned_is_refused_by_name(target: str, changes, words: str, station: rp.Station) -> None:
    with pytest.raises(ValueError, match=words):
        station.scan(rp.elements(target), start=START, **(QUICK | changes))


def test_a_source_beside_the_sun_is_refused_with_the_angle(station: rp.Station) -> None:
    """On 2026-06-16 the Sun stands 1.4 deg north of Taurus A."""
    with pytest.raises(ValueError, match=r"the Sun is \d.\d deg from Taurus A: a side lobe may add .* K to the"):
        station.scan(rp.elements("Taurus A"), start="2026-06-16T09:00:00", **QUICK)


def test_a_drift_lets_the_antenna_stand(station: rp.Station) -> None:
    """The rate in right ascension is that of the sky at the declination: the axes hardly move."""
    request = ScanRequest(station=station, target=rp.elements("Sun"), pattern="drift")
    program = request.program(1782032400.0)
    assert program.frame == "right_ascension"
    assert math.degrees(program.rate_rad_s) * 3600.0 == pytest.approx(15.04 * math.cos(math.radians(23.4)), rel=0.002)
