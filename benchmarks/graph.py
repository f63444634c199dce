"""Measure the live graph: bring-up, speed, losses, tick regularity, CPU, and what tracking gains over program track.

    scripts/run-python benchmarks/graph.py [--output FOLDER] [--only max real_time program]

Runs the executable `track` as a user would and reads its summary.json; CPU is read from the kernel's accounting of the
node processes over a minute of steady tracking.  Prints a Markdown table.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_prefix

TICKS_PER_S = os.sysconf("SC_CLK_TCK")
CPU_WINDOW_S = 60.0
SLEW_S = 160.0


def track(output: Path, *options: str, cpu_after_s: float | None = None) -> dict[str, Any]:
    """Run one pass; return its summary with wall time, bring-up time and, with `cpu_after_s`, the CPU share of the graph."""
    executable = Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing" / "track"
    began_s = time.monotonic()
    process = subprocess.Popen(
        # Whatever was calibrated in the working folder must not change what is measured.
        [str(executable), "--models", "", "--output", str(output), *options],
        stderr=subprocess.PIPE,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    share = measure_cpu(process.pid, cpu_after_s) if cpu_after_s is not None else None
    _, log = process.communicate()
    if process.returncode:
        sys.exit(f"track {' '.join(options)} ended with {process.returncode}:\n{log}")
    summary: dict[str, Any] = json.loads((output / "summary.json").read_text())
    matched = re.search(r"active in ([0-9.]+) s", log)
    return summary | {
        "total_wall_s": time.monotonic() - began_s,
        "bring_up_s": float(matched.group(1)) if matched else None,
        "cpu_share": share,
    }


def measure_cpu(parent: int, after_s: float) -> float:
    """Return the CPU that the children of `parent` use over a minute, in cores, beginning `after_s` from now."""
    time.sleep(after_s)
    first = dict(children_cpu_s(parent))
    began_s = time.monotonic()
    time.sleep(CPU_WINDOW_S)
    last = dict(children_cpu_s(parent))
    used_s = sum(last[pid] - first[pid] for pid in last if pid in first)
    return used_s / (time.monotonic() - began_s)


def children_cpu_s(parent: int) -> Iterator[tuple[int, float]]:
    """Yield process id and CPU seconds of every child of `parent`."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == parent:
                yield int(folder.name), (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def axis(summary: dict[str, Any], which: str) -> str:
    """Return rms of both axes and the loss, as a table cell."""
    error = summary["headline"][which]
    rms = [error[name]["rms_mdeg"] for name in ("cross_elevation", "elevation")]
    return f"{rms[0]:.2f} / {rms[1]:.2f} mdeg, {error['mean_loss_db']:.3f} dB"


def main() -> None:
    """Run the passes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=None, help="keep the reports in this folder")
    parser.add_argument(
        "--only", nargs="+", choices=("max", "real_time", "program"), default=["max", "real_time", "program"]
    )
    options = parser.parse_args()
    folder = options.output or Path(tempfile.mkdtemp(prefix="graph-benchmark-"))
    rows: list[tuple[str, str]] = []
    if "max" in options.only:
        rows += max_rows(track(folder / "max"))
    if "program" in options.only:
        program = track(folder / "program", "--sensor", "program")
        rows.append(("program track alone, true error after the slew", axis(program, "error")))
    if "real_time" in options.only:
        rows += real_time_rows(
            track(folder / "real_time", "--speed", "1", "--mask", "42", cpu_after_s=SLEW_S - CPU_WINDOW_S)
        )
    print("| quantity | measured |\n|---|---|")
    for name, value in rows:
        print(f"| {name} | {value} |")


def max_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what the pass at full speed shows."""
    bag = summary["bag"]
    return [
        ("nodes matched and active after", f"{summary['bring_up_s']:.1f} s"),
        (f"pass of {bag['simulated_s'] / 60.0:.1f} min with slew at full speed", f"{bag['wall_s']:.1f} s wall"),
        ("the same with bring-up and report", f"{summary['total_wall_s']:.1f} s wall"),
        ("messages lost", f"{summary['headline']['messages_lost']} of {bag['message_count']}"),
        ("commands sent / accepted", f"{summary['commands']['sent']} / {summary['commands']['accepted']}"),
        ("monopulse, true error after acquisition", axis(summary, "error")),
        ("the same pass without the tracking loop's correction", axis(summary, "program_track_alone")),
    ]


def real_time_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what a pass in real time shows."""
    return [
        ("whole graph at speed 1", f"{100.0 * summary['cpu_share']:.0f} % of one core"),
        ("servo period deviation p99 at speed 1", f"{summary['servo']['period_deviation_p99_ms']:.2f} ms"),
        ("servo tick lateness p99 at speed 1", f"{summary['servo']['tick_lateness_p99_ms']:.2f} ms"),
    ]


if __name__ == "__main__":
    main()
