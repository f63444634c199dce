"""A simulated night beside its passes: what the executive is shown and given, and when faults begin."""

import math
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.operations import AlarmParams, BetweenParams
from rf_pointing.operations.alarms import Alarm
from rf_pointing.simulation import StationSetup
from rf_pointing.simulation.night import COMMON, NO_ANSWER, NightFault, NightSimulation, kinds_of
from test.simulation.night_plan import small_night

T0 = 1_151_520_000.0
NODES = ("pointing_controller", "ephemeris_publisher", "conscan_tracker", "rf_receiver", "antenna_servo")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return what makes the small night of a dish with a plant, or of one with a rotator."""
    station, elements, passes = small_night(tmp_path_factory.mktemp("night"))
    setups = {"plant": StationSetup(station), "rotator": StationSetup("rotator_2m")}

    def make(*faults: NightFault, kind: str = "plant", **options: Any) -> NightSimulation:
        return NightSimulation(setups[kind], elements, passes, T0, faults=faults, **options)

    return make


def shown(night: NightSimulation, seconds: float) -> dict[str, Any]:
    """Return what the executive has been shown after so long."""
    night.run(night.t_s + seconds)
    return {name: seen.value for name, seen in night.night.expected_state.attributes().items()}


def test_a_night_at_rest_shows_antenna_drive_nodes_disk_and_recorder(made: Any) -> None:
    wanted = {
        "antenna.mode": "holding", "antenna.fault": "", "antenna.high_wind": "", "antenna.moving": False,
        "antenna.azimuth": pytest.approx(0.0, abs=1e-3), "antenna.elevation": pytest.approx(math.radians(45.0), abs=1e-3),
        "drive.problem": "", **{f"{node}.silent_s": 0.0 for node in NODES}, "disk.free_gb": 500.0, "recorder.state": "idle",
    }  # fmt: skip
    assert shown(made(), 2.0).items() >= wanted.items()
    blind = made(reads=lambda name: name not in ("antenna.mode", "disk.free_gb"))
    assert set(wanted) - set(shown(blind, 2.0)) == {"antenna.mode", "disk.free_gb"}


def test_faults_begin_and_end_at_their_times_in_order(made: Any) -> None:
    faults = (
        NightFault(T0 + 8.0, "full_disk", 5.0), NightFault(T0 + 3.0, "tracker_killed", 4.0),
        NightFault(T0 + 3.0, "servo_killed", 4.0), NightFault(T0 + 20.0, "link_drop", 5.0),
    )  # fmt: skip
    for seconds, begun, silent, free_gb in (
        (5.5, 2, ("conscan_tracker", "antenna_servo"), 500.0), (10.0, 3, (), 0.0), (25.0, 3, (), 500.0),
    ):  # fmt: skip
        night = made(*faults)
        seen = shown(night, seconds)
        assert {node for node in NODES if seen[f"{node}.silent_s"] > 1.0} == set(silent)
        assert (seen["disk.free_gb"], seen["antenna.mode"]) == (free_gb, "holding")
        # A link drops where there is one: in the next pass.
        assert [fault.kind for fault in night.log.faults] == ["tracker_killed", "servo_killed", "full_disk"][:begun]


def test_the_place_of_a_rotator_is_shown_while_its_drive_answers(made: Any) -> None:
    for seconds, problem in ((2.0, ""), (5.0, NO_ANSWER)):
        night = made(NightFault(T0 + 3.0, "drive_lost", 30.0), kind="rotator")
        assert shown(night, seconds)["drive.problem"] == problem
        age_s = night.t_s - night.night.expected_state.actual("antenna.azimuth").t_s
        assert (age_s > 1.5) is bool(problem)


def test_what_can_go_wrong_is_that_of_every_station_and_that_of_its_kind(made: Any, tmp_path: Path) -> None:
    assert kinds_of(made().setup) == (*COMMON, "runaway", "encoder_frozen", "gust")
    assert kinds_of(made(kind="rotator").setup) == (*COMMON, "axes_stuck")
    calm, *_ = small_night(tmp_path, **{"wind.anemometer": False})
    assert "gust" not in kinds_of(StationSetup(calm))


def test_the_morning_report_shows_the_disk_and_the_relays_of_a_rotator(made: Any) -> None:
    assert made().health() == {"disk": {"free_gb": 500.0}}
    assert made(kind="rotator").health()["relays"] == {"starts of azimuth and elevation": "0, 0"}


def test_the_executive_gets_thresholds_rest_sensor_and_share_of_the_station(made: Any) -> None:
    night = made(between=BetweenParams(lead_s=7.0), thresholds=AlarmParams(quiet_s=33.0, node_silent_s=44.0))
    assert (night.night.schedule.params.lead_s, night.night.book.quiet_s) == (7.0, 33.0)
    (cause,) = [each for each in night.night.table.causes if each.name == "lost_node"]
    assert cause.when[0].wanted == 44.0
    assert (night.night.sensor, night.night.least_share) == (night.setup.sensor, 0.6)
    assert list(night.night.schedule.entries) == ["90001", "90002"]
    night.night.book.notify("raised", Alarm("x", 1, "text", T0))
    assert night.log.messages == [("raised", "x", "text")]
