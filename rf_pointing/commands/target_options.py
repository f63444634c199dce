"""The options that name a satellite, a station and a time, alike for all commands."""

import argparse

from rf_pointing.commands.number_option import between
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris.source import SourceParams, first_time_s

__all__ = ["add_target_options", "source_of", "start_of"]


def add_target_options(parser: argparse.ArgumentParser) -> None:
    """Add --elements, --interpolation, --satellite, --station, --start and --mask."""
    parser.add_argument("--elements", metavar="FILE", default="", help="elements (default: verification set of sgp4)")
    parser.add_argument("--interpolation", nargs=2, metavar=("METHOD", "DEGREE"), default=("", "7"), help="HERMITE, LAGRANGE "
                        "or LINEAR, for an OEM that declares none")  # fmt: skip
    parser.add_argument("--satellite", default="28057", help="catalogue number or name (default: 28057, CBERS-2)")
    parser.add_argument("--station", default="Goldstone DSS-13", help="station name (default: Goldstone DSS-13)")
    parser.add_argument("--start", metavar="UTC", help="look for passes after this time (default: the elements' epoch)")
    parser.add_argument(
        "--mask", type=between(0.0, 89.0), default=5.0, help="elevation of AOS and LOS in deg (default: 5)"
    )


def source_of(options: argparse.Namespace) -> SourceParams:
    """Return the satellite and the station."""
    method, degree = options.interpolation
    if not degree.isdecimal():
        raise ValueError(f"interpolation={method} {degree!r}: the degree must be a whole number")
    return SourceParams(
        elements_file=options.elements, satellite=options.satellite, station=options.station,
        interpolation=method.upper(), interpolation_degree=int(degree),
    )  # fmt: skip


def start_of(options: argparse.Namespace) -> float:
    """Return the time after which passes are looked for, UTC in s since 1970."""
    return parse_utc(options.start) if options.start else first_time_s(source_of(options))
