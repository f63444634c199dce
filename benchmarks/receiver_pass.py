"""Fly passes by samples and without: is a pass held through a receiver as by the simulation itself?

    scripts/run-python benchmarks/receiver_pass.py [--only NAME] [--json FILE]

Each pass flies twice with `track`, in one graph of the simulated antenna: directly, as fast as it
goes, and in real time with the samples of `signal_source` over loopback as all that the station
knows of the signal.  Wanted: as many seconds held, less 1 s, and a loss within 0.05 dB.

A recording (`sigmf`) is followed while it is written, and then flown again from the file alone: the
beam is then led by what another beam has received, so the level is compared, second by second.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from launched_station import executable
from real_station import free_port

from rf_pointing.report import read_recording

PASSES = {
    "conscan": ("conscan", "leo_3m7", 60.0, "rtl_tcp", ""),
    "steptrack": ("steptrack", "leo_3m7", 60.0, "rtl_tcp", ""),
    "monopulse": ("monopulse", "dss13", 42.0, "vita49", "&signal.channels=3"),
    "zmq": ("conscan", "leo_3m7", 60.0, "zmq", ""),
    "sigmf": ("conscan", "leo_3m7", 60.0, "sigmf", ""),
}
"""Sensor, station, mask in degrees, source, and what its address must say."""
RATE_HZ = 240000
HELD_S, LOSS_DB = 1.0, 0.05
_RESULT = re.compile(r"(\d+) s held, (\d+) s lost; mean pointing loss ([\d.]+) dB")


def flown(name: str, folder: Path, *, by_samples: bool) -> tuple[float, float]:
    """Return the seconds held and the mean loss in dB of the pass."""
    sensor, station, mask_deg, kind, more = PASSES[name]
    words = [executable("track"), "--station", station, "--band", "S", "--mask", f"{mask_deg:g}", "--sensor", sensor,
             "--namespace", "/samples" if by_samples else "/direct", "--output", str(folder)]  # fmt: skip
    if by_samples:
        place = folder.parent / "pass.sigmf-meta" if kind == "sigmf" else f"localhost:{free_port()}"
        words += ["--receiver", f"{kind}://{place}?iq.rate_hz={RATE_HZ}{more}"]
    done = subprocess.run(words, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    found = _RESULT.search(done.stdout + done.stderr)
    if found is None:
        raise RuntimeError(
            f"{' '.join(words)} ended with {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
        )
    return float(found[1]), float(found[3])


def levels_db_hz(folder: Path) -> dict[float, float]:
    """Return the C/N0 of a flown pass by time."""
    power = read_recording(folder / "bag").get("carrier_power")
    assert power is not None
    times = np.round(1e-9 * power.stamp_ns, 1).tolist()
    return dict(zip(times, power.columns["carrier_to_noise"].tolist(), strict=True))


def replayed(folder: Path) -> tuple[float, float]:
    """Return the share of the recorded levels that come again, and their median difference in dB."""
    flown("sigmf", folder / "again", by_samples=True)
    first, again = levels_db_hz(folder / "sigmfTrue"), levels_db_hz(folder / "again")
    both = first.keys() & again.keys()
    return len(both) / len(first), float(np.median([abs(first[t_s] - again[t_s]) for t_s in both]))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=list(PASSES), help="one of them alone")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers into this file")
    options = parser.parse_args()
    rows: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name in [options.only] if options.only else PASSES:
            (direct_s, direct_db), (held_s, loss_db) = (
                flown(name, folder / f"{name}{by_samples}", by_samples=by_samples) for by_samples in (False, True)
            )
            good = held_s >= direct_s - HELD_S and abs(loss_db - direct_db) <= LOSS_DB
            rows[name] = {"direct": [direct_s, direct_db], "by samples": [held_s, loss_db], "good": good}
            print(f"{'ok ' if good else 'BAD'} {name} by {PASSES[name][3]}: {held_s:.0f} s held, {loss_db:.2f} dB; "
                  f"directly {direct_s:.0f} s, {direct_db:.2f} dB", flush=True)  # fmt: skip
            if name == "sigmf":
                share, off_db = replayed(folder)
                rows["replay"] = {"share": share, "off_db": off_db, "good": share > 0.95 and off_db < LOSS_DB}
                print(f"{'ok ' if rows['replay']['good'] else 'BAD'} replayed: {100.0 * share:.0f} % of the levels, "
                      f"{off_db:.3f} dB apart", flush=True)  # fmt: skip
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(not all(row["good"] for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
