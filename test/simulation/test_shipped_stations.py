"""Every shipped station flies a real pass on its own plant with its own default sensor."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import pytest

from rf_pointing.core import Mode, gaussian_gain
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION
from rf_pointing.ephemeris import find_passes, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.description import read_station, shipped_stations
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.tracking.sensors import SENSOR_CHOICES

ACQUIRED_S = 25.0
# Mean loss that each station may have over the pass, dB: a scan costs 0.1.
LOSS_DB = {"dss13": 0.05, "geo_7m": 0.3, "leo_3m7": 0.2, "rotator_2m": 0.2, "ship_2m4": 0.2, "vhf_uhf_yagi": 0.3}


class Flight(NamedTuple):
    """What a pass has left."""

    log: PassLog
    antenna: SimulatedAntenna | DriveAntenna
    setup: StationSetup
    acquired: np.ndarray

    def mean_loss_db(self) -> float:
        """Return the loss of the mean power after the acquisition."""
        width_rad = self.setup.sets("pointing_controller")["machine"].half_power_beamwidth_rad
        offset = np.hypot(*self.log.errors_rad()[self.acquired].T)
        return -10.0 * math.log10(float(np.mean(gaussian_gain(offset, width_rad))))


def fly(
    name: str, band: str | None = None, sensor: str | None = None, seconds: float = 70.0,
    over: bool = False, **truth: object,
) -> Flight:  # fmt: skip
    """Return the top of a pass of CBERS-2, on an antenna that stands near its start, `over` the top or not.

    `truth` are parameters of antenna_servo and rf_receiver.
    """
    epoch_t_s = load_elements(SourceParams()).epoch_t_s
    track = StationSetup(name).track()
    window = first_pass_above(track, epoch_t_s, math.radians(40.0), math.radians(30.0), 4.0 * 86400.0)
    window = dataclasses.replace(window, los_t_s=min(window.los_t_s, window.aos_t_s + seconds))
    lowest_deg = read_station(name).content.mount.azimuth.travel_deg[0]
    azimuth_deg, elevation_deg = math.degrees(window.aos_azimuth_rad), math.degrees(window.aos_elevation_rad)
    if over:
        azimuth_deg, elevation_deg = azimuth_deg + 180.0, 180.0 - elevation_deg
    start: dict[str, object] = {
        "antenna.start_azimuth_deg": lowest_deg + (azimuth_deg - lowest_deg) % 360.0,
        "antenna.start_elevation_deg": elevation_deg,
    }
    changes = {"antenna_servo": start, "rf_receiver": dict[str, object]()}
    for key, value in truth.items():
        changes["rf_receiver" if key.startswith("source") else "antenna_servo"][key.replace("__", ".")] = value
    setup = StationSetup(name, band, changes=changes)
    antenna = setup.antenna()
    setup.antenna = lambda: antenna  # type: ignore[method-assign]
    log = simulate_pass(setup, window, window.aos_t_s - 5.0, sensor)
    return Flight(log, antenna, setup, np.array(log.t_s) > window.aos_t_s + ACQUIRED_S)


LEVEL = [name for name in shipped_stations() if read_station(name).content.mount.type == AZIMUTH_ELEVATION]
"""The others are flown in `test_other_mounts.py`."""


@pytest.mark.parametrize("name", LEVEL)
def test_a_shipped_station_holds_a_pass_with_its_default_sensor(name: str) -> None:
    flight = fly(name)
    assert flight.antenna.safety.latch.text == ""
    assert flight.antenna.mode == AntennaMode.TRACKING
    # Rotators fly as rotators: constant speed, whole steps, dead band.
    stepping = read_station(name).content.drive["type"] == "simulated_rotator"
    assert isinstance(flight.antenna, DriveAntenna) == stepping == (name in ("rotator_2m", "vhf_uhf_yagi"))
    sensor = flight.setup.sensor
    wanted = Mode.PROGRAM_TRACK if sensor == "program" else Mode(sensor)
    assert set(np.array(flight.log.mode)[flight.acquired].tolist()) == {wanted}
    assert flight.mean_loss_db() < LOSS_DB[name]


def test_conscan_of_a_3_7_m_dish_in_x_band_loses_less_than_0_2_db_in_wind() -> None:
    flight = fly("leo_3m7", "X", "conscan", seconds=110.0, wind__mean_speed_m_s=8.0)
    loss_db = flight.mean_loss_db()
    assert loss_db < 0.2
    # The scan itself takes its share, however well the target is held.
    assert loss_db > 0.09


@pytest.mark.parametrize("sensor", ["conscan", "steptrack"])
def test_a_scan_corrects_the_beam_over_the_top_too(sensor: str) -> None:
    """The mount's errors alone cost 0.2 to 0.35 dB here, and the scan at least 0.06 dB."""
    flight = fly("leo_3m7", "X", sensor, seconds=90.0, over=True)
    assert flight.log.certificate is not None
    assert flight.log.certificate.chosen is not None
    assert flight.log.certificate.chosen.plunge
    assert flight.mean_loss_db() < 0.13


def test_program_track_in_s_band_with_elements_half_a_second_wrong_loses_what_their_error_costs() -> None:
    flight = fly("leo_3m7", "S", "program", seconds=80.0, source__along_track_offset_s=0.5)
    # 0.5 s of the satellite's motion on the sky, 0.2 to 0.5 deg/s here, of a beam of 2.38 deg: at most 0.13 dB; the mount's own
    # errors, uncorrected, come on top.
    assert 0.02 < flight.mean_loss_db() < 0.3


AUTO = {"dss13": "auto", "geo_7m": "conscan", "leo_3m7": "conscan", "rotator_2m": "steptrack", "vhf_uhf_yagi": ""}
"""What `auto` means on each; "" where nothing can track."""


@pytest.mark.parametrize(("name", "band"), [(name, band) for name in AUTO for band in read_station(name).bands])
def test_every_sensor_of_every_band_has_a_certificate_and_every_other_is_refused(name: str, band: str) -> None:
    station, setup = read_station(name), StationSetup(name, band)
    track = setup.track()
    (window, *_) = find_passes(track, load_elements(SourceParams()).epoch_t_s, 2.0 * 86400.0, math.radians(25.0))
    for choice in SENSOR_CHOICES:
        if choice not in (*station.sensors(band), "program", *(("auto",) if AUTO[name] else ())):
            with pytest.raises(ValueError, match=f"sensor={choice}: {band} band of .* has .*program"):
                station.chosen_sensor(choice, band)
            continue
        sensor = station.chosen_sensor(choice, band)
        assert sensor == (AUTO[name] if choice == "auto" else choice)
        controller, start_s = setup.controller(), window.aos_t_s - 300.0
        controller.plan.take_profiles([pass_profile(track, window)])
        controller.take_joints(setup.antenna().reading(start_s))
        controller.start(start_s, window, sensor)
        chosen = controller.plan.certificate.chosen if controller.plan.certificate else None
        assert chosen is not None
        # What a scan costs is in it.
        if sensor == "array":
            # It sees the target wherever it is in the prior, and holds it but for its noise.
            assert 0.0 < chosen.mean_loss_db < 0.06
        else:
            assert chosen.mean_loss_db > (0.06 if sensor in ("conscan", "steptrack") else 0.0)


@pytest.mark.parametrize(("name", "sensor"), [("leo_3m7", Mode.CONSCAN), ("rotator_2m", Mode.STEPTRACK)])
def test_auto_tracks_with_what_the_feed_has(name: str, sensor: str) -> None:
    flight = fly(name, sensor="auto", seconds=40.0)
    assert set(np.array(flight.log.mode)[flight.acquired].tolist()) == {sensor}
