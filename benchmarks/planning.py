"""Time and memory of `plan_passes` for many satellites, and its search beside skyfield's in the same run.

    scripts/run-python benchmarks/planning.py --objects 30 10000 --against 1000

The catalogue is the synthetic one of benchmarks/ephemeris.py, as OMM JSON.  Each plan is the command as a user starts
it, with JSON, CSV, calendar and picture, over 24 h; processor time and largest memory are those of its process.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ephemeris import EPOCH_T_S, compare, synthetic_catalogue

from rf_pointing.core.dates import DAY_S, to_utc_text, utc_text
from rf_pointing.ephemeris import Elements, site

COMMAND = [sys.executable, "-c", "from rf_pointing.commands.plan_passes import main; main()"]


def as_omm(one: Elements) -> dict[str, object]:
    """Return one object as CelesTrak writes it."""
    day = DAY_S / (2.0 * math.pi)
    angles = {
        "INCLINATION": one.inclination_rad, "RA_OF_ASC_NODE": one.ascending_node_rad,
        "ARG_OF_PERICENTER": one.argument_of_perigee_rad, "MEAN_ANOMALY": one.mean_anomaly_rad,
    }  # fmt: skip
    return {
        "OBJECT_NAME": one.name, "OBJECT_ID": "2000-001A", "EPOCH": to_utc_text(one.epoch_t_s),
        "MEAN_MOTION": one.mean_motion_rad_s * day, "ECCENTRICITY": one.eccentricity,
        **{name: math.degrees(angle) for name, angle in angles.items()},
        "EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": "U", "NORAD_CAT_ID": one.catalogue_number, "ELEMENT_SET_NO": 999,
        "REV_AT_EPOCH": 1, "BSTAR": one.drag_per_earth_radius, "MEAN_MOTION_DOT": 0, "MEAN_MOTION_DDOT": 0,
    }  # fmt: skip


def measure(catalogue: list[Elements], folder: Path) -> None:
    """Plan for `catalogue` and print what it took."""
    elements, listed = folder / "active.json", folder / "list.txt"
    elements.write_text(json.dumps([as_omm(one) for one in catalogue]))
    # Three priorities, as an operator of many satellites has them.
    listed.write_text("".join(f"{one.catalogue_number}, priority={k % 3}\n" for k, one in enumerate(catalogue)))
    outputs = [
        "--csv",
        str(folder / "plan.csv"),
        "--ics",
        str(folder / "plan.ics"),
        "--picture",
        str(folder / "plan.png"),
    ]
    options = [
        "--elements",
        str(elements),
        "--satellites",
        str(listed),
        "--start",
        utc_text(EPOCH_T_S),
        "--hours",
        "24",
    ]
    before, begin_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run([*COMMAND, *options, *outputs, "--json"], capture_output=True, text=True, check=True)
    wall_s, after = time.monotonic() - begin_s, resource.getrusage(resource.RUSAGE_CHILDREN)
    rows = json.loads(done.stdout)["passes"]
    tracked = sum(row["fate"] == "tracked" for row in rows)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(
        f"{len(catalogue):6d} objects: {len(rows):6d} passes, {tracked:4d} tracked; {used_s:6.2f} s of processor time, "
        f"{wall_s:6.2f} s by the clock, {after.ru_maxrss / 1024:5.0f} MB"
    )


def main() -> None:
    """Run all measurements."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", type=int, nargs="+", default=[30, 10000], help="rising: memory is the largest yet")
    parser.add_argument("--against", type=int, default=1000, help="objects to give to skyfield")
    arguments = parser.parse_args()
    catalogue = synthetic_catalogue(max(*arguments.objects, arguments.against))
    low = [one for one in catalogue if one.name.startswith("low")]
    for count in sorted(arguments.objects):
        with tempfile.TemporaryDirectory() as folder:
            # A station with few satellites has low ones.
            measure(low[:count] if count <= 100 else catalogue[:count], Path(folder))
    compare(catalogue[: arguments.against], site("Goldstone DSS-13"))


if __name__ == "__main__":
    main()
