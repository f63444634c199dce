"""A night without an operator: 8 hours of 30 satellites, in simulated time, with and without faults.

    scripts/run-python benchmarks/night.py                          both stations, without faults
    scripts/run-python benchmarks/night.py --faults 20 --seed 1     the same with 20 faults at random times
    scripts/run-python benchmarks/night.py --station leo_3m7 --hours 1 --report /var/tmp/night
    scripts/run-python benchmarks/night.py --drive rotctld          20 faults in an hour of wall time (see live_night.py)

The satellites are the low ones of the synthetic catalogue of benchmarks/ephemeris.py; the schedule is made by
`plan_passes`, handed over as JSON.  Printed: passes planned, tracked, lost with their reasons; requests of an operator;
motions outside the gate; every fault with the alarm that it became; memory by the hour; wall time.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from ephemeris import EPOCH_T_S, synthetic_catalogue
from night_simulation import CAUSES, RESTART_S, NightFault, NightSimulation, kinds_of
from planning import as_omm

import rf_pointing as rp
from rf_pointing.core.dates import utc_text
from rf_pointing.operations.pass_list import read_passes
from rf_pointing.operations.schedule import BetweenParams, PassState
from rf_pointing.simulation import StationSetup

STATIONS = ("leo_3m7", "rotator_2m")
SECONDS = {"drive_lost": 20.0, "link_drop": 60.0, "runaway": 10.0, "encoder_frozen": 10.0, "axes_stuck": 10.0, "gust": 120.0,
           "stale_elements": 900.0, "full_disk": 900.0}  # fmt: skip


def schedule_of(station: str, folder: Path, hours: float, satellites: int) -> tuple[str, Path]:
    """Return the schedule as JSON, and the file of the elements."""
    low = [one for one in synthetic_catalogue(10 * satellites) if one.name.startswith("low")][:satellites]
    elements = folder / "elements.json"
    elements.write_text(json.dumps([as_omm(one) for one in low]))
    targets = [
        rp.elements(elements, satellite=one.catalogue_number, priority=k % 3, min_peak_deg=10.0)
        for k, one in enumerate(low)
    ]
    return rp.Station(station).plan(targets, start_t_s=EPOCH_T_S, hours=hours, gap_s=10.0).to_json(), elements


def random_faults(count: int, seed: int, start_s: float, hours: float, kinds: tuple[str, ...]) -> list[NightFault]:
    """Return faults at random times, every kind at least once as far as they reach."""
    rng = np.random.default_rng(seed)
    chosen = (kinds * (count // len(kinds) + 1))[:count]
    # Apart from each other, so that each has an effect of its own.
    times = start_s + 3600.0 * hours * (np.arange(count) + rng.uniform(0.1, 0.7, count)) / count
    return [
        NightFault(float(round(t_s)), str(kind), SECONDS.get(str(kind), RESTART_S + float(rng.uniform(3.0, 10.0))))
        for t_s, kind in zip(times, rng.permutation(chosen), strict=True)
    ]


def memory_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def measure(options: argparse.Namespace, station: str) -> bool:
    """Run one night and print it; return whether it is as asked for."""
    memory: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        text, elements = schedule_of(station, Path(folder), options.hours, options.satellites)
        setup = StationSetup(station)
        passes = read_passes(text, every=False)
        faults = random_faults(options.faults, options.seed, EPOCH_T_S, options.hours, kinds_of(setup))
        between = BetweenParams(lead_s=300.0) if options.procedure else None
        night = NightSimulation(
            setup, elements, passes, EPOCH_T_S, faults=faults, between=between, procedure=options.procedure
        )
        began_s, used_s = time.monotonic(), time.process_time()
        night.run(EPOCH_T_S + 3600.0 * options.hours + 3600.0, lambda _t_s: memory.append(memory_mb()))
        wall_s, used_s = time.monotonic() - began_s, time.process_time() - used_s
    if options.report:
        from rf_pointing.report.night_report import night_of, write_night

        write_night(
            night_of(night.night.state(), setup.station.name, health=night.health()), Path(options.report) / station
        )
    return show(options, station, night, len(passes), memory, (wall_s, used_s))


def show(
    options: argparse.Namespace,
    station: str,
    night: NightSimulation,
    scheduled: int,
    memory: list[float],
    took_s: tuple[float, float],
) -> bool:
    records, log, history = night.night.records, night.log, night.night.book.history
    tracked = [record for record in records if record.state == PassState.TRACKED]
    lost = [record for record in records if record.state != PassState.TRACKED]
    planned_s = sum(record.los_t_s - record.aos_t_s for record in tracked)
    held = 100.0 * sum(record.tracked_s for record in tracked) / max(1.0, planned_s)
    hours, moved_h = planned_s / 3600.0, log.moved_s / 3600.0
    print(f"\n{station}: {options.hours:g} h, {options.satellites} satellites, {len(log.faults)} faults")
    print(
        f"  passes scheduled {scheduled}, tracked {len(tracked)}, not tracked {len(lost)}; {hours:.2f} h, {held:.2f} % held"
    )
    print(f"  wall time {took_s[0] / 60.0:.1f} min (processor {took_s[1] / 60.0:.1f} min); operator actions 0")
    print(
        f"  antenna in motion {moved_h:.2f} h, outside the gate {len(log.outside)}; messages sent {len(log.messages)}"
    )
    begun = {entry.block: entry.t_s for entry in night.night.journal if entry.event == "begun"}
    ready = [entry.t_s for entry in night.night.journal if (entry.directive, entry.event) == ("track", "accepted")]
    took = sorted(min(t_s - s for s in begun.values() if s <= t_s) for t_s in ready)
    missed = sum(entry.event == "anomaly" for entry in night.night.journal)
    print(
        f"  from the begin of a pass to its goal {took[len(took) // 2]:.0f} s, at most {took[-1]:.0f} s; blocks failed {missed}"
    )
    print("  memory by the hour (MB): " + " ".join(f"{each:.0f}" for each in memory))
    for record in lost:
        print(
            f"    {record.state} {record.name} {utc_text(record.aos_t_s)[11:19]}: {record.reason}; {'; '.join(record.causes)}"
        )
    for one in log.outside[:5]:
        print(f"    OUTSIDE {one}")
    # A pass is under a fault when one begins or lasts in it, or in the slew to it.
    innocent = [
        record for record in lost
        if not any(f.t_s < record.los_t_s and f.t_s + f.seconds + 120.0 > record.aos_t_s for f in log.faults)
    ]  # fmt: skip
    unseen = 0
    for fault in log.faults:
        name, last_s = CAUSES[fault.kind], fault.t_s + fault.seconds + 60.0
        found = next(
            (row for row in history if row[1:3] == ("raised", name) and fault.t_s - 1.0 <= row[0] <= last_s), None
        )
        # The same cause within it is the same alarm: one message for each.
        if found is None:
            found = next((row for row in reversed(history) if row[2] == name and row[0] <= fault.t_s), None)
            found = found if found and found[1] == "raised" else None
        unseen += found is None
        when = f"after {found[0] - fault.t_s:.1f} s" if found and found[0] >= fault.t_s - 1.0 else "raised already"
        shown = f"{name} {when}: {found[4]}" if found else "NOT IN THE REPORT"
        print(f"  {utc_text(fault.t_s)[11:19]} {fault.kind:<17} {fault.seconds:5.0f} s -> {shown}")
    good = 0 < scheduled == len(records) and not innocent and not unseen and not log.outside
    print(
        f"  {'as asked' if good else 'NOT AS ASKED'}: {len(innocent)} lost without a fault, {unseen} faults without an alarm"
    )
    return good


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--station", help=f"(default: {' and '.join(STATIONS)})")
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--satellites", type=int, default=30)
    parser.add_argument("--faults", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--procedure", default="", help="procedure of a pass, as precalibration (default: the shipped)")
    parser.add_argument("--report", help="folder of the morning report")
    parser.add_argument(
        "--every", type=float, default=360.0, help="s from a pass to the next, on rotctld (default: 360)"
    )
    parser.add_argument("--drive", choices=("simulated", "rotctld"), default="simulated")
    options = parser.parse_args()
    if options.drive == "rotctld":
        from live_night import fly

        sys.exit(
            fly(min(20, options.faults or 20), Path(options.report or tempfile.mkdtemp(prefix="night-")), options.every)
        )
    good = [measure(options, station) for station in ([options.station] if options.station else STATIONS)]
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
