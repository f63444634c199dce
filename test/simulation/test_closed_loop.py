"""The time loop: what the caller changes between two ticks is in force in the next one."""

from types import SimpleNamespace

import pytest

from rf_pointing.simulation.closed_loop import PointedAntenna, ticks


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


class Parts:
    """An antenna and a controller that note what they are given, with ticks of 0.02 s and periods of 0.1 s."""

    def __init__(self, *, trajectory: str | None = "trajectory", boresight: str | None = "beam") -> None:
        self.log: list[tuple[object, ...]] = []
        self.trajectory, self.boresight, self.count = trajectory, boresight, 0
        self.params = SimpleNamespace(tick_s=0.02, pointing=SimpleNamespace(period_s=0.1))

    def pointed(self, start_s: float, *targets_from_s: float) -> PointedAntenna:
        track = SimpleNamespace(target_at=lambda t_s: f"target {t_s:.6f}")
        return PointedAntenna(self, Controller(self), track, start_s, *targets_from_s)

    def reading(self, t_s: float) -> str:
        return f"first at {t_s}"

    def step(self, t_s: float) -> tuple[str | None, str | None]:
        self.count += 1
        self.log.append(("step", t_s))
        return f"reading {self.count}", self.boresight

    def accept(self, trajectory: str, t_s: float) -> None:
        self.log.append(("accept", trajectory, t_s))


class Controller:
    """The controller of such parts."""

    def __init__(self, parts: Parts) -> None:
        self.params, self._parts = parts.params, parts

    def take_joints(self, reading: str) -> None:
        self._parts.log.append(("joints", reading))

    def take_target(self, target: str) -> None:
        self._parts.log.append(("target", target))

    def step(self, t_s: float) -> tuple[str | None, str]:
        self._parts.log.append(("control", t_s))
        return self._parts.trajectory, "status"


def test_the_controller_acts_every_fifth_tick_on_the_axes_of_a_period_before_and_a_target_two_seconds_ahead() -> None:
    parts = Parts()
    pointed = parts.pointed(1000.0)
    assert parts.log == [("joints", "first at 1000.0")]
    parts.log.clear()
    outputs = [output for _, output in ticks(pointed, 11)]
    assert [output.t_s for output in outputs] == [round(1000.0 + 0.02 * k, 6) for k in range(11)]
    assert [output.reading for output in outputs] == [f"reading {k + 1}" for k in range(11)]
    assert {output.boresight for output in outputs} == {"beam"}
    for k, output in enumerate(outputs):
        due = k % 5 == 0
        assert (output.status, output.trajectory) == (("status", "trajectory") if due else (None, None))
    expected: list[tuple[object, ...]] = []
    for k in range(11):
        t_s = round(1000.0 + 0.02 * k, 6)
        expected.append(("step", t_s))
        if k % 5 == 0:
            known = f"reading {k - 4}" if k else "first at 1000.0"
            expected += [
                ("joints", known), ("target", f"target {t_s + 2.0:.6f}"), ("control", t_s), ("accept", "trajectory", t_s)
            ]  # fmt: skip
    assert parts.log == expected


def test_no_target_is_given_long_before_the_pass_and_no_trajectory_accepted_that_is_none() -> None:
    parts = Parts(trajectory=None)
    pointed = parts.pointed(1000.0, 1002.1)
    for _ in ticks(pointed, 11):
        pass
    assert [row[1] for row in parts.log if row[0] == "target"] == ["target 1002.100000", "target 1002.200000"]
    assert not [row for row in parts.log if row[0] == "accept"]


def test_an_antenna_that_does_not_say_where_its_beam_is_is_refused() -> None:
    with pytest.raises(ValueError, match="must read its axes, and say where its beam is"):
        Parts(boresight=None).pointed(0.0).step(0)
    parts = Parts()
    parts.step = lambda _t_s: (None, "beam")
    with pytest.raises(ValueError, match="must read its axes"):
        parts.pointed(0.0).step(0)


def test_the_stamps_of_ticks_are_whole_microseconds() -> None:
    parts = Parts()
    assert parts.pointed(1000.0000004).step(1).t_s == 1000.02
