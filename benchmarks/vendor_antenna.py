"""A vendor's antenna behind `drive: {type: topic, model: rate}`: a flexible 7-m mount in wind, 50 Hz.

    scripts/run-python benchmarks/vendor_antenna.py --ros-args -r __ns:=/gs1

Its plant has the modes of the 34-m antenna scaled to its dish, a dead time, play and gusts that no
station description knows of.  It stops by itself when no velocity has come for 0.5 s.
"""

import math
import time
from contextlib import suppress

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from rf_pointing.core import AXES
from rf_pointing.ros.qos import LATCHED, SET_POINT
from rf_pointing.servo import AntennaPlant, Wind, WindParams
from rf_pointing.station.derive.plants import MountAxis, plant_of

DISH_M, RATE_DEG_S, ACCELERATION_DEG_S2, BITS, WIND_M_S = 7.3, 3.0, 1.5, 20, 5.0
AZIMUTH_TRAVEL_DEG, ELEVATION_TRAVEL_DEG = (-270.0, 270.0), (0.0, 90.0)
SILENCE_S, PERIOD_S = 0.5, 0.02


def mount_axis(travel_deg: tuple[float, float]) -> MountAxis:
    lowest, highest = (math.radians(angle + sign * 2.0) for angle, sign in zip(travel_deg, (-1.0, 1.0), strict=True))
    return MountAxis(
        rate_rad_s=math.radians(RATE_DEG_S),
        acceleration_rad_s2=math.radians(ACCELERATION_DEG_S2),
        stop_rad=(lowest, highest),
        encoder_bits=BITS,
        backlash_rad=None,
    )


class VendorAntenna(Node):
    """Moves the plant with the newest velocities while enabled, and publishes what its encoders read."""

    def __init__(self) -> None:
        super().__init__("vendor_antenna")
        random = np.random.default_rng(7)
        axes = mount_axis(AZIMUTH_TRAVEL_DEG), mount_axis(ELEVATION_TRAVEL_DEG)
        self.plant = AntennaPlant(plant_of("flexible", DISH_M, axes, 20.0), random, np.radians([0.0, 45.0]))
        self.wind = Wind(WindParams(mean_speed_m_s=WIND_M_S, dish_diameter_m=DISH_M), random)
        self.rates, self.taken_s, self.enabled, self.newest_s = np.zeros(2), -math.inf, False, time.monotonic()
        self.plant.brake()
        self.state = self.create_publisher(JointState, "drive/state", 10)
        self.create_subscription(JointState, "drive/set_point", self.take, SET_POINT)
        self.create_subscription(Bool, "drive/enable", self.enable, LATCHED)
        self.create_timer(PERIOD_S, self.advance)

    def take(self, set_point: JointState) -> None:
        rates = dict(zip(set_point.name, set_point.velocity, strict=False))
        if set(rates) == set(AXES) and all(map(math.isfinite, rates.values())):
            self.rates, self.taken_s = np.array([rates[axis] for axis in AXES]), time.monotonic()

    def enable(self, enabled: Bool) -> None:
        self.rates, self.enabled = np.zeros(2), enabled.data
        if enabled.data:
            self.plant.release_brake()
        else:
            self.plant.brake()

    def advance(self) -> None:
        now_s = time.monotonic()
        late_s, self.newest_s = min(1.0, now_s - self.newest_s), now_s
        rates = self.rates if now_s - self.taken_s <= SILENCE_S else np.zeros(2)
        azimuth, elevation = self.plant.joints()
        self.plant.step(rates, self.wind.step(late_s, azimuth, elevation), late_s)
        message = JointState(name=list(AXES))
        message.position, message.velocity = self.plant.encoder_rad.tolist(), self.plant.velocity_rad_s.tolist()
        message.header.stamp = self.get_clock().now().to_msg()
        self.state.publish(message)


def main() -> None:
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(VendorAntenna())


if __name__ == "__main__":
    main()
