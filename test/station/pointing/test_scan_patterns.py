"""Searches and scans: where they lead, what they need of the axes, and what sensors and an array cost on a pass."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.controllers import TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.core import MDEG, MU, Mode, Motion, random_stream
from rf_pointing.planning import AxisRates
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.scan_patterns import UNDERWAY_S, ScanPatterns, Scans, loop_offsets_rad, sensor_cost
from rf_pointing.tracking import AutotrackParams, SkyMotion, SpiralParams, SpiralSearch, TrimFilter, TrimParams
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.scan import ScanParams
from rf_pointing.tracking.sensors import SENSORS


@pytest.mark.parametrize(
    "changes", [{}, {"mean_of": 5, "mean_within_rad": 4e-3}, {"bandwidth_hz": 0.5}, {"offset_limit_rad": 2e-3}]
)
def test_the_loops_are_those_of_the_tracking_integrator(changes: dict[str, float]) -> None:
    params = dataclasses.replace(TrackerIntegratorParams(bandwidth_hz=0.2, offset_limit_rad=0.1), **changes)
    noise = 0.01 * random_stream(4, "loops").standard_normal((300, 2, 3))
    found, underway = loop_offsets_rad(params, noise), round(UNDERWAY_S / params.sample_s)
    for column in range(3):
        loop, offsets = TrackerIntegrator(params), np.zeros((300, 2))
        loop.reset(0.0)
        for k in range(300):
            t_s = k * params.sample_s
            seen = offsets[k - underway] if k >= underway else np.zeros(2)
            loop.update(t_s, noise[k, :, column] - seen)
            offsets[k] = loop.at(t_s)[0]
        np.testing.assert_allclose(found[:, :, column], offsets, atol=1e-12)
        assert np.abs(offsets).max() > 1e-3


def test_a_linear_loop_loses_what_its_noise_bandwidth_says() -> None:
    """a / (2 - a) of the variance of white noise, a = 2 pi f T, for a loop that is slow against its delay."""
    params = TrackerIntegratorParams(bandwidth_hz=0.02, offset_limit_rad=0.1, acceleration_rad_s2=1.0)
    noise = 1e-3 * random_stream(4, "loops").standard_normal((6000, 2, 40))
    gain = 2.0 * np.pi * params.bandwidth_hz * params.sample_s
    variance = np.mean(np.square(loop_offsets_rad(params, noise)[1000:]))
    assert variance == pytest.approx(1e-6 * gain / (2.0 - gain), rel=0.1)


CONSCAN = ConscanParams(radius_rad=6.0 * MDEG, period_s=4.0, ramp_s=2.0)
PROBE = ScanParams(radius_rad=0.2 * MDEG, period_s=1.0, ramp_s=1.0)
BEAM_RAD = 65.0 * MDEG
RIGHT, UP, RANGE_M = 0.006, -0.008, 1e6
EARLY = TrimParams(along_track_s=3.0, cross_track_m=300.0, bias_rad=0.0)
"""A target that moves at 10 mrad/s and may be 30 mrad early or late, but 0.3 mrad off its track."""


def scans(spiral: SpiralParams | None = None, probe: ScanParams | None = PROBE) -> Scans:
    sets = ControllerParams(conscan=CONSCAN)
    return Scans(spiral or SpiralParams(half_power_beamwidth_rad=BEAM_RAD), sets.calibration.scan, probe, sets)


def sky(count: int = 1, bend: float = 0.0) -> SkyMotion:
    """The target's motion, its direction turning by `bend` from row to row."""
    angle = math.atan2(UP, RIGHT) + bend * np.arange(count)
    return SkyMotion(0.01 * np.cos(angle), 0.01 * np.sin(angle), np.full(count, RANGE_M))


@pytest.mark.parametrize(
    ("elevation", "rate", "bend", "share"),
    [
        (0.0, 0.0, 0.0, 1.0),
        # What the azimuth has left of its rate, times the cosine of the elevation, for the rate of the circle.
        (1.0, 0.03, 0.0, (0.0301 - 0.03) * math.cos(1.0) / (6.0 * MDEG * 0.5 * math.pi)),
        (1.0, -0.03, 0.0, (0.0301 - 0.03) * math.cos(1.0) / (6.0 * MDEG * 0.5 * math.pi)),
        (1.2, 0.0, 0.0138, (0.01396 - 0.0138) * math.cos(1.2) / (6.0 * MDEG * (0.5 * math.pi) ** 2)),
        (math.pi - 1.2, 0.0, -0.0138, (0.01396 - 0.0138) * math.cos(1.2) / (6.0 * MDEG * (0.5 * math.pi) ** 2)),
        (1.0, 0.04, 0.0, 0.0),
    ],
)
def test_near_the_zenith_a_scan_is_as_large_as_the_azimuth_has_rate_and_acceleration_left(
    elevation: float, rate: float, bend: float, share: float
) -> None:
    limits = AxisRates((0.0301, 1e-9), (0.01396, 1e-9))
    target = Motion(np.array([[1.0, elevation]]), np.array([[rate, 1.0]]), np.array([[bend, 1.0]]))
    patterns = ScanPatterns(scans())
    patterns.begin("conscan", 100.0, TrimFilter(EARLY), None)
    assert patterns.running == "conscan"
    # The circle is sampled in steps of 0.05 s, which sees 0.999 of it.
    assert patterns.share(target, limits) == pytest.approx([share], rel=0.01)
    patterns.begin(Mode.SEARCH, 100.0, TrimFilter(EARLY), None)
    assert patterns.share(target, limits).tolist() == [1.0], "the way of a search must not change"
    patterns.begin("program_track", 100.0, TrimFilter(EARLY), None)
    assert patterns.running == ""


@pytest.mark.parametrize("bend", [0.0, 0.002])
def test_a_target_that_is_early_or_late_is_searched_in_strips_along_its_track(bend: float) -> None:
    """Three sigmas of 30 mrad along the track; a quarter of a beamwidth across it, however sure the filter is."""
    spiral = SpiralParams(half_power_beamwidth_rad=BEAM_RAD, uncertainty_rad=30e-3, rate_rad_s=5e-3)
    assert SpiralSearch(spiral).duration_s > 30.0
    patterns, times = ScanPatterns(scans(spiral)), 100.0 + 0.05 * np.arange(4000)
    patterns.begin(Mode.SEARCH, 100.0, TrimFilter(EARLY), sky())
    assert patterns.running == Mode.SEARCH
    rows = sky(len(times), bend)
    offset, rate = patterns.at(times, rows)
    unit = np.column_stack(rows[:2]) / 0.01
    along = np.einsum("ni,ni->n", offset, unit)
    left = unit[:, 0] * offset[:, 1] - unit[:, 1] * offset[:, 0]
    assert np.max(np.abs(along)) == pytest.approx(90e-3, rel=0.01)
    pitch = 0.6 * BEAM_RAD
    # 3 x 0.25 beamwidths to either side, in strips of 0.6 beamwidths: one beside the middle.
    assert np.max(np.abs(left)) == pytest.approx(pitch, rel=0.01)
    assert {round(each / pitch) for each in left if abs(each / pitch - round(each / pitch)) < 0.01} == {-1, 0, 1}
    inside = np.abs(np.gradient(along, times)) > 4e-3
    np.testing.assert_allclose(
        rate[1:-1][inside[1:-1]], np.gradient(offset, times, axis=0)[1:-1][inside[1:-1]], atol=1e-4
    )


@pytest.mark.parametrize(
    ("spiral", "motion"),
    [
        # Short enough; a target without a motion that is known; one that stands.
        (SpiralParams(half_power_beamwidth_rad=BEAM_RAD), sky()),
        (SpiralParams(half_power_beamwidth_rad=BEAM_RAD, uncertainty_rad=30e-3, rate_rad_s=5e-3), None),
        (
            SpiralParams(half_power_beamwidth_rad=BEAM_RAD, uncertainty_rad=30e-3, rate_rad_s=5e-3),
            SkyMotion(np.array([5e-6]), np.array([5e-6]), np.array([RANGE_M])),
        ),
    ],
)
def test_any_other_target_is_searched_in_a_spiral(spiral: SpiralParams, motion: SkyMotion | None) -> None:
    patterns, times = ScanPatterns(scans(spiral)), np.array([100.0, 103.0, 111.0])
    patterns.begin(Mode.SEARCH, 100.0, TrimFilter(EARLY), motion)
    offset, rate = patterns.at(times, sky(3))
    wanted = np.array([SpiralSearch(spiral).offset(t_s - 100.0) for t_s in times])
    np.testing.assert_allclose(np.hstack([offset, rate]), wanted, atol=1e-15)


@pytest.mark.parametrize(("along_track_s", "sigma_rad"), [(0.02, 0.25 * BEAM_RAD), (0.07, 0.7e-3), (1.0, 1.2e-3)])
def test_what_the_filter_has_learned_makes_the_spiral_as_small_as_it_is_sure(
    along_track_s: float, sigma_rad: float
) -> None:
    """At least a quarter of a beamwidth, at most what is configured."""
    spiral = SpiralParams(half_power_beamwidth_rad=BEAM_RAD, uncertainty_rad=1.2e-3)
    known = TrimFilter(TrimParams(along_track_s=along_track_s, cross_track_m=1.0, bias_rad=0.0))
    patterns = ScanPatterns(scans(spiral))
    for used, size in ((0, 1.2e-3), (5, sigma_rad)):
        known.state = dataclasses.replace(known.state, used=used)
        patterns.begin(Mode.SEARCH, 100.0, known, sky())
        offset, _ = patterns.at(np.array([107.0]), sky())
        wanted = SpiralSearch(spiral.replace(uncertainty_rad=size)).offset(7.0)
        np.testing.assert_allclose(offset[0], wanted[:2], atol=1e-9)


WIDE = TrimParams(along_track_s=0.05, cross_track_m=0.0, bias_rad=0.8e-3)
TABLE = AutotrackParams()


def test_without_a_sensor_the_error_of_the_prediction_costs_its_mean_gain() -> None:
    """Sigmas of 0.94 mrad along and 0.8 mrad across: E[exp(-mu e^2 / h^2)] of each axis by itself."""
    found = sensor_cost(None, scans(), WIDE, TABLE, sky())
    sigmas = (math.hypot(0.05 * 0.01, 0.8e-3), 0.8e-3)
    assert found.power == pytest.approx(
        math.prod(1.0 / math.sqrt(1.0 + 2.0 * MU * (s / BEAM_RAD) ** 2) for s in sigmas)
    )
    assert (found.acquisition_s, found.memory_s) == (0.0, math.inf)


@pytest.mark.parametrize("name", ["conscan", "monopulse"])
def test_a_sensor_costs_its_search_on_average_and_the_loss_of_its_scan(name: str) -> None:
    """Against 3000 targets drawn at random, each found when the spiral first comes within half a beamwidth of it."""
    chosen, sensor = scans(), SENSORS[name]
    found = sensor_cost(sensor, chosen, WIDE, TABLE, sky())
    radius = 6.0 * MDEG if name == "conscan" else 0.2 * MDEG
    assert found.power == pytest.approx(math.exp(-MU * (radius / BEAM_RAD) ** 2), rel=1e-6)
    assert found.memory_s == TABLE.coast_s
    times = np.arange(0.0, TABLE.search_s, 0.1)
    way = np.array([SpiralSearch(chosen.spiral).offset(t_s)[:2] for t_s in times])
    drawn = random_stream(2, "targets").standard_normal((3000, 2))
    ahead = np.array([RIGHT, UP]) / 0.01
    left = np.array([-ahead[1], ahead[0]])
    targets = drawn[:, :1] * math.hypot(0.05 * 0.01, 0.8e-3) * ahead + drawn[:, 1:] * 0.8e-3 * left
    # A scan begins with what is left after a drop, a stare within half power.
    at_once = BEAM_RAD * math.sqrt(TABLE.beam_drop_db / 10.0 * math.log(10.0) / MU) if sensor.scans else 0.5 * BEAM_RAD
    taken = []
    for target in targets:
        if math.hypot(*target) <= at_once:
            taken.append(0.0)
            continue
        passed = np.hypot(*(way - target).T) <= 0.5 * BEAM_RAD
        found_s = float(times[np.argmax(passed)]) if passed.any() else TABLE.search_s
        taken.append(TABLE.settle_s + found_s + (TABLE.search_turn_s if sensor.scans else 0.0))
    # The mean of 3000 is known to 2 %; the quantiles leave out the outermost twentieth.
    assert found.acquisition_s == pytest.approx(float(np.mean(taken)), rel=0.1)
    assert found.acquisition_s > 1.0
