"""State table of autotrack: when to slew, follow the ephemeris, search, or trust a sensor.

All transitions and their guards are the rows of `TRANSITIONS`, tried from the top; the first row
whose guard holds is taken, one per tick.  The rows name no sensor: what differs between sensors are
their traits (`tracking/sensors.py`), so that a registered tracker gets the rows of its kind.
`step` is pure: the same state and inputs give the same state.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

from rf_pointing.core import Mode, Params, Sensor, parameter, require_choice, require_finite
from rf_pointing.tracking.sensors import NO_SENSOR, SENSORS, TABLE_WORDS, SensorTraits, sensors_of

HALF_POWER_DB = 3.0


class Request(StrEnum):
    """Request of the pass to the table."""

    IDLE = "idle"
    TRACK = "track"
    CALIBRATE = "calibrate"


@dataclass(frozen=True, kw_only=True)
class AutotrackParams(Params):
    """C/N0 thresholds and times of the state table; hysteresis from `_on` to `_off`."""

    sensor: str = parameter(Sensor.AUTO, "which sensor may track (none: ephemeris only)", choices=TABLE_WORDS.keys())
    carrier_on_db_hz: float = parameter(22.0, "C/N0 from which there is a carrier", 0.0, 120.0)
    carrier_off_db_hz: float = parameter(18.0, "C/N0 below which the carrier is lost", 0.0, 120.0)
    monopulse_on_db_hz: float = parameter(36.0, "C/N0 from which monopulse is chosen", 0.0, 120.0)
    monopulse_off_db_hz: float = parameter(32.0, "C/N0 below which monopulse is left", 0.0, 120.0)
    array_on_db_hz: float = parameter(31.0, "C/N0 of the array from which it has a carrier", 0.0, 120.0)
    array_off_db_hz: float = parameter(28.0, "C/N0 of the array below which its carrier is lost", 0.0, 120.0)
    array_gain_db: float = parameter(
        0.0, "C/N0 of the array, all elements together, less that of the dish", -100.0, 40.0
    )
    beam_drop_db: float = parameter(
        10.0, "C/N0 below that on the beam's axis at which the target is outside the beam", 3.0, 60.0
    )
    confirm_s: float = parameter(0.3, "time a carrier must last before it counts", 0.0, 60.0)
    patience_s: float = parameter(1.0, "time of invalid errors after which monopulse is left", 0.0, 60.0)
    coast_s: float = parameter(5.0, "time on the trimmed ephemeris before a search", 0.0, 600.0)
    settle_s: float = parameter(3.0, "time on program track without a carrier before a search", 0.0, 600.0)
    search_turn_s: float = parameter(
        8.0, "time without a higher C/N0 after which a search has seen the target: one turn", 0.1, 600.0
    )
    search_s: float = parameter(60.0, "longest search", 0.1, 3600.0)
    calibrate_s: float = parameter(25.0, "time of a calibration scan", 1.0, 3600.0)
    hold_s: float = parameter(5.0, "time in hold-off before the sensors are trusted again", 0.0, 600.0)
    most_false_locks: int = parameter(
        2, "false locks of monopulse after which auto leaves it alone until a calibration", 1, 1000
    )

    @cached_property
    def own_level(self) -> bool:
        """Whether the sensor in use has a receiver of its own."""
        return any(traits.own_level for traits in sensors_of(self.sensor))

    @cached_property
    def carrier_db_hz(self) -> tuple[float, float]:
        """C/N0 from which the receiver of the sensor in use has a carrier, and below which none."""
        if self.own_level:
            return self.array_on_db_hz, self.array_off_db_hz
        return self.carrier_on_db_hz, self.carrier_off_db_hz

    # Without hysteresis noise on the C/N0 would change the mode every period.
    ordered = (
        *(f"{stem}_off_db_hz < {stem}_on_db_hz" for stem in ("carrier", Sensor.MONOPULSE, Sensor.ARRAY)),
        "monopulse_off_db_hz >= carrier_off_db_hz",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class AutotrackInputs:
    """Inputs of one tick.

    `request` is idle, track or calibrate. `carrier_to_noise_db_hz` is the receiver's own, -inf for
    none or a stale one. `axis_db_hz` is the C/N0 that the link would give on the beam's axis, -inf
    where it is not known. `valid` names the sensors whose newest estimate may be used; a sensor
    that scans is in it until its first estimate. `arriving`: the beam is still on its way to where
    it was sent, so that invalid errors mean nothing yet. `heard`: a sensor has reported lately, a
    carrier or none, so that a search would see the target. `fault` is why the sensor in use must
    not be trusted (sidelobe, sign flip), empty if it may be; `sidelobe`: it seems to follow one.
    """

    t_s: float
    request: str
    target_available: bool
    on_target: bool
    carrier_to_noise_db_hz: float = -math.inf
    axis_db_hz: float = -math.inf
    valid: frozenset[str] = field(
        default_factory=lambda: frozenset(name for name, traits in SENSORS.items() if traits.scans)
    )
    arriving: bool = False
    heard: bool = True
    fault: str = ""
    sidelobe: bool = False

    def __post_init__(self) -> None:
        require_choice("request", self.request, tuple(Request))
        require_finite("t_s", self.t_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class AutotrackState:
    """Mode, when and why it was entered, and what the C/N0 thresholds remember.

    `peak_db_hz` is the largest C/N0 of the last search and `peak_s` its time: where the beam was
    then is where to go when the search ends in coasting.  `peak_excess_db` is that level against
    the link's, `learned_db` the same of the last search that was completed, at most 0: what the
    link really gives.  `lock_db` is the highest level of the lock in force against the link's, if
    that lock began in the main beam; infinite if not.  `false_locks` counts those since the pass
    began or the feed was calibrated, `sidelobe` remembers that one of them was a sidelobe.
    """

    mode: str = Mode.IDLE
    entered_s: float = 0.0
    reason: str = "start"
    carrier: bool = False
    strong: bool = False
    carrier_since_s: float | None = None
    invalid_since_s: float | None = None
    peak_db_hz: float = -math.inf
    peak_s: float | None = None
    peak_excess_db: float = 0.0
    learned_db: float = 0.0
    lock_db: float = math.inf
    false_locks: int = 0
    sidelobe: bool = False

    @property
    def integrating(self) -> bool:
        """Whether a sensed error may be used: only while a sensor tracks a carrier."""
        return self.mode in SENSORS and self.carrier


Guard = Callable[[AutotrackParams, AutotrackState, AutotrackInputs], bool]


@dataclass(frozen=True, slots=True)
class Transition:
    """From any of `sources` to `target` when `guard` holds; `when` is the guard in words."""

    sources: tuple[str, ...]
    target: str
    when: str
    guard: Guard


def _elapsed(state: AutotrackState, inputs: AutotrackInputs) -> float:
    return inputs.t_s - state.entered_s


def _within_beam(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    """Whether the C/N0 is near the link's, or as good as the last search found it."""
    learned = inputs.axis_db_hz + state.learned_db
    best = learned if state.peak_s is None else min(learned, state.peak_db_hz)
    return inputs.carrier_to_noise_db_hz >= best - params.beam_drop_db


def _in_main_beam(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    """Whether the C/N0 is near what the link gives, by the last completed search if there is one.

    The peak of a search that goes on is not proof: it may be that of a sidelobe.
    """
    return inputs.carrier_to_noise_db_hz >= inputs.axis_db_hz + state.learned_db - params.beam_drop_db


def _search_helps(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    """Whether a search could find more.

    Not where no sensor reports, and not for an array, which sees most of the sky: a search would
    move the beam without showing it any more.  Nor where a carrier is too weak for monopulse
    although it has the level of a target within the half-power beam: that is the link's.  One that
    has just come back is first given its time to count.
    """
    returning = state.carrier_since_s is not None and not state.carrier
    if params.own_level or returning or not inputs.heard:
        return False
    level_db = inputs.axis_db_hz + state.learned_db - HALF_POWER_DB
    faint = state.carrier and not state.strong and math.isfinite(level_db)
    return not (faint and inputs.carrier_to_noise_db_hz >= level_db)


def _excess_db(inputs: AutotrackInputs) -> float:
    """Return the C/N0 against the link's, 0 where that is not known."""
    known = math.isfinite(inputs.axis_db_hz)
    return inputs.carrier_to_noise_db_hz - inputs.axis_db_hz if known else 0.0


def _peaked(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    """Whether the search passed the target: a carrier, and a turn without a stronger one."""
    if state.peak_s is None or state.peak_db_hz < params.carrier_db_hz[0]:
        return False
    return inputs.t_s - state.peak_s > params.search_turn_s


def _impatient(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    return state.invalid_since_s is not None and inputs.t_s - state.invalid_since_s > params.patience_s


def _take_over(traits: SensorTraits) -> Transition:
    """Return the row that leads to a sensor."""

    def allowed(params: AutotrackParams, state: AutotrackState) -> bool:
        # A sensor that was chosen is tried again however often it locked wrongly; auto has others.
        doubted = traits.watched and params.sensor == Sensor.AUTO and state.false_locks >= params.most_false_locks
        return traits in sensors_of(params.sensor) and not doubted

    def scan_ready(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
        # With a single beam the carrier alone may come from far outside of it, where no scan finds
        # the way back.
        return state.carrier and allowed(params, state) and _within_beam(params, state, inputs)

    def error_ready(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
        enough = state.carrier and (state.strong or not traits.needs_strong_carrier)
        # After a sidelobe the error alone would lead there again: first a search learns the level.
        proved = not (traits.watched and state.sidelobe) or _in_main_beam(params, state, inputs)
        return enough and proved and traits.name in inputs.valid and allowed(params, state)

    if traits.scans:
        words = f"there is a carrier for {traits.name}, the target within the beam"
        return Transition((Mode.PROGRAM_TRACK, Mode.COAST), traits.name, words, scan_ready)
    carrier = "the carrier is strong" if traits.needs_strong_carrier else "there is a carrier"
    doubt = ", auto does not doubt it, after a sidelobe in the main beam" if traits.watched else ""
    sources = (Mode.PROGRAM_TRACK, Mode.SEARCH, Mode.COAST, *((traits.weaker,) if traits.weaker else ()))
    return Transition(sources, traits.name, f"{carrier} and the {traits.name} error valid{doubt}", error_ready)


def _too_weak(traits: SensorTraits) -> Transition:
    """Return the row from a sensor to the one that needs less of a carrier."""
    return Transition(
        (traits.name,), traits.weaker, f"the carrier is too weak for {traits.name}, {traits.weaker} may be used",
        lambda p, s, _i: not s.strong and SENSORS[traits.weaker] in sensors_of(p.sensor),
    )  # fmt: skip


def transitions(sensors: Sequence[SensorTraits]) -> tuple[Transition, ...]:
    """Return the whole state machine for these sensors, in order of priority."""
    tracking = tuple(traits.name for traits in sensors)
    scanning = tuple(traits.name for traits in sensors if traits.scans)
    staring = tuple(traits.name for traits in sensors if not traits.scans)
    on_sky = (Mode.SLEW, Mode.PROGRAM_TRACK, Mode.SEARCH, *tracking, Mode.CALIBRATE, Mode.COAST, Mode.HOLD_OFF)
    # The order is the priority.  What ends a pass comes first, then what must not be followed, then
    # what is lost; a sensor takes over before a search begins.
    return (
        Transition(on_sky, Mode.IDLE, "tracking is no longer requested", lambda _p, _s, i: i.request == Request.IDLE),
        Transition(on_sky, Mode.IDLE, "the target is no longer available", lambda _p, _s, i: not i.target_available),
        Transition(
            (Mode.IDLE,), Mode.SLEW, "a target is requested and available",
            lambda _p, _s, i: i.request != Request.IDLE and i.target_available,
        ),
        Transition((Mode.SLEW,), Mode.PROGRAM_TRACK, "the axes are on the target", lambda _p, _s, i: i.on_target),
        Transition(tracking, Mode.HOLD_OFF, "the sensor reports a fault", lambda _p, _s, i: bool(i.fault)),
        Transition((*tracking, Mode.CALIBRATE), Mode.COAST, "the carrier is lost", lambda _p, s, _i: not s.carrier),
        Transition(
            (*tracking, Mode.PROGRAM_TRACK, Mode.COAST), Mode.CALIBRATE,
            "a calibration is requested and the carrier strong",
            lambda _p, s, i: i.request == Request.CALIBRATE and s.carrier and s.strong,
        ),
        # By way of a coast: the row that leads to a sensor then decides with the new calibration.
        Transition(
            (Mode.CALIBRATE,), Mode.COAST, "the calibration scan is over", lambda p, s, i: _elapsed(s, i) > p.calibrate_s,
        ),
        *(_too_weak(traits) for traits in sensors if traits.weaker),
        # A sensor that needs no scan may lose a strong carrier for a moment only; a scan that fails
        # has most likely lost the target out of its beam.
        Transition(staring, Mode.COAST, "the errors stay invalid", _impatient),
        Transition(scanning, Mode.SEARCH, "the errors stay invalid, or the target outside the beam", _impatient),
        *(_take_over(traits) for traits in sensors if not traits.scans),
        *(_take_over(traits) for traits in sensors if traits.scans),
        # A search ends where the carrier was strongest, one turn later: only then is it known.
        Transition(
            (Mode.SEARCH,), Mode.COAST, "the search has passed a carrier: back to where it was strongest", _peaked,
        ),
        Transition(
            (Mode.COAST,), Mode.SEARCH, "the coasting time is over, and a search would help",
            lambda p, s, i: _search_helps(p, s, i) and _elapsed(s, i) > p.coast_s,
        ),
        Transition(
            (Mode.PROGRAM_TRACK,), Mode.SEARCH, "no sensor has taken over in the settling time, and a search would help",
            lambda p, s, i: p.sensor != NO_SENSOR and _search_helps(p, s, i) and _elapsed(s, i) > p.settle_s,
        ),
        Transition(
            (Mode.SEARCH,), Mode.PROGRAM_TRACK, "the search found nothing", lambda p, s, i: _elapsed(s, i) > p.search_s,
        ),
        Transition(
            (Mode.HOLD_OFF,), Mode.PROGRAM_TRACK, "the hold time is over", lambda p, s, i: _elapsed(s, i) > p.hold_s,
        ),
    )  # fmt: skip


# The whole state machine of the sensors of the package, in order of priority.
TRANSITIONS = transitions(tuple(SENSORS.values()))


class Autotrack:
    """Runs the table with `params`, for the sensors that are registered when it is made."""

    def __init__(self, params: AutotrackParams) -> None:
        self.params = params
        self._rows = transitions(tuple(SENSORS.values()))

    def step(self, state: AutotrackState, inputs: AutotrackInputs) -> AutotrackState:
        """Return the state after one tick: thresholds first, then at most one transition."""
        seen = _observe(self.params, state, inputs)
        for row in self._rows:
            if seen.mode in row.sources and row.guard(self.params, seen, inputs):
                held_off = row.target == Mode.HOLD_OFF
                watched = seen.mode in SENSORS and SENSORS[seen.mode].watched
                false_locks = seen.false_locks + (held_off and watched)
                # A search that ran its turn after the strongest carrier has seen the main beam.
                completed = seen.mode == Mode.SEARCH and row.target == Mode.COAST
                return replace(
                    seen, mode=row.target, entered_s=inputs.t_s, reason=inputs.fault if held_off else row.when,
                    invalid_since_s=None, false_locks=0 if row.target == Mode.CALIBRATE else false_locks,
                    peak_db_hz=-math.inf if row.target == Mode.SEARCH else seen.peak_db_hz,
                    peak_s=None if row.target == Mode.SEARCH else seen.peak_s,
                    learned_db=min(0.0, seen.peak_excess_db) if completed else seen.learned_db,
                    lock_db=_excess_db(inputs) if _in_main_beam(self.params, seen, inputs) else math.inf,
                    sidelobe=row.target != Mode.CALIBRATE and (seen.sidelobe or (held_off and inputs.sidelobe)),
                )  # fmt: skip
        return seen


def _observe(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> AutotrackState:
    """Update the thresholds: a carrier is lost at once, but must last to be there."""
    level = inputs.carrier_to_noise_db_hz
    # A carrier is gone with the first weak sample, else noise would be integrated meanwhile; to be
    # there it must last, for noise alone exceeds any threshold now and then.
    on, off = params.carrier_db_hz
    present = level >= (off if state.carrier else on)
    since = (inputs.t_s if state.carrier_since_s is None else state.carrier_since_s) if present else None
    carrier = since is not None and (state.carrier or inputs.t_s - since >= params.confirm_s)
    # The level of an array says nothing about the feed of the dish.
    enough = level >= (params.monopulse_off_db_hz if state.strong else params.monopulse_on_db_hz)
    strong = carrier and enough and not params.own_level
    valid = True
    sensor = SENSORS.get(state.mode)
    if sensor is not None and not inputs.arriving:
        valid = sensor.once_a_round or sensor.name in inputs.valid
        valid = valid and (not sensor.scans or _within_beam(params, state, inputs))
    invalid = (inputs.t_s if state.invalid_since_s is None else state.invalid_since_s) if not valid else None
    seen = replace(state, carrier=carrier, strong=strong, carrier_since_s=since, invalid_since_s=invalid)
    # Kept after the search: it is the best proof of the level that the link really gives.
    # Against the link's: that of a satellite that comes nearer rises without an end.
    known = state.peak_s is not None and math.isfinite(inputs.axis_db_hz)
    higher = _excess_db(inputs) > state.peak_excess_db if known else level > state.peak_db_hz
    if state.mode == Mode.SEARCH and higher:
        return replace(seen, peak_db_hz=level, peak_s=inputs.t_s, peak_excess_db=_excess_db(inputs))
    return replace(seen, lock_db=max(seen.lock_db, _excess_db(inputs)))
