"""The bytes of every controller, against its published command table."""

import pytest

from rf_pointing.drives.protocols import DeviceProtocol, protocol_of

NOISE = b"\x00\xff~{"


def made(type_: str, model: str = "") -> DeviceProtocol:
    return protocol_of(type_, model)


def positions(words: DeviceProtocol, *chunks: bytes) -> list[tuple[float, ...]]:
    buffer, found = bytearray(), []
    for chunk in chunks:
        buffer += chunk
        found += [answer.angles_deg for answer in words.take(buffer) if answer.kind == "position"]
    return found


@pytest.mark.parametrize(
    ("type_", "model", "ask", "go", "stop"),
    [
        ("hamlib", "", b"+p\n", b"+P 123.500000 45.250000\n", b"+S\n"),
        ("gs232", "", b"C2\r", b"W124 045\r", b"S\r"),
        ("easycomm", "2", b"AZ EL\n", b"AZ123.5 EL45.2\n", b"SA SE\n"),
        # The example of the SPID document: 123.5 deg and 77 deg at two pulses per degree.
        ("spid", "rot2", b"W" + bytes(10) + b"\x1f ", b"W0967\x020810\x02/ ", b"W" + bytes(10) + b"\x0f "),
        ("spid", "rot1", b"W" + bytes(10) + b"\x1f ", b"W4840" + bytes(6) + b"/ ", b"W" + bytes(10) + b"\x0f "),
    ],
)
def test_requests_are_those_of_the_table(type_: str, model: str, ask: bytes, go: bytes, stop: bytes) -> None:
    words = made(type_, model)
    assert words.ask.data == ask
    assert words.go_to(123.5, 45.25).data == go
    assert words.stop.data == stop


def test_the_set_point_of_the_spid_document() -> None:
    words = made("spid", "rot2")
    assert words.go_to(123.5, 77.0).data == bytes.fromhex("57 30 39 36 37 02 30 38 37 34 02 2F 20")
    assert made("spid", "rot1").go_to(123.0, 0.0).data == bytes.fromhex("57 34 38 33 30 00 00 00 00 00 00 2F 20")


ANSWERS = [
    ("hamlib", "", b"get_pos:\nAzimuth: 123.45\nElevation: -0.50\nRPRT 0\n", (123.45, -0.5)),
    ("gs232", "", b"+0123+0045\r\n", (123.0, 45.0)),
    ("gs232", "", b"AZ=123  EL=045\r\n", (123.0, 45.0)),
    ("gs232", "", b"AZ=123 EL= -5\r\n", (123.0, -5.0)),
    ("gs232", "", b"AZ=123.4EL=045.6\r\n", (123.4, 45.6)),
    ("gs232", "", b"AZ = 5, EL = 45\r", (5.0, 45.0)),
    ("gs232", "a", b"+0450-0005\r\n", (450.0, -5.0)),
    ("gs232", "b", b"AZ=450  EL=180\n", (450.0, 180.0)),
    ("gs232", "a", b"+0123 +0045\r", (123.0, 45.0)),
    ("easycomm", "2", b"AZ123.4 EL45.6\n", (123.4, 45.6)),
    ("easycomm", "2", b"AZ=123.4,EL=45.6\r\n", (123.4, 45.6)),
    ("easycomm", "2", b"AZ 7 EL 8\n", (7.0, 8.0)),
    ("easycomm", "3", b"AZ-10.0 EL5.0\r\n", (-10.0, 5.0)),
    ("spid", "rot2", bytes.fromhex("57 03 07 02 05 02 03 09 04 00 02 20"), (12.5, 34.0)),
    ("spid", "rot1", bytes.fromhex("57 03 07 02 20"), (12.0, 0.0)),
    ("spid", "rot2", bytes.fromhex("57 03 07 02 20"), (12.0, 0.0)),
    ("spid", "rot1", bytes.fromhex("57 03 07 02 05 0A 03 09 04 00 0A 20"), (12.5, 34.0)),
    ("spid", "md01", bytes.fromhex("57 08 01 00 00 04 05 04 00 09 04 20"), (450.0, 180.9)),
    ("spid", "rot2", bytes.fromhex("57 03 07 02 05 05 03 09 04 00 05 20"), (12.5, 34.0)),
    ("easycomm", "2", b"AZ=093.5 EL=012.0 UP0 XXX DN0 XXX\n", (93.5, 12.0)),
    ("gs232", "", b"AZ=-12.5 EL=045.6\r\n", (-12.5, 45.6)),
    ("gs232", "", b"\r\n>AZ=180  EL=001\r\n", (180.0, 1.0)),
    ("easycomm", "2", b"AZ123 EL45\r\n", (123.0, 45.0)),
    ("easycomm", "3", b"AZ0.0 EL0.0\r", (0.0, 0.0)),
    ("easycomm", "2", b"AZ359.99 EL89.99\n", (359.99, 89.99)),
    ("hamlib", "", b"get_pos:\nAzimuth: -179.990000\nElevation: 90.000000\nRPRT 0\n", (-179.99, 90.0)),
]


@pytest.mark.parametrize(("type_", "model", "answer", "angles"), ANSWERS)
def test_answers_are_read_however_they_arrive(
    type_: str, model: str, answer: bytes, angles: tuple[float, float]
) -> None:
    assert positions(made(type_, model), answer) == [pytest.approx(angles)]
    assert positions(made(type_, model), *(answer[i : i + 1] for i in range(len(answer)))) == [pytest.approx(angles)]
    assert positions(made(type_, model), answer + answer) == [pytest.approx(angles)] * 2
    # Noise costs at most the answer that it falls into.
    assert positions(made(type_, model), NOISE + answer + answer)[-1] == pytest.approx(angles)


@pytest.mark.parametrize(("type_", "model", "answer", "angles"), ANSWERS)
def test_a_cut_answer_is_no_position(type_: str, model: str, answer: bytes, angles: tuple[float, float]) -> None:
    for cut in range(1, len(answer) - 2):
        found = positions(made(type_, model), answer[cut:] if cut else answer)
        assert all(each == pytest.approx(angles) for each in found), cut


def test_an_azimuth_of_a_lost_line_never_becomes_an_elevation() -> None:
    found = positions(made("hamlib"), b"get_pos:\nAzimuth: 120.00\nRPRT 0\nget_pos:\nElevation: 45.00\nRPRT 0\n")
    assert found == []


def test_positions_that_no_controller_could_mean_are_noise_and_shown_as_they_came() -> None:
    for type_, line in (("gs232", "AZ=999  EL=045"), ("easycomm", "AZ123.4 EL456.0")):
        (answer,) = made(type_).take(bytearray(f"{line}\r\n".encode()))
        assert (answer.kind, answer.text) == ("noise", line)


@pytest.mark.parametrize(("place", "byte"), [(1, 10), (4, 10), (6, 10), (9, 10), (5, 0), (5, 3), (10, 0), (10, 3)])
def test_a_packet_with_a_digit_beyond_nine_or_pulses_that_no_controller_has_is_noise(place: int, byte: int) -> None:
    packet, words = bytearray.fromhex("57 03 07 02 05 02 03 09 04 00 02 20"), made("spid", "rot2")
    packet[place] = byte
    assert {answer.kind for answer in words.take(packet)} == {"noise"}
    assert words.resolution_deg == made("spid", "rot2").resolution_deg


def test_reasons_are_given_in_words() -> None:
    (answer,) = made("hamlib").take(bytearray(b"set_pos: 500 20\nRPRT -1\n"))
    assert (answer.kind, answer.text) == ("refused", "set_pos: RPRT -1 (invalid parameter)")
    (answer,) = made("gs232").take(bytearray(b"?>\r\n"))
    assert answer.kind == "refused"
    kinds = [(answer.kind, answer.text) for answer in made("easycomm", "3").take(bytearray(b"GE3\nALmotor hot\n"))]
    assert kinds == [("status", ""), ("alarm", "sensor error, jam"), ("alarm", "alarm motor hot")]


@pytest.mark.parametrize(
    ("type_", "model", "baud", "resolution_deg", "has_elevation"),
    [
        ("hamlib", "", 9600, 0.01, True), ("gs232", "", 9600, 1.0, True),
        ("easycomm", "", 9600, 0.1, True), ("spid", "rot1", 1200, 1.0, False),
        ("spid", "rot2", 600, 0.5, True), ("spid", "md01", 600, 0.5, True),
    ],
)  # fmt: skip
def test_speeds_steps_and_axes_are_those_of_the_manuals(
    type_: str, model: str, baud: int, resolution_deg: float, has_elevation: bool
) -> None:
    words = made(type_, model)
    assert (words.baud, words.resolution_deg) == (baud, (resolution_deg, resolution_deg))
    assert words.has_elevation is has_elevation


@pytest.mark.parametrize(
    ("type_", "answer", "azimuth_deg", "named"),
    [
        ("gs232", b"AZ=229\r\n", 229.0, "b_azimuth"),
        ("gs232", b"+0229\r\n", 229.0, "a_azimuth"),
        ("easycomm", b"AZ229.5\n", 229.5, "2_azimuth"),
    ],
)
def test_a_controller_without_elevation_is_recognised_or_named(
    type_: str, answer: bytes, azimuth_deg: float, named: str
) -> None:
    """Not by one answer, which may be the rest of a longer one whose beginning was lost."""
    words = made(type_)
    assert positions(words, answer, answer) == []
    assert words.has_elevation
    assert positions(words, answer) == [(azimuth_deg, 0.0)]
    assert not words.has_elevation
    assert b"EL" not in words.go_to(123.0, 45.0).data
    assert b"045" not in words.go_to(123.0, 45.0).data
    # Once it is known, nothing else is a position; another connection begins anew.
    assert positions(words, b"AZ=123 EL=045\r\n+0123+0045\r\n") == []
    words.connected()
    assert words.has_elevation
    assert positions(words, b"AZ=123 EL=045\r\n", b"AZ123.0 EL45.0\n")[0] == (123.0, 45.0)
    assert positions(made(type_, named), answer) == [(azimuth_deg, 0.0)]


def test_one_with_elevation_never_becomes_one_without() -> None:
    words = made("gs232")
    assert positions(words, b"+0123+0045\r\n", *[b"+0045\r\n"] * 9) == [(123.0, 45.0)]
    assert words.has_elevation


def test_rotctld_names_a_rotator_of_the_azimuth_alone() -> None:
    words = made("hamlib")
    buffer = bytearray(b"dump_state:\nMinimum Azimuth: 0.0\nrot_type=Az\ndone\nRPRT 0\n")
    words.take(buffer)
    assert not words.has_elevation
    assert not made("hamlib", "azimuth").has_elevation


def test_the_length_of_an_answer_tells_a_spid_controller_of_the_azimuth_alone() -> None:
    words = made("spid")
    assert positions(words, bytes.fromhex("57 03 07 02 20")) == [(12.0, 0.0)]
    assert (words.has_elevation, words.go_to(123.0, 45.0).data) == (False, made("spid", "rot1").go_to(123.0, 0.0).data)
    assert positions(words, bytes.fromhex("57 03 07 02 05 02 03 09 04 00 02 20")) == [(12.5, 34.0)]
    assert words.has_elevation


@pytest.mark.parametrize(
    ("type_", "model", "known"),
    [("gs232", "c", ""), ("hamlib", "2", ""), ("easycomm", "1", "2, 3"), ("spid", "rot3", "")],
)
def test_a_dialect_that_a_type_does_not_have_is_refused_with_the_known_ones(type_: str, model: str, known: str) -> None:
    with pytest.raises(ValueError, match=f"{type_}: drive.model='{model}' must be one of {known}"):
        made(type_, model)
