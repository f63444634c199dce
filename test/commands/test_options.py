"""The options that the commands share: their ranges, what they mean, and how a command ends."""

import argparse
from typing import Any

import pytest

from rf_pointing.api.target import Target
from rf_pointing.commands import options


def parsed(names: str, *line: str) -> dict[str, Any]:
    def parser() -> argparse.ArgumentParser:
        made = argparse.ArgumentParser()
        options.add_options(made, names)
        return made

    return options.requested(parser, dict, list(line))


def test_a_text_is_reported_and_an_empty_one_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    options.say_if("track", "")
    options.say_if("track", "the elements are old")
    assert capsys.readouterr() == ("", "track: the elements are old\n")


@pytest.mark.parametrize("error", [ValueError("mask=95 must be <= 89"), OSError("no such file: a.csv")])
def test_what_is_wrong_ends_a_command_with_2_and_the_reason(
    error: Exception, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended, options.ending_with_reason("track"):
        raise error
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"track: {error}\n"


def test_a_fault_of_the_program_is_no_reason() -> None:
    with pytest.raises(KeyError), options.ending_with_reason("track"):
        raise KeyError("mask")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("-2.1", "-2.1 must be between -2 and 5"), ("5.1", "between -2 and 5"), ("nan", "between"), ("x", "a number")],
)
def test_a_number_beyond_its_range_is_refused(text: str, complaint: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=complaint):
        options.between(-2.0, 5.0)(text)


def test_a_target_is_what_the_options_name() -> None:
    names = "station band elements satellite interpolation"
    assert parsed(names)["target"] == Target()
    line = ["--satellite", "BIRD", "--elements", "a.tle", "--interpolation", "lagrange", "5"]
    wanted = Target(satellite="BIRD", location="a.tle", interpolation="LAGRANGE", interpolation_degree=5)
    assert parsed(names, *line)["target"] == wanted
