"""Executable `new_station`: a station description to begin with, printed with comments.

The options fill in what they say; the mount is that of a small antenna until you change it.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from rf_pointing.commands.options import command, ending_with_reason
from rf_pointing.core.checks import one_of
from rf_pointing.station.description import StationError, station_from
from rf_pointing.station.description.content import BandSection

FREQUENCIES_MHZ = {
    "VHF": 145.9, "UHF": 436.5, "L": 1690.0, "S": 2250.0, "C": 5000.0, "X": 8200.0, "Ku": 12000.0,
    "Ka": 26500.0,
}  # fmt: skip
"""Downlink frequency of each band; a description says the frequency, so any name will do."""

MOUNT = """
mount:
  azimuth:
    travel_deg: [-270.0, 270.0]     # more than one turn is the cable wrap
    rate_deg_s: 6.0
    acceleration_deg_s2: 6.0
    encoder_bits: 20                # or resolution_deg: 0.1
  elevation:
    travel_deg: [0.0, 90.0]         # up to 180 where the dish goes over the top
    rate_deg_s: 6.0
    acceleration_deg_s2: 6.0
    encoder_bits: 20
  # horizon_deg: [[0, 3], [90, 5], [180, 12], [270, 4]]   # azimuth, lowest elevation of each point
  # horizon_file: horizon.txt                             # the same, a point a line
  # park_deg: [0.0, 45.0]
  # stow_elevation_deg: 90.0

sun: {radius_deg: 1.0}              # the beam stays this far from the Sun
# With an anemometer that publishes weather/wind: true.  Its silence counts as high wind.
wind: {anemometer: false, gust_limit_m_s: 25.0, mean_limit_m_s: 18.0}

drive: {type: simulated}            # your rotator or control unit: docs/own_antenna.md
"""


@dataclass(frozen=True, kw_only=True)
class NewStation:
    """Options of a new station, as they were written."""

    name: str
    latitude: str
    longitude: str
    height: str
    diameter: str | None
    bands: list[str]
    beamwidth: str | None

    def description(self) -> str:
        """Return the text of the description; ValueError with every problem."""
        unknown = [name for name in self.bands if name not in FREQUENCIES_MHZ]
        problems = [f"bands={name!r} must be {one_of(name, FREQUENCIES_MHZ)}" for name in unknown]
        if self.diameter is None and self.beamwidth is None:
            problems.append(
                "an antenna needs its diameter (--diameter), or one without a dish its beamwidth (--beamwidth)"
            )
        text = self._text([name for name in self.bands if name not in unknown])
        try:
            station_from(Path("new station"), text)
        except StationError as error:
            # A line of a file that nobody has seen means nothing; a missing band was named above.
            problems += [reason for _, reason in error.problems if not unknown or not reason.startswith("bands")]
        if problems:
            raise ValueError("\n".join(problems))
        return text

    def _text(self, bands: list[str]) -> str:
        width = "" if self.beamwidth is None else f"\n    half_power_beamwidth_deg: {self.beamwidth}"
        usual = BandSection(frequency_mhz=1e3).sensors
        sections = [
            f"""  {name}:
    frequency_mhz: {FREQUENCIES_MHZ[name]}{width}
    sensors: [{", ".join(usual)}]   # the default first; monopulse for such a feed; [] for program track
    # system_noise_k: 120.0
    # bias_model: my_model.yaml     # none until you have calibrated one"""
            for name in bands
        ]
        dish = "" if self.diameter is None else f"\ndish: {{diameter_m: {self.diameter}}}\n"
        return (
            "# Degrees, metres and seconds; `check_station` prints what follows from these numbers.\n"
            f"version: 1\nname: {_quoted(self.name)}\n"
            f"site: {{latitude_deg: {self.latitude}, longitude_deg: {self.longitude}, height_m: {self.height}}}\n"
            f"{dish}\nbands:\n" + "\n".join(sections) + "\n" + MOUNT
        )


def _quoted(name: str) -> str:
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def request_from(argv: list[str] | None = None) -> NewStation:
    """Return the request of a command line."""
    parser = command("new_station", "Print a station description to begin with.")
    add = parser.add_argument
    add("--name", required=True, help="name of the station")
    add("--latitude", required=True, metavar="DEG", help="geodetic latitude, north positive")
    add("--longitude", required=True, metavar="DEG", help="longitude, east positive")
    add("--height", default="0.0", metavar="M", help="height above the WGS 84 ellipsoid (default: 0)")
    add("--diameter", metavar="M", help="diameter of the dish; without one the bands need their beamwidths")
    add("--bands", default="S", metavar="NAME[,NAME]", help=f"bands, of {', '.join(FREQUENCIES_MHZ)} (default: S)")
    add("--beamwidth", metavar="DEG", help="half-power beamwidth of every band, for an antenna without a dish")
    options = vars(parser.parse_args(argv))
    bands = [name.strip() for name in options.pop("bands").split(",") if name.strip()]
    return NewStation(bands=bands, **options)


def main(argv: list[str] | None = None) -> None:
    """Print the description."""
    with ending_with_reason("new_station"):
        sys.stdout.write(request_from(argv).description())
