"""How a pass through the zenith is flown, and which ones are, on controllers, antennas and passes that are planted."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.core import JointReading, random_stream
from rf_pointing.ephemeris import SITES, Elements
from rf_pointing.papers import keyhole, keyhole_passes
from rf_pointing.papers.keyhole import Loss
from rf_pointing.papers.keyhole_passes import KeyholeCase
from rf_pointing.planning import GateParams
from rf_pointing.servo import dss13_plant
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from rf_pointing.station.pointing.params import ControllerParams

Array = NDArray[np.float64]
BEAM_RAD = math.radians(0.5)


def case(track: object = None, aos_t_s: float = 400.0, los_t_s: float = 900.0) -> KeyholeCase:
    window = SimpleNamespace(
        name="one", aos_t_s=aos_t_s, los_t_s=los_t_s, peak_elevation_rad=1.5, azimuth_min_rad=0.4, azimuth_max_rad=3.0
    )
    return KeyholeCase(
        track=track, window=window, beamwidth_rad=BEAM_RAD, station="here", mount=keyhole_passes.station_mount()
    )


class Controller:
    """Stands in for the controller: its certificate has this branch; notes its calls."""

    def __init__(self, branch: object = None, over: bool = False) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.params = SimpleNamespace(pointing=SimpleNamespace(period_s=0.1))
        course = SimpleNamespace(plunge_at=lambda t_s: over and t_s == 500.0, turns_rad=2.0 * math.pi)
        self.plan = SimpleNamespace(
            certificate=SimpleNamespace(chosen=branch), course=course,
            take_profiles=lambda given: self.calls.append(("profiles", given)),
        )  # fmt: skip

    def take_joints(self, reading: JointReading) -> None:
        self.calls.append(("joints", reading.t_s, reading.position_rad.tolist(), reading.velocity_rad_s.tolist()))

    def take_target(self, target: object) -> None:
        self.calls.append(("target", target))

    def take_model(self, model: object) -> None:
        self.calls.append(("model", model))

    def start(self, *args: object) -> None:
        self.calls.append(("start", *args))


def branch(first_s: float | None) -> SimpleNamespace:
    times = None if first_s is None else first_s + 0.5 * np.arange(3)
    crossing = None if times is None else SimpleNamespace(t_s=times, error_rad=BEAM_RAD * np.array([0.1, 0.6, 0.2]))
    return SimpleNamespace(crossing=crossing, keyhole_s=12.5, over=True)


def test_a_run_holds_the_loss_of_the_crossing_against_that_of_the_flight_from_its_begin(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    controller, antenna = Controller(branch(500.7)), SimpleNamespace(params=SimpleNamespace(tick_s=0.25))
    one = case("track")
    angles = BEAM_RAD * np.array([2.0, 0.3, 0.55, 0.4])

    def flown(*args: object) -> tuple[Array, Array]:
        assert args == (one, controller, antenna, 470.0, 501.7 + 15.0)
        return np.array([500.5, 500.7, 500.95, 501.2]), angles

    def begun(given: KeyholeCase, steered: Controller) -> float | None:
        assert (given, steered) == (one, controller)
        assert controller.calls == [("profiles", [("track", one.window)])]
        return begin_s

    monkeypatch.setattr(keyhole, "_controller", lambda given: controller if given is one else None)
    monkeypatch.setattr(keyhole, "pass_profile", lambda *args: args)
    monkeypatch.setattr(keyhole, "_begin", begun)
    monkeypatch.setattr(keyhole, "_antenna", lambda *args: antenna if args == (controller, one, 470.0) else None)
    monkeypatch.setattr(keyhole, "_flown", flown)
    begin_s: float | None = 470.0
    run = keyhole.fly(one)
    assert run is not None
    assert (run.name, run.station, run.aos_t_s, run.peak_rad, run.beamwidth_rad) == (
        "one",
        "here",
        400.0,
        1.5,
        BEAM_RAD,
    )
    assert (run.keyhole_s, run.over) == (12.5, True)
    assert run.predicted == Loss.of(BEAM_RAD * np.array([0.1, 0.6, 0.2]), 0.5, BEAM_RAD)
    assert run.simulated == Loss.of(angles[1:], 0.25, BEAM_RAD)
    controller.calls.clear()
    begin_s = None
    assert keyhole.fly(one) is None


def test_the_controller_forbids_nothing_and_knows_the_mount_as_calibrated(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[ControllerParams] = []
    controller = Controller()
    monkeypatch.setattr(keyhole, "PointingController", lambda params: made.append(params) or controller)
    one = case()
    assert keyhole._controller(one) is controller
    ((_, model),) = controller.calls
    assert model == one.calibrated
    (params,) = made
    machine = params.machine
    assert (machine.half_power_beamwidth_rad, machine.least_share, machine.sun_radius_rad) == (BEAM_RAD, 0.0, 0.0)
    assert (params.limits, params.pointing.lag_averaging_s) == (one.limits, 5.0)
    assert params.gate == GateParams(sun_radius_rad=0.0)


@pytest.mark.parametrize(
    ("first_s", "aos_t_s", "begin_s"),
    [(None, 400.0, None), (500.7, 400.0, 470.0), (500.7, 469.5, 470.5), (500.7, 480.0, 481.0)],
)
def test_a_flight_begins_on_the_target_half_a_minute_before_the_crossing(
    first_s: float | None, aos_t_s: float, begin_s: float | None
) -> None:
    controller, one = Controller(branch(first_s)), case(aos_t_s=aos_t_s)
    assert keyhole._begin(one, controller) == begin_s
    assert controller.calls == [
        ("joints", aos_t_s, [3.0, 0.5], [0.0, 0.0]),
        ("start", aos_t_s, one.window, "program"),
    ]


@pytest.mark.parametrize("over", [False, True])
def test_the_antenna_stands_on_the_target_with_travel_beyond_the_controllers(
    over: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def target_at(t_s: float, near_azimuth_rad: float) -> SimpleNamespace:
        # The middle of the pass, by the turns of the course.
        assert (t_s, near_azimuth_rad) == (500.0, pytest.approx(1.7 + 2.0 * math.pi))
        return SimpleNamespace(azimuth_rad=1.6, elevation_rad=0.9)

    def plunged(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, str, str]:
        assert (velocity.tolist(), acceleration.tolist()) == ([0.0, 0.0], [0.0, 0.0])
        return np.array([position[0] + 1.0, 3.0 - position[1]]), "velocity", "acceleration"

    monkeypatch.setattr(keyhole, "SimulatedAntenna", lambda params: params)
    monkeypatch.setattr(keyhole, "plunged", plunged)
    one = case(SimpleNamespace(target_at=target_at))
    found: AntennaParams = keyhole._antenna(Controller(over=over), one, 500.0)
    start = (found.antenna.start_azimuth_rad, found.antenna.start_elevation_rad)
    assert start == pytest.approx((2.6, 2.1) if over else (1.6, 0.9))
    assert found.antenna.lag_averaging_s == 5.0
    preprocessor = found.loops.preprocessor
    assert (preprocessor.travel_min_rad, preprocessor.travel_max_rad) == ((-7.0, -0.1), (13.0, 3.2))
    azimuth, elevation = found.plant.azimuth, found.plant.elevation
    assert (azimuth.travel_min_rad, azimuth.travel_max_rad, elevation.travel_max_rad) == (-7.5, 13.5, 3.3)
    assert elevation.travel_min_rad == dss13_plant().elevation.travel_min_rad
    assert (found.mount, found.safety.gate) == (one.mount, GateParams(sun_radius_rad=0.0))


@pytest.mark.parametrize(("end_s", "count"), [(511.0, 21), (600.0, 33)])
def test_a_flight_knows_its_target_2_s_ahead_and_ends_3_s_before_the_pass(
    end_s: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    start_s = 500.123_456_78
    controller = Controller()
    enabled: list[int] = []

    def step(k: int) -> SimpleNamespace:
        assert enabled == [20]
        t_s = start_s + 0.5 * k
        return SimpleNamespace(t_s=t_s, boresight=SimpleNamespace(azimuth_rad=0.01 * t_s, elevation_rad=0.6 + 1e-3 * k))

    def pointed(*args: object) -> SimpleNamespace:
        assert args == (antenna, controller, track, start_s)
        return SimpleNamespace(step=step)

    antenna = SimpleNamespace(enable=lambda: enabled.append(len(controller.calls)), params=SimpleNamespace(tick_s=0.5))
    track = SimpleNamespace(
        target_at=lambda t_s: t_s,
        sample=lambda t_s: SimpleNamespace(azimuth_rad=0.01 * t_s, elevation_rad=np.full(len(t_s), 0.6)),
    )
    monkeypatch.setattr(keyhole, "PointedAntenna", pointed)
    one = case(track, los_t_s=520.0)
    times, angles = keyhole._flown(one, controller, antenna, start_s, end_s)
    assert [target for _, target in controller.calls] == [round(500.123_457 + 0.1 * k, 6) for k in range(20)]
    # From the first tick on, to the last but one.
    np.testing.assert_allclose(times, start_s + 0.5 * np.arange(1, count + 1), rtol=1e-12)
    np.testing.assert_allclose(angles, 1e-3 * np.arange(1, count + 1), rtol=1e-6)


# Which passes.


def elements(name: str, perigee_m: float) -> Elements:
    axis_m = keyhole_passes.EARTH_RADIUS_M + perigee_m
    return Elements(
        name=name, catalogue_number=1, epoch_t_s=5e8, inclination_rad=1.0, ascending_node_rad=0.0, eccentricity=0.0,
        argument_of_perigee_rad=0.0, mean_anomaly_rad=0.0, drag_per_earth_radius=0.0,
        mean_motion_rad_s=math.sqrt(keyhole_passes.EARTH_MU_M3_S2 / axis_m**3),
    )  # fmt: skip


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Elements, str, float]]:
    """Return what was searched: orbit, station and day; every search finds passes of 74, 75 and 80 deg."""
    found: list[tuple[Elements, str, float]] = []

    def find(track: tuple[Elements, str], start_s: float, duration_s: float, mask_rad: float) -> list[SimpleNamespace]:
        assert (duration_s, mask_rad) == (86400.0, pytest.approx(math.radians(5.0)))
        found.append((*track, (start_s - track[0].epoch_t_s) / 86400.0))
        return [SimpleNamespace(peak_elevation_rad=math.radians(peak)) for peak in (74.0, 75.0, 80.0)]

    known = [elements("low", 250e3), elements("kept", 800e3), elements("high", 1600e3)]
    monkeypatch.setattr(keyhole_passes, "verification_elements", lambda: known)
    monkeypatch.setattr(keyhole_passes, "TopocentricTrack", lambda orbit, station: (orbit, station))
    monkeypatch.setattr(keyhole_passes, "site", lambda name: name)
    monkeypatch.setattr(keyhole_passes, "find_passes", find)
    return found


@pytest.mark.parametrize("count", [1, 2, 5])
def test_as_many_high_passes_are_flown_as_asked_for(count: int, searched: list[tuple[Elements, str, float]]) -> None:
    cases = list(keyhole_passes.high_passes(count, 3))
    assert len(cases) == count
    assert len(searched) == (count + 1) // 2
    peaks = [math.radians(75.0), math.radians(80.0)] * 3
    assert [one.window.peak_elevation_rad for one in cases] == peaks[:count]
    for place, one in enumerate(cases):
        orbit, station, _ = searched[place // 2]
        assert (one.track, one.station) == ((orbit, station), station)
        assert round(math.degrees(one.beamwidth_rad), 9) in keyhole_passes.BEAMS_DEG


def test_seven_of_ten_orbits_are_generated_and_none_is_searched_twice_on_a_day(
    searched: list[tuple[Elements, str, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keyhole_passes, "MOST_TRIES", 600)
    assert len(list(keyhole_passes.high_passes(10**6, 3))) == 2 * len(searched)
    generated = [orbit for orbit, _, _ in searched if orbit.name.startswith("generated")]
    assert len(generated) == pytest.approx(0.7 * 600, abs=40)
    assert len({(orbit.name, station, day) for orbit, station, day in searched}) == len(searched)
    assert {orbit.name for orbit, _, _ in searched} - {orbit.name for orbit in generated} == {"kept"}
    # Some days of the one orbit kept came up again.
    assert len(searched) < 600
    assert {day for _, _, day in searched} == set(range(7))
    assert {station for _, station, _ in searched} == set(SITES)


def test_a_generated_orbit_is_drawn_in_height_node_anomaly_and_inclination() -> None:
    found, random = keyhole_passes._generated(8, random_stream(4, "one")), random_stream(4, "one")
    axis_m = keyhole_passes.EARTH_RADIUS_M + random.uniform(350e3, 1300e3)
    node, anomaly = random.uniform(0.0, 2.0 * math.pi, 2)
    assert found.mean_motion_rad_s == pytest.approx(math.sqrt(keyhole_passes.EARTH_MU_M3_S2 / axis_m**3), rel=1e-12)
    assert (found.ascending_node_rad, found.mean_anomaly_rad) == (node, anomaly)
    assert math.degrees(found.inclination_rad) == pytest.approx(random.uniform(40.0, 110.0))
    assert (found.name, found.catalogue_number, found.epoch_t_s) == ("generated 8", 9, 1_151_347_200.0)
    assert (found.eccentricity, found.argument_of_perigee_rad, found.drag_per_earth_radius) == (1e-3, 0.0, 1e-5)
