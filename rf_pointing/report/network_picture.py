"""Picture of the plan of a network: a line for each station, and one for each target."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rf_pointing.core.types import Array
from rf_pointing.report.day_picture import MOST_ROWS, ROW_IN, YIELDS_COLOUR, clock_axis
from rf_pointing.report.picture_style import figure
from rf_pointing.report.plan_picture import COLOURS
from rf_pointing.station.pointing.multi_satellite_plan import DayPass, DayPlan, Fate


def draw_network(days: Mapping[str, DayPlan], path: Path) -> None:
    """Write the picture of the plans of stations by name to `path`.

    Contacts have the colour of their station, what is seen and not tracked is grey.  There is room
    for `MOST_ROWS` targets, those with the most contact.
    """
    colours = {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(days)}
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
                begins, widths = _hours(shown, day.start_t_s)
                axes.barh(rows, widths, left=begins, height=height, color=colour, edgecolor="white", lw=0.4,
                          zorder=2.0 + (items is tracked))  # fmt: skip
        names = [f"{name:.20}" for name in days] + [f"{label:.20}" for label in targets]
        axes.set_yticks(range(len(names)), names, fontsize=8.0)
        for label, colour in zip(axes.get_yticklabels(), colours.values(), strict=False):
            label.set_color(colour)
            label.set_fontweight("bold")
        axes.axhline(len(days) - 0.5, color="#888888", lw=0.7)
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_xlim(0.0, first.duration_s / 3600.0)
        clock_axis(axes, first)
        axes.grid(axis="y", visible=False)
        left = "" if len(targets) == len(contact_s) else f", {len(targets)} of {len(contact_s)} targets"
        axes.set_title(f"Contacts of {len(days)} stations{left}; grey: seen, not tracked", fontsize=9.0, loc="left")


def _hours(items: list[DayPass], start_t_s: float) -> tuple[Array, Array]:
    begins = np.array([item.window.aos_t_s - start_t_s for item in items]) / 3600.0
    return begins, np.array([item.window.duration_s for item in items]) / 3600.0
