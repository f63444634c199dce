"""Rows on wind: what feedforward does not change, and the row the paper lacks, the best controller on this plant.

Headline errors are flown with the real code on the whole plant (friction, play, encoder steps); margins, and the
antennas that differ from the model, come from exact sampled responses.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import (
    TUNED_RADIO_BANDWIDTH_HZ,
    LqgDesign,
    LqgWeights,
    PositionLoopParams,
    dss13_loops,
)
from rf_pointing.geometry import MDEG
from rf_pointing.reproduce.row import Row
from rf_pointing.reproduce.servo_linear import WIND, closed_loop
from rf_pointing.reproduce.servo_pass import PassSetup, fly
from rf_pointing.reproduce.servo_sampled import AxisResponse, LoopQuality, Variation, loop_quality
from rf_pointing.reproduce.servo_trajectory import LowOrbitPass
from rf_pointing.servo import WindParams, discretise, dss13_plant, linear_model, wind_torque_n_m

__all__ = ["LQG_WEIGHTS", "lqg_designs", "wind_rows"]

Array = NDArray[np.float64]
Laws = tuple[PositionLoopParams, PositionLoopParams] | tuple[LqgDesign, LqgDesign]

PUBLISHED = PositionLoopParams(notch_enabled=False)
WIND_8 = WindParams(mean_speed_m_s=8.0)
SPAN_S = (-180.0, 180.0)
SETTLE_S = 20.0
VARIATIONS = [Variation(f, 1.3) for f in (0.9, 0.95, 0.98, 1.02, 1.05, 1.1)]
VARIATIONS += [Variation(f, 0.7) for f in (0.9, 1.0, 1.1)]
NEUTRAL_SHAPING = {
    "shaping_zero_hz": 1.0,
    "shaping_zero_damping": 0.7,
    "shaping_pole_hz": 1.0,
    "shaping_pole_damping": 0.7,
}
"""A zero on its own pole: the section of the law passes everything."""

LQG_WEIGHTS = (
    LqgWeights(
        notch_frequency_hz=1.579,
        notch_damping=0.79,
        control_weight=7.51e-4,
        disturbance_intensity=0.118,
        rate_intensity=0.333,
        **NEUTRAL_SHAPING,
    ),
    LqgWeights(
        notch_frequency_hz=2.268,
        notch_damping=0.265,
        control_weight=0.0227,
        disturbance_intensity=0.059,
        rate_intensity=5e-6,
        **NEUTRAL_SHAPING,
    ),
)


def wind_rows(seed: int = 1) -> list[Row]:
    """Return wind rejection and best-controller rows."""
    return [*_rejection(), *_best(seed), *_lqg()]


def lqg_designs() -> tuple[LqgDesign, LqgDesign]:
    """Return the LQG designs (azimuth, elevation) for the nominal plant's own sampled models."""
    from rf_pointing.controllers.design_lqg import design_lqg

    designs = []
    for axis, weights in enumerate(LQG_WEIGHTS):
        model = linear_model(dss13_plant(ideal=True))
        name = ("azimuth", "elevation")[axis]
        kept = [i for i, state in enumerate(model.state_names) if name in state]
        step = discretise(model.a[np.ix_(kept, kept)], model.b_command[kept][:, [axis]], 0.02)
        shown = model.encoder[axis, kept][None, :]
        designs.append(design_lqg(step[:, :-1], step[:, -1:], shown, np.zeros((1, 1)), 0.02, weights))
    return designs[0], designs[1]


def _rejection() -> list[Row]:
    """Wind torque to beam with and without feedforward: the feedforward is outside the loop."""
    frequency = np.geomspace(1e-3, 10.0, 400)
    responses = []
    for gain in (1.0, 0.0):
        loop = closed_loop(dss13_plant(ideal=True), (PUBLISHED.replace(feedforward_gain=gain),) * 2)
        responses.append(np.abs(loop.response(frequency, loop.beam, WIND)))
    worst = float(np.max(np.abs(responses[0] / responses[1] - 1.0)[:, [0, 1], [0, 1]]))
    return [
        Row(
            quantity="wind to beam, with over without feedforward, largest difference from 1",
            source="BWG Sec. II",
            paper=0.0,
            ours=worst,
            unit="1",
            tolerance=1e-9,
        )
    ]


@cache
def _response(axis: int, variation: Variation) -> AxisResponse:
    return AxisResponse(dss13_plant(ideal=True), axis, variation)


@cache
def _wind_gain() -> tuple[float, float]:
    """Return rms over the pass of wind acceleration per gust speed, cross-elevation and elevation, rad/s^2 per m/s."""
    plant, orbit = dss13_plant(), LowOrbitPass()
    step = 1e-3
    gains = []
    for azimuth, elevation in orbit.at(np.arange(SPAN_S[0] + SETTLE_S, SPAN_S[1], 4.0)).position_rad:

        def torque(along: float, across: float, az: float = azimuth, el: float = elevation) -> Array:
            return np.array(wind_torque_n_m(WIND_8, along, across, az, el))

        along = (torque(8.0 + step, 0.0) - torque(8.0 - step, 0.0)) / (2.0 * step)
        across = WIND_8.lateral_ratio * (torque(8.0, step) - torque(8.0, -step)) / (2.0 * step)
        inertia = np.array([plant.azimuth.inertia_kg_m2, plant.elevation.inertia_kg_m2])
        gains.append((along**2 + across**2) / inertia**2 * (math.cos(elevation) ** 2, 1.0))
    cross, elevation = np.sqrt(np.mean(gains, axis=0))
    return float(cross), float(elevation)


def _qualities(laws: Laws, radio_hz: float, variation: Variation) -> list[LoopQuality]:
    chosen: list[PositionLoopParams | LqgDesign] = [laws[0], laws[1]]
    return [loop_quality(_response(axis, variation), law, radio_hz, 8.0) for axis, law in enumerate(chosen)]


def _total_mdeg(qualities: list[LoopQuality]) -> float:
    if not all(quality.stable for quality in qualities):
        return math.inf
    errors = [gain * quality.rms_s2_per_m_s for gain, quality in zip(_wind_gain(), qualities, strict=True)]
    return math.hypot(*errors) / MDEG


def _best(seed: int) -> list[Row]:
    tuned = dss13_loops("tuned")
    flown = [
        _flown_mdeg(loops, f_m, seed) for loops, f_m in (((PUBLISHED,) * 2, 0.0), (tuned, TUNED_RADIO_BANDWIDTH_HZ))
    ]
    nominal = _qualities(tuned, TUNED_RADIO_BANDWIDTH_HZ, Variation())
    varied = [_qualities(tuned, TUNED_RADIO_BANDWIDTH_HZ, variation) for variation in VARIATIONS]
    worst = max(_total_mdeg(quality) for quality in varied)
    return [
        _row(
            "best controller, 8 m/s, LEO pass: total radial error (rms)",
            flown[1],
            0.5,
            "mdeg",
            f"PI with feedforward on the same pass and wind {flown[0]:.2f} mdeg; tuned PI with notch and shaping section, "
            f"radio loop of f_m {TUNED_RADIO_BANDWIDTH_HZ} Hz at 10 Hz with 0.1 s delay; whole plant, real code",
        ),
        _row("best controller: sensitivity peak of encoder and radio loops", _peak(nominal), 2.0, "1"),
        _row(
            "best controller: same, worst of modes +-10 % and residues +-30 %",
            max(_peak(quality) for quality in varied),
            2.0,
            "1",
        ),
        _row("best controller: total error, worst of the same (linear)", worst, 0.5, "mdeg"),
    ]


def _lqg() -> list[Row]:
    """The model-based law, with the encoder loop alone and with the radio loop around it."""
    designs = lqg_designs()
    nominal = _qualities(designs, TUNED_RADIO_BANDWIDTH_HZ, Variation())
    varied = [_qualities(designs, TUNED_RADIO_BANDWIDTH_HZ, variation) for variation in VARIATIONS]
    worst = max(_peak(quality) for quality in varied)
    total = _total_mdeg(nominal)
    remark = (
        "measured: at the same sensitivity the law with a rolled-off estimator gives up the direct path of the PI, which "
        f"costs bandwidth; margins {designs[1].gain_margin_db:.1f} dB, {math.degrees(designs[1].phase_margin_rad):.0f} deg"
    )
    return [
        _row(
            "LQG with integral action, 8 m/s, LEO pass: total radial error (linear)", total, 0.5, "mdeg", remark, True
        ),
        _row("LQG: sensitivity peak, worst of modes +-10 % and residues +-30 %", worst, 2.0, "1"),
    ]


def _flown_mdeg(loops: tuple[PositionLoopParams, ...], f_m: float, seed: int) -> float:
    setup = PassSetup(
        plant=dss13_plant(),
        loops=(loops[0], loops[1]),
        bandwidth_hz=f_m,
        start_s=SPAN_S[0],
        end_s=SPAN_S[1],
        wind=WIND_8,
        seed=seed,
    )
    error = fly(setup).after(SPAN_S[0] + SETTLE_S).beam_rad
    return math.sqrt(float(np.mean(np.sum(error**2, axis=1)))) / MDEG


def _peak(qualities: list[LoopQuality]) -> float:
    return max(max(quality.encoder_peak, quality.radio_peak) for quality in qualities)


def _row(quantity: str, ours: float, asked: float, unit: str, remark: str = "", explained: bool = False) -> Row:
    return Row(
        quantity=quantity,
        source="beyond the paper",
        paper=asked,
        ours=ours,
        unit=unit,
        tolerance=0.0,
        bound="<=",
        remark=remark,
        explained=explained,
    )
