"""Timing of the commands: what cannot be, is refused."""

import pytest

from rf_pointing.station.pointing.params import PointingParams


def test_a_horizon_too_short_to_be_relieved_is_refused() -> None:
    with pytest.raises(ValueError, match=r"horizon_s=0\.2 must be >= transport_s \+ 2 period_s"):
        PointingParams(horizon_s=0.2)


@pytest.mark.parametrize("transport_s", [0.0, 0.05, 0.15])
def test_a_transport_off_the_grid_of_periods_is_refused(transport_s: float) -> None:
    with pytest.raises(ValueError, match=rf"transport_s={transport_s} must be a whole number of period_s=0\.1"):
        PointingParams(transport_s=transport_s)
