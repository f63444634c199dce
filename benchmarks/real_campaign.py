"""`calibrate` on a drive that is not simulated: Debian's rotctld, in real time, with a crooked dish on it.

    scripts/run-python benchmarks/real_campaign.py                   about half an hour
    scripts/run-python benchmarks/real_campaign.py --longest 900 --folder /var/tmp/campaign

The beam of the 2-m dish is offset from the rotator, and the station description does not contain the offsets.  A receiver
of the station's own reads the position of the rotator as a second client, and publishes the carrier power of the selected
satellite.  The satellites are synthetic and new.  Printed: what `calibrate` printed, and the fitted offsets with the true
ones.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import rclpy
from ephemeris import EPOCH_T_S, synthetic_catalogue
from rclpy.node import Node
from rf_pointing_msgs.msg import CarrierPower, PassList
from rotator_pass import SecondClient, start_rotctld

from rf_pointing.calibration import read_model
from rf_pointing.core import Boresight
from rf_pointing.ephemeris import TopocentricTrack, tle_lines
from rf_pointing.ephemeris.source import read_source
from rf_pointing.ros import convert
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.station.antenna.receiver import SimulatedReceiver
from rf_pointing.station.description import read_station

NAMESPACE = "/real_campaign"
START = "from rf_pointing.commands.calibrate import main; main()"
OFFSET_DEG = (0.35, -0.20)
"""Azimuth and elevation of the beam minus those of the rotator."""
STATION = Path(__file__).parents[1] / "examples" / "hamlib_rotator.yaml"


class OwnReceiver(Node):
    """Publishes the carrier power that the crooked dish receives, until it is stopped."""

    def __init__(self, station: Path, elements: Path, port: int) -> None:
        super().__init__("own_receiver", namespace=NAMESPACE)
        self._given, self._site = read_source(str(elements)).elements, read_station(station).site
        self._receiver: SimulatedReceiver | None = None
        self._signal = read_station(station).sets("rf_receiver", "S")["signal"]
        self._power = self.create_publisher(CarrierPower, "carrier_power", STREAM)
        self.create_subscription(PassList, "passes", self._on_passes, LATCHED)
        self._client, self._sent, self.stopping = SecondClient(port), 0, False

    def _on_passes(self, message: PassList) -> None:
        if message.target and (self._receiver is None or self._receiver.target != message.target):
            (one,) = (each for each in self._given if each.name == message.target)
            self._receiver = SimulatedReceiver(self._signal, TopocentricTrack(one, self._site))

    def work(self) -> None:
        index = math.ceil(time.time() / self._signal.sample_s)
        while not self.stopping:
            index += 1
            t_s = index * self._signal.sample_s
            time.sleep(max(0.0, t_s - time.time()))
            beam = self._client.read()[1] + np.radians(OFFSET_DEG)
            rclpy.spin_once(self, timeout_sec=0.0)
            reception = self._receiver.take(Boresight(t_s=t_s, azimuth_rad=beam[0], elevation_rad=beam[1])) \
                if self._receiver else None  # fmt: skip
            if reception is not None:
                message = convert.power_to_message(reception.power)
                message.sequence, self._sent = self._sent, self._sent + 1
                self._power.publish(message)


def satellites(path: Path, count: int, now_s: float) -> Path:
    """Write `count` low satellites of the synthetic catalogue, made anew today, and return the file."""
    low = [one for one in synthetic_catalogue(2 * count) if one.name.startswith("low")][:count]
    fresh = [replace(one, epoch_t_s=one.epoch_t_s - EPOCH_T_S + now_s) for one in low]
    path.write_text("".join("\n".join((one.name, *tle_lines(one))) + "\n" for one in fresh))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--longest", type=float, default=1200.0, help="length of the campaign in s (default: 1200)")
    parser.add_argument("--fewest", type=int, default=5, help="observations in each sector (default: 5)")
    parser.add_argument("--folder", type=Path, help="folder of models, bag and report")
    options = parser.parse_args()
    folder = options.folder or Path(tempfile.mkdtemp(prefix="campaign"))
    folder.mkdir(parents=True, exist_ok=True)
    server, port = start_rotctld()
    station = folder / "crooked.yaml"
    station.write_text(STATION.read_text().replace("port: 4533", f"port: {port}"))
    elements = satellites(folder / "low.tle", 150, time.time())
    rclpy.init()
    receiver = OwnReceiver(station, elements, port)
    thread = threading.Thread(target=receiver.work)
    thread.start()
    line = ["--station", str(station), "--elements", str(elements), "--sensor", "steptrack", "--namespace", NAMESPACE,
            "--longest", str(options.longest), "--fewest", str(options.fewest), "--shadow", "2",
            "--models", str(folder / "models"), "--output", str(folder / "run")]  # fmt: skip
    # A rotctld that begins at 0 is not where the last run has left it.
    own = {**os.environ, "XDG_STATE_HOME": str(folder / "state")}
    try:
        done = subprocess.run([sys.executable, "-c", START, *line], env=own, check=False)
    finally:
        receiver.stopping = True
        thread.join()
        server.kill()
        server.wait()
        rclpy.try_shutdown()
    print(f"exit code {done.returncode}")
    for path in sorted((folder / "models").rglob("*.yaml")):
        azimuth, elevation = np.radians([float(each) for each in np.arange(0.0, 360.0, 30.0)]), math.radians(40.0)
        still = [np.zeros(len(azimuth))] * 4
        axes = read_model(path).model.apply(azimuth, np.full(len(azimuth), elevation), *still)
        off = np.degrees([azimuth - axes[0], elevation - axes[1]])
        print(f"{path.name}: beam minus rotator at 40 deg, around the compass: azimuth {off[0].mean():+.3f} +- "
              f"{off[0].std():.3f}, elevation {off[1].mean():+.3f} +- {off[1].std():.3f} deg")  # fmt: skip
    print(f"the beam is off the rotator by azimuth {OFFSET_DEG[0]:+.2f}, elevation {OFFSET_DEG[1]:+.2f} deg")
    sys.exit(done.returncode)


if __name__ == "__main__":
    main()
