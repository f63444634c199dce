"""One pass of the station without ROS: the parts of the graph, wired by function calls.

The order within a tick is the order in which messages arrive in the graph: antenna, receiver,
tracker; the controller acts every few ticks, on errors stamped before its own period.
"""

import copy
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.core import PointingError, Sensor
from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.core.types import Array
from rf_pointing.drives import make_drive, simulated, takes_positions
from rf_pointing.ephemeris import ElementUncertainty, Pass, TopocentricTrack
from rf_pointing.ephemeris.learned_times import LearnedTimes
from rf_pointing.ephemeris.source import load_track
from rf_pointing.planning import Certificate
from rf_pointing.receiver.registry import SAMPLES as SAMPLED
from rf_pointing.servo import WindParams, WindSource
from rf_pointing.simulation.closed_loop import PointedAntenna, ticks
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.radio import SampledReceiver, SimulatedRadio, seeded
from rf_pointing.station.antenna.receiver import Reception, SimulatedReceiver
from rf_pointing.station.antenna.simulated_antenna import (
    AntennaParams,
    SimulatedAntenna,
    SimulatedHardware,
)
from rf_pointing.station.derive.axes import feed_model, kinematics_of
from rf_pointing.station.description import DEFAULT_STATION, StationDescription, read_station
from rf_pointing.station.description.description import require_known
from rf_pointing.station.parameters import wider_band
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.tracking import MonopulseTracker
from rf_pointing.tracking.power_tracker import (
    NODE,
    CarrierTracker,
    PowerTracker,
    PowerTrackerParams,
)
from rf_pointing.tracking.scan_program import ScanProgramParams
from rf_pointing.tracking.sensors import SENSORS, load_trackers

EARLY_TARGET_S = 5.0
"""How long before acquisition of signal the first target is, still below the horizon."""


@dataclass
class PassLog:
    """True error and mode per cluster, trajectories' first points, certificate; in rad."""

    t_s: list[float] = field(default_factory=list)
    cross_elevation_rad: list[float] = field(default_factory=list)
    elevation_rad: list[float] = field(default_factory=list)
    mode: list[str] = field(default_factory=list)
    carrier_to_noise_db_hz: list[float] = field(default_factory=list)
    command_t_s: list[float] = field(default_factory=list)
    command_rad: list[tuple[float, float]] = field(default_factory=list)
    certificate: Certificate | None = None
    bands: list[tuple[float, str]] = field(default_factory=list)
    """Times at which another band went on with the pass."""
    fault: str = ""
    """The fault that was latched at the end, "" without one."""
    ended: str = ""
    """Why the controller has ended the pass, "" where the log ends before."""
    learned: str = ""
    """The time along the orbit that the pass has taught, in words."""

    def errors_rad(self, *modes: str) -> Array:
        """Return the true errors (n, 2) of the clusters in these modes (all when none is named)."""
        wanted = np.array([not modes or mode in modes for mode in self.mode], dtype=bool)
        errors: Array = np.column_stack([self.cross_elevation_rad, self.elevation_rad])[wanted]
        return errors


class StationSetup:
    """Everything a run needs: a station, one of its bands, and what this run changes.

    Parameters
    ----------
    station
        A description, the name of a shipped one, or the path of a user's file.
    band
        The station's default band if None.
    changes
        Dotted names per node, over everything else: an experiment may change any of them.
    files
        Parameter files of the nodes; what the station gives is refused in them.
    model
        Bias model in place of the station's: a file, or `BiasModel.zero()` for none.
    tracker
        Measures the carrier power in place of the package's trackers: one of your own, which is
        registered (`tracking.sensors.register`).
    array
        Measures each reception with an array on the dish, the sensor `array`.
    wind
        Makes the wind of each simulated antenna in place of the description's gusts.
    truth
        Where the satellite really is, in place of the receiver's `source`.

    Raises
    ------
    ValueError
        For a description with problems, an unknown band, and a parameter in a file that the
        description gives.
    """

    def __init__(
        self,
        station: StationDescription | str | Path = DEFAULT_STATION,
        band: str | None = None,
        *,
        changes: Mapping[str, Mapping[str, object]] | None = None,
        files: Sequence[Path] = (),
        model: BiasModel | Path | None = None,
        tracker: CarrierTracker | None = None,
        array: Callable[[Reception], PointingError] | None = None,
        wind: Callable[[WindParams], WindSource] | None = None,
        truth: TopocentricTrack | None = None,
    ) -> None:
        load_trackers()
        self.station = station if isinstance(station, StationDescription) else read_station(station)
        self.station.require_mount("simulate")
        self.band = self.station.default_band if band is None else band
        self._tracker, self.array, self._wind, self._truth = tracker, array, wind, truth
        self.changes: dict[str, dict[str, object]] = defaultdict(dict)
        """Values that files and experiment put over the description, by node and dotted name."""
        for node, given in read_parameter_files(files).items():
            self.station.check_file(node, given, self.band)
            self.changes[node] |= given
        for node, values in (changes or {}).items():
            require_known(node, values)
            self.changes[node] |= values
        chosen = self.station.bias_model_file(self.band) if model is None else model
        if not isinstance(chosen, BiasModel):
            chosen = (
                read_model(chosen).model if chosen else feed_model(self.station.content, self.band)
            )
        self.model = chosen.on(self.sets("pointing_controller")["kinematics"])

    def sets(self, node: str) -> dict[str, Any]:
        """Return the parameter sets of one node by their prefix: description, files and changes."""
        return self.station.sets(node, self.band, self.changes[node])

    @property
    def sensor(self) -> str:
        """The station's default sensor in this band."""
        return self.station.chosen_sensor(band=self.band)

    def track(self) -> TopocentricTrack:
        """Return the target as the station predicts it."""
        return load_track(self.sets("ephemeris_publisher")["source"])

    def in_band(self, band: str) -> "StationSetup":
        """Return the same run in another band of the station, with that band's model."""
        other = copy.copy(self)
        other.band, file = band, self.station.bias_model_file(band)
        model = read_model(file).model if file else feed_model(self.station.content, band)
        other.model = model.on(other.sets("pointing_controller")["kinematics"])
        return other

    def antenna(self, hardware: SimulatedHardware | None = None) -> SimulatedAntenna | DriveAntenna:
        """Return the simulated antenna; a drive that takes positions is simulated as a rotator.

        `hardware` is that of an antenna whose control unit starts again.
        """
        params = AntennaParams(**self.sets("antenna_servo"))
        drive = simulated(params.drive)
        if not takes_positions(drive.type):
            antenna = SimulatedAntenna(params, hardware)
            if self._wind is not None:
                antenna.hardware.blow(self._wind(params.wind))
            return antenna
        return DriveAntenna(
            params.replace(drive=drive), make_drive(drive, params.antenna.start_rad), 0.0
        )

    def receiver(self) -> SimulatedReceiver | SampledReceiver:
        """Return the simulated receiver, which receives the satellite where it really is.

        Where the station's receiver takes samples, it is the meter of a simulated radio's.
        """
        sets = self.sets("rf_receiver")
        signal, real = sets["signal"], self._truth or load_track(sets["source"])
        mount = kinematics_of(self.station.content)
        taken = self.sets("signal_receiver")["receiver"]
        if taken.type not in SAMPLED:
            return SimulatedReceiver(signal, real, mount)
        radio = seeded(self.sets("signal_source")["sdr"], signal.seed)
        return SampledReceiver(SimulatedRadio(signal, radio, real, mount), taken, self.track())

    def controller(self) -> PointingController:
        """Return the pointing controller with its model."""
        own = ControllerParams(**self.sets("pointing_controller"))
        # A tracker of one's own measures one band.
        given = self._tracker is not None or self.array is not None
        controller = PointingController(
            own, None if given else wider_band(self.station, self.band, self.changes)
        )
        controller.take_model(self.model)
        return controller

    def power_tracker(self) -> CarrierTracker:
        """Return the tracker of the carrier power."""
        if self._tracker is not None:
            return self._tracker
        return PowerTracker(PowerTrackerParams(**self.sets(NODE)))


def merged(*changes: Mapping[str, Mapping[str, object]] | None) -> dict[str, dict[str, object]]:
    """Return changes by node and dotted name, the last ones over the first ones."""
    found: dict[str, dict[str, object]] = {}
    for each in changes:
        for node, values in (each or {}).items():
            found[node] = found.get(node, {}) | dict(values)
    return found


def simulate_pass(
    setup: StationSetup,
    window: Pass,
    start_t_s: float,
    sensor: str = "",
    on_reception: Callable[[Reception], object] | None = None,
    scan: ScanProgramParams | None = None,
    on_signal: Callable[[str, Any], object] | None = None,
    track: TopocentricTrack | None = None,
    enough: Callable[[PassLog], bool] | None = None,
) -> PassLog:
    """Return the log of one pass, from `start_t_s` (time to slew included) to loss of signal.

    Without a `sensor` the station's default one tracks.  `on_reception` is called with every
    reception.  With a `scan` program track is scanned by it, and the log ends with the scan.
    `on_signal` is called with the topic of the graph and every signal that would be sent on it.
    The controller predicts by the `track`, by default that of the setup.  The log ends before the
    pass where it is `enough`.
    """
    given, sensor = track, setup.station.chosen_sensor(sensor, setup.band)
    track = given or setup.track()
    send = on_signal or (lambda _topic, _signal: None)
    publisher = setup.sets("ephemeris_publisher")
    lesson = LearnedTimes(publisher["publisher"].learned_file)
    law: ElementUncertainty | None = None if given is not None else publisher["uncertainty"]
    # A track of the caller's is what it is: no law of elements, and nothing learned of them.
    believed = lesson.applied(track, window.tca_t_s, law) if law is not None else track
    if sensor == Sensor.ARRAY and setup.array is None:
        raise ValueError(
            "sensor=array needs an array: what measures the receptions with it is not given"
        )
    antenna, receiver, controller = setup.antenna(), setup.receiver(), setup.controller()
    monopulse = MonopulseTracker(setup.sets(SENSORS[Sensor.MONOPULSE].node)[Sensor.MONOPULSE])
    carrier = setup.power_tracker()
    # Before the controller starts: its certificate begins at the axes' present angles.
    antenna.enable()
    log = PassLog()
    pointed = PointedAntenna(
        antenna, controller, believed, start_t_s, window.aos_t_s - EARLY_TARGET_S, law
    )
    controller.plan.take_profiles([pass_profile(believed, window, law=law)])
    controller.start(start_t_s, window, sensor, scan)
    send("joint_states", antenna.reading(start_t_s))
    log.certificate = controller.plan.certificate
    mode = controller.state.mode
    for _, tick in ticks(
        pointed, round((window.los_t_s - start_t_s) / antenna.params.tick_s) - 1, first=1
    ):
        status, trajectory = tick.status, tick.trajectory
        if status is not None:
            # A cluster is noted under the mode of the newest period before its end.
            mode = status.mode
            if (held := status.held_direction) is not None:
                lesson.take(held)
            carrier.take_status(
                status.t_s, status.scan_centre_rad, status.offset_rad, status.mode, status.sensor
            )
            send("antenna_status", antenna.status(tick.t_s))
            send("tracking_status", status)
            if tick.target is not None:
                send("target", tick.target)
        if trajectory is not None:
            log.command_t_s.append(float(trajectory.t_s[0]))
            log.command_rad.append(
                (float(trajectory.position_rad[0, 0]), float(trajectory.position_rad[0, 1]))
            )
            send("joint_trajectory", (tick.t_s, trajectory))
        # Every tick, not only in a period: the circle of a scan is read off the encoders.
        carrier.take_joints(tick.reading)
        send("joint_states", tick.reading)
        reception = receiver.take(tick.boresight)
        if reception is not None:
            # Before the next period, as on the graph: only errors stamped before it are used.
            errors = [*carrier.take_power(reception.power)]
            if setup.array is not None:
                errors.insert(0, setup.array(reception))
            if reception.cluster is not None:
                errors.insert(0, monopulse.measure(reception.cluster))
                send(Sensor.MONOPULSE, reception.cluster)
            send("carrier_power", reception.power)
            send("sim/pointing_error", reception.truth)
            for error in errors:
                controller.take_error(error)
                send("pointing_error", error)
            log.t_s.append(reception.truth.t_s)
            log.cross_elevation_rad.append(reception.truth.cross_elevation_rad)
            log.elevation_rad.append(reception.truth.elevation_rad)
            log.carrier_to_noise_db_hz.append(reception.truth.carrier_to_noise_db_hz)
            log.mode.append(mode)
            if on_reception is not None:
                on_reception(reception)
        if status is not None and (band := controller.wanted_band):
            # Between two periods: what was received belongs to the band before.
            other = setup.in_band(band)
            receiver, carrier = other.receiver(), other.power_tracker()
            monopulse = MonopulseTracker(
                other.sets(SENSORS[Sensor.MONOPULSE].node)[Sensor.MONOPULSE]
            )
            if isinstance(antenna, SimulatedAntenna):
                antenna.hardware.bend(other.sets("antenna_servo")["mount"])
            controller.go_on_in_band(status.t_s, band)
            controller.take_model(other.model)
            log.bands.append((status.t_s, band))
        if (scan is not None and not controller.busy) or (enough is not None and enough(log)):
            break
    if law is not None:
        log.learned = lesson.end_pass(track, law)
    log.fault, log.ended = antenna.safety.latch.text, controller.statistics.reason
    return log
