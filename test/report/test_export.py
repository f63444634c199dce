"""Exports are read back by the libraries that they are for, to the last bit, with units and meanings."""

import builtins
import csv
import math
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rf_pointing.report.definitions import Definitions
from rf_pointing.report.export import SUFFIXES, ColumnMeaning, export_recording, exported_topics, meanings, topic_table
from rf_pointing.report.recording import Recording, read_recording
from rf_pointing.report.topics import TOPICS


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, synthetic_run: Any, types: Definitions) -> Path:
    path = tmp_path_factory.mktemp("export") / "bag"
    run = synthetic_run(
        seconds=40.0, aos_los_s=(1.0, 35.0), reason=lambda t: 'a "reason", with a comma' if t > 20.0 else "",
        error_mdeg=lambda t: (3.0 * math.sin(t), 2.0),
    )  # fmt: skip
    run.write(path, types, {"station": "DSS-13", "band": "X"})
    return path


@pytest.fixture(scope="module")
def recording(bag: Path) -> Recording:
    return read_recording(bag)


def without(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let these packages be missing."""
    found = builtins.__import__

    def importing(name: str, *arguments: Any, **options: Any) -> Any:
        if name.partition(".")[0] in names:
            raise ImportError(name)
        return found(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", importing)


def test_every_column_that_a_report_reads_has_a_meaning_and_every_number_of_ours_its_unit() -> None:
    # Counts, shares and words have none.
    plain = {"name", "target", "mode", "reason", "commands_sent", "level", "alarm", "accepted", "least_share", "fault",
             "at_limit", "commands_accepted", "commands_rejected", "last_rejection", "set_points", "starts", "reversals",
             "sensor", "valid", "offsets", "sun_permit"}  # fmt: skip
    for topic, columns in meanings().items():
        assert topic == "passes" or tuple(columns) == TOPICS[topic].columns
        for column, (unit, meaning) in columns.items():
            assert unit in SUFFIXES
            assert (unit == "") == (column in plain), f"{topic} {column}"
            assert len(meaning) > 5, f"{topic} {column}"


def test_columns_that_an_older_recording_lacks_are_filled() -> None:
    layout, shown = TOPICS["antenna_status"], dict.fromkeys(TOPICS["antenna_status"].columns, 7.0)
    row = dict(zip(layout.columns, layout.row(SimpleNamespace(**shown)), strict=True))
    assert row["set_points"] == row["starts"] == row["mode"] == 7.0
    for name in ("set_points", "starts", "reversals"):
        del shown[name]
    row = dict(zip(layout.columns, layout.row(SimpleNamespace(**shown)), strict=True))
    assert (row["set_points"], row["starts"], row["reversals"], row["mode"]) == (0, [0, 0], [0, 0], 7.0)


def test_csv_is_read_back_to_the_last_bit_by_pandas(recording: Recording, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    files = export_recording(recording, tmp_path, "csv")
    assert {path.stem for path in files} == {
        *(name.replace("/", "_") for name in exported_topics(recording)),
        "dictionary",
    }
    back = pandas.read_csv(tmp_path / "sim_boresight.csv")
    data = recording.topics["sim/boresight"]
    assert list(back.columns) == ["stamp_ns", "log_time_ns", "t_s", "azimuth_rad", "elevation_rad"]
    assert np.array_equal(back["azimuth_rad"], data["azimuth"])
    assert np.array_equal(back["stamp_ns"], data.stamp_ns)
    status = pandas.read_csv(tmp_path / "tracking_status.csv", keep_default_na=False)
    assert list(status["reason"]) == list(recording.topics["tracking_status"]["reason"])
    joints = pandas.read_csv(tmp_path / "joint_states.csv")
    assert np.array_equal(
        joints[["position_azimuth_rad", "position_elevation_rad"]], recording.topics["joint_states"]["position"]
    )


def test_parquet_carries_the_unit_and_meaning_of_each_column(recording: Recording, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    export_recording(recording, tmp_path, "parquet")
    for topic in exported_topics(recording):
        back = parquet.read_table(tmp_path / f"{topic.replace('/', '_')}.parquet")
        for field in back.schema:
            assert field.metadata[b"meaning"], f"{topic} {field.name}"
    error = parquet.read_table(tmp_path / "pointing_error.parquet")
    assert np.array_equal(
        error["cross_elevation_rad"].to_numpy(), recording.topics["pointing_error"]["cross_elevation"]
    )
    assert error.schema.field("cross_elevation_rad").metadata == {
        b"unit": b"rad", b"meaning": b"target minus beam to the right: azimuth difference times cos(elevation)",
        b"source": b"/gs1/pointing_error: cross_elevation",
    }  # fmt: skip


def test_matlab_reads_a_structure_for_each_topic(recording: Recording, tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    (path,) = export_recording(recording, tmp_path, "mat")
    back = io.loadmat(path, simplify_cells=True)
    status, data = back["tracking_status"], recording.topics["tracking_status"]
    assert np.array_equal(status["cross_elevation_error_rad"], data["cross_elevation_error"])
    assert [text if len(text) else "" for text in status["reason"]] == list(data["reason"])
    assert np.array_equal(back["sim_boresight"]["stamp_ns"], recording.topics["sim/boresight"].stamp_ns)
    rows = dict(zip(zip(back["dictionary"]["table"], back["dictionary"]["column"], strict=True),
                    back["dictionary"]["unit"], strict=True))  # fmt: skip
    assert rows["joint_states", "velocity_azimuth_rad_s"] == "rad/s"


def test_the_dictionary_has_a_row_for_every_column_of_an_export(recording: Recording, tmp_path: Path) -> None:
    export_recording(recording, tmp_path, "csv")
    with (tmp_path / "dictionary.csv").open() as file:
        head, *kept = csv.reader(file)
    assert head == [each.name for each in fields(ColumnMeaning)]
    rows = [ColumnMeaning(*row) for row in kept]
    assert all(row.meaning and row.source.startswith("/gs1/") and row.type_name for row in rows)
    for path in tmp_path.glob("*.csv"):
        if path.stem != "dictionary":
            with path.open() as file:
                assert next(csv.reader(file)) == [row.column for row in rows if row.table == path.stem]


def test_parquet_without_its_package_is_refused_by_its_name_and_writes_nothing(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without(monkeypatch, "pyarrow")
    with pytest.raises(ValueError, match="needs the package pyarrow, which is not installed: pip install pyarrow"):
        export_recording(recording, tmp_path / "out", "parquet")
    assert not (tmp_path / "out").exists()


def test_a_topic_that_is_not_there_is_refused_with_those_that_are(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="topic='nothing' must be one of target, passes"):
        topic_table(recording, "nothing")
    with pytest.raises(ValueError, match="has no message of pass_certificate; it has "):
        topic_table(recording, "pass_certificate")
    with pytest.raises(ValueError, match="export='xls' must be one of csv, parquet, mat"):
        export_recording(recording, tmp_path, "xls")
