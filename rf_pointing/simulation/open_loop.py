"""Recorded inputs once more through the parts of a station, each part alone: its loop stays open.

    samples, powers, axes, status  ->  trackers       ->  pointing errors
    targets, axes, errors          ->  controller     ->  trajectories
    trajectories                   ->  control unit   ->  axes (of a simulated antenna)

Each part gets what was recorded, not what the part before it gives now: a difference belongs to the
part that shows it.  The order of the inputs is that of `pass_simulation.py`.
"""

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from rf_pointing.calibration import ReferenceTrack
from rf_pointing.calibration.reference import COLUMNS
from rf_pointing.core import (
    JointReading,
    JointTrajectory,
    PointingError,
    Sensor,
    Target,
    nearest_turn_rad,
)
from rf_pointing.core.types import Array
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.ephemeris.look_angles import LookAngles
from rf_pointing.simulation.closed_loop import TARGET_LEAD_S, ticks
from rf_pointing.simulation.pass_simulation import StationSetup
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.tracking import MonopulseTracker
from rf_pointing.tracking.sensors import SENSORS

LONGEST_GAP_S = 1.0
"""Gap of a recorded stream that is named: over it a loop is not what was recorded."""


@dataclass
class Signals:
    """Signals of one antenna by topic, each list in order of its times.

    An item of `joint_trajectory` is (time of its period, trajectory); statuses need the fields that
    a message of them has.
    """

    topics: dict[str, list[Any]] = field(default_factory=dict)

    def take(self, topic: str, signal: Any) -> None:
        """Add a signal, as `simulate_pass` sends it."""
        self.topics.setdefault(topic, []).append(signal)

    def of(self, topic: str) -> list[Any]:
        """Return the signals of a topic, none where it was not recorded."""
        return self.topics.get(topic, [])

    def missing(self, *topics: str) -> str:
        """Return which of these topics are not there, "" for none."""
        return ", ".join(topic for topic in topics if not self.of(topic))

    def gaps(self, topic: str, start_s: float, end_s: float) -> list[tuple[float, float]]:
        """Return begin and length of each gap of a stream within a time."""
        times = [t_s for t_s in map(time_of, self.of(topic)) if start_s <= t_s <= end_s]
        return [(a, b - a) for a, b in pairwise(times) if b - a > LONGEST_GAP_S]


def time_of(signal: Any) -> float:
    """Return the time of a signal; that of a trajectory's period."""
    found = signal[0] if isinstance(signal, tuple) else signal.t_s
    # A cluster has the times of its samples, and is stamped with the last.
    return float(np.ravel(found)[-1])


class RecordedTrack(TopocentricTrack):
    """The target as `target` messages tell it, between them by a quintic polynomial.

    Before the first and after the last it stands still: nothing is tracked there.
    """

    def __init__(self, targets: list[Target], place: TopocentricTrack) -> None:
        # Without the base's own: nothing of the target but these messages is known, and neither
        # its motion in space nor its offsets are there.
        self.name, self.site, self.refraction = targets[0].name, place.site, place.refraction
        # A publisher that was started again has sent some instants twice.
        rows = {round(each.t_s, 6): each for each in targets}
        known = [rows[t_s] for t_s in sorted(rows)]
        columns: dict[str, Any] = {
            name: np.array([getattr(each, name) for each in known])
            for name in (*COLUMNS, "refraction_rad", "satellite_gain_db")
        }
        # A target that crosses north jumps by a turn, which no polynomial may follow.
        columns["azimuth_rad"] = np.unwrap(columns["azimuth_rad"])
        self._further = columns.pop("refraction_rad"), columns.pop("satellite_gain_db")
        self._reference, self._shift = ReferenceTrack(**columns), (np.zeros(1), np.zeros((1, 2)))

    def shifted(self, t_s: Array, offset_rad: Array) -> "RecordedTrack":
        """Return the track moved on the sky by (n, 2), cross-elevation and elevation, at (n,)."""
        # A copy: the controller goes on predicting by the track as it was sent.
        moved = RecordedTrack.__new__(RecordedTrack)
        moved.__dict__ |= self.__dict__ | {"_shift": (t_s, offset_rad)}
        return moved

    def sample(self, t_s: Any) -> LookAngles:
        """Return the directions at UTC times (n,)."""
        times = np.asarray(t_s, dtype=np.float64)
        known = self._reference.t_s
        # With both ends, since a track has two points at least; each time once, rising.
        inside = np.clip([*known[[0, -1]], *times], known[0], known[-1])
        among, rows = np.unique(inside, return_inverse=True)
        at = self._reference.at(among)
        refraction, gain = (np.interp(times, known, column) for column in self._further)
        right, up = (np.interp(times, self._shift[0], column) for column in self._shift[1].T)
        look = {name: getattr(at, name)[rows[2:]] for name in COLUMNS}
        look["t_s"] = times
        # Rates stay those of the prediction: what tracking adds changes slowly.
        look["azimuth_rad"] = look["azimuth_rad"] + right / np.cos(look["elevation_rad"])
        look["elevation_rad"] = look["elevation_rad"] + up
        return LookAngles(
            true_elevation_rad=look["elevation_rad"] - refraction, satellite_gain_db=gain, **look
        )  # fmt: skip

    def target_at(self, t_s: float, *, near_azimuth_rad: float = np.pi) -> Target:
        """Return the direction at `t_s`, its azimuth nearest to `near_azimuth_rad`."""
        look = self.sample(np.array([t_s]))
        names = LookAngles.__dataclass_fields__
        numbers: dict[str, Any] = {name: float(getattr(look, name)[0]) for name in names}
        numbers["refraction_rad"] = numbers["elevation_rad"] - numbers.pop("true_elevation_rad")
        numbers["azimuth_rad"] = nearest_turn_rad(numbers["azimuth_rad"], near_azimuth_rad)
        return Target(name=self.name, **numbers)


def sensed_errors(setup: StationSetup, signals: Signals) -> list[PointingError]:
    """Return what the trackers make of the recorded samples, powers, axes and status."""
    monopulse = MonopulseTracker(setup.sets(SENSORS[Sensor.MONOPULSE].node)[Sensor.MONOPULSE])
    carrier, found = setup.power_tracker(), list[PointingError]()
    # The order of a tick: status of the period, axes, then what was received.
    order = ("tracking_status", "joint_states", Sensor.MONOPULSE.value, "carrier_power")
    streams = enumerate(map(signals.of, order))
    inputs = [(time_of(each), rank, each) for rank, stream in streams for each in stream]
    for _, rank, each in sorted(inputs, key=lambda item: item[:2]):
        if rank == 0:
            centre_rad = np.array(each.scan_centre_rad)
            carrier.take_status(each.t_s, centre_rad, each.offset_rad, each.mode, each.sensor)
        elif rank == 1:
            carrier.take_joints(each)
        elif rank == 2:
            found.append(monopulse.measure(each))
        else:
            found += carrier.take_power(each)
    return found


def commanded(
    setup: StationSetup, signals: Signals, window: Pass, sensor: str, track: TopocentricTrack
) -> list[tuple[float, JointTrajectory]]:  # fmt: skip
    """Return the trajectories that the controller makes of the recorded targets, axes and errors.

    It starts a period before the first status of the pass, and gets the axes of the period before.
    """
    controller = setup.controller()
    period_s = controller.params.pointing.period_s
    busy = [each.t_s for each in signals.of("tracking_status") if each.target]
    if not busy:
        raise ValueError("tracking_status tells of no pass: the controller has nothing to do")
    topics = ("joint_states", "target", "pointing_error")
    joints, targets, errors = (_Stream(signals.of(topic)) for topic in topics)
    # A recording may begin within the pass: the certificate needs the axes all the same.
    readings = joints.until(busy[0]) or signals.of("joint_states")[:1]
    before: JointReading = readings[0]
    controller.take_joints(before)
    own = setup.sets("ephemeris_publisher")["uncertainty"]
    law = None if isinstance(track, RecordedTrack) else own
    controller.plan.take_profiles([pass_profile(track, window, law=law)])
    controller.start(round(busy[0] - period_s, 6), window, sensor)
    found = []
    for status in (each for each in signals.of("tracking_status") if each.t_s >= busy[0]):
        controller.take_joints(before)
        before = [before, *readings, *joints.until(status.t_s)][-1]
        readings = []
        for target in targets.until(round(status.t_s + TARGET_LEAD_S, 6)):
            controller.take_target(target)
        # One of this period is not used in it, whenever it came.
        for error in errors.until(status.t_s):
            controller.take_error(error)
        trajectory, _ = controller.step(status.t_s)
        if trajectory is not None:
            found.append((status.t_s, trajectory))
    return found


class _Stream:
    """Signals in order of their times, given once each."""

    def __init__(self, signals: list[Any]) -> None:
        self._signals = sorted(signals, key=time_of)
        self._times, self._next = [time_of(each) for each in self._signals], 0

    def until(self, t_s: float) -> list[Any]:
        """Return what has come up to a time and was not given before."""
        first, self._next = self._next, max(self._next, bisect_right(self._times, t_s))
        return self._signals[first : self._next]


class FollowedAntenna:
    """A simulated antenna that follows recorded trajectories; tick `k` is that of reading k."""

    def __init__(self, antenna: SimulatedAntenna, signals: Signals) -> None:
        self.antenna, self.statuses = antenna, list[Any]()
        self.times = [each.t_s for each in signals.of("joint_states")]
        # By their times: a trajectory is taken in the tick in which it was sent.
        self._given = {round(t_s, 6): each for t_s, each in signals.of("joint_trajectory")}
        self._reported = {round(each.t_s, 6) for each in signals.of("antenna_status")}
        antenna.enable()

    def step(self, k: int) -> JointReading:
        """Move through a tick, then take the trajectory that was sent at its time.

        The first reading is that of the activation, before the first tick.
        """
        t_s = self.times[k]
        reading = self.antenna.step(t_s)[0] if k else self.antenna.reading(t_s)
        if t_s in self._reported:
            self.statuses.append(self.antenna.status(t_s))
        if t_s in self._given:
            self.antenna.accept(self._given[t_s], t_s)
        return reading


def followed(antenna: SimulatedAntenna, signals: Signals) -> tuple[list[JointReading], list[Any]]:
    """Return readings and statuses of a simulated antenna that follows the recorded commands."""
    follower = FollowedAntenna(antenna, signals)
    readings = [reading for _, reading in ticks(follower, len(follower.times))]
    return readings, follower.statuses
