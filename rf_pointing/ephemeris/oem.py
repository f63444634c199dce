"""Orbit ephemeris messages (CCSDS 502.0-B, KVN and XML): read, written, followed as a target.

Epochs are turned into TAI seconds, in which time runs evenly over a leap second.  A message must be
complete and in km: one that ends before its STOP_TIME, or whose states no body near the Earth can
have, is an error.  Interpolation is as declared and never outside the usable span.  Lagrange of
degree N passes a polynomial through N + 1 positions, Hermite of degree N through (N + 1) / 2
positions and velocities.  The polynomial of a window is solved for once, in a time scaled to
[-1, 1], and differentiated for velocity, acceleration and jerk.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import erfa
import numpy as np

from rf_pointing.core import EARTH_MU_M3_S2, EARTH_RADIUS_M, Array, Pair, name_of, require_choice
from rf_pointing.core.dates import DAY_S, from_utc_text, to_utc_text, utc_text
from rf_pointing.core.kvn import key_and_value
from rf_pointing.ephemeris import time_scales
from rf_pointing.ephemeris.celestial_frame import EARTH_RATE_RAD_S, earth_fixed_from_gcrs
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.sgp4_orbit import GMST_RATE_RAD_S, earth_fixed_from_teme
from rf_pointing.ephemeris.state_vector import StateVector, Vector, rotated, seen_from_rotating_axes
from rf_pointing.ephemeris.time_scales import leap_seconds, tai_from_utc_calendar, utc_from_tai_s
from rf_pointing.ephemeris.track import TargetSource

_LEAST_DEGREE = {"HERMITE": 3, "LAGRANGE": 1, "LINEAR": 1}
METHODS = tuple(_LEAST_DEGREE)
_SCALES = ("UTC", "TAI", "TT", "GPS", "TDB")
_REQUIRED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")
_CELESTIAL = ("GCRF", "ICRF", "EME2000", "J2000")
_TEME = "TEME"
# Axes of covariances that turn with the orbit: radial, transverse, normal, or along the velocity.
_RADIAL, _TANGENTIAL = ("RTN", "RSW", "RIC", "UVW", "QSW"), ("TNW",)
_J2000 = erfa.DJ00, 0.0
# The controller's differences reach a little beyond the time that is wanted.
EDGE_S = 1.0
_MAX_DEGREE = 15
# Twice as far as the Earth holds a satellite; states in metres taken for km would lie beyond it.
_FARTHEST_M = 3e9
# No satellite moves at so many times the speed of escape; turning axes may add to it.
_FASTEST_ESCAPES = 3.0
# Whoever knows a position to a million kilometres does not know it.
_LARGEST_KM2 = 1e12


@dataclass(frozen=True, eq=False)
class StateCovariance:
    """Covariance (6, 6) of position and velocity [m, m/s] at `tai_s`, in axes of `frame`."""

    tai_s: float
    frame: str
    matrix: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class OemSegment:
    """One segment: states at `tai_s` (n,) [TAI s since 1970], positions and velocities (n, 3).

    Interpolation uses every state, but only for times in
    [`usable_from_s`, `usable_to_s`] (TAI).  `method` is empty where the message declares none.
    """

    name: str
    object_id: str
    frame: str
    tai_s: Array
    position_m: Array
    velocity_m_s: Array
    usable_from_s: float
    usable_to_s: float
    method: str
    degree: int
    covariances: tuple[StateCovariance, ...] = ()


class State(NamedTuple):
    """One line of data; position and velocity in km and km/s."""

    number: int
    epoch: str
    values: Sequence[float]


@dataclass
class Draft:
    """One segment as a file states it: `meta` by the keywords of an OEM, and the first fault."""

    meta: dict[str, str] = field(default_factory=dict)
    states: list[State] = field(default_factory=list)
    covariances: list[tuple[int, dict[str, str], list[float]]] = field(default_factory=list)
    """Line, EPOCH and COV_REF_FRAME, and the 21 numbers of the lower triangle in km and s."""
    wrong: ValueError | None = None

    def segment(self) -> "OemSegment | ValueError":
        """Return the checked segment, or why it is refused."""
        try:
            return self.wrong or _segment(self)
        except ValueError as error:
            return error


def read_oem(text: str, _name: str = "") -> Iterator[OemSegment | ValueError]:
    """Yield the segments of a KVN message in file order; a ValueError names a malformed line."""
    draft, place = None, "header"
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        try:
            if line == "META_START":
                if draft is not None:
                    yield draft.segment()
                draft, place = Draft(), "meta"
            elif line in ("META_STOP", "COVARIANCE_STOP"):
                place = "data"
            elif line == "COVARIANCE_START":
                place = "covariance"
            elif not line or line.startswith("COMMENT"):
                continue
            elif draft is None:
                key_and_value(line, number)
            elif place == "data":
                draft.states.append(_state(line, number))
            elif place == "covariance":
                _take_covariance(draft, line, number)
            else:
                key, value = key_and_value(line, number) or ("", "")
                if key in draft.meta:
                    raise ValueError(f"line {number}: {key} is given twice")
                draft.meta[key] = value
        except ValueError as error:
            if draft is None:
                raise
            draft.wrong = draft.wrong or error
    if draft is None:
        raise ValueError("OEM has no META_START")
    yield draft.segment()


def _take_covariance(draft: Draft, line: str, number: int) -> None:
    if line.startswith("EPOCH") and "=" in line:
        draft.covariances.append((number, {}, []))
    if not draft.covariances:
        raise ValueError(f"line {number}: a covariance must begin with its EPOCH")
    if "=" in line:
        draft.covariances[-1][1].update([key_and_value(line, number) or ("", "")])
    else:
        draft.covariances[-1][2].extend(numbers_of(line.split(), number, line))


_STATE_LEAVES = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_COVARIANCE_LEAVES = [f"C{row}_{column}" for k, row in enumerate(_STATE_LEAVES) for column in _STATE_LEAVES[: k + 1]]


def read_oem_xml(text: str, _name: str = "") -> Iterator[OemSegment | ValueError]:
    """Yield the segments of an <oem>, in XML, in file order."""
    from rf_pointing.core.xml_text import local_name
    from rf_pointing.ephemeris.element_messages import xml_segments

    for line, segment in xml_segments(text, "OEM"):
        if isinstance(segment, ValueError):
            yield segment
            continue
        draft = Draft()
        try:
            for part in segment.iter():
                leaves = {local_name(leaf.tag): (leaf.text or "").strip() for leaf in part}
                kind = local_name(part.tag)
                if kind == "metadata":
                    draft.meta = leaves
                elif kind == "stateVector":
                    row = [leaves.get(name, "") for name in _STATE_LEAVES]
                    draft.states.append(State(line, leaves.get("EPOCH", ""), numbers_of(row, line, str(row))))
                elif kind == "covarianceMatrix":
                    row = [leaves.get(name, "") for name in _COVARIANCE_LEAVES]
                    draft.covariances.append((line, leaves, numbers_of(row, line, "its covariance")))
        except ValueError as error:
            draft.wrong = error
        yield draft.segment()


WRITTEN_STEP_S = 60.0
"""Between the states of a written message; Hermite of degree 7 follows low orbits to mm."""


def oem_text(
    target: TargetSource, object_id: str, start_t_s: float, end_t_s: float, *, originator: str,
    created_t_s: float, covariances: Sequence[StateCovariance] = (),
) -> str:  # fmt: skip
    """Return the message of a target's motion between two UTC times; `read_oem` is the inverse.

    The states are of the Earth-fixed frame ITRF, a minute apart; `covariances` keep their frames.
    ValueError for a body of the sky, and for times that the target does not know.
    """
    if target.at_infinity or target.name.casefold() in ("sun", "moon"):
        raise ValueError(f"{target.name} is not a satellite: an OEM holds the states of an orbit")
    count = max(math.ceil((end_t_s - start_t_s) / WRITTEN_STEP_S), 1) + 1
    times = np.round(np.linspace(start_t_s, end_t_s, count), 6)
    inertial = target.motion_at(times)
    turning = seen_from_rotating_axes(inertial, target.rotation_rate_rad_s)
    columns = np.array([*turning.position, *turning.velocity]).T / 1e3
    epochs = [to_utc_text(float(t_s)) for t_s in times]
    created = f"CREATION_DATE = {to_utc_text(created_t_s)}"
    lines = ["CCSDS_OEM_VERS = 2.0", created, f"ORIGINATOR = {originator}", "", "META_START"]
    meta = {
        "OBJECT_NAME": target.name, "OBJECT_ID": object_id, "CENTER_NAME": "EARTH", "REF_FRAME": "ITRF-2020",
        "TIME_SYSTEM": "UTC", "START_TIME": epochs[0], "STOP_TIME": epochs[-1], "INTERPOLATION": "HERMITE",
        "INTERPOLATION_DEGREE": "7",
    }  # fmt: skip
    lines += [*(f"{key} = {value}" for key, value in meta.items()), "META_STOP", ""]
    for epoch, row in zip(epochs, columns, strict=True):
        lines.append(" ".join([epoch, *(f"{value:.9f}" for value in row)]))
    return "\n".join([*lines, *_covariance_lines(covariances)]) + "\n"


def _covariance_lines(covariances: Sequence[StateCovariance]) -> list[str]:
    lines: list[str] = []
    for one in covariances:
        epoch = to_utc_text(utc_from_tai_s(one.tai_s))
        lines += [f"EPOCH = {epoch}", f"COV_REF_FRAME = {one.frame}"]
        # Metres to km: the lower triangle, a line for each row.
        for k, row in enumerate(one.matrix * 1e-6):
            lines.append(" ".join(f"{value:.9e}" for value in row[: k + 1]))
    return ["", "COVARIANCE_START", *lines, "COVARIANCE_STOP"] if lines else []


def _state(line: str, number: int) -> State:
    fields = line.split()
    if len(fields) not in (7, 10):
        raise ValueError(f"line {number}: a state must have an epoch and 6 or 9 numbers, has {len(fields)} fields")
    return State(number, fields[0], numbers_of(fields[1:], number, line)[:6])


def numbers_of(fields: Sequence[str], number: int, line: str) -> list[float]:
    """Return finite numbers; ValueError names the line."""
    try:
        values = [float(text) for text in fields]
    except ValueError:
        raise ValueError(f"line {number}: {line[:60]!r} holds something that is not a number") from None
    if not np.all(np.isfinite(values)):
        raise ValueError(f"line {number}: {line[:60]!r} must hold finite numbers")
    return values


def _segment(draft: Draft) -> OemSegment:
    meta, states = draft.meta, draft.states
    missing = [key for key in _REQUIRED if not meta.get(key)]
    if missing:
        raise ValueError(f"OEM segment of {meta.get('OBJECT_NAME', 'an unnamed object')} lacks {', '.join(missing)}")
    require_choice("TIME_SYSTEM", meta["TIME_SYSTEM"], _SCALES)
    if meta["CENTER_NAME"].upper() != "EARTH":
        raise ValueError(f"CENTER_NAME={meta['CENTER_NAME']!r} must be EARTH")
    method, degree = _interpolation(meta)
    if len(states) < 2:
        raise ValueError(f"OEM segment of {meta['OBJECT_NAME']} has {len(states)} states, must have 2 or more")
    scale = meta["TIME_SYSTEM"]
    tai_s = np.array([_tai_of(f"line {state.number}", state.epoch, scale) for state in states])
    for state, step_s in zip(states[1:], np.diff(tai_s), strict=True):
        if step_s <= 0.0:
            raise ValueError(f"line {state.number}: {state.epoch} must be later than the state before")
    # km and km/s to metres.
    values = np.array([state.values for state in states]) * 1e3
    alone = values.shape[1] == 3
    if alone:
        # Positions alone: the slope between them serves the check, and Lagrange needs none.
        values = np.hstack([values, np.gradient(values, tai_s, axis=0)])
    _require_near_the_earth(states, values)
    position, velocity, frame = values[:, :3], values[:, 3:], meta["REF_FRAME"].upper()
    # Imported here: stations on mean elements read no states.
    from rf_pointing.ephemeris.damaged_states import OFF_M, damaged_state

    row, off_m = damaged_state(tai_s, position, None if alone else velocity, turning=frame.startswith("ITRF"))
    if row >= 0:
        raise ValueError(
            f"line {states[row].number}: the state at {states[row].epoch} lies {1e-3 * off_m:.3g} km off the "
            f"orbit through its neighbours, must be <= {1e-3 * OFF_M:g} km"
        )
    usable_from_s, usable_to_s = _usable(meta, tai_s)
    return OemSegment(
        name=name_of(meta["OBJECT_NAME"]), object_id=meta["OBJECT_ID"], frame=frame, tai_s=tai_s,
        position_m=position, velocity_m_s=velocity, usable_from_s=usable_from_s,
        usable_to_s=usable_to_s, method=method, degree=degree,
        covariances=tuple(_covariance(*one, meta) for one in draft.covariances),
    )  # fmt: skip


def _covariance(number: int, keys: dict[str, str], lower: list[float], meta: dict[str, str]) -> StateCovariance:
    if len(lower) != 21:
        raise ValueError(f"line {number}: a covariance has {len(lower)} numbers, must have 21")
    if max(map(abs, lower)) > _LARGEST_KM2:
        raise ValueError(f"line {number}: a covariance of {max(map(abs, lower)):g} must be <= {_LARGEST_KM2:g} km2")
    matrix = np.zeros((6, 6))
    matrix[np.tril_indices(6)] = lower
    matrix += np.tril(matrix, -1).T
    if np.min(np.diag(matrix)) < 0.0:
        raise ValueError(f"line {number}: a covariance has the variance {np.min(np.diag(matrix)):g}, must be >= 0")
    # A file has few digits, so a correlation of one may exceed it by its rounding.
    least = float(np.linalg.eigvalsh(matrix[:3, :3]).min())
    if least < -1e-5 * float(matrix[:3, :3].max(initial=0.0)):
        raise ValueError(f"line {number}: a covariance has the eigenvalue {least:g} km2, must be >= 0")
    frame = keys.get("COV_REF_FRAME") or meta["REF_FRAME"]
    tai_s = _tai_of(f"line {number}", keys.get("EPOCH", ""), meta["TIME_SYSTEM"])
    return StateCovariance(tai_s, frame.upper(), matrix * 1e6)


def _tai_of(place: str, text: str, scale: str) -> float:
    try:
        return tai_from_text(text, scale)
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None


def _require_near_the_earth(states: list[State], values: Array) -> None:
    """Refuse states that no satellite has: they are not in km and km/s."""
    distance, speed = (np.linalg.norm(part, axis=1) for part in (values[:, :3], values[:, 3:]))
    # States in ITRF carry the turning of the axes in their velocity.
    turning = EARTH_RATE_RAD_S * distance
    fastest = _FASTEST_ESCAPES * np.sqrt(2.0 * EARTH_MU_M3_S2 / np.maximum(distance, EARTH_RADIUS_M)) + turning
    for state, far, fast, most in zip(states, distance, speed, fastest, strict=True):
        if not 0.9 * EARTH_RADIUS_M <= far <= _FARTHEST_M:
            raise ValueError(
                f"line {state.number}: distance {1e-3 * far:.6g} km from the centre of the Earth must be in "
                f"[{0.9e-3 * EARTH_RADIUS_M:.0f}, {1e-3 * _FARTHEST_M:.0f}] km"
            )
        if fast > most:
            bound = f"must be <= {1e-3 * most:.6g} km/s there"
            raise ValueError(f"line {state.number}: speed {1e-3 * fast:.6g} km/s {bound}")


def _usable(meta: dict[str, str], tai_s: Array) -> Pair:
    """Return the usable span in TAI seconds; its ends may lie a step beyond the states."""
    keys = [f"USEABLE_{key}" if meta.get(f"USEABLE_{key}") else key for key in ("START_TIME", "STOP_TIME")]
    first, last = (_tai_of(key, meta[key], meta["TIME_SYSTEM"]) for key in keys)
    if not first < last:
        raise ValueError(f"{keys[0]}={meta[keys[0]]} must be before {keys[1]}={meta[keys[1]]}")
    # The ends may lie up to a step beyond the states; further means lines are missing.
    step_s = float(np.max(np.diff(tai_s)))
    for key, short_s in zip(keys, (tai_s[0] - first, last - tai_s[-1]), strict=True):
        if short_s > step_s:
            beyond = f"{short_s:.0f} s beyond the states, must be <= {step_s:.0f} s (one step)"
            of = f"{key}={meta[key]} of {meta['OBJECT_NAME']}"
            raise ValueError(f"{of} lies {beyond}: is the message whole?")
    return max(first, float(tai_s[0])), min(last, float(tai_s[-1]))


def _interpolation(meta: dict[str, str]) -> tuple[str, int]:
    method = meta.get("INTERPOLATION", "").upper()
    if not method:
        return "", 0
    require_choice("INTERPOLATION", method, METHODS)
    text = meta.get("INTERPOLATION_DEGREE", "1" if method == "LINEAR" else "")
    least = _LEAST_DEGREE[method]
    if not re.fullmatch(r"[0-9]+", text) or not least <= int(text) <= _MAX_DEGREE:
        bound = f"a whole number in [{least}, {_MAX_DEGREE}] for {method}"
        raise ValueError(f"INTERPOLATION_DEGREE={text!r} must be {bound}")
    return method, int(text)


def tai_from_text(text: str, scale: str) -> float:
    """Return TAI seconds since 1970-01-01T00:00:00 TAI of a date written in `scale`."""
    if scale == "UTC":
        return tai_from_utc_calendar(text)
    seconds = from_utc_text(text)
    if scale == "TDB":
        whole, rest = divmod(seconds, DAY_S)
        parts = time_scales.POSIX_EPOCH_JD + whole, rest / DAY_S
        seconds -= float(erfa.dtdb(*parts, 0.0, 0.0, 0.0, 0.0))
    tt_s, gps_s = -time_scales.TT_MINUS_TAI_S, time_scales.TAI_MINUS_GPS_S
    return seconds + {"TAI": 0.0, "GPS": gps_s, "TT": tt_s, "TDB": tt_s}[scale]


class OemTarget:
    """StateVector from the segments of one object.

    `interpolation` (method, degree) serves segments that declare none; without it such a message is
    refused.
    """

    at_infinity = False

    def __init__(
        self, segments: Sequence[OemSegment], orientation: IersEarthOrientation | None = None, *,
        interpolation: tuple[str, int] | None = None,
    ) -> None:  # fmt: skip
        if not segments or len({segment.object_id for segment in segments}) != 1:
            raise ValueError("segments must be one or more of one object")
        frames = {segment.frame for segment in segments}
        frame = frames.pop()
        if frames or not (frame in _CELESTIAL or frame == _TEME or frame.startswith("ITRF")):
            known = f"{', '.join(_CELESTIAL)}, TEME, ITRF-yyyy, in all segments"
            raise ValueError(f"REF_FRAME={frame!r} must be one of {known}")
        self.name = segments[0].name
        self.rotation_rate_rad_s = GMST_RATE_RAD_S if frame == _TEME else EARTH_RATE_RAD_S
        self._frame = frame
        self._segments = tuple(segments)
        self._windows = tuple(_window_size(segment, interpolation) for segment in segments)
        self._earth = orientation or IersEarthOrientation()
        self.orientation = None if frame.startswith("ITRF") else self._earth
        # One window serves many control periods; a solve costs far more than an evaluation.
        self._polynomial = lru_cache(maxsize=4096)(self._solved_polynomial)

    @property
    def spans_t_s(self) -> tuple[Pair, ...]:
        """First and last UTC times of what is usable without a gap, a second of light inside."""
        joined: list[list[float]] = []
        for first, last in sorted((segment.usable_from_s, segment.usable_to_s) for segment in self._segments):
            if joined and first <= joined[-1][1]:
                joined[-1][1] = max(joined[-1][1], last)
            else:
                joined.append([first, last])
        inside = [(first + EDGE_S, last - EDGE_S) for first, last in joined]
        return tuple((utc_from_tai_s(first), utc_from_tai_s(last)) for first, last in inside if first < last)

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the inertial motion [m] in Earth-fixed axes; ValueError outside its spans."""
        tai_s = t_s + leap_seconds().tai_minus_utc_s(t_s) + ahead_s
        if isinstance(t_s, float):
            derivatives = self._derivatives(tai_s)
        else:
            each = [self._derivatives(float(time)) for time in tai_s]
            derivatives = np.moveaxis(np.array(each).reshape(-1, 4, 3), 0, -1)
        position, velocity, acceleration, jerk = ((v[0], v[1], v[2]) for v in derivatives)
        return self._earth_fixed(StateVector(position, velocity, acceleration, jerk), t_s)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the position at `t_s` less certain than the message."""
        given = {each.frame for one in self._segments for each in one.covariances}
        unused = [f"covariance in {each} is not used" for each in sorted(given) if not _known_axes(each)]
        return (*self._earth.warnings(t_s), *unused)

    @cached_property
    def covariances(self) -> list[tuple[float, str, Array]]:
        """Known covariances (3, 3) of the position [m^2]: UTC, frame, matrix; in order of time."""
        every = sorted((each for one in self._segments for each in one.covariances), key=lambda each: each.tai_s)
        spans = [(one.usable_from_s, one.usable_to_s) for one in self._segments]
        return [
            (utc_from_tai_s(each.tai_s), each.frame, each.matrix[:3, :3]) for each in every
            if _known_axes(each.frame) and any(first <= each.tai_s <= last for first, last in spans)
        ]  # fmt: skip

    def axes_of(self, frame: str, t_s: float) -> Array:
        """Return the axes (3, 3) of a covariance's frame at UTC `t_s`, in rows, Earth-fixed."""
        if frame in _RADIAL or frame in _TANGENTIAL:
            motion = self.motion_at(t_s)
            position, velocity = np.array(motion.position), np.array(motion.velocity)
            normal = np.cross(position, velocity)
            normal /= np.linalg.norm(normal)
            first = velocity if frame in _TANGENTIAL else position
            first = first / np.linalg.norm(first)
            return np.array([first, np.cross(normal, first), normal])
        still = (0.0, 0.0, 0.0)
        units = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        each = (self._earth_fixed(StateVector(unit, still, still, still), t_s, frame) for unit in units)
        return np.array([axis.position for axis in each], dtype=np.float64)

    def _earth_fixed(self, motion: StateVector, t_s: Any, frame: str = "") -> StateVector:
        frame = frame or self._frame
        if frame == _TEME:
            return earth_fixed_from_teme(motion, t_s, self._earth)
        if frame.startswith("ITRF"):
            # Its derivatives are those of the turning frame; turning back makes them inertial.
            return seen_from_rotating_axes(motion, -EARTH_RATE_RAD_S)
        if frame in ("EME2000", "J2000"):
            motion = rotated(motion, _gcrs_from_j2000())
        return earth_fixed_from_gcrs(motion, t_s, self._earth)

    def _derivatives(self, tai_s: float) -> Any:
        """Return position to jerk (4, 3) at a TAI time, from the last segment usable there."""
        # Where segments overlap the later one counts.
        for index in reversed(range(len(self._segments))):
            segment = self._segments[index]
            # Ends included: segments that meet share the instant at which they do.
            if segment.usable_from_s <= tai_s <= segment.usable_to_s:
                break
        else:
            spans = "; ".join(f"{_utc(s.usable_from_s)} to {_utc(s.usable_to_s)}" for s in self._segments)
            raise ValueError(f"{_utc(tai_s)} is outside the usable span of {self.name}: {spans}")
        _, size, _ = self._windows[index]
        after = int(np.searchsorted(segment.tai_s, tai_s, side="right"))
        # The window is centred where the data allow; at the ends it stays inside them.
        start = min(max(after - size // 2 - size % 2, 0), len(segment.tai_s) - size)
        middle, half, derivatives = self._polynomial(index, start)
        powers = ((tai_s - middle) / half) ** np.arange(derivatives.shape[1])
        return np.einsum("p,kpc->kc", powers, derivatives)

    def _solved_polynomial(self, index: int, start: int) -> tuple[float, float, Array]:
        """Return middle and half width of a window, and the coefficients (4, degree + 1, 3)."""
        segment, (hermite, size, degree) = self._segments[index], self._windows[index]
        times = segment.tai_s[start : start + size]
        middle = np.mean(times)
        # Scaled to [-1, 1]: powers of seconds would make the matrix singular in floating point.
        half = np.max(np.abs(times - middle))
        x = (times - middle) / half
        rows, values = np.vander(x, degree + 1, increasing=True), segment.position_m[start : start + size]
        if hermite:
            slopes = np.zeros_like(rows)
            slopes[:, 1:] = rows[:, :-1] * np.arange(1, degree + 1)
            rows = np.concatenate([rows, slopes])
            values = np.concatenate([values, segment.velocity_m_s[start : start + size] * half])
        coefficients = [np.linalg.solve(rows, values)]
        for _ in range(3):
            lower = np.zeros_like(coefficients[-1])
            lower[:-1] = coefficients[-1][1:] * np.arange(1, degree + 1)[:, None] / half
            coefficients.append(lower)
        return float(middle), float(half), np.array(coefficients)


def _window_size(segment: OemSegment, fallback: tuple[str, int] | None) -> tuple[bool, int, int]:
    """Return whether velocities are used, how many states, and the degree."""
    method, degree = (segment.method, segment.degree) if segment.method else (fallback or ("", 0))
    if not method:
        example = "--interpolation HERMITE 7 (of a node: source.interpolation)"
        wanted = f"give interpolation and its degree, as in {example}"
        raise ValueError(f"OEM of {segment.name} declares no INTERPOLATION: {wanted}")
    require_choice("interpolation", method, METHODS)
    hermite = method == "HERMITE"
    # Positions and velocities come in pairs: an even degree has no whole number of states.
    if hermite and (degree % 2 == 0 or degree < 3):
        why = "it takes positions and velocities"
        raise ValueError(f"INTERPOLATION_DEGREE={degree} must be odd, 3 or more, for HERMITE: {why}")
    degree = 1 if method == "LINEAR" else degree
    size = (degree + 1) // 2 if hermite else degree + 1
    if (count := len(segment.tai_s)) < size:
        few = f"{count} states, must have {size} for {method}"
        raise ValueError(f"OEM segment of {segment.name} has {few}")
    return hermite, size, degree


def _known_axes(frame: str) -> bool:
    return frame in (*_RADIAL, *_TANGENTIAL, *_CELESTIAL, _TEME) or frame.startswith("ITRF")


@lru_cache(maxsize=1)
def _gcrs_from_j2000() -> tuple[Vector, Vector, Vector]:
    """Rows of the frame bias, transposed: 23 mas between the mean equator of J2000 and the GCRS."""
    first, second, third = map(tuple, erfa.bp06(*_J2000)[0].T.tolist())
    return first, second, third


def _utc(tai_s: float) -> str:
    return utc_text(utc_from_tai_s(tai_s))
