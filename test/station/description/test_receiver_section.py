"""The section `receiver`: what reaches the nodes, what is refused, and addresses of a command line."""

from pathlib import Path
from typing import Any

import pytest

from rf_pointing.api.requests import TrackRequest, receiver_section
from rf_pointing.api.station import Station
from rf_pointing.receiver import SignalReceiverParams
from rf_pointing.ros.graph import DRIVE_NODES, NODES
from rf_pointing.ros.managed_graph import with_receiver
from rf_pointing.station.description import read_station
from rf_pointing.station.description.description import STATIONS


def written(folder: Path, section: str) -> Path:
    path = folder / "station.yaml"
    path.write_text((STATIONS / "leo_3m7.yaml").read_text() + f"\nreceiver: {section}\n")
    return path


def params_of(path: Path, band: str = "X") -> SignalReceiverParams:
    found: SignalReceiverParams = read_station(path).sets("signal_receiver", band)["receiver"]
    return found


def test_the_section_reaches_the_node_with_the_numbers_of_the_band(tmp_path: Path) -> None:
    section = "{type: rtl_tcp, link: {host: dish, port: 7}, iq: {rate_hz: 1.0e6, converter_mhz: 7000.0}}"
    params = params_of(written(tmp_path, section))
    assert (params.type, params.link.host, params.link.port, params.iq.rate_hz) == ("rtl_tcp", "dish", 7, 1e6)
    assert (params.frequency_hz, params.system_noise_k, params.period_s) == (8.2e9, 110.0, 0.1)
    source = read_station(tmp_path / "station.yaml").sets("signal_source", "X")
    assert (source["sdr"].carrier_hz, source["sdr"].doppler_hz) == (1.2e9, 8.2e9)
    assert (source["outlet"].format, source["outlet"].port) == ("rtl_tcp", 7)
    assert source["sdr"].generator.rate_hz == 1e6


@pytest.mark.parametrize(
    ("section", "reason"),
    [
        ("{type: radio}", "receiver.type='radio' must be one of simulated, topic, rtl_tcp"),
        ("{type: rtl_tcp, iq: {rate: 1.0}}", "receiver.iq.rate: no such key of receiver; did you mean iq.rate_hz?"),
        ("{type: rtl_tcp, iq: {rate_hz: 1.0}}", "rate_hz=1.0 must be >= 8000"),
        ("{type: level, level: {pattern: x}}", "must have a group level"),
        ("{type: vita49, signal: {channels: 2}}", "signal.channels=2 must be 1"),
    ],
)
def test_a_section_that_cannot_work_is_refused_at_its_line(tmp_path: Path, section: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason.replace("(", r"\(").replace("?", r"\?")):
        read_station(written(tmp_path, section))


@pytest.mark.parametrize(
    ("section", "known"),
    [
        ("{type: rtl_tcp}", True),
        ("{type: level}", False),
        ("{type: level, level: {floor_dbm: -90.0}}", True),
        ("{type: level, level: {kind: es_n0_db}}", True),
    ],
)
def test_gates_know_whether_a_level_is_a_c_n0(tmp_path: Path, section: str, known: bool) -> None:
    controller = read_station(written(tmp_path, section)).sets("pointing_controller", "X")
    assert controller["watch"].compares_level is known


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("rtl_tcp://dish:99", {"type": "rtl_tcp", "link": {"host": "dish", "port": 99}}),
        ("vita49://:5000?signal.channels=3", {"link": {"port": 5000}, "signal": {"channels": 3}}),
        (
            "sigmf:///tmp/a.sigmf-meta?iq.rate_hz=48000",
            {"link": {"file": "/tmp/a.sigmf-meta"}, "iq": {"rate_hz": 48000}},
        ),
        ("level://x?level.kind=es_n0_db", {"level": {"kind": "es_n0_db"}}),
        (
            "zmq://x:5?iq.rate_hz=1.0e6&signal.preamble=01101000",
            {"iq": {"rate_hz": 1e6}, "signal": {"preamble": "01101000"}},
        ),
    ],
)
def test_an_address_means_a_section(address: str, expected: dict[str, Any]) -> None:
    section = receiver_section(address, read_station("leo_3m7").content.receiver)
    for name, value in expected.items():
        assert getattr(section, name) == value


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("localhost:1234", "must begin with one of simulated"),
        ("rtl_tcp://a:1?gain=3", "gain must begin with one of link"),
        ("rtl_tcp://a:1?iq.gain=3", "has no such parameter"),
        ("rtl_tcp://a:99999", "Port out of range"),
    ],
)
def test_an_address_that_means_none_is_refused(address: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        receiver_section(address, read_station("leo_3m7").content.receiver)


def test_a_run_with_a_receiver_has_its_nodes_and_real_time() -> None:
    request = TrackRequest(station=Station("leo_3m7"), receiver="rtl_tcp://localhost:99")
    assert request.station.description.receiver == "rtl_tcp"
    assert request.speed == 1.0
    assert TrackRequest(station=Station("leo_3m7")).speed is None


def test_the_nodes_of_every_receiver() -> None:
    rest = tuple(name for name in NODES if name != "rf_receiver")
    assert with_receiver(NODES, "simulated") == NODES
    for served in ("rtl_tcp", "vita49", "zmq", "sigmf"):
        assert with_receiver(NODES, served) == (*rest, "signal_source", "signal_receiver")
    assert with_receiver(NODES, "scpi") == (*rest, "signal_receiver")
    assert with_receiver(NODES, "topic") == rest
    assert with_receiver(DRIVE_NODES, "rtl_tcp") == (*DRIVE_NODES, "signal_receiver")
    assert with_receiver(DRIVE_NODES, "topic") == DRIVE_NODES
