"""Rows on wind: what feedforward does not change, and the row the paper lacks, the best controller
on this plant.

Headline errors are flown with the real code on the whole plant (friction, play, encoder steps);
margins, and the antennas that differ from the model, come from exact sampled responses.
"""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from rf_pointing.controllers import (
    TUNED_RADIO_BANDWIDTH_HZ,
    LqgDesign,
    PositionLoopParams,
    dss13_loops,
    dss13_lqg_loops,
    load_lqg_designs,
)
from rf_pointing.controllers.margins import RadioLoop
from rf_pointing.core import MDEG
from rf_pointing.core.types import Array
from rf_pointing.papers.row import Row
from rf_pointing.papers.servo_linear import WIND, closed_loop
from rf_pointing.papers.servo_pass import Law, PassSetup, fly
from rf_pointing.papers.servo_sampled import (
    LawResponse,
    LoopQuality,
    loop_quality,
    published_radio,
    sampled_axis,
    station_radio,
)
from rf_pointing.papers.servo_trajectory import LowOrbitPass
from rf_pointing.servo import WindParams, dss13_plant, wind_torque_n_m
from rf_pointing.station.antenna.axis_response import AxisResponse, Variation

Responses = tuple[LawResponse, LawResponse]

PUBLISHED = PositionLoopParams(notch_enabled=False)
WIND_8 = WindParams(mean_speed_m_s=8.0)
SPAN_S = (-180.0, 180.0)
SETTLE_S = 20.0
RADIO_WAITS_S = (0.06, 0.13, 0.2)
"""Times from the newest sample to the command for which the station's margins are taken, its own
and shorter ones.
"""
VARIATIONS = [
    Variation(round(0.9 + 0.02 * step, 2), residue)
    for step in range(11)
    for residue in (0.7, 1.0, 1.3)
]
"""Modes up to 10 % off in steps of 2 %, residues 30 % off and right."""


def wind_rows(seed: int = 1) -> list[Row]:
    """Return wind rejection and best-controller rows."""
    return [*_rejection(), *_best(seed)]


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
            "wind to beam, with over without feedforward, largest difference from 1", "BWG Sec. II", 0.0, worst, "1",
            1e-9,
        )
    ]  # fmt: skip


@cache
def _response(axis: int, variation: Variation) -> AxisResponse:
    return sampled_axis(dss13_plant(ideal=True), axis, variation)


@cache
def _wind_gain() -> tuple[float, float]:
    """Return rms over the pass of wind acceleration per gust speed, cross-elevation and elevation,
    rad/s^2 per m/s.
    """
    plant, orbit = dss13_plant(), LowOrbitPass()
    step = 1e-3
    gains = []
    for azimuth, elevation in orbit.at(
        np.arange(SPAN_S[0] + SETTLE_S, SPAN_S[1], 4.0)
    ).position_rad:

        def torque(
            along: float, across: float, az: float = azimuth, el: float = elevation
        ) -> Array:
            return np.array(wind_torque_n_m(WIND_8, along, across, az, el))

        along = (torque(8.0 + step, 0.0) - torque(8.0 - step, 0.0)) / (2.0 * step)
        across = WIND_8.lateral_ratio * (torque(8.0, step) - torque(8.0, -step)) / (2.0 * step)
        inertia = np.array([plant.azimuth.inertia_kg_m2, plant.elevation.inertia_kg_m2])
        gains.append((along**2 + across**2) / inertia**2 * (math.cos(elevation) ** 2, 1.0))
    cross, elevation = np.sqrt(np.mean(gains, axis=0))
    return float(cross), float(elevation)


def _responses(
    azimuth: PositionLoopParams | LqgDesign, elevation: PositionLoopParams | LqgDesign
) -> Responses:
    return LawResponse(azimuth), LawResponse(elevation)


def _qualities(laws: Responses, radio_loop: RadioLoop, variation: Variation) -> list[LoopQuality]:
    return [
        loop_quality(_response(axis, variation), law, radio_loop, 8.0)
        for axis, law in enumerate(laws)
    ]


def _total_mdeg(qualities: list[LoopQuality]) -> float:
    if not all(quality.stable for quality in qualities):
        return math.inf
    errors = [
        gain * quality.rms_s2_per_m_s for gain, quality in zip(_wind_gain(), qualities, strict=True)
    ]
    return math.hypot(*errors) / MDEG


def _best(seed: int) -> list[Row]:
    """The row the paper lacks, by the tuned PI loops and by the model-based law, each with the
    radio loop around it.
    """
    published = _flown_mdeg((PUBLISHED, PUBLISHED), None, seed)
    tuned, designs = dss13_loops("tuned"), load_lqg_designs()
    beside = dss13_lqg_loops()
    margins = ", ".join(
        f"{d.gain_margin_db:.1f} dB and {math.degrees(d.phase_margin_rad):.0f} deg" for d in designs
    )
    best = _Controller("best controller", tuned, _responses(*tuned))
    lqg = _Controller(
        "LQG with integral action",
        ((designs[0], beside[0]), (designs[1], beside[1])),
        _responses(*designs),
    )
    f_m = TUNED_RADIO_BANDWIDTH_HZ
    there = [replace(station_radio(f_m), wait_s=wait_s) for wait_s in RADIO_WAITS_S]
    station = f"errors of 0.1 s, mean of five, 0.2 s to the command (margins also {RADIO_WAITS_S[0]} and {RADIO_WAITS_S[1]} s)"
    slow = _total_mdeg(_qualities(lqg.responses, station_radio(0.5 * f_m), Variation()))
    fast = _total_mdeg(_qualities(lqg.responses, station_radio(f_m), Variation()))
    late = (
        "the radio loop, 0.49 s late by averages and commands, amplifies what the gusts leave about 0.6 Hz: linear "
        f"{fast:.3f} mdeg, at half the f_m {slow:.3f}. The PI loops leave less there and are the station's default"
    )
    return [
        *best.rows(
            "BWG Fig. 12 loop",
            [published_radio(f_m)],
            seed,
            f"published PI with feedforward on the same pass and wind {published:.2f} mdeg; tuned PI with notch and shaping "
            f"section, f_m {f_m} Hz; whole plant, real code",
        ),
        *best.rows("station's loop", there, seed, station),
        *lqg.rows(
            "BWG Fig. 12 loop",
            [published_radio(f_m)],
            seed,
            f"designed from identified models; margins of the encoder loops (az, el) {margins}",
        ),
        *lqg.rows("station's loop", there, seed, station, late),
    ]


@dataclass(frozen=True, slots=True)
class _Controller:
    """Laws of both axes and their responses."""

    name: str
    laws: tuple[Law, Law]
    responses: Responses

    def rows(
        self, where: str, loops: list[RadioLoop], seed: int, remark: str, miss: str = ""
    ) -> list[Row]:
        """Return error and margins in the last of some radio loops, margins of other antennas in
        all of them.

        `miss` explains an error above 0.5 mdeg.
        """
        name, off = f"{self.name}, {where}", "worst of modes +-10 %, residues +-30 %"
        nominal = _qualities(self.responses, loops[-1], Variation())
        varied = [
            _qualities(self.responses, loop, variation)
            for variation in VARIATIONS
            for loop in loops
        ]
        worst = max(_total_mdeg(qualities) for qualities in varied)
        flown = _flown_mdeg(self.laws, loops[-1], seed)
        nominal_mdeg = _total_mdeg(nominal)
        return [
            _row(
                f"{name}, 8 m/s, LEO pass: total radial error (rms)",
                flown,
                0.5,
                "mdeg",
                remark,
                miss,
                nominal_mdeg,
            ),
            _row(f"{name}: sensitivity peak of encoder and radio loops", _peak(nominal), 2.0, "1"),
            _row(f"{name}: same, {off}", max(_peak(qualities) for qualities in varied), 2.0, "1"),
            _row(
                f"{name}: total error, {off} (linear)", worst, 0.5, "mdeg", "", miss, nominal_mdeg
            ),
        ]


def _flown_mdeg(loops: tuple[Law, Law], radio_loop: RadioLoop | None, seed: int) -> float:
    setup = PassSetup(
        plant=dss13_plant(),
        loops=loops,
        bandwidth_hz=radio_loop.bandwidth_hz if radio_loop else 0.0,
        radio_delay_s=radio_loop.wait_s if radio_loop else 0.0,
        cluster=radio_loop.cluster if radio_loop else 1,
        mean_of=radio_loop.mean_of if radio_loop else 1,
        start_s=SPAN_S[0],
        end_s=SPAN_S[1],
        wind=WIND_8,
        seed=seed,
    )
    error = fly(setup).after(SPAN_S[0] + SETTLE_S).beam_rad
    return math.sqrt(float(np.mean(np.sum(error**2, axis=1)))) / MDEG


def _peak(qualities: list[LoopQuality]) -> float:
    return max(max(quality.encoder_peak, quality.radio_peak) for quality in qualities)


def _row(
    quantity: str,
    ours: float,
    asked: float,
    unit: str,
    remark: str = "",
    miss: str = "",
    linear: float = math.nan,
) -> Row:
    """Return a row; `miss` explains the `linear` error, as other gusts and plants raise it."""
    missed = bool(miss) and ours > asked
    return Row(
        quantity, "beyond the paper", asked, ours, unit, 0.0, bound="<=", remark=miss if missed else remark,
        due=(0.9 * linear, 1.25 * linear) if missed and math.isfinite(linear) else None,
    )  # fmt: skip
