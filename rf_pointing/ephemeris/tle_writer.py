"""Writing two-line elements; what does not fit the columns is refused by name, never cut off."""

import math
from datetime import UTC, datetime

from rf_pointing.ephemeris.alpha5 import alpha5_from_number
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.time_scales import DAY_S
from rf_pointing.ephemeris.tle import checksum

__all__ = ["tle_lines"]


def tle_lines(elements: Elements) -> tuple[str, str]:
    """Return both lines; the inverse is `read_elements`.

    Raises ValueError for a catalogue number above 339999, an epoch outside 1957-2056 and numbers too large for their
    columns.
    """
    number = alpha5_from_number(elements.catalogue_number)
    day = DAY_S / (2.0 * math.pi)
    first = (
        f"1 {number}{elements.classification:1.1s} {_designator(elements.international_designator):8.8s} "
        f"{_epoch(elements.epoch_t_s)} {_fraction(0.5 * elements.mean_motion_dot_rad_s2 * day * DAY_S)} "
        f"{_exponent('mean_motion_ddot_rad_s3', elements.mean_motion_ddot_rad_s3 * day * DAY_S**2 / 6.0)} "
        f"{_exponent('drag_per_earth_radius', elements.drag_per_earth_radius)} 0 {elements.element_set_number:4d}"
    )
    second = (
        f"2 {number} {math.degrees(elements.inclination_rad):8.4f} {_degrees(elements.ascending_node_rad)} "
        f"{round(elements.eccentricity * 1e7):07d} {_degrees(elements.argument_of_perigee_rad)} "
        f"{_degrees(elements.mean_anomaly_rad)} {elements.mean_motion_rad_s * day:11.8f}"
        f"{elements.revolution_number:5d}"
    )
    for line in (first, second):
        if len(line) != 68:
            raise ValueError(f"elements of {elements.name} do not fit the columns of a TLE: {line!r}")
    return first + str(checksum(first)), second + str(checksum(second))


def _degrees(angle_rad: float) -> str:
    degrees = round(math.degrees(angle_rad) % 360.0, 4) % 360.0
    return f"{degrees:8.4f}"


def _epoch(t_s: float) -> str:
    stamp = datetime.fromtimestamp(t_s, tz=UTC)
    if not 1957 <= stamp.year <= 2056:
        raise ValueError(f"epoch_t_s={t_s} is in {stamp.year}, must be in 1957 to 2056 to fit a TLE")
    day = 1.0 + (t_s - datetime(stamp.year, 1, 1, tzinfo=UTC).timestamp()) / DAY_S
    return f"{stamp.year % 100:02d}{day:012.8f}"


def _fraction(value: float) -> str:
    if not abs(value) < 0.999999995:
        raise ValueError(f"mean_motion_dot_rad_s2 is {value} rev/day^2, must be below 1 to fit a TLE")
    return f"{value:+.8f}".replace("+0.", " .").replace("-0.", "-.")


def _exponent(name: str, value: float) -> str:
    """Return ' 28098-4' for 0.28098e-4; what is below the smallest exponent is zero."""
    if value == 0.0:
        return " 00000-0"
    mantissa, exponent = f"{abs(value):.4e}".split("e")
    power = int(exponent) + 1
    if power > 9:
        raise ValueError(f"{name}={value} must be below 1e9 to fit a TLE")
    if power < -9:
        return " 00000-0"
    digits = mantissa.replace(".", "")
    return f"{'-' if value < 0.0 else ' '}{digits}{'+' if power > 0 else '-'}{abs(power)}"


def _designator(designator: str) -> str:
    """Return 98067A for 1998-067A; other text as it stands."""
    year, separator, rest = designator.partition("-")
    return f"{year[2:]}{rest}" if separator and len(year) == 4 else designator
