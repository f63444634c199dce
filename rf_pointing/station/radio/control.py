"""The brain of `radio_control`: tunes both rigs, and lets the transmitter send or not.

Orders of clients arrive from `drives/rigctld.py`: a tuning within the passband, and the key.  With
a reason against sending the key is refused; a transmitter that sends nevertheless, by a client or
at its microphone, is unkeyed with the next step or message that brings the reason.
"""

import math
from collections.abc import Callable

from rf_pointing.core import Pair, Target
from rf_pointing.drives.line_server import INVALID, IO_ERROR, REJECTED, Inquiry, LineServer
from rf_pointing.drives.params import LinkParams
from rf_pointing.drives.rigctld import RECEIVE, TRANSMIT, RadioView, Rig
from rf_pointing.station.description.content import RadioSection, RigSection
from rf_pointing.station.pointing.status import Level, Report
from rf_pointing.station.radio.frequencies import Channel, Dial, Motion, Shifts
from rf_pointing.station.radio.inhibit import Antenna, TransmitLine, TransmitRules

RESTING = "radio_control is not active"
PERIOD_S = 0.02
STEP_SHARE = 1e-8
"""Largest step of a tuning, relative: 10 Hz at 1 GHz.  A rig that is slower is named."""
LONGEST_ANSWER_S = 0.25
SHORTEST_WAIT_S, LONGEST_WAIT_S = 0.001, 0.01
"""Between two tunings; a low orbit moves 1 GHz by up to 400 Hz/s: 4 Hz from one to the next."""
ANY = "any"
UNKEY_AGAIN_S = 0.1
TRIES = 3
"""Times that a transmitter is unkeyed before it counts as one that cannot be."""


class RadioControl:
    """Steps both rigs; `say` takes words for the operator.

    `inhibit` is "" while the transmitter may send, else why not.  Times `t_s` are UTC, `wall_s`
    steady.
    """

    def __init__(
        self, radio: RadioSection, rules: TransmitRules, view: RadioView,
        say: Callable[[str], object] = str, make_rig: Callable[..., Rig] = Rig,
    ) -> None:  # fmt: skip
        self._radio, self._rules, self.view, self._say = radio, rules, view, say
        known = radio.transponders.items()
        self._channels = {name.casefold(): Channel.of(each) for name, each in known}
        receive, transmit = radio.receive, radio.transmit
        self._receive_dial = Dial(receive or RigSection())
        self._transmit_dial = Dial(transmit or RigSection())
        places = [(rig.host, rig.port) for rig in (receive, transmit) if rig]
        split = len(places) == 2 and places[0] == places[1]
        self._receiver = make_rig(_link(receive), sends=split, split=split) if receive else None
        apart = transmit if not split else None
        self._transmitter = make_rig(_link(apart), sends=True) if apart else None
        # The transmitter first: it is unkeyed first.
        self._rigs = [each for each in (self._transmitter, self._receiver) if each]
        if split:
            self._transmitter = self._receiver
        self._transmit_command = TRANSMIT if split else RECEIVE
        self._line = TransmitLine(radio.transmit_line)
        self.antenna = Antenna()
        self._motion = Motion()
        self._above_hz: dict[str, float] = {}
        """Where in the passband each satellite is used."""
        self._active, self.inhibit = False, RESTING
        self._sun_rad: Pair | None = None
        self._t_s = self._wall_s = 0.0
        self._unkeyed_s, self._tries, self.unkeyed = -math.inf, 0, 0

    # What is known

    def note_target(self, target: Target) -> None:
        """Take where the target will be."""
        self._motion.take(target)

    def note(self, topic: str, wall_s: float, **known: object) -> None:
        """Take fields of `Antenna` from a message, and unkey at once if they say so."""
        for name, value in known.items():
            setattr(self.antenna, name, value)
        self.antenna.heard_s[topic] = wall_s
        self._decide(wall_s)

    @property
    def reason(self) -> str:
        """Why the key is refused, "" while it is not."""
        return self.inhibit or self._line.problem

    # Orders

    def order(self, inquiry: Inquiry, t_s: float) -> None:
        """Carry out the order of a client; its reply may come later."""
        order = inquiry.order
        if order.name != "set_ptt":
            split = order.name == "set_split_freq"
            inquiry.reply(self._retune(order.values[0], split, t_s, inquiry.client))
        elif not order.values[0]:
            self._key(False, inquiry.reply)
        elif self.reason:
            self._say(f"{inquiry.client}: the key is refused: {self.reason}")
            inquiry.reply(REJECTED)
        else:
            self._key(True, inquiry.reply)

    def _key(self, on: bool, reply: Callable[[int], object] = int) -> None:
        if self._transmitter is None:
            reply(REJECTED)
        else:
            self._transmitter.key(on, self._wall_s, reply)

    def _retune(self, dial_hz: float, split: bool, t_s: float, client: str) -> int:
        """Move to another point of the passband; return 0 or an error code."""
        channel, shifts = self._channel(), self._motion.at(t_s)
        if channel is None or shifts is None:
            return IO_ERROR
        if split and channel.up_hz is None:
            return REJECTED
        if split:
            uplink_hz = self._transmit_dial.frequency_hz(dial_hz, channel.up_hz or 0.0) / shifts.up
            above_hz = channel.above_hz(uplink_hz)
        else:
            received_hz = self._receive_dial.frequency_hz(dial_hz, channel.down_hz)
            above_hz = received_hz / shifts.down - channel.down_hz
        # A client may give back what it has read, a step of the dial and a moment later.
        if abs(above_hz) > channel.half_hz + 100.0:
            self._say(f"{client}: {dial_hz:.0f} Hz is {above_hz:.0f} Hz from the middle of the passband of "
                      f"{self._motion.name}, must be within {channel.half_hz:.0f} Hz")  # fmt: skip
            return INVALID
        self._above_hz[self._motion.name] = min(max(above_hz, -channel.half_hz), channel.half_hz)
        return 0

    # Periodic work

    def step(self, t_s: float, wall_s: float, sun_rad: Pair | None) -> None:
        """Tune, key, and set the line, as is due now."""
        self._active, self._sun_rad = True, sun_rad
        self.follow(t_s, wall_s)
        self._decide(wall_s)
        self.view.keyed = self._transmitter is not None and bool(self._transmitter.keyed)

    def follow(self, t_s: float, wall_s: float) -> None:
        """Tune again if a rig has answered; between two steps, a slow rig waits for less."""
        if not self._active:
            return
        self._wall_s = wall_s
        self._tune(t_s)
        for rig in self._rigs:
            rig.step(wall_s)

    def wait_s(self, wall_s: float) -> float:
        """Return the time until `follow` is due: a slow rig gets its next tuning at its answer."""
        slow = [rig.due_s(wall_s) for rig in self._rigs if rig.answer_s > LONGEST_WAIT_S]
        return min(max(min(slow, default=math.inf), SHORTEST_WAIT_S), LONGEST_WAIT_S)

    def rest(self, wall_s: float) -> None:
        """Unkey, and take the line down, until the next step."""
        self._active = False
        self._decide(wall_s)

    def close(self) -> None:
        """Unkey, and release rigs and line."""
        self._active = False
        self._line.close()
        for rig in self._rigs:
            rig.close()

    def _tune(self, t_s: float) -> None:
        channel, self._t_s = self._channel(), t_s
        receive, transmit = (self._shifts(rig, t_s) for rig in (self._receiver, self._transmitter))
        if channel is None or receive is None or transmit is None:
            self.view.receive_hz = self.view.transmit_hz = None
            return
        shifts = Shifts(receive.down, transmit.up)
        receive_hz, transmit_hz = self.frequencies_hz(channel, shifts)
        dial_hz = self._receive_dial.of(receive_hz)
        self.view.receive_hz = dial_hz
        self.view.transmit_hz = None if transmit_hz is None else self._transmit_dial.of(transmit_hz)
        if self._receiver is not None:
            self._receiver.tune(RECEIVE, dial_hz)
        if self._transmitter is not None and self.view.transmit_hz is not None:
            self._transmitter.tune(self._transmit_command, self.view.transmit_hz)

    def _shifts(self, rig: Rig | None, t_s: float) -> Shifts | None:
        """Return the shifts in the middle of the time for which a tuning holds."""
        answer_s = min(rig.answer_s, LONGEST_ANSWER_S) if rig else 0.0
        # It begins somewhere until the answer, and ends with the next one.
        return self._motion.at(t_s + 0.5 * (answer_s + max(LONGEST_WAIT_S, answer_s)))

    def _slow(self, rig: Rig) -> str:
        """Say how large the steps are where they are too large, else ""."""
        now, later = self._motion.at(self._t_s), self._motion.at(self._t_s + 1.0)
        if now is None or later is None:
            return ""
        step = abs(later.down - now.down) * max(LONGEST_WAIT_S, rig.answer_s)
        if step <= STEP_SHARE:
            return ""
        took = f"the rig takes {1e3 * rig.answer_s:.0f} ms for each"
        return f" in steps of {1e9 * step:.0f} Hz at 1 GHz: {took}"

    def frequencies_hz(self, channel: Channel, shifts: Shifts) -> tuple[float, float | None]:
        """Return the frequencies on the air at the station, received and sent."""
        above_hz = self._above_hz.get(self._motion.name, 0.0)
        uplink_hz = channel.uplink_hz(above_hz)
        sent_hz = None if uplink_hz is None else uplink_hz * shifts.up
        return (channel.down_hz + above_hz) * shifts.down, sent_hz

    def _channel(self) -> Channel | None:
        return self._channels.get(self._motion.name.casefold()) or self._channels.get(ANY)

    def _decide(self, wall_s: float) -> None:
        """Find whether the transmitter may send; unkey it at once where it may not."""
        self._wall_s, before = wall_s, self.inhibit
        self.inhibit = self._reason(wall_s)
        self._line.step(not self.inhibit, wall_s)
        rig = self._transmitter
        again = wall_s - self._unkeyed_s > UNKEY_AGAIN_S
        if self.inhibit and rig is not None and rig.keyed and again:
            self._unkeyed_s, self._tries, self.unkeyed = wall_s, self._tries + 1, self.unkeyed + 1
            self._say(f"the transmitter is unkeyed: {self.inhibit}")
            rig.key(False, wall_s)
        elif rig is None or not rig.keyed:
            self._tries = 0
        if bool(before) != bool(self.inhibit):
            barred = f"the transmitter may not send: {self.inhibit}"
            self._say(barred if self.inhibit else "the transmitter may send")

    def _reason(self, wall_s: float) -> str:
        if not self._active:
            return RESTING
        channel = self._channel()
        if self._radio.transmit is None:
            return "the station has no transmitter (radio.transmit)"
        if channel is None or channel.up_hz is None:
            return f"no uplink is known of {self._motion.name or 'the target'} (radio.transponders)"
        if self._transmitter is not None and self._transmitter.problem:
            return self._transmitter.problem
        return self._rules.reason(self.antenna, self._motion.name, self._sun_rad, wall_s)

    # Reports

    def reports(self, server: LineServer | None) -> dict[str, Report]:
        """Return the checks of both rigs, of the key, and of the clients."""
        found = {"receiver": self._rig(self._receiver, RECEIVE, self.view.receive_hz)}
        command, sent_hz = self._transmit_command, self.view.transmit_hz
        found["transmitter"] = self._rig(self._transmitter, command, sent_hz)
        values: dict[str, object] = {"keyed": self.view.keyed, "unkeyed": self.unkeyed}
        values["line"] = self._line.problem or "ok"
        level, words = Level.OK, self.inhibit or "may send"
        if self._tries > TRIES:
            level, words = Level.ERROR, f"the transmitter sends although it may not: {self.inhibit}"
        elif self._line.problem:
            level, words = Level.ERROR, self._line.problem
        found["transmit"] = Report(level, words, values)
        clients = server.values() if server is not None else {}
        found["clients"] = Report(Level.OK, "served" if clients else "not served", clients)
        return found

    def _rig(self, rig: Rig | None, command: str, wanted_hz: float | None) -> Report:
        if rig is None:
            return Report(Level.OK, "not controlled", {})
        values: dict[str, object] = {
            "wanted_hz": wanted_hz, "tuned_hz": rig.tuned_hz.get(command), "answer_ms": round(1e3 * rig.answer_s, 1),
            "largest_step_hz": round(rig.step_hz, 1), **rig.losses,
        }  # fmt: skip
        if rig.problem:
            return Report(Level.ERROR, rig.problem, values)
        if rig.refused:
            return Report(Level.WARN, "refused: " + "; ".join(rig.refused.values()), values)
        if wanted_hz is None:
            name, known = self._motion.name, self._channel() is not None
            why = "is not predicted now" if known else "is not in radio.transponders"
            words = f"no frequency: {name or 'no target'} {why}"
            return Report(Level.WARN if name else Level.OK, words, values)
        return Report(Level.OK, f"follows {self._motion.name}{self._slow(rig)}", values)


def _link(rig: RigSection) -> LinkParams:
    return LinkParams(host=rig.host, port=rig.port, longest_retry_s=5.0)
