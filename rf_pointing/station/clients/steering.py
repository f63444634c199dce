"""Clients that steer the antenna: whom it obeys, how it takes their points, when a pass begins.

Orders arrive from `drives/rotctld.py`.  What an order needs of the other nodes leaves as directives
(`steering_rows`); the motion on the points is returned by `step`.  An order is a generator of
directives: it waits where an answer is still due, and ends with the code for the client.

One client steers at a time.  A client is refused while the executive runs a schedule, while
somebody else's pass is tracked, and while a fault is latched.  So is its `S`: it ends what the
client itself has begun.  Points of the very satellite that is tracked are accepted whoever tracks
it, and move nothing.

An accepted point means that the antenna follows.  Where it has followed nobody for `FOLLOWED_S`,
the points are refused; a pass that the controller no longer names is given up, its points are
followed, and as soon as a controller is back its goal is sent again.
"""

import math
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from rf_pointing.core import JointReading, JointTrajectory, Params, Sensor, parameter, require_choice
from rf_pointing.core.types import Array
from rf_pointing.core.whole_file import read_whole
from rf_pointing.drives.line_server import IO_ERROR, REJECTED, TIMED_OUT, Inquiry, LineServer
from rf_pointing.drives.rotctld import StationView, direction_rad
from rf_pointing.ephemeris import CatalogueSky
from rf_pointing.operations.dictionary import TABLES, DirectiveRow, read_directives
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.clients.points import (
    ClientPoints,
    Follower,
    KnownSatellites,
    Match,
    MatchParams,
    identify,
    on_track,
)
from rf_pointing.station.pointing.status import Level, Report
from rf_pointing.tracking.sensors import SENSOR_CHOICES

PERIOD_S = 0.1
SILENT_S = 2.0
"""Steady time after which an antenna that publishes nothing counts as absent."""
FOLLOWED_S = 1.2
"""Longest steady time for which points are accepted that nobody has followed."""
ANSWER_S, STOPPED_S, ACCEPTED_S = 2.5, 1.0, 20.0
"""Longest steady time until a service answers, a pass is stopped, and one is accepted."""
LEASE_S = 10.0
"""After its last command a client that is still connected keeps others from steering."""
AGAIN_S = 120.0
"""A pass that was refused is not tried again for so long."""
SAME_RAD = math.radians(0.005)
MOVING_RAD_S = 1e-4
STRAYS = 2
"""Points in a row off the track of the pass in hand that end it."""


@dataclass(frozen=True, kw_only=True)
class SteeringParams(Params):
    """How a recognised pass is tracked."""

    identify: bool = parameter(True, "whether points of a known satellite become its pass")
    sensor: str = parameter(Sensor.PROGRAM.value, "sensor of the passes; auto: the station's choice")


def steering_rows() -> dict[str, DirectiveRow]:
    """Return what `Steering` sends to the other nodes, by name."""
    shipped = read_directives(read_whole(TABLES / "directives.yaml"))
    names = ("park", "release", "stop_pass", "select_target", "track")
    return {name: shipped[name] for name in names} | {"go_to": replace(shipped["unwind"], name="go_to")}


class Answer(NamedTuple):
    """The answer of a node: 0 or a code of rotctld, its words, and the passes of a target.

    A pass is its rise and its end in UTC s, and what `track` takes.
    """

    code: int
    text: str = ""
    passes: tuple[tuple[float, float, Any], ...] = ()


class NoAnswer(Exception):  # noqa: N818
    """A node is absent or silent, as its argument says."""


Steps = Generator[tuple[str, Mapping[str, Any]], Answer, int]
Reply = Callable[[int], object]


class Steering:
    """Carries out the orders of one client at a time, and follows its points.

    `send` takes number, name and arguments of a directive; `answered` and `ended` take what comes
    back under the number, within the same call too.  `heard_s` returns the steady time of the last
    bytes of a client, minus infinity for one that is gone.  `inform` takes words for the operator,
    `warn` one of a few subjects and words.  Raises ValueError for a sensor that is not known.
    """

    def __init__(
        self, params: SteeringParams, match: MatchParams, follower: Follower, known: KnownSatellites, view: StationView,
        *, node: str, send: Callable[[int, str, Mapping[str, Any]], None], heard_s: Callable[[str], float],
        inform: Callable[[str], object], warn: Callable[[str, str], object],
    ) -> None:  # fmt: skip
        require_choice("sensor", params.sensor, SENSOR_CHOICES)
        self._params, self._match_params = params, match
        self.follower, self._known, self.view = follower, known, view
        self._node, self._send, self._heard_s, self._inform, self._log = node, send, heard_s, inform, warn
        self.client = ""
        self._t_s = self._wall_s = 0.0
        self._axes: JointReading | None = None
        self._mode, self._fault, self._antenna_wall_s, self._rejected = "", "", -math.inf, 0
        self._target, self._sent, self._executive = "", 0, "idle"
        self._named_wall_s = self._obeyed_wall_s = self._tracking_wall_s = -math.inf
        self._joining, self._joined = ClientPoints(follower.params), -1
        self._steered_wall_s = -math.inf
        self._place: Array | None = None
        self._place_due = self._parked_here = False
        self._refusal = ""
        self._match: Match | None = None
        self._goal, self._certified, self._sent_before, self._strays = 0, False, 0, 0
        # A pass that is called off before the controller has accepted it.
        self._called_off = False
        self._refused: dict[int, float] = {}
        self._number, self._waiting = 0, dict[int, tuple[Steps, Reply, str, float]]()

    # What is known

    def note_axes(self, axes: JointReading) -> None:
        """Take the newest reading of the encoders."""
        self._axes = axes
        azimuth, elevation = self.follower.beam_rad(axes)
        self.view.position_deg = math.degrees(azimuth), math.degrees(elevation)
        rates = [0 if abs(rate) < MOVING_RAD_S else int(math.copysign(1, rate)) for rate in axes.velocity_rad_s]
        self.view.moving = rates[0], rates[1]

    def note_antenna(self, mode: str, fault: str, commander: str, rejected: int, last_rejection: str) -> None:
        """Take the status of the antenna, which has refused so many commands."""
        more, self._rejected = rejected > self._rejected, rejected
        self._mode, self._fault, self._antenna_wall_s = mode, fault, self._wall_s
        if mode == AntennaMode.TRACKING:
            self._obeyed_wall_s = self._wall_s
        if mode not in (AntennaMode.PARKED, AntennaMode.PARKING):
            self._parked_here = False
        if self.follower.azimuth_rad is not None and commander == self._node:
            self._refusal = ""
        elif self.follower.azimuth_rad is not None and more:
            self._warn("the points are not followed", last_rejection)
            self._refusal = last_rejection

    def note_tracking(self, target: str, commands_sent: int) -> None:
        """Take the status of the pointing controller; `target` is "" between passes."""
        if self._match is not None and not self._goal and target == self._match.name:
            # The answer of a controller that has just started may be lost: its status tells it.
            for number in [number for number, (*_, name, _) in self._waiting.items() if name == "track"]:
                self.answered(number, Answer(0))
        self._target, self._sent, self._tracking_wall_s = target, commands_sent, self._wall_s
        mine = self._goal and self._match is not None and target == self._match.name
        if mine:
            self._named_wall_s = self._wall_s
        if target and self._match is None and self.follower.points.moving:
            # Somebody else's pass has begun: two commanders would fight.
            self._inform(f"{target} is tracked for somebody else; the points are not followed")
            self._forget()
        if mine and not self._certified and commands_sent > self._sent_before:
            # The pass has its certificate, and from here on the controller commands.
            self._certified, self.follower.azimuth_rad = True, None

    def note_executive(self, state: str) -> None:
        """Take the state of the executive."""
        self._executive = state

    def report(self, server: LineServer | None) -> Report:
        """Return what the antenna does for clients, and what became of them at the port."""
        if server is None:
            return Report(Level.OK, "not served", {})
        sky = self._known.sky
        values = server.values() | {"steering": self.client, "satellites": len(sky.elements) if sky else 0}
        if trouble := self._known.problem or self._refusal:
            return Report(Level.WARN, trouble, values)
        if self._match is not None and self._certified:
            return Report(Level.OK, f"tracks {self._match.name}", values)
        follows = self.follower.azimuth_rad is not None
        return Report(Level.OK, "follows points" if follows else "holds" if self.client else "waits", values)

    @property
    def in_pass(self) -> bool:
        """Whether the controller has accepted the pass of a client."""
        return self._goal != 0

    @property
    def _tracked(self) -> str:
        """The target of a controller that reports, else ""."""
        return self._target if self._wall_s - self._tracking_wall_s <= SILENT_S else ""

    # Orders

    def turn(self, t_s: float, wall_s: float) -> None:
        """Set UTC and steady time (s) of what follows; give up answers that are overdue."""
        self._t_s, self._wall_s = t_s, wall_s
        for number in [number for number, (*_, until_s) in self._waiting.items() if wall_s > until_s]:
            self.answered(number, Answer(TIMED_OUT, "no answer"))

    def _warn(self, subject: str, text: str) -> None:
        """Log why something was not done; a client can request the reason."""
        self.view.reason = f"{subject}: {text}"
        self._log(subject, text)

    def order(self, inquiry: Inquiry) -> None:
        """Carry out the order of a client; its reply may come later."""
        order, self.view.reason = inquiry.order, self._refusal
        code, reason = self._reason_against(inquiry.client, order.name)
        if code and order.name == "set_pos" and self._joins(inquiry):
            inquiry.reply(0)
        elif code:
            self._warn(f"{order.name} refused", f"{inquiry.client} {order.text}: {reason}")
            inquiry.reply(code)
        elif order.name == "set_pos":
            self._go_on(self._point(inquiry), inquiry.reply)
            self._identify()
        else:
            self._go_on(self._stop() if order.name == "stop" else self._park(), inquiry.reply)

    def answered(self, number: int, answer: Answer) -> None:
        """Take the answer to a directive; one that comes too late is ignored."""
        if number in self._waiting:
            steps, reply, name, _ = self._waiting.pop(number)
            if name == "track" and not answer.code:
                self._goal, self._sent_before = number, self._sent
                self._named_wall_s = self._obeyed_wall_s = self._wall_s
            self._go_on(steps, reply, answer)

    def _go_on(self, steps: Steps, reply: Reply = int, answer: Answer | None = None) -> None:
        """Take the steps of an order up to the next answer; by default nobody takes the code."""
        try:
            if answer is not None and answer.code in (IO_ERROR, TIMED_OUT):
                name, arguments = steps.throw(NoAnswer(answer))
            else:
                name, arguments = steps.send(answer)  # type: ignore[arg-type]
        except StopIteration as end:
            reply(end.value)
        except NoAnswer as error:
            self._warn("not carried out", error.args[0].text)
            reply(error.args[0].code)
        else:
            self._number += 1
            until_s = self._wall_s + {"track": ACCEPTED_S, "stop_pass": STOPPED_S}.get(name, ANSWER_S)
            self._waiting[self._number] = steps, reply, name, until_s
            self._send(self._number, name, arguments)

    def _reason_against(self, client: str, order: str) -> tuple[int, str]:
        """Return the code and why `client` may not move the antenna, 0 and "" if it may."""
        rival = self.client != client and math.isfinite(self._heard_s(self.client))
        if rival and self._wall_s - self._steered_wall_s < LEASE_S:
            return REJECTED, f"{self.client} steers; it must be silent for {LEASE_S:.0f} s or disconnect"
        if self._goal and order == "stop":
            return 0, ""
        if self._wall_s - self._antenna_wall_s > SILENT_S or self._axes is None:
            return IO_ERROR, "antenna_servo is silent"
        if self._fault:
            return REJECTED, f"a fault is latched ({self._fault}); reset it first"
        if self._executive not in ("", "idle"):
            return REJECTED, f"the executive is {self._executive}: pause or stop the night first"
        if self._tracked and not self._goal and self._match is None:
            return REJECTED, f"{self._target} is tracked for somebody else; stop that pass first"
        if self._mode == AntennaMode.PARKED and not self._parked_here:
            return REJECTED, "the antenna was parked by somebody else; release it first"
        return 0, ""

    def _joins(self, inquiry: Inquiry) -> bool:
        """Return whether a point is of the satellite that is tracked for somebody else."""
        sky, points = self._known.sky, self._joining
        if sky is None or not self._tracked or self._goal or self._match is not None or self._followed():
            self._joined = -1
            return False
        points.add(self._t_s - (self._wall_s - inquiry.at_s), *direction_rad(*inquiry.order.values))
        if self._joined < 0:
            found = identify(sky, *points.history, self._match_params)
            self._joined = found.row if found is not None and found.name == self._target else -1
        return self._joined >= 0 and self._on_track(sky, self._joined, points)

    def _on_track(self, sky: CatalogueSky, row: int, points: ClientPoints) -> bool:
        times, directions = points.history
        return on_track(sky, row, float(times[-1]), directions[-1], self._match_params)

    def _followed(self) -> int:
        """Return the code of a point while the antenna should be moving: REJECTED if it rests."""
        silent_s = self._wall_s - self._obeyed_wall_s
        if silent_s > FOLLOWED_S:
            self._warn("nothing is followed", f"the antenna has been {self._mode} for more than {FOLLOWED_S} s")
        return REJECTED if silent_s > FOLLOWED_S else 0

    def _point(self, inquiry: Inquiry) -> Steps:
        self.client, self._steered_wall_s = inquiry.client, self._wall_s
        azimuth_deg, elevation_deg = inquiry.order.values
        arrived_s, moved = self._t_s - (self._wall_s - inquiry.at_s), self.follower.points.moving
        self.follower.points.add(arrived_s, *direction_rad(azimuth_deg, elevation_deg))
        if self._goal:
            return (yield from self._point_of_pass())
        if self.follower.points.moving:
            if not moved:
                self._obeyed_wall_s = self._wall_s
            return REJECTED if self._refusal else self._followed()
        self.follower.azimuth_rad = None
        return (yield from self._go_to_place())

    def _point_of_pass(self) -> Steps:
        """Take a point during a pass; points off its track end it."""
        sky, match = self._known.sky, self._match
        assert sky is not None
        assert match is not None
        self._strays = 0 if self._on_track(sky, match.row, self.follower.points) else self._strays + 1
        if self._strays >= STRAYS:
            self._inform(f"the client has left the track of {match.name}")
            self._strays, self._place_due = 0, True
            yield "stop_pass", {}
            return 0
        return self._followed()

    def _stop(self) -> Steps:
        """End what moves for the client, in a controlled way."""
        if (yield from self._end_pass()):
            return 0
        return IO_ERROR if self._axes is None else (yield from self._halt())

    def _end_pass(self) -> Generator[tuple[str, Mapping[str, Any]], Answer, bool]:
        """Forget the points and end the pass; return whether a controller ends one."""
        self._forget()
        self._called_off = self._match is not None and not self._goal
        if not self._goal:
            return False
        with suppress(NoAnswer):
            yield "stop_pass", {}
            return True
        self._give_up("it does not answer")
        return False

    def _give_up(self, why: str) -> None:
        """Take a pass for over that the controller has lost."""
        if self._match is not None:
            self._warn("the pass is given up", f"{self._match.name}: pointing_controller has lost it, {why}")
        self._goal, self._match, self._certified = 0, None, False

    def _park(self) -> Steps:
        yield from self._end_pass()
        answer = yield "park", {}
        self._parked_here = self._parked_here or not answer.code
        return self._told("park", answer)

    def _halt(self) -> Steps:
        """Come to rest where the axes can stop, and hold there."""
        assert self._axes is not None
        return self._told("S", (yield _go_to(self.follower.rest_rad(self._axes))))

    def _go_to_place(self) -> Steps:
        """Go to the latest point and hold there."""
        assert self._axes is not None
        goal = self.follower.place_rad(self._axes)
        if self._place is not None and float(np.max(np.abs(goal - self._place))) < SAME_RAD:
            return 0
        self._place, code = goal, REJECTED
        try:
            if self._mode == AntennaMode.PARKED:
                yield "release", {}
            code = self._told("P", (yield _go_to(goal)))
        finally:
            if code:
                # Sent again, it is tried again.
                self._place = None
        return code

    def _told(self, what: str, answer: Answer) -> int:
        if answer.code:
            self._warn(f"{what} refused", answer.text)
        return answer.code

    # Motion

    def step(self, t_s: float, wall_s: float) -> JointTrajectory | None:
        """Return the motion of the second after `t_s`, None while no points are followed."""
        self.turn(t_s, wall_s)
        points = self.follower.points
        if wall_s - self._antenna_wall_s > SILENT_S:
            self.view.position_deg = None
        if self._goal and wall_s - self._named_wall_s > FOLLOWED_S:
            self._give_up(f"silent for {FOLLOWED_S} s")
        if self._goal and self._certified:
            silent_s = wall_s - max(self._heard_s(self.client), self._steered_wall_s)
            if silent_s > self._match_params.silence_s:
                self._warn("the pass ends", f"{self.client} has been silent for {silent_s:.0f} s")
                self._steered_wall_s = math.inf
                self._go_on(_stop_pass())
            return None
        if self._place_due and not self._goal:
            self._place_due = False
            if not points.moving and math.isfinite(points.newest_s):
                self._go_on(self._go_to_place())
        if not points.moving or self._axes is None:
            return None
        if (silent_s := t_s - points.newest_s) > self.follower.params.coast_s:
            self._hold(f"no further point for {silent_s:.1f} s")
            return None
        self._place, command = None, self.follower.command(t_s, self._axes)
        if self.follower.unwinds:
            self._warn("the azimuth's travel ends here", "unwinding to go on on another turn")
        return command

    def rest(self) -> None:
        """Bring what moves for clients to rest."""
        if self._goal:
            self._go_on(_stop_pass())
        elif self.follower.points.moving:
            self._hold("the server was deactivated")

    def _hold(self, reason: str) -> None:
        self._inform(f"holding: {reason}")
        self._forget()
        self._go_on(self._halt())

    def _forget(self) -> None:
        self.follower.clear()
        self._place, self._refusal = None, ""

    # Passes of known satellites

    def _identify(self) -> None:
        """Look whether the points are those of a known satellite, and bring about its pass."""
        if self._known.sky is None or self._match is not None or self._wall_s - self._tracking_wall_s > SILENT_S:
            return
        found = identify(self._known.sky, *self.follower.points.history, self._match_params)
        if found is not None and self._t_s >= self._refused.get(found.catalogue_number, -math.inf):
            self._match, self._called_off = found, False
            self._go_on(self._start_pass(found))

    def _start_pass(self, found: Match) -> Steps:
        """Have a satellite tracked; where it cannot be, its points are followed."""
        self._inform(
            f"the points are those of {found.name} ({found.catalogue_number}): within "
            f"{math.degrees(found.distance_rad):.2f} deg of its track, {found.lead_s:+.1f} s ahead of it"
        )
        # Where nobody has refused it: a node that was just started again answers the next time.
        again_s = ANSWER_S
        try:
            answer = yield "select_target", {"target": str(found.catalogue_number)}
            again_s = AGAIN_S
            coming = [each for each in answer.passes if each[1] > self._t_s]
            if not answer.code and coming:
                aos_t_s, _, wanted = coming[0]
                if aos_t_s > self._t_s + AGAIN_S:
                    answer = Answer(REJECTED, "it does not rise above the station's horizon now")
                else:
                    answer = yield "track", {"target_pass": wanted, "sensor": self._params.sensor}
                    if self._called_off and not answer.code:
                        yield "stop_pass", {}
            elif not answer.code:
                answer = Answer(REJECTED, answer.text)
        except NoAnswer as error:
            answer = error.args[0]
            again_s = ANSWER_S if answer.code == TIMED_OUT else again_s
        if answer.code:
            self._warn("no pass", f"{found.name} is not tracked, its points are followed: {answer.text}")
            self._end_match(found, again_s)
        return 0

    def ended(self, number: int, message: str, tracked_s: float) -> None:
        """Take the end of a pass."""
        if number == self._goal and self._match is not None:
            self._inform(f"{self._match.name}: {message}; {tracked_s:.0f} s tracked")
            if self._certified and not self._place_due:
                # What was sent for the pass is over with it; the client's next points count.
                self._forget()
            self._end_match(self._match)

    def _end_match(self, match: Match, again_s: float = AGAIN_S) -> None:
        self._refused[match.catalogue_number] = self._t_s + again_s
        self._goal, self._match, self._certified = 0, None, False


def _go_to(goal: Array) -> tuple[str, Mapping[str, Any]]:
    return "go_to", {"azimuth": float(goal[0]), "elevation": float(goal[1])}


def _stop_pass() -> Steps:
    yield "stop_pass", {}
    return 0
