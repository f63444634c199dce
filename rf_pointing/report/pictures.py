"""The pictures of a report; each is drawn only if the recording has its data."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rf_pointing.report.analysis import Analysis, tracking_modes
from rf_pointing.report.error_pictures import draw_beam, draw_error, draw_link
from rf_pointing.report.motion_pictures import draw_axes, draw_sky, draw_timing
from rf_pointing.report.statistics import link_series


@dataclass(frozen=True)
class Picture:
    """One drawn picture: file, heading, and what to look at."""

    path: Path
    title: str
    caption: str


@dataclass(frozen=True)
class _Plan:
    name: str
    title: str
    caption: str
    draw: Callable[[Analysis, Path], None]
    possible: Callable[[Analysis], bool]


def _has_errors(analysis: Analysis) -> bool:
    return analysis.errors is not None and len(analysis.errors.stamp_ns) > 0


def _has_tracking(analysis: Analysis) -> bool:
    errors = analysis.errors
    return errors is not None and (analysis.modes is None or bool(np.any(np.isin(errors.mode, tracking_modes()))))


def _has_link(analysis: Analysis) -> bool:
    return _has_errors(analysis) or link_series(analysis.recording) is not None


def _has_sky(analysis: Analysis) -> bool:
    return any(
        analysis.recording.get(name) is not None for name in ("sim/boresight", "joint_states", "tracking_status")
    )


_PLANS = (
    _Plan(
        "pointing_error",
        "Pointing error",
        "Angle between target and beam. Light: every sample; strong: rms of each second, coloured by tracking mode. "
        "Grey: what the error would have been without the tracking offset.",
        draw_error,
        _has_errors,
    ),
    _Plan(
        "link",
        "Link and pointing loss",
        "Loss of a Gaussian beam: mean of each second, shaded up to the largest. Beyond about one beamwidth the true "
        "beam has side lobes, and the Gaussian loss is only a large number.",
        draw_link,
        _has_link,
    ),
    _Plan(
        "sky_track",
        "Track over the sky",
        "North up, zenith in the middle. Thin line: commanded; wide line: actual, coloured by mode.",
        draw_sky,
        _has_sky,
    ),
    _Plan(
        "beam",
        "The target in the beam",
        "Position of the target seen from the beam while tracking, with the half-power circle.",
        draw_beam,
        _has_tracking,
    ),
    _Plan(
        "axes",
        "Axis rates and accelerations",
        "From the encoders; accelerations are means over half a second. Dashed: limits of the drive.",
        draw_axes,
        lambda analysis: analysis.recording.get("joint_states") is not None,
    ),
    _Plan(
        "timing",
        "Timing of the graph",
        "Left: how far the commands run ahead of the clock. Right: wall time between linked messages at the recorder.",
        draw_timing,
        lambda analysis: analysis.modes is not None or analysis.recording.get("antenna_status") is not None,
    ),
)


def draw_pictures(analysis: Analysis, folder: Path) -> list[Picture]:
    """Draw what the recording allows as PNG files into `folder`, in the order of the report."""
    drawn = []
    for plan in _PLANS:
        # A picture without data would look like a fault of the antenna.
        if plan.possible(analysis):
            path = folder / f"{plan.name}.png"
            plan.draw(analysis, path)
            drawn.append(Picture(path, plan.title, plan.caption))
    return drawn
