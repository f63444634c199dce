"""Whether the transmitter may send, and the line that says so to its hardware.

The reasons against it, in this order: what a station that is not known cannot allow, the antenna's
own (mode, fault, elevation), the horizon mask and the Sun for where the beam is, the pointing
error, and the EIRP that a sector of the sky may get.
"""

import math
import os
from dataclasses import dataclass, field

import serial

from rf_pointing.core import LEVEL, OF_ANTENNA, Kinematics, Mode, Pair, Params, parameter
from rf_pointing.operations.partners import CONTACT_S
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.station.description.content import RadioSection

AGAIN_S = 1.0
"""A line is set again after so long, whoever else has set it."""
NOT_ON_TARGET = (Mode.IDLE, Mode.SLEW, Mode.SEARCH, Mode.CALIBRATE)


@dataclass(frozen=True, kw_only=True)
class InhibitParams(Params):
    """When the transmitter may not send."""

    most_error_beamwidths: float = parameter(
        0.5, "largest pointing error with the transmitter on, in half-power beamwidths", 0.01, 10.0
    )
    silence_s: float = parameter(0.5, "antenna and controller may be silent for so long", 0.15, 5.0)


@dataclass(slots=True)
class Antenna:
    """State of the station, from its messages; `heard_s` are the steady times of the last ones."""

    axes_rad: Pair = (0.0, 0.0)
    inhibit: str = ""
    fault: str = ""
    shares: bool = False
    executive_inhibit: str = ""
    mode: str = Mode.IDLE
    target: str = ""
    error_rad: float = 0.0
    beamwidth_rad: float = 1.0
    heard_s: dict[str, float] = field(default_factory=dict)


HEARD = {
    "joint_states": "antenna_servo (joint_states)",
    "antenna_status": "antenna_servo",
    "tracking_status": "pointing_controller",
}
"""Who is silent without a topic."""


class TransmitRules:
    """The reasons of one station."""

    def __init__(
        self, params: InhibitParams, radio: RadioSection, sky: ForbiddenSky,
        mount: Kinematics = LEVEL,
    ) -> None:  # fmt: skip
        self._params, self._radio, self._sky, self._mount = params, radio, sky, mount

    def reason(self, antenna: Antenna, target: str, sun_rad: Pair | None, wall_s: float) -> str:
        """Return "" when the transmitter may send to `target`, else why not."""
        for topic, name in HEARD.items():
            if wall_s - antenna.heard_s.get(topic, -math.inf) > self._params.silence_s:
                return f"{name} is silent"
        if antenna.fault or antenna.inhibit:
            return antenna.inhibit or OF_ANTENNA + antenna.fault
        if antenna.shares:
            late = wall_s - antenna.heard_s["executive_status"] > CONTACT_S
            silent = "station_executive is silent: a partner may transmit" if late else ""
            if reason := silent or antenna.executive_inhibit:
                return reason
        if antenna.mode in NOT_ON_TARGET:
            return f"the controller is not on a target: {antenna.mode}"
        if antenna.target != target:
            return f"{antenna.target} is tracked, and the radio is on {target}"
        # Mask, Sun and sectors are on the sky, and axes over the top are folded below.
        level = self._mount.level
        beam_rad = antenna.axes_rad if level else self._mount.sky_at(*antenna.axes_rad)
        if reason := self._sky.reason(*beam_rad, None, sun_rad):
            return reason
        most_rad = self._params.most_error_beamwidths * antenna.beamwidth_rad
        if antenna.error_rad > most_rad:
            error_deg, most_deg = math.degrees(antenna.error_rad), math.degrees(most_rad)
            return f"pointing error {error_deg:.3f} deg exceeds {most_deg:.3f} deg"
        return self._sector(*map(math.degrees, beam_rad))

    def _sector(self, azimuth_deg: float, elevation_deg: float) -> str:
        # Over the top the beam is on the other side of the sky.
        if elevation_deg > 90.0:
            azimuth_deg, elevation_deg = azimuth_deg + 180.0, 180.0 - elevation_deg
        eirp_dbw = self._radio.eirp_dbw
        for first, last, below, most_dbw in self._radio.eirp_sectors:
            inside = (azimuth_deg - first) % 360.0 <= (last - first) % 360.0
            if inside and elevation_deg < below and eirp_dbw > most_dbw:
                return (
                    f"EIRP {eirp_dbw:g} dBW exceeds {most_dbw:g} dBW, allowed below {below:g} deg at azimuth "
                    f"{first:g} to {last:g} deg"
                )
        return ""


class TransmitLine:
    """A line that is high while the transmitter may send, low otherwise and at the end.

    `where` is a file that takes 1 and 0, as a GPIO does, or a line of a serial port, as in
    `/dev/ttyUSB1:rts` or `:dtr`.  A wire that breaks, and a computer without power, leave the
    transmitter off.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self.problem = ""
        self._port: serial.Serial | None = None
        self._set: bool | None = None
        self._set_s = -math.inf

    def step(self, allowed: bool, t_s: float) -> None:
        """Set the line where it is not set, or has been for long; `t_s` is steady time."""
        if not self._where or (allowed == self._set and 0.0 <= t_s - self._set_s <= AGAIN_S):
            return
        self._set, self._set_s = allowed, t_s
        try:
            self._write(allowed)
        except (OSError, ValueError) as error:
            self.problem = f"the transmit line {self._where} cannot be set: {error}"
            if self._port is not None:
                self._port.close()
            self._port = None
        else:
            self.problem = ""

    def close(self) -> None:
        """Take the line down for good."""
        self.step(False, math.inf)
        if self._port is not None:
            self._port.close()

    def _write(self, allowed: bool) -> None:
        path, _, name = self._where.rpartition(":")
        if name not in ("rts", "dtr"):
            # Not the usual open: a pipe that nobody reads would hold up the station.
            file = os.open(self._where, os.O_WRONLY | os.O_NONBLOCK)
            try:
                os.write(file, b"1\n" if allowed else b"0\n")
            finally:
                os.close(file)
            return
        if self._port is None:
            # Before it is opened, or the kernel raises both lines with the port.
            port = serial.Serial()
            port.port, port.rts, port.dtr, port.exclusive = path, False, False, True
            port.open()
            self._port = port
        setattr(self._port, name, allowed)
