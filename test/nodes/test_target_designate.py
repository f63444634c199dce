"""The node between its topics: fixes with a velocity, directions of a radar, what is selected and yields."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import TwistStamped
from rf_pointing_msgs.msg import PassList, Target
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import NavSatFix

from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.target_designate import TargetDesignate
from rf_pointing.ros.stamps import stamp_from_seconds
from test.nodes.test_ephemeris_publisher import NOW_S


@pytest.fixture
def make(make_bench: Callable[..., Any]) -> Callable[..., Any]:
    return lambda **given: make_bench(TargetDesignate, t_s=NOW_S, **given).up()


def radar(bench: Any, seconds: int) -> None:
    """Give a direction a second, of a target that rises in the north."""
    for _ in range(seconds):
        message = Target(azimuth=0.1, elevation=0.5 + 0.001 * (bench.t_s - NOW_S), range=5e4)
        message.header.stamp = stamp_from_seconds(bench.t_s)
        bench.give("designate/direction", message)
        bench.run(1.0)


def test_a_radar_leads_to_what_it_sees_and_another_selection_ends_it(make: Callable[..., Any]) -> None:
    bench = make(**{"designate.target": "direction"})
    radar(bench, 1)
    assert not bench.sent["target"]
    assert not bench.sent["passes"]
    radar(bench, 5)
    assert bench.sent["passes"][0].target == "designated direction"
    newest = bench.sent["target"][-1]
    assert newest.azimuth == pytest.approx(0.1, abs=2e-3)
    assert newest.elevation == pytest.approx(0.5 + 0.001 * (bench.t_s + 2.0 - NOW_S), abs=3e-3)
    assert len(newest.covariance) == 4
    count = len(bench.sent["target"])
    bench.give("passes", PassList(target="CBERS 2"))
    radar(bench, 3)
    assert len(bench.sent["target"]) == count
    answer = bench.call("~/select_target", SelectTarget.Request(target="designated direction"))
    assert (answer.success, answer.passes[0].target) == (True, "designated direction")
    refused = bench.call("~/select_target", SelectTarget.Request(target="designated nobody"))
    assert not refused.success
    assert "known: direction" in refused.message


def test_fixes_that_are_wrong_are_refused_and_counted(make: Callable[..., Any]) -> None:
    bench = make()
    for latitude, status, age_s in ((math.nan, 0, 0.0), (35.3, -1, 0.0), (35.3, 0, 60.0), (95.0, 0, 0.0)):
        message = NavSatFix(latitude=latitude, longitude=-116.8, altitude=9e3)
        message.status.status = status
        message.header.stamp = stamp_from_seconds(bench.t_s - age_s)
        bench.give("designate/fix", message)
    assert bench.health("inputs").values["refused designate/fix"] == "4"
    for _ in range(3):
        speed = TwistStamped()
        speed.twist.linear.x = 100.0
        message = NavSatFix(latitude=35.5, longitude=-116.8, altitude=9e3)
        speed.header.stamp = message.header.stamp = stamp_from_seconds(bench.t_s)
        bench.give("designate/velocity", speed)
        bench.give("designate/fix", message)
        bench.run(1.0)
    assert bench.call("~/select_target", SelectTarget.Request(target="designated")).success


def test_the_ephemeris_is_silent_while_another_leads(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(EphemerisPublisher, t_s=NOW_S).up()
    bench.run(1.0)
    count = len(bench.sent["target"])
    assert count
    bench.give("passes", PassList(target="designated 3C6444"))
    bench.run(1.0)
    assert len(bench.sent["target"]) == count
    bench.call("~/select_target", SelectTarget.Request(target="CBERS 2"))
    bench.run(1.0)
    assert len(bench.sent["target"]) > count
