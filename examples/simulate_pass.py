"""Track one pass without ROS and print how well each mode held the target: scripts/run-python examples/simulate_pass.py."""

import math
from collections import Counter

import numpy as np

from rf_pointing.core import MDEG
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import StationSetup, simulate_pass


def main() -> None:
    """Simulate CBERS-2 over DSS-13 with monopulse."""
    source = SourceParams(satellite="28057")
    window = first_pass_above(
        load_track(source), load_elements(source).epoch_t_s, math.radians(40.0), math.radians(5.0), 86400.0
    )
    setup = StationSetup("dss13", "X")
    log = simulate_pass(setup, window, math.floor(window.aos_t_s) - 150.0, "monopulse")
    for mode, count in Counter(log.mode).items():
        rms = np.sqrt(np.mean(log.errors_rad(mode) ** 2, axis=0)) / MDEG
        print(f"{mode:14} {0.1 * count:7.1f} s  rms cross-elevation {rms[0]:9.2f} mdeg, elevation {rms[1]:9.2f} mdeg")


if __name__ == "__main__":
    main()
