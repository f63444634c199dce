"""The certificate's expected loss is within 0.1 dB of the flown one: three bands, four sensors, once near the zenith.

`benchmarks/predicted_loss.py` flies more cases and prints both.
"""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.dish_array import DishArrayTracker, SimulatedDishArray
from rf_pointing.core.pass_outcome import PassOutcome
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.simulation import StationSetup, simulate_pass
from test.scripts import script_module

NEAR_DB = 0.1


@pytest.fixture(scope="module")
def script() -> Any:
    return script_module("benchmarks/predicted_loss.py")


@pytest.mark.parametrize("name", ["S,conscan,40", "S,steptrack,40", "Ka,monopulse,40", "X,monopulse,88"])
def test_the_flown_loss_is_the_predicted_one(script: Any, name: str) -> None:
    """Above 20 deg the acquisition is a larger share than of the whole pass, which the zenith needs: it costs 103 s."""
    setup, window, sensor, width_rad = script.case(name, {"S": 30.0, "Ka": 20.0, "X": 5.0}[name.partition(",")[0]])
    log = simulate_pass(setup, window, math.floor(window.aos_t_s) - script.LEAD_S, sensor)
    inside = (np.array(log.t_s) >= window.aos_t_s) & (np.array(log.t_s) <= window.los_t_s)
    flown = PassOutcome.of(np.hypot(*log.errors_rad().T)[inside], width_rad, script.CLUSTER_S)
    assert log.certificate is not None
    chosen = log.certificate.chosen
    assert chosen is not None
    print(f"{name}: predicted {chosen.mean_loss_db:.3f} dB, flown {flown.mean_loss_db:.3f} dB")
    assert abs(flown.mean_loss_db - chosen.mean_loss_db) <= NEAR_DB


@pytest.mark.parametrize("level_db_hz", [60.0, 56.0])
def test_an_array_costs_what_its_noise_does(level_db_hz: float) -> None:
    """90 s of a pass by the array alone; at 56 dB-Hz half of them have the least C/N0 that is valid."""
    flown, predicted = array_loss_db(level_db_hz, math.radians(20.0))
    print(f"array, {level_db_hz:.0f} dB-Hz: predicted {predicted:.3f} dB, flown {flown:.3f} dB")
    assert abs(flown - predicted) <= NEAR_DB
    # A certificate without the array's noise would say 0.00.
    assert 0.4 * flown < predicted < 2.5 * flown


def array_loss_db(level_db_hz: float, mask_rad: float) -> tuple[float, float]:
    """Return the loss that is flown from this elevation on, and the one that was predicted."""
    epoch_t_s = load_elements(SourceParams()).epoch_t_s
    track = StationSetup("rotator_2m").track()
    window = first_pass_above(track, epoch_t_s, math.radians(40.0), mask_rad, 4.0 * 86400.0)
    window = dataclasses.replace(window, los_t_s=window.aos_t_s + 90.0)
    changes = {
        "antenna_servo": {
            "antenna.start_azimuth_deg": (math.degrees(window.aos_azimuth_rad) + 180.0) % 360.0 - 180.0,
            "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
        },
        "rf_receiver": {"signal.link.zenith_carrier_to_noise_db_hz": level_db_hz},
        "pointing_controller": {"link.zenith_carrier_to_noise_db_hz": level_db_hz},
    }
    setup = StationSetup("rotator_2m", changes=changes)
    array = setup.sets("array_tracker")["array"]
    source, tracker = SimulatedDishArray(array, 1), DishArrayTracker(array)
    setup.array = lambda reception: tracker.measure(source.receive(reception.truth))
    log = simulate_pass(setup, window, window.aos_t_s - 5.0, "array")
    width_rad = setup.controller().corrections.half_power_beamwidth_rad
    flown = PassOutcome.of(np.hypot(*log.errors_rad().T)[np.array(log.t_s) >= window.aos_t_s], width_rad, 0.1)
    assert log.certificate is not None
    chosen = log.certificate.chosen
    assert chosen is not None
    return flown.mean_loss_db, chosen.mean_loss_db
