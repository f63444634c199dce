"""Plant files: round trip, the shipped file, strictness."""

from pathlib import Path

import pytest
import yaml

from rf_pointing.servo import dss13_plant, plant_from_mapping, plant_to_mapping

SHIPPED = Path(__file__).parents[2] / "config" / "plant_dss13.yaml"


def test_mapping_and_back_is_the_same_plant() -> None:
    plant = dss13_plant(elevation_deg=90, bending="identified")
    back = plant_to_mapping(plant_from_mapping(plant_to_mapping(plant)))
    for axis in ("azimuth", "elevation"):
        for key, value in plant_to_mapping(plant)[axis].items():
            assert back[axis][key] == pytest.approx(value, rel=1e-12)


def test_angles_are_in_degrees() -> None:
    mapping = plant_to_mapping(dss13_plant())
    assert mapping["azimuth"]["travel_max_deg"] == pytest.approx(225.0)
    assert mapping["elevation"]["rate_limit_deg_s"] == pytest.approx(2.0)


def test_the_shipped_file_is_the_preset() -> None:
    shipped = plant_from_mapping(yaml.safe_load(SHIPPED.read_text()))
    assert shipped.elevation.mode_frequency_hz == dss13_plant().elevation.mode_frequency_hz
    assert shipped.azimuth.gear_stiffness_n_m == pytest.approx(dss13_plant().azimuth.gear_stiffness_n_m, rel=1e-9)
    assert shipped.pinion_factor == dss13_plant().pinion_factor


def test_missing_and_unknown_keys_are_refused_by_name() -> None:
    mapping = plant_to_mapping(dss13_plant())
    mapping["azimuth"].pop("inertia_kg_m2")
    with pytest.raises(ValueError, match=r"plant needs azimuth\.inertia_kg_m2"):
        plant_from_mapping(mapping)
    mapping = plant_to_mapping(dss13_plant())
    mapping["elevation"]["stiffness"] = 1.0
    with pytest.raises(ValueError, match=r"plant has no key elevation\.stiffness"):
        plant_from_mapping(mapping)
    with pytest.raises(ValueError, match="plant needs azimuth with its own keys"):
        plant_from_mapping({"elevation": {}})


def test_a_negative_stiffness_in_a_file_is_refused() -> None:
    mapping = plant_to_mapping(dss13_plant())
    mapping["azimuth"]["gear_stiffness_n_m"] = -2.0
    with pytest.raises(ValueError, match=r"gear_stiffness_n_m=-2\.0 must be >= 1\.0"):
        plant_from_mapping(mapping)
