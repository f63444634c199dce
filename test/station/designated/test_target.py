"""The antenna led by reports: nothing before two agree, never to a wrong place, only as certified."""

import json
import math
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rf_pointing.core import LOSS_OF_SIGNAL, JointReading
from rf_pointing.designate import Report
from rf_pointing.ephemeris import SITES, Site
from rf_pointing.planning import AxisLimits, HorizonMask
from rf_pointing.station.designated.params import DesignateParams
from rf_pointing.station.designated.target import DesignatedTarget

SITE, T_S, NAME = SITES["Goldstone DSS-13"], 1.8e9, "designated 3C6444"
MakeController = Callable[..., Any]


class Led:
    """A designated target, its truth in east, north, up of the site, and a controller on ideal axes."""

    def __init__(
        self, truth: Callable[[float], Any], controller: Any = None, kind: str = "aircraft",
        **params: Any,
    ) -> None:  # fmt: skip
        self.truth, self.controller = truth, controller
        self.target = DesignatedTarget(
            DesignateParams(kind=kind, **params), SITE, HorizonMask(), self.show, lambda: T_S
        )
        self.passes: list[Any] = []
        self.axes_rad, self.rate, self.latest = np.array([0.0, 0.5]), np.zeros(2), None
        self.t_s, self.begun = T_S, False

    def show(self, passes: list[Any], profiles: list[Any]) -> None:
        self.passes = passes
        if self.controller is not None:
            self.controller.take_profiles(profiles)

    def report(self, t_s: float, away_m: Any = (0.0, 0.0, 0.0), name: str = "3C6444") -> None:
        place = np.array(SITE.position_m) + (np.array(self.truth(t_s - T_S)) + away_m) @ np.array(
            SITE.axes
        )
        self.target.take(
            Report(t_s=t_s, name=name, position_m=place, covariance_m2=400.0 * np.eye(3))
        )

    def true_rad(self, t_s: float) -> tuple[float, float]:
        east, north, up = self.truth(t_s - T_S)
        return math.atan2(east, north), math.atan2(up, math.hypot(east, north))

    def run(
        self, seconds: float, away_m: Any = (0.0, 0.0, 0.0), *, reports: bool = True
    ) -> list[float]:
        """Report once a second and step ten times; return how far the axes are off the truth [rad]."""
        apart = []
        for _ in range(round(10.0 * seconds)):
            self.t_s = round(self.t_s + 0.1, 6)
            if reports and abs(self.t_s - round(self.t_s)) < 1e-6:
                self.report(self.t_s, away_m)
            self.target.step(self.t_s)
            if self.latest is not None:
                row = int(np.argmin(np.abs(self.latest.t_s - self.t_s)))
                self.axes_rad, self.rate = (
                    self.latest.position_rad[row],
                    self.latest.velocity_rad_s[row],
                )
            core = self.controller
            core.take_joints(
                JointReading(t_s=self.t_s, position_rad=self.axes_rad, velocity_rad_s=self.rate)
            )
            if (found := self.target.target_at(self.t_s)) is not None:
                core.take_target(found[0])
            self.latest = core.step(self.t_s)[0] or self.latest
            azimuth, elevation = self.true_rad(self.t_s)
            right = math.remainder(self.axes_rad[0] - azimuth, math.tau) * math.cos(elevation)
            apart.append(math.hypot(right, self.axes_rad[1] - elevation))
        return apart

    def begin(self) -> None:
        """Select the target, let the axes stand at it, and start its pass."""
        (window,) = self.target.select(NAME, self.t_s)
        self.axes_rad = np.array(
            [math.remainder(window.aos_azimuth_rad, math.tau), window.aos_elevation_rad]
        )
        core = self.controller
        core.take_joints(
            JointReading(t_s=self.t_s, position_rad=self.axes_rad, velocity_rad_s=np.zeros(2))
        )
        core.start(self.t_s, window, "program")


def flying_by(t: float) -> tuple[float, float, float]:
    """Return the place of an airliner at 10 km that turns north of the site at 2.5 deg/s."""
    if t < 60.0:
        return -20e3 + 220.0 * t, 15e3, 10e3
    angle = math.radians(min(t - 60.0, 60.0) * 2.5)
    radius = 220.0 / math.radians(2.5)
    after = max(t - 120.0, 0.0) * 220.0
    way = np.array([math.cos(angle), math.sin(angle)])
    turned = radius * np.array([math.sin(angle), 1.0 - math.cos(angle)]) + after * way
    return -6.8e3 + turned[0], 15e3 + turned[1], 10e3


def test_nothing_is_published_and_nothing_selected_before_two_reports_agree() -> None:
    led = Led(flying_by)
    with pytest.raises(
        ValueError, match="'designated 3C6444' is not known: two reports must agree first"
    ):
        led.target.select(NAME, T_S)
    led.report(T_S + 1.0)
    led.report(T_S + 2.0, away_m=(0.0, 0.0, 4e4))
    led.target.step(T_S + 2.0)
    with pytest.raises(ValueError, match="is not known"):
        led.target.select("designated", T_S + 2.0)
    assert led.target.target_at(T_S + 2.0) is None
    led.report(T_S + 3.0, away_m=(0.0, 200.0, 4e4))
    assert led.target.select("designated", T_S + 3.0)[0].name == NAME
    assert led.target.target_at(T_S + 3.0) is not None


def test_a_turning_aircraft_is_held_longer_than_any_of_its_certificates(
    make_controller: MakeController,
) -> None:
    """150 s of a flight that is known for two minutes at a time, to 0.5 deg also in its turn."""
    led = Led(flying_by, make_controller())
    led.run(3.0)
    led.begin()
    first_los_s = led.controller.window.los_t_s
    apart = led.run(150.0)
    assert led.controller.busy
    assert led.t_s > first_los_s
    assert led.controller.window.los_t_s > led.t_s + 60.0
    assert math.degrees(np.max(apart[50:])) < 0.5
    assert math.degrees(np.median(apart)) < 0.1
    stated = led.target.target_at(led.t_s)[1]
    assert 1e-3 < math.sqrt(np.trace(stated.covariance_rad2)) < 2e-2


def test_without_reports_the_pass_goes_on_as_predicted_and_ends_in_time(
    make_controller: MakeController,
) -> None:
    led = Led(lambda t: (-20e3 + 220.0 * t, 15e3, 10e3), make_controller())
    led.run(20.0)
    led.begin()
    led.run(30.0)
    before = led.target.target_at(led.t_s)[1].along_track_rad
    apart = led.run(60.0, reports=False)
    assert math.degrees(apart[-1]) < 3.0
    assert led.target.target_at(led.t_s)[1].along_track_rad > 3.0 * before
    led.run(120.0, reports=False)
    assert not led.controller.busy
    assert led.controller.statistics.reason == LOSS_OF_SIGNAL
    assert led.target.target_at(led.t_s) is None


def test_reports_that_jump_lead_nowhere_and_must_be_selected_again(
    make_controller: MakeController,
) -> None:
    led = Led(lambda t: (-20e3 + 220.0 * t, 15e3, 10e3), make_controller())
    led.run(20.0)
    led.begin()
    led.run(20.0)
    apart = led.run(60.0, away_m=(0.0, -3e4, 0.0))
    assert math.degrees(np.max(apart)) < 3.0
    assert "jumped by" in led.target.health(led.t_s).message
    led.run(130.0, away_m=(0.0, -3e4, 0.0))
    assert not led.controller.busy
    assert led.target.select(NAME, led.t_s)


def test_a_pass_ends_where_the_axes_would_have_to_unwind(make_controller: MakeController) -> None:
    """Circles round the station: after the travel of the azimuth there is no certificate."""

    def circling(t: float) -> tuple[float, float, float]:
        return 15e3 * math.sin(0.01 * t), 15e3 * math.cos(0.01 * t), 5e3

    limits = AxisLimits(azimuth_min_rad=math.radians(-170.0), azimuth_max_rad=math.radians(170.0))
    led = Led(circling, make_controller(limits=limits))
    led.run(10.0)
    led.begin()
    led.run(400.0)
    assert not led.controller.busy
    assert "no certificate beyond this time" in led.controller.statistics.reason
    assert "past the limit azimuth 170.0 deg" in led.controller.statistics.reason


def test_a_rocket_near_its_pad_is_refused_with_what_it_needs(
    make_controller: MakeController,
) -> None:
    """30 m/s^2 seen from 500 m: the axes would drag behind for half of the minute."""
    led = Led(lambda t: (0.0, 500.0, 50.0 + 15.0 * t**2), make_controller(), kind="rocket")
    led.run(4.0)
    with pytest.raises(
        ValueError,
        match=r"of the next 60 s would be lost: the target needs .* deg/s of elevation, the axis turns at 1.8",
    ):
        led.begin()
    assert led.latest is None


def test_a_table_has_the_certificate_of_its_whole_flight(
    tmp_path: Path, make_controller: MakeController
) -> None:
    file = tmp_path / "flight.csv"
    rows = [f"{T_S + t},{20.0 + 0.2 * t},{10.0 + 0.1 * t}" for t in range(300)]
    file.write_text("\n".join(["time,azimuth_deg,elevation_deg", *rows]))
    led = Led(flying_by, make_controller(), source=f"table:{file}", target="flight")
    led.target.step(T_S)
    (window,) = led.passes
    assert window.name == "designated flight"
    assert window.los_t_s - window.aos_t_s == pytest.approx(299.0)
    # Light takes 0.3 ms from the range that is assumed.
    assert math.degrees(window.aos_azimuth_rad) == pytest.approx(20.0, abs=1e-4)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        (
            {"source": "ogn:localhost:1"},
            "designate.source='ogn' must be one of adsb, sonde, mavlink, table",
        ),
        (
            {"source": "adsb:localhost"},
            "designate.source='adsb:localhost' must be adsb:HOST:PORT, or adsb:HOST:PORT/NAME",
        ),
    ],
)
def test_an_address_that_cannot_be_is_refused(params: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Led(flying_by, **params)


@pytest.mark.parametrize("age_s", [-3600.0, 11.0, math.nan])
def test_a_report_with_another_time_is_refused(age_s: float) -> None:
    led = Led(flying_by)
    late = Report(
        t_s=T_S - age_s, name="fix", position_m=np.array(SITE.position_m), covariance_m2=np.eye(3)
    )
    with pytest.raises(ValueError, match="old by the station's clock"):
        led.target.take_stamped(late, T_S)


def test_a_flood_of_names_does_not_push_out_the_selected_one() -> None:
    led = Led(flying_by)
    for second in (1.0, 2.0):
        led.report(T_S + second)
    led.target.select(NAME, T_S + 2.0)
    for number in range(2000):
        led.report(T_S + 2.0 + 1e-3 * number, name=f"F{number}")
    assert "3C6444" in led.target.known


def test_two_sources_of_one_target_are_fused() -> None:
    led = Led(flying_by, fused=True, target="vehicle")
    for number in range(20):
        led.report(T_S + 0.5 * number, name="adsb" if number % 2 else "7")
    led.target.step(T_S + 9.5)
    assert led.passes[0].name == "designated vehicle"
    assert not led.target.refused


def udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def test_a_sonde_and_a_drone_of_one_vehicle_come_by_udp_and_lead_to_where_it_is() -> None:
    dialect = pytest.importorskip("pymavlink.dialects.v20.common")
    sender, ports, now_s = (
        dialect.MAVLink(None, srcSystem=7, srcComponent=1), (udp_port(), udp_port()), [T_S],
    )  # fmt: skip
    latitude_deg, longitude_deg = (
        math.degrees(each) for each in (SITE.latitude_rad, SITE.longitude_rad)
    )
    passes: list[Any] = []
    target = DesignatedTarget(
        DesignateParams(
            kind="balloon", fused=True, target="vehicle",
            source=f"sonde:127.0.0.1:{ports[0]} mavlink:127.0.0.1:{ports[1]}",
        ),
        SITE, HorizonMask(), lambda found, _: passes.append(found), lambda: now_s[0],
    )  # fmt: skip

    def place(t_s: float) -> tuple[float, float, float]:
        """Return latitude, longitude and height: north of the station, rising by 5 m/s."""
        return latitude_deg + 0.1, longitude_deg, 9000.0 + 5.0 * (t_s - T_S)

    def sonde(t_s: float) -> bytes:
        north, east, height_m = place(t_s)
        return json.dumps({
            "type": "PAYLOAD_SUMMARY", "callsign": "S1", "latitude": north, "longitude": east, "altitude": height_m,
        }).encode()  # fmt: skip

    def drone(t_s: float) -> bytes:
        north, east, height_m = place(t_s)
        rows = round(1e7 * north), round(1e7 * east), round(1e3 * height_m), 0, 0, 0, -500, 0
        return bytes(sender.global_position_int_encode(0, *rows).pack(sender))

    try:
        target.step(now_s[0])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            begun_s, number, found = time.monotonic(), 0, None
            # Reports arrive when the reading threads have had them, so it goes on until 30 s are known.
            while (found is None or number < 60) and time.monotonic() - begun_s < 60.0:
                number, now_s[0] = number + 1, now_s[0] + 0.5
                out.sendto(
                    b"not JSON" if number == 20 else sonde(now_s[0]), ("127.0.0.1", ports[0])
                )
                out.sendto(drone(now_s[0]), ("127.0.0.1", ports[1]))
                sent_s = time.monotonic()
                while time.monotonic() - sent_s < 0.05:
                    target.step(now_s[0])
                    if target.health(now_s[0]).values.get("report_age_s") == 0.0:
                        break
                found = target.target_at(now_s[0])
        assert passes, target.health(now_s[0])
        assert passes[0][0].name == "designated vehicle"
        assert found is not None
        north, east, height_m = place(now_s[0] + 2.0)
        away = SITE.axes @ (
            np.array(Site.from_degrees(north, east, 0.0).position_m) - SITE.position_m
        )
        away += SITE.axes @ (height_m * np.array(Site.from_degrees(north, east, 0.0).axes[2]))
        published, uncertainty = found
        assert math.remainder(
            published.azimuth_rad - math.atan2(away[0], away[1]), math.tau
        ) == pytest.approx(0, abs=2e-3)
        assert published.elevation_rad == pytest.approx(
            math.atan2(away[2], math.hypot(*away[:2])), abs=2e-3
        )
        assert 0.0 < math.sqrt(np.trace(uncertainty.covariance_rad2)) < 0.05
    finally:
        target.end()
