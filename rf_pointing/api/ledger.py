"""Where the pointing loss of a pass comes from: it is flown again with one cause after another off.

simulated   what its run says of satellite, mount, air, wind, noise and encoders is switched off
real        the direction in which tracking found the target, minus the prediction, is split:

    d(t) = orbit error + terms of the model + scale of the refraction + unexplained

(`api/misprediction.py`); then as a simulated one.  Wind is that of the anemometer or of the rate
commands, noise that of the C/N0 that was received.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.api.misprediction import GROUPS, split_prediction
from rf_pointing.api.passes import StationPass
from rf_pointing.api.station import Station
from rf_pointing.calibration import BiasModel
from rf_pointing.core import AXES, MDEG, Array, Mode, Pair, sky_offset_rad
from rf_pointing.drives import takes_positions
from rf_pointing.ephemeris import TopocentricTrack, load_track, sky_uncertainty
from rf_pointing.report import error_ledger as rows
from rf_pointing.report.analysis import tracking_modes
from rf_pointing.report.error_ledger import Cause, Ledger, loss_db, shared
from rf_pointing.report.recorded_signals import read_pass
from rf_pointing.report.replay_case import RecordedCase
from rf_pointing.report.replay_report import SENSED, TRUE, Flown, settled_s
from rf_pointing.servo import RecordedWind, WindParams
from rf_pointing.simulation import StationSetup, merged, simulate_pass
from rf_pointing.simulation.open_loop import RecordedTrack, Signals
from rf_pointing.simulation.recorded_gusts import calm
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from rf_pointing.station.description import StationDescription

WAITING_S = 10.0
"""Time before the pass in which the antenna of a budget waits where it begins."""
LEVEL = "link.zenith_carrier_to_noise_db_hz"
LOUDER_DB = 30.0
"""By how much the carrier is stronger where its noise is switched off."""
FINE_BITS, FINE_DEG = 34, 1e-6
"""Encoder and steps of a rotator without quantisation."""
NEAR_DB = 0.5
"""Difference of C/N0 up to which a replayed pass has the noise of the recorded one."""
REMEMBERED_S = 10.0
"""Time after it has settled in which a loop still remembers the way to the target."""
MOST_OF = 0.98
"""Share of the errors of a pass below which a recording has gaps."""
Wind = Callable[[WindParams], RecordedWind]


@dataclass
class _Switches:
    """Holds what of a flight is switched off so far."""

    over: dict[str, dict[str, object]] = field(default_factory=dict)
    model: BiasModel | None = None
    truth: TopocentricTrack | None = None
    wind: Wind | None = None

    def change(self, node: str, **values: object) -> None:
        self.over[node] = self.over.get(node, {}) | values


@dataclass
class PlannedCase:
    """A pass that is flown for a budget: the same of a simulation as `RecordedCase` of a bag."""

    station: Station
    one: StationPass
    sensor: str
    seed: int
    changes: Mapping[str, Mapping[str, object]]

    simulated, recorded_target = True, False

    def setup(
        self, over: Mapping[str, Mapping[str, object]] | None = None,
        model: BiasModel | None = None, **more: Any,
    ) -> StationSetup:  # fmt: skip
        """Return the station of the pass, with changes."""
        changes = merged(self.changes, over)
        return self.station.setup(self.one, self.seed, changes, model=model, **more)

    def fly(self, setup: StationSetup) -> tuple[Signals, float]:
        """Return the signals of the pass, and 0."""
        signals, start_s = Signals(), math.floor(self.one.aos_t_s) - WAITING_S
        simulate_pass(setup, self.one.window, start_s, self.sensor, on_signal=signals.take)
        return signals, 0.0


class _Flights:
    """Flights of one pass, each with one cause less; `parts` are what they make of its error."""

    def __init__(self, case: RecordedCase | PlannedCase, aos_t_s: float, los_t_s: float) -> None:
        self.case, self.off, self.remarks = case, _Switches(), list[str]()
        self.span, self.notes = (aos_t_s, los_t_s), dict[str, str]()
        self.first = self.signals = self._flown()
        flown = Flown.of(self.first, TRUE, None)
        self.t_s = flown.t_s[(flown.t_s >= aos_t_s) & (flown.t_s <= los_t_s)]
        if not len(self.t_s):
            raise ValueError("the replayed pass has no sample between AOS and LOS: nothing flies")
        self.width_rad, self.held = flown.beamwidth_rad, self._held(self.first)
        self._left: list[tuple[str, Array]] = [("", self._errors_rad(self.first))]

    def _flown(self) -> Signals:
        off = self.off
        setup = self.case.setup(off.over, off.model, truth=off.truth, wind=off.wind)
        return self.case.fly(setup)[0]

    def _errors_rad(self, signals: Signals) -> Array:
        """Return the true errors (n, 2) at the times of the first flight."""
        flown = Flown.of(signals, TRUE, None)
        # A flight with a fault ends early: what it does not have is as far off as its last sample.
        return np.column_stack([np.interp(self.t_s, flown.t_s, e) for e in flown.error_rad.T])

    def _held(self, signals: Signals) -> Any:
        """Return where (n, 1) the beam had settled on the target and was not searching for it."""
        statuses = signals.of("tracking_status")
        among = np.searchsorted([each.t_s for each in statuses], self.t_s, side="right") - 1
        modes = np.array([each.mode for each in statuses])[np.maximum(among, 0)]
        begin_s = settled_s(Flown.of(signals, TRUE, None), self.span[0])
        begin_s += REMEMBERED_S * (begin_s > self.t_s[0])
        return ((self.t_s >= begin_s) & ~np.isin(modes, (Mode.SEARCH, Mode.SLEW)))[:, None]

    def take(self, name: str, moved: Array, note: str) -> None:
        """Take what (n, 2) a cause has added to the error that is left."""
        self._left.append((name, self._left[-1][1] - moved))
        self.notes[name] = note

    def without(self, name: str, note: str = "") -> None:
        """Fly without the cause that was just switched off."""
        self.signals = self._flown()
        self.held &= self._held(self.signals)
        self._left.append((name, self._errors_rad(self.signals)))
        self.notes[name] = note

    def parts(self) -> dict[str, Array]:
        """Return what (n, 2) each cause adds to the error of the first flight."""
        errors, found = self._left[0][1], dict[str, Array]()
        # Before every flight has settled they differ by when they find the target.
        found[rows.SEARCH] = np.where(self.held, 0.0, errors)
        self.notes[rows.SEARCH] = "until every flight has settled, and while searching"
        for (_, before), (name, after) in pairwise(self._left):
            part = np.where(self.held, before - after, 0.0)
            found[name] = found.get(name, 0.0) + part
        left = np.where(self.held, self._left[-1][1], 0.0)
        found[rows.UNEXPLAINED] = found.get(rows.UNEXPLAINED, 0.0) + left
        self.notes[rows.UNEXPLAINED] = "starts of the motion and the loop itself"
        return found

    def axis_error_rad(self) -> tuple[Array, Array]:
        """Return command minus encoders and minus centre of the scan, (n, 2) each on the sky."""
        sent = [each for _, each in self.signals.of("joint_trajectory")]
        status, joints = (self.signals.of(name) for name in ("tracking_status", "joint_states"))

        def at(times: list[Any], angles: list[Array]) -> list[Array]:
            return [np.interp(self.t_s, times, column) for column in np.array(angles).T]

        # The first point of a trajectory is in force when the next one comes.
        command = at([each.t_s[0] for each in sent], [each.position_rad[0] for each in sent])
        axes = at([each.t_s for each in joints], [each.position_rad for each in joints])
        # An antenna that has stopped has no command, and its centre means nothing.
        status = [each for each in status if each.mode in tracking_modes()]
        centre = at([each.t_s for each in status], [each.scan_centre_rad for each in status])
        meant = (self.t_s <= min(sent[-1].t_s[0], status[-1].t_s))[:, None]
        lag, scan = (np.column_stack(sky_offset_rad(*command, *each)) for each in (axes, centre))
        return np.where(meant, lag, 0.0), np.where(meant, scan, 0.0)


def _account(flights: _Flights) -> None:
    """Switch off one cause after another."""
    case, off = flights.case, flights.off
    _without_prediction(flights) if case.simulated else _without_estimate(flights)
    setup = case.setup()
    signal = setup.sets("rf_receiver")["signal"]
    louder = min(signal.link.zenith_carrier_to_noise_db_hz + LOUDER_DB, 140.0)
    # The controller knows it, too: a carrier that strong would be taken for a false one.
    off.change("pointing_controller", **{LEVEL: louder})
    off.change("rf_receiver", **{f"signal.{LEVEL}": louder, "signal.receiver.phase_noise_deg": 0.0})
    flights.without(rows.NOISE, f"carrier {LOUDER_DB:.0f} dB stronger")
    # Its motors hold what gusts there are, and the simulation has none of them.
    if takes_positions(AntennaParams(**setup.sets("antenna_servo")).drive.type):
        flights.notes[rows.WIND] = "a drive that takes positions is simulated in a calm"
        fine: dict[str, object] = {"drive.rotator.resolution_deg": [FINE_DEG] * 2}
    else:
        off.wind = calm
        flights.without(rows.WIND, "in a calm")
        fine = {f"plant.{axis}.encoder_bits": FINE_BITS for axis in AXES}
        fine |= {f"plant.{axis}.encoder_noise_deg": 0.0 for axis in AXES}
    off.change("antenna_servo", **fine)
    flights.without(rows.STEPS, "positions without steps and noise")
    lag, scan = flights.axis_error_rad()
    flights.take(rows.LAG, lag, "command minus encoders")
    flights.take(rows.SCAN, -scan, "command minus its centre")


def _without_prediction(flights: _Flights) -> None:
    """Switch off orbit, model and air of a simulated pass, whose run says what they are."""
    case, off, setup = flights.case, flights.off, flights.case.setup()
    predicted = setup.sets("ephemeris_publisher")["source"]
    real = setup.sets("rf_receiver")["source"]
    exact = predicted.replace(refraction=real.refraction, weather=real.weather)
    recorded = case.track if isinstance(case, RecordedCase) and case.recorded_target else None
    if recorded is not None:
        off.truth = recorded
        flights.without(rows.EPHEMERIS, "the recorded target, with the error of its refraction")
    elif exact != real:
        off.truth = load_track(exact)
        flights.without(rows.EPHEMERIS)
    mount = setup.sets("antenna_servo")["mount"].model(setup.model.mount)
    if mount.coefficients != setup.model.coefficients:
        # The mount stays, and with it the motion of the axes: the model becomes perfect.
        off.model = mount
        flights.without(rows.MODEL)
    if exact != predicted and recorded is None:
        off.truth = load_track(predicted)
        flights.without(rows.REFRACTION)


def _without_estimate(flights: _Flights) -> None:
    """Switch off orbit, model and air of a real pass, as its tracking shows them."""
    case, off = flights.case, flights.off
    assert isinstance(case, RecordedCase)
    assert isinstance(case.track, RecordedTrack)
    t_s, parts, left, sigmas = split_prediction(case)
    # The loop is flown with what is left, so that each row is what the loop leaves of it.
    for name in GROUPS:
        left = left - parts[name]
        off.truth = case.track.shifted(t_s, left)
        size = float(np.sqrt(np.mean(np.sum(parts[name] ** 2, axis=1)))) / MDEG
        flights.without(name, f"the prediction is off by {size:.3g} ±{sigmas[name]:.2g} mdeg")
    # Slow, and of no shape that is known: weather that changes, a mount that warms up.
    off.truth = case.track
    flights.without(rows.UNEXPLAINED)


def ledger(
    bag: str | Path, *, station: StationDescription | str | Path | None = None, namespace: str | None = None
) -> Ledger:
    """Return where the pointing loss of a recorded pass comes from.

    The pass is flown again some seven times, each time without one more cause: minutes of the
    processor.

    Parameters
    ----------
    bag : rosbag2 recording of one pass; `station.yaml` and `run.yaml` of `track` lie next to it.
    station : description in place of that next to the bag.
    namespace : which antenna, where the bag holds several.

    Raises
    ------
    ValueError
        No tracked pass in the bag, no axes, no description for it.  What else is missing is in
        `remarks`, and its share in the row "unexplained".

    Examples
    --------
    >>> print(rp.ledger("runs/28057-20060627T045843-01/bag"))
    """
    case = RecordedCase(Path(bag), read_pass(bag, namespace), station)
    case.choose_wind("auto")
    if not case.simulated and not case.recorded_target:
        raise ValueError(f"{bag} holds no target: the prediction of a real pass is not known")
    window = case.window
    flights = _Flights(case, window.aos_t_s, window.los_t_s)
    if not case.simulated:
        flights = _as_loud(flights)
    _account(flights)
    kind = TRUE if case.simulated else SENSED
    measured, replayed = (_inside(each, kind, flights) for each in (case.signals, flights.first))
    missed, width_rad = (0.0, 0.0), flights.width_rad
    if len(measured) and len(replayed):
        squares = [float(np.mean(np.sum(each**2, axis=1))) for each in (measured, replayed)]
        losses = [loss_db(each, width_rad) for each in (measured, replayed)]
        missed = squares[0] - squares[1], losses[0] - losses[1]
        if len(measured) < MOST_OF * len(replayed):
            share = 100.0 * len(measured) / len(replayed)
            flights.remarks.append(f"{share:.0f} % of the errors of the pass were recorded")
    else:
        flights.remarks.append(f"no valid {kind} in the pass: the totals are those of its replay")
    remarks = (*case.remarks, *flights.remarks, f"wind: {case.wind}")
    source = "true" if case.simulated else "sensed"
    return _made(flights, f"{window.name}, {bag}", source, remarks, missed)


def _inside(signals: Signals, kind: str, flights: _Flights) -> Array:
    flown = Flown.of(signals, kind, None)
    inside = (flown.t_s >= flights.t_s[0]) & (flown.t_s <= flights.t_s[-1])
    errors: Array = flown.error_rad[inside]
    return errors


def _as_loud(flights: _Flights) -> _Flights:
    """Return flights with the C/N0 of the recording, flown anew where they had another."""
    case = flights.case
    assert isinstance(case, RecordedCase)
    levels = []
    for signals in (case.signals, flights.first):
        power = [each for each in signals.of("carrier_power") if each.t_s >= flights.span[0]]
        levels.append([each.carrier_to_noise_db_hz for each in power])
    if not all(levels):
        flights.remarks.append("no carrier_power: the noise is that of the description")
        return flights
    recorded, flown = map(float, map(np.median, levels))
    if abs(recorded - flown) <= NEAR_DB:
        return flights
    setup = case.setup()
    level = setup.sets("rf_receiver")["signal"].link.zenith_carrier_to_noise_db_hz
    case.assume("rf_receiver", f"signal.{LEVEL}", level + recorded - flown)
    again = _Flights(case, *flights.span)
    again.remarks.append(f"C/N0 {recorded - flown:+.1f} dB against the description")
    return again


def _made(
    flights: _Flights, title: str, source: str, remarks: tuple[str, ...],
    missed: Pair = (0.0, 0.0),
) -> Ledger:  # fmt: skip
    """Return the ledger; `missed` (rad^2, dB) is what was measured beyond the first flight."""
    parts = flights.parts()
    whole = np.asarray(sum(parts.values()))
    found = shared(parts, flights.width_rad)
    square_mdeg2 = missed[0] / MDEG**2
    rms, loss = found[rows.UNEXPLAINED]
    found[rows.UNEXPLAINED] = math.sqrt(rms**2 + abs(square_mdeg2)), loss + missed[1]
    notes, nothing = flights.notes, (0.0, 0.0)
    causes = tuple(Cause(n, *found.get(n, nothing), notes.get(n, "")) for n in rows.COLOURS)
    total = float(np.mean(np.sum(whole**2, axis=1))) / MDEG**2 + square_mdeg2
    return Ledger(
        title=title, source=source, seconds=flights.span[1] - flights.span[0],
        beamwidth_mdeg=flights.width_rad / MDEG, rms_mdeg=math.sqrt(max(total, 0.0)),
        loss_db=loss_db(whole, flights.width_rad) + missed[1], causes=causes, remarks=remarks,
    )  # fmt: skip


def budget(
    one: StationPass,
    *,
    sensor: str | None = None,
    minutes: float | None = None,
    late_s: float | None = None,
    wind_m_s: float | None = None,
    seed: int = 1,
    changes: Mapping[str, Mapping[str, object]] | None = None,
) -> Ledger:
    """Return the same table before the pass, of the station as its description says it is.

    Parameters
    ----------
    one : a pass of `passes`.
    sensor : as of `simulate`; by default the station's.
    minutes : only the first minutes of the pass.
    late_s : how far the satellite is ahead of its elements; by default that of the description's
        simulation, or one sigma of their age where it has none.
    wind_m_s : mean wind speed; by default that of the description's simulation.
    seed, changes : as of `simulate`.

    A mount that the description simulates without errors has the model error of its band, half of
    its variance in the collimation and half in the elevation offset.

    Raises
    ------
    ValueError
        A sensor that the band does not have, or a parameter that does not exist.

    Examples
    --------
    >>> station = rp.Station("leo_3m7")
    >>> print(rp.budget(station.passes(rp.elements("CBERS 2"))[0], wind_m_s=12.0))
    """
    station = one.station
    own = merged(changes)
    branch = station.certificate(one).chosen
    if branch is None:
        raise ValueError(f"{one.name}: {station.certificate(one).reason}")
    for axis, angle in zip(AXES, branch.start_rad, strict=True):
        _default(own, "antenna_servo", f"antenna.start_{axis}_deg", math.degrees(angle))
    chosen = station.description.chosen_sensor(sensor, station.band)
    if minutes is not None:
        los_t_s = min(one.los_t_s, one.aos_t_s + 60.0 * minutes)
        one = replace(one, window=replace(one.window, los_t_s=los_t_s))
    # The axes stand where the pass begins: a slew that comes late is the certificate's to tell.
    law = station.description.sets("ephemeris_publisher", station.band)["uncertainty"]
    known = sky_uncertainty(station.track_of(one.target), one.tca_t_s, law)
    if late_s is None:
        late_s = station.description.content.simulation.along_track_offset_s
        late_s = late_s or (known.along_track_s if known is not None else 0.0)
    supposed = [f"elements off by {late_s:.3g} s"]
    _default(own, "rf_receiver", "source.along_track_offset_s", late_s)
    if wind_m_s is not None:
        _default(own, "antenna_servo", "wind.mean_speed_m_s", wind_m_s)
    case = PlannedCase(station, one, chosen, seed, own)
    setup = case.setup()
    mount = setup.sets("antenna_servo")["mount"].model(setup.model.mount)
    error_deg = station.description.content.bands[station.band].model_error_deg
    # A mount without errors of its own is off by what the band tolerates.
    if mount == setup.model:
        for name in ("collimation", "elevation_offset"):
            _default(own, "antenna_servo", f"mount.{name}_deg", error_deg / math.sqrt(2.0))
        supposed.append(f"model off by {1e3 * error_deg:.3g} mdeg")
    supposed.append(f"wind of {setup.sets('antenna_servo')['wind'].mean_speed_m_s:.3g} m/s")
    flights = _Flights(case, one.aos_t_s, one.window.los_t_s)
    _account(flights)
    title = f"{one.name} by {chosen} on {station.name}"
    return _made(flights, title, "predicted", (", ".join(supposed),))


def _default(own: dict[str, dict[str, object]], node: str, name: str, value: object) -> None:
    own.setdefault(node, {}).setdefault(name, value)
