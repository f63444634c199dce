"""The nodes of a station: the parameter sets of each, and what a description gives to them.

Each function imports the sets of its own node only: a node takes no more of the station into its
memory than it needs.
"""

from collections.abc import Callable, Mapping
from functools import cache

from rf_pointing.core import Rows, Sensor, Value, flat, rounded, tuned
from rf_pointing.planning.horizon import HorizonMask
from rf_pointing.station import parameters as own
from rf_pointing.station.derive.band import Band, Derived, pass_elevation_deg
from rf_pointing.station.description.content import (
    VERSION,
    ArraySection,
    AxisSection,
    BandSection,
    Content,
    DishSection,
    MountSection,
    SecondStageSection,
    SiteSection,
)
from rf_pointing.tracking.sensors import SENSORS

RADIO_PORT = 4534
"""Port of radio_control: Hamlib's own are 4532 for a rig and 4533 for a rotator."""
KEY = {"key": own.CommandKeyParams()}
"""The set of every node that signs what it sends, by its group."""


def antenna_servo(of: Band) -> Derived:
    """The antenna's control unit, and the truth of a simulated one."""
    from rf_pointing.station.antenna.operation import ServoNodeParams
    from rf_pointing.station.antenna.simulated_antenna import AntennaParams
    from rf_pointing.station.derive import axes, loop, watches
    from rf_pointing.station.derive.plants import plant_and_loops

    simulation = of.content.simulation
    plant, loops = plant_and_loops(of)
    start = simulation.start_deg or axes.at_rest_deg(of)
    wind = {name: Value(getattr(simulation.wind, name), f"simulation.wind.{name}")
            for name in ("mean_speed_m_s", "from_azimuth_deg")}  # fmt: skip
    rows = {
        "antenna": {
            "start_azimuth_deg": Value(start[0], "simulation.start_deg"),
            "start_elevation_deg": Value(start[1], "simulation.start_deg"),
            "lag_averaging_s": axes.lag_averaging(of),
        },
        "drive": axes.drive(of), "plant": plant, "loops": loops,
        "wind": wind | {"dish_diameter_m": Value(of.wind_diameter_m, "dish.diameter_m", "1 m without a dish")},
        "mount": axes.mount_errors(of),
        "base_motion": {name: Value(value, f"simulation.base.{name}")
                        for name, value in flat(simulation.base).items()},
        "safety": {
            **axes.rest(of), "watch": watches.encoder_watch(of), "drive": watches.drive_watch(of),
            "wind": axes.wind_limits(of), "gate": axes.gate(of), "mask": axes.mask(of, deck=True),
            "kinematics": axes.kinematics(of), "base": axes.base(of), "sun": axes.sun(of),
            "at_rest": axes.sun_at_rest(of),
        },
        "second_stage": loop.second_stage(of),
    }  # fmt: skip
    trial = ("antenna.", "mount.", "base_motion.", "wind.mean_speed_m_s", "wind.from_azimuth_deg")
    return Derived(AntennaParams().sets(), rows, trial, {"": ServoNodeParams(), **KEY})


def pointing_controller(of: Band) -> Derived:
    """The pointing controller."""
    from rf_pointing.station.derive import array, axes, loop, watches
    from rf_pointing.station.derive.signal import link
    from rf_pointing.station.pointing.certificates import StoreParams
    from rf_pointing.station.pointing.params import ControllerParams
    from rf_pointing.tracking.power_tracker import scans_of_band
    from rf_pointing.tracking.search import spiral_of_band

    rows = {
        "pointing": {**loop.pointing(of), "lag_averaging_s": axes.lag_averaging(of)},
        "axes": watches.antenna_watch(of), "limits": axes.limits(of),
        "autotrack": array.thresholds(of), "integrator": loop.integrator(of),
        "spiral": spiral_of_band(of),
        "machine": {
            **axes.commanded(of), **axes.fixed_elevation(of), "half_power_beamwidth_deg": of.width,
            "sun_radius_deg": axes.sun_radius(of),
        },
        "mask": axes.mask(of), "kinematics": axes.kinematics(of), **scans_of_band(of),
        "calibration": {"half_power_beamwidth_deg": of.width}, "trim": loop.trim(of),
        "watch": loop.lock_watch(of), "link": link(of), "array": array.array(of),
        "gate": axes.gate(of), "sun": axes.sun(of),
    }  # fmt: skip
    # What remains a ROS parameter: the timing of the node, and the sensor of a pass.
    timing = ("pointing.period_s", "pointing.transport_s", "pointing.horizon_s", "pointing.error_age_s")
    return Derived(ControllerParams().sets(), rows, (*timing, "autotrack.sensor"), {"": StoreParams(), **KEY})


def ephemeris_publisher(of: Band) -> Derived:
    """The target as the station predicts it; its passes and their horizon."""
    from rf_pointing.ephemeris.source import SourceParams
    from rf_pointing.ephemeris.uncertainty import ElementUncertainty
    from rf_pointing.station.derive import axes
    from rf_pointing.station.pointing.predicted_target import PublisherParams

    begin = Value(pass_elevation_deg(of.content), "mount.pass_elevation_deg")
    return Derived(
        {"source": SourceParams(), "mask": HorizonMask(), "publisher": PublisherParams(),
         "uncertainty": ElementUncertainty()},
        {"source": {"site": axes.site(of)}, "mask": axes.mask(of),
         "publisher": {"mask_deg": begin, "moves": Value(of.content.base is not None, "base")}},
        ("source.", "publisher.", "uncertainty."),
    )  # fmt: skip


def target_designate(of: Band) -> Derived:
    """Targets without an orbit, as others report them."""
    from rf_pointing.ephemeris.sites import Site
    from rf_pointing.station.derive import axes
    from rf_pointing.station.designated.params import DesignateParams

    begin = Value(pass_elevation_deg(of.content), "mount.pass_elevation_deg")
    at_origin = Site.from_degrees(0.0, 0.0, 0.0)
    return Derived(
        {"designate": DesignateParams(), "site": at_origin, "mask": HorizonMask()},
        {"site": axes.site(of), "mask": axes.mask(of), "designate": {"mask_deg": begin}},
        ("designate.",),
    )


def rf_receiver(of: Band) -> Derived:
    """The simulated receiver, and where the satellite really is."""
    from rf_pointing.ephemeris.source import SourceParams
    from rf_pointing.station.antenna.receiver import SignalParams
    from rf_pointing.station.derive import axes
    from rf_pointing.station.derive.signal import signal

    offset = Value(of.content.simulation.along_track_offset_s, "simulation.along_track_offset_s")
    trial = ("dropouts", "spin.", "interference.", "sign_flip_after_s", "seed")
    return Derived(
        {"source": SourceParams(), "signal": SignalParams()},
        {"source": {"site": axes.site(of), "along_track_offset_s": offset}, "signal": signal(of)},
        ("source.", *(f"signal.{name}" for name in trial)),
    )


def signal_receiver(of: Band) -> Derived:
    """The receiver of a station that is not simulated."""
    from rf_pointing.receiver.params import SignalReceiverParams
    from rf_pointing.station.derive.signal import receiver

    return Derived({"receiver": SignalReceiverParams()}, {"receiver": receiver(of)})


def signal_source(of: Band) -> Derived:
    """The radio of a simulated station whose receiver takes samples."""
    from rf_pointing.receiver.params import OutletParams
    from rf_pointing.station.antenna.receiver import RadioParams
    from rf_pointing.station.derive.signal import outlet, radio

    arriving = rf_receiver(of)
    sets = {**arriving.defaults, "sdr": RadioParams(), "outlet": OutletParams()}
    rows = {**arriving.rows, "sdr": radio(of), "outlet": outlet(of)}
    return Derived(sets, rows, (*arriving.own, "sdr.generator."))


def monopulse_tracker(of: Band) -> Derived:
    """The monopulse tracker."""
    from rf_pointing.tracking import MonopulseParams, MonopulseScanParams

    width: Rows = {"half_power_beamwidth_deg": of.width}
    sets = {Sensor.MONOPULSE.value: MonopulseParams(), "calibration": MonopulseScanParams()}
    return Derived(sets, dict.fromkeys(sets, width), root={"": own.FileParams()})


def carrier_tracker(of: Band) -> Derived:
    """The tracker of the carrier power, with both scans."""
    from rf_pointing.tracking.power_tracker import PowerTrackerParams, scans_of_band

    return Derived(PowerTrackerParams().sets(), scans_of_band(of))


def array_receiver(of: Band) -> Derived:
    """The simulated array of patches on the dish."""
    tracker = array_tracker(of)
    return Derived({**tracker.defaults, "receiver": own.ReceiverSeed()}, tracker.rows, ("receiver.",))


def array_tracker(of: Band) -> Derived:
    """The array of patches on the dish."""
    from rf_pointing.rf.dish_array import DishArrayParams
    from rf_pointing.station.derive.array import array

    return Derived({"array": DishArrayParams()}, {"array": array(of)})


def station_executive(_: Band) -> Derived:
    """A night without an operator."""
    from rf_pointing.operations import AlarmParams, BetweenParams
    from rf_pointing.station.clients.alarm_hooks import HookParams
    from rf_pointing.station.clients.night_watch import ExecutiveParams

    sets = {"between": BetweenParams(), "alarms": AlarmParams(), "executive": ExecutiveParams(), "hooks": HookParams()}
    return Derived(sets, own=("executive.",), root=KEY, either=("hooks.",))


def station_alarms(_: Band) -> Derived:
    """Alarms where no executive runs."""
    from rf_pointing.operations import AlarmParams
    from rf_pointing.station.clients.alarm_hooks import HookParams
    from rf_pointing.station.clients.station_alarms import AlarmNodeParams

    return Derived({"alarms": AlarmParams(), "hooks": HookParams()}, root={"": AlarmNodeParams()}, either=("hooks.",))


def bias_calibrator(of: Band) -> Derived:
    """The bias model of a station and band."""
    from rf_pointing.calibration.acceptance_passes import AcceptanceRules
    from rf_pointing.station.campaign.calibrator import ORBIT, CalibratorParams

    h = of.beamwidth_deg
    largest = rounded(0.1 * h, 1 if h < 0.05 else 2)
    rows = {
        "station": Value(of.content.name, "name"), "band": Value(of.name, "bands"),
        "model_file": Value(of.model_file, "bands.*.bias_model"),
        "sigma_deg": tuned(min(rounded(0.03 * h, 1), 5.0), "0.03 h, at most 5 deg"),
        "largest_error_deg": tuned(min(largest, 5.0), "0.1 h" if largest <= 5.0 else "5 deg, less than 0.1 h"),
    }  # fmt: skip
    sets = {"calibrator": CalibratorParams(), "shadow": AcceptanceRules(), "orbit": ORBIT}
    return Derived(sets, {"calibrator": rows}, ("calibrator.", "shadow.", "orbit."))


def operator_page(_: Band) -> Derived:
    """The page in a browser."""
    from rf_pointing.station.clients.board import PageParams

    return Derived({"page": PageParams()}, own=("page.",), root=KEY)


def rotctld_server(_: Band) -> Derived:
    """The server of rotctld's clients."""
    from rf_pointing.drives.line_server import ServerParams
    from rf_pointing.station.clients.points import FollowParams, MatchParams
    from rf_pointing.station.clients.steering import SteeringParams

    sets = {"server": ServerParams(), "follow": FollowParams(), "match": MatchParams()}
    return Derived(sets, own=tuple(sets), root={"": SteeringParams(), **KEY})


def radio_control(of: Band) -> Derived:
    """Radio of the antenna: where its transmitter may send, and the port of its clients."""
    from rf_pointing.drives.line_server import ServerParams
    from rf_pointing.ephemeris.solar import SunParams
    from rf_pointing.planning.gate import GateParams
    from rf_pointing.station.derive import axes
    from rf_pointing.station.radio.inhibit import InhibitParams

    sets = {
        "server": ServerParams(port=RADIO_PORT), "inhibit": InhibitParams(), "mask": HorizonMask(),
        "gate": GateParams(), "sun": SunParams(),
    }  # fmt: skip
    rows = {"mask": axes.mask(of), "gate": axes.gate(of), "sun": axes.sun(of)}
    return Derived(sets, rows, ("server.", "inhibit."))


def simulation_clock(_: Band) -> Derived:
    """Simulation time."""
    from rf_pointing.station.clients.pacing import ClockParams

    return Derived({}, root={"": ClockParams()})


def station_description(_: Band) -> Derived:
    """Parameter set of what viewers show."""
    return Derived({"view": own.ViewParams()}, own=("view.",))


NODES: Mapping[str, Callable[[Band], Derived]] = {
    # The node of a tracker is named in the row of its sensors.
    SENSORS[Sensor.STEPTRACK].node if each is carrier_tracker else each.__name__: each
    for each in (
        antenna_servo, pointing_controller, ephemeris_publisher, target_designate, rf_receiver,
        monopulse_tracker, carrier_tracker,
        signal_source, signal_receiver,
        array_receiver, array_tracker, station_executive, station_alarms, bias_calibrator, operator_page, rotctld_server,
        radio_control, simulation_clock, station_description,
    )
}  # fmt: skip
"""Derivation of each node's parameters from a band, by the node's name."""


@cache
def reference(node: str) -> Derived:
    """Return a node's sets for a small description with every section: who owns a parameter.

    Raises KeyError for a node that does not exist.
    """
    axis = AxisSection(travel_deg=(0.0, 90.0), rate_deg_s=1.0)
    content = Content(
        version=VERSION, name="", site=SiteSection(latitude_deg=0.0, longitude_deg=0.0),
        mount=MountSection(azimuth=axis, elevation=axis), dish=DishSection(diameter_m=5.0),
        array=ArraySection(), bands={"X": BandSection(frequency_mhz=8450.0)},
        second_stage=SecondStageSection(travel_deg=0.1, bandwidth_hz=5.0),
    )  # fmt: skip
    return NODES[node](Band(content, "X"))


@cache
def described_parameters(nodes: tuple[str, ...] = tuple(NODES)) -> dict[str, tuple[str, ...]]:
    """Return which of the nodes have a parameter, by its name."""
    found: dict[str, tuple[str, ...]] = {}
    for node in nodes:
        for name in reference(node).names:
            found[name] = (*found.get(name, ()), node)
    return found


@cache
def owner_of_name(name: str) -> str:
    """Return the key that gives a parameter; "" for one that is the node's own."""
    return next((reference(node).owner(name) for node in described_parameters().get(name, ())), "")
