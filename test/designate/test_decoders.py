"""Aircraft, sondes and drones as their receivers send them; against pymavlink where it is there."""

import json
import math
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rf_pointing.core.constants import EARTH_RADIUS_M
from rf_pointing.designate import DECODERS, Report, ReportNoise
from rf_pointing.designate.decoders import crc_mavlink
from rf_pointing.ephemeris import Site

NOISE, T_S = ReportNoise(), 1.8e9
ADSB_PLACE = (
    "MSG,3,1,1,3C6444,1,2026/06/21,09:00:00.0,2026/06/21,09:00:00.0,,35000,,,50.0,8.0,,,0,0,0,0"
)
ADSB_SPEED = "MSG,4,1,1,3C6444,1,2026/06/21,09:00:00.0,2026/06/21,09:00:00.0,,,450,90.0,,,-600,,,,,"
SUMMARY: dict[str, Any] = {
    "type": "PAYLOAD_SUMMARY", "station": "auto_rx", "callsign": "S1234567", "latitude": 47.5, "longitude": 9.25,
    "altitude": 18000.0, "speed": 72.0, "heading": 180.0, "time": "09:00:00", "vel_h": 20.0, "vel_v": 5.0,
}  # fmt: skip


def place(report: Report, latitude_deg: float, longitude_deg: float, height_m: float) -> None:
    """Compare with the place as a station there would have it."""
    there = Site.from_degrees(latitude_deg, longitude_deg, 0.0)
    up = np.array(there.axes[2])
    np.testing.assert_allclose(
        report.position_m, np.array(there.position_m) + height_m * up, atol=0.02
    )


def local(report: Report, latitude_deg: float, longitude_deg: float) -> np.ndarray:
    return np.array(Site.from_degrees(latitude_deg, longitude_deg, 0.0).axes) @ report.velocity_m_s


def test_an_aircraft_has_the_place_of_one_line_and_the_velocity_of_another() -> None:
    decoder = DECODERS["adsb"](NOISE)
    (alone,) = decoder.take(ADSB_PLACE.encode(), T_S)
    assert alone.name == "3C6444"
    assert alone.velocity_m_s is None
    place(alone, 50.0, 8.0, 35000 * 0.3048)
    assert decoder.take(ADSB_SPEED.encode(), T_S + 0.5) == []
    (moving,) = decoder.take(ADSB_PLACE.encode(), T_S + 1.0)
    np.testing.assert_allclose(
        local(moving, 50.0, 8.0), [450 * 1852 / 3600, 0.0, -3.048], atol=1e-6
    )
    (later,) = decoder.take(ADSB_PLACE.encode(), T_S + 11.0)
    assert later.velocity_m_s is None


def test_a_sonde_has_its_velocity_where_its_decoder_has_it() -> None:
    (found,) = DECODERS["sonde"](NOISE).take(json.dumps(SUMMARY).encode(), T_S)
    place(found, 47.5, 9.25, 18000.0)
    np.testing.assert_allclose(local(found, 47.5, 9.25), [0.0, -20.0, 5.0], atol=1e-9)
    unknown = {**SUMMARY, "heading": -1, "speed": -1}
    assert DECODERS["sonde"](NOISE).take(json.dumps(unknown).encode(), T_S)[0].velocity_m_s is None
    assert DECODERS["sonde"](NOISE).take(b'{"type": "MODEM_STATS"}', T_S) == []


@pytest.mark.parametrize("version", [1, 2])
def test_a_drone_is_read_as_pymavlink_sends_it(version: int) -> None:
    dialect = pytest.importorskip(f"pymavlink.dialects.v{version}0.common")
    sender = dialect.MAVLink(None, srcSystem=7, srcComponent=1)
    heartbeat = sender.heartbeat_encode(2, 3, 0, 0, 4).pack(sender)
    position = sender.global_position_int_encode(
        1000, 473977420, -85456000, 488_500, 10_000, 1200, -340, -55, 0
    ).pack(sender)
    (found,) = DECODERS["mavlink"](NOISE).take(heartbeat + position, T_S)
    assert found.name == "7"
    place(found, 47.397742, -8.5456, 488.5)
    np.testing.assert_allclose(local(found, 47.397742, -8.5456), [-3.4, 12.0, 0.55], atol=1e-9)
    for bad in (
        position[:-1],
        bytes([position[0], *position[2:]]),
        position[:20] + b"\x55" + position[21:],
    ):
        with pytest.raises(ValueError, match="MAVLink"):
            DECODERS["mavlink"](NOISE).take(bad, T_S)


@given(st.binary(max_size=60))
def test_the_checksum_is_that_of_pymavlink(data: bytes) -> None:
    mavcrc = pytest.importorskip("pymavlink.generator.mavcrc")
    assert crc_mavlink(data) == mavcrc.x25crc(list(data)).crc


@pytest.mark.parametrize("kind", DECODERS)
@given(data=st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_whatever_arrives_is_a_report_or_a_reason(kind: str, data: bytes) -> None:
    with suppress(ValueError):
        assert all(isinstance(each, Report) for each in DECODERS[kind](NOISE).take(data, T_S))


@pytest.mark.parametrize("wrong", ["nan", "1e9", "-91", "inf"])
def test_a_place_that_is_none_is_refused_by_its_name(wrong: str) -> None:
    with pytest.raises(ValueError, match="latitude_deg"):
        DECODERS["adsb"](NOISE).take(ADSB_PLACE.replace("50.0", wrong).encode(), T_S)
    with pytest.raises(ValueError, match=r"latitude|JSON"):
        DECODERS["sonde"](NOISE).take(
            json.dumps({**SUMMARY, "latitude": float(wrong)}).encode(), T_S
        )


def test_a_direction_and_a_place_are_one_point() -> None:
    """The covariance of a direction lies along the range and across it."""
    site = Site.from_degrees(40.0, -3.0, 500.0)
    sent = Report.of_direction(
        T_S, "radar", math.radians(30.0), math.radians(20.0), 5e4, site, NOISE
    )
    east, north, up = np.array(site.axes) @ (sent.position_m - np.array(site.position_m))
    assert math.degrees(math.atan2(east, north)) == pytest.approx(30.0)
    assert math.degrees(math.atan2(up, math.hypot(east, north))) == pytest.approx(20.0)
    along = (sent.position_m - np.array(site.position_m)) / 5e4
    assert math.sqrt(along @ sent.covariance_m2 @ along) == pytest.approx(NOISE.range_m)
    assert np.trace(sent.covariance_m2) == pytest.approx(
        NOISE.range_m**2 + 2.0 * (5e4 * NOISE.direction_rad) ** 2
    )
    assert float(np.linalg.norm(sent.position_m)) > EARTH_RADIUS_M
