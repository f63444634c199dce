"""Who may command: the first to speak, until it has been silent for a while; the others are told whose turn it is."""

import math

__all__ = ["Authority"]


class Authority:
    """One commander at a time."""

    def __init__(self, silence_s: float) -> None:
        self._silence_s = silence_s
        self.holder = ""
        self._heard_s = -math.inf

    def conflict(self, name: str, t_s: float) -> str:
        """Return "" if `name` may command at `t_s`, else who holds the authority."""
        if name != self.holder and t_s - self._heard_s <= self._silence_s:
            return f"conflict: {self.holder or 'an unnamed commander'} commands, {name or 'an unnamed one'} is refused"
        return ""

    def claim(self, name: str, t_s: float) -> None:
        """Note that a command of `name` was taken at `t_s`; one that was refused for anything else holds nobody up."""
        self.holder, self._heard_s = name, t_s

    def release(self) -> None:
        """Let the next one to speak command."""
        self.holder, self._heard_s = "", -math.inf
