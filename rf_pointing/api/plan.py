"""The plan of one antenna for many satellites, as rows, text, JSON, CSV, calendar and picture.

Every pass is listed with what becomes of it: tracked (with its branch), yields (to which pass, and
why), or barred (by travel, Sun, keyhole).
"""

import json
import math
import time
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rf_pointing.core import DAY_S, to_degrees, utc_text
from rf_pointing.ephemeris.uncertainty import error_text
from rf_pointing.operations.pass_list import read_passes, table_of, to_calendar
from rf_pointing.operations.pass_work import tracked_in_gaps
from rf_pointing.station.pointing.multi_satellite_plan import DayPass, DayPlan, Fate

if TYPE_CHECKING:
    from rf_pointing.api.station import Station


@dataclass(frozen=True, eq=False)
class Plan:
    """Which passes of many satellites one antenna tracks; `print(plan)` shows a line for each.

    `day` has the passes with their certificates in radians.
    """

    station: "Station" = field(repr=False)
    day: DayPlan = field(repr=False)

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """Every pass in order of rise: times in UTC, angles in degrees, `fate` and `reason`."""
        return [row_values(item, self.station) for item in self.day.passes]

    @property
    def unsearched(self) -> dict[str, str]:
        """The satellites that were not searched, with the reasons."""
        return {one.name: reason for one, reason in self.day.unsearched}

    @property
    def tracked(self) -> list[dict[str, Any]]:
        """The rows of the passes that the antenna tracks."""
        return [row for row in self.rows if row["fate"] == Fate.TRACKED]

    def __str__(self) -> str:
        return table_text(self.day)

    def warning(self, stale_days: float = 2.0) -> str:
        """Return "" or the number of satellites with stale elements, and the worst error."""
        beamwidth_rad = self.station.rules.machine.half_power_beamwidth_rad
        return stale_text(self.day, stale_days * DAY_S, beamwidth_rad)

    def to_json(self) -> str:
        """Return the plan with its rows, a pass a line."""
        start_s, end_s = self.day.start_t_s, self.day.start_t_s + self.day.duration_s
        head = {
            "station": self.station.name, "start_utc": utc_text(start_s), "end_utc": utc_text(end_s),
            "unsearched": [{"name": one.name, "reason": reason} for one, reason in self.day.unsearched],
        }  # fmt: skip
        # Indented, a day of 10 000 satellites takes ten times as long to write.
        lines = ",\n".join(json.dumps(row) for row in self.rows)
        return f'{json.dumps(head)[:-1]}, "passes": [\n{lines}\n]}}'

    def to_csv(self) -> str:
        """Return a line for every pass, with the names of the rows in the first one."""
        return table_of(self.rows)

    def to_calendar(self, now_t_s: float | None = None) -> str:
        """Return the tracked passes as a calendar (RFC 5545), made at `now_t_s` or now."""
        tracked = [item for item in self.day.passes if item.fate is Fate.TRACKED]
        passes = read_passes(json.dumps(self.tracked))
        remarks = {one.id: _remark(item) for one, item in zip(passes, tracked, strict=True)}
        return to_calendar(passes, self.station.name, time.time() if now_t_s is None else now_t_s, remarks)

    def draw(self, path: str | Path) -> None:
        """Draw the plan into a PNG."""
        # Matplotlib is loaded where a picture is wanted.
        from rf_pointing.report.day_picture import draw_day

        draw_day(self.day, self.station.name, self.station.rules.mask, Path(path))


def row_values(item: DayPass, station: "Station") -> dict[str, Any]:
    """Return one pass as names and plain values: times in UTC, angles in degrees."""
    window, band = item.window, item.band or station.band
    beamwidth_rad = station.in_band(band).rules.machine.half_power_beamwidth_rad
    values: dict[str, Any] = {"name": window.name, "catalogue_number": window.catalogue_number}
    values |= {"band": band, "priority": item.priority}
    values |= {"fate": str(item.fate), "reason": item.reason}
    values |= {f"{name}_utc": utc_text(getattr(window, f"{name}_t_s")) for name in ("aos", "tca", "los")}
    values["duration_s"] = window.duration_s
    names = ("peak_elevation_rad", "aos_azimuth_rad", "tca_azimuth_rad", "los_azimuth_rad", "tca_azimuth_rate_rad_s")
    values |= dict(to_degrees(name, getattr(window, name)) for name in names)
    # Continuous from the rise on: what a schedule needs to know of the turns between two passes.
    low, high, end = window.azimuth_path_rad[1:]
    names_of_path = {"azimuth_low_rad": low, "azimuth_high_rad": high, "azimuth_end_rad": end}
    names_of_path |= {"aos_elevation_rad": window.aos_elevation_rad, "los_elevation_rad": window.los_elevation_rad}
    values |= dict(to_degrees(name, value) for name, value in names_of_path.items())
    values |= {"tca_range_m": window.tca_range_m, "rises_before": window.rises_before, "sets_after": window.sets_after}
    values["filler"] = item.filler
    values["element_age_h"] = item.age_s / 3600.0 if window.catalogue_number is not None else None
    values |= {
        "along_track_sigma_deg": math.degrees(item.along_rad),
        "along_track_sigma_beams": item.along_rad / beamwidth_rad,
    }
    branch = item.certificate.chosen if item.certificate else None
    values |= {"branch": branch.label if branch else None, "keyhole_s": branch.keyhole_s if branch else None}
    values |= {"lost_s": branch.lost_s if branch else None, "slew_s": branch.preposition_s if branch else None}
    values["sun_angle_deg"] = math.degrees(float(item.profile.sun_angle_rad().min())) if item.profile else None
    # Below a microsecond and a microdegree no digit means anything.
    return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}


def _remark(item: DayPass) -> str:
    window, chosen = item.window, item.certificate.chosen if item.certificate else None
    branch, peak_deg = chosen.label if chosen else "", math.degrees(window.peak_elevation_rad)
    return (
        f"Catalogue number {window.label}, priority {item.priority}, branch {branch}\n"
        f"Closest approach {utc_text(window.tca_t_s)}, {peak_deg:.2f} deg"
    )


def stale_text(plan: DayPlan, stale_s: float, beamwidth_rad: float) -> str:
    """Return "" or the number of tracked satellites with stale elements, and the worst error."""
    stale = [item for item in plan.passes if item.age_s > stale_s and item.fate is Fate.TRACKED]
    if not stale:
        return ""
    worst = max(stale, key=lambda item: item.along_rad)
    names = {item.window.label for item in stale}
    return (
        f"stale elements of {len(names)} tracked satellites, older than {stale_s / DAY_S:g} days; the worst, "
        f"{worst.window.name}: {worst.age_s / DAY_S:.1f} days, {error_text(worst.along_rad, beamwidth_rad)}"
    )


def table_text(plan: DayPlan) -> str:
    """Return a line for every pass; < and > mark one cut off at an end of the searched time."""
    lines = [
        f"{'satellite':<24} {'prio':>4} {'AOS (UTC)':<24}  {'TCA':<12} {'LOS':<12}  {'s':>6} {'peak':>6} "
        f"{'azimuth deg':>17}  plan"
        if plan.passes
        else "no pass"
    ]
    for item in plan.passes:
        window, branch = item.window, item.certificate.chosen if item.certificate else None
        azimuths = " ".join(
            f"{math.degrees(getattr(window, f'{name}_azimuth_rad')):5.1f}" for name in ("aos", "tca", "los")
        )
        aos, tca, los = (utc_text(getattr(window, f"{name}_t_s")) for name in ("aos", "tca", "los"))
        fate = f"{branch.label}, {branch.lost_s:.1f} s lost" if branch else item.reason
        fate = f"{item.band} band, {fate}" if item.band else fate
        lines.append(
            f"{window.name:<24.24} {item.priority:>4} {aos}{'<' if window.rises_before else ' '} {tca[11:23]} "
            f"{los[11:23]}{'>' if window.sets_after else ' '} {window.duration_s:6.0f} "
            f"{math.degrees(window.peak_elevation_rad):6.2f} {azimuths}  {item.fate}: {fate}"
        )
    counts = {fate: sum(item.fate is fate for item in plan.passes) for fate in Fate}
    pieces: dict[str, list[float]] = {}
    for item in plan.passes:
        if item.fate is Fate.TRACKED and item.filler:
            pieces.setdefault(item.window.name, []).append(item.window.duration_s)
    lines += [f"{name} is {tracked_in_gaps(each)}" for name, each in pieces.items()]
    return "\n".join([*lines, f"{len(plan.passes)} passes: " + ", ".join(f"{n} {fate}" for fate, n in counts.items())])
