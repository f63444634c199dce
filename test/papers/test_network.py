"""The optical subnet: every row holds or is explained, and the numbers behind them to their last digit."""

import pytest

from rf_pointing.papers import network


def test_the_rows_hold_or_are_explained_by_a_number() -> None:
    rows = network.rows()
    assert [row.quantity for row in rows if not row.accepted] == []
    explained = {row.quantity for row in rows if row.explained and not row.holds}
    assert {"receiver gain", "symbol time", "loss at 70 deg", "slope b of eq. 2 from w(30 dB) = 0.8"} <= explained
    ours = {row.quantity: row.ours for row in rows}
    closed = {
        "two stations": 0.8844, "three stations": 0.960696, "seven stations, shares as rounded in the text": 0.9111,
        "eight stations, shares as rounded in the text": 0.9348, "distance at which rho is 0.01": 151.743,
        "coverage of COS 3x3 to 60 deg": 61.1, "coverage of COS 3x3 on the -6.2 dB line": 79.44,
        "coverage of COS 3x3 to 70 deg": 83.75, "gaps of COS 3x3 to 70 deg": 3.90, "coverage of LDOS 6 to 60 deg": 94.66,
        "primary aspheric deformation K1": -1.00092, "secondary aspheric deformation K2": -1.30619,
        "required photoelectrons a symbol": 3.690, "uncoded rate": 1387.78,
    }  # fmt: skip
    for quantity, value in closed.items():
        assert ours[quantity] == pytest.approx(value, rel=3e-4), quantity
    assert ours["availability of LDOS 6 on the -6.2 dB line"] == pytest.approx(0.819, abs=1e-3)
