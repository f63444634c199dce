"""The whole station in one call: monopulse holds an X-band beam that program track misses, and one seed fixes the run."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.calibration import BiasModel
from rf_pointing.core import MDEG
from rf_pointing.ephemeris import ElementUncertainty, Pass, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.tracking.power_tracker import PowerTracker

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


@pytest.mark.parametrize(
    ("node", "changes", "complaint"),
    [
        (
            "antenna_servo",
            {"wind.mean_speed_m_s": -3.0},
            r"^antenna_servo: wind\.mean_speed_m_s=-3\.0 must be >= 0\.0$",
        ),
        (
            "antenna_servo",
            {"mount.dropp_deg": 0.1},
            r"^antenna_servo: no such parameter mount\.dropp_deg; did you mean",
        ),
        ("rf_receiver", {"signal.seed": 1.5}, r"^rf_receiver: signal\.seed=1\.5 must be a whole number$"),
        ("pointing_controller", {"pointing.horizon_s": 0.2}, r"^pointing_controller: pointing\.horizon_s=0\.2 must be"),
    ],
)
def test_a_refused_parameter_names_node_and_key(
    window: Pass, node: str, changes: dict[str, float], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        simulate_pass(StationSetup(changes={node: changes}), window, window.aos_t_s, "program")


# The parts, with stand-ins


def test_a_setup_takes_the_station_then_files_then_changes_and_its_model(tmp_path: Path) -> None:
    file = tmp_path / "nodes.yaml"
    file.write_text(
        "/**/rf_receiver: {ros__parameters: {signal: {seed: 5}}}\n"
        "/**/antenna_servo: {ros__parameters: {antenna: {seed: 6}}}\n"
    )
    setup = StationSetup("dss13", files=[file], changes={"rf_receiver": {"signal.seed": 7}})
    assert setup.sets("rf_receiver")["signal"].seed == 7
    assert setup.sets("antenna_servo")["antenna"].seed == 6
    assert setup.band == setup.station.default_band
    assert StationSetup("dss13", "S").band == "S"
    file.write_text("/**/rf_receiver: {ros__parameters: {signal: {beam: {half_power_beamwidth_deg: 3.0}}}}\n")
    with pytest.raises(ValueError, match="half_power_beamwidth_deg is given by the station description"):
        StationSetup("dss13", files=[file])


def test_a_setup_has_the_model_of_its_station_unless_another_or_none_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    own = StationSetup("dss13", "X")
    assert own.model != BiasModel.zero()
    file = own.station.bias_model_file("X")
    assert StationSetup("dss13", "X", model=file).model == own.model
    assert StationSetup("dss13", "X", model=BiasModel.zero()).model == BiasModel.zero()
    assert StationSetup("leo_3m7").model == BiasModel.zero()
    taken: list[BiasModel] = []
    monkeypatch.setattr(PointingController, "take_model", lambda _, model: taken.append(model))
    own.controller()
    assert taken == [own.model]


def test_a_tracker_of_ones_own_is_that_of_the_setup_and_the_sensor_that_of_the_band() -> None:
    mine = object()
    assert StationSetup("dss13", "X", tracker=mine).power_tracker() is mine
    setup = StationSetup("dss13", "X")
    assert isinstance(setup.power_tracker(), PowerTracker)
    assert setup.sensor == setup.station.chosen_sensor(band="X")


def test_a_rotator_is_simulated_as_one_and_begins_where_it_is_said_to() -> None:
    changes = {"antenna_servo": {"antenna.start_azimuth_deg": 50.0, "antenna.start_elevation_deg": 20.0}}
    antenna = StationSetup("rotator_2m", changes=changes).antenna()
    assert isinstance(antenna, DriveAntenna)
    assert antenna.hardware.drive.truth_rad == pytest.approx(
        (math.radians(50.0), math.radians(20.0)), abs=math.radians(1.0)
    )
    plant = StationSetup("dss13").antenna()
    assert not isinstance(plant, DriveAntenna)
    # One whose control unit starts again keeps its hardware.
    assert StationSetup("dss13").antenna(plant.hardware).hardware is plant.hardware


def test_a_satellite_four_seconds_off_is_held_and_the_next_pass_begins_on_it(tmp_path: Path) -> None:
    """The first minutes of two passes 12 h apart; the law says 4 s both times."""
    station, file = rp.Station("leo_3m7", "X"), tmp_path / "learned.json"
    passes = station.passes(rp.elements("CBERS 2"), days=2, min_peak_deg=60.0)[:2]
    law = {"uncertainty.along_m": 30e3, "publisher.learned_file": str(file)}
    changes = {"ephemeris_publisher": law, "rf_receiver": {"source.along_track_offset_s": 4.0}}
    begun_mdeg = []
    for number, one in enumerate(passes, start=1):
        flown = station.simulate(one, sensor="conscan", minutes=4.0 if number == 1 else 2.0, changes=changes)
        times, errors = np.array(flown.log.t_s), np.hypot(*flown.errors_mdeg().T)
        inside = errors[times >= one.aos_t_s]
        assert np.mean(inside < 325.0) > 0.99
        assert "search" not in flown.seconds
        begun_mdeg.append(inside[5])
        if number == 1:
            assert flown.log.certificate.chosen.held_90_s == pytest.approx(234.0, abs=8.0)
            assert "+4.0" in flown.log.learned
            assert "from 1 pass" in flown.log.learned
    assert begun_mdeg[0] > 200.0
    assert begun_mdeg[1] < 100.0


def test_an_uncertain_target_is_acquired_in_the_wider_band_and_handed_over_without_a_search() -> None:
    """Four seconds off: 6 X-band beams at the rise, within the S-band beam's reach.  Elements of a day change nothing."""
    station = rp.Station("dss13", "X")
    one = station.passes(rp.elements("CBERS 2"), days=2, min_peak_deg=40.0)[0]
    start_deg = np.degrees(station.certificate(one).chosen.start_rad).tolist()
    changes = {
        "ephemeris_publisher": {"uncertainty.along_m": 4.0 * 7500.0},
        "rf_receiver": {"source.along_track_offset_s": 4.0},
        "antenna_servo": {"antenna.start_azimuth_deg": start_deg[0], "antenna.start_elevation_deg": start_deg[1]},
    }  # fmt: skip
    setup = station.setup(one, 1, changes)
    begin_s, words = math.floor(one.aos_t_s) - 5.0, []
    log = simulate_pass(
        setup, one.window, begin_s, "monopulse", enough=lambda log: log.t_s[-1:] > [one.aos_t_s + 12.0],
        on_signal=lambda topic, signal: words.append(signal.reason) if topic == "tracking_status" else None,
    )  # fmt: skip
    assert log.certificate is not None
    assert log.certificate.chosen is not None
    assert (log.certificate.acquisition_band, [band for _, band in log.bands]) == ("S", ["S", "X"])
    assert any(each.startswith("S band: ") for each in words)
    assert "the X band takes over" in words
    assert "search" not in log.mode
    held = np.hypot(*log.errors_rad()[np.array(log.t_s) > one.aos_t_s + 8.0].T) < HALF_BEAM_RAD
    assert held.all()
    # It promises what it holds, and far more than the X band alone could.
    assert one.duration_s - 60.0 < log.certificate.chosen.held_90_s < one.duration_s - 8.0
    del changes["ephemeris_publisher"]
    usual = station.setup(one, 1, changes).controller()
    usual.plan.take_profiles([pass_profile(setup.track(), one.window, law=ElementUncertainty())])
    usual.take_joints(setup.antenna().reading(begin_s))
    usual.start(begin_s, one.window, "monopulse")
    assert usual.plan.certificate is not None
    assert (usual.plan.certificate.acquisition_band, usual.wanted_band) == ("", "")
