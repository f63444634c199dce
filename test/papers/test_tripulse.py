from concurrent.futures import ThreadPoolExecutor

import pytest

from rf_pointing.array_sensors.tripulse.source import TripulseSourceParams
from rf_pointing.papers import tripulse
from rf_pointing.papers.tripulse_attitude import run_tripulse


def test_failed_share_does_not_depend_on_the_executor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tripulse, "TRIALS", 200)
    with ThreadPoolExecutor(2) as executor:
        assert tripulse.failed_share_at_limit(1, executor) == tripulse.failed_share_at_limit(1)


def test_weak_link_flags_the_attitude_instead_of_inventing_one() -> None:
    run = run_tripulse(5, 1, source=TripulseSourceParams(element_carrier_to_noise_db_hz=-15.0))
    assert not any(attitude.valid for attitude in run.attitudes)
    assert all("sum SNR" in attitude.reason for attitude in run.attitudes)
