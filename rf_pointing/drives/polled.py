"""A device that is polled over a link: one request at a time, answers whenever they come.

    closed --wait--> opening --open--> greeting --> set point or stop, position, position, ...
      ^--------------- lost: link gone, or no position for `lost_s` ---------------'

The waits to reconnect double up to the longest.  A device that is lost keeps its stop: whatever it
did meanwhile, the first thing that it gets is to stop.  What comes too late, in part or as noise is
counted by name in `losses`.
"""

import math
from collections import Counter, deque

from rf_pointing.core.types import Pair
from rf_pointing.drives import protocols
from rf_pointing.drives.drive import Drive, DriveReading
from rf_pointing.drives.link import KeptLink, Link
from rf_pointing.drives.params import DriveParams
from rf_pointing.drives.protocols import Answer, DeviceProtocol, Request

ALSO_S = 1.0
STOP_AGAIN_S = 1.0
"""A device that still moves so long after its stop gets it again."""
LATE_S = 0.1
"""Time between two steps from which on it does not count as waiting for the device."""
SETTLED_STEPS = 1.5
"""Steps of the resolution that a device at rest may show as motion."""


class PolledDrive(Drive):
    """A rotator controller behind a serial port or TCP; positions are its set points."""

    _set_point: Pair | None

    def __init__(self, protocol: DeviceProtocol, params: DriveParams) -> None:
        self._protocol, self._params, self._timing = protocol, params, params.link
        self._kept = KeptLink(protocol.name, params.link, protocol.baud)
        self.losses: Counter[str] = Counter()
        self.problem = self._kept.problem
        self._buffer = bytearray()
        self._queue: deque[Request] = deque()
        self._pending: tuple[Request, float] | None = None
        self._owed_s: deque[float] = deque()
        """When the requests of the position were sent whose answers may still come."""
        self._reading: DriveReading | None = None
        self._set_point, self._stopped, self._stop_due = None, True, True
        self._latency_s, self._alarm, self._refused = 0.0, "", ""
        # Waits are kept in a time that does not jump; clocks are set, by `_set_s` in all.
        self._own_s: float | None = None
        self._set_s = 0.0
        self._poll_s = self._also_s = self._known_s = self._stop_s = -1e9
        self._asked_s = math.inf
        """When the position was first requested since the last one."""
        self._state_capabilities(None)

    def _state_capabilities(self, travel_rad: tuple[Pair, Pair] | None) -> None:
        """State what is known of the device now; it may say more once it is connected."""
        self._resolution_deg = self._protocol.resolution_deg
        known = {"travel_rad": travel_rad, "has_elevation": self._protocol.has_elevation}
        self.capabilities = self._params.capabilities(self._resolution_deg, **known)

    def step(self, t_s: float) -> DriveReading | None:
        now_s = t_s - self._set_s
        late_s = 0.0 if self._own_s is None else now_s - self._own_s
        # A step that came late is not silence of the device, and a clock that went back keeps
        # every wait as long as it was.
        if late_s < 0.0:
            self.clock_stepped(late_s)
            now_s -= late_s
        elif late_s > LATE_S:
            self._known_s, self._asked_s = self._known_s + late_s, self._asked_s + late_s
            if self._pending is not None:
                self._pending = self._pending[0], self._pending[1] + late_s
        self._own_s = now_s
        if self._kept.step(now_s):
            self._begin(now_s)
        elif self._kept.link is None:
            self.problem = self._kept.problem
        if self._kept.link is not None:
            try:
                self._exchange(self._kept.link, now_s)
            except OSError as error:
                self._lose(now_s, f"the link is lost: {error}")
        return self._reading

    def clock_stepped(self, by_s: float) -> None:
        if self._own_s is not None:
            self._set_s += by_s

    def go_to(self, position_rad: Pair) -> None:
        self._set_point, self._stopped, self._stop_due = position_rad, False, False
        self._send_now()

    def stop(self) -> None:
        self._set_point, self._stopped, self._stop_due = None, True, True
        self._send_now()

    def close(self) -> None:
        if self._kept.link is not None and self._stop_due:
            try:
                self._kept.link.write(self._protocol.stop.data)
            except OSError:
                self.losses["stop at the end"] += 1
        self._kept.close()
        self.problem = self._kept.problem

    # The link

    def _begin(self, t_s: float) -> None:
        """Begin the exchange on a link that has just been opened."""
        self._pending = None
        self._owed_s.clear()
        self._buffer.clear()
        # Whatever the device does now was not commanded on this connection.
        self._set_point, self._stopped, self._stop_due = None, True, True
        self._protocol.connected()
        self._queue = deque(self._protocol.greeting)
        self._known_s, self._also_s, self._asked_s = t_s, t_s, math.inf
        self._poll_s = t_s - self._timing.poll_period_s

    def _lose(self, t_s: float, why: str) -> None:
        self.losses["connection"] += 1
        self._pending = None
        self._kept.lose(t_s, why)
        self.problem = self._kept.problem

    # The exchange

    def _exchange(self, link: Link, t_s: float) -> None:
        arrived = link.read()
        self._buffer += arrived
        # What is read was measured before now, however long this process slept since its tick.
        read_s = max(t_s, self.now_s() - self._set_s) if arrived and self.now_s is not None else t_s
        for answer in self._protocol.take(self._buffer):
            self._take(answer, read_s)
        if self._pending is not None and t_s - self._pending[1] > self._timing.answer_s:
            self.losses[f"answer to {self._pending[0].name}"] += 1
            self._pending = None
        # From its first request on: a tick that came late is not silence of the device.
        since_s = max(self._known_s, self._asked_s - self._timing.poll_period_s)
        if t_s - since_s <= self._timing.lost_s:
            self._send(link, t_s)
            return
        refused = f", last answer: {self._refused}" if self._refused else ""
        silent = f"no position for {t_s - self._known_s:.2f} s"
        self._lose(t_s, f"{silent}, at most {self._timing.lost_s:.2f} s{refused}")

    def _send_now(self) -> None:
        """Send a new set point or a stop without waiting for the next tick."""
        if self._kept.link is not None and self._own_s is not None:
            try:
                self._send(self._kept.link, self._own_s)
            except OSError as error:
                self._lose(self._own_s, f"the link is lost: {error}")

    def _send(self, link: Link, t_s: float) -> None:
        # A stop does not wait for an answer that may never come.
        while (self._stop_due or self._pending is None) and (request := self._next(t_s)):
            link.write(request.data)
            if request.answer:
                self._pending = request, t_s
            if request.answer == protocols.POSITION:
                self._owed_s.append(t_s)

    def _next(self, t_s: float) -> Request | None:
        """Return what is to be sent now: a stop before a set point before what is only read."""
        if self._stop_due:
            self._stop_due, self._stop_s = False, t_s
            return self._protocol.stop
        # A controller may need its greeting's answer to understand the set point.
        if self._queue:
            return self._queue.popleft()
        if self._set_point is not None and self._reading is not None:
            angles, self._set_point = self._set_point, None
            return self._protocol.go_to(*(math.degrees(angle) for angle in angles))
        if t_s - self._poll_s >= self._timing.poll_period_s - 1e-6:
            if self._owed_s and self._owed_s[-1] < self._known_s:
                # Answers bear no number: one that is overdue would be taken for the next one's.
                if t_s - self._known_s <= self._timing.answer_s:
                    return None
                self._owed_s.clear()
            self._poll_s = t_s
            self._asked_s = min(self._asked_s, t_s)
            if t_s - self._also_s >= ALSO_S:
                self._also_s = t_s
                self._queue.extend(self._protocol.also)
            return self._protocol.ask
        return None

    def _take(self, answer: Answer, t_s: float) -> None:
        pending = self._pending
        if answer.kind == protocols.POSITION:
            self._take_position(answer, t_s)
        elif answer.kind == protocols.LIMITS and answer.angles_deg:
            low_az, high_az, low_el, high_el = map(math.radians, answer.angles_deg)
            self._state_capabilities(((low_az, low_el), (high_az, high_el)))
        elif answer.kind == protocols.REFUSED:
            self._refused = answer.text
            self.losses[f"refused ({answer.text})"] += 1
        elif answer.kind == protocols.ALARM:
            self._alarm = answer.text
        elif answer.kind == protocols.NOISE:
            self.losses["noise"] += 1
        if answer.kind in (protocols.REFUSED, pending[0].answer if pending else ""):
            self._pending = None

    def _take_position(self, answer: Answer, t_s: float) -> None:
        # The device measured between the request and the answer; one that nobody requested is as
        # old as answers usually are.
        if self._owed_s:
            self._latency_s = t_s - self._owed_s.popleft()
        else:
            self.losses["late answer"] += 1
        first, second = (math.radians(angle) for angle in answer.angles_deg)
        before, self._known_s, self._asked_s = self._reading, t_s, math.inf
        half_s = 0.5 * self._latency_s
        self._reading = DriveReading(
            t_s=t_s + self._set_s - half_s, within_s=half_s, position_rad=(first, second),
            alarm=self._alarm, status=self._refused,
        )  # fmt: skip
        # A position came after it: from now on it is an old answer.
        self._refused = ""
        self._kept.answers()
        self.problem = ""
        can, protocol = self.capabilities, self._protocol
        stated = self._resolution_deg, can.has_elevation
        if (protocol.resolution_deg, protocol.has_elevation) != stated:
            self._state_capabilities(can.travel_rad)
        if self._stopped and before is not None and t_s - self._stop_s > STOP_AGAIN_S:
            places = self._reading.position_rad, before.position_rad
            rows = zip(*places, self.capabilities.resolution_rad, strict=True)
            self._stop_due = any(abs(a - b) > SETTLED_STEPS * step for a, b, step in rows)
