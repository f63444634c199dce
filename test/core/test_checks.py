"""Refusals carry the name, the value and the bound."""

import math
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import as_finite_array, as_finite_pair, require_between, require_choice, require_finite
from rf_pointing.core.checks import id_of, is_number, name_of, require_id, require_name

NOT_FINITE = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_a_number_that_is_not_finite_is_refused_by_name(bad: float) -> None:
    with pytest.raises(ValueError, match=r"^gain=-?(nan|inf) must be finite$"):
        require_finite("gain", bad)


@pytest.mark.parametrize("value", [1.0, 1.5, 2.0])
def test_a_value_on_or_between_the_bounds_passes(value: float) -> None:
    require_between("rate", value, 1.0, 2.0)


@pytest.mark.parametrize(
    ("value", "low", "high", "complaint"),
    [
        (0.999, 1.0, 2.0, r"rate=0\.999 must be >= 1\.0"),
        (2.001, 1.0, 2.0, r"rate=2\.001 must be <= 2\.0"),
        (-1e300, 0.0, None, r"rate=-1e\+300 must be >= 0\.0"),
        (1e300, None, 0.0, r"rate=1e\+300 must be <= 0\.0"),
        (math.nan, None, None, r"rate=nan must be finite"),
        (math.inf, 0.0, None, r"rate=inf must be finite"),
    ],
)
def test_a_value_outside_is_refused_with_the_bound(
    value: float, low: float | None, high: float | None, complaint: str
) -> None:
    with pytest.raises(ValueError, match=f"^{complaint}$"):
        require_between("rate", value, low, high)


def test_an_unknown_choice_is_refused_with_the_known_ones() -> None:
    require_choice("band", "X", ("S", "X"))
    with pytest.raises(ValueError, match=r"^band='Q' must be one of S, X$"):
        require_choice("band", "Q", ["S", "X"])


@pytest.mark.parametrize("known", ["monopulse", "hamlib", "easycomm", "Goldstone DSS-13"])
def test_a_name_with_a_letter_left_out_is_refused_with_the_one_that_is_meant(known: str) -> None:
    for place in range(len(known)):
        with pytest.raises(ValueError, match=rf"; did you mean {known}\?$"):
            require_choice("name", (known[:place] + known[place + 1 :]).upper(), [known, "program", "SPID"])


def test_as_finite_array_converts_and_checks_the_shape() -> None:
    array = as_finite_array("position_rad", [[1, 2], [3, 4], [5, 6]], (None, 2))
    assert array.dtype == np.float64
    assert array.tolist() == [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]


@pytest.mark.parametrize("value", [1.0, [1.0], [1.0, 2.0, 3.0], [[1.0, 2.0]]])
def test_another_shape_is_refused_with_both_shapes(value: object) -> None:
    with pytest.raises(ValueError, match=r"^position_rad has shape \(.*\), must be \(2,\)$"):
        as_finite_array("position_rad", value, (2,))


def test_an_open_dimension_is_named_n() -> None:
    with pytest.raises(ValueError, match=r"must be \('n', 2\)$"):
        as_finite_array("position_rad", [1.0, 2.0], (None, 2))


def test_an_array_with_a_bad_element_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^position_rad=.* must be finite$"):
        as_finite_array("position_rad", [1.0, math.nan], (2,))


@pytest.mark.parametrize("bad", NOT_FINITE)
@pytest.mark.parametrize("place", [0, 1])
def test_either_number_of_a_pair_can_refuse_it(bad: float, place: int) -> None:
    pair = [0.5, 0.5]
    pair[place] = bad
    for value in (pair, tuple(pair), np.array(pair)):
        with pytest.raises(ValueError, match=r"^goal=.* must be finite$"):
            as_finite_pair("goal", value)


@pytest.mark.parametrize(
    "value", [(1, 2.5), [1, 2.5], np.array([1.0, 2.5]), np.array([1, 2.5], dtype=np.float32), range(1, 3)]
)
def test_whatever_holds_two_numbers_is_a_pair_of_plain_floats(value: object) -> None:
    pair = as_finite_pair("goal", value)
    assert pair == (1.0, 2.0 if isinstance(value, range) else 2.5)
    assert [type(number) for number in pair] == [float, float]


@pytest.mark.parametrize("size", [1, 15, 16, 17, 200])
def test_a_bad_element_is_found_in_arrays_of_every_size_and_kind(size: int) -> None:
    for kind in (np.float64, np.float32, np.complex128):
        values = np.zeros(size, dtype=kind)
        require_finite("table", values)
        values[size // 2] = math.nan
        with pytest.raises(ValueError, match=r"(?s)^table=.* must be finite$"):
            require_finite("table", values)
    require_finite("count", np.arange(size))
    require_finite("whole", 10**300)
    with pytest.raises(ValueError, match="must be finite"):
        require_finite("whole", 10**400)


NAMES = st.one_of(st.text(), st.text("ab./\\ \n\0-é\u202e"), st.sampled_from(["..", "/etc", "~", "a" * 101, "CON", ""]))


@given(NAMES)
def test_what_may_be_an_id_stays_in_its_folder_and_whatever_is_made_one_may_be_one(text: str) -> None:
    require_id("id", made := id_of(text))
    require_name("name", name_of(text))
    allowed = [made]
    with suppress(ValueError):
        require_id("id", text)
        allowed.append(text)
    for each in allowed:
        path = Path("/folder") / f"{each}-01"
        assert path.resolve() == path
        assert (path.parent, len(path.name.encode()) < 255) == (Path("/folder"), True)


@pytest.mark.parametrize("value", [None, True, "1", [], math.nan, math.inf, 10**400, 1.1e18, -(10**19)])
def test_only_numbers_within_bounds_are_numbers_of_a_table(value: object) -> None:
    assert not is_number(value)
    assert is_number(1e18)
    assert is_number(-3)
