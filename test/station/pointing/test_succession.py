"""Two controllers of one antenna: whatever fails, it obeys one of them, and in the end exactly one works."""

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from rf_pointing.planning.interlocks import SUCCEEDS_S, Authority
from rf_pointing.station.pointing.params import PointingParams
from rf_pointing.station.pointing.succession import FIRST, SECOND, START_S, Succession

PERIOD_S = 0.1
CALM_S = max(START_S.values()) + 3.0
ROLES = (FIRST, SECOND)


class World:
    """Both controllers, the antenna that obeys one of them, and the links between the three."""

    def __init__(self) -> None:
        self.t_s, self.calm_s, self.in_pass = 0.0, 0.0, True
        self.both: list[Succession | None] = [Succession("/gs1/controller", role, 0.0) for role in ROLES]
        self.stalled_until_s, self.reaches = [0.0, 0.0], [True, True]
        self.linked = True
        self.authority, self.accepted = Authority(1.0), 0
        self.obeyed: list[tuple[float, str]] = []

    @property
    def working(self) -> list[int]:
        return [index for index, each in enumerate(self.both) if each is not None and each.works]

    def restart(self, index: int) -> None:
        self.both[index] = Succession("/gs1/controller", ROLES[index], self.t_s)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.step()

    def step(self) -> None:
        self.t_s = round(self.t_s + PERIOD_S, 6)
        runs = [
            index for index, each in enumerate(self.both) if each is not None and self.t_s > self.stalled_until_s[index]
        ]
        for index in runs:
            one, other = self.both[index], self.both[1 - index]
            assert one is not None
            if not one.step(self.t_s, in_pass=self.in_pass):
                continue
            if self.in_pass and self.reaches[index] and not self.authority.conflict(one.name, self.t_s):
                self.authority.claim(one.name, self.t_s)
                self.accepted += 1
                self.obeyed.append((self.t_s, one.name))
            if other is not None and self.linked and 1 - index in runs:
                other.take_claim(self.t_s)
        for index in runs:
            one = self.both[index]
            if one is not None and self.reaches[index]:
                one.take_antenna(self.authority.holder, self.accepted, self.t_s)
        well = len(runs) == 2 and self.linked and all(self.reaches)
        self.calm_s = self.calm_s + PERIOD_S if well else 0.0


class TwoControllers(RuleBasedStateMachine):
    """Kills, stalls and cuts in any order, in passes and between them."""

    def __init__(self) -> None:
        super().__init__()
        self.world = World()
        self.world.run(CALM_S)

    @rule(seconds=st.sampled_from([0.3, 1.0, 4.0, CALM_S]))
    def time_goes_on(self, seconds: float) -> None:
        self.world.run(seconds)

    @rule(in_pass=st.booleans())
    def a_pass_begins_or_ends(self, in_pass: bool) -> None:
        self.world.in_pass = in_pass
        if not in_pass:
            self.world.authority.release()
        self.world.run(0.5)

    @rule(index=st.integers(0, 1), seconds=st.sampled_from([0.2, 1.0, 3.0, 20.0]))
    def one_is_killed_and_comes_back(self, index: int, seconds: float) -> None:
        self.world.both[index] = None
        self.world.run(seconds)
        self.world.restart(index)

    @rule(index=st.integers(0, 1), seconds=st.sampled_from([0.2, 0.6, 3.0]))
    def one_stalls(self, index: int, seconds: float) -> None:
        self.world.stalled_until_s[index] = self.world.t_s + seconds
        self.world.run(seconds)

    @rule(
        linked=st.booleans(), reaches=st.tuples(st.booleans(), st.booleans()), seconds=st.sampled_from([0.5, 3.0, 9.0])
    )
    def links_are_cut_or_heal(self, linked: bool, reaches: tuple[bool, bool], seconds: float) -> None:
        self.world.linked, self.world.reaches = linked, list(reaches)
        self.world.run(seconds)

    @invariant()
    def the_antenna_obeys_another_one_only_after_a_silence(self) -> None:
        rows = self.world.obeyed
        for (before_s, before), (t_s, name) in pairwise(rows):
            assert name == before or t_s - before_s > SUCCEEDS_S
        rows[:-1] = []

    @invariant()
    def after_a_while_without_a_failure_exactly_one_works_and_is_obeyed(self) -> None:
        world = self.world
        if world.calm_s > CALM_S:
            (index,) = world.working
            one = world.both[index]
            assert one is not None
            if world.in_pass:
                assert world.obeyed[-1] == (world.t_s, one.name)


TestTwoControllers = TwoControllers.TestCase
TestTwoControllers.settings = settings(max_examples=60, stateful_step_count=25, deadline=None)


@given(run_s=st.floats(0.0, 3.0), index=st.integers(0, 1))
def test_the_other_one_commands_before_the_last_command_of_a_killed_one_has_ended(run_s: float, index: int) -> None:
    world = World()
    world.run(CALM_S)
    if world.working != [index]:
        # The second works after the first has been away.
        world.both[0] = None
        world.run(1.0)
        world.restart(0)
    world.run(CALM_S + run_s)
    assert world.working == [index]
    last_s, name = world.obeyed[-1]
    world.both[index] = None
    world.run(2.0)
    next_s = next(t_s for t_s, each in world.obeyed if each != name and t_s > last_s)
    assert next_s - last_s <= PointingParams().horizon_s - 2.0 * PERIOD_S


def test_between_passes_a_silence_of_a_second_is_no_death() -> None:
    world = World()
    world.in_pass = False
    world.run(CALM_S)
    world.stalled_until_s[0] = world.t_s + 1.0
    world.run(1.0)
    assert world.working == [0]


def test_a_first_that_was_cut_off_in_a_pass_gives_way_when_it_is_back_and_no_command_is_missed() -> None:
    world = World()
    world.run(CALM_S)
    world.linked, world.reaches = False, [False, True]
    world.run(3.0)
    assert world.working == [0, 1]
    world.linked, world.reaches = True, [True, True]
    world.run(2.0)
    assert world.working == [1]
    times_s = [t_s for t_s, _ in world.obeyed if t_s > world.t_s - 2.0]
    assert max(later - before for before, later in pairwise(times_s)) < 1.5 * PERIOD_S


def test_one_that_does_not_receive_the_antenna_does_not_begin() -> None:
    one = Succession("/gs1/controller", FIRST, 0.0)
    assert not one.step(60.0, in_pass=True)
    assert one.step(60.0, in_pass=True, needs_antenna=False)
