"""Expected and actual state of the attributes of devices.

An attribute is named `device.attribute`, as in `antenna.mode`.  Whatever is published about it sets
the actual value: status messages, responses, an operator.  Only values and their stamps count, so
messages may be lost, repeated or arrive out of order.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rf_pointing.core.checks import is_number

Value = Any
"""A number or a text; what is only handed on, as the window of a pass, may be any plain value."""
_NUMBERS = ("above", "below")
_TESTS = ("is", "is_not", "one_of", *_NUMBERS)
OLDEST_S = 10.0
"""Age in s from which a value is not trusted, unless a condition states another."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One test of one attribute; `wanted` is a value, two or more for `one_of`.

    `test` is is, is_not, one_of, above or below; a value older than `max_age_s` does not satisfy.
    """

    attribute: str
    test: str
    wanted: Any
    max_age_s: float = OLDEST_S

    @property
    def demand(self) -> str:
        """The required value in words."""
        wanted = " or ".join(map(_shown, self.wanted)) if self.test == "one_of" else _shown(self.wanted)
        test = {"is": "be", "is_not": "not be", "one_of": "be"}.get(self.test, f"be {self.test}")
        return f"must {test} {wanted}"

    def __str__(self) -> str:
        return f"{self.words} {self.demand}"

    @property
    def words(self) -> str:
        """The attribute as an operator reads it: antenna fault for antenna.fault."""
        return self.attribute.replace(".", " ").replace("_", " ")

    def holds(self, value: Value) -> bool:
        """Return whether a value satisfies the test."""
        if self.test == "one_of":
            return value in self.wanted
        if self.test in _NUMBERS:
            # NaN satisfies neither.
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            return number and (value > self.wanted if self.test == "above" else value < self.wanted)
        return bool(value == self.wanted) == (self.test == "is")


def read_conditions(where: str, given: Any) -> tuple[Condition, ...]:
    """Return the conditions of a mapping from attribute to value, or to tests.

    `antenna.mode: parked` stands for `antenna.mode: {is: parked}`; `max_age_s` may be with the
    tests.  Raises ValueError with `where` and the key.
    """
    if not isinstance(given, Mapping):
        raise ValueError(f"{where} must map attributes to values")
    return tuple(each for name, wanted in given.items() for each in _conditions_of(where, str(name), wanted))


def _conditions_of(where: str, name: str, wanted: Any) -> list[Condition]:
    device, _, attribute = name.partition(".")
    if not device or not attribute:
        raise ValueError(f"{where}: {name!r} must name device and attribute, as in antenna.mode")
    tests = dict(wanted) if isinstance(wanted, Mapping) else {"is": wanted}
    age_s = tests.pop("max_age_s", OLDEST_S)
    if not is_number(age_s) or age_s <= 0.0:
        raise ValueError(f"{where}: {name}: max_age_s={age_s!r} must be > 0 s")
    unknown = sorted(map(str, set(tests) - set(_TESTS)))
    if unknown or not tests:
        raise ValueError(f"{where}: {name}: {', '.join(unknown) or 'no test'}: must be one of {', '.join(_TESTS)}")
    for test, value in tests.items():
        if test in _NUMBERS and not is_number(value):
            raise ValueError(f"{where}: {name}: {test}={value!r} must be a number")
        if test == "one_of" and not isinstance(value, (list, tuple)):
            raise ValueError(f"{where}: {name}: one_of={value!r} must be a list")
    return [
        Condition(attribute=name, test=test, wanted=tuple(value) if test == "one_of" else value, max_age_s=float(age_s))
        for test, value in tests.items()
    ]


@dataclass(frozen=True, slots=True)
class Observed:
    """The newest value of an attribute."""

    value: Value
    t_s: float


class ExpectedState:
    """The newest value of every attribute, against which conditions are held."""

    def __init__(self) -> None:
        self._actual: dict[str, Observed] = {}

    def observe(self, attribute: str, value: Value, t_s: float) -> None:
        """Take a value with its stamp; an older one than the present changes nothing."""
        present = self._actual.get(attribute)
        if present is None or t_s >= present.t_s:
            self._actual[attribute] = Observed(value, t_s)

    def set_back(self, by_s: float) -> None:
        """Go on with a clock that was set back: every value stays as old as it was."""
        self._actual = {name: Observed(seen.value, seen.t_s - by_s) for name, seen in self._actual.items()}

    def actual(self, attribute: str) -> Observed | None:
        """Return the newest value, None if nothing was ever published."""
        return self._actual.get(attribute)

    def value(self, attribute: str) -> Value | None:
        """Return the newest value itself, None if nothing was ever published."""
        seen = self._actual.get(attribute)
        return None if seen is None else seen.value

    def is_fresh(self, attribute: str, now_s: float, oldest_s: float) -> bool:
        """Return whether an attribute was published at most `oldest_s` ago."""
        seen = self._actual.get(attribute)
        return seen is not None and now_s - seen.t_s <= oldest_s

    def reason_not_met(self, condition: Condition, now_s: float, since_s: float = -math.inf) -> str:
        """Return why a condition does not hold at `now_s`, "" if it does.

        Values from before `since_s` do not count: what is to be shown is shown afterwards.
        """
        seen = self._actual.get(condition.attribute)
        if seen is None:
            return f"{condition.words} is unknown, {condition.demand}"
        if seen.t_s < since_s:
            return f"{condition.words} has not been reported since the directive, {condition.demand}"
        if now_s - seen.t_s > condition.max_age_s:
            return f"{condition.words} is {now_s - seen.t_s:.1f} s old, must be <= {condition.max_age_s:g} s"
        if not condition.holds(seen.value):
            return f"{condition.words} is {_shown(seen.value)}, {condition.demand}"
        return ""

    def shown(self, condition: Condition) -> str:
        """Return the present value of a condition's attribute in words."""
        seen = self._actual.get(condition.attribute)
        return f"{condition.words} is {_shown(seen.value) if seen else 'unknown'}"

    def attributes(self) -> dict[str, Observed]:
        """Return every attribute with its newest value."""
        return dict(self._actual)


def _shown(value: Any) -> str:
    # True and "" are words of a program.
    return {"": "none", "True": "yes", "False": "no"}.get(str(value), str(value))
