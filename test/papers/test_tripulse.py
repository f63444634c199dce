from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import TripulseSourceParams
from rf_pointing.papers import tripulse
from rf_pointing.papers.tripulse_attitude import run_tripulse


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
