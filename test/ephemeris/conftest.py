"""The satellites and the stations that several ephemeris tests share."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest

from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, find_elements, site, verification_elements
from rf_pointing.ephemeris.earth_orientation import EarthOrientation
from test.ephemeris.element_server import Source, serving


@pytest.fixture(scope="session")
def cbers() -> Elements:
    return find_elements(verification_elements(), "28057")


@pytest.fixture(scope="session")
def goldstone() -> Site:
    return site("Goldstone DSS-13")


@pytest.fixture(scope="session")
def track(cbers: Elements, goldstone: Site) -> TopocentricTrack:
    return TopocentricTrack(cbers, goldstone)


@pytest.fixture
def source() -> Iterator[Source]:
    with serving() as made:
        yield made


@dataclass(frozen=True)
class AssumedOrientation:
    """An Earth whose orientation is given instead of read from tables."""

    ut1_minus_utc_s: float = 0.0
    pole_x_rad: float = 0.0
    pole_y_rad: float = 0.0
    sigmas: tuple[float, float] = (0.0, 0.0)

    def at(self, t_s: Any) -> EarthOrientation:
        zeros = 0.0 * t_s
        return EarthOrientation(zeros + self.ut1_minus_utc_s, zeros + self.pole_x_rad, zeros + self.pole_y_rad)

    def sigmas_at(self, _t_s: float) -> tuple[float, float]:
        return self.sigmas

    def warnings(self, _t_s: float) -> tuple[str, ...]:
        return ()
