"""Procedures as files: every name known, no cycle, every mistake with its place."""

import math

import pytest

from rf_pointing.operations import Block, Condition, Directive, ExpectedState, read_procedure
from rf_pointing.operations.procedure import LARGEST_FILE

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


def read(block: str, parameters: str = "{az: 10}") -> Block:
    text = f"version: 1\nname: p\nparameters: {parameters}\nblocks:\n  zero: {{}}\n  one: {block}"
    return read_procedure(text, DICTIONARY).blocks["one"]


def test_what_a_block_says_is_what_it_does_and_what_it_does_not_say_is_usual() -> None:
    bare = Block(
        name="one", after=(), before=(), directives=(), then=(), fails=(), window_s=(-math.inf, math.inf),
        timeout_s=60.0, optional=False, skippable=False, timeout_from="",
    )  # fmt: skip
    assert read("{}") == bare
    whole = read(
        "{after: [zero], before: {a.b: 1}, then: {a.c: 2}, fails: {a.d: 3}, window_s: [-300, 20.5], timeout_s: 7,"
        " optional: true, skippable: true, directives: [{send: antenna/park}, {send: antenna/go,"
        " with: {azimuth_deg: '${az}'}, expect: {a.e: 4}, when: {a.f: 5}}]}"
    )

    def one(attribute: str, wanted: int) -> tuple[Condition]:
        return (Condition(attribute=attribute, test="is", wanted=wanted),)

    assert whole == Block(
        name="one", after=("zero",), before=one("a.b", 1), then=one("a.c", 2), fails=one("a.d", 3),
        window_s=(-300.0, 20.5), timeout_s=7.0, optional=True, skippable=True, directives=(
            Directive(name="antenna/park", arguments={}, expected=(), when=()),
            Directive(name="antenna/go", arguments={"azimuth_deg": "${az}"}, expected=one("a.e", 4), when=one("a.f", 5)),
        ),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ("3", "block one must be a mapping, not int"),
        ("{directives: antenna/park}", "one.directives must be a list"),
        ("{directives: {send: antenna/park}}", "one.directives must be a list"),
        ("{directives: [{send: antenna/park}, {with: {}}]}", r"one.directives\[1\]: send='' must be one of"),
        ("{directives: [{send: antenna/go, with: {azimuth_deg: '${el}'}}]}", "azimuth_deg=..el.: el must be one of"),
        ("{directives: [{send: antenna/go, with: [1]}]}", r"one.directives\[0\].with must be a mapping, not list"),
        ("{timeout_s: -1}", "timeout_s=-1 must be > 0 s, or a parameter"),
        ("{timeout_s: '5'}", "timeout_s='5' must be > 0 s, or a parameter"),
        ("{timeout_s: true}", "timeout_s=True must be > 0 s, or a parameter"),
        ("{timeout_s: .inf}", "timeout_s=inf must be > 0 s, or a parameter"),
        ("{timeout_s: '${el}'}", "must be > 0 s, or a parameter"),
        ("{skippable: 1}", "one.skippable=1 must be true or false"),
        ("{window_s: 5}", "window_s=5 must be two times in s"),
        ("{window_s: [1]}", r"window_s=\[1\] must be two times in s"),
        ("{window_s: [1, 2, 3]}", "must be two times in s"),
        ("{window_s: [1, true]}", "must be two times in s"),
        ("{window_s: [1, .inf]}", "must be two times in s"),
        ("{window_s: [1, x]}", "must be two times in s"),
        ("{window_s: [6, 5]}", r"one.window_s=\[6.0, 5.0\]: the first must be < the last"),
        ("{after: [one]}", "wait for each other: one after one"),
        ("{before: 3}", "one.before must map attributes to values"),
        ("{fails: {b: 1}}", "one.fails: 'b' must name device and attribute"),
        ("{speed: 1, aim: 2}", "block one: unknown aim, speed; known are after, before, directives, fails, optional"),
    ],
)
def test_a_block_that_cannot_run_is_refused(block: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read(block)


def test_a_file_of_a_million_characters_is_read() -> None:
    text = "version: 1\nname: p\nblocks: {one: {}}\n#"
    assert LARGEST_FILE == 1_000_000
    assert read_procedure(text + "x" * (LARGEST_FILE - len(text)), DICTIONARY).name == "p"


@pytest.mark.parametrize(
    ("value", "good"), [(5, True), (0.5, True), (0, False), (-2.0, False), (True, False), ("5", False)]
)
def test_a_time_out_may_be_a_parameter_and_is_a_number_before_it_runs(value: object, good: bool) -> None:
    text = (
        "version: 1\nname: p\nparameters: {long: null}\nblocks: {one: {timeout_s: '${long}'}, two: {timeout_s: 0.75}}"
    )
    procedure = read_procedure(text, DICTIONARY)
    assert (procedure.blocks["one"].timeout_s, procedure.blocks["one"].timeout_from) == (60.0, "long")
    if good:
        times = procedure.with_timeouts({"long": value}).blocks
        assert (times["one"].timeout_s, times["two"].timeout_s) == (float(value), 0.75)
    else:
        with pytest.raises(ValueError, match="one.timeout_s=.* must be > 0 s"):
            procedure.with_timeouts({"long": value})


def test_place_holders_become_parameters_before_live_values_and_texts_stay() -> None:
    expected_state = ExpectedState()
    arguments = {"a": "${az}", "b": "${antenna.azimuth}", "c": "x${az}", "d": 3, "e": "${both.b}"}
    directive = Directive(name="go", arguments=arguments, expected=())
    given = {"az": 10, "both.b": "given"}
    with pytest.raises(ValueError, match="^go: b: antenna.azimuth is not known yet$"):
        directive.filled(given, expected_state)
    expected_state.observe("antenna.azimuth", 1.5, 0.0)
    expected_state.observe("both.b", "seen", 0.0)
    assert directive.filled(given, expected_state) == {"a": 10, "b": 1.5, "c": "x${az}", "d": 3, "e": "given"}


def test_unknown_keys_of_a_file_are_named_with_all_that_are_known() -> None:
    with pytest.raises(ValueError, match="^the procedure: unknown a, b; known are blocks, name, parameters, version$"):
        read_procedure("b: 1\na: 2", DICTIONARY)
    with pytest.raises(ValueError, match="^parameters must be a mapping, not list$"):
        read_procedure("version: 1\nname: p\nparameters: [a]\nblocks: {one: {}}", DICTIONARY)
    text = "version: 1\nname: p\nparameters: {a: null, b: null, c: 2}\nblocks: {one: {}}"
    procedure = read_procedure(text, DICTIONARY)
    assert procedure.with_parameters({"a": 1, "b": 3}) == {"a": 1, "b": 3, "c": 2}
    with pytest.raises(ValueError, match="^p has no parameter d, e; it has a, b, c$"):
        procedure.with_parameters({"e": 1, "a": 1, "d": 2})
    with pytest.raises(ValueError, match="^p needs a, b$"):
        procedure.with_parameters({})
