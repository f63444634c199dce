"""Times of satellites along their orbits, as passes teach them, kept from pass to pass.

    ahead(t) = tau + rate (t - t0)        variance: that of both, and (g dt^2)^2

tau s ahead of the elements and its rate, known from the passes up to t0; g is the quadratic growth
of the law of the elements over the speed: what drag may have changed since.  A pass gives one tau:
the directions in which the beam was held, fitted with the time along the track, the distance across
it and a bias of the mount; it is fused with what was known by the equations of Kalman.

What was learned belongs to one set of elements.  It is dropped when others come, when a pass
contradicts it (a manoeuvre), and when the elements alone are known better.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from rf_pointing.core import DAY_S, Array, HeldDirection, KeptState, Pair
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.state_vector import norm
from rf_pointing.ephemeris.track import TopocentricTrack
from rf_pointing.ephemeris.uncertainty import ElementUncertainty

LEAST_SAMPLES = 60
"""Directions, one a second, from which a pass teaches."""
# Time over which what moves the beam, and a scan's window, is the same.
CORRELATION_S = 15.0
# Prior of a fit: metres across the track, a bias of the mount in beamwidths.
CROSS_M, BIAS_BEAMWIDTHS = 3000.0, 0.25
# However even the directions are: the mount's errors change over the sky as the time does.
LEAST_SIGMA_BEAMWIDTHS, MOUNT_BEAMWIDTHS = 0.02, 0.08
LARGEST_S, DIFFERENCE_S, ROUNDS = 60.0, 0.05, 5
LEAST_M = 0.01
# A pass that is so far from what was expected tells of a manoeuvre.
MANOEUVRE_SIGMAS = 6.0


@dataclass(frozen=True, kw_only=True)
class LearnedTime:
    """How far a target is ahead of the elements of `epoch_t_s`, by `passes` up to `t_s`."""

    epoch_t_s: float
    t_s: float
    along_s: float
    rate: float
    variances: tuple[float, float, float]
    """Variance of the time, covariance of both, variance of the rate."""
    growth_1_s: float
    passes: int = 1
    unlawful: float = 1.0
    """How many times the law of the elements was too sure of them."""

    def ahead_s(self, t_s: Any) -> Any:
        """Return the seconds ahead of the elements at UTC `t_s`."""
        return self.along_s + self.rate * (t_s - self.t_s)

    def sigma_s(self, t_s: float) -> float:
        """Return the standard deviation of `ahead_s`."""
        return math.sqrt(self._grown(t_s)[0, 0])

    def _grown(self, t_s: float) -> Array:
        later_s, (along, both, rate) = t_s - self.t_s, self.variances
        drag = self.growth_1_s * later_s
        return np.array([
            [along + 2.0 * later_s * both + later_s**2 * rate + (drag * later_s) ** 2, both + later_s * rate],
            [both + later_s * rate, rate + 4.0 * drag**2],
        ])  # fmt: skip

    def fused(self, t_s: float, along_s: float, sigma_s: float) -> "LearnedTime":
        """Return what is known after a pass about `t_s` that gave this time."""
        covariance, innovation = self._grown(t_s), along_s - self.ahead_s(t_s)
        gain = covariance[:, 0] / (covariance[0, 0] + sigma_s**2)
        keep = np.eye(2) - np.outer(gain, [1.0, 0.0])
        covariance = keep @ covariance @ keep.T + np.outer(gain, gain) * sigma_s**2
        (along, both), (_, rate) = covariance.tolist()
        return replace(
            self, t_s=t_s, along_s=float(self.ahead_s(t_s) + gain[0] * innovation),
            rate=float(self.rate + gain[1] * innovation), passes=self.passes + 1,
            variances=(along, both, rate),
        )  # fmt: skip

    def text(self, t_s: float) -> str:
        """Say how far ahead the target is at `t_s`, and from how many passes."""
        passes = "1 pass" if self.passes == 1 else f"{self.passes} passes"
        return f"{self.ahead_s(t_s):+.3f} s along the track, sigma {self.sigma_s(t_s):.3f} s, from {passes}"


class LearnedTimes:
    """The learned times of all satellites in a file; without a name they are forgotten."""

    def __init__(self, name: str) -> None:
        self._state = KeptState(name)
        try:
            self._known = {satellite: _read(values) for satellite, values in self._state.recover().items()}
        except (TypeError, ValueError, KeyError) as error:
            raise ValueError(f"learned_file {name} cannot be used: {error}") from error
        self._held: list[HeldDirection] = []
        self.news = ""
        """The time that was dropped last, and why."""

    @property
    def problem(self) -> str:
        """Why the file does not hold what it should, empty when it does."""
        return self._state.problem

    def of(self, track: TopocentricTrack, t_s: float, law: ElementUncertainty) -> LearnedTime | None:
        """Return what is known of a track's target at `t_s`; what no longer holds is dropped."""
        elements, known = getattr(track.target, "elements", None), self._known.get(track.name)
        if known is None or not isinstance(elements, Elements):
            return None
        if abs(elements.epoch_t_s - known.epoch_t_s) > 1e-3:
            self._drop(track.name, "newer elements are in force")
            return None
        lawful_s = known.unlawful * _lawful_s(track, t_s, law)
        if known.sigma_s(t_s) >= lawful_s:
            own = f"after {(t_s - known.t_s) / 3600.0:.1f} h its sigma is {known.sigma_s(t_s):.2f} s"
            self._drop(track.name, f"{own}, that of the elements {lawful_s:.2f} s")
            return None
        return known

    def applied(self, track: TopocentricTrack, t_s: float, law: ElementUncertainty) -> TopocentricTrack:
        """Return the track with what was learned of its target, without where there is nothing."""
        known = self.of(track, t_s, law)
        if known is None and track.learned is None:
            return track
        return track.with_offsets(hold_t_s=track.hold_t_s, learned=known, **track.offsets.offsets)

    def forget(self, name: str) -> str:
        """Forget what was learned of a target and say so; ValueError where nothing was."""
        if name not in self._known:
            raise ValueError(f"nothing was learned of {name}")
        self._drop(name, "forgotten on request")
        return self.news

    def take(self, held: HeldDirection) -> None:
        """Note a direction of the pass in hand; one a second is enough."""
        if not self._held or held.t_s >= self._held[-1].t_s + 1.0:
            self._held.append(held)
        elif held.t_s < self._held[-1].t_s:
            # Time was set back: another pass.
            self._held = [held]

    def end_pass(self, track: TopocentricTrack, law: ElementUncertainty) -> str:
        """Learn from the directions noted, and say what; "" where they are too few."""
        held, self._held = self._held, []
        elements = getattr(track.target, "elements", None)
        if len(held) < LEAST_SAMPLES or not isinstance(elements, Elements):
            return ""
        along_s, sigma_s = fitted_time(track, held)
        t_s = 0.5 * (held[0].t_s + held[-1].t_s)
        known, lost = self.of(track, t_s, law), ""
        if known is not None:
            expected_s = math.hypot(known.sigma_s(t_s), sigma_s)
            if abs(along_s - known.ahead_s(t_s)) > MANOEUVRE_SIGMAS * expected_s:
                off_s = along_s - float(known.ahead_s(t_s))
                self._drop(track.name, f"this pass is {off_s:+.2f} s off it, sigma {expected_s:.2f} s: a manoeuvre")
                known, lost = None, f"; {self.news}"
        found = (known or _unlearned(elements, track, t_s, law, along_s)).fused(t_s, along_s, sigma_s)
        self._known[track.name] = found
        self._keep()
        return f"{track.name} is {found.text(t_s)}{lost}"

    def _drop(self, name: str, why: str) -> None:
        del self._known[name]
        self.news = f"what was learned of {name} is dropped: {why}"
        self._keep()

    def _keep(self) -> None:
        self._state.keep({name: asdict(one) for name, one in self._known.items()})


def fitted_time(track: TopocentricTrack, held: Sequence[HeldDirection]) -> Pair:
    """Return how far ahead of its elements a target was that was held in these directions.

    Seconds and their standard deviation: by least squares with the distance across the track and
    a bias of the mount, which are known beforehand to `CROSS_M` and `BIAS_BEAMWIDTHS`.
    """
    times, azimuth, elevation = (np.array([getattr(each, name) for each in held])
                                 for name in ("t_s", "azimuth_rad", "elevation_rad"))  # fmt: skip
    width = held[0].beamwidth_rad
    stretch, floor = np.cos(elevation), LEAST_SIGMA_BEAMWIDTHS * width

    def off(ahead_s: float) -> Array:
        """Return the directions (2, n) less those of a target so far ahead, on the sky."""
        still = LearnedTime(
            epoch_t_s=0.0, t_s=0.0, along_s=ahead_s, rate=0.0, variances=(0.0, 0.0, 0.0), growth_1_s=0.0
        )
        looks = track.with_offsets(learned=still, **track.offsets.offsets).sample(times)
        across = np.remainder(azimuth - looks.azimuth_rad + math.pi, 2.0 * math.pi) - math.pi
        return np.array([across * stretch, elevation - looks.elevation_rad])

    range_m = track.sample(times).range_m
    known = np.array([LARGEST_S, CROSS_M, BIAS_BEAMWIDTHS * width, BIAS_BEAMWIDTHS * width])
    state, sigma = np.zeros(4), floor
    for _ in range(ROUNDS):
        rest = off(float(state[0]))
        ahead = -(off(float(state[0]) + DIFFERENCE_S) - off(float(state[0]) - DIFFERENCE_S)) / (2.0 * DIFFERENCE_S)
        speed = np.maximum(np.hypot(*ahead), 1e-9)
        left = np.array([-ahead[1], ahead[0]]) / (speed * range_m)
        ones, none = np.ones(len(times)), np.zeros(len(times))
        biases = np.concatenate([ones, none]), np.concatenate([none, ones])
        rows = np.stack([ahead.ravel(), left.ravel(), *biases], axis=1)
        # The same gust, and the same window of a scan, is in many of the directions.
        weight = 1.0 / (sigma**2 * max(CORRELATION_S * (len(times) - 1) / (times[-1] - times[0]), 1.0))
        normal = weight * rows.T @ rows + np.diag(1.0 / known**2)
        linear = rest.ravel() + rows[:, 0] * state[0]
        state = np.linalg.solve(normal, weight * rows.T @ linear)
        sigma = max(float(np.std(linear - rows @ state)), floor)
    found_s = math.sqrt(float(np.linalg.inv(normal)[0, 0]))
    return float(state[0]), math.hypot(found_s, MOUNT_BEAMWIDTHS * width / float(speed.max()))


def _lawful_s(track: TopocentricTrack, t_s: float, law: ElementUncertainty) -> float:
    """Return the standard deviation along the orbit by the age of the elements alone."""
    age_s = t_s - track.target.elements.epoch_t_s  # type: ignore[attr-defined]
    # A law may say that elements have no error: a pass shows otherwise.
    return max(law.sigmas_m(age_s)[0], LEAST_M) / float(norm(track.target.motion_at(t_s).velocity))


def _unlearned(
    elements: Elements, track: TopocentricTrack, t_s: float, law: ElementUncertainty, along_s: float
) -> LearnedTime:
    """Return what the law says before the first pass, which gave `along_s`: on time, with errors.

    A pass that the law cannot explain is believed all the same, and may drift as it came.
    """
    age_s, lawful_s = abs(t_s - elements.epoch_t_s), _lawful_s(track, t_s, law)
    speed_m_s = float(norm(track.target.motion_at(t_s).velocity))
    rate = (law.along_growth_m_s + 2.0 * law.along_drag_m_s2 * age_s) / speed_m_s
    unlawful = abs(along_s) / lawful_s if abs(along_s) > MANOEUVRE_SIGMAS * lawful_s else 1.0
    if unlawful > 1.0:
        rate = max(rate, abs(along_s) / max(age_s, 3600.0))
    lawful_s = max(lawful_s, abs(along_s))
    return LearnedTime(
        epoch_t_s=elements.epoch_t_s, t_s=t_s, along_s=0.0, rate=0.0, variances=(lawful_s**2, 0.0, rate**2),
        growth_1_s=law.along_drag_m_s2 / speed_m_s, passes=0, unlawful=unlawful,
    )  # fmt: skip


def _read(values: dict[str, Any]) -> LearnedTime:
    """Return one entry of the file; ValueError, TypeError or KeyError for what cannot be one."""
    along, both, rate = (float(each) for each in values["variances"])
    found = LearnedTime(**{**values, "variances": (along, both, rate)})
    numbers = (found.epoch_t_s, found.t_s, found.along_s, found.rate, along, both, rate, found.growth_1_s,
               found.unlawful)  # fmt: skip
    if not all(math.isfinite(each) for each in numbers) or min(along, rate) < 0.0 or both**2 > along * rate * 1.000001:
        raise ValueError(f"variances={values['variances']} must be finite and those of a time and its rate")
    if abs(found.along_s) > LARGEST_S or abs(found.rate) > LARGEST_S / DAY_S * 100.0:
        raise ValueError(f"along_s={found.along_s} must be within {LARGEST_S} s")
    return found
