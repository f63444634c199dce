"""The time loop: what the caller changes between two ticks is in force in the next one."""

from rf_pointing.simulation.closed_loop import ticks


class Counted:
    """Returns what it was last given, and keeps the ticks that it was moved through."""

    def __init__(self) -> None:
        self.given, self.moved = 0, []

    def step(self, k: int) -> int:
        self.moved.append(k)
        return self.given


def test_a_change_between_two_ticks_acts_in_the_next() -> None:
    antenna, seen = Counted(), []
    for k, output in ticks(antenna, 3, first=5):
        seen.append((k, output))
        antenna.given = 10 * k
    assert seen == [(5, 0), (6, 50), (7, 60)]


def test_no_tick_is_moved_through_before_it_is_asked_for_and_without_count_the_caller_ends_the_loop() -> None:
    antenna = Counted()
    loop = ticks(antenna)
    assert antenna.moved == []
    for k, _ in loop:
        if k == 4:
            break
    assert antenna.moved == [0, 1, 2, 3, 4]
