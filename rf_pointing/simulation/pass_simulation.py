"""One pass of the simulated station without ROS: the same parts as the graph, wired by function calls.

The order within a tick is the order in which messages arrive in the graph: antenna, receiver, tracker; the controller
acts every few ticks, on errors stamped before its own period.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.core import PointingError
from rf_pointing.core.parameter_files import NodeParameters, read_parameter_files
from rf_pointing.ephemeris import Pass
from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.planning import Certificate
from rf_pointing.servo import WindParams, dss13_plant
from rf_pointing.station.antenna.mount import MountParams
from rf_pointing.station.antenna.receiver import Reception, SignalParams, SimulatedReceiver
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, LoopParams, SimulatedAntenna
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.tracking import MonopulseParams, MonopulseTracker, StepTrackParams
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.power_tracker import CarrierTracker, PowerTracker
from rf_pointing.tracking.sensors import load_trackers

__all__ = ["PassLog", "StationSetup", "simulate_pass"]

Array = NDArray[np.float64]
TARGET_LEAD_S = 2.0


@dataclass
class PassLog:
    """True error and mode, one row per cluster; the first point of every trajectory; the certificate; angles in rad."""

    t_s: list[float] = field(default_factory=list)
    cross_elevation_rad: list[float] = field(default_factory=list)
    elevation_rad: list[float] = field(default_factory=list)
    mode: list[str] = field(default_factory=list)
    carrier_to_noise_db_hz: list[float] = field(default_factory=list)
    command_t_s: list[float] = field(default_factory=list)
    command_rad: list[tuple[float, float]] = field(default_factory=list)
    certificate: Certificate | None = None

    def errors_rad(self, *modes: str) -> Array:
        """Return the true errors (n, 2) of the clusters in these modes (all when none is named)."""
        wanted = np.array([not modes or mode in modes for mode in self.mode], dtype=bool)
        errors: Array = np.column_stack([self.cross_elevation_rad, self.elevation_rad])[wanted]
        return errors


class StationSetup:
    """Everything a run needs, from the nodes' parameter files; `changes` are dotted keys per node over the files.

    `tracker` measures the carrier power in place of the package's trackers: one of your own, which is registered
    (`tracking.sensors.register`).
    """

    def __init__(
        self,
        files: Sequence[Path],
        model: Path | None,
        changes: Mapping[str, Mapping[str, object]] | None = None,
        tracker: CarrierTracker | None = None,
    ) -> None:
        load_trackers()
        self._tracker = tracker
        self._nodes = read_parameter_files(files)
        for node, values in (changes or {}).items():
            self.node(node).values.update(values)
        self.model = read_model(model).model if model else BiasModel.zero()

    def node(self, name: str) -> NodeParameters:
        """Return what the files say to one node."""
        return self._nodes.setdefault(name, NodeParameters(name, {}))

    def antenna(self) -> SimulatedAntenna:
        """Return the simulated antenna."""
        node = self.node("antenna_servo")
        return SimulatedAntenna(
            node.group("antenna", AntennaParams()),
            node.group("plant", dss13_plant()),
            node.group("loops", LoopParams()),
            node.group("wind", WindParams()),
            node.group("mount", MountParams()).model(),
            node.group("safety", SafetyParams()),
        )

    def receiver(self) -> SimulatedReceiver:
        """Return the simulated receiver, which hears the satellite where it really is."""
        node = self.node("rf_receiver")
        return SimulatedReceiver(node.group("signal", SignalParams()), load_track(node.group("source", SourceParams())))

    def controller(self) -> PointingController:
        """Return the pointing controller with its model."""
        node = self.node("pointing_controller")
        sets = ControllerParams().sets()
        read = {name: node.group(name, defaults) for name, defaults in sets.items()}
        controller = PointingController(ControllerParams().replace(**read))
        controller.take_model(self.model)
        return controller

    def power_tracker(self) -> CarrierTracker:
        """Return the tracker of the carrier power."""
        if self._tracker is not None:
            return self._tracker
        node = self.node("conscan_tracker")
        return PowerTracker(node.group("conscan", ConscanParams()), node.group("steptrack", StepTrackParams()))


def simulate_pass(
    setup: StationSetup,
    window: Pass,
    start_t_s: float,
    sensor: str,
    heard: Callable[[Reception], object] | None = None,
) -> PassLog:
    """Return the log of one pass, from `start_t_s` (time to slew included) to loss of signal.

    `heard` is called with everything that the receiver gives.
    """
    track = load_track(setup.node("ephemeris_publisher").group("source", SourceParams()))
    antenna, receiver, controller = setup.antenna(), setup.receiver(), setup.controller()
    monopulse = MonopulseTracker(setup.node("monopulse_tracker").group("monopulse", MonopulseParams()))
    conscan = setup.power_tracker()
    tick_s, period_s = antenna.params.tick_s, controller.params.pointing.period_s
    every = round(period_s / tick_s)
    antenna.modes.enable()
    log = PassLog()
    known = antenna.reading(start_t_s)
    controller.take_joints(known)
    controller.plan.take_profiles([pass_profile(track, window)])
    controller.start(start_t_s, window, sensor)
    log.certificate = controller.plan.certificate
    mode = controller.state.mode
    for tick in range(1, round((window.los_t_s - start_t_s) / tick_s)):
        t_s = round(start_t_s + tick * tick_s, 6)
        reading, boresight = antenna.step(t_s)
        if tick % every == 0:
            # As on the graph, a period knows where the axes were when the one before began.
            controller.take_joints(known)
            known = reading
            if t_s + TARGET_LEAD_S >= window.aos_t_s - 5.0:
                controller.take_target(track.target_at(round(t_s + TARGET_LEAD_S, 6)))
            trajectory, status = controller.step(t_s)
            mode = status.mode
            conscan.take_status(status.t_s, status.scan_centre_rad, status.offset_rad, status.mode, status.sensor)
            if trajectory is not None:
                antenna.commands.accept(trajectory, t_s)
                log.command_t_s.append(float(trajectory.t_s[0]))
                log.command_rad.append((float(trajectory.position_rad[0, 0]), float(trajectory.position_rad[0, 1])))
        conscan.take_joints(reading)
        reception = receiver.take(boresight)
        if reception is not None:
            controller.take_error(monopulse.measure(reception.cluster))
            for error in conscan.take_power(reception.power):
                controller.take_error(error)
            _note(log, reception.truth, mode)
            if heard is not None:
                heard(reception)
    return log


def _note(log: PassLog, truth: PointingError, mode: str) -> None:
    log.t_s.append(truth.t_s)
    log.cross_elevation_rad.append(truth.cross_elevation_rad)
    log.elevation_rad.append(truth.elevation_rad)
    log.mode.append(mode)
    log.carrier_to_noise_db_hz.append(truth.carrier_to_noise_db_hz)
