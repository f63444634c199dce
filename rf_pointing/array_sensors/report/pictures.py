"""Pictures of the array sensors: truth and estimate, and the error inside its 3-sigma band."""

from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.array_sensors.attitude.quaternion import quaternion_to_roll_pitch_yaw
from rf_pointing.array_sensors.report.series import ArraySeries
from rf_pointing.core.types import Array
from rf_pointing.report.picture_style import (
    ALONE_COLOUR,
    AXIS_COLOURS,
    LIMIT_COLOUR,
    figure,
    legend_above,
)

_TRUE, _FOUND = LIMIT_COLOUR, AXIS_COLOURS[0]
HAND_OFF_COLOUR = "#a6761d"
_MDEG_BELOW_DEG = 0.03
"""Errors of a smaller standard deviation are drawn in thousandths of a degree."""


def draw_attitude(series: ArraySeries, path: Path, title: str) -> None:
    """Roll, pitch and yaw, true and estimated, and the error about each axis.

    As PNG at `path`.
    """
    with figure(path, 11.0, 7.4) as drawn:
        drawn.suptitle(title, fontsize=12.0)
        _columns(drawn.subplots(3, 2, sharex=True), series, 0, "rotation")


def draw_pose(series: ArraySeries, path: Path, title: str) -> None:
    """Position, its error, attitude, its error, for each axis; as PNG at `path`."""
    with figure(path, 16.0, 7.4) as drawn:
        drawn.suptitle(title, fontsize=12.0)
        axes = drawn.subplots(3, 4, sharex=True)
        _columns(axes, series, 0, "position")
        _columns(axes, series, 2, "rotation")


def _columns(axes: Any, series: ArraySeries, first: int, what: str) -> None:
    """Draw the two columns from `first` on: values and errors of the three axes."""
    errors = ("in x", "in y", "in z") if what == "position" else ("about x", "about y", "about z")
    values, error, sigma, names, units = (
        _position(series) if what == "position" else _rotation(series)
    )
    for row in range(3):
        left, right = axes[row, first], axes[row, first + 1]
        _draw_values(left, series, [column[:, row] for column in values])
        left.set_ylabel(f"{names[row]}, {units[0]}")
        _draw_error(right, series, error[:, row], sigma[:, row], units[1])
        right.set_ylabel(f"error {errors[row]}, {units[1]}")
    for time_s, station in series.hand_offs:
        for each in axes[:, first : first + 2].flat:
            each.axvline(time_s, color=HAND_OFF_COLOUR, lw=0.9, ls=":")
        # At the end of the line that is farther from the curve.
        low, high = axes[0, first].get_ylim()
        curve = np.interp(time_s, series.t_s, values[0][:, 0])
        end, shift, align = (1.0, -3, "top") if curve < 0.5 * (low + high) else (0.0, 3, "bottom")
        axes[0, first].annotate(
            station, (time_s, end), xycoords=("data", "axes fraction"), xytext=(2, shift), textcoords="offset points",
            fontsize=8.0, color=HAND_OFF_COLOUR, rotation=90.0, va=align,
        )  # fmt: skip
    for place in (first, first + 1):
        axes[2, place].set_xlabel("simulation time from the first epoch, s")
        legend_above(axes[0, place])


def _position(
    series: ArraySeries,
) -> tuple[list[Array], Array, Array, tuple[str, ...], tuple[str, str]]:
    error, sigma = series.position_error_m, series.position_sigma_m
    assert series.true_position_m is not None
    assert series.position_m is not None
    names = ("x (forward)", "y (left)", "z (up)")
    return [series.true_position_m, series.position_m], error, sigma, names, ("m", "m")


def _rotation(
    series: ArraySeries,
) -> tuple[list[Array], Array, Array, tuple[str, ...], tuple[str, str]]:
    quaternions = (series.true_quaternion, series.quaternion)
    # Unwrapped: a yaw through 180 deg would be drawn as a vertical line.
    values = [np.degrees(np.unwrap(quaternion_to_roll_pitch_yaw(q), axis=0)) for q in quaternions]
    error, sigma = np.degrees(series.rotation_error_rad), np.degrees(series.rotation_sigma_rad)
    unit = "deg"
    if (
        series.valid.any()
        and float(np.max(np.median(sigma[series.valid], axis=0))) < _MDEG_BELOW_DEG
    ):
        error, sigma, unit = 1e3 * error, 1e3 * sigma, "mdeg"
    return values, error, sigma, ("roll", "pitch", "yaw"), ("deg", unit)


def _draw_values(axes: Any, series: ArraySeries, values: list[Array]) -> None:
    valid = series.valid
    if not valid.all():
        axes.plot(
            series.t_s[~valid],
            values[1][~valid],
            ".",
            color=ALONE_COLOUR,
            ms=2.5,
            label="not valid",
        )
    axes.plot(series.t_s[valid], values[1][valid], ".", color=_FOUND, ms=3.5, label="estimated")
    axes.plot(series.t_s, values[0], color=_TRUE, lw=1.0, label="true")
    _limit(axes, np.concatenate([values[0], values[1][valid]]))


def _draw_error(axes: Any, series: ArraySeries, error: Array, sigma: Array, unit: str) -> None:
    valid = series.valid
    time, error, three_sigma = series.t_s[valid], error[valid], 3.0 * sigma[valid]
    axes.fill_between(
        time, -three_sigma, three_sigma, color=_FOUND, alpha=0.15, lw=0.0, label="3 sigma"
    )
    axes.plot(time, error, ".-", color=AXIS_COLOURS[1], lw=0.7, ms=3.0, label="error")
    axes.axhline(0.0, color="#aaaaaa", lw=0.7)
    if not len(error):
        return
    inside = 100.0 * float(np.mean(np.abs(error) <= three_sigma))
    axes.annotate(
        f"rms {np.sqrt(np.mean(error**2)):.3g} {unit}, {inside:.1f} % inside",
        (1.0, 1.0),
        xycoords="axes fraction",
        xytext=(-3, -3),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=9.0,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
    )
    # The band before convergence would squeeze the rest.
    reach = 1.6 * max(
        float(np.percentile(three_sigma, 80.0)), float(np.percentile(np.abs(error), 90.0))
    )
    axes.set_ylim(-reach, reach)


def _limit(axes: Any, values: Array) -> None:
    low, high = float(np.min(values)), float(np.max(values))
    margin = 0.08 * max(high - low, 1e-6)
    axes.set_ylim(low - margin, high + margin)
