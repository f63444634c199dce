"""The radio's brain: tuning within the passband, every reason against sending, the key, the line."""

import math
import os
import pty
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import pytest
from rf_pointing.core import SPEED_OF_LIGHT_M_S, Kinematics, Mode
from rf_pointing.drives.line_server import INVALID, IO_ERROR, REJECTED, Inquiry, Order
from rf_pointing.drives.rigctld import RECEIVE, TRANSMIT, RadioView
from rf_pointing.operations.partners import CONTACT_S
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.horizon import HorizonMask
from rf_pointing.station.description import read_station
from rf_pointing.station.pointing.status import Level
from rf_pointing.station.radio.control import RESTING, RadioControl
from rf_pointing.station.radio.inhibit import Antenna, InhibitParams, TransmitLine, TransmitRules
from test.station.radio.targets import target

EXAMPLE = Path(__file__).parents[3] / "examples" / "transponder_radio.yaml"
T_S, RATE_M_S = 1.8e9, 6500.0
BEAM_RAD = math.radians(30.0)
SUN_RAD = (math.radians(200.0), math.radians(40.0))


class FakeRig:
    """A rig that does at once what it is told."""

    def __init__(self, *_: Any, **given: bool) -> None:
        self.sends, self.split = given.get("sends", False), given.get("split", False)
        self.problem, self.keyed, self.answer_s, self.step_hz = "", False, 0.0, 0.0
        self.tuned_hz: dict[str, float] = {}
        self.refused: dict[str, str] = {}
        self.losses: dict[str, int] = {}
        self.deaf = self.closed = False

    def tune(self, command: str, hertz: float) -> None:
        self.tuned_hz[command] = hertz

    def key(self, on: bool, _t_s: float, reply: Callable[[int], object] = int) -> None:
        self.keyed = self.keyed if self.deaf else on
        reply(0)

    def step(self, _t_s: float) -> None: ...

    def close(self) -> None:
        self.closed = True


class Station:
    """A station that tracks RS-44 at azimuth 100 and elevation 50 deg, and its radio."""

    def __init__(self, line: str = "", **changes: Any) -> None:
        section = read_station(EXAMPLE).content.radio
        assert section is not None
        self.section = replace(section, transmit_line=line, **changes)
        mask = HorizonMask(
            azimuth_rad=(0.0, 1.0, 2.0), elevation_rad=(0.0, 0.0, math.radians(30.0))
        )
        rules = TransmitRules(InhibitParams(), self.section, ForbiddenSky(mask, math.radians(10.0)))
        self.rigs: list[Any] = []
        self.said: list[str] = []
        self.radio = RadioControl(self.section, rules, RadioView("x"), self.said.append, self.make)
        self.t_s, self.target, self.axes, self.sun = T_S, "RS-44", (100.0, 50.0), SUN_RAD
        self.inhibit = self.fault = self.partner = ""
        self.mode, self.tracked, self.error_deg = str(Mode.PROGRAM_TRACK), "RS-44", 1.0
        self.silent: set[str] = set()
        self.slope_m_s2 = 0.0
        for _ in range(30):
            self.step()

    def make(self, *given: Any, **more: Any) -> FakeRig:
        self.rigs.append(FakeRig(*given, **more))
        return self.rigs[-1]

    def step(self) -> None:
        self.t_s = round(self.t_s + 0.02, 6)
        wall_s, radio = self.t_s - T_S, self.radio
        rate_m_s = RATE_M_S + self.slope_m_s2 * (self.t_s + 2.0 - T_S)
        radio.note_target(target(self.t_s + 2.0, self.target, rate_m_s))
        messages: dict[str, dict[str, Any]] = {
            "joint_states": {"axes_rad": tuple(map(math.radians, self.axes))},
            "executive_status": {"shares": True, "executive_inhibit": self.partner},
            "antenna_status": {"inhibit": self.inhibit, "fault": self.fault},
            "tracking_status": {
                "mode": self.mode, "target": self.tracked, "error_rad": math.radians(self.error_deg),
                "beamwidth_rad": BEAM_RAD,
            },
        }  # fmt: skip
        for topic in messages.keys() - self.silent:
            radio.note(topic, wall_s, **messages[topic])
        radio.step(self.t_s, wall_s, self.sun)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.02)):
            self.step()

    def order(self, name: str, value: float) -> int:
        codes: list[int] = []
        self.radio.order(Inquiry(Order(name, (value,)), "1.2.3.4:5", 0.0, codes.append), self.t_s)
        return codes[0]

    @property
    def transmitter(self) -> Any:
        return self.rigs[-1]


@pytest.fixture
def station() -> Station:
    one = Station()
    one.run(2.5)
    return one


def test_both_rigs_follow_the_satellite_in_an_inverting_transponder(station: Station) -> None:
    q = RATE_M_S / SPEED_OF_LIGHT_M_S
    receiver, transmitter = station.rigs
    assert receiver.tuned_hz == {RECEIVE: round(435.640e6 * (1.0 - q))}
    assert transmitter.tuned_hz == {RECEIVE: round(145.965e6 * (1.0 - q) / (1.0 - 2.0 * q))}
    dial_hz = receiver.tuned_hz[RECEIVE] + 12_000.0
    assert station.order("set_freq", dial_hz) == 0
    station.step()
    assert receiver.tuned_hz[RECEIVE] == pytest.approx(dial_hz, abs=1.0)
    above = 12_000.0 / (1.0 - q)
    assert transmitter.tuned_hz[RECEIVE] == pytest.approx(
        (145.965e6 - above) * (1.0 + q + 2 * q * q), abs=1.0
    )
    assert station.order("set_split_freq", transmitter.tuned_hz[RECEIVE] + 12_000.0) == 0
    station.step()
    assert receiver.tuned_hz[RECEIVE] == pytest.approx(435.640e6 * (1.0 - q), abs=2.0), (
        "back in the middle"
    )


def test_a_tuning_outside_the_passband_and_one_without_a_satellite_are_refused(
    station: Station,
) -> None:
    before = dict(station.rigs[0].tuned_hz)
    assert station.order("set_freq", 435.72e6) == INVALID
    assert (
        "Hz from the middle of the passband of RS-44, must be within 30000 Hz" in station.said[-1]
    )
    station.step()
    assert station.rigs[0].tuned_hz == before
    station.target = "NOAA 19"
    station.run(2.2)
    assert station.order("set_freq", 435.64e6) == IO_ERROR
    report = station.radio.reports(None)["receiver"]
    assert (report.level, report.message) == (
        Level.WARN,
        "no frequency: NOAA 19 is not in radio.transponders",
    )
    assert station.radio.inhibit == "no uplink is known of NOAA 19 (radio.transponders)"


@pytest.mark.parametrize(
    ("answer_s", "words"),
    [(0.0, ""), (0.024, ""), (0.042, " in steps of 17 Hz at 1 GHz: the rig takes 42 ms for each")],
)
def test_a_rig_that_is_too_slow_for_the_doppler_is_named_and_tuned_to_the_middle_of_its_steps(
    station: Station, answer_s: float, words: str
) -> None:
    """400 Hz/s at 1 GHz."""
    receiver = station.rigs[0]
    receiver.answer_s, station.slope_m_s2 = answer_s, 120.0
    station.run(2.5)
    held_s = station.t_s + 0.5 * (answer_s + max(0.01, answer_s)) - T_S
    q = (RATE_M_S + 120.0 * held_s) / SPEED_OF_LIGHT_M_S
    assert receiver.tuned_hz[RECEIVE] == pytest.approx(435.640e6 * (1.0 - q), abs=0.6)
    assert station.radio.reports(None)["receiver"].message == f"follows RS-44{words}"


def test_one_rig_for_both_sides_is_tuned_in_split() -> None:
    receive = read_station(EXAMPLE).content.radio.receive
    station = Station(receive=receive, transmit=receive)
    station.run(2.5)
    assert len(station.rigs) == 1
    assert station.rigs[0].split
    assert station.rigs[0].sends
    assert set(station.rigs[0].tuned_hz) == {RECEIVE, TRANSMIT}


REASONS: dict[str, tuple[Callable[[Station], object], str]] = {
    "mode": (lambda s: setattr(s, "inhibit", "the antenna is stowed"), "the antenna is stowed"),
    "fault": (lambda s: setattr(s, "fault", "azimuth runaway"), "antenna fault: azimuth runaway"),
    "mask": (lambda s: setattr(s, "axes", (114.6, 25.0)), "below the horizon mask"),
    "Sun": (lambda s: setattr(s, "axes", (200.0, 45.0)), "from the Sun, must be >= 10.000 deg"),
    "pointing error": (lambda s: setattr(s, "error_deg", 16.0), "pointing error 16.000 deg exceeds 15.000 deg"),
    "slew": (lambda s: setattr(s, "mode", str(Mode.SLEW)), "the controller is not on a target: slew"),
    "another target": (lambda s: setattr(s, "tracked", "ISS"), "ISS is tracked, and the radio is on RS-44"),
    "sector": (lambda s: setattr(s, "axes", (30.0, 8.0)), "EIRP 26 dBW exceeds 20 dBW, allowed below 10 deg at azimuth 0"),
    "sector over the top": (lambda s: setattr(s, "axes", (210.0, 172.0)), "EIRP 26 dBW exceeds 20 dBW"),
    "silent antenna": (lambda s: s.silent.add("antenna_status"), "antenna_servo is silent"),
    "a partner": (lambda s: setattr(s, "partner", "gs1 has pass 7"), "gs1 has pass 7"),
    "silent executive": (lambda s: s.silent.add("executive_status"), "station_executive is silent: a partner may transmit"),
    "silent joints": (lambda s: s.silent.add("joint_states"), "antenna_servo (joint_states) is silent"),
    "silent controller": (lambda s: s.silent.add("tracking_status"), "pointing_controller is silent"),
    "rig": (lambda s: setattr(s.transmitter, "problem", "rigctld at localhost:4542: gone"), "rigctld at localhost:4542: gone"),
}  # fmt: skip


@pytest.mark.parametrize("name", REASONS)
def test_every_reason_refuses_the_key_and_unkeys_within_100_ms_of_its_message(
    station: Station, name: str
) -> None:
    assert station.order("set_ptt", 1.0) == 0
    station.run(0.1)
    assert station.transmitter.keyed
    assert station.radio.reason == ""
    change, words = REASONS[name]
    change(station)
    took_s = 0.0
    while station.transmitter.keyed and took_s < 3.0:
        station.step()
        took_s += 0.02
    # What is silent is missed after its silence.
    silence_s = {"silent executive": CONTACT_S}.get(name, 0.5 * name.startswith("silent"))
    assert took_s <= silence_s + 0.06
    assert words in station.radio.reason
    assert station.order("set_ptt", 1.0) == REJECTED
    assert "1.2.3.4:5: the key is refused: " in station.said[-1]
    assert not station.transmitter.keyed
    assert station.order("set_ptt", 0.0) == 0


def test_a_transmitter_keyed_at_its_microphone_is_unkeyed_and_one_that_sends_on_is_an_error(
    station: Station,
) -> None:
    station.inhibit = "the antenna is parked"
    station.step()
    station.transmitter.keyed = True
    station.step()
    assert not station.transmitter.keyed
    assert station.radio.unkeyed == 1
    station.transmitter.keyed = station.transmitter.deaf = True
    station.run(1.0)
    report = station.radio.reports(None)["transmit"]
    assert report.level == Level.ERROR
    assert report.message == "the transmitter sends although it may not: the antenna is parked"


def test_at_rest_nothing_is_sent_and_a_station_without_a_transmitter_never_sends(
    station: Station,
) -> None:
    assert station.order("set_ptt", 1.0) == 0
    station.radio.rest(station.t_s - T_S)
    assert not station.transmitter.keyed
    assert station.radio.reason == RESTING
    station.radio.note("antenna_status", station.t_s - T_S)
    assert station.radio.reason == RESTING, "a message does not wake it"
    station.radio.close()
    assert all(rig.closed for rig in station.rigs)
    deaf = Station(transmit=None)
    assert deaf.radio.reason == "the station has no transmitter (radio.transmit)"
    assert deaf.order("set_ptt", 1.0) == REJECTED


def test_the_line_of_a_gpio_is_high_exactly_while_the_transmitter_may_send(tmp_path: Path) -> None:
    pin = tmp_path / "value"
    pin.write_text("?\n")
    station = Station(line=str(pin))
    station.run(2.5)
    assert pin.read_text() == "1\n"
    station.error_deg = 40.0
    station.step()
    assert pin.read_text() == "0\n"
    pin.write_text("1\n")
    station.run(1.1)
    assert pin.read_text() == "0\n", "somebody else has set it"
    station.error_deg = 0.0
    station.step()
    assert pin.read_text() == "1\n"
    pin.unlink()
    station.run(1.1)
    report = station.radio.reports(None)["transmit"]
    assert report.level == Level.ERROR
    assert "the transmit line" in report.message
    assert "No such file" in report.message
    assert station.order("set_ptt", 1.0) == REJECTED
    pin.write_text("1\n")
    station.radio.close()
    assert pin.read_text() == "0\n"


class FakePort:
    """A serial port that notes what is done with it, unless its cable is pulled."""

    done: ClassVar[list[tuple[str, Any]]] = []
    pulled: ClassVar[bool] = False

    def __setattr__(self, name: str, value: Any) -> None:
        if self.pulled:
            raise OSError("Input/output error")
        self.done.append((name, value))

    def open(self) -> None:
        self.done.append(("open", True))

    def close(self) -> None:
        self.done.append(("open", False))


@pytest.mark.parametrize("name", ["rts", "dtr"])
def test_a_line_of_a_serial_port_never_goes_up_by_itself(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("serial.Serial", FakePort)
    monkeypatch.setattr(FakePort, "done", [])
    where, low, high = "/dev/ttyUSB1", (name, False), (name, True)
    opened = [("port", where), ("rts", False), ("dtr", False), ("exclusive", True), ("open", True)]
    line = TransmitLine(f"{where}:{name}")
    for t_s, allowed in enumerate((False, True, True, False, True)):
        line.step(allowed, 0.1 * t_s)
    assert FakePort.done == [*opened, low, high, low, high]
    monkeypatch.setattr(FakePort, "pulled", True)
    line.step(False, 1.0)
    assert line.problem == f"the transmit line {where}:{name} cannot be set: Input/output error"
    monkeypatch.setattr(FakePort, "pulled", False)
    FakePort.done.clear()
    line.step(False, 2.1)
    assert line.problem == ""
    line.step(True, 2.2)
    line.close()
    assert FakePort.done == [*opened, low, high, low, ("open", False)]


@pytest.fixture
def terminal() -> Iterator[str]:
    master, slave = pty.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_a_pipe_that_nobody_reads_and_a_port_without_such_a_line_do_not_hold_up_the_radio(
    tmp_path: Path, terminal: str
) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    # A pseudo terminal has no RTS.
    for where in (str(pipe), f"{terminal}:rts", "/dev/nothing:dtr"):
        line = TransmitLine(where)
        line.step(True, 1.0)
        assert line.problem.startswith(f"the transmit line {where} cannot be set: ")
        line.close()


@pytest.mark.parametrize("axes", [(0.2, 0.3), (-0.9, 0.4), (1.1, -0.2), (0.1, 1.1), (-1.35, -0.3)])
@pytest.mark.parametrize("mount", [
    Kinematics(type="x_y", lower_axis="east_west"), Kinematics(type="ha_dec", latitude_rad=-0.62),
], ids=lambda each: each.type)  # fmt: skip
def test_the_radio_of_another_mount_may_send_where_one_of_azimuth_and_elevation_may(
    mount: Kinematics, axes: tuple[float, float]
) -> None:
    """The mask, the Sun and the sectors are those of where the beam is, whatever the axes show."""
    section = replace(Station().section, eirp_sectors=((0.0, 360.0, 60.0, -100.0),))
    mask = HorizonMask(azimuth_rad=(0.0, 3.0), elevation_rad=(0.1, 0.5))
    sky = ForbiddenSky(mask, math.radians(10.0))
    heard = dict.fromkeys(("joint_states", "antenna_status", "tracking_status"), 0.0)
    level = Antenna(
        axes_rad=mount.sky_at(*axes), mode=str(Mode.PROGRAM_TRACK), target="a", heard_s=heard
    )
    for sun_rad in (None, mount.sky_at(axes[0] + 0.05, axes[1])):
        expected = TransmitRules(InhibitParams(), section, sky).reason(level, "a", sun_rad, 0.0)
        other = replace(level, axes_rad=axes)
        assert (
            TransmitRules(InhibitParams(), section, sky, mount).reason(other, "a", sun_rad, 0.0)
            == expected
        )
