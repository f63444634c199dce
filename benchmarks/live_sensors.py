"""Track one whole pass on the live graph with every sensor in every band, and print what each one held.

    scripts/run-python benchmarks/live_sensors.py [--sensor auto ...] [--band X ...] [--output FOLDER]

Each is a run of `track` at full speed with the commissioning model, which is wrong by 140 mdeg, and an ephemeris 0.15 s
late.  A scan is part of the error of the beam.  Prints a Markdown table; twelve runs take 20 minutes.
"""

import argparse
import itertools
import tempfile
from pathlib import Path
from typing import Any

from graph import track

BANDS = ("S", "X", "Ka")
SENSORS = ("monopulse", "conscan", "steptrack", "auto")
HEADINGS = (
    "band",
    "sensor",
    "first valid error, s after AOS",
    "radial rms, mdeg",
    "without the loop",
    "loss, dB",
    "inside half power, %",
    "messages lost",
    "modes",
)


def row(band: str, sensor: str, summary: dict[str, Any]) -> str:
    """Return one line of the table."""
    headline, acquisition = summary["headline"], summary["acquisition"]
    error = headline["error"]
    modes = sorted({mode["mode"] for mode in summary["modes"]} - {"idle", "slew"})
    cells = (
        band,
        sensor,
        f"{acquisition['first_valid_s']:.1f}",
        f"{error['radial']['rms_mdeg']:.2f}",
        f"{headline['program_track_alone']['radial']['rms_mdeg']:.0f}",
        f"{error['mean_loss_db']:.3f}",
        f"{error['inside_half_power_percent']:.1f}",
        f"{headline['messages_lost']} of {summary['bag']['message_count']}",
        ", ".join(modes),
    )
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Run the passes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--band", nargs="+", choices=BANDS, default=BANDS)
    parser.add_argument("--sensor", nargs="+", choices=SENSORS, default=SENSORS)
    parser.add_argument("--output", type=Path, default=None, help="keep the reports in this folder")
    options = parser.parse_args()
    folder = options.output or Path(tempfile.mkdtemp(prefix="live-sensors-"))
    print(f"| {' | '.join(HEADINGS)} |\n{'|---' * len(HEADINGS)}|")
    for band, sensor in itertools.product(options.band, options.sensor):
        summary = track(folder / f"{sensor}-{band}", "--sensor", sensor, "--band", band)
        print(row(band, sensor, summary), flush=True)


if __name__ == "__main__":
    main()
