"""Rows on the attitude: Tables 1 and 2, convergence, process noise, the filter as printed."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.multiplicative_filter import PRINTED_Q, TABLE_Q
from rf_pointing.array_sensors.doa.array import CircularArrayParams
from rf_pointing.array_sensors.doa.cramer_rao import cosine_sigma_rad
from rf_pointing.papers.doa_study.attitude_runs import CaseResult
from rf_pointing.papers.doa_study.direction_rows import FLOOR_DEG, PRINTED, case_name, table_of
from rf_pointing.papers.doa_study.directions import DirectionCase
from rf_pointing.papers.row import Row

ARRAY = CircularArrayParams()
AXES = ("yaw", "roll", "pitch")
FAIR = [
    (100, -10.0),
    (100, -8.0),
    (100, -6.0),
    (100, -2.0),
    (100, 0.0),
    (10, 0.0),
    (20, 0.0),
    (50, 0.0),
]
"""Rows above the threshold whose attitude errors are noise, not the repeating error of the grid."""
SCENE_FACTOR = 2.5
AVERAGED_S = 3000
"""The end of each history that the tables average, one value a second."""
FINE = [(100, -2.0), (100, 0.0), (50, 0.0)]


def attitude_rows(tables: dict[DirectionCase, CaseResult]) -> list[Row]:
    """Return yaw, roll and pitch of the paper and ours, and of any station geometry."""
    found: list[Row] = []
    for (snapshots, snr_db), printed in PRINTED.items():
        grid = tables[DirectionCase(snapshots=snapshots, snr_db=snr_db, refined=False)]
        refined = tables[DirectionCase(snapshots=snapshots, snr_db=snr_db)]
        reason, most_deg = _reason(grid, refined)
        for axis, paper in zip(AXES, printed[2:], strict=True):
            # Better than the peak without a grid and without outliers no axis is.
            least_deg = 0.5 * getattr(refined, f"{axis}_deg")
            due = (least_deg, max(least_deg, most_deg)) if reason else None
            found.append(
                # The stations and Q are not published; they move an axis by no more than this.
                Row(
                    f"RMSE of {axis}, {case_name(snapshots, snr_db)}, 1-deg grid", table_of(snapshots, snr_db), paper,
                    getattr(grid, f"{axis}_deg"), "deg", 0.0, factor=SCENE_FACTOR,
                    remark=f"refined peak {getattr(refined, f'{axis}_deg'):.3f} deg{f'; {reason}' if reason else ''}",
                    due=due,
                )
            )  # fmt: skip
        if (snapshots, snr_db) in FAIR:
            found += _fair_rows(grid, refined)
    return [*found, *_refinement_rows(tables)]


def convergence_rows(tables: dict[DirectionCase, CaseResult]) -> list[Row]:
    """Return how long the error takes from 50 deg and 0.5 deg/s at 0 dB and 100 snapshots, worst
    trial.
    """
    result = tables[DirectionCase(snapshots=100, snr_db=0.0)]
    return [
        *_settling_rows(result, ""),
        Row(
            "time until the rate error stays below 0.1 deg/s", "section 6, Figs. 6 and 7", 1000.0,
            settling_time_s(result.rate_history_deg_s, 0.1, 1), "s", 0.0, bound="<=",
        ),
    ]  # fmt: skip


def _settling_rows(result: CaseResult, of: str) -> list[Row]:
    """Return how long the attitude error takes to stay below 2 and 0.5 deg, worst trial."""
    # Seconds: the 1-deg grid makes the error jump by its step between stations.
    smooth = 100
    cases = [("2 deg", 2.0, 1, 1350.0), (f"0.5 deg ({smooth}-s running mean)", 0.5, smooth, 1500.0)]
    return [
        Row(
            f"time until the total error{of} stays below {name}", "section 6, Figs. 6 and 7", paper,
            settling_time_s(result.history_deg, limit, window), "s", 0.0, bound="<=",
        )
        for name, limit, window, paper in cases
    ]  # fmt: skip


def filter_rows(inside: CaseResult, drawn: CaseResult, published: list[CaseResult]) -> list[Row]:
    """Return filter and process noise as printed, and the pool against MUSIC in the loop."""
    trials = min(found.history_deg.shape[1] for found in (inside, drawn))
    ours_q, printed_q = published
    grown = PRINTED_Q / TABLE_Q
    found = [
        Row(
            f"RMSE of {axis}, printed filter, Q=1e-12, {case_name(100, 0.0)}, 1-deg grid", "Table 1", paper,
            getattr(ours_q, f"{axis}_deg"), "deg", 0.0, factor=SCENE_FACTOR,
        )
        for axis, paper in zip(AXES, PRINTED[100, 0.0][2:], strict=True)
    ]  # fmt: skip
    found += _settling_rows(ours_q, " of the printed filter, Q=1e-12,")
    found.append(
        # Measured with two seeds: 19.6 and 19.7 times for Q a thousand times larger, Q^0.43.
        Row(
            f"attitude sigma the printed filter predicts for itself with the printed Q={PRINTED_Q:g}", "section 5.2",
            max(PRINTED[100, 0.0][2:]), printed_q.sigma_deg, "deg", 0.1,
            remark=f"contradicts the tables; with Q=1e-12 it predicts {ours_q.sigma_deg:.3f} deg",
            due=(grown**0.4 * ours_q.sigma_deg, grown**0.46 * ours_q.sigma_deg),
        )
    )  # fmt: skip
    for name, ratio, tolerance in (
        ("theta RMSE", inside.theta_deg / drawn.theta_deg, 0.03),
        # The attitude of few trials scatters with their own transients.
        (
            "worst axis of the attitude",
            _worst(inside) / _worst(drawn),
            0.05 + 0.6 / math.sqrt(trials),
        ),
    ):
        found.append(
            Row(
                f"{name}: MUSIC inside the loop / errors from the pool, {trials} trials", "check of method", 1.0,
                ratio, "1", tolerance,
            )
        )  # fmt: skip
    return found


def settling_time_s(history: NDArray[np.float32], limit: float, window_s: int) -> float:
    """Return the last second at which the running mean over `window_s` of any trial (seconds,
    trials) is above `limit`.
    """
    kernel = np.full(window_s, 1.0 / window_s)
    # Trial by trial: a mean over the trials would hide a single slow one.
    smooth = np.stack([np.convolve(trial, kernel, mode="valid") for trial in history.T], axis=-1)
    above = np.flatnonzero(np.any(smooth > limit, axis=-1))
    return float(above[-1] + window_s) if len(above) else 0.0


def _fair_rows(grid: CaseResult, refined: CaseResult) -> list[Row]:
    case = (grid.case.snapshots, grid.case.snr_db)
    # What the bound and any sensible geometry allow, for strong and for weak signals.
    limit = 0.13 if case in FINE else 0.25
    found = []
    for name, result in (("1-deg grid", grid), ("refined", refined)):
        found.append(
            Row(
                f"worst axis, {case_name(*case)}, {name}", "attainable range", limit, _worst(result), "deg", 0.0,
                bound="<=",
            )
        )  # fmt: skip
        found.append(
            Row(
                f"RMSE of theta / worst axis, {case_name(*case)}, {name}", "attainable range", 4.0,
                result.theta_deg / _worst(result), "1", 0.0, bound=">=",
            )
        )  # fmt: skip
    return found


def _refinement_rows(tables: dict[DirectionCase, CaseResult]) -> list[Row]:
    found = []
    for snr_db, paper, bound, tolerance in ((14.0, 3.0, ">=", 0.0), (-10.0, 1.0, "==", 0.35)):
        pair = [
            tables[DirectionCase(snapshots=100, snr_db=snr_db, refined=refined)]
            for refined in (False, True)
        ]
        found.append(
            Row(
                f"worst axis on the 1-deg grid / refined, {case_name(100, snr_db)}", "gain of refining", paper,
                _worst(pair[0]) / _worst(pair[1]), "1", tolerance, bound=bound,
            )
        )  # fmt: skip
    return found


def _worst(result: CaseResult) -> float:
    return max(result.yaw_deg, result.roll_deg, result.pitch_deg)


def _reason(grid: CaseResult, refined: CaseResult) -> tuple[str, float]:
    """Return what is measured where ours is not the paper's, and the largest error that explains.

    The text is empty where nothing is.

    Each reason has its own criterion: a filter with outliers must be as good as it claims, and the
    grid's repeating error must be gone from the refined peak.
    """
    lost = [int(np.sum(locked_wrongly(result))) for result in (grid, refined)]
    trials = grid.history_deg.shape[1]
    claimed = share_of_claim(grid)
    # No more trials may be lost than begin with an outlier, by three deviations.
    begun = trials * grid.outliers
    fewest = lost[0] <= begun + 3.0 * math.sqrt(begun)
    if grid.outliers > 1e-3 and fewest and 1.0 / SCENE_FACTOR <= claimed <= SCENE_FACTOR:
        text = (
            f"{100.0 * grid.outliers:.1f} % outliers, which the chi-square test refuses; "
            + (f"the other {trials - lost[0]} trials: " if lost[0] else "worst axis ")
            + f"{claimed:.2f} of what the filter claims; the cause of the paper's number is unknown (without the test the "
            f"filter does not give it either); locked wrongly at the end: {lost[0]} of {trials} on the grid, {lost[1]} of "
            f"{trials} refined, and {begun:.0f} begin with an outlier"
        )
        return text, SCENE_FACTOR * _worst(grid) / claimed
    weak = (
        math.degrees(cosine_sigma_rad(ARRAY, grid.case.snapshots, grid.case.snr)) >= 0.5 * FLOOR_DEG
    )
    if not weak and _worst(grid) >= SCENE_FACTOR * _worst(refined):
        text = (
            "the error of the grid repeats with the direction, and the filter cannot average it away: "
            f"{_worst(grid) / _worst(refined):.1f} times the refined peak's"
        )
        # One direction alone; stations see the attitude by two or more.
        return text, SCENE_FACTOR * FLOOR_DEG
    return "", 0.0


def locked_wrongly(result: CaseResult) -> NDArray[np.bool_]:
    """Return which trials end more than 10 deg off: settled on a wrong turn, not noisy."""
    return np.asarray(result.history_deg[-1] > 10.0)


def share_of_claim(result: CaseResult) -> float:
    """Return the error over the sigma that the filter claims: of the worst axis, or where trials
    locked wrongly the mean axis of the others.
    """
    lost, sigma = locked_wrongly(result), max(result.sigma_deg, 1e-12)
    if not np.any(lost):
        return _worst(result) / sigma
    if np.all(lost):
        return math.inf
    kept = result.history_deg[-AVERAGED_S:, ~lost]
    return float(np.sqrt(np.mean(kept.astype(float) ** 2) / 3.0)) / sigma
