"""Planted truth: level, frequency and sigma that come out are those that went in."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.core import AXES
from rf_pointing.receiver import SignalMeter
from rf_pointing.receiver.band import band_bound
from rf_pointing.receiver.carrier import power_bound
from rf_pointing.receiver.iq_sources import decoded
from rf_pointing.receiver.params import SignalSearchParams
from rf_pointing.receiver.serving import PAYLOAD
from test.receiver.planted import PIECE_S, START_S, Planted, mean_db, ratios

WITHIN_DB = 0.3
"""Accuracy that is promised from 25 to 90 dB-Hz."""
BYTES = {"cu8": 2, "ci16": 4, "cf32": 8}
BAND = SignalSearchParams(kind="band", band_hz=1.4e4)


def sigmas_off(planted: Planted, measured: list, level_db_hz: float) -> float:
    """Return by how many of its sigmas the mean differs from the truth."""
    ratio, sigma = ratios(measured)
    return float((np.mean(ratio) - 10.0 ** (0.1 * level_db_hz)) / (np.mean(sigma) / math.sqrt(len(ratio))))


@pytest.mark.parametrize("level_db_hz", [25.0, 35.0, 60.0, 90.0])
def test_the_level_of_a_carrier_and_its_sigma(level_db_hz: float) -> None:
    planted = Planted(level_db_hz)
    measured = planted.run(14.0)
    ratio, sigma = ratios(measured)
    # A strong carrier's scatter is below its sigma: that of the noise density is common to all.
    spread = float(np.std(ratio) / np.mean(sigma))
    assert (0.75 < spread < 1.3) if level_db_hz < 80.0 else spread < 1.3
    chance_db = 4.343 * float(np.mean(sigma) / np.mean(ratio)) / math.sqrt(len(ratio))
    assert abs(mean_db(measured) - level_db_hz) < WITHIN_DB + (0.5 * chance_db if level_db_hz < 30.0 else 0.0)
    assert planted.meter.carrier.locked
    assert not planted.meter.problem(planted.time_s(planted.index))


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_weak_carrier_has_no_bias_beyond_chance(seed: int) -> None:
    planted = Planted(25.0, radio={"seed": seed})
    assert abs(sigmas_off(planted, planted.run(14.0), 25.0)) < 4.0


@pytest.mark.parametrize("doppler_hz", [-1e5, 1e5])
def test_doppler_of_100_khz_at_1_khz_a_second_with_a_clock_that_is_50_ppm_off(doppler_hz: float) -> None:
    planted = Planted(
        45.0, rate_hz=1.2e6, doppler_hz=doppler_hz, slope_hz_s=-math.copysign(1e3, doppler_hz), clock_ppm=50.0,
        signal=SignalSearchParams(uncertainty_hz=1.5e5),
    )  # fmt: skip
    measured = planted.run(5.0)
    assert abs(mean_db(measured) - 45.0) < WITHIN_DB
    # What the clock adds: 50 ppm of the centre; that of the carrier's offset is below a hertz.
    assert planted.meter.carrier.offset_hz == pytest.approx(-50e-6 * (2.25e9 - 1.2e5), abs=10.0)


@pytest.mark.parametrize(("level_db_hz", "slope_hz_s"), [(45.0, 1e3), (55.0, -1e3)])
def test_a_frequency_that_nothing_predicts(level_db_hz: float, slope_hz_s: float) -> None:
    planted = Planted(level_db_hz, slope_hz_s=slope_hz_s, doppler_hz=-3.0 * slope_hz_s, predicted=False)
    assert abs(mean_db(planted.run(5.0)) - level_db_hz) < WITHIN_DB
    assert planted.meter.carrier.locked


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk", "fm"])
@pytest.mark.parametrize("level_db_hz", [25.0, 35.0, 60.0, 90.0])
def test_the_power_of_a_modulated_signal(modulation: str, level_db_hz: float) -> None:
    # Carson's band holds 98 % of FM.
    radio = {"modulation": modulation, "symbol_rate_hz": 1e3 if modulation == "fm" else 1e4}
    signal = SignalSearchParams(kind="band", band_hz=1e4 if modulation == "fm" else 1.4e4)
    planted = Planted(level_db_hz, signal=signal, radio=radio)
    measured = planted.run(12.0, settle_s=3.0)
    assert abs(mean_db(measured) - level_db_hz) < WITHIN_DB
    ratio, sigma = ratios(measured)
    # The noise density is common to all of them: where it dominates they scatter by less.
    assert 0.7 < np.std(ratio) / np.mean(sigma) < 1.4
    assert planted.meter.found or level_db_hz < 30.0


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk"])
def test_a_weak_band_is_found_in_a_long_average_wherever_the_clock_puts_it(modulation: str) -> None:
    signal = BAND.replace(uncertainty_hz=9e4)
    planted = Planted(25.0, signal=signal, clock_ppm=30.0, radio={"modulation": modulation, "symbol_rate_hz": 1e4})
    seconds = 0.0
    while not planted.meter.found and seconds < 25.0:
        planted.run(1.0)
        seconds += 1.0
    assert seconds > 2.0, "in a second it is three sigmas of a radiometer"
    planted.run(5.0)
    due_hz = -30e-6 * (2.25e9 - 2.4e4)
    assert planted.meter.band.centre_bins * planted.meter.layout.bin_hz == pytest.approx(due_hz, abs=3e3)


@pytest.mark.parametrize("slope", [0.0, 0.02])
def test_noise_on_a_slope_is_no_weak_band(slope: float) -> None:
    """A response 1 + j a exp(-j w): 0.35 dB from end to end."""
    planted, before = Planted(-30.0, signal=BAND, predicted=False), np.zeros(1, dtype=np.complex64)
    for _ in range(round(40.0 / PIECE_S)):
        piece = planted.piece()
        samples = np.concatenate([before, piece.samples[0]])
        before = samples[-1:]
        sloped = (samples[1:] + 1j * slope * samples[:-1])[None, :].astype(np.complex64)
        planted.meter.take(replace(piece, samples=sloped))
        assert not planted.meter.found


def test_the_bounds_stand_beside() -> None:
    planted = Planted(50.0)
    measured = planted.run(6.0)
    watts = measured[0].power.power_w / ratios(measured)[0][0]
    seconds = measured[0].power.integration_s
    assert measured[0].bound_w / watts == pytest.approx(power_bound(ratios(measured)[0][0], seconds))
    # Nothing is better than the bound, and the estimate is within 15 % of it.
    share = np.mean([each.power.sigma_w / each.bound_w for each in measured])
    assert 1.0 <= share < 1.15
    weak = Planted(30.0, signal=BAND, radio={"modulation": "qpsk"})
    found = weak.run(12.0, settle_s=3.0)
    bound = band_bound(ratios(found)[0][0], weak.meter.band.band_hz, found[0].power.integration_s)
    assert found[0].bound_w / watts == pytest.approx(bound)
    assert 1.0 <= np.mean([each.power.sigma_w / each.bound_w for each in found]) < 1.6


@pytest.mark.parametrize("signal", [SignalSearchParams(), BAND], ids=["carrier", "band"])
def test_a_step_of_the_gain_is_taken_out(signal: SignalSearchParams) -> None:
    modulation = "cw" if signal.kind == "carrier" else "qpsk"
    planted = Planted(50.0, signal=signal, radio={"bits": 0, "modulation": modulation})
    planted.run(4.0)
    scaled = []
    for _ in range(150):
        piece = planted.piece()
        piece.samples[:] *= 2.0
        scaled += planted.meter.take(piece)
    assert planted.meter.noise.steps == 1
    assert planted.meter.noise.step_db == pytest.approx(6.02, abs=0.3)
    assert all(abs(each.power.carrier_to_noise_db_hz - 50.0) < 1.0 for each in scaled)
    assert "has changed by +" in planted.meter.problem(planted.time_s(planted.index))


def test_a_line_beside_the_signal_is_kept_out_of_it() -> None:
    beside = Planted(50.0, radio={"line_db_hz": 60.0, "line_offset_hz": 25e3})
    measured = beside.run(5.0)
    assert abs(mean_db(measured) - 50.0) < WITHIN_DB
    assert beside.meter.state.line is not None
    assert beside.meter.state.line.offset_hz == pytest.approx(25e3, abs=100.0)
    assert beside.meter.state.line.level_db_hz == pytest.approx(60.0, abs=2.0)
    assert not beside.meter.problem(beside.time_s(beside.index)), "outside of what is searched"


@pytest.mark.parametrize("kind", ["carrier", "band"])
@pytest.mark.parametrize(("line_db_hz", "named"), [(-100.0, False), (45.0, False), (49.0, True)])
def test_a_line_like_the_signal_is_a_problem(kind: str, line_db_hz: float, named: bool) -> None:
    radio = {"line_db_hz": line_db_hz, "line_offset_hz": -15e3}
    radio |= {"modulation": "bpsk", "symbol_rate_hz": 4e3} if kind == "band" else {}
    planted = Planted(50.0, signal=SignalSearchParams(kind=kind, band_hz=6e3), radio=radio)
    assert abs(mean_db(planted.run(6.0, settle_s=3.0)) - 50.0) < WITHIN_DB
    problem = planted.meter.problem(planted.time_s(planted.index))
    words = "interference: a line of (48|49|50) dB-Hz at -1[45][.][0-9]+ kHz from the predicted"
    assert bool(re.search(f"{words} frequency, where the signal has 50 dB-Hz", problem)) == named
    assert bool(problem) == named


@pytest.mark.parametrize("size", [PAYLOAD, 4800], ids=["datagrams", "pieces"])
@pytest.mark.parametrize("format_", ["ends", "cu8", "ci16", "cf32"])
def test_random_numbers_are_named(format_: str, size: int, random: np.random.Generator) -> None:
    planted = Planted(55.0)
    planted.run(3.0)
    for _ in range(round(2.0 / PIECE_S)):
        piece = planted.piece()
        count = piece.samples.shape[1]
        if format_ == "ends":
            parts = 2.0 * random.integers(0, 2, (1, 2 * count)).astype(np.float32) - 1.0
            samples, clipped = parts.view(np.complex64), 1.0
        else:
            samples, clipped = decoded(random.bytes(count * BYTES[format_]), format_)
        for first in range(0, samples.shape[1], size):
            part = replace(piece, samples=samples[:, first : first + size], index=piece.index + first, clipped=clipped)
            planted.meter.take(part)
    problem = planted.meter.problem(planted.time_s(planted.index))
    assert problem.startswith("the samples are random numbers of full scale: garbage")
    assert abs(mean_db(planted.run(4.0, settle_s=2.0)) - 55.0) < WITHIN_DB
    assert "garbage" not in planted.meter.problem(planted.time_s(planted.index))


@pytest.mark.parametrize("noise_dbfs", [-45.0, -9.0, 10.0])
@pytest.mark.parametrize("level_db_hz", [-20.0, 60.0])
def test_noise_is_no_garbage(noise_dbfs: float, level_db_hz: float) -> None:
    planted = Planted(level_db_hz, radio={"noise_dbfs": noise_dbfs})
    planted.run(4.0)
    problem = planted.meter.problem(planted.time_s(planted.index))
    # Noise at the ends of the scale is random: without a signal nobody can tell.
    assert ("garbage" in problem) == (noise_dbfs == 10.0 and level_db_hz < 0.0)
    assert ("clipped" in problem) == (noise_dbfs > -10.0 and level_db_hz > 0.0)


def test_a_dropout_is_lost_named_and_found_again() -> None:
    planted = Planted(lambda t_s: -20.0 if 4.0 < t_s < 7.0 else 50.0)
    planted.run(6.5)
    assert not planted.meter.carrier.tracking
    assert "no signal" in planted.meter.problem(planted.time_s(planted.index))
    assert abs(mean_db(planted.run(4.0, settle_s=2.0)) - 50.0) < WITHIN_DB
    assert planted.meter.carrier.jumps == 0


@pytest.mark.parametrize("turns", [-6.0, -2.3, -1.0, 0.5, 1.4, 2.0, 4.0])
@pytest.mark.parametrize(("level_db_hz", "rate_hz"), [(35.0, 2.4e5), (60.0, 4.8e4), (60.0, 1e6)])
def test_a_small_jump_does_not_leave_the_loop_on_an_image(level_db_hz: float, rate_hz: float, turns: float) -> None:
    """A step in the time of the samples moves the prediction by so many turns an integration."""
    planted = Planted(level_db_hz, rate_hz=rate_hz)
    planted.run(3.0)
    jump_hz = turns / planted.meter.layout.hop_s
    planted.carrier_hz += jump_hz
    assert abs(mean_db(planted.run(3.0, settle_s=1.5)) - level_db_hz) < WITHIN_DB
    assert planted.meter.carrier.offset_hz == pytest.approx(jump_hz, abs=3.0)


def test_a_signal_at_another_frequency_is_named_as_a_jump() -> None:
    planted = Planted(50.0)
    planted.run(3.0)
    planted.level = -20.0
    planted.run(2.0)
    planted.level, planted.carrier_hz = 50.0, planted.carrier_hz + 7e3
    planted.run(2.0)
    assert planted.meter.carrier.jump_hz == pytest.approx(7e3, abs=20.0)
    assert "+7.0 kHz from where it was: retuned" in planted.meter.problem(planted.time_s(planted.index))


def test_lost_samples_do_not_shift_the_time() -> None:
    planted = Planted(50.0)
    planted.run(3.0)
    for _ in range(3):
        planted.piece()
    measured = planted.run(2.0, settle_s=0.5)
    assert abs(mean_db(measured) - 50.0) < WITHIN_DB
    assert measured[-1].power.t_s == pytest.approx(planted.time_s(planted.index), abs=0.13)


def test_stamps_are_the_time_at_the_antenna() -> None:
    """A level that falls at a known time is measured to fall then."""
    falls_s = 3.2
    planted = Planted(lambda t_s: 60.0 if t_s < falls_s else 57.0)
    measured = planted.run(5.0)
    after = [each for each in measured if each.power.t_s - each.power.integration_s >= START_S + falls_s + 1e-6]
    before = [each for each in measured if each.power.t_s <= START_S + falls_s]
    assert all(abs(each.power.carrier_to_noise_db_hz - 57.0) < WITHIN_DB for each in after)
    assert all(abs(each.power.carrier_to_noise_db_hz - 60.0) < WITHIN_DB for each in before)
    assert len(before) + len(after) >= len(measured) - 1


def test_a_carrier_outside_the_received_span_is_named() -> None:
    planted = Planted(50.0, doppler_hz=2e5)
    planted.run(2.0)
    assert "outside the 240 kHz that are received" in planted.meter.problem(planted.time_s(planted.index))


def test_three_channels_give_clusters_whose_ratio_is_that_of_the_feed() -> None:
    truth = np.array([1.0, 0.2 - 0.01j, -0.1 + 0.02j])
    planted = Planted(60.0, volts=truth, signal=SignalSearchParams(channels=3))
    clusters = [each.cluster for each in planted.run(4.0)]
    assert all(cluster is not None for cluster in clusters)
    total = np.concatenate([cluster.sum for cluster in clusters])
    for axis, name in enumerate(AXES):
        part = clusters[0].difference_cross_elevation if name == AXES[0] else clusters[0].difference_elevation
        assert len(part) == len(clusters[0].t_s) >= 7
        values = np.concatenate(
            [c.difference_cross_elevation if axis == 0 else c.difference_elevation for c in clusters]
        )
        assert np.vdot(total, values) / np.vdot(total, total) == pytest.approx(truth[1 + axis], abs=2e-3)
    # The noise of a sample is N0 / T in the unit of the cluster.
    each_s = float(np.mean(np.diff(clusters[0].t_s)))
    assert np.var(total - np.mean(total)) * each_s == pytest.approx(1.0, rel=0.3)


def test_a_drift_of_a_difference_channel_is_named() -> None:
    """Gain of signal and noise alike, and phase."""
    planted = Planted(60.0, rate_hz=4.8e4, signal=SignalSearchParams(channels=3), volts=[1.0, 0.2, -0.1])
    planted.run(8.0)
    assert planted.meter.balance.problem == ""
    for _ in range(round(70.0 / PIECE_S)):
        piece = planted.piece()
        piece.samples[1] *= 10.0 ** (-1.5 / 20.0) * np.exp(1j * math.radians(25.0))
        planted.meter.take(piece)
    balance = planted.meter.balance
    assert balance.gain_drift_db == pytest.approx([-1.5, 0.0], abs=0.2)
    assert np.degrees(balance.phase_drift_rad) == pytest.approx([25.0, 0.0], abs=1.0)
    assert "cross-elevation: gain -1." in balance.problem
    assert "; elevation" not in balance.problem


def test_a_meter_that_is_made_anew_at_another_rate_says_so() -> None:
    planted = Planted(50.0)
    meter: SignalMeter = planted.meter
    other = Planted(50.0, rate_hz=1.2e5)
    for _ in range(round(2.0 / PIECE_S)):
        meter.take(other.piece())
    assert meter.layout.rate_hz == 1.2e5
    assert "the source's rate is 120000 sample/s, stated 240000" in meter.problem(START_S + 2.0)
