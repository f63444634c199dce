"""Run benchmarks, each in a process of its own, and compare their processor times with the last run's.

    scripts/run-python benchmarks/run.py --quick          small arguments: does each still run?
    scripts/run-python benchmarks/run.py [NAME ...]       these, or all of the list, in full

A benchmark that ends with another code than 0, or runs longer than `--limit`, fails the whole.
Processor times are kept as JSON (`--results`, .ros/benchmarks.json) beside those of the run before,
and shown as ratios to them, which say something on the same machine alone; what a benchmark is
compared with (skyfield, numpy, scipy, rclpy) runs within it.  What flies in wall time or takes
minutes whatever its arguments is left to its own command; `WALL_TIME` and `MINUTES` name it.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

FOLDER = Path(__file__).parent
RESULTS = FOLDER.parent / ".ros" / "benchmarks.json"
QUICK = {
    "arrays": "",
    "calibration": "--runs 20",
    "calibration_faults": "--campaigns 0 --orbits 150 --passes 6 --only clock",
    "calibration_trials": "--trials 4 --campaigns 1 --rates 1 --noise white --orbits 150",
    "elements_file": "--objects 4000",
    "ephemeris": "--objects 200 --against 20",
    "geo_service": "--days 2 --stations rotator_2m --inclinations 1",
    "ka_model": "model.yaml",
    "keyhole": "--passes 2",
    "moving_base": "--seconds 20 --cases rest",
    "near_the_sun": "--passes 1 --apart 2.0 --station leo_3m7",
    "orbit_from_passes": "--trials 5 --at-once 5",
    "night": "--hours 0.5 --satellites 3 --station leo_3m7",
    "pass_search": "--objects 20",
    "period_calls": "",
    "planning": "--objects 30 --against 10",
    "predicted_loss": "--plan",
    "random_dishes": "2 4",
    "receiver": "--seconds 1",
    "recorded_pass": "monopulse",
    "replay": "",
    "second_stage": "--quick",
    "servo": "--runs 1",
    "slew_paths": "--trials 100 --each 50",
    "tracking": "",
}
"""Benchmarks in simulated time, and the arguments of a quick run."""
WALL_TIME = (
    "attack", "first_hour", "graph", "live_sensors", "live_stalls", "memory_growth", "operator_page", "processes",
    "radio", "real_campaign", "receiver_faults", "receiver_pass", "rotator_pass", "servo_jitter",
    "slews_on_a_drive", "soak", "two_antennas", "two_computers",
)  # fmt: skip
MINUTES = (
    "array_trials", "clock", "ephemeris_accuracy", "ephemeris_trials", "error_ledger", "lock_watch", "lqg_tuning", "mutants",
    "network_plan", "plant_tuning", "receiver_accuracy", "receiver_memory", "scanning_campaigns", "scans",
    "servo_tuning", "strong_carriers", "target_uncertainty", "tuning_trials", "zenith_passes",
)  # fmt: skip
PARTS = ("launched_station", "vendor_antenna", "live_night", "night_simulation", "real_station")
"""Modules of other benchmarks, without a command of their own."""
STEP_S = 0.05


@dataclass(frozen=True)
class Run:
    """One run: exit code, None when it was ended, times in s, and the last line that it printed."""

    code: int | None
    processor_s: float
    wall_s: float
    last_line: str


def run(name: str, arguments: str, limit_s: float) -> Run:
    """Run one benchmark; its processor time is that of all its processes."""
    began_s, code = time.monotonic(), None
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [sys.executable, str(FOLDER / f"{name}.py"), *arguments.split()],
            stdout=output, stderr=subprocess.STDOUT, start_new_session=True, cwd=folder,
            env=os.environ | {"MPLBACKEND": "agg", "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        ended, status, spent = os.wait4(process.pid, os.WNOHANG)
        while not ended:
            if time.monotonic() - began_s > limit_s:
                os.killpg(process.pid, 9)
                ended, _, spent = os.wait4(process.pid, 0)
                break
            time.sleep(STEP_S)
            ended, status, spent = os.wait4(process.pid, os.WNOHANG)
        else:
            code = os.waitstatus_to_exitcode(status)
        # It is waited for here and not by Popen, which would report it as still running.
        process.returncode = os.waitstatus_to_exitcode(status) if code is not None else -9
        output.seek(0)
        text = output.read()
        lines = [line for line in text.splitlines() if line.strip()] or [""]
        if code != 0:
            print(text, flush=True)
    return Run(code, spent.ru_utime + spent.ru_stime, time.monotonic() - began_s, lines[-1][:160])


def main() -> None:
    """Run them, print a line for each, and keep their times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*QUICK, []], metavar="NAME", help=", ".join(QUICK))
    parser.add_argument("--quick", action="store_true", help="small arguments")
    parser.add_argument("--limit", type=float, default=3600.0, help="longest run of each in s (default: 3600)")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    kept = json.loads(options.results.read_text()) if options.results.is_file() else {}
    failed = []
    for name in options.names or QUICK:
        key = f"{name} --quick" if options.quick else name
        found = run(name, QUICK[name] if options.quick else "", options.limit)
        earlier = kept.get(key, {})
        before = earlier.get("processor_s")
        ratio = f"{found.processor_s / before:5.2f} of the last" if before else "the first here"
        verdict = "ok" if found.code == 0 else "FAILED"
        print(f"{verdict:<7}{name:<20}{found.processor_s:7.1f} s  {ratio:<18}  {found.last_line}", flush=True)
        if found.code == 0:
            kept[key] = asdict(found) | {"before": {name: earlier[name] for name in earlier if name != "before"}}
        else:
            failed.append(f"{name} ({'too long' if found.code is None else f'code {found.code}'})")
    options.results.parent.mkdir(parents=True, exist_ok=True)
    options.results.write_text(json.dumps(kept, indent=1) + "\n")
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
