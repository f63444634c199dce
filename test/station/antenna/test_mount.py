"""The simulated mount's errors: named as in SATCAL, and removed as exactly as the docstring says."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.calibration import TERMS, BiasModel
from rf_pointing.core import MDEG, sky_offset_rad
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.station.antenna.mount import RENEWAL_S, MountError, MountParams, RateAverage
from rf_pointing.station.description import read_station

CLAIMED_RAD = 0.03 * MDEG
TICK_S = 0.02


@pytest.fixture(scope="module")
def dss13() -> BiasModel:
    """Return the mount errors of the simulated station."""
    return read_station("dss13").sets("antenna_servo")["mount"].model()


def axes_along(track: TopocentricTrack, window: Pass, model: BiasModel, start_s: float) -> tuple[np.ndarray, ...]:
    """Times, true sky angles (n, 2), and the motion (n, 2) of the axes that hold the beam there."""
    times = start_s + TICK_S * np.arange(2000)
    look = track.sample(times)
    sky = np.column_stack([look.azimuth_rad, look.elevation_rad])
    rates = np.column_stack([look.azimuth_rate_rad_s, look.elevation_rate_rad_s])
    accelerations = np.column_stack([look.azimuth_acceleration_rad_s2, look.elevation_acceleration_rad_s2])
    return times, sky, *model.apply_moving(sky, rates, accelerations)


@pytest.mark.parametrize("at", ["rise", "peak", "set"])
def test_the_running_correction_is_within_the_claim_of_the_exact_inverse_along_a_pass(
    track: TopocentricTrack, window: Pass, dss13: BiasModel, at: str
) -> None:
    start_s = {"rise": window.aos_t_s, "peak": window.tca_t_s - 20.0, "set": window.los_t_s - 40.0}[at]
    times, _, axes, rates, accelerations = axes_along(track, window, dss13, start_s)
    error = MountError(dss13)
    got = np.array([error.remove(*row) for row in zip(times.tolist(), axes, rates, accelerations, strict=True)])
    exact = np.column_stack(dss13.remove(*axes.T, *rates.T, *accelerations.T))
    # The first straight piece has no slope yet; the claim is about the run.
    settled = times > times[0] + 2.0 * RENEWAL_S
    off = sky_offset_rad(*got[settled].T, *exact[settled].T)
    assert np.max(np.hypot(*off)) < CLAIMED_RAD


def test_the_first_value_and_one_after_a_long_gap_are_exact(
    track: TopocentricTrack, window: Pass, dss13: BiasModel
) -> None:
    times, _, axes, rates, accelerations = axes_along(track, window, dss13, window.tca_t_s)
    error = MountError(dss13)
    for row in (0, 300, 1999):
        got = error.remove(float(times[row]), axes[row], rates[row], accelerations[row])
        exact = dss13.remove(*axes[row], *rates[row], *accelerations[row])
        np.testing.assert_allclose(got, exact, rtol=0.0, atol=1e-12)


def test_every_term_of_the_model_has_its_parameter_in_satcal_order() -> None:
    names = [item.name for item in dataclasses.fields(MountParams)]
    assert [name.rsplit("_", 1)[0] for name in names] == [term.name for term in TERMS]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_an_averaged_rate_is_the_rate_of_the_averaging_time_before_up_to_its_third_derivative(order: int) -> None:
    """rate = t^order: the average is rate - T rate', without a term of the second derivative, + T^3 of the third."""
    time_s, step_s, count = 2.0, 0.005, 40_000
    average = RateAverage(time_s)
    for t_s in step_s * np.arange(1, count + 1):
        average.update(step_s, np.array([t_s**order, 0.0]))
    t_s = step_s * count
    wanted = t_s**order - time_s * order * t_s ** (order - 1)
    third = 6.0 * time_s**3 if order == 3 else 0.0
    # Half a step of the integration is a delay of its own.
    assert average.rate_rad_s[0] == pytest.approx(wanted + third, abs=step_s * order * t_s ** (order - 1) + 1e-6)
    assert average.acceleration_rad_s2[0] == pytest.approx(
        order * t_s ** (order - 1) - time_s * order * (order - 1) * t_s ** max(order - 2, 0), rel=1e-3
    )


@pytest.mark.parametrize("peak_deg", [89.96, 90.5])
def test_a_beam_that_crosses_the_zenith_is_where_the_exact_inverse_says_and_never_stops_the_antenna(
    dss13: BiasModel, peak_deg: float
) -> None:
    """The mount's own zenith is a hole of 0.05 deg in which no direction can be named; the axes go through it all the same."""
    model = dss13.replace(**{term.name: 0.0 for term in dss13.terms if term.kind == "lag"})
    error, still = MountError(model), np.zeros(2)
    times = TICK_S * np.arange(0, 3000, 2)
    azimuth = np.radians(20.0 + 1.7 * times)
    elevation = np.radians(peak_deg + 0.001 - 6.0 * np.sin(2.0 * np.pi * times / 60.0))
    sky = np.array(
        [error.remove(t, np.array(row), still, still) for t, *row in zip(times, azimuth, elevation, strict=True)]
    )
    assert np.all(np.isfinite(sky))
    clear = np.abs(elevation - 0.5 * np.pi) > np.radians(0.3)
    exact = np.column_stack(model.remove(azimuth[clear], elevation[clear], 0.0, 0.0, 0.0, 0.0))
    off = sky_offset_rad(*sky[clear].T, *exact.T)
    assert np.max(np.hypot(*off)) < 1.0 * MDEG


def lagging() -> MountParams:
    return MountParams(
        azimuth_velocity_lag_s=0.5, azimuth_acceleration_lag_s2=0.2, elevation_velocity_lag_s=-0.3,
        elevation_acceleration_lag_s2=0.4,
    )  # fmt: skip


@pytest.mark.parametrize("elevation", [0.9, 0.5 * math.pi - 0.05, 0.5 * math.pi + 0.05])
def test_lags_act_on_the_motion_of_the_axes_far_from_the_zenith_and_near_it(elevation: float) -> None:
    """observed = true + lag x rate + lag x acceleration, each axis by itself."""
    error, axes = MountError(lagging().model()), np.array([1.0, elevation])
    sky = error.remove(5.0, axes, np.array([0.02, 0.01]), np.array([0.003, -0.002]))
    expected = axes - [0.5 * 0.02 + 0.2 * 0.003, -0.3 * 0.01 - 0.4 * 0.002]
    np.testing.assert_allclose(sky, expected, rtol=0.0, atol=1e-9)


def test_near_the_zenith_lags_add_to_what_the_mount_is_off_at_rest(dss13: BiasModel) -> None:
    """The motion takes the axes away from where they are; what is left is removed as of a mount at rest."""
    lags = {term.name: 0.0 for term in dss13.terms if term.kind == "lag"}
    still = dss13.replace(**lags)
    moving = still.replace(azimuth_velocity_lag=0.5, elevation_velocity_lag=-0.3)
    axes, rates = np.array([1.0, 0.5 * math.pi - 0.04]), np.array([0.02, 0.01])
    found = MountError(moving).remove(5.0, axes, rates, np.zeros(2))
    expected = still.remove(axes[0] - 0.5 * 0.02, axes[1] + 0.3 * 0.01, 0.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(found, [float(part) for part in expected], rtol=0.0, atol=1e-9)
