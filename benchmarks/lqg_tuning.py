"""Makes the LQG designs for DSS-13 that the package brings, `rf_pointing/controllers/dss13_lqg.json`.

The model of each axis is identified from the experiment on the simulated antenna (8 sequences of 8192 samples).  The
weights are those with the smallest rms beam error under Davenport's wind at 8 m/s, with the sensitivity peaks of encoder
and radio loop (f_m 0.2 Hz) below 1.95 for modes 10 % and residues 30 % off, and at most 25 (rad/s)/rad of gain from 5 Hz
on: the terms on which the PI loops were tuned (`servo_tuning.py`).  Nelder-Mead from the weights in force; a few minutes
per axis.  Run from the repository: `scripts/run-python -m benchmarks.lqg_tuning > benchmarks/lqg_tuning.txt`.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from benchmarks.servo_tuning import VARIATIONS
from rf_pointing.controllers import TUNED_RADIO_BANDWIDTH_HZ, LawMatrices, LqgDesign
from rf_pointing.controllers.filters import SectionParams
from rf_pointing.controllers.lqg import LqgWeights, law_matrices
from rf_pointing.controllers.lqg_design import design_lqg, drive_of, lqg_gains, save_lqg_designs
from rf_pointing.core import AXES
from rf_pointing.identification import STRAIGHT, ExcitationParams, StateSpace
from rf_pointing.identification.identify import identify
from rf_pointing.papers.servo_identification import record
from rf_pointing.papers.servo_sampled import LawResponse, LoopQuality, loop_quality, published_radio, sampled_axis
from rf_pointing.servo import dss13_plant
from rf_pointing.station.antenna.axis_response import AxisResponse

PEAK, HIGH_GAIN, HIGH_HZ = 1.95, 25.0, 5.0
SEQUENCES, SEED = 8, 1
TARGET = Path(__file__).parent.parent / "rf_pointing" / "controllers" / "dss13_lqg.json"
NAMES = tuple(LqgWeights.__dataclass_fields__)
STARTS = (
    (1.546, 0.2352, 1.928, 0.4863, 5.947, 0.5619, 0.01212, 0.7827, 1.001),
    (2.197, 0.1028, 2.015, 0.01784, 6.737, 0.4725, 0.05502, 1.001, 1e-8),
)


def identified(axis: str) -> StateSpace:
    data = record(axis, SEQUENCES, SEED, ExcitationParams(), bending="bwg")
    return identify(data.input_rad_s, data.output_rad(axis), data.sample_s, STRAIGHT).model


def weights(values: np.ndarray) -> LqgWeights:
    return LqgWeights(**dict(zip(NAMES, np.exp(values).tolist(), strict=True)))


def design(model: StateSpace, values: np.ndarray) -> LqgDesign:
    return design_lqg(model.a, model.b, model.c, model.d, model.sample_s, weights(values))


@dataclass(frozen=True)
class Trial:
    """A law without the margins on its model, which cost ten times the rest of a design."""

    weights: LqgWeights
    drive: tuple[float, float]

    @property
    def notch(self) -> SectionParams:
        return self.weights.notch

    def matrices(self, sample_s: float) -> LawMatrices:
        return law_matrices(lqg_gains(*self.drive, sample_s, self.weights), self.weights, sample_s)


def judge(law: LqgDesign | Trial, responses: list[AxisResponse]) -> tuple[list[LoopQuality], float]:
    """Return the qualities on every antenna and the largest gain of the law from 5 Hz on."""
    response = LawResponse(law)
    found = [loop_quality(antenna, response, published_radio(TUNED_RADIO_BANDWIDTH_HZ), 8.0) for antenna in responses]
    return found, float(np.max(np.abs(response.gain[responses[0].frequency_hz >= HIGH_HZ])))


def cost(values: np.ndarray, drive: tuple[float, float], responses: list[AxisResponse]) -> float:
    try:
        found, high = judge(Trial(weights(values), drive), responses)
    except (ValueError, np.linalg.LinAlgError):
        return 1e3
    unstable = sum(not quality.stable for quality in found)
    if unstable:
        return 1e2 + unstable
    peak = max(max(quality.encoder_peak, quality.radio_peak) for quality in found)
    return found[0].rms_s2_per_m_s + 10.0 * max(0.0, peak - PEAK) + 0.05 * max(0.0, high - HIGH_GAIN)


def tune(number: int) -> LqgDesign:
    model = identified(AXES[number])
    responses = [sampled_axis(dss13_plant(ideal=True), number, variation) for variation in VARIATIONS]
    values, drive = np.log(STARTS[number]), drive_of(model.a, model.b, model.c, model.sample_s)
    for _ in range(5):
        options = {"maxfev": 400, "xatol": 1e-3, "fatol": 1e-6}
        values = minimize(cost, values, (drive, responses), method="Nelder-Mead", options=options).x
    law = design(model, values)
    report(AXES[number], law, *judge(law, responses))
    return law


def report(axis: str, law: LqgDesign, found: list[LoopQuality], high: float) -> None:
    peaks = [max(quality.encoder_peak, quality.radio_peak) for quality in found]
    print(
        f"{axis}, f_m {TUNED_RADIO_BANDWIDTH_HZ} Hz: rms per m/s gust acceleration {found[0].rms_s2_per_m_s:.5f} s^2/(m/s) "
        f"(worst {max(q.rms_s2_per_m_s for q in found):.5f}), peak sensitivity {peaks[0]:.3f} (worst {max(peaks):.3f}), "
        f"gain from {HIGH_HZ:.0f} Hz on {high:.1f} (rad/s)/rad"
    )
    print("   ", ", ".join(f"{name} {getattr(law.weights, name):.4g}" for name in NAMES))
    sys.stdout.flush()


def main() -> None:
    azimuth, elevation = (tune(number) for number in (0, 1))
    save_lqg_designs(TARGET, azimuth, elevation)


if __name__ == "__main__":
    main()
