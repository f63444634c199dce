"""Two antennas that share a list: whatever fails, one has the pass, and never do both transmit."""

import json

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from rf_pointing.operations import BetweenParams
from rf_pointing.operations.partners import CONTACT_S, Partners
from rf_pointing.operations.schedule import PassState
from test.operations.test_night import STEP_S, Station, two
from test.operations.test_schedule import a_pass

SILENT_S = 5.0
NAMES = ("gs1", "gs2")


class Partner(Station):
    """A station that stands by for the other one."""

    between = BetweenParams(standby=True)

    def __init__(self, name: str) -> None:
        self.name, self.died_s, self.transmitted = name, None, False
        super().__init__(*two(), a_pass("c", 3300.0, azimuth=(-100.0, -260.0)))
        self.forget()

    def forget(self) -> None:
        self.partners = Partners(self.name, [each for each in NAMES if each != self.name], SILENT_S)

    @property
    def has(self) -> str:
        active = self.night.schedule.active
        return active.item.id if active and active.state == PassState.ACTIVE else ""

    def step(self, now_s: float) -> None:
        """Go on for a second; without an executive the antenna only goes on to transmit for a while."""
        if self.died_s is not None:
            self.transmitted = self.transmitted and now_s - self.died_s <= CONTACT_S
            return
        self.now_s = now_s - STEP_S
        self.partners.share(self.night, self.now_s, self.now_s)
        self.run(STEP_S)
        active = self.night.schedule.active
        inhibit = self.partners.inhibit(self.night, now_s)
        self.transmitted = bool(active and self.target and not self.fault and not inhibit)


class TwoAntennas(RuleBasedStateMachine):
    """The second stands by for the first, or the first for the second."""

    @initialize()
    def begin(self) -> None:
        self.both, self.now_s, self.linked, self.quiet_s = [Partner(name) for name in NAMES], 0.0, True, 0.0
        self.linked_s, self.cut = 0.0, False
        self.run(1010.0)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds)):
            self.now_s += STEP_S
            self.linked_s = self.linked_s + STEP_S if self.linked else 0.0
            for me, other in (self.both, self.both[::-1]):
                if self.linked and me.died_s is None and other.died_s is None:
                    rows = {each.item.id: str(each.state) for each in me.night.schedule.in_order}
                    status = {"night": not me.night.finished, "sends": me.has if me.transmitted else ""}
                    # After a cut the status arrives first.
                    known = status if 0.0 < self.linked_s < 3.0 and self.cut else status | {"states": rows}
                    other.partners.take(me.name, self.now_s, other.night, **known)
            for each in self.both:
                each.step(self.now_s)
            transmit = [each.name for each in self.both if each.transmitted]
            assert len(transmit) < 2 or self.both[0].has != self.both[1].has, (self.now_s, transmit)
            well = self.linked and all(each.died_s is None and not each.fault for each in self.both)
            self.quiet_s = self.quiet_s + STEP_S if well else 0.0

    @rule(seconds=st.sampled_from([1.0, 3.0, 7.0, 40.0, 150.0]))
    def time_goes_on(self, seconds: float) -> None:
        self.run(seconds)

    @rule(linked=st.booleans(), seconds=st.sampled_from([1.0, 2.0, 6.0, 30.0]))
    def the_link_is_cut_or_heals(self, linked: bool, seconds: float) -> None:
        self.cut |= not linked
        self.linked = linked
        self.run(seconds)

    @rule(which=st.integers(0, 1), seconds=st.sampled_from([1.0, 2.0, 20.0]))
    def a_fault_is_latched(self, which: int, seconds: float) -> None:
        one = self.both[which]
        if one.died_s is None:
            one.trip("azimuth drive")
        self.run(seconds)

    @rule(which=st.integers(0, 1), seconds=st.sampled_from([1.0, 4.0, 30.0]))
    def an_executive_is_killed(self, which: int, seconds: float) -> None:
        one = self.both[which]
        one.died_s = self.now_s
        self.run(seconds)
        one.died_s = None
        one.now_s = self.now_s
        one.forget()
        one.executive().restore(json.loads(one.kept[-1]), self.now_s)

    @invariant()
    def after_a_quiet_minute_exactly_one_has_the_pass(self) -> None:
        if getattr(self, "quiet_s", 0.0) < 60.0:
            return
        for item in self.both[0].passes.values():
            if item.aos_t_s + 60.0 < self.now_s < item.los_t_s - 10.0:
                assert [each.has for each in self.both].count(item.id) == 1, (self.now_s, item.id)


TestTwoAntennas = TwoAntennas.TestCase
TestTwoAntennas.settings = settings(
    max_examples=20, stateful_step_count=20, deadline=None, suppress_health_check=list(HealthCheck)
)


def test_a_pass_goes_on_without_a_gap_where_the_antenna_that_had_it_fails() -> None:
    """The partner is on the target already: it has the pass two seconds later, and keeps it."""
    world = TwoAntennas()
    world.begin()
    first, second = world.both
    world.run(100.0)
    assert (first.has, second.has, bool(second.target)) == ("a", "", True)
    assert (first.transmitted, second.transmitted) == (True, False)
    first.trip("azimuth drive")
    fault_s = world.now_s
    while not second.transmitted:
        world.run(1.0)
    assert world.now_s - fault_s <= 12.0
    world.run(60.0)
    assert (first.has, second.has) == ("", "a")
    assert first.night.schedule.entries["a"].state == PassState.STANDBY
    world.run(2000.0)
    states = [[str(each.night.schedule.entries[name].state) for name in "ab"] for each in world.both]
    assert states == [["yields", "tracked"], ["tracked", "yields"]]
