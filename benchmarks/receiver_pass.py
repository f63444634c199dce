"""Fly passes by samples and without: is a pass held through a receiver as by the simulation itself?

    scripts/run-python benchmarks/receiver_pass.py [--sensor conscan] [--json FILE]

Each pass flies twice with `track`, in one graph of the simulated antenna: directly, as fast as it
goes, and in real time with the samples of `signal_source` over loopback as all that the station
knows of the signal.  Wanted: as many seconds held, less 1 s, and a loss within 0.05 dB.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from launched_station import executable
from real_station import free_port

PASSES = {
    "conscan": ("leo_3m7", 60.0, "rtl_tcp", ""),
    "steptrack": ("leo_3m7", 60.0, "rtl_tcp", ""),
    "monopulse": ("dss13", 42.0, "vita49", "&signal.channels=3"),
}
"""Station, mask in degrees, source, and what its address must say."""
RATE_HZ = 240000
HELD_S, LOSS_DB = 1.0, 0.05
_RESULT = re.compile(r"(\d+) s held, (\d+) s lost; mean pointing loss ([\d.]+) dB")


def flown(sensor: str, folder: Path, *, by_samples: bool) -> tuple[float, float]:
    """Return the seconds held and the mean loss in dB of the pass."""
    station, mask_deg, kind, more = PASSES[sensor]
    words = [executable("track"), "--station", station, "--band", "S", "--mask", f"{mask_deg:g}", "--sensor", sensor,
             "--namespace", "/samples" if by_samples else "/direct", "--output", str(folder)]  # fmt: skip
    if by_samples:
        words += ["--receiver", f"{kind}://localhost:{free_port()}?iq.rate_hz={RATE_HZ}{more}"]
    done = subprocess.run(words, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    found = _RESULT.search(done.stdout)
    if found is None:
        raise RuntimeError(
            f"{' '.join(words)} ended with {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
        )
    return float(found[1]), float(found[3])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sensor", choices=list(PASSES), help="one of them alone")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers into this file")
    options = parser.parse_args()
    rows: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for sensor in [options.sensor] if options.sensor else PASSES:
            (direct_s, direct_db), (held_s, loss_db) = (
                flown(sensor, Path(folder) / f"{sensor}{by_samples}", by_samples=by_samples)
                for by_samples in (False, True)
            )
            good = held_s >= direct_s - HELD_S and abs(loss_db - direct_db) <= LOSS_DB
            rows[sensor] = {"direct": [direct_s, direct_db], "by samples": [held_s, loss_db], "good": good}
            print(f"{'ok ' if good else 'BAD'} {sensor} by {PASSES[sensor][2]}: {held_s:.0f} s held, {loss_db:.2f} dB; "
                  f"directly {direct_s:.0f} s, {direct_db:.2f} dB", flush=True)  # fmt: skip
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(not all(row["good"] for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
