"""Autotrack state table: when the antenna slews, follows the ephemeris, searches, or trusts a radio sensor.

All transitions and their guards are the rows of `TRANSITIONS`, tried from the top; the first row whose guard holds is
taken, one per tick.  `step` is pure: the same state and inputs give the same state.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from rf_pointing.tracking.autotrack_state import (
    MODES,
    RF_MODES,
    AutotrackInputs,
    AutotrackParams,
    AutotrackState,
)

__all__ = ["TRANSITIONS", "Autotrack", "Transition", "transition_diagram", "transition_table"]

Guard = Callable[[AutotrackParams, AutotrackState, AutotrackInputs], bool]
ON_SKY = ("slew", "program_track", "search", *RF_MODES, "calibrate", "coast", "hand_back")


@dataclass(frozen=True, slots=True)
class Transition:
    """From any of `sources` to `target` when `guard` holds; `when` is the guard in words."""

    sources: tuple[str, ...]
    target: str
    when: str
    guard: Guard


def _elapsed(state: AutotrackState, inputs: AutotrackInputs) -> float:
    return inputs.t_s - state.entered_s


def _may_use(params: AutotrackParams, sensor: str) -> bool:
    return params.sensor in ("auto", sensor) and (sensor != "steptrack" or params.sensor == "steptrack")


def _monopulse_ready(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    doubted = params.sensor == "auto" and state.false_locks >= params.most_false_locks
    return _may_use(params, "monopulse") and not doubted and state.carrier and state.strong and inputs.monopulse_valid


def _scan_ready(sensor: str) -> Guard:
    """Return the guard of a sensor with a single beam: a carrier alone may be heard from far outside of it."""

    def ready(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
        return _may_use(params, sensor) and state.carrier and _within_beam(params, state, inputs)

    return ready


def _within_beam(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    """Whether the C/N0 is that of a target within the beam: near the link's, or as good as the last search found it."""
    best = inputs.axis_db_hz if state.peak_s is None else min(inputs.axis_db_hz, state.peak_db_hz)
    return inputs.carrier_to_noise_db_hz >= best - params.beam_drop_db


def _peaked(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    """Whether the search passed the target: a carrier was seen, and for a whole turn nothing stronger."""
    if state.peak_s is None or state.peak_db_hz < params.carrier_on_db_hz:
        return False
    return inputs.t_s - state.peak_s > params.search_turn_s


def _impatient(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> bool:
    return state.invalid_since_s is not None and inputs.t_s - state.invalid_since_s > params.patience_s


TRANSITIONS = (
    Transition((*ON_SKY, "idle"), "stow", "stow is requested", lambda _p, _s, i: i.request == "stow"),
    Transition(("stow",), "idle", "stow is no longer requested", lambda _p, _s, i: i.request != "stow"),
    Transition(ON_SKY, "idle", "tracking is no longer requested", lambda _p, _s, i: i.request == "idle"),
    Transition(ON_SKY, "idle", "the target is no longer available", lambda _p, _s, i: not i.target_available),
    Transition(
        ("idle",), "slew", "a target is requested and available",
        lambda _p, _s, i: i.request in ("track", "calibrate") and i.target_available,
    ),
    Transition(("slew",), "program_track", "the axes are on the target", lambda _p, _s, i: i.on_target),
    Transition(RF_MODES, "hand_back", "the sensor reports a fault", lambda _p, _s, i: bool(i.fault)),
    Transition((*RF_MODES, "calibrate"), "coast", "the carrier is lost", lambda _p, s, _i: not s.carrier),
    Transition(
        (*RF_MODES, "program_track", "coast"), "calibrate", "a calibration is requested and the carrier strong",
        lambda _p, s, i: i.request == "calibrate" and s.carrier and s.strong,
    ),
    Transition(
        ("calibrate",), "coast", "the calibration scan is over", lambda p, s, i: _elapsed(s, i) > p.calibrate_s,
    ),
    Transition(
        ("monopulse",), "conscan", "the carrier is too weak for monopulse, conscan may be used",
        lambda p, s, _i: not s.strong and _may_use(p, "conscan"),
    ),
    Transition(("monopulse",), "coast", "the errors stay invalid", _impatient),
    Transition(
        ("conscan", "steptrack"), "search", "the errors stay invalid, or the target outside the beam", _impatient,
    ),
    Transition(
        ("program_track", "search", "coast", "conscan"), "monopulse",
        "the carrier is strong and the monopulse error valid, auto does not doubt it", _monopulse_ready,
    ),
    Transition(
        ("program_track", "coast"), "conscan", "there is a carrier for conscan, the target within the beam",
        _scan_ready("conscan"),
    ),
    Transition(
        ("program_track", "coast"), "steptrack", "there is a carrier for steptrack, the target within the beam",
        _scan_ready("steptrack"),
    ),
    Transition(("search",), "coast", "the search has passed a carrier: back to where it was strongest", _peaked),
    Transition(
        ("coast",), "search", "the coasting time is over", lambda p, s, i: _elapsed(s, i) > p.coast_s,
    ),
    Transition(
        ("program_track",), "search", "no sensor has taken over in the settling time",
        lambda p, s, i: p.sensor != "none" and _elapsed(s, i) > p.settle_s,
    ),
    Transition(
        ("search",), "program_track", "the search found nothing", lambda p, s, i: _elapsed(s, i) > p.search_s,
    ),
    Transition(
        ("hand_back",), "program_track", "the hold time is over", lambda p, s, i: _elapsed(s, i) > p.hold_s,
    ),
)  # fmt: skip
"""The whole state machine, in order of priority."""


class Autotrack:
    """Runs the table with `params`."""

    def __init__(self, params: AutotrackParams) -> None:
        self.params = params

    def step(self, state: AutotrackState, inputs: AutotrackInputs) -> AutotrackState:
        """Return the state after one tick: gates first, then at most one transition."""
        seen = _observe(self.params, state, inputs)
        for row in TRANSITIONS:
            if seen.mode in row.sources and row.guard(self.params, seen, inputs):
                reason = inputs.fault if row.target == "hand_back" else row.when
                false_locks = seen.false_locks + (row.target == "hand_back" and seen.mode == "monopulse")
                return replace(
                    seen, mode=row.target, entered_s=inputs.t_s, reason=reason, invalid_since_s=None,
                    false_locks=0 if row.target == "calibrate" else false_locks,
                    peak_db_hz=-math.inf if row.target == "search" else seen.peak_db_hz,
                    peak_s=None if row.target == "search" else seen.peak_s,
                )  # fmt: skip
        return seen


def _observe(params: AutotrackParams, state: AutotrackState, inputs: AutotrackInputs) -> AutotrackState:
    """Update the gates: a carrier is lost at once, but must last to be there."""
    level = inputs.carrier_to_noise_db_hz
    present = level >= (params.carrier_off_db_hz if state.carrier else params.carrier_on_db_hz)
    since = (inputs.t_s if state.carrier_since_s is None else state.carrier_since_s) if present else None
    carrier = since is not None and (state.carrier or inputs.t_s - since >= params.confirm_s)
    strong = carrier and level >= (params.monopulse_off_db_hz if state.strong else params.monopulse_on_db_hz)
    within = _within_beam(params, state, inputs)
    usable = {"monopulse": inputs.monopulse_valid, "conscan": inputs.conscan_valid and within, "steptrack": within}
    valid = usable.get(state.mode, True) or inputs.arriving
    invalid = (inputs.t_s if state.invalid_since_s is None else state.invalid_since_s) if not valid else None
    seen = replace(state, carrier=carrier, strong=strong, carrier_since_s=since, invalid_since_s=invalid)
    if state.mode == "search" and level > state.peak_db_hz:
        return replace(seen, peak_db_hz=level, peak_s=inputs.t_s)
    return seen


def transition_table() -> str:
    """Return the table as Markdown, in order of priority."""
    rows = [f"| {', '.join(row.sources)} | {row.target} | {row.when} |" for row in TRANSITIONS]
    return "\n".join(["| from | to | when |", "|---|---|---|", *rows])


def transition_diagram() -> str:
    """Return the table as a Mermaid state diagram."""
    lines = [f"    {source} --> {row.target}: {row.when}" for row in TRANSITIONS for source in row.sources]
    return "\n".join(["stateDiagram-v2", *(f"    {mode}" for mode in MODES), *lines])
