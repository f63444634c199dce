"""The executive without ROS: a night on what the nodes of one antenna publish.

`NightWatch` is stepped by time.  Whatever the night is, it is in the state file before a directive
leaves: a killed executive comes back with it, looks at the station, and goes on.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rf_pointing.core import KeptState, Params, mount_to_notes, parameter, require_choice
from rf_pointing.operations import AlarmParams, BetweenParams
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.operations.executor import block_text
from rf_pointing.operations.night import Night, NightState
from rf_pointing.operations.partners import Partners
from rf_pointing.operations.pass_work import filler_text, fillers_of
from rf_pointing.operations.schedule import Entry, PassState, Schedule, ScheduledPass
from rf_pointing.planning.horizon import horizon_to_notes
from rf_pointing.station.clients.alarm_hooks import HookParams, Message
from rf_pointing.station.clients.night_folder import NightFolder, Recording
from rf_pointing.station.clients.station_alarms import NEEDED, StationAlarms
from rf_pointing.station.description import StationDescription
from rf_pointing.station.parameters import controller_params
from rf_pointing.station.pointing.status import Level, Report
from rf_pointing.tracking.scan_program import PATTERNS
from rf_pointing.tracking.sensors import SENSOR_CHOICES, sensors_of

STATUS_S, SHARED_STATUS_S = 1.0, 0.4
"""Time between two statuses, usually and in a pass that is shared."""


@dataclass(frozen=True, kw_only=True)
class ExecutiveParams(Params):
    """Parameters of the executive itself."""

    state_file: str = parameter("", "file that keeps the night over a restart; empty: not kept")
    folder: str = parameter("runs/night", "folder of recordings, journal and morning report")
    directives_file: str = parameter("", "further directives of the station (YAML); empty: the shipped ones")
    procedure_file: str = parameter("", "procedure of a pass (YAML), or precalibration")
    maintenance_folder: str = parameter("", "procedures (YAML) besides self_test")
    recovery_file: str = parameter("", "recovery table (YAML); empty: the shipped one")
    sensor: str = parameter("", "sensor of passes that name none; empty: the station's")
    record: bool = parameter(True, "whether each pass is recorded and reported on")
    refine: str = parameter(
        "", "file of elements that the passes of a night refine; refined ones go next to it, into the folder that "
        "ephemeris_publisher reads; empty: not refined"
    )  # fmt: skip
    model: bool = parameter(False, "whether a bias model is fitted to scans and recorded passes at the end of a night")
    elements: str = parameter("", "elements of satellites that are scanned, for that fit; empty: of none")
    partners: str = parameter("", "namespaces of the antennas that share the schedule, separated by commas")
    partners_key_file: str = parameter("", "key that the executives of these antennas share; the first makes it")

    def check_together(self) -> None:
        """Refuse partners without a key: anybody could say that a pass has been tracked."""
        if self.partners and not self.partners_key_file:
            raise ValueError(f"partners_key_file='' must name the key that is shared with partners={self.partners}")


class NightWatch:
    """Runs a `Night`; `wall_s` is that of a steady clock.  ValueError refuses the files of `own`.

    `connect(rows, own actions, responded, ended)` returns the sender of directives, as
    `ros.directives.DirectiveSender`; `record(bag, notes)` begins a recording of every topic;
    `report(folder, health)` writes the morning report; `tell(text, good)` logs, and `publish` takes
    what an operator receives.
    """

    def __init__(
        self, own: ExecutiveParams, between: BetweenParams, alarms: AlarmParams, hooks: HookParams,
        station: StationDescription, band: str, antenna: str, *, connect: Callable[..., Any],
        record: Callable[[Path, Mapping[str, str]], Recording], report: Callable[..., None],
        tell: Callable[[str, bool], None], publish: Callable[[Message], None],
    ) -> None:  # fmt: skip
        require_choice("executive.sensor", own.sensor, ("", *SENSOR_CHOICES))
        self._own, self._thresholds, self._write_report, self._tell = own, alarms, report, tell
        tables = read_tables(alarms, own.directives_file, own.procedure_file, own.recovery_file, own.maintenance_folder)
        self._maintenance = tables.maintenance
        controller = controller_params(station, band)
        self._station = station
        self._notes = {
            "station": station.name,
            **horizon_to_notes(controller.mask),
            **mount_to_notes(controller.kinematics),
        }
        self.folder = NightFolder(own.folder, record)
        actions = {
            "scan": self._scan,
            "record": self._record,
            "end_record": self.folder.end_record,
            "report": self.folder.report,
        }
        self.sender = connect(tables.directives, actions, self._responded, self._ended)
        self.night = Night(
            Schedule(controller.limits, controller.machine.axes, between, antenna, controller.kinematics),
            tables.procedure, tables.recovery, self.sender.send, quiet_s=alarms.quiet_s, sensor=own.sensor, band=band,
            scan_procedure=tables.scan, least_share=controller.machine.least_share, save=self._keep,
        )  # fmt: skip
        self.alarms = StationAlarms(
            self.night.recovery, alarms, hooks, station.name, controller, self.folder.path, publish
        )
        self._memory, self._ready_to_keep = KeptState(own.state_file), False
        self._t_s = 0.0
        self._report, self._judged = "", 0
        self.others = Partners(antenna, self.partners, alarms.node_silent_s)
        self._rivals: dict[str, tuple[bool, float]] = {}
        self._steered_by = ""
        self._unrefined: list[tuple[str, str]] = []
        self._shown: Any = None
        self._status_wall_s, self._inhibit = 0.0, ""

    @property
    def partners(self) -> list[str]:
        """Namespaces of the antennas that share the schedule."""
        return [name for each in self._own.partners.split(",") if (name := each.strip().strip("/"))]

    def begin(self, now_s: float) -> None:
        """Go on with the night of the state file, if there is one."""
        self._t_s, kept = now_s, self._memory.recover()
        if kept and self.night.finished:
            self.night.restore(kept, now_s)
            self._tell(f"the night goes on where it was: {self.night.state_name}", True)
            if self.night.active_id:
                # The pass that was tracked when the executive was killed.
                try:
                    self._record(self.night.active_id)
                except (ValueError, OSError) as error:
                    self._tell(f"the rest of the pass is not recorded: {error}", False)
        # Only from here on: a state that was not taken over must not be replaced.
        self._ready_to_keep = True

    def end(self) -> None:
        """Keep the night and end the recording."""
        self._keep()
        self.folder.end_record()

    # What is known

    def take_rival(self, who: str, *, night: bool, first: bool, wall_s: float) -> None:
        """Note another executive of this antenna: whether it has a `night`, and began `first`."""
        if night:
            self._rivals[who] = first, wall_s
        else:
            self._rivals.pop(who, None)

    def _stand_aside(self, wall_s: float) -> bool:
        """Return whether another executive steers; of two nights that of the first goes on."""
        silent_s, idle = self._thresholds.node_silent_s, self.night.finished
        self._rivals = {who: row for who, row in self._rivals.items() if wall_s - row[1] <= silent_s}
        steers = next((who for who, (first, _) in self._rivals.items() if first or idle), "")
        if steers != self._steered_by:
            if not idle:
                self._tell(f"{_steers(steers)}: stands aside" if steers else "steers the antenna again", not steers)
                self.night.look_again()
            self._steered_by = steers
        return bool(steers) and not idle

    def _observe(self, t_s: float, wall_s: float) -> None:
        """Note what no message carries: what nodes lack for the next pass, recorder, files."""
        needed = self._needed()
        self.alarms.observe(t_s, wall_s, needed)
        self.night.take_readiness(self.alarms.reasons_not_ready(sorted(needed), wall_s), t_s)
        self.night.take("recorder", {"state": self.folder.recorder}, t_s)
        self.night.take("scan", {"state": self.folder.scan_state}, t_s)
        self.night.take("executive", {"problem": self._memory.problem or self.folder.problem}, t_s)

    def _needed(self) -> set[str]:
        """Return the nodes without which the present or the next pass cannot be tracked."""
        entry = self.night.schedule.active or self.night.schedule.next()
        sensor = (entry.item.sensor if entry else "") or self.night.sensor
        band = (entry.item.band if entry else "") or self.night.band
        sensor = sensor or self._station.chosen_sensor(band=band)
        trackers = (traits.node for traits in sensors_of(SENSOR_CHOICES.get(sensor, "")))
        return {*NEEDED, *self.alarms.named, *trackers}

    # Work

    def poll(self, now_s: float) -> None:
        """Take the responses that have come back."""
        self._t_s = now_s
        self.sender.poll()

    def step(self, t_s: float, wall_s: float) -> bool:
        """Do what is due; return whether the night has just ended, with its morning report."""
        self.poll(t_s)
        self._observe(t_s, wall_s)
        self.others.share(self.night, t_s, wall_s)
        before = self.night.state_name
        if self._stand_aside(wall_s):
            return False
        self.night.step(t_s)
        for record in self.night.records[self._judged :]:
            self.folder.judge(record)
            if self._own.refine and record.state == PassState.TRACKED and record.recorded:
                self._unrefined.append((record.name, record.band))
        self._refine()
        if self.folder.scanned != self.night.active_id:
            self.folder.end_scan()
        text, good = self.folder.fitted()
        if text:
            self._tell(text, good)
        self._judged = len(self.night.records)
        if self.night.journal:
            self.folder.write_journal(self.night.journal)
            self.night.journal.clear()
        if not self.night.finished or before == NightState.IDLE:
            return False
        self.folder.end_record()
        if self._own.model:
            done = [each for each in self.night.records if each.state == PassState.TRACKED]
            further = ["--elements", self._own.elements] * bool(self._own.elements)
            place = ["--station", str(self._station.path), "--band", self.night.band]
            self.folder.fit([each.id for each in done if each.recorded], [*place, *further])
        self._report = self.folder.write_morning(t_s, lambda folder: self._write_report(folder, self.alarms.healths))
        if self._report:
            self._tell(f"morning report {Path(self._report) / 'night.html'}", True)
        return True

    def _refine(self) -> None:
        """Refine elements from the passes of this night, one satellite after the other."""
        if self._own.refine and (news := self.folder.refined()):
            self._tell(news, news.startswith("elements refined"))
        # The recording of the pass must have ended.
        if not self._unrefined or self.folder.refining or self.folder.recorder != "idle":
            return
        name, band = self._unrefined.pop(0)
        mine = [each.id for each in self.night.records if each.name == name and each.state == PassState.TRACKED]
        if len(mine) < 2:
            return
        further = ["--station", str(self._station.path), "--band", band or self.night.band, "--satellite", name]
        try:
            self.folder.refine(mine, Path(self._own.refine).expanduser().resolve(), further)
        except OSError as error:
            self._tell(f"elements of {name} not refined: {error}", False)

    def _responded(self, number: int, accepted: bool, text: str, answer: Any = None) -> None:
        # A selection is answered with passes, which have the name of a target known by its number.
        names = [each.target for each in getattr(answer, "passes", ())]
        self.night.respond(number, accepted, text, self._t_s, *names[:1])

    def _ended(self, number: int, name: str, succeeded: bool, result: Mapping[str, Any]) -> None:
        message = str(result.get("message") or "")
        self.night.take(name, {**result, "succeeded": succeeded}, self._t_s)
        if name == "track":
            refused = "" if succeeded or result.get("seconds_tracked") else message
            self.night.take("track", {"refused": refused}, self._t_s)
        if not succeeded:
            self.night.fail(number, message or "it has failed", self._t_s)

    def _keep(self) -> None:
        if self._ready_to_keep:
            self._memory.keep(self.night.state())

    def _record(self, name: str) -> str:
        if not self._own.record:
            raise ValueError("executive.record is false")
        entry = self.night.schedule.entries.get(name)
        band = (entry.item.band if entry else "") or self.night.band
        notes = {**self._notes, "band": band}
        return self.folder.record(name, self._thresholds.disk_free_gb, notes)

    def _scan(self, **given: str) -> str:
        return self.folder.scan(**given, antenna=self.night.schedule.antenna)

    def inhibit(self, wall_s: float) -> str:
        """Return "" or why the antenna must not transmit in the pass in work: a partner may."""
        return self.others.inhibit(self.night, wall_s)

    def status_due(self, wall_s: float) -> bool:
        """Return whether to publish the status: partners and transmitter wait for it in a pass."""
        period_s = SHARED_STATUS_S if self.partners and self.night.schedule.active else STATUS_S
        inhibit = self.inhibit(wall_s)
        due = wall_s - self._status_wall_s >= period_s or inhibit != self._inhibit
        if due:
            self._status_wall_s, self._inhibit = wall_s, inhibit
        return due

    # Requests

    def request(self, name: str, now_s: float) -> str:
        """Pause, resume, stop or abort the night; return the answer."""
        getattr(self.night, name)(now_s)
        return f"{name}: the executive is {self.night.state_name}"

    def run(self, name: str, now_s: float) -> str:
        """Begin a procedure of maintenance between two passes; return the answer."""
        require_choice("name", name, tuple(self._maintenance))
        if self._steered_by:
            raise ValueError(_steers(self._steered_by))
        self.night.run(self._maintenance[name], now_s)
        return f"{name} begins; its outcome is in the log: station log"

    def cancel(self, now_s: float) -> None:
        """Abort the night, if it has not ended meanwhile."""
        with suppress(ValueError):
            self.night.abort(now_s)

    def acknowledge(self, name: str, now_s: float) -> str:
        """Acknowledge an alarm, or all with an empty name; return the answer."""
        names = self.night.book.acknowledge(name, now_s)
        self._keep()
        return f"acknowledged: {', '.join(names) or 'no alarm lasts'}"

    def change(self, added: Sequence[ScheduledPass], remove: Sequence[str], now_s: float) -> str:
        """Add passes, and remove those of these ids: all of it, or nothing."""
        schedule = self.night.schedule
        self._require_bands(added)
        schedule.change(added, remove)
        self.night.change(now_s)
        return f"{len(added)} passes added, {len(remove)} removed; {len(schedule.entries)} in all"

    def _require_bands(self, passes: Sequence[ScheduledPass]) -> None:
        """Raise ValueError for a pass of this antenna in a band that it does not have."""
        for each in passes:
            if each.antenna in ("", self.night.schedule.antenna):
                require_choice(f"pass {each.id}: band", each.band, ("", *self._station.bands))
                require_choice(f"pass {each.id}: scan", each.scan, ("", *PATTERNS))
                if each.scan and each.band not in ("", self.night.band):
                    raise ValueError(
                        f"pass {each.id}: a scan is in the band in use, {self.night.band}, not {each.band}"
                    )
                if each.band and "band" not in self.night.procedure.parameters:
                    needs = "needs a procedure_file with parameter band"
                    raise ValueError(f"pass {each.id}: band={each.band} {needs}")

    def start(self, passes: Sequence[ScheduledPass], resume: bool, now_s: float) -> None:
        """Begin a night with these passes, or take part in the present one."""
        night = self.night
        if self._steered_by:
            raise ValueError(_steers(self._steered_by))
        if not night.finished and not resume:
            raise ValueError(f"the executive is {night.state_name}: resume, or abort first")
        if night.finished and not passes and not (resume and night.schedule.entries):
            raise ValueError("passes=[] must name passes")
        self._require_bands(passes)
        night.schedule.change(passes, () if resume else tuple(night.schedule.entries))
        if night.finished:
            night.start(now_s)
        else:
            # The night goes on after a restart; the client takes part again.
            night.change(now_s)

    # What is shown

    def news(self) -> list[Entry] | None:
        """Return the schedule if it has changed since this was called last."""
        rows = self.night.schedule.state()
        if rows == self._shown:
            return None
        self._shown = rows
        return self.night.schedule.in_order

    def result(self, reason: str) -> dict[str, Any]:
        """Return the result of the night, or of one refused for `reason`, by its fields."""
        if reason:
            return {"message": reason}
        records = self.night.records
        states = Counter(record.state for record in records if not record.filler)
        tracked = states[PassState.TRACKED]
        lost = sum(states.values()) - tracked
        gaps = [f"{name} {filler_text(each)}" for name, each in fillers_of(records).items()]
        said = "; ".join([f"{self.night.reason}: {tracked} tracked, {lost} not", *gaps])
        return {"success": lost == 0, "passes_tracked": tracked, "passes_lost": lost, "report": self._report,
                "message": said}  # fmt: skip

    def progress(self) -> dict[str, Any]:
        """Return where the night is, by the fields of its feedback."""
        night = self.night
        states = Counter(each.state for each in night.schedule.entries.values())
        entry = night.schedule.active
        step = [block_text(name, run.state, run.reason) for name, run in night.blocks()]
        step += [night.reason] * bool(entry)
        return {"state": str(night.state_name), "target": entry.item.name if entry else "",
                "step": "; ".join(filter(None, step)), "passes_done": len(night.records),
                "passes_left": states[PassState.WAITING] + states[PassState.ACTIVE]}  # fmt: skip

    def health(self) -> Report:
        """Return state and reason, or what the disk or a server does not take."""
        night = self.night
        values: dict[str, object] = {
            "pass": night.active_id, "passes": len(night.schedule.entries), "records": len(night.records),
        }  # fmt: skip
        problem = self._memory.problem or self.folder.problem
        if self._rivals:
            steers = self._steered_by and not night.finished
            problem = _steers(self._steered_by) if self._steered_by else f"{_steers(next(iter(self._rivals)))}, too"
            return Report(Level.ERROR if steers else Level.WARN, problem, values)
        return Report(Level(bool(problem)), problem or f"{night.state_name}: {night.reason}".rstrip(": "), values)


def _steers(who: str) -> str:
    return f"station_executive {who} has a night of this antenna: end one of the two"
