"""Receivers beside the network: a radio of SoapySDR, a serial line, a package of one's own."""

import os
import pty
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock, call

import numpy as np
import pytest

from rf_pointing.receiver import SignalReceiver, SignalReceiverParams, known_types, make_source
from rf_pointing.receiver.params import IqParams, LevelParams, SignalSearchParams, SourceLinkParams
from test.receiver.test_sources import wait_for

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_receiver.py"
TIMEOUT, OVERFLOW, BROKEN = -1, -4, -2


@pytest.fixture
def radio(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """Put a stand-in for Debian's SoapySDR in place; `script` is what its stream returns."""
    device = MagicMock(**{"setupStream.return_value": "a stream"})

    def read(_: str, buffers: list[Any], size: int, timeoutUs: int) -> Any:
        assert 0 < timeoutUs <= 200_000
        found = device.script.pop(0) if device.script else TIMEOUT
        if isinstance(found, int):
            return SimpleNamespace(ret=found)
        assert found.shape[1] <= size
        for buffer, row in zip(buffers, found, strict=True):
            buffer[: len(row)] = row
        return SimpleNamespace(ret=found.shape[1])

    device.readStream.side_effect = read
    module = SimpleNamespace(
        SOAPY_SDR_RX=1, SOAPY_SDR_CF32="CF32", SOAPY_SDR_TIMEOUT=TIMEOUT,
        SOAPY_SDR_OVERFLOW=OVERFLOW, Device=device.make, errToStr={BROKEN: "STREAM_ERROR"}.get,
    )  # fmt: skip
    device.make.return_value = device
    monkeypatch.setitem(sys.modules, "SoapySDR", module)
    return device


def test_a_radio_of_soapy_is_set_read_and_found_again(radio: MagicMock) -> None:
    piece = np.array([[0.5 + 0.25j, -1.0j, 0.0], [0.1, 0.2, 0.3], [0, 0, 0]], dtype=np.complex64)
    radio.script = [TIMEOUT, piece, OVERFLOW, piece, BROKEN]
    params = SignalReceiverParams(
        type="soapy", frequency_hz=10.489e9, signal=SignalSearchParams(channels=3),
        link=SourceLinkParams(device="driver=lime", first_retry_s=0.05, longest_retry_s=0.1),
        iq=IqParams(rate_hz=1e6, converter_mhz=9750.0, gain_db=20.0),
    )  # fmt: skip
    source, found = make_source(params, lambda: 7.0), list[Any]()
    wait_for(lambda: found.extend(source.step()) or "STREAM_ERROR" in source.problem, "an error")
    assert source.problem == "soapy at driver=lime: SoapySDR: STREAM_ERROR"
    opened = [call.make("driver=lime")]
    for each in range(3):
        opened += [call.setSampleRate(1, each, 1e6), call.setFrequency(1, each, 739e6)]
        opened += [call.setGain(1, each, 20.0)]
    opened += [call.setupStream(1, "CF32", [0, 1, 2]), call.activateStream("a stream")]
    closed = [call.deactivateStream("a stream"), call.closeStream("a stream")]
    calls = [each for each in radio.mock_calls if each[0] != "readStream"]
    assert calls[: len(opened) + 2] == opened + closed
    assert [each.index for each in found] == [0, 4], "a gap where samples were lost"
    assert all(np.array_equal(each.samples, piece) for each in found)
    assert found[0].clipped == pytest.approx(1.0 / 18.0)
    assert source.losses["overflow"] == 1
    for name in ("make", "setSampleRate"):
        getattr(radio, name).side_effect = RuntimeError(f"{name} failed")
        radio.script.append(BROKEN)
        wait_for(lambda: f"{name} failed" in source.problem, "a problem")  # noqa: B023
        getattr(radio, name).side_effect = None
    radio.deactivateStream.side_effect, ends = RuntimeError("gone"), radio.deactivateStream.call_count
    radio.script.append(BROKEN)
    wait_for(lambda: radio.deactivateStream.call_count > ends, "a radio that cannot be closed")
    radio.deactivateStream.side_effect = None
    radio.script.append(piece)
    wait_for(lambda: found.extend(source.step()) or len(found) == 3, "samples again")
    wait_for(lambda: not source.problem, "no problem")
    source.end()
    assert radio.mock_calls[-2:] == closed


def test_without_soapy_the_package_to_install_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "SoapySDR", None)
    with pytest.raises(ValueError, match="apt install python3-soapysdr"):
        make_source(SignalReceiverParams(type="soapy"), time.time).open()


def test_a_modem_at_a_serial_line_whose_cable_is_pulled_and_put_in_again(tmp_path: Path) -> None:
    device = tmp_path / "modem"

    def plug() -> int:
        master, slave = pty.openpty()
        device.unlink(missing_ok=True)
        device.symlink_to(os.ttyname(slave))
        os.close(slave)
        return master

    master = plug()
    link = SourceLinkParams(device=str(device), baud=19200, first_retry_s=0.05, longest_retry_s=0.1)
    pattern = r"=(?P<level>[\d.]+) (?P<lock>\w+)"
    level = LevelParams(transport="serial", request="ESN0?", pattern=pattern, locked="LOCK")
    source = make_source(SignalReceiverParams(type="level", link=link, level=level), lambda: 7.0)
    found: list[Any] = []

    def answered(text: bytes) -> bool:
        os.set_blocking(master, False)
        try:
            asked = os.read(master, 100)
        except OSError:
            asked = b""
        if b"ESN0?\n" in asked:
            os.write(master, text)
        found.extend(source.step())
        return len(found) >= 3

    wait_for(lambda: answered(b"ESN0=12.5 LOCK\r\n"), "levels")
    assert {(each.value, each.locked) for each in found} == {(12.5, True)}
    os.close(master)
    wait_for(lambda: source.problem, "a problem")
    assert source.problem.startswith(f"level at {device}: ")
    master = plug()
    found.clear()
    wait_for(lambda: answered(b"ESN0=3.25 SEARCH\r\n"), "levels again")
    assert {(each.value, each.locked) for each in found[1:]} == {(3.25, False)}
    source.end()
    os.close(master)


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Install the example as a package would be."""
    info = tmp_path / "my_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my_package\nVersion: 1.0\n")
    points = "[rf_pointing.receivers]\nown_receiver = own_receiver:OwnReceiver\n"
    (info / "entry_points.txt").write_text(points)
    (tmp_path / "own_receiver.py").write_text(EXAMPLE.read_text())
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("own_receiver", None)


@pytest.mark.usefixtures("installed")
def test_an_installed_receiver_is_found_by_its_name_and_measured() -> None:
    assert "own_receiver" in known_types()
    params = SignalReceiverParams(type="own_receiver", iq=IqParams(rate_hz=240e3))
    receiver = SignalReceiver(params, time.time)
    assert type(receiver.source).__name__ == "OwnReceiver"

    def settled() -> bool:
        receiver.step(time.time())
        # A busy computer makes a gap, after which the level counts as changed for a moment.
        return receiver.reports > 20 and not receiver.problem(time.time())

    wait_for(settled, "reports without a problem")
    receiver.end()
    assert receiver.newest is not None
    # C / N0 of 0.02^2 over 2 * 0.05^2 in 240 kHz, 5 kHz above the centre.
    assert receiver.newest.carrier_to_noise_db_hz == pytest.approx(42.8, abs=1.5)
    assert receiver.meter.carrier.offset_hz == pytest.approx(5e3, abs=10.0)
    assert len(EXAMPLE.read_text().splitlines()) <= 60
