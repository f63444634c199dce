"""Alarms: one for every cause, raised, acknowledged and cleared; messages without a storm.

A cause that comes and goes is one alarm that counts.  A message goes out when an alarm is raised,
when it gets worse or needs an operator, and when it is cleared; otherwise not again within
`quiet_s` of the last one of its cause.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rf_pointing.core import Params, parameter

WARNING, ERROR = 1, 2
MOST_HISTORY = 2000
"""Rows of the history that are kept over a restart."""


@dataclass(frozen=True, kw_only=True)
class AlarmParams(Params):
    """Thresholds and durations of the alarms; the recovery table refers to them by name."""

    node_silent_s: float = parameter(5.0, "a node without a sign of life for so long is lost", low=1.0, high=600.0)
    drive_lost_s: float = parameter(3.0, "so long without the drive", low=0.1, high=600.0)
    signal_lost_s: float = parameter(30.0, "so long without the signal in a pass", low=1.0, high=3600.0)
    disk_free_gb: float = parameter(2.0, "free space of the disk of the recordings", low=0.0, high=1e5)
    elements_stale_h: float = parameter(72.0, "age of the elements of the next pass", low=0.1, high=1e5)
    fault_s: float = parameter(2.0, "a fault latched for so long is dealt with", low=0.0, high=600.0)
    quiet_s: float = parameter(600.0, "no second message of one cause within this time", low=0.0, high=1e5)


@dataclass(slots=True)
class Alarm:
    """One cause; `cleared_t_s` is None while it lasts."""

    name: str
    level: int
    message: str
    raised_t_s: float
    ask: str = ""
    cleared_t_s: float | None = None
    acknowledged: bool = False
    count: int = 1
    notified_t_s: float | None = None

    @property
    def lasts(self) -> bool:
        """Whether the cause is there now."""
        return self.cleared_t_s is None


Notify = Callable[[str, Alarm], None]
"""Takes "raised", "worse", "urgent" or "cleared" and the alarm."""


@dataclass(slots=True)
class AlarmBook:
    """All alarms of a night by their names; `notify` gets what an operator should receive."""

    notify: Notify
    quiet_s: float = 600.0
    alarms: dict[str, Alarm] = field(default_factory=dict)
    history: list[tuple[float, str, str, int, str]] = field(default_factory=list)
    """Time, event, name, level and message of whatever happened to an alarm."""

    @property
    def lasting(self) -> list[Alarm]:
        """The alarms whose causes are there, the worst first."""
        return sorted((each for each in self.alarms.values() if each.lasts), key=lambda a: (-a.level, a.raised_t_s))

    def raise_(self, name: str, level: int, message: str, t_s: float, ask: str = "") -> None:
        """Note that a cause is there; a further call only keeps its message up to date."""
        alarm = self.alarms.get(name)
        if alarm is None:
            alarm = self.alarms[name] = Alarm(name, level, message, t_s, ask)
            self._tell("raised", alarm, t_s)
        elif not alarm.lasts:
            needed = bool(ask) and not alarm.ask
            alarm.cleared_t_s, alarm.raised_t_s, alarm.level = None, t_s, level
            alarm.message, alarm.ask, alarm.acknowledged = message, ask, False
            alarm.count += 1
            self._tell("raised", alarm, t_s, always=needed)
        elif level > alarm.level:
            alarm.level, alarm.message, alarm.ask, alarm.acknowledged = level, message, ask, False
            self._tell("worse", alarm, t_s, always=True)
        elif ask and not alarm.ask:
            # Whatever could be tried without an operator has been tried.
            alarm.message, alarm.ask, alarm.acknowledged = message, ask, False
            self._tell("urgent", alarm, t_s, always=True)
        else:
            alarm.message, alarm.ask = message, ask

    def clear(self, name: str, t_s: float) -> None:
        """Note that a cause has gone."""
        alarm = self.alarms.get(name)
        if alarm is not None and alarm.lasts:
            alarm.cleared_t_s = t_s
            self._tell("cleared", alarm, t_s, always=alarm.notified_t_s == alarm.raised_t_s)

    def acknowledge(self, name: str, t_s: float) -> list[str]:
        """Note that an operator knows of an alarm, of all if the name is empty; return which."""
        if name and name not in self.alarms:
            raise ValueError(f"there is no alarm {name!r}; there are: {', '.join(self.alarms) or 'none'}")
        known = [self.alarms[name]] if name else self.lasting
        for alarm in known:
            alarm.acknowledged, alarm.count = True, 0
            self.history.append((t_s, "acknowledged", alarm.name, alarm.level, alarm.message))
        return [alarm.name for alarm in known]

    def _tell(self, event: str, alarm: Alarm, t_s: float, *, always: bool = False) -> None:
        self.history.append((t_s, event, alarm.name, alarm.level, alarm.message))
        last_s = alarm.notified_t_s
        if not always and last_s is not None and t_s - last_s < self.quiet_s:
            return
        alarm.notified_t_s = t_s
        self.notify(event, alarm)

    # State

    def state(self) -> dict[str, Any]:
        """Return the alarms as plain values; `restore` takes them back."""
        names = Alarm.__slots__
        return {
            "alarms": [{key: getattr(alarm, key) for key in names} for alarm in self.alarms.values()],
            "history": [list(row) for row in self.history[-MOST_HISTORY:]],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take back what `state` has returned."""
        self.alarms = {row["name"]: Alarm(**row) for row in state["alarms"]}
        self.history = [tuple(row) for row in state["history"]]
