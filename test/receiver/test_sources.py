"""Every source against what really sends its protocol, over real sockets and in the time of the test."""

import json
import math
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.receiver import (
    GeneratorParams,
    SignalGenerator,
    SignalReceiver,
    SignalReceiverParams,
    make_source,
)  # fmt: skip
from rf_pointing.receiver.iq_sources import decoded, read_sigmf
from rf_pointing.receiver.params import IqParams, LevelParams, OutletParams, SignalSearchParams, SourceLinkParams
from rf_pointing.receiver.serving import DifiSender, Outlet, RtlTcpServer, make_outlet
from rf_pointing.receiver.vita49 import Context, Packet, decode_context, decode_packet, encode_context, encode_packet

RATE_HZ, CARRIER_HZ, CENTRE_HZ = 96e3, 437.5e6, 437.49e6
LEVEL_DB_HZ, PIECE_S = 55.0, 0.02
PATIENCE_S = 20.0


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(condition: Callable[[], object], what: str) -> None:
    """Wait in wall time for what threads and sockets do."""
    for _ in range(int(PATIENCE_S / 0.005)):
        if condition():
            return
        time.sleep(0.005)
    raise AssertionError(f"{what} within {PATIENCE_S} s")


@dataclass
class Line:
    """A generator, an outlet and a receiver in the test's own time."""

    kind: str
    channels: int = 1
    port: int = field(default_factory=lambda: free_port())
    t_s: float = 5000.0
    iq: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.generator = SignalGenerator(GeneratorParams(rate_hz=RATE_HZ, channels=self.channels))
        self.outlet: Outlet | None = self.open_outlet()
        self.receiver = SignalReceiver(
            SignalReceiverParams(
                type=self.kind, frequency_hz=CARRIER_HZ,
                link=SourceLinkParams(host="127.0.0.1", port=self.port, first_retry_s=0.05, longest_retry_s=0.2),
                iq=IqParams(**{"rate_hz": RATE_HZ, "centre_mhz": 1e-6 * CENTRE_HZ, **self.iq}),
                signal=SignalSearchParams(channels=self.channels),
            ),
            lambda: self.t_s,
        )  # fmt: skip
        self.measured: list[Any] = []
        self.receiver.step(self.t_s)

    def open_outlet(self) -> Outlet:
        return make_outlet(OutletParams(format=self.kind, port=self.port), RATE_HZ, CENTRE_HZ)

    def connect(self) -> None:
        if isinstance(self.outlet, RtlTcpServer):
            outlet = self.outlet
            wait_for(lambda: outlet.connected, "no client")
        else:
            # Neither UDP nor a subscription says that it is heard.
            before = self.receiver.source.index

            def heard() -> bool:
                self.run(PIECE_S, wait=False)
                return self.receiver.source.index > before

            wait_for(heard, "no samples")
            self.receiver.step(self.t_s)

    def run(self, seconds: float, *, wait: bool = True, shift_s: float = 0.0, gain: float = 1.0) -> None:
        """Send `seconds` of signal, a piece at a time, and let the receiver take each."""
        volts = 10.0 ** (LEVEL_DB_HZ / 20.0) * np.array([1.0, 0.1, -0.05])[: self.channels]
        for _ in range(round(seconds / PIECE_S)):
            samples = self.generator.take(round(PIECE_S * RATE_HZ), (CARRIER_HZ - CENTRE_HZ,) * 2, volts)
            begin_s, self.t_s = self.t_s, self.t_s + PIECE_S
            before = self.receiver.source.index
            assert self.outlet is not None
            self.outlet.send(np.clip(gain * samples.view(np.float32), -1.0, 1.0).view(np.complex64), begin_s + shift_s)
            if wait:
                wait_for(lambda: self.receiver.source.index >= before + samples.shape[1], "samples")  # noqa: B023
                self.measured += self.receiver.step(self.t_s)

    def stall(self, seconds: float) -> None:
        self.t_s += seconds
        self.measured += self.receiver.step(self.t_s)

    def problem(self) -> str:
        return self.receiver.problem(self.t_s)

    def close(self) -> None:
        self.receiver.end()
        if self.outlet is not None:
            self.outlet.close()


@pytest.fixture
def line() -> Iterator[Callable[..., Line]]:
    with ExitStack() as until_the_end:

        def make(*args: Any, **named: Any) -> Line:
            made = until_the_end.enter_context(closing(Line(*args, **named)))
            made.connect()
            return made

        yield make


def levels(line: Line, since_s: float = 1.0) -> list[float]:
    begun_s = line.measured[0].power.t_s
    return [each.power.carrier_to_noise_db_hz for each in line.measured if each.power.t_s > begun_s + since_s]


@pytest.mark.parametrize("kind", ["rtl_tcp", "vita49", "zmq"])
def test_what_is_served_is_measured_with_its_time(line: Callable[..., Line], kind: str) -> None:
    if kind == "zmq":
        pytest.importorskip("zmq")
    subject = line(kind)
    subject.run(4.0)
    assert np.mean(levels(subject)) == pytest.approx(LEVEL_DB_HZ, abs=0.3)
    assert not subject.problem()
    # The newest report ends where the samples do, but for one report and the block under way.
    assert 0.0 <= subject.t_s - subject.measured[-1].power.t_s < 0.15
    assert subject.receiver.values()["phase_locked"]


def test_difi_carries_three_channels_and_survives_lost_packets(line: Callable[..., Line]) -> None:
    subject = line("vita49", channels=3)
    subject.run(3.0)
    clusters = [each.cluster for each in subject.measured[10:]]
    ratio = np.mean([np.vdot(c.sum, c.difference_cross_elevation) / np.vdot(c.sum, c.sum) for c in clusters])
    assert ratio == pytest.approx(0.1, abs=5e-3)
    sender = subject.outlet
    assert isinstance(sender, DifiSender)
    count = len(subject.measured)
    for _ in range(50):
        # One piece of five is lost.
        subject.run(4 * PIECE_S)
        subject.generator.take(round(PIECE_S * RATE_HZ), (CARRIER_HZ - CENTRE_HZ,) * 2, [1.0, 0.0, 0.0])
        subject.t_s += PIECE_S
    assert len(subject.measured) > count + 10
    late = subject.measured[-1].power
    assert late.carrier_to_noise_db_hz == pytest.approx(LEVEL_DB_HZ, abs=1.0)


@pytest.mark.parametrize("kind", ["rtl_tcp", "zmq", "vita49"])
def test_a_source_that_is_killed_comes_back(line: Callable[..., Line], kind: str) -> None:
    if kind == "zmq":
        pytest.importorskip("zmq")
    subject = line(kind)
    subject.run(2.0)
    assert subject.outlet is not None
    subject.outlet.close()
    wait_for(lambda: f"{kind} at 127.0.0.1" in subject.problem(), "a problem")
    subject.outlet = None
    subject.stall(1.0)
    subject.outlet = subject.open_outlet()
    subject.connect()
    subject.measured.clear()
    subject.run(3.0)
    assert not subject.problem()
    assert np.mean(levels(subject)) == pytest.approx(LEVEL_DB_HZ, abs=0.3)
    assert subject.receiver.source.losses["connection"] >= 1


def test_a_stall_is_named_and_does_not_shift_the_time(line: Callable[..., Line]) -> None:
    subject = line("rtl_tcp")
    subject.run(2.0)
    subject.stall(5.0)
    assert subject.problem()
    subject.measured.clear()
    subject.run(3.0)
    assert not subject.problem()
    assert 0.0 <= subject.t_s - subject.measured[-1].power.t_s < 0.15
    assert subject.receiver.meter.clock.stalls >= 1


def test_samples_of_another_time_are_named_and_left_out(line: Callable[..., Line]) -> None:
    subject = line("vita49")
    subject.run(2.0)
    subject.measured.clear()
    # 1e9 samples at 2.4 Msample/s.
    subject.run(1.0, shift_s=-416.7)
    assert not subject.measured
    assert "samples are 416.7 s late" in subject.problem()
    subject.run(2.0)
    assert not subject.problem()


def test_a_wrong_rate_is_named(line: Callable[..., Line]) -> None:
    subject = line("rtl_tcp", iq={"rate_hz": 1.2 * RATE_HZ})
    subject.run(3.0)
    assert "96.0 ksample/s arrive, iq.rate_hz states 115.2" in subject.problem()


def test_clipping_is_named(line: Callable[..., Line]) -> None:
    subject = line("rtl_tcp")
    subject.run(2.0, gain=40.0)
    assert "% of the samples are clipped" in subject.problem()
    subject.run(1.0, gain=300.0)
    reports = subject.receiver.reports
    subject.run(1.0, gain=300.0)
    assert subject.receiver.reports == reports


def test_what_is_not_rtl_tcp_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = SourceLinkParams(host="127.0.0.1", port=server.getsockname()[1])
        source = make_source(SignalReceiverParams(type="rtl_tcp", frequency_hz=1e9, link=link), lambda: 0.0)
        source.step()
        client, _ = server.accept()
        client.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        wait_for(lambda: "is not rtl_tcp: it begins with b'HTTP'" in source.problem, "a problem")
        source.end()
        client.close()


def test_garbage_on_the_port_of_difi_is_named(line: Callable[..., Line]) -> None:
    subject = line("vita49")
    subject.run(2.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for size in (1, 27, 28, 100, 1400):
            sender.sendto(bytes(range(256)) * 6 if size == 1400 else b"\xff" * size, ("127.0.0.1", subject.port))
        wait_for(lambda: subject.receiver.source.losses["packet that is not DIFI"] >= 5, "garbage")
        subject.run(1.0)
        assert not subject.problem(), "a few are no problem"
        for _ in range(60):
            sender.sendto(b"\xff" * 100, ("127.0.0.1", subject.port))
        subject.run(PIECE_S)
        assert "garbage arrives: " in subject.problem()
        assert subject.problem().endswith(" times packet that is not DIFI")
        subject.run(3.0)
        assert not subject.problem()

        def silent() -> bool:
            sender.sendto(b"\xff" * 100, ("127.0.0.1", subject.port))
            return "silent for 1." in subject.problem()

        wait_for(silent, "silence")
        assert "garbage arrives: 50 of 50 times packet that is not DIFI" in subject.problem()


def test_a_recording_is_written_read_and_replayed(tmp_path: Path) -> None:
    path = tmp_path / "pass.sigmf-meta"
    outlet = make_outlet(OutletParams(format="sigmf", file=str(path)), RATE_HZ, CENTRE_HZ)
    generator = SignalGenerator(GeneratorParams(rate_hz=RATE_HZ))
    for piece in range(150):
        offset_hz = CARRIER_HZ - CENTRE_HZ
        outlet.send(generator.take(1920, (offset_hz, offset_hz), [10.0 ** (LEVEL_DB_HZ / 20.0)]), 1e9 + PIECE_S * piece)
    outlet.close()
    about = json.loads(path.read_text())
    assert about["global"]["core:datatype"] == "ci16_le"
    assert read_sigmf(path) == (RATE_HZ, "ci16", 1, CENTRE_HZ, 1e9)
    written = path.with_suffix(".sigmf-data").read_bytes()
    make_outlet(OutletParams(format="sigmf", file=str(path)), RATE_HZ, CENTRE_HZ).close()
    assert path.with_suffix(".sigmf-data").read_bytes() == written, "one that exists is kept"
    params = SignalReceiverParams(
        type="sigmf", frequency_hz=CARRIER_HZ, link=SourceLinkParams(file=str(path)), iq=IqParams(rate_hz=RATE_HZ)
    )
    receiver = SignalReceiver(params, time.time)
    found: list[Any] = []

    def replayed() -> bool:
        found.extend(receiver.step(time.time()))
        return receiver.source.index >= 140 * 1920

    wait_for(replayed, "samples")
    receiver.end()
    assert np.mean([each.power.carrier_to_noise_db_hz for each in found[10:]]) == pytest.approx(LEVEL_DB_HZ, abs=0.3)


@pytest.mark.parametrize("within_s", [-3.0, 1.0])
def test_a_recording_is_followed_while_it_is_written_and_replayed_at_its_own_time(
    tmp_path: Path, within_s: float
) -> None:
    path, begun_s, now_s = tmp_path / "pass.sigmf-meta", 1e9, 1e9
    outlet = make_outlet(OutletParams(format="sigmf", file=str(path)), RATE_HZ, CENTRE_HZ)
    count = round(PIECE_S * RATE_HZ)
    every = (np.arange(150 * count) % 3000 / 4000.0).astype(np.complex64)
    iq, link = IqParams(rate_hz=RATE_HZ), SourceLinkParams(file=str(path), first_retry_s=0.05, longest_retry_s=0.1)
    params = SignalReceiverParams(type="sigmf", frequency_hz=CARRIER_HZ, link=link, iq=iq)

    def take(source: Any, until_s: float) -> list[Any]:
        """Return the pieces before `until_s`, each with the samples of its time."""
        found: list[Any] = []
        wait_for(lambda: found.extend(source.step()) or (found and ends_s(found[-1]) > until_s - 0.05), "samples")
        for each in found:
            first = round((each.t_s - begun_s) * RATE_HZ)
            wanted = every[first : first + each.samples.shape[1]]
            assert each.samples[0] == pytest.approx(wanted, abs=1e-4)
        return found

    def ends_s(piece: Any) -> float:
        return float(piece.t_s) + piece.samples.shape[1] / RATE_HZ

    follower = make_source(params, lambda: now_s)
    for piece in range(150):
        outlet.send(every[None, piece * count : (piece + 1) * count], begun_s + PIECE_S * piece)
        now_s = begun_s + PIECE_S * (piece + 1)
        if piece == 24:
            follower.step()
            wait_for(lambda: follower.index, "a recording that is open")
        elif piece % 25 == 24:
            take(follower, now_s)
    now_s += 1.5
    wait_for(lambda: "the recording has ended" in follower.problem, "its end")
    follower.end()
    outlet.close()
    now_s = begun_s + within_s
    again = make_source(params, lambda: now_s)
    again.step()
    wait_for(lambda: again.index, "a recording that is open")
    now_s = begun_s + max(within_s, 0.0) + 0.3
    # Where it begins later, it is waited for.
    assert take(again, now_s)[0].t_s == pytest.approx(begun_s + max(within_s, 0.0), abs=0.3)
    again.end()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("{", "is not SigMF"),
        ('{"global": {"core:sample_rate": 1.0}}', "is not SigMF"),
        ('{"global": {"core:datatype": "rf64_le", "core:sample_rate": 1e4}}', "core:datatype=rf64 must be"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(tmp_path: Path, content: str, reason: str) -> None:
    path = tmp_path / "a.sigmf-meta"
    path.write_text(content)
    with pytest.raises(ValueError, match=reason):
        read_sigmf(path)


class Instrument(threading.Thread):
    """An instrument that answers each line of a request, or sends lines by itself."""

    def __init__(self, answer: Callable[[str], str], port: int = 0) -> None:
        super().__init__(daemon=True)
        self._answer, self.requests = answer, list[str]()
        self._server, self._client = socket.create_server(("127.0.0.1", port)), None
        self.port = int(self._server.getsockname()[1])
        self.start()

    def run(self) -> None:
        with suppress(OSError):
            while True:
                self._client, _ = client, _ = self._server.accept()
                with client, client.makefile("rw") as lines:
                    for line in lines:
                        self.requests.append(line.strip())
                        lines.write(self._answer(line.strip()))
                        lines.flush()

    def close(self) -> None:
        # `accept` of another thread goes on after a mere close.
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        if self._client is not None:
            with suppress(OSError):
                self._client.shutdown(socket.SHUT_RDWR)
        self.join(PATIENCE_S)


@pytest.mark.parametrize(
    ("kind", "request_", "answer"),
    [("scpi", "CALC:MARK1:Y?", "-{}\n"), ("rigctl", "l STRENGTH", "-{}\n"), ("level", "C/N?", "LOCK 1 C/N= -{} dB\n")],
)
def test_an_instrument_is_asked_and_found_again(kind: str, request_: str, answer: str) -> None:
    instrument = Instrument(lambda _: answer.format("63.25"))
    level = LevelParams(transport="tcp", request=request_ if kind == "level" else "",
                        **({"pattern": r"LOCK (?P<lock>\d) C/N= *(?P<level>-[\d.]+)"} if kind == "level" else {}))  # fmt: skip
    link = SourceLinkParams(host="127.0.0.1", port=instrument.port, first_retry_s=0.05, longest_retry_s=0.2)
    source = make_source(SignalReceiverParams(type=kind, link=link, level=level, period_s=0.06), time.time)
    found: list[Any] = []
    for value in (-63.25, -20.5):
        wait_for(lambda: found.extend(source.step()) or len(found) >= 3, "levels")
        wait_for(lambda: not source.problem, "no problem")
        assert {(each.value, each.locked) for each in found} == {(value, True if kind == "level" else None)}
        assert set(instrument.requests) == {request_}
        instrument.close()
        wait_for(lambda: f"{kind} at 127.0.0.1" in source.problem, "a problem")
        source.step()
        found.clear()
        instrument = Instrument(lambda _: answer.format("20.5"), instrument.port)
    source.end()
    instrument.close()


@pytest.mark.parametrize(
    ("words", "value", "problem"),
    [
        ("printf 'STRING: \"%s dB\"' 7.25", 7.25, ""),
        ("sh -c 'echo Timeout: no response from modem >&2; exit 1'", None, "sh ended with 1: Timeout: no response"),
        ("no-such-program 1.3.6.1", None, "level from no-such-program: No such file"),
        ("", None, "level.request must be the command line"),
    ],
)
def test_a_level_that_a_program_prints(words: str, value: float | None, problem: str) -> None:
    """As Debian's snmpget prints that of a modem."""
    level = LevelParams(transport="command", request=words)
    source = make_source(SignalReceiverParams(type="level", level=level), time.time)
    found: list[Any] = []
    try:
        wait_for(
            lambda: found.extend(source.step()) or len(found) >= 2 or (problem and problem in source.problem), "levels"
        )
    finally:
        source.end()
    assert {each.value for each in found} == ({value} if value else set())


def test_a_beacon_receiver_that_sends_datagrams() -> None:
    port, sent = free_port(socket.SOCK_DGRAM), 0
    level = LevelParams(pattern=r"BCN1 (?P<level>-?[\d.]+) dBm (?P<lock>\w+)", locked="LOCKED")
    params = SignalReceiverParams(type="level", link=SourceLinkParams(host="127.0.0.1", port=port), level=level)
    source = make_source(params, lambda: 7.0)
    found: list[Any] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:

        def send() -> bool:
            nonlocal sent
            sender.sendto(b"BCN1 -71.4 dBm " + (b"SEARCH" if sent % 2 else b"LOCKED"), ("127.0.0.1", port))
            sender.sendto(b"HELLO", ("127.0.0.1", port))
            sent += 1
            found.extend(source.step())
            return len(found) >= 4

        wait_for(send, "levels")
    source.end()
    assert {each.value for each in found} == {-71.4}
    assert {each.locked for each in found} == {True, False}
    assert source.losses["line without a level"] >= 1


def test_an_instrument_that_does_not_answer_is_lost() -> None:
    instrument = Instrument(lambda _: "RPRT -11\n")
    link = SourceLinkParams(host="127.0.0.1", port=instrument.port)
    source = make_source(SignalReceiverParams(type="rigctl", link=link), time.time)
    source.step()
    wait_for(lambda: "the rig refuses its level: RPRT -11" in source.problem, "a refusal")
    source.end()
    instrument.close()


@given(
    st.builds(
        Packet, st.sampled_from([1, 4]), st.integers(0, 2**32 - 1), st.integers(0, 15), st.integers(0, 2**32 - 1),
        st.integers(0, 10**12 - 1), st.binary(max_size=400).map(lambda data: data + bytes(-len(data) % 4)),
    )
)  # fmt: skip
def test_packets_survive_the_way(packet: Packet) -> None:
    assert decode_packet(encode_packet(packet)) == packet


@given(
    st.builds(
        Context, st.none() | st.integers(1, 10**9).map(float), st.none() | st.integers(1, 10**11).map(float),
        st.none() | st.integers(4, 16),
    )
)  # fmt: skip
def test_contexts_survive_the_way(context: Context) -> None:
    assert decode_context(encode_context(context)) == context


@given(st.binary(max_size=200))
def test_any_datagram_is_decoded_or_refused(data: bytes) -> None:
    with suppress(ValueError):
        packet = decode_packet(data)
        decode_context(packet.payload)


def test_a_packet_as_the_difi_consortium_prints_it() -> None:
    """The header of its tutorial: 1A61 00C9, stream 0, OUI of VITA, seconds, one picosecond."""
    header = bytes.fromhex("1a6100c900000000000012a200000000") + struct.pack(">IQ", 1_700_000_000, 1)
    packet = decode_packet(header + b"\xff\xff\x00\x00" * 194)
    assert (packet.kind, packet.count, packet.seconds, packet.picoseconds) == (1, 1, 1_700_000_000, 1)
    assert len(packet.payload) == 4 * 194


@pytest.mark.parametrize(("kind", "data", "value"), [
    ("cu8", bytes([255, 0]), complex(127.5 / 128.0, -127.5 / 128.0)),
    ("ci8", bytes([127, 128]), complex(127.0 / 128.0, -1.0)),
    ("ci16", struct.pack("<hh", 32767, -32768), complex(32767.0 / 32768.0, -1.0)),
    ("cf32", struct.pack("<ff", 0.5, math.nan), complex(0.5, 0.0)),
])  # fmt: skip
def test_samples_of_every_format(kind: str, data: bytes, value: complex) -> None:
    samples, clipped = decoded(data, kind)
    assert samples[0, 0] == pytest.approx(value, abs=1e-6)
    assert clipped > 0.0


@pytest.mark.parametrize(
    ("params", "reason"),
    [
        ({"type": "radio"}, "receiver.type='radio' must be one of"),
        ({"type": "level", "level": LevelParams(pattern="(")}, "is not a regular expression"),
        ({"type": "level", "level": LevelParams(pattern="a")}, "must have a group level"),
        ({"type": "rtl_tcp", "signal": SignalSearchParams(channels=2)}, "signal.channels=2 must be 1"),
        ({"type": "rtl_tcp", "signal": SignalSearchParams(kind="preamble", preamble="01")}, "at least 8"),
    ],
)
def test_receivers_that_could_never_work_are_refused(params: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        make_source(SignalReceiverParams(**params), time.time)
