"""Every contradiction is noted by itself, with its key and its words, and what is missing is not noted twice."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from rf_pointing.planning import HorizonMask
from rf_pointing.station.description import STATIONS, StationError, station_from
from rf_pointing.station.description.description import StationDescription

DEG = math.pi / 180.0
GOOD: dict[str, Any] = {
    "version": 1, "name": "Mine", "site": {"latitude_deg": 48.1, "longitude_deg": 11.6},
    "dish": {"diameter_m": 3.7},
    "mount": {
        "azimuth": {"travel_deg": [-270, 270], "rate_deg_s": 6},
        "elevation": {"travel_deg": [0, 90], "rate_deg_s": 6},
    },
    "bands": {"X": {"frequency_mhz": 8200}},
}  # fmt: skip
CIRCLE = {"elements": 5, "radius_m": 0.12, "phase_sigma_deg": 10.0}


def changed(**changes: Any) -> dict[str, Any]:
    """Return the description with values at dotted keys (`__` for the dot); ... leaves a key out."""
    found = yaml.safe_load(yaml.safe_dump(GOOD))
    for name, value in changes.items():
        *way, last = name.split("__")
        place = found
        for step in way:
            place = place.setdefault(step, {})
        if value is ...:
            del place[last]
        else:
            place[last] = value
    return found


def read(folder: Path, **changes: Any) -> StationDescription:
    return station_from(folder / "s.yaml", yaml.safe_dump(changed(**changes), sort_keys=False))


def said(folder: Path, **changes: Any) -> list[str]:
    """Return what is wrong, "" at the beginning of each file name left out."""
    with pytest.raises(StationError) as caught:
        read(folder, **changes)
    return [text for _, text in caught.value.problems]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": ...}, "name is missing"), ({"site": ...}, "site is missing"), ({"mount": ...}, "mount is missing"),
        ({"bands": ...}, "bands is missing"), ({"mount__azimuth": ...}, "mount.azimuth is missing"),
        ({"mount__elevation": ...}, "mount.elevation is missing"),
        ({"mount__azimuth__travel_deg": ...}, "mount.azimuth.travel_deg is missing"),
        ({"mount__elevation__travel_deg": ...}, "mount.elevation.travel_deg is missing"),
        ({"mount__elevation__rate_deg_s": ...}, "mount.elevation.rate_deg_s is missing"),
        ({"mount__azimuth": 7}, "mount.azimuth=7 must be a section"), ({"mount": 7}, "mount=7 must be a section"),
        ({"bands": {"X": 7}}, "bands.X=7 must be a section"), ({"bands__X": {}}, "bands.X.frequency_mhz is missing"),
        ({"drive": 7}, "drive=7 must be a section"), ({"simulation": 7}, "simulation=7 must be a section"),
        ({"tuning": 7}, "tuning=7 must be a section"), ({"dish": {}}, "dish.diameter_m is missing"),
        ({"bands__X__sensors": 7}, "bands.X.sensors must be a list"),
        ({"mount__park_deg": [1]}, "mount.park_deg has 1 values, must have 2"),
        ({"mount__horizon_deg": [[0, 3], [90]]}, "mount.horizon_deg[1] has 1 values, must have 2"),
        ({"mount__elevation__travel_deg": ..., "mount__park_deg": [0, 300]}, "mount.elevation.travel_deg is missing"),
        ({"mount__elevation__rate_deg_s": ..., "mount__elevation__command_rate_deg_s": 9},
            "mount.elevation.rate_deg_s is missing"),
        ({"bands__X__frequency_mhz": ..., "bands__X__half_power_beamwidth_deg": 9}, "bands.X.frequency_mhz is missing"),
        ({"bands__X__frequency_mhz": ..., "bands__X__sensors": ["array"], "array": {}},
            "bands.X.frequency_mhz is missing"),
        ({"bands__X__sensors": ["array"], "array": {"elements": 1}}, "array.elements=1 must be >= "),
        ({"bands__X__sensors": ["array"], "array": {"radius_m": -1.0}}, "array.radius_m=-1.0 must be >= "),
        ({"bands__X__sensors": ["array"], "array": {"phase_sigma_deg": "x"}}, "array.phase_sigma_deg=x must be a number"),
    ],
)  # fmt: skip
def test_what_is_missing_or_of_another_kind_is_the_one_problem(
    tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    (found,) = said(tmp_path, **changes)
    assert found.startswith(words)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"dish": ...}, "bands.X needs half_power_beamwidth_deg: there is no dish to derive it from"),
        ({"bands__X__sensors": ["array"], "array": CIRCLE}, "array: 5 patches on a circle of 0.12 m, phases known to 10.0"),
        ({"bands__X__tuning": {"mask.clearance_deg": 2.0}},
            "bands.X.tuning.mask.clearance_deg is given by mount.horizon_clearance_deg: change it there"),
        ({"tuning": {"loops.azimuth.integral_gain": -1.0}}, "tuning.loops.azimuth.integral_gain=-1.0 must be >= "),
        ({"tuning": {"pointing.lag_averaging_s": 2.0}},
            "tuning.pointing.lag_averaging_s is given by simulation.lag_averaging_s: change it there"),
        ({"simulation": {"mount_errors": {"droop_deg": 99.0}}}, "simulation.mount_errors.droop_deg=99.0 must be <= "),
        ({"drive": {"rotator": {"latency_s": -1.0}}}, "drive.rotator.latency_s=-1.0 must be >= 0.0"),
        ({"drive": {"rotator": {"latncy_s": 1.0}}}, "drive.rotator.latncy_s: no such key of drive; did you mean "),
        ({"mount__horizon_file": "empty.txt"}, "mount.horizon_file='empty.txt' must have at least one point"),
        ({"mount__horizon_deg": [[0, 5], [91, 5], [180, 5], [270, 5]]},
            "mount.horizon_deg point 2: 91 deg after the point before"),
        ({"bands__X__sensors": ["conscan", "conscan"]}, "bands.X.sensors="),
        ({"mount__elevation__travel_deg": [0, 40], "mount__horizon_deg": [[0, 40]]},
            "mount.elevation.travel_deg=[0.0, 40.0] ends below the horizon mask"),
        ({"mount__azimuth__travel_deg": [10, 10]}, "mount.azimuth.travel_deg=[10.0, 10.0] must rise"),
        ({"drive": {"type": "spid", "model": "rot1"}},
            "mount.fixed_elevation_deg must say where the antenna looks: drive.model=rot1 turns the azimuth alone"),
    ],
)  # fmt: skip
def test_each_contradiction_is_one_problem_in_these_words(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    (tmp_path / "empty.txt").write_text("# nothing\n")
    (found,) = said(tmp_path, **changes)
    assert found.startswith(words)


def test_a_circle_of_patches_is_ambiguous_at_one_frequency_and_not_at_another(tmp_path: Path) -> None:
    """At 8200 MHz it has a problem."""
    band = {"frequency_mhz": 1640, "sensors": ["array"]}
    assert read(tmp_path, bands__X=band, array=CIRCLE, dish__diameter_m=9.0).sensors("X") == ("array",)


MODEL = STATIONS / "bias_model_dss13_x.yaml"


@pytest.mark.parametrize(
    ("name", "band", "words"),
    [
        ("Goldstone DSS-13", "X", []),
        ("Goldstone DSS-13", "S", ["is of band 'X', must be of 'S'"]),
        ("Mine", "X", ["is of station 'Goldstone DSS-13', must be of 'Mine'"]),
        ("Mine", "S", ["is of band 'X'", "is of station 'Goldstone DSS-13'"]),
    ],
)
def test_a_bias_model_is_that_of_station_and_band(tmp_path: Path, name: str, band: str, words: list[str]) -> None:
    changes = {"name": name, "bands": {band: {"frequency_mhz": 8200, "bias_model": str(MODEL)}}}
    found = said(tmp_path, **changes) if words else [] * len(read(tmp_path, **changes).bands)
    assert len(found) == len(words)
    for text, word in zip(found, words, strict=True):
        assert text.startswith(f"bands.{band}.bias_model={str(MODEL)!r} ")
        assert word in text


def test_a_stow_may_lie_where_only_the_control_unit_goes(tmp_path: Path) -> None:
    """Travel for commands up to 90 deg, for the control unit up to 95 deg."""
    wide = {"tuning": {"loops.preprocessor.travel_max_deg": [270.1, 95.0]}, "mount__elevation__hard_stop_deg": [-2, 99]}
    assert read(tmp_path, mount__stow_elevation_deg=95, **wide).parameters("antenna_servo") is not None
    (found,) = said(tmp_path, mount__stow_elevation_deg=96, **wide)
    assert found.startswith("mount.stow_elevation_deg=96.0 must lie within")
    (found,) = said(tmp_path, mount__stow_elevation_deg=91)
    assert found.startswith("mount.stow_elevation_deg=91.0 must lie within")


def test_a_mask_has_a_clearance_of_a_degree_unless_one_is_given(tmp_path: Path) -> None:
    assert read(tmp_path).mask == HorizonMask(clearance_rad=1.0 * DEG)
    assert read(tmp_path, mount__horizon_clearance_deg=2.5).mask == HorizonMask(clearance_rad=2.5 * DEG)
    one = read(tmp_path, mount__horizon_deg=[[20, 3]], mount__horizon_clearance_deg=0.5).mask
    assert one == HorizonMask(azimuth_rad=(20 * DEG,), elevation_rad=(3 * DEG,), clearance_rad=0.5 * DEG)


def test_only_points_a_whole_turn_apart_are_the_same(tmp_path: Path) -> None:
    """From 10 to 350 deg all of them count."""
    points = [[10, 1], [90, 2], [180, 3], [270, 4], [350, 5]]
    found = read(tmp_path, mount__horizon_deg=points).mask
    assert found.azimuth_rad == pytest.approx([10 * DEG, 90 * DEG, 180 * DEG, 270 * DEG, 350 * DEG])
    assert found.elevation_rad == pytest.approx([1 * DEG, 2 * DEG, 3 * DEG, 4 * DEG, 5 * DEG])
    points = [[0, 1], [90, 2], [180, 3], [270, 4], [360, 5]]
    assert read(tmp_path, mount__horizon_deg=points).mask.elevation_rad == pytest.approx(
        [k * DEG for k in (1, 2, 3, 4)]
    )
