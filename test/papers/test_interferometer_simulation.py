import math

import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import direction_from_angles
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.relative_pose import RelativePose
from rf_pointing.array_sensors.interferometer.sequence import SequenceParams
from rf_pointing.array_sensors.interferometer.system import ArrayParams, CarrierPlan
from rf_pointing.papers.interferometer_simulation import TrialErrors, require_gaussian_regime, run_trials

PLAN, LINK, ARRAYS = CarrierPlan(speed_of_light_m_s=3.0e8), LinkParams(), ArrayParams()


def errors(rng, trials, radio=None):
    pose = RelativePose(position_m=1e5 * direction_from_angles(0.0, 0.0), attitude=np.eye(3))
    return run_trials(pose, trials, rng, ARRAYS, radio or RadioParams(), PLAN, LINK, SequenceParams(), "corrected")


def test_wrong_lanes_are_tallied_and_left_out(rng) -> None:
    weak = RadioParams(forward_power_w=0.008, return_power_w=0.004)
    found = errors(rng, trials=400, radio=weak)
    assert 50 < found.wrong_lanes < 150
    assert len(found.range_m) == 400 - found.wrong_lanes
    assert np.max(np.abs(found.range_m)) < 0.25


def test_no_trial_at_all_is_refused(rng) -> None:
    with pytest.raises(ValueError, match="trials=0 must be >= 1"):
        errors(rng, trials=0)


@pytest.mark.parametrize(("forward", "back", "name"), [(9.99, 100.0, "forward"), (100.0, 9.99, "return")])
def test_a_link_below_10_db_is_named_and_refused(forward: float, back: float, name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} link snr=9.99 must be >= 10"):
        require_gaussian_regime([50.0, forward], [[back, 60.0]])
    require_gaussian_regime([50.0, max(forward, 10.0)], [[max(back, 10.0)]])


def test_rms_of_trials_is_taken_of_each_error() -> None:
    found = TrialErrors(
        range_m=np.array([3.0, -4.0]), forward_rad=np.array([1.0, 7.0]), reverse_rad=np.array([2.0, 2.0]),
        roll_rad=np.array([-6.0, 8.0]), wrong_lanes=0,
    )  # fmt: skip
    assert found.rms() == pytest.approx((math.sqrt(12.5), 5.0, 2.0, math.sqrt(50.0)))
