"""rotctld's protocol as a server: answers beside those of Debian's rotctld, and what hostile clients get."""

import hashlib
import math
import random
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from rf_pointing.drives.line_server import Inquiry, LineServer, ServerParams, Session
from rf_pointing.drives.rotctld import Habit, RotatorWords, StationView, direction_rad
from test.drives.rotctld import RealRotctld
from test.drives.test_link import until


class Station:
    """What a server has handed over, answered with `code`, or not at all while it is None."""

    def __init__(self) -> None:
        self.inquiries: list[Inquiry] = []
        self.code: int | None = 0

    def take(self, inquiry: Inquiry) -> None:
        self.inquiries.append(inquiry)
        if self.code is not None:
            inquiry.reply(self.code)


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture
def server(station: Station) -> Iterator[LineServer]:
    params = ServerParams(port=0, patience_s=0.3, most_clients=100)
    one = LineServer(params, RotatorWords(StationView("Test dish", (9.012, 15.2))), station.take)
    yield one
    one.close()


@pytest.fixture(scope="module")
def debian() -> Iterator[RealRotctld]:
    """Debian's rotctld with its dummy at azimuth and elevation 0."""
    real = RealRotctld()
    yield real
    real.kill()


def connect(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), 5.0)


def talk(port: int, sent: bytes, ended_by: bytes | None = None) -> bytes:
    """Send and return all that comes until the server closes, or until `ended_by` has come."""
    found = b""
    # A server that has more to read than it wants resets the connection.
    with connect(port) as client, suppress(OSError):
        client.sendall(sent)
        if ended_by is None:
            client.shutdown(socket.SHUT_WR)
        while data := client.recv(65536):
            found += data
            if ended_by is not None and found.endswith(ended_by):
                break
    return found


@pytest.mark.parametrize(
    "line",
    ["p", "+p", ";p", "|p", ",p", "\\get_pos", "+\\get_pos", "P 10 20", "+P 10 20", ";P 10 20", "|P 1 2", "P 10.5 20.25",
     "P 500 2", "+P 500 2", "+\\set_pos 1 2", "S", "+S", "\\stop", "K", "+K", "\\park", "\\dump_state", "+\\dump_state",
     ";\\dump_state", "|\\dump_state", "P abc 2", "+P abc 2"],
)  # fmt: skip
def test_an_answer_is_that_of_debians_rotctld_byte_for_byte(server: LineServer, debian: RealRotctld, line: str) -> None:
    with connect(debian.port) as client:
        client.sendall(f"{line}\nq\n".encode())
        expected = b""
        while data := client.recv(65536):
            expected += data
    server.words.view.position_deg = (0.0, 0.0)
    # Its dummy is another model, and its dish does not go over the top.
    expected = expected.replace(b"Rotor Model: 1", b"Rotor Model: 2").replace(b"1\n1\nmin", b"1\n2\nmin")
    expected = expected.replace(b"Maximum Elevation: 90", b"Maximum Elevation: 180").replace(
        b"max_el=90", b"max_el=180"
    )
    assert talk(server.port, f"{line}\nq\n".encode()) == expected
    assert expected


@pytest.mark.parametrize(
    ("line", "code", "words"),
    [("P nan nan", -1, "azimuth 'nan' is not a number"), ("P inf 3", -1, "azimuth 'inf' is not a number"),
     ("P 10 nan", -1, "elevation 'nan' is not a number"), ("P 1_0 20", -1, "azimuth '1_0' is not a number"),
     ("P 0x10 20", -1, "is not a number"), ("P 10,5 20", -1, "azimuth '10,5' is not a number"),
     ("P 10", -1, "set_pos has 1 arguments, must have 2"), ("P 10 20 30", -1, "set_pos has 3 arguments"),
     ("P", -1, "set_pos has 0 arguments"), ("P120 45", -1, "'P120' is not a command"),
     ("P 10 181", -1, "elevation '181' must be 0 to 180 deg"), ("P 10 -1", -1, "elevation '-1' must be 0 to 180 deg"),
     ("P -181 1", -1, "azimuth '-181' must be -180 to 450 deg"), ("P 1e400 1", -1, "azimuth '1e400' must be"),
     ("M 2 20", -4, "move is not offered"), ("R 1", -4, "reset is not offered"), ("R", -1, "reset has 0 arguments"),
     ("z", -4, "command 'z' is not known"), ("\\zzz", -4, "command 'zzz' is not known"), ("dump_state", -1, "is not a command"),
     ("p 1", -1, "get_pos has 1 arguments"), ("+", -1, "'' is not a command"), ("++p", -1, "is not a command"),
     ("Gpredict", -1, "is not a command")],
)  # fmt: skip
def test_a_line_that_is_no_order_is_refused_with_its_code_and_moves_nothing(
    server: LineServer, station: Station, line: str, code: int, words: str
) -> None:
    answer = talk(server.port, f"{line}\np\nq\n".encode())
    assert answer.endswith(b"9.01\n15.20\n"), "the next line is served"
    assert answer[: -len(b"9.01\n15.20\n")].decode().endswith(f"RPRT {code}\n")
    assert words in server.counts.last_refusal
    assert server.counts.refused_lines == 1
    assert station.inquiries == []


def test_pipelined_lines_are_answered_in_their_order(server: LineServer, station: Station) -> None:
    lines = b"P 1 2\np\n# a comment\n\nS\r\n+p\nK\n_\nP nan 1\nP 3 4\nq\n"
    assert talk(server.port, lines) == (
        b"RPRT 0\n9.01\n15.20\nRPRT 0\nget_pos:\nAzimuth: 9.01\nElevation: 15.20\nRPRT 0\nRPRT 0\nTest dish\nRPRT -1\nRPRT 0\n"
    )
    assert [(each.order.name, each.order.values) for each in station.inquiries] == [
        ("set_pos", (1.0, 2.0)), ("stop", ()), ("park", ()), ("set_pos", (3.0, 4.0)),
    ]  # fmt: skip


def test_a_half_line_at_the_end_is_forgotten(server: LineServer, station: Station) -> None:
    for half in (b"P 10 20", b"P 10", b"p\nP 1", b"S", b"K"):
        talk(server.port, half)
    with connect(server.port) as client:
        client.sendall(b"P 10 2")
        time.sleep(0.05)
        client.sendall(b"0\n")
        assert client.recv(100) == b"RPRT 0\n"
    assert [each.order.text for each in station.inquiries] == ["10 20"]


@pytest.mark.parametrize(
    "sent",
    ["POST / HTTP/1.1\r\nHost: 127.0.0.1:4533\r\nOrigin: http://evil.example\r\n\r\n", "GET /live HTTP/1.1\r\n",
     "options * http/1.0\n", "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", "P 200 HTTP/1.1\r\n", "S / HTTP/1.1\r\n", "HOST : evil\n",
     f"POST /{'x' * 300} HTTP/1.1\r\n", f"POST /{'x' * 1_000_000}", "\x16\x03\x01\x02\n", "P 10 20\x00\n",
     "P \uff11\uff10 20\n", "z\n" * 20, "P 1 nan\n" * 20],
)  # fmt: skip
def test_what_no_rotator_client_sends_ends_its_connection_and_the_body_is_not_read(
    server: LineServer, station: Station, sent: str
) -> None:
    body = b"\nP 200 40\nS\nK\n"
    assert set(talk(server.port, sent.encode() + body).splitlines()) <= {b"RPRT -1", b"RPRT -4"}
    assert station.inquiries == []
    assert server.counts.ended == 1
    assert talk(server.port, b"z\n" * 19 + b"p\nz\np\nq\n").endswith(b"9.01\n15.20\nRPRT -4\n9.01\n15.20\n")


def test_only_addresses_of_the_list_are_served(station: Station) -> None:
    for allow, served in (("127.0.0.0/8", True), ("10.0.0.1, ::1", False), ("10.0.0.1,127.0.0.1", True)):
        server = LineServer(ServerParams(port=0, allow=allow), RotatorWords(StationView("x", (1.0, 2.0))), station.take)
        try:
            assert (talk(server.port, b"p\nq\n") == b"1.00\n2.00\n") is served
            assert server.counts.refused_clients == (not served)
        finally:
            server.close()
    with pytest.raises(ValueError, match="allow='lab' must be addresses or networks, as 10.0.0.0/24"):
        ServerParams(allow="lab")


def test_with_a_password_nothing_is_served_before_it(station: Station) -> None:
    word = "correct-horse-battery"
    view = StationView("x", (1.0, 2.0))
    server = LineServer(ServerParams(port=0, most_refused=3), RotatorWords(view), station.take, password=word)
    try:
        for given in (word, "9c6fca4b2c6c2e1a4b5b1d4f1c", hashlib.md5(word.encode()).hexdigest()):
            right = given == word or len(given) == 32
            answer = talk(server.port, f"p\n\\password {given}\np\nq\n".encode())
            assert answer == (b"RPRT -9\nRPRT 0\n1.00\n2.00\n" if right else b"RPRT -9\nRPRT -9\nRPRT -9\n")
        assert talk(server.port, b"P 1 2\n+S\n\\password\nP 1 2\n").count(b"RPRT -9") == 3
        assert station.inquiries == []
        assert word not in server.counts.last_refusal
    finally:
        server.close()


def test_random_bytes_never_become_a_motion(server: LineServer, station: Station) -> None:
    chosen = random.Random(7)
    for _ in range(20):
        noise = bytes(chosen.randrange(256) for _ in range(5000)).replace(b"q", b"x").replace(b"Q", b"x")
        talk(server.port, noise + b"\nq\n")
    # A stop and a park are single letters, which noise can spell; a direction is not.
    assert [each for each in station.inquiries if each.order.name == "set_pos"] == []


def test_damaged_lines_of_directions_either_are_refused_or_say_a_direction() -> None:
    chosen = random.Random(3)
    accepted = 0
    for _ in range(20000):
        line = bytearray(b"P 123.45 67.89")
        for _ in range(chosen.randrange(1, 4)):
            line[chosen.randrange(len(line))] = chosen.randrange(256)
        for order in Session(RotatorWords(StationView("x"))).take(bytes(line) + b"\n"):
            if order.name == "set_pos" and not order.code:
                accepted += 1
                azimuth, elevation = direction_rad(order.values[0], order.values[1])
                assert 0.0 <= azimuth < 2.0 * math.pi
                assert 0.0 <= elevation <= math.pi / 2.0
    assert 0 < accepted < 4000


def test_a_hundred_clients_are_served_and_one_more_is_refused(server: LineServer) -> None:
    clients = [connect(server.port) for _ in range(100)]
    try:
        began_s = time.monotonic()
        for client in clients:
            client.sendall(b"p\n")
        assert {client.recv(100) for client in clients} == {b"9.01\n15.20\n"}
        took_s = time.monotonic() - began_s
        print(f"100 clients answered in {1e3 * took_s:.0f} ms")
        assert took_s < 2.0
        assert talk(server.port, b"") == b"RPRT -9\n"
        assert server.counts.refused_clients == 1
        # One that has sent no line gives way: nobody keeps the others out by connecting.
        clients.pop().close()
        until(lambda: len(server.counts.connected) == 99)
        clients += [connect(server.port) for _ in range(30)]
        assert talk(server.port, b"p\nq\n") == b"9.01\n15.20\n"
        clients[0].sendall(b"p\n")
        assert clients[0].recv(100) == b"9.01\n15.20\n"
    finally:
        for client in clients:
            client.close()
    until(lambda: not server.counts.connected)
    assert talk(server.port, b"p\nq\n") == b"9.01\n15.20\n"


def test_a_client_that_never_reads_is_disconnected_and_others_are_served_meanwhile(server: LineServer) -> None:
    with connect(server.port) as deaf:
        deaf.settimeout(0.05)
        name = "{}:{}".format(*deaf.getsockname())
        assert talk(server.port, b"p\nq\n") == b"9.01\n15.20\n"
        deadline_s = time.monotonic() + 20.0
        # Where the kernel's buffers are full, the client itself may learn of its end much later.
        while name in server.counts.connected and time.monotonic() < deadline_s:
            try:
                deaf.sendall(b"+\\dump_state\n" * 300)
            except TimeoutError:
                assert talk(server.port, b"p\nq\n") == b"9.01\n15.20\n"
            except OSError:
                break
        assert name not in server.counts.connected
    assert not server.counts.connected


def test_a_client_that_sends_nothing_is_disconnected() -> None:
    server = LineServer(ServerParams(port=0, idle_s=1.0), RotatorWords(StationView("x")), Station().take)
    try:
        with connect(server.port) as silent:
            silent.sendall(b"P 1")
            assert silent.recv(10) == b""
    except ConnectionResetError:
        pass
    finally:
        server.close()


def test_a_refusal_of_the_station_and_a_station_that_is_silent_have_their_codes(
    server: LineServer, station: Station
) -> None:
    station.code = -9
    assert talk(server.port, b"P 1 2\n+S\nq\n") == b"RPRT -9\nstop:\nRPRT -9\n"
    station.code = None
    assert talk(server.port, b"P 1 2\nq\n") == b"RPRT -5\n"
    server.words.view.position_deg = None
    assert talk(server.port, b"p\n+p\nq\n") == b"RPRT -6\nget_pos:\nRPRT -6\n"


def test_the_position_is_read_back_in_the_range_of_the_client(server: LineServer) -> None:
    server.words.view.position_deg = (-30.0, 100.0)
    assert talk(server.port, b"p\nq\n") == b"150.00\n80.00\n"
    assert talk(server.port, b"P -20 10\np\nq\n").splitlines()[1:] == [b"150.00", b"80.00"]
    server.words.view.position_deg = (200.0, 10.0)
    # Clients that connect for each command keep the habit of the command before.
    assert talk(server.port, b"p\nq\n") == b"-160.00\n10.00\n"
    assert talk(server.port, b"P 200 120\np\nq\n").splitlines()[1:] == [b"20.00", b"170.00"]
    assert talk(server.port, b"P 300 20\np\nq\n").splitlines()[1:] == [b"200.00", b"10.00"]


@pytest.mark.parametrize("negative", [False, True])
def test_a_shown_azimuth_stays_in_its_range_at_the_seam(negative: bool) -> None:
    habit = Habit(negative=negative)
    for azimuth in (-0.004, 359.9961, 359.994, 180.0, -180.0, 719.9999, 180.004):
        shown, _ = habit.shown_deg(azimuth, 10.0)
        assert (-180.0 < float(f"{shown:.2f}") <= 180.0) if negative else (0.0 <= float(f"{shown:.2f}") < 360.0)
        assert abs(math.remainder(shown - azimuth, 360.0)) < 0.0051


def test_a_port_that_is_taken_is_refused_by_its_name(server: LineServer) -> None:
    with pytest.raises(ValueError, match=f"server.port={server.port}: Address already in use"):
        LineServer(ServerParams(port=server.port), RotatorWords(StationView("x")), Station().take)


def test_debians_rotctl_runs_its_whole_command_set_against_the_server(server: LineServer, station: Station) -> None:
    def rotctl(*words: str) -> str:
        done = subprocess.run(
            ["rotctl", "-m", "2", "-r", f"127.0.0.1:{server.port}", *words],
            capture_output=True, text=True, timeout=20.0,
        )  # fmt: skip
        return done.stdout + done.stderr

    assert rotctl("p") == "9.01\n15.20\n"
    assert rotctl("P", "120.5", "33.25") == ""
    assert rotctl("S") == rotctl("K") == ""
    assert [(each.order.name, each.order.values) for each in station.inquiries] == [
        ("set_pos", (120.5, 33.25)), ("stop", ()), ("park", ()),
    ]  # fmt: skip
    assert "Test dish" in rotctl("_")
    assert "Feature not implemented" in rotctl("M", "2", "20")
    assert "Feature not implemented" in rotctl("R", "1")
    assert "Invalid parameter" in rotctl("P", "10", "200")
    station.code = -9
    assert "rejected" in rotctl("P", "10", "20")


def test_a_direction_over_the_top_is_one_of_the_other_side() -> None:
    for given, meant in (((10.0, 90.0), (10.0, 90.0)), ((10.0, 120.0), (190.0, 60.0)), ((200.0, 95.0), (20.0, 85.0)),
                         ((-90.0, 0.0), (270.0, 0.0))):  # fmt: skip
        assert direction_rad(*given) == pytest.approx(tuple(map(math.radians, meant)))


@pytest.mark.parametrize(
    ("moving", "flags"),
    [
        ((0, 0), ""), ((1, 0), "MOVING MOVING_AZ MOVING_RIGHT "), ((-1, 0), "MOVING MOVING_AZ MOVING_LEFT "),
        ((0, 1), "MOVING MOVING_EL MOVING_UP "), ((0, -1), "MOVING MOVING_EL MOVING_DOWN "),
        ((-1, 1), "MOVING MOVING_AZ MOVING_LEFT MOVING_EL MOVING_UP "),
    ],
)  # fmt: skip
def test_the_status_says_which_way_each_axis_moves(moving: tuple[int, int], flags: str) -> None:
    view = StationView("x", moving=moving)
    assert view.fields("get_status", Habit()) == ((f"Status flags: {flags}", flags),)


def test_the_capabilities_are_those_of_the_bounds() -> None:
    lines = [plain for _, plain in StationView("My dish").fields("dump_caps", Habit())]
    for line in (
        "Caps dump for model:\t2", "Model name:\t\tMy dish", "Min Azimuth:\t\t-180.00", "Max Azimuth:\t\t450.00",
        "Min Elevation:\t\t0.00", "Max Elevation:\t\t180.00", "Can Park:\t\tY", "Can Move:\t\tN",
    ):  # fmt: skip
        assert line in lines, line


def test_when_a_client_was_heard_last_is_known_while_it_is_connected(server: LineServer) -> None:
    with connect(server.port) as client:
        before_s = time.monotonic()
        client.sendall(b"p\n")
        assert client.recv(100) == b"9.01\n15.20\n"
        name = "{}:{}".format(*client.getsockname())
        assert before_s <= server.heard_s(name) <= time.monotonic()
    assert server.heard_s("10.0.0.1:5") == -math.inf
