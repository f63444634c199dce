"""The live ephemeris publisher: offsets, hold and weather set while it runs, each read back, and other kinds of targets."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2", exc_type=ImportError)
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rf_pointing_msgs.msg import Target
from rf_pointing_msgs.srv import SelectTarget

from rf_pointing.core import Target as SkyTarget
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.ephemeris import ElementUncertainty, sky_uncertainty
from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.ros import convert
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from test.faults.clocks import ManualClock

pytestmark = pytest.mark.graph

MIDDLE_T_S = 1_151_384_600.0
"""In the middle of the first pass of CBERS-2 above 40 deg."""


class Publisher:
    """A live ephemeris_publisher on a clock told by hand."""

    def __init__(self, live: SimpleNamespace) -> None:
        self.live, self.clock = live, ManualClock(live, MIDDLE_T_S)
        self.targets: list[SkyTarget] = []
        self.message = Target()
        self.values: dict[str, str] = {}
        live.node.create_subscription(Target, "target", self._on_target, STREAM)
        live.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        started = live.start(["ephemeris_publisher"], state="configure", simulated=True)
        assert started.refused == []
        for _ in range(100):
            self.clock.run(0.1)
            if not started.client.change(["ephemeris_publisher"], "activate", 20.0):
                break
        assert self.clock.run(10.0, lambda: len(self.targets) > 3)

    def _on_target(self, message: Target) -> None:
        self.message = message
        self.targets.append(convert.target_from_message(message))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith("target"):
                self.values = {item.key: item.value for item in status.values}

    def ask(self, kind: Any, name: str, request: Any) -> Any:
        client = self.live.node.create_client(kind, f"ephemeris_publisher/{name}")
        future = None
        for _ in range(200):
            self.clock.run(0.1)
            if future is None and client.service_is_ready():
                future = client.call_async(request)
            if future is not None and future.done():
                self.live.node.destroy_client(client)
                return future.result()
        raise AssertionError(f"no answer of {name}")

    def set(self, name: str, value: float | bool | str) -> ParameterValue:
        """Set a parameter of the source and return what the node then says it is."""
        kinds = {
            bool: (ParameterType.PARAMETER_BOOL, "bool_value"),
            float: (ParameterType.PARAMETER_DOUBLE, "double_value"),
            str: (ParameterType.PARAMETER_STRING, "string_value"),
        }
        kind, field = kinds[type(value)]
        parameter = Parameter(name=f"source.{name}", value=ParameterValue(type=kind, **{field: value}))
        request = SetParametersAtomically.Request(parameters=[parameter])
        answer = self.ask(SetParametersAtomically, "set_parameters_atomically", request).result
        assert answer.successful, answer.reason
        read = self.ask(GetParameters, "get_parameters", GetParameters.Request(names=[parameter.name])).values[0]
        assert getattr(read, field) == value
        return read

    def newest(self) -> SkyTarget:
        self.targets.clear()
        assert self.clock.run(10.0, lambda: len(self.targets) > 1)
        return self.targets[-1]


def test_offsets_hold_and_weather_are_set_live_and_each_is_read_back(live: SimpleNamespace) -> None:
    node, plain = Publisher(live), SourceParams()
    sky = node.newest()
    assert sky.azimuth_rad == pytest.approx(load_track(plain).target_at(sky.t_s).azimuth_rad, abs=1e-9)
    published = node.message
    looks = load_track(plain).sample([seconds_from_stamp(published.header.stamp)])
    assert published.doppler_factor == pytest.approx(1.0 - looks.range_rate_m_s[0] / SPEED_OF_LIGHT_M_S, abs=1e-12)
    assert published.light_time == pytest.approx(looks.range_m[0] / SPEED_OF_LIGHT_M_S, rel=1e-9)
    assert published.refraction == pytest.approx(looks.elevation_rad[0] - looks.true_elevation_rad[0], abs=1e-9)
    assert published.refraction > 0.0
    expected = sky_uncertainty(load_track(plain), float(looks.t_s[0]), ElementUncertainty())
    assert list(published.covariance) == pytest.approx(expected.covariance_rad2.ravel().tolist(), rel=1e-6)
    assert published.along_track_sigma > published.cross_track_sigma > 0.0

    node.set("along_track_offset_s", 0.5)
    sky, late = node.newest(), load_track(plain.replace(along_track_offset_s=0.5))
    assert (sky.azimuth_rad, sky.elevation_rad) == pytest.approx(both(late.target_at(sky.t_s)), abs=1e-9)
    assert node.clock.run(5.0, lambda: node.values.get("along_track_offset_s") == "0.5")

    node.set("cross_track_offset_deg", 0.25)
    beside = load_track(plain.replace(along_track_offset_s=0.5, cross_track_offset_rad=math.radians(0.25)))
    sky = node.newest()
    assert (sky.azimuth_rad, sky.elevation_rad) == pytest.approx(both(beside.target_at(sky.t_s)), abs=1e-9)
    assert node.clock.run(5.0, lambda: node.values.get("cross_track_offset_deg") == "0.25")

    node.set("hold", True)
    first, second = node.newest(), node.newest()
    assert second.t_s > first.t_s
    assert (first.azimuth_rad, first.elevation_rad) == (second.azimuth_rad, second.elevation_rad)
    assert (second.azimuth_rate_rad_s, second.elevation_rate_rad_s) == (0.0, 0.0)
    assert node.clock.run(5.0, lambda: node.values.get("hold_since", "").startswith("2006-06-27T"))
    node.set("hold", False)
    node.set("refraction", "none")
    sky = node.newest()
    vacuum = load_track(
        plain.replace(along_track_offset_s=0.5, cross_track_offset_rad=math.radians(0.25), refraction="none")
    )
    assert (sky.azimuth_rad, sky.elevation_rad) == pytest.approx(both(vacuum.target_at(sky.t_s)), abs=1e-9)
    assert float(node.values["element_age_h"]) == pytest.approx(11.0, abs=12.0)
    assert float(node.values["along_track_sigma_deg"]) > float(node.values["cross_track_sigma_deg"]) > 0.0

    for name in ("Moon", "3C 84"):
        answer = node.ask(SelectTarget, "select_target", SelectTarget.Request(target=name))
        assert answer.success, answer.message
        assert answer.passes
        assert answer.passes[0].target == name
    answer = node.ask(SelectTarget, "select_target", SelectTarget.Request(target="Nemesis"))
    assert not answer.success
    assert "Nemesis" in answer.message


def both(target: SkyTarget) -> tuple[float, float]:
    return target.azimuth_rad, target.elevation_rad
