"""Metrics of passes over the same time, what a replay changes of them, and a picture.

Each metric is made of sums over blocks of the pass, so that the uncertainty of a difference is that
of drawing the blocks anew, those of both passes together (bootstrap).  Blocks are longer than what
a loop remembers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core import MDEG, Array, Pair, random_stream
from rf_pointing.core.pass_outcome import is_held, pointing_loss_db, received_power
from rf_pointing.report.picture_style import figure, legend_above
from rf_pointing.servo import PlantParams
from rf_pointing.simulation.open_loop import Signals

BLOCK_S, FEWEST_BLOCKS, DRAWS = 10.0, 8, 400
TRUE, SENSED = "sim/pointing_error", "pointing_error"
# Share of the friction by which the motors must push the other way to count as a reversal.
HYSTERESIS = 0.5
UNITS = {
    "rms cross-elevation": "mdeg", "rms elevation": "mdeg", "worst error": "mdeg", "held": "s",
    "lost": "s", "mean loss": "dB", "travel": "deg", "torque reversals": "", "starts": "",
    "reversals": "",
}  # fmt: skip


@dataclass(frozen=True)
class Flown:
    """Errors (n, 2) [rad] at `t_s` (n,), and times and sizes (m,) of `events` by metric."""

    t_s: Array
    error_rad: Array
    beamwidth_rad: float
    events: Mapping[str, tuple[Array, Array]]

    @classmethod
    def of(cls, signals: Signals, topic: str, plant: PlantParams | None) -> "Flown":
        """Return errors and wear by signals; `plant` is None of drives that take positions."""
        statuses = signals.of("tracking_status")
        times = np.array([each.t_s for each in statuses])
        modes = np.array([each.mode if each.target else "" for each in statuses])
        rows = [each for each in signals.of(topic) if each.valid]
        if topic == SENSED:
            # Trackers side by side: that of the mode, and no scan about nothing.
            held = np.searchsorted(times, [each.t_s for each in rows], side="right") - 1
            pairs = zip(rows, held, strict=True)
            rows = [each for each, k in pairs if k >= 0 and modes[k] == each.sensor]
        return cls(
            t_s=np.array([each.t_s for each in rows]),
            error_rad=np.reshape([(e.cross_elevation_rad, e.elevation_rad) for e in rows], (-1, 2)),
            beamwidth_rad=max((each.half_power_beamwidth_rad for each in statuses), default=np.nan),
            events=_wear(signals, plant),
        )


def _wear(signals: Signals, plant: PlantParams | None) -> dict[str, tuple[Array, Array]]:
    joints, drive = signals.of("joint_states"), signals.of("antenna_status")
    found: dict[str, tuple[Array, Array]] = {}
    if len(joints) > 1:
        angles = np.degrees([each.position_rad for each in joints])
        moved = np.abs(np.diff(angles, axis=0)).sum(axis=1)
        found["travel"] = np.array([each.t_s for each in joints[1:]]), moved
    for name in ("starts", "reversals") if plant is None else ():
        counts = np.array([np.sum(getattr(each, name)) for each in drive], dtype=np.float64)
        # The counts begin anew with each tracking.
        if len(counts) > 1:
            times = np.array([each.t_s for each in drive[1:]])
            found[name] = times, np.maximum(np.diff(counts), 0.0)
    if plant is not None and drive and joints:
        known = {each.t_s: each.velocity_rad_s for each in joints}
        rows = [each for each in drive if each.t_s in known]
        stamps = np.array([each.t_s for each in rows])
        gaps = np.reshape([each.rate_command_rad_s - known[each.t_s] for each in rows], (-1, 2))
        turns = [np.zeros(0)]
        for index, axis in enumerate((plant.azimuth, plant.elevation)):
            # The motors push by J w_d (u - v); steady motion takes the friction of them.
            push = axis.inertia_kg_m2 * axis.drive_bandwidth_rad_s * gaps[:, index]
            # Below it the push is noise about zero, each crossing of which wears nothing.
            pushing = np.abs(push) > HYSTERESIS * axis.coulomb_friction_n_m
            at, sign = stamps[pushing], np.sign(push[pushing])
            turns.append(at[1:][sign[1:] != sign[:-1]])
        turned = np.sort(np.concatenate(turns))
        found["torque reversals"] = turned, np.ones(len(turned))
    return found


@dataclass(frozen=True)
class MetricChange:
    """One metric: recorded, simulated as recorded, and with the changes; None where not known.

    `sigma` is that of `difference`; `source` says whose errors count, "true" or "sensed".
    """

    name: str
    unit: str
    source: str
    recorded: float | None
    before: float
    after: float
    sigma: float

    @property
    def difference(self) -> float:
        """After minus before."""
        return self.after - self.before

    def __str__(self) -> str:
        recorded = f"{self.recorded:11.3f}" if self.recorded is not None else f"{'-':>11}"
        numbers = "".join(f"{each:11.3f}" for each in (self.before, self.after))
        numbers += f"{self.difference:+11.3f} ±{self.sigma:.3f}"
        return f"{self.name:<20}{self.unit:<6}{recorded}{numbers}  {self.source}"


def settled_s(flown: Flown, start_s: float) -> float:
    """Return when ten errors in a row are first below 0.1 beamwidths, else 0.5, else `start_s`."""
    radial, count = np.hypot(*flown.error_rad.T), 10
    for limit in (0.1, 0.5):
        near = (flown.t_s >= start_s) & (radial <= limit * flown.beamwidth_rad)
        runs = np.convolve(near, np.ones(count), mode="full")[count - 1 :]
        first = np.flatnonzero(runs == count)
        if len(first):
            return float(flown.t_s[first[0]])
    return start_s


def changes(flights: Sequence[Flown], span_s: Pair, source: str) -> list[MetricChange]:
    """Return every metric that is known, over the time from begin to end of the pass.

    `flights` are what was recorded, simulated as recorded, and simulated with changes.  Errors
    count from when on all three have settled, seconds and loss over the whole pass.
    Where the simulation misses what was recorded by a share, it may miss a difference by that too.
    """
    begin_s = max(settled_s(each, span_s[0]) for each in flights)
    count = max(FEWEST_BLOCKS, round((span_s[1] - span_s[0]) / BLOCK_S))
    # The same blocks for all: what wind and geometry do to both cancels in the difference.
    edges = np.linspace(*span_s, count + 1)
    tables = [_blocks(each, edges, begin_s) for each in flights]
    drawn = random_stream(1, "replay").integers(0, count, (DRAWS, count))
    found = []
    for name in flights[1].events.keys() & flights[2].events.keys() | UNITS.keys() - _EVENTS:
        values = [float(_metric(name, table, np.arange(count)[None])[0]) for table in tables]
        first, second = (_metric(name, table, drawn) for table in tables[-2:])
        sigma = float(np.std(second - first))
        known = values[0] if len(flights[0].t_s) and not np.isnan(values[0]) else None
        # Relative: a simulation that is quiet by half is wrong about a difference by half, too.
        if known is not None:
            missed = abs(known - values[-2]) / max(abs(known), abs(values[-2]), 1e-12)
            sigma = float(np.hypot(sigma, missed * (values[-1] - values[-2])))
        found.append(MetricChange(name, UNITS[name], source, known, values[-2], values[-1], sigma))
    return sorted(found, key=lambda each: list(UNITS).index(each.name))


_EVENTS = {"travel", "torque reversals", "starts", "reversals"}


def _blocks(flown: Flown, edges: Array, begin_s: float) -> dict[str, Array]:
    """Return the sums of each block (b,) that the metrics are made of."""
    count, found = len(edges) - 1, dict[str, Array]()

    def add(name: str, times: Array, values: Any) -> None:
        among = (times > edges[0]) & (times <= edges[-1])
        block = np.searchsorted(edges, times[among]) - 1
        found[name] = np.bincount(block, values[among], count).astype(np.float64)

    t_s, (right, up) = flown.t_s, flown.error_rad.T / MDEG
    step_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    radial, settled = np.hypot(right, up), t_s >= begin_s
    add("samples", t_s, settled)
    add("right", t_s, settled * right**2)
    add("up", t_s, settled * up**2)
    add("held", t_s, step_s * is_held(MDEG * radial, flown.beamwidth_rad))
    add("power", t_s, step_s * received_power(MDEG * radial, flown.beamwidth_rad))
    for name, (times, adds) in flown.events.items():
        add(name, times, adds)
    found["worst"], found["span"] = np.zeros(count), np.diff(edges)
    among = settled & (t_s > edges[0]) & (t_s <= edges[-1])
    np.maximum.at(found["worst"], np.searchsorted(edges, t_s[among]) - 1, radial[among])
    return found


def _metric(name: str, table: dict[str, Array], rows: Any) -> Array:
    """Return a metric for each row of blocks (d, b)."""
    if name in _EVENTS and name not in table:
        return np.full(len(rows), np.nan)
    if name == "worst error":
        return np.asarray(table["worst"][rows].max(axis=1))
    part = {key: np.asarray(values[rows].sum(axis=1)) for key, values in table.items()}
    if name.startswith("rms"):
        squares = part["right" if "cross" in name else "up"]
        return np.asarray(np.sqrt(squares / np.maximum(part["samples"], 1.0)))
    if name == "mean loss":
        return pointing_loss_db(part["power"] / part["span"])
    if name in _EVENTS:
        return part[name]
    # Samples at both ends of a block stand for a step more than the span has.
    held: Array = np.minimum(part["held"], part["span"])
    return held if name == "held" else part["span"] - held


def draw_replay(path: Path, flights: Sequence[tuple[str, Flown]], span_s: Pair) -> None:
    """Draw the errors of the flights over the time of the pass into a PNG."""
    with figure(path, 9.0, 5.4) as drawing:
        rows = drawing.subplots(2, 1, sharex=True)
        for row, label in enumerate(("cross-elevation", "elevation")):
            axes, shown = rows[row], []
            for name, flown in flights:
                inside = (flown.t_s >= span_s[0]) & (flown.t_s <= span_s[1])
                values = flown.error_rad[inside, row] / MDEG
                axes.plot(flown.t_s[inside] - span_s[0], values, lw=0.9, label=name)
                shown.append(np.percentile(np.abs(values), 99.0) if len(values) else 0.0)
            # A search or a jump onto the target must not flatten what follows it.
            axes.set(ylabel=f"{label} (mdeg)", ylim=np.array([-1.4, 1.4]) * max(*shown, 1e-3))
        rows[1].set_xlabel("time from acquisition (s)")
        legend_above(rows[0])
