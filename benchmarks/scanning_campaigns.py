"""Calibration by scans alone: does a campaign with conscan or step-track give a right pointing model?

scripts/run-python benchmarks/scanning_campaigns.py [--station dss13 leo_3m7] [--sensor conscan steptrack] [--span 1500]

Beacons are tracked by the whole simulated station, what the calibrator hears becomes observations and a
fit, and a beacon that was not in it is then followed on the model alone.  Printed per case: observations,
what was not used and why, and the true error of that pass in beamwidths, before and after; the exit
status is 1 where the model misses by 5 % of a beamwidth rms.  The ephemerides are exact.
"""

import argparse
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

from rf_pointing.calibration import BiasModel, PassPriors, SectorRule, Slew, plan_campaign
from rf_pointing.core import CarrierPower, JointReading, PointingError
from rf_pointing.ephemeris import Elements, Pass, Site, tle_lines
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.campaign.log import CalibrationLog
from rf_pointing.station.campaign.plan import ArcRules, beacons, candidate_arcs, window_of

START_S = 1151193600.0
ACQUISITION_S, SETTLE_S, LEAD_S = 60.0, 25.0, 20.0
# As `calibrate` and the calibrator have them.
SPACING_S, SCAN_SPACING_S, SIGMA_RAD, ORBIT_M = 0.5, 8.0, math.radians(2e-3), 5.0
ALLOWED_BEAMWIDTHS = 0.05
TARGET_STEP_S = 0.5


class Listener:
    """The station's tracker of the carrier, and a calibrator that hears what it hears."""

    def __init__(self, setup: StationSetup, log: CalibrationLog) -> None:
        self._tracker, self._track, self._log = setup.power_tracker(), setup.track(), log
        self._target_s, self._azimuth_rad = -math.inf, math.pi

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoders."""
        self._tracker.take_joints(reading)
        self._log.take_joints(reading)

    def take_status(self, t_s: float, centre_rad: np.ndarray, offset_rad: np.ndarray, mode: str, sensor: str) -> None:
        """Note the controller's status, and the target that it follows."""
        self._tracker.take_status(t_s, centre_rad, offset_rad, mode, sensor)
        self._log.take_status(t_s, centre_rad, offset_rad, mode, sensor)
        if t_s + 1.0 >= self._target_s + TARGET_STEP_S:
            self._target_s = t_s + 1.0
            target = self._track.target_at(self._target_s, near_azimuth_rad=self._azimuth_rad)
            self._azimuth_rad = target.azimuth_rad
            self._log.take_target(target)

    def take_power(self, power: CarrierPower) -> list[PointingError]:
        """Return the errors that a carrier power gives, which the calibrator receives too."""
        errors = self._tracker.take_power(power)
        for error in errors:
            self._log.take_error(error)
        return errors


def setup_of(
    station: str,
    elements: Elements,
    window: Pass,
    file: Path,
    model: BiasModel | None = None,
    log: CalibrationLog | None = None,
) -> StationSetup:
    """Return the station in front of one pass of a beacon, its axes where the pass begins.

    `log` receives what the calibrator would.
    """
    file.write_text("\n".join((elements.name, *tle_lines(elements))) + "\n")
    source = {"source.elements": str(file), "source.satellite": str(elements.catalogue_number)}
    lowest_deg = StationSetup(station).station.content.mount.azimuth.travel_deg[0]
    start = {
        "antenna.start_azimuth_deg": lowest_deg + (math.degrees(window.aos_azimuth_rad) - lowest_deg) % 360.0,
        "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
    }
    changes: dict[str, dict[str, object]] = {
        "antenna_servo": dict(start),
        "ephemeris_publisher": dict(source),
        "rf_receiver": {**source, "source.along_track_offset_s": 0.0},
    }
    setup = StationSetup(station, changes=changes, model=model)
    return setup if log is None else StationSetup(station, changes=changes, model=model, tracker=Listener(setup, log))


def planned(site: Site, span_s: float) -> list[tuple[Elements, Pass]]:
    """Return the beacons of a campaign and their passes, last the one to be pointed at.

    That is the one in the middle of their azimuth rates.  The lag terms stand for the rates that were seen, and
    the axes of a large antenna lag behind a pass at 1.4 deg/s by what no term of the mount describes: on dss13
    8 % of a beamwidth, where the same model misses by 1 % at up to 0.5 deg/s.
    """
    sky = {one.name: one for one in beacons(START_S)}
    rules = ArcRules(arcs_s=(150.0,), every_s=60.0, spacing_s=1.0, lowest_rad=0.25, lead_s=ACQUISITION_S)
    candidates, _ = candidate_arcs(list(sky.values()), site, START_S + 180.0, span_s, rules)
    plan = plan_campaign(candidates, SectorRule(fewest=12), Slew(settle_s=ACQUISITION_S))
    passes = [(sky[one.name], window_of(one, sky[one.name], site, ACQUISITION_S)) for one in plan.passes]
    in_the_middle = sorted(passes, key=lambda one: one[1].peak_azimuth_rate_rad_s)[len(passes) // 2]
    return [one for one in passes if one is not in_the_middle] + [in_the_middle]


def missed_beamwidths(setup: StationSetup, window: Pass) -> float:
    """Return the rms error (beamwidths) of a pass on the model alone, once the lags have settled."""
    log = simulate_pass(setup, window, window.aos_t_s - LEAD_S, "program")
    late = np.array(log.t_s) > window.aos_t_s + SETTLE_S
    rms_rad = math.sqrt(float(np.mean(np.sum(log.errors_rad()[late] ** 2, axis=1))))
    beamwidth_deg = math.degrees(setup.sets("pointing_controller")["machine"].half_power_beamwidth_rad)
    return math.degrees(rms_rad) / float(beamwidth_deg)


def log_of(described: StationSetup) -> CalibrationLog:
    """Return the log of a campaign, as the calibrator of the station has it."""
    largest_deg = math.degrees(described.sets("bias_calibrator")["calibrator"].largest_error_rad)
    return CalibrationLog(
        described.station.name, described.band, SPACING_S, SIGMA_RAD, scan_spacing_s=SCAN_SPACING_S,
        largest_error_rad=math.radians(largest_deg), settle_s=SETTLE_S,
    )  # fmt: skip


def campaign(station: str, sensor: str, span_s: float, file: Path) -> tuple[str, float]:
    """Return the line of one case, and by what its model misses in beamwidths."""
    described = StationSetup(station)
    log = log_of(described)
    *passes, (elements, window) = planned(described.station.site, span_s)
    for number, (beacon, one) in enumerate(passes, start=1):
        setup, so_far = setup_of(station, beacon, one, file, log=log), len(log)
        log.begin_pass()
        simulate_pass(setup, one, one.aos_t_s - LEAD_S, sensor)
        print(f"    pass {number}: {len(log) - so_far} observations; {log.reasons()}", file=sys.stderr, flush=True)
    fit = log.fit(described.model, pass_priors=PassPriors.of_orbit(ORBIT_M))
    before, after = (
        missed_beamwidths(setup_of(station, elements, window, file, model), window) for model in (None, fit.model)
    )
    line = (
        f"{station:8s} {sensor:9s} {len(log):4d} observations of {len(passes)} passes, {len(fit.rejected)} edited out; "
        f"missed by {100.0 * before:6.1f} % of a beamwidth before, {100.0 * after:4.1f} % after"
    )
    return line, after


def main() -> int:
    """Print a line for each case; 1 where a model misses by more than is allowed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--station", nargs="+", default=["leo_3m7", "dss13"])
    parser.add_argument("--sensor", nargs="+", default=["conscan", "steptrack"])
    parser.add_argument("--span", type=float, default=1500.0, help="length of the campaign, s")
    options = parser.parse_args()
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for station in options.station:
            for sensor in options.sensor:
                line, missed = campaign(station, sensor, options.span, Path(folder) / "beacon.tle")
                print(line, flush=True)
                worst = max(worst, missed)
    return int(worst > ALLOWED_BEAMWIDTHS)


if __name__ == "__main__":
    sys.exit(main())
