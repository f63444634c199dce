"""Parameters of the watch on monopulse: what the right lock may show, and how sure a verdict must be."""

from dataclasses import dataclass

from rf_pointing.core import MDEG, Params, parameter
from rf_pointing.tracking.scan import ScanParams

__all__ = ["LockWatchParams"]

LARGEST_PROBE_BEAMWIDTHS = 0.1


@dataclass(frozen=True, kw_only=True)
class LockWatchParams(Params):
    """Weather and drift of the right lock, the probe of it, certainty of the verdicts, limits of steepness and level."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", low=1e-6, high=0.5)
    evidence: float = parameter(
        8.0, "logarithm of the likelihood ratio from which a lock is a false one", low=2.0, high=100.0
    )
    fade_s: float = parameter(30.0, "time in which evidence fades", low=0.1, high=3600.0)
    gust_rad: tuple[float, ...] = parameter(
        (0.1 * MDEG, 0.2 * MDEG, 0.4 * MDEG, 0.8 * MDEG),
        "strengths of gusts: motion of the beam in 1 s that the encoders do not see, rms per axis", low=1e-9, high=0.1,
    )  # fmt: skip
    vibration_rad: tuple[float, ...] = parameter(
        (0.0, 0.2 * MDEG, 0.6 * MDEG), "strengths of such motion from one cluster to the next", low=0.0, high=0.1
    )
    weather_s: float = parameter(10.0, "time for which gusts and vibration keep their strength", low=0.1, high=3600.0)
    drift_rad_s: float = parameter(
        0.5 * MDEG, "velocity of the target against the prediction, rms per axis", low=1e-9, high=0.1
    )
    drift_change_rad_s: tuple[float, ...] = parameter(
        (0.05 * MDEG, 4.0 * MDEG),
        "strengths of the change of that velocity in 1 s, rms: mostly the first, the others while lags of the mount settle",
        low=1e-9, high=0.1,
    )  # fmt: skip
    settling_share: float = parameter(0.01, "share of the time of each of those others", low=1e-6, high=0.5)
    probe_rad: float = parameter(
        0.0, "radius of the circle of the beam while monopulse tracks, 0: none", low=0.0, high=0.01
    )
    probe_period_s: float = parameter(1.0, "time of one turn of that circle", low=0.4, high=60.0)
    probe_ramp_s: float = parameter(1.0, "time over which its radius grows from zero", low=0.1, high=60.0)
    window_s: float = parameter(2.0, "time over which the steepness is measured", low=0.1, high=60.0)
    unmodelled_beamwidths: float = parameter(
        0.03, "motion of the beam that the encoders do not see, for the steepness", low=0.0, high=0.5
    )
    sigmas: float = parameter(4.0, "certainty of the steepness in standard deviations", low=1.0, high=10.0)
    steepest: float = parameter(2.0, "response above which it is a sidelobe", low=1.1, high=10.0)
    level_clusters: int = parameter(3, "clusters in a row for which it must be", low=1, high=100)
    level_drop_db: float = parameter(10.0, "C/N0 below the link's that is a sidelobe", low=3.0, high=30.0)

    def check_together(self) -> None:
        """Refuse a watch that knows no weather, and a probe that leaves the middle of the beam."""
        for name in ("gust_rad", "vibration_rad", "drift_change_rad_s"):
            if not getattr(self, name):
                raise ValueError(f"{name} has 0 strengths, must have at least 1")
        largest_rad = LARGEST_PROBE_BEAMWIDTHS * self.half_power_beamwidth_rad
        if self.probe_rad > largest_rad:
            raise ValueError(
                f"probe_rad={self.probe_rad} must be <= {largest_rad}, {LARGEST_PROBE_BEAMWIDTHS} half_power_beamwidth_rad"
            )

    @property
    def probe(self) -> ScanParams | None:
        """The circle to command while monopulse tracks, None for none."""
        if self.probe_rad == 0.0:
            return None
        return ScanParams(radius_rad=self.probe_rad, period_s=self.probe_period_s, ramp_s=self.probe_ramp_s)
