"""Passes as messages and back; a pass that cannot be is refused in words."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rf_pointing_msgs import msg as ours

from rf_pointing.ephemeris import Pass
from rf_pointing.operations.schedule import Entry, PassState, ScheduledPass
from rf_pointing.planning import PassProfile
from rf_pointing.ros import convert_planning
from rf_pointing.ros.stamps import stamp_from_seconds

T_S = 1_151_384_323.813083
# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


@pytest.fixture
def window() -> Pass:
    """Return a pass."""
    return Pass(
        name="bird", aos_t_s=T_S, tca_t_s=T_S + 300.0, los_t_s=T_S + 600.0, peak_elevation_rad=0.8,
        aos_azimuth_rad=2.5, aos_elevation_rad=0.09, los_azimuth_rad=-0.04, azimuth_min_rad=-0.04, azimuth_max_rad=2.5,
        peak_azimuth_rate_rad_s=0.01, peak_elevation_rate_rad_s=0.003, peak_azimuth_acceleration_rad_s2=6e-5,
        smallest_range_m=1.05e6, rises_before=False, sets_after=False,
    )  # fmt: skip


def test_a_pass_comes_back_unchanged_but_for_rounding_of_time(window: Pass) -> None:
    back = convert_planning.pass_from_message(convert_planning.pass_to_message(window))
    for item in dataclasses.fields(Pass):
        got, wanted = getattr(back, item.name), getattr(window, item.name)
        assert got == (pytest.approx(wanted, abs=1e-6) if item.name.endswith("_t_s") else wanted), item.name


@pytest.mark.parametrize("name", ["aos_azimuth", "aos_elevation", "peak_elevation", "azimuth_max", "smallest_range"])
def test_a_pass_that_is_not_finite_is_refused(window: Pass, name: str) -> None:
    message = convert_planning.pass_to_message(window)
    setattr(message, name, math.nan)
    with pytest.raises(ValueError, match=f"{name}=nan must be finite"):
        convert_planning.pass_from_message(message)


@pytest.mark.parametrize(("first", "second"), [("aos", "los"), ("aos", "tca"), ("tca", "los")])
def test_a_pass_whose_times_are_out_of_order_is_refused(window: Pass, first: str, second: str) -> None:
    message = convert_planning.pass_to_message(window)
    early, late = getattr(message, first), getattr(message, second)
    setattr(message, first, late)
    setattr(message, second, early)
    with pytest.raises(ValueError, match="must follow each other"):
        convert_planning.pass_from_message(message)


def test_an_empty_goal_holds_no_pass() -> None:
    with pytest.raises(ValueError, match=r"aos=0\.0, tca=0\.0 and los=0\.0 must follow each other"):
        convert_planning.pass_from_message(ours.Pass())


@pytest.mark.parametrize(
    ("tca_s", "los_s", "taken"), [(0.0, 10.0, True), (10.0, 10.0, True), (0.0, 0.0, False), (11.0, 10.0, False)]
)
def test_a_pass_may_peak_at_its_ends_but_must_last(window: Pass, tca_s: float, los_s: float, taken: bool) -> None:
    message = convert_planning.pass_to_message(window)
    message.aos = stamp_from_seconds(1e9)
    message.tca, message.los = stamp_from_seconds(1e9 + tca_s), stamp_from_seconds(1e9 + los_s)
    if taken:
        assert convert_planning.pass_from_message(message).los_t_s == 1e9 + los_s
    else:
        with pytest.raises(ValueError, match="must follow each other"):
            convert_planning.pass_from_message(message)


ANGLES, TIMES_S = st.floats(-7.0, 7.0), st.integers(0, 2**30 - 2)
SCHEDULED = st.builds(
    ScheduledPass, id=st.sampled_from(["7", "a-b"]), target=st.sampled_from(["25544", "ISS (ZARYA)"]),
    name=st.sampled_from(["", "ISS"]), priority=st.integers(-(2**31), 2**31 - 1), aos_t_s=TIMES_S.map(float),
    los_t_s=TIMES_S.map(lambda s: s + 2.0**30 - 1.0), peak_rad=ANGLES, antenna=st.sampled_from(["", "gs1"]),
    azimuth_path_rad=st.none() | st.tuples(ANGLES, ANGLES, ANGLES, ANGLES), elevation_rad=st.tuples(ANGLES, ANGLES),
    sensor=st.sampled_from(["", "conscan"]), element_age_s=st.just(math.nan) | st.floats(1.0, 1e7), filler=st.booleans(),
)  # fmt: skip


@given(SCHEDULED)
def test_a_scheduled_pass_comes_back_from_the_wire(item: ScheduledPass) -> None:
    # Through CDR: what cannot be sent fails here.
    sent = serialize_message(convert_planning.scheduled_to_message(item))
    (back,) = convert_planning.scheduled_from_messages([deserialize_message(sent, ours.ScheduledPass)])
    assert repr(back) == repr(item), "nan is not itself"


def test_what_became_of_a_pass_reaches_the_wire() -> None:
    item = ScheduledPass(target="25544", aos_t_s=1e9, los_t_s=1e9 + 600.0)
    entry = Entry(item, PassState.LOST, "why", tracked_s=310.0, lost_s=12.0, loss_db=0.5)
    message = convert_planning.entry_to_message(entry)
    assert (message.id, message.state, message.reason) == ("25544-1000000300", "lost", "why")
    assert (message.seconds_tracked, message.seconds_lost, message.mean_loss) == (310.0, 12.0, 0.5)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"target": ""}, "pass 2: target='' of pass 'unnamed-1000000300' must name a satellite"),
        ({"id": "../x"}, "pass 2: id='../x' must"),
        ({"name": "a\nb"}, "pass 2: name="),
        ({"peak_elevation": math.nan}, "pass 2: peak_elevation must be finite"),
        ({"element_age": math.inf}, "pass 2: element_age must be finite"),
        ({"azimuth_path": [1.0, math.nan, 0.0, 0.0]}, "pass 2: azimuth_path must be finite"),
        ({"azimuth_path": [1.0, 2.0]}, "pass 2: azimuth_path has 2 angles, must have 4 or none"),
        ({"los": Time(sec=10**9)}, "pass 2: aos=1000000000.0 of pass .* must be < los"),
        ({"aos": Time(sec=-1)}, "pass 2: stamp of -1 s and 0 ns is not a time"),
        ({}, "pass 25544-1000000300 is in the list twice"),
    ],
)
def test_a_scheduled_pass_that_is_none_is_refused_with_its_place(changes: dict[str, Any], words: str) -> None:
    fields = {"target": "25544", "aos": Time(sec=10**9), "los": Time(sec=10**9 + 600)}
    with pytest.raises(ValueError, match=words):
        convert_planning.scheduled_from_messages([ours.ScheduledPass(**fields), ours.ScheduledPass(**fields | changes)])


@pytest.fixture
def profile() -> PassProfile:
    """Return a profile with a different number in every place."""
    pairs = {
        name: np.arange(6.0).reshape(3, 2) + 10.0 * number
        for number, name in enumerate(("position_rad", "velocity_rad_s", "acceleration_rad_s2", "sun_rad"))
    }
    return PassProfile(
        name="bird", t_s=1e9 + np.array([0.5, 5.5, 11.5]), range_m=np.array([2e6, 1e6, 3e6]),
        satellite_gain_db=np.array([-3.0, -1.0, -2.0]), **pairs,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["azimuth", "elevation_rate", "sun_elevation", "range", "satellite_gain"])
def test_a_profile_with_columns_of_different_length_is_refused(profile: PassProfile, name: str) -> None:
    message = convert_planning.profile_to_message(profile)
    setattr(message, name, getattr(message, name)[:-1])
    with pytest.raises(ValueError, match=f"^{name} has 2 values, must have 3"):
        convert_planning.profile_from_message(message)


def test_a_certificate_without_a_branch_is_refused() -> None:
    with pytest.raises(ValueError, match="a certificate has no branch, must have >= 1"):
        convert_planning.certificate_from_message(ours.PassCertificate(target="bird"))
