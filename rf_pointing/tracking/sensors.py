"""The sensors that may track, as data: one row of traits for each.

The state table, the controller and the reports read these rows and name no sensor of their own.  A
tracker from outside the package is one more row, added by `register` or by an entry point of the
group `rf_pointing.trackers`; what it publishes as `pointing_error` is then used like any other.
"""

from dataclasses import dataclass
from functools import cache

from rf_pointing.core import Mode, Sensor
from rf_pointing.core.lazy import installed
from rf_pointing.tracking.scan import Scan

ENTRY_POINTS = "rf_pointing.trackers"
# `Sensor.PROGRAM` as `autotrack.sensor` and `tracking_status.sensor` spell it.
NO_SENSOR = "none"


@dataclass(frozen=True, kw_only=True)
class SensorTraits:
    """Traits of one sensor that the station must know; defaults: a tracker that always measures.

    Attributes
    ----------
    name : value of `pointing_error.sensor`; also the mode in which it tracks and the operator's
        choice.
    scans : whether the beam must move for a measurement, so that errors come in the sensor's own
        mode only.
    scan : how the beam moves; None where the controller's parameter set of the sensor's name says
        so.
    needs_strong_carrier : whether it needs the C/N0 of `autotrack.monopulse_on_db_hz`; else a
        carrier is enough.
    automatic : whether the choice `auto` may use it.
    weaker : the sensor that may take over when the carrier is too weak for this one; empty for
        none.
    every_period : whether it reports every period, so that a late report is worth waiting for.
    once_a_round : whether results come so seldom that an invalid one alone must not end the mode.
    watched : whether the watch on false locks judges its errors.
    own_level : whether its C/N0 is that of a receiver of its own, judged by
        `autotrack.array_on_db_hz` and not by the thresholds of the dish.
    level_from : other sensors whose reports carry the C/N0 while this one does not track.
    colour : of its mode in reports, as #rrggbb.
    node : executable of the package that publishes its errors; empty for a tracker from outside.
    """

    name: str
    scans: bool = False
    scan: Scan | None = None
    needs_strong_carrier: bool = False
    automatic: bool = False
    weaker: str = ""
    every_period: bool = False
    once_a_round: bool = False
    watched: bool = False
    own_level: bool = False
    level_from: tuple[str, ...] = ()
    colour: str = "#a6761d"
    node: str = ""


# Traits by name, registered trackers last; read it, `register` writes it.
SENSORS: dict[str, SensorTraits] = {
    traits.name: traits
    for traits in (
        SensorTraits(
            # Only monopulse has sidelobes with nulls of their own, and signs that can flip.
            name=Sensor.MONOPULSE, needs_strong_carrier=True, automatic=True, weaker=Sensor.CONSCAN, every_period=True,
            watched=True, colour="#0072b2", node="monopulse_tracker",
        ),
        SensorTraits(
            name=Sensor.CONSCAN, scans=True, automatic=True, every_period=True, colour="#009e73", node="conscan_tracker",
        ),
        # While nothing is scanned, conscan_tracker reports the C/N0 under the name of conscan.
        SensorTraits(
            name=Sensor.STEPTRACK, scans=True, every_period=True, once_a_round=True, level_from=(Sensor.CONSCAN,),
            colour="#5f4b8b", node="conscan_tracker",
        ),
        SensorTraits(name=Sensor.ARRAY, every_period=True, own_level=True, colour="#d55e00", node="array_tracker"),
    )
}  # fmt: skip
# Sensor of a pass as the operator names it, and as the state table does.
SENSOR_CHOICES: dict[str, str] = {Sensor.PROGRAM: NO_SENSOR} | {name: name for name in (*SENSORS, Sensor.AUTO)}
# Values of `autotrack.sensor`: a view of the keys grows with registered trackers.
TABLE_WORDS = dict.fromkeys((Sensor.AUTO, *SENSORS, NO_SENSOR))


def register(traits: SensorTraits) -> None:
    """Add a tracker; every process that must know it (controller, `track`, reports) has to.

    Raises
    ------
    ValueError
        When the name is taken, or a sensor that scans does not say how.
    """
    # An entry point and the program itself may both register it.
    if SENSORS.get(traits.name) == traits:
        return
    if not traits.name or traits.name in {*TABLE_WORDS, *SENSOR_CHOICES, *Mode}:
        raise ValueError(f"name={traits.name!r} of a tracker must differ from every mode and every other sensor")
    if traits.scans and traits.scan is None:
        raise ValueError(f"scan=None: {traits.name} scans, so it must say how the beam moves")
    SENSORS[traits.name] = traits
    SENSOR_CHOICES[traits.name] = traits.name
    TABLE_WORDS[traits.name] = None


@cache
def load_trackers() -> None:
    """Register the trackers of installed packages, once: entry points that name a `SensorTraits`.

    Not done on import: a tracker's own module imports this one.
    """
    for point in installed(ENTRY_POINTS).values():
        register(point.load())


def sensors_of(choice: str) -> tuple[SensorTraits, ...]:
    """Return the sensors that a pass may use, `choice` in the state table's words."""
    return tuple(
        traits for name, traits in SENSORS.items() if choice == name or (choice == Sensor.AUTO and traits.automatic)
    )
