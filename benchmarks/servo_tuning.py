"""Finds the tuned gains of `dss13_loops("tuned")` and the front of wind error against radio bandwidth.

Per axis and radio bandwidth f_m: smallest rms beam error under Davenport's wind at 8 m/s, with the sensitivity peaks
of encoder and radio loop below 1.95 for modes 10 % and residues 30 % off (the published limits of the plant are
checked by `reproduce servo`), and at most 25 (rad/s)/rad of gain at high frequency.  Nelder-Mead from the gains in
force; a few minutes per line.  Run from the repository:
`scripts/run-python -m benchmarks.servo_tuning > benchmarks/servo_tuning.txt`.
"""

import math
import sys

import numpy as np
from scipy.optimize import minimize

from rf_pointing.controllers import PositionLoopParams
from rf_pointing.papers.servo_sampled import LawResponse, LoopQuality, loop_quality, published_radio, sampled_axis
from rf_pointing.servo import dss13_plant
from rf_pointing.station.antenna.axis_response import AxisResponse, Variation

PEAK, HIGH_GAIN = 1.95, 25.0
VARIATIONS = [Variation()]
VARIATIONS += [Variation(frequency, 1.3) for frequency in (0.9, 0.93, 0.96, 0.98, 1.0, 1.02, 1.04, 1.07, 1.1)]
VARIATIONS += [Variation(frequency, 0.7) for frequency in (0.9, 1.0, 1.1)]
NAMES = ("kp", "ki", "notch_hz", "notch_damping", "zero_hz", "zero_damping", "pole_hz", "pole_damping")
STARTS = ((6.76, 19.9, 1.433, 0.061, 1.767, 0.494, 3.39, 0.636), (6.50, 7.91, 2.073, 0.086, 2.040, 0.031, 4.00, 0.588))
RADIO_HZ = (0.05, 0.1, 0.2, 0.3)


def loop(values: np.ndarray) -> PositionLoopParams:
    kp, ki, notch_hz, notch_damping, zero_hz, zero_damping, pole_hz, pole_damping = np.exp(values).tolist()
    return PositionLoopParams(
        proportional_gain=kp,
        integral_gain=ki,
        notch_frequency_hz=notch_hz,
        notch_damping=notch_damping,
        shaping_enabled=True,
        shaping_zero_hz=zero_hz,
        shaping_zero_damping=zero_damping,
        shaping_pole_hz=pole_hz,
        shaping_pole_damping=pole_damping,
    )


def qualities(responses: list[AxisResponse], values: np.ndarray, radio_hz: float) -> list[LoopQuality]:
    law = LawResponse(loop(values))
    return [loop_quality(response, law, published_radio(radio_hz), 8.0) for response in responses]


def cost(values: np.ndarray, responses: list[AxisResponse], radio_hz: float) -> float:
    try:
        found = qualities(responses, values, radio_hz)
    except ValueError:
        return 1e3
    if not all(quality.stable for quality in found):
        return 1e2
    peak = max(max(quality.encoder_peak, quality.radio_peak) for quality in found)
    kp, pole_over_zero = math.exp(values[0]), math.exp(values[6] - values[4])
    excess = 10.0 * max(0.0, peak - PEAK) + 0.05 * max(0.0, kp * pole_over_zero**2 - HIGH_GAIN)
    return found[0].rms_s2_per_m_s + excess


def tune(axis: int, radio_hz: float, start: np.ndarray) -> np.ndarray:
    responses = [sampled_axis(dss13_plant(ideal=True), axis, variation) for variation in VARIATIONS]
    values = start
    for _ in range(3):
        options = {"maxfev": 350, "xatol": 1e-3, "fatol": 1e-4}
        values = minimize(cost, values, (responses, radio_hz), method="Nelder-Mead", options=options).x
    report(axis, radio_hz, values, qualities(responses, values, radio_hz))
    return values


def report(axis: int, radio_hz: float, values: np.ndarray, found: list[LoopQuality]) -> None:
    peaks = [max(quality.encoder_peak, quality.radio_peak) for quality in found]
    print(
        f"{('azimuth', 'elevation')[axis]}, f_m {radio_hz} Hz: rms per m/s gust acceleration "
        f"{found[0].rms_s2_per_m_s:.5f} s^2/(m/s) (worst {max(q.rms_s2_per_m_s for q in found):.5f}), "
        f"peak sensitivity {peaks[0]:.3f} (worst {max(peaks):.3f})"
    )
    print("   ", ", ".join(f"{name} {value:.4g}" for name, value in zip(NAMES, np.exp(values), strict=True)))
    sys.stdout.flush()


def main() -> None:
    for axis, start in enumerate(STARTS):
        values = np.log(start)
        for radio_hz in RADIO_HZ:
            values = tune(axis, radio_hz, values)


if __name__ == "__main__":
    main()
