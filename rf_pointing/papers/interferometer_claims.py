"""Statements in the text of PI83: design chain of chapters 7 and 8, estimators, links.

Also the direction estimator that PI83 tried first: nine separate ranges instead of three sums
(p. 35).
"""

import math

import numpy as np

from rf_pointing.array_sensors.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
    euler_from_attitude,
    forward_angles,
)
from rf_pointing.array_sensors.interferometer.initializer import Geometry
from rf_pointing.array_sensors.interferometer.radio import LinkParams
from rf_pointing.array_sensors.interferometer.relative_pose import (
    attitude_from_directions,
    reverse_direction,
)
from rf_pointing.array_sensors.interferometer.sequence import (
    SequenceParams,
    minimum_variance_step,
    track,
    turned_direction,
)
from rf_pointing.array_sensors.interferometer.system import ArrayParams, CarrierPlan, two_way_ranges
from rf_pointing.core.types import Array
from rf_pointing.papers.interferometer_accuracy import (
    direction_variance_from_gradients,
    range_variance_from_gradients,
    roll_variance,
)
from rf_pointing.papers.interferometer_design import (
    Requirements,
    carrier_tracking_design,
    difference_tracking_design,
    direction_requirement_m,
    minimum_difference_hz,
    range_requirement_m,
    required_ratio,
)
from rf_pointing.papers.interferometer_transponder import (
    mixed_snr,
    nonlinear_reflector,
    simple_repeater,
)
from rf_pointing.papers.row import Row, near

_AHEAD = np.array([1.0, 0.0, 0.0])
_DOUBLE_DB = 10.0 * math.log10(2.0)
_RANGE_M = 1e4
_DITHER_RAD = 0.01
_PASSES = 20


def _db(ratio: float) -> float:
    return 10.0 * math.log10(ratio)


def _row(
    quantity: str,
    section: str,
    paper: float,
    ours: float,
    unit: str,
    tolerance: float,
    *,
    bound: str = "==",
    remark: str = "",
    due: float | None = None,
    within: float = 0.003,
) -> Row:
    """Return a row; one that does not hold is explained while ours is `due`, what `remark` makes of
    it.
    """
    return Row(
        quantity, f"PI83 {section}", paper, ours, unit, tolerance, bound=bound, remark=remark,
        due=near(due, within),
    )  # fmt: skip


def chain_rows() -> list[Row]:
    """Return the design numbers of chapters 7 and 8."""
    needs, plan = Requirements(), CarrierPlan()
    # Published forms throughout: these rows check the report's arithmetic, the next ones its
    # formulas.
    cft, dft = (
        design(needs, variant="published")
        for design in (carrier_tracking_design, difference_tracking_design)
    )
    return [
        _row("lowest difference frequency", "(8-1)", 1500.0, minimum_difference_hz(1e5, 6.0)[0], "Hz", 0.5),
        _row("f0 with room for noise", "(8-2)", 1250.0, minimum_difference_hz(1e5, 6.0)[1], "Hz", 0.5),
        _row(
            "sigma of a range for the distance requirement", "(8-5)", 0.1095, range_requirement_m(needs), "m", 5e-5,
            remark="six times 3.33 mm; the print has 1/36 = 0.278 and forgets to square, which gives 0.1095 m",
            due=6.0 * 0.01 / 3.0,
        ),
        _row("sigma of a range for the direction requirement", "(8-7)", 3.53e-3, cft.range_sigma_m, "m", 1e-5),
        _row(
            "the same from the printed 0.0333 rad", "(8-6)", 3.53e-3,
            direction_requirement_m(needs.replace(direction_sigma_rad=0.0333), "published"), "m", 1e-5,
            remark="misprint: 3.33 mrad is meant, 0.0333 rad would give ten times the printed 3.53 mm",
            due=10.0 * 3.53e-3,
        ),
        _row(
            "the same for a diameter of 1 m", "section 4.3", 3.53e-3,
            direction_requirement_m(needs.replace(radius_m=0.5)), "m", 1e-5,
            remark="0.4448 holds for a radius of 1 m as in the listings, not for the diameter named in the text",
            due=0.5 * 3.53e-3,
        ),
        _row("largest difference, nu = 6 from 1500 Hz", "section 8.1", 420.0, 1500.0 * 6.0**7 / 1e6, "MHz", 0.5),
        _row(
            "largest difference of the simulated plan", "section 8.1", 420.0, plan.offsets_hz[-1] / 1e6, "MHz", 0.5,
            remark="420 MHz is 1500 Hz times 6^7; the listing's plan starts at f0 = 1250 Hz with nu = 6.1324",
            due=420.0 * 1250.0 / 1500.0 * (6.1324 / 6.0) ** 7, within=1e-3,
        ),
        _row("CFT phase sigma", "(8-10)", 0.185, cft.phase_sigma_rad, "rad", 5e-4),
        _row("CFT power ratio for direction", "(8-11)", 14.7, _db(cft.snr_direction), "dB", 0.05),
        _row("amplitude power ratio for roll", "(8-13)", 40.0, _db(cft.snr_roll), "dB", 0.01),
        _row("largest pattern ripple", "(8-14)", 0.061, cft.ripple_db, "dB", 5e-4),
        _row("largest hardware phase", "(8-16)", 25.7, math.degrees(cft.phase_bias_rad), "deg", 0.05),
        _row("CFT power ratio for ambiguity, p = 0.001/8", "section 8.1", 19.7, _db(cft.snr_ambiguity), "dB", 0.1),
        _row("the same, p = 0.001/9 as in the text", "section 8.1", 19.7, _db(required_ratio(6.0, 0.001 / 9)), "dB",
             0.1),
        _row("DFT phase sigma", "(8-22)", 0.00739, dft.phase_sigma_rad, "rad", 2e-5),
        _row("DFT power ratio for direction", "(8-23)", 45.6, _db(dft.snr_direction), "dB", 0.05),
    ]  # fmt: skip


def estimator_rows() -> list[Row]:
    """Return sensitivities and convergence of chapter 4."""
    arrays, same = ArrayParams(), np.eye(3)
    off = direction_from_angles(math.radians(45.0), 0.0)
    # One offset at 45 deg and any of the other: the report claims the bound for this case.
    roll = max(
        roll_variance(math.radians(45.0), math.radians(b)) for b in np.linspace(0.0, 89.9, 200)
    )
    # Exact ranges and a start that is 5 deg off: what remains is the estimator's own.
    attitude_deg, direction_deg = settled_error_deg(5.0)
    return [
        _row(
            "Var(rho)/sigma^2", "(4-20)", 0.278, range_variance_from_gradients(1e4, _AHEAD, same, arrays), "1", 5e-4,
            remark="1/36 is 0.0278: the decimal point slipped",
            due=1.0 / 36.0,
        ),
        _row("V^2 on boresight", "(4-21)", 0.4448,
             direction_variance_from_gradients(1e4, _AHEAD, same, arrays), "1/m^2", 0.0045),
        _row("V^2 at 45 deg", "(4-21)", 0.8896,
             direction_variance_from_gradients(1e4, off, same, arrays), "1/m^2", 0.009),
        _row("largest V_psi^2 with one offset of 45 deg", "section 4.3", 2.0, roll, "1", 0.0, bound="<="),
        _row("angle error 2 passes after 45 deg", "section 4.2", 0.01, _left_deg(45.0, 2), "deg", 0.0, bound="<="),
        _row("angle error 3 passes after 80 deg", "section 4.2", 0.01, _left_deg(80.0, 3), "deg", 0.0, bound="<="),
        _row("range error 4 passes after a tenfold range", "section 4.2", 1e-6, _range_left_m(), "m", 0.0, bound="<="),
        _row("attitude left wrong by nine separate ranges", "p. 35", 5.0, attitude_deg, "deg", 0.01),
        _row(
            "direction left wrong by nine separate ranges", "p. 35", 5.0, direction_deg, "deg", 0.1,
            remark="half the attitude error is what the nine ranges trade against it; the report's start is not given",
            due=0.5 * attitude_deg, within=0.02,
        ),
    ]  # fmt: skip


def _left_deg(angle_deg: float, passes: int) -> float:
    angle = math.radians(angle_deg)
    start = Geometry(
        range_m=np.array(1e4),
        forward=direction_from_angles(angle, 0.0),
        reverse=direction_from_angles(math.pi + angle, 0.0),
        roll_rad=np.array(angle),
    )
    found = _tracked(start, passes)
    chords = [
        np.linalg.norm(found.forward - _AHEAD),
        np.linalg.norm(found.reverse + _AHEAD),
        abs(found.roll_rad),
    ]
    return math.degrees(max(float(chord) for chord in chords))


def _range_left_m() -> float:
    start = Geometry(range_m=np.array(1e5), forward=_AHEAD, reverse=-_AHEAD, roll_rad=np.array(0.0))
    return abs(float(_tracked(start, 4).range_m) - 1e4)


def _tracked(start: Geometry, passes: int) -> Geometry:
    ranges = two_way_ranges(1e4 * _AHEAD, np.eye(3), ArrayParams())
    amplitudes = coupling_amplitudes(_AHEAD, np.eye(3))
    return track(
        start, ranges, amplitudes, ArrayParams(), SequenceParams(iterations=passes)
    ).geometry


def _link(bandwidth_hz: float) -> LinkParams:
    return LinkParams(
        bandwidth_hz=bandwidth_hz,
        noise_figure_db=3.0,
        transmit_gain_db=_DOUBLE_DB,
        receive_gain_db=_DOUBLE_DB,
    )


def link_rows() -> list[Row]:
    """Return the statements of chapter 5 about nonlinear reflector and repeater."""
    return [*_reflector_rows(), *_repeater_rows()]


def _reflector_rows() -> list[Row]:
    def back_db(
        range_m: float, gain_db: float, loss: str = "corrected", power_w: float = 1.0
    ) -> float:
        links = (20e9, 2e9, _link(1e3), _link(1.0))
        return _db(
            float(nonlinear_reflector(power_w, range_m, gain_db, *links, loss=loss).snr_return)
        )

    def forward_db(power_w: float, range_m: float, bandwidth_hz: float) -> float:
        link = _link(bandwidth_hz)
        return _db(
            float(nonlinear_reflector(power_w, range_m, 0.0, 20e9, 2e9, link, link).snr_output)
        )

    return [
        _row("mixed ratio of two inputs of -10 dB", "section 5.3", -20.0, _db(float(mixed_snr(0.1, 0.1, "published"))),
             "dB", 0.5),
        _row("the same, all signal x noise counted", "(5-33)", -20.0, _db(float(mixed_snr(0.1, 0.1))), "dB", 1.0),
        _row("1 W, 10 MHz at 10 km", "Fig. 5-5", 0.0, forward_db(1.0, 1e4, 1e7), "dB", 0.0, bound="<="),
        _row("10 W, 1 MHz at 10 km", "Fig. 5-5", 0.0, forward_db(10.0, 1e4, 1e6), "dB", 0.0, bound=">="),
        _row("10 W, 1 MHz at 100 km", "Fig. 5-5", 0.0, forward_db(10.0, 1e5, 1e6), "dB", 0.0, bound="<="),
        _row("1 W, 1 kHz at 100 km", "Fig. 5-5", 0.0, forward_db(1.0, 1e5, 1e3), "dB", 0.0, bound=">="),
        _row("returned ratio without gain at 0.1 km", "Fig. 5-6", -60.0, back_db(1e2, 0.0), "dB", 1.0),
        _row("returned ratio without gain at 100 km", "Fig. 5-6", -240.0, back_db(1e5, 0.0), "dB", 1.0),
        _row("the same with the printed (8 pi)^2", "(5-39)", -240.0, back_db(1e5, 0.0, "published"), "dB", 1.0,
             remark="(5-39) must read (4 pi)^2 as (8-19): only that gives the text's -240 dB",
             due=back_db(1e5, 0.0) - 3.0 * _db(4.0), within=1e-4),
        _row("the same with the printed 1 MW", "section 5.4", -240.0, back_db(1e5, 0.0, power_w=1e6), "dB", 1.0,
             remark="1 W is meant: 1 MW would return 120 dB more", due=back_db(1e5, 0.0) + 120.0,
             within=1e-4),
        *(_row(f"returned ratio with {gain} dB at {km} km", "Fig. 5-6", 10.0, back_db(1e3 * km, gain), "dB", 0.0,
               bound=">=") for km, gain in ((1, 140), (10, 200), (100, 260))),
    ]  # fmt: skip


def _repeater_rows() -> list[Row]:
    def back_db(
        power_w: float, range_m: float, gain_db: float, hz: float, bandwidth_hz: float
    ) -> float:
        return _db(
            float(
                simple_repeater(
                    power_w, range_m, gain_db, hz, 2e9, _link(bandwidth_hz), _link(1.0)
                ).snr_return
            )
        )

    return [
        _row("repeater 20 GHz, 1 W, 1 kHz, 120 dB at 100 km", "Fig. 5-7", 10.0,
             back_db(1.0, 1e5, 120.0, 20e9, 1e3), "dB", 0.0, bound=">="),
        _row("repeater 3 GHz, 0.1 W, 100 Hz, 120 dB at 100 km", "Fig. 5-8", 20.0,
             back_db(0.1, 1e5, 120.0, 3e9, 100.0), "dB", 0.0, bound=">="),
        _row("repeater 3 GHz, 1 W, 1 MHz, 120 dB at 10 km", "Fig. 5-9", 20.0,
             back_db(1.0, 1e4, 120.0, 3e9, 1e6), "dB", 0.0, bound=">="),
        _row("repeater 3 GHz, 1 W, 1 MHz, 120 dB at 100 km", "Fig. 5-9", 10.0,
             back_db(1.0, 1e5, 120.0, 3e9, 1e6), "dB", 0.0, bound="<="),
    ]  # fmt: skip


def settled_error_deg(attitude_error_deg: float) -> tuple[float, float]:
    """Return the attitude and direction errors that remain after 20 passes.

    The truth is 10 deg of direction.
    """
    truth, arrays = math.radians(10.0), ArrayParams()
    ranges = two_way_ranges(_RANGE_M * direction_from_angles(truth, 0.0), np.eye(3), arrays)
    attitude = attitude_from_euler(math.radians(attitude_error_deg), 0.0, 0.0)
    forward = direction_from_angles(truth, 0.0)
    reverse = reverse_direction(forward, attitude)
    # It settles long before: what is left is not the start but the estimator.
    for _ in range(_PASSES):
        # No sums: nine separate ranges let an attitude error into the direction.
        forward = _nine_range_step(ranges, forward, attitude, arrays)
        reverse = _nine_range_step(ranges.T, reverse, attitude.T, arrays.swapped())
        attitude = attitude_from_directions(forward, reverse, 0.0)
    return _degrees_off(euler_from_attitude(attitude)[0], 0.0), _degrees_off(
        forward_angles(forward)[0], truth
    )


def _degrees_off(found_rad: Array, truth_rad: float) -> float:
    return abs(math.degrees(float(found_rad) - truth_rad))


def _nine_range_step(
    ranges: Array, direction: Array, attitude: Array, arrays: ArrayParams
) -> Array:
    predicted = two_way_ranges(_RANGE_M * direction, attitude, arrays)
    gradient = []
    for dither in ((_DITHER_RAD, 0.0), (0.0, _DITHER_RAD)):
        moved = two_way_ranges(_RANGE_M * turned_direction(direction, *dither), attitude, arrays)
        # The same finite dither as the listing.
        gradient.append((moved - predicted).ravel() / _DITHER_RAD)
    step, _ = minimum_variance_step(np.stack(gradient, axis=-1), (ranges - predicted).ravel())
    return turned_direction(direction, step[0], step[1])
