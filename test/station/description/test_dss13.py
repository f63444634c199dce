"""`dss13` gives every node the numbers that the 34-m antenna has always had."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.calibration.model_file import read_model
from rf_pointing.core import Value, read_parameter_files
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.station.derive.nodes import reference
from rf_pointing.station.description import read_station

BEFORE = Path(__file__).parents[2] / "data" / "dss13"
"""The parameter files of the 34-m antenna before it had a description."""


@pytest.mark.parametrize("band", ["S", "X", "Ka"])
@pytest.mark.parametrize("node", ["antenna_servo", "pointing_controller", "ephemeris_publisher", "rf_receiver",
                                  "monopulse_tracker", "conscan_tracker"])  # fmt: skip
def test_dss13_gives_the_numbers_of_its_parameter_files(node: str, band: str) -> None:
    files = read_parameter_files([BEFORE / "dss13.yaml", BEFORE / f"band_{band.lower()}.yaml"])
    values = dict(files.get(node, {}))
    if node == "pointing_controller":
        # No file held it: `track` wrote it after the files.
        values["machine.half_power_beamwidth_deg"] = math.degrees(HALF_POWER_BEAMWIDTH_RAD[band])
    before = replace(reference(node), rows={}, given={name: Value(value, "") for name, value in values.items()})
    for prefix, found in read_station("dss13").sets(node, band).items():
        held = before.set_of(prefix)
        if prefix == "signal":
            # No file held what the power of a body takes: each band has its frequency and gain.
            held = replace(held, frequency_hz=found.frequency_hz, gain_dbi=found.gain_dbi)
        # No file held the drive: there was one.  In radians, bit for bit: a pass is recorded bit for bit.
        assert prefix == "drive" or found == held


def test_what_the_lock_watch_expects_of_wind_grows_with_the_dish_and_with_the_encoder_step(tmp_path: Path) -> None:
    """With the strengths of 34 m, a dish of 68.7 m had a false lock before its first second of monopulse was over."""
    own, larger = read_station("dss13"), tmp_path / "larger.yaml"
    own.write(larger, {"dish.diameter_m": 68.0, "bands.S.half_power_beamwidth_deg": 0.13,
                       "bands.X.half_power_beamwidth_deg": 0.034, "bands.Ka.half_power_beamwidth_deg": 0.009})  # fmt: skip
    names = ("watch.gust_deg", "watch.vibration_deg")
    for name in names:
        before, after = (
            np.array(station.parameters("pointing_controller", "X")[name]) for station in (own, read_station(larger))
        )
        assert after == pytest.approx(2.0**2.5 * before)
    steps_deg = read_station("rotator_2m").parameters("pointing_controller")[names[1]]
    assert steps_deg[1] == pytest.approx(0.1 / math.sqrt(12.0))


@pytest.mark.parametrize("band", ["S", "X", "Ka"])
def test_its_bias_models_stay_within_what_the_guards_of_sun_and_horizon_allow(band: str) -> None:
    station = read_station("dss13")
    file = station.bias_model_file(band)
    assert file is not None
    given = station.parameters("pointing_controller", band)
    apart_rad = read_model(file).model.departure()[0]
    assert math.radians(0.1) < apart_rad < math.radians(0.5 * given["machine.sun_radius_deg"])
    assert apart_rad < math.radians(given["mask.clearance_deg"])
