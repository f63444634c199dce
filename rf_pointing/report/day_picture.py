"""Pictures of the plan of many satellites: time line of each, and the tracked passes on the sky.

A network has a line for each station and for each target.

It has room for `MOST_ROWS` satellites and `MOST_PATHS` paths, and says how many it leaves out.
"""

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.planning import HorizonMask
from rf_pointing.report.picture_style import draw_hills, figure, sky_axes, sky_place
from rf_pointing.report.plan_picture import COLOURS as STATION_COLOURS
from rf_pointing.station.pointing.multi_satellite_plan import DayPass, DayPlan, Fate

FEWEST_ROWS, MOST_ROWS = 8, 45
MOST_PATHS = 80
MOST_SUNS = 24
FEW_PATHS = 12
"""Up to so many paths have the time of their rise on them."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of the priorities, the highest first; lower ones share the last."""
YIELDS_COLOUR = "#c9ccd1"
BARRED_COLOUR = "#8a1c1c"
ROW_IN = 0.2


def draw_day(plan: DayPlan, station: str, mask: HorizonMask, path: Path) -> None:
    """Write the picture of `plan` to `path`."""
    tracked = [item for item in plan.passes if item.fate is Fate.TRACKED]
    rows = _rows(plan)
    priorities = sorted({item.priority for item in plan.passes}, reverse=True)
    colours = {p: COLOURS[min(k, len(COLOURS) - 1)] for k, p in enumerate(priorities)}
    begin, end = (datetime.fromtimestamp(plan.start_t_s + s, UTC) for s in (0.0, plan.duration_s))
    with figure(path, 15.0, max(6.0, 1.6 + ROW_IN * (len(rows) + 1))) as drawn:
        when = f"{begin:%Y-%m-%d %H:%M} to {end:%Y-%m-%d %H:%M} UTC"
        drawn.suptitle(f"{station}, {when}: {len(tracked)} of {len(plan.passes)} passes tracked")
        lines, sky = drawn.subplots(1, 2, width_ratios=[1.75, 1.0])
        position = sky.get_subplotspec()
        sky.remove()
        _draw_lines(lines, plan, rows, colours)
        _draw_sky(drawn.add_subplot(position, projection="polar"), tracked, rows, mask, colours)


def draw_network(days: Mapping[str, DayPlan], path: Path) -> None:
    """Write the picture of the plans of stations by name to `path`.

    Contacts have the colour of their station, what is seen and not tracked is grey.
    """
    colours = {name: STATION_COLOURS[k % len(STATION_COLOURS)] for k, name in enumerate(days)}
    contact_s: dict[str, float] = {}
    for item in (each for day in days.values() for each in day.passes):
        label = item.window.name
        contact_s[label] = contact_s.get(label, 0.0) + item.window.duration_s * (item.fate is Fate.TRACKED)
    targets = sorted(contact_s, key=lambda label: (-contact_s[label], label))[:MOST_ROWS]
    place = {label: len(days) + k for k, label in enumerate(targets)}
    first = next(iter(days.values()))
    with figure(path, 13.0, max(4.0, 1.4 + ROW_IN * (len(days) + len(targets)))) as drawn:
        axes = drawn.subplots()
        for row, (name, day) in enumerate(days.items()):
            tracked = [item for item in day.passes if item.fate is Fate.TRACKED]
            others = [item for item in day.passes if item.fate is not Fate.TRACKED]
            for items, colour, height in ((others, YIELDS_COLOUR, 0.35), (tracked, colours[name], 0.75)):
                shown = [item for item in items if item.window.name in place]
                rows = [float(place[item.window.name]) for item in shown]
                if items is tracked:
                    shown, rows = [*shown, *tracked], [*rows, *(float(row) for _ in tracked)]
                begins = [(item.window.aos_t_s - day.start_t_s) / 3600.0 for item in shown]
                widths = [item.window.duration_s / 3600.0 for item in shown]
                axes.barh(rows, widths, left=begins, height=height, color=colour, edgecolor="white", lw=0.4,
                          zorder=2.0 + (items is tracked))  # fmt: skip
        names = [f"{name:.20}" for name in days] + [f"{label:.20}" for label in targets]
        axes.set_yticks(range(len(names)), names, fontsize=8.0)
        for label, colour in zip(axes.get_yticklabels(), colours.values(), strict=False):
            label.set_color(colour)
            label.set_fontweight("bold")
        axes.axhline(len(days) - 0.5, color="#888888", lw=0.7)
        axes.set_ylim(len(names) - 0.4, -0.6)
        _clock_axis(axes, first)
        left = "" if len(targets) == len(contact_s) else f", {len(targets)} of {len(contact_s)} targets"
        axes.set_title(f"Contacts of {len(days)} stations{left}; grey: seen, not tracked", fontsize=9.0, loc="left")


def _rows(plan: DayPlan) -> list[str]:
    """Return the labels of the targets that are shown, in order of the rows."""
    tracked_s: dict[str, float] = {}
    priority: dict[str, int] = {}
    for item in plan.passes:
        number = item.window.label
        tracked_s[number] = tracked_s.get(number, 0.0) + item.window.duration_s * (item.fate is Fate.TRACKED)
        priority[number] = item.priority
    return sorted(tracked_s, key=lambda n: (-priority[n], -tracked_s[n], n))[:MOST_ROWS]


def _draw_lines(axes: Any, plan: DayPlan, rows: Sequence[str], colours: dict[int, str]) -> None:
    place = {number: k + 1 for k, number in enumerate(rows)}
    names: dict[str, str] = {}
    bars: dict[tuple[str, Any, float], list[tuple[float, float, float]]] = {}
    for item in plan.passes:
        number, colour = item.window.label, colours[item.priority]
        begin, width = (item.window.aos_t_s - plan.start_t_s) / 3600.0, item.window.duration_s / 3600.0
        if item.fate is Fate.TRACKED:
            bars.setdefault((colour, colour, 0.75), []).append((0.0, begin, width))
        if number in place:
            alone = len(colours) == 1
            name = item.window.name
            names[number] = f"{name:.26}" if alone else f"{name:.22} ({item.priority})"
            bars.setdefault(_look(item, colour), []).append((float(place[number]), begin, width))
    for (face, edge, height), group in bars.items():
        y, left, widths = np.array(group).T
        axes.barh(y, widths, left=left, height=height, color=face, edgecolor=edge, lw=0.7)
    axes.set_yticks(range(len(rows) + 1), ["the antenna", *(names[number] for number in rows)], fontsize=8.0)
    axes.get_yticklabels()[0].set_fontweight("bold")
    axes.axhline(0.5, color="#888888", lw=0.7)
    axes.set_ylim(max(len(rows), FEWEST_ROWS) + 0.6, -0.6)
    _clock_axis(axes, plan)
    from matplotlib.patches import Patch

    labels = {p: f"tracked, priority {p}" if len(colours) > 1 else "tracked" for p in colours}
    keys = [Patch(color=colours[p], label=label) for p, label in labels.items()][: len(COLOURS)]
    keys += [Patch(color=YIELDS_COLOUR, label="yields"), Patch(fc="white", ec=BARRED_COLOUR, label="barred")]
    # Below the hours and their name.
    below = {"loc": "upper left", "bbox_to_anchor": (0.0, 0.0), "borderaxespad": 4.0}
    axes.legend(handles=keys, ncols=len(keys), **below)
    total = len({item.window.label for item in plan.passes})
    if total > len(rows):
        some = f"{len(rows)} of {total} satellites: highest priority, then most tracked time."
        axes.set_title(f"{some} The top line has all tracked passes.", fontsize=9.0, loc="left")


def _look(item: DayPass, colour: str) -> tuple[str, Any, float]:
    """Return face, edge and height of the bar of a pass."""
    if item.fate is Fate.TRACKED:
        return colour, colour, 0.75
    return (YIELDS_COLOUR, YIELDS_COLOUR, 0.4) if item.fate is Fate.YIELDS else ("white", BARRED_COLOUR, 0.4)


def _clock_axis(axes: Any, plan: DayPlan) -> None:
    """Write whole hours of UTC below the axis, with the date where a day begins."""
    hours = plan.duration_s / 3600.0
    axes.set_xlim(0.0, hours)
    axes.grid(axis="y", visible=False)
    step = next((s for s in (0.25, 0.5, 1, 2, 3, 6, 12, 24, 48) if hours / s <= 12.0), 96) * 3600.0
    first = math.ceil(plan.start_t_s / step) * step
    ticks = np.arange(first, plan.start_t_s + plan.duration_s + 1.0, step)
    stamps = [datetime.fromtimestamp(float(t_s), UTC) for t_s in ticks]
    dated = [k == 0 or s.hour + s.minute == 0 for k, s in enumerate(stamps)]
    labels = [f"{s:%H:%M}\n{s:%d %b}" if d else f"{s:%H:%M}" for s, d in zip(stamps, dated, strict=True)]
    axes.set_xticks((ticks - plan.start_t_s) / 3600.0, labels)


def _draw_sky(
    axes: Any, tracked: Sequence[DayPass], rows: Sequence[str], mask: HorizonMask, colours: dict[int, str]
) -> None:
    sky_axes(axes)
    draw_hills(axes, mask)
    shown = [item for item in tracked if item.window.label in set(rows)][:MOST_PATHS]
    for item in shown:
        if item.profile is None:
            continue
        angle, zenith = sky_place(*item.profile.position_rad[::20].T)
        axes.plot(angle, zenith, color=colours[item.priority], lw=1.3 if len(shown) <= FEW_PATHS else 0.7, alpha=0.8)
        axes.plot(angle[:1], zenith[:1], ".", color=colours[item.priority], ms=3.0)
        if len(shown) <= FEW_PATHS:
            rise = datetime.fromtimestamp(item.window.aos_t_s, UTC)
            # On the path a little after its rise: at the edge several rise at the same place.
            at = len(angle) // 4
            white = {"fc": "white", "ec": "none", "pad": 0.6, "alpha": 0.8}
            axes.text(angle[at], zenith[at], f"{rise:%H:%M}", fontsize=7.5, color="#333333", bbox=white, ha="center")
    suns = np.array([item.profile.sun_rad[0] for item in tracked if item.profile is not None])
    if len(suns) and np.any(suns[:, 1] > 0.0):
        up = suns[suns[:, 1] > 0.0]
        up = up[:: max(1, len(up) // MOST_SUNS)]
        axes.plot(up[:, 0], 90.0 - np.degrees(up[:, 1]), "o", color="#e6b800", ms=4.0, label="the Sun during the plan")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06))
    left = "" if len(shown) == len(tracked) else f" of {len(tracked)}"
    axes.set_title(f"{len(shown)}{left} tracked passes, a dot at the rise", fontsize=9.0)
