"""Impossible antennas are refused by name, value and bound."""

import math
import re
from pathlib import Path

import pytest

from rf_pointing.servo import dss13_plant

TABLE = Path(__file__).parents[2] / "docs" / "math" / "plant.md"
IN_SI = {"deg": math.radians(1.0), "mdeg": math.radians(1e-3)}


def test_an_axis_must_be_a_parameter_set() -> None:
    with pytest.raises(ValueError, match=r"azimuth=3\.0 must be AxisParams"):
        dss13_plant().replace(azimuth=3.0)


def test_an_unknown_preset_is_refused() -> None:
    with pytest.raises(ValueError, match="elevation_deg='45' must be one of 60, 90"):
        dss13_plant(elevation_deg=45)
    with pytest.raises(ValueError, match="bending='measured' must be one of bwg, identified"):
        dss13_plant(bending="measured")


def test_cross_residues_must_match_the_modes() -> None:
    with pytest.raises(ValueError, match="elevation_modes_in_azimuth has 1 values, elevation has 3 modes"):
        dss13_plant().replace(elevation_modes_in_azimuth=(0.01,))


@pytest.mark.parametrize(("bending", "bending_hz"), [("bwg", 2.12), ("identified", 2.01)])
def test_modes_travel_and_encoders_are_the_published_ones(bending: str, bending_hz: float) -> None:
    """DSS13-ID Table 1 and Sec. IV, BWG Sec. IV-B."""
    plant = dss13_plant(bending=bending)
    assert plant.azimuth.mode_frequency_hz == (1.65, 3.24, 4.24)
    assert plant.elevation.mode_frequency_hz == (bending_hz, 3.15, 5.22)
    assert plant.cross_mode_frequency_hz == 5.76
    assert math.degrees(plant.azimuth.travel_max_rad - plant.azimuth.travel_min_rad) == pytest.approx(450.0)
    assert plant.azimuth.travel_max_rad == -plant.azimuth.travel_min_rad
    assert (plant.azimuth.encoder_bits, plant.elevation.encoder_bits) == (24, 24)


def test_tracking_does_not_cross_the_play_and_a_slew_does() -> None:
    """The countertorque lies above the friction at any rate and below the torque of the largest acceleration."""
    for axis in (dss13_plant().azimuth, dss13_plant().elevation):
        friction = axis.static_friction_ratio * axis.coulomb_friction_n_m
        assert 10.0 * friction < axis.countertorque_n_m
        assert axis.countertorque_n_m < 0.5 * axis.inertia_kg_m2 * axis.acceleration_limit_rad_s2


def test_every_number_of_an_axis_is_that_of_the_table() -> None:
    plant, rows = dss13_plant(), re.findall(r"^\| `(\w+)` \| (.*) \| (.*) \| (.*) \|$", TABLE.read_text(), re.MULTILINE)
    # The bandwidth stands for its value per gain.
    assert {name for name, *_ in rows} == set(type(plant.azimuth).__dataclass_fields__) - {
        "drive_bandwidth_per_gain_hz"
    } | {"drive_bandwidth_rad_s"}
    for name, *columns, unit in rows:
        factor = IN_SI.get(unit.split("/")[0], 1.0)
        for axis, text in zip((plant.azimuth, plant.elevation), columns, strict=True):
            value = getattr(axis, name)
            found = value if isinstance(value, tuple) else (value,)
            assert found == pytest.approx([factor * float(each) for each in text.split(", ")], rel=3e-6), name


def test_what_couples_the_axes_is_that_of_the_table() -> None:
    plant, level = dss13_plant(), dss13_plant(elevation_deg=90, pinion_angle_rad=0.3)
    assert plant.azimuth_modes_in_elevation == pytest.approx((0.005, 0.002, 0.002))
    assert level.azimuth_modes_in_elevation == pytest.approx((0.0015, 0.0006, 0.0006))
    assert (plant.azimuth_to_bending, level.azimuth_to_bending) == (0.10, 0.03)
    for each in (plant, level):
        assert each.elevation_modes_in_azimuth == (0.0032, 0.001, 0.001)
        assert (each.cross_mode_frequency_hz, each.cross_mode_damping, each.cross_mode_residue) == (5.76, 0.02, 0.003)
        assert (each.pinion_floor, each.substep_s) == (0.28, 0.005)
    assert (plant.pinion_angle_rad, level.pinion_angle_rad) == (0.0, 0.3)
    assert (level.azimuth, level.elevation) == (plant.azimuth, plant.elevation)


def test_the_ideal_antenna_differs_by_friction_play_and_encoders_only() -> None:
    plant, ideal = dss13_plant(), dss13_plant(ideal=True)
    linear = {"coulomb_friction_n_m": 0.0, "backlash_rad": 0.0, "encoder_bits": 40, "encoder_noise_rad": 0.0}
    assert ideal == plant.replace(azimuth=plant.azimuth.replace(**linear), elevation=plant.elevation.replace(**linear))


def test_an_axis_without_modes_or_of_no_travel_is_refused() -> None:
    none = dict.fromkeys(("mode_frequency_hz", "mode_damping", "mode_encoder_residue", "mode_beam_residue"), ())
    with pytest.raises(ValueError, match="mode_frequency_hz has 0 values, must have at least 1"):
        dss13_plant().elevation.replace(**none)
    for name in ("mode_damping", "mode_encoder_residue", "mode_beam_residue"):
        with pytest.raises(ValueError, match=f"{name} has 4 values, mode_frequency_hz has 3"):
            dss13_plant().azimuth.replace(**{name: (0.1, 0.1, 0.1, 0.1)})
    with pytest.raises(ValueError, match="travel_min_rad=1.0 must be < travel_max_rad=1.0"):
        dss13_plant().elevation.replace(travel_min_rad=1.0, travel_max_rad=1.0)
