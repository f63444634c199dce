"""A drive that a package of one's own registers: found by its entry point, checked, and flown."""

import importlib.util
import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.commands import check_drive
from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import JointTrajectory
from rf_pointing.drives import DriveParams, RotatorParams, make_drive
from rf_pointing.drives.conformance import ConformanceCheck
from rf_pointing.drives.registry import known_types
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from test.station.driven_antenna import UNWATCHED, pass_path

EXAMPLE = Path(__file__).parents[3] / "examples" / "own_drive.py"
TICK_S = 0.02


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Install the example as a package would be."""
    info = tmp_path / "my_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my_package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[rf_pointing.drives]\nown_drive = own_drive:OwnDrive\n")
    (tmp_path / "own_drive.py").write_text(EXAMPLE.read_text())
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("own_drive", None)


PARAMS = DriveParams(
    type="own_drive", rotator=RotatorParams(travel_min_rad=(-math.pi, 0.0), travel_max_rad=(2.0 * math.pi, math.pi))
)


def test_the_example_has_at_most_sixty_lines_and_needs_no_ros() -> None:
    text = EXAMPLE.read_text()
    assert text.count("\n") <= 60
    assert "rclpy" not in text
    assert importlib.util.spec_from_file_location("own_drive", EXAMPLE) is not None


@pytest.mark.usefixtures("installed")
def test_an_installed_drive_is_found_by_its_name_and_passes_the_checks() -> None:
    assert "own_drive" in known_types()
    now = iter(range(100_000))
    check = ConformanceCheck(make_drive(PARAMS), PARAMS, lambda _: 0.02 * next(now))
    assert [str(line) for line in check_drive.check(check, move=True) if not line.passed] == []


@pytest.mark.usefixtures("installed")
def test_it_flies_a_pass_under_the_control_unit(track: TopocentricTrack, window: Pass) -> None:
    motion = CommandPreprocessorParams(
        rate_limit_rad_s=(math.radians(1.8),) * 2,
        travel_min_rad=PARAMS.rotator.travel_min_rad,
        travel_max_rad=PARAMS.rotator.travel_max_rad,
    )
    params = AntennaParams(drive=PARAMS, loops=LoopParams(preprocessor=motion), safety=UNWATCHED)
    antenna = DriveAntenna(params, make_drive(PARAMS), 0.0)
    antenna.enable()
    before_s = window.tca_t_s - window.aos_t_s - 20.0
    path = pass_path(track, window, 100.0 - before_s)
    errors = []
    for tick in range(1, round(140.0 / TICK_S)):
        t_s = round(TICK_S * tick, 6)
        reading, _ = antenna.step(t_s)
        if tick % 5 == 0:
            times = t_s + 0.1 * np.arange(1, 10)
            position, velocity = (
                np.array(part) for part in zip(*(path(max(at_s, 100.0)) for at_s in times), strict=True)
            )
            velocity *= (times > 100.0)[:, None]
            zero = np.zeros_like(velocity)
            assert antenna.accept(
                JointTrajectory(t_s=times, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=zero), t_s
            ) == ""  # fmt: skip
        assert reading is not None
        if t_s > 110.0:
            errors.append(reading.position_rad - path(t_s)[0])
    assert antenna.status(140.0).fault == ""
    assert 1e3 * math.degrees(np.max(np.abs(errors))) < 2.0, "mdeg"
