"""From snapshots of an array and the known torques to attitude and rate of the satellite.

The filter starts at the first direction, with the guess that the satellite points to the nadir and
turns with its orbit.  It starts anew after a long gap, and when direction after direction
contradicts it.  Each torque holds from its stamp on; between two blocks the torques carry the
filter on.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.attitude_report import (
    AttitudeReport,
    RateReport,
    require_arrived,
)
from rf_pointing.array_sensors.attitude.ground_stations import (
    GroundPlace,
    place_slopes,
    view_stations,
)
from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import Orbit
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams
from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import SnapshotBlock
from rf_pointing.array_sensors.doa.attitude_filter import (
    DoaAttitudeFilter,
    DoaAttitudeParams,
    SharedDirections,
    StationDirection,
)
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.estimator import (
    DirectionEstimate,
    DoaEstimator,
    DoaEstimatorParams,
)
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.doa.response_watch import ResponseWatch
from rf_pointing.core import Params, as_finite_array, parameter, require_between
from rf_pointing.core.types import Array

MERGED = "one of the maxima has no signal: two of the channel's stations have one between them"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelBlock:
    """Snapshots of one channel, and the stations that are known to send in it."""

    transmitters: tuple[str, ...]
    block: SnapshotBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldTorque:
    """Torques that the satellite knows, from `t_s` on."""

    t_s: float
    known: KnownTorque


def match_directions(
    measured: NDArray[np.float64], expected: NDArray[np.float64], largest_rad: float
) -> list[tuple[int, int]]:
    """Return pairs (measured index, expected index), each used once, no pair farther apart than
    `largest_rad`.

    `measured` (n, 3) and `expected` (m, 3) are unit vectors in one frame; unmatched ones do not
    appear.
    """
    from scipy.optimize import linear_sum_assignment

    require_between("largest_rad", largest_rad, 0.0, np.pi)
    first = as_finite_array("measured", measured, (None, 3))
    second = as_finite_array("expected", expected, (None, 3))
    # atan2 of cross and dot product: arccos alone loses angles below 1e-8 rad.
    cross = np.linalg.norm(np.cross(first[:, None, :], second[None, :, :]), axis=-1)
    angle = np.arctan2(cross, first @ second.T)
    # a pair that is out of reach costs more than leaving both alone ever could
    rows, columns = linear_sum_assignment(np.where(angle <= largest_rad, angle, 1e3))
    return [
        (int(i), int(j)) for i, j in zip(rows, columns, strict=True) if angle[i, j] <= largest_rad
    ]


@dataclass(frozen=True, kw_only=True)
class DoaChainParams(Params):
    """Rules by which inputs of the filter belong together."""

    # The torque changes with the attitude error; held longer it would carry the filter off its
    # course.
    torque_age_max_s: float = parameter(
        5.0, "oldest known torque that the filter is carried on by", low=0.1, high=1e4
    )
    gap_max_s: float = parameter(
        300.0, "longest time without blocks before the filter starts anew", low=1.0, high=1e5
    )
    # Twice the filter's own doubt: a filter that accepts everything and still fits nothing is lost.
    lost_after: int = parameter(
        16,
        "directions in a row outside the gate after which the filter starts anew",
        low=1,
        high=10**6,
    )
    # Two transmitters on one site leave the turn about their direction as open as one does.
    distinct_sigmas: float = parameter(
        5.0,
        "angle between two stations that count as two, in sigmas of a direction",
        low=1.0,
        high=100.0,
    )
    # Elements of some days are off by kilometres along the track; a satellite makes 7.5 km/s.
    time_sigma_s: float = parameter(
        0.3,
        "sigma of a constant error of the clock, or of the orbit along its track",
        low=0.0,
        high=60.0,
    )
    place_sigma_m: float = parameter(
        0.0, "sigma of a constant error of each station's place, north and east", low=0.0, high=1e6
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DoaAttitudeReport:
    """Attitude and rate after one block.

    `refused` says which of its directions were not used, and why.
    """

    attitude: AttitudeReport
    rate: RateReport
    refused: tuple[str, ...] = ()


class DoaAttitude:
    """`take_torque` and `take_block` what arrives; `coast` where no block comes."""

    def __init__(
        self,
        array: CircularArrayParams,
        estimator: DoaEstimatorParams,
        orbit: Orbit,
        stations: Sequence[GroundPlace],
        satellite: SatelliteParams,
        filtering: tuple[
            DoaAttitudeParams, StartParams, ProcessNoiseParams, GateParams, WatchParams
        ],
        params: DoaChainParams,
        *,
        response: ArrayResponse | None = None,
    ) -> None:
        self._array, self._estimator, self._orbit = array, estimator, orbit
        self._stations = {station.name: station for station in stations}
        self._satellite, self._filtering, self._params = satellite, filtering, params
        self._response = response
        # Only to check: excluded elements and gains are refused here and not with the first block.
        DoaEstimator(array, estimator, response=response)
        self._torques: deque[HeldTorque] = deque()
        self._filter: DoaAttitudeFilter | None = None
        # In the order in which they are received: the filter's constants grow with them.
        self._placed: list[str] = []
        # The array stays the same when the filter starts anew.
        self._response_watch, self._doubt = ResponseWatch(), ""

    def take_torque(self, torque: HeldTorque, now_s: float) -> None:
        """Note what the satellite knows of its torques.

        ValueError if it is not newer than the last.
        """
        require_arrived(torque.t_s, now_s)
        if self._torques and torque.t_s <= self._torques[-1].t_s:
            raise ValueError(
                f"torque of t_s={torque.t_s} must be > the last one's {self._torques[-1].t_s}"
            )
        self._torques.append(torque)

    def take_block(self, heard: ChannelBlock, now_s: float) -> DoaAttitudeReport:
        """Return attitude and rate after one block.

        Raises
        ------
        ValueError
            If a transmitter is unknown, the block is late or ahead of the clock, no torque
            is known for the time up to it, or its snapshots are refused.  The attitude is as before
            then, at most carried on in time.
        """
        t_s = heard.block.t_s
        require_arrived(t_s, now_s)
        self._require_known(heard.transmitters)
        found = self._directions(heard)
        self._watch_response(found)
        if self._merged(found):
            found = [replace(each, valid=False, reason=MERGED) for each in found]
        # After the directions, so that a block of unusable snapshots leaves the filter's time
        # alone.
        running = self._carried_on(t_s)
        refused = [
            f"{' or '.join(heard.transmitters)}: {each.reason}" for each in found if not each.valid
        ]
        usable = [each for each in found if each.valid]
        if usable:
            inside = self._observe(running, usable, heard.transmitters, t_s)
            missing = [name for name in heard.transmitters if name not in inside]
            refused += [f"{name}: no direction inside the gate" for name in missing]
        return _report(running, self._doubt, tuple(refused))

    def coast(self, t_s: float) -> DoaAttitudeReport | None:
        """Return attitude and rate carried on to `t_s` without a block, None before the first
        block.
        """
        if self._filter is None or t_s <= self._filter.state.t_s:
            return None
        return _report(self._carried_on(t_s), self._doubt)

    @property
    def time_s(self) -> float | None:
        """The filter's time, None before the first block."""
        return None if self._filter is None else self._filter.state.t_s

    def _require_known(self, transmitters: tuple[str, ...]) -> None:
        unknown = [name for name in transmitters if name not in self._stations]
        if unknown or not transmitters or len(set(transmitters)) != len(transmitters):
            known = ", ".join(self._stations)
            raise ValueError(
                f"transmitters={transmitters} must be different stations, and at least one, of {known}"
            )

    def _directions(self, heard: ChannelBlock) -> list[DirectionEstimate]:
        params = self._estimator.replace(sources=len(heard.transmitters))
        return DoaEstimator(self._array, params, response=self._response).estimate(heard.block)

    def _merged(self, found: list[DirectionEstimate]) -> bool:
        """Return whether one of several directions has no signal.

        Two stations that are too near each other have one maximum between them; noise makes
        another one elsewhere, whose response lies outside the signals.
        """
        return len(found) > 1 and any(each.misfit.squared > self._by_chance(each) for each in found)

    def _by_chance(self, found: DirectionEstimate) -> float:
        """Return the largest misfit that noise and unknown phases make."""
        return found.misfit.by_chance(
            self._estimator.phase_sigma_rad, self._filtering[-1].false_alarm
        )

    def _watch_response(self, found: list[DirectionEstimate]) -> None:
        """Take the misfits of the directions that are strong enough to be directions."""
        watch, least = self._filtering[-1], self._estimator.effective_snr_min
        for each in found:
            if each.effective_snr < least:
                continue
            # A false maximum now and then is not caused by the elements, which make one every
            # time.
            largest = self._by_chance(each) if len(found) > 1 else np.inf
            misfit = replace(each.misfit, squared=min(each.misfit.squared, largest))
            self._response_watch = self._response_watch.with_direction(watch, misfit)
            self._doubt = self._response_watch.doubt(
                watch, self._estimator.phase_sigma_rad, misfit.freedom
            )

    def _observe(
        self,
        running: DoaAttitudeFilter,
        found: list[DirectionEstimate],
        names: tuple[str, ...],
        t_s: float,
    ) -> tuple[str, ...]:
        """Give the filter the directions found; return the stations of those that it accepted."""
        reference = view_stations(
            self._orbit, [self._stations[name] for name in names], t_s
        ).reference
        of_references = self._reference_biases(names, t_s)
        sites = self._sites(running.state.stations, found, names, t_s)
        # No pairing for a sole station: it must also work while the attitude is still wrong.
        if len(names) == 1:
            (only,) = found
            direction = StationDirection(
                station=sites[0],
                measured=only.direction,
                covariance_rad2=only.covariance_rad2,
                reference=reference[0],
                bias_rad=only.bias_rad,
                reference_bias_rad=None if of_references is None else of_references[0],
            )
            return names if running.observe(direction) else ()
        biases = [each.bias_rad for each in found if each.bias_rad is not None]
        shared = SharedDirections(
            measured=np.array([each.direction for each in found]),
            covariance_rad2=np.array([each.covariance_rad2 for each in found]),
            stations=sites,
            reference=reference,
            bias_rad=np.array(biases) if biases else None,
            reference_bias_rad=of_references,
        )
        return tuple(names[index] for index in running.observe_shared(shared))

    def _reference_biases(self, names: tuple[str, ...], t_s: float) -> Array | None:
        """Return what one sigma of the clock and of every place adds to the references (n, 3, k).

        None where clock and places are exact.
        """
        params = self._params
        places = [self._stations[name] for name in names]
        columns = []
        if params.time_sigma_s > 0.0:
            before, after = (
                view_stations(self._orbit, places, t_s + shift).reference for shift in (-0.5, 0.5)
            )
            columns.append((params.time_sigma_s * (after - before))[..., None])
        if params.place_sigma_m > 0.0:
            self._placed += [name for name in names if name not in self._placed]
            moved = np.zeros((len(names), 3, 2 * len(self._placed)))
            for row, (name, by_metre) in enumerate(
                zip(names, place_slopes(self._orbit, places, t_s), strict=True)
            ):
                first = 2 * self._placed.index(name)
                moved[row, :, first : first + 2] = params.place_sigma_m * by_metre
            columns.append(moved)
        return np.concatenate(columns, axis=-1) if columns else None

    def _sites(
        self,
        received: tuple[str, ...],
        found: list[DirectionEstimate],
        names: tuple[str, ...],
        t_s: float,
    ) -> tuple[str, ...]:
        """Return each of `names`, or the received station from which it cannot be distinguished."""
        sigma = max(float(np.sqrt(0.5 * np.trace(each.covariance_rad2))) for each in found)
        known, sites = list(received), []
        for name in names:
            places = [self._stations[each] for each in [name, *known]]
            reference = view_stations(self._orbit, places, t_s).reference
            apart = np.linalg.norm(reference[1:] - reference[0], axis=-1)
            near = [
                each
                for each, angle in zip(known, apart, strict=True)
                if angle < self._params.distinct_sigmas * sigma
            ]
            sites.append(name if name in known or not near else near[0])
            known = list(dict.fromkeys([*known, sites[-1]]))
        return tuple(sites)

    def _carried_on(self, t_s: float) -> DoaAttitudeFilter:
        """Return the filter at `t_s`, started there if it has not begun, was silent for too long,
        or it is lost.
        """
        if self._filter is not None and t_s < self._filter.state.t_s:
            raise ValueError(f"t_s={t_s} is late: the filter is at {self._filter.state.t_s}")
        if (
            self._filter is None
            or t_s - self._filter.state.t_s > self._params.gap_max_s
            or self._filter.refused >= self._params.lost_after
        ):
            self._filter = self._started(t_s)
            return self._filter
        for until_s, known in self._pieces(self._filter.state.t_s, t_s):
            self._filter.predict_to(until_s, known, self._orbit.point(until_s).frame_rate_rad_s)
        return self._filter

    def _started(self, t_s: float) -> DoaAttitudeFilter:
        self._placed = []
        params, start, noise, gate, watch = self._filtering
        return DoaAttitudeFilter(
            self._satellite,
            params,
            start,
            noise,
            gate,
            watch,
            t_s=t_s,
            quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
            rate_rad_s=self._orbit.point(t_s).frame_rate_rad_s,
        )

    def _pieces(self, from_s: float, to_s: float) -> list[tuple[float, KnownTorque]]:
        """Return the torques held between the two times, each with its end; forget those before."""
        if from_s >= to_s:
            return []
        # The torque in force at the filter's time stays: it is the last one before it.
        while len(self._torques) > 1 and self._torques[1].t_s <= from_s:
            self._torques.popleft()
        held = [torque for torque in self._torques if torque.t_s < to_s]
        if not held or held[0].t_s > from_s:
            raise ValueError(f"no torque is known at {from_s} s: the attitude cannot be carried on")
        ends = [torque.t_s for torque in held[1:]] + [to_s]
        for torque, end_s in zip(held, ends, strict=True):
            if end_s - torque.t_s > self._params.torque_age_max_s:
                raise ValueError(
                    f"the torque of {torque.t_s} s is {end_s - torque.t_s:.6g} s old, "
                    f"must be <= {self._params.torque_age_max_s} s"
                )
        return [
            (end_s, torque.known)
            for torque, end_s in zip(held, ends, strict=True)
            if end_s > from_s
        ]


def _report(
    running: DoaAttitudeFilter, doubt: str, refused: tuple[str, ...] = ()
) -> DoaAttitudeReport:
    """Return attitude and rate; `doubt` says why the array itself is not as known, or nothing."""
    found = running.output()
    reason = "; ".join(each for each in (found.reason, doubt) if each)
    # The report is checked for symmetry on the wire; propagation leaves rounding in it.
    covariance = 0.5 * (found.covariance + found.covariance.T)
    attitude = AttitudeReport(
        t_s=found.t_s,
        quaternion=found.quaternion,
        covariance_rad2=covariance[:3, :3],
        valid=not reason,
        reason=reason,
    )
    rate = RateReport(
        t_s=found.t_s, rate_rad_s=found.rate_rad_s, covariance_rad2_s2=covariance[3:, 3:]
    )
    return DoaAttitudeReport(attitude=attitude, rate=rate, refused=refused)
