"""Executable `check_station`: what is wrong in a station description, or what follows from it.

Prints every problem with file, line, name, value and bound; without any, what the description
gives, what was derived from it with the formula, and what a user should know.  `--urdf` prints the
antenna's URDF instead.  Exit code 0: it can be used; 2: it cannot.
"""

import argparse
import math
import sys
from collections.abc import Iterable

from rf_pointing.commands.options import command, ending_with_reason
from rf_pointing.core import MDEG, Value, parameter_unit
from rf_pointing.station.derive.band import Band
from rf_pointing.station.derive.nodes import described_parameters
from rf_pointing.station.derive.plants import FIRST_LOOP
from rf_pointing.station.description import StationDescription, read_station, shipped_stations
from rf_pointing.station.description.remarks import remarks
from rf_pointing.station.description.urdf import urdf

WIDE = 84


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    parser = command("check_station", "Check a station description.")
    add = parser.add_argument
    add("station", metavar="STATION", help=f"file, or one of {', '.join(shipped_stations())}")
    add("--band", help="band whose derived values are printed (default: the station's)")
    add(
        "--all",
        action="store_true",
        help="print the simulated plant and its loops as well, and the nodes of each value",
    )
    add("--urdf", action="store_true", help="print the antenna as a URDF, for robot_state_publisher and viewers")
    return parser.parse_args(argv)


def report(station: StationDescription, band: str, everything: bool) -> Iterable[str]:
    """Yield the lines of the report."""
    site = station.site
    yield f"{station.name}: {station.path}, digest {station.digest}"
    yield (
        f"site      {math.degrees(site.latitude_rad):.5f} deg north, {math.degrees(site.longitude_rad):.5f} deg east, "
        f"{site.altitude_m:g} m"
    )
    for name in station.bands:
        section, numbers = station.content.bands[name], Band(station.content, name)
        default = " (default)" if name == station.default_band else ""
        model = station.bias_model_file(name)
        sensors = ", ".join(station.sensors(name)) or "program track alone"
        yield (
            f"band {name:<4} {section.frequency_mhz:g} MHz, half-power beamwidth {numbers.beamwidth_deg:.4g} deg, tracks with "
            f"{sensors}, bias model {model.name if model else 'none'}{default}"
        )
    values, nodes = station.values(band), described_parameters()
    yield f"\nderived for band {band}:"
    shown: set[str] = set()
    for name, given in sorted(values.items()):
        # The first loops of a device are what its first motion depends on.
        simulated = FIRST_LOOP not in given.formula and name.startswith(
            ("plant.", "loops.azimuth.", "loops.elevation.", "loops.lqg_")
        )
        if FIRST_LOOP in given.formula and not name.endswith(("proportional_gain", "integral_gain")) and not everything:
            continue
        # Several parameters that one key gives are one number to the user.
        title = name if everything or given.key.startswith(("tuning.", f"bands.{band}.tuning.")) else given.key
        if given.formula and title not in shown and (everything or not simulated):
            shown.add(title)
            users = f"  -> {', '.join(nodes.get(name, ()))}" if everything else ""
            yield f"  {_shown(title, given):<{WIDE}} {_reason(given)}{users}"
    if station.content.second_stage is not None:
        yield "\nsecond stage:"
        yield from (f"  {line}" for line in _second_stage(station, band))
    found = list(remarks(station, band))
    if found:
        yield "\nto know:"
        yield from (f"  {remark}" for remark in found)


def _second_stage(station: StationDescription, band: str) -> Iterable[str]:
    """Yield its error in wind and its margins; ValueError for one that is refused."""
    # Imported here: it takes the whole antenna, which most stations are checked without.
    from rf_pointing.station.antenna.simulated_antenna import AntennaParams
    from rf_pointing.station.antenna.stage_design import DESIGN_WIND_M_S

    design = AntennaParams(**station.sets("antenna_servo", band)).stage_design()
    design.require_useful()
    heads = ("alone mdeg", "with it", "x", "modes off x", "radio |S|")
    yield f"wind {DESIGN_WIND_M_S:<7g}" + "".join(f"{head:>13}" for head in heads)
    for axis in design.axes:
        errors = axis.before_rad / MDEG, axis.after_rad / MDEG
        numbers = (*errors, errors[0] / errors[1], axis.worst_gain, axis.radio_peak)
        yield f"{axis.name:<12}" + "".join(f"{number:13.3f}" for number in numbers)


def _shown(name: str, given: Value) -> str:
    unit = parameter_unit(name)
    return f"{name} = {_text(given.value)}" + ("" if unit == "1" else f" {unit}")


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _reason(given: Value) -> str:
    return f"given by {given.key}" if given.formula == "given" else given.formula


def main(argv: list[str] | None = None) -> None:
    """Check one description."""
    options = arguments(argv)
    with ending_with_reason("check_station"):
        station = read_station(options.station)
        band = station.default_band if options.band is None else options.band
        print(urdf(station) if options.urdf else "\n".join(report(station, band, options.all)))
    sys.exit(0)
