"""Samples to points: each second and each 10 s against lines fitted piece by piece, outliers against a plain loop."""

import numpy as np
import pytest

from rf_pointing.calibration.noise import noise_of
from rf_pointing.calibration.thinning import Thinned, find_outliers, smooth, thin

START_S = 1.7e9
MEDIAN_TO_SIGMA = 1.4826


def samples(random, rates=(8.0, 5.0, 1.0, 8.0), lengths_s=(95.0, 61.0, 70.0, 33.0)):
    """Return times, passes and two channels (n, 2) of passes with gaps, at other rates each."""
    parts = []
    for number, (rate, length) in enumerate(zip(rates, lengths_s, strict=True)):
        own = START_S + 4000.0 * number + 3.3 * number + np.arange(0.0, length, 1.0 / rate)
        parts.append(own[random.random(len(own)) > (0.25 if rate > 1.0 else 0.0)])
    t_s = np.concatenate(parts)
    passes = np.repeat(np.arange(len(parts)) + 7, [len(part) for part in parts])
    drift = 1e-5 * (t_s - START_S - 4000.0 * (passes - 7))
    return t_s, passes, np.column_stack([drift, -2.0 * drift]) + random.normal(size=(len(t_s), 2)) * [1e-3, 3e-3]


def by_pieces(t_s, passes, values, length_s, fewest):
    """Return the points of a loop over pieces: time, pass, means, count, variance about a line, freedom."""
    rows = []
    for number in np.unique(passes):
        for piece in np.unique(np.floor(t_s[passes == number] / length_s)):
            own = (passes == number) & (np.floor(t_s / length_s) == piece)
            if np.sum(own) < fewest:
                continue
            times, count = t_s[own] - np.mean(t_s[own]), int(np.sum(own))
            line = np.polyfit(times, values[own], 1)
            left = values[own] - np.outer(times, line[0]) - line[1]
            rows.append(
                (
                    np.mean(t_s[own]), number, *np.mean(values[own], axis=0), count,
                    *np.sum(left**2, axis=0) / (count - 2),
                )
            )  # fmt: skip
    return np.array(rows)


def test_points_are_the_means_of_their_pieces_and_scatter_about_the_lines_through_them(random):
    t_s, passes, values = samples(random)
    found = smooth(t_s, passes, values)
    expected = by_pieces(t_s, passes, values, 10.0, 5)
    np.testing.assert_allclose(found.t_s, expected[:, 0], rtol=0.0, atol=1e-6)
    assert found.passes.tolist() == expected[:, 1].tolist()
    np.testing.assert_allclose(found.residuals, expected[:, 2:4], rtol=1e-9)
    assert found.counts.tolist() == expected[:, 4].tolist()
    assert found.freedom.tolist() == (expected[:, 4] - 2.0).tolist()
    np.testing.assert_allclose(found.variance, expected[:, 5:], rtol=1e-6)
    (why, lost), *others = found.dropped.items()
    assert (why, others) == ("in a 10-s piece with fewer than 5 samples", [])
    assert lost == len(t_s) - np.sum(expected[:, 4]) > 0
    pooled = np.sqrt(
        np.sum((expected[:, 4] - 2.0)[:, np.newaxis] * expected[:, 5:], axis=0) / np.sum(expected[:, 4] - 2.0)
    )
    np.testing.assert_allclose(found.noise, pooled, rtol=1e-6)


def test_a_second_is_one_point_of_fast_passes_and_slow_ones_stay_as_they_are(random):
    t_s, passes, values = samples(random)
    found = thin(t_s, passes, values)
    slow = passes == 9
    assert np.array_equal(found.t_s[found.passes == 9], t_s[slow])
    np.testing.assert_allclose(found.residuals[found.passes == 9], values[slow], rtol=1e-12)
    assert np.all(found.freedom[found.passes == 9] == 0.0)
    expected = by_pieces(t_s[~slow], passes[~slow], values[~slow], 1.0, 4)
    fast = found.passes != 9
    np.testing.assert_allclose(found.t_s[fast], expected[:, 0], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.variance[fast], expected[:, 5:], rtol=1e-5)
    assert found.dropped == {"in a 1-s piece with fewer than 4 samples": len(t_s) - int(np.sum(found.counts))}


def test_pieces_without_enough_samples_are_refused():
    t_s = START_S + np.arange(0.0, 60.0, 3.0)
    with pytest.raises(ValueError, match="no 10-s piece has the 5 samples it needs"):
        smooth(t_s, np.zeros(len(t_s), dtype=int), np.zeros((len(t_s), 1)))


def plain_outliers(t_s, passes, residual):
    """Return the samples off the parabolas of their 30-s pieces, found one piece at a time."""
    gross = np.zeros(len(t_s), dtype=bool)
    for number in np.unique(passes):
        rows = np.flatnonzero(passes == number)
        own = np.pad(residual[rows], 4, mode="reflect")
        apart = residual[rows] - np.median(np.lib.stride_tricks.sliding_window_view(own, 9), axis=1)
        gross[rows] = np.abs(apart) > 8.0 * MEDIAN_TO_SIGMA * np.median(np.abs(apart))
    wrong = gross.copy()
    for piece in {(p, k) for p, k in zip(passes.tolist(), np.floor(t_s / 30.0).tolist(), strict=True)}:
        rows = np.flatnonzero((passes == piece[0]) & (np.floor(t_s / 30.0) == piece[1]))
        good = ~gross[rows]
        times = t_s[rows] - t_s[rows[0]]
        for _ in range(10):
            if np.sum(good) < 8:
                break
            left = np.abs(residual[rows] - np.polyval(np.polyfit(times[good], residual[rows][good], 2), times))
            found = good & (left > 3.0 * MEDIAN_TO_SIGMA * np.median(left[good]))
            good &= ~found
            if not np.any(found):
                break
        wrong[rows[~good]] = True
    return wrong


def test_outliers_are_those_off_the_parabola_of_their_piece(random):
    t_s, passes, values = samples(random, rates=(8.0, 2.0, 1.0, 0.25), lengths_s=(200.0, 130.0, 150.0, 70.0))
    bend = 3e-5 * np.mod(t_s - START_S, 4000.0) ** 1.5
    azimuth, elevation = values[:, 0] + bend, values[:, 1] - bend
    azimuth[random.choice(len(t_s), 12, replace=False)] += 0.2
    elevation[[0, 1, len(t_s) - 1]] += [0.05, -0.04, 0.5]
    keep, dropped = find_outliers(t_s, passes, {"azimuth_rad": azimuth, "elevation_rad": elevation})
    wrong = [plain_outliers(t_s, passes, one) for one in (azimuth, elevation)]
    assert np.array_equal(keep, ~(wrong[0] | wrong[1]))
    assert dropped == {
        "azimuth_rad beyond 3 sigma": int(np.sum(wrong[0])),
        "elevation_rad beyond 3 sigma": int(np.sum(wrong[1] & ~wrong[0])),
    }
    assert dropped["azimuth_rad beyond 3 sigma"] >= 12


def test_sigma_of_a_point_is_that_of_its_mean_and_bent_pieces_have_none(random):
    """Noise of 2 mrad across, so 2 / cos E in azimuth, and of 1 mrad upward; one piece has ten times that."""
    count, freedom = 4000, 40.0
    elevation = np.radians(np.concatenate([np.linspace(10.0, 80.0, count // 2), np.linspace(75.0, 12.0, count // 2)]))
    actual = np.column_stack([(2e-3 / np.cos(elevation)) ** 2, np.full(count, 1e-6)])
    variance = actual * random.chisquare(freedom, size=(count, 2)) / freedom
    variance[100] *= [1.0, 100.0]
    variance[3000] *= [100.0, 1.0]
    counts = random.integers(20, 80, count).astype(float)
    points = Thinned(
        START_S + 10.0 * np.arange(count), np.repeat([4, 9], count // 2), np.zeros((count, 2)), counts, variance,
        np.full(count, freedom), {},
    )  # fmt: skip
    sigma, straight = noise_of(points, elevation)
    np.testing.assert_allclose(sigma, np.sqrt(actual / counts[:, np.newaxis]), rtol=0.06)
    assert not straight[100]
    assert not straight[3000]
    assert np.sum(~straight) <= 4
