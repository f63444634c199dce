"""An antenna on a ship: it holds the sky, coasts, stows, and does not look through the ship."""

import math

import numpy as np

from rf_pointing.core import Array, JointTrajectory
from rf_pointing.core.parameters import with_leaves
from rf_pointing.simulation import StationSetup
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

BEGIN_S, TICK_S, HELD_RMS_DEG = 1.7e9, 0.02, 0.05
LEVEL_RAD = np.radians([57.0, 34.0])


class Ship:
    """The shipped ship and a commander that holds one direction."""

    def __init__(self, **motion: float) -> None:
        sets = StationSetup("ship_2m4", "X").sets("antenna_servo")
        sets["base_motion"] = with_leaves(sets["base_motion"], motion)
        self.antenna, self.tick = SimulatedAntenna(AntennaParams(**sets)), 0
        self.antenna.enable()
        self.refused: set[str] = set()
        self.level_rad = LEVEL_RAD

    def hold(self, seconds: float) -> Array:
        """Command the direction for some seconds; return how far the beam was off it (n,) in deg."""
        off = []
        for _ in range(round(seconds / TICK_S)):
            t_s = round(BEGIN_S + TICK_S * self.tick, 6)
            _, beam = self.antenna.step(t_s)
            across = math.remainder(beam.azimuth_rad - self.level_rad[0], math.tau) * math.cos(self.level_rad[1])
            off.append(math.degrees(math.hypot(across, beam.elevation_rad - self.level_rad[1])))
            if self.tick % 5 == 0:
                times, still = t_s + 0.1 * np.arange(1, 11), np.zeros((10, 2))
                self.refused.add(
                    self.antenna.accept(
                        JointTrajectory(
                            t_s=times,
                            position_rad=still + self.level_rad,
                            velocity_rad_s=still,
                            acceleration_rad_s2=still,
                        ),
                        t_s,
                    )
                )
            self.tick += 1
        return np.array(off)


def test_a_ship_in_sea_state_5_holds_the_sky() -> None:
    """Within 0.05 deg rms, and the readings are those of a base at rest."""
    ship = Ship()
    ship.hold(8.0)
    off = ship.hold(10.0)
    assert float(np.sqrt(np.mean(off**2))) < HELD_RMS_DEG
    assert np.allclose(ship.antenna.reading(ship.antenna.t_s).position_rad, LEVEL_RAD, atol=math.radians(0.2))
    assert not ship.antenna.safety.latch.text


def test_without_its_imu_it_coasts_then_stows() -> None:
    """It goes on for the 2 s of the description, then stows and refuses commands, without a fault."""
    ship = Ship(lost_from_t_s=BEGIN_S + 8.0, lost_s=100.0)
    ship.hold(9.8)
    assert ship.antenna.mode == AntennaMode.TRACKING
    ship.hold(0.6)
    assert ship.antenna.mode == AntennaMode.STOWING
    status = ship.antenna.status(ship.antenna.t_s)
    assert "no attitude of the base for 2.4 s, at most 2 s" in status.warning
    assert "no attitude of the base" in status.transmit_inhibit or "stowing" in status.transmit_inhibit
    assert not ship.antenna.safety.latch.text


def test_it_does_not_look_through_its_funnel() -> None:
    """A target at 15 deg behind the funnel, 18 deg high: it waits above it, without a fault."""
    ship = Ship(heading_deg=237.0, roll_rms_deg=0.0, pitch_rms_deg=0.0, yaw_rms_deg=0.0)
    ship.level_rad = np.radians([57.0, 15.0])
    ship.hold(6.0)
    assert any("below the horizon mask" in reason for reason in ship.refused)
    assert float(np.degrees(ship.antenna.axes.encoder_rad[1])) > 17.9
    assert not ship.antenna.safety.latch.text
