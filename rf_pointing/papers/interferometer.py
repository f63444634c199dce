"""PI83 recomputed: Tables 7-1 and 8-1 to 8-3, the design chain, the links, the simulated errors.

Table 7-1 lies on its side in the scan; the module has only those cells whose seven digits are
legible without doubt.
"""

from concurrent.futures import Executor

from rf_pointing.array_sensors.interferometer.radio import LinkParams
from rf_pointing.papers.interferometer_claims import chain_rows, estimator_rows, link_rows
from rf_pointing.papers.interferometer_design import (
    SOLVER_LIMIT_DB,
    carrier_count_row,
    frequency_ratio,
    link_powers_w,
    step_error_probability,
)
from rf_pointing.papers.interferometer_simulation import simulation_rows
from rf_pointing.papers.row import Row, near

_SINGLE_PRECISION = 1e-6
TABLE_7_1: dict[int, dict[int, float]] = {
    2: {10: 0.0000510, 12: 0.0000003},
    3: {10: 0.0079278, 11: 0.0028910, 12: 0.0008300, 13: 0.0001782, 14: 0.0000264},
    4: {10: 0.0513752, 11: 0.0288109, 15: 0.0005309, 16: 0.0001029, 17: 0.0000131, 18: 0.0000010},
    5: {
        10: 0.1252906, 12: 0.0536245, 16: 0.0022231, 17: 0.0005996, 18: 0.0001199, 19: 0.0000160, 20: 0.0000013,
        21: 0.0000001,
    },
    6: {10: 0.2070590, 22: 0.0000005},
    7: {
        11: 0.2293676, 17: 0.0164721, 19: 0.0025340, 21: 0.0001458, 22: 0.0000206, 23: 0.0000018, 24: 0.0000001,
    },
    8: {
        11: 0.2964898, 15: 0.0980023, 17: 0.0372477, 19: 0.0087316, 20: 0.0032572, 21: 0.0009621, 23: 0.0000331,
        25: 0.0000002,
    },
    9: {
        10: 0.4109675, 11: 0.3562600, 12: 0.3006321, 16: 0.1009035, 18: 0.0388990, 20: 0.0093224, 22: 0.0010634,
        23: 0.0002417, 24: 0.0000386, 25: 0.0000039, 26: 0.0000002,
    },
    10: {11: 0.4086594, 12: 0.3538883, 13: 0.2982500, 15: 0.1903562, 17: 0.0992309, 22: 0.0033716},
}  # fmt: skip
"""Probability of a wrong cycle: cycles per step -> power ratio in dB -> probability."""
TABLE_8_1: dict[int, tuple[float, float, float, float | None]] = {
    2: (1666668.000, 110.0, 66666.633, 102.9),
    3: (1290.995, 66.1, 258.199, 55.1),
    4: (118.563, 45.6, 40.548, 39.2),
    5: (35.930, 35.3, 16.069, 31.2),
    6: (17.554, 29.1, 9.221, 26.3),
    7: (10.889, 24.9, 6.368, 23.1),
    8: (7.742, 21.9, 4.888, 20.7),
    9: (5.994, 19.7, 4.009, 18.9),
    10: (4.913, 17.9, 3.435, 17.5),
    11: (4.190, 16.4, 3.037, 16.4),
    12: (3.678, 15.3, 2.745, 15.6),
    13: (3.300, 14.3, 2.523, 14.8),
    14: (3.010, 13.5, 2.350, None),
    15: (2.782, 12.8, 2.211, 13.7),
    16: (2.599, 12.2, 2.097, 13.3),
    17: (2.448, 11.7, 2.002, 13.0),
    18: (2.323, 11.3, 1.922, 13.0),
    19: (2.216, 10.9, 1.854, 13.0),
    20: (2.126, 10.5, 1.794, 13.0),
    21: (2.047, 10.2, 1.743, 13.0),
    22: (1.978, 10.0, 1.697, 13.0),
    23: (1.918, 10.0, 1.657, 13.0),
    24: (1.864, 10.0, 1.621, 13.0),
    25: (1.817, 10.0, 1.589, 13.0),
}
"""Carriers -> cycles per step and dB of the CFT system, then of the DFT system (its 14-carrier dB
is illegible)."""
P_EI = dict(
    zip(
        range(2, 26),
        (
            0.0010000, 0.0005000, 0.0003333, 0.0002500, 0.0002000, 0.0001667, 0.0001429, 0.0001250, 0.0001111,
            0.0001000, 0.0000909, 0.0000833, 0.0000769, 0.0000714, 0.0000667, 0.0000625, 0.0000588, 0.0000556,
            0.0000526, 0.0000500, 0.0000476, 0.0000455, 0.0000435, 0.0000417,
        ),
        strict=True,
    )
)  # fmt: skip
"""Carriers -> p_ei, the column that both systems share."""


def rows(seed: int = 1, *, executor: Executor | None = None) -> list[Row]:
    """Return the published numbers of the polarized interferometer and ours.

    Trials run on `executor`.
    """
    return [
        *_table_7_1(),
        *_table_8_1(),
        *_tables_8_2_and_8_3(),
        *chain_rows(),
        *estimator_rows(),
        *link_rows(),
        *simulation_rows(seed, executor),
    ]


def _table_7_1() -> list[Row]:
    return [
        # The author's error function is up to 2e-6 high; half a digit; never the cell itself.
        Row(
            f"wrong cycle, nu = {ratio}, {snr_db} dB", "PI83 Table 7-1", printed,
            step_error_probability(ratio, 10.0 ** (0.1 * snr_db)), "1", min(3e-6, 0.1 * printed + 5e-8),
        )
        for ratio, column in TABLE_7_1.items()
        for snr_db, printed in column.items()
    ]  # fmt: skip


def _table_8_1() -> list[Row]:
    found = []
    for carriers, (cft_ratio, cft_db, dft_ratio, dft_db) in TABLE_8_1.items():
        found.append(_probability_row(carriers))
        for system, ratio, snr_db in (("CFT", cft_ratio, cft_db), ("DFT", dft_ratio, dft_db)):
            found.append(_ratio_row(system, carriers, ratio))
            # The cell of the 14-carrier DFT row is illegible in the scan.
            if snr_db is not None:
                found.append(_snr_row(system, carriers, snr_db))
    return [*found, _steps_row()]


def _probability_row(carriers: int) -> Row:
    # Half of the last printed digit.
    return Row(
        f"K = {carriers}: probability of a wrong cycle in one step", "PI83 Table 8-1", P_EI[carriers],
        carrier_count_row(carriers, "CFT", variant="published").step_probability, "1", 5.1e-8,
    )  # fmt: skip


def _ratio_row(system: str, carriers: int, printed: float) -> Row:
    # The author computed in single precision: large ratios carry its relative error.
    return Row(
        f"{system}, K = {carriers}: cycles per step", "PI83 Table 8-1", printed,
        carrier_count_row(carriers, system, variant="published").ratio, "1", max(6e-4, _SINGLE_PRECISION * printed),
    )  # fmt: skip


def _snr_row(system: str, carriers: int, printed_db: float) -> Row:
    # The two-carrier row is printed at the limit of the author's iteration: ask for the formula
    # without that limit.
    two = system == "CFT" and carriers == 2
    row = carrier_count_row(carriers, system, variant="corrected" if two else "published")
    ours = row.snr_db
    return Row(
        f"{system}, K = {carriers}: power ratio", "PI83 Table 8-1", printed_db, ours, "dB", 0.1,
        remark=f"(7-30) and (7-33) need {ours:.2f} dB; 110.0 is where the author's iteration stopped" if two else "",
        due=near(ours if two and printed_db == SOLVER_LIMIT_DB and _gives(row.ratio, ours, 1, 1) else None, 1e-3),
    )  # fmt: skip


def _gives(ratio: float, snr_db: float, phases: int, steps: int) -> bool:
    """Return whether `steps` of this power ratio err with 0.001 in all, by (7-33) itself."""
    snr = 10.0 ** (0.1 * snr_db) / phases
    return abs(steps * step_error_probability(ratio, snr) / 0.001 - 1.0) <= 1e-3


def _steps_row() -> Row:
    ours = carrier_count_row(8, "DFT")
    ratio = frequency_ratio(100e6, 1500.0, 6)
    return Row(
        "DFT, K = 8: power ratio for its K - 2 = 6 steps", "PI83 section 8.2", 20.7, ours.snr_db, "dB", 0.1,
        remark=f"K carriers give K - 1 differences and K - 2 steps between them: nu = {ours.ratio:.3f}, not 4.888",
        due=near(ours.snr_db if _gives(ratio, ours.snr_db, 2, 6) else None, 1e-3),
    )  # fmt: skip


def _tables_8_2_and_8_3() -> list[Row]:
    cases = (
        ("PI83 Table 8-2", 40.0, 3.42e9, 2.42e9, 2.134, 1.069),
        ("PI83 Table 8-2", 20.0, 3.42e9, 2.42e9, 0.02134, 0.01069),
        ("PI83 Table 8-3", 46.0, 2.5e9, 1.7e9, 4.540, 2.099),
    )
    found = []
    for source, snr_db, forward_hz, return_hz, *printed in cases:
        powers = link_powers_w(snr_db, 1e5, forward_hz, return_hz, LinkParams())
        for link, hz, paper, ours in zip(
            ("forward", "return"), (forward_hz, return_hz), printed, powers, strict=True
        ):
            found.append(
                _power_row(
                    f"{link} power, {snr_db:g} dB at 100 km, {hz / 1e9:g} GHz", source, paper, ours
                )
            )
    return [*found, *_printed_frequency_rows()]


def _power_row(
    quantity: str,
    source: str,
    paper: float,
    ours: float,
    remark: str = "",
    due: float | None = None,
) -> Row:
    return Row(quantity, source, paper, ours, "W", 1e-3 * paper, remark=remark, due=near(due, 1e-3))


def _printed_frequency_rows() -> list[Row]:
    powers = link_powers_w(40.0, 1e5, 3.424e9, 2.424e9, LinkParams())
    remark = "the printed powers belong to 3.42 and 2.42 GHz: the square of the frequency is the whole difference"
    return [
        _power_row(
            "forward power at the printed 3.424 GHz",
            "PI83 Table 8-2",
            2.134,
            powers[0],
            remark,
            2.134 * (3.424 / 3.42) ** 2,
        ),
        _power_row(
            "return power at the printed 2.424 GHz",
            "PI83 Table 8-2",
            1.069,
            powers[1],
            remark,
            1.069 * (2.424 / 2.42) ** 2,
        ),
    ]
