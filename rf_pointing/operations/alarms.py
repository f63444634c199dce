"""Alarms: one for every cause, raised, acknowledged and cleared; messages without storm or silence.

A cause that comes and goes is one alarm that counts.  The book compares what it reported last with
what is, and reports the difference: the start and the end of a cause, and at once what is worse,
new, or needs somebody.  While somebody is needed and has not acknowledged, it reports that again
each `quiet_s`.  A cause that flickers is reported again after `quiet_s`, one that needs somebody
sooner (`RETURN_S` for each return), and never dropped: what lasts by then is reported.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rf_pointing.core import Params, parameter

WARNING, ERROR = 1, 2
MOST_HISTORY = 2000
"""Rows of the history that are kept over a restart."""
RETURN_S = 60.0
"""Patience with a cause that needs somebody, for each of its returns since it was acknowledged."""


@dataclass(frozen=True, kw_only=True)
class AlarmParams(Params):
    """Thresholds and durations of the alarms; the recovery table refers to them by name."""

    node_silent_s: float = parameter(5.0, "a node without a sign of life for so long is lost", 1.0, 600.0)
    drive_lost_s: float = parameter(3.0, "so long without the drive", 0.1, 600.0)
    signal_lost_s: float = parameter(30.0, "so long without the signal in a pass", 1.0, 3600.0)
    disk_free_gb: float = parameter(2.0, "free space of the disk of the recordings", 0.0, 1e5)
    elements_stale_h: float = parameter(72.0, "age of the elements of the next pass", 0.1, 1e5)
    fault_s: float = parameter(2.0, "a fault latched for so long is dealt with", 0.0, 600.0)
    clock_ms: float = parameter(100.0, "offset of the clock of a node's computer", 1.0, 1e5)
    memory_free_mb: float = parameter(100.0, "free memory of the computer", 0.0, 1e6)
    check_failed_s: float = parameter(5.0, "a check is in error for so long", 0.0, 3600.0)
    nodes: str = parameter("", "own nodes whose errors and silence are alarms, separated by commas")
    not_ready_s: float = parameter(900.0, "from so long before a pass whatever it needs must be ready", 60.0, 1e5)
    quiet_s: float = parameter(600.0, "between two messages of one lasting cause", 0.0, 1e5)


@dataclass(slots=True)
class Alarm:
    """One cause; `cleared_t_s` is None while it lasts.

    `ask` is what somebody should do, "" while nobody is needed.  `about` is which of several things
    it is, as the words of a fault: another one is news.  `reported` is what was reported last:
    the level (0: nothing, or its end), whether somebody is needed, and about what.
    """

    name: str
    level: int
    message: str
    raised_t_s: float
    ask: str = ""
    cleared_t_s: float | None = None
    acknowledged: bool = False
    count: int = 0
    notified_t_s: float | None = None
    about: str = ""
    reported: tuple[int, bool, str] = (0, False, "")

    @property
    def lasts(self) -> bool:
        """Whether the cause is there now."""
        return self.cleared_t_s is None

    @property
    def news(self) -> str:
        """Event of `Notify` that has not been reported, "" for nothing."""
        level, needed, about = self.reported
        if not self.lasts:
            return "cleared" if level else ""
        if not level:
            return "raised"
        if self.level > level:
            return "worse"
        if self.about != about:
            return "changed"
        if not self.ask:
            return ""
        return "reminder" if needed and not self.acknowledged else "" if needed else "urgent"

    def patience_s(self, quiet_s: float) -> float:
        """Return how long after the last message the news is reported."""
        if self.news == "raised":
            return min(quiet_s, RETURN_S * max(0, self.count - 1)) if self.ask else quiet_s
        return quiet_s if self.news == "reminder" else 0.0


Notify = Callable[[str, Alarm], None]
"""Takes "raised", "worse", "changed", "urgent", "reminder" or "cleared" and the alarm."""


@dataclass(slots=True)
class AlarmBook:
    """All alarms of a station by their names; `notify` gets what an operator should receive.

    `messages` counts these; while the book is `held` only ends of what it has reported are, and
    afterwards what lasts.
    """

    notify: Notify
    quiet_s: float = 600.0
    alarms: dict[str, Alarm] = field(default_factory=dict)
    history: list[tuple[float, str, str, int, str]] = field(default_factory=list)
    """Time, event, name, level and message of whatever happened to an alarm."""
    messages: int = 0
    held: bool = False

    @property
    def lasting(self) -> list[Alarm]:
        """The alarms whose causes are there, the worst first."""
        return sorted((each for each in self.alarms.values() if each.lasts), key=lambda a: (-a.level, a.raised_t_s))

    def raise_(
        self, name: str, level: int, message: str, t_s: float, ask: str = "", about: str = ""
    ) -> None:  # fmt: skip
        """Note that a cause is there; a further call only keeps its message up to date."""
        alarm, event = self.alarms.get(name), ""
        if alarm is None or not alarm.lasts:
            event = "raised"
            alarm = self.alarms.setdefault(name, Alarm(name, level, message, t_s))
            alarm.cleared_t_s, alarm.raised_t_s, alarm.level = None, t_s, level
            alarm.count += 1
        elif level > alarm.level:
            event, alarm.level = "worse", level
        elif about != alarm.about:
            event = "changed"
        elif ask and not alarm.ask:
            # Whatever could be tried without an operator has been tried.
            event = "urgent"
        alarm.message, alarm.ask, alarm.about = message, ask, about
        if event:
            alarm.acknowledged = False
            self.history.append((t_s, event, name, alarm.level, message))
        self._tell(alarm, t_s)

    def clear(self, name: str, t_s: float) -> None:
        """Note that a cause has gone."""
        alarm = self.alarms.get(name)
        if alarm is not None and alarm.lasts:
            alarm.cleared_t_s = t_s
            self.history.append((t_s, "cleared", name, alarm.level, alarm.message))
            self._tell(alarm, t_s)

    def remind(self, t_s: float) -> None:
        """Tell what is due; call it regularly."""
        for alarm in list(self.alarms.values()):
            self._tell(alarm, t_s)

    def note_of_another(self, t_s: float, event: str, name: str, level: int, message: str) -> None:
        """Note once, in the history alone, what another node has reported."""
        row = t_s, event, name, level, message
        if len(self.history) < MOST_HISTORY and row not in self.history:  # Nobody signs it: no flood.
            self.history.append(row)

    def acknowledge(self, name: str, t_s: float) -> list[str]:
        """Note that an operator knows of an alarm, of all if the name is empty; return which."""
        if name and name not in self.alarms:
            raise ValueError(f"there is no alarm {name!r}; there are: {', '.join(self.alarms) or 'none'}")
        known = [self.alarms[name]] if name else self.lasting
        for alarm in known:
            alarm.acknowledged, alarm.count = True, 0
            self.history.append((t_s, "acknowledged", alarm.name, alarm.level, alarm.message))
            self._tell(alarm, t_s)
        return [alarm.name for alarm in known]

    def _tell(self, alarm: Alarm, t_s: float) -> None:
        event, last_s = alarm.news, alarm.notified_t_s
        # A clock that was set back must not silence an alarm.
        waited = last_s is None or abs(t_s - last_s) >= alarm.patience_s(self.quiet_s)
        # What was reported here ends here, whoever reports meanwhile.
        if not event or (self.held and event != "cleared") or not waited:
            return
        present = alarm.level, bool(alarm.ask), alarm.about
        alarm.notified_t_s, alarm.reported = t_s, present if alarm.lasts else (0, False, "")
        self.messages += 1
        self.notify(event, alarm)

    # State

    def state(self) -> dict[str, Any]:
        """Return the alarms as plain values; `restore` takes them back."""
        names = Alarm.__slots__
        return {
            "alarms": [{key: getattr(alarm, key) for key in names} for alarm in self.alarms.values()],
            "history": [list(row) for row in self.history[-MOST_HISTORY:]],
            "messages": self.messages,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take back what `state` has returned."""
        self.alarms = {row["name"]: Alarm(**row) for row in state["alarms"]}
        for alarm in self.alarms.values():
            level, needed, about = alarm.reported
            alarm.reported = level, needed, about
        self.history = [tuple(row) for row in state["history"]]
        self.messages = state.get("messages", 0)
