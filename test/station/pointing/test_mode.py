"""Which errors a period may use, what the link must give, and what interrupts a mode."""

import math
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import MDEG, Mode, PointingError
from rf_pointing.ephemeris import Pass
from rf_pointing.planning import PassProfile
from rf_pointing.rf import LinkParams
from rf_pointing.station.pointing.mode import CROSSING, CarrierWatch, SensedErrors, TrackingMode
from rf_pointing.station.pointing.motion import MotionSnapshot
from rf_pointing.station.pointing.params import PointingParams
from rf_pointing.tracking import AutotrackParams, LockWatchParams

LINK = LinkParams(zenith_carrier_to_noise_db_hz=60.0, reference_range_m=500e3)
"""40 dB-Hz at 5000 km."""
ON_TARGET = MotionSnapshot(target_available=True, on_target=True)


def report(t_s: float, sensor: str = "monopulse", level_db_hz: float = 50.0, **changes: Any) -> PointingError:
    values: dict[str, Any] = {"t_s": t_s, "sensor": sensor, "cross_elevation_rad": 0.0, "elevation_rad": 0.0,
        "covariance_rad2": np.eye(2) * (0.2 * MDEG) ** 2, "carrier_to_noise_db_hz": level_db_hz}  # fmt: skip
    return PointingError(**(values | changes))


def tracking(sensor: str = "auto", **changes: float) -> TrackingMode:
    made = TrackingMode(AutotrackParams(**changes), PointingParams(), CarrierWatch(LockWatchParams(), LINK))
    made.restart(100.0, sensor)
    return made


# Errors


def test_errors_of_the_period_that_ends_and_of_longer_ago_than_half_a_second_are_not_used() -> None:
    errors = SensedErrors()
    errors.restart("auto")
    for t_s in (9.45, 9.5, 9.9, 9.93, 10.0):
        errors.take(report(t_s))
    assert [each.t_s for each in errors.usable(10.0, 0.1, 0.5)] == [9.9, 9.5]
    assert [each.t_s for each in errors.usable(10.1, 0.1, 0.5)] == [10.0, 9.93, 9.9]


def test_a_pass_uses_the_sensors_of_its_choice_and_those_that_carry_their_level() -> None:
    for choice, used in (
        ("auto", ["monopulse", "conscan"]), ("steptrack", ["conscan", "steptrack"]), ("array", ["array"]), ("none", []),
    ):  # fmt: skip
        errors = SensedErrors()
        errors.restart(choice)
        for sensor in ("monopulse", "conscan", "steptrack", "array"):
            errors.take(report(1.0, sensor))
        assert [each.sensor for each in reversed(errors.usable(1.2, 0.1, 0.5))] == used
        errors.restart(choice)
        assert errors.usable(1.2, 0.1, 0.5) == []


def test_a_new_pass_knows_neither_errors_nor_evidence_of_the_one_before() -> None:
    made, t_s = locked()
    assert drop(made, t_s, 0.2) == ["monopulse", "monopulse"]
    state = made.state
    made.restart(t_s + 0.2, "auto")
    assert made.usable_errors(t_s + 0.3) == []
    step(made, round(t_s + 0.2, 6))
    made.state = state
    assert drop(made, round(t_s + 0.2, 6), 0.3)[:2] == ["monopulse", "monopulse"]


# The link


def passing(range_m: tuple[float, float, float], gain_db: tuple[float, float, float]) -> PassProfile:
    rows = np.zeros((3, 2))
    return PassProfile(
        name="S", t_s=np.arange(3.0), position_rad=rows, velocity_rad_s=rows, acceleration_rad_s2=rows, sun_rad=rows,
        range_m=np.array(range_m), satellite_gain_db=np.array(gain_db),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("sensor", "zenith_db_hz", "said"),
    [("monopulse", 56.0, ""), ("monopulse", 55.9, "needs a carrier of 36.0 dB-Hz; the link gives at most 35.9"),
     ("conscan", 42.0, ""), ("conscan", 41.9, "needs a carrier of 22.0 dB-Hz; the link gives at most 21.9"),
     ("auto", 42.0, ""), ("auto", 41.9, "22.0"), ("program", 0.0, ""),
     # 31 dB-Hz of an array that has 3 dB less than the dish.
     ("array", 54.0, ""), ("array", 53.9, "needs a carrier of 31.0 dB-Hz; the link gives at most 30.9")],
)  # fmt: skip
def test_a_sensor_needs_the_level_of_its_own_threshold_at_the_least_range(
    window: Pass, sensor: str, zenith_db_hz: float, said: str
) -> None:
    carrier = CarrierWatch(LockWatchParams(), LINK.replace(zenith_carrier_to_noise_db_hz=zenith_db_hz + 1e-6))
    nearest, thresholds = replace(window, smallest_range_m=5000e3), AutotrackParams(array_gain_db=-3.0)
    if said:
        with pytest.raises(ValueError, match=f"sensor={sensor} .*{said}.*5000 km away"):
            carrier.require_level(nearest, sensor, thresholds)
        carrier.require_level(replace(window, smallest_range_m=0.0), sensor, thresholds)
        carrier.require_level(replace(window, smallest_range_m=2500e3), sensor, thresholds)
    else:
        carrier.require_level(nearest, sensor, thresholds)


@pytest.mark.parametrize("compares", [True, False])
def test_a_level_of_its_own_scale_meets_no_link(window: Pass, compares: bool) -> None:
    """40 dB-Hz by the link; a total power whose noise is unknown reads 12."""
    carrier = CarrierWatch(LockWatchParams(compares_level=compares), LINK)
    thresholds, path = AutotrackParams(monopulse_on_db_hz=45.0), (5000e3, 0.0)
    refused = pytest.raises(ValueError, match="needs a carrier of 45.0 dB-Hz") if compares else nullcontext()
    with refused:
        carrier.require_level(replace(window, smallest_range_m=5000e3), "monopulse", thresholds)
    assert carrier.axis_db_hz(path) == pytest.approx(40.0 if compares else -math.inf)
    faults = [
        carrier.false_lock(report(0.1 * row, level_db_hz=12.0), np.zeros(2), path, 0.0, 0.0) for row in range(1, 5)
    ]
    assert any(faults) == compares
    assert carrier.faults == sum(map(bool, faults))


def test_the_level_of_a_pass_is_the_best_of_its_rows_where_its_profile_says_more(window: Pass) -> None:
    """46, 40 - 3 and 34 + 1 dB-Hz: monopulse needs 36; the second alone has them."""
    carrier, nearest = CarrierWatch(LockWatchParams(), LINK), replace(window, smallest_range_m=500e3)
    profile = passing((2505936.2, 5000e3, 9976311.6), (-30.0, -3.0, 1.0))
    assert carrier.levels_db_hz(profile) == pytest.approx([16.0, 37.0, 35.0], abs=1e-4)
    carrier.require_level(nearest, "monopulse", AutotrackParams(), profile)
    with pytest.raises(ValueError, match=r"needs a carrier of 37.5 dB-Hz; the link gives at most 37.0 .* 5000 km away"):
        carrier.require_level(nearest, "monopulse", AutotrackParams(monopulse_on_db_hz=37.5), profile)
    # Without gains the profile says no more than the least range.
    plain = passing((5000e3, 5000e3, 5000e3), (0.0, 0.0, 0.0))
    carrier.require_level(nearest, "monopulse", AutotrackParams(monopulse_on_db_hz=50.0), plain)


def test_what_the_state_table_expects_is_the_link_over_the_distance_and_the_gain_of_the_satellite() -> None:
    made = tracking()
    assert made.axis_db_hz == -math.inf
    near = replace(ON_TARGET, path=(5000e3, -2.0))
    made.advance(100.1, [], near, arriving=False, ended=False)
    assert made.axis_db_hz == pytest.approx(38.0)
    made.advance(100.2, [], ON_TARGET, arriving=False, ended=False)
    assert made.axis_db_hz == -math.inf
    array = tracking("array", array_gain_db=-7.0)
    array.advance(100.1, [], near, arriving=False, ended=False)
    assert array.axis_db_hz == pytest.approx(31.0)


# Modes


def locked(level_db_hz: float = 59.0, sensor: str = "auto") -> tuple[TrackingMode, float]:
    """Return a mode that tracks with monopulse at 500 km since a second, and its time."""
    made, t_s = tracking(sensor), 100.0
    while t_s < 101.5:
        t_s = round(t_s + 0.1, 6)
        made.errors.take(report(round(t_s - 0.1, 6), level_db_hz=level_db_hz))
        step(made, t_s)
    assert made.state.mode == "monopulse"
    return made, t_s


def step(made: TrackingMode, t_s: float, **changes: Any) -> None:
    motion = replace(ON_TARGET, path=(500e3, 0.0), beam_rad=np.zeros(2), error_path=(500e3, 0.0))
    given = {"arriving": False, "ended": False} | changes
    made.advance(t_s, made.usable_errors(t_s), motion, **given)


def test_an_interruption_goes_back_to_the_slew_and_keeps_what_is_known_of_the_carrier() -> None:
    made, t_s = locked()
    made.interrupt(t_s, "stalled")
    assert (made.state.mode, made.state.reason, made.state.entered_s) == (Mode.IDLE, "stalled", t_s)
    assert made.state.carrier
    assert made.state.strong
    made.interrupt(t_s + 1.0, "again")
    assert (made.state.reason, made.state.entered_s) == ("stalled", t_s)


def test_a_crossing_ends_a_scan_in_a_coast_that_begins_with_the_crossing_s_end() -> None:
    made, t_s = locked()
    assert not made.cross(t_s)
    assert made.state.mode == "monopulse"
    made.state = replace(made.state, mode=Mode.CONSCAN, invalid_since_s=3.0)
    assert made.cross(t_s + 1.0)
    assert (made.state.mode, made.state.reason, made.state.entered_s) == (Mode.COAST, CROSSING, t_s + 1.0)
    assert made.state.invalid_since_s is None
    assert not made.cross(t_s + 2.0)
    assert made.state.entered_s == t_s + 2.0
    made.state = replace(made.state, mode=Mode.PROGRAM_TRACK)
    assert not made.cross(t_s + 3.0)
    assert made.state.entered_s == t_s + 2.0


def test_a_calibration_needs_a_target_that_is_tracked_with_a_strong_carrier() -> None:
    made = tracking()
    assert made.calibrate() == "the mode is idle: a calibration needs a target that is tracked"
    made, t_s = locked()
    for mode in ("search", Mode.HOLD_OFF, "steptrack", "slew"):
        made.state = replace(made.state, mode=mode)
        assert made.calibrate().startswith(f"the mode is {mode}")
    for mode in ("monopulse", "conscan", "coast", "program_track"):
        made.state = replace(made.state, mode=mode, strong=False)
        assert made.calibrate() == "a calibration needs a carrier strong enough for monopulse"
        made.state = replace(made.state, strong=True)
        assert made.calibrate() == ""
    made, t_s = locked()
    assert made.calibrate() == ""
    step(made, t_s)
    assert made.state.mode == Mode.CALIBRATE
    # Requested once: when it is over the sensor takes over again.
    made.state = replace(made.state, mode=Mode.COAST, entered_s=t_s)
    step(made, t_s)
    assert made.state.mode == "monopulse"


def drop(made: TrackingMode, t_s: float, seconds: float, **changes: Any) -> list[str]:
    """Go on with reports of 45 dB-Hz, 15 dB under the link; return the modes."""
    modes = []
    for _ in range(round(seconds / 0.1)):
        made.errors.take(report(t_s, level_db_hz=45.0, **changes))
        t_s = round(t_s + 0.1, 6)
        step(made, t_s)
        modes.append(str(made.state.mode))
    return modes
