"""Antennas that share one list of passes: who has a pass, who takes it over, and who may transmit.

An antenna takes over what a partner that falls silent has begun.  It transmits only in a pass that
no partner can have: the one that had it stops transmitting at the silence, before the other begins.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rf_pointing.operations.night import Night
from rf_pointing.operations.schedule import IN_WORK, OPEN, Entry, PassState

CONTACT_S = 2.5
"""Longest silence of a partner with which the pass in work is still transmitted in."""
UNKEYED_S = 0.5
"""Time in which the radio of a partner has followed a status that it may no longer send."""


@dataclass(frozen=True, slots=True)
class Partner:
    """States of a partner's passes by id, whether it has a `night`, and when it was received.

    Without its schedule, `states` None, it may have any pass.
    `held` is the pass that this antenna had at that time; one that has `ended` takes nothing over.
    `sends` is the pass in which it may transmit, and `free_s` since when it may in none.
    """

    states: Mapping[str, str] | None = None
    night: bool = False
    seen_s: float = -math.inf
    held: str = ""
    ended: bool = False
    sends: str = ""
    free_s: float = math.inf


class Partners:
    """The partners `names` of `antenna`, by steady time; one silent for `silent_s` is not there."""

    def __init__(self, antenna: str, names: Sequence[str], silent_s: float) -> None:
        # Both send once a second, and the inhibit goes out with that: what is left is the margin.
        self._antenna, self._silent_s = antenna, max(silent_s, 2.0 * CONTACT_S)
        self._known = {name: Partner() for name in names}

    def take(self, name: str, wall_s: float, mine: Night, **known: object) -> None:
        """Note fields of a partner that were received in the night of this antenna."""
        active = mine.schedule.active
        held = active.item.id if active and active.state == PassState.ACTIVE else ""
        partner = self._known[name]
        fresh = {"seen_s": wall_s, "held": held, "ended": False}
        if "sends" in known:
            fresh["free_s"] = math.inf if known["sends"] else min(partner.free_s, wall_s)
        self._known[name] = replace(partner, **fresh | known)  # type: ignore[arg-type]

    def _alive(self, partner: Partner, wall_s: float) -> bool:
        return not partner.ended and wall_s - partner.seen_s <= self._silent_s

    def present(self, wall_s: float) -> bool:
        """Return whether a partner is there that has a night."""
        return any(each.night and self._alive(each, wall_s) for each in self._known.values())

    def silent(self, wall_s: float) -> str:
        """Return the partners that have fallen silent."""
        lost = [
            name for name, each in self._known.items()
            if math.isfinite(each.seen_s) and not each.ended and not self._alive(each, wall_s)
        ]  # fmt: skip
        return ", ".join(lost)

    def share(self, night: Night, t_s: float, wall_s: float) -> None:
        """Leave to the partners what they have at UTC `t_s`."""
        night.shared = self.present(wall_s)
        night.take("partner", {"silent": self.silent(wall_s)}, t_s)
        if (taken := self._taken(night.schedule.entries, t_s, wall_s)) != night.taken:
            night.taken = taken
            night.change(t_s)

    def _taken(self, entries: Mapping[str, Entry], t_s: float, wall_s: float) -> set[str]:
        """Return the ids that a partner has: all it plans, if it comes first by name."""
        return {
            each
            for name, partner in self._known.items()
            for each, state in (partner.states or {}).items()
            if each in entries and self._has(name, state, entries[each], t_s, self._alive(partner, wall_s))
        }

    def _has(self, name: str, state: str, entry: Entry, t_s: float, alive: bool) -> bool:
        first = name < self._antenna
        if entry.state == PassState.ACTIVE:
            # After a silence both may have it: the first goes on.
            return alive and first and state == PassState.ACTIVE
        if state == PassState.TRACKED:
            # What has not risen, nobody has tracked.
            return entry.item.aos_t_s <= t_s
        return alive and (state == PassState.ACTIVE or (first and state == PassState.WAITING))

    def inhibit(self, night: Night, wall_s: float) -> str:
        """Return "" or why this antenna must not transmit in the pass of `night` in work."""
        if (entry := night.schedule.active) is None:
            return ""
        if entry.state == PassState.STANDBY:
            return f"this antenna stands by in pass {entry.item.id}, which a partner has"
        name = next((name for name, each in self._known.items() if self._may_have(each, entry, wall_s)), "")
        return f"{name} has pass {entry.item.id}, or may have taken it over" if name else ""

    def _may_have(self, partner: Partner, entry: Entry, wall_s: float) -> bool:
        if partner.ended or partner.states is None:
            return not partner.ended
        state, silence_s = partner.states.get(entry.item.id), wall_s - partner.seen_s
        # After a cut its status arrives before its schedule, and its radio follows its status.
        sends = partner.sends == entry.item.id or wall_s - partner.free_s < UNKEYED_S
        if silence_s <= CONTACT_S and sends:
            return True
        if state not in (*OPEN, *IN_WORK):
            return False
        known = partner.held == entry.item.id
        if silence_s <= CONTACT_S:
            # It must have been received since this antenna has the pass: both may have taken it.
            return state == PassState.ACTIVE or not known
        # One that had it, and from which it was taken over, has stopped transmitting long before.
        return not (state == PassState.ACTIVE and not known and silence_s > self._silent_s)
