"""Processor time of one satellite's selection from a large file of elements, in each format.

    scripts/run-python benchmarks/elements_file.py --objects 30000

The catalogue is the synthetic one of benchmarks/ephemeris.py.  Each first selection is made by a process of its own: once
with nothing kept of the file, once with what the process before has kept.  Later ones are other satellites in the same
process, after a look whether the file has changed.
"""

import argparse
import csv
import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from ephemeris import synthetic_catalogue
from planning import as_omm

from rf_pointing.ephemeris.tle import tle_lines

SELECT = """
import sys, time
from rf_pointing.ephemeris import SourceParams
from rf_pointing.ephemeris.source import load_target, unused
file, count = sys.argv[1], int(sys.argv[2])
times = []
for number in (count // 2, 1, count, count // 3):
    began_s = time.process_time()
    found = load_target(SourceParams(elements=file, satellite=str(number)))
    problems = unused(file)
    times.append(time.process_time() - began_s)
    assert (found.catalogue_number, problems) == (number, "")
print(times[0], max(times[1:]))
"""


def main() -> None:
    """Write the files, select and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", type=int, default=30000)
    count = parser.parse_args().objects
    catalogue = synthetic_catalogue(count)
    messages = [as_omm(one) for one in catalogue]
    table = io.StringIO()
    writer = csv.DictWriter(table, messages[0])
    writer.writeheader()
    writer.writerows(messages)
    texts = {
        "OMM, JSON": json.dumps(messages), "OMM, CSV": table.getvalue(),
        "TLE": "\n".join("\n".join((one.name, *tle_lines(one))) for one in catalogue),
    }  # fmt: skip
    for name, text in texts.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "catalogue.txt"
            file.write_text(text)
            rows = [
                subprocess.run(
                    [sys.executable, "-c", SELECT, str(file), str(count)], capture_output=True, text=True, check=True,
                    env=os.environ | {"XDG_CACHE_HOME": folder},
                ).stdout.split()
                for _ in range(2)
            ]  # fmt: skip
        (new_s, _), (kept_s, later_s) = ([float(value) for value in row] for row in rows)
        print(
            f"{name:10} {len(text) / 1e6:5.1f} MB, {count} objects: first selection {new_s:.2f} s of a new file, "
            f"{kept_s:.2f} s of one that was read before; later ones at most {1e3 * later_s:.1f} ms"
        )


if __name__ == "__main__":
    main()
