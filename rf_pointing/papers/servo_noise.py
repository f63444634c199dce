"""Rows of BWG Sec. V: what averaging a cluster of N monopulse samples gains, in theory and in the
running loop.

    r_s = sigma_N^2 / sigma_av^2,   sigma_av^2 / sigma_N^2 = mean over the noise band of |D(f)|^2,
    |D(f)|^2 = (1 / N^2) [N + 2 sum_{k=1..N-1} (N - k) cos(2 pi f k dt)]              (Fejer kernel)

exact for noise that is flat between f_o and f_c; white noise is f_o = 0 and gives N (BWG eq. 17).
"""

import math

import numpy as np

from rf_pointing.controllers import PositionLoopParams
from rf_pointing.papers.row import Row, near
from rf_pointing.papers.servo_pass import PassSetup, fly

CLUSTER, SAMPLE_S, CUT_OFF_HZ = 5, 0.02, 8.0
SNR_DB = 20.0
PLAIN = PositionLoopParams(notch_enabled=False)


def noise_rows(seed: int = 1) -> list[Row]:
    """Return the averaging rows."""
    white = 10.0 * math.log10(averaging_gain(0.0))
    coloured = averaging_gain(CUT_OFF_HZ)
    return [
        Row("SNR gained by averaging 5 samples, white noise", "BWG eq. 17, 18", 7.0, white, "dB", 0.05),
        # r_s of such noise, integrated apart; a misprinted cut-off would be doubled.
        Row(
            "SNR gained by averaging 5 samples, noise above 8 Hz", "BWG Fig. 27", 17.0, 10.0 * math.log10(coloured),
            "dB", 1.0, remark=
            f"exact for noise flat from 8 to 25 Hz: r_s = {coloured:.1f}; flat noise gives the paper's simulated 50 "
            f"from {_cut_off_hz(50.0):.1f} Hz on, so its noise was not flat above 8 Hz",
            due=near(10.0 * math.log10(37.3) if _cut_off_hz(50.0) > 1.5 * CUT_OFF_HZ else None, 2e-3),
        ),
        Row(
            "noise power ratio r_s in the running loop, white noise at 20 dB", "BWG Fig. 28", 4.7, _in_the_loop(seed),
            "1", 0.6, remark="paper 6.7 dB; f_m 0.04 Hz, samples at 50 Hz, clusters at 10 Hz",
        ),
    ]  # fmt: skip


def averaging_gain(cut_off_hz: float) -> float:
    """Return r_s of averaging 5 samples of 0.02 s for noise that is flat from `cut_off_hz` to 25
    Hz.
    """
    nyquist = 0.5 / SAMPLE_S
    total = float(CLUSTER)
    for k in range(1, CLUSTER):
        phase = 2.0 * math.pi * k * SAMPLE_S
        mean = (math.sin(phase * nyquist) - math.sin(phase * cut_off_hz)) / (
            phase * (nyquist - cut_off_hz)
        )
        total += 2.0 * (CLUSTER - k) * mean
    return CLUSTER**2 / total


def _cut_off_hz(ratio: float) -> float:
    """Return the lowest f_o (in steps of 0.05 Hz) at which flat noise gives r_s = `ratio`."""
    cuts = np.arange(1.0, 20.0, 0.05)
    gains = np.array([averaging_gain(float(cut)) for cut in cuts])
    return float(cuts[np.argmax(gains >= ratio)])


def _in_the_loop(seed: int) -> float:
    """Return the ratio of the noise that reaches the integrator from last samples to that from
    cluster means.
    """

    def radio(noise: float, cluster: int) -> np.ndarray:
        setup = PassSetup(
            loops=(PLAIN, PLAIN),
            bandwidth_hz=0.04,
            late_s=(0.05, 0.05),
            start_s=-60.0,
            end_s=60.0,
            radio_noise_rad=noise,
            cluster=cluster,
            seed=seed,
        )
        return fly(setup).radio_rad

    quiet = {cluster: radio(0.0, cluster) for cluster in (1, CLUSTER)}
    noise = float(np.sqrt(np.mean(quiet[1][:, 1] ** 2))) * 10.0 ** (-SNR_DB / 20.0)
    heard = {cluster: np.var(radio(noise, cluster) - quiet[cluster], axis=0) for cluster in quiet}
    return float(np.mean(heard[1] / heard[CLUSTER]))
