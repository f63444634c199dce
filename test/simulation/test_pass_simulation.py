"""The whole station in one call: monopulse holds an X-band beam that program track misses, and one seed fixes the run."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.core import MDEG
from rf_pointing.ephemeris import Pass, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass

SETTLED_S = 35.0
"""After the jump onto a pass that is in full motion: the search, and the ringing of the paper's position loop (4 s)."""
HELD_RAD = 2.0 * MDEG
HALF_BEAM_RAD = 32.5 * MDEG


@pytest.fixture(scope="module")
def window() -> Pass:
    """Return the two minutes of the CBERS-2 pass above 40 deg, where the rates are largest."""
    source = SourceParams()
    epoch_t_s = load_elements(source).epoch_t_s
    return first_pass_above(load_track(source), epoch_t_s, math.radians(40.0), math.radians(40.0), 2.0 * 86400.0)


def station(window: Pass, model: BiasModel | None = None, seed: int = 1) -> StationSetup:
    """The simulated station, standing where the pass begins."""
    at_start: dict[str, object] = {
        "antenna.start_azimuth_deg": math.degrees(window.aos_azimuth_rad),
        "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
        "antenna.seed": seed,
    }
    changes: dict[str, dict[str, object]] = {"antenna_servo": at_start, "rf_receiver": {"signal.seed": seed}}
    return StationSetup("dss13", "X", changes=changes, model=model)


def settled(log: PassLog, window: Pass) -> np.ndarray:
    return log.errors_rad()[np.array(log.t_s) > window.aos_t_s + SETTLED_S]


def first_seconds(window: Pass, seconds: float) -> Pass:
    return dataclasses.replace(window, los_t_s=window.aos_t_s + seconds)


def test_monopulse_holds_the_target_within_two_millidegrees_where_program_track_misses_the_beam(window: Pass) -> None:
    held = simulate_pass(station(window), window, window.aos_t_s - 5.0, "monopulse")
    alone = simulate_pass(station(window), window, window.aos_t_s - 5.0, "program")
    rms = np.sqrt(np.mean(settled(held, window) ** 2, axis=0))
    assert np.all(rms < HELD_RAD), rms / MDEG
    late = np.array(held.t_s) > window.aos_t_s + SETTLED_S
    assert set(np.array(held.mode)[late].tolist()) == {"monopulse"}
    missed = np.hypot(*settled(alone, window).T)
    assert np.sqrt(np.mean(missed**2)) > HALF_BEAM_RAD
    assert len(held.t_s) == pytest.approx((window.duration_s + 5.0) * 10.0, abs=2)


def test_one_seed_fixes_every_noise_source(window: Pass) -> None:
    short = first_seconds(window, 6.0)
    first, again, other = (
        simulate_pass(station(window, seed=seed), short, window.aos_t_s - 2.0, "monopulse") for seed in (1, 1, 2)
    )
    assert first == again
    assert first.cross_elevation_rad != other.cross_elevation_rad


def test_the_pointing_model_moves_the_waiting_beam_by_the_mounts_errors(window: Pass) -> None:
    short = first_seconds(window, 1.0)
    start_s = window.aos_t_s - 30.0
    models = (None, BiasModel.zero())
    with_model, without = (simulate_pass(station(window, model), short, start_s, "program") for model in models)
    waiting = int(np.searchsorted(with_model.t_s, window.aos_t_s)) - 2
    moved = with_model.errors_rad()[waiting] - without.errors_rad()[waiting]
    assert np.hypot(*moved) > 100.0 * MDEG
    # At the instant of AOS the target passes where the antenna waits: what the model does not know is left.
    assert np.hypot(*with_model.errors_rad()[waiting]) < np.hypot(*without.errors_rad()[waiting])


def test_errors_can_be_chosen_by_mode() -> None:
    log = PassLog(
        t_s=[0.0, 0.1, 0.2],
        cross_elevation_rad=[1.0, 2.0, 3.0],
        elevation_rad=[4.0, 5.0, 6.0],
        mode=["slew", "monopulse", "conscan"],
    )
    assert log.errors_rad().shape == (3, 2)
    assert log.errors_rad("monopulse", "conscan").tolist() == [[2.0, 5.0], [3.0, 6.0]]
    assert log.errors_rad("coast").shape == (0, 2)


@pytest.mark.parametrize(
    ("node", "changes", "complaint"),
    [
        (
            "antenna_servo",
            {"wind.mean_speed_m_s": -3.0},
            r"^antenna_servo: wind\.mean_speed_m_s=-3\.0 must be >= 0\.0$",
        ),
        ("antenna_servo", {"mount.dropp_deg": 0.1}, r"^antenna_servo: mount\.dropp_deg: MountParams has no such"),
        ("rf_receiver", {"signal.seed": 1.5}, r"^rf_receiver: signal\.seed=1\.5 must be a whole number$"),
        ("pointing_controller", {"pointing.horizon_s": 0.2}, r"^pointing_controller: pointing\.horizon_s=0\.2 must be"),
    ],
)
def test_a_refused_parameter_names_node_and_key(
    window: Pass, node: str, changes: dict[str, float], complaint: str
) -> None:
    setup = StationSetup(changes={node: changes})
    with pytest.raises(ValueError, match=complaint):
        simulate_pass(setup, window, window.aos_t_s, "program")
