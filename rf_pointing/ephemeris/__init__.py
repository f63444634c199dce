"""Where the target is at a time: elements, time scales, look angles and passes."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.ephemeris.catalogue import CataloguePass, CatalogueSky, find_catalogue_passes
    from rf_pointing.ephemeris.celestial import RADIO_SOURCES, moon, radio_source, sun
    from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
    from rf_pointing.ephemeris.element_files import cache_folder
    from rf_pointing.ephemeris.element_updates import ElementUpdates
    from rf_pointing.ephemeris.elements import Elements, find_elements
    from rf_pointing.ephemeris.fetching import Outcome, fetched, kept_outcomes
    from rf_pointing.ephemeris.oem import OemTarget, oem_text
    from rf_pointing.ephemeris.orbit_file import read_elements
    from rf_pointing.ephemeris.passes import Pass, find_passes, first_pass_above, passes_with_present
    from rf_pointing.ephemeris.satellite_antenna import SatelliteAntennaParams, orbital_axes, orbital_rate_rad_s
    from rf_pointing.ephemeris.sites import SITES, Site, site
    from rf_pointing.ephemeris.solar import SolarDirection, SunPermit
    from rf_pointing.ephemeris.source import NO_TARGET, SourceParams, load_catalogue, load_track, read_source
    from rf_pointing.ephemeris.state_vector import StateVector
    from rf_pointing.ephemeris.time_scales import leap_seconds
    from rf_pointing.ephemeris.tle import tle_lines, verification_elements
    from rf_pointing.ephemeris.track import TargetSource, TopocentricTrack
    from rf_pointing.ephemeris.uncertainty import (
        ElementUncertainty,
        orientation_sigma_rad,
        sky_uncertainty,
        stale_warning,
    )

__getattr__ = lazily(__name__, __file__)
