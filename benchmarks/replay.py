"""Measure how fast a recorded pass is replayed, and that it is what was recorded.

scripts/run-python benchmarks/replay.py [BAG] [--law lqg]

Without a bag the top of a CBERS-2 pass over DSS-13 is flown without ROS and recorded first.  Speeds
are times of real time by the processor time: of one closed loop, and of each part alone.
"""

import argparse
import math
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import rf_pointing as rp
from rf_pointing.report.recorded_signals import read_pass
from rf_pointing.report.replay_case import RecordedCase
from rf_pointing.simulation import StationSetup
from rf_pointing.simulation.open_loop import commanded, followed, sensed_errors
from test.api.headless_bag import HeadlessBag

WIND_M_S = 8.0


def recorded(folder: Path) -> Path:
    """Return the bag of a pass that is flown here."""
    one = rp.Station("dss13").passes(rp.elements("28057"), days=2.0, min_peak_deg=44.0, mask_deg=41.0)[0]
    setup = StationSetup("dss13", "X", changes={"antenna_servo": {"wind.mean_speed_m_s": WIND_M_S}})
    return HeadlessBag(setup, one.window, math.floor(one.aos_t_s) - 150.0, "monopulse").write(folder / "run")


def main() -> None:
    """Replay the bag, and print its table and the speeds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag", nargs="?", type=Path)
    parser.add_argument("--law", choices=("pi", "lqg"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bag = options.bag or recorded(Path(folder))
        found = rp.replay(bag, law=options.law)
        print(found)
        case = RecordedCase(bag, read_pass(bag), None)
        setup, signals, one = case.setup(), case.signals, case.recorded
        parts = {
            "trackers": lambda: sensed_errors(setup, signals),
            "controller": lambda: commanded(setup, signals, one.window, one.sensor, case.track),
            "servo": lambda: followed(setup.antenna(), signals),
        }
        for name, run in parts.items():
            began_s = time.process_time()
            run()
            print(f"{name:<12}{case.seconds / (time.process_time() - began_s):7.0f} times real time")
    print(f"closed loop {found.speed:.0f} times real time, {'reproduced' if found.reproduced else 'NOT reproduced'}")


if __name__ == "__main__":
    main()
