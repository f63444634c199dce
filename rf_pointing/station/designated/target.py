"""A target that reports lead to: what is reported, which one is selected, and its next minutes.

Nothing is published before two reports agree, and nothing for a target that was not selected.  A
selected one has a pass of `ahead_s` of its class, cut where it leaves the horizon; while reports
come, the pass is renewed in time, and the controller certifies or refuses what is new.  A target
whose reports jump or cease is followed to the end of its last pass, as it was predicted.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from rf_pointing.core import DESIGNATED, SkyUncertainty, Target, require_choice
from rf_pointing.designate import (
    CLASSES,
    DECODERS,
    DesignatedPath,
    MotionFilter,
    Report,
    read_table,
)
from rf_pointing.designate.decoders import Decoder
from rf_pointing.designate.table import TableTarget
from rf_pointing.ephemeris import Pass, Site, TopocentricTrack, find_passes
from rf_pointing.ephemeris.uncertainty import place_uncertainty
from rf_pointing.planning import HorizonMask, PassProfile
from rf_pointing.receiver.level_sources import LineSource
from rf_pointing.receiver.params import SignalReceiverParams, SourceLinkParams
from rf_pointing.station.designated.params import DesignateParams
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.status import Level
from rf_pointing.station.pointing.status import Report as Health

TABLE, TOPICS = "table", "topics"
# A pass is renewed after this share of it, and not once reports are older than the other.
RENEWED, SILENT = 1.0 / 6.0, 0.25
# Reports with a time of their own are refused beyond these differences from the station's clock.
OLDEST_S, EARLIEST_S = 10.0, 1.0
MOST_HEARD = 500
LONGEST_SILENCE_S = 60.0


class ReportSource(LineSource):
    """Lines or datagrams of one address, decoded where they arrive."""

    def __init__(self, address: str, params: DesignateParams, now_s: Callable[[], float]) -> None:
        kind, _, place = address.partition(":")
        place, _, self._only = place.partition("/")
        require_choice("designate.source", kind, (*DECODERS, TABLE))
        self._decoder: Decoder = DECODERS[kind](params.noise)
        host, _, port = place.rpartition(":")
        if not host or not port.isdecimal():
            raise ValueError(
                f"designate.source={address!r} must be {kind}:HOST:PORT, or {kind}:HOST:PORT/NAME"
            )
        link = SourceLinkParams(host=host, port=int(port), silence_s=LONGEST_SILENCE_S)
        super().__init__(SignalReceiverParams(type=kind, link=link), now_s)
        self._latency_s = params.latency_s

    @property
    def transport(self) -> str:  # type: ignore[override]
        return self._decoder.transport

    def read(self) -> Sequence[Report]:
        # A line is text, a datagram may hold any byte.
        data = self.receive() if self.transport == "udp" else (self.line() or "").encode("latin-1")
        try:
            found = self._decoder.take(data, self.now_s() - self._latency_s) if data else []
            return [each for each in found if self._only in ("", each.name)]
        except ValueError as error:
            self.refuse(str(error))
            return ()


class DesignatedTarget:
    """Every target that is reported, and the one that is selected.

    `show(passes, profiles)` gets each pass of the selected target.
    """

    def __init__(
        self, params: DesignateParams, site: Site, mask: HorizonMask,
        show: Callable[[list[Pass], list[PassProfile]], None], now_s: Callable[[], float],
    ) -> None:  # fmt: skip
        self.params, self.site, self._show = params, site, show
        self._horizon, self._kind = mask.above(params.mask_rad), CLASSES[params.kind]
        self._filters: dict[str, MotionFilter] = {}
        self._path: DesignatedPath | TableTarget | None = None
        self._track: TopocentricTrack | None = None
        self._selected, self._wanted, self._why = "", params.target, ""
        self._until_s = self._renew_s = self._published_s = -math.inf
        self.refused: Counter[str] = Counter()
        self._table: TableTarget | None = None
        self.sources: list[ReportSource] = []
        kind, _, file = params.source.partition(":")
        if kind == TABLE:
            self._table = read_table(Path(file), site, params.noise)
        else:
            self.sources = [ReportSource(each, params, now_s) for each in params.source.split()]

    @property
    def first_s(self) -> float | None:
        """Time of the first row of a table, None for reports that come."""
        return None if self._table is None else self._table.spans_t_s[0][0]

    def end(self) -> None:
        """Release the sources."""
        for source in self.sources:
            source.end()

    def take_stamped(self, report: Report, now_s: float) -> None:
        """Use a report that has a time of its own; ValueError for one far from the clock."""
        age_s = now_s - report.t_s
        if not -EARLIEST_S <= age_s <= OLDEST_S:
            raise ValueError(
                f"a report is {age_s:.1f} s old by the station's clock, must be {-EARLIEST_S:g} to {OLDEST_S:g} s"
            )
        self.take(report)

    def take(self, report: Report) -> None:
        """Use a report, or count why it is refused."""
        name = "" if self.params.fused else report.name
        if name not in self._filters:
            if len(self._filters) >= MOST_HEARD:
                self._forget(report.t_s)
            self._filters[name] = MotionFilter(
                self._kind, self.params.noise.velocity_m_s, self.params.noise.time_s
            )
        if why := self._filters[name].take(report):
            self.refused[why] += 1

    def _forget(self, now_s: float) -> None:
        """Forget who has been silent; at worst everybody, but never the selected target."""

        def recent(each: MotionFilter) -> bool:
            return each.state is not None and now_s - each.state.t_s < LONGEST_SILENCE_S

        kept = {name: each for name, each in self._filters.items() if recent(each)}
        kept = {} if len(kept) >= MOST_HEARD else kept
        self._filters = kept | {
            name: self._filters[name] for name in (self._selected,) if name in self._filters
        }

    @property
    def known(self) -> list[str]:
        """Names of the targets of which two reports agree."""
        return sorted(name for name, each in self._filters.items() if each.state is not None)

    def step(self, now_s: float) -> None:
        """Take what has arrived, follow corrections, and renew the pass of the selected target."""
        for source in self.sources:
            for report in source.step():
                self.take(report)
        if self._wanted and (
            self._table or self._wanted in self.known or (self.params.fused and self.known)
        ):
            self.select(f"{DESIGNATED} {self._wanted}", now_s)
        found = self._filters.get(self._selected)
        if not isinstance(self._path, DesignatedPath) or found is None:
            return
        if found.state is None:
            # Whatever comes next under this name must be selected again.
            self._why, self._selected = found.lost, "\n"
            return
        if found.state is not self._path.state:
            self._path.renew(max(now_s, self._published_s), found.state)
        if now_s >= self._renew_s and now_s - found.state.t_s <= SILENT * self._kind.ahead_s:
            self._show_passes(now_s)

    def select(self, words: str, now_s: float) -> list[Pass]:
        """Make a target the one that is followed, and return its pass; ValueError if it cannot be.

        `words` are `designated NAME`; without a name the only one that is known.
        """
        # Fused reports have one name, whatever their sources call it.
        first, _, name = words.strip().partition(" ")
        if first != DESIGNATED:
            raise ValueError(f"target={words!r} must begin with {DESIGNATED}")
        if self._table is not None:
            self._follow("", f"{DESIGNATED} {name or self._table.name}", self._table)
        else:
            only = self.known[0] if len(self.known) == 1 else ""
            name = "" if self.params.fused else name or only
            found = self._filters.get(name)
            if found is None or found.state is None:
                known = ", ".join(self.known[:20]) or "nothing"
                again = f"{found.lost}; two new reports must agree" if found else ""
                why = again or "two reports must agree first"
                raise ValueError(f"{words.strip()!r} is not known: {why}; known: {known}")
            label = f"{DESIGNATED} {name or self.params.target or self.params.kind}"
            self._follow(name, label, DesignatedPath(label, found.state))
        passes = self._show_passes(now_s)
        if not passes:
            self._track = None
            low = "is below the horizon of the station, and stays there"
            raise ValueError(f"{words.strip()!r} {low}")
        # Chosen once: a name that is lost and comes back must not move the antenna by itself.
        self._wanted = ""
        return passes

    def _follow(self, key: str, label: str, path: DesignatedPath | TableTarget) -> None:
        path.name = label
        self._selected, self._path, self._why = key, path, ""
        self._track = TopocentricTrack(path, self.site)

    def _show_passes(self, now_s: float) -> list[Pass]:
        """Find and show the passes of the selected target; return them."""
        track, ahead_s = self._track, self._kind.ahead_s
        assert track is not None
        self._renew_s = now_s + RENEWED * ahead_s
        start_s, end_s = (now_s, now_s + ahead_s) if self._table is None else track.spans_t_s[0]
        every = find_passes(track, start_s, end_s - start_s, self._horizon)
        passes = [each for each in every if each.los_t_s > now_s]
        if passes:
            before_s = self._until_s if self._table is None else -math.inf
            self._until_s = max(before_s, passes[-1].los_t_s)
            self._show(passes, [pass_profile(track, window) for window in passes])
        return passes

    def release(self) -> None:
        """Follow nothing: another target was selected."""
        self._selected, self._path, self._track, self._why = "", None, None, ""
        self._until_s = -math.inf

    @property
    def name(self) -> str:
        """Name of the target that is followed, "" without one."""
        return self._track.name if self._track else ""

    def target_at(self, now_s: float) -> tuple[Target, SkyUncertainty] | None:
        """Return what is published at `now_s`, None for no target and beyond its pass."""
        t_s = round(now_s + self.params.lead_s, 6)
        if (
            self._track is None
            or self._path is None
            or t_s > self._until_s
            or not self._track.covers(t_s)
        ):
            return None
        # The path up to here has been sent out, and stays as it is.
        self._published_s = t_s
        age_s = t_s - self._path.state.t_s if isinstance(self._path, DesignatedPath) else 0.0
        uncertainty = place_uncertainty(self._track, t_s, self._path.covariance_m2(t_s), age_s)
        return self._track.target_at(t_s), uncertainty

    def health(self, now_s: float) -> Health:
        """Return whether sources and target are well, and the numbers behind it."""
        problems = [source.problem for source in self.sources if source.problem]
        if self._why:
            problems.insert(0, f"{self.name or DESIGNATED}: {self._why}; select it again")
        values: dict[str, object] = {"known": ", ".join(self.known[:20])}
        values |= {f"refused: {why}": count for why, count in self.refused.items()}
        found = self._filters.get(self._selected)
        if found is not None and found.state is not None and self._track is not None:
            values["report_age_s"] = round(now_s - found.state.t_s, 2)
        words = "; ".join(problems) or self.name or "no target is selected"
        return Health(Level.WARN if problems else Level.OK, words, values)
