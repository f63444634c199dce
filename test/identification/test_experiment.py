"""The inputs keep to amplitude, band and travel.

The experiment on the antenna: bounded before it starts, watched while it runs, abortable.

Samples of an experiment, put together as they come; a sequence with a hole is not used.
"""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import random_stream
from rf_pointing.identification import ExcitationParams, IdentificationExperiment, SampleCollector
from rf_pointing.identification.experiment import excitation_rad_s, predicted_travel_rad


def test_peak_is_never_exceeded() -> None:
    params = ExcitationParams(kind="multisine", mean_rad_s=0.0, rms_rad_s=4e-4, peak_rad_s=7e-4)
    assert np.max(np.abs(excitation_rad_s(params, random_stream(1, "excitation")))) <= 7e-4


def test_predicted_travel_is_the_integral_of_the_rate() -> None:
    rate = np.array([1.0, 1.0, -4.0, 1.0])
    assert predicted_travel_rad(rate, 0.5) == (-1.0, 1.0)


def test_white_noise_is_what_the_generator_gives_shifted_and_scaled() -> None:
    params = ExcitationParams(samples=64, peak_rad_s=math.radians(0.09))
    drawn = random_stream(4, "excitation").uniform(-1.0, 1.0, 64)
    wanted = params.mean_rad_s + params.rms_rad_s * (drawn - np.mean(drawn)) / np.std(drawn)
    found = excitation_rad_s(params, random_stream(4, "excitation"))
    assert np.max(wanted) > params.peak_rad_s
    np.testing.assert_allclose(found, np.minimum(wanted, params.peak_rad_s), rtol=1e-12)


def test_multisine_has_equal_amplitudes_and_the_phases_that_were_drawn() -> None:
    """Lines from 1 to 8 Hz of 128 samples of 20 ms: one at every 1 / 2.56 s, both ends within the band."""
    params = ExcitationParams(kind="multisine", samples=128, low_hz=3 / 2.56, high_hz=20 / 2.56, mean_rad_s=1e-4)
    turns = random_stream(4, "excitation").random(18)
    times = np.arange(128) * 0.02
    wanted = sum(
        np.cos(2.0 * np.pi * (line / 2.56 * times + turn)) for line, turn in zip(range(3, 21), turns, strict=True)
    )
    wanted *= params.rms_rad_s / np.std(wanted)
    found = excitation_rad_s(params, random_stream(4, "excitation"))
    np.testing.assert_allclose(found, 1e-4 + wanted, atol=1e-9 * params.rms_rad_s)


@pytest.mark.parametrize(("rates", "travel"), [((0.2, 0.3), (0.0, 0.25)), ((-0.2, -0.3), (-0.25, 0.0))])
def test_travel_to_one_side_leaves_the_start_out_to_the_other(rates: tuple, travel: tuple[float, float]) -> None:
    assert predicted_travel_rad(np.array(rates), 0.5) == pytest.approx(travel)


def test_rms_beyond_the_peak_is_refused() -> None:
    with pytest.raises(ValueError, match=r"together must be <= 0\.001"):
        ExcitationParams(mean_rad_s=math.radians(0.05), rms_rad_s=math.radians(0.03), peak_rad_s=0.001)


def test_a_band_above_half_the_sampling_rate_is_refused() -> None:
    with pytest.raises(ValueError, match=r"high_hz=30\.0 must be <= 25\.0"):
        ExcitationParams(kind="multisine", high_hz=30.0)


PARAMS = ExcitationParams(samples=256)


def experiment(**changes: object) -> IdentificationExperiment:
    options = {
        "params": PARAMS, "axis": "elevation", "sequences": 4, "start_rad": 0.8,
        "travel_rad": (0.1, 1.5), "random": random_stream(1, "excitation"),
    }  # fmt: skip
    return IdentificationExperiment(**(options | changes))


def follow(run: IdentificationExperiment, samples: int) -> np.ndarray:
    position, rates = np.array([0.3, 0.8]), []
    for _ in range(samples):
        rates.append(run.command(position))
        position = position + rates[-1] * PARAMS.sample_s
    return np.array(rates)


def test_records_what_it_commanded_and_measured() -> None:
    run = experiment()
    rates = follow(run, 4 * 256)
    assert run.finished
    recording = run.recording()
    np.testing.assert_array_equal(recording.input_rad_s.ravel(), rates[:, 1])
    np.testing.assert_array_equal(rates[:, 0], np.zeros(1024))
    assert recording.output_rad("azimuth").shape == (4, 256)
    assert (recording.axis, recording.sample_s) == ("elevation", PARAMS.sample_s)
    with pytest.raises(ValueError, match="axis='focus' must be one of azimuth, elevation"):
        recording.output_rad("focus")
    travelled = recording.output_rad("elevation").ravel()
    np.testing.assert_allclose(np.diff(travelled), rates[:-1, 1] * PARAMS.sample_s, atol=1e-12)


def test_sequences_alternate_sides_so_the_axis_comes_back() -> None:
    run = experiment()
    rates = follow(run, 4 * 256)[:, 1].reshape(4, 256)
    assert np.all(np.sign(np.mean(rates, axis=1)) == (1.0, -1.0, 1.0, -1.0))
    assert abs(np.sum(rates)) * PARAMS.sample_s < 1e-9


def test_an_experiment_that_would_leave_the_travel_is_refused_with_the_numbers() -> None:
    with pytest.raises(ValueError, match=r"elevation would run from 1\.4870 to 1\.49\d\d rad, must stay within 0\.11"):
        experiment(start_rad=1.487)


def test_an_experiment_that_would_leave_the_travel_below_is_refused_too() -> None:
    down = PARAMS.replace(mean_rad_s=-PARAMS.mean_rad_s)
    with pytest.raises(
        ValueError, match=r"elevation would run from 0\.10\d\d to 0\.11\d\d rad, must stay within 0\.11"
    ):
        experiment(params=down, start_rad=0.112)
    # The way from there is free to the other side.
    assert not experiment(start_rad=0.112).finished


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sequences": 0}, "sequences=0 must be >= 1"),
        ({"sequences": 1001}, "sequences=1001 must be <= 1000"),
        ({"margin_rad": -0.01}, r"margin_rad=-0\.01 must be >= 0\.0$"),
        ({"start_rad": 0.105}, r"start_rad=0\.105 must be >= 0\.11$"),
        ({"start_rad": 1.495}, r"start_rad=1\.495 must be <= 1\.49$"),
    ],
)
def test_an_experiment_without_sequences_or_room_is_refused(changes: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        experiment(**changes)


def test_the_newest_sample_is_the_last_command_and_the_angles_it_was_given_at() -> None:
    run = experiment()
    with pytest.raises(ValueError, match="no sample has been taken"):
        _ = run.newest
    for count in (1, 2, 256, 257):
        rates = follow(run, count - run.samples_taken)
        rate, encoder, _ = run.newest
        np.testing.assert_array_equal(rate, rates[-1])
        assert rate[1] != 0.0
        # The walk of `follow` begins anew at each call.
        begun = np.array([0.3, 0.8])
        np.testing.assert_allclose(encoder, begun + np.sum(rates[:-1], axis=0) * PARAMS.sample_s, atol=1e-12)
        encoder[:] = 7.0
        assert run.newest[1][0] != 7.0
    assert run.peak_rad_s >= np.max(np.abs(rates))
    assert run.sample_s == PARAMS.sample_s


def test_an_axis_that_leaves_the_travel_ends_it() -> None:
    run = experiment()
    follow(run, 300)
    np.testing.assert_array_equal(run.command((0.3, 1.6)), np.zeros(2))
    assert run.finished
    assert run.abort_reason.startswith("elevation 1.600000 rad left")
    assert run.recording().input_rad_s.shape == (1, 256)


def test_abort_gives_zero_rate_from_then_on() -> None:
    run = experiment()
    follow(run, 10)
    run.abort("operator")
    np.testing.assert_array_equal(run.command((0.3, 0.8)), np.zeros(2))
    assert run.progress == pytest.approx(10 / 1024)
    with pytest.raises(ValueError, match="no sequence is complete: 10 of 256"):
        run.recording()


def test_a_non_finite_encoder_is_refused() -> None:
    with pytest.raises(ValueError, match="encoder_rad"):
        experiment().command((math.nan, 0.8))


def test_an_unknown_axis_is_refused() -> None:
    with pytest.raises(ValueError, match="axis='focus' must be one of azimuth, elevation"):
        experiment(axis="focus")


def test_the_other_axis_runs_at_the_idle_rate_while_the_experiment_lasts() -> None:
    run = experiment(params=PARAMS.replace(idle_rate_rad_s=3e-6), sequences=1)
    np.testing.assert_array_equal(follow(run, 256)[:, 0], 3e-6)
    np.testing.assert_array_equal(run.command((0.3, 0.8)), 0.0)


def filled(skip: tuple[int, ...] = (), missed: tuple[int, ...] = ()) -> SampleCollector:
    """Return three sequences of four samples; before each of `missed` a tick was missed."""
    collector = SampleCollector("elevation", 3, 4, 0.02)
    for sample in range(12):
        if sample not in skip:
            t_s = 1.8e9 + 0.02 * (sample + sum(each <= sample for each in missed))
            collector.take(t_s, "elevation", sample, (0.0, 0.1 * sample), (sample, 2.0 * sample))
    return collector


def test_samples_take_their_places_in_any_order() -> None:
    collector = SampleCollector("azimuth", 2, 3, 0.02)
    for sample in (3, 1, 0, 5, 2, 4):
        collector.take(0.02 * sample, "azimuth", sample, (float(sample), 0.0), (10.0 + sample, 20.0 + sample))
    recording, missing = collector.recording()
    assert missing == 0
    np.testing.assert_array_equal(recording.input_rad_s, [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
    np.testing.assert_array_equal(recording.output_rad("elevation"), [[20.0, 21.0, 22.0], [23.0, 24.0, 25.0]])


def test_a_lost_sample_costs_its_sequence_and_no_other() -> None:
    recording, missing = filled(skip=(5, 6)).recording()
    assert missing == 2
    np.testing.assert_allclose(recording.input_rad_s, [[0.0, 0.1, 0.2, 0.3], [0.8, 0.9, 1.0, 1.1]])


def test_a_sequence_in_which_ticks_were_missed_is_left_out_by_name() -> None:
    """Its input is another than was made."""
    collector = filled(missed=(4, 6))
    assert collector.late == (
        "1 of 3 sequences took up to 0.1 s, must be 0.1 s within 10 %: the antenna missed ticks, its computer was busy"
    )
    recording, missing = collector.recording()
    assert (missing, recording.input_rad_s.tolist()) == (0, filled(skip=(4,)).recording()[0].input_rad_s.tolist())
    with pytest.raises(ValueError, match="no sequence is complete: 12 of 12 samples taken; 3 of 3 sequences took"):
        filled(missed=(1, 6, 9)).recording()
    assert filled(missed=(4, 8)).late == "", "between two sequences nothing is measured"


@given(st.integers(0, 2**32 - 1))
def test_samples_of_a_busy_computer_are_taken_to_their_times(seed: int) -> None:
    """Early, late and missed ticks, angles of any age: the rates add up, and the angles are those of the mount."""
    random, count, period_s = np.random.default_rng(seed), 200, 0.02
    t_s = period_s * np.arange(count) + random.uniform(0.0, 0.8 * period_s, count)
    t_s[random.integers(count) :] += period_s
    # The device measures at its own times; one measurement may serve two commands.
    rate, phase_s = random.normal(size=count), random.uniform(0.0, period_s)
    age_s = (t_s - phase_s) % period_s
    collector = SampleCollector("azimuth", 1, count, period_s)

    def mount_rad(at_s: Any) -> Any:
        return 0.1 * np.sin(2.0 * math.pi * 2.0 * at_s)

    for sample, (at_s, age) in enumerate(zip(t_s, age_s, strict=True)):
        wire_s = at_s + random.uniform(-1e-7, 1e-7)
        collector.take(wire_s, "azimuth", sample, (rate[sample], 0.0), (mount_rad(at_s - age), 0.0), age)
    recording = collector.recording()[0]
    grid_s = t_s[0] + period_s * np.arange(count + 1)
    turned = np.append(0.0, np.cumsum(rate[:-1] * np.diff(t_s)))
    inside = grid_s < t_s[-1]
    evened = np.append(0.0, np.cumsum(recording.input_rad_s[0]) * period_s)
    np.testing.assert_allclose(evened[inside], np.interp(grid_s[inside], t_s, turned), atol=1e-5)
    inner = slice(5, count - 5)
    truth = mount_rad(grid_s[:-1] - np.mean(age_s))
    np.testing.assert_allclose(recording.output_rad("azimuth")[0, inner], truth[inner], atol=2e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("roll", 3, 4, 0.02), "axis='roll' must be one of"),
        (("azimuth", 0, 4, 0.02), "sequences=0 must be >= 1"),
        (("azimuth", 1001, 4, 0.02), "sequences=1001 must be <= 1000"),
        (("azimuth", 3, 0, 0.02), "samples=0 must be >= 1"),
    ],
)
def test_a_collector_of_no_experiment_is_refused(arguments: tuple, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        SampleCollector(*arguments)


@pytest.mark.parametrize(
    ("sample", "words"),
    [
        (("azimuth", 5, (0.0, 0.0), (0.0, 0.0)), "axis='azimuth' must be 'elevation'"),
        (("elevation", 12, (0.0, 0.0), (0.0, 0.0)), "sample=12 must be <= 11"),
        (("elevation", 3, (0.0, 0.0), (0.0, 0.0)), "sample=3 was taken before"),
        (("elevation", 5, (0.0, math.nan), (0.0, 0.0)), "rate_rad_s"),
        (("elevation", 5, (0.0, 0.0), (math.inf, 0.0)), "position_rad"),
        (("elevation", 5, (0.0, 0.0), (0.0, 0.0), math.nan), "age_s=nan"),
    ],
)
def test_a_sample_that_does_not_belong_is_refused_and_not_counted(sample: tuple, words: str) -> None:
    collector = filled(skip=(5,))
    with pytest.raises(ValueError, match=words):
        collector.take(0.1, *sample)
    assert collector.received == 11
