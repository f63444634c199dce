"""The simulated antenna: a control unit in front of simulated hardware.

The encoders read the true direction plus the mount's own errors.  Faults of drives and sensors can
be injected.  Only this module knows where the beam really points.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rf_pointing.core import Boresight, JointReading, Params, parameter, random_stream, require_choice, require_finite
from rf_pointing.core.second_stage import SecondStageParams, axes_from_sky
from rf_pointing.core.types import Array, Pair
from rf_pointing.drives import DriveParams
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams, WindSource, dss13_plant
from rf_pointing.servo.base_motion import BaseMotion, BaseMotionParams
from rf_pointing.servo.second_stage import StagePlant
from rf_pointing.station.antenna.axes import Following
from rf_pointing.station.antenna.control_unit import ControlUnit
from rf_pointing.station.antenna.loops import AxisLoops, LoopParams
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.mount import MountParams, SimulatedBeam
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.second_stage import StageLoop

if TYPE_CHECKING:
    from rf_pointing.station.antenna.stage_design import StageDesign

LONGEST_STOP_S = 30.0
SPIKE_TICKS = 2
"""Ticks that an injected spike lasts: short enough to be bridged, where a jump is not."""
FAULTS = ("none", "encoder_frozen", "encoder_jump", "encoder_spike", "encoder_lie", "encoder_nan", "runaway", "gust",
          "anemometer_silent")  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SimulationParams(Params):
    """Tick, start and randomness of the simulated antenna."""

    tick_s: float = parameter(0.02, "control period", 0.001, 0.1)
    lag_averaging_s: float = parameter(5.0, "time over which rates are averaged for the mount's lag terms", 0.1, 100.0)
    start_azimuth_rad: float = parameter(math.radians(120.0), "azimuth at the start", -20.0, 20.0)
    start_elevation_rad: float = parameter(math.radians(60.0), "elevation at the start", -3.4, 3.4)
    seed: int = parameter(1, "seed of every noise source", 0, 2**31 - 1)

    @property
    def start_rad(self) -> Pair:
        """Azimuth and elevation at the start."""
        return self.start_azimuth_rad, self.start_elevation_rad


@dataclass(frozen=True, kw_only=True)
class AntennaParams(Params):
    """All parameter sets of a simulated antenna; the names are the ROS prefixes."""

    antenna: SimulationParams = parameter(SimulationParams(), "tick, start and randomness")
    drive: DriveParams = parameter(DriveParams(), "the drive")
    plant: PlantParams = parameter(dss13_plant(), "drives and structure")
    loops: LoopParams = parameter(LoopParams(), "position laws and limits of the commands")
    wind: WindParams = parameter(WindParams(), "wind at the dish")
    mount: MountParams = parameter(MountParams(), "errors of the mount")
    base_motion: BaseMotionParams = parameter(BaseMotionParams(), "true motion of the base")
    safety: SafetyParams = parameter(SafetyParams(), "limits of trust, park and stow position")
    second_stage: SecondStageParams = parameter(SecondStageParams(), "fast actuator of the beam")

    def stage_design(self) -> "StageDesign":
        """Return what the second stage does here; ValueError where the device closes the loop."""
        # Imported here: it loads scipy, which most antennas do without.
        from rf_pointing.station.antenna.stage_design import design_stage

        tick_s = self.antenna.tick_s
        laws = AxisLoops(self.loops, self.plant, tick_s).in_force
        return design_stage(self.second_stage, self.plant, laws, self.wind, tick_s)


class InjectedFaults:
    """At most one fault at a time, all of the azimuth axis; `value` in rad, rad/s or m/s."""

    def __init__(self) -> None:
        self.kind, self.value = "none", 0.0
        self._frozen: Pair | None = None
        self._ticks = 0

    def inject(self, kind: str, value: float) -> None:
        """Put in a fault in place of the one before; "none" takes it out.

        Raises
        ------
        ValueError
            For a fault that is not in `FAULTS`, or a value that is not finite.
        """
        require_choice("fault", kind, FAULTS)
        require_finite("value", value)
        self.kind, self.value, self._frozen, self._ticks = kind, value, None, 0

    def encoder(self, angles: Pair, tick_s: float) -> Pair:
        """Return what the encoders show instead of `angles`."""
        self._ticks += 1
        azimuth, elevation = angles
        if self.kind == "encoder_frozen":
            self._frozen = self._frozen or angles
            return self._frozen
        if self.kind == "encoder_jump" or (self.kind == "encoder_spike" and self._ticks <= SPIKE_TICKS):
            return azimuth + self.value, elevation
        if self.kind == "encoder_lie":
            return azimuth + self.value * self._ticks * tick_s, elevation
        return (math.nan if self.kind == "encoder_nan" else azimuth), elevation

    def wind_speed(self, speed_m_s: float) -> float:
        """Return what the anemometer shows, NaN when it is silent."""
        if self.kind == "anemometer_silent":
            return math.nan
        return speed_m_s + self.value if self.kind == "gust" else speed_m_s


class SimulatedHardware(AntennaPlant):
    """Drives, brakes and sensors for a control unit; once a tick `look` comes first.

    It begins with its brakes set.
    """

    takes_positions = False
    settled_rad = math.radians(0.02)
    fault = ""
    lag_s = 0.0

    def __init__(self, params: AntennaParams) -> None:
        seed, self._tick_s = params.antenna.seed, params.antenna.tick_s
        self.sampled_s = self._tick_s
        super().__init__(params.plant, random_stream(seed, "encoder"), params.antenna.start_rad)
        self.brake()
        self.injected = InjectedFaults()
        self._wind: WindSource = Wind(params.wind, random_stream(seed, "wind"))
        self._torque = np.zeros(2)
        self.stage = StagePlant(params.second_stage) if params.second_stage.present else None
        self._beam = SimulatedBeam(
            params.mount, params.antenna.lag_averaging_s, self._tick_s, params.safety.kinematics
        )  # fmt: skip
        moves = params.safety.base.moves
        self.base = BaseMotion(params.base_motion, seed) if moves else None

    def bend(self, mount: MountParams) -> None:
        """Have other mount errors from now on, as in another band."""
        self._beam.bend(mount)

    def blow(self, wind: WindSource) -> None:
        """Let another wind blow from now on, as one that was recorded."""
        self._wind = wind

    @property
    def switch_rad(self) -> Pair:
        """Angles at the limit switches: the true ones, whatever the encoders show."""
        return self.joints()

    def look(self, t_s: float) -> Boresight:
        """Return the true direction of the beam, and let the wind blow on it for this tick."""
        beam = self.beam_rad
        if self.stage is not None:
            beam = beam + axes_from_sky(self.stage.deflection_rad, float(beam[1]))
        boresight = self._beam.boresight(t_s, beam, self.velocity_rad_s)
        if self.base is not None:
            sky = self.base.sky_at(t_s, boresight.azimuth_rad, boresight.elevation_rad)
            boresight = Boresight(t_s=t_s, azimuth_rad=sky[0], elevation_rad=sky[1])
        # At the true boresight: the wind does not know what the encoders show.
        self._torque = self._wind.step(self._tick_s, boresight.azimuth_rad, boresight.elevation_rad)
        return boresight

    def anemometer_m_s(self) -> float:
        """Return the speed of the wind as it is measured, NaN when it is not."""
        return self.injected.wind_speed(math.hypot(*self._wind.speed_m_s))

    def move(self, rate_command_rad_s: Array, _following: Following | None = None) -> None:
        """Drive the axes through this tick (2,); a drive that runs away ignores the command."""
        if self.injected.kind == "runaway":
            rate_command_rad_s = np.array((self.injected.value, rate_command_rad_s[1]))
        self.step(rate_command_rad_s, self._torque, self._tick_s)
        if self.stage is not None:
            self.stage.step(self._tick_s)

    def encoders(self) -> Pair:
        """Return the angles that the encoders show."""
        azimuth, elevation = self._state.encoder_rad.tolist()
        # The common case without a call: this runs in every tick.
        if self.injected.kind == "none":
            return azimuth, elevation
        return self.injected.encoder((azimuth, elevation), self._tick_s)


class SimulatedAntenna(ControlUnit):
    """One antenna: `enable` it, `accept` trajectories, and `step` it once a tick.

    `hardware` is that of an antenna whose control unit starts again; by default it is new.
    """

    def __init__(self, params: AntennaParams | None = None, hardware: SimulatedHardware | None = None) -> None:
        params = params or AntennaParams()
        self.params = params.antenna
        self.hardware = hardware or SimulatedHardware(params)
        self.injected = self.hardware.injected
        super().__init__(
            self.hardware, params.loops, params.plant, params.safety, params.antenna.tick_s, params.antenna.start_rad
        )
        if self.hardware.stage is not None:
            self.stage = StageLoop(self.hardware.stage, params.stage_design())

    def step(self, t_s: float) -> tuple[JointReading, Boresight]:
        """Return encoder reading and true boresight at `t_s`, then advance by one tick."""
        boresight = self.hardware.look(t_s)
        if self.hardware.base is not None and self.safety.base is not None:
            for sample in self.hardware.base.samples(t_s):
                self.safety.base.take(sample, t_s)
        return self.tick(t_s), boresight

    def deactivate(self) -> None:
        """Decelerate at the limits, then set the brakes; the seconds this takes pass at once."""
        self.stop()
        for _ in range(round(LONGEST_STOP_S / self.params.tick_s)):
            if self.mode != AntennaMode.STOPPING:
                break
            self.step(self.t_s + self.params.tick_s)
        self.rest(AntennaMode.INACTIVE)

    def check(self, plant: PlantParams, loops: LoopParams) -> None:
        """Raise ValueError, saying why, if `retune` would refuse these; changes nothing."""
        self.hardware.check(plant)
        self.axes.check(loops, plant)

    def retune(self, plant: PlantParams, loops: LoopParams) -> None:
        """Take new laws and limits between two ticks without a jump; all or, with ValueError, none.

        Another plant means an antenna that changes in the middle of its motion: the laws in force
        stay in force, even where they are unstable on it.
        """
        self.check(plant, loops)
        if plant != self.hardware.params:
            self.hardware.reconfigure(plant)
        self.axes.retune(loops, plant)
