"""Remarks on a station for its user, besides the problems of its description."""

import math
from collections.abc import Iterator

from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.derive.band import Band
from rf_pointing.station.description.description import StationDescription


def remarks(station: StationDescription, band: str | None = None) -> Iterator[str]:
    """Yield remarks that a user of this station should know, besides its problems."""
    numbers = Band(station.content, station.default_band if band is None else band)
    mount, kinematics = station.content.mount, kinematics_of(station.content)
    low, high = mount.pair[0].travel_deg
    if not kinematics.level:
        for azimuth, elevation in kinematics.keyholes_rad():
            yield (
                f"mount: a keyhole at elevation {math.degrees(elevation):.1f} deg, azimuth "
                f"{math.degrees(azimuth) % 360.0:.1f} deg, where the {kinematics.axes[0]} axis is too slow"
            )
    elif high - low < 360.0:
        yield f"mount.azimuth.travel_deg: {360.0 - high + low:g} deg of the sky cannot be reached"
    elif high - low > 360.0:
        yield f"mount.azimuth.travel_deg: {high - low - 360.0:g} deg of azimuth can be reached on two turns"
    if station.mask == type(station.mask)(clearance_rad=station.mask.clearance_rad):
        yield "mount: there is no horizon mask; the antenna may look at hills, houses and people"
    if not numbers.section.bias_model:
        yield f"bands.{numbers.name}: there is no bias model; errors of the mount are not corrected"
    if not station.content.wind.anemometer:
        yield "wind.anemometer: the station has none; wind does not stow the antenna"
    if station.content.mount.unsigned_commands:
        yield "mount.unsigned_commands: anybody on the network may command the antenna between passes"
    if station.content.sun.radius_deg == 0.0:
        yield "sun.radius_deg: the beam may look into the Sun"
    share = numbers.step_deg / numbers.beamwidth_deg
    if share > 0.1:
        yield f"mount: an encoder step is {share:.2f} of the beamwidth; a tenth costs 0.03 dB, a half 0.75 dB"
