"""The simulated receiver's node: it follows the selected satellite, and publishes while it is active."""

from collections.abc import Callable
from typing import Any

from rf_pointing_msgs.msg import Boresight, PassList

from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.ros.stamps import stamp_from_seconds

T_S = 1_151_384_600.0
TOPICS = ("monopulse", "carrier_power", "sim/pointing_error")


def fly(bench: Any, target: str = "28057") -> None:
    """Let the antenna look at a satellite for a second."""
    track = load_track(SourceParams(satellite=target))
    for k in range(51):
        aim = track.target_at(T_S + 0.02 * k)
        message = Boresight(azimuth=aim.azimuth_rad, elevation=aim.elevation_rad)
        message.header.stamp = stamp_from_seconds(aim.t_s)
        bench.give("sim/boresight", message)


def test_samples_of_the_selected_satellite_are_published_while_the_node_is_active(
    make_bench: Callable[..., Any],
) -> None:
    bench = make_bench(RfReceiver)
    assert bench.step("configure")
    fly(bench)
    assert not any(bench.sent[topic] for topic in TOPICS)
    assert bench.step("activate")
    fly(bench)
    assert [len(bench.sent[topic]) for topic in TOPICS] == [10, 10, 10]
    error = bench.sent["sim/pointing_error"][-1]
    assert max(abs(error.cross_elevation), abs(error.elevation)) < 1e-3
    bench.give("passes", PassList(target=""), PassList(target="Moon"))
    fly(bench, "28057")
    other = bench.sent["sim/pointing_error"][-1]
    assert max(abs(other.cross_elevation), abs(other.elevation)) > 1e-2


def test_elements_that_were_never_fetched_refuse_the_configuration(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(RfReceiver, **{"source.elements": "https://example.invalid/never.tle"})
    assert not bench.step("configure")
    assert "never.tle" in bench.health("state").message
