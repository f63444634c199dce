"""A recording with the station, the target and the wind that it is flown with once more."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.core import AXES, MDEG, STANDBY_ROLE, Array, sky_offset_rad
from rf_pointing.core.parameters import read_parameter_files, to_degrees
from rf_pointing.drives import takes_positions
from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.report.recorded_signals import RecordedPass
from rf_pointing.report.replay_report import SENSED, Flown
from rf_pointing.servo import RecordedWind, WindParams
from rf_pointing.simulation import StationSetup, merged, simulate_pass
from rf_pointing.simulation.open_loop import RecordedTrack, Signals
from rf_pointing.simulation.recorded_gusts import calm, estimated_gusts, missed_gusts_m_s
from rf_pointing.station.antenna.mount import MountParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from rf_pointing.station.derive.nodes import NODES
from rf_pointing.station.description import StationDescription, read_station, shipped_stations
from rf_pointing.station.description.description import OF_EVERY_NODE

_OF_A_NODE = STANDBY_ROLE, "command_key_file", "certificate_folder", "publisher.learned_file"
NOT_OF_THE_PASS = (*OF_EVERY_NODE, *_OF_A_NODE)
SAME_TARGET_RAD, SLOW_S = 1e-9, 10.0
Changes = Mapping[str, Mapping[str, object]]


class RecordedCase:
    """Flies a recorded pass; `remarks` say what of it is not known, `wind` what blows.

    A pass of a simulated antenna is flown by its seed and elements; that of a real one on the
    recorded target, moved by what tracking has added, with a mount as its model describes it.
    """

    def __init__(
        self, path: Path, recorded: RecordedPass, station: str | Path | StationDescription | None
    ) -> None:  # fmt: skip
        self.path, self.recorded, self.remarks = path, recorded, list[str]()
        self.signals, self.window = recorded.signals, recorded.window
        if missing := self.signals.missing("joint_states"):
            raise ValueError(f"{path} holds no {missing}: nothing tells where the antenna was")
        self.simulated = bool(self.signals.of("sim/pointing_error"))
        self.description = self._description(station)
        self.description.require_mount("replay")
        self.band = recorded.recording.notes.get("band") or self.description.default_band
        self.wind = ""
        self._wind: Callable[[WindParams], RecordedWind] | None = None
        self._truth: TopocentricTrack | None = None
        self._given = self._parameters()
        self.start_s = float(self.signals.of("joint_states")[0].t_s)
        statuses = self.signals.of("tracking_status")
        self.beamwidth_rad = float(max(each.half_power_beamwidth_rad for each in statuses))
        self._remark_damage()
        self.seconds = self.window.los_t_s - self.start_s
        self.track = self._track()
        self.recorded_target = isinstance(self.track, RecordedTrack)
        # A simulated satellite is where its own source says, with the offsets of the run.
        if isinstance(self.track, RecordedTrack) and not self.simulated:
            self._truth = self.track.shifted(*self.off_prediction())
        self.servo = AntennaParams(**self.setup().sets("antenna_servo"))
        self.plant = None if takes_positions(self.servo.drive.type) else self.servo.plant

    def _remark_damage(self) -> None:
        digest, used = self.description.digest, self.recorded.digests
        if used and digest not in used:
            known = ", ".join(used)
            self.remarks.append(f"another station or version: digest {digest}, recorded {known}")
        self.remarks += [f"damage: {each}" for each in self.recorded.recording.problems]
        begin_s, end_s = self.window.aos_t_s, self.signals.of("tracking_status")[-1].t_s
        if (lost_s := self.window.los_t_s - end_s) > 1.0:
            self.remarks.append(f"the recording ends {lost_s:.0f} s before the pass")
            self.window = replace(self.window, los_t_s=end_s)
        for topic in ("target", "joint_states", "tracking_status"):
            if gaps := self.signals.gaps(topic, begin_s, end_s):
                at_s, longest_s = max(gaps, key=lambda gap: gap[1])
                longest = f"the longest {longest_s:.1f} s, {at_s - begin_s:.0f} s after acquisition"
                self.remarks.append(f"{topic} has {len(gaps)} gaps, {longest}")

    def _description(self, given: str | Path | StationDescription | None) -> StationDescription:
        if given is not None:
            return given if isinstance(given, StationDescription) else read_station(given)
        if (beside := self._beside("station.yaml")) is not None:
            return read_station(beside)
        name = self.recorded.recording.notes.get("station", "")
        for each in map(read_station, shipped_stations()):
            if each.name == name:
                return each
        why = f"no station.yaml is next to it, and {name!r} is not shipped"
        raise ValueError(f"{self.path}: {why}: give station")

    def _beside(self, name: str) -> Path | None:
        # A bag is a folder or one of its files; `track` puts it into the folder of its run.
        folder = self.path if self.path.is_dir() else self.path.parent
        places = (folder / name, folder.parent / name)
        return next((place for place in places if place.is_file()), None)

    def _parameters(self) -> dict[str, dict[str, object]]:
        """Return the parameters of the recorded run by node."""
        beside = self._beside("run.yaml")
        if beside is None:
            self.remarks.append("no run.yaml next to the bag: seeds and parameters are not known")
        given = read_parameter_files([beside]) if beside is not None else {}
        found: dict[str, dict[str, object]] = {
            node: {name: value for name, value in values.items() if name not in NOT_OF_THE_PASS}
            for node, values in given.items()
            if node in NODES and node != "bias_calibrator"
        }
        if not self.simulated:
            # The errors of a real mount are those that its model takes out, as far as it is good.
            model = (self.recorded.model or BiasModel.zero()).coefficients
            servo = found["antenna_servo"] = dict(found.get("antenna_servo", {}))
            for name in MountParams.__dataclass_fields__:
                edge, value = to_degrees(name, model.get(name.rsplit("_", 1)[0], 0.0))
                servo[f"mount.{edge}"] = value
            standing = np.degrees(self.signals.of("joint_states")[0].position_rad).tolist()
            for axis, angle in zip(AXES, standing, strict=True):
                servo[f"antenna.start_{axis}_deg"] = angle
        return found

    def assume(self, node: str, name: str, value: object) -> None:
        """Take a parameter of the recorded run to be this from now on."""
        self._given.setdefault(node, {})[name] = value

    def setup(
        self, over: Changes | None = None, model: BiasModel | None = None, *,
        truth: TopocentricTrack | None = None,
        wind: Callable[[WindParams], RecordedWind] | None = None,
    ) -> StationSetup:  # fmt: skip
        """Return the station of the recording, with changes, another satellite or wind."""
        # That of the recording: the one in the station's folder may be newer.
        return StationSetup(
            self.description, self.band, changes=merged(self._given, over),
            model=model or self.recorded.model, wind=wind or self._wind, truth=truth or self._truth,
        )  # fmt: skip

    def _track(self) -> TopocentricTrack:
        """Return the target: that of the run's elements where they give what was recorded."""
        targets = self.signals.of("target")
        try:
            track = self.setup().track()
        except (ValueError, OSError) as error:
            if not targets:
                raise ValueError(f"{self.path} holds no target: {error}") from error
            self.remarks.append(f"the target is the recorded one: {error}")
            # Site and refraction of a target that is known are those of the station.
            sun = {"ephemeris_publisher": {"source.satellite": "Sun"}}
            own = StationSetup(self.description, self.band, changes=sun)
            return RecordedTrack(targets, own.track())
        away_rad = 0.0 if self.simulated else math.inf
        for each in targets[:: max(1, len(targets) // 10)] if self.simulated else ():
            ours = track.target_at(each.t_s, near_azimuth_rad=each.azimuth_rad)
            looks = ours.azimuth_rad, ours.elevation_rad, each.azimuth_rad, each.elevation_rad
            away_rad = max(away_rad, float(np.hypot(*np.ravel(sky_offset_rad(*looks)))))
        if away_rad <= SAME_TARGET_RAD or not targets:
            return track
        if self.simulated:
            off = f"the elements are {away_rad / MDEG:.3g} mdeg off"
            self.remarks.append(f"the target is the recorded one: {off}")
        return RecordedTrack(targets, track)

    def off_prediction(self) -> tuple[Array, Array]:
        """Return times (n,) and how far (n, 2) the satellite was off its prediction on the sky.

        That is the offset of tracking and what the sensor still saw beyond it, over 10 s: what is
        faster is wind and noise.
        """
        rows = self.signals.of("tracking_status")
        t_s = np.array([each.t_s for each in rows])
        offset = np.array([each.offset_rad for each in rows])
        seen = Flown.of(self.signals, SENSED, None)
        if not len(seen.t_s):
            return t_s, offset
        known = np.column_stack([np.interp(seen.t_s, t_s, column) for column in offset.T])
        sums = np.vstack([np.zeros(2), np.cumsum(known + seen.error_rad, axis=0)])
        first, last = (np.searchsorted(seen.t_s, seen.t_s + side * SLOW_S) for side in (-0.5, 0.5))
        return seen.t_s, (sums[last] - sums[first]) / (last - first)[:, None]

    def choose_wind(self, wanted: str) -> None:
        """Let the wind of the recording blow; ValueError for one that it does not have."""
        if wanted == "auto":
            # What was measured comes before what is concluded.
            known = "measured" if self.recorded.wind is not None else "estimated"
            try:
                self.choose_wind("seed" if self.simulated and self._given else known)
            except ValueError as error:
                self.remarks.append(str(error))
                self.choose_wind("none")
        elif wanted == "none":
            self.wind, self._wind = "none", calm
        elif wanted == "seed":
            self.wind, self._wind = "that of the simulation, by its seed", None
        elif wanted == "measured":
            if self.recorded.wind is None:
                raise ValueError(f"wind=measured: {self.path} holds no weather/wind")
            t_s, velocity = self.recorded.wind
            mean, missed = missed_gusts_m_s(t_s, velocity, self.servo.wind.drag_coefficient)
            gusts = f"gusts of ±{missed:.2g} m/s fall between the records"
            self.wind = f"measured, mean {mean:.1f} m/s; {gusts}"
            self._wind = self._blowing(t_s, velocity_m_s=velocity)
        else:
            found = estimated_gusts(self.setup(), self.signals)
            self.wind = f"estimated from the rate commands: {found}"
            self._wind = self._blowing(found.t_s, torque_n_m=found.torque_n_m)

    def _blowing(self, t_s: Array, **what: Array) -> Callable[[WindParams], RecordedWind]:
        return lambda params: RecordedWind(params, self.start_s, t_s, **what)

    def fly(self, setup: StationSetup, sensor: str | None = None) -> tuple[Signals, float]:
        """Return the signals of the whole simulated station, and the processor time of it in s."""
        signals, began_s = Signals(), time.process_time()
        simulate_pass(
            setup, self.window, self.start_s, sensor or self.recorded.sensor,
            on_signal=signals.take, track=self.track if self.recorded_target else None,
        )  # fmt: skip
        return signals, time.process_time() - began_s
