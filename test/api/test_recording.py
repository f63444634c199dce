"""A recording gives its topics as tables, its report, and its data for other programs."""

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.api import recording as module
from rf_pointing.calibration import read_tdm
from rf_pointing.core import Kinematics, mount_to_notes
from rf_pointing.report.definitions import Definitions, definitions
from rf_pointing.report.tracking_from_bag import tracking_from_bag
from test.report.conftest import MSG_DEFS, SyntheticRun


@pytest.fixture(scope="module")
def types() -> Definitions:
    return definitions(MSG_DEFS)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, types: Definitions) -> Path:
    path = tmp_path_factory.mktemp("recording") / "bag"
    SyntheticRun(seconds=12.0, error_mdeg=lambda t: (t, 2.0)).write(path, types, {"station": "DSS-13", "band": "X"})
    return path


def test_a_topic_is_a_table_with_its_units_and_a_frame_of_pandas_with_its_times(bag: Path) -> None:
    recording = rp.Recording(bag)
    assert recording.notes["station"] == "DSS-13"
    assert recording.problems == ()
    errors = recording.table("sim/pointing_error")
    assert np.degrees(errors["cross_elevation_rad"]) * 1e3 == pytest.approx(errors["t_s"] - errors["t_s"][0], abs=1e-6)
    assert "sim/pointing_error" in recording.topics
    with pytest.raises(ValueError, match="topic='nothing' must be one of"):
        recording.table("nothing")
    pandas = pytest.importorskip("pandas")
    frame = recording.to_pandas("sim/pointing_error")
    assert frame.index[0] == pandas.Timestamp(errors["stamp_ns"][0], unit="ns", tz="UTC")
    assert frame["elevation_rad"].to_numpy().tolist() == errors["elevation_rad"].tolist()


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no.bag"):
        _ = rp.Recording(tmp_path / "no.bag").data


@pytest.mark.parametrize("kind", ["csv", "mat", "tdm"])
def test_data_are_exported_below_the_bag_or_where_they_are_wanted(bag: Path, kind: str, tmp_path: Path) -> None:
    for folder, written in ((None, bag.parent / "export"), (tmp_path / "out", tmp_path / "out")):
        files = rp.Recording(bag).export(kind, folder)
        assert files
        assert {file.parent for file in files} == {written}
        assert all(file.stat().st_size for file in files)


def test_tracked_angles_need_station_and_band(tmp_path: Path, types: Definitions) -> None:
    SyntheticRun(seconds=12.0).write(tmp_path / "bag", types, {"station": "DSS-13"})
    with pytest.raises(ValueError, match="name no band"):
        rp.Recording(tmp_path / "bag").export("tdm")


def test_tracked_angles_are_of_the_type_of_the_mount(tmp_path: Path, types: Definitions) -> None:
    known = {"station": "A", "band": "X"}
    for mount, kind in ((Kinematics(type="x_y"), "XSYE"), (Kinematics(type="ha_dec", latitude_rad=0.6), "AZEL")):
        SyntheticRun(seconds=12.0).write(tmp_path / mount.type, types, known | mount_to_notes(mount))
        (file,) = rp.Recording(tmp_path / mount.type).export("tdm", tmp_path / kind)
        assert f"ANGLE_TYPE = {kind}" in file.read_text()
        (raw,), (own,) = read_tdm(file), tracking_from_bag(tmp_path / mount.type, "A", "X")
        sky = mount.directions(own[0].azimuth_rad, own[0].elevation_rad)
        np.testing.assert_allclose([raw.azimuth_rad, raw.elevation_rad], sky, atol=1e-9)


def test_pages_of_other_packages_are_written_with_the_report(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def page(_bag: Path, folder: Path) -> Path:
        (folder / "sky.html").write_text("sky")
        return folder / "sky.html"

    class Offered(EntryPoint):
        def load(self) -> Any:
            return {"sky": page, "none": lambda *_: None}[self.name]

    found = [Offered(name, "x", "rf_pointing.reports") for name in ("sky", "none")]
    monkeypatch.setattr(module, "entry_points", lambda group: found if group == "rf_pointing.reports" else [])
    assert rp.Recording(bag).report(tmp_path) == [tmp_path / "sky.html", tmp_path / "report.html"]
    assert all((tmp_path / name).stat().st_size for name in ("sky.html", "report.html", "summary.json"))
