"""TRIPULSE recomputed: measurement time, noise, phase bits and dead elements of the 16 x 16 array.

Every standard deviation is measured over seeded trials; its tolerance is four of its own standard
errors unless stated.  "3 sigma" of 4.3 and 4.4 is 3 sqrt(var eps_x + var eps_y), the initial error
is 0.1 deg along x, steering at boresight.
"""

import math
from concurrent.futures import Executor
from functools import partial

import numpy as np

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.papers.row import Row, near
from rf_pointing.papers.sweeps import sweep
from rf_pointing.papers.tripulse_attitude import attitude_rows, signal_rows
from rf_pointing.papers.tripulse_noise import (
    ErrorStatistics,
    failed_element_errors,
    future_rows,
    noise_rows,
    phase_error_errors,
    quantiser_errors,
)
from rf_pointing.papers.tripulse_theory import integration_time_s

ARRAY = TripulseArrayParams()
OFFSET_RAD = math.radians(0.1)
OFFSET = (OFFSET_RAD, 0.0)
BORESIGHT = (0.0, 0.0)
CN0_DB_HZ, SPECIFICATION = 37.0, 5.8e-5
LIMIT_DEG = 0.01
FIVE_BITS_RAD = 2.0 * math.pi / 2**5
TRIALS = 20_000


def rows(seed: int = 1, *, executor: Executor | None = None) -> list[Row]:
    """Return the published numbers of TRIPULSE and ours, contradicted statements included.

    Sweeps on `executor`.
    """
    return [
        *_time_rows(),
        *noise_rows(seed),
        *_phase_rows(seed),
        *_failure_rows(seed, executor),
        *signal_rows(seed),
        *attitude_rows(seed),
        *future_rows(seed),
    ]


def failed_share_at_limit(seed: int = 1, executor: Executor | None = None) -> float:
    """Return the share of dead elements of 256 at which the 3 sigma error is 0.01 deg, by a sweep
    over their number.
    """
    # Around the paper's 15 % of 256: nearly straight there, so a line finds the crossing.
    counts = list(range(30, 48, 2))
    task = partial(_failures, seed)
    angles = [math.degrees(case.three_sigma_total_rad) for case in sweep(task, counts, executor)]
    # A line through all cases evens out their Monte Carlo error of 0.5 % each.
    slope, start = np.polyfit(counts, angles, 1)
    return float((LIMIT_DEG - start) / slope / ARRAY.n_total)


def _failures(seed: int, count: int) -> ErrorStatistics:
    return failed_element_errors(ARRAY, count, BORESIGHT, OFFSET, TRIALS, seed)


def _time_rows() -> list[Row]:
    sigma_deg = math.degrees(SPECIFICATION)
    # X N / 4 at the largest initial error, the argument of the tangent in (9).
    cubic = (ARRAY.kd[0] * OFFSET_RAD * ARRAY.n_x / 4.0) ** 2 / 3.0
    return [
        Row(
            "time of one pulse, 37 dB-Hz per element, 16 x 16, 3 wavelengths, delta = 5.8e-5", "eq. (22)", 80.0,
            integration_time_s(ARRAY, CN0_DB_HZ, SPECIFICATION) * 1e6, "us", 1.0,
        ),
        Row("3 delta of one projection", "4.2", LIMIT_DEG, 3.0 * sigma_deg, "deg", 1e-4),
        Row(
            "3 sigma of the total angle at delta = 5.8e-5, as 4.3 and 4.4 count it", "4.2", LIMIT_DEG,
            3.0 * math.sqrt(2.0) * sigma_deg, "deg", 1e-4,
            remark="the 80 us hold for one projection; both together are sqrt(2) larger and would take 160 us",
            due=near(math.sqrt(2.0) * LIMIT_DEG, 0.007),
        ),
        Row(
            "cubic over linear term of (11) at 0.1 deg", "4.1", 2.0, 100.0 * cubic, "%", 0.1,
            remark="(X N/4)^2 / 3 with X N/4 = 0.1316 rad, whose square is 1.7 %; the exact inversion needs neither",
            due=near(100.0 * 0.1316**2 / 3.0, 2e-3),
        ),
    ]  # fmt: skip


def _phase_rows(seed: int) -> list[Row]:
    found = []
    # The paper says that 256 elements fail and 324 meet the limit: one row for each side.
    for count, bound in ((16, ">="), (18, "<=")):
        params = ARRAY.replace(n_x=count, n_y=count)
        case = phase_error_errors(params, FIVE_BITS_RAD, BORESIGHT, OFFSET, TRIALS, seed)
        found.append(
            Row(
                f"3 sigma, 5-bit phases as uniform errors, {count * count} elements {'(fails)' if count == 16 else '(meets)'}",
                "4.3, Fig. 3", LIMIT_DEG, math.degrees(case.three_sigma_total_rad), "deg", 0.0, bound=bound,
            )
        )  # fmt: skip
    rounding = ARRAY.replace(n_x=18, n_y=18, phase_bits=5)
    remarks = {
        False: "steering phases are odd in the element's place, so mirrored elements round to opposite errors that add "
        "up: sqrt(2) more than independent errors",
        True: "",
    }
    totals = {
        common: math.degrees(
            quantiser_errors(
                rounding, OFFSET, 0.15, 4000, seed, random_common_phase=common
            ).three_sigma_total_rad
        )
        for common in remarks
    }
    independent = totals[True]
    for common, remark in remarks.items():
        total = totals[common]
        found.append(
            Row(
                "3 sigma, real 5-bit rounding, 324 elements, steering to 8.6 deg"
                + (", a common phase added before rounding" if common else ""),
                "4.3, Fig. 3", LIMIT_DEG, total, "deg", 0.0, bound="<=", remark=remark,
                due=near(math.sqrt(2.0) * independent if remark else None, 0.1),
            )
        )  # fmt: skip
    return found


def _failure_rows(seed: int, executor: Executor | None) -> list[Row]:
    return [
        Row(
            "3 sigma with 38 of 256 elements dead, no noise, 20 000 trials", "4.4, Fig. 4", LIMIT_DEG,
            math.degrees(_failures(seed, 38).three_sigma_total_rad), "deg", 3e-4,
        ),
        Row(
            "share of dead elements at 3 sigma = 0.01 deg", "4.4, Fig. 4", 15.0,
            100.0 * failed_share_at_limit(seed, executor), "%", 1.0,
        ),
    ]  # fmt: skip
