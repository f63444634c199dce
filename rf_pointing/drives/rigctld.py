"""Both sides of rigctld's protocol: a rig of Hamlib that is tuned and keyed, and programs that ask.

    F Hz  set_freq   I Hz  set_split_freq   T 1  set_ptt   S 1 VFOB  set_split_vfo   V  set_vfo
    f     get_freq   i     get_split_freq   t    get_ptt   s         get_split_vfo   v  get_vfo

`Rig` speaks the extended form, whose answers name their command.  One command is on its way at a
time, but for the key, which never waits for an answer.
"""

import math
import re
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from rf_pointing.drives import line_server as door
from rf_pointing.drives.link import KeptLink
from rf_pointing.drives.params import LinkParams
from rf_pointing.drives.protocols import LONGEST_LINE, refused_text

KEY_POLL_S = 0.05
"""A rig may be keyed at its microphone: its key is read so often."""
ASK_S = 1.0
HIGHEST_HZ = 4e11
FORGOTTEN = 0.995
"""Share of the largest step that is left after the next one."""
RECEIVE, TRANSMIT = "F", "I"


class Rig:
    """A rig behind rigctld, kept at its frequencies; `sends` is one whose key counts.

    `tuned_hz` are the frequencies that it has accepted, by command, `keyed` whether it sends, None
    where it cannot tell.  `problem` is why it does not answer, "" while it does.
    """

    def __init__(self, params: LinkParams, *, sends: bool = False, split: bool = False) -> None:
        self._kept, self._timing = KeptLink("rigctld", params, 0), params
        self.sends, self._split = sends, split
        self.losses: Counter[str] = Counter()
        self.refused: dict[str, str] = {}
        """Why the rig refused the last command of a kind, by its name."""
        self.tuned_hz: dict[str, float] = {}
        self.keyed: bool | None = None
        self.answer_s = self.step_hz = 0.0
        """Time of the last answer to a tuning; largest step of the last hundreds of tunings."""
        self._wanted_hz: dict[str, float] = {}
        self._answered_hz: dict[str, float] = {}
        self._buffer = bytearray()
        self._queue: deque[str] = deque()
        self._pending: deque[tuple[str, float]] = deque()
        self._replies: deque[Callable[[int], object]] = deque()
        self._fields: list[str] = []
        self._key_s = self._asked_s = -1e9
        self._polled = False

    @property
    def problem(self) -> str:
        """Why the rig does not answer, "" while it does."""
        return self._kept.problem

    def tune(self, command: str, hertz: float) -> None:
        """Want this frequency of the receiver (F) or of the transmitter in split (I)."""
        self._wanted_hz[command] = hertz

    def key(self, on: bool, t_s: float, reply: Callable[[int], object] = int) -> None:
        """Key or unkey at once; `reply` takes the code of the rig."""
        if self._kept.link is None:
            reply(door.IO_ERROR)
            return
        self._replies.append(reply)
        self._send(f"T {int(on)}", t_s)

    def step(self, t_s: float) -> None:
        """Take what has arrived and send what is due, without waiting; `t_s` is steady time."""
        if self._kept.step(t_s):
            self._begin(t_s)
        if self._kept.link is None:
            return
        try:
            self._buffer += self._kept.link.read()
        except OSError as error:
            self._lose(t_s, f"the link is lost: {error}")
            return
        *lines, rest = bytes(self._buffer).split(b"\n")
        self._buffer = bytearray(rest)
        for line in lines:
            self._take(line.strip().decode("ascii", errors="replace"), t_s)
        if len(rest) > LONGEST_LINE or len(self._fields) > LONGEST_LINE:
            shown = door.shown(rest.decode(errors="replace"))
            self._lose(t_s, f"it answers without an end: {shown}")
        elif self._pending and t_s - self._pending[0][1] > self._timing.lost_s:
            sent, sent_s = self._pending[0]
            self._lose(t_s, f"no answer to {_name(sent)} for {t_s - sent_s:.1f} s")
        elif not self._pending and (line_now := self._next(t_s)):
            self._send(line_now, t_s)

    def due_s(self, t_s: float) -> float:
        """Return the time until the answer under way is due, as long as the one before took."""
        return self._pending[0][1] + self.answer_s - t_s if self._pending else math.inf

    def close(self) -> None:
        """Unkey and release the rig."""
        if self.sends and self._kept.link is not None:
            self._send("T 0", 0.0)
        self._kept.close()

    def _begin(self, t_s: float) -> None:
        self._buffer.clear()
        self._pending.clear()
        self._fields.clear()
        self._answered_hz.clear()
        self.refused.clear()
        self._queue = deque(["S 1 VFOB"] if self._split else [])
        # Whatever it did without this program: it does not send.
        if self.sends:
            self.key(False, t_s)

    def _lose(self, t_s: float, why: str) -> None:
        self.losses["connection"] += 1
        self._kept.lose(t_s, why)
        self.keyed = None
        self.tuned_hz.clear()
        while self._replies:
            self._replies.popleft()(door.IO_ERROR)

    def _next(self, t_s: float) -> str:
        if self._queue:
            return self._queue.popleft()
        wanted = self._wanted_hz
        due = [each for each in wanted if self._answered_hz.get(each) != wanted[each]]
        # A slow rig reads its key and is tuned in turns, and so are its two frequencies.
        polls = self.sends and t_s - self._key_s >= KEY_POLL_S and not (due and self._polled)
        self._polled = polls and "get_ptt" not in self.refused
        if self._polled:
            self._key_s = t_s
            return "t"
        if due:
            command = due[0]
            hertz = wanted[command] = wanted.pop(command)
            return f"{command} {hertz:.0f}" if hertz == round(hertz) else f"{command} {hertz:.1f}"
        if t_s - self._asked_s >= ASK_S:
            self._asked_s = t_s
            return "f"
        return ""

    def _send(self, line: str, t_s: float) -> None:
        assert self._kept.link is not None
        try:
            self._kept.link.write(f"+{line}\n".encode())
        except OSError as error:
            self._lose(t_s, f"the link is lost: {error}")
        else:
            self._pending.append((line, t_s))

    def _take(self, line: str, t_s: float) -> None:
        end = re.fullmatch(r"RPRT (-?[0-9]{1,4})", line)
        if end is None:
            self._fields.append(line)
            return
        fields, self._fields = self._fields, []
        name = fields[0].partition(":")[0] if fields else ""
        if not self._pending or name != _name(self._pending[0][0]):
            self.losses["noise"] += 1
            return
        (sent, sent_s), code = self._pending.popleft(), int(end[1])
        self._kept.answers()
        if code:
            self.refused[name] = refused_text(sent, code)
            self.losses[f"{name} refused"] += 1
        else:
            self.refused.pop(name, None)
        command, _, argument = sent.partition(" ")
        if command in (RECEIVE, TRANSMIT):
            # One that it refuses is not sent again: the next one may be possible.
            self._answered_hz[command], self.answer_s = float(argument), t_s - sent_s
            if not code:
                before_hz = self.tuned_hz.get(command, float(argument))
                self.step_hz = max(FORGOTTEN * self.step_hz, abs(float(argument) - before_hz))
                self.tuned_hz[command] = float(argument)
        elif command == "T":
            self.keyed = None if code else argument == "1"
            self._replies.popleft()(code)
        elif command == "t" and not code:
            self.keyed = fields[-1].rpartition(" ")[2] != "0"


@dataclass(slots=True)
class RadioView:
    """Values that clients may read, in Hz of the dials; None while they are not known."""

    name: str
    receive_hz: float | None = None
    transmit_hz: float | None = None
    keyed: bool = False


class RigWords(door.ServedWords):
    """A rig for programs that ask for the frequencies, tune within the passband, or key."""

    title = "rigctld"
    letters: ClassVar = {
        "F": ("set_freq", 1), "f": ("get_freq", 0), "I": ("set_split_freq", 1), "i": ("get_split_freq", 0),
        "T": ("set_ptt", 1), "t": ("get_ptt", 0), "S": ("set_split_vfo", 2), "s": ("get_split_vfo", 0),
        "V": ("set_vfo", 1), "v": ("get_vfo", 0), "_": ("get_info", 0), "q": ("quit", 0), "Q": ("quit", 0),
    }  # fmt: skip
    names: ClassVar = {"dump_state": 0, "chk_vfo": 0, "get_powerstat": 0}
    of_station = ("set_freq", "set_split_freq", "set_ptt")

    def __init__(self, view: RadioView) -> None:
        self.view = view

    def judged(self, name: str, arguments: list[str]) -> door.Judgement:
        if name not in self.of_station:
            return 0, "", ()
        (text,) = arguments
        if not door.NUMBER.fullmatch(text) or not 0.0 <= float(text) <= HIGHEST_HZ:
            must = f"must be a number from 0 to {HIGHEST_HZ:g}"
            return door.INVALID, f"{name} {door.shown(text)} {must}", ()
        return 0, "", (float(text),)

    def fields(self, order: door.Order) -> door.Fields | None:
        view = self.view

        def dial(label: str, hertz: float | None) -> door.Fields | None:
            return None if hertz is None else door.labelled((label, f"{hertz:.0f}"))

        known: dict[str, door.Fields | None] = {
            "get_freq": dial("Frequency", view.receive_hz),
            "get_split_freq": dial("TX Frequency", view.transmit_hz),
            "get_ptt": door.labelled(("PTT", int(view.keyed))),
            "get_info": door.labelled(("Info", view.name)),
            "get_powerstat": door.labelled(("Power Status", 1)),
            "chk_vfo": door.labelled(("ChkVFO", 0)),
            # The two VFOs are what they are: receive and transmit.
            "get_vfo": door.labelled(("VFO", "VFOA")),
            "get_split_vfo": door.labelled(("Split", 1), ("TX VFO", "VFOB")),
            "dump_state": tuple((line, line) for line in _STATE),
        }
        return known.get(order.name, ())


def _name(line: str) -> str:
    """Return the name of the command of a line."""
    return RigWords.letters[line[0]][0]


# Version 0 of Hamlib's form: model and region, ranges of receiver and transmitter, steps, filters,
# RIT, XIT, IF shift, announces, preamplifiers, attenuators, functions, levels and parameters.
_RANGE, _END = f"0.000000 {HIGHEST_HZ:.6f} 0x1ff -1 -1 0x3 0x1", "0 0 0 0 0 0 0"
_STATE = (
    "0", "2", "0", _RANGE, _END, _RANGE, _END, "0x1ff 1", "0 0", "0 0", *["0"] * 4, "", "",
    *["0x0"] * 6,
)  # fmt: skip
