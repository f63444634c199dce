"""Trackers from outside: what names and traits are refused, and who is asked on a pass."""

from dataclasses import replace

import pytest

from rf_pointing.core import Mode, Sensor
from rf_pointing.tracking import sensors
from rf_pointing.tracking.scan import CircleScan, ScanParams
from rf_pointing.tracking.sensors import NO_SENSOR, SensorTraits, register, sensors_of

SCAN = CircleScan(ScanParams(), age_s=2.0, bandwidth_hz=0.05)


@pytest.fixture(autouse=True)
def _own_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SENSORS", "SENSOR_CHOICES", "TABLE_WORDS"):
        monkeypatch.setattr(sensors, name, dict(getattr(sensors, name)))


@pytest.mark.parametrize("name", ["", Sensor.AUTO, Sensor.PROGRAM, NO_SENSOR, Mode.COAST, Sensor.MONOPULSE])
def test_a_tracker_without_a_name_of_its_own_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="must differ from every mode and every other sensor"):
        register(SensorTraits(name=name))


def test_a_tracker_that_scans_must_say_how() -> None:
    with pytest.raises(ValueError, match="slope scans, so it must say how the beam moves"):
        register(SensorTraits(name="slope", scans=True))
    register(SensorTraits(name="slope", scans=True, scan=SCAN))


def test_a_registered_tracker_is_a_choice_and_may_be_registered_again() -> None:
    traits = SensorTraits(name="slope")
    for _ in range(2):
        register(traits)
    assert sensors_of("slope") == (traits,)
    assert sensors.SENSOR_CHOICES["slope"] == "slope"
    assert "slope" in sensors.TABLE_WORDS
    with pytest.raises(ValueError, match="name='slope'"):
        register(replace(traits, own_level=True))


def test_auto_means_the_sensors_that_offer_themselves() -> None:
    register(SensorTraits(name="slope"))
    register(SensorTraits(name="ready", automatic=True))
    assert [traits.name for traits in sensors_of(Sensor.AUTO)] == [Sensor.MONOPULSE, Sensor.CONSCAN, "ready"]
    assert sensors_of(NO_SENSOR) == ()
