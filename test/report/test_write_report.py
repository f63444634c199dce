"""One call from a bag to a page, a table and pictures."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.report import write_report
from rf_pointing.report.analysis import analyse
from rf_pointing.report.bag_writer import LOST_NOTE, PROBLEM_NOTE, BagWriter
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.recording import read_recording
from rf_pointing.report.statistics import summarize
from rf_pointing.report.summary import to_json
from rf_pointing.report.write_report import page

VOID = {"meta", "img", "br"}


class Checker(HTMLParser):
    """Collects the links of a page and complains about tags that do not match."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.words: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for key, value in attrs if key in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def checked(html: str) -> Checker:
    checker = Checker()
    checker.feed(html)
    checker.close()
    assert checker.open == []
    return checker


def planned(t: float) -> str:
    return "program_track" if t < 5.0 - 1e-9 else "monopulse"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, synthetic_run: type[Any], types: Definitions) -> Path:
    root = tmp_path_factory.mktemp("report")
    run = synthetic_run(
        seconds=15.0, aos_los_s=(2.0, 14.0), mode=planned,
        error_mdeg=lambda t: (40.0, -30.0) if planned(t) == "program_track" else (1.5, -0.5),
        offset_mdeg=lambda t: (0.0, 0.0) if planned(t) == "program_track" else (40.0, -30.0),
        dropped={"target": {7}}, target=lambda t: "28057" if t < 14.0 else "",
        reason=lambda t: "" if t < 14.0 else "loss of signal",
        counted=lambda t: (min(max(t - 4.1, 0.0), 9.9), min(max(t - 2.0, 0.0), 2.1), 0.8),
        predicted={"mean_loss": 0.7, "lost": 1.0, "late": 0.25, "acquisition": 0.5},
    )  # fmt: skip
    run.write(root / "bag", types, {"station": "DSS-13 <&>"})
    write_report(root / "bag", root / "report")
    return root


def test_page_needs_nothing_else(folder: Path) -> None:
    html = (folder / "report" / "report.html").read_text()
    checker = checked(html)
    assert len(checker.links) == 6
    assert all(link.startswith("data:image/png;base64,") for link in checker.links)
    assert not re.search(r"https?://|@import|url\(", html)
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in html
    assert "@media print" in html


def test_headline_numbers_are_on_the_page(folder: Path) -> None:
    words = checked((folder / "report" / "report.html").read_text()).text
    assert "Pass of 28057" in words
    assert "tracked loss of signal; 75.17 % within half power" in words
    assert "9.020 s held 2.98 s lost, 1.75 s predicted" in words
    assert "0.98 dB mean pointing loss of the pass, 0.70 dB predicted by its certificate" in words
    for row in ("predicted by the certificate 10.2 1.75 85.4 0.700", "counted by the controller 9.90 2.10 82.5 0.800",
                "flown, by the true error 9.02 2.98 75.2 0.977"):  # fmt: skip
        assert row in words
    assert "1.50 / 0.500 mdeg true error, rms cross-elevation / elevation, after acquisition" in words
    assert "41.5 / 30.5 mdeg rms of program track alone, 7.6 dB lost" in words
    assert "1 messages lost" in words
    assert "DSS-13 <&>" in words


def test_tables_and_page_come_from_the_same_numbers(folder: Path) -> None:
    table = json.loads((folder / "report" / "summary.json").read_text())
    assert table["headline"]["error"]["cross_elevation"]["rms_mdeg"] == pytest.approx(1.5)
    assert table["headline"]["messages_lost"] == 1
    names = {path.name for path in (folder / "report").iterdir()}
    pictures = {f"{name}.png" for name in ("pointing_error", "link", "sky_track", "beam", "axes", "timing")}
    assert names == {"report.html", "summary.json", *pictures}


def test_second_report_replaces_the_first(folder: Path, synthetic_run: type[Any], types: Definitions) -> None:
    few = {"truth": False, "left_out": {"joint_states", "tracking_status", "pointing_error", "monopulse"}}
    synthetic_run(seconds=2.0, **few).write(folder / "short", types)
    synthetic_run(seconds=3.0, **few).write(folder / "long", types)
    first = write_report(folder / "short", folder / "again")
    assert json.loads((folder / "again" / "summary.json").read_text()) == json.loads(to_json(first))
    second = write_report(folder / "long", folder / "again")
    assert json.loads((folder / "again" / "summary.json").read_text()) == json.loads(to_json(second))
    assert second.bag.message_count > first.bag.message_count


def test_what_the_recorder_lost_is_named(tmp_path: Path, synthetic_run: type[Any], types: Definitions) -> None:
    lost = [{"topic": "/gs1/monopulse", "count": 123, "first_log_time_ns": 1_800_000_000 * 10**9}]
    notes = {PROBLEM_NOTE: "recording stopped: No space left on device", LOST_NOTE: json.dumps(lost)}
    synthetic_run(seconds=2.0).write(tmp_path / "bag", types, notes)
    summary = summarize(analyse(read_recording(tmp_path / "bag")))
    words = checked(page(summary, {})).text
    assert "recording stopped: No space left on device" in words
    assert "123 messages of /gs1/monopulse were not recorded, from 2027-01-15T08:00:00.000Z" in words
    assert summary.headline.messages_lost == 123
    assert summary.bag.notes == {}


def test_text_of_nodes_cannot_become_markup(tmp_path: Path, synthetic_run: type[Any], types: Definitions) -> None:
    synthetic_run(seconds=2.0, mode=lambda _: "<img src=x>").write(tmp_path / "bag", types)
    html = page(summarize(analyse(read_recording(tmp_path / "bag"))), {})
    assert "<img src=x>" not in html
    assert "&lt;img src=x&gt;" in html


def test_nearly_empty_recording_still_gives_a_page(tmp_path: Path, types: Definitions, maker: Any) -> None:
    with BagWriter(tmp_path / "bag", types) as bag:
        bag.register("/gs1/sim/boresight", "rf_pointing_msgs/msg/Boresight")
        bag.register("/gs1/joint_states", "sensor_msgs/msg/JointState")
        bag.write("/gs1/sim/boresight", 5, maker.serialized("rf_pointing_msgs/msg/Boresight"))
    summary = write_report(tmp_path / "bag", tmp_path / "report")
    words = checked((tmp_path / "report" / "report.html").read_text()).text
    assert "Recording of /gs1" in words
    assert "What this recording does not tell" in words
    assert summary.outcome.tracked is None
    assert "no joint_states: no axis rates" in summary.problems


def test_nothing_is_written_for_a_bag_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="does not exist"):
        write_report(tmp_path / "missing", tmp_path / "report")
    assert not (tmp_path / "report").exists()
