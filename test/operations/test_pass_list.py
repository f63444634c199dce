"""Lists of passes: every field on its way out and in, what may be missing, and what is refused."""

import json
import math
import re

import pytest

from rf_pointing.operations import pass_list
from rf_pointing.operations.pass_list import read_passes, row_of, to_calendar, to_csv, to_json, to_simple_schedule
from rf_pointing.operations.schedule import ScheduledPass

AOS_S, LOS_S = 1_767_229_200.25, 1_767_229_900.75
"""2026-01-01 01:00:00.25 and 700.5 s later."""
WHOLE = ScheduledPass(
    id="7", target="33591", name="NOAA 19", aos_t_s=AOS_S, los_t_s=LOS_S, priority=-3, peak_rad=math.radians(40.0),
    azimuth_path_rad=tuple(map(math.radians, (10.0, -5.0, 200.0, 190.0))),
    elevation_rad=(math.radians(5.0), math.radians(7.0)), antenna="gs2", sensor="program", element_age_s=5400.0,
    band="S", scan="cross", filler=True,
)  # fmt: skip
ROW = {
    "id": "7", "name": "NOAA 19", "target": "33591", "priority": -3, "aos_utc": "2026-01-01T01:00:00.250Z",
    "los_utc": "2026-01-01T01:11:40.750Z", "peak_elevation_deg": 40.0, "aos_azimuth_deg": 10.0,
    "azimuth_low_deg": -5.0, "azimuth_high_deg": 200.0, "azimuth_end_deg": 190.0, "aos_elevation_deg": 5.0,
    "los_elevation_deg": 7.0, "antenna": "gs2", "sensor": "program", "band": "S", "element_age_h": 1.5,
    "scan": "cross", "filler": True,
}  # fmt: skip
HEAD = "target,aos_utc,los_utc"
TIMES = "2026-01-01T01:00:00Z,2026-01-01T01:10:00Z"


def test_a_row_holds_degrees_hours_and_utc() -> None:
    assert row_of(WHOLE) == ROW
    bare = row_of(ScheduledPass(id="b", target="x", aos_t_s=AOS_S, los_t_s=LOS_S))
    assert (bare["azimuth_low_deg"], bare["element_age_h"]) == (None, None)
    assert row_of(ScheduledPass(id="b", target="x", aos_t_s=0.0, los_t_s=1.0, peak_rad=1.0))[
        "peak_elevation_deg"
    ] == round(math.degrees(1.0), 6)


@pytest.mark.parametrize("form", ["json", "json list", "csv", "calendar"])
def test_every_field_comes_back(form: str) -> None:
    text = {
        "json": lambda: to_json([WHOLE]),
        "json list": lambda: " \n" + json.dumps([ROW]),
        "csv": lambda: "\ufeff" + to_csv([WHOLE]),
        "calendar": lambda: to_calendar([WHOLE], "Station", 0.0),
    }[form]()
    (back,) = read_passes(text)
    for name in ("id", "target", "name", "priority", "antenna", "sensor", "band", "scan", "filler"):
        assert getattr(back, name) == getattr(WHOLE, name)
    for name in ("aos_t_s", "los_t_s", "peak_rad", "element_age_s"):
        assert getattr(back, name) == pytest.approx(getattr(WHOLE, name), abs=1e-6)
    assert back.azimuth_path_rad == pytest.approx(WHOLE.azimuth_path_rad, abs=1e-7)
    assert back.elevation_rad == pytest.approx(WHOLE.elevation_rad, abs=1e-7)


@pytest.mark.parametrize("key", ["target", "catalogue_number", "name"])
def test_target_and_times_are_enough(key: str) -> None:
    (one,) = read_passes(f"{key},aos_utc,los_utc\nA B,{TIMES}\n")
    middle = 1_767_229_200 + 300
    assert (one.id, one.target, one.name) == (f"A_B-{middle}", "A B", "A B")
    assert (one.priority, one.peak_rad, one.elevation_rad, one.antenna, one.sensor) == (0, 0.0, (0.0, 0.0), "", "")
    assert one.azimuth_path_rad is None
    assert math.isnan(one.element_age_s)


def test_the_target_is_the_first_of_target_number_and_name() -> None:
    (one,) = read_passes(f"name,catalogue_number,target,aos_utc,los_utc\nn,5,t,{TIMES}\n")
    assert (one.target, one.name) == ("t", "n")
    (one,) = read_passes(f"name,catalogue_number,target,aos_utc,los_utc\nn,5,,{TIMES}\n")
    assert (one.target, one.name) == ("5", "n")


def test_a_path_of_azimuths_without_one_of_its_four_is_none() -> None:
    whole = {key: value for key, value in ROW.items() if key != "azimuth_end_deg"}
    (one,) = read_passes(json.dumps([whole]))
    assert one.azimuth_path_rad is None


def test_lists_without_passes_are_lists() -> None:
    assert to_csv([]) == "id\n"
    assert to_json([]) == '{"passes": [\n\n]}\n'
    for text in (to_csv([]), to_json([]), to_calendar([], "x", 0.0)):
        assert read_passes(text) == []


def test_a_list_has_a_most_of_passes_that_it_may_have(monkeypatch: pytest.MonkeyPatch) -> None:
    assert pass_list.MOST_PASSES == 20_000
    monkeypatch.setattr(pass_list, "MOST_PASSES", 2)
    rows = [f"{name},{TIMES}" for name in "abc"]
    assert len(read_passes("\n".join([HEAD, *rows[:2]]))) == 2
    with pytest.raises(ValueError, match="a schedule of 3 passes must have <= 2"):
        read_passes("\n".join([HEAD, *rows]))


@pytest.mark.parametrize(("fate", "taken"), [("", True), ("tracked", True), (None, True), ("yields", False)])
def test_of_a_plan_the_passes_without_another_fate_are_taken(fate: str | None, taken: bool) -> None:
    row = {"target": "a", "aos_utc": "2026-01-01T01:00:00Z", "los_utc": "2026-01-01T01:10:00Z", "fate": fate}
    assert len(read_passes(json.dumps([row]), every=False)) == taken
    assert len(read_passes(json.dumps([row]))) == 1
    del row["fate"]
    assert len(read_passes(json.dumps([row]), every=False)) == 1


def test_three_of_the_ids_that_are_there_twice_are_named() -> None:
    rows = [f"{name},a,{TIMES}" for name in "d0cbadcba"]
    with pytest.raises(ValueError, match="^pass a, b, c is in the list twice$"):
        read_passes("\n".join([f"id,{HEAD}", *rows]))


def calendar_of(*lines: str) -> str:
    event = ["BEGIN:VEVENT", "SUMMARY:S", *lines, "END:VEVENT"]
    return "\r\n".join(["BEGIN:VCALENDAR", "VERSION:2.0", "PRODID:own", *event, "END:VCALENDAR", ""])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{HEAD}\na,{TIMES}\n,{TIMES}\n", "row 2: target=''"),
        (f"{HEAD},priority\na,{TIMES},high\n", "row 1: priority='high' must be a number"),
        (f"{HEAD},priority\na,{TIMES},1.5\n", "row 1: priority='1.5' must be a whole number"),
        ('[{"target": ["a"], "aos_utc": "", "los_utc": ""}]', r"row 1: target=\['a'\] must be a text"),
        (f"{HEAD},id\na,{TIMES},../../x\n", r"row 1: id='../../x' must be <= 100 letters"),
        (f"{HEAD},name\na,{TIMES},a\x07b\n", r"row 1: name='a.x07b' must be one line of <= 100 printable signs"),
        (f"{HEAD}\na,1960-01-01T00:00:00Z,1960-01-01T00:10:00Z\n", "must be from 1970 to 2038"),
        (f"{HEAD},name\na,{TIMES},{'x' * 200_000}\n", "not a table: field larger than field limit"),
        (f"{HEAD},element_age_h\na,{TIMES},inf\n", "row 1: element_age_h='inf' must be a number from"),
        (f"{HEAD},azimuth_low_deg\na,{TIMES},nan\n", "row 1: azimuth_low_deg='nan' must be a number from"),
        ('[{"target": "a"}, 3]', "must be a list of passes"),
        ('{"list": []}', "must be a list of passes"),
        ('{"passes": 3}', "must be a list of passes"),
        (f"{HEAD},peak_elevation_deg\na,{TIMES},x\n", "row 1: peak_elevation_deg='x' must be a number"),
        (f"{HEAD},filler\na,{TIMES},maybe\n", "row 1: filler='maybe' must be true or false"),
        (f"{HEAD}\na,soon,later\n", "row 1"),
        (f"{HEAD}\na,{','.join(reversed(TIMES.split(',')))}\n", "row 1: aos=.* must be < los="),
        ("BEGIN:VCALENDAR\nBEGIN:VEVENT\n", "not a calendar|must have dtstart"),
        ('[{"target": "a", "los_utc": "2026-01-01T00:10:00Z"}]', "row 1: aos_utc is missing"),
        ("BEGIN:VCALENDAR\r\nBEGIN:VEVENT\r\nSUMMARY:S\r\nX-RF-POINTING-PASS:[1]\r\nEND:VEVENT\r\nEND:VCALENDAR\r\n",
         "X-RF-POINTING-PASS of S must be an object"),
        ("BEGIN:VCALENDAR\r\nBEGIN:VEVENT\r\nSUMMARY:S\r\nDTSTART:20260101T010000Z\r\nEND:VEVENT\r\nEND:VCALENDAR\r\n",
         "event S must have dtstart, and dtend or duration"),
        ("BEGIN:VCALENDAR\r\nBEGIN:VEVENT\r\nSUMMARY:S\r\nDTEND:20260101T010000Z\r\nEND:VEVENT\r\nEND:VCALENDAR\r\n",
         "event S must have dtstart, and dtend or duration"),
        ("BEGIN:VCALENDAR\r\nBEGIN:VEVENT\r\nSUMMARY:S\r\nDTSTART;VALUE=DATE:20260101\r\nDTEND;VALUE=DATE:20260102\r\n"
         "END:VEVENT\r\nEND:VCALENDAR\r\n", "with a time of day"),
        *((calendar_of("DTSTART:20260101T010000Z", "DTEND:20260101T011000Z", more), f"event S has {more.split(':')[0]}: ")
          for more in ("RRULE:FREQ=DAILY;COUNT=3", "EXRULE:FREQ=DAILY", "RDATE:20260102T010000Z", "EXDATE:20260102T010000Z",
                       "RECURRENCE-ID:20260101T010000Z")),
        (calendar_of("DTSTART:20260101T010000", "DTEND:20260101T011000"),
         "event S has a time without a zone, 2026-01-01T01:00:00: write Z or TZID"),
        (calendar_of("DTSTART:20260101T010000", "DURATION:PT10M"), "event S has a time without a zone"),
        (calendar_of("DTSTART;TZID=Moon/Tycho:20260101T010000", "DURATION:PT10M"),
         "event S has a time in a zone that is not known, TZID=Moon/Tycho: write Z"),
        (calendar_of("DTSTART:20260101T010000Z", "DURATION:PT10M")[:-20], "not a calendar"),
    ],
)  # fmt: skip
def test_what_is_no_pass_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_passes(text)


def test_an_event_holds_all_of_its_pass_in_whole_seconds_with_its_remark() -> None:
    other = ScheduledPass(id="8", target="40069", aos_t_s=AOS_S, los_t_s=LOS_S + 0.25, priority=2)
    text = to_calendar([WHOLE, other], "Dish", 1_767_225_600.9, {"7": "a remark"}).replace("\r\n ", "")
    lines = text.splitlines()
    for line in (
        "VERSION:2.0", "PRODID:-//rf_pointing//plan_passes//EN",
        "DTSTAMP:20260101T000000Z", "DTSTART:20260101T010000Z", "DTEND:20260101T011141Z", "DTEND:20260101T011142Z",
        "SUMMARY:NOAA 19\\, peak 40 deg", "SUMMARY:40069\\, peak 0 deg", "DESCRIPTION:a remark",
        "DESCRIPTION:40069\\, priority 2", "LOCATION:Dish", "UID:7@rf_pointing", "X-WR-CALNAME:Passes over Dish",
    ):  # fmt: skip
        assert line in lines, line


@pytest.mark.parametrize(
    ("begin", "end"),
    [
        ("DTSTART:20260101T010000Z", "DTEND:20260101T011000Z"),
        ("DTSTART:20260101T010000Z", "DURATION:PT10M"),
        ("DTSTART:20260101T010000Z", "DURATION:PT600S"),
        ("DTSTART;TZID=America/New_York:20251231T200000", "DURATION:P0DT0H10M0S"),
        ("DTSTART;TZID=Europe/Berlin:20260101T020000", "DTEND;TZID=Europe/Berlin:20260101T021000"),
        ("DTSTART;TZID=W. Europe Standard Time:20260101T020000", "DURATION:PT10M"),
        ("DTSTART;TZID=/mozilla.org/20050126_1/Europe/Berlin:20260101T020000", "DURATION:PT10M"),
        ("DTSTART:20260101T010000Z", "DTEND:20260101T01\r\n 1000Z"),
    ],
)
def test_times_of_a_calendar_are_utc_or_have_their_zone(begin: str, end: str) -> None:
    text = "\r\n".join(
        ["BEGIN:VCALENDAR", "BEGIN:VEVENT", "SUMMARY:NOAA 19,  peak 40 deg, x", begin, end, "END:VEVENT",
         "END:VCALENDAR", ""]
    )  # fmt: skip
    (one,) = read_passes(text)
    assert (one.target, one.aos_t_s, one.duration_s) == ("NOAA 19", 1_767_229_200.0, 600.0)


def test_a_cancelled_event_is_not_a_pass() -> None:
    times = "DTSTART:20260101T010000Z", "DURATION:PT10M"
    assert read_passes(calendar_of(*times, "STATUS:CANCELLED")) == []
    one = calendar_of(*times, "STATUS:CONFIRMED")
    assert len(read_passes(one)) == 1
    assert read_passes(one.replace("VERSION", "METHOD:CANCEL\r\nVERSION")) == []


def test_the_calendars_of_a_file_are_read_in_its_order_with_or_without_a_mark() -> None:
    other = calendar_of("DTSTART:20260101T020000Z", "DURATION:PT10M")
    found = read_passes("\ufeff" + calendar_of("DTSTART:20260101T010000Z", "DURATION:PT10M") + other)
    assert [one.aos_t_s for one in found] == [1_767_229_200.0, 1_767_232_800.0]


ACTIVITY = """<s:simpleSchedule xmlns:s="urn:ccsds:schema:cssm:1.0.0"><s:simpleScheduleHeader/>
<s:scheduledPackage user="NOAA 19" scheduledPackageId="p" comment="of a partner">
<s:scheduledActivity scheduledActivityId="a 1" activityStatus="CANCELLED"/>
<s:scheduledActivity scheduledActivityId="a/2" activityStatus="COMMITTED" beginningOfTrack="{}" endOfTrack="{}">
<s:serviceInfo serviceType="TELEMETRY" frequencyBand="S_BAND"/></s:scheduledActivity></s:scheduledPackage>
</s:simpleSchedule>"""


def test_a_simple_schedule_of_others_has_its_times_by_day_of_year_or_date() -> None:
    for times in (
        ("2024-060T23:59:30.000Z", "2024-061T00:05:00.5Z"),
        ("2024-02-29T23:59:30Z", "2024-03-01T00:05:00.500Z"),
    ):
        (one,) = read_passes(ACTIVITY.format(*times))
        assert (one.id, one.target, one.name) == ("a_2", "NOAA 19", "of a partner")
        assert (one.aos_t_s, one.duration_s) == (1_709_251_170.0, 330.5)


def test_a_simple_schedule_of_ours_comes_back_a_package_for_each_target() -> None:
    passes = [
        ScheduledPass(id=f"{number}", target=target, name=f"<{target}>", aos_t_s=AOS_S + number, los_t_s=LOS_S + number)
        for number, target in enumerate(("25544", "A & B", "25544"))
    ]
    text = to_simple_schedule(passes, "Station", AOS_S)
    back = sorted(read_passes(text), key=lambda each: each.id)
    assert list(map(row_of, back)) == list(map(row_of, passes))
    assert text.count("<scheduledPackage ") == 2
    assert read_passes(to_simple_schedule([], "Station", AOS_S)) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<simpleSchedule>", "line 1: schedule XML is malformed"),
        ("<html></html>", "<html> is not a schedule, must be <simpleSchedule>"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><simpleSchedule/>', "line 1: schedule XML must not define entities"),
        ("<a>" * 60 + "</a>" * 60, "nested more than 50 deep"),
        (ACTIVITY.replace("endOfTrack", "end").format("x", "y"), "scheduledActivity a/2: endOfTrack is missing"),
        (ACTIVITY.format("2024-366T00:00:00Z", "soon"), "row 1: start='soon' must be an ISO time"),
    ],
)
def test_what_is_no_simple_schedule_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        read_passes(text)
