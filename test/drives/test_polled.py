"""Controllers that answer late, in pieces, with noise or not at all: what the drive makes of it."""

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, closing
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.drives import DriveParams, LinkParams, make_drive, simulated, takes_positions
from test.drives.benches import BOTH_AXES, TICK_S, Bench
from test.drives.simulators import Easycomm, Rotctld, Spid

GOAL_DEG = (150.0, 60.0)
GOAL_RAD = (math.radians(150.0), math.radians(60.0))


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    with ExitStack() as until_the_end:
        yield lambda *args, **changes: until_the_end.enter_context(closing(Bench(*args, **changes)))


@pytest.mark.parametrize("name", BOTH_AXES)
def test_readings_come_once_a_poll_period_and_carry_their_time(bench, name: str) -> None:
    subject = bench(name)
    subject.drive.go_to(GOAL_RAD)
    subject.run(1.0)
    subject.readings.clear()
    subject.run(2.0)
    assert len(subject.readings) == pytest.approx(2.0 / 0.2, abs=2)
    for reading in subject.readings:
        assert abs(reading.age_s(reading.t_s)) == 0.0
        moved = math.degrees(reading.position_rad[0]) - 120.0
        due = 6.0 * (reading.t_s - subject.device.set_points[0][0] - 0.15)
        assert moved == pytest.approx(due, abs=0.5 * subject.device.resolution_deg + 6.0 * 1.1 * TICK_S)


@pytest.mark.parametrize("name", BOTH_AXES)
def test_late_answers_in_pieces_and_noise_are_survived_and_named(bench, name: str) -> None:
    subject = bench(name)
    subject.device.pieces = True
    subject.run(4.0)
    assert not subject.drive.problem
    subject.device.pieces = False
    subject.run(1.0)
    subject.device.delay_s = 0.3
    subject.run(3.0)
    assert not subject.drive.problem
    subject.device.delay_s, subject.device.noise = 0.0, b"\x00\xfe}\x57\r\n"
    subject.run(3.0)
    assert not subject.drive.problem
    assert subject.drive.losses["noise"] > 0
    subject.device.noise = b""
    subject.drive.go_to(GOAL_RAD)
    subject.run(8.0)
    assert subject.degrees == pytest.approx(GOAL_DEG, abs=0.01)


@pytest.mark.parametrize("name", BOTH_AXES)
def test_a_silent_device_is_lost_after_a_second_and_is_stopped_when_it_comes_back(bench, name: str) -> None:
    subject = bench(name)
    subject.drive.go_to(GOAL_RAD)
    subject.run(1.0)
    subject.device.silent = True
    took_s = subject.run(5.0, lambda: bool(subject.drive.problem))
    assert took_s <= 1.0 + 2.0 * TICK_S
    assert "no position for 1.0" in subject.drive.problem
    assert subject.device.model.moving, "the device does not know that nobody receives it"
    subject.device.silent = False
    for _ in range(200):
        subject.tick(0.05)
        time.sleep(0.002)
        if not subject.drive.problem:
            break
    assert not subject.drive.problem
    assert not subject.device.model.moving, "the first words of a new connection are to stop"
    before = len(subject.device.set_points)
    subject.run(3.0)
    assert len(subject.device.set_points) == before, "nothing is resumed by itself"


@pytest.mark.parametrize("name", ["gs232", "easycomm 2", "spid rot2", "hamlib"])
def test_a_link_that_is_cut_is_noticed_at_once(bench, name: str) -> None:
    subject = bench(name)
    subject.run(0.5)
    subject.device.unplug()
    took_s = subject.run(5.0, lambda: bool(subject.drive.problem))
    assert took_s <= 2.0 * TICK_S + 1e-6
    assert "the link is lost" in subject.drive.problem
    assert subject.drive.losses["connection"] == 1


def test_attempts_to_reconnect_become_rarer_up_to_the_longest_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    attempts: list[float] = []
    now = [0.0]

    def refused(*_: object) -> Future[Any]:
        attempts.append(now[0])
        found = Future[Any]()
        found.set_exception(ConnectionRefusedError(111, "Connection refused"))
        return found

    monkeypatch.setattr("rf_pointing.drives.link.opening", refused)
    drive = make_drive(DriveParams(type="hamlib", link=LinkParams(first_retry_s=0.5, longest_retry_s=4.0)))
    while now[0] < 30.0:
        assert drive.step(now[0]) is None
        now[0] += 0.02
    waits = [b - a for a, b in pairwise(attempts)]
    assert waits[:6] == pytest.approx([0.52, 1.02, 2.02, 4.02, 4.02, 4.02], abs=0.05)
    assert drive.problem == "rotctld at localhost:4533: Connection refused; is rotctld running?"


def test_a_stop_that_a_device_did_not_receive_is_sent_again(bench) -> None:
    subject = bench("gs232")
    subject.drive.go_to((math.radians(300.0), math.radians(45.0)))
    subject.run(2.0)
    subject.device.deaf = True
    subject.drive.stop()
    subject.run(0.5)
    subject.device.deaf = False
    assert subject.device.model.moving
    took_s = subject.run(5.0, lambda: not subject.device.model.moving)
    assert took_s < 1.5


def test_a_set_point_that_is_refused_is_named(bench) -> None:
    subject = bench("hamlib")
    subject.drive.go_to((math.radians(500.0), 1.0))
    subject.run(1.0)
    assert subject.drive.losses["refused (set_pos: RPRT -1 (invalid parameter))"] == 1
    said = [reading.status for reading in subject.readings if reading.status]
    assert len(said) == 1, "an answer older than a poll is not quoted"
    assert "invalid parameter" in said[0]
    assert not subject.device.model.moving


def test_limits_of_hamlib_and_alarms_of_easycomm_are_read(bench) -> None:
    limits = bench("hamlib").drive.capabilities.travel_rad
    assert [math.degrees(each) for pair in limits for each in pair] == pytest.approx([-180.0, 0.0, 450.0, 180.0])
    device = Easycomm(version=3)
    subject = bench("easycomm 3", device)
    device.errors = 2
    subject.run(2.5)
    assert subject.readings[-1].alarm == "jam"
    device.errors = 0
    subject.run(2.5)
    assert subject.readings[-1].alarm == ""
    device.alarm("motor hot")
    subject.run(0.5)
    assert subject.readings[-1].alarm == "alarm motor hot"


def test_the_pulses_of_a_spid_controller_are_its_own(bench) -> None:
    subject = bench("spid md01", Spid("md01"))
    assert subject.drive.capabilities.resolution_rad == pytest.approx((math.radians(0.1),) * 2)
    subject.drive.go_to((math.radians(123.4), math.radians(45.6)))
    subject.run(3.0)
    assert subject.device.set_points[-1][1] == pytest.approx((123.4, 45.6))


def test_a_drive_without_elevation_moves_its_azimuth(bench) -> None:
    device = Spid("rot1", (120.0, 0.0))
    subject = bench("spid rot1", device)
    subject.drive.go_to((math.radians(130.0), math.radians(30.0)))
    subject.run(4.0)
    assert subject.degrees[0] == 130.0
    assert not subject.drive.capabilities.has_elevation


@pytest.mark.parametrize("name", BOTH_AXES)
def test_a_set_point_leaves_at_once_and_ends_the_stop_before_it(bench, name: str) -> None:
    subject = bench(name)
    subject.drive.go_to((math.radians(300.0), math.radians(45.0)))
    subject.run(2.0)
    subject.drive.stop()
    subject.run(3.0)
    assert not subject.device.model.moving
    before, count = len(subject.device.set_points), len(subject.readings)
    # Just answered: nothing is waited for.
    subject.run(1.0, lambda: len(subject.readings) > count)
    subject.drive.go_to(GOAL_RAD)
    subject.device.step(subject.t_s)
    assert len(subject.device.set_points) > before, "it waits for no tick"
    # A stop that is sent once more would hold it up on its way.
    subject.run(15.0)
    assert subject.degrees == pytest.approx(GOAL_DEG, abs=1.0)


@pytest.mark.parametrize(("by_s", "said"), [(3600.0, True), (-3600.0, True), (-3.0, False)])
def test_readings_are_stamped_by_a_clock_that_was_set_and_none_is_lost(bench, by_s: float, said: bool) -> None:
    subject = bench("hamlib", Rotctld())
    subject.run(1.0)
    if said:
        subject.drive.clock_stepped(by_s)
    subject.t_s += by_s
    del subject.readings[:-1]
    subject.run(1.0)
    assert not subject.drive.problem
    assert len(subject.readings) >= 4
    assert all(abs(reading.t_s - subject.t_s) < 1.5 for reading in subject.readings[1:])


def test_before_its_first_tick_a_drive_has_nobody_to_send_to() -> None:
    drive = make_drive(DriveParams(type="hamlib", link=LinkParams(host="127.0.0.1", port=9)))
    drive.go_to(GOAL_RAD)
    drive.stop()
    drive.close()
    assert drive.problem.endswith("is closed")


def test_what_is_commanded_while_the_link_opens_is_not_sent_and_closing_gives_the_link_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waiting, closed = Future[Any](), list[str]()
    monkeypatch.setattr("rf_pointing.drives.link.opening", lambda *_: waiting)
    drive = make_drive(DriveParams(type="hamlib"))
    for t_s in (1.0, 2.0):
        assert drive.step(t_s) is None
    drive.go_to(GOAL_RAD)
    drive.stop()
    drive.close()
    assert not closed
    waiting.set_result(SimpleNamespace(close=lambda: closed.append("closed")))
    assert closed == ["closed"]


class Script:
    """An open link: what a test lets arrive, and what was written when."""

    def __init__(self, *_: object) -> None:
        self.arriving, self.written = b"", []

    def read(self) -> bytes:
        data, self.arriving = self.arriving, b""
        return data

    def write(self, data: bytes) -> None:
        self.written.append(data)

    def close(self) -> None: ...


def opened(link: Script) -> Future[Script]:
    found = Future[Script]()
    found.set_result(link)
    return found


class Scripted:
    """A drive on such a link: `at` steps it at a time with what has arrived and returns what it wrote."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, type_: str) -> None:
        self.link = Script()
        monkeypatch.setattr("rf_pointing.drives.link.opening", lambda *_: opened(self.link))
        self.drive = make_drive(DriveParams(type=type_))

    def at(self, t_s: float, arriving: bytes = b"") -> list[bytes]:
        self.link.arriving = arriving
        self.link.written.clear()
        self.reading = self.drive.step(t_s)
        return list(self.link.written)


def test_a_reading_is_of_the_middle_between_request_and_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    subject = Scripted(monkeypatch, "easycomm")
    subject.at(9.98)
    assert subject.at(10.0) == [b"SA SE\n", b"AZ EL\n"]
    assert subject.at(10.08, b"AZ10.0 EL20.0\n") == []
    assert (subject.reading.t_s, subject.reading.within_s) == pytest.approx((10.04, 0.04))
    assert subject.reading.position_rad == pytest.approx((math.radians(10.0), math.radians(20.0)))
    assert subject.drive.losses == {}
    # One that nobody requested is as old as the answer before was.
    subject.at(10.1, b"AZ11.0 EL20.0\n")
    assert (subject.reading.t_s, subject.reading.within_s) == pytest.approx((10.06, 0.04))
    assert subject.drive.losses == {"late answer": 1}
    assert subject.at(10.19) == []
    assert subject.at(10.2) == [b"AZ EL\n"]


@given(
    delays_s=st.lists(st.floats(0.0, 0.9) | st.just(math.inf), min_size=40, max_size=40),
    measured=st.lists(st.floats(0.0, 1.0), min_size=40, max_size=40),
)  # fmt: skip
@settings(deadline=None, max_examples=60)
def test_no_reading_claims_a_time_at_which_the_device_was_elsewhere(
    delays_s: list[float], measured: list[float]
) -> None:
    """However late answers come and whichever is lost: 10 deg/s, measured anywhere between request and answer."""
    with pytest.MonkeyPatch.context() as patch:
        subject = Scripted(patch, "easycomm")
        t_s, due, count, last_s, newest = 9.98, list[tuple[float, float]](), 0, math.inf, None
        while t_s < 16.0:
            arriving = [angle for when_s, angle in due if when_s <= t_s]
            due = [each for each in due if each[0] > t_s]
            written = subject.at(t_s, b"".join(b"AZ%.1f EL20.0\n" % angle for angle in arriving))
            if subject.drive.problem and t_s > 11.0:
                return
            reading = subject.reading
            if reading is not newest:
                was_s = 10.0 + 0.1 * math.degrees(reading.position_rad[0])
                assert abs(was_s - reading.t_s) <= reading.within_s + 0.02 + 1e-6
            newest = reading
            for _ in range(written.count(b"AZ EL\n")):
                delay_s, share = delays_s[count % 40], measured[count % 40]
                if math.isfinite(delay_s):
                    # A serial line keeps the order, and what is overdue comes within `answer_s` of the one before.
                    last_s = max([t_s, min(last_s + 0.48, t_s + delay_s), *(when_s for when_s, _ in due)])
                    due.append((last_s, 10.0 * (t_s + share * (last_s - t_s) - 10.0)))
                count += 1
            t_s = round(t_s + 0.02, 6)


def test_an_answer_is_stamped_when_it_is_read_however_long_the_process_slept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The device may have measured at any time since the request; the clock is read after the answer."""
    subject = Scripted(monkeypatch, "easycomm")
    subject.at(9.98)
    subject.at(10.0)
    subject.drive.now_s = lambda: 10.5
    subject.at(10.02, b"AZ10.0 EL20.0\n")
    assert (subject.reading.t_s, subject.reading.within_s) == pytest.approx((10.25, 0.25))


def test_time_in_which_the_process_itself_stood_is_not_silence_of_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    subject, lost_s = Scripted(monkeypatch, "easycomm"), LinkParams().lost_s
    times = [9.98, 10.0]
    for _ in range(8):
        times += [times[-1] + 0.9 * lost_s, times[-1] + 0.9 * lost_s + 0.02]
    for t_s in times:
        subject.at(t_s)
    assert "no position" not in subject.drive.problem, "0.02 s at a time were left to it"
    for _ in range(60):
        times.append(times[-1] + 0.02)
        subject.at(times[-1])
    assert subject.drive.problem.endswith("no position for 1.02 s, at most 1.00 s")


def test_a_simulated_drive_has_the_steps_of_the_protocol_that_it_stands_for() -> None:
    spid = simulated(DriveParams(type="spid"))
    assert spid.type == "simulated_rotator"
    assert spid.rotator.resolution_rad == pytest.approx((math.radians(0.5),) * 2)
    own = DriveParams(type="spid").rotator.replace(resolution_rad=(0.01, 0.0))
    assert simulated(DriveParams(type="spid", rotator=own)).rotator.resolution_rad == pytest.approx(
        (0.01, math.radians(0.5))
    )
    for type_, kept in (("simulated_rotator", "simulated_rotator"), ("simulated", "simulated"), ("mine", "simulated")):
        assert simulated(DriveParams(type=type_)).type == kept
    assert [takes_positions(each) for each in ("simulated_rotator", "hamlib", "simulated", "mine")] == [
        True, True, False, False,
    ]  # fmt: skip
    assert make_drive(DriveParams(type="simulated_rotator")).truth_rad == (0.0, 0.0)
    with pytest.raises(ValueError, match=r"drive.type='mine' must be one of simulated, topic, simulated_rotator"):
        make_drive(DriveParams(type="mine"))
