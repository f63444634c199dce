"""Tuned loops: margins against python-control, error against brute force, refusals, a flight."""

import dataclasses
import json
import math
from pathlib import Path

import control
import numpy as np
import pytest
import yaml

import rf_pointing as rp
from benchmarks.tuning_trials import BOUNDS, WIND_M_S, random_plant
from rf_pointing.commands.tune import main
from rf_pointing.controllers import LqgDesign, PositionLoopParams
from rf_pointing.core import MDEG, flat
from rf_pointing.identification import StateSpace, load_models
from rf_pointing.servo import dss13_plant
from rf_pointing.station.antenna.axis_response import Variation
from rf_pointing.station.antenna.loops import AxisLoops, LoopParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna
from rf_pointing.station.antenna.tuning import (
    MOST_SENSITIVE,
    RESERVE,
    AxisModel,
    Problem,
    TunedAxis,
    identified_axis,
    judged,
    plant_axis,
    require_described,
    tuned_axis,
)

TICK_S = 0.02
FREQUENCY_HZ = np.geomspace(2e-3, 24.9, 6000)


def stated_margins_hold(axis: AxisModel, tuned: TunedAxis) -> None:
    """Hold the stated margins against python-control on the exact sampled axis."""
    plant = control.ss(*axis.nominal.sampled, TICK_S)
    loop = plant * control.ss(*tuned.law.matrices(TICK_S), TICK_S)
    assert np.max(np.abs(control.feedback(loop, 1).poles())) < 1.0 + 1e-6
    response = loop(np.exp(2j * np.pi * FREQUENCY_HZ * TICK_S))
    found = 1.0 / np.abs(1.0 + response)
    assert np.max(found) == pytest.approx(tuned.margins.peak_sensitivity, rel=0.02)
    assert np.max(found) < MOST_SENSITIVE
    phase_deg = np.degrees(np.unwrap(np.angle(response)))
    _, phase, *_ = control.stability_margins((np.abs(response), phase_deg, FREQUENCY_HZ))
    assert math.degrees(tuned.margins.phase_margin_rad) == pytest.approx(phase, abs=1.0)
    assert tuned.margins.phase_margin_rad >= 2.0 * math.asin(0.5 / MOST_SENSITIVE)
    assert tuned.margins.gain_margin_db >= 20.0 * math.log10(2.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_random_antenna_gets_its_margins_and_nearly_the_best_loop(seed: int) -> None:
    """A random search of 4000 loops finds none that is a fifth better within the same bounds."""
    random = np.random.default_rng(seed)
    axis = plant_axis(random_plant(random)[1], seed % 2, TICK_S)
    tuned = tuned_axis(axis, "pi", WIND_M_S)
    stated_margins_hold(axis, tuned)
    for variation in (Variation(0.93, 1.3), Variation(1.07, 0.7), *axis.play):
        moved = dataclasses.replace(axis, off=lambda _, moved=variation: axis.off(moved))
        assert judged(moved, tuned.law, WIND_M_S).margins.peak_sensitivity <= MOST_SENSITIVE
    problem = Problem(axis, WIND_M_S, MOST_SENSITIVE * RESERVE)
    low, high = np.transpose(BOUNDS)
    costs = [problem.cost("pi", random.uniform(low, high)) for _ in range(4000)]
    assert tuned.rms_s2_per_m_s < 1.2 * math.exp(min(costs))


def late_axis(delays: int, lag_s: float, mode_hz: float = 0.0) -> StateSpace:
    """Return an integrator behind a lag and samples of delay and a mode of a tenth of it."""
    angle, omega = control.tf([1.0], [1.0, 0.0]), 2.0 * math.pi * mode_hz
    if mode_hz:
        angle = angle + control.tf([-0.1, 0.0], [1.0, 0.02 * omega, omega**2])
    found = control.ss(control.c2d(control.ss(angle * control.tf([1.0], [lag_s, 1.0])), TICK_S))
    late = control.ss(control.tf([1.0], [1.0] + [0.0] * delays, TICK_S)) if delays else 1.0
    whole = found * late
    return StateSpace(whole.A, whole.B, whole.C, whole.D, TICK_S)


@pytest.mark.parametrize(("delays", "lag_s"), [(0, 0.05), (4, 0.1), (12, 0.2)])
def test_an_identified_axis_gets_its_margins_and_its_lag(delays: int, lag_s: float) -> None:
    axis = identified_axis("azimuth", late_axis(delays, lag_s))
    tuned = tuned_axis(axis, "pi", WIND_M_S)
    stated_margins_hold(axis, tuned)
    # A first-order lag, the samples of delay, and half a period of holding.
    assert tuned.lag_s == pytest.approx(lag_s + (delays + 0.5) * TICK_S, rel=0.02)


def test_an_identified_mode_moves_as_that_of_a_plant() -> None:
    """The mode of a model that is 10 % off peaks where that of a model made there does."""
    off = identified_axis("azimuth", late_axis(0, 0.05, 2.0)).off(Variation(1.1, 1.0))
    there = identified_axis("azimuth", late_axis(0, 0.05, 2.2)).off(Variation())
    peaks = []
    for one in (off, there):
        near = (one.frequency_hz > 1.9) & (one.frequency_hz < 2.6)
        peaks.append(one.frequency_hz[near][np.argmax(np.abs(one.command[near, 0]))])
    assert peaks[0] == pytest.approx(peaks[1], rel=0.01)
    assert np.max(np.abs(off.command[off.frequency_hz > 1.9])) == pytest.approx(
        np.max(np.abs(there.command[there.frequency_hz > 1.9])), rel=0.15
    )


def test_a_model_that_misses_a_mode_is_refused_with_its_frequency() -> None:
    true, poor = late_axis(0, 0.05, 3.0), late_axis(0, 0.05)
    hz = np.arange(0.02, 20.0, 0.01)
    measured = true.response(hz)[:, 0, 0]
    tuned = tuned_axis(identified_axis("elevation", poor), "pi", WIND_M_S)
    with pytest.raises(ValueError, match=r"elevation: the model of order 2 does not describe the axis at (2\.9|3\.0)"):
        require_described(tuned, hz, measured, poor)
    good = tuned_axis(identified_axis("elevation", true), "pi", WIND_M_S)
    require_described(good, hz, measured, true)
    with pytest.raises(ValueError, match="measured at 48 frequencies"):
        require_described(good, hz[3:52], measured[3:52], true)


def test_models_that_are_no_axis_are_refused() -> None:
    poles, ones = np.diag([1.0, 0.5, 1.01]), np.ones((3, 1))
    drifting = StateSpace(poles, ones, ones.T, np.zeros((1, 1)), TICK_S)
    with pytest.raises(ValueError, match=r"azimuth: the model grows by itself at 0\.00 Hz"):
        identified_axis("azimuth", drifting)
    still = StateSpace(np.array([[0.9]]), np.array([[-0.1]]), np.eye(1), np.zeros((1, 1)), TICK_S)
    with pytest.raises(ValueError, match="azimuth: pole nearest to the integrator"):
        identified_axis("azimuth", still)


def test_the_servo_refuses_a_law_whose_plant_has_moved() -> None:
    plant = dss13_plant()
    loops = LoopParams()
    kept = loops.replace(elevation=loops.elevation.replace(peak_sensitivity=1.81))
    AxisLoops(kept, plant, TICK_S)
    # A tenth is what it was tuned for; a quarter is another antenna, though still a stable one.
    for share, words in ((1.05, ""), (1.25, r"elevation: the plant is not the one .* peak of \d+\.\d+ at 2\.\d+ Hz")):
        modes = tuple(share * hz for hz in plant.elevation.mode_frequency_hz)
        moved = plant.replace(elevation=plant.elevation.replace(mode_frequency_hz=modes))
        AxisLoops(loops, moved, TICK_S)
        if words:
            with pytest.raises(ValueError, match=words):
                AxisLoops(kept, moved, TICK_S)
        else:
            AxisLoops(kept, moved, TICK_S)


@pytest.fixture(scope="module")
def tuning() -> rp.Tuning:
    return rp.tune(rp.Station("leo_3m7"))


def flown_mdeg(block: dict[str, object]) -> float:
    """Return the rms axis error of a minute in wind of 8 m/s, play and friction included."""
    changes = {**block, "wind.mean_speed_m_s": 8.0}
    sets = rp.Station("leo_3m7").description.sets("antenna_servo", None, changes)
    antenna = SimulatedAntenna(AntennaParams(**sets))
    antenna.enable()
    error = []
    for k in range(3000):
        antenna.step(round(1e9 + k * TICK_S, 6))
        error.append(antenna.reading(0.0).position_rad - antenna.status(0.0).commanded_rad)
    return float(np.sqrt(np.mean(np.square(error[500:])))) / MDEG


def test_the_block_is_one_of_a_description_and_better_on_the_whole_antenna(tuning: rp.Tuning) -> None:
    """Linear gains alone would swing across the play of the stiff mount, by 14 mdeg."""
    block = flat(yaml.safe_load(tuning.block())["tuning"])
    for tuned, before in zip(tuning.axes, tuning.before, strict=True):
        assert before is not None
        assert tuned.rms_s2_per_m_s < 0.5 * before.rms_s2_per_m_s
    assert flown_mdeg(block) < min(0.7, 0.8 * flown_mdeg({}))


def test_designs_of_an_own_antenna_are_made_and_taken(tmp_path: Path) -> None:
    station = rp.Station("leo_3m7")
    found = rp.tune(station, law="lqg")
    files = found.write(tmp_path)
    assert [file.name for file in files] == ["loops.yaml", "loops.png", "lqg.json"]
    block = flat(yaml.safe_load((tmp_path / "loops.yaml").read_text())["tuning"])
    assert block["loops.lqg_file"] == str(tmp_path / "lqg.json")
    sets = station.description.sets("antenna_servo", None, block)
    AxisLoops(sets["loops"], sets["plant"], TICK_S)
    for tuned in found.axes:
        assert isinstance(tuned.law, LqgDesign)
        assert tuned.worst_peak <= MOST_SENSITIVE
    late = sets["plant"].azimuth.replace(drive_delay_s=0.04)
    with pytest.raises(ValueError, match=r"azimuth: the plant is not the one that this law was tuned for"):
        AxisLoops(sets["loops"], sets["plant"].replace(azimuth=late), TICK_S)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "give a station, the models of identify_antenna, or both"),
        ({"models": "/nowhere.json"}, "/nowhere.json: no identified models"),
        ({"station": "vhf_uhf_yagi", "law": "pid"}, "law='pid' must be"),
        ({"station": "dss13", "wind_m_s": 0.1}, "wind_m_s=0.1"),
        ({"station": "vhf_uhf_yagi"}, "its drive takes positions and closes the loop itself"),
    ],
)
def test_requests_that_cannot_be_are_refused(given: dict, words: str) -> None:
    station = rp.Station(given.pop("station")) if "station" in given else None
    with pytest.raises(ValueError, match=words):
        rp.tune(station, **given)


def models_file(path: Path, error: float = 0.01, missed: float = 0.0) -> Path:
    """Write a planted azimuth as identify_antenna does, of which the model misses a share from 2 to 8 Hz."""
    model, hz = late_axis(2, 0.05, 3.0), np.arange(0.02, 20.0, 0.01)
    measured = model.response(hz)[:, 0, 0] * (1.0 + missed * ((hz > 2.0) & (hz < 8.0)))
    response = {name: getattr(model, name).tolist() for name in "abcd"} | {
        "input": "azimuth", "output": "azimuth", "sample_s": TICK_S, "error": error,
        "measured_hz": hz.tolist(), "measured_real": measured.real.tolist(), "measured_imag": measured.imag.tolist(),
    }  # fmt: skip
    path.write_text(json.dumps({"format": "rf_pointing identified models 2", "responses": [response]}))
    return path


def test_the_command_tunes_identified_models_and_leaves_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    models = models_file(tmp_path / "models.json")
    main([str(models), "--output", str(tmp_path / "tuned")])
    said = capsys.readouterr().out
    block = (tmp_path / "tuned" / "loops.yaml").read_text()
    assert said.endswith(block)
    assert (tmp_path / "tuned" / "loops.png").read_bytes().startswith(b"\x89PNG")
    loop = flat(yaml.safe_load(block)["tuning"])
    # Nobody knows here what plant the servo will have.
    assert loop["loops.azimuth.peak_sensitivity"] == 0.0
    for arguments, words in (
        ([str(models), "--law", "lqg", "--output", str(tmp_path)], "law=lqg: needs both axes, here is azimuth alone"),
        ([str(models_file(tmp_path / "poor.json", 0.3))], "azimuth: the model misses 30.0 % of the held-out motion"),
    ):
        with pytest.raises(SystemExit, match="2"):
            main(arguments)
        assert words in capsys.readouterr().err


def test_a_model_that_misses_what_a_fast_loop_meets_gets_a_slower_one(tmp_path: Path) -> None:
    fast, slow = (rp.tune(models=models_file(tmp_path / f"{missed}.json", missed=missed)) for missed in (0.0, 0.3))
    assert fast.remarks == ()
    assert slow.axes[0].margins.peak_sensitivity < 0.9 * fast.axes[0].margins.peak_sensitivity
    assert "slower than |S| <= 2 allows" in slow.remarks[0]
    with pytest.raises(ValueError, match="does not describe the axis"):
        rp.tune(models=models_file(tmp_path / "poor.json", missed=3.0))


def test_files_that_hold_no_models_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "models.json"
    head = '{"format": "rf_pointing identified models 2", "responses": '
    for text, words in (
        ("[]", "format must be 'rf_pointing identified models 2'"),
        ('{"format": "rf_pointing identified models 1"}', "format must be"),
        (head + "3}", "no identified models: TypeError"),
        (head + '[{"input": "azimuth", "output": "azimuth"}]}', "no identified models: KeyError"),
    ):
        path.write_text(text)
        with pytest.raises(ValueError, match=words):
            load_models(path)


def test_a_loop_without_filters_is_stated_as_one() -> None:
    """What the block says of a plain loop is what the parameters hold."""
    law = PositionLoopParams(proportional_gain=2.0, integral_gain=0.5, notch_enabled=False)
    axis = plant_axis(dss13_plant(), 0, TICK_S)
    assert judged(axis, law, WIND_M_S).lead_s == pytest.approx(axis.lag_s + 1.0 / (20.0 * math.pi))
