"""Where the target is at a time: elements, time scales, look angles and passes."""

from rf_pointing.ephemeris.earth_orientation import EarthOrientation, FixedEarthOrientation, IersEarthOrientation
from rf_pointing.ephemeris.elements import Elements, find_elements
from rf_pointing.ephemeris.look_angles import LookAngles
from rf_pointing.ephemeris.messages import read_elements
from rf_pointing.ephemeris.passes import Pass, find_passes, first_pass_above
from rf_pointing.ephemeris.sites import SITES, Site, site
from rf_pointing.ephemeris.time_scales import Gps, Tai, Tt, Ut1, Utc, leap_seconds, utc_text
from rf_pointing.ephemeris.tle import verification_elements
from rf_pointing.ephemeris.track import TargetSource, TopocentricTrack

__all__ = [
    "SITES",
    "EarthOrientation",
    "Elements",
    "FixedEarthOrientation",
    "Gps",
    "IersEarthOrientation",
    "LookAngles",
    "Pass",
    "Site",
    "Tai",
    "TargetSource",
    "TopocentricTrack",
    "Tt",
    "Ut1",
    "Utc",
    "find_elements",
    "find_passes",
    "first_pass_above",
    "leap_seconds",
    "read_elements",
    "site",
    "utc_text",
    "verification_elements",
]
