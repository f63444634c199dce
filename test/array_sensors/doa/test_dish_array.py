"""A small dish follows a pass by the array of patches on it alone, and never trusts a wrong lobe."""

import dataclasses
import math
import re

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.cramer_rao import cosine_sigma_rad
from rf_pointing.array_sensors.doa.dish_array import (
    DishArrayTracker,
    SimulatedDishArray,
    circle_of,
    direction_from_offset,
    offset_from_direction,
    rival,
)
from rf_pointing.core import Mode, PointingError, Sensor, random_stream, sky_offset_rad, unit_vector_from_azel
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.rf.dish_array import PERIOD_S, SNAPSHOTS, DishArrayParams, direction_sigmas_rad, least_level_db_hz
from rf_pointing.simulation import PassLog, StationSetup, simulate_pass
from rf_pointing.station.antenna.receiver import Reception

TURNED = DishArrayParams(
    roll_rad=0.4, axis_cross_elevation_rad=0.1, axis_elevation_rad=-0.07, phase_sigma_rad=0.0
)  # fmt: skip
STRONG_DB_HZ = 54.0


def truth(t_s: float, offset_rad: np.ndarray, level_db_hz: float = STRONG_DB_HZ) -> PointingError:
    return PointingError(
        t_s=t_s, sensor="truth", cross_elevation_rad=float(offset_rad[0]),
        elevation_rad=float(offset_rad[1]), carrier_to_noise_db_hz=level_db_hz,
    )  # fmt: skip


def measured(array: DishArrayParams, offsets_rad: np.ndarray, level_db_hz: float, seed: int = 3) -> list[PointingError]:
    source, tracker = SimulatedDishArray(array, seed), DishArrayTracker(array)
    return [
        tracker.measure(source.receive(truth(1.0 + k, offset, level_db_hz))) for k, offset in enumerate(offsets_rad)
    ]


@pytest.mark.parametrize("array", [DishArrayParams(phase_sigma_rad=0.0), TURNED])
def test_errors_are_as_large_as_their_covariance_and_the_bound(array: DishArrayParams) -> None:
    offsets = random_stream(5, "offsets").uniform(-0.1, 0.1, (150, 2))
    errors = measured(array, offsets, STRONG_DB_HZ)
    assert all(error.valid for error in errors)
    found = np.array([[error.cross_elevation_rad, error.elevation_rad] for error in errors])
    nees = [
        float(miss @ np.linalg.solve(error.covariance_rad2, miss))
        for miss, error in zip(offsets - found, errors, strict=True)
    ]
    # chi squared of 300 degrees of freedom, 99.9 %
    assert 1.50 < np.mean(nees) < 2.57
    snr = 10.0 ** (0.1 * (STRONG_DB_HZ - array.element_loss_db)) * PERIOD_S / SNAPSHOTS
    bound = cosine_sigma_rad(circle_of(array), SNAPSHOTS, snr)
    assert 0.9 < np.sqrt(np.mean((offsets - found) ** 2)) / bound < 1.15
    assert direction_sigmas_rad(array, STRONG_DB_HZ) == pytest.approx((bound, 0.0))
    level = STRONG_DB_HZ - array.element_loss_db + 10.0 * math.log10(array.elements)
    assert np.median([error.carrier_to_noise_db_hz for error in errors]) == pytest.approx(level, abs=0.5)


def test_phases_that_are_not_known_are_in_the_covariance() -> None:
    array, nees, misses = DishArrayParams(phase_sigma_rad=0.2), [], []
    for seed in range(1, 101):
        (error,) = measured(array, np.array([[0.05, -0.03]]), 75.0, seed)
        miss = np.array([0.05 - error.cross_elevation_rad, -0.03 - error.elevation_rad])
        nees.append(float(miss @ np.linalg.solve(error.covariance_rad2, miss)))
        misses.append(miss)
    # At 75 dB-Hz the noise is a tenth of it.
    assert np.sqrt(np.mean(np.square(misses))) == pytest.approx(direction_sigmas_rad(array, 75.0)[1], rel=0.15)
    # chi squared of 200 degrees of freedom, 99.9 %
    assert 1.39 < np.mean(nees) < 2.72


def test_a_grating_lobe_is_never_valid() -> None:
    """Few patches far apart, and twelve around a dish of 2 m."""
    valid = refused = 0
    for elements, radius_m in ((5, 0.3), (5, 1.0), (6, 0.5), (8, 0.5), (12, 1.0)):
        array = DishArrayParams(elements=elements, radius_m=radius_m, phase_sigma_rad=0.0)
        stream = random_stream(elements, "lobes")
        for level in (42.0, 48.0, 54.0, 66.0):
            offsets = stream.uniform(-0.5, 0.5, (15, 2))
            for offset, error in zip(offsets, measured(array, offsets, level, int(level)), strict=True):
                miss = offset - [error.cross_elevation_rad, error.elevation_rad]
                sigma = np.sqrt(np.diag(error.covariance_rad2))
                if error.valid:
                    assert np.all(np.abs(miss) < 5.0 * sigma), (array, offset, error)
                refused += not error.valid and bool(np.any(np.abs(miss) > 5.0 * sigma))
                valid += error.valid
    # Without the criterion each of these would be believed.
    assert refused >= 5
    assert valid >= 40


@pytest.mark.parametrize("changes", [{"elements": 6, "radius_m": 0.3}, {"phase_sigma_rad": 0.4}])
def test_an_array_that_is_ambiguous_has_no_least_level(changes: dict[str, float]) -> None:
    assert math.isinf(least_level_db_hz(DishArrayParams(**changes)))


def test_the_rival_of_a_small_hexagon_is_its_grating_lobe() -> None:
    """Six patches on a circle repeat at a distance of (2 / sqrt 3) wavelengths / radius."""
    array = circle_of(DishArrayParams(elements=6, radius_m=0.3))
    other, likeness = rival(array, np.array([0.0, 0.0, 1.0]))
    assert likeness == pytest.approx(1.0, abs=2e-3)
    assert math.hypot(*other[:2]) == pytest.approx(
        2.0 / math.sqrt(3.0) * array.wavelength_m / 0.3, abs=0.25 * array.wavelength_m / (2.0 * math.pi * 0.3)
    )


def test_noise_and_a_target_behind_the_array_are_invalid() -> None:
    offsets = np.array([[0.05, 0.0]] * 20 + [[2.5, 0.0]] * 20)
    errors = measured(DishArrayParams(), offsets[:20], 0.0) + measured(DishArrayParams(), offsets[20:], 70.0, 4)
    assert not any(error.valid for error in errors)


@pytest.fixture(scope="module")
def flown() -> tuple[StationSetup, PassLog, list[PointingError]]:
    """The top of a pass over the shipped 2-m rotator, tracked by its array alone."""
    epoch_t_s = load_elements(SourceParams()).epoch_t_s
    window = first_pass_above(
        StationSetup("rotator_2m").track(), epoch_t_s, math.radians(40.0), math.radians(30.0), 4.0 * 86400.0
    )
    window = dataclasses.replace(window, los_t_s=window.aos_t_s + 90.0)
    start = {
        "antenna.start_azimuth_deg": (math.degrees(window.aos_azimuth_rad) + 180.0) % 360.0 - 180.0,
        "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
    }
    # Far enough ahead of its elements for the ephemeris alone to miss it.
    changes = {"antenna_servo": start, "rf_receiver": {"source.along_track_offset_s": 6.0}}
    setup = StationSetup("rotator_2m", changes=changes)
    array = setup.sets("array_tracker")["array"]
    source, tracker, errors = SimulatedDishArray(array, 1), DishArrayTracker(array), list[PointingError]()

    def measure(reception: Reception) -> PointingError:
        errors.append(tracker.measure(source.receive(reception.truth)))
        return errors[-1]

    setup.array = measure
    return setup, simulate_pass(setup, window, window.aos_t_s - 5.0, "array"), errors


def test_a_dish_tracks_a_pass_by_its_array_alone(flown: tuple[StationSetup, PassLog, list[PointingError]]) -> None:
    setup, log, errors = flown
    assert set(log.mode) <= {Mode.IDLE, Mode.SLEW, Mode.PROGRAM_TRACK, Mode.ARRAY, Mode.COAST}
    late = np.array(log.t_s) > log.t_s[0] + 30.0
    assert np.mean(np.array(log.mode)[late] == Mode.ARRAY) == 1.0
    radial_deg = np.degrees(np.hypot(*log.errors_rad().T))
    # The ephemeris alone would be 6 s late.
    track, times = setup.track(), np.array(log.t_s)[late]
    predicted, real = track.sample(times), track.sample(times + 6.0)
    alone = np.hypot(
        *sky_offset_rad(real.azimuth_rad, real.elevation_rad, predicted.azimuth_rad, predicted.elevation_rad)
    )
    assert np.degrees(np.min(alone)) > 1.0
    rms = float(np.sqrt(np.mean(radial_deg[late] ** 2)))
    single = math.degrees(float(np.median([np.sqrt(0.5 * np.trace(e.covariance_rad2)) for e in errors if e.valid])))
    print(f"pointing error {rms:.3f} deg rms, one error by the bound {single:.3f} deg in each axis")
    assert rms < 0.1 * math.degrees(setup.sets("pointing_controller")["machine"].half_power_beamwidth_rad)
    assert rms < single * math.sqrt(2.0)


def test_valid_errors_of_the_pass_are_as_large_as_their_covariance(
    flown: tuple[StationSetup, PassLog, list[PointingError]],
) -> None:
    _, log, errors = flown
    middle = np.array(log.t_s) - 0.5 * PERIOD_S
    true = np.column_stack([np.interp(middle, log.t_s, axis) for axis in log.errors_rad().T])
    for error, offset in list(zip(errors, true, strict=True))[50:]:
        if error.valid:
            miss = offset - [error.cross_elevation_rad, error.elevation_rad]
            assert np.all(np.abs(miss) < 5.0 * np.sqrt(np.diag(error.covariance_rad2)))


def test_without_an_array_the_sensor_is_refused() -> None:
    window = first_pass_above(
        StationSetup("rotator_2m").track(), load_elements(SourceParams()).epoch_t_s, 0.6, 0.5, 4.0 * 86400.0
    )
    with pytest.raises(ValueError, match="sensor=array needs an array"):
        simulate_pass(StationSetup("rotator_2m"), window, window.aos_t_s, Sensor.ARRAY)
    with pytest.raises(ValueError, match=re.escape("sensor=array: X band of Goldstone DSS-13 has")):
        simulate_pass(StationSetup("dss13"), window, window.aos_t_s, Sensor.ARRAY)


def test_an_error_is_stamped_in_the_middle_of_its_block_in_whole_microseconds() -> None:
    (first,) = measured(TURNED, np.array([[0.02, -0.03]]), 60.0)
    assert first.t_s == round(1.0 - 0.5 * PERIOD_S, 6)
    source, tracker = SimulatedDishArray(TURNED, 3), DishArrayTracker(TURNED)
    error = tracker.measure(source.receive(truth(2.12345678, np.array([0.02, -0.03]), 60.0)))
    assert error.t_s == pytest.approx(2.123457 - 0.5 * PERIOD_S, abs=1e-9)
    assert (tracker.counts, tracker.last_reason) == ({"valid": 1, "invalid": 0}, "")
    weak = tracker.measure(source.receive(truth(3.0, np.array([0.02, -0.03]), 0.0)))
    assert (tracker.counts, tracker.last_reason) == ({"valid": 1, "invalid": 1}, weak.reason)
    assert weak.carrier_to_noise_db_hz >= 0.0


def test_an_offset_is_that_of_the_sky() -> None:
    azimuth, elevation, beam = 1.3, 0.9, (1.1, 0.8)
    offset = np.array([float(part) for part in sky_offset_rad(azimuth, elevation, *beam)])
    forward, up = unit_vector_from_azel(*beam), unit_vector_from_azel(beam[0], beam[1] + math.pi / 2.0)
    right = np.array([math.cos(beam[0]), -math.sin(beam[0]), 0.0])
    sky = unit_vector_from_azel(azimuth, elevation)
    np.testing.assert_allclose(direction_from_offset(offset), [sky @ right, sky @ up, sky @ forward], atol=1e-12)
    np.testing.assert_allclose(
        offset_from_direction(direction_from_offset(offset), np.zeros((3, 3)))[0], offset, atol=1e-12
    )


def test_the_covariance_is_carried_along_as_differences_are() -> None:
    offset = np.array([0.4, -0.7])
    slopes = np.stack(
        [
            (direction_from_offset(offset + step) - direction_from_offset(offset - step)) / 2e-6
            for step in 1e-6 * np.eye(2)
        ],
        axis=1,
    )
    wanted = np.array([[4.0, 1.0], [1.0, 2.0]])
    found = offset_from_direction(direction_from_offset(offset), slopes @ wanted @ slopes.T)[1]
    np.testing.assert_allclose(found, wanted, rtol=1e-8)


def test_on_the_axis_the_sky_is_flat() -> None:
    direction, covariance = np.array([3e-10, -4e-10, 1.0]), np.diag([4.0, 9.0, 0.0]) + 0.5
    offset, spread = offset_from_direction(direction, covariance)
    np.testing.assert_array_equal(offset, direction[:2])
    np.testing.assert_array_equal(spread, [[4.5, 0.5], [0.5, 9.5]])
    np.testing.assert_array_equal(direction_from_offset(offset), direction)
