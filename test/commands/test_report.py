"""`report` writes every page that there is, or the data in the form that is requested."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rf_pointing.commands import report


class Outside:
    """The bag, its readers and the pages of other packages; `done` is what was written."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.done: list[Any] = []
        self.antennas = ["/gs1"]
        self.pages: list[str | None] = []
        self.notes = {"station": "DSS-13", "band": "X"}
        recording = SimpleNamespace(notes=self.notes)

        def read(bag: Path, *, namespace: str | None) -> Any:
            self.done.append(("read", bag, namespace))
            return recording

        def export(found: Any, folder: Path, kind: str) -> list[Path]:
            assert found is recording
            self.done.append(("export", folder, kind))
            return [folder / "a.csv", folder / "b.csv"]

        def tracks(bag: Path, station: str, band: str, *, namespace: str | None, allow_damage: bool) -> Any:
            self.done.append(("tracks", bag, station, band, namespace, allow_damage))
            return [("raw 1", "reference"), ("raw 2", "reference")]

        def write_tdm(path: Path, raw: list[str], *, originator: str, created_t_s: float) -> None:
            assert path.parent.is_dir()
            self.done.append(("tdm", path, raw, originator.split()[0], created_t_s))

        def page(name: str | None) -> Any:
            return SimpleNamespace(load=lambda: lambda _bag, folder: name and folder / name)

        monkeypatch.setattr(report, "read_recording", read)
        monkeypatch.setattr(report, "export_recording", export)
        monkeypatch.setattr(report, "tracking_from_bag", tracks)
        monkeypatch.setattr(report, "write_tdm", write_tdm)
        monkeypatch.setattr(report, "write_report", lambda bag, folder: self.done.append(("report", bag, folder)))
        monkeypatch.setattr(report, "antennas", lambda _bag: self.antennas)
        monkeypatch.setattr(report, "entry_points", lambda group: [page(name) for name in self.pages if group])
        monkeypatch.setattr(report, "time", SimpleNamespace(time=lambda: 1.5e9))


@pytest.fixture
def outside(monkeypatch: pytest.MonkeyPatch) -> Outside:
    return Outside(monkeypatch)


@pytest.mark.parametrize(
    ("antennas", "pages", "written"),
    [
        (["/gs1"], [], ["report.html"]),
        (["/gs1"], ["sky.html", None], ["sky.html", "report.html"]),
        ([], ["sky.html", None], ["sky.html"]),
        # The report then states what the bag lacks.
        ([], [None], ["report.html"]),
    ],
)
def test_every_page_is_written_and_printed(
    antennas: list[str], pages: list[str | None], written: list[str], outside: Outside, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    outside.antennas, outside.pages = antennas, pages
    report.main([str(tmp_path / "bag")])
    assert capsys.readouterr().out.splitlines() == [str(tmp_path / name) for name in written]
    assert outside.done == [("report", tmp_path / "bag", tmp_path)] * ("report.html" in written)


def test_a_report_goes_where_it_is_wanted(outside: Outside, tmp_path: Path) -> None:
    report.main([str(tmp_path / "bag"), "--output", str(tmp_path / "out")])
    assert outside.done == [("report", tmp_path / "bag", tmp_path / "out")]


@pytest.mark.parametrize("kind", ["csv", "parquet", "mat"])
def test_tables_are_exported_below_the_folder_of_the_bag(
    kind: str, outside: Outside, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report.main([str(tmp_path / "bag"), "--export", kind, "--namespace", "/gs2"])
    assert outside.done == [("read", tmp_path / "bag", "/gs2"), ("export", tmp_path / "export", kind)]
    names = [str(tmp_path / "export" / name) for name in ("a.csv", "b.csv")]
    assert capsys.readouterr().out.splitlines() == names
    report.main([str(tmp_path / "bag"), "--export", kind, "--output", str(tmp_path / "out")])
    assert outside.done[-1] == ("export", tmp_path / "out", kind)


@pytest.mark.parametrize("there", [True, False])
def test_tracked_angles_are_written_with_the_sound_part_of_a_damaged_bag(
    there: bool, outside: Outside, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "runs" / "out"
    if there:
        folder.mkdir(parents=True)
    report.main([str(tmp_path / "bag"), "--export", "tdm", "--output", str(folder)])
    path = folder / "tracking.tdm"
    assert outside.done[1:] == [
        ("tracks", tmp_path / "bag", "DSS-13", "X", None, True),
        ("tdm", path, ["raw 1", "raw 2"], "rf_pointing", 1.5e9),
    ]
    assert capsys.readouterr().out == f"{path}\n"


@pytest.mark.parametrize(("missing", "complaint"), [("station", "name no station"), ("band", "name no band")])
def test_tracked_angles_need_station_and_band(
    missing: str, complaint: str, outside: Outside, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outside.notes[missing] = ""
    with pytest.raises(SystemExit) as ended:
        report.main([str(tmp_path / "bag"), "--export", "tdm"])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
    assert len(outside.done) == 1


def test_another_form_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as ended:
        report.main([str(tmp_path / "bag"), "--export", "xls"])
    assert ended.value.code == 2
