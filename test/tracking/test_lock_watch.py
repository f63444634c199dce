"""The watch on monopulse: false locks are named within 2 s, right ones never."""

import copy
import math

import numpy as np
import pytest

from rf_pointing.geometry import MDEG, PointingError, random_stream
from rf_pointing.tracking import LockWatch, LockWatchParams

H = 17.0 * MDEG
CLUSTER_S = 0.1
SIGMA = 0.14 * MDEG


def sensed(t_s: float, value: complex, level_db_hz: float = 45.0, valid: bool = True) -> PointingError:
    return PointingError(
        t_s=t_s, sensor="monopulse", cross_elevation_rad=value.real, elevation_rad=value.imag,
        covariance_rad2=np.eye(2) * SIGMA**2, carrier_to_noise_db_hz=level_db_hz, valid=valid,
        reason="" if valid else "no lock",
    )  # fmt: skip


def close_loop(
    response: complex, start: complex, bandwidth_hz: float, seconds: float, name: str = "loop"
) -> tuple[str, float]:
    """Integrate a sensed error -> beam with this sensor response; return the first fault and its time."""
    rng = random_stream(12, name)
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    beam, target = 0j, start
    for k in range(round(seconds / CLUSTER_S)):
        t_s = k * CLUSTER_S
        noise = complex(*rng.standard_normal(2)) * SIGMA
        wind = complex(*rng.standard_normal(2)) * 0.1 * MDEG
        error = response * (target - beam - wind) + noise
        fault = watch.add(sensed(t_s, error), beam.real, beam.imag)
        if fault:
            return fault, t_s
        beam += 2.0 * math.pi * bandwidth_hz * CLUSTER_S * error
    return "", seconds


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("bandwidth_hz", [0.04, 0.3])
def test_right_sensor_is_never_doubted_in_two_minutes(seed: int, bandwidth_hz: float) -> None:
    assert close_loop(1.0, complex(5.0, -3.0) * MDEG, bandwidth_hz, 120.0, f"right {seed}") == ("", 120.0)


@pytest.mark.parametrize("bandwidth_hz", [0.04, 0.1, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_flipped_sign_is_found_within_two_seconds(bandwidth_hz: float, seed: int) -> None:
    fault, t_s = close_loop(-1.0, complex(4.0, 3.0) * MDEG, bandwidth_hz, 10.0, f"flip {seed}")
    assert fault.startswith("sign flip: the error grows while it is corrected")
    assert t_s <= 2.0


def follow_gusts(watch: LockWatch, seconds: float, name: str) -> str:
    """Let the loop follow a wind of 0.2 mdeg per axis that stays for a second, as the encoders do not see it."""
    rng, beam, gust = random_stream(12, name), 0j, 0j
    keep = math.exp(-CLUSTER_S)
    for k in range(round(seconds / CLUSTER_S)):
        gust = keep * gust + math.sqrt(1.0 - keep**2) * 0.2 * MDEG * complex(*rng.standard_normal(2))
        error = gust - beam + complex(*rng.standard_normal(2)) * SIGMA
        fault = watch.add(sensed(k * CLUSTER_S, error), beam.real, beam.imag)
        if fault:
            return fault
        beam += 2.0 * math.pi * 0.2 * CLUSTER_S * error
    return ""


def test_a_loop_that_follows_gusts_is_no_sign_flip() -> None:
    """Gusts that come back look like one when the size of the error is not asked for."""
    params = LockWatchParams(half_power_beamwidth_rad=H, unmodelled_beamwidths=0.012)
    assert follow_gusts(LockWatch(params), 600.0, "gusts") == ""
    assert follow_gusts(LockWatch(params.replace(grown=0.0)), 600.0, "gusts").startswith(("sign flip", "phase"))


def test_sidelobe_slope_is_found_within_two_seconds() -> None:
    fault, t_s = close_loop(5.0, complex(1.0, 0.5) * MDEG, 0.04, 10.0)
    assert fault.startswith("sidelobe: the error changes")
    assert t_s <= 2.0


def test_turned_phase_is_found_within_two_seconds() -> None:
    fault, t_s = close_loop(np.exp(1.5j), complex(5.0, 2.0) * MDEG, 0.1, 10.0)
    assert fault.startswith("phase: the error is turned by")
    assert t_s <= 2.0


def test_level_far_below_the_link_with_a_small_error_is_a_sidelobe_after_three_clusters() -> None:
    """One cluster alone may be the end of the carrier."""
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    faults = [
        watch.add(sensed(0.1 * k, error_mdeg * MDEG, 45.0), 0.0, 0.0, expected_carrier_to_noise_db_hz=expected)
        for k, (error_mdeg, expected) in enumerate(
            [(1.0, 62.6), (1.0, 62.6), (8.0, 62.6), (1.0, 50.0), (1.0, 62.6), (1.0, 62.6), (1.0, 62.6)]
        )
    ]
    assert faults == [""] * 6 + ["sidelobe: C/N0 is 17.6 dB below the link's with a small error"]


def test_beam_at_rest_gives_no_verdict() -> None:
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    for k in range(30):
        assert watch.add(sensed(k * CLUSTER_S, 3.0 * MDEG), 0.0, 0.0) == ""
    assert watch.response() is None


def test_invalid_errors_are_not_used() -> None:
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    watch.add(sensed(0.0, 1.0 * MDEG, valid=False), 0.0, 0.0)
    assert watch.state.rows == ()


def test_copied_state_continues_identically_and_reset_forgets() -> None:
    watch, twin = LockWatch(LockWatchParams()), LockWatch(LockWatchParams())
    for k in range(5):
        watch.add(sensed(k * CLUSTER_S, complex(5.0 - k, 0.3 * k) * MDEG), k * MDEG, 0.0)
    twin.state = copy.deepcopy(watch.state)
    for each in (watch, twin):
        each.add(sensed(0.5, 0j), 5.0 * MDEG, 0.0)
    assert watch.response() == twin.response()
    watch.reset()
    assert watch.response() is None
