"""A night of one station in one process: the executive, the station, and what goes wrong.

The parts are those of the graph, wired by function calls as in `pass_simulation.py`.  Where nothing
moves and nothing is due, time goes on in whole seconds.  Faults are put in at given times: a part
that is killed and comes back, a drive that is lost, a link that drops, a gust, old elements, a full
disk.  The motion is watched by a gate of its own.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rf_pointing.core import JointReading
from rf_pointing.drives.simulated_rotator import RotatorModel, SimulatedRotator
from rf_pointing.ephemeris.passes import passes_with_present
from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.operations.alarms import Alarm, AlarmParams
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.operations.night import Night
from rf_pointing.operations.schedule import BetweenParams, Schedule, ScheduledPass
from rf_pointing.planning import MachineParams
from rf_pointing.simulation.pass_simulation import StationSetup
from rf_pointing.station.antenna.axes import pair
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.status import TrackingStatus
from rf_pointing.tracking import MonopulseTracker, power_tracker

TICK_S = 0.02
PERIOD_TICKS = 5
EXECUTIVE_S = 0.5
"""Time between two steps of the executive."""
IDLE_S = 1.0
OUTSIDE_RAD = math.radians(0.5)
"""True angles this far past the travel are a motion outside the gate."""
ANSWER_S = 0.1
NO_ANSWER = "the drive does not answer"
AHEAD_S = 2.0
EARLY_TARGET_S = 5.0
RESTART_S = 3.0
"""How long a killed part is away."""
SEARCH_S = 7200.0
COMMON = (
    "controller_killed",
    "ephemeris_killed",
    "tracker_killed",
    "receiver_killed",
    "servo_killed",
    "drive_lost",
    "link_drop",
    "stale_elements",
    "full_disk",
)
"""Faults of any station; a plant and a rotator have faults of their own."""
_NODES = {"controller_killed": "pointing_controller", "ephemeris_killed": "ephemeris_publisher",
          "tracker_killed": power_tracker.NODE, "receiver_killed": "rf_receiver", "servo_killed": "antenna_servo"}  # fmt: skip
CAUSES = {
    **{kind: f"lost_node {node}" for kind, node in _NODES.items()},
    "drive_lost": "lost_drive",
    "axes_stuck": "latched_fault", "runaway": "latched_fault", "encoder_frozen": "latched_fault", "gust": "high_wind",
    "link_drop": "lost_signal", "stale_elements": "stale_elements", "full_disk": "full_disk",
}  # fmt: skip
"""The alarm by which each of them must be in the report."""


def kinds_of(setup: StationSetup) -> tuple[str, ...]:
    """Return what can go wrong with a station."""
    own = ("axes_stuck",) if isinstance(setup.antenna(), DriveAntenna) else ("runaway", "encoder_frozen")
    wind = ("gust",) if setup.station.content.wind.anemometer and "axes_stuck" not in own else ()
    return (*COMMON, *own, *wind)


@dataclass(frozen=True, slots=True)
class NightFault:
    """One thing that goes wrong at a time, for a while."""

    t_s: float
    kind: str
    seconds: float


@dataclass(slots=True)
class NightLog:
    """Records of a night besides the executive's own."""

    faults: list[NightFault] = field(default_factory=list)
    messages: list[tuple[str, str, str]] = field(default_factory=list)
    """Event, name and text of what an operator received."""
    outside: list[str] = field(default_factory=list)
    """Motions outside the gate."""
    sent: list[tuple[float, str]] = field(default_factory=list)
    """Directives that left the executive."""
    moved_s: float = 0.0


class NightSimulation:
    """A station with its executive; `run` ends when the night is over.

    `elements`: file of all satellites.  `faults` begin at their times, but one that needs the
    antenna in motion waits for the next pass.
    """

    def __init__(
        self,
        setup: StationSetup,
        elements: Path,
        passes: Sequence[ScheduledPass],
        start_t_s: float,
        *,
        faults: Sequence[NightFault] = (),
        between: BetweenParams | None = None,
        thresholds: AlarmParams | None = None,
        procedure: str = "",
        reads: Callable[[str], bool] = lambda _attribute: True,
    ) -> None:
        self.setup, self.log, self.t_s = setup, NightLog(), start_t_s
        self._elements, self._reads = str(elements), reads
        self._faults = sorted(faults, key=lambda each: each.t_s)
        self._on: list[tuple[float, NightFault]] = []
        self.antenna, self.receiver = setup.antenna(), setup.receiver()
        self.controller: PointingController | None = setup.controller()
        self._monopulse = MonopulseTracker(setup.sets("monopulse_tracker")["monopulse"])
        self._carrier = setup.power_tracker()
        params = self.controller.params
        alarms = thresholds or AlarmParams()
        tables = read_tables(alarms, procedure=procedure)
        machine: MachineParams = params.machine
        schedule = Schedule(params.limits, machine.axes, between, mount=params.kinematics)
        schedule.change(passes)
        self.night = Night(
            schedule, tables.procedure, tables.recovery, self._send, quiet_s=alarms.quiet_s, band=setup.band,
            least_share=machine.least_share, notify=self._notify,
        )  # fmt: skip
        self._answers: list[tuple[float, int, bool, str]] = []
        self._seen = dict.fromkeys(_NODES.values(), start_t_s)
        self._target: Any = None
        self._windows: list[Any] = []
        self._status: TrackingStatus | None = None
        self._goal: tuple[int, Any] | None = None
        self._recording = ""
        self._free_gb, self._aged_h = 500.0, 0.0
        self._ticks = 0
        self._known: JointReading | None = None
        self._least = setup.station.mask.above(setup.sets("ephemeris_publisher")["publisher"].mask_rad)

    def run(self, until_s: float, on_hour: Callable[[float], object] = lambda _t_s: None) -> None:
        """Run the night from its start to its end, at most to `until_s`."""
        self.antenna.enable()
        self._look()
        self.night.start(self.t_s)
        hour_s, executive_s = self.t_s, self.t_s
        while not self.night.finished and self.t_s < until_s:
            self._begin_and_end_faults()
            if self.t_s >= executive_s:
                self._look()
                self.night.step(self.t_s)
                executive_s = self.t_s + EXECUTIVE_S
            self._tick()
            idle = self._idle
            # On the grid of the ticks and the periods, which sums of ticks would leave.
            step_s = IDLE_S if idle else TICK_S
            self.t_s = round(self.t_s + step_s, 6)
            self._ticks = 0 if idle else self._ticks + 1
            if self.t_s >= hour_s:
                on_hour(self.t_s)
                hour_s += 3600.0

    @property
    def _idle(self) -> bool:
        """Whether nothing moves and nothing is waited for."""
        antenna, night = self.antenna, self.night
        resting = antenna.mode in (AntennaMode.HOLDING, AntennaMode.PARKED, AntennaMode.STOWED)
        still = resting and not antenna.axes.moving and float(abs(antenna.axes.rate_command_rad_s).max()) < 1e-6
        busy = self.controller is not None and self.controller.busy
        return still and not (busy or self._answers or night.active_id or night.blocks() or self._on)

    # The station

    def _tick(self) -> None:
        t_s, antenna = self.t_s, self.antenna
        reading, boresight = antenna.step(t_s)
        if boresight is None:
            raise ValueError("a simulated antenna must say where its beam is")
        self._guard(t_s)
        controller = self.controller
        if controller is not None and self._ticks % PERIOD_TICKS == 0:
            controller.take_antenna(antenna.mode, antenna.safety.latch.text)
            if self._known is not None:
                controller.take_joints(self._known)
            if self._target is not None and self._alive("ephemeris_killed") and self._near(t_s + AHEAD_S):
                controller.take_target(self._target.target_at(round(t_s + AHEAD_S, 6)))
            busy = controller.busy
            trajectory, self._status = controller.step(t_s)
            if trajectory is not None:
                antenna.accept(trajectory, t_s)
            seen = self._status
            self._carrier.take_status(t_s, seen.scan_centre_rad, seen.offset_rad, seen.mode, seen.sensor)
            if busy and not controller.busy:
                self._end_of_goal(controller)
        if self._ticks % PERIOD_TICKS == 0:
            # A lost drive reads nothing.
            self._known = reading
        if controller is None or not controller.busy:
            return
        if reading is not None:
            self._carrier.take_joints(reading)
        hears = self._alive("receiver_killed") and self._alive("link_drop")
        reception = self.receiver.take(boresight) if self._alive("receiver_killed") else None
        if reception is None or not self._alive("tracker_killed"):
            return
        power = reception.power
        if not hears:
            # The carrier is gone: noise alone is received.
            return
        controller.take_error(self._monopulse.measure(reception.cluster))
        for error in self._carrier.take_power(power):
            controller.take_error(error)

    def _near(self, t_s: float) -> bool:
        return any(w.aos_t_s - EARLY_TARGET_S <= t_s <= w.los_t_s + EARLY_TARGET_S for w in self._windows)

    def _guard(self, t_s: float) -> None:
        """Look at the true motion with a gate of its own: travel, horizon, Sun."""
        axes = self.antenna.axes
        if not axes.moving:
            return
        self.log.moved_s += TICK_S
        if self._ticks % PERIOD_TICKS:
            return
        switch, rate = axes.hardware.switch_rad, pair(axes.hardware.velocity_rad_s)
        safety = self.antenna.safety
        reason = safety.beyond(switch, rate) or safety.gate.limits.reason(*switch, None, OUTSIDE_RAD)
        if reason and len(self.log.outside) < 100:
            self.log.outside.append(f"{t_s:.1f}: {reason}")

    def _end_of_goal(self, controller: PointingController) -> None:
        if self._goal is None:
            return
        number, _ = self._goal
        self._goal = None
        statistics = controller.statistics
        why = statistics.outcome.why_not_tracked(
            statistics.reason, statistics.fault, controller.params.machine.least_share
        )
        self.night.take("track", {"success": not why, "message": why}, self.t_s)
        if statistics.fault or statistics.reason != "loss of signal":
            self.night.fail(number, why, self.t_s)

    # Between station and executive

    def _look(self) -> None:
        """Give the executive what the topics would."""
        t_s, night = self.t_s, self.night
        due = [each for each in self._answers if each[0] <= t_s]
        self._answers = [each for each in self._answers if each[0] > t_s]
        for _, number, accepted, text in due:
            night.respond(number, accepted, text, t_s)
        if self._alive("servo_killed"):
            status, reading = self.antenna.status(t_s), self.antenna.reading(t_s)
            known = not isinstance(self.antenna, DriveAntenna) or self.antenna.hardware.current
            place = reading.position_rad.tolist()
            self._take("antenna", {
                "mode": str(status.mode), "fault": status.fault, "warning": status.warning, "high_wind": status.high_wind,
                "moving": bool(self.antenna.axes.moving or abs(status.rate_command_rad_s).max() > 1e-4),
                **({"azimuth": place[0], "elevation": place[1]} if known else {}),
            })  # fmt: skip
            self._take("drive", {"problem": _lost(self.antenna)})
        status_ = self._status
        if self.controller is not None and status_ is not None:
            self._take("tracking", {
                "mode": str(status_.mode), "target": status_.target, "reason": status_.reason, "held": bool(status_.held),
                "seconds_tracked": status_.seconds_tracked_s, "seconds_lost": status_.seconds_lost_s,
                "mean_loss": status_.mean_loss_db,
            })  # fmt: skip
        silent = list[str]()
        for kind, node in _NODES.items():
            if self._alive(kind):
                self._seen[node] = t_s
            silent_s = t_s - self._seen[node]
            self._take(node, {"silent_s": silent_s, "failed": ""})
            if silent_s > EXECUTIVE_S:
                silent.append(node)
        self.night.take_readiness(silent, t_s)
        self._take("disk", {"free_gb": self._free_gb})
        self._take("recorder", {"state": "recording" if self._recording else "idle"})
        age_h = self._element_age_h()
        if age_h is not None:
            self._take("elements", {"age_h": age_h, "target": self._target.name})

    def _take(self, device: str, values: dict[str, Any]) -> None:
        self.night.take(device, {k: v for k, v in values.items() if self._reads(f"{device}.{k}")}, self.t_s)

    def _element_age_h(self) -> float | None:
        elements = getattr(getattr(self._target, "target", None), "elements", None)
        return None if elements is None else (self.t_s - elements.epoch_t_s) / 3600.0 + self._aged_h

    def _notify(self, event: str, alarm: Alarm) -> None:
        self.log.messages.append((event, alarm.name, alarm.message))

    def _send(self, number: int, name: str, arguments: dict[str, Any]) -> None:
        self.log.sent.append((self.t_s, name))
        try:
            text, accepted = self._act(number, name, arguments), True
        except (ValueError, OSError) as error:
            text, accepted = str(error), False
        if text != "no answer":
            self._answers.append((self.t_s + ANSWER_S, number, accepted, text))

    def _act(self, number: int, name: str, arguments: dict[str, Any]) -> str:
        antenna = self.antenna
        requests = {"park": antenna.park, "stow": antenna.stow, "release": antenna.resume,
                    "reset_antenna_fault": antenna.reset_fault}  # fmt: skip
        if name in requests or name == "unwind":
            if not self._alive("servo_killed"):
                return "no answer"
            goal = arguments.get("azimuth", 0.0), arguments.get("elevation", 0.0)
            refused = antenna.go_to(goal) if name == "unwind" else requests[name]()
            if refused:
                raise ValueError(refused)
            return "accepted"
        if name == "select_target":
            return self._select(arguments) if self._alive("ephemeris_killed") else "no answer"
        if name in ("track", "stop_pass"):
            if self.controller is None:
                return "no answer"
            return self._track(number, arguments) if name == "track" else self._stop_pass()
        return self._own(name, arguments)

    def _own(self, name: str, arguments: dict[str, Any]) -> str:
        if name == "record":
            if not self._free_gb:
                raise OSError("No space left on device")
            self._recording = str(arguments["name"])
        elif name == "end_record":
            self._recording = ""
        return "accepted"

    def _select(self, arguments: dict[str, Any]) -> str:
        source: SourceParams = self.setup.sets("ephemeris_publisher")["source"]
        source = source.replace(elements=self._elements, satellite=str(arguments["target"]))
        track = load_track(source)
        self._windows = passes_with_present(track, float(arguments["start"]), SEARCH_S, self._least)
        if not self._windows:
            raise ValueError(f"{track.name} has no pass")
        self._target = track
        real: SourceParams = self.setup.sets("rf_receiver")["source"]
        real = real.replace(elements=self._elements, satellite=str(arguments["target"]))
        self.receiver.tune(load_track(real))
        self._profiles()
        windows = [(window.aos_t_s, window.los_t_s, window) for window in self._windows]
        self.night.take_passes(track.name, windows, self.t_s)
        return f"{len(windows)} passes"

    def _profiles(self) -> None:
        if self.controller is not None and self._target is not None:
            self.controller.plan.take_profiles([pass_profile(self._target, window) for window in self._windows])

    def _track(self, number: int, arguments: dict[str, Any]) -> str:
        assert self.controller is not None
        if arguments["band"] not in ("", self.setup.band):
            self._change_band(self.controller, str(arguments["band"]))
        try:
            sensor = self.setup.station.chosen_sensor(str(arguments["sensor"]), self.setup.band)
            self.controller.start(self.t_s, arguments["target_pass"], sensor)
        except ValueError as error:
            self.night.take("track", {"refused": str(error)}, self.t_s)
            raise
        self.night.take("track", {"refused": ""}, self.t_s)
        self._goal = number, arguments["target_pass"]
        return "accepted"

    def _change_band(self, controller: PointingController, band: str) -> None:
        """Do in one process what the nodes do on a change of band: antenna and what is known stay."""
        self.setup = setup = StationSetup(self.setup.station, band, changes=self.setup.changes)
        self.controller = controller.in_band(ControllerParams(**setup.sets("pointing_controller")))
        self.controller.take_model(setup.model)
        track, self.receiver = self.receiver.track, setup.receiver()
        self.receiver.tune(track)
        self._monopulse = MonopulseTracker(setup.sets("monopulse_tracker")["monopulse"])
        self._carrier = setup.power_tracker()
        if isinstance(self.antenna, SimulatedAntenna):
            self.antenna.hardware.bend(setup.sets("antenna_servo")["mount"])

    def _stop_pass(self) -> str:
        assert self.controller is not None
        self.controller.stop("stop was requested")
        return "stopping"

    # What goes wrong

    def _alive(self, kind: str) -> bool:
        return not any(fault.kind == kind for _, fault in self._on)

    def _begin_and_end_faults(self) -> None:
        for end in [each for each in self._on if each[0] <= self.t_s]:
            self._on.remove(end)
            self._end(end[1])
        while self._faults and self._faults[0].t_s <= self.t_s:
            fault = self._faults[0]
            if fault.kind == "link_drop" and not (self._status and self._status.held):
                # Without a pass nobody could notice it.
                break
            if fault.kind in ("encoder_frozen", "axes_stuck") and not self.antenna.axes.moving:
                break
            self._faults.pop(0)
            self.log.faults.append(NightFault(self.t_s, fault.kind, fault.seconds))
            self._on.append((self.t_s + fault.seconds, fault))
            self._begin(fault)

    def health(self) -> dict[str, dict[str, Any]]:
        """Return what the morning report shows of the station."""
        shown: dict[str, dict[str, Any]] = {"disk": {"free_gb": self._free_gb}}
        if isinstance(self.antenna, DriveAntenna):
            starts = _rotator(self.antenna).starts
            shown["relays"] = {"starts of azimuth and elevation": f"{starts[0]}, {starts[1]}"}
        return shown

    def _begin(self, fault: NightFault) -> None:
        antenna = self.antenna
        match fault.kind:
            case "controller_killed":
                self.controller, self._goal = None, None
            case "servo_killed":
                antenna.rest(AntennaMode.INACTIVE)
            case "drive_lost" if isinstance(antenna, DriveAntenna):
                antenna.hardware.drive.problem = NO_ANSWER
            case "drive_lost":
                _plant(antenna).hardware.fault = NO_ANSWER
                antenna.trip(NO_ANSWER)
            case "axes_stuck":
                _rotator(antenna).powered = False
            case "runaway":
                _plant(antenna).injected.inject("runaway", 0.5 * antenna.axes.limits.rate_limit_rad_s[0])
            case "encoder_frozen":
                _plant(antenna).injected.inject("encoder_frozen", 0.0)
            case "gust":
                _plant(antenna).injected.inject("gust", 30.0)
            case "stale_elements":
                self._aged_h = 200.0
            case "full_disk":
                self._free_gb = 0.0

    def _end(self, fault: NightFault) -> None:
        antenna = self.antenna
        match fault.kind:
            case "controller_killed":
                self.controller, self._status = self.setup.controller(), None
                self._profiles()
            case "servo_killed":
                antenna.enable()
            case "drive_lost" if isinstance(antenna, DriveAntenna):
                antenna.hardware.drive.problem = ""
            case "drive_lost":
                _plant(antenna).hardware.fault = ""
            case "axes_stuck":
                _rotator(antenna).powered = True
            case "runaway" | "encoder_frozen" | "gust":
                _plant(antenna).injected.inject("none", 0.0)
            case "stale_elements":
                self._aged_h = 0.0
            case "full_disk":
                self._free_gb = 500.0


def _lost(antenna: SimulatedAntenna | DriveAntenna) -> str:
    """Return why the drive is lost, "" if it is not."""
    return antenna.hardware.drive.problem if isinstance(antenna, DriveAntenna) else antenna.hardware.fault


def _rotator(antenna: SimulatedAntenna | DriveAntenna) -> RotatorModel:
    drive = antenna.hardware.drive if isinstance(antenna, DriveAntenna) else None
    if not isinstance(drive, SimulatedRotator):
        raise ValueError("axes_stuck is a fault of a simulated rotator")
    return drive.model


def _plant(antenna: SimulatedAntenna | DriveAntenna) -> SimulatedAntenna:
    if isinstance(antenna, DriveAntenna):
        raise ValueError("runaway, encoder_frozen and gust are faults of a simulated plant")
    return antenna
