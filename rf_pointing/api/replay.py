"""A recorded pass once more, as it was and with other parameters: what a change would have given.

    open loop     recorded inputs through each part alone; its output is held against the recorded
    closed loop   the same target, wind and model through the whole simulated station, as recorded
                  and with the changes; the difference of the two is that of the changes

The recorded pass itself shows whether the simulation explains it; what it does not explain is in
the uncertainty of every difference.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.core import MDEG, Array, read_parameter_files, require_choice
from rf_pointing.ephemeris import Pass
from rf_pointing.report.recorded_signals import read_pass
from rf_pointing.report.replay_case import Changes, RecordedCase
from rf_pointing.report.replay_report import SENSED, TRUE, Flown, MetricChange, changes, draw_replay
from rf_pointing.simulation.open_loop import commanded, followed, sensed_errors, time_of
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.description import StationDescription
from rf_pointing.tracking.power_tracker import NODE, TRACKED

WINDS = ("auto", "seed", "measured", "estimated", "none")
SAME_BEAMWIDTHS = 1e-3
"""Rms up to which two runs are the same: parameters travel in degrees, stamps in microseconds."""
MOST_LOST = 0.01
"""Share of a topic that may be without a counterpart, as what came before the run was whole."""
WORSE = {"rms cross-elevation": 0.5, "rms elevation": 0.5, "lost": 2.0, "mean loss": 0.1}
"""By how much each metric may get worse in a suite, in mdeg, s and dB, unless it says otherwise."""


@dataclass(frozen=True)
class TopicCheck:
    """Output of a part held against the recorded topic: digests of both, and their distance.

    `rms_mdeg` and `largest_mdeg` are over messages of the same time; `reason` is "" for equal
    digests.  `same` tells whether both are the same but for what the wire rounds.
    """

    loop: str
    topic: str
    count: int
    recorded: str
    replayed: str
    rms_mdeg: float
    largest_mdeg: float
    reason: str
    same: bool

    def __str__(self) -> str:
        row = f"{self.loop:<8}{self.topic:<20}{self.count:7}"
        return f"{row}  {self.recorded}  {self.replayed}  {self.reason or 'equal'}"


@dataclass(frozen=True, eq=False)
class Replay:
    """A replayed pass: `print` shows it, `write` keeps table and picture, `worse` judges it.

    `checks` hold the parts against the recording, `metrics` the changes against the recorded
    parameters; `wind` says what blew, `remarks` what could not be replayed.  `speed` is that of the
    slower closed loop, in times of real time.
    """

    path: Path
    window: Pass
    changed: str
    checks: tuple[TopicCheck, ...]
    metrics: tuple[MetricChange, ...]
    wind: str
    remarks: tuple[str, ...]
    speed: float
    flights: tuple[tuple[str, Flown], ...] = field(repr=False)

    @property
    def reproduced(self) -> bool:
        """Whether every part that could be replayed gives what was recorded."""
        return all(check.same for check in self.checks)

    def metric(self, name: str) -> MetricChange:
        """Return one metric; ValueError for one that is not known of this pass."""
        require_choice("metric", name, [each.name for each in self.metrics])
        return next(each for each in self.metrics if each.name == name)

    def worse(self, allowed: Mapping[str, float] = WORSE) -> list[str]:
        """Return which metrics got worse by more than is `allowed`, beyond two of their sigmas."""
        rows = [(self.metric(name), most) for name, most in allowed.items()]
        return [
            f"{each.name} {each.difference:+.3g} ±{each.sigma:.2g} {each.unit}, allowed {most:g}"
            for each, most in rows
            if each.difference - 2.0 * each.sigma > most
        ]

    def write(self, folder: str | Path) -> list[Path]:
        """Write `replay.json` and `replay.png` into a folder; return the files."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        table, picture = folder / "replay.json", folder / "replay.png"
        rows = [asdict(each) | {"difference": each.difference} for each in self.metrics]
        content = {
            "bag": str(self.path), "pass": self.window.name, "changed": self.changed,
            "wind": self.wind, "reproduced": self.reproduced, "metrics": rows,
            "checks": [asdict(each) for each in self.checks], "remarks": self.remarks,
            "speed": self.speed,
        }  # fmt: skip
        table.write_text(json.dumps(content, indent=1) + "\n")
        draw_replay(picture, self.flights, (self.window.aos_t_s, self.window.los_t_s))
        return [table, picture]

    def __str__(self) -> str:
        heads = "".join(f"{head:>11}" for head in ("recorded", "before", "after", "difference"))
        changed = self.changed or "nothing changed"
        lines = [
            f"{self.path}: {self.window.name}, {self.window.duration_s:.0f} s; {changed}",
            f"wind: {self.wind}", *(f"remark: {each}" for each in self.remarks),
            f"{'loop':<8}{'topic':<20}{'count':>7}  {'recorded':<16}  replayed",
            *map(str, self.checks), f"{'closed loop':<26}{heads} ±sigma  errors",
            *map(str, self.metrics), f"closed loop at {self.speed:.0f} times real time",
        ]  # fmt: skip
        return "\n".join(lines)


def replay(
    bag: str | Path,
    *,
    station: StationDescription | str | Path | None = None,
    params: str | Path | Changes | None = None,
    model: BiasModel | str | Path | None = None,
    law: str | None = None,
    estimator: str | None = None,
    sensor: str | None = None,
    wind: str = "auto",
    namespace: str | None = None,
) -> Replay:
    """Replay a recorded pass, as it was and with these changes.

    Parameters
    ----------
    bag : rosbag2 recording of one pass; `station.yaml` and `run.yaml` of `track` lie next to it.
    station : description in place of that next to the bag, or of the shipped one of its name.
    params : changed parameters: a ROS parameter file, or by node and dotted name, in degrees.
    model : changed bias model, or its file.
    law, estimator, sensor : changed position law (pi, lqg), estimator of the scan (linear,
        likelihood), sensor of the pass.
    wind : seed (the gusts of a simulated recording), measured (weather/wind), estimated (from the
        rate commands), none; auto takes the first of them that the recording has.
    namespace : which antenna, where the bag holds several.

    Raises
    ------
    ValueError
        No tracked pass in the bag, no description for it, a parameter that does not exist, a wind
        that the recording does not have.  What else is missing is in `remarks`.

    Examples
    --------
    >>> print(rp.replay("runs/28057-20060627T045843-01/bag", law="lqg"))
    """
    require_choice("wind", wind, WINDS)
    over, said = _changes(params, law, estimator)
    own = {"model": model if isinstance(model, str | Path | None) else "given", "sensor": sensor}
    said += [f"{name}={value}" for name, value in own.items() if value is not None]
    chosen = read_model(model).model if isinstance(model, str | Path) else model
    case = RecordedCase(Path(bag), read_pass(bag, namespace), station)
    # Before minutes are spent on what is refused.
    case.setup(over).antenna()
    case.choose_wind(wind)
    checks = list(_open_loop(case))
    before, took_s = case.fly(case.setup())
    if case.simulated:
        checks += [_check(case, "closed", each, before.of(each)) for each in ("joint_states", TRUE)]
    after, again_s = case.fly(case.setup(over, chosen), sensor) if said else (before, took_s)
    kind, topic = ("true", TRUE) if case.simulated else ("sensed", SENSED)
    flights = [Flown.of(each, topic, case.plant) for each in (case.signals, before, after)]
    span = (case.window.aos_t_s, case.window.los_t_s)
    names = ("recorded", "as recorded", "changed") if said else ("recorded", "replayed")
    return Replay(
        path=Path(bag), window=case.window, changed=", ".join(said), checks=tuple(checks),
        metrics=tuple(changes(flights, span, kind)), wind=case.wind, remarks=tuple(case.remarks),
        speed=case.seconds / max(took_s, again_s), flights=tuple(zip(names, flights, strict=False)),
    )  # fmt: skip


def bags_of(folder: str | Path) -> list[Path]:
    """Return the bags at or below a folder in the order of their names, at least one.

    ValueError without a bag.
    """
    root, kinds = Path(folder), ("*.mcap", "*.db3", "*.mcap.zstd", "*.db3.zstd")
    holders = {file.parent for kind in kinds for file in root.rglob(kind)}
    found = [root] if root.is_file() or root in holders else sorted(holders)
    if not found:
        raise ValueError(f"{root} holds no recording")
    return found


def _changes(
    params: str | Path | Changes | None, law: str | None, estimator: str | None
) -> tuple[dict[str, dict[str, object]], list[str]]:
    """Return the changed parameters by node, and the same as texts."""
    given = read_parameter_files([Path(params)]) if isinstance(params, str | Path) else params or {}
    over = {node: dict(values) for node, values in given.items()}
    if law is not None:
        over.setdefault("antenna_servo", {})["loops.law"] = law
    if estimator is not None:
        # Only the first of both scans has more than one.
        over.setdefault(NODE, {})[f"{TRACKED[0]}.estimator"] = estimator
    if "**" in over:
        raise ValueError("params: ** names every node; name the node of each parameter")
    rows = [(node, *row) for node, values in over.items() for row in values.items()]
    return over, [f"{node} {name}={value}" for node, name, value in rows]


def _open_loop(case: RecordedCase) -> Iterator[TopicCheck]:
    """Yield the check of each part whose inputs were recorded; the others are remarked."""
    signals, setup = case.signals, case.setup()
    antenna = setup.antenna()

    def track() -> Sequence[Any]:
        return sensed_errors(setup, signals)

    def control() -> Sequence[Any]:
        return commanded(setup, signals, case.recorded.window, case.recorded.sensor, case.track)

    def follow() -> Sequence[Any]:
        if not case.simulated or not isinstance(antenna, SimulatedAntenna):
            raise ValueError("its drive is not a simulated one that takes rates")
        return followed(antenna, signals)[0]

    parts = (
        ("trackers", SENSED, ("tracking_status", "carrier_power"), track),
        ("controller", "joint_trajectory", ("target", "tracking_status"), control),
        ("servo", "joint_states", ("joint_trajectory",), follow),
    )
    for part, topic, inputs, run in parts:
        try:
            if missing := signals.missing(topic, *inputs):
                raise ValueError(f"no {missing} in the recording")
            yield _check(case, "open", topic, run())
        except ValueError as error:
            case.remarks.append(f"{part} not replayed alone: {error}")


def _check(case: RecordedCase, loop: str, topic: str, given: Sequence[Any]) -> TopicCheck:
    both_rows = given, case.signals.of(topic)
    ours, recorded = ({_key(each): _angles(each) for each in rows} for rows in both_rows)
    # A simulation ends with the pass, a recording some seconds later.
    last_s = max((t_s for _, t_s in ours), default=-math.inf)
    recorded = {key: value for key, value in recorded.items() if key[1] <= last_s}
    both = [key for key in recorded if key in ours and len(ours[key]) == len(recorded[key])]
    apart = [float(np.max(np.abs(ours[key] - recorded[key]))) for key in both]
    away = np.array(apart or [math.inf]) / MDEG
    rms, largest, reason = float(np.sqrt(np.mean(away**2))), float(np.max(away)), ""
    digests = _digest(recorded), _digest(ours)
    near = rms * MDEG <= SAME_BEAMWIDTHS * case.beamwidth_rad
    same = near and len(both) >= (1.0 - MOST_LOST) * len(recorded)
    if digests[0] != digests[1]:
        reason = f"rms {rms:.2g}, at most {largest:.2g} mdeg apart: "
        if lost := len(recorded) - len(both):
            reason += f"{lost} recorded without a counterpart"
        elif near:
            reason += "parameters travel in degrees, stamps in microseconds"
        else:
            reason += "another station, target or version, or inputs that came late"
    return TopicCheck(loop, topic, len(recorded), *digests, rms, largest, reason, same)


def _key(signal: Any) -> tuple[str, float]:
    return str(getattr(signal, "sensor", "")), round(time_of(signal), 6)


def _angles(signal: Any) -> Array:
    """Return the angles of a signal, which another run must give again."""
    moving = signal[1] if isinstance(signal, tuple) else signal
    if hasattr(moving, "position_rad"):
        return np.ravel(moving.position_rad)
    return np.array([signal.cross_elevation_rad, signal.elevation_rad])


def _digest(angles: Mapping[tuple[str, float], Array]) -> str:
    """Return the first 16 digits of the SHA-256 of all angles in the order of their times."""
    sums = hashlib.sha256()
    for key in sorted(angles):
        sums.update(angles[key].astype(np.float64).tobytes())
    return sums.hexdigest()[:16]
