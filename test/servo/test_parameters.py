"""Impossible antennas are refused by name, value and bound."""

import math

import pytest

from rf_pointing.servo import dss13_plant


def test_mode_lists_of_unequal_length_are_refused() -> None:
    with pytest.raises(ValueError, match="mode_damping has 2 values, mode_frequency_hz has 3"):
        dss13_plant().elevation.replace(mode_damping=(0.01, 0.01))


def test_negative_stiffness_is_refused() -> None:
    with pytest.raises(ValueError, match=r"gear_stiffness_n_m=-1\.0 must be >= 1\.0"):
        dss13_plant().elevation.replace(gear_stiffness_n_m=-1.0)


def test_an_empty_travel_is_refused() -> None:
    with pytest.raises(ValueError, match=r"travel_min_rad=2\.0 must be < travel_max_rad"):
        dss13_plant().elevation.replace(travel_min_rad=2.0)


def test_a_non_finite_parameter_is_refused() -> None:
    with pytest.raises(ValueError, match="inertia_kg_m2=nan must be finite"):
        dss13_plant().azimuth.replace(inertia_kg_m2=math.nan)


def test_an_axis_must_be_a_parameter_set() -> None:
    with pytest.raises(ValueError, match=r"azimuth=3\.0 must be AxisParams"):
        dss13_plant().replace(azimuth=3.0)


def test_an_unknown_preset_is_refused() -> None:
    with pytest.raises(ValueError, match="elevation_deg='45' must be one of 60, 90"):
        dss13_plant(elevation_deg=45)
    with pytest.raises(ValueError, match="bending='measured' must be one of bwg, identified"):
        dss13_plant(bending="measured")


def test_the_amplifier_gain_is_the_corrected_published_one() -> None:
    plant = dss13_plant()
    assert plant.elevation.amplifier_gain == 56.0
    assert plant.elevation.drive_bandwidth_rad_s == pytest.approx(20.0)


def test_the_azimuth_gear_is_fifteen_percent_softer_for_its_inertia() -> None:
    plant = dss13_plant()
    ratio = (plant.azimuth.gear_frequency_rad_s / plant.elevation.gear_frequency_rad_s) ** 2
    assert ratio == pytest.approx(0.85)


def test_cross_residues_must_match_the_modes() -> None:
    with pytest.raises(ValueError, match="elevation_modes_in_azimuth has 1 values, elevation has 3 modes"):
        dss13_plant().replace(elevation_modes_in_azimuth=(0.01,))
