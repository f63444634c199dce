"""A scan of a running station: the goal of the controller, and the powers received meanwhile.

How far the beam was off the target follows from the encoders and the centre that the controller
commands, as for its trackers.
"""

from collections.abc import Callable
from typing import Any

from rf_pointing_msgs.action import Scan
from rf_pointing_msgs.msg import CarrierPower, PointingModel, TrackingStatus
from sensor_msgs.msg import JointState

from rf_pointing.calibration import BiasModel
from rf_pointing.ros import convert
from rf_pointing.ros.convert_calibration import model_from_message
from rf_pointing.ros.live_pass import LivePass
from rf_pointing.ros.qos import LATCHED, WATCHED
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_run import GraphRun
from rf_pointing.station.clients.scan_samples import ScanSamples


class LiveScan(LivePass):
    """One scan of the controller in the namespace of `run`.

    Attributes
    ----------
    samples : the powers with the beam's offsets.
    model : the bias model in force; `now_s`: time of the newest status, None before the first.
    """

    KIND, NAME = Scan, "scan"

    def __init__(self, run: GraphRun) -> None:
        super().__init__(run)
        self.samples, self.model = ScanSamples(), BiasModel.zero()
        self.now_s: float | None = None
        self.refused = 0

        def listen(kind: Any, name: str, take: Callable[[Any], object], qos: Any = WATCHED) -> None:
            def guarded(message: Any) -> None:
                try:
                    take(message)
                except ValueError:
                    # Counted: one bad message must not end a scan.
                    self.refused += 1

            run.node.create_subscription(kind, name, guarded, qos)

        power, joints = convert.power_from_message, convert.joints_from_message
        listen(CarrierPower, "carrier_power", lambda m: self.samples.take_power(power(m)))
        listen(JointState, "joint_states", lambda m: self.samples.take_joints(joints(m)))
        listen(TrackingStatus, "tracking_status", self._take_status)
        listen(PointingModel, "pointing_model", self._take_model, LATCHED)

    def _take_status(self, message: TrackingStatus) -> None:
        self.now_s = seconds_from_stamp(message.header.stamp)
        self.samples.take_status(*convert.scan_centre_from_message(message))

    def _take_model(self, message: PointingModel) -> None:
        self.model = model_from_message(message)
