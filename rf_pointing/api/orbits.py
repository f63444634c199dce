"""Orbits from an antenna's own passes, and what orbits a network could know."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing import __version__
from rf_pointing.api.calibration import TABULAR, DataFiles
from rf_pointing.api.keywords import time_s
from rf_pointing.api.station import Station
from rf_pointing.api.target import MAX_AGE_S, Target
from rf_pointing.calibration import TrackedPass
from rf_pointing.core import MDEG, Array, RadioRefraction, to_utc_text, write_whole
from rf_pointing.ephemeris import Elements, ElementUncertainty, OemTarget, leap_seconds, oem_text
from rf_pointing.ephemeris.element_messages import omm_text
from rf_pointing.ephemeris.oem import OemSegment, StateCovariance
from rf_pointing.orbit.determination import Dynamics, Orbits, Priors
from rf_pointing.orbit.passes import (
    Ephemeris,
    checked_orbit,
    forces_of,
    mean_elements,
    points_of,
    prior_of,
    refuse_leap_second,
)
from rf_pointing.station.campaign import recorded_input

STEP_S, COVARIANCE_STEPS, BEFORE_S = 60.0, 10, 600.0
CALIBRATED_MDEG = 5.0
"""Sigma of the angles' bias under a bias model; without a model it is a tenth of the beam."""


@dataclass(frozen=True, eq=False)
class DeterminedOrbit:
    """An orbit from passes, with covariance; `print` shows how good it is, `write` keeps it.

    Attributes
    ----------
    elements : refined mean elements, for what flies elements.
    elements_rms_m : their distance from the orbit, over the passes and the prediction.
    before : the elements that the orbit began with.
    ephemeris : states in TEME and covariances in radial, transverse, normal, a minute apart.
    """

    elements: Elements
    elements_rms_m: float
    ephemeris: Ephemeris = field(repr=False)
    found: Orbits = field(repr=False)
    notes: tuple[str, ...] = field(repr=False)
    before: Elements = field(repr=False)
    manoeuvre_t_s: float | None = None

    @property
    def reason_not_better(self) -> str:
        """Where the prediction falls short of that of the old elements, "" if it is better.

        Their errors are those of the law of elements.  Passes that do not agree within what is
        known of their noise and biases have given no orbit at all.
        """
        law, t_s = ElementUncertainty(), float(self.ephemeris.t_s[-1])
        along_m, cross_m, _ = law.sigmas_m(t_s - self.before.epoch_t_s)
        _, along, cross = self.sigmas_m(t_s)
        for words, found_m, most_m in (
            ("the orbit's sigma along the track", along, along_m),
            ("the orbit's sigma across the track", cross, cross_m),
            ("the refined elements' distance from the orbit", self.elements_rms_m, law.along_m),
        ):
            if found_m >= most_m:
                return f"{words} is {found_m:.0f} m, must be < {most_m:.0f} m, that of the elements"
        return ""

    @cached_property
    def target(self) -> OemTarget:
        """The orbit as a target of the station."""
        states, tai_s = self.ephemeris.states, _tai_s(self.ephemeris.t_s)
        return OemTarget([OemSegment(
            name=self.elements.name, object_id=self._object_id, frame="TEME", tai_s=tai_s,
            position_m=states[:, :3], velocity_m_s=states[:, 3:], method="HERMITE", degree=7,
            usable_from_s=float(tai_s[0]), usable_to_s=float(tai_s[-1]),
        )])  # fmt: skip

    @property
    def _object_id(self) -> str:
        return self.elements.international_designator or str(self.elements.catalogue_number)

    def sigmas_m(self, t_s: float) -> tuple[float, float, float]:
        """Return the sigma in radius, along and across the track at a UTC time of the orbit."""
        row = int(np.argmin(np.abs(self.ephemeris.t_s - t_s)))
        radial, along, cross = self.ephemeris.sigmas_m()[row]
        return float(radial), float(along), float(cross)

    def to_oem(self, created_t_s: float) -> str:
        """Return the orbit as a CCSDS OEM with a covariance (RTN axes) every ten minutes."""
        first_s, last_s = self.target.spans_t_s[0]
        at, tai_s = self.ephemeris, _tai_s(self.ephemeris.t_s)
        # More often would fill the file: a covariance changes over a revolution.
        blocks = [
            StateCovariance(float(t_s), "RTN", matrix)
            for t_s, matrix in list(zip(tai_s, at.covariance, strict=True))[::COVARIANCE_STEPS]
        ]
        return oem_text(
            self.target, self._object_id, math.ceil(first_s), math.floor(last_s),
            originator=f"rf_pointing {__version__}", created_t_s=created_t_s, covariances=blocks,
        )  # fmt: skip

    def write(self, stem: str | Path, *, created_t_s: float) -> tuple[Path, Path]:
        """Write STEM.oem and STEM.omm; return both."""
        oem, omm = (Path(f"{stem}{suffix}") for suffix in (".oem", ".omm"))
        write_whole(oem, self.to_oem(created_t_s))
        write_whole(omm, omm_text(self.elements, originator=f"rf_pointing {__version__}",
            created_t_s=created_t_s))  # fmt: skip
        return oem, omm

    def __str__(self) -> str:
        found, values = self.found, dict(zip(self.found.names, self.found.values[0], strict=True))
        name, count = self.elements.name, len(found.passes)
        lines = [f"{name}: orbit from {count} passes, {found.iterations} iterations"]
        sigmas, first = np.sqrt(np.diag(found.covariance()[0])), 0
        spread = dict(zip(found.names, sigmas, strict=True))
        for k, one in enumerate(found.passes):
            used = found.used[0, first : first + one.values[0].size]
            first += one.values[0].size
            noise = math.degrees(one.sigma[1] * found.scale[0, k]) * 1e3
            clock = f"clock of pass {k + 1}"
            lines.append(
                f"  pass {k + 1} {one.station} {to_utc_text(float(one.t_s[0]))[:19]}: "
                f"{int(np.sum(used))} of {used.size} values, {noise:.1f} mdeg, "
                f"clock {values[clock]:+.4f} s (sigma {spread[clock]:.4f})"
            )
        if self.manoeuvre_t_s is not None:
            burn = np.array([values[name] for name in self.found.dynamics.names[7:10]])
            when = to_utc_text(self.manoeuvre_t_s)[:19]
            lines.append(f"  manoeuvre {when}: {float(np.linalg.norm(burn)):.3f} m/s")
        last_s = float(found.passes[-1].t_s[-1])
        for t_s in (last_s, float(self.ephemeris.t_s[-1])):
            radial, along, cross = self.sigmas_m(t_s)
            known = f"radial {radial:.0f}, along {along:.0f}, cross {cross:.0f} m"
            lines.append(f"  sigma {to_utc_text(t_s)[:19]}: {known}")
        ahead_s = self.ahead_of_elements_s
        lines.append(
            f"  {abs(ahead_s):.3f} s {'ahead of' if ahead_s > 0.0 else 'behind'} its elements; "
            f"refined elements follow within {self.elements_rms_m:.0f} m rms"
        )
        lines += [f"  not determined, from the elements: {one}" for one in found.undetermined()]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    @property
    def ahead_of_elements_s(self) -> float:
        """How much earlier than by the old elements the satellite is there, at the first pass."""
        before = self.found.prior.states[0]
        moved = self.found.values[0, :3] - before[:3]
        return float(moved @ before[3:] / (before[3:] @ before[3:]))


def _tai_s(t_s: Array) -> Array:
    return np.asarray(t_s + leap_seconds().tai_minus_utc_s(t_s))


def _read(files: DataFiles, elements: Elements, station: Station) -> Sequence[TrackedPass]:
    """Return the passes of one file, which are of the satellite."""
    (path,), passes = files.paths, files.read(station).passes
    if not passes:
        raise ValueError(f"{path} holds calibration points and no tracking data of a pass")
    for one in passes:
        mine = elements.name.casefold(), str(elements.catalogue_number)
        if one.raw.target.casefold() not in mine:
            raise ValueError(f"{path} is of {one.raw.target!r}, must be of {' or '.join(mine)}")
    return passes


def _station_of(path: Path, stations: Sequence[Station]) -> Station:
    if path.is_file() and path.suffix in TABULAR:
        names = {one.station for one in recorded_input.read_raw(path, stations[0].band)}
    else:
        # A recording loads a ROS message library, which tables do without.
        from rf_pointing.report.recording import read_recording

        names = {read_recording(path).notes.get("station", stations[0].name)}
    mine = [one for one in stations if one.name in names]
    if len(names) != 1 or not mine:
        known = ", ".join(one.name for one in stations)
        given = ", ".join(sorted(names))
        raise ValueError(f"{path} is of station {given}, must be one of: {known}")
    return mine[0]


def orbit_from_passes(
    data: str | Path | Sequence[str | Path],
    stations: Station | Sequence[Station],
    target: Target,
    *,
    manoeuvre: str | None = None,
    manoeuvre_t_s: float | None = None,
    predict_hours: float = 24.0,
    clock_s: float = 0.01,
    bias_mdeg: float | None = None,
    max_age_s: float = MAX_AGE_S,
    refraction_removed: bool = False,
    allow_damage: bool = False,
) -> DeterminedOrbit:
    """Return the orbit of a satellite from passes that stations have tracked.

    Parameters
    ----------
    data : files: rosbag2 recordings, CSV, CCSDS TDM, with angles and where there are any range and
        range rate.
    stations : the owners of the data; their bias models are taken off.
    target : the satellite by its old elements, which the orbit begins with.
    manoeuvre, manoeuvre_t_s : UTC time of a change of velocity, which is estimated.
    predict_hours : how far the ephemeris reaches beyond the last pass.
    clock_s : sigma of the stations' clocks.
    bias_mdeg : sigma of the angle biases that are left; by default 5 with a bias model, else a
        tenth of the beam.
    max_age_s : greatest age of the elements.
    refraction_removed : the angles of CSV and TDM are free of it.
    allow_damage : take the sound part of damaged recordings.

    Raises
    ------
    ValueError
        Data of another satellite or station, a wrong clock, a pass or elements that do not agree
        with the rest, too few points: with value and bound.

    Examples
    --------
    >>> orbit = rp.orbit_from_passes(["first.tdm", "second.tdm"], station, rp.elements("my.tle"))
    >>> print(orbit)
    """
    paths = [Path(data)] if isinstance(data, str | Path) else [Path(one) for one in data]
    own = [stations] if isinstance(stations, Station) else list(stations)
    manoeuvre_t_s = time_s("manoeuvre", manoeuvre, manoeuvre_t_s)
    elements = target.found
    if not isinstance(elements, Elements):
        raise ValueError(f"{elements.name} has no mean elements, which the orbit begins with")
    known: dict[str, Any] = {"elements": [elements], "max_age_s": max_age_s, "allow_damage": allow_damage}
    known["refraction"] = None if refraction_removed else "standard"
    owned = ((path, _station_of(path, own)) for path in paths)
    tracked = [(one, s) for path, s in owned for one in _read(DataFiles(paths=[path], **known), elements, s)]
    if not tracked:
        raise ValueError("files=[]: no pass, must be 1 or more")
    points, notes = [], []
    for one, station in tracked:
        air = None if refraction_removed else RadioRefraction.standard(station.site.altitude_m)
        measured, left_out = points_of(one, station.site, station.model, air)
        points.append(measured)
        notes += [f"{measured.station}: {left_out}"] if left_out else []
    if len(points) == 1:
        notes.append("one pass: 2 or more tell the period")
    # The first pass can be flown again: an antenna slews before it.
    first_s = math.floor(min(float(one.t_s[0]) for one in points)) - BEFORE_S
    last_s = math.floor(max(float(one.t_s[-1]) for one in points))
    refuse_leap_second(first_s, last_s + 3600.0 * predict_hours)
    prior = prior_of(elements, first_s, ElementUncertainty(), max_age_s)
    # A model leaves little, whatever the beam.
    left = [CALIBRATED_MDEG if any(one.model.coefficients.values()) else 100.0 * one.beamwidth_deg for one in own]
    bias_rad = MDEG * (max(left) if bias_mdeg is None else bias_mdeg)
    priors = Priors(clock_s=clock_s, azimuth_bias_rad=bias_rad, elevation_bias_rad=bias_rad)
    dynamics = Dynamics(forces=forces_of(elements, prior.states[0]), manoeuvre_t_s=manoeuvre_t_s)
    found = checked_orbit(prior, points, dynamics, priors)
    t_s = np.arange(first_s, last_s + 3600.0 * predict_hours + STEP_S, STEP_S)
    ephemeris = Ephemeris.of(found, t_s)
    # After a manoeuvre no elements can follow both sides of it.
    after = t_s >= (manoeuvre_t_s or -math.inf)
    places, air_factor = ephemeris.states[after, :3], float(found.values[0, 6])
    fresh, rms_m = mean_elements(elements, float(last_s), t_s[after], places, air_factor)
    return DeterminedOrbit(fresh, rms_m, ephemeris, found, tuple(notes), elements, manoeuvre_t_s)
