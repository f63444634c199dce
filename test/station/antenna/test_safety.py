"""The last guard of the control unit: what moves towards a hill is stopped, what rests is left alone."""

import math

import pytest

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core.kinematics import Kinematics
from rf_pointing.planning import HorizonMask
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.safety import AntennaSafety, SafetyParams

DEG = math.pi / 180.0
TICK_S = 0.02
HILL = HorizonMask(
    azimuth_rad=(0.0, 1.0, 1.1, 2.0, 2.1),
    elevation_rad=(0.0, 0.0, 20.0 * DEG, 20.0 * DEG, 0.0),
    clearance_rad=0.1 * DEG,
)


@pytest.mark.parametrize(
    ("elevation_deg", "rate_deg_s", "stopped"),
    [(20.3, -1.0, True), (20.3, 1.0, False), (40.0, -1.0, False), (20.3, 0.0, False), (10.0, 0.0, False)],
    ids=["towards the hill", "away from it", "far above it", "at rest above it", "at rest inside it"],
)
def test_only_a_motion_that_cannot_stop_above_the_hill_is_stopped(
    elevation_deg: float, rate_deg_s: float, stopped: bool
) -> None:
    """At 1 deg/s the axes come to rest after 0.63 deg."""
    safety = AntennaSafety(SafetyParams(mask=HILL), CommandPreprocessorParams(), TICK_S)
    reason = safety.guard("track", 1e9, (1.5, elevation_deg * DEG), (0.0, rate_deg_s * DEG))
    assert ("below the horizon mask" in reason) is stopped
    assert bool(reason) is stopped


def made(**changes: object) -> AntennaSafety:
    return AntennaSafety(SafetyParams(**changes), CommandPreprocessorParams(), TICK_S)  # type: ignore[arg-type]


def test_a_late_command_is_a_warning_while_the_antenna_follows_one() -> None:
    """Every 0.1 s one is due; it is late when another 0.1 s has passed."""
    safety = made()
    safety.commanded_s = 100.0
    for late_s, mode, words in (
        (0.19, AntennaMode.TRACKING, ""), (0.21, AntennaMode.TRACKING, "no command for 0.21 s"),
        (5.0, AntennaMode.TRACKING, "no command for 5.00 s"), (5.0, AntennaMode.HOLDING, ""),
    ):  # fmt: skip
        assert safety.warning(100.0 + late_s, mode, (1.0, 1.0)) == words
    safety.wind.reason = "gust 40 m/s"
    for mode, words in (
        (AntennaMode.TRACKING, "gust 40 m/s: the antenna is not stowed (tracking)"),
        (AntennaMode.STOWING, ""), (AntennaMode.STOWED, ""),
    ):  # fmt: skip
        assert safety.warning(100.0, mode, (1.0, 1.0)) == words


def test_the_gate_has_the_travel_and_the_rates_of_the_commands() -> None:
    motion = CommandPreprocessorParams(
        travel_min_rad=(-1.0, 0.1), travel_max_rad=(2.0, 1.4), rate_limit_rad_s=(0.02, 0.01),
        acceleration_limit_rad_s2=(0.03, 0.04),
    )  # fmt: skip
    safety = made()
    safety.retune(motion)
    limits = safety.gate.limits
    assert (limits.azimuth_min_rad, limits.azimuth_max_rad) == (-1.0, 2.0)
    assert (limits.elevation_min_rad, limits.elevation_max_rad) == (0.1, 1.4)


def test_the_guard_looks_one_tick_ahead_in_place_and_rate() -> None:
    safety, seen = made(), []
    safety.gate.guard = lambda *given: seen.append(given) or "why"  # type: ignore[method-assign, func-returns-value]
    assert safety.guard("track", 5.0, (1.0, 0.5), (0.1, -0.2), (3.0, 4.0)) == "why"
    kind, position, then, faster, _ = seen[0]
    assert (kind, position) == ("track", (1.0, 0.5))
    assert then == pytest.approx((1.002, 0.496))
    assert faster == pytest.approx((0.16, -0.12))
    # At rest nothing is looked at; one axis that moves is enough.
    assert safety.guard("track", 5.0, (1.0, 0.5), (0.0, 0.0)) == ""
    assert safety.guard("track", 5.0, (1.0, 0.5), (0.0, 1e-6)) == "why"
    assert seen[1][3] == (0.0, 1e-6)


def test_a_release_forgets_what_the_watches_saw_and_takes_the_place_as_it_is() -> None:
    safety, seen = made(), []
    safety.watch.reset = lambda: seen.append("watch")  # type: ignore[method-assign]
    safety.drive.reset = lambda: seen.append("drive")  # type: ignore[method-assign]
    beyond = math.radians(271.0)
    assert "past the hard limit" in safety.beyond((beyond, 1.0), (0.01, 0.0))
    safety.release((beyond, 1.0))
    assert seen == ["watch", "drive"]
    assert safety.beyond((beyond, 1.0), (0.0, 0.0)) == ""
    assert "past the hard limit" in safety.beyond((beyond + 0.05, 1.0), (0.01, 0.0))


def test_an_axis_of_elevation_rests_above_the_horizon_and_another_where_it_is_driven_to() -> None:
    for name in ("park_elevation", "stow_elevation"):
        with pytest.raises(ValueError, match=rf"{name}_deg=-5 must be >= 0\.0"):
            SafetyParams(**{f"{name}_rad": math.radians(-5.0)})
        SafetyParams(**{f"{name}_rad": math.radians(-5.0)}, kinematics=Kinematics(type="x_y"))
