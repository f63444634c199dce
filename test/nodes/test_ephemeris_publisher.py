"""The ephemeris publisher between its topics: what it cannot tell it says, and goes on."""

import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rf_pointing_msgs.msg import Attitude

from rf_pointing.core.dates import utc_text
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import TopocentricTrack, find_elements, site, verification_elements
from rf_pointing.ephemeris.earth_orientation import orientation_table
from rf_pointing.nodes.diagnostics import ERROR, OK, WARN
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher

STATE = LifecycleState(state_id=1, label="unconfigured")
FIRST_S, STEP_S, STATES = 1_151_384_300.0, 60.0, 13
MIDDLE_S = FIRST_S + 0.5 * STEP_S * (STATES - 1)


@pytest.fixture
def ephemeris(tmp_path: Path) -> Path:
    """Return an ephemeris of twelve minutes; the pass of CBERS-2 that begins in them goes on for 20 s more."""
    elements = find_elements(verification_elements(), "28057")
    record, times = elements.satrec(), FIRST_S + STEP_S * np.arange(STATES)
    rows = [(utc_text(t)[:-1], *np.ravel(record.sgp4_tsince((t - elements.epoch_t_s) / 60.0)[1:])) for t in times]
    meta = {
        "OBJECT_NAME": "BIRD", "OBJECT_ID": "2003-049A", "CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC",
        "START_TIME": rows[0][0], "STOP_TIME": rows[-1][0], "INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "9",
    }  # fmt: skip
    lines = ["CCSDS_OEM_VERS = 2.0", "META_START", *(f"{key} = {value}" for key, value in meta.items()), "META_STOP"]
    file = tmp_path / "bird.oem"
    file.write_text("\n".join([*lines, *(" ".join(map(str, row)) for row in rows)]))
    return file


@pytest.fixture
def publisher(default_context: None, ephemeris: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Yield a publisher that is active in the middle of the pass, and what it publishes as `sent`."""
    node = EphemerisPublisher()
    values = {"source.elements": str(ephemeris), "source.satellite": "BIRD"}
    node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
    monkeypatch.setattr(node, "now_s", lambda: MIDDLE_S)
    assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS
    assert node.on_activate(STATE) == TransitionCallbackReturn.SUCCESS
    node.sent = []
    monkeypatch.setattr(node._targets, "publish", node.sent.append)
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


def told(node: Any, **values: float | bool) -> None:
    (result,) = {
        item.successful for item in node.set_parameters([Parameter(f"source.{k}", value=v) for k, v in values.items()])
    }
    assert result


def test_an_offset_beyond_the_end_of_an_ephemeris_ends_the_targets_not_the_node(publisher: Any) -> None:
    late_s = FIRST_S + STEP_S * (STATES - 1) - 40.0
    publisher._publish(late_s)
    assert len(publisher.sent) == 1
    told(publisher, along_track_offset_s=50.0)
    publisher._publish(late_s)
    assert len(publisher.sent) == 1
    publisher._publish(late_s - 20.0)
    assert len(publisher.sent) == 2


def test_a_target_that_cannot_be_told_is_an_error_on_diagnostics(
    publisher: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_t_s: float) -> None:
        raise ValueError("BIRD cannot be propagated: it has decayed")

    with monkeypatch.context() as broken:
        broken.setattr(publisher._track, "target_at", fails)
        publisher._publish(MIDDLE_S)
        assert publisher._health().level == ERROR
        assert "it has decayed" in publisher._health().message
    publisher._publish(MIDDLE_S)
    assert publisher._health().level == OK


def test_a_held_target_keeps_the_pass_and_another_one_moves(publisher: Any) -> None:
    told(publisher, hold=True)
    passes = publisher._passes
    assert publisher._choose(publisher._track, MIDDLE_S, 0.0) == passes
    from rf_pointing_msgs.srv import SelectTarget

    publisher._select(SelectTarget.Request(target="BIRD"))
    assert publisher.parameters.value("source").hold is False
    assert publisher._track.hold_t_s is None


def test_beyond_the_table_of_the_earth_the_target_goes_on_and_diagnostics_states_the_error(
    publisher: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert publisher._health().values["earth_orientation_sigma_deg"] == 0.0
    after_s = orientation_table().span_t_s[1] + 1.5 * 86400.0
    elements = dataclasses.replace(find_elements(verification_elements(), "28057"), epoch_t_s=after_s - 3600.0)
    publisher._choose(TopocentricTrack(elements, site("Goldstone DSS-13")), after_s, 0.0)
    publisher.sent.clear()
    during_s = publisher._passes[0].tca_t_s
    monkeypatch.setattr(publisher, "now_s", lambda: during_s)
    publisher._publish(during_s)
    assert len(publisher.sent) == 1
    health = publisher._health()
    assert health.level == WARN
    assert "beyond the table that ends on" in health.message
    # 0.1 s of the Earth's turn is 50 m, seen from 1000 to 3000 km.
    assert 2e-4 < health.values["earth_orientation_sigma_deg"] < 5e-3


def activated(node: EphemerisPublisher, monkeypatch: pytest.MonkeyPatch) -> Iterator[EphemerisPublisher]:
    """Yield the node active in June 2006, and end it."""
    monkeypatch.setattr(node, "now_s", lambda: 1_151_384_500.0)
    assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS
    assert node.on_activate(STATE) == TransitionCallbackReturn.SUCCESS
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


@pytest.fixture
def weather(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Yield a publisher that takes the weather from the station's instruments."""
    node = EphemerisPublisher()
    node.set_parameters([Parameter("source.refraction", value="measured")])
    yield from activated(node, monkeypatch)


def test_the_measured_weather_bends_the_rays_and_its_age_is_reported(
    weather: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    low = math.radians(5.0)
    before = weather._track.refraction.apply(low)
    weather._on_weather("pressure_hpa", 940.0)
    weather._on_weather("temperature_k", 308.0)
    weather._on_weather("relative_humidity", 0.2)
    weather._renew(weather.now_s())
    expected = RadioRefraction(pressure_hpa=940.0, temperature_k=308.0, relative_humidity=0.2).apply(low)
    assert weather._track.refraction.apply(low) == pytest.approx(expected, abs=1e-12)
    assert abs(before - expected) > math.radians(0.005)
    kept = weather._track
    weather._on_weather("pressure_hpa", 940.3)
    weather._renew(weather.now_s())
    assert weather._track is kept, "half a hectopascal bends nothing"
    weather._on_weather("relative_humidity", 7.0)
    weather._renew(weather.now_s())
    assert "measured weather is not used: relative_humidity=7.0" in weather._health().message
    late_s = weather.now_s() + 2.0 * 3600.0
    monkeypatch.setattr(weather, "now_s", lambda: late_s)
    assert "the measured weather is 2.0 h old" in weather._health().message


@pytest.fixture
def turning(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Yield a publisher of a satellite with a narrow beam, whose attitude is measured."""
    node = EphemerisPublisher()
    node.set_parameters([Parameter("source.antenna.half_power_beamwidth_deg", value=40.0)])
    yield from activated(node, monkeypatch)


def attitude(roll_rad: float, frame: str = "sat/orbit", valid: bool = True) -> Attitude:
    message = Attitude(valid=valid)
    message.header.frame_id = frame
    message.orientation.x, message.orientation.w = math.sin(0.5 * roll_rad), math.cos(0.5 * roll_rad)
    return message


def test_a_measured_attitude_moves_the_satellite_s_beam(turning: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    profiles: list[Any] = []
    monkeypatch.setattr(turning._profiles, "publish", profiles.append)
    before = turning._track.target_at(turning._passes[0].tca_t_s)
    turning._on_attitude(attitude(0.5))
    turning._renew(turning.now_s())
    after = turning._track.target_at(turning._passes[0].tca_t_s)
    assert turning._track.antenna.roll_rad == pytest.approx(0.5)
    assert after.satellite_gain_db != pytest.approx(before.satellite_gain_db, abs=1.0)
    assert after.azimuth_rad == before.azimuth_rad
    row = len(profiles[0].profiles[0].time) // 2
    fresh = turning._track.target_at(turning._passes[0].aos_t_s + profiles[0].profiles[0].time[row])
    assert profiles[0].profiles[0].satellite_gain[row] == pytest.approx(fresh.satellite_gain_db, abs=1e-9)
    # A hundredth of the beam, or an attitude that is not valid, changes nothing.
    for message in (attitude(0.5 + math.radians(0.4)), attitude(-0.5, valid=False)):
        turning._on_attitude(message)
        turning._renew(turning.now_s())
    assert (turning._track.antenna.roll_rad, len(profiles)) == (pytest.approx(0.5), 1)
    with pytest.raises(ValueError, match="frame_id='earth' of an attitude must be 'orbit'"):
        turning._on_attitude(attitude(0.5, frame="earth"))
