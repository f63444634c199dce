"""Parameters of the conscan tracker: beam, scan, window and what is believed."""

from dataclasses import dataclass
from itertools import pairwise

from rf_pointing.core import MDEG, Params, parameter
from rf_pointing.tracking.scan import ONCE_A_ROUND, LoopRate, Pattern, ScanParams

__all__ = ["ConscanParams"]


@dataclass(frozen=True, kw_only=True)
class ConscanParams(Params):
    """Beam, scan and window of the estimate."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", low=1e-6, high=0.5)
    radius_rad: float = parameter(5.93 * MDEG, "scan radius", low=1e-8, high=0.1)
    period_s: float = parameter(32.0, "time of one turn of the scan", low=0.1, high=3600.0)
    ramp_s: float = parameter(4.0, "time over which the radius grows from zero", low=0.0, high=600.0)
    estimator: str = parameter(
        "likelihood", "exact beam, or the paper's weighted least squares", choices=("likelihood", "linear")
    )
    window_samples: int = parameter(32, "carrier power samples of one estimate", low=4, high=10000)
    updates: str = parameter(
        "window", "one estimate per separate window, or one per sample (sliding)", choices=("window", "sample")
    )
    fewest_samples: int = parameter(32, "samples from which a sliding window gives estimates", low=4, high=10000)
    sample_s: float = parameter(1.0, "time between two carrier powers", low=1e-3, high=60.0)
    bandwidth_hz: float = parameter(
        0.05, "bandwidth of the loop on the estimates of a sliding window", low=0.0, high=5.0
    )
    drift: bool = parameter(False, "whether a steady change of the power is estimated along")
    unmodelled_rad: float = parameter(0.0, "motion of the beam that the encoders do not see, rms", low=0.0, high=0.01)
    max_age_s: float = parameter(120.0, "age at which samples leave the window", low=0.1, high=36000.0)
    delay_s: float = parameter(0.0, "time from the beam's position to the power it gives", low=-60.0, high=60.0)
    spin_periods_s: tuple[float, ...] = parameter(
        (), "periods of power modulation to take out, harmonics included", low=0.01, high=36000.0
    )
    valid_range_beamwidths: float = parameter(1.0, "largest error that is believed", low=0.05, high=2.0)
    lock_db_hz: float = parameter(15.0, "smallest C/N0 of a sample that is used", low=0.0, high=120.0)
    misfit_limit: float = parameter(
        6.0, "largest chi squared per degree of freedom of the power about the beam", low=1.5, high=1e6
    )

    def check_together(self) -> None:
        """Refuse a scan that leaves the beam, and windows that cannot be filled or solved."""
        if self.radius_rad > 0.5 * self.half_power_beamwidth_rad:
            raise ValueError(
                f"radius_rad={self.radius_rad} must be <= {0.5 * self.half_power_beamwidth_rad}, half of "
                "half_power_beamwidth_rad: the scan leaves the beam"
            )
        if self.spin_periods_s and self.estimator == "linear":
            raise ValueError(f"spin_periods_s={self.spin_periods_s} needs estimator=likelihood, not linear")
        ordered = sorted(self.spin_periods_s)
        if any(later < 1.01 * earlier for earlier, later in pairwise(ordered)):
            raise ValueError(f"spin_periods_s={self.spin_periods_s} must differ by at least 1 %")
        if self.drift and self.estimator == "linear":
            raise ValueError("drift=True needs estimator=likelihood, not linear")
        unknowns = 3 + self.drift + 2 * len(self.spin_periods_s)
        for name in ("window_samples", "fewest_samples"):
            if getattr(self, name) <= unknowns:
                raise ValueError(f"{name}={getattr(self, name)} must be > {unknowns}, the number of unknowns")

    @property
    def age_s(self) -> float:
        """How long before the newest sample those of a full window lie on average."""
        return 0.5 * self.window_samples * self.sample_s

    @property
    def loop(self) -> LoopRate:
        """How the tracking loop follows the estimates."""
        return LoopRate(self.bandwidth_hz) if self.updates == "sample" else ONCE_A_ROUND

    def pattern(self) -> Pattern:
        """Return the motion of the beam."""
        return self.scan.pattern()

    @property
    def scan(self) -> ScanParams:
        """The circle to command."""
        return ScanParams(radius_rad=self.radius_rad, period_s=self.period_s, ramp_s=self.ramp_s)
