"""Passes as messages and back; a pass that cannot be is refused in words."""

import dataclasses
import math

import pytest
from rf_pointing_msgs import msg as ours

from rf_pointing.ephemeris import Pass
from rf_pointing.nodes import convert_planning

T_S = 1_151_384_323.813083


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
