"""Finding elements by number or name, and refusals in the operator's words."""

import dataclasses

import pytest

from rf_pointing.ephemeris import Elements, find_elements, verification_elements


def test_number_and_name_find_the_same_object(cbers: Elements) -> None:
    elements = verification_elements()
    assert find_elements(elements, " cbers 2 ") == cbers
    assert find_elements(elements, " 28057 ") == cbers
    assert find_elements(elements, "00005").catalogue_number == 5


def test_the_newest_set_wins(cbers: Elements) -> None:
    older = dataclasses.replace(cbers, epoch_t_s=cbers.epoch_t_s - 86400.0)
    assert find_elements([cbers, older], "28057") == cbers
    assert find_elements([older, cbers], "28057") == cbers


def test_an_unknown_satellite_is_refused_with_the_nearest_names() -> None:
    with pytest.raises(ValueError, match="satellite='CBERS 4' is not among 30 elements; did you mean CBERS 2"):
        find_elements(verification_elements(), "CBERS 4")
    with pytest.raises(ValueError, match=r"satellite='99999' is not among"):
        find_elements(verification_elements(), "99999")


def test_a_name_of_several_objects_is_refused_with_their_numbers() -> None:
    with pytest.raises(ValueError, match="names several objects: 16925, 22312, 22674; give the number"):
        find_elements(verification_elements(), "SL-6 R/B(2)")


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


def test_a_name_of_digits_that_is_no_number_of_an_object_finds_it(cbers: Elements) -> None:
    named = dataclasses.replace(cbers, name="4711")
    assert find_elements([named], "4711") is named
