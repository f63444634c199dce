"""An antenna on a real drive: the control unit in front of any `Drive`.

A drive that takes rates is moved by the position laws, as the simulated plants are.  One that takes
positions gets the feasible motion of the preprocessor as set points; its watch and every threshold
of the control unit then follow from its resolution, its speed and the time between two readings.
"""

import dataclasses
import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from rf_pointing.core import AXES, Array, Boresight, JointReading, JointTrajectory, Pair
from rf_pointing.core.signals import LONGEST_GAP_S
from rf_pointing.drives import Capabilities, Drive, DriveParams, DriveReading, Rotator
from rf_pointing.planning import PositionLimits, PositionWatch
from rf_pointing.servo import PlantParams
from rf_pointing.station.antenna.axes import Following
from rf_pointing.station.antenna.control_unit import AntennaStatus, ControlUnit
from rf_pointing.station.antenna.loops import BY_DRIVE, LoopParams
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.mount import SimulatedBeam
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams

CONNECT_S = 5.0
"""Longest wait for the first reading of a device."""
LOOK_S = 0.01
MOVED_RAD = math.radians(10.0)
"""As for the wrap file: a device that was lost and reads so far away may have lost its turn."""
SETTLED_STEPS = 1.1
SAME_RAD = 1e-6
LATE_S = 0.1
"""Time between two looks from which on it does not count as waiting for the device."""
KEPT_RATE_S = 0.1
"""Longest time at the rate of the last tick after which the commanded motion goes on as it was."""
EDGE_RAD = math.radians(0.1)
"""By which the travel of the laws exceeds that of the mount: a device may end where it does."""


class DriveHardware:
    """A drive as the hardware of a control unit; once a tick `look` comes first."""

    settled_rad: float

    def __init__(self, drive: Drive, params: DriveParams, names: Sequence[str] = AXES) -> None:
        can = drive.capabilities
        self.drive, self.rotator = drive, Rotator(drive, params.rotator)
        self.takes_positions = can.set_points == "position"
        self.powered = False
        self._watch = PositionWatch(_limits(can, params), names)
        self._longest_s = max(params.link.lost_s, 2.0 * can.period_s)
        self._reason, self._lost, self._t_s = "", "", -math.inf
        self._encoder_rad: Pair = (0.0, 0.0)
        self.sampled_s = self._unseen_s = 0.0
        self._wind_m_s = math.nan
        smallest = max(self.rotator.smallest_rad) if self.takes_positions else max(can.resolution_rad)
        self.settled_rad = max(math.radians(0.02), SETTLED_STEPS * smallest)

    def clock_stepped(self, by_s: float) -> None:
        """Go on with a clock that was stepped: every wait stays as long as it was."""
        # Readings on both sides of the step say nothing about how far apart they are.
        self._watch.reset()
        self.rotator.clock_stepped(by_s)
        self._t_s += by_s
        self._unseen_s += max(0.0, by_s)

    def look(self, t_s: float) -> None:
        """Let the drive work at `t_s`, and check what it reads."""
        if t_s < self._t_s:
            # A clock that goes back says nothing about how fast the device moves.
            self._watch.reset()
        # Time in which nobody looked is not silence of the device.
        late_s, self._t_s = max(0.0, t_s - self._t_s), t_s
        self._unseen_s += late_s if late_s > LATE_S else 0.0
        rotator = self.rotator
        before, newest = rotator.position_rad, rotator.reading
        was_lost = self._lost
        new = rotator.step(t_s)
        self._unseen_s = 0.0 if new else self._unseen_s
        seen_s = t_s - max(late_s, self._unseen_s)
        self._lost = self.drive.problem or self._silent(seen_s, rotator.reading)
        self.sampled_s = 0.0
        if was_lost:
            # As little do readings on both sides of an outage.
            self._watch.reset()
        if new and rotator.reading is not None:
            self.sampled_s = max(0.0, rotator.reading.t_s - newest.t_s) if newest is not None else 0.0
            moved_rad = rotator.position_rad[0] - before[0]
            one_turn = self.drive.capabilities.one_turn
            if newest is not None and was_lost and one_turn and abs(moved_rad) > MOVED_RAD:
                self._reason = (
                    f"azimuth moved by {math.degrees(moved_rad):.1f} deg while the drive was lost, "
                    f"at most {math.degrees(MOVED_RAD):.1f} deg: look at the cables, then reset"
                )
            elif self.takes_positions:
                self._encoder_rad, self._reason = self._watch.step(
                    rotator.reading.t_s, rotator.position_rad, rotator.set_point_rad,
                    rotator.latency_s, rotator.reading.within_s,
                )  # fmt: skip
                if self._encoder_rad != rotator.position_rad:
                    rotator.correct(self._encoder_rad)
            else:
                self._encoder_rad = rotator.position_rad

    def _silent(self, t_s: float, reading: DriveReading | None) -> str:
        """Return why the reading is too old to be trusted, "" if it is not."""
        if reading is None:
            return "the drive has given no position yet"
        # The device answered at the end of the time in which it may have measured.
        age_s, most_s = reading.age_s(t_s) - reading.within_s, self._longest_s
        return f"no position from the drive for {age_s:.2f} s, at most {most_s:.2f} s" if age_s > most_s else ""

    @property
    def lag_s(self) -> float:
        """Age of the newest sample of a drive of rates, as far as it may be silent."""
        reading = self.rotator.reading
        # A device that takes positions is estimated between two readings.
        return (
            0.0 if reading is None or self.takes_positions else min(max(reading.age_s(self._t_s), 0.0), self._longest_s)
        )

    @property
    def current(self) -> bool:
        """Whether there is a reading that is not too old."""
        return not self._lost

    @property
    def fault(self) -> str:
        """Why the drives must be cut: a lost device, its own alarm, or what its watch found."""
        reading = self.rotator.reading
        alarm = f"drive: {reading.alarm}" if reading is not None and reading.alarm else ""
        return (f"drive lost: {self._lost}" if self._lost else "") or alarm or self._reason

    @property
    def velocity_rad_s(self) -> Array:
        """Rates (2,) of the axes, measured over the last second where there is no tachometer."""
        # A lost drive has no known rate; the last one would persist.
        return np.zeros(2) if self._lost else np.array(self.rotator.rate_rad_s)

    @property
    def switch_rad(self) -> Pair:
        """Angles for the hard limits: those of the encoders, there are no others."""
        return self.rotator.position_rad

    @property
    def at_stop(self) -> tuple[bool, bool]:
        """Which axis is at a limit switch, by the device."""
        reading = self.rotator.reading
        return (False, False) if reading is None else reading.at_limit

    def encoders(self) -> Pair:
        """Return the angles of the axes now; between two readings those of a device on its way."""
        if not self.takes_positions:
            return self._encoder_rad
        return self.rotator.estimate(self._t_s) if self.powered and not self._reason else self._encoder_rad

    def note_wind(self, speed_m_s: float) -> None:
        """Take a reading of the station's anemometer, which is not part of the drive."""
        self._wind_m_s = speed_m_s

    def anemometer_m_s(self) -> float:
        """Return the reading since the last call, NaN without one."""
        speed, self._wind_m_s = self._wind_m_s, math.nan
        return speed

    def move(self, rate_command_rad_s: Array, following: Following | None = None) -> None:
        """Give a powered drive its rates, or the set point that the motion needs now."""
        if not self.powered:
            return
        if not self.takes_positions:
            first, second = rate_command_rad_s.tolist()
            self.drive.turn((first, second))
        elif following is not None:
            self.rotator.follow(self._t_s, *following)

    def brake(self) -> None:
        """Stop the device and set its brakes where there are any; it gets no set points."""
        self.powered = False
        self.rotator.stop()

    def release_brake(self, _held_axis: int = -1) -> None:
        """Power the device; what was found before is forgotten.

        A device has one stop for both axes: an axis to be held gets no other set point or rate.
        """
        self.powered, self._reason = True, ""
        self._watch.reset()
        self.drive.enable()

    @property
    def doubt(self) -> str:
        """Why the angles cannot be trusted to hold there, "" if they can."""
        return "the last angle jumped, the next one must confirm it" if self._watch.doubted else ""

    def place(self, azimuth_rad: float) -> None:
        """Take the turn of a one-turn azimuth from outside."""
        self.rotator.place(azimuth_rad)
        self._watch.reset()
        self._encoder_rad = self.rotator.position_rad


class DriveAntenna(ControlUnit):
    """A control unit on a drive: `enable` it, `accept` trajectories, and `step` it once a tick.

    The drive must have given its first reading by `t_s` (`wait_for_drive`).  ValueError names what
    the drive cannot do: travel or rates beyond its own, or a law that it does not run.
    """

    def __init__(self, params: AntennaParams, drive: Drive, t_s: float) -> None:
        self.params, self.drive_params, self._names = params.antenna, params.drive, params.safety.kinematics.axes
        self._beam = SimulatedBeam(
            params.mount, params.antenna.lag_averaging_s, params.antenna.tick_s, params.safety.kinematics
        )
        self._truth_rad: Array | None = None
        self.hardware = DriveHardware(drive, params.drive, self._names)
        self.hardware.look(t_s)
        if self.hardware.rotator.reading is None:
            raise ValueError(self.hardware.fault)
        self._require_able(params.loops)
        super().__init__(
            self.hardware, self._suited_loops(params.loops), params.plant,
            suited_safety(params.safety, drive.capabilities, params.antenna.tick_s),
            params.antenna.tick_s, self.hardware.encoders(),
        )  # fmt: skip

    def status(self, t_s: float) -> AntennaStatus:
        """Return the status at `t_s`, with what the device was sent."""
        counts = self.hardware.rotator.counts
        (first, second), (back, down) = counts.starts, counts.reversals
        return dataclasses.replace(
            super().status(t_s), set_points=counts.commands, starts=(first, second), reversals=(back, down)
        )

    def accept(self, trajectory: JointTrajectory, now_s: float, commander: str = "") -> str:
        held = self.mode == AntennaMode.HOLDING
        refused = super().accept(trajectory, now_s, commander)
        if held and not refused:
            self.hardware.rotator.count_anew()
        return refused

    def reset_fault(self) -> str:
        return self.hardware.doubt or super().reset_fault()

    def resume(self) -> str:
        return self.hardware.doubt or super().resume()

    def step(self, t_s: float) -> tuple[JointReading | None, Boresight | None]:
        """Return the joints at `t_s` (None: the drive is lost) and where it really is, if known."""
        passed_s = t_s - self.t_s
        self.hardware.look(t_s)
        spare_s, positions = 2.0 * self.params.tick_s, self.hardware.takes_positions
        # A rotator goes on to its set point meanwhile, a drive of rates at its rate.
        if not 0.0 < passed_s <= (LONGEST_GAP_S if positions else KEPT_RATE_S) + spare_s:
            passed_s = self.params.tick_s
            self.axes.regain()
        reading = self.tick(t_s, passed_s)
        truth = self.hardware.drive.truth_rad
        boresight = None
        if truth is not None:
            axes_rad = np.add(truth, self.drive_params.rotator.zero_rad)
            before, self._truth_rad = self._truth_rad, axes_rad
            rate_rad_s = np.zeros(2) if before is None else (axes_rad - before) / passed_s
            boresight = self._beam.boresight(t_s, axes_rad, rate_rad_s)
        return (reading if self.hardware.current else None), boresight

    def place(self, azimuth_rad: float) -> None:
        """Take the turn of a one-turn azimuth from outside, with the axes at rest."""
        self.hardware.place(azimuth_rad)
        self.axes.encoder_rad = np.array(self.hardware.encoders())
        self.axes.hold()

    def clock_stepped(self, by_s: float) -> None:
        super().clock_stepped(by_s)
        self.hardware.clock_stepped(by_s)

    def deactivate(self) -> None:
        """Stop the device at once, and set its brakes where it has any."""
        self.stop()
        self.rest(AntennaMode.INACTIVE)
        self.hardware.look(self.t_s)

    def close(self) -> None:
        """Stop the device and release it."""
        self.hardware.brake()
        self.hardware.drive.close()

    def check(self, plant: PlantParams, loops: LoopParams) -> None:
        """Raise ValueError, saying why, if `retune` would refuse these; changes nothing."""
        self._require_able(loops)
        self.axes.check(self._suited_loops(loops), plant)

    def retune(self, plant: PlantParams, loops: LoopParams) -> None:
        """Take new laws and limits without a jump; all or, with ValueError, none."""
        self.check(plant, loops)
        self.axes.retune(self._suited_loops(loops), plant)

    def _suited_loops(self, loops: LoopParams) -> LoopParams:
        """Return the laws for this drive: one that takes positions closes the loop itself."""
        motion = loops.preprocessor
        rows = zip(self._travel_rad(), motion.travel_min_rad, motion.travel_max_rad, strict=True)
        (low_az, high_az), (low_el, high_el) = ((max(low, a), min(high, b)) for (low, high), a, b in rows)
        motion = motion.replace(travel_min_rad=(low_az, low_el), travel_max_rad=(high_az, high_el))
        loops = loops.replace(preprocessor=motion)
        return loops.replace(law=BY_DRIVE) if self.hardware.takes_positions else loops

    def _travel_rad(self) -> list[Pair]:
        """Return what the drive reaches of each axis, by its parameters and by the device."""
        can, rotator = self.hardware.drive.capabilities, self.drive_params.rotator
        found = list(zip(rotator.travel_min_rad, rotator.travel_max_rad, strict=True))
        if not can.has_elevation:
            found[1] = -math.inf, math.inf
        for axis, (low, high) in enumerate(found):
            # What a device states of a folded azimuth is not travel.
            if can.travel_rad is not None and not (axis == 0 and (can.one_turn or rotator.takes_one_turn)):
                zero = rotator.zero_rad[axis]
                found[axis] = max(low, can.travel_rad[0][axis] + zero), min(high, can.travel_rad[1][axis] + zero)
        return found

    def _require_able(self, loops: LoopParams) -> None:
        can, limits = self.hardware.drive.capabilities, loops.preprocessor
        if loops.law == BY_DRIVE and not self.hardware.takes_positions:
            raise ValueError(f"loops.law={BY_DRIVE} needs a drive that takes positions, this one takes rates")
        for axis, name in enumerate(self._names):
            low, high = self._travel_rad()[axis]
            wanted = limits.travel_min_rad[axis], limits.travel_max_rad[axis]
            if wanted[0] < low - EDGE_RAD - SAME_RAD or wanted[1] > high + EDGE_RAD + SAME_RAD:
                raise ValueError(
                    f"{name} travel {_degrees(*wanted)} (loops.preprocessor) must be within that of the drive, "
                    f"{_degrees(low, high)} (drive.rotator.travel and what the device states)"
                )
            if limits.rate_limit_rad_s[axis] > can.rate_rad_s[axis] + SAME_RAD:
                raise ValueError(
                    f"{name} rate {math.degrees(limits.rate_limit_rad_s[axis]):.3f} deg/s (loops.preprocessor) "
                    f"must be <= {math.degrees(can.rate_rad_s[axis]):.3f} deg/s of the drive"
                )


def suited_safety(safety: SafetyParams, can: Capabilities, tick_s: float) -> SafetyParams:
    """Return the limits of trust with thresholds above the steps and delays of this drive."""
    step, rate = max(can.resolution_rad), max(can.rate_rad_s)
    # One step beyond a limit may be a rounding of the reading.
    gate = safety.gate.replace(hard_rad=min(max(safety.gate.hard_rad, 1.5 * step), 0.5))
    # Between two readings of a drive that takes rates the tachometer alone goes on.
    stale = step + (rate * can.period_s if can.period_s > tick_s else 0.0)
    watch = safety.watch.replace(
        jump_rad=min(max(safety.watch.jump_rad, 2.0 * stale), 1.0),
        drift_rad=min(max(safety.watch.drift_rad, 2.0 * stale), 1.0),
        frozen_rad=min(max(safety.watch.frozen_rad, 2.0 * stale), 1.0),
    )
    drive = safety.drive.replace(delay_s=min(max(safety.drive.delay_s, can.latency_s), 1.0))
    return safety.replace(gate=gate, watch=watch, drive=drive)


def wait_for_drive(drive: Drive, now_s: Callable[[], float], patience_s: float = CONNECT_S) -> None:
    """Let a drive connect until it has given a position; ValueError says why it has not."""
    begun_s = time.monotonic()
    while drive.step(now_s()) is None:
        if time.monotonic() - begun_s > patience_s:
            raise ValueError(f"drive: {drive.problem or 'no position'}, waited {patience_s:g} s")
        time.sleep(LOOK_S)


def connected_antenna(params: AntennaParams, drive: Drive, begun_s: float, patience_s: float) -> DriveAntenna:
    """Return the antenna on a drive once that has answered.

    Raises
    ------
    ValueError
        For a drive that does not answer, or cannot do what the parameters require.
    """
    steady_s = time.monotonic()

    def now_s() -> float:
        # Simulated time does not go on while this waits.
        return begun_s + time.monotonic() - steady_s

    wait_for_drive(drive, now_s, patience_s)
    return DriveAntenna(params, drive, now_s())


def _limits(can: Capabilities, params: DriveParams) -> PositionLimits:
    return PositionLimits(
        resolution_rad=can.resolution_rad,
        rate_rad_s=can.rate_rad_s,
        dead_band_rad=params.rotator.dead_band_rad,
        period_s=can.period_s,
        # A network that loses a set point sends it again.
        **({"busy_s": params.link.lost_s} if params.type == "topic" else {}),
    )


def _degrees(low: float, high: float) -> str:
    return f"{math.degrees(low):.1f} to {math.degrees(high):.1f} deg"
