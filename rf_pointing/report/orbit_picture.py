"""Picture of what is known of an orbit: sigmas over time, and when each station measures."""

from pathlib import Path

import numpy as np

from rf_pointing.core.types import Array
from rf_pointing.orbit.study import Knowledge
from rf_pointing.report.picture_style import figure


def draw_covariance(known: Knowledge, rtn_m: Array, tracked_until_t_s: float, title: str,
    path: Path) -> None:  # fmt: skip
    """Write the picture of a covariance to `path`; `rtn_m` (n, 3) are the sigmas of the total."""
    hours = (known.t_s - known.t_s[0]) / 3600.0
    with figure(path, 11.0, 6.0) as drawn:
        sigmas, tracks = drawn.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [4, 1]})
        for name, values in zip(("radial", "along the track", "across"), rtn_m.T, strict=True):
            sigmas.plot(hours, values, label=name)
        sigmas.plot(hours, known.sigma_m(known.formal), "k--", lw=1.0,
            label="all three, noise alone")  # fmt: skip
        sigmas.axvline((tracked_until_t_s - known.t_s[0]) / 3600.0, color="0.5", lw=1.0)
        sigmas.set_yscale("log")
        sigmas.set_ylabel("sigma, m")
        sigmas.legend()
        for row, tracked in enumerate(known.tracked):
            tracks.plot(hours[tracked], np.full(int(np.sum(tracked)), row), "|", ms=12.0)
        tracks.set_yticks(range(len(known.names)), known.names)
        tracks.set_ylim(-0.6, len(known.names) - 0.4)
        tracks.set_xlabel("hours")
        drawn.suptitle(title)
