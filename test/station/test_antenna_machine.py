"""Random sequences of everything one can ask of an antenna: what must hold after every one of them.

|position| within the hard limits and never further below the horizon mask or into the Sun's zone, commanded rates and
accelerations within theirs, no commanded motion unless active, authorised and free of faults.  `scripts/soak` runs the same
machine for as long as it is told.
"""

import math
import os

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from rf_pointing.core import JointTrajectory
from rf_pointing.ephemeris.solar import SolarDirection
from rf_pointing.identification import ExcitationParams, IdentificationExperiment
from rf_pointing.planning import GateParams, HorizonMask
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.gate import GUARD_RAD
from rf_pointing.servo import WindParams
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import FAULTS, AntennaParams, SimulatedAntenna, SimulationParams

DEG = math.pi / 180.0
START_S = 1_151_384_000.0 + 12.0 * 3600.0
"""The Sun stands at 50 deg."""
MASK = HorizonMask(
    azimuth_rad=tuple(angle * DEG for angle in (0.0, 40.0, 60.0, 90.0, 100.0, 250.0, 300.0)),
    elevation_rad=tuple(height * DEG for height in (0.0, 0.0, 30.0, 30.0, 0.0, 0.0, 15.0)),
)
SAFETY = SafetyParams(mask=MASK, gate=GateParams(sun_radius_rad=5.0 * DEG))
RESET_RAD = 0.05 * DEG
"""More than the fastest axis moves in a tick: the command was set to where the axes are."""
SUN_RAD = GUARD_RAD + 0.05 * DEG
"""The guard's tolerance, and what the Sun moves between two looks at it."""
BRAKING_RAD = 0.1 * DEG
"""What brakes need that are set at the hard limit; the guard has slowed the axes down by then."""
BRAKED = ("inactive", "parked", "stowed", "disabled")
EXAMPLES = int(os.environ.get("RF_POINTING_SOAK_EXAMPLES", "15"))
STEPS = 40


class AntennaMachine(RuleBasedStateMachine):
    """One antenna under commands, services, faults and time in any order."""

    @initialize(
        azimuth=st.floats(-215.0, 215.0), elevation=st.floats(5.0, 89.0), wind=st.sampled_from([0.0, 8.0, 16.0])
    )
    def begin(self, azimuth: float, elevation: float, wind: float) -> None:
        params = SimulationParams(start_azimuth_rad=azimuth * DEG, start_elevation_rad=elevation * DEG)
        self.antenna = SimulatedAntenna(
            AntennaParams(antenna=params, wind=WindParams(mean_speed_m_s=wind), safety=SAFETY)
        )
        self.sky, self.sun = ForbiddenSky(MASK, SAFETY.gate.sun_radius_rad), SolarDirection(SAFETY.sun)
        self.tick_s, self.ticks = params.tick_s, 0
        self.limits = LoopParams().preprocessor
        self.before: tuple[np.ndarray, np.ndarray] | None = None
        self.course = self.antenna.status(self.t_s).commanded_rad
        self.authority = ("", -math.inf)
        self.run(3)

    @property
    def t_s(self) -> float:
        return round(START_S + self.ticks * self.tick_s, 6)

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.ticks += 1
            before = self.antenna.mode
            self.antenna.step(self.t_s)
            self.check_motion(before)
            self.check_sky(before)

    def check_sky(self, mode_before: str) -> None:
        """A command leads no further into what is forbidden than the guard's tolerance, or out of it."""
        course, self.course = self.course, self.antenna.status(self.t_s).commanded_rad
        here, before = self.course.tolist(), course.tolist()
        moved = float(np.max(np.abs(self.course - course)))
        if moved == 0.0 or moved > RESET_RAD or "stopping" in (mode_before, self.antenna.mode):
            return
        under = self.sky.under_mask(*here)
        assert under <= max(GUARD_RAD, self.sky.under_mask(*before) + 1e-9)
        sun = self.sun.at(self.t_s)
        if sun is not None and self.antenna.mode != "stowing":
            near = self.sky.sun_distance(*here, sun)
            assert near >= min(SAFETY.gate.sun_radius_rad - SUN_RAD, self.sky.sun_distance(*before, sun) - 1e-9)

    def check_motion(self, mode_before: str) -> None:
        antenna, limits = self.antenna, self.limits
        truth = antenna.axes.hardware.true_joint_rad
        reach = antenna.safety.params.gate.hard_rad + BRAKING_RAD
        assert np.all(truth >= np.array(limits.travel_min_rad) - reach)
        assert np.all(truth <= np.array(limits.travel_max_rad) + reach)
        state = antenna.axes.path.preprocessor.state
        assert np.all(np.abs(state.velocity_rad_s) <= np.array(limits.rate_limit_rad_s) * (1.0 + 1e-9))
        assert np.all(np.abs(state.acceleration_rad_s2) <= np.array(limits.acceleration_limit_rad_s2) * (1.0 + 1e-6))
        if antenna.mode == mode_before and antenna.mode in BRAKED:
            assert not antenna.axes.hardware.powered
            assert not np.any(antenna.axes.rate_command_rad_s)
        if antenna.mode == mode_before == "fault":
            moved = state.velocity_rad_s if antenna.axes.hardware.powered else antenna.axes.rate_command_rad_s
            assert not np.any(moved), "a fault ends in rest"

    @rule(seconds=st.floats(0.02, 3.0))
    def wait(self, seconds: float) -> None:
        self.run(max(1, round(seconds / self.tick_s)))

    @rule(
        azimuth=st.floats(-400.0, 400.0), elevation=st.floats(-40.0, 130.0), rate=st.floats(-5.0, 5.0),
        lead_s=st.sampled_from([-3.0, 0.05, 0.1, 0.5, 100.0]), who=st.sampled_from(["controller", "panel", ""]),
        points=st.integers(1, 12),
    )  # fmt: skip
    def command(self, azimuth: float, elevation: float, rate: float, lead_s: float, who: str, points: int) -> None:
        times = self.t_s + lead_s + 0.1 * np.arange(points)
        line = 0.1 * np.arange(points)[:, None] * np.array([rate, -0.5 * rate]) * DEG
        trajectory = JointTrajectory(
            t_s=times, position_rad=np.array([azimuth, elevation]) * DEG + line,
            velocity_rad_s=np.tile([rate * DEG, -0.5 * rate * DEG], (points, 1)),
            acceleration_rad_s2=np.zeros((points, 2)),
        )  # fmt: skip
        fault, mode = self.antenna.safety.latch.text, self.antenna.mode
        holder, since_s = self.authority
        refused = self.antenna.accept(trajectory, self.t_s, who)
        if fault or mode in (*BRAKED, "manual_rate"):
            assert refused
        elif mode in ("tracking", "paused") and who != holder and self.t_s - since_s <= SAFETY.authority_s:
            assert (
                refused
                == f"conflict: {holder or 'an unnamed commander'} commands, {who or 'an unnamed one'} is refused"
            )
        if refused:
            assert self.antenna.mode == mode
        else:
            self.authority = (who, self.t_s)
        self.run(10)

    @rule(axis=st.sampled_from(["azimuth", "elevation"]), seed=st.integers(0, 9), ticks=st.integers(5, 120))
    def identify(self, axis: str, seed: int, ticks: int) -> None:
        """Drive an axis by an experiment; it must be refused unless the antenna stands, active and free of faults."""
        mode, start = self.antenna.mode, self.antenna.reading(self.t_s).position_rad["ae".index(axis[0])]
        shake, travel = ExcitationParams(sample_s=self.tick_s), self.antenna.axes.travel_rad["ae".index(axis[0])]
        try:
            experiment = IdentificationExperiment(shake, axis, 1, float(start), travel, np.random.default_rng(seed))
        except ValueError:
            return
        refused = self.antenna.identify(experiment)
        if mode != "holding" or self.antenna.safety.latch.text:
            assert refused
        self.run(ticks)

    @rule(name=st.sampled_from(["pause", "resume", "park", "stow", "disable", "reset_fault", "enable", "deactivate"]))
    def ask(self, name: str) -> None:
        if name == "enable" and self.antenna.mode != "inactive":
            return
        position = self.antenna.axes.hardware.true_joint_rad
        getattr(self.antenna, name)()
        if name != "deactivate":
            np.testing.assert_array_equal(self.antenna.axes.hardware.true_joint_rad, position)
        self.run(2)

    @rule(reason=st.sampled_from(["", "stop was requested"]))
    def stop(self, reason: str) -> None:
        self.antenna.stop(reason)
        self.run(5)

    @rule(kind=st.sampled_from(FAULTS), value=st.floats(-0.1, 0.1))
    def break_something(self, kind: str, value: float) -> None:
        self.antenna.injected.inject(kind, 60.0 if kind == "gust" else value)
        self.run(12)
        if kind == "encoder_nan" and self.antenna.axes.hardware.powered:
            raise AssertionError("an encoder without numbers must have cut the drives within 200 ms")

    @rule()
    def mend(self) -> None:
        self.antenna.injected.inject("none", 0.0)

    @invariant()
    def a_latched_fault_is_said(self) -> None:
        if not hasattr(self, "antenna"):
            return
        status = self.antenna.status(self.t_s)
        assert status.fault == self.antenna.safety.latch.text
        assert np.all(np.isfinite(self.antenna.reading(self.t_s).position_rad))
        if status.mode == "fault":
            assert status.fault
        if status.mode not in ("tracking", "holding"):
            assert status.transmit_inhibit


TestAntennaMachine = AntennaMachine.TestCase
TestAntennaMachine.settings = settings(
    max_examples=EXAMPLES, stateful_step_count=STEPS, deadline=None, derandomize="RF_POINTING_SOAK_EXAMPLES" not in os.environ,
    suppress_health_check=list(HealthCheck), database=None,
)  # fmt: skip
