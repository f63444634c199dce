"""Passes of one target in degrees and UTC, the certificate of each, and where the target is."""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rf_pointing.api.target import Target
from rf_pointing.calibration import BiasModel
from rf_pointing.core import DAY_S, LEVEL, to_degrees, utc_text
from rf_pointing.ephemeris import ElementUncertainty, Pass, TopocentricTrack, stale_warning
from rf_pointing.ephemeris.source import SourceParams
from rf_pointing.planning import Branch, Certificate, certificate_lines, certificate_values
from rf_pointing.station.pointing.certificates import PlannedPass

if TYPE_CHECKING:
    from rf_pointing.api.station import Station


@dataclass(frozen=True, kw_only=True, eq=False)
class StationPass:
    """One pass over a station: times in UTC, apparent angles, azimuths continuous from the rise on.

    `rises_before` and `sets_after` tell that the pass runs on beyond the searched time, where it is
    cut off.  `window` has the same numbers in radians.
    """

    aos_utc: str
    tca_utc: str
    los_utc: str
    duration_s: float
    name: str
    peak_elevation_deg: float
    aos_azimuth_deg: float
    aos_elevation_deg: float
    los_azimuth_deg: float
    azimuth_min_deg: float
    azimuth_max_deg: float
    peak_azimuth_rate_deg_s: float
    peak_elevation_rate_deg_s: float
    peak_azimuth_acceleration_deg_s2: float
    smallest_range_m: float
    rises_before: bool
    sets_after: bool
    crosses_north: bool
    window: Pass = field(repr=False)
    target: Target = field(repr=False)
    station: "Station" = field(repr=False)
    searched_from_t_s: float = field(repr=False)

    @classmethod
    def of_window(cls, window: Pass, target: Target, station: "Station", searched_from_t_s: float) -> "StationPass":
        """Return the row of a pass that a search from a time on has found."""
        values = dataclasses.asdict(window)
        times: dict[str, Any] = {f"{name}_utc": utc_text(values.pop(f"{name}_t_s")) for name in ("aos", "tca", "los")}
        angles = dict(to_degrees(name, value) for name, value in values.items())
        return cls(
            **times, **angles, duration_s=window.duration_s, crosses_north=window.crosses_north, window=window,
            target=target, station=station, searched_from_t_s=searched_from_t_s,
        )  # fmt: skip

    @property
    def aos_t_s(self) -> float:
        """Acquisition of signal: the rise, UTC in s since 1970."""
        return self.window.aos_t_s

    @property
    def tca_t_s(self) -> float:
        """Time of the highest elevation, UTC in s since 1970."""
        return self.window.tca_t_s

    @property
    def los_t_s(self) -> float:
        """Loss of signal: the set, UTC in s since 1970."""
        return self.window.los_t_s

    def values(self) -> dict[str, Any]:
        """Return the row as names and plain values."""
        names = [item.name for item in dataclasses.fields(self) if item.repr]
        return {name: getattr(self, name) for name in names}

    @property
    def warning(self) -> str:
        """Error of stale elements at the closest approach, in beamwidths; "" for fresh ones."""
        track, beamwidth_rad = self.target.track(self.station.site), math.radians(self.station.beamwidth_deg)
        return stale_warning(track, self.tca_t_s, STALE_S, ElementUncertainty(), beamwidth_rad)


STALE_S = SourceParams().stale_days * DAY_S
"""Age from which elements are stale."""


@dataclass(frozen=True, eq=False)
class PassCertificate:
    """Requirements of a pass on the antenna: all ways to track it, and the one that is taken.

    `print(certificate)` shows the table of the branches.  `planned` has its parts in radians.
    """

    one: StationPass
    planned: PlannedPass = field(repr=False)

    @property
    def certificate(self) -> Certificate:
        """The certificate, in radians."""
        return self.planned.certificate

    @property
    def chosen(self) -> Branch | None:
        """The branch to track on, in radians; None when no branch works."""
        return self.certificate.chosen

    @property
    def accepted(self) -> bool:
        """Whether the pass can be tracked."""
        return self.chosen is not None

    @property
    def reason(self) -> str:
        """Why it cannot be tracked, with the numbers of the nearest branch; "" if it can."""
        return self.certificate.reason

    @property
    def lost_s(self) -> float | None:
        """Time below half power near the zenith, None when no branch works."""
        return self.chosen.lost_s if self.chosen else None

    @property
    def expected_loss_db(self) -> float | None:
        """Expected pointing loss of the mean power of the pass, None when no branch works."""
        return self.chosen.mean_loss_db if self.chosen else None

    @property
    def sun_angle_deg(self) -> float:
        """Smallest angle between target and Sun in the pass."""
        return math.degrees(float(self.planned.profile.sun_angle_rad().min()))

    def values(self) -> dict[str, Any]:
        """Return pass and certificate as names and plain values, angles in degrees."""
        mine = {**self.one.values(), "sun_angle_deg": self.sun_angle_deg}
        return {"pass": mine, **certificate_values(self.certificate)}

    def __str__(self) -> str:
        one, north = self.one, " through north" if self.one.crosses_north else ""
        return "\n".join([
            f"{one.name}: AOS {one.aos_utc}, TCA {one.tca_utc}, LOS {one.los_utc}, {one.duration_s:.0f} s",
            f"  peak {one.peak_elevation_deg:.2f} deg, azimuth {one.aos_azimuth_deg:.1f} to "
            f"{one.los_azimuth_deg:.1f} deg{north}, rates {one.peak_azimuth_rate_deg_s:.3g} "
            f"{one.peak_elevation_rate_deg_s:.3g} deg/s, Sun {self.sun_angle_deg:.1f} deg away",
            *certificate_lines(self.certificate),
        ])  # fmt: skip


def draw_certificates(certificates: Sequence[PassCertificate], station: "Station", path: str | Path) -> None:
    """Draw passes into a PNG: the sky, the azimuth within its travel, rates against limits."""
    # Matplotlib is loaded where a picture is wanted.
    from rf_pointing.report.plan_picture import draw_plan

    draw_plan([each.planned for each in certificates], station.rules.limits, station.rules.mask, Path(path))


@dataclass(frozen=True, kw_only=True)
class Look:
    """Apparent direction of a target (refraction and light time included), rates and range.

    `azimuth_correction_deg` and `elevation_correction_deg` are what the bias model adds so that the
    beam of the real mount points there.
    """

    t_s: float
    utc: str
    azimuth_deg: float
    elevation_deg: float
    azimuth_rate_deg_s: float
    elevation_rate_deg_s: float
    range_m: float
    azimuth_correction_deg: float
    elevation_correction_deg: float

    @classmethod
    def of(cls, track: TopocentricTrack, model: BiasModel, t_s: float) -> "Look":
        """Return the direction on a track at a time, UTC in s since 1970."""
        look = track.target_at(t_s)
        # The correction is one of axis angles, the lower axis under the name of azimuth.
        axes = (model.mount or LEVEL).of_axes(look)
        rows = np.degrees(np.array([*look.motion[:4], *model.offset_rad(*axes.motion)], dtype=np.float64)).tolist()
        azimuth, elevation, azimuth_rate, elevation_rate, azimuth_correction, elevation_correction = rows
        return cls(
            t_s=t_s, utc=utc_text(t_s), azimuth_deg=azimuth, elevation_deg=elevation, azimuth_rate_deg_s=azimuth_rate,
            elevation_rate_deg_s=elevation_rate, range_m=look.range_m,
            azimuth_correction_deg=azimuth_correction, elevation_correction_deg=elevation_correction,
        )  # fmt: skip
