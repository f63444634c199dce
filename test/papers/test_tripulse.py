import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import TripulseSourceParams
from rf_pointing.papers import tripulse
from rf_pointing.papers.row import Row
from rf_pointing.papers.tripulse_attitude import run_tripulse


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return tripulse.rows(seed=1)


def test_every_row_holds_or_is_explained(rows: list[Row]) -> None:
    assert [row.quantity for row in rows if not row.accepted] == []


def test_explained_rows_are_exactly_the_printed_statements_that_do_not_hold(rows: list[Row]) -> None:
    contradicted = [row.source for row in rows if not row.holds]
    assert contradicted == ["4.2", "4.1", "eq. (21), Fig. 2", "eq. (17)", "4.3, Fig. 3", "5.2, H = sum t' t^T"]
    assert all(row.explained for row in rows if not row.holds)
    assert not any(row.explained and row.holds for row in rows)


def test_failed_share_does_not_depend_on_the_executor() -> None:
    with ThreadPoolExecutor(2) as executor:
        assert tripulse.failed_share_at_limit(1, executor) == tripulse.failed_share_at_limit(1)


def test_interleaved_scheme_gives_the_attitude_without_any_reference_tone() -> None:
    signal = TripulseSignalParams(scheme="interleaved", pattern="SxSy")
    run = run_tripulse(100, 1, signal=signal)
    assert all(attitude.valid for attitude in run.attitudes)
    errors = run.attitude_errors_rad
    scores = [e @ np.linalg.solve(a.covariance_rad2, e) for e, a in zip(errors, run.attitudes, strict=True)]
    # Mean of 100 chi-square values of three degrees of freedom: 3 +- 0.24.
    assert np.mean(scores) == pytest.approx(3.0, abs=1.0)


def test_weak_link_flags_the_attitude_instead_of_inventing_one() -> None:
    run = run_tripulse(5, 1, source=TripulseSourceParams(element_carrier_to_noise_db_hz=-15.0))
    assert not any(attitude.valid for attitude in run.attitudes)
    assert all("sum SNR" in attitude.reason for attitude in run.attitudes)


@pytest.mark.parametrize(("beyond_deg", "holds"), [(0.0, True), (0.9e-4, True), (1.15e-4, False), (-1.15e-4, False)])
def test_the_total_angle_is_explained_while_it_is_root_two_of_the_limit_to_1e_4_deg(
    monkeypatch: pytest.MonkeyPatch, beyond_deg: float, holds: bool
) -> None:
    total_deg = math.sqrt(2.0) * tripulse.LIMIT_DEG + beyond_deg
    monkeypatch.setattr(tripulse, "SPECIFICATION", math.radians(total_deg / (3.0 * math.sqrt(2.0))))
    row = tripulse._time_rows()[2]
    assert row.ours == pytest.approx(total_deg)
    assert row.explained is holds


@pytest.mark.parametrize(("beyond", "holds"), [(0.0, True), (0.9e-5, True), (1.15e-5, False), (-1.15e-5, False)])
def test_the_cubic_term_is_explained_while_it_is_that_of_0_1316_rad_to_1e_5(
    monkeypatch: pytest.MonkeyPatch, beyond: float, holds: bool
) -> None:
    cubic = 0.1316**2 / 3.0 + beyond
    monkeypatch.setattr(
        tripulse, "OFFSET_RAD", math.sqrt(3.0 * cubic) / (tripulse.ARRAY.kd[0] * tripulse.ARRAY.n_x / 4.0)
    )
    row = tripulse._time_rows()[3]
    assert row.ours == pytest.approx(100.0 * cubic)
    assert row.explained is holds
