"""Conditions and values: what satisfies a test, what is refused in a file, and which value is the newest."""

import math

import pytest

from rf_pointing.operations.expected_state import OLDEST_S, Condition, ExpectedState, read_conditions


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("parked", ["antenna mode must be parked"]),
        (True, ["antenna mode must be yes"]),
        ({"is_not": ""}, ["antenna mode must not be none"]),
        ({"one_of": ["parked", ""]}, ["antenna mode must be parked or none"]),
        ({"above": 3, "below": 4.5}, ["antenna mode must be above 3", "antenna mode must be below 4.5"]),
    ],
)
def test_a_condition_says_in_words_what_it_tests(given: object, words: list[str]) -> None:
    assert [str(each) for each in read_conditions("x", {"antenna.mode": given})] == words


def test_what_a_file_says_is_what_is_tested() -> None:
    read = read_conditions("x", {"a.b": {"one_of": [1, 2], "max_age_s": 0.5}, "a.c.d": {"below": 2}, 7.5: True})
    assert read == (
        Condition(attribute="a.b", test="one_of", wanted=(1, 2), max_age_s=0.5),
        Condition(attribute="a.c.d", test="below", wanted=2, max_age_s=OLDEST_S),
        Condition(attribute="7.5", test="is", wanted=True, max_age_s=10.0),
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["a.b"], "^x must map attributes to values"),
        ({".b": 1}, "x: '.b' must name device and attribute"),
        ({"a.": 1}, "x: 'a.' must name device and attribute"),
        ({"a.b": {"is": 1, "max_age_s": 0.0}}, "max_age_s=0.0 must be > 0 s"),
        ({"a.b": {"is": 1, "max_age_s": -1}}, "max_age_s=-1 must be > 0 s"),
        ({"a.b": {"is": 1, "max_age_s": math.inf}}, "max_age_s=inf must be > 0 s"),
        ({"a.b": {"is": 1, "max_age_s": "5"}}, "max_age_s='5' must be > 0 s"),
        ({"a.b": {}}, "x: a.b: no test: must be one of is"),
        ({"a.b": {"max_age_s": 5}}, "x: a.b: no test: must be one of is"),
        ({"a.b": {"is": 1, "over": 2, "beside": 3}}, "x: a.b: beside, over: must be one of is"),
        ({"a.b": {"above": True}}, "above=True must be a number"),
        ({"a.b": {"below": "3"}}, "below='3' must be a number"),
        ({"a.b": {"one_of": "ab"}}, "one_of='ab' must be a list"),
    ],
)
def test_a_condition_that_cannot_be_tested_is_refused_with_its_place(given: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_conditions("x", given)


@pytest.mark.parametrize(
    ("test", "wanted", "value", "good"),
    [
        ("is", 1, 1, True), ("is", 1, 2, False), ("is_not", 1, 1, False), ("is_not", 1, 2, True),
        ("one_of", (1, 2), 2, True), ("one_of", (1, 2), 3, False), ("is", (1, 2), 1, False),
        ("above", 3, 3, False), ("above", 3, 3.5, True), ("below", 3, 3, False), ("below", 3, 2.5, True),
        ("above", 0, True, False), ("below", 2, True, False), ("above", 0, None, False), ("below", 0, "x", False),
        ("above", 3, math.nan, False), ("below", 3, math.nan, False),
    ],
)  # fmt: skip
def test_a_value_satisfies_a_test_or_does_not(test: str, wanted: object, value: object, good: bool) -> None:
    assert Condition(attribute="a.b", test=test, wanted=wanted).holds(value) is good


def test_the_newest_stamp_counts_and_of_one_stamp_the_last_value() -> None:
    expected_state = ExpectedState()
    assert expected_state.actual("a.b") is None
    for value, t_s in ((1, 5.0), (2, 5.0), (3, 4.9)):
        expected_state.observe("a.b", value, t_s)
    seen = expected_state.actual("a.b")
    assert (seen.value, seen.t_s) == (2, 5.0)
    assert {name: each.value for name, each in expected_state.attributes().items()} == {"a.b": 2}
    assert (expected_state.value("a.b"), expected_state.value("c.d")) == (2, None)
    fresh = [
        expected_state.is_fresh(name, 10.0, oldest_s) for name, oldest_s in (("a.b", 5.0), ("a.b", 4.9), ("c.d", 99.0))
    ]
    assert fresh == [True, False, False]


def test_a_value_counts_from_the_directive_on_and_up_to_its_age() -> None:
    expected_state, condition = ExpectedState(), Condition(attribute="a.b", test="is", wanted=1, max_age_s=2.0)
    expected_state.observe("a.b", 1, 10.0)
    assert expected_state.reason_not_met(condition, 12.0, since_s=10.0) == ""
    assert expected_state.reason_not_met(condition, 12.25) == "a b is 2.2 s old, must be <= 2 s"
    assert (
        expected_state.reason_not_met(condition, 11.0, 10.25)
        == "a b has not been reported since the directive, must be 1"
    )
    assert (
        expected_state.reason_not_met(Condition(attribute="a.b", test="is", wanted=""), 11.0)
        == "a b is 1, must be none"
    )


def test_the_present_value_is_shown_in_words() -> None:
    expected_state = ExpectedState()
    condition = Condition(attribute="a.b", test="is", wanted=1)
    assert expected_state.shown(condition) == "a b is unknown"
    expected_state.observe("a.b", "", 1.0)
    assert expected_state.shown(condition) == "a b is none"
    expected_state.observe("a.b", "no", 2.0)
    assert expected_state.shown(condition) == "a b is no"
