"""Finding elements by number or name, and refusals in the operator's words."""

import dataclasses

import pytest

from rf_pointing.ephemeris import Elements, find_elements, verification_elements


def test_number_and_name_find_the_same_object(cbers: Elements) -> None:
    elements = verification_elements()
    assert find_elements(elements, "cbers 2") == cbers
    assert find_elements(elements, " 28057 ") == cbers
    assert find_elements(elements, "00005").catalogue_number == 5


def test_the_newest_set_wins(cbers: Elements) -> None:
    older = dataclasses.replace(cbers, epoch_t_s=cbers.epoch_t_s - 86400.0)
    assert find_elements([cbers, older], "28057") == cbers
    assert find_elements([older, cbers], "28057") == cbers


def test_an_unknown_satellite_is_refused_with_the_nearest_names() -> None:
    with pytest.raises(ValueError, match="satellite='CBERS 4' is not among 30 elements; nearest: CBERS 2"):
        find_elements(verification_elements(), "CBERS 4")


def test_a_name_of_several_objects_is_refused_with_their_numbers() -> None:
    with pytest.raises(ValueError, match="names several objects: 16925, 22312, 22674; give the number"):
        find_elements(verification_elements(), "SL-6 R/B(2)")


def test_numbers_above_alpha5_keep_their_value_and_still_propagate(cbers: Elements) -> None:
    nine_digits = dataclasses.replace(cbers, catalogue_number=799500123)
    assert nine_digits.satrec().sgp4_tsince(10.0) == cbers.satrec().sgp4_tsince(10.0)
    assert find_elements([nine_digits, cbers], "799500123") == nine_digits


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"eccentricity": 1.0}, "eccentricity=1.0"),
        ({"mean_motion_rad_s": 0.0}, "mean_motion_rad_s=0.0 of CBERS 2 must be > 0"),
        ({"mean_anomaly_rad": float("nan")}, "mean_anomaly_rad=nan must be finite"),
        ({"catalogue_number": -5}, "catalogue_number=-5"),
    ],
)
def test_impossible_elements_are_refused(cbers: Elements, change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(cbers, **change)


def test_elements_of_one_name_and_number_are_one_object_whatever_the_case(cbers: Elements) -> None:
    for wanted in ("cbers 2", "  CBERS 2 ", "28057", "028057"):
        assert find_elements([cbers], wanted) is cbers
    # A name of digits that is no number of an object here.
    named = dataclasses.replace(cbers, name="4711")
    assert find_elements([named], "4711") is named
