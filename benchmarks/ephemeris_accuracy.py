"""Accuracy of the ephemeris: the largest angle to skyfield and astropy above 5 deg, orbit by orbit, each explained.

    scripts/run-python benchmarks/ephemeris_accuracy.py

Five orbits of the SGP4 verification set with their epochs moved, six stations, two days from each epoch in steps of 61 s;
no refraction, no light time.  A difference is explained by doing here what the other library does, and looking again.
astropy is asked on the same grid, thinned to every `ASTROPY_EVERY`th instant, where it is installed; it is no dependency.
"""

import dataclasses
import importlib.util
import math
from typing import Any

import astropy_iers_data
import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, angular_distance_rad
from rf_pointing.core.dates import from_utc_text
from rf_pointing.ephemeris import (
    SITES,
    Elements,
    IersEarthOrientation,
    Site,
    TopocentricTrack,
    find_elements,
    read_elements,
    verification_elements,
)
from rf_pointing.ephemeris.earth_orientation import EarthOrientation
from rf_pointing.ephemeris.time_scales import DAY_S
from rf_pointing.ephemeris.tle import tle_lines

Array = NDArray[np.float64]
ORBITS = {"LEO 780 km": "28057", "LEO 230 km": "29238", "GPS": "28129", "HEO 12 h": "8195", "GEO": "24208"}
EPOCHS = (
    "1995-06-26T12:00:00",
    "2006-06-26T12:00:00",
    "2016-12-31T00:00:00",
    "2024-03-01T12:00:00",
    "2026-11-01T12:00:00",
)
STEP_S, SPAN_S, ASTROPY_EVERY = 61.0, 2.0 * DAY_S, 40
LEAST_RAD = math.radians(5.0)
BOUND_MDEG = 1.0
"""What a difference in a low orbit must stay below when both do the same."""


class Imitated:
    """The Earth's orientation as another library has it: without the pole, or with its own UT1."""

    def __init__(self, *, pole: bool, ut1_minus_utc: Any = None) -> None:
        self._tables, self._pole, self._ut1 = IersEarthOrientation(), float(pole), ut1_minus_utc

    def at(self, t_s: Any) -> EarthOrientation:
        """Return the orientation at UTC times."""
        ours = self._tables.at(t_s)
        ut1 = ours.ut1_minus_utc_s if self._ut1 is None else self._ut1(t_s)
        return EarthOrientation(ut1, self._pole * ours.pole_x_rad, self._pole * ours.pole_y_rad)

    def sigmas_at(self, _t_s: float) -> tuple[float, float]:
        """Return no uncertainty: it is an imitation on purpose."""
        return 0.0, 0.0

    def warnings(self, _t_s: float) -> tuple[str, ...]:
        """Return nothing: it is an imitation on purpose."""
        return ()


class Skyfield:
    """skyfield, as installed or with the pole's motion installed."""

    def __init__(self, *, pole: bool) -> None:
        from skyfield.api import load
        from skyfield.data import iers

        self.scale = load.timescale(builtin=True)
        if pole:
            with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
                iers.install_polar_motion_table(self.scale, iers.parse_x_y_dut1_from_finals_all(file))

    def times(self, t_s: Any) -> Any:
        """Return UTC times as skyfield's."""
        return self.scale.utc(1970, 1, 1 + t_s // DAY_S, 0, 0, t_s % DAY_S)

    def ut1_minus_utc_s(self, t_s: Any) -> Any:
        """Return the UT1 that skyfield has at UTC times."""
        return self.times(t_s).dut1

    def direction(self, elements: Elements, place: Site, t_s: Array) -> tuple[Array, Array]:
        """Return azimuth and elevation."""
        from skyfield.api import EarthSatellite, wgs84

        seen = wgs84.latlon(math.degrees(place.latitude_rad), math.degrees(place.longitude_rad), place.altitude_m)
        satellite = EarthSatellite(*tle_lines(elements), elements.name, self.scale)
        elevation, azimuth, _ = (satellite - seen).at(self.times(t_s)).altaz()
        return azimuth.radians, elevation.radians


class Astropy:
    """astropy: SGP4's TEME position through ITRS to the horizon of the station."""

    def direction(self, elements: Elements, place: Site, t_s: Array) -> tuple[Array, Array]:
        """Return azimuth and elevation."""
        from astropy import units
        from astropy.coordinates import ITRS, TEME, AltAz, CartesianRepresentation, EarthLocation
        from astropy.time import Time
        from astropy.utils import iers

        iers.conf.auto_download = False
        days = np.floor(t_s / DAY_S)
        when = Time(2440587.5 + days, (t_s - days * DAY_S) / DAY_S, format="jd", scale="utc")
        _, position_km, _ = elements.satrec().sgp4_array(when.jd1, when.jd2)
        where = EarthLocation.from_geodetic(
            math.degrees(place.longitude_rad) * units.deg, math.degrees(place.latitude_rad) * units.deg,
            place.altitude_m * units.m,
        )  # fmt: skip
        fixed = TEME(CartesianRepresentation(position_km.T * units.km), obstime=when).transform_to(ITRS(obstime=when))
        relative = fixed.cartesian - where.get_itrs(when).cartesian
        horizon = ITRS(relative, obstime=when, location=where).transform_to(AltAz(obstime=when, location=where))
        return horizon.az.rad, horizon.alt.rad


def moved(number: str, epoch_t_s: float) -> Elements:
    """Return elements with another epoch, as both sides read them from the same two lines."""
    elements = dataclasses.replace(find_elements(verification_elements(), number), epoch_t_s=epoch_t_s)
    return read_elements("\n".join((elements.name, *tle_lines(elements))))[0]


def largest_mdeg(other: Any, epoch: str, orientation: Any = None, later_s: float = 0.0, every: int = 1) -> list[float]:
    """Return the largest angle between here and there for each orbit.

    `later_s` moves the epoch here, to be compared on the second day only.
    """
    found = []
    for number in ORBITS.values():
        elements = moved(number, from_utc_text(epoch))
        t_s = elements.epoch_t_s + np.arange(DAY_S if later_s else 0.0, SPAN_S, STEP_S)[::every]
        ours = dataclasses.replace(elements, epoch_t_s=elements.epoch_t_s + later_s)
        worst = 0.0
        for place in SITES.values():
            track = TopocentricTrack(ours, place, refraction=None, light_time="none", orientation=orientation)
            looks = track.sample(t_s)
            up = looks.elevation_rad > LEAST_RAD
            if up.any():
                azimuth, elevation = other.direction(elements, place, t_s[up])
                apart = angular_distance_rad(azimuth, elevation, looks.azimuth_rad[up], looks.elevation_rad[up])
                worst = max(worst, float(apart.max()) / MDEG)
        found.append(worst)
    return found


def show(what: str, values: list[float], why: str) -> None:
    """Print one line of the table."""
    print(f"{what:<52}" + "".join(f"{value:>12.2g}" for value in values) + f"   {why}", flush=True)


def main() -> None:
    """Print the table; complain about a low orbit that differs by more than the bound although both do the same."""
    print(f"{'largest angle in mdeg':<52}" + "".join(f"{name:>12}" for name in ORBITS))
    plain, poled = Skyfield(pole=False), Skyfield(pole=True)
    theirs = Imitated(pole=True, ut1_minus_utc=poled.ut1_minus_utc_s)
    same: list[float] = []
    for epoch in EPOCHS:
        day = epoch[:10]
        leap = day == "2016-12-31"
        show(f"skyfield as installed, {day}", largest_mdeg(plain, epoch), "")
        show(f"skyfield with polar motion, {day}", largest_mdeg(poled, epoch), "it leaves out the pole")
        if leap:
            alike = largest_mdeg(poled, epoch, theirs, later_s=1.0)
            show("  and a second less of flight here, after it", alike, "it does not count the leap second as flight")
            continue
        alike = largest_mdeg(poled, epoch, theirs)
        show("  and its UT1 here", alike, "its table of UT1 is another, interpolated otherwise")
        same.append(max(alike[:2]))
    if importlib.util.find_spec("astropy") is None:
        print("astropy is not installed: see test/ephemeris/data/astropy.json for directions computed with it")
    else:
        for epoch in EPOCHS:
            values = largest_mdeg(Astropy(), epoch, every=ASTROPY_EVERY)
            show(
                f"astropy, {epoch[:10]}",
                values,
                "rounding" if epoch[:10] != "2016-12-31" else "the leap second, as above",
            )
            same += [max(values[:2])] if epoch[:10] != "2016-12-31" else []
    verdict = "holds" if max(same) <= BOUND_MDEG else "does NOT hold"
    print(f"low orbits, where both do the same: {max(same):.2g} mdeg at most; <= {BOUND_MDEG:g} mdeg {verdict}")


if __name__ == "__main__":
    main()
