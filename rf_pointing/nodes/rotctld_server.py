"""Executable `rotctld_server`: the antenna as a rotator of Hamlib, for Gpredict, SatNOGS, SatDump.

Serves rotctld's protocol (`drives/rotctld.py`) on TCP port 4533 of this computer.  A client
names a place, or sends the points of a moving target.  Where the points are those of a satellite of
the ephemeris publisher's elements, that pass is tracked by `track_pass`, with its certificate:
turn, plunge, mask, limits and rates.  Other points are followed with the motion that they mean
(`station/pointing/client_points.py`), through the safety gate of the antenna like any commander.

Subscribes: joint_states, antenna_status, tracking_status, executive_status, pointing_model.
Publishes: joint_trajectory (10 Hz, while it follows points itself).
Uses: antenna_servo/go_to, park, resume; pointing_controller/stop;
ephemeris_publisher/select_target and its parameter source.elements; track_pass.
Parameters: server.* (address, port, clients), follow.* and match.* (what points mean), sensor,
identify, command_key_file (the key that signs joint_trajectory and calls).

One client steers at a time.  A client is refused while the executive runs a schedule, while
somebody else's pass is tracked, and while a fault is latched.
"""

import math
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any

import numpy as np
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus, PointingModel, TrackingStatus
from rf_pointing_msgs.srv import GoTo, SelectTarget
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory as TrajectoryMessage

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, JointTrajectory, Motion, nearest_turn_rad
from rf_pointing.core.parameters import NodeParameters
from rf_pointing.drives.rotctld import (
    IO_ERROR,
    REJECTED,
    TIMED_OUT,
    Inquiry,
    RotctldServer,
    ServerParams,
    StationView,
    direction_rad,
)
from rf_pointing.ephemeris import CatalogueSky
from rf_pointing.ephemeris.source import load_catalogue
from rf_pointing.planning import AxisLimits, HorizonMask, MachineParams
from rf_pointing.ros import convert, convert_calibration
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.graph import EXECUTIVE_STATUS
from rf_pointing.ros.leased_services import Caller
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.qos import COMMAND, LATCHED, STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.parameters import RotctldNodeParams
from rf_pointing.station.pointing.client_points import (
    ClientPoints,
    FollowParams,
    Match,
    MatchParams,
    azimuth_still_to_come,
    identify,
    on_track,
    raised,
    turn_for,
)
from rf_pointing.station.pointing.prediction import axis_motion
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers

PERIOD_S = 0.1
AHEAD_S = np.arange(1, 11) * PERIOD_S
SILENT_S = 2.0
"""Wall time after which an antenna that publishes nothing is not there."""
SERVICE_S = 2.5
LEASE_S = 10.0
"""After its last command a client that is still connected keeps others from steering."""
RELOAD_S = 600.0
AGAIN_S = 120.0
"""A pass that was refused is not tried again for so long."""
SAME_RAD = math.radians(0.005)
MOVING_RAD_S = 1e-4
STRAYS = 2
"""Points in a row off the track of the pass in hand that end it."""
Reply = Callable[[int], None]


class RotctldServerNode(StationNode):
    """Carries out what clients ask, one at a time, with the other nodes of its namespace."""

    def __init__(self) -> None:
        super().__init__("rotctld_server")
        load_trackers()
        self.parameters.declare("", RotctldNodeParams())
        self.parameters.declare("", CommandKeyParams(), group="key")
        self.parameters.declare("server", ServerParams())
        self.parameters.declare("follow", FollowParams())
        self.parameters.declare("match", MatchParams())
        self._server: RotctldServer | None = None
        self._inbox: SimpleQueue[Inquiry] = SimpleQueue()
        self._words: deque[str] = deque(maxlen=20)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="elements")

    def configure(self) -> None:
        value = self.parameters.value
        assert self.station is not None
        if value("").sensor not in SENSOR_CHOICES:
            raise ValueError(f"sensor={value('').sensor} must be one of {', '.join(SENSOR_CHOICES)}")
        rules = NodeParameters("pointing_controller", self.station.parameters("pointing_controller", self.band))
        self._limits: AxisLimits = rules.group("limits", AxisLimits())
        self._mask: HorizonMask = rules.group("mask", HorizonMask())
        self._stop_rad_s2 = rules.group("machine", MachineParams()).axes.acceleration_rad_s2
        self._follow, self._match_params = value("follow"), value("match")
        self._points = ClientPoints(self._follow)
        self._model: BiasModel | None = None
        self._joints: JointReading | None = None
        self._antenna, self._antenna_wall_s = AntennaStatus(), -math.inf
        self._tracking, self._executive = TrackingStatus(), ExecutiveStatus(state="idle")
        self._sky: CatalogueSky | None = None
        self._elements: str | None = None
        self._loading: Future[CatalogueSky] | None = None
        self._loaded_wall_s, self._problem = -math.inf, ""
        self._waiting: list[tuple[Any, Callable[[Any], None], float, Reply]] = []
        self._steering, self._steered_wall_s = "", -math.inf
        self._azimuth_rad: float | None = None
        self._place: np.ndarray | None = None
        self._place_due = self._parked_here = False
        self._refusal, self._rejected = "", 0
        self._match: Match | None = None
        self._goal: Any = None
        self._sent_before = 0
        self._certified = False
        self._strays = 0
        self._refused: dict[int, float] = {}
        self._view = StationView(f"rf_pointing {self.station.name}")
        self._connect()
        self.diagnostics.add("clients", self._health)

    def _connect(self) -> None:
        self._commands = self.publisher(TrajectoryMessage, "joint_trajectory", COMMAND)
        self._key = CommandKey(self.parameters.value("key"), self.resolve_topic_name("joint_trajectory"))
        self._latest = self.listen_latest(JointState, "joint_states", convert.joints_from_message, STREAM)
        self.listen(AntennaStatus, "antenna_status", self._on_antenna, STATUS)
        self.listen(TrackingStatus, "tracking_status", self._on_tracking, STREAM)
        self.listen(ExecutiveStatus, EXECUTIVE_STATUS, lambda m: setattr(self, "_executive", m), STATUS)
        self.listen(PointingModel, "pointing_model", self._on_model, LATCHED)
        triggers = ("antenna_servo/park", "antenna_servo/resume", "pointing_controller/stop")
        kinds = {"antenna_servo/go_to": GoTo, "ephemeris_publisher/select_target": SelectTarget,
                 "ephemeris_publisher/get_parameters": GetParameters, **dict.fromkeys(triggers, Trigger)}  # fmt: skip
        self._caller = Caller(self, self._key)
        self._called = {name: self._caller.client(kind, name) for name, kind in kinds.items()}
        for client in self._called.values():
            self._at_cleanup.callback(self.destroy_client, client)
        self._passes = ActionClient(self, TrackPass, "track_pass")
        self._at_cleanup.callback(self._passes.destroy)

    def activate(self) -> None:
        self._server = RotctldServer(
            self.parameters.value("server"), self._view, self._inbox.put, lambda text: self._words.append(text)
        )
        self._at_deactivation.callback(self._close)
        host = self.parameters.value("server").host
        self.get_logger().info(f"rotctld clients are served at {host}:{self._server.port}")
        self.every(PERIOD_S, self._step)

    def deactivate(self) -> None:
        if self._goal is not None:
            self._call("pointing_controller/stop", Trigger.Request(), lambda _answer: None)
        elif self._points.moving:
            self._hold("the server was deactivated")

    def _close(self) -> None:
        if self._server is not None:
            self._server.close()
        self._server = None

    def turn(self) -> float:
        """Carry out what clients have requested since the last turn."""
        while not self._inbox.empty():
            self._carry_out(self._inbox.get())
        while self._words:
            self.get_logger().warning(f"refused: {self._words.popleft()}", throttle_duration_sec=0.2)
        self._poll()
        busy = self._server is not None and bool(self._server.counts.connected)
        # An order waits this long at most; its time is that of its arrival.
        return 0.01 if busy else 0.1

    # What is known

    def _on_antenna(self, message: AntennaStatus) -> None:
        rejected = message.commands_rejected - self._rejected
        self._rejected, self._antenna, self._antenna_wall_s = message.commands_rejected, message, time.monotonic()
        if message.mode != AntennaMode.PARKED and message.mode != AntennaMode.PARKING:
            self._parked_here = False
        if not self._follows:
            return
        if message.commander == self.get_fully_qualified_name():
            self._refusal = ""
        elif rejected > 0:
            self._refuse_motion(message.last_rejection)

    def _refuse_motion(self, reason: str) -> None:
        if reason != self._refusal:
            self.get_logger().warning(f"the points are not followed: {reason}", throttle_duration_sec=1.0)
        self._refusal = reason

    def _on_model(self, message: PointingModel) -> None:
        self._model = convert_calibration.model_from_message(message)

    def _on_tracking(self, message: TrackingStatus) -> None:
        self._tracking = message
        mine = self._goal is not None and self._match is not None and message.target == self._match.name
        if mine and not self._certified and message.commands_sent > self._sent_before:
            # The pass has its certificate, and from here on the controller commands.
            self._certified, self._azimuth_rad = True, None

    def _look(self) -> None:
        """Take the position of the axes, and show that of the beam to the clients."""
        reading = self._latest.take()
        if reading is not None:
            self._joints = reading
            azimuth, elevation = map(float, reading.position_rad)
            if self._model is not None:
                try:
                    found = self._model.remove(azimuth, elevation, *reading.velocity_rad_s, 0.0, 0.0)
                except ValueError:
                    # At the mount's zenith the model has no inverse: the axes are near enough.
                    pass
                else:
                    azimuth, elevation = map(float, found)
            self._view.position_deg = math.degrees(azimuth), math.degrees(elevation)
            rates = [0 if abs(rate) < MOVING_RAD_S else int(math.copysign(1, rate)) for rate in reading.velocity_rad_s]
            self._view.moving = rates[0], rates[1]
        if time.monotonic() - self._antenna_wall_s > SILENT_S:
            self._view.position_deg = None

    @property
    def _follows(self) -> bool:
        """Whether points are followed by this node."""
        return self._azimuth_rad is not None

    def _against(self, client: str) -> tuple[int, str]:
        """Return the code and why `client` may not move the antenna, 0 and "" if it may."""
        if time.monotonic() - self._antenna_wall_s > SILENT_S or self._joints is None:
            return IO_ERROR, "antenna_servo is silent"
        if self._antenna.fault:
            return REJECTED, f"a fault is latched ({self._antenna.fault}); reset it first"
        if self._executive.state not in ("", "idle"):
            return REJECTED, f"the executive is {self._executive.state}: pause or stop the night first"
        if self._tracking.target and self._goal is None and self._match is None:
            return REJECTED, f"{self._tracking.target} is tracked for somebody else; stop that pass first"
        if self._antenna.mode == AntennaMode.PARKED and not self._parked_here:
            return REJECTED, "the antenna was parked by somebody else; release it first"
        assert self._server is not None
        rival = self._steering != client and self._steering in self._server.counts.connected
        if rival and time.monotonic() - self._steered_wall_s < LEASE_S:
            return REJECTED, f"{self._steering} steers; it must be silent for {LEASE_S:.0f} s or disconnect"
        return 0, ""

    # What clients ask

    def _carry_out(self, inquiry: Inquiry) -> None:
        if inquiry.order.name == "stop":
            self._stop(inquiry.reply)
        elif inquiry.order.name == "park":
            self._park(inquiry)
        else:
            self._set_pos(inquiry)

    def _set_pos(self, inquiry: Inquiry) -> None:
        code, reason = self._against(inquiry.client)
        if code:
            self._say_refused(inquiry, reason)
            inquiry.reply(code)
            return
        self._steering, self._steered_wall_s = inquiry.client, time.monotonic()
        t_s = self.now_s() - (time.monotonic() - inquiry.at_s)
        self._points.add(t_s, *direction_rad(inquiry.order.values_deg[0], inquiry.order.values_deg[1]))
        if self._match is not None and self._goal is not None:
            self._in_pass(inquiry.reply)
            return
        if self._points.moving:
            inquiry.reply(REJECTED if self._refusal else 0)
        else:
            self._azimuth_rad = None
            self._go_to_place(inquiry.reply)
        self._identify()

    def _in_pass(self, reply: Reply) -> None:
        """Take a point while the pass of a satellite is tracked: one of its own, or another's."""
        times, directions = self._points.history
        assert self._match is not None
        mine = self._sky is not None and on_track(
            self._sky, self._match.row, float(times[-1]), directions[-1], self._match_params
        )
        self._strays = 0 if mine else self._strays + 1
        if self._strays >= STRAYS:
            name, self._strays = self._match.name, 0
            self.get_logger().info(f"the client has left the track of {name}")
            self._place_due = True
            self._call("pointing_controller/stop", Trigger.Request(), lambda _answer: reply(0), reply)
            return
        reply(0)

    def _stop(self, reply: Reply) -> None:
        """End whatever moves, in a controlled way."""
        self._forget()
        self._place_due = False
        if self._tracking.target or self._goal is not None:
            self._call("pointing_controller/stop", Trigger.Request(), lambda _answer: reply(0), reply)
        elif self._joints is None:
            reply(IO_ERROR)
        else:
            self._halt(reply)

    def _park(self, inquiry: Inquiry) -> None:
        code, reason = self._against(inquiry.client)
        if code:
            self._say_refused(inquiry, reason)
            inquiry.reply(code)
            return
        self._forget()

        def park(_answer: Any = None) -> None:
            self._call("antenna_servo/park", Trigger.Request(), parked, inquiry.reply)

        def parked(answer: Any) -> None:
            self._parked_here = self._parked_here or answer.success
            self._conclude("park", answer, inquiry.reply)

        if self._goal is not None:
            self._call("pointing_controller/stop", Trigger.Request(), park, inquiry.reply)
        else:
            park()

    def _say_refused(self, inquiry: Inquiry, reason: str) -> None:
        self.get_logger().warning(f"{inquiry.client}: {inquiry.order.name} {inquiry.order.text} refused: {reason}",
                                  throttle_duration_sec=1.0)  # fmt: skip

    # Motion of this node

    def _forget(self) -> None:
        self._points.clear()
        self._azimuth_rad, self._place, self._refusal = None, None, ""

    def _go_to_place(self, reply: Reply) -> None:
        """Go to the latest point and hold there, on the turn that is nearest."""
        _, directions = self._points.history
        assert self._joints is not None
        east, north, up = directions[-1]
        azimuth = nearest_turn_rad(math.atan2(east, north), float(self._joints.position_rad[0]))
        azimuth = self._inside(azimuth)
        sky = raised(np.array([[azimuth, math.asin(up)]]), self._limits, self._mask, self._follow.clear_rad)
        goal = self._on_axes(Motion(sky, np.zeros((1, 2)), np.zeros((1, 2)))).position[0]
        if self._place is not None and float(np.max(np.abs(goal - self._place))) < SAME_RAD:
            reply(0)
            return
        self._place = goal
        request = GoTo.Request(azimuth=float(goal[0]), elevation=float(goal[1]))

        def gone(answer: Any) -> None:
            if not answer.success:
                self._place = None
            self._conclude("P", answer, reply)

        def go(_answer: Any = None) -> None:
            self._call("antenna_servo/go_to", request, gone, reply)

        if self._antenna.mode == AntennaMode.PARKED:
            self._call("antenna_servo/resume", Trigger.Request(), go, reply)
        else:
            go()

    def _inside(self, azimuth_rad: float) -> float:
        """Return an azimuth on the turn nearest to it that the travel holds."""
        low, high = self._limits.azimuth_min_rad, self._limits.azimuth_max_rad
        turns = [azimuth_rad + 2.0 * math.pi * k for k in (0, -1, 1, -2, 2)]
        return next((each for each in turns if low <= each <= high), azimuth_rad)

    def _on_axes(self, sky: Motion) -> Motion:
        return sky if self._model is None else axis_motion(sky, self._model)

    def _halt(self, reply: Reply) -> None:
        """Come to rest where the axes can stop, and hold there."""
        assert self._joints is not None
        rate = np.asarray(self._joints.velocity_rad_s)
        goal = self._joints.position_rad + rate * np.abs(rate) / (2.0 * np.array(self._stop_rad_s2))
        low, high = np.array(self._limits.lowest_rad), np.array(self._limits.highest_rad)
        goal = np.clip(goal, np.minimum(low, self._joints.position_rad), np.maximum(high, self._joints.position_rad))
        request = GoTo.Request(azimuth=float(goal[0]), elevation=float(goal[1]))
        self._call("antenna_servo/go_to", request, lambda answer: self._conclude("S", answer, reply), reply)

    def _hold(self, reason: str) -> None:
        self.get_logger().info(f"holding: {reason}")
        self._forget()
        self._halt(lambda _code: None)

    def _step(self, t_s: float) -> None:
        self._look()
        self._renew_elements()
        assert self._server is not None
        if self._goal is not None and self._certified:
            heard_s = max(self._server.heard_s(self._steering), self._steered_wall_s)
            silent_s = time.monotonic() - heard_s
            if silent_s > self._match_params.silence_s:
                self.get_logger().warning(f"{self._steering} has been silent for {silent_s:.0f} s: the pass ends")
                self._steered_wall_s = math.inf
                self._call("pointing_controller/stop", Trigger.Request(), lambda _answer: None)
            return
        if self._place_due and self._goal is None and self._joints is not None:
            self._place_due = False
            if not self._points.moving and math.isfinite(self._points.newest_s):
                self._go_to_place(lambda _code: None)
        if not self._points.moving or self._joints is None:
            return
        silent_s = t_s - self._points.newest_s
        if silent_s > self._follow.coast_s:
            self._hold(f"no further point for {silent_s:.1f} s")
        else:
            self._command(t_s)

    def _command(self, t_s: float) -> None:
        """Send the motion of the next second."""
        times = np.round(t_s + AHEAD_S, 6)
        self._place = None
        if self._azimuth_rad is None:
            self._azimuth_rad = self._chosen_azimuth(t_s)
        sky = self._points.motion(times, self._azimuth_rad)
        low, high = self._limits.azimuth_min_rad, self._limits.azimuth_max_rad
        if not low <= sky.position[-1, 0] <= high:
            other = self._chosen_azimuth(t_s)
            if abs(other - self._azimuth_rad) > math.pi:
                self.get_logger().warning("the azimuth's travel ends here: unwinding to go on on another turn")
                sky = self._points.motion(times, other)
        self._azimuth_rad = float(sky.position[0, 0])
        motion = self._on_axes(self._within(times, sky))
        trajectory = JointTrajectory(
            t_s=times, position_rad=motion.position, velocity_rad_s=motion.velocity,
            acceleration_rad_s2=motion.acceleration,
        )  # fmt: skip
        command = convert.trajectory_to_message(trajectory, t_s)
        self._key.sign(command, self.get_fully_qualified_name())
        self._commands.publish(command)

    def _chosen_azimuth(self, t_s: float) -> float:
        """Return the azimuth now on the turn that holds the rest of the motion."""
        assert self._joints is not None
        encoder = float(self._joints.position_rad[0])
        now = self._points.motion(np.array([t_s]), encoder)
        return float(now.position[0, 0]) + turn_for(self._limits, azimuth_still_to_come(now), encoder)

    def _within(self, times: np.ndarray, sky: Motion) -> Motion:
        """Return a motion inside the travel and above the horizon."""
        position = raised(sky.position, self._limits, self._mask, self._follow.clear_rad)
        position[:, 0] = np.clip(position[:, 0], self._limits.azimuth_min_rad, self._limits.azimuth_max_rad)
        changed = position != sky.position
        velocity, acceleration = sky.velocity.copy(), sky.acceleration.copy()
        if np.any(changed):
            velocity[changed] = np.gradient(position, times, axis=0)[changed]
            acceleration[changed] = 0.0
        return Motion(position, velocity, acceleration)

    # Passes of known satellites

    def _renew_elements(self) -> None:
        """Load the elements of the ephemeris publisher when they are new, in another thread."""
        if self._loading is not None and self._loading.done():
            try:
                self._sky, self._problem = self._loading.result(), ""
            except (ValueError, OSError) as error:
                self._problem = f"satellites cannot be identified: {error}"
                self.get_logger().warning(self._problem)
            self._loading = None
        due = time.monotonic() - self._loaded_wall_s > RELOAD_S
        client = self._called["ephemeris_publisher/get_parameters"]
        if not due or self._goal is not None or not client.service_is_ready() or not self.parameters.value("").identify:
            return
        self._loaded_wall_s = time.monotonic()
        request = GetParameters.Request(names=["source.elements"])
        self._call("ephemeris_publisher/get_parameters", request, self._load)

    def _load(self, answer: Any) -> None:
        assert self.station is not None
        elements, site, now_s = answer.values[0].string_value, self.station.site, self.now_s()
        self._loading = self._pool.submit(lambda: CatalogueSky(load_catalogue(elements), site, now_s))

    def _identify(self) -> None:
        """Look whether the points are those of a known satellite, and ask for its pass."""
        if self._sky is None or self._match is not None:
            return
        found = identify(self._sky, *self._points.history, self._match_params)
        if found is None or self.now_s() < self._refused.get(found.catalogue_number, -math.inf):
            return
        self._match, self._certified = found, False
        self.get_logger().info(
            f"the points are those of {found.name} ({found.catalogue_number}): within "
            f"{math.degrees(found.distance_rad):.2f} deg of its track, {found.lead_s:+.1f} s ahead of it"
        )
        request = SelectTarget.Request(target=str(found.catalogue_number))
        self._call(
            "ephemeris_publisher/select_target", request, self._selected, lambda _code: self._no_pass("no answer")
        )

    def _selected(self, answer: Any) -> None:
        if self._match is None:
            return
        now_s = self.now_s()
        windows = [each for each in answer.passes if seconds_from_stamp(each.los) > now_s]
        if not answer.success or not windows:
            self._no_pass(answer.message)
            return
        if seconds_from_stamp(windows[0].aos) > now_s + AGAIN_S:
            self._no_pass("it does not rise above the station's horizon now")
            return
        if not self._passes.server_is_ready():
            self._no_pass("track_pass is not offered")
            return
        goal = TrackPass.Goal(target_pass=windows[0], sensor=self.parameters.value("").sensor)
        self._wait(self._passes.send_goal_async(goal), self._offered, lambda _code: self._no_pass("no answer"))

    def _offered(self, handle: Any) -> None:
        if not handle.accepted:
            self._no_pass("pointing_controller has refused the goal")
        elif self._match is None:
            handle.cancel_goal_async()
        else:
            self._goal, self._sent_before = handle, self._tracking.commands_sent
            self._wait(handle.get_result_async(), self._over, wait_s=math.inf)

    def _over(self, answer: Any) -> None:
        """Go on with the points after a pass."""
        name = self._match.name if self._match else "the pass"
        result, tracked = answer.result, self._certified
        self.get_logger().info(f"{name}: {result.message}; {result.seconds_tracked:.0f} s tracked")
        if self._match is not None:
            self._refused[self._match.catalogue_number] = self.now_s() + AGAIN_S
        self._goal, self._match, self._certified = None, None, False
        if tracked and not self._place_due:
            # What was sent for the pass is over with it; the client's next points count.
            self._forget()

    def _no_pass(self, reason: str) -> None:
        assert self._match is not None
        self.get_logger().warning(f"{self._match.name} is not tracked as a pass, its points are followed: {reason}")
        self._refused[self._match.catalogue_number] = self.now_s() + AGAIN_S
        self._match = None

    # Answers of other nodes

    def _call(self, name: str, request: Any, then: Callable[[Any], None], failed: Reply = lambda _code: None) -> None:
        """Call a service; `failed` takes the code of one that is not there or is silent."""
        client = self._called[name]
        if not client.service_is_ready():
            self.get_logger().warning(f"{name} is not offered", throttle_duration_sec=1.0)
            failed(IO_ERROR)
            return
        self._wait(client.call_async(self._caller.request(name, request)), then, failed)

    def _wait(
        self, future: Any, then: Callable[[Any], None], failed: Reply = lambda _code: None, wait_s: float = SERVICE_S
    ) -> None:
        self._waiting.append((future, then, time.monotonic() + wait_s, failed))

    def _poll(self) -> None:
        waiting, self._waiting = self._waiting, []
        for each in waiting:
            future, then, deadline_s, failed = each
            if future.done():
                then(future.result())
            elif time.monotonic() > deadline_s:
                failed(TIMED_OUT)
            else:
                self._waiting.append(each)

    def _conclude(self, what: str, answer: Any, reply: Reply) -> None:
        if not answer.success:
            self.get_logger().warning(f"{what} refused: {answer.message}", throttle_duration_sec=1.0)
        reply(0 if answer.success else REJECTED)

    def _health(self) -> Health:
        if self._server is None:
            return Health(OK, "not served")
        counts = self._server.counts
        tracked = f"tracks {self._match.name}" if self._match and self._certified else ""
        doing = tracked or ("follows points" if self._follows else "holds" if self._steering else "waits")
        values = {"port": self._server.port, "clients": len(counts.connected), "steering": self._steering,
                  "refused lines": counts.refused_lines, "last refused": counts.last_refusal,
                  "refused clients": counts.refused_clients,
                  "satellites": len(self._sky.elements) if self._sky else 0}  # fmt: skip
        problem = self._problem or self._refusal
        return Health(WARN if problem else OK, problem or doing, values)

    def end(self) -> None:
        """Close the port with the node, too."""
        super().end()
        self._pool.shutdown(wait=False, cancel_futures=True)


def main() -> None:
    """Entry point of `ros2 run rf_pointing rotctld_server`."""
    run(RotctldServerNode)
