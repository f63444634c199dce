"""The executive without ROS: what it knows, shares, keeps, records and reports, and what it answers."""

import json
from collections.abc import Collection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rf_pointing.core.dates import utc_text
from rf_pointing.operations import AlarmParams, BetweenParams
from rf_pointing.operations.dictionary import TABLES
from rf_pointing.operations.pass_work import PassRecord, record_of
from rf_pointing.operations.schedule import Entry, ScheduledPass
from rf_pointing.station.clients import night_folder, station_alarms
from rf_pointing.station.clients.alarm_hooks import HookParams
from rf_pointing.station.clients.night_watch import ExecutiveParams, NightWatch
from rf_pointing.station.description import read_station
from test.operations.test_schedule import a_pass

T_S, WALL_S = 1.8e9, 1000.0
STATION = read_station("leo_3m7")


class Bench:
    """A watch of `antenna` whose directives go nowhere, and what it has told, recorded and reported."""

    def __init__(self, folder: Path, antenna: str = "gs2", **own: Any) -> None:
        self.told: list[tuple[str, bool]] = []
        self.reports: list[Any] = []
        self.messages: list[dict[str, str]] = []
        self.folder, self.failure = folder / "night", ""
        values = {"folder": str(self.folder), "record": False} | own
        self.watch = NightWatch(
            ExecutiveParams(**values), BetweenParams(), AlarmParams(), HookParams(), STATION, "X", antenna,
            connect=self._connect, record=self._record, report=self._report, tell=lambda *told: self.told.append(told),
            publish=self.messages.append,
        )  # fmt: skip
        self.night = self.watch.night

    def _connect(self, rows: Any, own: Any, responded: Any, ended: Any) -> Any:
        self.rows, self.own, self.responded, self.ended = rows, own, responded, ended
        return SimpleNamespace(send=lambda *_: None, poll=lambda: None, close=lambda: None)

    def _record(self, bag: Path, notes: Any) -> Any:
        self.recording = SimpleNamespace(problem="", close=lambda: SimpleNamespace(path=bag), notes=notes)
        return self.recording

    def _report(self, folder: Path, health: Any) -> None:
        if self.failure:
            raise OSError(28, self.failure)
        self.reports.append((folder, health))

    def known(self, attribute: str) -> Any:
        return self.night.expected_state.value(attribute)

    def start(self, *begins_s: float, resume: bool = False) -> None:
        self.watch.start(listed(*begins_s), resume, T_S)

    def step(self, later_s: float = 0.0) -> bool:
        return self.watch.step(T_S + later_s, WALL_S + later_s)

    def journal(self) -> list[dict[str, Any]]:
        return [json.loads(row) for row in (self.folder / "journal.jsonl").read_text(encoding="utf-8").splitlines()]


def listed(*begins_s: float, **more: str) -> list[ScheduledPass]:
    """Return passes of 300 s, named p0, p1, ... that rise so long from T_S."""
    return [
        ScheduledPass(id=f"p{n}", target=f"bird{n}", aos_t_s=T_S + s, los_t_s=T_S + s + 300.0, **more)
        for n, s in enumerate(begins_s)
    ]


@pytest.fixture(autouse=True)
def disk(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the disk, of which `free` bytes are free (OSError if negative), and the `processes` that were begun."""
    one = SimpleNamespace(free=5e9, processes=[], commands=[], poll=lambda: 0, ended=0)

    def usage(_folder: Path) -> Any:
        if one.free < 0.0:
            raise OSError("the disk is gone")
        return one

    def begin(command: list[str], **_options: Any) -> Any:
        one.commands.append(command)
        one.processes.append(command[-1])
        return SimpleNamespace(poll=lambda: one.poll(), terminate=lambda: setattr(one, "ended", one.ended + 1))

    for module in (night_folder, station_alarms):
        monkeypatch.setattr(module, "shutil", SimpleNamespace(disk_usage=usage))
    monkeypatch.setattr(night_folder.subprocess, "Popen", begin)
    return one


@given(
    begun=st.permutations(range(3)), nights=st.lists(st.booleans(), min_size=3, max_size=3),
    deaf=st.lists(st.booleans(), min_size=3, max_size=3),
)  # fmt: skip
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_of_executives_of_one_antenna_that_hear_each_other_exactly_one_steers(
    tmp_path_factory: pytest.TempPathFactory, begun: list[int], nights: list[bool], deaf: list[bool]
) -> None:
    """The first with a night; the others say who, take no night, and go on where that falls silent."""
    folder = tmp_path_factory.mktemp("rivals")
    several = [Bench(folder / str(index)) for index in range(3)]
    for one, night in zip(several, nights, strict=True):
        if night:
            one.start(5000.0)

    def second(at_s: float, alive: Collection[int]) -> set[int]:
        """Let the living tell each other, and step; return those that have stepped their nights."""
        for me, one in enumerate(several):
            for other in set(alive) - {me}:
                has = not several[other].night.finished
                one.watch.take_rival(f"at {other}", night=has, first=begun[other] < begun[me], wall_s=WALL_S + at_s)
        for one in several:
            one.step(at_s)
        return {i for i, one in enumerate(several) if not one.night.finished and one.watch.health().level < 2}

    with_night = {index for index, night in enumerate(nights) if night}
    steers = second(1.0, range(3))
    assert steers == set(sorted(with_night, key=begun.__getitem__)[:1])
    for index, one in enumerate(several):
        if index not in steers and with_night:
            with pytest.raises(ValueError, match="station_executive at . has a night of this antenna"):
                one.start(6000.0)
    left = {index for index in range(3) if not deaf[index]} - steers
    second(7.0, left)
    after = second(8.0, left) & left
    assert after == set(sorted(with_night & left, key=begun.__getitem__)[:1])


@pytest.mark.parametrize(
    ("mine", "other", "silent_s", "taken"),
    [
        ("gs1", "gs2", 0.0, {"p1", "p2"}), ("gs2", "gs1", 0.0, {"p0", "p1", "p2"}), ("gs2", "gs1", 5.1, {"p2"}),
        ("gs2", "gs1", 5.0, {"p0", "p1", "p2"}),
    ],
)  # fmt: skip
def test_the_first_by_name_leaves_what_has_begun_the_second_all_and_the_living_one_takes_over(
    tmp_path: Path, mine: str, other: str, silent_s: float, taken: set[str]
) -> None:
    one = Bench(tmp_path, mine, partners=f" /{other}/,, ", partners_key_file="x")
    assert one.watch.partners == [other]
    one.watch.change(listed(600.0, 600.0, -60.0, 600.0, 600.0), [], T_S)
    # p3 has not risen: nobody can have tracked it; p9 is in no list.
    said = {"p0": "waiting", "p1": "active", "p2": "tracked", "p3": "tracked", "p4": "yields", "p9": "tracked"}
    one.watch.others.take(other, WALL_S - 99.0, one.night, states=said)
    one.watch.others.take(other, WALL_S - silent_s, one.night, night=True)
    one.step()
    assert one.night.taken == taken


def test_a_night_ends_with_its_report_once_and_with_a_result(tmp_path: Path, disk: Any) -> None:
    one = Bench(tmp_path)
    assert not one.step(), "there is no night"
    one.start(600.0)
    assert not one.step()
    assert [(row["utc"], row["event"]) for row in one.journal()][:1] == [(utc_text(T_S), "started")]
    assert one.watch.request("abort", T_S) == "abort: the executive is stopping"
    assert one.step()
    assert not one.step()
    ((folder, health),) = one.reports
    assert folder == one.folder / f"report-{utc_text(T_S)[:16].replace(':', '')}"
    assert health["disk"] == {"free_gb": 5.0}
    result = one.watch.result("")
    assert (result["success"], result["report"]) == (True, str(folder))
    one.watch.cancel(T_S)
    one.failure = "No space left"
    one.start(600.0)
    one.watch.cancel(T_S)
    assert one.step()
    assert one.watch.result("")["report"] == ""
    assert one.watch.health()[:2] == (1, f"report {folder} cannot be written: No space left")
    disk.free = -1.0
    one.step(2.0)
    assert one.watch.alarms.healths["disk"] == {"free_gb": 0.0, "problem": "the disk is gone"}


def test_the_answer_to_a_selection_names_the_target_of_a_number(tmp_path: Path) -> None:
    one = Bench(tmp_path)
    one.start(30.0)
    for later_s in (0.0, 1.0):
        one.night.take("antenna", {"mode": "holding", "azimuth": 0.5, "elevation": 0.5, "fault": ""}, T_S + later_s)
        one.night.take("tracking", {"mode": "idle", "target": ""}, T_S + later_s)
        one.step(later_s)
    assert one.night.active_id == "p0"
    one.responded(1, True, "1 passes", SimpleNamespace(passes=[SimpleNamespace(target="METEOR-M2 4")]))
    assert [each.item.name for each in one.night.schedule.in_order] == ["METEOR-M2 4"]


def test_a_list_replaces_the_schedule_unless_it_resumes(tmp_path: Path) -> None:
    one = Bench(tmp_path)
    with pytest.raises(ValueError, match="must name passes"):
        one.watch.start([], False, T_S)
    one.start(600.0, 1200.0)
    with pytest.raises(ValueError, match="the executive is running: resume, or abort first"):
        one.start(1800.0)
    one.start(600.0, 1200.0, 1800.0, resume=True)
    assert list(one.night.schedule.entries) == ["p0", "p1", "p2"]
    one.watch.request("abort", T_S)
    one.step()
    one.watch.start([], True, T_S)
    assert len(one.night.schedule.entries) == 3
    one.watch.request("abort", T_S)
    one.step()
    # A refused list changes nothing, and neither does the half of one.
    with pytest.raises(ValueError, match="pass 'p9' is not in the schedule"):
        one.watch.change(listed(0.0, 600.0, 1200.0, 1800.0), ["p0", "p9"], T_S)
    assert len(one.night.schedule.entries) == 3
    one.watch.start(listed(900.0), False, T_S)
    assert list(one.night.schedule.entries) == ["p0"]


def effect(one: Bench, later_s: float) -> tuple[str, set[str]]:
    """Return how the night goes on, and the names of the alarms, after a step."""
    one.step(later_s)
    return one.night.recovery.effect()[0], {each.name for each in one.night.book.lasting if "_node" in each.name}


def test_only_a_node_that_a_pass_needs_holds_the_night(tmp_path: Path) -> None:
    one = Bench(tmp_path)
    one.start(600.0)
    nodes = (
        "antenna_servo", "conscan_tracker", "monopulse_tracker", "operator_page", "rotctld_server",
        "ghost", "a\nb",
    )  # fmt: skip
    for node in nodes:
        one.watch.alarms.take_check(node, "state", 0, "active", {"state": "active"}, WALL_S)
    # Whoever ends says so; one that is needed is missed all the same.
    for node in ("operator_page", "antenna_servo"):
        one.watch.alarms.take_check(node, "state", 0, "finalized", {"state": "finalized"}, WALL_S)
    assert effect(one, 5.0) == ("continue", set())
    missing = {f"missing_node {node}" for node in ("monopulse_tracker", "rotctld_server")}
    assert effect(one, 5.1) == ("wait", {"lost_node antenna_servo", "lost_node conscan_tracker"} | missing)
    for node in ("antenna_servo", "conscan_tracker"):
        one.watch.alarms.take_check(node, "state", 0, "active", {"state": "active"}, WALL_S + 5.2)
    assert effect(one, 5.3) == ("continue", missing)
    # The sensor of the next pass decides which tracker is needed.
    one.watch.change(listed(900.0, sensor="monopulse"), ["p0"], T_S)
    one.night.take("antenna", {"mode": "holding", "azimuth": 0.0, "elevation": 0.5}, T_S + 5.3)
    one.step(5.4)
    assert effect(one, 5.5)[0] == "wait"


def test_a_node_that_the_recovery_table_names_is_needed_too(tmp_path: Path) -> None:
    shipped = (TABLES / "recovery.yaml").read_text()
    own = tmp_path / "recovery.yaml"
    own.write_text(f"{shipped}  transmitter:\n    when: {{transmitter.silent_s: {{above: 60}}}}\n")
    one = Bench(tmp_path, recovery_file=str(own))
    one.start(600.0)
    assert one.watch.alarms.named == {"transmitter"}
    one.watch.alarms.take_check("transmitter", "state", 0, "active", {}, WALL_S)
    assert effect(one, 5.1) == ("wait", {"lost_node transmitter"})


def test_an_alarm_goes_to_the_hooks_warns_until_it_is_acknowledged_and_is_kept(tmp_path: Path) -> None:
    one = Bench(tmp_path, state_file=str(tmp_path / "kept.json"))
    assert one.watch.alarms.report()[:2] == (0, "none")
    one.watch.begin(T_S)
    one.night.book.raise_("disk", 1, "full", T_S, ask="delete")
    one.night.book.raise_("wind", 2, "strong", T_S)
    assert one.watch.alarms.report() == (
        2, "wind: strong; disk: full", dict.fromkeys(("wind", "disk"), f"raised {utc_text(T_S)}"),
    )  # fmt: skip
    assert one.watch.acknowledge("wind", T_S) == "acknowledged: wind"
    assert "wind" in (tmp_path / "kept.json").read_text()
    assert one.watch.alarms.report().level == 1
    for name in ("disk", "wind"):
        one.night.book.clear(name, T_S + 2.0)
    assert one.watch.acknowledge("", T_S) == "acknowledged: no alarm lasts"
    utc, later = utc_text(T_S), utc_text(T_S + 2.0)
    assert [tuple(each.values())[1:] for each in one.messages] == [
        ("raised", "disk", "warning", "full", "delete", utc),
        ("raised", "wind", "error", "strong", "nothing: the station deals with it", utc),
        ("cleared", "disk", "warning", "full", "delete", later),
        ("cleared", "wind", "error", "strong", "nothing: it has ended", later),
    ]  # fmt: skip


def test_a_killed_executive_goes_on_with_the_night_that_it_kept_and_records_its_pass(tmp_path: Path, disk: Any) -> None:
    own = {"state_file": str(tmp_path / "kept.json"), "record": True}
    first = Bench(tmp_path, **own)
    first.start(600.0)
    # What was not taken over yet must not be replaced.
    assert not (tmp_path / "kept.json").exists()
    first.watch.begin(T_S)
    place = {"mode": "holding", "azimuth": 0.0, "elevation": 0.5}
    first.night.take("antenna", place, T_S + 599.0)
    first.step(600.0)
    assert first.night.active_id == "p0"
    second = Bench(tmp_path, **own)
    second.watch.begin(T_S + 601.0)
    assert (second.night.active_id, second.recording.notes["pass"]) == ("p0", "p0")
    assert second.told == [("the night goes on where it was: running", True)]
    # A night in work is not replaced by its older state.
    second.watch.request("pause", T_S + 602.0)
    second.watch.end()
    assert disk.processes == [str(second.folder / "passes" / "p0")]
    second.watch.begin(T_S + 603.0)
    assert second.night.state_name == "paused"
    disk.free = 0.0
    third = Bench(tmp_path, **own)
    third.watch.begin(T_S + 604.0)
    assert third.told[-1] == ("the rest of the pass is not recorded: 0 GB are free, must be >= 2 GB", False)


def test_a_pass_has_one_folder_one_report_and_one_verdict_however_often_it_is_joined(tmp_path: Path, disk: Any) -> None:
    one = Bench(tmp_path, record=True)
    folder = one.folder / "passes" / "p0"
    assert one.own["record"]("p0") == str(folder)
    one.step()
    assert one.known("recorder.state") == "recording"
    first = one.recording
    assert one.own["record"]("p0") == str(folder)
    assert (one.recording, disk.processes) == (first, []), "it goes on"
    one.recording.problem = "no space"
    one.step()
    assert one.known("recorder.state") == "failed"
    (folder / "bag").mkdir()
    one.own["record"]("p0")
    assert one.own["end_record"]() == str(folder / "bag-2")
    assert one.own["end_record"]() == "nothing is recorded"
    assert disk.processes == [str(folder)] * 2
    one.night.records.append(record_of(Entry(a_pass("p0", T_S)), None, one.night.book, one.night.expected_state))
    one.step()
    assert json.loads((folder / "verdict.json").read_text())["state"] == "waiting"
    disk.free = 1.99e9
    with pytest.raises(OSError, match="1.99 GB are free, must be >= 2 GB"):
        one.own["record"]("p0")
    with pytest.raises(ValueError, match="record is false"):
        Bench(tmp_path).own["record"]("p0")


def test_a_journal_that_cannot_be_written_is_a_warning_until_it_can(tmp_path: Path) -> None:
    one = Bench(tmp_path)
    one.start(600.0)
    (one.folder / "journal.jsonl").mkdir()
    one.step()
    level, message, _ = one.watch.health()
    assert (level, message.startswith(f"journal {one.folder / 'journal.jsonl'} cannot be written")) == (1, True)
    (one.folder / "journal.jsonl").rmdir()
    one.night.change(T_S)
    one.step()
    level, message, values = one.watch.health()
    assert (level, message, values["passes"], values["records"]) == (0, "running", 1, 0)
    assert [row["event"] for row in one.journal()] == ["schedule changed"]


def test_a_band_that_the_station_lacks_is_refused_by_name_unless_the_pass_is_for_another_antenna(
    tmp_path: Path,
) -> None:
    one = Bench(tmp_path)
    one.start(100.0)
    with pytest.raises(ValueError, match=r"pass p0: band='Ka' must be one of S, X"):
        one.watch.change(listed(900.0, band="Ka"), ["p0"], T_S)
    assert list(one.night.schedule.entries) == ["p0"]
    one.watch.change(listed(900.0, band="Ka", antenna="gs1"), ["p0"], T_S)


def test_a_recording_is_noted_with_the_band_of_its_pass_and_one_that_a_procedure_cannot_pass_on_is_refused(
    tmp_path: Path,
) -> None:
    for band, noted in (("S", "S"), ("", "X")):
        one = Bench(tmp_path / noted, record=True)
        one.watch.start(listed(100.0, band=band), False, T_S)
        one.own["record"](name="p0")
        assert one.recording.notes["band"] == noted
    own = tmp_path / "pass.yaml"
    own.write_text((TABLES / "pass.yaml").read_text().replace(" band: null,", "").replace(', band: "${band}"', ""))
    two = Bench(tmp_path, procedure_file=str(own))
    with pytest.raises(ValueError, match="pass p0: band=S needs a procedure_file with parameter band"):
        two.watch.start(listed(100.0, band="S"), False, T_S)


def test_a_scan_is_a_client_that_ends_with_its_pass_and_a_model_is_fitted_to_the_night(
    tmp_path: Path, disk: Any
) -> None:
    one, codes = Bench(tmp_path, model=True, elements="all.tle", record=True), [None]
    disk.poll = lambda: codes[-1]
    one.watch.start(listed(100.0, scan="cross"), False, T_S)
    one.own["scan"](name="p0", target="Moon", pattern="cross")
    folder, table = one.folder / "passes" / "p0", one.folder / "offsets.csv"
    assert disk.commands[-1][3:] == ["--namespace", "/gs2", "scan", "Moon", "--pattern", "cross", "--table", str(table),
                                     "--output", str(folder)]  # fmt: skip
    assert one.watch.folder.scan_state == "scanning"
    (folder / "scan.txt").write_text("goal sent\nno source was seen\n")
    codes.append(1)
    assert one.watch.folder.scan_state == "no source was seen"
    codes.append(0)
    assert one.watch.folder.scan_state == "complete"
    codes.append(None)
    # A pass that is not in work any more leaves no client behind.
    one.step()
    assert (disk.ended, one.watch.folder.scan_state) == (1, "")
    table.write_text("utc,target\n")
    one.watch.request("abort", T_S)
    assert any(one.step(n) for n in range(1, 100))
    fit = disk.commands[-1]
    assert fit[2].endswith("from rf_pointing.commands.fit_bias_model import main; main()")
    assert fit[3:] == [str(table), "--output", str(one.folder / "model.yaml"), "--station", str(STATION.path),
                       "--band", "X", "--elements", "all.tle"]  # fmt: skip
    for code, good, words in ((0, True, "bias model of this night"), (1, False, "it has ended without a word")):
        one.watch.folder.fit([], [])
        codes.append(code)
        one.step(100.0)
        assert one.told[-1][1] is good
        assert words in one.told[-1][0]


@pytest.mark.parametrize(
    ("more", "words"), [({"scan": "zigzag"}, "scan='?zigzag'? must be one of"), ({"scan": "cross", "band": "S"}, "in use, X")],
)  # fmt: skip
def test_a_scan_of_an_unknown_pattern_or_in_another_band_is_refused(
    tmp_path: Path, more: dict[str, str], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        Bench(tmp_path).watch.start(listed(100.0, **more), False, T_S)


def test_elements_are_refined_from_all_passes_of_a_satellite_once_it_has_two_and_only_where_they_are_better(
    tmp_path: Path, disk: Any
) -> None:
    elements = tmp_path / "elements" / "catalogue.tle"
    elements.parent.mkdir()
    one, codes = Bench(tmp_path, refine=str(elements)), []
    disk.poll = lambda: codes[-1]

    def tracked(number: int, name: str, state: str = "tracked") -> Path:
        folder = one.folder / "passes" / f"p{number}"
        folder.mkdir(parents=True)
        (folder / "bag").mkdir()
        one.night.records.append(PassRecord(
            id=f"p{number}", name=name, aos_t_s=T_S, los_t_s=T_S + 600.0, state=state, reason="", tracked_s=600.0,
            lost_s=0.0, loss_db=0.1, attempts=1, causes=(), element_age_h=None, recorded=True, band="X",
        ))  # fmt: skip
        one.watch.step(T_S, WALL_S)
        return folder

    tracked(1, "CBERS 2")
    tracked(2, "ISS")
    tracked(3, "CBERS 2", "lost")
    assert disk.commands == []
    codes.append(None)
    folder = tracked(4, "CBERS 2")
    (command,) = disk.commands
    bags = [str(one.folder / "passes" / name / "bag") for name in ("p1", "p4")]
    assert command[3:5] == bags
    assert command[5:] == ["--elements", str(elements), "--if-better", "--output", str(folder / "orbit"),
                           "--station", str(STATION.path), "--band", "X", "--satellite", "CBERS 2"]  # fmt: skip
    place = elements.parent / "refined-2003-049A.omm"
    (folder / "orbit.txt").write_text("an orbit\nnot written: the orbit's sigma is 900 m\n")
    codes.append(1)
    one.watch.step(T_S, WALL_S)
    assert one.told[-1] == (
        "elements not refined from passes up to p4: not written: the orbit's sigma is 900 m", False,
    )  # fmt: skip
    assert not place.exists()
    codes.append(None)
    folder = tracked(5, "CBERS 2")
    assert disk.commands[-1][3:6] == [*bags, str(folder / "bag")]
    (folder / "orbit.txt").write_text("written\n")
    (folder / "orbit.omm").write_text("OBJECT_ID = 2003-049A\n")
    codes.append(0)
    one.watch.step(T_S, WALL_S)
    assert one.told[-1] == (f"elements refined from passes up to p5: {place}", True)
    assert place.read_text() == "OBJECT_ID = 2003-049A\n"
