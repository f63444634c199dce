"""The options that several executables share, and the argparse types of their numbers."""

import argparse
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager

from rf_pointing.api.target import Target
from rf_pointing.core.checks import one_of
from rf_pointing.ephemeris.source import unused
from rf_pointing.station.description import DEFAULT_STATION, shipped_stations
from rf_pointing.station.log_lines import say


def say_if(program: str, text: str) -> None:
    """Report a text that may be empty."""
    if text:
        say(program, text)


@contextmanager
def ending_with_reason(program: str) -> Iterator[None]:
    """Report a ValueError or OSError in a line, and end the program with exit code 2."""
    try:
        yield
    except (ValueError, OSError) as error:
        say(program, str(error), "ERROR")
        sys.exit(2)


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


def add_namespace_option(parser: argparse.ArgumentParser) -> None:
    """Add --namespace to a command line; its first slash may be omitted."""
    parser.add_argument("--namespace", type=_namespace, default="/gs1", help="namespace of the antenna (default: /gs1)")


def _namespace(text: str) -> str:
    # Executables without a node use the other options where there is no ROS.
    from rclpy.exceptions import InvalidNamespaceException
    from rclpy.validate_namespace import validate_namespace

    name = text if text.startswith("/") else f"/{text}"
    if name == "/":
        raise argparse.ArgumentTypeError(f"{text!r} must name the antenna, as /gs1 does")
    # Without this check ROS itself would refuse the name, later and with a traceback.
    try:
        validate_namespace(name)
    except InvalidNamespaceException as error:
        reason = str(error).splitlines()[0]
        raise argparse.ArgumentTypeError(f"{text!r} is not a ROS namespace: {reason}") from error
    return name


def target_from(location: str, satellite: str, interpolation: Sequence[str] = ("", "7")) -> Target:
    """Return what --elements, --satellite and --interpolation name; say if an address failed.

    Raises ValueError for a degree that is not a whole number, and for an address without elements.
    """
    method, degree = interpolation_of(interpolation)
    target = Target(location=location, satellite=satellite, interpolation=method, interpolation_degree=degree)
    say_if("elements", target.problem)
    say_if("elements not used", unused(location))
    return target


def interpolation_of(words: Sequence[str]) -> tuple[str, int]:
    """Return method and degree of --interpolation."""
    method, degree = words
    if not degree.isdecimal():
        raise ValueError(f"interpolation={method} {degree!r}: the degree must be a whole number")
    return method.upper(), int(degree)


ELEMENTS_HELP = "elements: a file, a folder, or an http(s) address, which is requested at most every 2 h"


def add_station_options(parser: argparse.ArgumentParser) -> None:
    """Add --station and --band to a command line."""
    add = parser.add_argument
    add("--station", metavar="FILE|NAME", default=DEFAULT_STATION,
        help=f"station description: your file, or {', '.join(shipped_stations())} (default: {DEFAULT_STATION})")  # fmt: skip
    add("--band", metavar="NAME", help="band of the station (default: the station's)")


def add_target_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of station, satellite, start and mask to a command line."""
    add = parser.add_argument
    add("--elements", metavar="FILE|DIR|URL", default="", help=f"{ELEMENTS_HELP} (default: verification set of sgp4)")
    add("--interpolation", nargs=2, metavar=("METHOD", "DEGREE"), default=("", "7"),
        help="HERMITE, LAGRANGE or LINEAR, for an OEM that declares none")  # fmt: skip
    add("--satellite", default="28057", help="catalogue number or name (default: 28057, CBERS-2)")
    add_station_options(parser)
    add("--start", metavar="UTC", help="look for passes after this time (default: the elements' epoch)")
    add("--mask", type=between(0.0, 89.0), metavar="DEG",
        help="elevation of AOS and LOS (default: the station's)")  # fmt: skip
