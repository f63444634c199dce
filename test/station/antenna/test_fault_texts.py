"""Every fault of an antenna and its drive states what was measured and the bound that it exceeds."""

import dataclasses
import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from rf_pointing.controllers import OscillationDetector, OscillationDetectorParams
from rf_pointing.drives import DriveParams, DriveReading
from rf_pointing.planning import AxisWatch, AxisWatchParams, DriveWatch, DriveWatchParams, WrapCount
from rf_pointing.planning.position_watch import PositionLimits, PositionWatch
from rf_pointing.station.antenna.drive_antenna import DriveHardware
from test.drives.benches import Bench
from test.station.antenna.test_drive_hardware import RATES, Told
from test.station.driven_antenna import Driven

NUMBER = r"[-+]?\d+(?:\.\d+)?"
MEASURED = re.compile(rf"{NUMBER} (?:deg/s|deg|mdeg|s|m/s)\b|reads nan")
BOUND = re.compile(rf"(?:at most|must be <=|must be within|limit) {NUMBER} (?:deg/s|deg|mdeg|s|m/s)\b|must be a number")
TICK_S = 0.02


def watched(*samples: tuple[float, float]) -> str:
    """Return what the watch over the encoders says of these angles and rates of the azimuth."""
    watch, said = AxisWatch(AxisWatchParams(), TICK_S), ""
    for angle, rate in samples:
        said = watch.step((angle, 0.0), (rate, 0.0))[1] or said
    return said


def driven(*samples: tuple[float, float]) -> str:
    """Return what the watch over the drives says of these rates and commands of the azimuth."""
    watch, said = DriveWatch(DriveWatchParams(), TICK_S), ""
    for rate, command in samples:
        said = said or watch.step((rate, 0.0), (command, 0.0))
    return said


def polled(*samples: tuple[float, float]) -> str:
    """Return what the watch over a rotator says of these times and azimuths; its set point is 1 rad."""
    watch = PositionWatch(PositionLimits(resolution_rad=(1e-3, 1e-3), rate_rad_s=(0.1, 0.1)))
    said = ""
    for t_s, angle in samples:
        said = said or watch.step(t_s, (angle, 0.0), (1.0, 0.0), 0.2)[1]
    return said


def swinging(largest_rad: float) -> str:
    detector = OscillationDetector(OscillationDetectorParams(largest_rad=largest_rad))
    for step in range(600):
        detector.update(4e-3 * math.sin(2.0 * math.pi * step * TICK_S), TICK_S)
    return detector.reason


def silent(kind: str) -> str:
    bench = Bench(kind)
    bench.device.silent = True
    bench.run(3.0, lambda: bool(bench.drive.problem))
    said = bench.drive.problem
    bench.close()
    return said


def hardware(*azimuths: float) -> str:
    """Return the fault of a drive of one turn that reads these, lost before each, and then is silent."""
    drive = Told(dataclasses.replace(RATES, one_turn=True))
    subject = DriveHardware(drive, DriveParams(type="own"))
    for t_s, azimuth in enumerate(azimuths):
        drive.problem = "gone"
        subject.look(t_s - 0.01)
        drive.problem, drive.next = "", DriveReading(t_s=float(t_s), position_rad=(azimuth, 0.5))
        subject.look(float(t_s))
    for tick in range(100) if len(azimuths) == 1 else ():
        subject.look(tick * TICK_S)
    return subject.fault


def kept_turn(folder: Path) -> str:
    (folder / "wrap.json").write_text(json.dumps({"azimuth_rad": 1.0}))
    return WrapCount(folder / "wrap.json").recover(1.5)[1]


def beyond_the_limit() -> str:
    subject = Driven("gs232")
    gate = subject.antenna.safety.gate
    said = gate.hard((20.0, 0.5), (0.1, 0.0))
    subject.close()
    return said


FAULTS: dict[str, Callable[[Path], str]] = {
    "encoder without a number": lambda _: watched((0.0, 0.0), *[(math.nan, 0.0)] * 5),
    "jump of an encoder": lambda _: watched((0.0, 0.0), *[(1.0, 0.0)] * 5),
    "frozen encoder": lambda _: watched(*[(0.3, 0.004)] * 40),
    "drift of an encoder": lambda _: watched(*((1e-4 * tick, 0.0) for tick in range(20))),
    "tachometer without a number": lambda _: driven((0.0, 0.0), (math.nan, 0.0)),
    "rate gained": lambda _: driven(*((6e-4 * tick, 0.0) for tick in range(20))),
    "rate beyond the command": lambda _: driven((0.0, 0.0), *[(0.02, 0.0)] * 9),
    "rate beyond the machine": lambda _: driven((0.0, 1.0), *[(0.05, 1.0)] * 9),
    "jump of a rotator": lambda _: polled((0.0, 0.0), (0.2, 0.5), (0.4, 0.5)),
    "standstill of a rotator": lambda _: polled(*((0.2 * poll, 0.0) for poll in range(20))),
    "motion without a command": lambda _: polled(*((0.2 * poll, -0.02 * poll) for poll in range(20))),
    "oscillation": lambda _: swinging(1.0),
    "swing beyond any": lambda _: swinging(2e-3),
    "silence of a protocol": lambda _: silent("gs232"),
    "silence of a drive": lambda _: hardware(0.0),
    "motion of a lost drive": lambda _: hardware(0.0, 1.0),
    "turn in doubt": kept_turn,
    "hard limit": lambda _: beyond_the_limit(),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_states_value_and_bound(name: str, tmp_path: Path) -> None:
    said = FAULTS[name](tmp_path)
    assert said, "no fault"
    bound = BOUND.search(said) or re.search(rf"past the hard limit {NUMBER} deg", said)
    assert bound, said
    assert MEASURED.search(said.replace(bound.group(), "")), said
