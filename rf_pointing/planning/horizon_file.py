"""Horizon masks as surveys and programs write them: azimuth and lowest elevation, a point a line.

Tables may have blanks, tabs, commas or semicolons, comments after `#`, `;` or `//`, a head that
names the columns, and azimuths from 0 to 360 or -180 to 180 deg.  One row or one column of heights
alone is even from north over east.  The points may begin anywhere and fall: they are sorted.  Two
heights at one azimuth are a wall.
"""

import math
import re
from collections.abc import Sequence

Point = tuple[int, float, float]
"""Line, azimuth and elevation in deg."""
WALL_DEG = 1e-3
"""Width of a wall: the mask is a function of the azimuth."""
FEWEST_HEIGHTS = 36
_COLUMNS = ({"az", "azimuth", "bearing", "heading"}, {"alt", "altitude", "angle", "el", "elevation"})


def read_horizon(text: str) -> tuple[list[Point], list[tuple[int, str]]]:
    """Return the points of a text in its order, and the lines that hold none."""
    points: list[Point] = []
    wrong: list[tuple[int, str]] = []
    columns: list[int] | None = None
    for number, raw in enumerate(text.splitlines(), start=1):
        line = re.sub(r"(#|//|^\s*;).*|°", "", raw).strip()
        # Semicolons between numbers leave the comma to the decimals.
        fields = re.split(r"\s*;\s*", line.replace(",", ".")) if ";" in line else re.split(r"\s*,\s*|\s+", line)
        fields = [field for field in fields if field]
        if not fields:
            continue
        numbers = [_number(field) for field in fields]
        if columns is None and not points and all(value is None for value in numbers):
            columns = _columns(fields)
            continue
        if not points and columns is None and (even := _even([(number, value) for value in numbers])):
            return even, []
        row = [numbers[k] for k in columns if k < len(numbers)] if columns else numbers
        if len(row) != 2 or row[0] is None or row[1] is None:
            wrong.append((number, raw.strip()))
        else:
            points.append((number, row[0], row[1]))
    column = [] if points else _even([(number, _number(text)) for number, text in wrong])
    return (column, []) if column else (points, wrong)


def _even(heights: Sequence[tuple[int, float | None]]) -> list[Point]:
    """Return the points of heights that stand evenly around, empty unless their number says so."""
    if len(heights) < FEWEST_HEIGHTS or 360 % len(heights):
        return []
    step = 360.0 / len(heights)
    return [(line, k * step, math.nan if height is None else height) for k, (line, height) in enumerate(heights)]


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _columns(names: Sequence[str]) -> list[int] | None:
    """Return where a head has azimuth and elevation, None where it does not say."""
    words = [re.split(r"[^a-z]", name.casefold().strip("\"'"))[0] for name in names]
    found = [next((k for k, word in enumerate(words) if word in column), -1) for column in _COLUMNS]
    return found if min(found) >= 0 else None


def in_order(points: Sequence[Point]) -> list[Point]:
    """Return points that go once around, either way and from anywhere, rising from north.

    Others come back as they are.  Of two points at one azimuth the second is moved by `WALL_DEG`.
    """
    around = [(line, azimuth % 360.0 if azimuth < 0.0 else azimuth, height) for line, azimuth, height in points]
    if len(around) > 1 and around[-1][1] - around[0][1] == 360.0:
        # Surveys often repeat the first point at 360 deg.
        around.pop()
    steps = [b[1] - a[1] for a, b in zip(around, [*around[1:], *around[:1]], strict=True)]
    if sum(step < 0.0 for step in steps) > 1 == sum(step > 0.0 for step in steps):
        around.reverse()
    elif sum(step < 0.0 for step in steps) > 1:
        return list(points)
    first = min(range(len(around)), key=lambda k: (around[k][1], k), default=0)
    # A wall at the lowest azimuth may stand across the begin of the list.
    while len(around) > 1 and around[first - 1][1] == around[first][1] and first > -len(around):
        first -= 1
    around = around[first:] + around[:first]
    for k in range(1, len(around)):
        line, azimuth, height = around[k]
        if azimuth == around[k - 1][1]:
            around[k] = line, azimuth + WALL_DEG, height
    return around
