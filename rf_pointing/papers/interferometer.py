"""PI83 recomputed: Tables 7-1, 8-1, 8-2 and 8-3, the design chain, the links and the simulated errors."""

from concurrent.futures import Executor

from rf_pointing.array_sensors.arrays.interferometer import (
    LinkParams,
    carrier_count_row,
    link_powers_w,
    step_error_probability,
)
from rf_pointing.papers.interferometer_claims import chain_rows, estimator_rows, link_rows
from rf_pointing.papers.interferometer_published import TABLE_7_1, TABLE_8_1
from rf_pointing.papers.interferometer_simulation import simulation_rows
from rf_pointing.papers.row import Row

__all__ = ["rows"]

_SINGLE_PRECISION = 1e-6


def rows(seed: int = 1, *, executor: Executor | None = None) -> list[Row]:
    """Return the published numbers of the polarized interferometer beside ours; trials run on `executor`."""
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
        Row(
            quantity=f"wrong cycle, nu = {ratio}, {snr_db} dB",
            source="PI83 Table 7-1",
            paper=printed,
            ours=step_error_probability(ratio, 10.0 ** (0.1 * snr_db)),
            unit="1",
            tolerance=3e-6,
        )
        for ratio, column in TABLE_7_1.items()
        for snr_db, printed in column.items()
    ]


def _table_8_1() -> list[Row]:
    found = []
    for carriers, (cft_ratio, cft_db, dft_ratio, dft_db) in TABLE_8_1.items():
        for system, ratio, snr_db in (("CFT", cft_ratio, cft_db), ("DFT", dft_ratio, dft_db)):
            found.append(_ratio_row(system, carriers, ratio))
            if snr_db is not None:
                found.append(_snr_row(system, carriers, snr_db))
    return [*found, _steps_row()]


def _ratio_row(system: str, carriers: int, printed: float) -> Row:
    return Row(
        quantity=f"{system}, K = {carriers}: cycles per step",
        source="PI83 Table 8-1",
        paper=printed,
        ours=carrier_count_row(carriers, system, variant="published").ratio,
        unit="1",
        tolerance=max(6e-4, _SINGLE_PRECISION * printed),
    )


def _snr_row(system: str, carriers: int, printed_db: float) -> Row:
    # The two-carrier row is printed at the limit of the author's iteration: ask for the formula without that limit.
    two = system == "CFT" and carriers == 2
    ours = carrier_count_row(carriers, system, variant="corrected" if two else "published").snr_db
    return Row(
        quantity=f"{system}, K = {carriers}: power ratio",
        source="PI83 Table 8-1",
        paper=printed_db,
        ours=ours,
        unit="dB",
        tolerance=0.1,
        remark=f"(7-30) and (7-33) need {ours:.2f} dB; 110.0 is where the author's iteration stopped" if two else "",
        explained=two,
    )


def _steps_row() -> Row:
    ours = carrier_count_row(8, "DFT")
    return Row(
        quantity="DFT, K = 8: power ratio for its K - 2 = 6 steps",
        source="PI83 section 8.2",
        paper=20.7,
        ours=ours.snr_db,
        unit="dB",
        tolerance=0.1,
        remark=f"K carriers give K - 1 differences and K - 2 steps between them: nu = {ours.ratio:.3f}, not 4.888",
        explained=True,
    )


def _tables_8_2_and_8_3() -> list[Row]:
    cases = (
        ("PI83 Table 8-2", 40.0, 3.42e9, 2.42e9, 2.134, 1.069),
        ("PI83 Table 8-2", 20.0, 3.42e9, 2.42e9, 0.02134, 0.01069),
        ("PI83 Table 8-3", 46.0, 2.5e9, 1.7e9, 4.540, 2.099),
    )
    found = []
    for source, snr_db, forward_hz, return_hz, *printed in cases:
        powers = link_powers_w(snr_db, 1e5, forward_hz, return_hz, LinkParams())
        for link, hz, paper, ours in zip(("forward", "return"), (forward_hz, return_hz), printed, powers, strict=True):
            found.append(_power_row(f"{link} power, {snr_db:g} dB at 100 km, {hz / 1e9:g} GHz", source, paper, ours))
    return [*found, *_printed_frequency_rows()]


def _power_row(quantity: str, source: str, paper: float, ours: float, remark: str = "") -> Row:
    return Row(
        quantity=quantity,
        source=source,
        paper=paper,
        ours=ours,
        unit="W",
        tolerance=1e-3 * paper,
        remark=remark,
        explained=bool(remark),
    )


def _printed_frequency_rows() -> list[Row]:
    powers = link_powers_w(40.0, 1e5, 3.424e9, 2.424e9, LinkParams())
    remark = "the printed powers belong to 3.42 and 2.42 GHz, which give them to 0.04 %"
    return [
        _power_row("forward power at the printed 3.424 GHz", "PI83 Table 8-2", 2.134, powers[0], remark),
        _power_row("return power at the printed 2.424 GHz", "PI83 Table 8-2", 1.069, powers[1], remark),
    ]
