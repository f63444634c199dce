"""The morning report: what is on the page, what is in the JSON, and what there is to do."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.core.dates import utc_text
from rf_pointing.operations.pass_work import VERDICT
from rf_pointing.report import night_report
from rf_pointing.report.night_report import night_of, page, write_night
from rf_pointing.report.outcome import judged_by_night
from rf_pointing.report.summary import OutcomeNumbers, Verdict

T0 = 1_151_347_200.0


def record(name: str, start_s: float, **changes: Any) -> dict[str, Any]:
    values = {
        "id": name, "name": name, "aos_t_s": T0 + start_s, "los_t_s": T0 + start_s + 600.0, "state": "tracked",
        "reason": "loss of signal", "tracked_s": 590.0, "lost_s": 10.0, "loss_db": 0.12, "attempts": 1, "causes": [],
        "element_age_h": 12.0, "recorded": True,
    }  # fmt: skip
    return values | changes


def state(records: list[dict[str, Any]], history: Sequence[Any] = (), alarms: Sequence[Any] = ()) -> dict[str, Any]:
    schedule = [{"pass": {"id": each["id"], "priority": 3}, "state": each["state"]} for each in records]
    schedule.append({"pass": {"id": "other", "priority": 0}, "state": "yields"})
    kept = {"history": list(history), "alarms": list(alarms), "messages": 3}
    return {"begun_s": T0, "schedule": schedule, "records": records, "alarms": kept}


def test_a_good_night_says_that_there_is_nothing_to_do() -> None:
    report = night_of(state([record("SAT 1", 600.0), record("SAT 2", 3600.0)]), "Dish")
    assert (report.tracked, report.yielded, report.to_do) == (2, 1, ())
    assert report.held_share == pytest.approx(590.0 / 600.0)
    text = page(report)
    assert "Nothing to do today" in text
    assert "2 of 2" in text
    assert text.count("<rect") == 4, "two passes, each with the share that was lost"
    assert 'href="../passes/SAT%201/report.html"' in text


HISTORY = [
    [T0 + 4000.0, "raised", "latched_fault", 2, "the antenna has a latched fault: drives cut"],
    [T0 + 4060.0, "cleared", "latched_fault", 2, "the antenna has a latched fault: drives cut"],
    [T0 + 5000.0, "raised", "full_disk", 1, "0.1 GB are free"],
    [T0 + 5100.0, "acknowledged", "full_disk", 1, "0.1 GB are free"],
]
FAULT = {"name": "latched_fault", "level": 2, "message": "drives cut", "raised_t_s": T0 + 4000.0,
         "cleared_t_s": T0 + 4060.0, "ask": ""}  # fmt: skip
DISK = {"name": "full_disk", "level": 1, "message": "0.1 GB are free", "raised_t_s": T0 + 5000.0, "ask": "free space"}


def bad_night() -> Any:
    records = [
        record("SAT 1", 600.0),
        record("<b>SAT 2", 3600.0, state="lost", reason="50 % of the pass was held", tracked_s=300.0, lost_s=300.0,
               loss_db=3.0, attempts=2, causes=["latched_fault since 06:26:40: drives cut", "no carrier"], element_age_h=90.0),
        record("SAT 3", 6000.0, recorded=False),
    ]  # fmt: skip
    health = {"model": {"health": "4 days since the last observation", "level": 1}, "relays": {"starts": "412, 260"}}
    return night_of(state(records, HISTORY, [FAULT, DISK]), "Dish", health=health)


def test_what_to_do_begins_with_what_lasts_and_names_every_cause() -> None:
    to_do = bad_night().to_do
    assert to_do[0] == "0.1 GB are free: free space"
    words = " ".join(to_do)
    for part in ("fetch newer elements of <b>SAT 2", "1 passes were lost", "1 tracked passes were not recorded",
                 "pointing model: 4 days"):  # fmt: skip
        assert part in words


def test_the_page_has_the_lost_seconds_with_their_causes_and_escapes_names(tmp_path: Path) -> None:
    report = bad_night()
    write_night(report, tmp_path / "night")
    text = (tmp_path / "night" / "night.html").read_text()
    # It lasted when the pass was written down; what lasts now has no end.
    cause = f"latched_fault {utc_text(T0 + 4000.0)[11:19]} to {utc_text(T0 + 4060.0)[11:19]}, 60 s: "
    assert cause.replace("_", " ") in text
    assert "0.1 GB are free" in report.alarms[1].message
    assert "3 messages sent" in text
    assert "joined 1 times" in text
    assert "&lt;b&gt;SAT 2" in text
    assert "<b>SAT 2" not in text
    assert "412, 260" in text
    values = json.loads((tmp_path / "night" / "night.json").read_text())
    assert values["tracked"] == 2
    assert values["passes"][1]["lost_s"] == 300.0
    assert values["passes"][1]["causes"] == [f"{cause}the antenna has a latched fault: drives cut", "no carrier"]
    # The index has every night of the folder, also one whose file was cut short.
    (tmp_path / "report-2006-06-27T1800").mkdir()
    (tmp_path / "report-2006-06-27T1800" / "night.json").write_text('{"begun')
    write_night(report, tmp_path / "report-2006-06-26T1800")
    index = (tmp_path / "index.html").read_text()
    assert index.index("report-2006-06-27T1800/night.html") < index.index("report-2006-06-26T1800/night.html")
    assert "2 of 3" in index
    # One night is no trend; of two the oldest is the first bar, as high as its share of the time.
    assert "<rect" not in index
    later = tmp_path / "report-2006-06-28T1800"
    write_night(night_of(state([record("SAT 1", 600.0, tracked_s=540.0)]), "Dish"), later)
    bars = re.findall(
        r'<rect x="(\d+)" [^>]* height="([\d.]+)"\s+class="bar([^"]*)"', (tmp_path / "index.html").read_text()
    )
    assert [(int(x), float(height), "tracked" in words) for x, height, words in bars] == [
        (30, pytest.approx(100.0 * report.held_share), False), (42, pytest.approx(90.0), True),
    ]  # fmt: skip
    assert values["to_do"] == list(report.to_do)


def test_what_fills_gaps_is_one_line_and_no_pass_of_the_counts(tmp_path: Path) -> None:
    """18 gaps of 640 s, and one in which the drive did not answer."""
    filler = {"name": "QO-100", "filler": True}
    pieces = [record(f"QO-100 {k}", 900.0 * k, tracked_s=640.0) | filler for k in range(18)]
    lost = record("QO-100 x", 17000.0, state="lost", reason="no answer", tracked_s=0.0) | filler
    text, night = [], tmp_path / "report-2006-06-26T1800"
    for records in (pieces, [*pieces, lost, record("SAT 1", 18000.0, tracked_s=540.0)]):
        report = night_of(state(records), "Dish")
        write_night(report, night)
        text.append((night / "night.html").read_text())
    assert "tracked in 18 gaps, 3.2 h" in text[0]
    assert "tracked in 18 of 19 gaps, 3.2 h" in text[1]
    assert [each.count("QO-100</span>") for each in text] == [1, 1]
    assert f"{utc_text(T0 + 17000.0)[11:16]}: no answer" in text[1]
    assert (report.tracked, len(report.chosen), report.held_share, report.to_do) == (1, 1, 0.9, ())
    assert "1 of 1" in (tmp_path / "index.html").read_text()


def test_a_night_without_a_pass_is_a_page_too() -> None:
    assert "Nothing to do" in page(night_of({"begun_s": None, "schedule": [], "records": [],
                                             "alarms": {"history": [], "alarms": []}}, "Dish"))  # fmt: skip


def test_an_alarm_keeps_its_worst_level_and_an_end_without_a_raise_is_none() -> None:
    history = [
        [T0 + 10.0, "cleared", "old", 1, "of the night before"],
        [T0 + 20.0, "raised", "disk", 1, "1 GB is free"],
        [T0 + 30.0, "worse", "disk", 2, "0.1 GB are free"],
        [T0 + 40.0, "cleared", "disk", 2, ""],
        [T0 + 50.0, "raised", "disk", 1, "1 GB is free"],
    ]
    first, again = night_of(state([], history), "Dish").alarms
    assert (first.level, first.raised_t_s, first.until_t_s) == (2, T0 + 20.0, T0 + 40.0)
    assert (again.level, again.until_t_s, again.acknowledged) == (1, None, False)


def to_do(records: list[dict[str, Any]], history: Sequence[Any] = (), **health: Any) -> tuple[str, ...]:
    return night_of(state(records, history), "Dish", health=health).to_do


def test_what_is_not_well_is_to_be_looked_at() -> None:
    model = {"health": "no observation", "level": 0}
    assert to_do([record("SAT 1", 600.0)], model=model, inputs={"lost": 0}) == ()
    assert to_do([record("SAT 1", 600.0, recorded=False)], model=model | {"level": 1}, inputs={"lost": 5}) == (
        "1 tracked passes were not recorded: free space on the disk",
        "pointing model: no observation",
        "5 messages were lost on the way to the executive: look at the network",
    )


# The picture and the tables, before they are a page


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return what the page of a night from midnight on shows."""
    monkeypatch.setattr(night_report, "render", lambda _, **values: values)

    def show(
        span_s: float, records: list[dict[str, Any]], history: Sequence[Any] = (),
        begun_s: float = MIDNIGHT, **health: Any,
    ) -> dict[str, Any]:  # fmt: skip
        kept = state(records, history) | {"begun_s": begun_s}
        values: Any = page(night_of(kept, "Dish", health=health, ended_t_s=begun_s + span_s))
        return dict(values)

    return show


MIDNIGHT = 1_151_280_000.0


def test_the_tables_have_each_pass_alarm_and_device(shown: Any) -> None:
    at = MIDNIGHT - T0
    records = [
        record("SAT 1", at + 60.0, element_age_h=None),
        record("SAT 2", at + 3600.0, state="lost", reason="clouds", causes=["drives cut", "wind"], recorded=False),
        record("SAT 3", at + 7200.0, element_age_h=30.0),
    ]
    history = [
        row
        for k, span_s in enumerate((119.0, 121.0, 140.0))
        for row in (
            [MIDNIGHT + 1000.0 * k, "raised", f"alarm {k}", k % 3, "text"],
            [MIDNIGHT + 1000.0 * k + span_s, "cleared", f"alarm {k}", k % 3, ""],
        )
    ]
    history += [
        [MIDNIGHT + 5000.0, "raised", "disk", 1, "1 GB is free"],
        [MIDNIGHT + 5001.0, "acknowledged", "disk", 1, ""],
    ]
    page = shown(10_800.0, records, history, relays={"starts": 412}, disk={"free": "1 GB"})
    first, second, _ = page["passes"]
    assert first == {"clock": "00:01", "name": "SAT 1", "cause": "", "state": "tracked",
                     "held": pytest.approx(98.333, abs=1e-3),
                     "why": ["alarm 0 00:00:00 to 00:01:59, 119 s:"], "lost_s": 10,
                     "loss_db": 0.12, "report": "../passes/SAT%201/report.html"}  # fmt: skip
    assert second["why"] == ["clouds", "drives cut", "wind"], "the disk was full later"
    assert second["report"] == ""
    assert [(each["level"], each["span"]) for each in page["alarms"]] == [
        ("", "119 s"), ("warning", "2 min"), ("error", "2 min"), ("warning", "lasts, acknowledged"),
    ]  # fmt: skip
    assert page["health"] == [("disk", "free", "1 GB"), ("relays", "starts", "412")]
    assert (page["begun"], page["ended"], page["oldest_h"]) == ("2006-06-26 00:00", "2006-06-26 03:00", 30.0)
    assert shown(10_800.0, records[:1])["oldest_h"] is None


def test_a_bar_is_where_its_pass_or_alarm_was(shown: Any) -> None:
    """A night of three hours is 1080 wide: 0.1 a second."""
    at = MIDNIGHT - T0
    records = [
        record("SAT 1", at - 300.0),
        record("SAT 2", at + 1000.7, lost_s=150.0),
        record("SAT 3", at + 5000.0, los_t_s=MIDNIGHT + 5000.5, lost_s=0.5, state="lost"),
        record("SAT 4", at + 10_500.0),
    ]
    history = [
        [MIDNIGHT + 1000.0, "raised", "disk", 1, "1 GB is free"],
        [MIDNIGHT + 3000.0, "cleared", "disk", 1, ""],
        [MIDNIGHT + 4000.0, "raised", "drives", 2, "drives cut"],
        [MIDNIGHT + 4010.0, "cleared", "drives", 2, ""],
        [MIDNIGHT + 9800.0, "raised", "disk", 1, "1 GB is free"],
    ]
    shows = shown(10_800.0, records, history)["timeline"]
    passes, alarms = ([(each["x"], each["width"]) for each in shows[kind]] for kind in ("passes", "alarms"))
    assert passes == [(0.0, 30.0), (100.1, pytest.approx(60.0)), (500.0, 2.0), (1050.0, 30.0)]
    assert [each["lost"] for each in shows["passes"]] == [10.0 / 600.0, pytest.approx(150.0 / 600.0), 0.5, 10.0 / 600.0]
    assert shows["passes"][2]["text"] == "SAT 3, 01:23:20: lost, 0 s lost"
    assert alarms == [(100.0, 200.0), (400.0, 3.0), (980.0, 100.0)]
    assert [each["lane"] for each in shows["alarms"]] == [0, 1, 0]
    assert (shows["names"], shows["height"]) == (["disk", "drives"], 70.0 + 2 * 26.0 + 24.0)


def test_passes_that_were_left_out_by_choice_are_neither_lost_nor_counted() -> None:
    left = [record("A", 600.0, state="skipped", tracked_s=0.0), record("B", 3600.0)]
    report = night_of(state(left), "Dish")
    assert (report.tracked, len(report.chosen), report.to_do, report.held_share) == (
        1, 1, (), pytest.approx(590.0 / 600.0),
    )  # fmt: skip
    assert "1 of 1" in page(report)


def test_a_pass_has_one_verdict_that_of_the_night_over_all_attempts(tmp_path: Path) -> None:
    """The recording of the last attempt alone would say: tracked, 89.86 %."""
    counted = OutcomeNumbers(tracked_s=89.86, lost_s=10.14, held_percent=89.86, mean_loss_db=0.4)
    found = Verdict(tracked=True, reason="loss of signal", source="counted", counted=counted, faults=[])
    assert judged_by_night(found, tmp_path / VERDICT) == found
    kept = record(
        "A", 600.0, state="lost", reason="74 % of the pass was held", tracked_s=222.0, lost_s=78.0, loss_db=1.5
    )
    (tmp_path / VERDICT).write_text(json.dumps(kept))
    judged = judged_by_night(found, tmp_path / VERDICT)
    assert (judged.tracked, judged.reason, judged.source) == (False, "74 % of the pass was held", "night")
    assert judged.counted is not None
    assert (judged.counted.held_percent, judged.counted.mean_loss_db) == pytest.approx((74.0, 1.5))
