"""The life of a node: parameters, transitions, periodic work, and why it refuses or has failed.

If a parameter or a transition is refused, the node stays in its state; the reason is in the log and
on /diagnostics.  With `lifecycle.autostart` a node configures and activates itself as soon as it
knows the time.  What it cannot do yet, because a device, a file or the network is missing, it tries
again until it can, and says what it waits for.
"""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.timer import Timer

from rf_pointing.core import Params, parameter
from rf_pointing.core.signals import LONGEST_GAP_S
from rf_pointing.ros.diagnostics import ERROR, OK, WARN, Diagnostics, EventLog, Health, Wait
from rf_pointing.ros.main_loop import IDLE_S, InstanceLock, run, take_priority
from rf_pointing.ros.params import ParameterGroups
from rf_pointing.ros.stamps import seconds_from_nanoseconds

FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 8.0
"""Waits before a node that brings itself up tries again; they double."""
ROUNDING = 1e-3
"""Share of a period by which an instant may lie ahead of the clock and is due."""
STEP_S = 0.05
"""Both clocks are read one after the other, and a busy computer may hold a process in between."""


@dataclass(frozen=True, kw_only=True)
class LifecycleParams(Params):
    """Who brings a node up."""

    autostart: bool = parameter(False, "whether the node configures and activates itself, now and after a restart")
    realtime_priority: int = parameter(0, "SCHED_FIFO priority of the process, 0: as it was started", 0, 98)
    place = ""  # tells a node from another one of its name on this computer


class Schedule:
    """The times at which periodic work is due: the whole multiples of `period_s` after `start_s`.

    The work is done once for every instant of the grid, in order; where nothing `catches_up`, once
    at the present time when the timer fires, not again before half a period has passed.  A gap of
    more than `longest_gap_s` starts a new grid.  It is a jump of the clock, unless a steady clock
    has gone on as far: then the process itself has stalled.  A smaller step of the clock is known
    by the steady clock too (`stepped_s`).
    `steady_s` is the time of a clock that nobody sets, None where time is simulated.
    """

    # A timer may fire late, or twice at one time when the clock moves in steps.  Whole multiples
    # let two nodes of one period work at the same time.

    def __init__(
        self, start_s: float, period_s: float, steady_s: float | None = None, *, catches_up: bool = True
    ) -> None:
        self._period_s, self._catches_up = period_s, catches_up
        self.longest_gap_s = max(LONGEST_GAP_S, 2.0 * period_s)
        self._origin_s, self._count = self._on_grid(start_s), 1
        self._steady_s, self._ahead_s = steady_s, None if steady_s is None else start_s - steady_s
        self._done_s = -math.inf
        self.jumped_s = self.stalled_s = self.stepped_s = 0.0

    def due(self, now_s: float, steady_s: float | None = None) -> list[float]:
        """Return the instants until `now_s` not returned yet.

        `jumped_s` is not 0 after a jump, `stalled_s` after a stall, `stepped_s` after any step of
        the clock since the instant before.
        """
        self.jumped_s = self.stalled_s = self.stepped_s = 0.0
        late_s = self.late_s(now_s)
        stood_s = 0.0 if steady_s is None or self._steady_s is None else steady_s - self._steady_s
        self._steady_s = steady_s
        if abs(late_s) > self.longest_gap_s:
            if abs(late_s - stood_s) > self.longest_gap_s:
                self.jumped_s = late_s - stood_s
            else:
                self.stalled_s = stood_s
            self._origin_s, self._count = self._on_grid(now_s), 0
        times = []
        while self._next_s <= now_s + ROUNDING * self._period_s:
            times.append(self._next_s)
            self._count += 1
        if not self._catches_up and steady_s is not None:
            # The timer has a phase of its own: on the grid half of them lose every other tick.
            times = [now_s] if steady_s - self._done_s >= 0.5 * self._period_s else []
        if times and steady_s is not None:
            self._done_s = steady_s
            before, self._ahead_s = self._ahead_s, now_s - steady_s
            stepped_s = 0.0 if before is None else self._ahead_s - before
            self.stepped_s = stepped_s if abs(stepped_s) > STEP_S else 0.0
        return times if self._catches_up or not times else [max(now_s, times[-1])]

    def late_s(self, now_s: float) -> float:
        """Return how long the next instant has been due, negative before it."""
        return now_s - self._next_s

    def _on_grid(self, t_s: float) -> float:
        return math.floor(t_s / self._period_s + ROUNDING) * self._period_s

    @property
    def _next_s(self) -> float:
        # Whole microseconds: that is what stamps can hold.
        return round(self._origin_s + self._count * self._period_s, 6)


class Lifecycle(LifecycleNode):
    """A lifecycle node with parameter sets, diagnostics, and timers that run while it is active."""

    LIFECYCLE = LifecycleParams()

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.parameters = ParameterGroups(self)
        self.parameters.declare("lifecycle", self.LIFECYCLE)
        own: LifecycleParams = self.parameters.value("lifecycle")
        self.lock = InstanceLock(f"{self.get_fully_qualified_name()}{own.place}")
        self.quiet, self.others_goal = False, True
        """Whether another node of this name works in place of this one; whether it has a goal."""
        self.brings_itself_up: bool = own.autostart
        if refused := take_priority(own.realtime_priority):
            self.get_logger().warning(refused)
        self._wait_s, self._next_try_s = FIRST_WAIT_S, -math.inf
        self._events, self._wait = EventLog(), Wait()
        self.diagnostics = Diagnostics(self)
        self.diagnostics.add("state", self._state_health)
        self._state_name, self._reason = "unconfigured", ""
        self.failure: Exception | None = None
        """The error by which periodic work has failed."""
        self._at_deactivation, self._at_cleanup = ExitStack(), ExitStack()
        self._works: list[tuple[Schedule, Callable[[], None]]] = []
        """The periodic work of simulated time."""
        # rclpy has no public way to guard the transitions of its own service.
        self._change_state_of_rclpy = self._service_change_state.callback
        self._service_change_state.callback = self._change_state_if_possible

    @classmethod
    def main(cls) -> None:
        """Entry point of the node's executable: it alone in its process, until a signal ends it."""
        run(cls)

    # What a node overrides

    def configure(self) -> None:
        """Build the core and the topics; ValueError refuses the configuration with its message."""

    def activate(self) -> None:
        """Start timers; ValueError refuses the activation with its message."""

    def deactivate(self) -> None:
        """Bring what moves to a stop; timers are stopped by the base."""

    def ready(self) -> bool:
        """Return whether a node that brings itself up may be activated yet."""
        return self.knows_time()

    def silent_because(self) -> str:
        """Return why an active node does not send all of its steady topics, "" while it does."""
        return ""

    def missing_inputs(self) -> str:
        """Return which required inputs do not reach an active node, "" if all do."""
        return ""

    def turn(self) -> float:
        """Do what is due between two events; return the longest wait in s for the next event."""
        # A signal is noticed between two events, so the wait bounds the time to react to it.
        return IDLE_S if self._works else 0.2

    def fail(self, reason: str) -> None:
        """Bring what moves to a stop although the work has failed; called before `end`."""

    # What a node uses

    @property
    def active(self) -> bool:
        """Whether the node works: from the end of `activate` to that of `deactivate`."""
        return self._state_name == "active"

    def now_s(self) -> float:
        """Return the node clock's time in seconds."""
        # The handle itself: `Clock.now` takes 14 times as long, at every event.
        return seconds_from_nanoseconds(self.get_clock().handle.get_now().nanoseconds)

    def knows_time(self) -> bool:
        """Return whether the node clock has a time: simulated time has to be received first."""
        return not self.get_parameter("use_sim_time").value or self.get_clock().now().nanoseconds != 0

    def every(self, period_s: float, callback: Callable[[float], None], *, catches_up: bool = True) -> Schedule:
        """Call `callback(t_s)` at every instant of a grid of node time until deactivation.

        Of instants that a late timer missed each is done, none is skipped; what works on a device
        does not catch up: it is called once, at the present time.
        """
        simulated = self.get_parameter("use_sim_time").value
        steady_s: Callable[[], float | None] = (lambda: None) if simulated else time.monotonic
        schedule = Schedule(self.now_s(), period_s, steady_s(), catches_up=catches_up)

        def fire() -> None:
            try:
                for t_s in schedule.due(self.now_s(), steady_s()):
                    callback(t_s)
            except Exception as error:
                # Work that moves an antenna cannot be left out: the main loop ends this node.
                self.failure = error
                raise

        self._at_deactivation.callback(self.destroy_timer, self.timer(period_s, fire))
        if simulated:
            self._works.append((schedule, fire))
            self._at_deactivation.callback(self._works.remove, (schedule, fire))
        return schedule

    def catch_up(self, late_s: float = -math.inf) -> None:
        """Do the periodic work that has been due for `late_s` and that no timer has called."""
        # The executor can lose a timer of simulated time: work, and time, would stand for seconds.
        for schedule, fire in tuple(self._works):
            if schedule.late_s(self.now_s()) >= late_s:
                fire()

    def timer(self, period_s: float, callback: Callable[[], object]) -> Timer:
        """Return a timer that no step of the computer's clock delays; it follows simulated time."""
        # One of the node clock waits for as long as that is set back, while a device goes on.
        clock = None if self.get_parameter("use_sim_time").value else Clock(clock_type=ClockType.STEADY_TIME)
        return self.create_timer(period_s, callback, clock=clock)

    # What the main loop and rclpy call

    def bring_up(self) -> None:
        """Take the steps of `lifecycle.autostart` that are possible now, until it is active."""
        # A manager's requests can go to a killed node alone for as long as its services stay in the
        # graph (20 s), and its discovery takes time: a node that acts itself is back within 3 s.
        if not self.brings_itself_up or time.monotonic() < self._next_try_s:
            return
        if self._state_name == "unconfigured":
            self.trigger_configure()
        if self._state_name == "inactive":
            if not self.ready():
                return
            self.trigger_activate()
            if self.active:
                self.get_logger().info("active")
        # Once it has been active a manager may take it down.
        self.brings_itself_up = self._state_name in ("unconfigured", "inactive")
        self._next_try_s = time.monotonic() + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, LONGEST_WAIT_S)

    def end(self) -> None:
        """Deactivate if active; called once before the process ends."""
        if self.active:
            self.deactivate()
        self._state_name = "finalized"
        if self.failure is None:
            # Nobody waits for a node that says that it has ended.
            self.diagnostics.publish()
        self._clear()

    def set_parameters_atomically(self, parameter_list: Any) -> SetParametersResult:
        """Set parameters, all or none; an unknown one is refused with the nearest name."""
        # rclpy raises, and its service answers with a tuple of words.
        for each in parameter_list:
            if not self.has_parameter(each.name):
                return SetParametersResult(successful=False, reason=self.parameters.unknown(each.name))
        return super().set_parameters_atomically(parameter_list)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.parameters.refuse_unknown()
        try:
            if self.parameters.reasons:
                raise ValueError("; ".join(self.parameters.reasons))
            self.configure()
        except Exception as error:
            self._clear()
            return self._refuse("configured", error)
        self._state_name, self._reason, self.parameters.configured = "inactive", "", True
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            if not self.knows_time():
                raise ValueError("use_sim_time is set, but no time has been received on the clock topic")
            self.activate()
        except Exception as error:
            self._at_deactivation.close()
            return self._refuse("activated", error)
        self._state_name, self._reason = "active", ""
        return super().on_activate(state)

    def _refuse(self, what: str, error: Exception) -> TransitionCallbackReturn:
        expected = isinstance(error, (ValueError, OSError))
        self._reason = str(error) if expected else f"{type(error).__name__}: {error}; please report it"
        if self.brings_itself_up:
            self.log_once(f"not {what} yet", f"{self._reason}; tried again until it is")
        else:
            self.get_logger().error(f"not {what}: {self._reason}")
        return TransitionCallbackReturn.FAILURE

    def log_once(self, subject: str, words: str, *, error: bool = False) -> None:
        """Log what may repeat with every message or period; its count is on /diagnostics."""
        if self._events.is_news(subject, words, time.monotonic()):
            # rclpy refuses another severity at the same place.
            if error:
                self.get_logger().error(f"{subject}: {words}")
            else:
                self.get_logger().warning(f"{subject}: {words}")

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.deactivate()
        self._at_deactivation.close()
        self._state_name = "inactive"
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._clear()
        self._state_name, self.parameters.configured = "unconfigured", False
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.end()
        return super().on_shutdown(state)

    def _change_state_if_possible(self, request: Any, response: Any) -> Any:
        # A second activation, for example, raises in rclpy, which would end the process.
        try:
            return self._change_state_of_rclpy(request, response)
        except rclpy_implementation.RCLError:
            wanted = request.transition.label or request.transition.id
            self.get_logger().error(f"transition {wanted} refused: the node is {self._state_name}")
            response.success = False
            return response

    def _clear(self) -> None:
        self._at_deactivation.close()
        self._at_cleanup.close()

    def _state_health(self) -> Health:
        values: dict[str, object] = {"state": self._state_name}
        if refused := "; ".join(self.parameters.reasons):
            return Health(ERROR, refused, values)
        if self._reason and self.brings_itself_up:
            return Health(WARN, f"waits, and tries again every {LONGEST_WAIT_S:.0f} s: {self._reason}", values)
        if self.active and (silent := self.silent_because()):
            return Health(WARN, silent, values)
        awaited, managed = self._awaited(), not self.active and not self.brings_itself_up
        if (news := self._wait.news(awaited, time.monotonic())) and self._state_name != "finalized":
            self.get_logger().info(f"{self._state_name}: {news}")
        if awaited and not self._reason and not managed:
            return Health(WARN, f"waits for {awaited}", values)
        return Health(ERROR if self._reason else OK, self._reason or self._state_name, values)

    def _awaited(self) -> str:
        """Return what must come before this node works, "" for nothing."""
        if self.active:
            return self.missing_inputs()
        if self.brings_itself_up:
            return "" if self.knows_time() else f"the time on {self.resolve_topic_name('/clock')}"
        call = f"`ros2 lifecycle set {self.get_fully_qualified_name()}"
        if self._state_name == "inactive":
            return f"{call} activate`"
        by_itself = ", or a start with `-p lifecycle.autostart:=true`"
        return f"{call} configure`{by_itself}" if self._state_name == "unconfigured" else ""
