"""Which of two pointing controllers of one antenna works; the other stands by and takes over.

Both have one name and receive all that arrives; one of them sends.  Every period it claims the
antenna.  The other follows the same pass in silence, so that it goes on with the same corrections.

    begins     SILENT_S after the last claim in a pass, IDLE_S between two; START_S count as claimed
    gives way  to one whom the antenna obeys; while it obeys neither, the second to the first

The antenna decides: its authority (`planning/interlocks.py`) takes one commander at a time, and
lets the other one of a pair succeed sooner than a stranger.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType

from rf_pointing.core.signals import STANDBY

FIRST, SECOND = "first", "second"
SILENT_S, IDLE_S = 0.5, 2.0
"""Silence in a pass, where commands reach 1 s ahead, and between two, where nothing is urgent."""
START_S: Mapping[str, float] = MappingProxyType({FIRST: 2.5, SECOND: 5.0})
"""Time from its start in which a node may not have found yet one that works."""
PRESENT_S = 1.5
"""One that does not receive the antenna does not begin: the other may well."""
OBEYED_S = 0.5


class Succession:
    """One of the two, `role`; times are those of a steady clock (s)."""

    def __init__(self, full_name: str, role: str, begun_s: float) -> None:
        names = {FIRST: full_name, SECOND: f"{full_name}{STANDBY}"}
        self._second = role == SECOND
        self.name, self.other = names[role], names[FIRST if self._second else SECOND]
        self.works = False
        self._claimed_s = begun_s + START_S[role]
        self._present_s = self._obeyed_s = -math.inf
        self._accepted = -1

    def take_claim(self, t_s: float) -> None:
        """Note that the other one works."""
        self._claimed_s = max(self._claimed_s, t_s)
        if self._second and t_s - self._obeyed_s > OBEYED_S:
            self.works = False

    def take_antenna(self, commander: str, accepted: int, t_s: float) -> None:
        """Note whom the antenna obeys, and how many commands it has accepted."""
        self._present_s, before, self._accepted = t_s, self._accepted, accepted
        if accepted in (before, 0):
            return
        if commander == self.name:
            self._obeyed_s = t_s
        elif commander == self.other and before >= 0:
            self._claimed_s, self.works = max(self._claimed_s, t_s), False

    def step(self, t_s: float, *, in_pass: bool, needs_antenna: bool = True) -> bool:
        """Return whether it works from now on."""
        silent_s = t_s - self._claimed_s
        present = not needs_antenna or t_s - self._present_s <= PRESENT_S
        if not self.works and present and silent_s > (SILENT_S if in_pass else IDLE_S):
            self.works = True
        return self.works
