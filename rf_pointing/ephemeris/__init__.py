"""Where the target is at a time: elements, time scales, look angles and passes."""

from rf_pointing.ephemeris.catalogue import CataloguePass, CatalogueSearch, CatalogueSky, find_catalogue_passes
from rf_pointing.ephemeris.celestial import RADIO_SOURCES, moon, radio_source, sun
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.element_messages import read_elements
from rf_pointing.ephemeris.elements import Elements, find_elements
from rf_pointing.ephemeris.oem import OemTarget, oem_text, read_oem
from rf_pointing.ephemeris.passes import Pass, find_passes, first_pass_above, passes_with_present
from rf_pointing.ephemeris.satellite_antenna import SatelliteAntennaParams, orbital_axes, orbital_rate_rad_s
from rf_pointing.ephemeris.sites import SITES, Site, site
from rf_pointing.ephemeris.tle import tle_lines, verification_elements
from rf_pointing.ephemeris.track import TargetSource, TopocentricTrack
from rf_pointing.ephemeris.uncertainty import (
    ElementUncertainty,
    SkyUncertainty,
    orientation_sigma_rad,
    sky_uncertainty,
    stale_warning,
)

__all__ = [
    "RADIO_SOURCES",
    "SITES",
    "CataloguePass",
    "CatalogueSearch",
    "CatalogueSky",
    "ElementUncertainty",
    "Elements",
    "IersEarthOrientation",
    "OemTarget",
    "Pass",
    "SatelliteAntennaParams",
    "Site",
    "SkyUncertainty",
    "TargetSource",
    "TopocentricTrack",
    "find_catalogue_passes",
    "find_elements",
    "find_passes",
    "first_pass_above",
    "moon",
    "oem_text",
    "orbital_axes",
    "orbital_rate_rad_s",
    "orientation_sigma_rad",
    "passes_with_present",
    "radio_source",
    "read_elements",
    "read_oem",
    "site",
    "sky_uncertainty",
    "stale_warning",
    "sun",
    "tle_lines",
    "verification_elements",
]
