"""A service: how often it starts, what it does without its beacon, under the Sun and at the hour."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rf_pointing.api.service import make_desk, make_service, stays
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.core import angular_distance_rad, gaussian_loss_db, parse_utc
from rf_pointing.core.whole_file import KeptState
from rf_pointing.station.service.keeper import Service, ServiceDesk, ServiceParams
from rf_pointing.station.service.sidereal import SIDEREAL_DAY_S, SiderealMotion

WIDTH_RAD, T_S, BASE = math.radians(0.25), 1.8e9, (3.0, 0.6)
W = math.tau / SIDEREAL_DAY_S


def service(
    swing_deg: float = 0.0, sun: Callable[[float], Any] = lambda _t_s: None, name: str = "GEO"
) -> Service:
    """Return a service of a target that is known: it swings in elevation, fastest at the start."""
    motion = SiderealMotion(WIDTH_RAD, 1e-5, 1e-5, t_s=T_S)
    motion.mean[:] = 0.0
    # a cos + b sin of the first harmonic of the elevation, with its phase at the start.
    swing, phase = math.radians(swing_deg), W * T_S
    motion.mean[9 + 1], motion.mean[9 + 2] = -swing * math.sin(phase), swing * math.cos(phase)
    return Service(name, ServiceParams(), motion, lambda _t_s: BASE, sun)


class Sky:
    """An ideal antenna with a receiver without noise; errors in beamwidths by the second."""

    def __init__(self, subject: Service, truth: Callable[[float], tuple[float, float]]) -> None:
        self.subject, self.truth, self.beam, self.t_s = subject, truth, truth(T_S), T_S

    def run(self, seconds: float, *, beacon: bool = True, step_s: float = 4.0) -> np.ndarray:
        apart = []
        for _ in range(round(seconds / step_s)):
            self.t_s += step_s
            off = float(angular_distance_rad(*self.truth(self.t_s), *self.beam)) / WIDTH_RAD
            level = 50.0 - float(gaussian_loss_db(off, 1.0)) if beacon else None
            goal = self.subject.step(self.t_s, self.beam, level)
            self.beam = goal or self.beam
            apart.append(off)
        return np.array(apart)


def swinging(swing_deg: float) -> Callable[[float], tuple[float, float]]:
    return lambda t_s: (BASE[0], BASE[1] + math.radians(swing_deg) * math.sin(W * (t_s - T_S)))


def test_starts_are_those_of_the_way_and_the_loss_that_of_even_drift() -> None:
    """6 deg of swing are 24 deg a day in steps of two holds; the mean square of an even drift is hold^2 / 3."""
    subject = service(6.0)
    apart = Sky(subject, swinging(6.0)).run(SIDEREAL_DAY_S)
    # One axis moves: by the cube roots of the speeds it has nearly the whole of both squares.
    hold = subject.params.hold_beams * math.sqrt(2.0)
    expected = 24.0 / (2.0 * hold * 0.25)
    assert subject.starts[1] == pytest.approx(expected, rel=0.15)
    assert subject.starts[0] <= 2 * subject.peaks + 2
    assert np.mean(apart**2) == pytest.approx(hold**2 / 3.0, rel=0.2)
    # A peak leads across the target, and may meet a hold of the other axis.
    assert np.quantile(apart, 0.99) < 1.1 * hold
    assert np.max(apart) < math.hypot(hold, subject.params.peak_beams)


def test_a_target_that_does_not_move_starts_no_motor_but_for_its_peaks() -> None:
    subject = service(0.0)
    Sky(subject, swinging(0.0)).run(SIDEREAL_DAY_S)
    assert subject.starts.sum() <= 4 * subject.peaks
    assert subject.peaks <= SIDEREAL_DAY_S / subject.params.longest_s + 1.0


def test_without_the_beacon_the_service_goes_on_from_memory() -> None:
    """Six hours: no peak, the way as before, and it says why."""
    subject = service(6.0)
    sky = Sky(subject, swinging(6.0))
    sky.run(3600.0)
    peaks, starts = subject.peaks, subject.starts.sum()
    apart = sky.run(6.0 * 3600.0, beacon=False)
    assert subject.peaks == peaks
    assert subject.starts.sum() > starts + 20
    assert np.max(apart) < 0.3
    assert subject.state == "rests from memory, no beacon" or subject.state == "moves"


def test_under_the_sun_nothing_is_measured_and_the_state_says_so() -> None:
    subject = service(0.0, sun=lambda _t_s: BASE)
    before = subject.motion.covariance.copy()
    Sky(subject, swinging(0.0)).run(7.0 * 3600.0)
    assert subject.peaks == 0
    assert subject.state == "rests from memory, the Sun is behind it"
    np.testing.assert_array_equal(subject.motion.covariance, before)


def test_a_fade_of_the_beacon_teaches_nothing() -> None:
    """Levels far below the usual one are no beacon: a satellite that is switched off is not sought."""
    subject = service(0.0)
    sky = Sky(subject, swinging(0.0))
    sky.run(600.0)
    mean = subject.motion.mean.copy()
    for second in range(1, 1000):
        subject.step(sky.t_s + second, sky.beam, 20.0)
    np.testing.assert_array_equal(subject.motion.mean, mean)


def test_satellites_are_handed_over_at_their_hours_and_kept_in_one_file(tmp_path: Path) -> None:
    state = tmp_path / "services.json"
    first, second = service(name="A"), service(1.0, name="B")
    desk = ServiceDesk([first, second], [6.0, 18.5], KeptState(str(state)))
    day_s = parse_utc("2026-06-21T00:00:00")
    served = [desk.active(day_s + 3600.0 * hour).name for hour in (0.0, 5.9, 6.0, 18.4, 18.5, 23.9)]
    assert served == ["B", "B", "A", "A", "B", "B"]
    assert desk.keep() == ""
    kept = KeptState(str(state)).recover()
    assert kept.keys() == {"A", "B"}
    assert kept["A"]["base_rad"] == list(BASE)
    with pytest.raises(ValueError, match="must differ"):
        ServiceDesk([first, second], [6.0, 6.0], KeptState(""))


def test_bodies_are_services_by_their_tracks_and_do_not_stay(tmp_path: Path) -> None:
    station, t_s = Station("geo_7m"), parse_utc("2026-06-21T12:00:00")
    for name in ("Moon", "Sun", "Cassiopeia A"):
        target = Target(satellite=name)
        track = station.track_of(target)
        assert not stays(track, t_s)
        subject = make_service(station, target, t_s)
        for later_s in (0.0, 7200.0):
            seen = track.target_at(t_s + later_s)
            apart = angular_distance_rad(
                *subject.direction(t_s + later_s), seen.azimuth_rad, seen.elevation_rad
            )
            assert apart < 1e-6
    desk = make_desk(station, [Target(satellite="Moon")], [0.0], t_s, tmp_path / "state.json")
    assert desk.active(t_s).name == "Moon"
