"""Procedures as files: every name known, no cycle, every mistake with its place."""

import pytest

from rf_pointing.operations import Condition, Situation, read_procedure

DICTIONARY = {"antenna/park": (), "antenna/go": ("azimuth_deg", "elevation_deg")}
BLOCK = "version: 1\nname: p\nparameters: {az: 10}\nblocks:\n  one: "


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1, 2]", "the procedure must be a mapping"),
        ("a: [", "not YAML"),
        ("version: 2\nname: p\nblocks: {}", "version=2 must be 1"),
        ("version: 1\nname: p\nblocks: {}", "at least one block"),
        ("version: 1\nblocks: {a: {}}", "name='' must say"),
        ("version: 1\nname: p\nspeed: 3\nblocks: {a: {}}", "unknown speed; known are"),
        (BLOCK + "{after: [two]}", "one.after: two must be one of one"),
        (BLOCK + "{after: [two]}\n  two: {after: [one]}", "wait for each other: (one after two|two after one)"),
        (BLOCK + "{directives: [{send: fly}]}", "send='fly' must be one of antenna/go, antenna/park"),
        (BLOCK + "{directives: [{send: antenna/go, with: {speed: 1}}]}", "unknown speed; known are azimuth_deg, elevation_deg"),
        (BLOCK + "{directives: [{send: antenna/go, with: {azimuth_deg: '${el}'}}]}", "el must be one of the parameters az"),
        (BLOCK + "{before: {mode: holding}}", "'mode' must name device and attribute"),
        (BLOCK + "{then: {a.b: {over: 3}}}", "over: must be one of is, is_not, one_of, above, below"),
        (BLOCK + "{then: {a.b: {above: high}}}", "above='high' must be a number"),
        (BLOCK + "{window_s: [5, 5]}", "the first must be < the last"),
        (BLOCK + "{timeout_s: 0}", "timeout_s=0 must be > 0 s"),
        (BLOCK + "{optional: perhaps}", "optional='perhaps' must be true or false"),
        ("a: &x [1]\nb: *x", "must be written out"),
        ("x" * 1_000_001, "must have <= 1000000"),
    ],
)  # fmt: skip
def test_mistake_in_a_file_is_refused_with_its_place(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_procedure(text, DICTIONARY)


def test_parameters_are_checked_against_those_of_the_file() -> None:
    procedure = read_procedure("version: 1\nname: p\nparameters: {a: null, b: 2}\nblocks: {one: {}}", DICTIONARY)
    assert procedure.with_parameters({"a": 1}) == {"a": 1, "b": 2}
    with pytest.raises(ValueError, match="p needs a"):
        procedure.with_parameters({})
    with pytest.raises(ValueError, match="has no parameter c; it has a, b"):
        procedure.with_parameters({"a": 1, "c": 3})


@pytest.mark.parametrize(
    ("test", "wanted", "good", "bad"),
    [
        ("is", "parked", ["parked"], ["stowed", ""]),
        ("is_not", "fault", ["holding"], ["fault"]),
        ("one_of", ("a", "b"), ["a", "b"], ["c"]),
        ("above", 3.0, [3.1, 4], [3.0, float("nan"), "5", True]),
        ("below", 3.0, [2.9, -1], [3.0, float("nan"), "1", False]),
    ],
)
def test_conditions_hold_for_what_they_name_and_nothing_else(test: str, wanted: object, good: list, bad: list) -> None:
    condition = Condition(attribute="a.b", test=test, wanted=wanted)
    assert all(condition.holds(value) for value in good)
    assert not any(condition.holds(value) for value in bad)


def test_old_values_and_late_messages_do_not_count() -> None:
    situation, condition = Situation(), Condition(attribute="a.b", test="is", wanted=1, max_age_s=2.0)
    situation.expect(condition, 0.0)
    assert situation.differences(0.0) == {"a.b": "a.b is unknown, must be: a.b is 1"}
    situation.observe("a.b", 1, 10.0)
    situation.observe("a.b", 0, 9.0)
    assert not situation.differences(11.0)
    assert situation.differences(12.5) == {"a.b": "a.b is 2.5 s old, must be <= 2 s"}
    assert "since the directive" in situation.against(condition, 11.0, since_s=10.5)
