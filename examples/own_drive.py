"""A drive of one's own: what the control unit of `antenna_servo` needs to move an antenna.

Put it into a package of yours and register it there (setup.cfg), then set `drive.type: own_drive`:

    [options.entry_points]
    rf_pointing.drives =
        own_drive = my_package.own_drive:OwnDrive

`Servo` takes the place of your device's protocol.  Nothing here may wait: `step` is called 50 times
a second.  `scripts/run check_drive` says what is still missing.
"""

import math

from rf_pointing.drives import Capabilities, Drive, DriveParams, DriveReading

Pair = tuple[float, float]
RATE_RAD_S = math.radians(6.0)


class Servo:
    """An axis that follows its rate command at 20 rad/s; it stops when no command comes for 0.5 s."""

    def __init__(self) -> None:
        self.position, self.rate, self.command, self.commanded_s, self.t_s = 0.8, 0.0, 0.0, 0.0, 0.0

    def advance(self, t_s: float) -> None:
        dt_s, self.t_s = min(max(t_s - self.t_s, 0.0), 0.1), t_s
        wanted = self.command if t_s - self.commanded_s < 0.5 else 0.0
        self.rate += (1.0 - math.exp(-20.0 * dt_s)) * (wanted - self.rate)
        self.position += self.rate * dt_s


class OwnDrive(Drive):
    """Two servos that take rates; a device that takes positions has `go_to` in place of `turn`."""

    def __init__(self, _params: DriveParams) -> None:
        self.capabilities = Capabilities(
            set_points="rate", resolution_rad=(1e-5, 1e-5), rate_rad_s=(RATE_RAD_S, RATE_RAD_S), period_s=0.02
        )
        self._axes = Servo(), Servo()
        self._t_s = 0.0

    def step(self, t_s: float) -> DriveReading:
        self._t_s = t_s
        for axis in self._axes:
            axis.advance(t_s)
        azimuth, elevation = self._axes
        return DriveReading(
            t_s=t_s, position_rad=(azimuth.position, elevation.position), rate_rad_s=(azimuth.rate, elevation.rate)
        )

    def turn(self, rate_rad_s: Pair) -> None:
        for axis, rate in zip(self._axes, rate_rad_s, strict=True):
            axis.command, axis.commanded_s = rate, self._t_s

    def stop(self) -> None:
        self.turn((0.0, 0.0))
