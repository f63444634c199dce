"""A replayed pass is the recorded one; other parameters give what a direct simulation with them gives."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import rf_pointing as rp
from rf_pointing.commands import replay as command
from rf_pointing.core import AXES, MDEG, Array, random_stream, sky_offset_rad
from rf_pointing.ephemeris import Pass
from rf_pointing.ephemeris.look_angles import LookAngles
from rf_pointing.servo import RecordedWind, Wind, WindParams, wind_torque_n_m
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.simulation.open_loop import RecordedTrack
from rf_pointing.simulation.recorded_gusts import estimated_gusts
from test.api.headless_bag import HeadlessBag

WIND_M_S, SEED, SECONDS, LEAD_S = 12.0, 3, 75.0, 20.0
GAINS = {"proportional_gain": 1.0, "integral_gain": 0.2}
SOFT = {"antenna_servo": {f"loops.{axis}.{name}": gain for axis in AXES for name, gain in GAINS.items()}}
"""Gains with which gusts move the 34-m antenna more than with its own of 7.9 and 11.6."""


@pytest.fixture(scope="module")
def window() -> Pass:
    """The top of a pass, 75 s that the antenna can follow."""
    station = rp.Station("dss13")
    one = station.passes(rp.elements("28057"), days=2.0, mask_deg=41.0, min_peak_deg=44.0)[0].window
    assert one.duration_s > SECONDS
    return replace(one, los_t_s=one.aos_t_s + SECONDS)


def setup_with(window: Pass, law: str = "pi", seed: int = SEED, **more: float) -> StationSetup:
    """Return the 34-m station in gusts, standing where the pass begins."""
    servo: dict[str, object] = {
        "antenna.start_azimuth_deg": math.degrees(window.aos_azimuth_rad),
        "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
        "antenna.seed": seed, "wind.mean_speed_m_s": WIND_M_S, "loops.law": law,
    }  # fmt: skip
    return StationSetup("dss13", "X", changes={"antenna_servo": servo | more, "rf_receiver": {"signal.seed": seed}})


@pytest.fixture(scope="module")
def flown(window: Pass) -> HeadlessBag:
    return HeadlessBag(setup_with(window), window, math.floor(window.aos_t_s) - LEAD_S, "monopulse")


@pytest.fixture(scope="module")
def bag(flown: HeadlessBag, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown.write(tmp_path_factory.mktemp("replay") / "run")


def code(*words: str | Path) -> int:
    """Return how the command ends."""
    with pytest.raises(SystemExit) as ended:
        command.main([*map(str, words)])
    return int(ended.value.code or 0)


def settled_rms(log_t_s: list[float], errors_rad: Array, since_s: float) -> Array:
    rows = errors_rad[np.array(log_t_s) > since_s]
    return np.asarray(np.sqrt(np.mean(rows**2, axis=0)) / MDEG)


def test_nothing_changed_is_the_recorded_pass_in_every_digest(bag: Path, tmp_path: Path) -> None:
    found = rp.replay(bag)
    assert [(each.loop, each.topic) for each in found.checks] == [
        ("open", "pointing_error"), ("open", "joint_trajectory"), ("open", "joint_states"),
        ("closed", "joint_states"), ("closed", "sim/pointing_error"),
    ]  # fmt: skip
    # The wire tells the time of the last sample of a cluster and their period, each rounded.
    wire, *others = found.checks
    assert [each.reason for each in others] == [""] * 4, str(found)
    assert "stamps in microseconds" in wire.reason
    assert wire.largest_mdeg < 0.02
    assert found.reproduced
    assert found.remarks == ()
    for each in found.metrics:
        assert each.recorded == each.before == each.after
        assert each.sigma == 0.0
    assert all(file.stat().st_size for file in found.write(tmp_path / "out"))


def test_other_gains_change_what_they_change_in_a_direct_simulation(
    bag: Path, flown: HeadlessBag, window: Pass, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = setup_with(window, **SOFT["antenna_servo"])
    soft = simulate_pass(changed, window, math.floor(window.aos_t_s) - LEAD_S, "monopulse")
    since_s = window.aos_t_s + 20.0
    direct = settled_rms(soft.t_s, soft.errors_rad(), since_s) - settled_rms(
        flown.log.t_s, flown.log.errors_rad(), since_s
    )
    assert direct[1] > 0.5
    # A folder is a suite, which does not pass where a metric gets worse.
    slow = tmp_path / "slow.yaml"
    slow.write_text(yaml.safe_dump({"/**/antenna_servo": {"ros__parameters": SOFT["antenna_servo"]}}))
    words = "--params", slow, "--allow", "rms elevation=0.0", "--output", tmp_path / "out"
    assert code(bag.parent, *words) == 1
    assert "rms elevation +" in capsys.readouterr().err
    kept = json.loads((tmp_path / "out" / "replay.json").read_text())["metrics"]
    # As by the seed, so by the wind that only the rate commands tell of.
    estimated = rp.replay(bag, params=SOFT, wind="estimated").metrics
    by_seed = {each["name"]: (each["difference"], each["sigma"]) for each in kept}
    for found in (by_seed, {each.name: (each.difference, each.sigma) for each in estimated}):
        for name, expected in zip(("rms cross-elevation", "rms elevation"), direct, strict=True):
            difference, sigma = found[name]
            assert abs(difference - expected) < 3.0 * sigma, found
        assert difference > 2.0 * sigma


@pytest.mark.parametrize("law", ["pi", "lqg"])
def test_planted_gusts_are_found_within_the_stated_error(window: Pass, law: str) -> None:
    start_s = math.floor(window.aos_t_s) - LEAD_S
    planted: list[Array] = []

    class Noted(Wind):
        def step(self, dt_s: float, azimuth_rad: float, elevation_rad: float) -> Array:
            planted.append(super().step(dt_s, azimuth_rad, elevation_rad))
            return planted[-1]

    setup = setup_with(window, law, seed=5)
    noted = StationSetup(
        setup.station, setup.band, changes=setup.changes, wind=lambda p: Noted(p, random_stream(5, "wind"))
    )
    found = estimated_gusts(setup, HeadlessBag(noted, window, start_s, "program").signals)
    truth, t_s = np.array(planted), start_s + 0.02 * np.arange(1, len(planted) + 1)
    # What began before the recording is not known in its first seconds.
    inner = (found.t_s > start_s + 15.0) & (found.t_s < found.t_s[-1] - 5.0)
    for axis in (0, 1):
        missed = (found.torque_n_m[:, axis] - np.interp(found.t_s, t_s, truth[:, axis]))[inner]
        assert np.sqrt(np.mean(missed**2)) < 1.5 * found.sigma_n_m[axis]
        assert found.sigma_n_m[axis] < np.sqrt(np.mean(truth[:, axis] ** 2))
    assert np.all(found.explained > 0.9)


@given(
    blows=st.tuples(st.floats(1.0, 30.0), st.floats(-3.0, 3.0)),
    beam=st.tuples(st.floats(-3.0, 3.0), st.floats(0.1, 1.5)),
)
def test_a_recorded_velocity_turns_the_axes_as_the_wind_of_that_direction(
    blows: tuple[float, float], beam: tuple[float, float]
) -> None:
    (speed, comes_from), to = blows, blows[1] + math.pi
    velocity = speed * np.array([[math.sin(to), math.cos(to)]])
    params = WindParams(from_azimuth_rad=comes_from)
    recorded = RecordedWind(WindParams(), 0.0, np.zeros(1), velocity_m_s=velocity)
    expected = wind_torque_n_m(params, speed, 0.0, *beam)
    assert recorded.step(0.02, *beam) == pytest.approx(expected, rel=1e-9, abs=1e-3)
    assert math.hypot(*recorded.speed_m_s) == pytest.approx(speed)


def test_a_recorded_target_is_the_one_that_was_sent_and_is_held_beyond_it(flown: HeadlessBag, window: Pass) -> None:
    track = flown.setup.track()
    recorded = RecordedTrack(flown.signals.of("target"), track)
    t_s = np.linspace(window.aos_t_s, window.los_t_s, 97)
    ours, true = recorded.sample(t_s), track.sample(t_s)
    for name in (each for each in LookAngles.__dataclass_fields__ if each.endswith(("_rad", "_rad_s", "_m"))):
        assert getattr(ours, name) == pytest.approx(getattr(true, name), abs=1e-8, rel=1e-8), name
    before = recorded.sample(np.array([window.aos_t_s - 1e3, window.aos_t_s - 500.0]))
    assert before.elevation_rad[0] == before.elevation_rad[1] == recorded.sample(t_s[:1] - 1e3).elevation_rad[0]
    moved = recorded.shifted(t_s, np.full((97, 2), 1e-3)).target_at(t_s[40])
    away = np.ravel(
        sky_offset_rad(moved.azimuth_rad, moved.elevation_rad, true.azimuth_rad[40], true.elevation_rad[40])
    )
    assert away == pytest.approx([1e-3, 1e-3], rel=2e-3)


def test_of_a_real_antenna_target_wind_and_errors_are_those_of_the_recording(
    flown: HeadlessBag, tmp_path: Path
) -> None:
    truth = ("sim/pointing_error",)
    found = rp.replay(flown.write(tmp_path / "real", without=truth, run=False))
    assert found.wind.startswith("estimated")
    assert any("no run.yaml" in each for each in found.remarks)
    assert any("servo not replayed alone" in each for each in found.remarks)
    # The recorded target is that of the elements to 1e-9 rad: the controller commands the same.
    assert all(each.largest_mdeg < 0.01 for each in found.checks), str(found)
    rms = found.metric("rms elevation")
    assert rms.source == "sensed"
    assert rms.recorded is not None
    assert rms.before == pytest.approx(rms.recorded, rel=0.5), str(found)


def test_what_is_missing_is_named_and_the_rest_replayed(flown: HeadlessBag, window: Pass, tmp_path: Path) -> None:
    hole_s = (window.aos_t_s + 20.0, window.aos_t_s + 24.0)
    broken = flown.write(tmp_path / "hole", without=("joint_trajectory", "carrier_power"), hole_s=hole_s)
    found = rp.replay(broken)
    text = "\n".join(found.remarks)
    assert "servo not replayed alone: no joint_trajectory" in text
    assert "trackers not replayed alone: no carrier_power" in text
    assert "joint_states has 1 gaps, the longest 4.0 s, 20 s after acquisition" in text
    assert [each.topic for each in found.checks if each.loop == "closed"] == ["joint_states", "sim/pointing_error"]
    with pytest.raises(ValueError, match="wind=measured: .* holds no weather/wind"):
        rp.replay(broken, wind="measured")
    with pytest.raises(ValueError, match="no such parameter loops.gain"):
        rp.replay(broken, params={"antenna_servo": {"loops.gain": 1.0}})
    nothing = flown.write(tmp_path / "nothing", without=("tracking_status",))
    with pytest.raises(ValueError, match="holds no tracking_status"):
        rp.replay(nothing)


def test_a_measured_wind_blows_and_a_suite_ends_with_a_verdict(
    flown: HeadlessBag, bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wind = [(each.t_s, 3.0, 4.0) for each in flown.signals.of("joint_states")[::50]]
    flown.write(tmp_path / "night", without=("sim/pointing_error",), wind=wind)
    # A disk that is full costs the files alone.
    (tmp_path / "full").write_text("")
    assert code(tmp_path / "night" / "bag", "--wind", "measured", "--output", tmp_path / "full") == 0
    shown = capsys.readouterr()
    assert "measured, mean 5.0 m/s; gusts of ±" in shown.out
    assert "not written" in shown.err

    def stop(*_given: object, **_named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "replay", stop)
    assert code(bag) == 130
    assert code(tmp_path / "empty") == 2
