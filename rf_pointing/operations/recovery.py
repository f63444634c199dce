"""The recovery table: what is done by itself about each cause, and how the night goes on.

The table is a YAML file; `tables/recovery.yaml` is the shipped one, a station may change it.

    actions:
      reset_fault: {send: reset_antenna_fault, expect: {antenna.fault: ""}, timeout_s: 20}
    causes:
      latched_fault:
        when: {antenna.fault: {is_not: ""}}     # all hold for `for_s`; ${names} are thresholds
        for_s: ${fault_s}
        level: error
        text: "the antenna has a latched fault: {antenna.fault}"
        again: antenna.fault                     # another value of it is another message
        unless: {drive.problem: {is_not: ""}}    # while all hold: not raised, and nothing tried
        do: [reset_fault]                        # by itself
        not_by_itself: runaway|hard limit        # ... unless the text matches this expression
        reported_by_another: drive lost              # is reported when nothing is left to try
        tries: 3
        every_s: 30
        ask: look at the antenna, then reset the fault
        night: wait                              # continue, wait, weather, stop
        last: stop                               # the same once the tries are used up

`*.attribute` in `when` makes one cause of every device that has the attribute; `{device}` names it.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rf_pointing.core import is_number, leaves, names_in, parse_yaml, require_choice
from rf_pointing.operations.alarms import ERROR, WARNING, AlarmBook, AlarmParams
from rf_pointing.operations.expected_state import Condition, ExpectedState, read_conditions
from rf_pointing.operations.procedure import Procedure, procedure_from

EFFECTS = ("continue", "wait", "weather", "stop")
"""How the night goes on: as before; no pass begins; no pass begins, for the weather; it ends."""
FORGET_S = 1800.0
"""A cause that stays away for so long is a new one."""
_LEVELS = {"warning": WARNING, "error": ERROR}
_CAUSE_KEYS = {
    "when", "unless", "for_s", "level", "text", "again", "do", "not_by_itself", "reported_by_another", "tries",
    "every_s", "ask", "night", "last",
}  # fmt: skip
_PLACE = re.compile(r"^\$\{(\w+)\}$")
_SHOWN = re.compile(r"\{([\w.*]+)\}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """One row of the table."""

    name: str
    when: tuple[Condition, ...]
    unless: tuple[Condition, ...]
    for_s: float
    level: int
    text: str
    again: str
    do: tuple[str, ...]
    not_by_itself: str
    reported_by_another: str
    tries: int
    every_s: float
    ask: str
    night: str
    last: str


@dataclass(frozen=True, slots=True)
class RecoveryTable:
    """The causes in order of the file, and the actions that they name."""

    causes: tuple[Cause, ...]
    actions: Mapping[str, Procedure]


def read_table(text: str, dictionary: Mapping[str, Collection[str]], thresholds: AlarmParams) -> RecoveryTable:
    """Return the table of a YAML text; ValueError with the place of the first mistake."""
    content = parse_yaml(text)
    if (
        not isinstance(content, Mapping)
        or content.get("version") != 1
        or set(content) - {"version", "actions", "causes"}
    ):
        raise ValueError("a recovery table must have version: 1, actions and causes")
    actions = {}
    for name, given in _section("actions", content.get("actions")).items():
        block = dict(given)
        directive = {key: block.pop(key) for key in ("send", "with", "expect", "when") if key in block}
        parameters = dict.fromkeys(("azimuth", "elevation"), 0.0)
        actions[name] = procedure_from(
            {
                "version": 1, "name": name, "parameters": parameters,
                "blocks": {name: block | {"directives": [directive]}},
            },
            dictionary,
        )  # fmt: skip
    known = {name: value for name, (_, value) in leaves(thresholds).items()}
    causes = tuple(
        _cause(name, given, actions, known) for name, given in _section("causes", content.get("causes")).items()
    )
    return RecoveryTable(causes, actions)


def _section(name: str, given: Any) -> dict[str, dict[str, Any]]:
    if not isinstance(given, Mapping) or not all(isinstance(value, Mapping) for value in given.values()):
        raise ValueError(f"{name} must map names to their keys")
    return {str(key): dict(value) for key, value in given.items()}


def _cause(name: str, given: dict[str, Any], actions: Collection[str], known: Mapping[str, Any]) -> Cause:
    unknown = sorted(map(str, set(given) - _CAUSE_KEYS))
    if unknown:
        raise ValueError(f"causes.{name}: unknown {', '.join(unknown)}; known are {', '.join(sorted(_CAUSE_KEYS))}")
    values = _filled(f"causes.{name}", given, known)
    do = names_in(f"causes.{name}.do", values.get("do"))
    if strange := sorted(set(do) - set(actions)):
        raise ValueError(f"causes.{name}.do: {', '.join(strange)} must be one of {', '.join(sorted(actions))}")
    night, level = values.get("night", "continue"), values.get("level", "error")
    last = values.get("last", night)
    for key, value, choices in (("night", night, EFFECTS), ("last", last, EFFECTS), ("level", level, _LEVELS)):
        require_choice(f"causes.{name}.{key}", value, choices)
    numbers = {key: values.get(key, default) for key, default in (("for_s", 0.0), ("tries", 0), ("every_s", 10.0))}
    for key, value in numbers.items():
        if not is_number(value, 0.0):
            raise ValueError(f"causes.{name}.{key}={value!r} must be a number >= 0")
    patterns = {key: str(values.get(key, "")) for key in ("not_by_itself", "reported_by_another")}
    for key, pattern in patterns.items():
        try:
            re.compile(pattern)
        except (re.error, RecursionError, OverflowError) as error:
            raise ValueError(f"causes.{name}.{key}={pattern!r} is not a regular expression: {error}") from error
    when = read_conditions(f"causes.{name}.when", values.get("when"))
    if not when:
        raise ValueError(f"causes.{name}.when must have at least one condition")
    return Cause(
        name=name, when=when,
        unless=read_conditions(f"causes.{name}.unless", values.get("unless", {})),
        for_s=float(numbers["for_s"]), level=_LEVELS[level],
        text=str(values.get("text") or name.replace("_", " ")), again=str(values.get("again", "")),
        do=do, **patterns,
        tries=int(numbers["tries"]), every_s=float(numbers["every_s"]), ask=str(values.get("ask", "")),
        night=str(night), last=str(last),
    )  # fmt: skip


def _filled(where: str, value: Any, known: Mapping[str, Any]) -> Any:
    """Return a value of the table with the thresholds in the place of their names."""
    if isinstance(value, Mapping):
        return {key: _filled(f"{where}.{key}", each, known) for key, each in value.items()}
    if isinstance(value, list):
        return [_filled(where, each, known) for each in value]
    place = _PLACE.match(value) if isinstance(value, str) else None
    if place is None:
        return value
    if place[1] not in known:
        raise ValueError(f"{where}={value}: {place[1]} must be one of the thresholds {', '.join(known)}")
    return known[place[1]]


@dataclass(slots=True)
class Ongoing:
    """One cause that is there: since when, and what was tried."""

    cause: Cause
    device: str
    since_s: float
    raised: bool = False
    held_off: bool = False
    given_up: bool = False
    tried: int = 0
    tried_s: float = -math.inf
    text: str = ""

    @property
    def name(self) -> str:
        """Name of its alarm."""
        return f"{self.cause.name} {self.device}".strip()

    @property
    def by_itself(self) -> bool:
        """Whether anything is left to try without an operator."""
        return bool(self.cause.do) and self._permitted and self.tried < self.cause.tries

    def dealt_with(self, now_s: float) -> bool:
        """Return whether it may still go without an operator: the last try has its time as well."""
        return self.by_itself or (self._permitted and now_s - self.tried_s < self.cause.every_s)

    @property
    def _permitted(self) -> bool:
        return not (self.cause.not_by_itself and re.search(self.cause.not_by_itself, self.text))

    @property
    def reported_by_another(self) -> bool:
        """Whether another cause has left it behind, which was reported."""
        pattern = self.cause.reported_by_another
        return bool(pattern and re.search(pattern, self.text))

    @property
    def effect(self) -> str:
        """How the night goes on while it lasts."""
        return self.cause.last if self.given_up and self.cause.do else self.cause.night


@dataclass(slots=True)
class Recovery:
    """Watches the devices by the table, keeps the alarms, and says which action is due.

    While it does not act nothing is tried, so an operator is needed at once.
    """

    table: RecoveryTable
    expected_state: ExpectedState
    book: AlarmBook
    acts: bool = True
    ongoing: dict[str, Ongoing] = field(default_factory=dict)
    _gone: dict[str, tuple[int, float, float]] = field(default_factory=dict)
    """Causes that have gone: number and time of the trials, and when the cause went."""

    def step(self, now_s: float) -> None:
        """Find what is there now, raise and clear the alarms."""
        present: set[str] = set()
        for cause in self.table.causes:
            for device in self._devices(cause):
                if not self._hold(cause.when, device, now_s):
                    continue
                name = f"{cause.name} {device}".strip()
                present.add(name)
                one = self.ongoing.setdefault(name, self._begun(name, cause, device, now_s))
                one.held_off = bool(cause.unless) and self._hold(cause.unless, device, now_s)
                if one.held_off and not one.raised:
                    one.since_s = now_s
                elif not one.held_off and now_s - one.since_s >= cause.for_s:
                    begins, one.raised, one.text = not one.raised, True, self._text(cause.text, device)
                    if begins and one.reported_by_another:
                        one.tried, one.tried_s = 0, -math.inf
                    one.given_up = not one.dealt_with(now_s)
                    dealt_with = self.acts and not one.given_up
                    if dealt_with and one.reported_by_another:
                        continue
                    ask = "" if dealt_with else self._text(cause.ask, device)
                    about = self._text(f"{{{cause.again}}}", device) if cause.again else ""
                    self.book.raise_(name, cause.level, one.text, now_s, ask, about)
        for name in [name for name in self.ongoing if name not in present]:
            one = self.ongoing.pop(name)
            if not one.reported_by_another:
                self._gone[name] = one.tried, one.tried_s, now_s
        # Also those of before a restart whose causes have gone meanwhile.
        for alarm in self.book.lasting:
            if alarm.name not in self.ongoing and alarm.name.partition(" ")[0] in {c.name for c in self.table.causes}:
                self.book.clear(alarm.name, now_s)
        self.book.remind(now_s)

    def _begun(self, name: str, cause: Cause, device: str, now_s: float) -> Ongoing:
        """Return a cause that is there; one that comes back soon has the tries of before.

        What another cause leaves behind has tries of its own each time: six cuts of a cable in half
        an hour are six outages, not a fault that no reset helps.
        """
        if name not in self._gone or now_s - self._gone[name][2] > FORGET_S:
            return Ongoing(cause, device, now_s)
        tried, tried_s, _ = self._gone[name]
        return Ongoing(cause, device, now_s, tried=tried, tried_s=tried_s)

    def set_back(self, by_s: float) -> None:
        """Go on with a clock that was set back: every wait stays as long as it was."""
        for one in self.ongoing.values():
            one.since_s, one.tried_s = one.since_s - by_s, one.tried_s - by_s
        self._gone = {
            name: (tried, tried_s - by_s, gone_s - by_s) for name, (tried, tried_s, gone_s) in self._gone.items()
        }

    def due(self, now_s: float) -> tuple[str, str] | None:
        """Return the name of the cause and the action to try now, or None."""
        for one in self.ongoing.values() if self.acts else ():
            waits = one.held_off or now_s - one.tried_s < one.cause.every_s
            if one.raised and one.by_itself and not waits:
                return one.name, one.cause.do[one.tried % len(one.cause.do)]
        return None

    def note_try(self, name: str, now_s: float) -> None:
        """Count that the action of a cause has been sent."""
        if (one := self.ongoing.get(name)) is not None:
            one.tried, one.tried_s = one.tried + 1, now_s

    def effect(self) -> tuple[str, str]:
        """Return how the night goes on, by the gravest cause, and that cause's text."""
        raised = [one for one in self.ongoing.values() if one.raised]
        worst = max(raised, key=lambda one: EFFECTS.index(one.effect), default=None)
        return ("continue", "") if worst is None else (worst.effect, worst.text)

    def _devices(self, cause: Cause) -> list[str]:
        marked = [each.attribute.partition(".")[2] for each in cause.when if each.attribute.startswith("*.")]
        if not marked:
            return [""]
        endings = tuple(f".{each}" for each in marked)
        return sorted({name.partition(".")[0] for name in self.expected_state.attributes() if name.endswith(endings)})

    def _hold(self, conditions: Sequence[Condition], device: str, now_s: float) -> bool:
        unmet = self.expected_state.reason_not_met
        return not any(unmet(_of(each, device), now_s) for each in conditions)

    def _text(self, text: str, device: str) -> str:
        def shown(match: re.Match[str]) -> str:
            name = match[1]
            if name == "device":
                return device
            seen = self.expected_state.actual(name.replace("*", device, 1))
            if seen is None:
                return "unknown"
            return f"{seen.value:.4g}" if isinstance(seen.value, float) else str(seen.value)

        return _SHOWN.sub(shown, text)

    # State

    def state(self) -> dict[str, tuple[int, float, float | None]]:
        """Return number and time of the tries of each cause, and since when it has been away."""
        ongoing = self.ongoing.items()
        tries = {name: (one.tried, one.tried_s, None) for name, one in ongoing if one.tried}
        return {**{name: row for name, row in self._gone.items() if row[0]}, **tries}

    def restore(self, state: Mapping[str, Sequence[Any]], now_s: float) -> None:
        """Take back what `state` has returned: a restart gives no cause further tries."""
        self._gone = {
            name: (tried, tried_s, now_s if gone_s is None else gone_s)
            for name, (tried, tried_s, gone_s) in state.items()
        }


def _of(condition: Condition, device: str) -> Condition:
    if not condition.attribute.startswith("*."):
        return condition
    return Condition(
        attribute=device + condition.attribute[1:], test=condition.test, wanted=condition.wanted,
        max_age_s=condition.max_age_s,
    )  # fmt: skip
