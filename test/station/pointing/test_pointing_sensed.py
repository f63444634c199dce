"""What sensed errors do to the commands: followed, refused, too old, lost, searched for."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import MDEG, MonopulseCluster, PointingError, sky_offset_rad
from rf_pointing.ephemeris import Pass
from rf_pointing.tracking import MonopulseParams, MonopulseTracker

STRONG_DB_HZ, WEAK_DB_HZ = 60.0, 5.0
BEAMWIDTH_RAD = 65.0 * MDEG
ROUNDING_RAD = 1e-10
"""Trim and residual are moved against each other by the filter; their sum stays to the rounding of floats."""

Rig = Any
MakeRig = Callable[..., Rig]


def error(t_s: float, right_rad: float = 0.0, up_rad: float = 0.0, **changes: Any) -> PointingError:
    values = {"t_s": t_s, "sensor": "monopulse", "cross_elevation_rad": right_rad, "elevation_rad": up_rad}
    return PointingError(**{**values, "carrier_to_noise_db_hz": STRONG_DB_HZ, **changes})


# Sensed errors


def acquired(rig: MakeRig, window: Pass, seconds: float = 4.0, **changes: Any) -> Rig:
    """A rig in monopulse mode on a target that is exactly where it is predicted."""
    made = rig("monopulse", **changes)
    *_, (_, _, status) = made.run(window.aos_t_s, seconds, lambda t_s, _: [error(t_s - 0.06)])
    assert status.mode == "monopulse"
    return made


def test_a_sensed_error_moves_the_beam_towards_the_target(rig: MakeRig, window: Pass) -> None:
    """A target that steps aside is followed at 2 pi f_m = 1.26 of the error in a second."""
    made = acquired(rig, window)
    beside = Offset(5 * MDEG, -3 * MDEG, "monopulse")
    *_, (_, _, early) = made.run(window.aos_t_s + 4.0, 1.0, beside)
    *_, (_, _, late) = made.run(window.aos_t_s + 5.0, 4.0, beside)
    # Without delay it would be 72 % after a second; the errors act 0.2 to 0.3 s late.
    assert 0.55 < early.cross_elevation_offset_rad / (5 * MDEG) < 0.8
    assert late.cross_elevation_offset_rad == pytest.approx(5 * MDEG, rel=0.03)
    assert late.elevation_offset_rad == pytest.approx(-3 * MDEG, rel=0.03)
    assert early.cross_elevation_error_rad > 1 * MDEG > abs(late.cross_elevation_error_rad)


@pytest.mark.parametrize("useless", [{"valid": False, "reason": "no lock"}, {"sensor": "conscan"}])
def test_errors_that_must_not_be_used_move_nothing(rig: MakeRig, window: Pass, useless: dict[str, Any]) -> None:
    made = acquired(rig, window)
    for _, _, status in made.run(
        window.aos_t_s + 4.0, 0.5, lambda t_s, _: [error(t_s - 0.06, 9 * MDEG, 9 * MDEG, **useless)]
    ):
        assert status.cross_elevation_offset_rad == pytest.approx(0.0, abs=ROUNDING_RAD)
        assert status.elevation_offset_rad == pytest.approx(0.0, abs=ROUNDING_RAD)


@pytest.mark.parametrize(("every", "count"), [(2, 1), (10, 5)])
def test_broken_clusters_among_good_ones_do_not_end_the_lock(
    rig: MakeRig, window: Pass, every: int, count: int
) -> None:
    """Of `every` clusters the first `count` have a sample that is no number: the loop follows the others."""
    made, aside_rad = acquired(rig, window), 5.0 * MDEG
    beside, tracker = Offset(aside_rad, 0.0, "monopulse"), MonopulseTracker(MonopulseParams())
    samples = np.array([1.0, np.nan, 1.0, 1.0, 1.0])

    def sense(t_s: float, rig: Rig) -> list[PointingError]:
        if round(10.0 * t_s) % every >= count:
            return beside(t_s, rig)
        broken = MonopulseCluster(
            t_s=t_s - 0.1 + 0.02 * np.arange(5), sum=samples, difference_cross_elevation=samples,
            difference_elevation=samples, carrier_to_noise_db_hz=STRONG_DB_HZ,
        )  # fmt: skip
        return [tracker.measure(broken)]

    for _, _, status in made.run(window.aos_t_s + 4.0, 6.0, sense):
        assert status.mode == "monopulse", status.reason
    assert status.cross_elevation_offset_rad == pytest.approx(aside_rad, rel=0.1)


@pytest.mark.parametrize(("sign", "faults"), [(1.0, 0), (-1.0, 1)])
def test_errors_of_the_wrong_sign_are_no_longer_followed(rig: MakeRig, window: Pass, sign: float, faults: int) -> None:
    """With a sign flipped the loop drives the beam away from a target 3 mdeg aside, e-fold in 0.8 s."""
    made, beside = acquired(rig, window), Offset(3 * MDEG, -2 * MDEG, "monopulse")

    def sense(t_s: float, rig: Rig) -> list[PointingError]:
        (seen,) = beside(t_s, rig)
        return [error(t_s, sign * seen.cross_elevation_rad, sign * seen.elevation_rad,
                      covariance_rad2=np.eye(2) * (0.1 * MDEG) ** 2)]  # fmt: skip

    for _, _, status in made.run(window.aos_t_s + 4.0, 4.0, sense):
        if status.mode != "monopulse":
            break
    assert made.controller.carrier.faults == faults
    assert (status.mode == "monopulse") == (faults == 0)
    if faults:
        assert made.controller.carrier.last_fault.startswith(("sign flip", "phase"))
        assert status.reason.startswith(("sign flip", "phase"))


def test_a_lost_carrier_freezes_the_loop_at_once_and_the_coast_follows_what_was_learned(
    rig: MakeRig, window: Pass
) -> None:
    """The satellite runs 0.2 s ahead of its elements: a quarter of the way to the top its offset has grown by a third."""
    made = acquired(rig, window)
    ahead_s, begin_s = 0.2, window.aos_t_s + 4.0

    def early(t_s: float, rig: Rig) -> list[PointingError]:
        real = rig.track.target_at(t_s + ahead_s)
        right, up = sky_offset_rad(real.azimuth_rad, real.elevation_rad, *rig.position_rad)
        return [error(t_s, float(right), float(up))]

    *_, (_, _, held) = made.run(begin_s, 40.0, early)
    lost = {"carrier_to_noise_db_hz": WEAK_DB_HZ, "cross_elevation_rad": 0.01, "elevation_rad": 0.01}
    modes, offsets = [], []
    for t_s, _, status in made.run(begin_s + 40.0, 4.5, lambda t_s, _: [error(t_s - 0.06, **lost)]):
        modes.append(status.mode)
        real, predicted = made.track.target_at(t_s + ahead_s), made.track.target_at(t_s)
        right, up = sky_offset_rad(real.azimuth_rad, real.elevation_rad, predicted.azimuth_rad, predicted.elevation_rad)
        offsets.append(
            math.hypot(status.cross_elevation_offset_rad - float(right), status.elevation_offset_rad - float(up))
        )
    assert held.mode == "monopulse"
    assert modes[1:] == ["coast"] * (len(modes) - 1), "the carrier counts as lost at the first sample without it"
    assert max(offsets) < 0.5 * MDEG


# Search


class Offset:
    """A target that runs beside its prediction, heard through a Gaussian beam, with the errors of a monopulse feed."""

    def __init__(self, right_rad: float, up_rad: float, sensor: str) -> None:
        self.right_rad, self.up_rad, self.sensor = right_rad, up_rad, sensor

    def __call__(self, t_s: float, made: Rig) -> list[PointingError]:
        real = made.track.target_at(t_s)
        right, up = sky_offset_rad(
            real.azimuth_rad + self.right_rad / math.cos(real.elevation_rad),
            real.elevation_rad + self.up_rad,
            *made.position_rad,
        )
        away = math.hypot(float(right), float(up)) / BEAMWIDTH_RAD
        level = STRONG_DB_HZ - 12.0 * away**2
        valid = self.sensor == "monopulse" and away < 0.4
        return [
            error(
                t_s, float(right) if valid else 0.0, float(up) if valid else 0.0,
                sensor=self.sensor, valid=valid, reason="" if valid else "not usable",
                carrier_to_noise_db_hz=max(level, 0.0),
            )
        ]  # fmt: skip


def test_a_search_finds_a_target_two_beamwidths_off_and_monopulse_starts_where_it_was(
    rig: MakeRig, window: Pass
) -> None:
    made, beside = rig("monopulse"), Offset(95.0 * MDEG, -85.0 * MDEG, "monopulse")
    modes: list[str] = []
    first_offset, entered = None, None
    for _, _, status in made.run(window.aos_t_s, 60.0, beside):
        if status.mode == "monopulse" and "search" in modes and entered is None:
            entered = len(modes)
        if entered is not None and len(modes) == entered + 2:
            first_offset = (status.cross_elevation_offset_rad, status.elevation_offset_rad)
        modes.append(status.mode)
        if entered is not None and len(modes) > entered + 60:
            break
    assert first_offset is not None, set(modes)
    assert modes[-1] == "monopulse"
    assert status.cross_elevation_offset_rad == pytest.approx(95.0 * MDEG, abs=1.0 * MDEG)
    assert status.elevation_offset_rad == pytest.approx(-85.0 * MDEG, abs=1.0 * MDEG)
    assert math.hypot(first_offset[0] - 95.0 * MDEG, first_offset[1] + 85.0 * MDEG) < 0.3 * BEAMWIDTH_RAD
