"""What may change on a configured node, and what is refused because it would not be used."""

from collections.abc import Callable
from typing import Any

import pytest

from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.pointing.controller import PointingController

CASES = [
    (AntennaServo, "loops.azimuth.proportional_gain", "antenna.start_azimuth_deg", 20.0),
    (PointingControllerNode, "limits.elevation_min_deg", "pointing.period_s", 0.05),
    (EphemerisPublisher, "source.along_track_offset_s", "source.satellite", "9998"),
]


@pytest.mark.parametrize(("kind", "live", "late", "value"), CASES)
def test_live_parameters_are_taken_and_others_only_by_a_node_that_is_cleaned_up(
    make_bench: Callable[..., Any], kind: Any, live: str, late: str, value: Any
) -> None:
    bench = make_bench(kind)
    assert bench.step("configure")
    assert bench.change(**{live: 5.0}) == ""
    assert bench.change(**{late: value}).startswith(f"{late} is read when the node is configured")
    assert bench.node.get_parameter(late).value != value
    assert bench.step("cleanup")
    assert bench.change(**{late: value}) == ""


@pytest.mark.parametrize(
    ("kind", "part", "name"), [(AntennaServo, SimulatedAntenna, CASES[0][1]),
                               (PointingControllerNode, PointingController, CASES[1][1])],
)  # fmt: skip
def test_what_has_changed_is_in_force_at_once(
    make_bench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, kind: Any, part: Any, name: str
) -> None:
    taken: list[Any] = []
    monkeypatch.setattr(part, "retune", lambda _, *sets: taken.append(sets))
    bench = make_bench(kind).up()
    assert bench.change(**{name: 5.0}) == ""
    expected = {SimulatedAntenna: lambda: taken[0][1].azimuth.proportional_gain,
                PointingController: lambda: taken[0][0].limits.elevation_min_rad / 0.017453292519943295}  # fmt: skip
    assert expected[part]() == pytest.approx(5.0)
