"""The section `receiver`: what reaches the nodes, what is refused, and addresses of a command line."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

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


def in_bands(folder: Path, section: str, **own: str) -> Path:
    path, added = written(folder, section), {name: yaml.safe_load(text) for name, text in own.items()}
    content = yaml.safe_load(path.read_text())
    for name, text in added.items():
        content["bands"][name]["receiver"] = text
    path.write_text(yaml.safe_dump(content))
    return path


COMMON = "{type: rtl_tcp, link: {host: dish, port: 7}, iq: {rate_hz: 1.0e6}, delay_s: 0.2}"
MODEM = (
    "{type: level, delay_s: 1.5, power_period_s: 0.5, link: {port: 9}, level: {kind: dbm, pattern: '(?P<level>.+)'}}"
)


def test_a_band_has_what_it_states_of_its_own_receiver_and_the_rest_of_the_common_one(tmp_path: Path) -> None:
    path = in_bands(tmp_path, COMMON, X="{iq: {converter_mhz: 7000.0}}", S=MODEM)
    x, s, station = params_of(path), params_of(path, "S"), read_station(path)
    assert (x.type, x.link, x.iq.rate_hz, x.iq.converter_mhz, x.period_s) == ("rtl_tcp", s.link.replace(port=7), 1e6,
        7000.0, 0.1)  # fmt: skip
    assert (s.type, s.link.host, s.link.port, s.iq.rate_hz, s.iq.converter_mhz, s.period_s) == (
        "level", "dish", 9, 1e6, 0.0, 0.5)  # fmt: skip
    assert s.level.pattern == "(?P<level>.+)"
    for band, known, delay_s in (("X", True, 0.2), ("S", False, 1.5)):
        assert station.sets("pointing_controller", band)["watch"].compares_level is known
        assert station.content.receiver_in(band).delay_s == delay_s
    assert read_station(in_bands(tmp_path, COMMON, S="{}")).digest == read_station(written(tmp_path, COMMON)).digest


@pytest.mark.parametrize(
    ("common", "own", "reason"),
    [
        (COMMON, "{type: topic}", "bands.S.receiver.type='topic': receiver.type='rtl_tcp' has other nodes"),
        ("{}", "{type: rtl_tcp}", "bands.S.receiver.type='rtl_tcp': receiver.type='simulated' has other nodes"),
        (COMMON, "{type: radio}", "bands.S.receiver.type='radio' must be one of simulated"),
        (COMMON, "{iq: {rate: 1.0}}", "bands.S.receiver.iq.rate: no such key of bands.S.receiver; did you mean"),
        (COMMON, "{iq: {rate_hz: 1.0}}", "rate_hz=1.0 must be >= 8000"),
        (COMMON, "{power_period_s: 0.01}", "power_period_s=0.01 must be >= 0.06"),
        (COMMON, "{signal: {channels: 2}}", "bands.S.receiver.signal.channels=2 must be 1"),
    ],
)
def test_a_receiver_of_a_band_that_cannot_work_is_refused(tmp_path: Path, common: str, own: str, reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)):
        read_station(in_bands(tmp_path, common, S=own))


def test_the_receiver_of_a_run_takes_the_place_of_that_of_its_band(tmp_path: Path) -> None:
    path = in_bands(tmp_path, COMMON, X="{link: {port: 8}, iq: {converter_mhz: 7000.0}}")
    request = TrackRequest(station=Station(path, "X"), receiver="rtl_tcp://lab")
    expected = ("lab", 8, 7000.0, 0.2)
    request.station.description.write(tmp_path / "run.yaml", request.changes)
    written_down = read_station(tmp_path / "run.yaml")
    for station in (request.station.description, written_down):
        params = station.sets("signal_receiver", "X")["receiver"]
        assert (
            params.link.host, params.link.port, params.iq.converter_mhz,
            station.content.receiver_in("X").delay_s,
        ) == expected  # fmt: skip
    assert written_down.digest == request.station.description.digest


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
