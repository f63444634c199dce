"""Plant an error of the clock in simulated passes of several satellites, and find it again.

scripts/run-python benchmarks/clock.py [--station leo_3m7] [--passes 6] [--slow 0.037] [--exact]

Each satellite is off its elements by a random time of the size that the law of the elements says,
by nothing with --exact.  Exits with 1 where the clock is farther off than three sigma, or with
--exact by more than a millisecond.
"""

import argparse
import json
import math
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

import rf_pointing as rp
from rf_pointing.core import random_stream
from rf_pointing.core.types import TURN
from rf_pointing.ephemeris import ElementUncertainty
from test.api.headless_bag import HeadlessBag

MILLISECOND = 1e-3
GROWTH = [name for name in ElementUncertainty.__dataclass_fields__ if name != "manoeuvre_m_s"]


def satellites(folder: Path, count: int) -> Path:
    """Write elements of satellites like the shipped one, at other places, into a file."""
    one, rows = rp.elements("28057").found, list[dict[str, object]]()
    for number in range(count):
        rows.append({
            "OBJECT_NAME": f"BIRD {number}", "OBJECT_ID": "2000-001A", "NORAD_CAT_ID": 90000 + number,
            "EPOCH": datetime.fromtimestamp(one.epoch_t_s, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f"),
            "MEAN_MOTION": one.mean_motion_rad_s * 86400.0 / TURN, "ECCENTRICITY": one.eccentricity,
            "INCLINATION": math.degrees(one.inclination_rad),
            "RA_OF_ASC_NODE": (math.degrees(one.ascending_node_rad) + 50.0 * number) % 360.0,
            "ARG_OF_PERICENTER": math.degrees(one.argument_of_perigee_rad),
            "MEAN_ANOMALY": (math.degrees(one.mean_anomaly_rad) + 110.0 * number) % 360.0,
            "EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": "U", "ELEMENT_SET_NO": 1, "REV_AT_EPOCH": 1,
            "BSTAR": 1e-5, "MEAN_MOTION_DOT": 0.0, "MEAN_MOTION_DDOT": 0.0,
        })  # fmt: skip
    path = folder / "elements.json"
    path.write_text(json.dumps(rows))
    return path


def main() -> None:
    """Fly the passes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--station", default="leo_3m7")
    add("--passes", type=int, default=6)
    add("--slow", type=float, default=0.037, help="error of the clock, in s")
    add("--exact", action="store_true", help="elements without errors")
    add("--seed", type=int, default=1)
    options = parser.parse_args()
    station, rng = rp.Station(options.station), random_stream(options.seed, "errors of elements")
    with tempfile.TemporaryDirectory() as place:
        folder, bags = Path(place), list[Path]()
        elements = satellites(folder, options.passes)
        law = ElementUncertainty(**dict.fromkeys(GROWTH, 0.0)) if options.exact else ElementUncertainty()
        known = {f"uncertainty.{name}": 0.0 for name in GROWTH} if options.exact else {}
        for number in range(options.passes):
            target = rp.elements(elements, satellite=str(90000 + number))
            one = station.passes(target, days=1.0, min_peak_deg=25.0)[0]
            age_s = abs(one.window.tca_t_s - target.found.epoch_t_s)
            off_s = rng.normal() * law.sigmas_m(age_s)[0] / 7500.0
            receiver = {"source.time_offset_s": options.slow, "source.along_track_offset_s": off_s}
            setup = station.setup(one, options.seed + number, {"rf_receiver": receiver, "ephemeris_publisher": known})
            begin_s = math.floor(one.aos_t_s) - 100.0
            flown = HeadlessBag(setup, one.window, begin_s, setup.station.chosen_sensor(None, setup.band))
            bags.append(flown.write(folder / str(number), without=("sim/pointing_error",)))
            print(f"{number + 1} of {options.passes} flown", file=sys.stderr, flush=True)
        found = rp.check_clock(bags)
    print(found)
    error_s = found.slow_s - options.slow
    print(f"error {1e3 * error_s:+.2f} ms of {1e3 * options.slow:.1f} ms planted, {error_s / found.sigma_s:+.2f} sigma")
    wrong = abs(error_s) > MILLISECOND if options.exact else abs(error_s) > 3.0 * found.sigma_s
    sys.exit(1 if wrong or not np.isfinite(error_s) else 0)


if __name__ == "__main__":
    main()
