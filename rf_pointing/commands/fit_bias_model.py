"""Executable `fit_bias_model FILE...`: from recorded data to a model file and a report.

Input: rosbag2 recordings (folder or .mcap), CSV (calibration points, or raw tracking data of one
pass), CCSDS TDM. Raw data of CSV and TDM need --elements.  With --points and --tdm it also writes
the points of the fit as CSV and the raw data as a CCSDS message, for other software.

Exit code 0: the model was fitted; 2: it was not, and nothing was written.
"""

import argparse
import time
from pathlib import Path
from typing import Literal

import numpy as np

from rf_pointing import __version__, calibration
from rf_pointing.calibration import (
    BiasModel,
    FitResult,
    ModelVersion,
    Observations,
    PassPriors,
    SectorRule,
    StageReport,
)
from rf_pointing.commands.options import (
    ELEMENTS_HELP,
    add_station_options,
    band_of,
    elements_of,
    ending_with_reason,
    station_of,
)
from rf_pointing.core import MDEG
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris.source import read_source
from rf_pointing.station.campaign import recorded_input
from rf_pointing.station.campaign.log import priors_near

Pass = tuple[calibration.RawTracking, calibration.ReferenceTrack]

DAY_S = 86400.0
FREEZING_K = 273.15
ELECTRONS_PER_TECU = 1e16
TABULAR = (".csv", ".tdm", ".kvn", ".txt")


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    parser = argparse.ArgumentParser(prog="fit_bias_model", description="Fit the pointing model of an antenna.")
    add = parser.add_argument
    add("files", nargs="+", type=Path, metavar="FILE", help="recording, CSV or TDM")
    add_station_options(parser)
    add("--namespace", help="antenna, where a recording holds several")
    add("--elements", metavar="FILE|DIR|URL", default="", help=f"{ELEMENTS_HELP}: the targets of CSV and TDM data")
    add("--max-age", type=float, default=14.0, metavar="DAYS", help="of the elements (default: 14)")
    air = parser.add_mutually_exclusive_group()
    air.add_argument("--weather", nargs=3, type=float, metavar=("HPA", "CELSIUS", "PERCENT"), help="pressure, temperature and "
                     "humidity during CSV and TDM data (default: the standard at the station's altitude)")  # fmt: skip
    air.add_argument("--refraction-removed", action="store_true", help="the angles of CSV and TDM data are free of it")
    add("--ionosphere", nargs=2, type=float, metavar=("TECU", "GHZ"),
        help="vertical electron content and carrier frequency during the raw data (default: no ionosphere)")  # fmt: skip
    add("--largest-error", type=float, default=6.0, metavar="MDEG",
        help="samples of recordings with a larger sensed error are left out (default: 6)")  # fmt: skip
    add("--allow-damage", action="store_true", help="use the sound part of damaged recordings")
    add("--start-model", type=Path, metavar="FILE", help="best model known, the prior of every term")
    add("--terms", nargs="+", default=list(calibration.TERM_NAMES), metavar="TERM", help="terms to fit (default: all)")
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
    return parser.parse_args(argv)


def read_files(options: argparse.Namespace) -> tuple[Observations | None, list[Pass]]:
    """Return the calibration points of all files (None without any), and the raw passes."""
    tables = [path for path in options.files if path.is_file() and path.suffix in TABULAR]
    of_points = [path for path in tables if path.suffix == ".csv" and recorded_input.holds_points(path)]
    points = recorded_input.read_points(of_points)
    raw = [one for path in tables if path not in of_points for one in recorded_input.read_raw(path, band_of(options))]
    passes = [(one, _reference(options, one)) for one in raw]
    for path in options.files:
        if path not in tables:
            passes += _recorded(options, path)
    return points, passes


def collected(
    options: argparse.Namespace, points: Observations | None, passes: list[Pass], model: BiasModel
) -> tuple[Observations, list[StageReport], list[str]]:
    """Return all points, the reports of the pipeline, and which raw passes gave none."""
    parts = [points] if points is not None else []
    stages: list[StageReport] = []
    notes: list[str] = []
    if passes:
        first = int(np.max(points.pass_id)) + 1 if points is not None else 0
        made, stages, notes = recorded_input.process_passes(passes, model, first, ionosphere(options))
        parts += made
    together = Observations.concatenate(parts)
    for name in ("station", "band"):
        found, wanted = getattr(together, name), getattr(options, name)
        if found != wanted:
            raise ValueError(f"the data are of {name} {found!r}, must be of {wanted!r}")
    if options.sectors or options.require_full:
        full = options.require_full
        together, _, selection = calibration.select_observations([together], SectorRule(), require_full=full)
        stages.append(selection)
    return together, stages, notes


def _reference(options: argparse.Namespace, raw: calibration.RawTracking) -> calibration.ReferenceTrack:
    if not options.elements:
        raise ValueError("elements: tracking data of CSV and TDM need --elements FILE for their reference")
    elements = read_source(elements_of(options)).elements
    oldest_s = options.max_age * DAY_S
    return recorded_input.reference_of(raw, elements, station_of(options).site, oldest_s, refraction(options))


def refraction(options: argparse.Namespace) -> RadioRefraction | Literal["standard"] | None:
    """Return the air through which CSV and TDM data were taken."""
    if options.weather is None:
        return None if options.refraction_removed else "standard"
    pressure_hpa, celsius, percent = options.weather
    temperature_k, humidity = celsius + FREEZING_K, percent / 100.0
    return RadioRefraction(pressure_hpa=pressure_hpa, temperature_k=temperature_k, relative_humidity=humidity)


def ionosphere(options: argparse.Namespace) -> calibration.Ionosphere | None:
    """Return the ionosphere through which raw data were taken."""
    if options.ionosphere is None:
        return None
    content, frequency_ghz = options.ionosphere
    return calibration.Ionosphere(electrons_per_m2=content * ELECTRONS_PER_TECU, frequency_hz=1e9 * frequency_ghz)


def _recorded(options: argparse.Namespace, path: Path) -> list[Pass]:
    # Reading a recording loads a ROS message library, which CSV and TDM do without.
    from rf_pointing.report.tracking_from_bag import tracking_from_bag

    return tracking_from_bag(
        path, station_of(options).name, band_of(options), namespace=options.namespace,
        largest_error_rad=options.largest_error * MDEG, allow_damage=options.allow_damage,
    )  # fmt: skip


def orbit_priors(options: argparse.Namespace, points: Observations, present: ModelVersion | None) -> PassPriors | None:
    """Return the orbit errors that the fit allows for: as given, or as the passes show them."""
    if options.orbit_prior is not None:
        return PassPriors.of_orbit(options.orbit_prior)
    # Without ranges a displacement in metres is no angle.
    if points.range_m is None or points.range_rate_m_s is None:
        return None
    return calibration.measured_pass_priors(
        lambda priors: fit_of(options, points, present, tuple(options.terms), priors)
    )


def orbit_remarks(options: argparse.Namespace, result: FitResult) -> list[str]:
    """Return which errors of the orbit the sigma of `result` allows for."""
    if result.pass_priors is not None:
        sizes = ", ".join(
            f"{size:.0f} m {name.removesuffix('_m').replace('_', '-')}"
            for name, size in zip(result.pass_priors.names, result.pass_priors.sigma.tolist(), strict=True)
        )
        measured = " as the passes show them" if options.orbit_prior is None else ""
        return [f"sigma allows for orbit errors of {sizes} in each pass{measured}"]
    if options.orbit_prior is None:
        return ["sigma is that of an exact reference: without range and range rate orbit errors cannot be estimated"]
    return []


def choice_remarks(options: argparse.Namespace, result: FitResult) -> list[str]:
    """Return which of the offered terms the data support, and which not."""
    if not options.select:
        return []
    rest = [name for name in options.terms if name not in result.names]
    return [f"chosen by BIC: {', '.join(result.names)}; not supported by the data, zero: {', '.join(rest) or 'none'}"]


def prediction_remarks(options: argparse.Namespace, points: Observations, result: FitResult) -> list[str]:
    """Return how well fits without a pass predict it, with the result's terms and with all."""
    if not options.held_out:
        return []
    if len(points.passes) < 4:
        raise ValueError(f"passes={len(points.passes)} must be >= 4 to hold one out and fit the others")
    remarks = []
    for words, names in (("these terms", result.names), ("all terms offered", tuple(options.terms))):
        held = {name: value for name, value in result.coefficients.items() if name not in names}
        if words == "these terms" or set(names) != set(result.names):
            one = calibration.held_out_passes(points, names, held=held, pass_priors=result.pass_priors)
            worst = int(np.argmax(one.rms_rad))
            remarks.append(
                f"passes held out are predicted to {one.total_rms_rad / MDEG:.2f} mdeg rms with {words}, the worst "
                f"({one.pass_ids[worst]}) to {one.rms_rad[worst] / MDEG:.2f} mdeg"
            )
    return remarks


def fitted(options: argparse.Namespace, points: Observations, present: ModelVersion | None) -> FitResult:
    """Return the fit of the chosen terms."""
    names, orbit = tuple(options.terms), orbit_priors(options, points, present)
    # Selection looks at the printed form, which is linear: all subsets come from one triangle.
    if options.select:
        held = {name: value for name, value in _known(present).items() if name not in names}
        names = calibration.select_terms(points, names, held=held, pass_priors=orbit)
    return fit_of(options, points, present, names, orbit)


def fit_of(
    options: argparse.Namespace,
    points: Observations,
    present: ModelVersion | None,
    names: tuple[str, ...],
    orbit: PassPriors | None,
) -> FitResult:
    """Return the fit of `names`, the others held at the present model's values."""
    known = _known(present)
    base = BiasModel.zero().replace(**dict.fromkeys(options.terms, 0.0) | known)
    return calibration.fit_bias_model(
        points,
        terms=names,
        # A term that was offered and not chosen is zero; one that was not offered keeps its known
        # value.
        held={name: 0.0 if name in options.terms else value for name, value in base.coefficients.items() if name not in names},
        priors=priors_near(base, names) if present else None,
        pass_priors=orbit,
        options=calibration.FitOptions(
            form=options.form, scale_covariance=True,
            huber_sigma=1.5 if options.robust else 0.0, edit_sigma=0.0 if options.robust else 3.0,
        ),
    )  # fmt: skip


def _known(present: ModelVersion | None) -> dict[str, float]:
    return dict(present.model.coefficients) if present else dict.fromkeys(calibration.TERM_NAMES, 0.0)


def run(options: argparse.Namespace) -> list[str]:
    """Read, fit, write model and report; return the lines that describe the result.

    Nothing is written before the fit has succeeded.
    """
    from rf_pointing.report.calibration_report import write_calibration_report

    present = calibration.read_model(options.start_model) if options.start_model else None
    if present is not None:
        present.check_for(station_of(options).name, band_of(options), present.valid_from_t_s)
    # Read once: a recording takes longer than all fits.
    files = read_files(options)
    if options.tdm and not files[1]:
        raise ValueError(f"tdm={options.tdm}: the files hold calibration points only, no raw data to write")
    points, stages, notes = collected(options, *files, present.model if present else BiasModel.zero())
    result = fitted(options, points, present)
    if stages:
        # The pipeline fits parabolas to what the model leaves over: with the first fit, high passes
        # come back.
        points, stages, notes = collected(options, *files, result.model)
        result = fitted(options, points, present)
    remarks = [
        *choice_remarks(options, result),
        *orbit_remarks(options, result),
        *prediction_remarks(options, points, result),
    ]
    name, software, now_s = options.name or f"fit-{result.last_t_s:.0f}", f"rf_pointing {__version__}", time.time()
    model = ModelVersion.from_fit(result, name=name, software=software, created_t_s=now_s)
    calibration.write_model(options.output, model)
    if options.points:
        calibration.write_observations(options.points, points)
    if options.tdm:
        calibration.write_tdm(options.tdm, [raw for raw, _ in files[1]], originator=software, created_t_s=now_s)
    folder = options.report or options.output.parent / f"{options.output.stem}_report"
    report = write_calibration_report(folder, points, result, name=name, stages=stages, notes=notes, remarks=remarks)
    return [
        summary(points, result),
        *remarks,
        *(f"not separable: {advice}" for advice in result.separation_advice()),
        *(f"doubtful: {doubt}" for doubt in calibration.doubts_of(result, points)),
        *(f"left out: {note}" for note in notes),
        f"model {options.output}, report {report}",
    ]


def summary(points: Observations, result: FitResult) -> str:
    """Return the outcome in one line."""
    rms = [value / MDEG for value in result.rms_rad()]
    used = points.select(result.used)
    rule = SectorRule()
    full = rule.count - len(rule.coverage(used.true_azimuth_rad, used.true_elevation_rad).thin)
    return (
        f"{len(used)} observations of {result.passes} passes, {len(result.rejected)} edited out; residual rms {rms[0]:.2f} "
        f"mdeg cross-elevation, {rms[1]:.2f} mdeg elevation; condition {result.condition:.0f}; {full} of {rule.count} "
        f"sectors have {rule.fewest} observations"
    )


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing fit_bias_model`."""
    options = arguments(argv)
    with ending_with_reason("fit_bias_model"):
        print("\n".join(run(options)))
