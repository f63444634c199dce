"""Calibration of one station and band: its observations, its pointing models, and a campaign.

A pass counts as observed when it gave observations, even if the controller does not call it
tracked: most of a short piece of a pass goes into the search.  A fault of the antenna ends the
campaign: it would refuse every other pass, too.

With a folder every observation is on the disk before the next one is taken, one file and one set of
models for each station and band: a killed node continues where it was.
"""

import math
from collections.abc import Callable, Collection, Generator, Sequence
from dataclasses import dataclass
from typing import Any

from rf_pointing import __version__, calibration
from rf_pointing.calibration import AcceptanceRules, FitResult, ModelVersion, ObservationJournal, PassPriors, SectorRule
from rf_pointing.core import LEVEL, MDEG, JointReading, Kinematics, Params, PointingError, parameter
from rf_pointing.station.campaign.log import CalibrationLog
from rf_pointing.station.campaign.model_keeper import ModelKeeper, campaign_folder
from rf_pointing.station.pointing.status import Level, Report

SECTORS = SectorRule()
# Wall time after which a service or an action server that does not answer is given up.
ANSWER_S = 20.0
ORBIT = PassPriors(along_track_m=100.0, cross_track_m=60.0, radial_m=30.0)
"""Errors of a reference orbit, unless other ones are stated."""


@dataclass(frozen=True, kw_only=True)
class CalibratorParams(Params):
    """Where the models live and how observations are taken."""

    folder: str = parameter("", "folder of models and observations; empty: none are kept after the node ends")
    keep_observations: bool = parameter(True, "whether observations are kept in the folder as well")
    model_file: str = parameter("", "model in force before one is accepted; empty: no correction")
    station: str = parameter("Goldstone DSS-13", "station that the model must belong to")
    band: str = parameter("X", "band that the model must belong to")
    spacing_s: float = parameter(1.0, "time between two observations", 0.1, 600.0)
    scan_spacing_s: float = parameter(
        8.0, "the same while the beam scans: estimates from the same window differ little", 0.1, 600.0
    )
    sigma_rad: float = parameter(
        2.0 * MDEG, "standard deviation of one observation on the sky, added to the sensor's own", 1e-7, 0.1
    )
    largest_error_rad: float = parameter(
        6.0 * MDEG, "sensed error above which nothing is observed: a tenth of a beamwidth", 1e-7, 0.1
    )
    settle_s: float = parameter(0.0, "time with a valid sensor before the first observation of a pass", 0.0, 600.0)


def journal_of(folder: str, station: str, band: str, mount: Kinematics = LEVEL) -> ObservationJournal:
    """Return the observations that are kept in `folder` for a station and band."""
    # One journal for each of them: a fit of mixed observations would be of no antenna.
    return ObservationJournal(campaign_folder(folder, station, band) / "observations.csv", station, band, mount)


class Calibrator:
    """The models (`keeper`) and the observations (`log`); ValueError for a file that is refused."""

    def __init__(self, params: CalibratorParams, rules: AcceptanceRules, mount: Kinematics = LEVEL) -> None:
        start = calibration.read_model(params.model_file) if params.model_file else None
        self.keeper = ModelKeeper(params.station, params.band, params.folder, start, rules, mount)
        self.retune, self.mount = self.keeper.retune, mount
        kept = params.folder and params.keep_observations
        self.log = CalibrationLog(
            params.station, params.band, params.spacing_s, params.sigma_rad, scan_spacing_s=params.scan_spacing_s,
            largest_error_rad=params.largest_error_rad, settle_s=params.settle_s,
            journal=journal_of(params.folder, params.station, params.band, mount) if kept else None, mount=mount,
        )  # fmt: skip

    def in_band(self, params: CalibratorParams, rules: AcceptanceRules, t_s: float) -> "Calibrator":
        """Return the calibrator of another band with its model in force; this one is at rest."""
        other = Calibrator(params, rules, self.mount)
        other.keeper.temperature_k = self.keeper.temperature_k
        other.keeper.begin(t_s)
        self.log.write_waiting()
        return other

    def take_error(self, error: PointingError, reading: JointReading | None) -> None:
        """Take an error with the encoders next to it: an observation, if one is due."""
        if reading is not None:
            self.log.take_joints(reading)
        row = self.log.take_error(error)
        if row is not None:
            self.keeper.observe(row)

    def fit(
        self, terms: Collection[str], name: str, orbit: PassPriors, now_s: float
    ) -> tuple[FitResult, ModelVersion, tuple[str, ...]]:
        """Fit the observations and make the model the candidate; return its doubts as well.

        Raises ValueError with the reason why it cannot be fitted.
        """
        fit = self.log.fit(self.keeper.model, terms=tuple(terms), pass_priors=orbit)
        name = name or self.keeper.free_name(f"fit-{now_s:.0f}")
        file = ModelVersion.from_fit(fit, name=name, software=f"rf_pointing {__version__}", created_t_s=now_s)
        self.keeper.propose(file)
        return fit, file, calibration.warnings_of(fit, self.log.observations())

    def accept(self, now_s: float) -> str:
        """Put the candidate in force (`ModelKeeper.accept`); return what it was, in words."""
        verdict = self.keeper.verdict_text()
        return f"{self.keeper.accept(now_s).name} is in force; it was {verdict}"

    def roll_back(self) -> str:
        """Put the model before in force again (`ModelKeeper.roll_back`); return which, in words."""
        file = self.keeper.roll_back()
        return f"{file.name if file else 'no model'} is in force again"

    def outcome(self, campaign: "Campaign | None", reason: str) -> dict[str, Any]:
        """Return the result of a campaign, or of one refused for `reason`, by its fields."""
        verdict, candidate, count = self.keeper.verdict(), self.keeper.candidate, len(self.log)
        found = {"observations": count, "sectors_filled": self._sectors_filled(), "message": reason,
                 "verdict": verdict.word if verdict else ""}  # fmt: skip
        if campaign is None or reason:
            return found
        wanted, fault = len(campaign.passes), campaign.fault
        lines = [f"{campaign.observed} of {wanted} passes observed, {count} observations"]
        if fault:
            lines.insert(0, f"stopped by a fault in pass {campaign.number} of {wanted}: {fault}")
        if verdict is not None and candidate is not None:
            lines.append(f"{candidate.name} is {self.keeper.verdict_text()}")
        return found | {
            "success": campaign.observed == wanted and not fault, "fault": fault, "passes_observed": campaign.observed,
            "message": "; ".join([*lines, *campaign.failures]),
        }  # fmt: skip

    def progress(self, campaign: "Campaign") -> dict[str, Any]:
        """Return where a campaign is, by the fields of its feedback."""
        return {
            "pass_number": campaign.number, "target": campaign.target, "observations": len(self.log),
            "sectors_filled": self._sectors_filled(), "progress": (campaign.number - 1) / len(campaign.passes),
        }  # fmt: skip

    def _sectors_filled(self) -> int:
        return SECTORS.count - len(self.log.coverage(SECTORS).thin)

    def health(self) -> Report:
        """Return the model in force, or what is wrong, and the numbers behind it."""
        keeper = self.keeper
        values: dict[str, object] = {
            "observations": len(self.log),
            "candidate": keeper.candidate.name if keeper.candidate else "",
            "shadow": keeper.verdict_text(),
        }
        # A station need not have one: a warning that stays for ever is read by nobody.
        name = keeper.active.name if keeper.active else "no model: commands are not corrected"
        return Report(Level(bool(self.log.problem)), self.log.problem or name, values)


class Campaign:
    """Runs passes one after the other; `failures` says why some gave no observation.

    `select(wanted)` and `track(wanted, sensor)` ask for a pass: what they return has the response,
    or the handle of a goal, once it is `done()`.  `fault` is what ended the campaign before its
    last pass.  Raises ValueError for nothing to track.
    """

    def __init__(
        self, passes: Sequence[Any], sensor: str, log: CalibrationLog, select: Callable[[Any], Any],
        track: Callable[[Any, str], Any],
    ) -> None:  # fmt: skip
        if not passes:
            raise ValueError("passes is empty, must name at least one pass")
        self.passes, self._sensor, self._log, self._select, self._track = list(passes), sensor, log, select, track
        self.number, self.observed, self.target, self.fault = 0, 0, "", ""
        self.failures: list[str] = []
        self.over = self._cancelled = False
        self._handle: Any = None
        self._work = self._run()
        self._answer: Any = None
        self._until_s = math.inf

    def cancel(self) -> None:
        """End after the pass in work has been stopped under control."""
        self._cancelled = True
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def poll(self, wall_s: float) -> None:
        """Continue where an answer has arrived; `wall_s` is that of a steady clock."""
        # Polled between two events: a callback that waited for an answer would block its arrival.
        try:
            if self._answer is None:
                self._answer, longest_s = next(self._work)
            elif self._answer.done():
                self._answer, longest_s = self._work.send(self._answer.result())
            elif wall_s > self._until_s:
                self._answer, longest_s = self._work.throw(TimeoutError())
            else:
                return
            self._until_s = wall_s + longest_s
        except StopIteration:
            self.over = True

    def _run(self) -> Generator[tuple[Any, float], Any, None]:
        for wanted in self.passes:
            self.number, self.target = self.number + 1, wanted.target
            try:
                why = yield from self._observe(wanted)
            except TimeoutError:
                why = f"no answer within {ANSWER_S:.0f} s"
            self._handle = None
            if why:
                self.failures.append(f"{self.target}: {why}")
            if self.fault or self._cancelled:
                return

    def _observe(self, wanted: Any) -> Generator[tuple[Any, float], Any, str]:
        """Observe one pass; return why it gave no observation, "" if it did."""
        before = len(self._log)
        self._log.begin_pass()
        answer = yield self._select(wanted), ANSWER_S
        if not answer.success:
            return str(answer.message)
        handle = yield self._track(wanted, self._sensor), ANSWER_S
        if not handle.accepted:
            return "the controller refused the pass"
        self._handle = handle
        # A pass lasts as long as it lasts: only services and goals have a time to answer in.
        result = (yield handle.get_result_async(), math.inf).result
        self.fault = result.fault
        if len(self._log) > before:
            self.observed += 1
            return ""
        return f"no observation, {result.seconds_tracked:.0f} s on target, {result.message}; {self._log.reasons()}"
