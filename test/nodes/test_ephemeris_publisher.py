"""The ephemeris publisher between its topics: what it publishes, takes, serves, and mirrors in its parameters."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rf_pointing_msgs.msg import Attitude
from rf_pointing_msgs.srv import Named, SelectTarget
from sensor_msgs.msg import FluidPressure, NavSatFix, RelativeHumidity, Temperature

from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.ephemeris import ElementUncertainty, find_elements, sky_uncertainty, verification_elements
from rf_pointing.ephemeris.sites import Site
from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.description import read_station

CBERS = find_elements(verification_elements(), "28057")
NOW_S = 1_151_384_500.0
"""In the first pass of CBERS-2."""


@pytest.fixture
def make(make_bench: Callable[..., Any]) -> Callable[..., Any]:
    """Return a maker of active publishers in June 2006."""
    return lambda **given: make_bench(EphemerisPublisher, t_s=NOW_S, **given).up()


def test_passes_profiles_and_targets_are_published_with_their_stamps(make: Callable[..., Any]) -> None:
    bench = make(**{"publisher.period_s": 0.25})
    ((passes,), (profiles,)) = bench.sent["passes"], bench.sent["pass_profiles"]
    assert (passes.target, passes.header.stamp.sec, profiles.header.stamp.sec) == ("CBERS 2", int(NOW_S), int(NOW_S))
    assert len(passes.passes) == len(profiles.profiles) >= 4
    bench.run(1.0)
    targets = bench.sent["target"]
    assert [seconds_from_stamp(each.header.stamp) - NOW_S for each in targets] == [2.25, 2.5, 2.75, 3.0]
    looks, target = load_track(SourceParams()).sample([NOW_S + 3.0]), targets[-1]
    assert (target.target, target.element_age) == ("CBERS 2", pytest.approx(NOW_S + 3.0 - CBERS.epoch_t_s, abs=1e-3))
    assert target.azimuth == pytest.approx(looks.azimuth_rad[0], abs=1e-9)
    assert target.doppler_factor == pytest.approx(1.0 - looks.range_rate_m_s[0] / SPEED_OF_LIGHT_M_S, abs=1e-12)
    assert target.light_time == pytest.approx(looks.range_m[0] / SPEED_OF_LIGHT_M_S, rel=1e-9)
    assert target.refraction == pytest.approx(looks.elevation_rad[0] - looks.true_elevation_rad[0], abs=1e-9)
    sky = sky_uncertainty(load_track(SourceParams()), NOW_S + 3.0, ElementUncertainty())
    assert list(target.covariance) == pytest.approx(sky.covariance_rad2.ravel().tolist(), rel=1e-6)
    assert target.along_track_sigma > target.cross_track_sigma > 0.0
    bench.wait(passes.passes[0].los.sec + 30.0 - bench.t_s)
    bench.run(1.0)
    assert len(targets) == 4
    heard = {each.topic_name for each in bench.node.subscriptions}
    assert not [each for each in heard if "weather" in each or "attitude" in each]


def test_a_target_is_selected_by_name_start_and_peak_and_a_refusal_has_its_reason(make: Callable[..., Any]) -> None:
    bench = make(**{"source.hold": True})
    start_s = bench.sent["passes"][0].passes[0].los.sec + 60.0
    request = SelectTarget.Request(target="CBERS 2", start=stamp_from_seconds(start_s), minimum_peak_elevation=0.2)
    answer = bench.call("~/select_target", request)
    assert (answer.success, answer.message) == (True, f"{len(answer.passes)} passes of CBERS 2")
    assert answer.passes[0].aos.sec > start_s
    assert min(each.peak_elevation for each in answer.passes) >= 0.2
    assert bench.node.get_parameter("source.hold").value is False
    for body in ("Moon", "3C 84"):
        assert bench.call("~/select_target", SelectTarget.Request(target=body)).passes[0].target == body
    refused = bench.call("~/select_target", SelectTarget.Request(target="nobody"))
    assert (refused.success, "nobody" in refused.message, len(bench.sent["passes"])) == (False, True, 4)


def test_measured_weather_and_attitude_are_used_and_read_back_where_they_are_wanted(make: Callable[..., Any]) -> None:
    bench = make(**{"source.refraction": "measured", "source.antenna.half_power_beamwidth_deg": 40.0})
    bench.give("weather/temperature", Temperature(temperature=30.0))
    bench.give("weather/pressure", FluidPressure(fluid_pressure=94000.0))
    bench.give("weather/humidity", RelativeHumidity(relative_humidity=0.4))
    for roll_rad, frame, valid in ((0.5, "sat/orbit", True), (0.9, "sat/orbit", False), (0.9, "earth", True)):
        message = Attitude(valid=valid)
        message.header.frame_id = frame
        message.orientation.x, message.orientation.w = math.sin(0.5 * roll_rad), math.cos(0.5 * roll_rad)
        bench.give("satellite_attitude", message)
    assert bench.health("inputs").values["refused satellite_attitude"] == "1"
    bench.run(11.0, 1.0)
    source = bench.node.parameters.value("source")
    found = (source.weather.temperature_k, source.weather.pressure_hpa, source.weather.relative_humidity)
    assert found == pytest.approx((303.15, 940.0, 0.4))
    assert source.antenna.roll_rad == pytest.approx(0.5)


def test_a_ship_is_where_its_receiver_says_and_its_passes_follow_between_two(
    make: Callable[..., Any], tmp_path: Path
) -> None:
    read_station("dss13").write(tmp_path / "station.yaml", {"base.coast_s": 2.0})
    bench = make(station=str(tmp_path / "station.yaml"))
    for latitude_deg in (34.0, 34.00002, 44.0, math.nan):
        bench.give("base/fix", NavSatFix(latitude=latitude_deg, longitude=-117.0, altitude=20.0))
        bench.run(0.1)
    assert bench.health("inputs").values["refused base/fix"] == "2"
    # Where the ship is to a metre, with offsets as they were.
    assert bench.change(**{"source.time_offset_s": 1.0}) == ""
    bench.run(0.1)
    source, target = SourceParams().replace(site=Site.from_degrees(34.00002, -117.0, 20.0)), bench.sent["target"][-1]
    looks = load_track(source).sample([seconds_from_stamp(target.header.stamp) + 1.0])
    assert target.azimuth == pytest.approx(looks.azimuth_rad[0], abs=1e-6)
    bench.run(11.0, 1.0)
    assert len(bench.sent["passes"]) == 1
    bench.wait(bench.sent["passes"][0].passes[0].los.sec + 30.0 - bench.t_s)
    bench.run(11.0, 1.0)
    assert bench.sent["passes"][1].passes[0].aos != bench.sent["passes"][0].passes[1].aos


def test_what_is_set_live_is_in_force_and_a_new_configuration_begins_without_passes(make: Callable[..., Any]) -> None:
    bench = make()
    assert bench.change(**{"publisher.lead_s": 9.0, "source.along_track_offset_s": 0.5}) == ""
    bench.run(0.1)
    assert seconds_from_stamp(bench.sent["target"][-1].header.stamp) == pytest.approx(bench.t_s + 9.0)
    assert bench.health("target").values["along_track_offset_s"] == "0.5"
    for transition in ("deactivate", "cleanup", "configure"):
        assert bench.step(transition)
    assert bench.health("target").values["passes"] == "0"


def test_offsets_are_cleared_together_and_sets_are_kept_for_the_band(make: Callable[..., Any], tmp_path: Path) -> None:
    bench = make(**{"publisher.state_file": str(tmp_path / "publisher.json")})
    wanted = {"source.azimuth_offset_deg": 0.1, "source.time_offset_s": 1.0}
    assert bench.change(**wanted) == ""
    bench.run(0.1)
    text = "time 1 s, azimuth 0.1 deg"
    assert bench.sent["target"][-1].offsets == text
    assert bench.call("~/keep_offsets", Named.Request(name="feed A")).message == "kept as feed A"
    assert bench.call("~/clear_offsets").message == "offsets: none"
    bench.run(0.1)
    assert bench.sent["target"][-1].offsets == ""
    assert not any(bench.node.parameters.value("source").offsets.values())
    assert bench.health("target").values["offset_sets"] == "feed A"
    assert bench.call("~/recall_offsets", Named.Request(name="feed A")).message == f"offsets: {text}"
    bench.run(0.1)
    assert bench.sent["target"][-1].offsets == text
    assert bench.health("target").values["azimuth_offset_deg"] == "0.1"
    assert not bench.call("~/recall_offsets", Named.Request(name="feed B")).success
    assert bench.call("~/forget_offsets", Named.Request(name="feed A")).message == "feed A is forgotten"
    assert not bench.call("~/forget_offsets", Named.Request(name="feed A")).success
