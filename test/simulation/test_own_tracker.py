"""A tracker that nothing in the package names holds the beam, once it is registered."""

import importlib.metadata
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.tracking import Autotrack, AutotrackInputs, AutotrackParams, AutotrackState, sensors
from test.scripts import script_module

HELD_RAD = 5.0 * MDEG
"""Per axis; the beam is 65 mdeg wide, and the loop on a mean of 4 s follows the wind no faster."""


@pytest.fixture
def example() -> Iterator[Any]:
    """Return the example as a module; what it registers is gone after the test."""
    tables: tuple[dict[str, Any], ...] = (sensors.SENSORS, sensors.SENSOR_CHOICES, sensors.TABLE_WORDS)
    before = [dict(table) for table in tables]
    yield script_module("examples/own_tracker.py")
    for table, known in zip(tables, before, strict=True):
        table.clear()
        table.update(known)


def test_a_registered_tracker_holds_the_beam(example: Any) -> None:
    log = example.main().log
    late = np.array(log.mode)[-600:]
    assert set(late.tolist()) == {"slope"}
    errors = log.errors_rad()[-600:]
    assert np.sqrt(np.mean(errors**2)) < HELD_RAD


def test_a_name_that_is_taken_and_a_scan_without_a_pattern_are_refused() -> None:
    for taken in ("monopulse", "search", "auto", ""):
        with pytest.raises(ValueError, match="must differ from every mode and every other sensor"):
            sensors.register(sensors.SensorTraits(name=taken))
    with pytest.raises(ValueError, match="scan=None: wobble scans, so it must say how the beam moves"):
        sensors.register(sensors.SensorTraits(name="wobble", scans=True))


def test_an_entry_point_registers_a_tracker_for_parameters_and_the_state_table(
    example: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    radar = sensors.SensorTraits(name="radar")
    point = SimpleNamespace(name="own", load=lambda: radar)
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda group: [point] if group == "rf_pointing.trackers" else []
    )
    with pytest.raises(ValueError, match="sensor='radar' must be one of auto, monopulse"):
        AutotrackParams(sensor="radar")
    sensors.load_trackers.cache_clear()
    sensors.load_trackers()
    table, state = Autotrack(AutotrackParams(sensor="radar")), AutotrackState(mode="program_track")
    for tick in range(10):
        inputs = AutotrackInputs(
            t_s=0.1 * tick, request="track", target_available=True, on_target=True, carrier_to_noise_db_hz=25.0,
            valid=frozenset({"radar"}),
        )  # fmt: skip
        state = table.step(state, inputs)
    assert state.mode == "radar"
    assert state.integrating
