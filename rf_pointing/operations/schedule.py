"""The schedule of one antenna: which pass is next, when it must begin, and what happens in between.

The passes are those of `plan_passes`, or of any table with target, AOS and LOS.  `replan` chooses
by `planning.schedule`: priorities are strict, within one the plan is the best.  It is called again
after every change: an added pass, a failed one, an antenna that is late or elsewhere.

A pass that is late is joined while enough of it is left.  A pass of a higher priority ends one of a
lower priority in time to turn to it.  Two antennas share one list by claims: what one of them has
planned, the other does not plan.  With `between.standby` it follows the other's passes while it has
none of its own: it is on the target when it must take over.
"""

import dataclasses
import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from rf_pointing.core import LEVEL, Kinematics, Pair, Params, id_of, parameter, require_id, require_name
from rf_pointing.planning import AxisLimits, AxisRates, Candidate, reasons_against, turns_within
from rf_pointing.planning.schedule import schedule

Path = tuple[float, float, float, float]
MOST_PASSES = 20_000
STANDBY_RANK = 2**33
"""By which a pass of a partner ranks below every one of its own."""
SCAN_SHARE = 0.9
"""Share of its time that a scan needs, to be begun late."""
LAST_S = 2.0**31
"""End of the stamps of ROS, UTC in s."""


class PassState(StrEnum):
    """State of a pass in the schedule."""

    WAITING = "waiting"
    ACTIVE = "active"
    STANDBY = "standby"
    TRACKED = "tracked"
    LOST = "lost"
    YIELDS = "yields"
    SKIPPED = "skipped"
    MISSED = "missed"
    WEATHER = "weather"


OPEN = (PassState.WAITING, PassState.YIELDS)
"""States of passes that may still be tracked."""
IN_WORK = (PassState.ACTIVE, PassState.STANDBY)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduledPass:
    """One pass of the list; `azimuth_path_rad` is rise, smallest, largest and set, continuous.

    Without a path the turns between passes are taken to be the longest that the antenna has.  An
    empty `id` is made of target and time.
    """

    target: str
    aos_t_s: float
    los_t_s: float
    id: str = ""
    name: str = ""
    priority: int = 0
    peak_rad: float = 0.0
    azimuth_path_rad: Path | None = None
    elevation_rad: Pair = (0.0, 0.0)
    antenna: str = ""
    sensor: str = ""
    band: str = ""
    element_age_s: float = math.nan
    scan: str = ""
    """Pattern by which the target is scanned; empty: it is tracked."""
    filler: bool = False
    """Whether it is a piece of a longer stay, in a gap between passes."""

    def __post_init__(self) -> None:
        if not self.id:
            object.__setattr__(self, "id", f"{id_of(self.target)}-{round(0.5 * (self.aos_t_s + self.los_t_s))}")
        # The name of its recording's folder.
        require_id("id", self.id)
        for key in ("target", "name", "antenna", "sensor", "band", "scan"):
            require_name(key, getattr(self, key))
        if not self.target:
            raise ValueError(f"target='' of pass {self.id!r} must name a satellite")
        if not self.aos_t_s < self.los_t_s:
            raise ValueError(f"aos={self.aos_t_s} of pass {self.id!r} must be < los={self.los_t_s}")
        if not 0.0 <= self.aos_t_s < self.los_t_s < LAST_S:
            raise ValueError(f"aos={self.aos_t_s} and los={self.los_t_s} of pass {self.id!r} must be from 1970 to 2038")

    @property
    def duration_s(self) -> float:
        """Time from rise to set."""
        return self.los_t_s - self.aos_t_s


def require_each_once(passes: Sequence[ScheduledPass]) -> None:
    """Raise ValueError, naming the first three, for passes that are in a list twice."""
    if twice := sorted(each for each, count in Counter(item.id for item in passes).items() if count > 1):
        raise ValueError(f"pass {', '.join(twice[:3])} is in the list twice")


@dataclass(slots=True)
class Entry:
    """A pass with its state; `turn` is where the axes begin and end it, by the present plan."""

    item: ScheduledPass
    state: PassState = PassState.WAITING
    reason: str = ""
    tracked_s: float = 0.0
    lost_s: float = 0.0
    loss_db: float = 0.0
    planned: bool = False
    turn: tuple[Pair, Pair] | None = None


@dataclass(frozen=True, kw_only=True)
class BetweenParams(Params):
    """Rest of the antenna between two passes, and how late a pass is still begun."""

    lead_s: float = parameter(60.0, "a pass is prepared this long before its slew must begin", 0.0, 3600.0)
    gap_s: float = parameter(5.0, "between the end of a pass and the slew to the next one", 0.0, 3600.0)
    park_after_s: float = parameter(1200.0, "the antenna parks when the next pass is further away", 0.0, 1e6)
    stow_after_s: float = parameter(14400.0, "it is stowed when the next pass is further away", 0.0, 1e6)
    least_s: float = parameter(60.0, "a late pass is joined if so much of it is left", 1.0, 3600.0)
    standby: bool = parameter(False, "an idle antenna follows the passes of its partners, to take them over")
    unwind_rad: float = parameter(
        math.radians(180.0), "an azimuth this far from the next start is unwound at once", 0.1, 20.0
    )


class Schedule:
    """The passes of one antenna with their states; times in UTC s."""

    def __init__(
        self, limits: AxisLimits, axes: AxisRates, params: BetweenParams | None = None, antenna: str = "",
        mount: Kinematics = LEVEL,
    ) -> None:  # fmt: skip
        self.limits, self.axes, self.params, self.antenna = limits, axes, params or BetweenParams(), antenna
        self._mount = mount
        self.entries: dict[str, Entry] = {}
        self.taken: Collection[str] = ()
        """Ids of passes that another antenna tracks."""

    def change(self, added: Iterable[ScheduledPass], removed: Iterable[str] = ()) -> None:
        """Take passes out and in, all or none; one with the id of another replaces it.

        ValueError names those to remove that are unknown or active, and those to replace that have
        begun.
        """
        entries = dict(self.entries)
        for each in removed:
            if self.entry(each).state in IN_WORK:
                raise ValueError(f"pass {each} is being tracked: skip it first")
            entries.pop(each, None)
        for item in added:
            present = entries.get(item.id)
            if present is None or present.state in OPEN:
                entries[item.id] = Entry(item)
            elif present.item != item:
                raise ValueError(f"pass {item.id} cannot be replaced: its state is {present.state}")
        if len(entries) > MOST_PASSES:
            raise ValueError(f"a schedule of {len(entries)} passes must have <= {MOST_PASSES}")
        self.entries = entries

    def name_target(self, item: ScheduledPass, name: str) -> None:
        """Give every pass of the target of `item` its name, where a list had its number alone."""
        for each in self.entries.values():
            if each.item.target == item.target and each.item.name in ("", item.target):
                each.item = dataclasses.replace(each.item, name=name)

    def gap_text(self, item: ScheduledPass) -> str:
        """Return which of its gaps a filler is in, "" for any other pass."""
        items = [each.item for each in self.in_order]
        gaps = [each.id for each in items if each.filler and each.target == item.target]
        return f"gap {gaps.index(item.id) + 1} of {len(gaps)}" if item.filler else ""

    def entry(self, name: str) -> Entry:
        """Return the entry of an id; ValueError for an unknown one."""
        if name not in self.entries:
            raise ValueError(f"pass {name!r} is not in the schedule of {len(self.entries)} passes")
        return self.entries[name]

    @property
    def in_order(self) -> list[Entry]:
        """All entries in order of rise."""
        return sorted(self.entries.values(), key=lambda each: (each.item.aos_t_s, each.item.id))

    @property
    def active(self) -> Entry | None:
        """The pass in work."""
        return next((each for each in self.entries.values() if each.state in IN_WORK), None)

    def rank(self, entry: Entry) -> int:
        """Return the priority of a pass: all that another antenna tracks is below its own."""
        theirs = entry.state == PassState.STANDBY or entry.item.id in self.taken
        return entry.item.priority - STANDBY_RANK * theirs

    def expire(self, now_s: float) -> list[Entry]:
        """Note as missed what is over, or nearly over, and has not begun; return what is new."""
        over = []
        for each in self.entries.values():
            if each.state == PassState.WAITING and now_s > each.item.los_t_s - self._least_s(each.item):
                each.state, each.planned = PassState.MISSED, False
                each.reason = each.reason or "the antenna was not ready before the end of the pass"
                over.append(each)
        return over

    def replan(self, now_s: float, place: Pair, taken: Collection[str] = ()) -> None:
        """Choose the passes to track from now on for an antenna at `place`.

        `taken`: ids that another antenna tracks.
        """
        self.taken = taken
        self.expire(now_s)
        active, start = self.active, (now_s, place)
        open_ = [each for each in self.in_order if each.state in OPEN and each.item.los_t_s > now_s]
        for each in open_:
            each.planned, each.turn = False, None
        mine = [
            each for each in open_
            if each.item.antenna in ("", self.antenna) and (self.params.standby or each.item.id not in taken)
        ]  # fmt: skip
        if active is not None:
            # What has a higher priority does not wait for the present pass.
            above = [each for each in mine if self.rank(each) > self.rank(active)]
            self._choose(above, start)
            start = self._free(active, place, now_s)
        rest = [each for each in mine if not each.planned]
        fixed = [each for each in mine if each.planned]
        self._choose([*fixed, *rest], start)
        for each in open_:
            own = each.planned and each.item.id not in taken
            each.state = PassState.WAITING if own else PassState.YIELDS
            if each.item.id in taken:
                each.reason = "another antenna tracks it"
            elif each.item.antenna not in ("", self.antenna):
                each.reason = f"it is for the antenna {each.item.antenna}"

    def _choose(self, entries: list[Entry], start: tuple[float, Pair]) -> None:
        """Mark the passes of the best plan from `start` on, and give the others their reasons."""
        now_s, place = start
        candidates = [self._candidate(each, now_s, place) for each in entries]
        begin = (now_s, place)
        chosen = schedule(candidates, self.axes, begin, self.params.gap_s)
        reasons = reasons_against(candidates, chosen, self.axes, begin, self.params.gap_s)
        turns = dict(chosen)
        for k, each in enumerate(entries):
            each.planned = k in turns
            each.turn = candidates[k].turns[turns[k]] if k in turns else None
            each.reason = "" if k in turns else reasons.get(k, "too little of it is left, or no turn of the axes fits")

    def _candidate(self, entry: Entry, now_s: float, place: Pair) -> Candidate:
        item = entry.item
        turns = self._turns(item)
        aos_t_s = item.aos_t_s
        if turns:
            # A pass that has risen is joined where the antenna can be there.
            soonest_s = now_s + min(self.axes.slew_s(place, turn[0]) for turn in turns) + 1e-3
            if item.aos_t_s < soonest_s:
                aos_t_s = soonest_s
            if item.los_t_s - aos_t_s < self._least_s(item):
                turns, aos_t_s = (), item.aos_t_s
        return Candidate(
            name=item.name or item.target, aos_t_s=aos_t_s, los_t_s=item.los_t_s, peak_rad=item.peak_rad,
            priority=self.rank(entry), turns=turns,
        )  # fmt: skip

    def _turns(self, item: ScheduledPass) -> tuple[tuple[Pair, Pair], ...]:
        if item.azimuth_path_rad is not None:
            return turns_within(self.limits, item.azimuth_path_rad, item.elevation_rad, self._mount)
        low, high = self.limits.azimuth_min_rad, self.limits.azimuth_max_rad
        # Unknown: from one end of the travel to the other, which no turn takes longer than.
        return (((low, self.limits.elevation_min_rad), (high, self.limits.elevation_min_rad)),)

    def _least_s(self, item: ScheduledPass) -> float:
        if item.scan:
            return SCAN_SHARE * item.duration_s
        return min(self.params.least_s, 0.5 * item.duration_s)

    def _free(self, active: Entry, place: Pair, now_s: float) -> tuple[float, Pair]:
        """Return when and where the present pass leaves the antenna."""
        end_s = self.ends_s(active, now_s)
        return end_s, active.turn[1] if active.turn and end_s == active.item.los_t_s else place

    def ends_s(self, active: Entry, now_s: float) -> float:
        """Return when the active pass ends: at its set, or in time for one of a higher priority."""
        above = [
            each for each in self.entries.values()
            if each.planned and each.state in OPEN and self.rank(each) > self.rank(active)
        ]  # fmt: skip
        end_s = active.item.los_t_s
        for each in above:
            turn = each.turn or self._turns(each.item)[0]
            ends = active.turn or (turn[0], turn[0])
            # Somewhere between its two ends: the longer way counts.
            slew_s = max(self.axes.slew_s(end, turn[0]) for end in ends)
            end_s = min(end_s, max(now_s, each.item.aos_t_s - slew_s - self.params.gap_s))
        return end_s

    def next(self) -> Entry | None:
        """Return the first planned pass."""
        return next((each for each in self.in_order if each.planned and each.state in OPEN), None)

    def begins_s(self, entry: Entry, place: Pair) -> float:
        """Return when the preparation of a planned pass must begin for an antenna at `place`."""
        turn = entry.turn or self._turns(entry.item)[0]
        return entry.item.aos_t_s - self.axes.slew_s(place, turn[0]) - self.params.lead_s

    def between(self, now_s: float, place: Pair) -> tuple[str, Pair | None]:
        """Return hold, park, stow or unwind for an antenna that waits at `place`.

        With unwind comes the position to go to: the start of the next pass, on its turn.
        """
        following = self.next()
        wait_s = math.inf if following is None else self.begins_s(following, place) - now_s
        if wait_s > self.params.stow_after_s:
            return "stow", None
        if wait_s > self.params.park_after_s:
            return "park", None
        if following is not None and following.turn is not None:
            start = following.turn[0]
            if abs(start[0] - place[0]) > self.params.unwind_rad and wait_s > 0.0:
                return "unwind", start
        return "hold", None

    def end(self, entry: Entry, state: PassState, reason: str) -> None:
        """Close a pass."""
        entry.state, entry.reason, entry.planned = state, reason, False

    # State

    def state(self) -> list[dict[str, Any]]:
        """Return all entries as plain values; `restore` takes them back."""
        return [
            {
                "pass": dataclasses.asdict(each.item) | {"element_age_s": _plain(each.item.element_age_s)},
                "state": str(each.state), "reason": each.reason, "planned": each.planned, "turn": each.turn,
                "outcome": [each.tracked_s, each.lost_s, each.loss_db],
            }
            for each in self.entries.values()
        ]  # fmt: skip

    def restore(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Take back what `state` has returned."""
        self.entries.clear()
        for row in rows:
            values = dict(row["pass"])
            values["element_age_s"] = math.nan if values["element_age_s"] is None else values["element_age_s"]
            for key in ("azimuth_path_rad", "elevation_rad"):
                values[key] = None if values[key] is None else tuple(values[key])
            item = ScheduledPass(**values)
            turn = row["turn"] and tuple(tuple(map(float, end)) for end in row["turn"])
            tracked_s, lost_s, loss_db = row["outcome"]
            self.entries[item.id] = Entry(
                item, PassState(row["state"]), row["reason"], tracked_s, lost_s, loss_db, bool(row["planned"]), turn
            )


def _plain(value: float) -> float | None:
    return None if math.isnan(value) else value
