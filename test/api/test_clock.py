"""The clock of a station is found in its recorded passes, next to errors of elements."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rf_pointing as rp
from rf_pointing.api.clock import PassClock, common_s, known_sizes
from rf_pointing.api.misprediction import TimedPass
from rf_pointing.commands import check_clock as command
from rf_pointing.simulation import StationSetup
from test.api.headless_bag import HeadlessBag

SLOW_S, SECONDS = 0.037, 260.0


def clock_of(ahead_s: float) -> PassClock:
    return PassClock(
        bag="bag", target="A", t_s=1.15e9, ahead_s=ahead_s, sigma_s=1e-3, elements_s=0.0, axes_s=(math.nan, 0.02),
        periods_s={"joint_states": 0.01, "target": 0.1},
    )  # fmt: skip


NAMES = ("along_track_m", "cross_track_m", "radial_m", "clock_s", "collimation")
SIZES = np.array([200.0, 50.0, 50.0, 10.0, 1e-4])
SPEED_M_S = 7000.0


def equations(rng: np.random.Generator, planted: Sequence[float], noise_rad: float) -> TimedPass:
    """Return a pass whose clock and along-track error look the same."""
    partials = rng.normal(0.0, 1.0, (60, len(NAMES))) / 1e6
    partials[:, 3], partials[:, 4] = partials[:, 0] * SPEED_M_S, rng.normal(0.0, 1.0, 60)
    off = partials @ np.array(planted) + rng.normal(0.0, noise_rad, 60)
    return TimedPass(NAMES, partials, SIZES, off, noise_rad, math.nan, math.nan)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The rise of a pass, stamped by a clock that is slow."""
    one = rp.Station("dss13").passes(rp.elements("28057"), days=2.0, mask_deg=15.0, min_peak_deg=25.0)[0]
    window = replace(one.window, los_t_s=one.window.aos_t_s + SECONDS)
    # It waits where the pass begins.
    place = {
        "antenna.start_azimuth_deg": math.degrees(window.aos_azimuth_rad),
        "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
    }
    changes = {
        "rf_receiver": {"source.time_offset_s": SLOW_S, "source.along_track_offset_s": 0.0},
        "antenna_servo": place,
    }
    setup = StationSetup("dss13", "X", changes=changes)
    flown = HeadlessBag(setup, window, math.floor(window.aos_t_s) - 15.0, "monopulse")
    return flown.write(tmp_path_factory.mktemp("clock") / "run", without=("sim/pointing_error",))


def test_a_slow_clock_is_found_within_its_sigma(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = rp.check_clock([bag.parent / "no.mcap", bag])
    # A file that is missing is refused by name, and the others are used.
    assert list(found.refused) == [str(bag.parent / "no.mcap")]
    (one,) = found.passes
    # A clock that is fast by as much would be 74 ms away.
    assert abs(one.ahead_s - SLOW_S) < min(0.03, 3.0 * one.sigma_s)
    # Neither elements nor lags of the mount are known better than their priors.
    assert found.sigma_s > 0.95 * math.hypot(one.elements_s, found.measured_s)
    # One satellite alone: it may be ahead of its elements.
    assert not found.wrong
    assert "no error of the clock is seen" in str(found)
    with pytest.raises(SystemExit) as ended:
        command.main([str(bag.parent)])
    assert ended.value.code == 0
    assert "ms ahead" in capsys.readouterr().out


@given(st.floats(-2.0, 2.0), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_what_satellites_have_in_common_is_the_clock(slow_s: float, satellites: int, seed: int) -> None:
    rng, term, passes, targets = np.random.default_rng(seed), 1e-4, list[TimedPass](), list[str]()
    for number in range(satellites):
        along_m = rng.normal(0.0, SIZES[0])
        for _ in range(2):
            cross, radial = rng.normal(0.0, SIZES[1:3])
            passes.append(equations(rng, (along_m, cross, radial, slow_s, term), 1e-6))
            targets.append(f"satellite {number}")
    found_s, sigma_s, measured_s = common_s(passes, targets)
    assert abs(found_s - slow_s) < 6.0 * sigma_s
    # However many passes of a satellite there are, its elements stay as they are.
    assert sigma_s >= 0.99 * SIZES[0] / SPEED_M_S / math.sqrt(satellites)
    assert measured_s < 0.3 * sigma_s


@pytest.mark.parametrize(
    ("ahead_s", "named"),
    [(14.002, ["UTC from GPS time, 14 s"]), (-0.1, ["a sample of target, 0.1 s"]), (0.001, []), (0.06, [])],
)
def test_a_clock_is_named_by_its_size(ahead_s: float, named: list[str]) -> None:
    assert list(known_sizes([clock_of(ahead_s)], ahead_s, 1.5e-3, 1e-3)) == named


def test_without_a_recording_it_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="no recording"):
        rp.check_clock([])
    with pytest.raises(SystemExit) as ended:
        command.main([str(tmp_path)])
    assert ended.value.code == 2
    assert "holds no recording" in capsys.readouterr().err
