"""The options that several executables share, and what they mean.

A command adds those of `OPTIONS` that it has, with the names of the fields of its request, and
makes the request with `requested`.
"""

import argparse
import os
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from rf_pointing.api.target import ELEMENTS_HELP, FIRST_SATELLITE, Target
from rf_pointing.core import one_of, parse_utc
from rf_pointing.ephemeris.source import unused
from rf_pointing.station.description import DEFAULT_STATION, shipped_stations
from rf_pointing.station.log_lines import say

Made = TypeVar("Made")


def say_if(program: str, text: str) -> None:
    """Report a text that may be empty."""
    if text:
        say(program, text)


def command(program: str, what: str | None) -> argparse.ArgumentParser:
    """Return the parser of a program; a description of several lines is shown as it is written."""
    layout = argparse.RawDescriptionHelpFormatter if what and "\n" in what else argparse.HelpFormatter
    # Short forms of an option would change their meaning with the next one.
    return argparse.ArgumentParser(allow_abbrev=False, prog=program, description=what, formatter_class=layout)


def written(program: str, path: Path | None, write: Callable[[Path], object]) -> None:
    """Write a file where one is wanted, and say which."""
    if path:
        write(path)
        say(program, str(path))


@contextmanager
def ending_with_reason(program: str) -> Iterator[None]:
    """Report a ValueError or OSError in a line, and end the program with exit code 2."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        # A command before `| head` ends as any other; Python must not complain at its end either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ValueError, OSError) as error:
        say(program, str(error), "ERROR")
        sys.exit(2)


def refusing(read: Callable[[str], Any]) -> Callable[[str], Any]:
    """Return an argparse type that refuses with the words of the ValueError of `read`."""

    def parse(text: str) -> Any:
        try:
            return read(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return parse


def between(low: float, high: float) -> Callable[[str], float]:
    """Return an argparse type: a number from `low` to `high`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{text!r} must be a number") from error
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} must be between {low:g} and {high:g}")
        return value

    return parse


def named(choices: Collection[str]) -> Callable[[str], str]:
    """Return an argparse type: one of the choices; a wrong one is refused with the nearest."""

    def parse(text: str) -> str:
        if text not in choices:
            raise argparse.ArgumentTypeError(f"{text!r} must be {one_of(text, choices)}")
        return text

    return parse


def seed(text: str) -> int:
    """Return the seed of a run; an argparse type with the range of the nodes' parameters."""
    # The range of an integer parameter of a node, which would refuse it after everything started.
    if not text.isdecimal() or int(text) >= 2**31:
        raise argparse.ArgumentTypeError(f"{text} must be a whole number from 0 to {2**31 - 1}")
    return int(text)


def _speed(text: str) -> float | str:
    try:
        return text if text == "max" else float(text)
    except ValueError as error:
        raise ValueError(f"speed={text!r} must be a factor or max") from error


def _namespace(text: str) -> str:
    # Executables without a node use the other options where there is no ROS.
    from rclpy.exceptions import InvalidNamespaceException
    from rclpy.validate_namespace import validate_namespace

    name = text if text.startswith("/") else f"/{text}"
    if name == "/":
        raise ValueError(f"{text!r} must name the antenna, as /gs1 does")
    # Without this check ROS itself would refuse the name, later and with a traceback.
    try:
        validate_namespace(name)
    except InvalidNamespaceException as error:
        raise ValueError(f"{text!r} is not a ROS namespace: {str(error).splitlines()[0]}") from error
    return name


OPTIONS: dict[str, dict[str, Any]] = {
    "elements": {
        "metavar": "FILE|DIR|URL", "default": "", "help": f"{ELEMENTS_HELP} (default: verification set of sgp4)",
    },
    "interpolation": {
        "nargs": 2, "metavar": ("METHOD", "DEGREE"), "default": ("", "7"),
        "help": "HERMITE, LAGRANGE or LINEAR, for an OEM that declares none",
    },
    "satellite": {"default": FIRST_SATELLITE, "help": "catalogue number or name (default: 28057, CBERS-2)"},
    "station": {
        "metavar": "FILE|NAME", "default": DEFAULT_STATION,
        "help": f"station description: your file, or {', '.join(shipped_stations())} (default: {DEFAULT_STATION})",
    },
    "band": {"metavar": "NAME", "help": "band of the station (default: the station's)"},
    "start": {
        "dest": "start_s", "metavar": "UTC", "type": refusing(parse_utc),
        "help": "look for passes after this time (default: the elements' epoch)",
    },
    "mask": {
        "dest": "mask_deg", "metavar": "DEG", "type": between(0.0, 89.0),
        "help": "elevation of AOS and LOS (default: the station's)",
    },
    "min-peak": {"dest": "min_peak_deg", "metavar": "MIN_PEAK", "type": between(0.0, 90.0)},
    "speed": {
        "metavar": "SPEED", "type": refusing(_speed),
        "help": "of a simulated antenna: factor of real time, or max (default)",
    },
    "seed": {"type": seed, "help": "of a simulated antenna: seed of every noise source (default: 1)"},
    "reset-fault": {
        "action": "store_true",
        "help": "of a real antenna: reset the fault that an earlier run has latched, after you have looked at the antenna",
    },
    "processes": {
        "type": int, "choices": (1, 2, 8), "default": 2,
        "help": "processes of the nodes: 1, 2 (what moves, and the others) or 8, one for each node (default: 2); a real "
        "drive's control unit always has its own",
    },
    "ephemeris-error": {"dest": "ephemeris_error_s", "metavar": "S", "type": between(-60.0, 60.0)},
    "models": {"metavar": "DIR"},
    "namespace": {
        "type": refusing(_namespace), "default": "/gs1", "help": "namespace of the antenna (default: /gs1)",
    },
    "params-file": {
        "dest": "parameter_files", "metavar": "PARAMS_FILE", "type": Path, "action": "append", "default": [],
        "help": "further ROS parameter file, may be repeated",
    },
    "receiver": {
        "metavar": "ADDRESS", "default": "",
        "help": "receiver in place of the station's, with further keys after ?: "
        "rtl_tcp://localhost:1234?iq.rate_hz=240000; a simulated antenna serves its samples there",
    },
    "output": {"type": Path, "metavar": "DIR"},
}  # fmt: skip
"""Settings of each option; its `dest` is a field of the requests."""


def add_options(parser: argparse.ArgumentParser, names: str, **own: Any) -> None:
    """Add options by their names, in this order; `own` are helps, or further settings."""
    for name in names.split():
        differs = own.get(name.replace("-", "_"), {})
        parser.add_argument(f"--{name}", **OPTIONS[name] | ({"help": differs} if isinstance(differs, str) else differs))


def requested(
    parser: Callable[[], argparse.ArgumentParser], made: Callable[..., Made], argv: list[str] | None = None
) -> Made:
    """Return what is `made` of the options of a command line, `station` and `target` as objects.

    Raises ValueError for a station, a band or an interpolation that does not exist.
    """
    # Imported here: commands without a station do without its libraries.
    from rf_pointing.api.station import Station

    given = vars(parser().parse_args(argv))
    given["station"] = Station(given["station"], given.pop("band"), model=given.pop("bias_model", None))
    if "elements" in given:
        method, degree = given.pop("interpolation", ("", "7"))
        if not degree.isdecimal():
            raise ValueError(f"interpolation={method} {degree!r}: the degree must be a whole number")
        given["target"] = Target(
            location=given.pop("elements"), satellite=given.pop("satellite", ""), interpolation=method.upper(),
            interpolation_degree=int(degree),
        )  # fmt: skip
    return made(**given)


def say_of_elements(target: Target) -> None:
    """Report elements of an address that are old, and those that cannot be used."""
    say_if("elements", target.problem)
    say_if("elements not used", unused(target.location))
