"""rigctld's protocol from both sides: a rig on a scripted link, and Hamlib's own client at the port."""

import math
import subprocess
from collections.abc import Iterator

import numpy as np
import pytest

from rf_pointing.drives.line_server import Inquiry, LineServer, ServerParams
from rf_pointing.drives.params import LinkParams
from rf_pointing.drives.rigctld import RECEIVE, TRANSMIT, RadioView, Rig, RigWords
from test.drives.test_polled import Script, opened
from test.drives.test_rotctld_server import talk


class Scripted:
    """A rig on a link whose bytes the test gives: `at` steps it and returns what it wrote."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **given: bool) -> None:
        self.link = Script()
        monkeypatch.setattr("rf_pointing.drives.link.opening", lambda *_: opened(self.link))
        self.rig, self.codes = Rig(LinkParams(port=4532), **given), list[int]()

    def at(self, t_s: float, *arriving: str) -> bytes:
        self.link.arriving = "".join(arriving).encode()
        self.link.written.clear()
        self.rig.step(t_s)
        return b"".join(self.link.written)


def test_the_newest_frequency_is_sent_as_soon_as_the_one_before_is_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    subject = Scripted(monkeypatch)
    assert subject.rig.problem == "rigctld at localhost:4532 is not connected yet"
    for step in range(3):
        subject.rig.tune(RECEIVE, 435e6 + step)
        written = subject.at(0.1 * step)
    assert written == b""
    assert subject.at(0.3, "set_freq: 435000001\nRPRT 0\n") == b"+F 435000002\n"
    assert subject.rig.tuned_hz == {RECEIVE: 435000001.0}
    assert subject.at(0.4, "set_freq: 435000002\n") == b""
    # With nothing to tune it is asked once a second, so that a rig that hangs is noticed.
    assert subject.at(0.5, "RPRT 0\n") == b"+f\n"
    assert subject.rig.answer_s == pytest.approx(0.2)
    assert subject.rig.due_s(0.6) == pytest.approx(0.1), "as long as the one before took"
    assert subject.at(0.6, "get_freq:\nFrequency: 1\nRPRT 0\n") == b""
    assert subject.rig.due_s(0.6) == math.inf
    assert subject.rig.problem == ""


def test_the_key_waits_for_no_answer_and_a_new_connection_begins_with_the_key_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    subject = Scripted(monkeypatch, sends=True, split=True)
    subject.rig.tune(TRANSMIT, 145.9e6)
    subject.at(0.0)
    assert subject.at(0.1) == b"+T 0\n"
    assert subject.at(0.2, "set_ptt: 0\nRPRT 0\n") == b"+S 1 VFOB\n"
    subject.rig.key(True, 0.21, subject.codes.append)
    assert subject.link.written[-1] == b"+T 1\n"
    answers = "set_split_vfo: 1 VFOB\nRPRT 0\nset_ptt: 1\nRPRT 0\n"
    assert subject.at(0.3, answers) == b"+t\n"
    assert (subject.codes, subject.rig.keyed) == ([0], True)
    assert subject.at(0.34, "get_ptt:\nPTT: 0\nRPRT 0\n") == b"+I 145900000\n"
    assert subject.rig.keyed is False, "somebody else has let go of it"
    # The link is lost with a key on its way: its client gets an answer.
    subject.rig.key(True, 0.35, subject.codes.append)
    subject.at(1.5)
    assert "no answer to set_split_freq for 1.2 s" in subject.rig.problem
    assert subject.codes == [0, -6]
    subject.rig.key(True, 1.5, subject.codes.append)
    assert subject.codes == [0, -6, -6]
    for t_s in (2.1, 2.2):
        written = subject.at(t_s)
    assert written == b"+T 0\n"


@pytest.mark.parametrize("answer_s", [0.002, 0.042, 0.3])
def test_a_rig_of_any_speed_is_tuned_on_both_sides_and_asked_for_its_key(
    monkeypatch: pytest.MonkeyPatch, answer_s: float
) -> None:
    """Frequencies that change all the time, and a rig that takes its time for each command."""
    subject = Scripted(monkeypatch, sends=True, split=True)
    sent, ready_s, answer = list[tuple[float, str]](), math.inf, ""
    for step in range(1000):
        t_s = 0.01 * step
        subject.rig.tune(RECEIVE, 435e6 + step)
        subject.rig.tune(TRANSMIT, 145e6 + step)
        due = t_s >= ready_s
        line = subject.at(t_s, answer if due else "").decode().strip("+\n")
        ready_s = math.inf if due else ready_s
        if line:
            name = {"F": "set_freq", "I": "set_split_freq", "S": "set_split_vfo"}.get(line[0], "set_ptt")
            answer = "get_ptt:\nPTT: 0\nRPRT 0\n" if line == "t" else f"{name}: {line[2:]}\nRPRT 0\n"
            sent, ready_s = [*sent, (t_s, line[0])], t_s + answer_s
    cycle_s = math.ceil(answer_s / 0.01) * 0.01
    for letter, longest_s in ((RECEIVE, 4 * cycle_s), (TRANSMIT, 4 * cycle_s), ("t", 0.05 + 2 * cycle_s)):
        times = [t_s for t_s, each in sent if each == letter]
        assert max(np.diff(times)) <= longest_s + 0.05, letter


def test_a_refusal_is_named_and_not_repeated_and_garbage_is_counted_or_ends_the_link(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    subject = Scripted(monkeypatch)
    subject.rig.tune(RECEIVE, 3e9)
    subject.at(0.0)
    subject.at(0.01)
    assert subject.at(0.1, "set_freq: 3000000000\nRPRT -1\n") == b"+f\n"
    assert subject.rig.refused == {"set_freq": "F 3000000000: RPRT -1 (invalid parameter)"}
    assert subject.rig.tuned_hz == {}
    assert subject.at(0.2, "get_pos:\nRPRT 0\n", "RPRT 0\n", "\x00\xff\nRPRT 0\n") == b""
    assert subject.rig.losses["noise"] == 3
    subject.rig.tune(RECEIVE, 435e6)
    assert subject.at(0.3, "get_freq:\nFrequency: 5\nRPRT 0\n") == b"+F 435000000\n"
    subject.at(0.4, "x" * 300)
    assert "it answers without an end: 'xxxxxxxxxxxxxxxxxxxxxxxx'" in subject.rig.problem
    assert subject.rig.losses["connection"] == 1


def take(inquiry: Inquiry) -> None:
    inquiry.reply(0 if inquiry.order.values == (1.0,) or inquiry.order.name != "set_ptt" else -9)


@pytest.fixture
def server() -> Iterator[LineServer]:
    view = RadioView("Test radio", 435640123.0, 145965321.0)
    one = LineServer(ServerParams(port=0), RigWords(view), take)
    yield one
    one.close()


@pytest.mark.parametrize(
    ("line", "answer"),
    [("f", "435640123"), ("i", "145965321"), ("t", "0"), ("+f", "get_freq:\nFrequency: 435640123\nRPRT 0"),
     ("F 435640500", "RPRT 0"), ("+I 145965000", "set_split_freq: 145965000\nRPRT 0"), ("T 1", "RPRT 0"),
     ("T 0", "RPRT -9"), ("s", "1\nVFOB"), ("S 1 VFOB", "RPRT 0"), ("v", "VFOA"), ("\\chk_vfo", "0"), ("_", "Test radio"),
     ("F nan", "RPRT -1"), ("F -5", "RPRT -1"), ("F 1e12", "RPRT -1"), ("T", "RPRT -1"), ("m", "RPRT -4"),
     ("POST / HTTP/1.1", "RPRT -1")],
)  # fmt: skip
def test_programs_get_the_frequencies_of_the_dials(server: LineServer, line: str, answer: str) -> None:
    assert talk(server.port, f"{line}\nq\n".encode()).decode() == f"{answer}\n"


def test_nothing_is_told_while_nothing_is_known(server: LineServer) -> None:
    server.words.view.receive_hz = None
    assert talk(server.port, b"f\ni\nq\n") == b"RPRT -6\n145965321\n"


def test_hamlibs_own_client_reads_and_tunes(server: LineServer) -> None:
    def rigctl(*words: str) -> str:
        line = ["rigctl", "-m", "2", "-r", f"127.0.0.1:{server.port}", *words]
        return subprocess.run(line, capture_output=True, text=True, timeout=30.0).stdout.strip()

    assert rigctl("f") == "435640123"
    assert rigctl("F", "435640500", "f") == "435640123"
    assert rigctl("i") == "145965321"
    assert rigctl("t") == "0"
