"""Every shipped station flies a real pass on its own plant with its own default sensor."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.core import Mode, gaussian_gain
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.simulation import StationSetup, pass_simulation, simulate_pass
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.description import shipped_stations

SECONDS = 70.0
ACQUIRED_S = 25.0
# Mean loss that the beam of each station may have over the pass, dB: its scan costs 0.1.
LOSS_DB = {"dss13": 0.05, "leo_3m7": 0.2, "rotator_2m": 0.2, "vhf_uhf_yagi": 0.3}


@pytest.mark.parametrize("name", shipped_stations())
def test_a_shipped_station_holds_a_pass_with_its_default_sensor(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = StationSetup(name)
    epoch_t_s = load_elements(SourceParams()).epoch_t_s
    window = first_pass_above(plain.track(), epoch_t_s, math.radians(40.0), math.radians(30.0), 4.0 * 86400.0)
    window = dataclasses.replace(window, los_t_s=window.aos_t_s + SECONDS)
    start: dict[str, object] = {
        "antenna.start_azimuth_deg": math.degrees(window.aos_azimuth_rad),
        "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
    }
    antennas: list[SimulatedAntenna] = []

    def kept(setup: StationSetup) -> SimulatedAntenna:
        antennas.append(build(setup))
        return antennas[0]

    build = StationSetup.antenna
    monkeypatch.setattr(pass_simulation.StationSetup, "antenna", kept)
    setup = StationSetup(name, changes={"antenna_servo": start})
    log = simulate_pass(setup, window, window.aos_t_s - 5.0)
    antenna = antennas[0]
    assert antenna.safety.latch.text == ""
    assert antenna.mode == AntennaMode.TRACKING
    late = np.array(log.t_s) > window.aos_t_s + ACQUIRED_S
    wanted = Mode.PROGRAM_TRACK if setup.sensor == "program" else Mode(setup.sensor)
    assert set(np.array(log.mode)[late].tolist()) == {wanted}
    width_rad = math.radians(setup.node("pointing_controller").values["machine.half_power_beamwidth_deg"])
    offset = np.hypot(*log.errors_rad()[late].T)
    assert -10.0 * math.log10(float(np.mean(gaussian_gain(offset, width_rad)))) < LOSS_DB[name]
