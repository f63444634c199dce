"""Look angles, OEM and covariances against Orekit, which shares no code with SGP4's or ERFA's Python packages.

Left out with a word where orekit-jpype or Java is missing (requirements/test.txt, a Java of 11 or later).
Both read the final series of the IERS: the rapid one is 0.45 ms of UT1 off it on single days of 2019, 1 m at a 12-h orbit.
Largest differences of 1000 random cases each, five seeds: angles 1.9e-6 deg, range 51 mm (beyond 1e8 m); OEM in EME2000 18 mm,
GCRF 16 mm, TEME 41 mm, ITRF 5e-9 m, which is the orientation of the Earth, not the interpolation; covariances on the
sky 1e-6 of the largest variance.
"""

import importlib.util
import math
import os
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import EARTH_MU_M3_S2, random_stream, unit_vector_from_azel
from rf_pointing.ephemeris import Elements, OemTarget, Site, TopocentricTrack, leap_seconds
from rf_pointing.ephemeris.tle import read_tle, tle_lines
from rf_pointing.ephemeris.uncertainty import ElementUncertainty, sky_uncertainty
from test.ephemeris.oem_text import read_oem, text_of

CASES = 250
HAS_JAVA = shutil.which("java") is not None or "JAVA_HOME" in os.environ
pytestmark = [
    pytest.mark.skipif(importlib.util.find_spec("orekit_jpype") is None, reason="orekit-jpype is not installed"),
    pytest.mark.skipif(not HAS_JAVA, reason="there is no Java"),
]


@pytest.fixture(scope="module")
def orekit() -> Any:
    """Orekit with the tables of astropy-iers-data: no data of its own are fetched."""
    import astropy_iers_data
    import orekit_jpype

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        orekit_jpype.initVM()
    import jpype
    from java.io import File
    from java.util import ArrayList
    from org.orekit import bodies, data, frames, orbits, propagation, time, utils
    from org.orekit.propagation.analytical.tle import TLE, TLEPropagator

    folder = Path(astropy_iers_data.IERS_B_FILE).parent
    data.DataContext.getDefault().getDataProvidersManager().addProvider(data.DirectoryCrawler(File(str(folder))))

    @jpype.JImplements("org.orekit.time.UTCTAIOffsetsLoader")
    class Leaps:
        @jpype.JOverride
        def loadOffsets(self) -> Any:  # noqa: N802
            found = ArrayList()
            for line in Path(astropy_iers_data.IERS_LEAP_SECOND_FILE).read_text().splitlines():
                if line.strip() and not line.startswith("#"):
                    _, day, month, year, offset = line.split()
                    start = time.DateComponents(int(year), int(month), int(day))
                    found.add(time.OffsetModel(start, int(offset)))
            return found

    time.TimeScalesFactory.addUTCTAIOffsetsLoader(Leaps())
    # The pole and UT1 of the newer convention: TEME of SGP4 knows no corrections of the nutation.
    frames.FramesFactory.addDefaultEOP1980HistoryLoaders("x", "x", r"^eopc04\.1962-now$", "x", "x", "x")
    frames.FramesFactory.addDefaultEOP2000HistoryLoaders("x", "x", r"^eopc04\.1962-now$", "x", "x", "x")
    tai = time.TimeScalesFactory.getTAI()
    first = time.AbsoluteDate(1970, 1, 1, 0, 0, 0.0, tai)

    def date(t_s: float) -> Any:
        return first.shiftedBy(t_s + float(leap_seconds().tai_minus_utc_s(t_s)))

    equinox = frames.FramesFactory.getITRFEquinox(utils.IERSConventions.IERS_1996, True)
    earth = bodies.OneAxisEllipsoid(utils.Constants.WGS84_EARTH_EQUATORIAL_RADIUS, utils.Constants.WGS84_EARTH_FLATTENING,
                                    equinox)  # fmt: skip
    return SimpleNamespace(date=date, earth=earth, equinox=equinox, bodies=bodies, frames=frames, time=time, utils=utils,
                          propagation=propagation, orbits=orbits, TLE=TLE, TLEPropagator=TLEPropagator,
                          Hermite=utils.TimeStampedPVCoordinatesHermiteInterpolator)  # fmt: skip


def cases(count: int) -> Iterator[tuple[Elements, Site, float]]:
    """Orbits from low to geosynchronous, round and eccentric; sites to both poles; times within three days."""
    rng = random_stream(36, "orekit")
    for number in range(count):
        perigee_m = 6.378e6 + (rng.uniform(350e3, 1500e3) if number % 3 else rng.uniform(2e6, 35e6))
        eccentricity = rng.uniform(0.0, 0.02) if number % 2 else rng.uniform(0.0, 0.8)
        axis_m = perigee_m / (1.0 - eccentricity)
        angles = rng.uniform(0.0, 2.0 * math.pi, 3)
        epoch_t_s = rng.uniform(1.2e9, 1.7e9)
        made = Elements(
            name="CASE", catalogue_number=number + 1, epoch_t_s=epoch_t_s, inclination_rad=rng.uniform(0.001, 2.9),
            ascending_node_rad=angles[0], eccentricity=eccentricity, argument_of_perigee_rad=angles[1],
            mean_anomaly_rad=angles[2], mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / axis_m**3),
            drag_per_earth_radius=1e-5,
        )  # fmt: skip
        # Both read the same lines, with their eight decimals.
        (elements,) = read_tle("\n".join(tle_lines(made)))
        place = Site(latitude_rad=math.asin(rng.uniform(-1.0, 1.0)), longitude_rad=rng.uniform(-math.pi, math.pi),
                     altitude_m=rng.uniform(0.0, 5e3))  # fmt: skip
        yield elements, place, epoch_t_s + rng.uniform(-1.0, 1.0) * 3.0 * 86400.0


def in_the_earth(orekit: Any, date: Any, position: Any) -> Any:
    """Turn from TEME into the Earth by way of the true equator of date.

    Orekit takes it by way of the GCRF there and by way of J2000 back, which are 23 mas apart.
    """
    factory, old = orekit.frames.FramesFactory, orekit.utils.IERSConventions.IERS_1996
    of_date = factory.getTEME().getTransformTo(factory.getTOD(False), date).transformPosition(position)
    return factory.getTOD(old, True).getTransformTo(orekit.equinox, date).transformPosition(of_date)


def topocentric(orekit: Any, place: Site) -> Any:
    point = orekit.bodies.GeodeticPoint(place.latitude_rad, place.longitude_rad, place.altitude_m)
    return orekit.frames.TopocentricFrame(orekit.earth, point, "site")


def test_look_angles_of_elements_are_orekits(orekit: Any) -> None:
    worst_rad, worst_m = 0.0, 0.0
    for elements, place, t_s in cases(CASES):
        track = TopocentricTrack(elements, place, refraction=None, light_time="none")
        ours = track.target_at(t_s)
        orbit = orekit.TLEPropagator.selectExtrapolator(orekit.TLE(*tle_lines(elements)))
        date = orekit.date(t_s)
        there = in_the_earth(orekit, date, orbit.getPVCoordinates(date, orbit.getFrame()).getPosition())
        seen = topocentric(orekit, place).getTrackingCoordinates(there, orekit.equinox, date)
        directions = [unit_vector_from_azel(np.array(azimuth), np.array(elevation)) for azimuth, elevation in (
            (ours.azimuth_rad, ours.elevation_rad), (seen.getAzimuth(), seen.getElevation()))]  # fmt: skip
        worst_rad = max(worst_rad, float(np.linalg.norm(directions[0] - directions[1])))
        worst_m = max(worst_m, abs(ours.range_m - seen.getRange()))
    assert math.degrees(worst_rad) < 2e-6
    assert worst_m < 0.1


@pytest.mark.parametrize("frame", ["EME2000", "GCRF", "TEME", "ITRF2000"])
def test_oem_interpolated_and_turned_into_the_earth_is_orekits(orekit: Any, frame: str) -> None:
    """By Hermite of degree 7 and by Lagrange."""
    from java.util import ArrayList
    from org.hipparchus.geometry.euclidean.threed import Vector3D

    rng, worst_m = random_stream(36, f"oem {frame}"), 0.0
    factory, conventions = orekit.frames.FramesFactory, orekit.utils.IERSConventions
    earth = factory.getITRF(conventions.IERS_2010, True)
    axes = {"EME2000": factory.getEME2000(), "GCRF": factory.getGCRF(), "TEME": factory.getTEME(), "ITRF2000": earth}
    for number in range(10):
        times = rng.uniform(1.2e9, 1.7e9) // 1.0 + 60.0 * np.arange(15)
        radius_m, rate = rng.uniform(6.8e6, 8e6), 1e-3
        plane, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        turn = rate * (times - times[0])
        place = 1e-3 * radius_m * (np.outer(np.cos(turn), plane[0]) + np.outer(np.sin(turn), plane[1]))
        speed = 1e-3 * radius_m * rate * (np.outer(np.cos(turn), plane[1]) - np.outer(np.sin(turn), plane[0]))
        method, degree = ("HERMITE", "7") if number % 2 else ("LAGRANGE", "9")
        text = text_of(list(np.hstack([place, speed])), times=times, REF_FRAME=frame, INTERPOLATION=method,
                       INTERPOLATION_DEGREE=degree)  # fmt: skip
        ours = OemTarget(read_oem(text))
        # Orekit's reader of OEM needs the planets' ephemerides for the centre of the Earth.
        states = ArrayList()
        for t_s, at, moving in zip(times.tolist(), 1e3 * np.round(place, 9), 1e3 * np.round(speed, 9), strict=True):
            vectors = (Vector3D(*each.tolist()) for each in (at, moving))
            states.add(orekit.utils.TimeStampedPVCoordinates(orekit.date(t_s), *vectors))
        filters = orekit.utils.CartesianDerivativesFilter
        between = orekit.Hermite(4 if method == "HERMITE" else 10,
                                              filters.USE_PV if method == "HERMITE" else filters.USE_P)  # fmt: skip
        for t_s in rng.uniform(times[4], times[-5], 25).tolist():
            date = orekit.date(t_s)
            there = between.interpolate(date, states.stream()).getPosition()
            if frame == "TEME":
                there = in_the_earth(orekit, date, there)
            else:
                there = axes[frame].getTransformTo(earth, date).transformPosition(there)
            apart = np.subtract(ours.motion_at(t_s).position, np.array(there.toArray()))
            worst_m = max(worst_m, float(np.linalg.norm(apart)))
    assert worst_m < 0.05


def test_covariances_of_elements_on_the_sky_are_orekits(orekit: Any) -> None:
    """Stated along the track, across and radially; Orekit turns them into its topocentric frame."""
    from org.hipparchus.linear import MatrixUtils

    model, worst = ElementUncertainty(), 0.0
    for elements, place, t_s in cases(CASES):
        track = TopocentricTrack(elements, place, refraction=None, light_time="none")
        ours = sky_uncertainty(track, t_s, model).covariance_rad2
        orbit = orekit.TLEPropagator.selectExtrapolator(orekit.TLE(*tle_lines(elements)))
        # Inertial, as an error in time is; TNW: along, then in the orbit's plane, then its normal.
        date, inertial = orekit.date(t_s), orekit.frames.FramesFactory.getTEME()
        along, across, radial = model.sigmas_m(t_s - elements.epoch_t_s)
        stated = np.zeros((6, 6))
        stated[:3, :3] = np.diag([along**2, radial**2, across**2])
        # The velocity that SGP4 returns is not the derivative of its positions.
        after, before = (orbit.getPVCoordinates(date.shiftedBy(step), inertial).getPosition() for step in (1.0, -1.0))
        moving = orekit.utils.PVCoordinates(
            orbit.getPVCoordinates(date, inertial).getPosition(), after.subtract(before).scalarMultiply(0.5)
        )
        there = orekit.orbits.CartesianOrbit(moving, inertial, date, EARTH_MU_M3_S2)
        covariance = orekit.propagation.StateCovariance(
            MatrixUtils.createRealMatrix(stated.tolist()), date, orekit.frames.LOFType.TNW_INERTIAL
        )
        turned = covariance.changeCovarianceFrame(there, inertial).getMatrix()
        frame = topocentric(orekit, place)
        rotation = np.array(inertial.getTransformTo(frame, date).getRotation().getMatrix())
        enu = rotation @ np.array(turned.getSubMatrix(0, 2, 0, 2).getData()) @ rotation.T
        seen = np.array(there.getPVCoordinates(frame).getPosition().toArray())
        azimuth, elevation = math.atan2(seen[0], seen[1]), math.asin(seen[2] / np.linalg.norm(seen))
        right = [math.cos(azimuth), -math.sin(azimuth), 0.0]
        up = [-math.sin(elevation) * math.sin(azimuth), -math.sin(elevation) * math.cos(azimuth), math.cos(elevation)]
        onto = np.array([right, up]) / np.linalg.norm(seen)
        theirs = onto @ enu @ onto.T
        worst = max(worst, float(np.max(np.abs(ours - theirs)) * np.dot(seen, seen) / along**2))
    assert worst < 5e-6
