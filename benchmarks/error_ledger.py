"""Hold the error ledger against the truth: passes with one planted cause each.

scripts/run-python benchmarks/error_ledger.py [STATION ...] [--sensor program] [--blind] [--seconds 45]

The truth of a cause is the rms of the error with it minus that without it, in two flights with the same
seeds; that of the scan is what is commanded, that of the search all until every flight has settled.  A
case passes where no row is farther from its truth than 10 % of the largest one.  --blind gives the
ledger a recording without simulation truth and without the parameters of the run.
"""

import argparse
import dataclasses
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

import rf_pointing as rp
from rf_pointing.api.ledger import REMEMBERED_S, WAITING_S, PlannedCase
from rf_pointing.core import AXES, MDEG, sky_offset_rad
from rf_pointing.drives import takes_positions
from rf_pointing.report.error_ledger import EPHEMERIS, MODEL, NOISE, REFRACTION, SCAN, SEARCH, STEPS, WIND, Ledger
from rf_pointing.report.replay_report import TRUE, Flown, settled_s
from rf_pointing.simulation import StationSetup, merged
from test.api.headless_bag import HeadlessBag

Changes = dict[str, dict[str, Any]]
LEVEL = "link.zenith_carrier_to_noise_db_hz"
SHARE = 0.1
BITS, WEAKER_DB = {"dss13": 17, "leo_3m7": 14}, {"dss13": 10.0, "leo_3m7": 12.0, "rotator_2m": 12.0}
COARSE_DEG, LATE_S, WIND_M_S, MODEL_DEG = 0.5, 0.15, 12.0, 0.02
SOUGHT = ("search", "slew")


def level(setup: StationSetup, by_db: float) -> Changes:
    """Return another C/N0, which controller and receiver know."""
    zenith = setup.sets("rf_receiver")["signal"].link.zenith_carrier_to_noise_db_hz + by_db
    return {"rf_receiver": {f"signal.{LEVEL}": zenith}, "pointing_controller": {LEVEL: zenith}}


def mount(coefficients: dict[str, float], **more_deg: float) -> Changes:
    """Return a mount with these errors in rad and s, and more of some in deg."""
    found = {}
    for field in dataclasses.fields(StationSetup("dss13").sets("antenna_servo")["mount"]):
        stem, _, unit = field.name.rpartition("_")
        edge = f"mount.{stem}_deg" if unit == "rad" else f"mount.{field.name}"
        value = coefficients[stem]
        found[edge] = (math.degrees(value) if unit == "rad" else value) + more_deg.get(stem, 0.0)
    return {"antenna_servo": found}


def causes(name: str, setup: StationSetup) -> dict[str, tuple[Changes, Changes]]:
    """Return by the row what plants a cause, and what switches it off."""
    own = setup.sets("antenna_servo")["mount"].model().coefficients
    if takes_positions(setup.sets("antenna_servo")["drive"].type) or name == "rotator_2m":
        coarse, fine = ({"drive.rotator.resolution_deg": [step] * 2} for step in (COARSE_DEG, 1e-5))
    else:
        coarse = {f"plant.{axis}.encoder_bits": BITS[name] for axis in AXES}
        fine = {f"plant.{axis}.encoder_bits": 30 for axis in AXES}
        fine |= {f"plant.{axis}.encoder_noise_deg": 0.0 for axis in AXES}
    late, wind = "source.along_track_offset_s", "wind.mean_speed_m_s"
    off_deg = MODEL_DEG / math.sqrt(2.0)
    return {
        EPHEMERIS: ({"rf_receiver": {late: LATE_S}}, {"rf_receiver": {late: 0.0}}),
        MODEL: (mount(own, collimation=off_deg, elevation_offset=off_deg), mount(setup.model.coefficients)),
        REFRACTION: (
            {"ephemeris_publisher": {"source.refraction": "none"}},
            {"ephemeris_publisher": {"source.refraction": "standard"}},
        ),
        NOISE: (level(setup, -WEAKER_DB[name]), {}),
        WIND: ({"antenna_servo": {wind: WIND_M_S}}, {"antenna_servo": {wind: 0.0}}),
        STEPS: ({"antenna_servo": coarse}, {"antenna_servo": fine}),
    }  # fmt: skip


class Case:
    """A station, the first seconds of its pass and what is planted."""

    def __init__(self, name: str, sensor: str | None, seconds: float) -> None:
        self.name, self.station = name, rp.Station(name)
        # At 12 deg a refraction that is left out is more than the X-band beam of 34 m is wide.
        mask_deg = 30.0 if name == "dss13" else 12.0
        found = self.station.passes(rp.elements("28057"), days=3.0, min_peak_deg=40.0, mask_deg=mask_deg)[0]
        window = dataclasses.replace(found.window, los_t_s=found.aos_t_s + seconds)
        self.one = dataclasses.replace(found, window=window)
        self.sensor = sensor or self.station.sensors[0]
        chosen = self.station.certificate(found).chosen
        assert chosen is not None
        standing = zip(AXES, map(math.degrees, chosen.start_rad), strict=True)
        self.start: Changes = {
            "antenna_servo": {f"antenna.start_{axis}_deg": at for axis, at in standing},
            "rf_receiver": {"source.along_track_offset_s": 0.0},
            # The Sun at the horizon is elsewhere in a vacuum, and another station's Sun is refused.
            "pointing_controller": {"gate.sun_radius_deg": 0.0},
        }
        # A calibrated mount, on which a cause is what is planted and not what commissioning left.
        own = self.station.setup(self.one)
        self.start = merged(self.start, mount(own.model.coefficients))
        self.causes = causes(name, self.station.setup(self.one, 1, self.start))

    def errors(self, changes: Changes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the true errors and the scan (n, 2) in mdeg, and where (n,) the beam was on the target."""
        case = PlannedCase(self.station, self.one, self.sensor, 1, merged(self.start, changes))
        signals, _ = case.fly(case.setup())
        flown = Flown.of(signals, TRUE, None)
        among = (flown.t_s >= self.one.window.aos_t_s) & (flown.t_s <= self.one.window.los_t_s)
        # An antenna that has stopped has no centre of a scan.
        statuses = [each for each in signals.of("tracking_status") if each.mode != "idle"]
        held = np.searchsorted([each.t_s for each in statuses], flown.t_s, side="right") - 1
        modes = np.array([each.mode for each in statuses])[held]
        begin_s = settled_s(flown, self.one.window.aos_t_s)
        begin_s += REMEMBERED_S * (begin_s > flown.t_s[among][0])
        near = (flown.t_s >= begin_s) & ~np.isin(modes, SOUGHT)
        sent, at = signals.of("joint_trajectory"), flown.t_s[among]
        command, centre = (
            [np.interp(at, times, column) for column in np.array(angles).T]
            for times, angles in (
                ([each.t_s[0] for _, each in sent], [each.position_rad[0] for _, each in sent]),
                ([each.t_s for each in statuses], [each.scan_centre_rad for each in statuses]),
            )
        )
        scan = np.column_stack(sky_offset_rad(*command, *centre)) / MDEG
        return flown.error_rad[among] / MDEG, scan, near[among]

    def truth(self, planted: Changes) -> dict[str, float]:
        """Return the rms in mdeg of what each cause adds to the error."""
        with_all, scan, near = self.errors(planted)
        flown = {}
        for row, (_, off) in self.causes.items():
            if row == NOISE:
                off = level(self.station.setup(self.one, 1, planted), 30.0)
                off["rf_receiver"]["signal.receiver.phase_noise_deg"] = 0.0
            flown[row], _, also = self.errors(merged(planted, off))
            near = near & also
        found = {SEARCH: float(np.sqrt(np.mean(~near * np.sum(with_all**2, axis=1))))}
        moved = {SCAN: scan} | {row: with_all - without for row, without in flown.items()}
        return found | {row: float(np.sqrt(np.mean(near * np.sum(each**2, axis=1)))) for row, each in moved.items()}

    def ledger(self, planted: Changes) -> Ledger:
        """Return the ledger of the simulated pass."""
        return rp.budget(self.one, sensor=self.sensor, late_s=0.0, changes=merged(self.start, planted))

    def flown(self, planted: Changes) -> HeadlessBag:
        """Return the pass as it is recorded."""
        setup = self.station.setup(self.one, 1, merged(self.start, planted))
        return HeadlessBag(setup, self.one.window, math.floor(self.one.aos_t_s) - WAITING_S, self.sensor)

    def blind(self, planted: Changes) -> Ledger:
        """Return the ledger of a recording that holds neither truth nor parameters."""
        with tempfile.TemporaryDirectory() as folder:
            written = self.flown(planted).write(Path(folder) / "run", without=("sim/pointing_error",), run=False)
            return rp.ledger(written)


def main() -> None:
    """Fly the cases, and print ledger and truth of every cause."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = ("dss13", "leo_3m7", "rotator_2m")
    parser.add_argument("stations", nargs="*", default=names, metavar="STATION", help=f"of {', '.join(names)}")
    parser.add_argument("--sensor")
    parser.add_argument("--blind", action="store_true")
    parser.add_argument("--seconds", type=float, default=45.0)
    options = parser.parse_args()
    passed = total = 0
    print(f"{'station':<12}{'planted':<20}" + "".join(f"{each:>22}" for each in ("found/true, mdeg",)))
    for name in options.stations:
        case = Case(name, options.sensor, options.seconds)
        print(
            f"{'':<32}"
            + "".join(f"{each.split(' ')[0]:>18}" for each in (SEARCH, SCAN, *case.causes))
            + f"{'missed':>9}"
        )
        for planted, (plant, _) in case.causes.items():
            truth = case.truth(plant)
            found = case.blind(plant) if options.blind else case.ledger(plant)
            missed = max(abs(found.cause(row).rms_mdeg - true) for row, true in truth.items()) / max(truth.values())
            shown = "".join(f"{found.cause(row).rms_mdeg:10.2f}/{true:7.2f}" for row, true in truth.items())
            total, passed = total + 1, passed + (missed <= SHARE)
            print(f"{name:<12}{planted:<20}{shown}{100.0 * missed:8.1f}%", flush=True)
            print(f"{'':<12}total {found.rms_mdeg:.2f} mdeg {found.loss_db:.3f} dB, sum {found.sum_db:.3f} dB, "
                  f"unexplained {found.cause('unexplained').rms_mdeg:.2f} mdeg", flush=True)  # fmt: skip
    print(f"{passed} of {total} within {100.0 * SHARE:.0f} % of the largest cause")


if __name__ == "__main__":
    main()
