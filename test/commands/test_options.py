"""The options that the commands share: their ranges, what they mean, and how a command ends."""

import argparse
import math

import pytest

from rf_pointing.commands import options
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import fetching, find_elements, verification_elements


def target_of(*line: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    options.add_target_options(parser)
    return parser.parse_args(line)


def namespace_of(text: str) -> str:
    parser = argparse.ArgumentParser()
    options.add_namespace_option(parser)
    return str(parser.parse_args(["--namespace", text]).namespace)


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


@pytest.mark.parametrize(("text", "value"), [("-2", -2.0), ("5", 5.0), ("0.5", 0.5)])
def test_a_number_within_its_range_is_taken(text: str, value: float) -> None:
    assert options.between(-2.0, 5.0)(text) == value


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("-2.1", "-2.1 must be between -2 and 5"), ("5.1", "between -2 and 5"), ("nan", "between"), ("x", "a number")],
)
def test_a_number_beyond_its_range_is_refused(text: str, complaint: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=complaint):
        options.between(-2.0, 5.0)(text)


def test_a_seed_is_a_parameter_of_a_node() -> None:
    assert [options.seed(text) for text in ("0", "7", "2147483647")] == [0, 7, 2**31 - 1]
    for text in ("2147483648", "-1", "1.5", "x"):
        with pytest.raises(argparse.ArgumentTypeError, match=f"{text} must be a whole number from 0 to 2147483647"):
            options.seed(text)


@pytest.mark.parametrize(("text", "name"), [("/gs1", "/gs1"), ("gs2", "/gs2"), ("/north/gs1", "/north/gs1")])
def test_the_first_slash_of_a_namespace_may_be_left_out(text: str, name: str) -> None:
    assert namespace_of(text) == name


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("/", "'/' must name the antenna, as /gs1 does"), ("a b", "'a b' is no ROS namespace: Invalid namespace")],
)
def test_a_namespace_without_a_name_is_refused(text: str, complaint: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        namespace_of(text)
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err


def test_an_address_is_fetched_and_a_file_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    fetched: list[str] = []
    monkeypatch.setattr(fetching, "current_elements", lambda address: fetched.append(address) or "")
    for name in ("https://celestrak.org/x", "sky.tle", ""):
        assert options.elements_of(argparse.Namespace(elements=name)) == name
    assert fetched == ["https://celestrak.org/x"]


def test_the_band_is_the_stations_unless_another_is_named() -> None:
    assert options.band_of(target_of()) == "X"
    assert options.band_of(target_of("--band", "Ka")) == "Ka"
    with pytest.raises(ValueError, match="band='L' of Goldstone DSS-13 must be one of S, X, Ka"):
        options.band_of(target_of("--band", "L"))


@pytest.mark.parametrize(("line", "lowest_deg"), [([], 5.0), (["--mask", "0"], 0.0), (["--mask", "89"], 89.0)])
def test_passes_begin_at_the_mask_of_the_station_or_of_the_user(line: list[str], lowest_deg: float) -> None:
    assert math.degrees(options.lowest_rad(target_of(*line))) == pytest.approx(lowest_deg)


@pytest.mark.parametrize("mask", ["-0.1", "89.1"])
def test_a_mask_is_between_the_horizon_and_the_zenith(mask: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        target_of("--mask", mask)
    assert f"{mask} must be between 0 and 89" in capsys.readouterr().err


def test_the_target_is_cbers_2_seen_from_the_station() -> None:
    source = options.source_of(target_of())
    assert (source.satellite, source.elements, source.interpolation) == ("28057", "", "")
    assert source.interpolation_degree == 7
    assert math.degrees(source.site.latitude_rad) == pytest.approx(35.24716, abs=1e-5)
    other = options.source_of(target_of("--interpolation", "lagrange", "5", "--satellite", "MY BIRD"))
    assert (other.satellite, other.interpolation, other.interpolation_degree) == ("MY BIRD", "LAGRANGE", 5)
    with pytest.raises(ValueError, match="interpolation=HERMITE 'x': the degree must be a whole number"):
        options.source_of(target_of("--interpolation", "HERMITE", "x"))


def test_passes_are_looked_for_from_the_epoch_of_the_elements_or_a_start() -> None:
    epoch_t_s = find_elements(verification_elements(), "28057").epoch_t_s
    assert options.start_of(target_of()) == pytest.approx(epoch_t_s)
    assert options.start_of(target_of("--start", "2006-06-27T06:00:00")) == parse_utc("2006-06-27T06:00:00")
