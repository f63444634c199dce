"""The plan of a network of stations: who tracks what, when and in which band; what changed since.

Rows, text, JSON, CSV, calendar and pictures; the plan of each station is a `Plan` of its own.
"""

import hashlib
import itertools
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.api.keywords import angle_rad, span_s, time_s
from rf_pointing.api.plan import Plan, row_values
from rf_pointing.api.station import Station, begin_of_plan
from rf_pointing.api.target import MAX_AGE_S, Target
from rf_pointing.core import DAY_S, id_of, one_of, parse_json, parse_utc, read_whole, utc_text
from rf_pointing.ephemeris import CataloguePass
from rf_pointing.operations.pass_list import read_passes, table_of, to_calendar
from rf_pointing.operations.schedule import BetweenParams
from rf_pointing.planning.availability import availability
from rf_pointing.station.pointing.multi_satellite_plan import DayPass, Fate, Wish
from rf_pointing.station.pointing.network_plan import plan_days

# A contact that begins so soon after another one of its target takes it over.
SAME_S = 1.0
# A contact whose begin or end has moved less is the same as before.
MOVED_S = 5.0
SKY_STEP_S = 60.0


@dataclass(frozen=True, kw_only=True)
class TargetContact:
    """Contact with one target over a plan; shares are of its time.

    `seen_share` is the time in which a station sees it, `clear_share` the same with a clear sky at
    one of them at least; `owed_s` the contact that its list requires.
    """

    name: str
    contacts: int
    contact_s: float
    owed_s: float
    longest_gap_s: float
    seen_share: float
    clear_share: float


@dataclass(frozen=True, eq=False)
class NetworkPlan:
    """Which station of a network tracks which target when; `print(plan)` shows it.

    `plans` has the plan of each station by name, `better_by` the largest share by which the sum of
    worth could be better, `visible` the passes over each station in its time.
    """

    plans: dict[str, Plan] = field(repr=False)
    better_by: float
    targets: Sequence[Target] = field(repr=False)
    wishes: Sequence[Wish] = field(repr=False)
    visible: Sequence[Sequence[CataloguePass]] = field(repr=False)
    cloudy: Mapping[str, float] = field(repr=False)

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The contacts in order of time, with station and band.

        `from_station` is the one that hands the target over, `leave_utc` when the axes must be on
        their way to be on source in time, `since_contact_s` the time without contact before.
        """
        found, last = [], dict[int, tuple[float, str]]()
        for item, station, leave_s in sorted(self._contacts(), key=lambda each: each[0].window.aos_t_s):
            window, key = item.window, id(item.window.target)
            end_s, other = last.get(key, (-math.inf, ""))
            last[key] = window.los_t_s, station.name
            apart_s = window.aos_t_s - end_s
            found.append({
                "station": station.name, "antenna": station.name,
                "from_station": other if apart_s < SAME_S and other != station.name else "",
                "leave_utc": utc_text(leave_s),
                "since_contact_s": round(max(0.0, apart_s), 3) if math.isfinite(apart_s) else None,
                **row_values(item, station),
            })  # fmt: skip
        return found

    def _contacts(self) -> Iterator[tuple[DayPass, Station, float]]:
        """Give what each station tracks, and when its axes must leave for it."""
        for plan in self.plans.values():
            station, free_s = plan.station, plan.day.start_t_s
            for item in plan.day.passes:
                chosen = item.certificate.chosen if item.certificate else None
                if item.fate is not Fate.TRACKED or chosen is None:
                    continue
                slew_s = chosen.preposition_s
                # In a long pause the executive parks the antenna: it leaves from there.
                if item.window.aos_t_s - free_s > BetweenParams().park_after_s:
                    slew_s = station.rules.machine.slew_s(station.start_rad, chosen.start_rad)
                # A slew that takes longer than the time between is late at the pass.
                yield item, station, max(free_s, item.window.aos_t_s - slew_s)
                free_s = item.window.los_t_s

    @cached_property
    def contacts(self) -> list[TargetContact]:
        """Contact with each target, in the order of the targets."""
        (begin_s, length_s), names = self._span, list(self.plans)
        places = np.array([self.plans[name].station.site.position_m for name in names])
        distance_m = np.linalg.norm(places[:, None] - places, axis=-1)
        t_s = np.arange(begin_s + 0.5 * SKY_STEP_S, begin_s + length_s, SKY_STEP_S)
        found = []
        for wish in self.wishes:
            seen = np.zeros((len(t_s), len(names)), dtype=np.bool_)
            for k, windows in enumerate(self.visible):
                for one in (each for each in windows if each.target is wish.target):
                    seen[:, k] |= (t_s >= one.aos_t_s) & (t_s <= one.los_t_s)
            shares = availability(seen, [self.cloudy.get(name, 0.0) for name in names], distance_m)
            mine = sorted(
                (item.window.aos_t_s, item.window.los_t_s)
                for item, _, _ in self._contacts() if item.window.target is wish.target
            )  # fmt: skip
            edges = [begin_s, *itertools.chain.from_iterable(mine), begin_s + length_s]
            gaps = [end - start for start, end in zip(edges[::2], edges[1::2], strict=True)]
            found.append(
                TargetContact(
                    name=wish.target.name, contacts=len(mine), contact_s=sum(end - begin for begin, end in mine),
                    owed_s=wish.contact_s * length_s / DAY_S, longest_gap_s=max(gaps),
                    seen_share=shares[0], clear_share=shares[1],
                )
            )  # fmt: skip
        return found

    @property
    def _span(self) -> tuple[float, float]:
        day = next(iter(self.plans.values())).day
        return day.start_t_s, day.duration_s

    def changes(self, earlier: str | Path) -> list[str]:
        """Return what differs from an earlier plan, a JSON file of `to_json`, while both last.

        Raises
        ------
        ValueError
            The file holds no plan of a network, one that ends before this one begins, or one in
            which two stations track one target at the same time.
        """
        head, before = _earlier(Path(earlier))
        begin_s, length_s = self._span
        begin_s, end_s = max(begin_s, before[0]), min(begin_s + length_s, before[1])
        if begin_s >= end_s:
            raise ValueError(
                f"{earlier}: its plan, {head['start_utc']} to {head['end_utc']}, does not last when this one does, "
                f"from {utc_text(self._span[0])} on"
            )
        now, then = (_spans(rows, begin_s, end_s) for rows in (self.rows, head["passes"]))
        stations = {one["name"]: one["description"] for one in head["network"]}
        found = [f"station {name} is new" for name in self.plans if name not in stations]
        found += [f"station {name} has left" for name in stations if name not in self.plans]
        found += [
            f"station {name} has another version of its description"
            for name, plan in self.plans.items() if stations.get(name, _digest(plan.station)) != _digest(plan.station)
        ]  # fmt: skip
        for row in now:
            met = [one for one in then if one.target == row.target and one.meets(row)]
            same = [one for one in met if one.station == row.station]
            if not met:
                found.append(f"new: {row}")
            elif not same:
                found.append(f"moved from {' and '.join(sorted({one.station for one in met}))}: {row}")
            elif max(abs(same[0].aos_s - row.aos_s), abs(same[0].los_s - row.los_s)) > MOVED_S:
                found.append(f"other times, were {same[0].clock}: {row}")
        dropped = [one for one in then if not any(one.target == row.target and one.meets(row) for row in now)]
        return found + [f"dropped: {one}" for one in dropped]

    def to_json(self, changes: Sequence[str] = ()) -> str:
        """Return the plan with its contacts, one a line; `changes` are kept with it."""
        (begin_s, length_s), stations = self._span, [plan.station for plan in self.plans.values()]
        head = {
            "network": [
                {"name": one.name, "latitude_deg": round(math.degrees(one.site.latitude_rad), 7),
                 "longitude_deg": round(math.degrees(one.site.longitude_rad), 7), "altitude_m": one.site.altitude_m,
                 "cloudy": self.cloudy.get(one.name, 0.0), "description": _digest(one)}
                for one in stations
            ],
            "start_utc": utc_text(begin_s), "end_utc": utc_text(begin_s + length_s),
            "better_by": self.better_by if math.isfinite(self.better_by) else None,
            "targets": [asdict(one) for one in self.contacts], "changes": list(changes),
        }  # fmt: skip
        lines = ",\n".join(json.dumps(row) for row in self.rows)
        return f'{json.dumps(head)[:-1]}, "passes": [\n{lines}\n]}}'

    def to_csv(self) -> str:
        """Return a line for every contact, with the names of the rows in the first one."""
        return table_of(self.rows)

    def to_calendar(self, now_t_s: float | None = None) -> str:
        """Return the contacts as a calendar (RFC 5545), each at its station."""
        passes = read_passes(json.dumps(self.rows))
        remarks = {
            one.id: f"{row['station']}, band {row['band']}, priority {row['priority']}\nOn the way at {row['leave_utc']}"
            for one, row in zip(passes, self.rows, strict=True)
        }
        return to_calendar(passes, " and ".join(self.plans), time.time() if now_t_s is None else now_t_s, remarks)

    def draw(self, path: str | Path) -> list[Path]:
        """Draw the network into a PNG, and a picture of each station; return the files."""
        # Matplotlib is loaded where a picture is wanted.
        from rf_pointing.report.day_picture import draw_network

        path = Path(path)
        draw_network({name: plan.day for name, plan in self.plans.items()}, path)
        files = [path]
        for name, plan in self.plans.items():
            files.append(path.with_name(f"{path.stem}_{id_of(name)}{path.suffix}"))
            plan.draw(files[-1])
        return files

    def __str__(self) -> str:
        lines = [
            f"{'station':<16} {'band':<5} {'satellite':<24} {'prio':>4} {'on the way':<8} {'AOS (UTC)':<19} "
            f"{'LOS':<8} {'s':>6} {'peak':>5}  from"
            if self.rows else "no contact"
        ]  # fmt: skip
        lines += [
            f"{row['station']:<16.16} {row['band']:<5.5} {row['name']:<24.24} {row['priority']:>4} "
            f"{row['leave_utc'][11:19]:<10} {row['aos_utc'][:19]} {row['los_utc'][11:19]} {row['duration_s']:6.0f} "
            f"{row['peak_elevation_deg']:5.1f}  {row['from_station']}".rstrip()
            for row in self.rows
        ]
        lines += [
            f"{one.name}: {one.contacts} contacts, {one.contact_s / 60.0:.1f} min{_short(one)}; longest gap "
            f"{one.longest_gap_s / 3600.0:.2f} h; seen {one.seen_share:.1%}, with a clear sky {one.clear_share:.1%}"
            for one in self.contacts
        ]
        lines += [
            f"{name}: {sum(row['station'] == name for row in self.rows)} of {len(plan.day.passes)} passes tracked"
            for name, plan in self.plans.items()
        ]
        bound = "the solver had no time for a bound"
        if math.isfinite(self.better_by):
            bound = f"no other choice is better by more than {self.better_by:.2%}"
        return "\n".join([*lines, bound])


def plan_network(
    stations: Sequence[Station],
    targets: Sequence[Target],
    *,
    start: str | None = None,
    start_t_s: float | None = None,
    hours: float | None = None,
    days: float | None = None,
    mask_deg: float | None = None,
    mask_rad: float | None = None,
    gap_s: float = 0.0,
    cloudy: Mapping[str, float] | None = None,
    maintenance: Mapping[str, Sequence[tuple[str, str]]] | None = None,
) -> NetworkPlan:
    """Return which of these stations tracks which target when; a target has one owner at a time.

    Parameters
    ----------
    stations : each with a name of its own, in the band of its contacts unless a target names one.
    targets : as for `Station.plan`; `band` and `contact_minutes` count here as well.
    start, start_t_s, hours, days, gap_s : as for `Station.plan`; up to 31 days for satellites.
    mask_deg, mask_rad : elevation at which contacts begin and end; by default each station's.
    cloudy : probability of clouds by station, where they end a contact: passes count the less.
    maintenance : times of each station, begin and end as UTC text, in which it tracks nothing.

    Raises
    ------
    ValueError
        Two stations of one name, a band that none has, or what `Station.plan` refuses.

    Examples
    --------
    >>> stations = [rp.Station("dss13"), rp.Station("leo_3m7")]
    >>> print(rp.plan_network(stations, [rp.elements("CBERS 2")], hours=6))  # doctest: +SKIP
    """
    _require_apart(stations)
    wishes, cloudy = [target.wish() for target in targets], dict(cloudy or {})
    closed = _closed(stations, maintenance or {})
    for name, share in cloudy.items():
        if not 0.0 <= share < 1.0:
            raise ValueError(f"cloudy={share} of {name} must be from 0 to below 1")
    _require_known("cloudy", stations, cloudy)
    for wish in wishes:
        if wish.band and not any(wish.band in one.bands for one in stations):
            raise ValueError(f"band={wish.band!r} of {wish.target.name}: no station has it")
    length_s = span_s(hours, days)
    begin_s = begin_of_plan(wishes, time_s("start", start, start_t_s), length_s)
    bands = {wish.band for wish in wishes if wish.band}
    antennas = [
        one.antenna(
            angle_rad("mask", mask_deg, mask_rad, one.lowest_rad), closed=closed.get(one.name, ()),
            of_band={band: one.in_band(band).rules for band in bands & set(one.bands)},
        )
        for one in stations
    ]  # fmt: skip
    found = plan_days(
        wishes, antennas, begin_s, length_s, names=[one.name for one in stations], gap_s=gap_s, max_age_s=MAX_AGE_S,
        clear=[1.0 - cloudy.get(one.name, 0.0) for one in stations],
    )  # fmt: skip
    plans = {one.name: Plan(one, day) for one, day in zip(stations, found.days, strict=True)}
    return NetworkPlan(plans, found.better_by, list(targets), wishes, found.visible, cloudy)


def _short(one: TargetContact) -> str:
    """Return the words about contact that is owed."""
    if not one.owed_s:
        return ""
    owed = f" of {one.owed_s / 60.0:.1f} min owed"
    return owed if one.contact_s >= one.owed_s else f"{owed}: {(one.owed_s - one.contact_s) / 60.0:.1f} min short"


def _require_apart(stations: Sequence[Station]) -> None:
    """Raise ValueError without a station, and for two of one name."""
    if not stations:
        raise ValueError("stations: give at least one")
    for one, other in itertools.combinations(stations, 2):
        if one.name != other.name:
            continue
        if one.site != other.site:
            first, then = (
                f"{math.degrees(each.site.latitude_rad):.5f} deg north, "
                f"{math.degrees(each.site.longitude_rad):.5f} deg east"
                for each in (one, other)
            )
            raise ValueError(f"stations: two have the name {one.name}, at {first} and at {then}")
        files = " and ".join(str(each.description.path) for each in (one, other))
        what = "is named twice" if _digest(one) == _digest(other) else "has two versions of its description"
        raise ValueError(f"stations: {one.name} {what}: {files}")


def _require_known(what: str, stations: Sequence[Station], given: Mapping[str, object]) -> None:
    names = [one.name for one in stations]
    for name in given:
        if name not in names:
            raise ValueError(f"{what} of {name!r}: the station must be {one_of(name, names)}")


def _closed(
    stations: Sequence[Station], maintenance: Mapping[str, Sequence[tuple[str, str]]]
) -> dict[str, tuple[tuple[float, float], ...]]:
    """Return times of maintenance in UTC s, those that meet joined."""
    _require_known("maintenance", stations, maintenance)
    found: dict[str, tuple[tuple[float, float], ...]] = {}
    for name, spans in maintenance.items():
        joined: list[tuple[float, float]] = []
        for begin_s, end_s in sorted((parse_utc(begin), parse_utc(end)) for begin, end in spans):
            if begin_s >= end_s:
                raise ValueError(f"maintenance of {name}: {utc_text(begin_s)} must be before {utc_text(end_s)}")
            if joined and begin_s <= joined[-1][1]:
                begin_s, end_s = joined[-1][0], max(joined.pop()[1], end_s)
            joined.append((begin_s, end_s))
        found[name] = tuple(joined)
    return found


def _digest(station: Station) -> str:
    """Return what tells two versions of a description apart."""
    return hashlib.sha256(repr(station.description.content).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class _Span:
    """One contact of a plan."""

    station: str
    target: str
    aos_s: float
    los_s: float

    def meets(self, other: "_Span") -> bool:
        return self.aos_s < other.los_s - SAME_S and self.los_s > other.aos_s + SAME_S

    @property
    def clock(self) -> str:
        return f"{utc_text(self.aos_s)[:19]} to {utc_text(self.los_s)[11:19]}"

    def __str__(self) -> str:
        return f"{self.station} {self.target} {self.clock}"


def _spans(rows: Sequence[Mapping[str, Any]], begin_s: float = -math.inf, end_s: float = math.inf) -> list[_Span]:
    """Return the contacts of rows between two times."""
    found = [
        _Span(
            str(row["station"]), str(row["name"]), max(begin_s, parse_utc(str(row["aos_utc"]))),
            min(end_s, parse_utc(str(row["los_utc"]))),
        )
        for row in rows
    ]  # fmt: skip
    return [one for one in found if one.aos_s < one.los_s]


def _earlier(path: Path) -> tuple[dict[str, Any], tuple[float, float]]:
    """Return an earlier plan and its time; ValueError for what holds none, or two owners."""
    try:
        head = parse_json(read_whole(path))
        span = parse_utc(str(head["start_utc"])), parse_utc(str(head["end_utc"]))
        rows = sorted(_spans(head["passes"]), key=lambda one: (one.target, one.aos_s))
        _ = [(one["name"], one["description"]) for one in head["network"]]
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(
            f"{path}: not a plan of a network, as plan_passes --stations --json prints it: {error}"
        ) from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    for one, other in itertools.pairwise(rows):
        if one.target == other.target and one.meets(other):
            raise ValueError(f"{path}: two owners of one pass, {one} and {other}")
    return head, span
