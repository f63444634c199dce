"""Whether the clock of a station is right, and what is late in it, from recorded passes.

A clock that is slow by tau shows every satellite ahead of its prediction by tau.  So do elements
with an error along the track, of one satellite at a time, and a model with errors of its terms.
One least-squares solution with priors takes all passes:

    d = tau (motion) + along (of each satellite) + cross, radial (of each pass)
          + terms of the model + scale of the refraction (of all)

Satellites that scatter by more than their elements should make the sigma larger (Birge ratio).
Passes of one satellite do not separate the clock from its elements, and no passes separate it from
a mount that follows late in both axes: lags that its model does not have are in the sigma.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np

from rf_pointing.api.misprediction import CLOCK_S, LIKE_A_CLOCK, TimedPass, timed_pass
from rf_pointing.core import AXES
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.time_scales import TAI_MINUS_GPS_S, TT_MINUS_TAI_S, leap_seconds
from rf_pointing.report.analysis import tracking_modes
from rf_pointing.report.recorded_signals import read_pass
from rf_pointing.report.replay_case import RecordedCase
from rf_pointing.report.summary import Latency
from rf_pointing.report.traffic import latencies
from rf_pointing.station.description import StationDescription

SIGMAS = 3.0
"""A clock is wrong, and its size is named, by so many sigma."""
SAMPLED = ("joint_states", "target", "pointing_error", "carrier_power")
"""Streams of which a whole sample may be counted wrong."""
OF_PASS = ("cross_track_m", "radial_m", "cross_track_drift_m_s", "radial_drift_m_s")
LEAST_RATE_RAD_S = math.radians(0.01)
"""Slower axes do not show how late they are."""


@dataclass(frozen=True)
class PassClock:
    """One pass: how far its satellite was ahead of the prediction, in s with one sigma.

    `elements_s` is one sigma of the elements along the track.  `axes_s` is by how much each axis
    follows its commands, NaN where it hardly moved.
    """

    bag: str
    target: str
    t_s: float
    ahead_s: float
    sigma_s: float
    elements_s: float
    axes_s: tuple[float, ...]
    periods_s: Mapping[str, float]
    hops: tuple[Latency, ...] = ()
    axes: tuple[str, str] = AXES

    def __str__(self) -> str:
        size = f"{1e3 * self.ahead_s:+.1f} ±{1e3 * self.sigma_s:.1f} ms ahead"
        return f"{self.target}, {self.bag}: {size}, elements ±{1e3 * self.elements_s:.0f} ms"


@dataclass(frozen=True)
class ClockCheck:
    """The clock of a station by its passes; `print` shows it.

    `slow_s` is by how much the clock is slow (its stamps are too early), NaN without a pass;
    `sigma_s` holds the errors of elements and lags of the mount, `measured_s` is without.
    `known_sizes` name what has this size, `refused` the recordings of which nothing could be
    concluded.
    """

    slow_s: float
    sigma_s: float
    measured_s: float
    known_sizes: tuple[str, ...]
    passes: tuple[PassClock, ...]
    refused: Mapping[str, str] = field(default_factory=dict)

    @property
    def wrong(self) -> bool:
        """Whether the clock is off by more than its sigma allows."""
        return abs(self.slow_s) > SIGMAS * self.sigma_s

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield from map(str, self.passes)
        yield from (f"not used: {bag}: {why}" for bag, why in self.refused.items())
        if not self.passes:
            return
        for hop in self.passes[0].hops:
            if hop.median_ms is not None:
                times = f"{hop.median_ms:.1f} ms, 99 % within {hop.p99_ms:.1f} ms"
                yield f"{hop.cause} -> {hop.effect}: {times}"
        late = zip(self.passes[0].axes, np.transpose([one.axes_s for one in self.passes]).tolist(), strict=True)
        for axis, each in late:
            if np.any(np.isfinite(each)):
                yield f"{axis} follows its commands after {1e3 * float(np.nanmedian(each)):.1f} ms"
        targets = {one.target for one in self.passes}
        size = f"{1e3 * abs(self.slow_s):.1f} ms {'slow' if self.slow_s > 0.0 else 'fast'}"
        sure = f"±{1e3 * self.sigma_s:.1f} ms (measured ±{1e3 * self.measured_s:.1f} ms)"
        words = "the clock is" if self.wrong else "no error of the clock is seen:"
        verdict = f"{words} {size} {sure}"
        if not self.wrong and abs(self.slow_s) > SIGMAS * self.measured_s:
            verdict += "; elements and lags of the mount may be off by as much"
            verdict += ": another satellite tells" if len(targets) == 1 else ""
        yield verdict
        yield from (f"  as large as {each}" for each in self.known_sizes)


def check_clock(
    bags: Sequence[str | Path], *, station: StationDescription | str | Path | None = None, namespace: str | None = None
) -> ClockCheck:
    """Return how far the clock of a station is off, by recorded passes of one or more satellites.

    Parameters
    ----------
    bags : rosbag2 recordings; `station.yaml` and `run.yaml` of `track` lie next to each.
    station : description in place of those next to the bags.
    namespace : which antenna, where a bag holds several.

    Raises
    ------
    ValueError
        Without any bag.  One that shows nothing is in `refused` with the reason.

    Examples
    --------
    >>> print(rp.check_clock(sorted(Path("runs").glob("*/bag"))))
    """
    if not bags:
        raise ValueError("no recording is given, there must be >= 1")
    found, equations, refused = list[PassClock](), list[TimedPass](), dict[str, str]()
    for bag in bags:
        try:
            one, timed = pass_clock(bag, station=station, namespace=namespace)
        except (ValueError, OSError) as error:
            # One recording that shows nothing must not cost the others.
            refused[str(bag)] = str(error)
            continue
        found.append(one)
        equations.append(timed)
    slow_s, sigma_s, measured_s = common_s(equations, [one.target for one in found])
    return ClockCheck(
        slow_s=slow_s, sigma_s=sigma_s, measured_s=measured_s, passes=tuple(found), refused=refused,
        known_sizes=tuple(known_sizes(found, slow_s, sigma_s, measured_s)),
    )  # fmt: skip


def pass_clock(
    bag: str | Path, *, station: StationDescription | str | Path | None = None,
    namespace: str | None = None,
) -> tuple[PassClock, TimedPass]:  # fmt: skip
    """Return what one recorded pass shows, and as equations; ValueError where it shows nothing."""
    recorded = read_pass(bag, namespace)
    case = RecordedCase(Path(bag), recorded, station)
    timed = timed_pass(case)
    known = [each.uncertainty for each in case.signals.of("target") if each.uncertainty]
    times = {name: np.unique([each.t_s for each in case.signals.of(name)]) for name in SAMPLED}
    clock = PassClock(
        bag=str(bag), target=case.window.name, t_s=case.window.tca_t_s, ahead_s=timed.ahead_s,
        sigma_s=timed.sigma_s, elements_s=known[-1].along_track_s if known else 0.0,
        axes_s=_axes_s(case),
        periods_s={n: float(np.median(np.diff(t_s))) for n, t_s in times.items() if len(t_s) > 1},
        hops=tuple(latencies(recorded.recording)), axes=recorded.recording.axes,
    )  # fmt: skip
    return clock, timed


def _axes_s(case: RecordedCase) -> tuple[float, ...]:
    """Return by how much each axis is later at its commanded positions than commanded."""
    statuses = [s for s in case.signals.of("tracking_status") if s.mode in tracking_modes()]
    joints = case.signals.of("joint_states")
    commands = [each for _, each in case.signals.of("joint_trajectory")]
    if not statuses or len(commands) < 2:
        return (math.nan,) * len(AXES)
    # The first point of a trajectory is in force when the next one comes.
    columns = "t_s", "position_rad", "velocity_rad_s"
    t_s, position, rate = (np.array([getattr(each, n)[0] for each in commands]) for n in columns)
    inside = (t_s >= statuses[0].t_s) & (t_s <= statuses[-1].t_s)
    measured, found = np.array([each.position_rad for each in joints]), list[float]()
    for axis in range(len(AXES)):
        rows = inside & (np.abs(rate[:, axis]) > LEAST_RATE_RAD_S)
        there = np.interp(t_s, [each.t_s for each in joints], measured[:, axis])
        lags = (position[:, axis] - there)[rows] / rate[rows, axis]
        found.append(float(np.median(lags)) if len(lags) else math.nan)
    return tuple(found)


def common_s(passes: Sequence[TimedPass], targets: Sequence[str]) -> tuple[float, float, float]:
    """Return by what the clock is slow, one sigma, and that with perfect elements and mount, in s.

    `targets` name the satellite of each pass; NaN without a pass.
    """
    if not passes:
        return math.nan, math.nan, math.nan
    satellites, larger = sorted(set(targets)), 1.0
    if len(satellites) > 1:
        values, _ = _solve(passes, targets, 1.0)
        # In sizes of their priors.
        off = math.hypot(*(values["along_track_m", target] for target in satellites))
        larger = max(1.0, off / math.sqrt(len(satellites) - 1))
    (values, sigma_s), (_, measured_s) = (_solve(passes, targets, k) for k in (larger, 0.0))
    return CLOCK_S * values["clock_s", ""], sigma_s, measured_s


def _solve(
    passes: Sequence[TimedPass], targets: Sequence[str], larger: float
) -> tuple[dict[tuple[str, str], float], float]:
    """Return all unknowns in sizes of their priors, and one sigma of the clock in s.

    Errors along the track are `larger` than their priors; 0: nothing else looks like a clock.
    """
    owners = [{"along_track_m": target} | dict.fromkeys(OF_PASS, str(number)) for number, target in enumerate(targets)]
    both = zip(passes, owners, strict=True)
    keys = [[(name, own.get(name, "")) for name in one.names] for one, own in both]
    places = {key: place for place, key in enumerate(dict.fromkeys(chain(*keys)))}
    # All unknowns are in sizes of their priors, which are the first information.
    information, right = np.eye(len(places)), np.zeros(len(places))
    for one, own in zip(passes, keys, strict=True):
        at = [places[key] for key in own]
        alike = [larger, min(larger, 1.0), min(larger, 1.0)]
        more = [dict(zip(LIKE_A_CLOCK, alike, strict=True)).get(name, 1.0) for name in one.names]
        scaled = one.partials * (one.sizes * np.array(more)) / one.noise_rad
        information[np.ix_(at, at)] += scaled.T @ scaled
        right[at] += scaled.T @ one.off / one.noise_rad
    covariance = np.linalg.inv(information)
    values = dict(zip(places, (covariance @ right).tolist(), strict=True))
    return values, CLOCK_S * math.sqrt(np.diag(covariance)[places["clock_s", ""]])


def known_sizes(
    passes: Sequence[PassClock], slow_s: float, sigma_s: float, measured_s: float
) -> Iterator[str]:  # fmt: skip
    """Yield known sizes that an offset has, if its sigma is smaller than they are."""
    if not passes or abs(slow_s) <= SIGMAS * measured_s:
        return
    t_s = passes[0].t_s
    tai_s = float(leap_seconds().tai_minus_utc_s(t_s))
    # Who takes UT1 for UTC turns the Earth too far: it looks like a clock, of a low orbit mostly.
    dut1_s = abs(IersEarthOrientation().at(t_s).ut1_minus_utc_s)
    sizes: dict[str, float] = {
        "UTC from TT": tai_s + TT_MINUS_TAI_S, "UTC from TAI": tai_s,
        "UTC from GPS time": tai_s - TAI_MINUS_GPS_S, "a leap second": 1.0, "UT1 - UTC": dut1_s,
    }  # fmt: skip
    sizes |= {f"a sample of {name}": period_s for name, period_s in passes[0].periods_s.items()}
    for name, size_s in sizes.items():
        # A size that is itself within the error says nothing.
        if abs(abs(slow_s) - size_s) <= SIGMAS * sigma_s < size_s:
            yield f"{name}, {size_s:g} s"
