"""Executable `fit_bias_model FILE...`: from recorded data to a model file and a report.

Input: rosbag2 recordings (folder or .mcap), CSV (calibration points, raw tracking data of one pass,
or a table of offsets: utc,target,azimuth_offset_deg,elevation_offset_deg), CCSDS TDM. Raw data of
CSV and TDM need --elements, offsets where a target is a satellite. With --points and --tdm it also
writes the points of the fit as CSV and the raw data as a CCSDS message, for other software.

Exit code 0: the model was fitted; 2: it was not, and nothing was written.
"""

import argparse
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from rf_pointing.api.calibration import ELECTRONS_PER_TECU, DataFiles, fitted, require_raw
from rf_pointing.api.station import Station
from rf_pointing.api.target import ELEMENTS_HELP
from rf_pointing.calibration import TERM_NAMES, Ionosphere, read_model
from rf_pointing.commands.options import add_options, command, ending_with_reason, requested, say_of_elements
from rf_pointing.core import DAY_S, MDEG, RadioRefraction
from rf_pointing.ephemeris.source import read_source
from rf_pointing.station.campaign.offline_fit import FitRequest

FREEZING_K = 273.15


@dataclass(frozen=True, kw_only=True)
class FitCommand:
    """The station, its files, what is fitted, and which files are written."""

    station: Station
    files: DataFiles
    fit: FitRequest
    name: str
    output: Path
    report: Path | None
    points: Path | None
    tdm: Path | None


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command("fit_bias_model", "Fit the pointing model of an antenna.")
    add = parser.add_argument
    add("files", nargs="*", type=Path, metavar="FILE", help="recording, CSV or TDM")
    add_options(parser, "station band")
    add("--namespace", help="antenna, where a recording holds several")
    add_options(parser, "elements", elements=f"{ELEMENTS_HELP}: the targets of CSV and TDM data")
    add("--max-age", type=float, default=14.0, metavar="DAYS", help="of the elements (default: 14)")
    air = parser.add_mutually_exclusive_group()
    air.add_argument("--weather", nargs=3, type=float, metavar=("HPA", "CELSIUS", "PERCENT"), help="pressure, temperature and "
                     "humidity during CSV and TDM data (default: the standard at the station's altitude)")  # fmt: skip
    air.add_argument("--refraction-removed", action="store_true", help="the angles of CSV and TDM data are free of it")
    add("--time-error", type=float, metavar="S", help="time tags of CSV and TDM data are this much late, which is taken off; "
        "0: they are known to be right (default: unknown, and equal lags of both axes are refused)")  # fmt: skip
    add("--ionosphere", nargs=2, type=float, metavar=("TECU", "GHZ"),
        help="vertical electron content and carrier frequency during the raw data (default: no ionosphere)")  # fmt: skip
    add("--largest-error", type=float, metavar="MDEG", help="samples of recordings with a larger "
        "sensed error are left out (default: a tenth of the beam)")  # fmt: skip
    add("--allow-damage", action="store_true", help="use the sound part of damaged recordings")
    add("--start-model", type=Path, metavar="FILE", help="best model known, the prior of every term")
    add("--terms", nargs="+", default=list(TERM_NAMES), metavar="TERM", help="terms to fit (default: all)")
    add("--select", action="store_true", help="choose among the terms by BIC")
    add("--held-out", action="store_true", help="predict each pass by a fit without it")
    add("--form", choices=("printed", "rotation"), default="rotation", help="(default: rotation)")
    add("--robust", action="store_true", help="Huber weights beyond 1.5 sigma instead of squares")
    add("--orbit-prior", type=float, metavar="M", help="orbit error of each pass that the fit allows for, along, "
        "across and radially; 0: none (default: as large as the passes show it)")  # fmt: skip
    add("--sectors", action="store_true", help="take 25 to 30 points of each of the 36 sectors")
    add("--require-full", action="store_true", help="the same, and refuse a sky with empty sectors")
    add("--name", default="", help="version of the model (default: made from the data's time)")
    add("--output", type=Path, default=Path("bias_model.yaml"), help="(default: bias_model.yaml)")
    add("--report", type=Path, metavar="DIR", help="folder of the report (default: next to the output)")
    add("--points", type=Path, metavar="FILE", help="write the points of the fit as CSV too")
    add("--tdm", type=Path, metavar="FILE", help="write the good samples of the raw data as a TDM too")
    return parser


def request_with(**given: Any) -> FitCommand:
    """Return the request of the options; ValueError for a wrong station, model or file."""
    options = argparse.Namespace(**given)
    # argparse gives a list of terms the files that follow it.
    files = [word for word in options.terms if word not in TERM_NAMES and Path(word).exists()]
    options.files += [Path(word) for word in files]
    options.terms = [word for word in options.terms if word not in files]
    if not options.files:
        arguments().error("the following arguments are required: FILE")
    station, location = options.station, options.target.location
    known = read_model(options.start_model) if options.start_model else None
    if known is not None:
        known.check_for(station.name, station.band, known.valid_from_t_s)
    say_of_elements(options.target)
    elements = read_source(location).elements if location else []
    station.description.require_mount("fit_bias_model")
    refraction = air_of(options.weather, removed=options.refraction_removed)
    ionosphere = None
    if options.ionosphere:
        content, frequency_ghz = options.ionosphere
        ionosphere = Ionosphere(electrons_per_m2=content * ELECTRONS_PER_TECU, frequency_hz=1e9 * frequency_ghz)
    files = DataFiles(
        paths=options.files, elements=elements, max_age_s=options.max_age * DAY_S, refraction=refraction,
        time_error_s=options.time_error, ionosphere=ionosphere, namespace=options.namespace,
        largest_error_rad=None if options.largest_error is None else options.largest_error * MDEG,
        allow_damage=options.allow_damage,
    )  # fmt: skip
    request = FitRequest(
        station=station.name, band=station.band, site=station.site, terms=tuple(options.terms), select=options.select,
        held_out=options.held_out, form=options.form, robust=options.robust, orbit_prior_m=options.orbit_prior,
        time_error_s=options.time_error, refraction=refraction, sectors=options.sectors,
        require_full=options.require_full, known=known, elements=elements, mount=station.controller.kinematics,
    )  # fmt: skip
    return FitCommand(
        station=station, files=files, fit=request, name=options.name, output=options.output, report=options.report,
        points=options.points, tdm=options.tdm,
    )  # fmt: skip


request_from = partial(requested, arguments, request_with)
"""Returns the request of a command line; ValueError for a wrong station, model or file."""


def air_of(weather: list[float] | None, *, removed: bool) -> RadioRefraction | Literal["standard"] | None:
    """Return the air through which CSV and TDM data were taken."""
    if weather is None:
        return None if removed else "standard"
    pressure_hpa, celsius, percent = weather
    temperature_k, humidity = celsius + FREEZING_K, percent / 100.0
    return RadioRefraction(pressure_hpa=pressure_hpa, temperature_k=temperature_k, relative_humidity=humidity)


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing fit_bias_model`; files are written after the fit."""
    with ending_with_reason("fit_bias_model"):
        request = request_from(argv)
        # Read once: a recording takes longer than all fits.
        data = request.files.read(request.station)
        if request.tdm:
            require_raw(data, request.tdm)
        found = fitted(request.fit, data, request.name)
        page = found.write(request.output, report=request.report)
        if request.points:
            found.write_points(request.points)
        if request.tdm:
            found.write_tdm(request.tdm)
        print(found)
        print(f"model {request.output}, report {page}")
