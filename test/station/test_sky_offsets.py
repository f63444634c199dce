"""What is added to the target on the sky: rates that belong to the positions, scans that run and end."""

import math

import numpy as np
import pytest

from rf_pointing.controllers import TrackerIntegratorParams
from rf_pointing.geometry import MDEG, Motion, PointingError, sky_offset_rad
from rf_pointing.station.sky_offsets import STEEPEST_RAD, SkyOffsets
from rf_pointing.tracking import AutotrackState, ConscanParams, SpiralParams

T_S = 1_151_384_000.0
ROUNDING_RAD = 1e-9
"""A float resolves UTC seconds to 0.24 microseconds: the trim of a period is known to that share of it."""


def offsets() -> SkyOffsets:
    made = SkyOffsets(TrackerIntegratorParams(bandwidth_hz=0.2), SpiralParams(), ConscanParams())
    made.restart(T_S)
    return made


def state(mode: str) -> AutotrackState:
    return AutotrackState(mode=mode, entered_s=T_S, carrier=True, strong=True)


def error(t_s: float, right_rad: float, up_rad: float) -> PointingError:
    return PointingError(t_s=t_s, sensor="monopulse", cross_elevation_rad=right_rad, elevation_rad=up_rad)


def trimmed(right_rad: float, up_rad: float) -> SkyOffsets:
    """Offsets with a steady trim, in monopulse."""
    made = offsets()
    made.listen(T_S, "program_track", state("monopulse"), None, None)
    gain = 2.0 * math.pi * 0.2 * 0.1
    made.listen(T_S, "monopulse", state("monopulse"), error(T_S, right_rad / gain, up_rad / gain), None)
    return made


def climbing(times: np.ndarray, elevation_rad: float) -> Motion:
    azimuth_rate, climb = 0.004, 0.01
    since = times - T_S
    position = np.column_stack([1.0 + azimuth_rate * since, elevation_rad + climb * since])
    return Motion(position, np.tile([azimuth_rate, climb], (len(times), 1)), np.zeros((len(times), 2)))


def test_the_trim_is_measured_on_the_sky() -> None:
    made, times = trimmed(5 * MDEG, -3 * MDEG), np.array([T_S + 0.5])
    sky = climbing(times, 0.9)
    moved = made.add_trim(times, sky)
    right, up = sky_offset_rad(*moved.position[0], *sky.position[0])
    assert float(right) == pytest.approx(5 * MDEG, abs=0.001 * MDEG)
    assert float(up) == pytest.approx(-3 * MDEG, abs=0.001 * MDEG)


@pytest.mark.parametrize("elevation_rad", [0.1, 0.9, 1.4])
@pytest.mark.parametrize("scanning", [False, True])
def test_rates_are_the_derivatives_of_the_positions(elevation_rad: float, scanning: bool) -> None:
    made = trimmed(5 * MDEG, -3 * MDEG)
    if scanning:
        made.listen(T_S, "monopulse", state("search"), None, None)
    step_s = 0.01
    times = T_S + 3.0 + step_s * np.arange(-1, 2)
    sky = climbing(times, elevation_rad)
    moved = made.add_scan(times, made.add_trim(times, sky))
    slope = (moved.position[2] - moved.position[0]) / (2.0 * step_s)
    np.testing.assert_allclose(moved.velocity[1], slope, atol=2e-6)


def test_close_to_the_zenith_the_azimuth_correction_stays_bounded() -> None:
    made, times = trimmed(5 * MDEG, 0.0), np.array([T_S + 0.5])
    at_zenith = Motion(np.array([[1.0, math.radians(89.99)]]), np.zeros((1, 2)), np.zeros((1, 2)))
    moved = made.add_trim(times, at_zenith)
    assert abs(moved.position[0, 0] - 1.0) <= 5 * MDEG / math.cos(STEEPEST_RAD) + 1e-12


def test_the_spiral_starts_at_the_centre_and_ends_with_the_search() -> None:
    made, times = offsets(), T_S + np.arange(0.0, 5.0, 0.5)
    sky = climbing(times, 0.5)
    np.testing.assert_array_equal(made.add_scan(times, sky).position, sky.position)
    made.listen(T_S, "program_track", state("search"), None, None)
    spiral = made.add_scan(times, sky).position - sky.position
    assert np.max(np.abs(spiral[0])) < 1e-12
    assert np.max(np.abs(spiral[-1])) > 10 * MDEG
    made.listen(T_S + 5.0, "search", state("program_track"), None, None)
    np.testing.assert_array_equal(made.add_scan(times, sky).position, sky.position)


def test_the_conscan_circle_has_its_radius_and_period() -> None:
    params = ConscanParams()
    made = offsets()
    made.listen(T_S, "program_track", state("conscan"), None, None)
    times = T_S + params.ramp_s + 1.0 + np.linspace(0.0, params.period_s, 41)
    sky = climbing(times, 0.5)
    moved = made.add_scan(times, sky).position
    on_sky = (moved - sky.position) * np.column_stack([np.cos(sky.position[:, 1]), np.ones(41)])
    np.testing.assert_allclose(np.hypot(*on_sky.T), params.radius_rad, rtol=1e-6)
    np.testing.assert_allclose(on_sky[0], on_sky[-1], atol=1e-8)


def test_the_error_of_the_period_in_which_the_mode_changes_is_not_integrated() -> None:
    made = offsets()
    made.listen(T_S, "program_track", state("monopulse"), error(T_S, 9 * MDEG, 9 * MDEG), None)
    np.testing.assert_array_equal(made.trim(T_S + 1.0), [0.0, 0.0])


def test_one_error_is_used_once() -> None:
    made, same = offsets(), error(T_S, 1 * MDEG, 0.0)
    made.listen(T_S, "program_track", state("monopulse"), None, None)
    for k in range(5):
        made.listen(T_S + 0.1 * k, "monopulse", state("monopulse"), same, None)
    assert made.trim(T_S + 1.0)[0] == pytest.approx(2.0 * math.pi * 0.2 * 0.1 * MDEG)


def test_hand_back_forgets_the_trim_and_coasting_keeps_it() -> None:
    for mode, kept in (("coast", 5 * MDEG), ("hand_back", 0.0)):
        made = trimmed(5 * MDEG, 0.0)
        made.listen(T_S + 1.0, "monopulse", state(mode), None, None)
        assert made.trim(T_S + 2.0)[0] == pytest.approx(kept, abs=ROUNDING_RAD)


@pytest.mark.parametrize("mode", ["monopulse", "conscan", "coast"])
def test_a_search_hands_over_the_place_of_the_strongest_carrier(mode: str) -> None:
    made = offsets()
    made.listen(T_S, "program_track", state("search"), None, None)
    for k, level_db_hz in enumerate((30.0, 45.0, 40.0)):
        heard = PointingError(
            t_s=T_S + k, sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=0.0, valid=False,
            reason="off the axis", carrier_to_noise_db_hz=level_db_hz,
        )  # fmt: skip
        made.listen(T_S + k + 0.1, "search", state("search"), heard, np.array([k * 10 * MDEG, -k * 5 * MDEG]))
    made.listen(T_S + 3.0, "search", state(mode), None, None)
    np.testing.assert_allclose(made.trim(T_S + 4.0), [10 * MDEG, -5 * MDEG], atol=1e-12)


def test_a_search_without_a_carrier_leaves_the_trim() -> None:
    made = trimmed(5 * MDEG, -3 * MDEG)
    made.listen(T_S + 1.0, "monopulse", state("search"), None, None)
    made.listen(T_S + 9.0, "search", state("program_track"), None, None)
    np.testing.assert_allclose(made.trim(T_S + 10.0), [5 * MDEG, -3 * MDEG], atol=ROUNDING_RAD)


def test_a_new_pass_begins_without_a_trim_or_scan() -> None:
    made, times = trimmed(5 * MDEG, -3 * MDEG), np.array([T_S + 20.0])
    made.listen(T_S + 1.0, "monopulse", state("search"), None, None)
    made.restart(T_S + 19.0)
    sky = climbing(times, 0.5)
    moved = made.add_scan(times, made.add_trim(times, sky))
    np.testing.assert_array_equal(moved.position, sky.position)
