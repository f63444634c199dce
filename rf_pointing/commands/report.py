"""Executable `report BAG [--output DIR]`: the report of any recorded pass, or its data.

The bag is one of ours, or of `ros2 bag record -a`.  `--export csv|parquet|mat` writes the topics as
tables with a data dictionary, `--export tdm` the tracked angles as a CCSDS message.

Other packages add pages through the entry point group `rf_pointing.reports`: a function of bag and
folder that writes its page and returns the path, or None if the bag has no data for it.
"""

import argparse
import time
from importlib.metadata import entry_points
from pathlib import Path

from rf_pointing import __version__
from rf_pointing.calibration import write_tdm
from rf_pointing.commands.options import ending_with_reason
from rf_pointing.report import antennas, export_recording, read_recording, write_report
from rf_pointing.report.export import FORMATS
from rf_pointing.report.tracking_from_bag import tracking_from_bag


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing report`."""
    what = "Write the HTML report and the summary of a recorded bag, or export its data."
    parser = argparse.ArgumentParser(prog="report", description=what)
    add = parser.add_argument
    add("bag", type=Path, help="directory of a rosbag2 bag")
    add("--output", type=Path, help="folder to write to (default: the folder of the bag; export below it)")
    add("--export", choices=(*FORMATS, "tdm"), help="write the data instead of the report")
    add("--namespace", help="which antenna is exported; needed where the bag holds several")
    options = parser.parse_args(argv)
    with ending_with_reason("report"):
        if options.export:
            print(*_export(options), sep="\n")
        else:
            print(*_write(options.bag, options.output or options.bag.parent), sep="\n")


def _export(options: argparse.Namespace) -> list[Path]:
    folder: Path = options.output or options.bag.parent / "export"
    recording = read_recording(options.bag, namespace=options.namespace)
    if options.export != "tdm":
        return export_recording(recording, folder, options.export)
    missing = [name for name in ("station", "band") if not recording.notes.get(name)]
    if missing:
        raise ValueError(f"export=tdm: the notes of {options.bag} name no {' and no '.join(missing)}")
    tracks = tracking_from_bag(
        options.bag, recording.notes["station"], recording.notes["band"], namespace=options.namespace, allow_damage=True
    )
    path = folder / "tracking.tdm"
    path.parent.mkdir(parents=True, exist_ok=True)
    raw = [one for one, _ in tracks]
    write_tdm(path, raw, originator=f"rf_pointing {__version__}", created_t_s=time.time())
    return [path]


def _write(bag: Path, folder: Path) -> list[Path]:
    pages = [entry.load()(bag, folder) for entry in entry_points(group="rf_pointing.reports")]
    written = [page for page in pages if page is not None]
    # Without any page, `write_report` states what the bag lacks.
    if antennas(bag) or not written:
        write_report(bag, folder)
        written.append(folder / "report.html")
    return written
