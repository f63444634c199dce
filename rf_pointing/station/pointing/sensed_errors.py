"""The errors that the trackers have sent of late, and which of them a period may use.

Only errors about the time before the last period are used, so the result does not depend on how fast messages travel.
"""

import math
from collections import deque

from rf_pointing.core import PointingError

__all__ = ["SENSOR_CHOICES", "SensedErrors", "newest", "trusted"]

KEPT = 20
LEAST_AGE_PERIODS = 0.75
"""Age from which an error is used: older than any of the period that ends, whether stamped at its middle or its end."""
SCANNING = ("conscan", "steptrack")
SENSOR_CHOICES = {
    "program": "none",
    "monopulse": "monopulse",
    "conscan": "conscan",
    "steptrack": "steptrack",
    "auto": "auto",
}
"""Sensor as the operator names it, and as the state table does."""


class SensedErrors:
    """Errors of the sensors that a pass may use; `sensor` is one of the state table's, or auto."""

    def __init__(self) -> None:
        self._errors: deque[PointingError] = deque(maxlen=KEPT)

    def clear(self) -> None:
        """Forget those of the last pass."""
        self._errors.clear()

    def take(self, error: PointingError, sensor: str) -> None:
        """Note what a sensor measured; only those that the pass may use count."""
        if sensor in ("auto", error.sensor) or (sensor == "steptrack" and error.sensor == "conscan"):
            self._errors.append(error)

    def awaited(self, t_s: float, mode: str, period_s: float, oldest_s: float) -> bool:
        """Whether a sensor that reports every period has not reported yet what the period at `t_s` should use."""
        last_s = {error.sensor: error.t_s for error in self._errors}
        sensor = mode if mode in SCANNING else "monopulse"
        return 2.0 * period_s <= t_s - last_s.get(sensor, -math.inf) < oldest_s

    def usable(self, t_s: float, period_s: float, oldest_s: float) -> list[PointingError]:
        """Return the errors that are about the time before the last period, the newest first, none older than `oldest_s`.

        One about the period that ends now may have arrived already, or not: it belongs to the next period in any case.
        """
        newest_t_s = t_s - LEAST_AGE_PERIODS * period_s
        return [error for error in reversed(self._errors) if t_s - oldest_s <= error.t_s <= newest_t_s]


def newest(errors: list[PointingError], mode: str) -> PointingError | None:
    """Return the newest of usable errors, that of the sensor in use as long as it reports."""
    in_use = (error for error in errors if error.sensor == mode)
    return next(in_use, next(iter(errors), None))


def trusted(errors: list[PointingError], sensor: str) -> bool:
    """Return whether the sensor's newest estimate may be used; a scan is trusted until its first one."""
    reports = [error for error in errors if error.sensor == sensor]
    if sensor == "monopulse":
        return bool(reports) and reports[0].valid
    return not reports or reports[0].valid or not reports[0].estimated
