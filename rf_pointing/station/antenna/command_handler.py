"""What becomes of a command: taken, with the way to it, or refused by the mode, the authority, the table or the gate."""

from rf_pointing.core import JointTrajectory
from rf_pointing.station.antenna.axes import AntennaAxes, pair
from rf_pointing.station.antenna.modes import AntennaModes
from rf_pointing.station.antenna.safety import AntennaSafety

__all__ = ["CommandHandler"]


class CommandHandler:
    """The commands of one antenna: how many were `accepted` and `rejected`, and why the `last_rejection` was."""

    def __init__(self, axes: AntennaAxes, modes: AntennaModes, safety: AntennaSafety) -> None:
        self.accepted = self.rejected = 0
        self.last_rejection = ""
        self._axes, self._modes, self._safety = axes, modes, safety

    def accept(self, trajectory: JointTrajectory, now_s: float, commander: str = "") -> str:
        """Take a command of `commander`; return "" or why it was rejected: then only the count has changed."""
        table, safety = self._axes.course.table, self._safety
        refused = (
            self._modes.refusal_of_command()
            or safety.authority.conflict(commander, now_s)
            or table.refusal(trajectory, now_s)
            or self._take_way(trajectory, now_s)
        )
        if refused:
            return self.reject(refused)
        table.accept(trajectory, now_s)
        safety.authority.claim(commander, now_s)
        self.accepted += 1
        safety.note_command(now_s)
        azimuth, elevation = trajectory.position_rad[-1].tolist()
        safety.latch.note_command((now_s, commander, azimuth, elevation))
        self._modes.follow()
        return ""

    def reject(self, reason: str) -> str:
        """Count a command that could not be used, and return the reason."""
        self.rejected += 1
        self.last_rejection = reason
        return reason

    def _take_way(self, trajectory: JointTrajectory, now_s: float) -> str:
        """Pass a command through the gate and note the way to it; return "" or the refusal: then nothing has changed."""
        course, used = self._axes.course, self._axes.used_rad
        present, positions = pair(used), trajectory.position_rad
        refused = self._safety.check("track", now_s, present, positions).reason
        if refused:
            return refused
        if course.leaves(trajectory, used, following=self._modes.mode in ("tracking", "paused")):
            decision = self._safety.check("preset", now_s, present, positions[:1])
            if not decision.allowed:
                return decision.reason
            course.take_way(decision.way)
        return ""
