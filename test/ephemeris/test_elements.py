"""Finding elements by number or name, and refusals in the operator's words."""

import dataclasses
import math

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


@pytest.mark.parametrize("inclination_rad", [-0.01, 3.15])
def test_an_inclination_is_between_none_and_half_a_turn(cbers: Elements, inclination_rad: float) -> None:
    for taken in (0.0, math.pi):
        assert dataclasses.replace(cbers, inclination_rad=taken).inclination_rad == taken
    with pytest.raises(ValueError, match="inclination_rad="):
        dataclasses.replace(cbers, inclination_rad=inclination_rad)


def test_an_unknown_satellite_among_very_many_is_refused_with_names_from_all_of_them(cbers: Elements) -> None:
    """Every second or third of thousands is compared: enough for the name of a family."""
    many = [dataclasses.replace(cbers, name=f"SAT {number}", catalogue_number=number) for number in range(12000)]
    with pytest.raises(ValueError, match=r"satellite='SAT 11999X' is not among 12000 elements; nearest: SAT 119\d\d"):
        find_elements(many, "SAT 11999X")
    with pytest.raises(ValueError, match="nearest: SAT 0, 0, SAT 2, 2, SAT 4$"):
        find_elements(many, "?")


def test_among_few_elements_every_name_and_number_is_compared(cbers: Elements) -> None:
    few = [
        dataclasses.replace(cbers, name=name, catalogue_number=number)
        for name, number in (("ALPHA", 11111), ("BRAVO", 22222), ("COCOS", 33333))
    ]
    for wanted, nearest in (("ALPHO", "ALPHA"), ("BRAVA", "BRAVO"), ("COCAS", "COCOS"), ("22223", "22222")):
        with pytest.raises(ValueError, match=f"satellite='{wanted}' is not among 3 elements; nearest: {nearest}"):
            find_elements(few, wanted)
    with pytest.raises(ValueError, match="nearest: ALPHA, 11111, BRAVO, 22222, COCOS$"):
        find_elements(few, "?")


def test_elements_of_one_name_and_number_are_one_object_whatever_the_case(cbers: Elements) -> None:
    for wanted in ("cbers 2", "  CBERS 2 ", "28057", "028057"):
        assert find_elements([cbers], wanted) is cbers
    # A name of digits that is no number of an object here.
    named = dataclasses.replace(cbers, name="4711")
    assert find_elements([named], "4711") is named


@pytest.mark.parametrize(
    ("change", "taken", "refused"),
    [
        ("catalogue_number", (0, 999999999), (-1, 1000000000)),
        ("eccentricity", (0.0, math.nextafter(1.0, 0.0)), (-1e-9, 1.0)),
        ("mean_motion_rad_s", (1e-9,), (-1e-3, math.nan)),
    ],
)
def test_elements_reach_to_the_ends_of_their_ranges(
    cbers: Elements, change: str, taken: tuple[float, ...], refused: tuple[float, ...]
) -> None:
    for value in taken:
        assert getattr(dataclasses.replace(cbers, **{change: value}), change) == value
    for value in refused:
        with pytest.raises(ValueError, match=f"{change}="):
            dataclasses.replace(cbers, **{change: value})


def test_what_is_not_said_of_elements_is_none_and_they_are_unclassified(cbers: Elements) -> None:
    said = ("name", "catalogue_number", "epoch_t_s", "inclination_rad", "ascending_node_rad", "eccentricity")
    said += ("argument_of_perigee_rad", "mean_anomaly_rad", "mean_motion_rad_s", "drag_per_earth_radius")
    bare = Elements(**{name: getattr(cbers, name) for name in said})
    assert (bare.mean_motion_dot_rad_s2, bare.mean_motion_ddot_rad_s3) == (0.0, 0.0)
    assert (bare.international_designator, bare.classification) == ("", "U")
    assert (bare.element_set_number, bare.revolution_number) == (0, 0)


@pytest.mark.parametrize(("number", "label"), [(339999, 339999), (340000, 0)])
def test_the_propagators_label_is_the_number_where_it_takes_it(cbers: Elements, number: int, label: int) -> None:
    record = dataclasses.replace(cbers, catalogue_number=number).satrec()
    assert record.satnum == label
    assert record.sgp4_tsince(7.0) == cbers.satrec().sgp4_tsince(7.0)


def test_a_name_of_two_objects_is_refused_with_both_numbers(cbers: Elements) -> None:
    with pytest.raises(ValueError, match="satellite='cbers 2' names several objects: 7, 28057; give the number"):
        find_elements([cbers, dataclasses.replace(cbers, catalogue_number=7)], "cbers 2")
