"""The satellites and the stations that several ephemeris tests share."""

import pytest

from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, find_elements, site, verification_elements


@pytest.fixture(scope="session")
def cbers() -> Elements:
    return find_elements(verification_elements(), "28057")


@pytest.fixture(scope="session")
def goldstone() -> Site:
    return site("Goldstone DSS-13")


@pytest.fixture(scope="session")
def track(cbers: Elements, goldstone: Site) -> TopocentricTrack:
    return TopocentricTrack(cbers, goldstone)
