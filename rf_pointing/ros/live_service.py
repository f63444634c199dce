"""A service on a live station: moves by antenna_servo/go_to, brakes between them, levels meanwhile.

Every move releases the brakes, goes to a place and sets them.  The client has no rights that
another lacks: gate, wind and Sun are the control unit's, and what it refuses is reported and
tried again.  The state is on /diagnostics as `service`: the operator's page and alarms show it.
"""

import math
import time
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rf_pointing_msgs.msg import AntennaStatus, CarrierPower
from rf_pointing_msgs.srv import GoTo
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.core import JointReading, nearest_turn_rad
from rf_pointing.ros import convert
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.leased_services import OWNER, Caller
from rf_pointing.ros.live_pass import LiveLine
from rf_pointing.ros.qos import STATUS, WATCHED
from rf_pointing.ros.repeated_call import RepeatedCall
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_run import GraphRun
from rf_pointing.station.antenna.modes import BRAKE, RELEASE
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.service.keeper import ServiceDesk

STEP_S, KEEP_S, REPORT_S = 1.0, 600.0, 1.0
LEVEL_AGE_S = 3.0
# A refused move is tried again after this; one that does not arrive is given up.
AGAIN_S, LONGEST_MOVE_S = 60.0, 900.0
# The loops have led the axes there; a rotator of coarse steps comes no nearer after some seconds.
COMMANDED_RAD, SETTLED_S = 1e-4, 5.0


class LiveService:
    """Serves the targets of a desk with the station in the namespace of `run`.

    `own` are the parameters of its controller, `key` is the file that signs the calls, "" for none;
    `lowest_rad` the elevation below which a target is waited for.
    """

    def __init__(self, run: GraphRun, desk: ServiceDesk, own: ControllerParams, lowest_rad: float, key: str) -> None:
        self._run, self._desk, self._lowest_rad = run, desk, lowest_rad
        self._limits, self._mount = own.limits, own.kinematics
        self._caller = Caller(run.node, CommandKey(CommandKeyParams(command_key_file=key)))
        self._clients: dict[str, Any] = {}
        self._joints: JointReading | None = None
        self._status: AntennaStatus | None = None
        self._level: tuple[float, float] = -math.inf, 0.0
        self._steps: list[tuple[str, Any]] = []
        self._call: RepeatedCall | None = None
        self._begun_s = self._stepped_s = self._kept_s = self._after_s = -math.inf
        self._there_s, self._goal_rad = -math.inf, np.zeros(2)
        self._why = ""
        node = run.node
        node.create_subscription(JointState, "joint_states", self._on_joints, WATCHED)
        node.create_subscription(AntennaStatus, "antenna_status", lambda m: setattr(self, "_status", m), STATUS)
        node.create_subscription(CarrierPower, "carrier_power", self._on_power, WATCHED)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._line, self._reported_s = LiveLine(REPORT_S), 0.0

    def _on_joints(self, message: JointState) -> None:
        self._joints = convert.joints_from_message(message)

    def _on_power(self, message: CarrierPower) -> None:
        self._level = seconds_from_stamp(message.header.stamp), message.carrier_to_noise

    @property
    def ready(self) -> bool:
        """Whether antenna and axes are known."""
        return self._joints is not None and self._status is not None

    def serve(self, seconds: float = math.inf) -> None:
        """Serve until the user stops it, or for a time; the antenna rests with its brakes then."""
        self._run.until(lambda: self.ready, "joint_states and antenna_status")
        assert self._joints is not None
        ends_s = self._joints.t_s + seconds
        while not self._run.stopping and self._joints.t_s < ends_s:
            self._run.spin(0.05)
            self._turn(self._joints)
        self._desk.keep()

    def _turn(self, joints: JointReading) -> None:
        t_s, service = joints.t_s, self._desk.active(joints.t_s)
        self._go_on(t_s)
        if t_s - self._stepped_s < STEP_S:
            return
        # Simulated time may run many times faster than this loop.
        self._stepped_s = t_s
        assert self._status is not None
        moving = bool(self._steps) or self._call is not None or self._status.mode != AntennaStatus.MODE_DISABLED
        level_s, level_db = self._level
        level = level_db if t_s - level_s <= LEVEL_AGE_S and level_db > 0.0 else None
        beam = self._mount.sky_at(*joints.position_rad.tolist())
        if service.direction(t_s)[1] < self._lowest_rad:
            service.state = "waits below the horizon"
        elif t_s >= self._after_s:
            # The first move may begin in any mode: afterwards the brakes are set.
            goal = service.step(t_s, beam, level, moving=moving and service.starts.any())
            if goal is not None:
                self._move(t_s, goal)
        self._report(t_s)
        if t_s - self._kept_s > KEEP_S:
            self._kept_s, self._why = t_s, self._desk.keep() or self._why

    def _move(self, t_s: float, goal: tuple[float, float]) -> None:
        assert self._joints is not None
        first, second = self._mount.axes_at(*goal)
        first = nearest_turn_rad(first, float(self._joints.position_rad[0]))
        # The nearest turn of the cables that the travel allows.
        low, high = self._limits.azimuth_min_rad, self._limits.azimuth_max_rad
        turns = math.ceil((low - first) / math.tau) if first < low else -math.ceil((first - high) / math.tau)
        first += math.tau * turns if not low <= first <= high else 0.0
        request = GoTo.Request(azimuth=first, elevation=second)
        self._steps = [(RELEASE, Trigger.Request()), ("go_to", request), (BRAKE, Trigger.Request())]
        self._begun_s = self._there_s = t_s
        self._goal_rad = np.array([first, second])

    def _go_on(self, t_s: float) -> None:
        """Take the next step of a move where the one before is done."""
        assert self._status is not None
        assert self._joints is not None
        if self._call is not None:
            if not self._call.done():
                return
            answer, self._call = self._call.result(), None
            name, _ = self._steps.pop(0)
            # Resume is refused where nothing rests, which is what is wanted.
            self._why = "" if answer.success or name == RELEASE else f"{name}: {answer.message}"
            if self._why:
                self._after_s = t_s + AGAIN_S
                self._steps = self._steps[-1:] if name == "go_to" else []
            return
        if not self._steps:
            return
        name, request = self._steps[0]
        if name == BRAKE and not self._arrived() and t_s - self._begun_s < LONGEST_MOVE_S:
            return
        if name not in self._clients:
            kind = GoTo if name == "go_to" else Trigger
            self._clients[name] = self._caller.client(kind, f"{OWNER}/{name}")
        self._call = RepeatedCall(self._clients[name], self._caller.request(f"{OWNER}/{name}", request))
        self._call.done()

    def _arrived(self) -> bool:
        """Return whether the axes are where they were sent, or no nearer `SETTLED_S` after that."""
        assert self._status is not None
        assert self._joints is not None
        t_s = self._joints.t_s
        if np.max(np.abs(np.array(self._status.commanded) - self._goal_rad)) > COMMANDED_RAD:
            self._there_s = t_s
        off = np.max(np.abs(self._joints.position_rad - self._goal_rad))
        return bool(t_s - self._there_s > SETTLED_S or (t_s > self._there_s and off < COMMANDED_RAD))

    def _report(self, t_s: float) -> None:
        service = self._desk.active(t_s)
        starts = f"{service.starts.sum()} starts, {service.peaks} peaks"
        words = f"service of {service.name}: {service.state}; {starts}" + (f"; {self._why}" if self._why else "")
        self._line.show(lambda: words)
        if time.monotonic() - self._reported_s < REPORT_S:
            return
        self._reported_s = time.monotonic()
        level = DiagnosticStatus.WARN if self._why else DiagnosticStatus.OK
        own = f"{self._run.namespace.rstrip('/')}/service"
        values = [
            KeyValue(key="starts", value=str(service.starts.sum())),
            KeyValue(key="peaks", value=str(service.peaks)),
        ]
        status = DiagnosticStatus(
            level=level, name=f"{own[1:]}: service", message=words, hardware_id=own, values=values
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._status.header.stamp if self._status else message.header.stamp
        self._diagnostics.publish(message)
