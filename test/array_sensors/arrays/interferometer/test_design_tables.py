import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.design_tables import (
    carrier_count_row,
    carrier_count_table,
    cycle_error_table,
    link_powers_w,
)
from rf_pointing.array_sensors.arrays.interferometer.link import LinkParams

DB, RATIO = 0.1, 5.1e-4


@pytest.mark.parametrize(
    ("system", "carriers", "ratio", "snr_db"),
    [
        ("CFT", 2, 1666666.667, 110.0),
        ("CFT", 4, 118.563, 45.6),
        ("CFT", 9, 5.994, 19.7),
        ("CFT", 22, 1.978, 10.0),
        ("DFT", 2, 66666.667, 102.9),
        ("DFT", 8, 4.888, 20.7),
        ("DFT", 14, 2.350, 14.2),
        ("DFT", 25, 1.589, 13.0),
    ],
)
def test_published_rows_of_table_8_1(system: str, carriers: int, ratio: float, snr_db: float) -> None:
    row = carrier_count_row(carriers, system, variant="published")
    assert row.ratio == pytest.approx(ratio, abs=RATIO)
    assert row.snr_db == pytest.approx(snr_db, abs=DB)
    assert row.step_probability == pytest.approx(0.001 / (carriers - 1))


def test_without_the_solvers_limit_two_carriers_need_127_85_db() -> None:
    assert carrier_count_row(2, "CFT").snr_db == pytest.approx(127.85, abs=0.01)


def test_difference_tracking_has_one_step_less_than_the_table_counts() -> None:
    corrected, above = carrier_count_row(8, "DFT"), carrier_count_row(7, "DFT", variant="published")
    assert corrected.ratio == pytest.approx(6.368, abs=RATIO)
    assert corrected.ratio == above.ratio
    assert corrected.snr_db == pytest.approx(23.06, abs=0.01)


def test_tables_span_all_carrier_counts_and_never_rise() -> None:
    for system, first in (("CFT", 2), ("DFT", 3)):
        table = carrier_count_table(system)
        assert [row.carriers for row in table] == list(range(first, 26))
        assert np.all(np.diff([row.snr_db for row in table]) <= 0.0)
    assert carrier_count_table("DFT", "published")[0].carriers == 2


def test_cycle_error_table_falls_with_ratio_and_rises_with_cycles() -> None:
    table = cycle_error_table(range(2, 11), range(10, 31))
    assert table.shape == (21, 9)
    assert np.all(np.diff(table, axis=0) <= 0.0)
    assert np.all(np.diff(table[:10], axis=1) >= 0.0)


def test_powers_of_both_designs() -> None:
    assert link_powers_w(40.0, 1e5, 3.42e9, 2.42e9, LinkParams()) == pytest.approx((2.1342, 1.0686), rel=1e-4)
    assert link_powers_w(46.0, 1e5, 2.5e9, 1.7e9, LinkParams()) == pytest.approx((4.5400, 2.0993), rel=1e-4)


def test_too_few_carriers_and_unknown_systems_are_refused() -> None:
    with pytest.raises(ValueError, match="carriers=2 must be >= 3"):
        carrier_count_row(2, "DFT")
    with pytest.raises(ValueError, match="system='PN'"):
        carrier_count_row(5, "PN")
