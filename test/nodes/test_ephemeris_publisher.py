"""The ephemeris publisher between its topics: what it cannot tell it says, and goes on."""

import dataclasses
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import Attitude
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import FluidPressure, RelativeHumidity, Temperature

from rf_pointing import ephemeris as elements_of
from rf_pointing.core.dates import utc_text
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import TopocentricTrack, find_elements, site, verification_elements
from rf_pointing.ephemeris.earth_orientation import orientation_table
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.stamps import stamp_from_seconds

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


def set_source(node: Any, **values: float | bool) -> None:
    (result,) = {
        item.successful for item in node.set_parameters([Parameter(f"source.{k}", value=v) for k, v in values.items()])
    }
    assert result


def test_an_offset_beyond_the_end_of_an_ephemeris_ends_the_targets_not_the_node(publisher: Any) -> None:
    late_s = FIRST_S + STEP_S * (STATES - 1) - 40.0
    publisher._publish(late_s)
    assert len(publisher.sent) == 1
    set_source(publisher, along_track_offset_s=50.0)
    publisher._publish(late_s)
    assert len(publisher.sent) == 1
    publisher._publish(late_s - 20.0)
    assert len(publisher.sent) == 2


def test_a_target_that_cannot_be_published_is_an_error_on_diagnostics(
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
    set_source(publisher, hold=True)
    passes = publisher._passes
    assert publisher._choose(publisher._track, MIDDLE_S, 0.0) == passes
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


NOW_S = 1_151_384_500.0


@pytest.fixture
def make(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Yield a maker of nodes that are configured in June 2006; `sent` is what they publish, by topic.

    `make(source__hold=True)` sets parameters; `clock` holds the time of all of them.
    """
    made: list[EphemerisPublisher] = []

    def publisher(**given: Any) -> Any:
        node: Any = EphemerisPublisher()
        made.append(node)
        node.clock = [NOW_S]
        monkeypatch.setattr(node, "now_s", lambda: node.clock[0])
        for name, value in given.items():
            (done,) = node.set_parameters([Parameter(name.replace("__", "."), value=value)])
            assert done.successful, done.reason
        assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS, node._reason
        node.sent = {"targets": [], "pass_list": [], "profiles": []}
        for name, messages in node.sent.items():
            monkeypatch.setattr(vars(node)[f"_{name}"], "publish", messages.append)
        return node

    yield publisher
    for node in made:
        node.end()
        node.lock.release()
        node.destroy_node()


def active(node: Any) -> Any:
    assert node.on_activate(STATE) == TransitionCallbackReturn.SUCCESS, node._reason
    return node


def select(node: Any, **given: Any) -> SelectTarget.Response:
    (service,) = (each for each in node.services if each.service_name.endswith("/select_target"))
    return service.callback(SelectTarget.Request(**given), SelectTarget.Response())


def topics(node: Any) -> set[str]:
    return {each.topic_name for each in node.subscriptions}


def give(node: Any, topic: str, message: Any) -> None:
    (door,) = [each.callback for each in node.subscriptions if each.topic_name == f"/{topic}"]
    door(serialize_message(message))


def test_passes_and_profiles_come_with_the_activation_and_again_with_each_choice(make: Callable[..., Any]) -> None:
    node = active(make())
    ((passes,), (profiles,)) = node.sent["pass_list"], node.sent["profiles"]
    assert (passes.target, passes.header.stamp.sec) == ("CBERS 2", int(NOW_S))
    assert [each.target for each in passes.passes] == ["CBERS 2"] * len(node._passes)
    assert len(passes.passes) == len(profiles.profiles) == len(node._passes) >= 4
    assert profiles.header.stamp.sec == int(NOW_S)
    rises = [each.aos.sec + each.aos.nanosec * 1e-9 for each in passes.passes]
    assert rises == pytest.approx([window.aos_t_s for window in node._passes], abs=1e-6)
    assert rises[-1] < NOW_S + 86400.0 < rises[-1] + 86400.0 / 2.0
    assert select(node).message == f"{len(rises)} passes of CBERS 2"
    assert len(node.sent["pass_list"]) == len(node.sent["profiles"]) == 2


def test_a_target_is_published_each_period_ahead_of_its_time_in_and_around_a_pass(
    make: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    node, work = make(publisher__lead_s=3.0, publisher__margin_s=7.0, publisher__period_s=0.25), []
    monkeypatch.setattr(node, "every", lambda period_s, call: work.append((period_s, call)))
    active(node)
    assert [period_s for period_s, _call in work] == [0.25, 10.0]
    publish = work[0][1]
    window = node._passes[1]
    first_s, last_s = math.ceil(window.aos_t_s - 10.0), math.floor(window.los_t_s + 4.0)
    for now_s, published in ((first_s - 1.0, 0), (first_s, 1), (last_s, 2), (last_s + 1.0, 2)):
        node.clock[0] = now_s
        publish(now_s)
        assert len(node.sent["targets"]) == published
    target = node.sent["targets"][0]
    assert (target.target, target.header.stamp.sec) == ("CBERS 2", first_s + 3)
    expected = node._track.target_at(first_s + 3.0)
    assert (target.azimuth, target.elevation) == (expected.azimuth_rad, expected.elevation_rad)
    assert target.element_age == pytest.approx(first_s + 3.0 - node._track.target.elements.epoch_t_s, abs=1e-3)
    assert len(target.covariance) == 4


def test_without_a_pass_the_node_is_active_and_another_target_can_be_chosen(make: Callable[..., Any]) -> None:
    node = make(publisher__span_s=360.0)
    node.clock[0] += 3000.0
    active(node)
    words = r"CBERS 2 has no pass above 0\.0 deg in the 0\.1 h after 2006-06-27T05:51:40"
    assert re.match(words, node._health().message)
    assert node._health().level == WARN
    assert node.sent["pass_list"] == []
    node.parameters.put("publisher", node.parameters.value("publisher").replace(span_s=86400.0))
    chosen = select(node, target="CBERS 2")
    assert chosen.success
    assert "no pass" not in node._health().message


def test_a_target_that_does_not_pass_leaves_the_present_one_in_force(make: Callable[..., Any]) -> None:
    node = active(make(publisher__span_s=5400.0))
    passes, track = node._passes, node._track
    refused = select(node, minimum_peak_elevation=math.radians(89.0))
    assert not refused.success
    assert refused.message.startswith("CBERS 2 has no pass above 89.0 deg in the 1.5 h after ")
    assert not select(node, target="nobody").success
    assert (node._passes, node._track, node._peak_rad) == (passes, track, 0.0)
    assert len(node.sent["pass_list"]) == 1


def test_passes_are_chosen_by_start_and_by_peak(make: Callable[..., Any]) -> None:
    node = active(make())
    everything = node._passes
    peak_rad = sorted(window.peak_elevation_rad for window in everything)[1]
    chosen = select(node, minimum_peak_elevation=peak_rad)
    assert len(chosen.passes) == len(everything) - 1
    assert min(each.peak_elevation for each in chosen.passes) == peak_rad
    start_s = everything[0].los_t_s + 60.0
    later = select(node, start=stamp_from_seconds(start_s))
    assert later.passes[0].aos.sec == int(everything[1].aos_t_s)
    assert select(node).passes[0].aos.sec == int(everything[0].aos_t_s), "without a start it is now"
    assert node._peak_rad == 0.0


def test_what_was_chosen_is_in_force_after_a_restart(make: Callable[..., Any], tmp_path: Path) -> None:
    node = active(make(publisher__state_file=str(tmp_path / "target.json")))
    assert select(node, target="CBERS 2", minimum_peak_elevation=0.25).success
    set_source(node, hold=True, along_track_offset_s=1.5)
    node.clock[0] += 30.0
    set_source(node, cross_track_offset_deg=0.02)
    assert node._track.hold_t_s == NOW_S, "a hold that is set keeps its instant"
    node.end()
    node.lock.release()
    node = make(publisher__state_file=str(tmp_path / "target.json"))
    assert (node._peak_rad, node._track.hold_t_s) == (0.25, NOW_S)
    assert (node._track.along_track_offset_s, node.parameters.value("source").hold) == (1.5, True)
    values = node._health().values
    assert values["along_track_offset_s"] == 1.5
    assert values["cross_track_offset_deg"] == pytest.approx(0.02, abs=1e-9)
    assert values["hold_since"].startswith("2006-06-27T05:01:40")
    set_source(node, hold=False)
    assert node._track.hold_t_s is None
    assert node._health().values["hold_since"] == ""


def test_health_has_the_age_and_the_error_of_the_elements(make: Callable[..., Any]) -> None:
    node = active(make())
    health, sky = node._health(), node._uncertainty(NOW_S)
    assert (health.level, health.message) == (OK, "CBERS 2")
    assert health.values["passes"] == len(node._passes)
    assert health.values["element_age_h"] == round((NOW_S - node._track.target.elements.epoch_t_s) / 3600.0, 3)
    assert health.values["along_track_sigma_s"] == round(sky.along_track_s, 4) > 0.0
    assert health.values["along_track_sigma_deg"] == round(math.degrees(sky.along_track_rad), 5) > 0.0
    assert health.values["cross_track_sigma_deg"] == round(math.degrees(sky.cross_track_rad), 5) > 0.0


def test_a_target_without_elements_has_no_uncertainty(make: Callable[..., Any]) -> None:
    node = active(make(source__satellite="Sun"))
    assert node._uncertainty(NOW_S) is None
    assert not {"element_age_h", "along_track_sigma_s"} & set(node._health().values)
    node._publish(node._passes[0].tca_t_s)
    assert list(node.sent["targets"][0].covariance) == []


def test_an_uncertainty_beyond_its_model_is_logged_and_the_target_goes_on(
    make: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    node, lines = active(make()), []
    monkeypatch.setattr(node, "log_once", lambda subject, words: lines.append((subject, words)))

    def expired(*_given: Any) -> None:
        raise ValueError("the elements are 15 days old")

    monkeypatch.setattr(elements_of, "sky_uncertainty", expired)
    node._publish(node._passes[0].tca_t_s)
    assert len(node.sent["targets"]) == 1
    assert lines == [("uncertainty unknown", "the elements are 15 days old")]
    assert "element_age_h" not in node._health().values


def test_a_target_that_cannot_be_computed_is_logged_once(
    make: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    node, lines = active(make()), []
    monkeypatch.setattr(node, "log_once", lambda subject, words: lines.append((subject, words)))

    def decayed(_t_s: float) -> None:
        raise ValueError("CBERS 2 has decayed")

    monkeypatch.setattr(node._track, "target_at", decayed)
    node._publish(node._passes[0].tca_t_s)
    assert lines == [("no target is published", "CBERS 2 has decayed")]
    assert node.sent["targets"] == []


@pytest.mark.parametrize(("stale_days", "level"), [(0.2, WARN), (0.43, OK), (1.0, OK)])
def test_elements_are_stale_by_their_age_at_the_next_closest_approach(
    make: Callable[..., Any], stale_days: float, level: bytes
) -> None:
    node = active(make())
    window = node._passes[0]
    epoch_t_s = node._track.target.elements.epoch_t_s
    assert 0.4 < (window.tca_t_s - epoch_t_s) / 86400.0 < 0.5
    node.parameters.put("source", node.parameters.value("source").replace(stale_days=stale_days))
    assert node._health().level == level
    # Between two passes it is the next one that counts.
    days = (node._passes[1].tca_t_s - epoch_t_s) / 86400.0
    for now_s, first in ((window.los_t_s, True), (window.los_t_s + 1.0, False)):
        node.clock[0] = now_s
        node.parameters.put("source", node.parameters.value("source").replace(stale_days=days - 0.001))
        assert bool(node._stale()) != first


def test_weather_arrives_in_the_units_of_its_messages_where_it_is_measured(make: Callable[..., Any]) -> None:
    instruments = {"/weather/temperature", "/weather/pressure", "/weather/humidity"}
    node = make(source__refraction="measured")
    assert instruments <= topics(node)
    give(node, "weather/temperature", Temperature(temperature=30.0))
    give(node, "weather/pressure", FluidPressure(fluid_pressure=94000.0))
    give(node, "weather/humidity", RelativeHumidity(relative_humidity=0.4))
    active(node)._renew(NOW_S)
    weather = node.parameters.value("source").weather
    assert (weather.temperature_k, weather.pressure_hpa, weather.relative_humidity) == pytest.approx(
        (303.15, 940.0, 0.4)
    )
    assert not topics(node) & {"/satellite_attitude"}


def test_without_instruments_and_without_a_satellite_s_antenna_nothing_is_subscribed(make: Callable[..., Any]) -> None:
    assert not {each for each in topics(make()) if "weather" in each or "attitude" in each}


@pytest.mark.parametrize(
    ("name", "step", "used"),
    [
        ("temperature_k", 0.45, False), ("temperature_k", 0.55, True), ("pressure_hpa", -0.45, False),
        ("pressure_hpa", -0.55, True), ("relative_humidity", 0.018, False), ("relative_humidity", -0.022, True),
    ],
)  # fmt: skip
def test_weather_is_used_when_it_has_changed_by_a_step(weather: Any, name: str, step: float, used: bool) -> None:
    before = getattr(weather.parameters.value("source").weather, name)
    weather._on_weather(name, before + step)
    weather._renew(weather.now_s())
    assert getattr(weather.parameters.value("source").weather, name) == (before + step if used else before)


def test_weather_is_old_after_an_hour_and_a_good_value_ends_a_problem(
    weather: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "measured weather" not in weather._health().message, "none has come"
    weather._on_weather("relative_humidity", 7.0)
    weather._renew(weather.now_s())
    weather._on_weather("relative_humidity", 0.3)
    weather._renew(weather.now_s())
    assert "measured weather" not in weather._health().message
    begun_s = weather.now_s()
    for age_s, old in ((3599.0, False), (3601.0, True)):
        monkeypatch.setattr(weather, "now_s", lambda age_s=age_s: begun_s + age_s)
        assert ("the measured weather is 1.0 h old" in weather._health().message) == old


@pytest.mark.parametrize(("turn_deg", "moved"), [(0.75, False), (0.85, True)])
def test_an_attitude_matters_from_a_fiftieth_of_the_beam(turning: Any, turn_deg: float, moved: bool) -> None:
    turning._on_attitude(attitude(math.radians(turn_deg)))
    turning._renew(turning.now_s())
    assert turning._track.antenna.roll_rad == pytest.approx(math.radians(turn_deg) if moved else 0.0, abs=1e-9)


def newer(node: Any, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Let newer elements be there; return what is noted of their acceptance."""
    accepted: list[int] = []
    monkeypatch.setattr(node._updates, "changed", lambda: True)
    monkeypatch.setattr(node._updates, "accept", lambda: accepted.append(1))
    return accepted


@pytest.mark.parametrize(("before_s", "taken"), [(18.0, True), (16.9, False), (-100.0, False)])
def test_newer_elements_come_into_force_ten_seconds_before_targets_at_the_latest(
    make: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, before_s: float, taken: bool
) -> None:
    node = active(make())
    accepted = newer(node, monkeypatch)
    node._renew(node._passes[1].aos_t_s - before_s)
    assert len(accepted) == len(node.sent["pass_list"]) - 1 == int(taken)


def test_a_held_target_keeps_its_elements(make: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    node = active(make(source__hold=True))
    accepted = newer(node, monkeypatch)
    between_s = 0.5 * (node._passes[0].los_t_s + node._passes[1].aos_t_s)
    node._renew(between_s)
    assert accepted == []
    set_source(node, hold=False)
    node._renew(between_s)
    assert accepted == [1]


def test_the_end_ends_the_command_that_fetches(make: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    node, ended = make(), []
    monkeypatch.setattr(node._updates, "end", lambda: ended.append(1))
    assert node.on_cleanup(STATE) == TransitionCallbackReturn.SUCCESS
    assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS
    assert ended == [1], "those of the configuration before"
    monkeypatch.setattr(node._updates, "end", lambda: ended.append(2))
    node.end()
    assert ended == [1, 2]
    assert not [each for each in node.services if each.service_name.endswith("/select_target")]


def test_a_configuration_forgets_the_passes_of_the_one_before(make: Callable[..., Any]) -> None:
    node = active(make())
    node.on_deactivate(STATE)
    node.on_cleanup(STATE)
    assert node.on_configure(STATE) == TransitionCallbackReturn.SUCCESS
    assert node._passes == []
    node._publish(NOW_S)
    assert node._health().values["passes"] == 0
