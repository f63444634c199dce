"""Every drive with a simulated device behind it, stepped together."""

import math
import time
from collections.abc import Callable

from rf_pointing.drives import Drive, DriveParams, DriveReading, LinkParams, RotatorParams, make_drive
from test.drives.simulators import MODEL, Easycomm, Gs232, Rotctld, Simulator, Spid

TICK_S = 0.02
DEVICES: dict[str, Callable[[], Simulator]] = {
    "hamlib": Rotctld, "gs232": Gs232, "gs232 a": lambda: Gs232(b=False), "easycomm 2": Easycomm,
    "easycomm 3": lambda: Easycomm(version=3), "spid rot2": Spid, "spid md01": lambda: Spid("md01"),
}  # fmt: skip
BOTH_AXES = list(DEVICES)
"""Names: type of the drive, and its model or what the device is."""


def drive_params(name: str, device: Simulator, **changes: object) -> DriveParams:
    """Return the parameters of the drive `name` on this device; `changes` are those of its rotator."""
    type_, _, model = name.partition(" ")
    where = {"port": device.port} if isinstance(device, Rotctld) else {"device": device.device}
    link = LinkParams(host="127.0.0.1", first_retry_s=0.2, **where)
    rotator = RotatorParams(travel_max_rad=MODEL.travel_max_rad, rate_rad_s=MODEL.rate_rad_s).replace(**changes)
    return DriveParams(type=type_, model="" if model == "a" else model, link=link, rotator=rotator)


class Bench:
    """A device and its drive; `run` steps both."""

    def __init__(self, name: str, device: Simulator | None = None, **changes: object) -> None:
        self.device = device or DEVICES[name]()
        self.params = drive_params(name, self.device, **changes)
        self.drive: Drive = make_drive(self.params)
        self.t_s = 100.0
        self.readings: list[DriveReading] = []
        self.connect()

    def connect(self) -> None:
        """Step without time until the link is open: opening is the only thing that takes real time."""
        for count in range(500):
            # A controller whose dialect is to be recognised needs more than one poll.
            reading = self.tick(0.0 if count < 100 else TICK_S)
            if reading is not None and not self.drive.problem:
                return
            time.sleep(0.005)
        raise AssertionError(self.drive.problem)

    def tick(self, tick_s: float = TICK_S) -> DriveReading | None:
        self.t_s += tick_s
        self.device.step(self.t_s)
        reading = self.drive.step(self.t_s)
        if reading is not None and (not self.readings or reading is not self.readings[-1]):
            self.readings.append(reading)
        return reading

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        """Step; return the time that it took until the condition was true, or all of it."""
        begun_s = self.t_s
        while self.t_s < begun_s + seconds and not until():
            self.tick()
        return self.t_s - begun_s

    @property
    def degrees(self) -> tuple[float, float]:
        """What the drive reads."""
        azimuth, elevation = self.readings[-1].position_rad
        return math.degrees(azimuth), math.degrees(elevation)

    def close(self) -> None:
        self.drive.close()
        self.device.close()
