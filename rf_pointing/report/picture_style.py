"""The common style of all pictures: colours, light grids, minutes from AOS.

Figures are made without pyplot: no global state, no window, drawn by Agg.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core import Array, IntArray, Mode, azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.planning import HorizonMask
from rf_pointing.report.analysis import Analysis
from rf_pointing.tracking.sensors import SENSORS

# Colours that the colour-blind can distinguish (Okabe and Ito).
MODE_COLOURS: dict[str, str] = {
    Mode.PROGRAM_TRACK: "#e69f00", Mode.SEARCH: "#cc79a7", Mode.COAST: "#d55e00",
    Mode.SLEW: "#56b4e9", Mode.IDLE: "#b0b4b8",
}  # fmt: skip
"""Colour by mode of the controller; that of a sensor's own mode is one of the sensor's traits."""
OTHER_MODE_COLOUR = "#4a4a4a"
"""Colour of the modes without one of their own."""
AXIS_COLOURS = ("#0072b2", "#d55e00")
"""Azimuth (or cross-elevation) and elevation."""
ALONE_COLOUR = "#8a8a8a"
"""The error that program track alone would have made."""
LIMIT_COLOUR = "#333333"
DASHED = (0, (5, 3))
"""Line style of limits."""
_STYLE: Any = {
    "font.family": "DejaVu Sans", "font.size": 10.0, "axes.grid": True, "axes.axisbelow": True,
    "axes.edgecolor": "#888888", "axes.spines.top": False, "axes.spines.right": False,
    "grid.color": "#e3e3e3", "grid.linewidth": 0.7, "legend.frameon": False,
    "legend.fontsize": 9.0, "lines.linewidth": 1.2,
}  # fmt: skip


def mode_colour(mode: str) -> str:
    """Return the colour of a mode of the controller, those of registered trackers included."""
    return SENSORS[mode].colour if mode in SENSORS else MODE_COLOURS.get(mode, OTHER_MODE_COLOUR)


def plain_log_scale(axis: Any) -> None:
    """Make `axis` (x or y) logarithmic, with plain numbers at 1 and, where possible, 2 and 5."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(LogLocator(subs=(1.0,), numticks=12))
    axis.set_minor_locator(LogLocator(subs=(2.0, 5.0), numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    low, high = axis.get_view_interval()
    # On more than 2.5 decades the labels at 2 and 5 would overlap.
    narrow = high / low < 300.0
    axis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}") if narrow else NullFormatter())


def sky_axes(axes: Any) -> None:
    """Make polar `axes` the sky, north up and zenith in the middle, with rings of elevation."""
    axes.set(theta_zero_location="N", theta_direction=-1, ylim=(0.0, 90.0))
    axes.set_rgrids([30.0, 60.0, 90.0], ["60°", "30°", "0°"], angle=112.5, fontsize=8.5, color="#666666")
    axes.set_thetagrids(range(0, 360, 45), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"])


def sky_place(azimuth_rad: Array, elevation_rad: Array) -> tuple[Array, Array]:
    """Return angle and zenith distance in degrees, also of elevations beyond the zenith."""
    # By way of the vector: past the zenith the antenna looks to the other side.
    theta, elevation = azel_from_unit_vector(unit_vector_from_azel(azimuth_rad, elevation_rad))
    return np.unwrap(theta), 90.0 - np.degrees(elevation)


def draw_hills(axes: Any, mask: HorizonMask) -> None:
    """Draw the horizon mask grey into a sky."""
    around = np.radians(np.arange(0.0, 360.5, 0.5))
    hills = np.degrees(mask.lowest_all(around))
    grey = {"where": hills > 0.0, "color": "#b0b4b8", "lw": 0.0, "zorder": 0.4}
    axes.fill_between(around, 90.0 - np.clip(hills, 0.0, 90.0), 90.0, **grey)


@contextmanager
def figure(path: Path, width_in: float, height_in: float) -> Iterator[Any]:
    """Give an empty figure in the common style, and save it as PNG at `path`."""
    # Imported late: matplotlib takes long to import, and recorders draw nothing.
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        drawn = Figure(figsize=(width_in, height_in), layout="constrained")
        FigureCanvasAgg(drawn)
        yield drawn
        drawn.savefig(path, dpi=130, format="png")


def legend_above(axes: Any, *others: Any) -> None:
    """Write the legend of `axes`, and of `others`, in one row above `axes`."""
    entries = [axis.get_legend_handles_labels() for axis in (axes, *others)]
    handles, labels = ([item for entry in entries for item in entry[part]] for part in (0, 1))
    axes.legend(handles, labels, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=7, borderaxespad=0.1)


def marked_level(axes: Any, level: float, label: str) -> None:
    """Draw a dashed line across `axes` at `level`, with its label if it is within the range."""
    axes.axhline(level, color=LIMIT_COLOUR, lw=0.9, ls=DASHED)
    axes.annotate(
        label, (1.0, level), xycoords=("axes fraction", "data"), xytext=(-2, 2),
        textcoords="offset points", ha="right", va="bottom", fontsize=8.5, color=LIMIT_COLOUR,
        annotation_clip=True,
    )  # fmt: skip


class TimeAxis:
    """Minutes from the acquisition of signal, or from the start of a recording without a pass."""

    def __init__(self, analysis: Analysis) -> None:
        found, start = analysis.target_pass, "acquisition of signal"
        if found is None:
            # Without a pass, the origin is the first stamp of any topic.
            stamps = (data.stamp_ns for data in analysis.recording.topics.values())
            firsts = (int(np.min(each)) for each in stamps if each is not None and len(each))
            first = min(firsts, default=0)
            start = "the start of the recording"
        self.origin_ns = first if found is None else found.aos_ns
        self.label = f"minutes from {start}"

    def minutes(self, stamp_ns: IntArray) -> Array:
        """Return stamps as minutes."""
        return (np.asarray(stamp_ns) - self.origin_ns) / 60e9


def mode_runs(analysis: Analysis, stamp_ns: IntArray) -> Iterator[tuple[str, slice, bool]]:
    """Give mode, samples, and whether the mode comes for the first time, for each stretch.

    Stretches share their border sample, so that lines along them have no gaps; stamps must be in
    order.
    """
    spans = analysis.modes.intervals() if analysis.modes is not None else []
    seen: set[str] = set()
    for span in spans:
        begin, end = np.searchsorted(stamp_ns, (span.start_ns, span.end_ns))
        if end > begin:
            yield span.mode, slice(int(begin), int(end) + 1), span.mode not in seen
            seen.add(span.mode)


def per_second(stamp_ns: IntArray, values: Array) -> tuple[IntArray, Array, Array]:
    """Return middle stamp, mean and maximum of the finite `values` in each second that has any."""
    # NaN means "not known" in a column; it must not spoil its second.
    good = np.isfinite(values)
    stamp_ns, values = stamp_ns[good], values[good]
    second, index = np.unique(stamp_ns // 10**9, return_inverse=True)
    mean = np.bincount(index, values) / np.bincount(index)
    largest = np.full(len(second), -np.inf)
    np.maximum.at(largest, index, values)
    return second * 10**9 + 5 * 10**8, mean, largest
