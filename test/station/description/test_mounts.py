"""Mounts in a description: their keys, every contradiction in words, and who refuses them."""

import copy
import importlib
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rf_pointing.api.station import Station
from rf_pointing.api.target import elements
from rf_pointing.calibration import BiasModel, read_model, write_model
from rf_pointing.calibration.terms import names_of
from rf_pointing.commands import check_drive, check_station
from rf_pointing.core import Kinematics, angular_distance_rad
from rf_pointing.core.mount_types import LOWER_AXES, MOUNTS
from rf_pointing.simulation import StationSetup
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.description import STATIONS, StationError, read_station, station_from
from rf_pointing.station.description.description import StationDescription

AXIS = {"rate_deg_s": 3.0, "acceleration_deg_s2": 3.0}
MOUNT_OF: dict[str, dict[str, Any]] = {
    "azimuth_elevation": {"azimuth": {"travel_deg": [-270, 270], **AXIS}, "elevation": {"travel_deg": [0, 90], **AXIS}},
    "x_y": {"lower_axis": "east_west",
            "axes": {"x": {"travel_deg": [-86, 86], **AXIS}, "y": {"travel_deg": [-86, 86], **AXIS}}},
    "ha_dec": {"axes": {"hour_angle": {"travel_deg": [-185, 185], **AXIS},
                        "declination": {"travel_deg": [-95, 95], **AXIS}}},
    "azimuth_elevation_tilt": {"tilt_deg": 7.0, "azimuth": {"travel_deg": [-270, 270], **AXIS},
                               "elevation": {"travel_deg": [-8, 98], **AXIS}},
}  # fmt: skip


def description(kind: str, mount: dict[str, Any], latitude: float = 48.1) -> str:
    return yaml.safe_dump({
        "version": 1, "name": "Mine", "site": {"latitude_deg": latitude, "longitude_deg": 11.6},
        "dish": {"diameter_m": 3.7}, "mount": {"type": kind, **mount}, "bands": {"X": {"frequency_mhz": 8200}},
    })  # fmt: skip


def read(folder: Path, kind: str, latitude: float = 48.1, **mount: Any) -> StationDescription:
    return station_from(folder / "s.yaml", description(kind, MOUNT_OF[kind] | mount, latitude))


@pytest.fixture(params=[kind for kind in MOUNTS if kind != "azimuth_elevation"])
def other(tmp_path: Path, request: pytest.FixtureRequest) -> StationDescription:
    return read(tmp_path, request.param)


@pytest.mark.parametrize(
    ("kind", "changes", "latitude", "problems"),
    [
        ("x_y", {"axes": {}}, 48.0, ["mount.axes.x is missing: type=x_y has the axes x and y",
                                     "mount.axes.y is missing: type=x_y has the axes x and y"]),
        ("x_y", {"lower_axis": "up"}, 48.0, ["mount.lower_axis='up' must be one of east_west, north_south"]),
        ("x_y", {"tilt_deg": 7.0}, 48.0, ["mount.tilt_deg: type=x_y has no such key"]),
        ("x_y", MOUNT_OF["azimuth_elevation"], 48.0, ["mount.azimuth: type=x_y has the axes x and y",
                                                      "mount.elevation: type=x_y has the axes x and y"]),
        ("x_y", {"axes": {**MOUNT_OF["x_y"]["axes"], "z": {"travel_deg": [0, 1], **AXIS}}}, 48.0,
            ["mount.axes.z: type=x_y has the axes x and y"]),
        ("x_y", {"axes": {"x": {"travel_deg": [100, 170], **AXIS}, "y": {"travel_deg": [-40, 40], **AXIS}}}, 48.0,
            ["mount.axes.x.travel_deg=[100.0, 170.0] and y [-40.0, 40.0] reach -7.6 deg of elevation at most, "
             "must be > 5, where passes begin"]),
        ("x_y", {"axes": {"x": {"travel_rad": [-1, 1], **AXIS}, "y": {"travel_deg": [-86, 86], **AXIS}}}, 48.0,
            ["mount.axes.x.travel_rad: no such key of mount.axes.x; did you mean travel_deg?",
             "mount.axes.x.travel_deg is missing: lowest and highest angle that may be commanded [deg]"]),
        ("x_y", {"axes": {"x": {"travel_deg": [-86, math.nan], **AXIS}, "y": {"travel_deg": [86, -86], **AXIS}}}, 48.0,
            ["mount.axes.x.travel_deg[1]=nan must be finite",
             "mount.axes.y.travel_deg=[86.0, -86.0] must rise from its lowest to its highest angle"]),
        ("x_y", {"park_deg": [0, 88]}, 48.0, ["mount.park_deg=[0.0, 88.0]: y 88.0 must lie within its "
                                              "travel_deg=[-86.0, 86.0]"]),
        ("x_y", {"fixed_elevation_deg": 30.0}, 48.0,
            ["mount.fixed_elevation_deg is for an azimuth alone, of type=azimuth_elevation"]),
        ("ha_dec", {}, 90.0, ["mount: latitude_deg=90 must be within +-89.9 for type=ha_dec: nearer to a pole of the "
                              "Earth the hour angle has no zero"]),
        ("azimuth_elevation_tilt", {"tilt_deg": None}, 48.0, ["mount.tilt_deg=null must be a number"]),
        ("azimuth_elevation", {"lower_axis": "east_west"}, 48.0,
            ["mount.lower_axis: type=azimuth_elevation has no such key"]),
        ("azimuth_elevation", {"axes": copy.deepcopy(MOUNT_OF["azimuth_elevation"])}, 48.0,
            ["mount.axes.azimuth: type=azimuth_elevation has the axes azimuth and elevation",
             "mount.axes.elevation: type=azimuth_elevation has the axes azimuth and elevation"]),
    ],
)  # fmt: skip
def test_every_contradiction_is_in_one_list(
    tmp_path: Path, kind: str, changes: dict[str, Any], latitude: float, problems: list[str]
) -> None:
    with pytest.raises(StationError) as caught:
        read(tmp_path, kind, latitude, **changes)
    assert sorted(text for _, text in caught.value.problems) == sorted(problems)


def test_an_unknown_type_is_refused_with_those_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(StationError, match="mount.type='hexapod' must be one of azimuth_elevation, x_y, ha_dec"):
        station_from(tmp_path / "s.yaml", description("hexapod", MOUNT_OF["x_y"]))


def test_travel_rates_and_rest_are_those_of_the_axes_by_their_names(tmp_path: Path) -> None:
    values = read(tmp_path, "x_y").values()
    assert (values["limits.azimuth_max_deg"].value, values["limits.azimuth_max_deg"].key) == (
        86.0,
        "mount.axes.x.travel_deg",
    )
    assert values["kinematics.type"].value == values["safety.kinematics.type"].value == "x_y"
    # At rest it looks at the zenith; a polar mount has it at its latitude.
    assert [values[f"safety.{name}_deg"].value for name in ("park_azimuth", "park_elevation", "stow_elevation")] == [
        0
    ] * 3
    polar = read(tmp_path, "ha_dec", -31.0).values()
    assert polar["safety.stow_elevation_deg"].value == pytest.approx(-31.0)
    assert polar["kinematics.latitude_deg"].value == pytest.approx(-31.0)


@pytest.mark.parametrize("kind", ["azimuth_elevation", "ha_dec", "turned", "x_y"])
def test_a_bias_model_is_taken_on_its_own_mount_alone(tmp_path: Path, kind: str) -> None:
    text = description("x_y", MOUNT_OF["x_y"]).replace(
        "frequency_mhz: 8200", "frequency_mhz: 8200\n    bias_model: a.yaml"
    )
    lies = kinematics_of(read(tmp_path, "x_y").content).lower_axis
    turned = {"x_y": lies, "turned": next(each for each in LOWER_AXES if each != lies)}
    mount = Kinematics(type="x_y", lower_axis=turned[kind]) if kind in turned else Kinematics(type=kind)
    version = read_model(STATIONS / "bias_model_dss13_x.yaml")
    term = names_of(mount.type)[9]
    model = BiasModel.zero(mount).replace(**{term: 1e-3})
    write_model(tmp_path / "a.yaml", replace(
        version, station="Mine", model=model, fitted=(term,), covariance=np.array([[1e-8]])
    ))  # fmt: skip
    assert read_model(tmp_path / "a.yaml").model.mount == mount
    if kind == "x_y":
        found = station_from(tmp_path / "s.yaml", text)
        assert Station(found).model.coefficients[term] == pytest.approx(1e-3)
        return
    with pytest.raises(StationError, match=f"bias_model='a.yaml': .* of a mount {mount.words}, must be of one of type"):
        station_from(tmp_path / "s.yaml", text)


def test_only_a_tilt_that_is_not_set_is_refused(other: StationDescription, tmp_path: Path) -> None:
    station, target = Station(other), elements("CBERS 2")
    (tmp_path / "s.yaml").write_text(description(other.content.mount.type, MOUNT_OF[other.content.mount.type]))
    # A drive is checked axis by axis, and every mount has two.
    ends = check_drive.flown_rad(str(tmp_path / "s.yaml"))
    np.testing.assert_allclose(np.degrees(ends).T, [axis.travel_deg for axis in other.content.mount.pair])
    requests = importlib.import_module("rf_pointing.api.requests")
    request = requests.TrackRequest(station=station, target=target)
    if other.content.mount.tilt_deg is None:
        assert request.station is station
        return
    # The tilt is set before the pass, to one of the two sides of its highest point.
    chosen = request.changes["mount.train_deg"]
    track = station.track_of(target)
    highest_deg = math.degrees(track.target_at(request.window.tca_t_s).azimuth_rad)
    assert abs(math.sin(math.radians(chosen - highest_deg))) < 0.05
    other.write(tmp_path / "run.yaml", request.changes)
    flown = read_station(tmp_path / "run.yaml")
    assert flown.values()["kinematics.train_deg"].value == pytest.approx(chosen)
    with pytest.raises(ValueError, match="^mount.train_deg of Mine is missing: simulate must know to which azimuth"):
        StationSetup(other)
    # A model is that of the mount wherever it leans: one campaign, one place.
    assert requests.CalibrateRequest(station=station).changes == {"mount.train_deg": 0.0}


def test_passes_of_any_mount_are_certified_in_the_angles_of_its_axes(
    other: StationDescription, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The axes of the chosen branch look where the target is, but for what the certificate says is off."""
    path = tmp_path / "s.yaml"
    path.write_text(description(other.content.mount.type, MOUNT_OF[other.content.mount.type]))
    with pytest.raises(SystemExit) as ended:
        check_station.main([str(path)])
    assert ended.value.code == 0
    assert "a keyhole at elevation" in capsys.readouterr().out
    station, target = Station(other), elements("CBERS 2")
    found = [station.certificate(one) for one in station.passes(target, days=2)]
    taken = [each for each in found if each.accepted]
    assert len(taken) >= len(found) - 1
    for each in taken:
        assert each.chosen is not None
        assert each.chosen.axes_rad is not None
        sky, profile = each.certificate.mount.skies(each.chosen.axes_rad), each.planned.profile
        off = angular_distance_rad(*sky.T, *profile.position_rad.T)
        # A second more than the crossing: it is left and joined on the target.
        assert float(np.sum(off > 1e-6)) * 0.1 <= each.chosen.keyhole_s * 1.2 + 8.0 * (each.chosen.keyhole_s > 0.0)
        assert each.certificate.sky_peak_rad == pytest.approx(float(profile.position_rad[:, 1].max()), abs=1e-9)
    plan = station.plan([target], start_t_s=target.first_t_s, hours=48.0)
    assert sum(each.fate == "tracked" for each in plan.day.passes) == len(taken)
